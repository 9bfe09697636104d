"""Universal files split into data sets: start, header fields, axes and place of the values of each.

Data set 58 (function at nodal DOF), revision of 30-Jun-1999: eleven header lines follow the number of the set, then
the values, as text or (58b) as bytes. Header lines are counted, not searched, so that an ID line may read ``-1``.
"""

import re
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import islice

import numpy as np

from damping.errors import InputError
from damping.records.text import describe_shortened

HEADER_LINES = 11
MOST_SETS = 50_000  #: most data sets in a file
#: A closing line after bytes; some programs put a line end before it.
_CLOSING = re.compile(rb"[\r\n]{0,2}[ \t]{0,8}-1[ \t\r]*(?=\n|\Z)")
_END = re.compile(rb"^[ \t]{0,8}-1[ \t\r]*$", re.MULTILINE)
_KIND = re.compile(rb"[ \t]{0,8}(\d{1,6})([bB]?)((?:[ \t]+-?\d{1,12})*)[ \t]*")
_INTEGER = re.compile(rb"\s*[+-]?\d{1,12}\s*")
D_TO_E = bytes.maketrans(b"Dd", b"EE")  #: Fortran's exponent letter to that of C
_MOST_OTHERS = 12  #: most other data set numbers that are listed
_QUANTITIES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force", 17: "time"}
FREQUENCY = 18  #: data type of an abscissa that is frequency (field 1 of record 8 of data set 58)
_TIME = 17  #: data type of an abscissa that is time (field 1 of record 8 of data set 58)


#: Storage of ordinate and uneven abscissa, by whether single precision is stated.
_WIDTHS = {True: (("f4", "f4"), ("f8", "f8")), False: (("f8", "f8"), ("f8", "f4"))}


@dataclass(frozen=True)
class Axis:
    """Data characteristics of an axis: specific data type, and label of the units ('' if there is none)."""

    code: int
    unit: str


#: Directions of data set 58 by code, without their sign; 0 is a scalar.
_AXES = {0: "", 1: "X", 2: "Y", 3: "Z", 4: "X rotation", 5: "Y rotation", 6: "Z rotation"}


@dataclass(frozen=True)
class DataSet:
    """One data set 58: its header, and the place of its values. Points are (node, direction)."""

    number: int  #: from 1
    line: int  #: on which it starts
    title: str  #: the first ID line
    notes: tuple[str, ...]  #: the other ID lines
    function: int
    response_point: tuple[int, int]
    entity: str  #: response entity name
    reference_point: tuple[int, int]
    ordinate: int
    points: int
    even: bool
    first: float
    step: float
    abscissa: Axis
    numerator: Axis
    denominator: Axis
    form: np.dtype[np.void] | None  #: binary storage of a point; None: text
    start: int
    end: int
    units_code: int  #: of the preceding data set 164

    @property
    def parts(self) -> int:
        """Numbers in one value: 1 if real, 2 if complex."""
        return 1 if self.ordinate in (2, 4) else 2

    @property
    def quantity(self) -> str:
        """Quantity of the ordinate, '' if unknown."""
        return _QUANTITIES.get(self.numerator.code, "")

    @property
    def per(self) -> str:
        """Quantity of the denominator of the ordinate, '' if none or unknown."""
        return _QUANTITIES.get(self.denominator.code, "")

    @property
    def is_time(self) -> bool:
        """Whether it is a time history."""
        return self.function == 1 or self.abscissa.code == _TIME

    @property
    def is_force(self) -> bool:
        """Whether it is a force and not a ratio."""
        return self.quantity == "force" and not self.per and self.function != 4

    @property
    def point(self) -> str:
        """Node and direction of the measurement, such as ``node 12 +Z``; marked if it is a force."""
        node, along = self.response_point
        axis = _AXES.get(abs(along), f"direction {abs(along)}")
        sign = "" if not along else "-" if along < 0 else "+"
        return f"{'force at ' if self.is_force else ''}node {node} {sign}{axis}".rstrip()

    @property
    def place(self) -> str:
        """Points of response and reference in words."""
        (node, direction), (at, along) = self.response_point, self.reference_point
        return f"node {node} direction {direction}" + (f" from node {at} direction {along}" if at or along else "")


def find_sets(data: bytes) -> tuple[list[DataSet], list[int]]:
    """The data sets 58 of a universal file in order, at least one, and the numbers of other data sets.

    InputError: no data set 58, one with a truncated or wrong header (the line is named), or more than ``MOST_SETS``.
    """
    sets: list[DataSet] = []
    others: list[int] = []
    place = counted = units_code = 0
    line = 1
    for _ in range(MOST_SETS):
        opening = _END.search(data, place)  # text between sets is skipped
        if opening is None:
            break
        first = opening.end() + 1
        line, counted = line + data.count(b"\n", counted, first), first
        kind_line, place = _take_lines(data, first, 1)
        match = _KIND.fullmatch(kind_line[0]) if kind_line else None
        if match is None:  # two delimiters in a row: the second opens a set
            place = first
            continue
        kind = int(match[1])
        if kind == 58:
            sets.append(_read_set(data, place, line, match, len(sets) + 1, units_code))
            place = sets[-1].end
        else:
            if kind not in others and len(others) < _MOST_OTHERS:
                others.append(kind)
            if kind == 164:
                units_code = _whole(data[place : place + 10].split(b"\n")[0])
            place = _find_end(data, place)
        closing = _CLOSING.match(data, place)
        place = place if closing is None else closing.end() + 1
    else:
        raise InputError(f"more than {MOST_SETS} data sets", expected="a file with fewer")
    if not sets:
        has = f" (it has {', '.join(map(str, others))})" if others else ""
        raise InputError(f"no data set 58{has}", expected="a universal file with functions at nodal DOF")
    return sets, others


