"""Contents of a file before it is a record: series, facts from the file and from the user, and angles in rad.

The summary of a file is a table of facts with their origin, and notes on what was left out.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from math import pi
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.headers import NAMES, PHASES, ROLE_NAMES, ColumnHeader, parse_header
from damping.formats.quantity import find_powers
from damping.records.keys import LARGEST
from damping.records.text import describe_shortened

Samples: TypeAlias = npt.NDArray[Any]  #: real or complex numbers
MOST_SWEEPS = 1000  #: most sweeps side by side in a file


@dataclass(frozen=True)
class FileFacts:
    """Facts on a series stated in a file; None if not stated."""

    response: str | None = None  #: a name of ``RESPONSES``
    per_force: bool | None = None  #: whether it is a ratio to force
    scaling: str | None = None  #: a name of ``SCALINGS``
    force_scaling: str | None = None  #: scaling of the force, if separate
    #: Of ``response`` and ``force`` those of which neither a header nor a role says that they are peak values.
    peak_assumed: Collection[str] = ()
    turn: bool = False  #: whether only the turn of the phase shows if it leads or lags
    units: Mapping[str, str] = field(default_factory=dict)  #: texts by quantity (``named.UNIT_OF``)
    angles: Mapping[str, str] = field(default_factory=dict)  #: ``degrees`` or ``radians`` by role, from headers
    largest_angle: float = 0.0  #: of all phases of the table, where the unit of this one is told by them; else 0
    remarks: tuple[str, ...] = ()  #: that may name the excitation: ID lines, lines above a table, headers


@dataclass(frozen=True)
class Series:
    """One sweep or one time history, in the units of the file."""

    label: str
    abscissa: FloatArray  #: in Hz, for a time history in s
    response: Samples  #: (n,), complex with the sign of exp(i omega t) if the phase is known, else the amplitude
    force: Samples | None = None  #: (n,), complex or amplitude as the response; None if the file has none
    is_time: bool = False
    has_phase: bool = True  #: whether the phase is known
    extra: Mapping[str, FloatArray] = field(default_factory=dict)  #: further columns of a record by name
    facts: FileFacts = FileFacts()
    is_part: bool = False  #: whether only frequency and force tell it from other sweeps of a table


@dataclass(frozen=True)
class Stated:
    """Statements of the user on a file."""

    format: str = "auto"  #: a name of ``FORMATS``
    columns: Mapping[str, str] = field(default_factory=dict)  #: name of the column or array of each role (``ROLES``)
    response: str | None = None  #: a name of ``RESPONSES``
    scaling: str | None = None  #: a name of ``SCALINGS``
    force_scaling: str | None = None  #: scaling of the force, if different
    units: Mapping[str, str] = field(default_factory=dict)  #: of ``force``, ``response``, ``energy``, ``mass`` as text
    consistent: bool = False  #: all values are in one consistent system of units
    scale: Mapping[str, float] = field(default_factory=dict)  #: sensitivities of ``force`` and ``response``
    system: str = "si"  #: ``si`` or ``us``: the units of the record
    forces: tuple[float, ...] = ()  #: force amplitude of every sweep, or one for all; in the unit of force
    labels: tuple[str, ...] = ()  #: of every sweep
    datasets: tuple[int, ...] = ()  #: numbers (from 1) of the data sets to take; empty: all
    band: tuple[float, float] | None = None  #: lowest and highest frequency to take, Hz
    reverse: bool = False  #: reverse the sign of the response (a sensor mounted against the force)
    delimiter: str = "auto"  #: of a CSV file: ``comma``, ``semicolon``, ``tab``, ``space``; ``auto``: from its lines
    skip: int = 0  #: lines before the header of a CSV file
    rate: float | None = None  #: sampling rate of a signal, Hz
    span: tuple[float, float] | None = None  #: first and last time to take, s; more may be read
    decimal: str = "auto"  #: mark in its numbers: ``point``, ``comma`` or ``auto``


@dataclass
class Summary:
    """Rows (what, understood, source) in the order of reading, and notes; filled while a file is read."""

    rows: list[tuple[str, str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def add(self, what: str, understood: str, source: str) -> None:
        """Add a fact once; ``source``: ``stated``, ``found in the file``, ``of the format`` or ``follows``."""
        if (what, understood, source) not in self.rows:
            self.rows.append((what, understood, source))

    def note(self, text: str) -> None:
        """Add a remark once."""
        if text not in self.notes:
            self.notes.append(text)

    def extend(self, other: "Summary") -> None:
        """Add the rows and notes of another."""
        self.rows += other.rows
        self.notes += other.notes

    @property
    def table(self) -> pd.DataFrame:
        """The rows as a table."""
        return pd.DataFrame(self.rows, columns=["what", "understood", "source"])


def require_finite(name: str, values: Samples) -> None:
    """Raise InputError for values (n,) that are not finite, or too large to be squared; it names the first."""
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST))
    if len(bad):
        what = f"beyond {LARGEST:g}" if np.isfinite(values[bad[0]]) else "that are no numbers"
        where = f"the first in row {bad[0] + 1} of {len(values)}"
        raise InputError(f"{name!r} holds values {what}, {where}", expected="finite numbers")


#: Names of columns beside x and y which show that these are readings of an amplifier.
_MODULI = {"r", "mag", "magnitude", "theta"}
_RESPONSES = ("response", "x", "amplitude")  # roles; a y belongs to its x


def require_response(of_role: Mapping[str, str], names: Iterable[str], stated: Stated, *, many: bool) -> None:
    """Raise InputError if no column is the response, or if x and y may be two motions instead of complex parts.

    ``many``: ``damping campaign`` reads all responses of such a file.
    """
    in_table = {parse_header(name.strip()).name.lower() for name in names}
    if not set(_RESPONSES) & set(of_role):
        others = {name for role, name in of_role.items() if role != "y"}
        free = [name.strip() for name in names if name.strip() and name not in others]
        unit_too = "" if any(parse_header(name).unit for name in free) else " --unit response=UNIT"
        words = {word for name in free for word in re.findall(r"[^\W_]+", name.lower())}
        many |= bool(words & {*NAMES["part"]["angle"], *NAMES["part"]["y"]})  # phases or parts of several sensors
        all_hint = "; damping campaign for all" if many else ""
        of_time = "time" in of_role and not {"frequency", "omega"} & set(of_role)
        kinds = "" if of_time else " of complex values (its parts x=NAME, y=NAME), else amplitude=NAME"
        expected = f"--column response=NAME{kinds}{unit_too}{all_hint}"
        raise InputError(f"which column is the response? {describe_shortened(', '.join(free), 80)}", expected=expected)
    halves = {role: of_role.get(role, "") for role in ("x", "y")}
    guessed = not set(halves) & set(stated.columns) and parse_header(halves["x"]).name.lower() == "x"
    if guessed and not in_table & _MODULI:
        expected = "--column x=x --column y=y for parts, --column amplitude=x for a motion"
        raise InputError("are x and y the parts of one complex response, or two motions?", expected=expected)


def require_no_force(headers: Iterable[ColumnHeader]) -> None:
    """Raise InputError if a column without a role may be the force, by its unit or a word of its name."""
    known = {name for name in ROLE_NAMES["force"] if len(name) > 1}
    doubtful = [
        header.text
        for header in headers
        if not header.angle and (find_powers(header.unit) == (1, 0, 0) or known & {*header.name.lower().split()})
    ]
    if doubtful:
        expected = "--column force=NAME (--unit force=UNIT), or --force AMPLITUDE of each sweep"
        raise InputError(f"which column is the force? {describe_shortened(', '.join(doubtful), 80)}", expected=expected)


#: Range above which an angle within 2 pi is in rad: a resonance turns it by pi; a few degrees are no resonance.
_TURN_IN_RADIANS = 1.5


def convert_angles(arrays: Mapping[str, Samples], facts: FileFacts, summary: Summary) -> dict[str, Samples]:
    """Convert angles to rad if the header says degrees, or if an angle of unknown sense is too large for rad.

    An angle of the force against the reference is subtracted from that of the response. An uncertainty without a unit
    has that of its phase; a phase without any number is dropped. Roles that end in ``_deg`` stay in degrees.

    InputError: an angle stated in rad is too large, or one in degrees turns as if in rad.
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
        of_phase = _find_unit(role, values, facts.angles.get(role, ""), facts.largest_angle)
        if of_phase == "degrees" and not role.endswith("_deg"):
            turned[role] = values * (pi / 180.0)
        if role == "angle":
            source = "found in the file" if role in facts.angles else "follows from its size"
            summary.add("unit of angle", of_phase, source)
    if "force_angle" in turned:
        _subtract_force_angle(turned, facts.angles.get("force_angle") or of_phase, summary)
    if "phase_sd" in turned:
        degrees = (facts.angles.get("phase_sd") or of_phase) == "degrees"
        if degrees:
            turned["phase_sd"] = turned["phase_sd"] * (pi / 180.0)
        source = "found in the file" if "phase_sd" in facts.angles else "that of the phase"
        summary.add("unit of phase_sd", "degrees" if degrees else "rad", source)
    return turned


