"""What a file holds, before it is a record: series, and what the file and the user say of them.

What was understood of a file: a table of fact and whence, and notes on what was left out.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.headers import parse_header
from damping.records.text import describe_shortened

Samples: TypeAlias = npt.NDArray[Any]  #: real or complex numbers


@dataclass(frozen=True)
class FileFacts:
    """What a file says of a series; None where it says nothing."""

    response: str | None = None  #: a name of ``RESPONSES``
    per_force: bool | None = None  #: whether it is a ratio to force
    scaling: str | None = None  #: a name of ``SCALINGS``
    force_scaling: str | None = None  #: that of the force where it has its own
    turn: bool = False  #: whether the phase leads or lags is told by its turn alone
    units: Mapping[str, str] = field(default_factory=dict)  #: texts by ``force``, ``response``, ``energy`` and ``mass``
    angles: Mapping[str, str] = field(default_factory=dict)  #: roles whose header says ``degrees`` or ``radians``


@dataclass(frozen=True)
class Series:
    """One sweep or one time history, as a file has it."""

    label: str
    abscissa: FloatArray  #: in Hz, of a time history in s
    response: Samples  #: (n,), complex with the sign of exp(i omega t) where the phase is known, else the amplitude
    force: Samples | None = None  #: (n,) likewise, None where the file has none
    is_time: bool = False
    has_phase: bool = True  #: whether the phase is known
    extra: Mapping[str, FloatArray] = field(default_factory=dict)  #: further columns of a record by name
    facts: FileFacts = FileFacts()


@dataclass(frozen=True)
class Stated:
    """What the user says of a file."""

    format: str = "auto"  #: ``auto``, ``uff``, ``mat``, ``hdf5``, ``tdms``, ``lvm``, ``csv`` or ``lock-in``
    columns: Mapping[str, str] = field(default_factory=dict)  #: name of the column or array of each role (``ROLES``)
    response: str | None = None  #: a name of ``RESPONSES``
    scaling: str | None = None  #: a name of ``SCALINGS``
    force_scaling: str | None = None  #: that of the force where it is another
    units: Mapping[str, str] = field(default_factory=dict)  #: of ``force``, ``response``, ``energy``, ``mass`` as text
    consistent: bool = False  #: all values are of one system of units
    scale: Mapping[str, float] = field(default_factory=dict)  #: sensitivities of ``force`` and ``response``
    system: str = "si"  #: ``si`` or ``us``: the units of the record
    forces: tuple[float, ...] = ()  #: force amplitude of every sweep, or one for all; in the unit of force
    labels: tuple[str, ...] = ()  #: of every sweep
    datasets: tuple[int, ...] = ()  #: numbers (from 1) of the data sets to take; empty: all
    band: tuple[float, float] | None = None  #: lowest and highest frequency to take, Hz
    reverse: bool = False  #: turn the sign of the response (a sensor mounted against the force)
    delimiter: str = "auto"  #: of a CSV file: ``comma``, ``semicolon``, ``tab``, ``space``; ``auto``: as its lines show
    skip: int = 0  #: lines before the header of a CSV file
    decimal: str = "auto"  #: mark in its numbers: ``point``, ``comma`` or ``auto``


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


#: Names of a column beside x and y that make them readings of an amplifier.
_MODULI = {"r", "mag", "magnitude", "theta"}
_MOTIONS = ("response", "x", "y", "amplitude")


def require_response(of_role: Mapping[str, str], names: Iterable[str], stated: Stated) -> None:
    """InputError where no column is the response, or a real one would be half of a complex one that nobody said."""
    own = {parse_header(name.strip()).name.lower() for name in names}
    if not set(_MOTIONS) & set(of_role):
        free = [name.strip() for name in names if name.strip() and name not in of_role.values()]
        unit_too = "" if any(parse_header(name).unit for name in free) else " --unit response=UNIT"
        expected = f"--column response=NAME (of a complex one x=NAME, y=NAME){unit_too}; damping campaign for all"
        raise InputError(f"which column is the response? {describe_shortened(', '.join(free), 80)}", expected=expected)
    halves = {role: of_role.get(role, "") for role in ("x", "y")}
    guessed = not set(halves) & set(stated.columns) and parse_header(halves["x"]).name.lower() == "x"
    if guessed and not own & _MODULI:
        expected = "--column x=x --column y=y for parts, --column amplitude=x for a motion"
        raise InputError("are x and y the parts of one complex response, or two motions?", expected=expected)
