"""What a file holds, before it is a record: series, what the file and the user say of them, and its angles in rad.

What was understood of a file: a table of fact and whence, and notes on what was left out.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import pi
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.headers import PHASES, parse_header
from damping.records.text import describe_shortened

Samples: TypeAlias = npt.NDArray[Any]  #: real or complex numbers
#: Sweeps that a file may hold beside each other.
MOST_SWEEPS = 1000


@dataclass(frozen=True)
class FileFacts:
    """What a file says of a series; None where it says nothing."""

    response: str | None = None  #: a name of ``RESPONSES``
    per_force: bool | None = None  #: whether it is a ratio to force
    scaling: str | None = None  #: a name of ``SCALINGS``
    force_scaling: str | None = None  #: that of the force where it has its own
    peak_assumed: bool = False  #: whether the scaling is that of most tables, and neither a header's nor a role's
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


def require_finite(name: str, values: Samples) -> None:
    """InputError for values (n,) that are no numbers, with the first of them."""
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        where = f"the first in row {bad[0] + 1} of {len(values)}"
        raise InputError(f"{name!r} holds values that are no numbers, {where}", expected="finite numbers")


#: Names of a column beside x and y that make them readings of an amplifier.
_MODULI = {"r", "mag", "magnitude", "theta"}
_MOTIONS = ("response", "x", "y", "amplitude")


def require_response(of_role: Mapping[str, str], names: Iterable[str], stated: Stated, *, many: bool) -> None:
    """InputError where no column is the response, or a real one would be half of a complex one that nobody said.

    ``many``: ``damping campaign`` reads all responses of such a file.
    """
    own = {parse_header(name.strip()).name.lower() for name in names}
    if not set(_MOTIONS) & set(of_role):
        free = [name.strip() for name in names if name.strip() and name not in of_role.values()]
        unit_too = "" if any(parse_header(name).unit for name in free) else " --unit response=UNIT"
        every = "; damping campaign for all" if many else ""
        expected = f"--column response=NAME (of a complex one x=NAME, y=NAME){unit_too}{every}"
        raise InputError(f"which column is the response? {describe_shortened(', '.join(free), 80)}", expected=expected)
    halves = {role: of_role.get(role, "") for role in ("x", "y")}
    guessed = not set(halves) & set(stated.columns) and parse_header(halves["x"]).name.lower() == "x"
    if guessed and not own & _MODULI:
        expected = "--column x=x --column y=y for parts, --column amplitude=x for a motion"
        raise InputError("are x and y the parts of one complex response, or two motions?", expected=expected)


#: An angle within 2 pi that turns by more is one in rad: a resonance turns it by pi, some degrees are none.
_TURN_IN_RADIANS = 1.5


def convert_angles(arrays: Mapping[str, Samples], facts: FileFacts, summary: Summary) -> dict[str, Samples]:
    """Angles in rad: those whose header says degrees, and an angle of unknown sense that is too large for rad.

    An uncertainty whose header says nothing is in the unit of its phase, and a phase without a number is none. Roles
    that end with ``_deg`` keep their degrees. InputError: an angle said to be in rad that is too large for it, or in
    degrees that turns as rad do.
    """
    turned, of_phase = dict(arrays), ""
    for role in PHASES:
        if role not in turned or np.iscomplexobj(turned[role]):
            continue
        values = np.asarray(turned[role], dtype=np.float64)
        if not np.isfinite(values).any():
            turned.pop("phase_sd", None)
            del turned[role]
            summary.note(f"the {role} holds no number: no phases are taken")
            continue
        of_phase = _tell_unit(role, values, facts.angles.get(role, ""))
        if of_phase == "degrees" and not role.endswith("_deg"):
            turned[role] = values * (pi / 180.0)
        if role == "angle":
            whence = "found in the file" if role in facts.angles else "follows from its size"
            summary.add("unit of angle", of_phase, whence)
    if "phase_sd" in turned:
        degrees = (facts.angles.get("phase_sd") or of_phase) == "degrees"
        if degrees:
            turned["phase_sd"] = turned["phase_sd"] * (pi / 180.0)
        whence = "found in the file" if "phase_sd" in facts.angles else "that of the phase"
        summary.add("unit of phase_sd", "degrees" if degrees else "rad", whence)
    return turned


def _tell_unit(role: str, values: Samples, said: str) -> str:
    """``degrees`` or ``rad``; ``said`` by its header. InputError where its size or turn is another's."""
    known = values[np.isfinite(values)]
    size = float(np.max(np.abs(known)))
    large = size > 2.0 * pi
    degrees = said == "degrees" or role.endswith("_deg")
    if (role in ("phase", "lead") or said == "radians") and large and not degrees:
        other = "lead_deg" if role == "lead" else "lag_deg"
        expected = f"at most 2 pi, or --column {other}=NAME for degrees"
        raise InputError(f"{role} in rad up to {size:.4g}", expected=expected)
    if degrees and not large and np.ptp(known) > _TURN_IN_RADIANS:
        message = f"{role} in degrees runs from {known.min():.3g} to {known.max():.3g}"
        raise InputError(message, expected="degrees, or --column phase=NAME (lag) or lead=NAME for rad")
    return "degrees" if degrees or large else "rad"
