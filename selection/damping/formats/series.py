"""What a file holds, before it is a record: series with what the file says of them, and what the user stated.

What was understood of a file: a table of fact and whence, and notes on what was left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.records.record import Record

#: Response types: order of the time derivative of displacement, and whether the response is per unit of force.
RESPONSES: dict[str, tuple[int, bool]] = {
    "receptance": (0, True),
    "mobility": (1, True),
    "accelerance": (2, True),
    "displacement": (0, False),
    "velocity": (1, False),
    "acceleration": (2, False),
}
#: What an amplitude may be, and its size in amplitudes of the sine.
SCALINGS: dict[str, float] = {"peak": 1.0, "rms": 2.0**0.5, "peak-to-peak": 0.5}

#: Real or complex numbers.
Samples: TypeAlias = npt.NDArray[Any]


@dataclass(frozen=True)
class Found:
    """What a file says of a series; None where it says nothing.

    ``response`` is a name of ``RESPONSES``, ``per_force`` whether it is a ratio to force, ``scaling`` a name of
    ``SCALINGS`` (``force_scaling`` of the force where it has its own), ``units`` are texts by ``force``,
    ``response``, ``energy`` and ``mass``; ``turn``: whether the phase leads or lags is told by its turn alone.
    """

    response: str | None = None
    per_force: bool | None = None
    scaling: str | None = None
    force_scaling: str | None = None
    turn: bool = False
    units: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Series:
    """One sweep (``abscissa`` in Hz) or one time history (``is_time``, in s), as a file has it.

    ``response`` (n,) is complex with the sign of exp(i omega t) where the phase is known (``has_phase``), else the
    amplitude; ``force`` (n,) likewise, None where the file has none. ``extra`` are further columns of a record by
    name.
    """

    label: str
    abscissa: FloatArray
    response: Samples
    force: Samples | None = None
    is_time: bool = False
    has_phase: bool = True
    extra: Mapping[str, FloatArray] = field(default_factory=dict)
    found: Found = Found()


@dataclass(frozen=True)
class Stated:
    """What the user says of a file.

    Attributes:
        format: ``auto``, ``uff``, ``mat``, ``hdf5``, ``tdms``, ``lvm``, ``csv`` or ``lock-in``.
        columns: name of the column or array of each role (``named.ROLES``).
        response: a name of ``RESPONSES``, or None.
        scaling: a name of ``SCALINGS``, or None; force_scaling: that of the force where it is another.
        units: unit of ``force``, ``response``, ``energy``, ``mass`` as text; ``consistent``: all are of one system.
        scale: factors that turn values of ``force`` and ``response`` into their units (sensitivities).
        system: ``si`` or ``us``: the units of the record.
        forces: force amplitude of every sweep, or one for all; in the unit of force.
        labels: label of every sweep.
        datasets: numbers (from 1) of the data sets to take; empty: all.
        band: lowest and highest frequency to take, Hz.
        reverse: turn the sign of the response (a sensor mounted against the force).
        delimiter: of a CSV file: ``comma``, ``semicolon``, ``tab``, ``space``, or ``auto``: as its lines show.
        skip: lines before the header of a CSV file. decimal: ``point``, ``comma`` or ``auto``: mark in its numbers.
    """

    format: str = "auto"
    columns: Mapping[str, str] = field(default_factory=dict)
    response: str | None = None
    scaling: str | None = None
    force_scaling: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    consistent: bool = False
    scale: Mapping[str, float] = field(default_factory=dict)
    system: str = "si"
    forces: tuple[float, ...] = ()
    labels: tuple[str, ...] = ()
    datasets: tuple[int, ...] = ()
    band: tuple[float, float] | None = None
    reverse: bool = False
    delimiter: str = "auto"
    skip: int = 0
    decimal: str = "auto"


@dataclass
class Summary:
    """Rows (what, understood, whence) in the order they became known, and notes; grows while a file is read."""

    rows: list[tuple[str, str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, what: str, understood: str, whence: str) -> None:
        """A fact: ``whence`` is ``stated``, ``found in the file``, ``of the format`` or ``follows``."""
        if (what, understood, whence) not in self.rows:
            self.rows.append((what, understood, whence))

    def note(self, text: str) -> None:
        """A remark, once."""
        if text not in self.notes:
            self.notes.append(text)

    @property
    def table(self) -> pd.DataFrame:
        """The rows as a table."""
        return pd.DataFrame(self.rows, columns=["what", "understood", "whence"])


@dataclass(frozen=True)
class Imported:
    """A record and what was understood on the way."""

    record: Record
    summary: Summary
