"""Column headers: names, units and scalings, and the roles of columns by their names.

A header has a name, a unit and a scaling: ``Accel [g rms]``. By their units ``F [N]`` is a force and ``f [Hz]`` a
frequency.
"""

import re
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log, pi
from pathlib import Path
from typing import Any

from damping.errors import InputError
from damping.formats.quantity import find_powers
from damping.records.keys import OPTIONAL_COLUMNS
from damping.records.text import describe_shortened

_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\[\]]*?)\s*[\])]$")
#: force N, force_N, Kraft in kN, Frequenz/Hz, Frequency, Hz
_BEFORE_UNIT = re.compile(r"(?<=\S)(?:\s+in\s+|\s*[/,]\s*|\s+|_)(?=[^\W\d_][^\s_]*$|°$)")
_UNIT_WITHIN = re.compile(r"\s*[\[(]([^\[\]]+)[\])](?=\s)")  # tip (g/N) Real
_SCALINGS = (
    r"(?:(?P<pp>peak[- ](?:to[- ])?peak|pk[- ](?:to[- ])?pk|p-p|pkpk|pp|spitze-spitze"
    r"|crête[- ]à[- ]crête)|(?P<rms>rms|r\.m\.s|eff(?:ektiv(?:wert)?|icace)?)|(?P<peak>0-p(?:k|eak)?|peak|pk))"
)
#: g rms, Accel [g] (rms)
_SCALING = re.compile(rf"(?i)(?P<apart>[\s_,-]*(?P<open>[\[(])?){_SCALINGS}\.?(?(open)[\])])$")
SCALING_WITHIN = re.compile(rf"(?i)(?<![^\W\d_]){_SCALINGS}(?![^\W_])")  # RMS tip, tip_rms_g, tip1rms
_DECIBELS = re.compile(r"dB(?![a-z])|(?<![A-Za-z])(?:db|DB)(?![A-Za-z])")  # HdB, Accel_dB, dB re 1 g
_ANGLES = dict.fromkeys(("deg", "degree", "degrees", "°", "grad", "degrés", "grados", "gradi"), "degrees") | {
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
#: Names of a response that is a rotation.
_ANGULAR = NAMES["rotation"]["displacement"]
_KNOWN_NAMES = {
    name for table in ("own", "laboratory", "motion", "amplifier") for names in NAMES[table].values() for name in names
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
    known = name.lower() in _KNOWN_NAMES  # other names may be of sensors: roof N, roof pk
    scaling = inner or last or first or _name_scaling(SCALING_WITHIN.search(title))
    title = title if within or match else text.strip()
    return ColumnHeader(text, name if known else title, within, scaling, title)


def _split_bare_unit(text: str) -> tuple[str, str]:
    """Name and unit of a header without brackets; of a name that is not known only a unit after a comma or slash."""
    for mark in _BEFORE_UNIT.finditer(text) if text.lower() not in _KNOWN_NAMES else ():
        title, within = text[: mark.start()], text[mark.end() :]
        name = _take_scaling(title, apart=True)[0].lower()
        if (name in _KNOWN_NAMES or mark[0].strip() in ("/", ",")) and _is_unit(name, within):
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
    return text[: scaled.start()].strip(), _name_scaling(scaled)


def _name_scaling(scaled: re.Match[str] | None) -> str | None:
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
    may_be = name in ("energy", "mass") or any(_may_be(kind, ColumnHeader(text, name, text)) for kind in kinds)
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


def recognise(headers: Sequence[ColumnHeader]) -> tuple[dict[str, int], str | None]:
    """Columns by role from the names in a table, and the response type from a name.

    The type is '' for a single letter: ``A`` may be an amplitude of any kind, ``v`` a voltage; its unit tells.
    With a time, or a ``z`` beside them, ``x`` and ``y`` are not readings of an amplifier.
    """
    places: dict[str, int] = {}
    names = _name_columns(headers)
    for place, (name, header) in enumerate(zip(names, headers, strict=True)):
        for role, known in ROLE_NAMES.items():
            if role not in places and name in known and _may_be(role, header):
                places[role] = place
                break
    in_hertz = [k for k, header in enumerate(headers) if header.unit.lower() in ("hz", "khz")]
    if not {"frequency", "omega", "time"} & set(places) and len(in_hertz) == 1:
        places["frequency"] = in_hertz[0]
    is_time = "time" in places and not {"frequency", "omega"} & set(places)
    response = None
    for place, (name, header) in enumerate(zip(names, headers, strict=True)):
        motion = next((kind for kind, known in NAMES["motion"].items() if name in known), None)
        free = place not in places.values() and not {"response", "amplitude"} & set(places)
        if motion and free and _may_be(motion, header):
            places["response" if is_time else "amplitude"], response = place, motion if len(name) > 1 else ""
    named = [k for k, name in enumerate(names) if name in NAMES["phase"]["angle"] and headers[k].angle]
    if not is_time and (phases := list_phases(headers) or (named if "amplitude" in places and len(named) == 1 else [])):
        places["angle"] = phases[0]
    of_moment = "force" in places and find_powers(headers[places["force"]].unit) == (1, 1, 0)
    if of_moment and not {"response", "amplitude", "x"} & set(places):
        turning = [k for k, name in enumerate(names) if name in _ANGULAR]
        for place in (place for place in turning if find_powers(headers[place].unit) == (0, 0, 0)):
            places["amplitude"], response = place, "displacement"
    if not is_time and {"x", "y"} <= set(names) and "z" not in names and "amplitude" not in places:
        places |= {"x": names.index("x"), "y": names.index("y")}
        places.pop("angle", None)
    return places, response


def list_phases(headers: Sequence[ColumnHeader]) -> list[int]:
    """Columns called ``phase``; else those that begin so, or are called lag or lead, in the unit of an angle."""
    names = [header.name.lower() for header in headers]
    own = [k for k, name in enumerate(names) if name == "phase" and (headers[k].angle or not headers[k].unit)]
    further = [k for k, name in enumerate(names) if headers[k].angle and (name.startswith("phase") or _lags(name))]
    return own or [k for k in further if names[k] not in OPTIONAL_COLUMNS]  # phase_sd, phase_3


def _lags(name: str) -> bool:
    """Whether a word of a name in lower case is that of a lag or a lead."""
    return not {*NAMES["part"]["lag"], *NAMES["part"]["lead"]}.isdisjoint(re.split(r"[\s_.]+", name))


def find_shared_name(places: Mapping[str, int], headers: Sequence[ColumnHeader]) -> str:
    """The first name that a column with a role shares with another, '' if none; all phases share theirs."""
    titles = [lower_name(header.title) for header in headers]
    if "angle" in places and len(list_phases(headers)) > 1:
        return "phase"
    return next((titles[place] for place in places.values() if titles.count(titles[place]) > 1), "")


def _name_columns(headers: Sequence[ColumnHeader]) -> list[str]:
    """Names in lower case; of several words with a unit, such as ``Tip displacement [mm]``, the known word.

    The known word must be of the quantity of the unit, and of no other column: of two forces or motions neither counts.
    """
    words = [_known_words(header) for header in headers]
    columns = Counter(kind for known in words for kind in set(known.values()))
    return [
        next((word for word, kind in known.items() if columns[kind] == 1), header.name.lower())
        for known, header in zip(words, headers, strict=True)
    ]


def _known_words(header: ColumnHeader) -> dict[str, str]:
    """Quantity by known name of a column, or by each of its known words."""
    name = header.name.lower()
    known = {word: kind for word in (name, *re.split(r"[\s_.]+", name)) if (kind := _measures(word, header))}
    return {name: known[name]} if name in known else known


def _measures(word: str, header: ColumnHeader) -> str:
    """Quantity of a column by a word of its name and its unit: a role, or ``motion``; else ''."""
    roles = (role for role, known in ROLE_NAMES.items() if role != "sweep" and word in known)
    motions = (kind for kind, known in NAMES["motion"].items() if word in known)
    if role := next((role for role in roles if header.unit and _may_be(role, header)), ""):
        return role
    return "motion" if any(header.unit and _may_be(kind, header) for kind in motions) else ""


def _may_be(role: str, header: ColumnHeader) -> bool:
    """Whether the unit of a header, if there is one, fits the role; a sweep rate may be in octaves."""
    if role == "sweep_rate":
        return header.unit.lower() in RATES or (not header.unit and header.name.lower() == role)
    if not header.unit or role == "sweep":
        return True
    text = header.unit.lower()
    if role in ABSCISSAS:
        return text in ABSCISSAS[role] and (role != "frequency" or not text.startswith("rad"))
    powers = find_powers(header.unit)
    if powers is None:  # volts: a scale may be stated
        return role != "force" and text not in ABSCISSAS["frequency"] and text not in _ANGLES
    order = ORDERS.get(role, 0)
    return powers in ((1, 0, 0), (1, 1, 0)) if role == "force" else powers in ((0, 1, -order), (-1, 1, -order))
