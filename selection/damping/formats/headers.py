"""Column headers: names, units and scalings.

A header has a name, a unit and a scaling: ``Accel [g rms]``. By their units ``F [N]`` is a force and ``f [Hz]`` a
frequency.
"""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from math import log, pi
from pathlib import Path
from typing import Any

from damping.errors import InputError
from damping.formats.quantity import find_powers
from damping.records.text import describe_shortened

_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\[\]]*?)\s*[\])]$")
#: force N, force_N, Kraft in kN, Frequenz/Hz, Frequency, Hz
_BEFORE_UNIT = re.compile(r"(?<=\S)(?:\s+in\s+|\s*[/,]\s*|\s+|_)(?=[^\W\d_][^\s_]*$|°$)")
_UNIT_WITHIN = re.compile(r"\s*[\[(]([^\[\]]+)[\])](?=\s)")  # tip (g/N) Real
_SCALINGS = (
    r"(?:(?P<pp>peak[- ](?:to[- ])?peak|pk[- ](?:to[- ])?pk|p-p|pkpk|pp|p(?:k)?2p(?:k)?|ptp|double[- ]amplitude"
    r"|spitze-spitze|schwing(?:weite|breite)|(?:crête|pic)[- ](?:à[- ])?(?:crête|pic)|c-c|(?-i:D\.A|DA|SS|ss))"
    r"|(?P<rms>rms|r\.m\.s|eff(?:ektiv(?:wert)?|icace)?)|(?P<peak>[0o]-p(?:k|eak)?|peak|pk))"
)
#: g rms, Accel [g] (rms)
_SCALING = re.compile(rf"(?i)(?P<apart>[\s_,-]*(?P<open>[\[(])?){_SCALINGS}\.?(?(open)[\])])$")
_LETTER = re.compile(rf"(?i)(?P<letter>[a-z]){_SCALINGS}")
SCALING_WITHIN = re.compile(rf"(?i)(?<![^\W\d_]){_SCALINGS}(?![^\W_])")  # RMS tip, tip_rms_g, tip1rms
_DECIBELS = re.compile(r"dB(?![a-z])|(?<![A-Za-z])(?:db|DB)(?![A-Za-z])")  # HdB, Accel_dB, dB re 1 g
_ANGLES = dict.fromkeys(("deg", "degree", "degrees", "°", "grad", "degré", "degrés", "grados", "gradi"), "degrees") | {
    "rad": "radians"
}
#: Units of an abscissa in Hz, rad/s and s, in lower case; others are refused.
ABSCISSAS: dict[str, dict[str, float]] = {
    "frequency": {"hz": 1.0, "1/s": 1.0, "s^-1": 1.0, "khz": 1e3, "rpm": 1 / 60, "1/min": 1 / 60, "cpm": 1 / 60,
                  "rad/s": 0.5 / pi},
    "omega": {"rad/s": 1.0, "rad/sec": 1.0, "1/s": 1.0, "s^-1": 1.0},
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0},
}  # fmt: skip

#: Units of a sweep rate, in lower case: Hz/s in one of them, and whether that is to be multiplied by the frequency.
RATES = {"hz/s": (1.0, 0), "hz/sec": (1.0, 0), "hz/min": (1 / 60, 0), "khz/s": (1e3, 0)} | {
    f"{name}/{per}": (log(ratio) / seconds, 1)
    for ratio, names in (
        (2.0, ("oct", "oct.", "octave", "octaves", "okt")),
        (10.0, ("dec", "dec.", "decade", "decades")),
    )
    for name in names
    for per, seconds in (("min", 60.0), ("s", 1.0))
}

#: Factors from columns of these roles to the lead of the response, rad.
PHASES = {"phase": -1.0, "lag_deg": -pi / 180.0, "lead": 1.0, "lead_deg": pi / 180.0, "angle": 1.0}

_NO_UNITS = {"", "-", "V", "mV", "%"}  #: cells of a row of units for columns without a usable unit

