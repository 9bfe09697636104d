"""Headers of columns: the name, unit and scaling in them, and the role that a name has in the tables of laboratories.

``Accel [g rms]`` is a name, a unit and a scaling; ``F [N]`` is a force and ``f [Hz]`` a frequency, told by the unit.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

from damping.errors import InputError
from damping.formats.quantity import unit

_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\[\]]*?)\s*[\])]$")
_SCALING = re.compile(
    r"(?i)[\s_,]*(?:(?P<pp>peak[- ]to[- ]peak|pk-pk|p-p|pkpk|pp)|(?P<rms>rms|eff)|(?P<peak>0-p(?:k|eak)?|peak|pk))\.?$"
)
_ANGLES = {"deg": "degrees", "degree": "degrees", "degrees": "degrees", "°": "degrees", "grad": "", "rad": "radians"}
#: Units of an abscissa in Hz, rad/s and s, in lower case; any other is asked for.
ABSCISSAS: dict[str, dict[str, float]] = {
    "frequency": {"hz": 1.0, "1/s": 1.0, "s^-1": 1.0, "khz": 1e3, "rpm": 1 / 60, "1/min": 1 / 60, "cpm": 1 / 60,
                  "rad/s": 0.5 / pi},
    "omega": {"rad/s": 1.0, "rad/sec": 1.0, "1/s": 1.0, "s^-1": 1.0},
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0},
}  # fmt: skip

#: Names of columns by role, in lower case, without unit; a response of a name is of that type.
ROLE_NAMES: dict[str, tuple[str, ...]] = {
    "sweep": ("sweep", "run", "level", "label"),
    "frequency": ("frequency", "freq", "f", "frequenz"),
    "omega": ("omega",),
    "time": ("time", "t", "zeit"),
    "force": ("force", "f", "kraft", "drive"),
}
RESPONSE_NAMES: dict[str, tuple[str, ...]] = {
    "displacement": ("displacement", "disp", "weg", "auslenkung"),
    "velocity": ("velocity", "vel", "v", "geschwindigkeit"),
    "acceleration": ("acceleration", "accel", "acc", "a", "beschleunigung"),
}


@dataclass(frozen=True)
class ColumnHeader:
    """A column's header: its whole ``text``, the ``name``, the ``unit`` ('' where none) and a name of ``SCALINGS``."""

    text: str
    name: str
    unit: str = ""
    scaling: str | None = None

    @property
    def angle(self) -> str:
        """``degrees`` or ``radians`` where the unit is one of these, else ''."""
        return _ANGLES.get(self.unit.lower(), "")


def parse_header(text: str) -> ColumnHeader:
    """Name, unit and scaling of a header."""
    match = _UNIT.match(text)
    name, of = (match[1].strip(), match[2]) if match else (text.strip(), "")
    scaled = _SCALING.search(of) if of else None
    if scaled is None:
        return ColumnHeader(text, name, of)
    kind = "peak-to-peak" if scaled["pp"] else "rms" if scaled["rms"] else "peak"
    return ColumnHeader(text, name, of[: scaled.start()].strip(), kind)


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
    is_time = "time" in places
    lower = [header.name.lower() for header in headers]
    response = None
    for place, header in enumerate(headers):
        of = next((kind for kind, names in RESPONSE_NAMES.items() if header.name.lower() in names), None)
        if of and place not in places.values() and _may_be(of, header) and not {"response", "amplitude"} & set(places):
            places["response" if is_time else "amplitude"], response = place, of
        elif not is_time and "angle" not in places and _is_angle(header):
            places["angle"] = place
    if not is_time and {"x", "y"} <= set(lower) and "z" not in lower and "amplitude" not in places:
        places |= {"x": lower.index("x"), "y": lower.index("y")}
        places.pop("angle", None)
    return places, response


def _is_angle(header: ColumnHeader) -> bool:
    """Whether a column is a phase whose unit is known, or that of a record."""
    name = header.name.lower()
    return name.startswith("phase") and (bool(header.angle) or (name == "phase" and not header.unit))


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
        return (
            role != "force" and text not in ABSCISSAS["frequency"] and text not in _ANGLES
        )  # volts: a scale may be stated
    order = {"displacement": 0, "velocity": 1, "acceleration": 2}.get(role, 0)
    return powers in ((1, 0, 0), (1, 1, 0)) if role == "force" else powers in ((0, 1, -order), (-1, 1, -order))
