"""Text tables: layout, and columns as numbers.

Lines are read one at a time and only the mapped columns are kept, so that memory stays below a few times the file.
"""

import csv
import re
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import islice

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.cells import DECIMALS, DELIMITERS, NUMBER, Thousands, find_decimal, read_clock, read_number
from damping.formats.headers import ColumnHeader, merge_units, parse_header
from damping.formats.roles import ABSCISSA, recognise
from damping.records.keys import LARGEST
from damping.records.text import CsvRows, count, describe_cell, recode, unguarded

_LONGEST_LINE = 1_000_000
_LONGEST_REMARK = 1000  # bytes of a line above the header
_LOOKED_AT = 60  # lines from which the layout is determined
_DAY = 86400.0  # s
_COMMENTS = ("#", "%")
_BREAK = re.compile(r"\s*[\r\n]+\s*|[\u00a0\u2009\u202f]")


@dataclass(frozen=True)
class Layout:
    """Layout of a text table."""

    delimiter: str  #: by name, as the decimal
    decimal: str
    names: tuple[str, ...]  #: of the columns; numbers from 1 if there is no header
    header: int  #: number of lines up to and including the header and the units below it
    comments: bool = False  #: comment lines are skipped
    numbered: bool = False  #: it has no header
    units: bool = False  #: there is a row of units below the names
    encoding: str = ""  #: of the text if it is not UTF-8


def _find_layout(lines: Sequence[str], delimiter: str, decimal: str) -> Layout | None:
    """The layout of a table from its first ``lines``, None if blank; ``delimiter``, ``decimal``: names, or ``auto``."""
    content = [(k, line.strip(" \r\n")) for k, line in enumerate(lines[:_LOOKED_AT]) if line.strip()]
    data = [(k, line) for k, line in content if not line.lstrip().startswith(_COMMENTS)]
    mark = delimiter if delimiter != "auto" else _describe_delimiter([line for _, line in data or content])
    if not content:
        return None
    point = decimal
    if decimal == "auto":  # of numbers between commas it is a point
        few = [line for _, line in data[1:21]] if mark != "comma" else []
        point = find_decimal({cell.strip() for line in few for cell in _list_cells(line, mark)})
    text = content[0][1]
    plain = not text.startswith(_COMMENTS)  # then the first line is the header, or text above it
    if not data or (plain and not _numeric(_list_cells(text, mark), point)):
        return _lay_out(content, mark, point)
    place, row = data[0]
    cells = _list_cells(row, mark)
    if not _numeric(cells, point):
        return Layout(mark, point, tuple(cells), place + 1, comments=not plain)
    above = [line.lstrip("#% ") for k, line in content if k < place]
    named = _list_cells(above[-1], mark) if above else []
    if len(named) == len(cells):
        return Layout(mark, point, tuple(named), place, comments=True)
    return Layout(mark, point, tuple(str(k + 1) for k in range(len(cells))), place, comments=True, numbered=True)


def _lay_out(content: Sequence[tuple[int, str]], mark: str, point: str) -> Layout:
    """Layout of a table that begins with its header, or with lines about the test.

    In the second case the header is the first line with as many cells as the last line, none of them a number; if it
    names no role (``Operator,A.B.`` above two columns), the first such line that names an abscissa.
    """
    rows = [_list_cells(line, mark) for _, line in content]
    width, whole = len(rows[-1]), content[0][1].count('"') % 2 == 0  # else its cells continue on the next line
    fitting = [k for k, row in enumerate(rows) if len(row) == width and not any(_numeric([c], point) for c in row)]
    at = 0 if len(rows[0]) == width or not whole else next(iter(fitting), 0)
    if whole and not _list_roles(rows[at]):
        at = next((k for k in fitting if not _list_roles(rows[k]).isdisjoint(ABSCISSA)), at)
    line, names = content[at][0] + 1, rows[at]
    merged = merge_units(names, rows[at + 1]) if at + 1 < len(rows) else None
    if merged is None:
        return Layout(mark, point, tuple(names), line)
    return Layout(mark, point, tuple(merged), content[at + 1][0] + 1, units=True)


def _list_roles(cells: Sequence[str]) -> set[str]:
    """Roles that cells name if they are headers."""
    return set(recognise([parse_header(cell) for cell in cells]).places)


def _list_cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=DELIMITERS[delimiter], skipinitialspace=delimiter == "space"), [])
    except csv.Error:
        return [line]


def _numeric(cells: Sequence[str], decimal: str) -> bool:
    """Whether all cells are numbers or empty, and at least one is not empty."""
    texts = [cell.strip() for cell in cells]
    return any(texts) and all(NUMBER[decimal].fullmatch(text) for text in texts)


def _describe_delimiter(lines: Sequence[str]) -> str:
    """The delimiter that gives equal rows, the last with two numbers or more; else comma."""
    for name in ("tab", "semicolon", "comma", "space"):
        rows = [_list_cells(line, name) for line in lines]
        widths = {len(row) for row in rows[-5:]}
        last = rows[-1] if rows else []
        numbers = sum(bool(cell.strip()) and any(NUMBER[d].fullmatch(cell.strip()) for d in DECIMALS) for cell in last)
        even = len(widths) == 1 and len(last) > 1 and numbers >= min(2, len(last))
        if even and (name != "comma" or DELIMITERS["semicolon"] not in lines[0]):
            return name
    return next((name for name in ("semicolon", "tab") if lines and DELIMITERS[name] in lines[0]), "comma")