#: Names of roles, columns and formats, by context.
NAMES: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("names.toml").read_text("utf-8"))
ROLES: dict[str, str] = NAMES["meaning"]  #: roles of arrays and columns, each with its meaning
ROLE_NAMES: dict[str, list[str]] = NAMES["laboratory"]  #: names of columns by role in laboratory tables
NAMES["own"] = {role: [role] for role in ROLES} | NAMES["own"]
#: Order of the time derivative of displacement by quantity.
ORDERS: dict[str, int] = {name: kind["order"] for name, kind in NAMES["response"].items() if not kind["per_force"]}
_KNOWN_NAMES = {
    name
    for table in ("own", "laboratory", "load", "motion", "amplifier")
    for names in NAMES[table].values()
    for name in names
}


def find_abscissa_factor(role: str, text: str, known: str = "one of") -> float:
    """One unit of a frequency in Hz, an omega in rad/s or a time in s; 1 if ``text`` is empty.

    InputError: no such unit; ``known`` introduces those that are.
    """
    factor = ABSCISSAS[role].get(text.lower()) if text else 1.0
    if factor is None:
        raise InputError(f"{role} in {text}", expected=f"{known} {', '.join(ABSCISSAS[role])}")
    return factor


@dataclass(frozen=True)
class ColumnHeader:
    """A column's header: its full ``text``, the ``name``, the ``unit`` ('' if none) and a name of ``SCALINGS``.

    ``title`` is the name with an adjacent scaling: ``Force RMS`` of ``Force RMS [N]``.
    """

    text: str
    name: str
    unit: str = ""
    scaling: str | None = None
    title: str = ""

    @property
    def angle(self) -> str:
        """``degrees`` or ``radians`` if the unit is one of these, else ''."""
        return describe_angle(self.unit)


def lower_name(name: str) -> str:
    """A name in lower case, except a single letter: f and F differ."""
    return name if len(name) == 1 else name.lower()


def describe_angle(unit: str) -> str:
    """``degrees`` or ``radians`` if a unit is one of these, else ''."""
    return _ANGLES.get(unit.lower(), "")


def parse_header(text: str) -> ColumnHeader:
    """Name, unit and scaling of a header: ``Force [N rms]``, ``Force RMS [N]``, ``force N``, ``Kraft / kN eff``."""
    if text.strip().lower() in RATES:
        return ColumnHeader(text, "sweep_rate", text.strip(), title=text)
    rest, last = _take_scaling(text.strip(), apart=True)
    if (inside := _UNIT_WITHIN.search(rest)) and any(find_powers(inside[1]) or ()):
        rest = f"{rest[: inside.start()]}{rest[inside.end() :]} [{inside[1]}]"
    match = _UNIT.match(rest)
    title, within = (match[1].rstrip("/ "), match[2]) if match else _split_bare_unit(rest)
    within, inner = _take_scaling(within, apart=False)
    name, first = _take_scaling(title, apart=True)
    if within and (letter := _LETTER.fullmatch(name)):  # arms [g], vpp [V]
        name, first = letter["letter"], name_scaling(letter)
    known = name.lower() in _KNOWN_NAMES  # other names may be of sensors: roof N, roof pk
    scaling = inner or last or first or name_scaling(SCALING_WITHIN.search(title)) or _find_joined(title)
    title = title if within or match else text.strip()
    return ColumnHeader(text, name if known else title, within, scaling, title)


def _split_bare_unit(text: str) -> tuple[str, str]:
    """Name and unit of a header without brackets; of a name that is not known only a unit after a comma or slash."""
    for mark in _BEFORE_UNIT.finditer(text) if text.lower() not in _KNOWN_NAMES else ():
        title, within = text[: mark.start()], text[mark.end() :]
        name = _take_scaling(title, apart=True)[0].lower()
        alone, _ = _take_scaling(within, apart=False)  # grms, Npk
        if (name in _KNOWN_NAMES or mark[0].strip() in ("/", ",")) and alone and _is_unit(name, alone):
            return title, within
    return text, ""


def is_in_decibels(header: ColumnHeader) -> bool:
    """Whether the unit of a column is a level in decibels."""
    return bool(_DECIBELS.search(header.unit))


