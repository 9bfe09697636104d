"""Columns of a table of steady states by sensor: an amplitude with its phase, two parts, or a complex response.

Columns belong together if their names differ in a word alone: ``tip [mm]`` and ``tip phase [deg]``, ``tip_re`` and
``tip_im``; else a phase belongs to the only name that shares its words, or to the column on its left.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.errors import InputError
from damping.formats.headers import (
    NAMES,
    PHASES,
    ColumnHeader,
    describe_angle,
    is_in_decibels,
    parse_header,
    refuse_decibels,
)
from damping.formats.quantity import find_powers
from damping.formats.roles import find_stated, recognise
from damping.formats.sampling import split
from damping.formats.series import Samples
from damping.records.keys import OPTIONAL_COLUMNS
from damping.records.text import describe_shortened

#: Roles that a table has once; ``force`` is the drive.
SETTING = ("sweep", "frequency", "omega", "force", "sweep_rate")
FOLLOWING = 2.0  #: factor within which the motion of a sensor stays, per drive, if it follows the base
#: Largest phase above which a table is in degrees: four turns in rad, more than a phase unwrapped over some modes.
UNWRAPPED = 8.0 * np.pi
_PARTS: dict[str, list[str]] = NAMES["part"]
_PHASES = ("angle", "lag", "lead")
_WORD = re.compile(r"[^\W_]+")
_HUMP = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[^\W\d_])(?=[0-9])")  # tipPhase, A1


@dataclass(frozen=True)
class SensorColumns:
    """A sensor or drive of a table: its ``name``, the ``main`` column, which has its unit, and columns by role."""

    name: str
    main: int
    roles: Mapping[str, int]

    @property
    def has_phase(self) -> bool:
        """Whether it has a phase or two parts; a complex response needs neither."""
        return bool(set(self.roles) - {"amplitude"})


@dataclass(frozen=True)
class _Part:
    """A column: the role of what it holds, and its words without the word for that."""

    kind: str
    words: tuple[str, ...]
    name: str


def find_setting(headers: Sequence[ColumnHeader], stated: Mapping[str, str]) -> dict[str, int]:
    """Columns of the roles ``SETTING``: as stated by name or number from 1, else by their usual names.

    InputError: a role that one sensor has, or no such column.
    """
    named = {role: k for role, k in recognise(headers).places.items() if role in SETTING}
    lower = [header.name.lower() for header in headers]
    named = {role: lower.index(role) for role in SETTING if lower.count(role) == 1} | named
    for role, name in stated.items():
        if role not in SETTING:
            expected = f"--column of {', '.join(SETTING)}; sensors are found by the names of their columns"
            raise InputError(f"--column {role} of a campaign", expected=expected)
        named[role] = find_stated(name, headers)
    if {"frequency", "omega"} <= set(named):
        del named["omega"]
    return named


def group_columns(
    headers: Sequence[ColumnHeader], is_complex: Sequence[bool], used: Collection[int], out: Collection[str] = ()
) -> list[SensorColumns]:
    """Sensors and drives among columns; ``used``: columns of another role, ``out``: names that are left out.

    InputError: a phase or an imaginary part that belongs to no column, or to several.
    """
    parts = {k: part for k, header in enumerate(headers) if k not in used and (part := _find_part(header))}
    phased = [part.words for part in parts.values() if part.kind in _PHASES]
    for k, part in parts.items():
        if is_complex[k]:
            parts[k] = replace(part, kind="response")
        elif part.kind == "amplitude" and headers[k].angle and part.words not in phased:
            parts[k] = replace(part, kind="angle")
    parts = {k: part for k, part in parts.items() if not {part.name, headers[k].name} & set(out)}
    mains = {k: part for k, part in parts.items() if part.kind in ("amplitude", "response", "x")}
    roles = {k: {part.kind: k} for k, part in mains.items()}
    free, by_place = [k for k in parts if k not in mains], list[int]()
    for find in (_find_same, _find_alike, _find_left):
        for k in list(free):
            wanted = "x" if parts[k].kind == "y" else "amplitude"
            open_mains = {m: part for m, part in mains.items() if part.kind == wanted and len(roles[m]) == 1}
            found = find(k, parts[k], open_mains)
            if len(found) == 1:
                roles[found[0]][_name_role(parts[k].kind, headers[k])] = k
                free.remove(k)
                by_place += [k] if find is _find_left else []
    halves = (m for m in mains if parts[m].kind == "x" and len(roles[m]) == 1)
    # a phase on the right of a drive and on the left of every sensor
    before = (k for k in by_place if len(by_place) > 1 and parts.get(k + 1) and _is_bare(k + 1, roles, headers))
    lonely = next((k for k in [*free, *halves, *before]), None)
    if lonely is not None:
        for header in headers:
            refuse_decibels("amplitude", header.text)
        expected = "names as tip [mm] and tip phase [deg], or tip re and tip im; --correct FILE.toml: role = 'out'"
        raise InputError(f"which column belongs to {describe_shortened(headers[lonely].text)!r}?", expected=expected)
    return [SensorColumns(part.name, k, roles[k]) for k, part in mains.items()]


def find_largest_angle(
    reading: SensorColumns,
    drive: SensorColumns | None,
    table: Sequence[SensorColumns],
    headers: Sequence[ColumnHeader],
    values: Mapping[int, Samples],
) -> float:
    """Largest phase in a ``table`` of those whose headers state the unit of the reading's, or none as it; else 0.

    A table has one unit of angle. That of a ``reading`` which follows the ``drive``, or is one, is told by the others:
    it turns by too few degrees to tell them from rad. 0 where the reading resonates and so tells its own.
    """
    own = [headers[place].angle for role, place in reading.roles.items() if role in PHASES]
    size = np.abs(values[reading.main])
    per_drive = size if drive is None else size / np.abs(values[drive.main])
    per_drive = per_drive[np.isfinite(per_drive) & (size > 0.0)]
    if not own or not len(per_drive) or np.max(per_drive) > FOLLOWING * np.min(per_drive):
        return 0.0
    places = [
        place
        for other in table
        for role, place in other.roles.items()
        if role in PHASES and headers[place].angle in own and np.any(values[other.main])
    ]
    largest = max(float(np.max(np.abs(x[np.isfinite(x)]), initial=0.0)) for x in (values[place] for place in places))
    return largest if largest > UNWRAPPED else 0.0


def describe_array(name: str, unit: str) -> ColumnHeader:
    """The header of an array or channel with a unit ('' if none), without its groups or structures."""
    header = parse_header(split(name)[-1])
    stated = parse_header(f"{header.name} [{unit}]")  # g rms
    return replace(header, unit=stated.unit, scaling=stated.scaling or header.scaling) if unit else header


def _is_bare(k: int, roles: Mapping[int, Mapping[str, int]], headers: Sequence[ColumnHeader]) -> bool:
    """Whether a column is a motion without a phase."""
    powers = find_powers(headers[k].unit)
    return set(roles.get(k, ())) == {"amplitude"} and powers is not None and powers[1] == 1


def _find_part(header: ColumnHeader) -> _Part | None:
    """What a column holds; None if it is no part of a motion or drive."""
    if is_in_decibels(header):  # beside linear values
        return None
    known = not header.unit or find_powers(header.unit) is not None or header.angle or header.unit in ("V", "mV")
    text = header.name if known else header.text  # Re(tip) has no unit
    words = _WORD.findall(_HUMP.sub(" ", text))
    lower = [word.lower() for word in words]
    if header.name.lower() in (set(OPTIONAL_COLUMNS) - {"phase"}) or set(lower) & set(_PARTS["neither"]) or not lower:
        return None
    for kind in ("y", "x", *_PHASES, "amplitude"):
        said = [word for word in lower if word in _PARTS[kind]]
        if said:
            drop = {*said, *(word for word in lower if kind in _PHASES and describe_angle(word))}
            rest = tuple(word for word in lower if word not in drop)
            return _Part(kind, rest, _drop_words(text, drop) if rest else header.name)
    return _Part("amplitude", tuple(lower), header.name)


def _drop_words(text: str, words: Collection[str]) -> str:
    pattern = "|".join(rf"(?<![^\W_]){re.escape(word)}(?![^\W_])" for word in words)
    return " ".join(re.sub(pattern, " ", text, flags=re.IGNORECASE).split()).strip(" _-.,()|") or text


def _name_role(kind: str, header: ColumnHeader) -> str:
    """The role of a phase, by its sense and unit."""
    if header.text.lower() == "phase" and not header.unit:  # as in a record
        return "phase"
    degrees = header.angle == "degrees" or any(describe_angle(w) == "degrees" for w in header.name.lower().split("_"))
    if kind == "lag":
        return "lag_deg" if degrees else "phase"
    return f"{kind}_deg" if kind == "lead" and degrees else kind


def _find_same(k: int, part: _Part, mains: Mapping[int, _Part]) -> list[int]:
    return [m for m, main in mains.items() if main.words == part.words]


def _find_alike(k: int, part: _Part, mains: Mapping[int, _Part]) -> list[int]:
    """Mains whose words include those of the part, or the other way round."""
    own = set(part.words)
    return [m for m, main in mains.items() if own and main.words and (own <= set(main.words) or own >= set(main.words))]


def _find_left(k: int, part: _Part, mains: Mapping[int, _Part]) -> list[int]:
    return [k - 1] if k - 1 in mains else []
