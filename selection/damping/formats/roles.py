"""Roles of the columns of a table, such as frequency, force and response, by the first of these that gives one:

1. the column stated for the role; if some are stated, `_find_further` says which other roles are looked for;
2. the name of the role, unless `_find_own` tells that it means something else there;
3. the rules `_USUAL` on usual names and units, in their order, but for motions if 2 gives one.
"""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from damping.errors import InputError
from damping.formats.cells import DELIMITERS
from damping.formats.headers import NAMES, PHASES, ROLE_NAMES, ColumnHeader, fits_role, lower_name
from damping.formats.phases import MOTIONS, WORDS, find_half, is_phase_of_force, list_phases
from damping.formats.quantity import find_powers
from damping.records.keys import OPTIONAL_COLUMNS
from damping.records.text import describe_meant, describe_shortened

Places: TypeAlias = dict[str, int]  #: columns by role
ABSCISSA = frozenset(("frequency", "omega", "time"))  #: roles of what sets a row
_MOTION = frozenset(("response", "x", "y", "amplitude"))  #: roles of a motion
_ROTATIONS = dict.fromkeys(NAMES["rotation"]["displacement"], "displacement")
_OF_MOTIONS = ((1, 0), (1, -1), (1, -2))  #: powers of length and time of motions, and of their ratios to force


@dataclass(frozen=True)
class Roles:
    """The columns of a table that have a role."""

    places: Places
    response: str | None  #: type of the response by its usual name, '' if that is a single letter


def recognise(headers: Sequence[ColumnHeader]) -> Roles:
    """Columns by role from the usual names in a table, by the rules `_USUAL`.

    The type of the response is '' for a single letter: ``A`` may be an amplitude of any kind, ``v`` a voltage.
    """
    names, places = _name_columns(headers), Places()
    for find in _USUAL:
        places |= find(headers, names, places)
    if "x" in places:  # parts have no other phase
        places.pop("angle", None)
    name = next((names[places[role]] for role in ("amplitude", "response") if role in places), None)
    response = None if name is None else (MOTIONS | _ROTATIONS).get(name, "") if len(name) > 1 else ""
    return Roles(places, response)