def _find_end(data: bytes, place: int) -> int:
    """Start of the closing line from a place on, or the end of the file."""
    closing = _END.search(data, place)
    return len(data) if closing is None else closing.start()


def _take_lines(data: bytes, place: int, count: int) -> tuple[list[bytes], int]:
    """Up to ``count`` lines from a place on, fewer at the end of the file, and the start of the next line."""
    file = BytesIO(data)  # shares the bytes
    file.seek(place)
    return [line.rstrip(b"\r\n") for line in islice(file, count)], file.tell()


def _read_set(data: bytes, place: int, line: int, match: re.Match[bytes], number: int, units_code: int) -> DataSet:
    """The data set 58 with its header at ``place``; ``match``: of the preceding ``line``, with the set's number."""
    lines, start = _take_lines(data, place, HEADER_LINES)
    if len(lines) < HEADER_LINES:
        expected = f"{HEADER_LINES} lines after its number"
        raise InputError("the file ends in the header of a data set 58", line=line + len(lines), expected=expected)
    function = lines[5][:5].strip()
    if function and not _INTEGER.fullmatch(function):
        message = f"{describe_shortened(_describe_decoded(function))!r} is no integer"
        raise InputError(message, line=line + 6, expected="an integer")
    described = _read_form(lines[6], line + 7)
    ordinate, points, spacing = (int(value) for value in described[:3])
    if ordinate not in (2, 4, 5, 6):
        expected = "2 or 4 (real, single or double precision), 5 or 6 (complex)"
        raise InputError(f"ordinate data type {ordinate}", line=line + 7, expected=expected)
    if points < 1:
        raise InputError(f"{points} points", line=line + 7, expected="at least one")
    axes = [Axis(_whole(content[:10]), _describe_text(content[46:80])) for content in lines[7:10]]
    entry = DataSet(
        number=number,
        line=line,
        title=_describe_text(lines[0][:80]),
        notes=tuple(_describe_text(content[:80]) for content in lines[1:5]),
        function=_whole(function),
        response_point=(_whole(lines[5][41:51]), _whole(lines[5][51:55])),
        entity=_describe_text(lines[5][31:41]),
        reference_point=(_whole(lines[5][66:76]), _whole(lines[5][76:80])),
        ordinate=ordinate,
        points=points,
        even=spacing == 1,
        first=described[3],
        step=described[4],
        abscissa=axes[0],
        numerator=axes[1],
        denominator=axes[2],
        form=None,
        start=start,
        end=start if match[2] else _find_end(data, start),
        units_code=units_code,
    )
    return _find_binary_form(data, entry, match[3].split()) if match[2] else entry


def _whole(field: bytes) -> int:
    """The integer in a field of a header; 0 if it is blank or not an integer."""
    return int(field) if _INTEGER.fullmatch(field) else 0


def _read_form(content: bytes, line: int) -> list[float]:
    """Record 7: ordinate type, number of points, spacing, first abscissa, its step; in columns, else between blanks."""
    columns = [content[a:b] for a, b in ((0, 10), (10, 20), (20, 30), (30, 43), (43, 56))]
    for fields in (columns, content.split()[:5]):
        try:
            values = [float(field.strip().translate(D_TO_E) or b"0") for field in fields]
        except ValueError:
            continue
        whole = [abs(value) < 1e12 and value == int(value) for value in values[:3] if value == value]
        if len(values) == 5 and len(whole) == 3 and all(whole):
            return values
    message = f"{describe_shortened(_describe_decoded(content.strip()))!r} does not describe the data"
    raise InputError(message, line=line, expected="ordinate data type, number of points, spacing, first abscissa, step")


def _describe_text(field: bytes) -> str:
    """A text field; '' for NONE."""
    text = _describe_decoded(field).strip(" \0\t")
    return "" if text.upper() == "NONE" else text


def _describe_decoded(content: bytes) -> str:
    """Text decoded as UTF-8, else as the Latin-1 of older programs."""
    try:
        return content.decode()
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _find_binary_form(data: bytes, entry: DataSet, fields: list[bytes]) -> DataSet:
    """A binary set with the storage of one point, and the end of the values.

    The abscissa is as wide as the ordinate, or (uneven spacing, double precision) of single precision; where single
    precision is stated, both may be double (pyuff writes so). The form that is followed by the end of the set is
    chosen. Of the ``fields`` after ``58b``, byte order and floating-point format are used; the number of bytes is not,
    as some programs write half of it.

    InputError: a floating-point format other than IEEE, no byte order, or no form fits.
    """
    byte_order, number_format = (*map(int, fields), 0, 0)[:2]
    if number_format not in (0, 2):
        expected = "2 (IEEE 754) in data set 58b"
        raise InputError(f"floating-point format {number_format}", line=entry.line, expected=expected)
    if byte_order not in (1, 2):
        expected = "1 (little endian) or 2 (big endian) after 58b"
        raise InputError(f"byte order {byte_order}", line=entry.line, expected=expected)
    order = "<" if byte_order == 1 else ">"
    for wide, x in _WIDTHS[entry.ordinate in (2, 5)]:
        form = np.dtype([*([] if entry.even else [("x", order + x)]), ("y", order + wide, (entry.parts,))])
        end = entry.start + entry.points * form.itemsize
        if end <= len(data) and _CLOSING.match(data, end):
            return replace(entry, form=form, end=end)
    message = f"the bytes of {entry.points} values are not followed by the end of the data set"
    raise InputError(message, line=entry.line + 7, expected="as many values as the header says, then a line with -1")
