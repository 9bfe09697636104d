"""Universal files cut into data sets: where each begins, its header fields and axes, and where its values are.

Data set 58 (function at nodal DOF), revision of 30-Jun-1999: eleven header lines follow the number of the set, then
the values, as text or (58b) as bytes. Header lines are counted, not searched, so that an ID line may read ``-1``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.errors import InputError
from damping.formats.quantity import unit
from damping.formats.series import Summary
from damping.records.text import describe_shortened

HEADER_LINES = 11
#: Data sets of a file that are looked at.
MOST_SETS = 50_000
_CLOSING = re.compile(
    rb"[\r\n]{0,2}[ \t]{0,8}-1[ \t\r]*(?=\n|\Z)"
)  # after bytes, where some programs end the line first
_END = re.compile(rb"^[ \t]{0,8}-1[ \t\r]*$", re.MULTILINE)
_KIND = re.compile(rb"[ \t]{0,8}(\d{1,6})([bB]?)((?:[ \t]+-?\d{1,12})*)[ \t]*")


@dataclass(frozen=True)
class UffBlock:
    """One data set: its number ``kind``, whether ``binary``, the line it starts on, where its contents are.

    ``header`` are the eleven lines of a set 58; ``fields`` the integers after ``58b``; ``closed``: a closing line was
    found.
    """

    kind: int
    binary: bool
    line: int
    fields: tuple[int, ...]
    header: tuple[bytes, ...]
    start: int
    end: int
    closed: bool


@dataclass(frozen=True)
class Axis:
    """Data characteristics of an axis: specific data type, label and label of the units ('' where there is none)."""

    code: int
    label: str
    unit: str


@dataclass(frozen=True)
class Header:
    """Fields of the header of a data set 58; ``title`` is the first ID line, ``notes`` are the others."""

    title: str
    notes: tuple[str, ...]
    function: int
    response_point: tuple[int, int]
    reference_point: tuple[int, int]
    ordinate: int
    points: int
    even: bool
    first: float
    step: float
    abscissa: Axis
    numerator: Axis
    denominator: Axis


class _Lines:
    """Lines of the file from a place on; ``number`` is that of the line last read."""

    def __init__(self, data: bytes) -> None:
        self.data, self.place, self.number = data, 0, 0

    def next(self) -> bytes | None:
        if self.place >= len(self.data):
            return None
        end = self.data.find(b"\n", self.place)
        end = len(self.data) if end < 0 else end
        line = self.data[self.place : end].rstrip(b"\r")
        self.place, self.number = end + 1, self.number + 1
        return line

    def back(self, line: bytes | None) -> None:
        """To the start of the line just read."""
        if line is not None:
            self.place = max(self.data.rfind(b"\n", 0, self.place - 1) + 1, 0)
            self.number -= 1

    def skip_to(self, place: int) -> None:
        self.number += self.data.count(b"\n", self.place, place)
        self.place = place


def blocks(data: bytes, end_of_bytes: Callable[[UffBlock], int]) -> Iterator[UffBlock]:
    """The data sets of a universal file in order; ``end_of_bytes`` tells where the values of a binary one end.

    Raises:
        InputError: a header of a data set 58 is cut off, or what ``end_of_bytes`` raises.
    """
    lines = _Lines(data)
    for _ in range(MOST_SETS):
        opening = _END.search(data, lines.place)  # nothing of ours between sets
        if opening is None:
            return
        lines.skip_to(opening.start())
        lines.next()
        line = lines.next()
        match = _KIND.fullmatch(line) if line is not None else None
        if line is None or match is None:  # two delimiters in a row: the second opens a set
            lines.back(line)
            continue
        block = _block(lines, match)
        if block.binary:
            block = replace(block, end=end_of_bytes(block), closed=True)
        yield block
        lines.skip_to(block.end)
        closing = _END.match(data, lines.place) or _CLOSING.match(data, lines.place)
        if closing is not None:
            lines.skip_to(closing.end())
            lines.next()
    raise InputError(f"more than {MOST_SETS} data sets", expected="a file with fewer")


def _block(lines: _Lines, match: re.Match[bytes]) -> UffBlock:
    kind, number = int(match[1]), lines.number
    fields = tuple(int(field) for field in match[3].split())
    header: list[bytes] = []
    if kind == 58:
        for _ in range(HEADER_LINES):
            line = lines.next()
            if line is None:
                raise InputError(
                    "the file ends in the header of a data set 58",
                    line=lines.number,
                    expected=f"{HEADER_LINES} lines after its number",
                )
            header.append(line)
    end = _END.search(lines.data, lines.place)
    place = len(lines.data) if end is None else end.start()
    binary = kind == 58 and bool(match[2])
    return UffBlock(kind, binary, number, fields, tuple(header), lines.place, place, end is not None)


def header(block: UffBlock) -> Header:
    """The header fields of a data set 58.

    Raises:
        InputError: a field that is needed is no number, or out of range; the line is named.
    """
    lines = block.header
    origin = _Fields(lines[5], block.line + 6)
    form = _form(lines[6], block.line + 7)
    axes = [_axis(lines[i], block.line + i + 1) for i in (7, 8, 9)]
    ordinate, points, spacing = (int(value) for value in form[:3])
    if ordinate not in (2, 4, 5, 6):
        raise InputError(
            f"ordinate data type {ordinate}",
            line=block.line + 7,
            expected="2 or 4 (real, single or double precision), 5 or 6 (complex)",
        )
    if points < 1:
        raise InputError(f"{points} points", line=block.line + 7, expected="at least one")
    return Header(
        title=_describe_text(lines[0], 0, 80),
        notes=tuple(_describe_text(line, 0, 80) for line in lines[1:5]),
        function=origin.integer(0, 5, required=True),
        response_point=(origin.integer(41, 51), origin.integer(51, 55)),
        reference_point=(origin.integer(66, 76), origin.integer(76, 80)),
        ordinate=ordinate,
        points=points,
        even=spacing == 1,
        first=form[3],
        step=form[4],
        abscissa=axes[0],
        numerator=axes[1],
        denominator=axes[2],
    )


@dataclass(frozen=True)
class _Fields:
    """One header line of fixed columns."""

    content: bytes
    line: int

    def integer(self, start: int, end: int, *, required: bool = False) -> int:
        """An integer; 0 where the field is blank or, unless ``required``, no integer."""
        field = self.content[start:end].strip()
        if re.fullmatch(rb"[+-]?\d{1,12}", field):
            return int(field)
        if field and required:
            raise InputError(
                f"{describe_shortened(_describe_decoded(field))!r} is no integer", line=self.line, expected="an integer"
            )
        return 0


def _form(content: bytes, line: int) -> list[float]:
    """Record 7: ordinate type, number of points, spacing, first abscissa, its step; by columns, else by blanks."""
    columns = [content[a:b] for a, b in ((0, 10), (10, 20), (20, 30), (30, 43), (43, 56))]
    for fields in (columns, content.split()[:5]):
        try:
            values = [
                float(field.replace(b"D", b"E").replace(b"d", b"e") or b"0") for field in map(bytes.strip, fields)
            ]
        except ValueError:
            continue
        whole = [abs(value) < 1e12 and value == int(value) for value in values[:3] if value == value]
        if len(values) == 5 and len(whole) == 3 and all(whole):
            return values
    raise InputError(
        f"{describe_shortened(_describe_decoded(content.strip()))!r} does not describe the data",
        line=line,
        expected="ordinate data type, number of points, spacing, first abscissa, step",
    )


def _axis(content: bytes, line: int) -> Axis:
    code = _Fields(content, line).integer(0, 10)
    return Axis(code, _describe_text(content, 26, 46), _describe_text(content, 46, 80))


def _describe_text(content: bytes, start: int, end: int) -> str:
    """A text field; '' for NONE."""
    text = _describe_decoded(content[start:end]).strip(" \0\t")
    return "" if text.upper() == "NONE" else text


def _describe_decoded(content: bytes) -> str:
    """UTF-8, else the Latin-1 of older programs."""
    try:
        return content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1")


#: Length and force of the units codes of data set 164 that need no factors.
_UNIT_CODES = {
    1: ("m", "N"),
    2: ("ft", "lbf"),
    3: ("m", "kgf"),
    5: ("mm", "mN"),
    7: ("in", "lbf"),
    8: ("mm", "kgf"),
} | {10: ("mm", "N")}
_PER_TIME = {"displacement": "", "velocity": "/s", "acceleration": "/s^2"}


def abscissa(x: FloatArray, axis: Axis, is_time: bool, summary: Summary) -> FloatArray:
    """Abscissa in Hz or s."""
    if is_time:
        time = unit(axis.unit or "s", what="unit of time")
        if time.powers != (0, 0, 1):
            raise InputError(f"time in {axis.unit!r}", expected="a unit of time")
        summary.add("time", time.text, "found in the file" if axis.unit else "of the format")
        return x * time.factor
    name = axis.unit.lower()
    factors = {"": 1.0, "hz": 1.0, "hertz": 1.0, "1/s": 1.0, "khz": 1e3, "rpm": 1.0 / 60.0}
    factors |= dict.fromkeys(("rad/s", "rad/sec"), 1.0 / RAD_S_PER_HZ)
    if name not in factors:
        raise InputError(f"frequency in {axis.unit!r}", expected=f"one of {', '.join(filter(None, factors))}")
    summary.add("frequency", axis.unit or "Hz", "found in the file" if axis.unit else "of the format")
    return x * factors[name]


def units(head: Header, quantity: str, per: str, code: int, summary: Summary) -> dict[str, str]:
    """Units of response and force by their labels; where there are none, by the units ``code`` of data set 164.

    ``quantity`` and ``per`` are what the ordinate is and what it is divided by ('' where that is not known).
    """
    texts = {}
    if head.numerator.unit:
        texts["force" if (quantity == "force" and not per) else "response"] = head.numerator.unit
    if head.function == 4 and head.denominator.unit:
        texts["force"] = head.denominator.unit
    if code in _UNIT_CODES:
        length, force = _UNIT_CODES[code]
        if quantity in _PER_TIME and "response" not in texts:
            texts["response"] = length + _PER_TIME[quantity]
            summary.note(f"units code {code} of data set 164 gives {length} and {force}")
        if "force" in (quantity, per):
            texts.setdefault("force", force)
    elif code:
        summary.note(f"units code {code} of data set 164 is not used: it names no units")
    return texts
