"""Columns of phases and of parts of phasors by the words of their names."""

import re
from collections.abc import Sequence

from damping.formats.headers import NAMES, ROLE_NAMES, ColumnHeader
from damping.records.keys import OPTIONAL_COLUMNS

#: Types of a response by name.
MOTIONS = {name: kind for kind, known in NAMES["motion"].items() for name in known}
WORDS = re.compile(r"[\s_.]+")  #: marks between the words of a name
_LAGS = {*NAMES["part"]["lag"], *NAMES["part"]["lead"]}
_PHASES = {*NAMES["phase"]["word"]}


def list_phases(headers: Sequence[ColumnHeader], response: str) -> list[int]:
    """Columns called ``phase``; else those that begin so, or have a word for it, lag or lead, and are angles.

    Of the latter, those of another motion than the ``response``, a name in lower case, or of the force (``Force phase
    [deg]``) are left out.
    """
    names = [header.name.lower() for header in headers]
    own = [k for k, name in enumerate(names) if name == "phase" and (headers[k].angle or not headers[k].unit)]
    of_response = _list_motions(response)
    further = []
    for k, header in enumerate(headers):
        words = {*WORDS.split(names[k])}
        is_phase = names[k].startswith("phase") or not words.isdisjoint(_PHASES | _LAGS)
        of_motion = _list_motions(names[k])
        is_angle = header.angle or (not header.unit and of_motion and words <= _PHASES | set(MOTIONS))
        is_other = of_response and of_motion and of_response.isdisjoint(of_motion)
        if is_phase and is_angle and not (is_other or is_phase_of_force(header)):
            further.append(k)
    return own or [k for k in further if names[k] not in OPTIONAL_COLUMNS]  # phase_sd, phase_3


def _list_motions(name: str) -> set[str]:
    """Types of motions that words of a name say, single letters left out."""
    return {MOTIONS[word] for word in WORDS.split(name) if len(word) > 1 and word in MOTIONS}


def is_phase_of_force(header: ColumnHeader) -> bool:
    """Whether a column is an angle called ``Force phase`` or ``Phase of force``, and by no further word."""
    words = {*WORDS.split(header.name.lower())} - {"of", "the", "angle"}
    named = [word for word in words if word in ROLE_NAMES["force"]]
    return bool(header.angle and len(named) == 1 and words & _PHASES and words <= {*named, *_PHASES})


def find_half(header: ColumnHeader, kind: str) -> tuple[str, ...] | None:
    """Further words and unit of a real (x) or imaginary (y) part such as ``Re tip [mm]``; None if it is none."""
    words = re.findall(r"[^\W_]+", header.name.lower())
    rest = [word for word in words if word not in NAMES["part"][kind]]
    return None if len(rest) == len(words) or not header.unit else (*rest, header.unit)