def _find_named(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """A usual name, without a unit or with one of its role."""
    places = Places()
    for place, (name, header) in enumerate(zip(names, headers, strict=True)):
        if role := next((role for role in _list_usual(name, header) if role not in places), ""):
            places[role] = place
    return places


def _find_load(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The only load or excitation in a unit of force, where no force is named."""
    loads = [k for k, name in enumerate(names) if name in NAMES["load"]["force"] and headers[k].unit]
    fitting = [k for k in loads if fits_role("force", headers[k])]
    return {"force": fitting[0]} if len(fitting) == 1 and "force" not in found else {}


def _find_hertz(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The only column in Hz, where no name is that of an abscissa."""
    in_hertz = [k for k, header in enumerate(headers) if header.unit.lower() in ("hz", "khz")]
    return {"frequency": in_hertz[0]} if len(in_hertz) == 1 and ABSCISSA.isdisjoint(found) else {}


def _find_motion(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The first motion: against time a response, else an amplitude."""
    free = [k for k, name in enumerate(names) if name in MOTIONS and k not in found.values()]
    fitting = [k for k in free if fits_role(MOTIONS[names[k]], headers[k])]
    return {"response" if _is_history(found) else "amplitude": fitting[0]} if fitting else {}


def _find_phase(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The first phase, or the only angle of an amplitude; not against time."""
    angles = [k for k, name in enumerate(names) if name in NAMES["phase"]["angle"] and headers[k].angle]
    phases = list_phases(headers, _name_response(headers, found))
    phases = phases or (angles if "amplitude" in found and len(angles) == 1 else [])
    of_force = [k for k, header in enumerate(headers) if is_phase_of_force(header)] if "force" in found else []
    both = {"angle": phases[:1], "force_angle": of_force[:1] if len(of_force) == 1 and phases else []}
    return {} if _is_history(found) else {role: place for role, places in both.items() for place in places}


def _find_rotation(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The last rotation beside a moment, without another motion."""
    turning = [k for k, name in enumerate(names) if name in _ROTATIONS and find_powers(headers[k].unit) == (0, 0, 0)]
    of_moment = "force" in found and find_powers(headers[found["force"]].unit) == (1, 1, 0)
    return {"amplitude": turning[-1]} if turning and of_moment and not {"response", "amplitude"} & set(found) else {}


def _find_parts(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The parts of a complex response: x and y without time, amplitude and z, or Re and Im of one name."""
    if _is_history(found) or "amplitude" in found:
        return {}
    if {"x", "y"} <= set(names):
        return {} if "z" in names else {"x": names.index("x"), "y": names.index("y")}
    halves = {kind: [find_half(header, kind) for header in headers] for kind in ("x", "y")}
    pairs = [(k, m) for k, x in enumerate(halves["x"]) for m, y in enumerate(halves["y"]) if x is not None and x == y]
    of_force = [pair for pair in pairs if not set(ROLE_NAMES["force"]).isdisjoint(halves["x"][pair[0]] or ())]
    of_motion = [pair for pair in pairs if pair not in of_force]
    if len(of_motion) != 1 or len(of_force) > 1:
        return {}
    return dict(
        zip(("x", "y", "force_x", "force_y"), [*of_motion[0], *(of_force[0] if of_force else ())], strict=False)
    )


def _find_only_motion(headers: Sequence[ColumnHeader], names: Sequence[str], found: Places) -> Places:
    """The only column in a unit of motion: beside an angle, in a ratio to force, or the only one beside the time."""
    if ABSCISSA.isdisjoint(found) or "amplitude" in found:
        return {}
    free = [k for k in range(len(headers)) if k not in found.values() and names[k] not in OPTIONAL_COLUMNS]
    free = [k for k in free if set(WORDS.split(names[k])).isdisjoint(NAMES["part"]["neither"])]
    motions = [k for k in free if headers[k].unit and (find_powers(headers[k].unit) or (0, 0, 0))[1:] in _OF_MOTIONS]
    if _is_history(found):
        return {"response": motions[0]} if found.keys() == {"time"} and motions == free and len(free) == 1 else {}
    is_ratio = len(motions) == 1 and (find_powers(headers[motions[0]].unit) or (0, 0, 0))[0] == -1
    has_phase = any(header.angle for header in headers)
    return {"amplitude": motions[0]} if len(motions) == 1 and (is_ratio or has_phase) else {}


#: Rules on headers and their names (`_name_columns`), in this order: each adds to the roles that those before it found.
_USUAL = (
    *(_find_named, _find_load, _find_hertz, _find_motion),
    *(_find_only_motion, _find_phase, _find_rotation, _find_parts),
)


def _is_history(places: Iterable[str]) -> bool:
    """Whether there is a time, and no frequency."""
    return ABSCISSA.intersection(places) == {"time"}


def find_roles(
    headers: Sequence[ColumnHeader],
    mapped: Mapping[str, str],
    known: Mapping[str, Iterable[str]],
    line: int | None = None,
) -> Roles:
    """Columns that have a role.

    Args:
        mapped: column stated for each role, with or without its unit, or its number from 1; `_find_further` says which
            roles are then found by name.
        known: names of columns by role, in lower case and without units; they take precedence over usual names.
        line: of the headers in a text.

    InputError: a missing or repeated column, or no column with a role.
    """
    usual = recognise(headers)
    own = _find_own(headers, known, usual.places)
    excluded = {*own, *_MOTION} if _MOTION & set(own) else set(own)
    free = {role: k for role, k in usual.places.items() if role not in excluded and k not in own.values()}
    by_name = free | own
    stated = {role: find_stated(name, headers, line) for role, name in mapped.items()}
    found = _find_further(stated, by_name)
    if name := _find_shared_name(found, headers):
        expected = "one, or --column ROLE=NAME or NUMBER"
        raise InputError(f"several columns are {describe_shortened(name)!r}", line=line, expected=expected)
    if not {*stated, *found} - {"sweep"}:
        raise _no_role([header.text for header in headers], line)
    is_taken = not stated or {by_name.get("amplitude"), by_name.get("response")} & set(stated.values())
    response = usual.response if is_taken and not _MOTION & set(own) else None
    return Roles(stated | found, response)


def _find_own(headers: Sequence[ColumnHeader], known: Mapping[str, Iterable[str]], usual: Places) -> Places:
    """Columns called by the names of roles, without those that mean something else beside the ``usual`` ones."""
    lower = [header.name.lower() for header in headers]
    # amplitude and amplitude_rms side by side are two columns
    lower = [h.title.lower() if lower.count(name) > 1 else name for h, name in zip(headers, lower, strict=True)]
    own = {role: lower.index(name) for role, of in known.items() for name in [n for n in of if n in lower][:1]}
    are_positions = "x" in own and lower[own["x"]] == "x" and not {"x", "y"} <= set(usual)  # by time, or beside a z
    is_something_else = {
        "x": are_positions,
        "y": are_positions,
        "phase": "angle" in usual,  # whether it is a lag or a lead shows later
        "angle": own.get("angle") == usual.get("amplitude"),  # a rotation
    }
    return {role: place for role, place in own.items() if not is_something_else.get(role)}


def _find_further(stated: Places, by_name: Places) -> Places:
    """Columns found by name that are taken beside ``stated`` ones; all, but for an angle, if there are none."""
    if not stated:
        has_angle = "amplitude" in by_name and {"lead_deg", "lag_deg", "lead"}.isdisjoint(by_name)
        return {role: place for role, place in by_name.items() if role != "angle" or has_angle}
    is_wanted = {
        "sweep": True,
        "sweep_rate": True,
        "force": "force_x" not in stated and "time" not in {*stated, *by_name},  # against time it is no amplitude
        **dict.fromkeys(ABSCISSA, ABSCISSA.isdisjoint(stated)),
        **dict.fromkeys(PHASES, "amplitude" in stated and not set(PHASES) & set(stated)),
    }
    unstated = {role: place for role, place in by_name.items() if role not in stated and place not in stated.values()}
    return {role: place for role, place in unstated.items() if is_wanted.get(role)}


def find_stated(name: str, headers: Sequence[ColumnHeader], line: int | None = None) -> int:
    """The column of a stated name, with or without its unit, or of a number from 1 if it is not a name.

    InputError: none or several, with the ``line`` of the header if known.
    """
    matches = [k for k, header in enumerate(headers) if name.strip() in (header.text, header.title, header.name)]
    exact = [k for k in matches if name.strip() in (headers[k].text, headers[k].title)]
    if not matches and name.strip().isdecimal() and 1 <= int(name) <= len(headers):
        matches = [int(name) - 1]
    if len(exact or matches) == 1:
        return (exact or matches)[0]
    names = [header.text for header in headers]
    hint = "" if matches else _describe_other_delimiter(names) or describe_meant(name, names)
    message = f"{'several columns are' if matches else 'no column'} {describe_shortened(name)!r}{hint}"
    raise InputError(message, line=line, expected=f"one of {describe_shortened(', '.join(names), 100)}")


def _no_role(names: list[str], line: int | None) -> InputError:
    if names == [str(k + 1) for k in range(len(names))]:
        expected = f"--column ROLE=NUMBER of its {len(names)} columns, such as frequency=1"
        return InputError("the table has no header", expected=expected)
    expected = f"--column ROLE=NAME; it has {describe_shortened(', '.join(names), 100)}"
    message = f"no column has the name of a role{_describe_other_delimiter(names)}"
    return InputError(message, line=line, expected=expected)


def _describe_other_delimiter(names: list[str]) -> str:
    """A hint if the header is one cell that contains another delimiter."""
    marks = ((name, DELIMITERS[name]) for name in ("semicolon", "tab", "comma"))
    other = next((name for name, mark in marks if len(names) == 1 and mark in names[0]), None)
    return f" (is --delimiter {other} meant?)" if other else ""


def _name_response(headers: Sequence[ColumnHeader], places: Mapping[str, int]) -> str:
    """Name of the column of the response in lower case, '' if there is none."""
    return next((headers[places[role]].name.lower() for role in sorted(_MOTION & set(places))), "")


def _find_shared_name(places: Mapping[str, int], headers: Sequence[ColumnHeader]) -> str:
    """The first name that a column with a role shares with another, '' if none; all phases share theirs."""
    titles = [lower_name(header.title) for header in headers]
    if "angle" in places and len(list_phases(headers, _name_response(headers, places))) > 1:
        return "phase"
    return next((titles[place] for place in places.values() if titles.count(titles[place]) > 1), "")


def _list_usual(name: str, header: ColumnHeader) -> list[str]:
    """Roles that have a usual name, and whose unit fits if there is one."""
    return [role for role, known in ROLE_NAMES.items() if name in known and fits_role(role, header)]


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
    known = {word: kind for word in (name, *WORDS.split(name)) if (kind := _measures(word, header))}
    return {name: known[name]} if name in known else known


def _measures(word: str, header: ColumnHeader) -> str:
    """Quantity of a column by a word of its name and its unit: a role, or ``motion``; else ''."""
    roles = [role for role in _list_usual(word, header) if role != "sweep" and header.unit]
    is_motion = header.unit and word in MOTIONS and fits_role(MOTIONS[word], header)
    return roles[0] if roles else "motion" if is_motion else ""
