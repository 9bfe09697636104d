"""Tables of text: how one is laid out, the name, unit and scaling in its headers, and the role that a name has.

``Accel [g rms]`` is a name, a unit and a scaling; ``F [N]`` is a force and ``f [Hz]`` a frequency, told by the unit.
"""

from __future__ import annotations

import csv
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
    name, within = (match[1].strip(), match[2]) if match else (text.strip(), "")
    scaled = _SCALING.search(within) if within else None
    if scaled is None:
        return ColumnHeader(text, name, within)
    kind = "peak-to-peak" if scaled["pp"] else "rms" if scaled["rms"] else "peak"
    return ColumnHeader(text, name, within[: scaled.start()].strip(), kind)


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
        motion = next((kind for kind, names in RESPONSE_NAMES.items() if header.name.lower() in names), None)
        if (
            motion
            and place not in places.values()
            and _may_be(motion, header)
            and not {"response", "amplitude"} & set(places)
        ):
            places["response" if is_time else "amplitude"], response = place, motion
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


DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
#: Marks that separate the decimals of a number.
DECIMALS = ("point", "comma")
#: Lines that are looked at.
LOOKED_AT = 60
_COMMENTS = ("#", "%")
_NUMBER = {
    "point": re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|nan|NaN|NA|--|"),
    "comma": re.compile(r"[+-]?(\d+,?\d*|,\d+)([eE][+-]?\d+)?|nan|NaN|NA|--|"),
}
_WITH_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")


@dataclass(frozen=True)
class Layout:
    """``delimiter`` and ``decimal`` by name; names of the columns; ``comments``: lines of comment are passed over.

    ``header`` counts the lines from the first looked at up to and with the header; ``names`` are numbers from 1 where
    there is none.
    """

    delimiter: str
    decimal: str
    names: tuple[str, ...]
    header: int
    comments: bool
    numbered: bool


def find_layout(lines: Sequence[str], delimiter: str, decimal: str) -> Layout | None:
    """The layout of a table by its first lines, None where they hold nothing.

    Args:
        lines: from the line on which the header is expected. delimiter, decimal: names, or ``auto``.
    """
    content = [(k, line.strip(" \r\n")) for k, line in enumerate(lines[:LOOKED_AT]) if line.strip()]
    data = [(k, line) for k, line in content if not line.lstrip().startswith(_COMMENTS)]
    mark = delimiter if delimiter != "auto" else _describe_delimiter([line for _, line in data or content])
    point = decimal if decimal != "auto" else _describe_decimal([line for _, line in data[1:]], mark)
    if not content:
        return None
    first, text = content[0]
    plain = not text.startswith(_COMMENTS)
    if plain or not data:  # comments begin none of the lines: the first is the header
        names = _list_cells(text, mark)
        if not _numeric(names, point) or not data:
            return Layout(mark, point, tuple(names), first + 1, False, False)
    place, row = data[0]
    cells = _list_cells(row, mark)
    if not _numeric(cells, point):
        return Layout(mark, point, tuple(cells), place + 1, not plain, False)
    above = [line.lstrip("#% ") for k, line in content if k < place]
    named = _list_cells(above[-1], mark) if above else []
    if len(named) == len(cells):
        return Layout(mark, point, tuple(named), place, True, False)
    return Layout(mark, point, tuple(str(k + 1) for k in range(len(cells))), place, True, True)


def _list_cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=DELIMITERS[delimiter], skipinitialspace=delimiter == "space"), [])
    except csv.Error:
        return [line]


def _numeric(cells: Sequence[str], decimal: str) -> bool:
    """Whether all cells are numbers, and one at least is not empty."""
    texts = [cell.strip() for cell in cells]
    return any(texts) and all(_NUMBER[decimal].fullmatch(text) for text in texts)


def _describe_delimiter(lines: Sequence[str]) -> str:
    """The mark that cuts every line alike into cells of which the last line has two numbers or more; else comma."""
    for name in ("tab", "semicolon", "comma", "space"):
        rows = [_list_cells(line, name) for line in lines]
        widths = {len(row) for row in rows[-5:]}
        last = rows[-1] if rows else []
        numbers = sum(bool(cell.strip()) and any(_NUMBER[d].fullmatch(cell.strip()) for d in DECIMALS) for cell in last)
        even = len(widths) == 1 and len(last) > 1 and numbers >= min(2, len(last))
        if even and (name != "comma" or DELIMITERS["semicolon"] not in lines[0]):
            return name
    heads = [name for name in ("semicolon", "tab") if lines and DELIMITERS[name] in lines[0]]
    return heads[0] if heads else "comma"


def _describe_decimal(lines: Sequence[str], delimiter: str) -> str:
    """``comma`` where numbers have commas and none has a point."""
    if delimiter == "comma":
        return "point"
    cells = [cell.strip() for line in lines[:20] for cell in _list_cells(line, delimiter)]
    commas = any(_WITH_COMMA.fullmatch(cell) for cell in cells)
    points = any("." in cell and _NUMBER["point"].fullmatch(cell) for cell in cells)
    return "comma" if commas and not points else "point"
