"""Files of laboratories to records: UFF data set 58, MAT, HDF5, CSV with a column map, lock-in columns.

Bytes or a path in, a record and a summary of what was understood out. Every module is pure; none evaluates anything
or loads a pickle. The way is: ``reading.read_file`` turns any file into ``Series`` (one sweep or one time history each,
as the file has it, with what the file says of units and kind), ``steady.steady_record`` turns sweeps into a record,
``conversion.time_histories`` turns time histories into displacement for ``signals.ringdown``. What neither the file nor
the user says is asked for in an error; nothing is guessed.

Here: series, what the file and the user say of them, roles of columns, and what was understood of a file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.headers import ABSCISSAS, parse_header
from damping.records.record import Record
from damping.records.text import describe_shortened

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
class FileFacts:
    """What a file says of a series; None where it says nothing.

    ``response`` is a name of ``RESPONSES``, ``per_force`` whether it is a ratio to force, ``scaling`` a name of
    ``SCALINGS`` (``force_scaling`` of the force where it has its own), ``units`` are texts by ``force``,
    ``response``, ``energy`` and ``mass``; ``turn``: whether the phase leads or lags is told by its turn alone;
    ``degrees``: roles whose header says degrees.
    """

    response: str | None = None
    per_force: bool | None = None
    scaling: str | None = None
    force_scaling: str | None = None
    turn: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    degrees: Sequence[str] = ()


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
    facts: FileFacts = FileFacts()


@dataclass(frozen=True)
class Stated:
    """What the user says of a file.

    Attributes:
        format: ``auto``, ``uff``, ``mat``, ``hdf5``, ``tdms``, ``lvm``, ``csv`` or ``lock-in``.
        columns: name of the column or array of each role (``ROLES``).
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


#: Roles of arrays and columns. Each says its meaning, so that none has to be guessed.
ROLES: dict[str, str] = {
    "sweep": "label of the sweep of each row",
    "frequency": "forcing frequency, Hz",
    "omega": "forcing frequency, rad/s",
    "time": "time of a time history, s",
    "response": "complex response, or the signal of a time history",
    "x": "real part of the response, or in-phase reading of a lock-in amplifier",
    "y": "imaginary part of the response, or quadrature reading",
    "amplitude": "amplitude of the response",
    "phase": "lag of the response behind the force, rad",
    "lag_deg": "lag of the response behind the force, degrees",
    "lead": "lead of the response before the force or the reference, rad",
    "lead_deg": "the same in degrees",
    "angle": "angle between response and force, degrees or rad; whether it leads or lags is told by its turn",
    "force": "amplitude of the force, or complex force",
    "force_x": "real part or in-phase reading of the force",
    "force_y": "imaginary part or quadrature reading of the force",
    "force_lead_deg": "lead of the force before the reference, degrees",
    "energy": "energy per cycle",
    "mass": "generalized mass",
    "amplitude_sd": "standard uncertainty of the amplitude",
    "phase_sd": "standard uncertainty of the phase, rad",
    "force_sd": "standard uncertainty of the force",
}


#: Names of columns and arrays by role where no map is stated: the role itself, and the parts of a complex number.
OWN_NAMES: dict[str, tuple[str, ...]] = {role: (role,) for role in ROLES} | {
    "x": ("x", "real", "re"),
    "y": ("y", "imag", "im"),
}


#: What the unit in the header of a role's column belongs to.
UNIT_OF = (
    dict.fromkeys(("force", "force_x", "force_y"), "force")
    | dict.fromkeys(("response", "x", "y", "amplitude"), "response")
    | {role: role for role in ("energy", "mass", *ABSCISSAS)}
)


#: Names of a column beside x and y that make them readings of an amplifier.
_MODULI = {"r", "mag", "magnitude", "theta"}


_MOTIONS = ("response", "x", "y", "amplitude")


def require_response(of_role: Mapping[str, str], names: Iterable[str], stated: Stated) -> None:
    """InputError where no column is the response, or a real one would be half of a complex one that nobody said."""
    own = {parse_header(name.strip()).name.lower() for name in names}
    if not set(_MOTIONS) & set(of_role):
        free = [name.strip() for name in names if name.strip() and name not in of_role.values()]
        unit_too = "" if any(parse_header(name).unit for name in free) else " --unit response=UNIT"
        raise InputError(
            f"which column is the response? {describe_shortened(', '.join(free), 80)}",
            expected=f"--column response=NAME (of a complex one x=NAME, y=NAME){unit_too}; damping campaign for all",
        )
    halves = {role: of_role.get(role, "") for role in ("x", "y")}
    guessed = not set(halves) & set(stated.columns) and parse_header(halves["x"]).name.lower() == "x"
    if guessed and not own & _MODULI:
        raise InputError(
            "are x and y the parts of one complex response, or two motions?",
            expected="--column x=x --column y=y for parts, --column amplitude=x for a motion",
        )


def list_units(of_roles: Mapping[str, str], stated: Stated) -> dict[str, str]:
    """The first unit of each quantity that the columns or arrays of some roles name; of an abscissa the stated one."""
    units = {role: text for role, text in stated.units.items() if role in ABSCISSAS}
    for role, text in of_roles.items():
        if role in UNIT_OF:
            units.setdefault(UNIT_OF[role], text)
    return units
