"""What of a record bears on resonant amplitudes: rows near resonance, free of a constant phase offset."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from selection.arrays import BoolArray, FloatArray
from selection.posterior.observations import Observations, observe
from selection.records.record import Record
from selection.records.resonance import resonances

#: Rows with |cot phase| up to this are near: those between the half-power points of their sweep.
NEAR = 1.0


def near_resonance(record: Record) -> Observations:
    """Observations of the rows near resonance.

    A constant phase offset rotates the energy of a row by offset times cot(phase), relative: what
    :func:`selection.records.resonance.resonances` finds of it is taken off first (not where the record has energies of
    its own). Then rows between the half-power points stay, |F cos(phase)| <= ``NEAR`` F sin(phase): beyond them the
    measured energy is mostly error of phase. A sweep without any keeps the row nearest to resonance.

    Raises:
        AnalysisError: no row says anything about damping.
    """
    data = observe(without_offset(record))
    return _rows(data, _near(data))


def without_offset(record: Record) -> Record:
    """The record with each sweep's phase offset taken off its phases; as it is where energies were recorded."""
    if not record.has_phase or "energy" in record.table.columns:
        return record
    offset = resonances(record).set_index("sweep")["phase_offset"]
    table = record.table.copy()
    table["phase"] = table["phase"] - table["sweep"].astype(str).map(offset)
    return Record(table, record.source)


def at_resonance(data: Observations) -> Observations:
    """One row a sweep: its phase resonance, with the mean uncertainties of the sweep's rows."""
    number = len(data.sweeps)

    def mean(values: FloatArray) -> FloatArray:
        return np.sqrt(np.bincount(data.sweep, values**2, number) / data.rows_per_sweep)

    return replace(
        data,
        A=data.tested_amplitude,
        omega=data.tested_omega,
        D=data.tested_force,
        R=np.zeros(number),
        sweep=np.arange(number),
        sd_amplitude=mean(data.sd_amplitude),
        sd_force=mean(data.sd_force),
        sd_phase=mean(data.sd_phase),
    )


def _near(data: Observations) -> BoolArray:
    """Which rows are near resonance, (rows,)."""
    cotangent = np.where(data.D > 0.0, data.R / np.where(data.D > 0.0, data.D, 1.0), np.inf)
    near = cotangent <= NEAR
    for sweep in range(len(data.sweeps)):
        rows = np.flatnonzero(data.sweep == sweep)
        near[rows[np.argmin(cotangent[rows])]] = True
    return np.asarray(near)


def _rows(data: Observations, keep: BoolArray) -> Observations:
    """The rows marked in ``keep``."""
    names = ("A", "omega", "D", "R", "sweep", "sd_amplitude", "sd_force", "sd_phase")
    return replace(data, **{name: getattr(data, name)[keep] for name in names})
