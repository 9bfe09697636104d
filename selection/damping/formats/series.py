"""What a file holds, before it is a record: series, what the file and the user say of them, roles and names of columns.

A header holds a name, a unit and a scaling: ``Accel [g rms]``; ``F [N]`` is a force and ``f [Hz]`` a frequency, told by
the unit. What was understood of a file: a table of fact and whence, and notes on what was left out.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import pi
from pathlib import Path
from typing import Any, TypeAlias

import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.quantity import unit
from damping.records.text import describe_shortened

_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\[\]]*?)\s*[\])]$")
_BARE_UNIT = re.compile(r"^(.*?\S)(?:\s+in\s+|\s*/\s*|\s+)([^\W\d_]\S*|°)$")  # force N, Kraft in kN, Frequenz/Hz
_SCALING = re.compile(
    r"(?i)(?P<apart>[\s_,]*)(?:(?P<pp>peak[- ]to[- ]peak|pk-pk|p-p|pkpk|pp)|(?P<rms>rms|r\.m\.s|eff)"
    r"|(?P<peak>0-p(?:k|eak)?|peak|pk))\.?$"
)
_DECIBELS = re.compile(r"dB(?![a-z])|(?<![A-Za-z])(?:db|DB)(?![A-Za-z])")  # HdB, Accel_dB, dB re 1 g
_ANGLES = {"deg": "degrees", "degree": "degrees", "degrees": "degrees", "°": "degrees", "grad": "", "rad": "radians"}
#: Units of an abscissa in Hz, rad/s and s, in lower case; any other is asked for.
ABSCISSAS: dict[str, dict[str, float]] = {
    "frequency": {"hz": 1.0, "1/s": 1.0, "s^-1": 1.0, "khz": 1e3, "rpm": 1 / 60, "1/min": 1 / 60, "cpm": 1 / 60,
                  "rad/s": 0.5 / pi},
    "omega": {"rad/s": 1.0, "rad/sec": 1.0, "1/s": 1.0, "s^-1": 1.0},
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0},
}  # fmt: skip

#: What a row of units holds where a column has none that is understood.
_NO_UNITS = {"", "-", "V", "mV", "%"}

#: Names of roles, columns and formats, by what they are names in.
NAMES: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("names.toml").read_text("utf-8"))
#: Roles of arrays and columns, each with its meaning.
ROLES: dict[str, str] = NAMES["meaning"]
#: Names of columns by role in tables of laboratories.
ROLE_NAMES: dict[str, list[str]] = NAMES["laboratory"]
NAMES["own"] = {role: [role] for role in ROLES} | NAMES["own"]
_KNOWN_NAMES = {
    name for table in ("own", "laboratory", "motion", "amplifier") for names in NAMES[table].values() for name in names
}


@dataclass(frozen=True)
class ColumnHeader:
    """A column's header: its whole ``text``, the ``name``, the ``unit`` ('' where none) and a name of ``SCALINGS``.

    ``title`` is the name with the scaling that stands beside it: ``Force RMS`` of ``Force RMS [N]``.
    """

    text: str
    name: str
    unit: str = ""
    scaling: str | None = None
    title: str = ""

    @property
    def angle(self) -> str:
        """``degrees`` or ``radians`` where the unit is one of these, else ''."""
        return _ANGLES.get(self.unit.lower(), "")


def parse_header(text: str) -> ColumnHeader:
    """Name, unit and scaling of a header: ``Force [N rms]``, ``Force RMS [N]``, ``force N``, ``Kraft / kN eff``."""
    rest, last = _take_scaling(text.strip(), apart=True)
    match = _UNIT.match(rest) or _BARE_UNIT.match(rest)
    title, within = (match[1].rstrip("/ "), match[2]) if match else (rest, "")
    within, inner = _take_scaling(within, apart=False)
    name, first = _take_scaling(title, apart=True)
    known = name.lower() in _KNOWN_NAMES  # any other may be the name of a sensor: roof N, roof pk
    if match and match.re is _BARE_UNIT and not (known and _is_unit(name.lower(), within)):
        title, within, name, match = rest, "", rest, None
    scaling = inner or last or first
    title = title if match else text.strip()
    return ColumnHeader(text, name if known else title, within, scaling, title)


def refuse_decibels(what: str, text: str) -> None:
    """InputError where a name or unit says that amplitudes are logarithms, which no factor turns back."""
    if _DECIBELS.search(text):
        expected = "linear values: the reference times 10^(dB/20)"
        raise InputError(f"{what} in decibels ({describe_shortened(text)!r})", expected=expected)


def _take_scaling(text: str, *, apart: bool) -> tuple[str, str | None]:
    """Text without the scaling at its end, and its name; ``apart``: only of a word of its own beside others."""
    scaled = _SCALING.search(text)
    if scaled is None or (apart and not (scaled["apart"] and scaled.start())):
        return text, None
    kind = "peak-to-peak" if scaled["pp"] else "rms" if scaled["rms"] else "peak"
    return text[: scaled.start()].strip(), kind


def _is_unit(name: str, text: str) -> bool:
    """Whether a word is a unit of what a column of a known name holds."""
    for abscissa in ABSCISSAS:
        if name in (abscissa, *ROLE_NAMES[abscissa]) and text.lower() in ABSCISSAS[abscissa]:
            return True
    if name.startswith(("phase", "lag", "lead", "angle", "theta")):
        return text.lower() in _ANGLES
    kinds = [kind for kind, names in NAMES["motion"].items() if name in names] or NAMES["motion"]
    kinds = ["force"] if name in ROLE_NAMES["force"] else kinds
    try:
        unit(text)
    except InputError:
        return False
    return name in ("energy", "mass") or any(_may_be(kind, ColumnHeader(text, name, text)) for kind in kinds)


def merge_units(names: Sequence[str], below: Sequence[str]) -> list[str] | None:
    """Headers of names with the units in the row below them; None where that row holds anything else."""
    texts = [cell.strip().strip("[]()") for cell in below]
    if len(texts) != len(names) or not all(text in _NO_UNITS or _names_unit(text) for text in texts):
        return None
    if set(texts) <= _NO_UNITS:
        return None
    return [name if text in ("", "-") else f"{name} [{text}]" for name, text in zip(names, texts, strict=True)]


def _names_unit(text: str) -> bool:
    """Whether a text is a unit of an abscissa, an angle, or any other."""
    if text.lower() in {*_ANGLES, *(name for names in ABSCISSAS.values() for name in names)}:
        return True
    try:
        unit(text)
    except InputError:
        return False
    return not text.isdecimal()


def recognise(headers: Sequence[ColumnHeader]) -> tuple[dict[str, int], str | None]:
    """Columns by role where the names of a table say it, and the type of response that a name says.

    Where there is a time, ``x`` and ``y`` are no readings of an amplifier, nor where there is a ``z`` beside them.
    """
    places: dict[str, int] = {}
    for place, header in enumerate(headers):
        for role, names in ROLE_NAMES.items():
            if role not in places and header.name.lower() in names and _may_be(role, header):
                places[role] = place
                break
    is_time = "time" in places and not {"frequency", "omega"} & set(places)
    lower = [header.name.lower() for header in headers]
    response = None
    for place, header in enumerate(headers):
        name = header.name.lower()
        motion = next((kind for kind, names in NAMES["motion"].items() if name in names), None)
        free = place not in places.values() and not {"response", "amplitude"} & set(places)
        # a phase whose unit is known, or that of a record
        is_angle = name.startswith("phase") and (header.angle or (name == "phase" and not header.unit))
        if motion and free and _may_be(motion, header):
            places["response" if is_time else "amplitude"], response = place, motion
        elif is_angle and not is_time and "angle" not in places:
            places["angle"] = place
    if not is_time and {"x", "y"} <= set(lower) and "z" not in lower and "amplitude" not in places:
        places |= {"x": lower.index("x"), "y": lower.index("y")}
        places.pop("angle", None)
    return places, response


def _may_be(role: str, header: ColumnHeader) -> bool:
    """Whether the unit of a header, where it has one, is one of the role."""
    if not header.unit or role == "sweep":
        return True
    text = header.unit.lower()
    if role in ABSCISSAS:
        return text in ABSCISSAS[role] and (role != "frequency" or not text.startswith("rad"))
    try:
        powers = unit(header.unit).powers
    except InputError:
        # volts: a scale may be stated
        return role != "force" and text not in ABSCISSAS["frequency"] and text not in _ANGLES
    order = {"displacement": 0, "velocity": 1, "acceleration": 2}.get(role, 0)
    return powers in ((1, 0, 0), (1, 1, 0)) if role == "force" else powers in ((0, 1, -order), (-1, 1, -order))


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
    degrees: Sequence[str] = ()  #: roles whose header says degrees


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
