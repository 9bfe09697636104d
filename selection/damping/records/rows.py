"""The rows of a record by sweep, as ranking and diagnosis both read them; their order, direction and sweep rate."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray, IntArray
from damping.records.record import Record


@dataclass(frozen=True)
class SweepRows:
    """Measured steady states, one entry for each; arrays of shape (rows,), those named in ``PER_SWEEP`` (sweeps,)."""

    omega: FloatArray  #: rad/s
    sweep: IntArray  #: index of the row's sweep into ``sweeps``
    sweeps: tuple[str, ...]  #: labels
    sd_amplitude: FloatArray  #: relative standard uncertainty; 0 where the record states none, as for the others
    sd_force: FloatArray  #: likewise
    sd_phase: FloatArray  #: rad
    PER_SWEEP: ClassVar[tuple[str, ...]] = ()

    def __len__(self) -> int:
        return len(self.omega)

    @cached_property
    def runs(self) -> list[IntArray]:
        """Indices of the rows of each sweep."""
        return [np.flatnonzero(self.sweep == number) for number in range(len(self.sweeps))]

    def take_rows(self, chosen: BoolArray | IntArray, **changed: FloatArray) -> Self:
        """Rows that are marked, or at indices, which may repeat; with some fields ``changed``."""
        held = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in self.PER_SWEEP}
        taken: dict[str, Any] = {name: of[chosen] for name, of in held.items() if isinstance(of, np.ndarray)}
        return replace(self, **(taken | changed))

    def take_sweeps(self, chosen: BoolArray | IntArray) -> Self:
        """Sweeps that are marked, or at indices, in that order; the order of rows within each is kept."""
        places = np.arange(len(self.sweeps))[chosen]
        runs, sweeps = [self.runs[place] for place in places], tuple(self.sweeps[place] for place in places)
        known = {name: values[places] for name in self.PER_SWEEP if (values := getattr(self, name)) is not None}
        number = np.repeat(np.arange(len(places)), list(map(len, runs)))
        return replace(self.take_rows(np.concatenate(runs)), sweep=number, sweeps=sweeps, **known)

    def where(self, keep: BoolArray) -> Self:
        """The rows marked in ``keep``; sweeps without rows are dropped and the others renumbered."""
        rows = self.take_rows(keep)
        return rows.take_sweeps(np.unique(rows.sweep))


def read_sweep_rows(record: Record) -> SweepRows:
    """The rows of a record, in its order; sweeps by their first row."""
    return SweepRows(
        omega=RAD_S_PER_HZ * record.column("frequency"),
        sweep=pd.factorize(record.frame["sweep"])[0],
        sweeps=record.sweeps,
        sd_amplitude=record.relative_sd("amplitude"),
        sd_force=record.relative_sd("force"),
        sd_phase=record.column("phase_sd", 0.0),
    )


def order_taken(record: Record) -> FloatArray:
    """Time of each row, -1/2 to 1/2 over the record; the order of the rows where no time is given."""
    time = np.arange(len(record), dtype=float)
    if "time" in record.frame.columns and np.isfinite(record.column("time")).all():
        time = record.column("time")
    span = float(np.ptp(time))
    return np.asarray((time - time.min()) / span - 0.5) if span > 0.0 else np.zeros(len(record))


def find_direction(record: Record) -> FloatArray:
    """1 in sweeps whose frequency rises in the order measured, -1 where it falls, (n,)."""
    time, frequency, up = order_taken(record), record.column("frequency"), np.ones(len(record))
    for rows in record.frame.groupby("sweep", sort=False).indices.values():
        t, f = time[rows], frequency[rows]
        up[rows] = np.sign(np.sum((t - t.mean()) * (f - f.mean()))) or 1.0
    return up


def list_rates(record: Record, rate: float | None) -> FloatArray:
    """df/dt of each row, Hz/s, (n,): that stated in the row, else of the rig, else of the sweep's other rows; else 0.

    A ``rate`` of the rig above 0 is a speed: df/dt is below 0 in sweeps whose frequency falls. One below 0 is df/dt.
    """
    stated, time = record.column("sweep_rate", np.nan), order_taken(record)
    if rate is not None:
        return np.where(np.isfinite(stated), stated, rate * find_direction(record) if rate > 0.0 else rate)
    rates = np.nan_to_num(stated)
    for rows in map(np.asarray, record.frame.groupby("sweep", sort=False).indices.values()):
        known = np.isfinite(stated[rows])
        if known.any():
            order = rows[known][np.argsort(time[rows[known]], kind="stable")]
            rates[rows[~known]] = np.interp(time[rows[~known]], time[order], stated[order])
    return rates