def _subtract_force_angle(turned: dict[str, Samples], unit: str, summary: Summary) -> None:
    """Replace the angle of the response by that against the force. InputError: there is none, or another shape."""
    role = next((role for role in PHASES if role in turned), None)
    of_force = np.asarray(turned.pop("force_angle"), dtype=np.float64)
    if role is None or of_force.shape != np.shape(turned[role]):
        raise InputError("force_angle without an angle of the response in each row", expected="--column angle=NAME")
    radians = of_force * (pi / 180.0 if unit == "degrees" else 1.0)
    turned[role] = turned[role] - (radians * (180.0 / pi) if role.endswith("_deg") else radians)
    summary.note("the phase of the force is subtracted from that of the response")


def _find_unit(role: str, values: Samples, stated: str, largest: float) -> str:
    """``degrees`` or ``rad``; ``stated``: by the header; ``largest``: of all phases that tell the unit of this one.

    InputError: size or turn contradict the unit.
    """
    known = values[np.isfinite(values)]
    size = max(float(np.max(np.abs(known))), largest)
    large = size > 2.0 * pi
    degrees = stated == "degrees" or role.endswith("_deg")
    if (role in ("phase", "lead") or stated == "radians") and large and not degrees:
        other = "lead_deg" if role == "lead" else "lag_deg"
        expected = f"at most 2 pi, or --column {other}=NAME for degrees (in a campaign [deg] in its header)"
        raise InputError(f"{role} in rad up to {size:.4g}", expected=expected)
    if degrees and not large and np.ptp(known) > _TURN_IN_RADIANS:
        message = f"{role} in degrees runs from {known.min():.3g} to {known.max():.3g}"
        raise InputError(message, expected="degrees, or --column phase=NAME (lag) or lead=NAME for rad")
    return "degrees" if degrees or large else "rad"