def refuse_decibels(what: str, text: str) -> None:
    """Raise InputError if a name or unit says that amplitudes are in decibels, which no factor converts."""
    if _DECIBELS.search(text):
        expected = "linear values: the reference times 10^(dB/20)"
        raise InputError(f"{what} in decibels ({describe_shortened(text)!r})", expected=expected)


def _take_scaling(text: str, *, apart: bool) -> tuple[str, str | None]:
    """Text without the scaling at its end, and the scaling; ``apart``: only if it is a separate word after others."""
    scaled = _SCALING.search(text)
    if scaled is None or (apart and not (scaled["apart"] and scaled.start())):
        return text, None
    return text[: scaled.start()].strip(), name_scaling(scaled)


def _find_joined(title: str) -> str | None:
    """The scaling that the last word of a name joins to a unit: ``rms`` of ``Acc tip grms``."""
    alone, scaling = _take_scaling(re.split(r"[\s_]", title)[-1], apart=False)
    return scaling if alone and any(find_powers(alone) or ()) else None


def name_scaling(scaled: re.Match[str] | None) -> str | None:
    """Name of a scaling that ``SCALING_WITHIN`` found; None if it found none."""
    return None if scaled is None else "peak-to-peak" if scaled["pp"] else "rms" if scaled["rms"] else "peak"


def _is_unit(name: str, text: str) -> bool:
    """Whether a word is a unit of the quantity in a column of a known name."""
    for abscissa in ABSCISSAS:
        if name in (abscissa, *ROLE_NAMES[abscissa]) and text.lower() in ABSCISSAS[abscissa]:
            return True
    if name in ROLE_NAMES["sweep_rate"]:
        return text.lower() in RATES
    if name.startswith(("phase", "lag", "lead", "angle", "theta")):
        return text.lower() in _ANGLES
    if name not in _KNOWN_NAMES and text.lower() in _ANGLES:
        return True
    kinds = [kind for kind, names in NAMES["motion"].items() if name in names] or [*NAMES["motion"]]
    kinds = ["force"] if name in ROLE_NAMES["force"] else kinds if name in _KNOWN_NAMES else [*kinds, "force"]
    may_be = name in ("energy", "mass") or any(fits_role(kind, ColumnHeader(text, name, text)) for kind in kinds)
    return find_powers(text) is not None and may_be


def merge_units(names: Sequence[str], below: Sequence[str]) -> list[str] | None:
    """Headers from names and the row of units below them; None if that row has other content."""
    texts = [cell.strip().strip("[]()") for cell in below]
    if len(texts) != len(names) or not all(text in _NO_UNITS or _names_unit(text) for text in texts):
        return None
    if set(texts) <= _NO_UNITS:
        return None
    return [name if text in ("", "-") else f"{name} [{text}]" for name, text in zip(names, texts, strict=True)]


def _names_unit(text: str) -> bool:
    """Whether a text is a unit of an abscissa, an angle, or another quantity."""
    text, _ = _take_scaling(text, apart=False)
    if text.lower() in {*_ANGLES, *RATES, *(name for names in ABSCISSAS.values() for name in names)}:
        return True
    return find_powers(text) is not None and not text.isdecimal()


def fits_role(role: str, header: ColumnHeader) -> bool:
    """Whether the unit of a header, if there is one, fits the role; a sweep rate may be in octaves."""
    if role == "sweep_rate":
        return header.unit.lower() in RATES or (not header.unit and header.name.lower() == role)
    if not header.unit or role == "sweep":
        return not is_in_decibels(header)
    text = header.unit.lower()
    if role in ABSCISSAS:
        return text in ABSCISSAS[role] and (role != "frequency" or not text.startswith("rad"))
    powers = find_powers(header.unit)
    if powers is None:  # volts: a scale may be stated
        return role != "force" and text not in ABSCISSAS["frequency"] and text not in _ANGLES
    order = ORDERS.get(role, 0)
    return powers in ((1, 0, 0), (1, 1, 0)) if role == "force" else powers in ((0, 1, -order), (-1, 1, -order))