@dataclass(frozen=True)
class TextTable:
    """A text table; the values of its columns are read when they are asked for."""

    data: bytes  #: in UTF-8
    skip: int  #: lines above it
    layout: Layout
    line: int  #: of the header
    headers: tuple[ColumnHeader, ...]
    is_doubtful: bool  #: decimal marks may stand between thousands
    places: tuple[int, ...] = ()  #: of its columns in the file, if it has only some of them
    level: tuple[float, str] | None = None  #: that these are of, with its unit

    @property
    def remarks(self) -> tuple[str, ...]:
        """The lines above the header, of which the first are looked at."""
        above = islice(BytesIO(self.data), min(self.line - 1, _LOOKED_AT))
        return tuple(line[:_LONGEST_REMARK].decode(errors="replace").strip() for line in above)

    def read(self, places: Mapping[str, int]) -> tuple[dict[str, FloatArray], tuple[str, ...] | None]:
        """Numbers (n,) of columns by role, and the text of the role ``sweep``; None if it has no place.

        InputError: a ragged row, text in place of a number (an empty cell or NaN means no measurement, but is an error
        in a time history), or no rows.
        """
        of_file = self.places or range(len(self.headers))
        places, decimal = {role: of_file[place] for role, place in places.items()}, self.layout.decimal
        _, names, rows = _read_header(self.data, self.layout, self.skip)
        values = {role: array("d") for role in places if role != "sweep"}
        gapless = set(values) - {"force"} if "time" in places and not {"frequency", "omega"} & set(places) else set()
        labels: list[str] | None = [] if "sweep" in places else None
        is_clock = False
        thousands = Thousands(decimal, is_possible=self.is_doubtful)
        for line, row in rows:
            if len(row) != len(names):
                expected = f"{len(names)} as in the header"
                raise InputError(f"{count(len(row), 'cell')} in the row", line=line, expected=expected)
            for role, column in values.items():
                cell = row[places[role]]
                clock = read_clock(cell) if role == "time" else None
                column.append(read_number(cell, decimal, line, names[places[role]]) if clock is None else clock)
                is_clock |= clock is not None
                if role in gapless and not abs(column[-1]) <= LARGEST:
                    what = describe_cell(row[places[role]])
                    raise InputError(what, line=line, column=names[places[role]], expected="a number in every row")
            for place in (places[role] for role in values) if thousands.is_possible else ():
                thousands.look_at(row[place], names[place])
            if labels is not None:
                labels.append(unguarded(row[places["sweep"]].strip()))
        if rows.problem is not None:
            raise rows.problem
        numbers = {role: np.frombuffer(column, dtype=np.float64) for role, column in values.items() if len(column)}
        if not numbers:
            raise InputError("no data rows", expected="at least one row below the header")
        if is_clock:  # which starts again at midnight
            numbers["time"] = numbers["time"] + _DAY * np.cumsum(np.diff(numbers["time"], prepend=0.0) < -0.5 * _DAY)
        thousands.require_none()
        return numbers, None if labels is None else tuple(labels)


def open_table(data: bytes, delimiter: str = "auto", skip: int = 0, decimal: str = "auto") -> TextTable:
    """The text table in a file, or in its first bytes. InputError: no header.

    ``delimiter``: a name of ``DELIMITERS`` (with ``space`` several count as one), or ``auto``. ``skip``: lines before
    the header. ``decimal``: ``point`` or ``comma``, the mark in numbers, or ``auto``.
    """
    data, encoding = recode(data)
    start = data.removeprefix(b"\xef\xbb\xbf")[: 4 * _LONGEST_LINE]
    pieces = start.replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n", skip + _LOOKED_AT)
    lines = [piece.decode(errors="replace") for piece in pieces[skip : skip + _LOOKED_AT]]
    if (layout := _find_layout(lines, delimiter, decimal)) is None:
        raise InputError("no header", expected=f"a row of column names after {skip} lines")
    line, names, _ = _read_header(data, layout, skip)
    layout, headers = replace(layout, encoding=encoding), tuple(map(parse_header, names))
    is_doubtful = decimal == "auto" and layout.delimiter != "comma"
    return TextTable(data, skip, layout, line, headers, is_doubtful)


def _read_header(data: bytes, layout: Layout, skip: int) -> tuple[int, list[str], CsvRows]:
    """The line and the names of a header, whose quoted cells may span lines, and the rows below it.

    InputError: no header.
    """
    whole = not (layout.comments or layout.numbered or layout.units)
    above = skip + layout.header - whole
    rows = CsvRows(data, DELIMITERS[layout.delimiter], comments=layout.comments, skip=above)
    line, header = next(rows, (0, None)) if whole else (above, list(layout.names))
    if header is None:
        raise rows.problem or InputError("no header", expected=f"a row of column names after {skip} lines")
    return line, [unguarded(_BREAK.sub(" ", name.strip()).lstrip("#%").strip()) for name in header], rows
