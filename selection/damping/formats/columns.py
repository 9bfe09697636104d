"""CSV files with a column map: the columns that have a role, as numbers, and the units in their headers.

Lines are taken one at a time and only the mapped columns are kept, so that memory stays below a few times the file.
"""

from __future__ import annotations

import csv
import io
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.records.keys import nearest
from damping.records.text import decode, shortened, unguarded

DELIMITERS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": " "}
_UNIT = re.compile(r"^(.*?)\s*[\[(]\s*([^\[\]]*?)\s*[\])]$")
#: Marks that separate the decimals of a number.
DECIMALS = ("point", "comma")
#: Numbers as they look with the other mark than the stated one.
_OTHER_MARK = {
    mark: re.compile(rf"[+-]?\d*{other}\d*([eE][+-]?\d+)?") for mark, other in (("point", ","), ("comma", r"\."))
}
_LONGEST_LINE = 1_000_000
_MISSING = ("", "nan", "NaN", "NA", "--")


@dataclass(frozen=True)
class ColumnMap:
    """Mapped columns by role: numbers (n,), text for the role ``sweep``, and the units their headers name."""

    numbers: Mapping[str, FloatArray]
    sweep: tuple[str, ...] | None
    units: Mapping[str, str]
    names: Mapping[str, str]


def read_columns(
    data: bytes,
    file: str | Path,
    mapped: Mapping[str, str],
    known: Mapping[str, Iterable[str]],
    delimiter: str,
    skip: int,
    decimal: str = "point",
) -> ColumnMap:
    """The columns of a CSV file that have a role.

    Args:
        data: the file. file: its name, for messages.
        mapped: column of each role as the user states it, with or without its unit; empty: by name.
        known: names, in lower case and without units, that columns of each role have; used where nothing is mapped.
        delimiter: a name of ``DELIMITERS``; with ``space`` several count as one.
        skip: lines before the header. decimal: ``point`` or ``comma``, the mark in numbers.

    Raises:
        InputError: no text in UTF-8, no header, a mapped column that is missing, a ragged row, text where a number
            belongs (an empty cell and NaN are no measurement there), or no rows.
    """
    rows = _Rows(data, file, delimiter)
    for _ in range(skip):
        rows.skip()
    header = next(rows, None)
    if header is None:
        raise InputError("no header", file=file, expected=f"a row of column names after {skip} lines")
    names = [unguarded(name.strip().lstrip("#%").strip()) for name in header]
    places = _places(names, mapped, known, file, rows.line)
    if not places:
        raise _no_role(names, file, rows.line)
    values = {role: array("d") for role in places if role != "sweep"}
    labels: list[str] | None = [] if "sweep" in places else None
    for row in rows:
        if len(row) != len(names):
            raise InputError(
                f"{len(row)} cells in the row", file=file, line=rows.line, expected=f"{len(names)} as in the header"
            )
        for role, column in values.items():
            column.append(_number(row[places[role]], decimal, file, rows.line, names[places[role]]))
        if labels is not None:
            labels.append(unguarded(row[places["sweep"]].strip()))
    numbers = {role: np.frombuffer(column, dtype=np.float64) for role, column in values.items() if len(column)}
    if not numbers:
        raise InputError("no data rows", file=file, expected="at least one row below the header")
    units = {role: match[2] for role, place in places.items() if (match := _UNIT.match(names[place]))}
    return ColumnMap(
        numbers, None if labels is None else tuple(labels), units, {r: names[p] for r, p in places.items()}
    )


class _Rows:
    """Iterator over the rows of a file as lists of cells, blank ones passed over; ``line`` is that of the last."""

    def __init__(self, data: bytes, file: str | Path, delimiter: str) -> None:
        self.file, self.line = file, 0
        data = data.removeprefix(b"\xef\xbb\xbf")
        self._stream = io.BytesIO(data if b"\n" in data else data.replace(b"\r", b"\n"))  # old Macintosh line ends
        self._reader = csv.reader(
            self._lines(), delimiter=DELIMITERS[delimiter], strict=True, skipinitialspace=delimiter == "space"
        )

    def _lines(self) -> Iterator[str]:
        for line in self._stream:
            self.line += 1
            if len(line) > _LONGEST_LINE:
                raise InputError(
                    f"a line of {len(line)} bytes", file=self.file, line=self.line, expected="cells in rows"
                )
            text, broken = decode(line, self.file)
            if broken is not None:
                raise InputError(broken.message, file=self.file, line=self.line, expected=broken.expected)
            yield text.rstrip(" \r\n") + "\n"

    def skip(self) -> None:
        self.line += bool(self._stream.readline())

    def __iter__(self) -> Iterator[list[str]]:
        return self

    def __next__(self) -> list[str]:
        while True:
            try:
                cells = next(self._reader)
            except csv.Error as error:
                raise InputError(
                    f"not CSV: {error}", file=self.file, line=self.line, expected="cells separated as stated"
                ) from None
            if len(cells) > 1 or (cells and cells[0].strip()):
                return cells


def _number(cell: str, decimal: str, file: str | Path, line: int, column: str) -> float:
    """The number in a cell; NaN where nothing was measured. A mark between thousands is no number."""
    text = cell.strip()
    if text in _MISSING:
        return float("nan")
    other, mark = (",", ".") if decimal == "point" else (".", ",")
    try:
        if "_" not in text and other not in text and text.isascii():
            return float(text.replace(mark, "."))
    except ValueError:
        pass
    name = "comma" if decimal == "point" else "point"
    hint = f" (is --decimal {name} meant?)" if _OTHER_MARK[decimal].fullmatch(text) else ""
    raise InputError(
        f"{shortened(text)!r} is not a number{hint}",
        file=file,
        line=line,
        column=shortened(column),
        expected=f"a number with a decimal {decimal}",
    )


def _places(
    names: list[str], mapped: Mapping[str, str], known: Mapping[str, Iterable[str]], file: str | Path, line: int
) -> dict[str, int]:
    """Position of the column of each role; stated ones by name, else those whose name is known."""
    bare = [_UNIT.sub(r"\1", name).strip() for name in names]
    if not mapped:
        lower = [name.lower() for name in bare]
        found = {role: [name for name in named if name in lower] for role, named in known.items()}
        for first in (matches[0] for matches in found.values() if matches):
            if lower.count(first) > 1:
                expected = "one, or --column ROLE=NAME"
                raise InputError(f"several columns are {shortened(first)!r}", file=file, line=line, expected=expected)
        return {role: lower.index(matches[0]) for role, matches in found.items() if matches}
    places: dict[str, int] = {}
    for role, name in mapped.items():
        matches = [i for i, pair in enumerate(zip(names, bare, strict=True)) if name.strip() in pair]
        exact = [i for i in matches if names[i] == name.strip()]
        if len(exact or matches) != 1:
            alike = nearest(name, names, likeness=0.5)
            meant = f" (is {shortened(alike)!r} meant?)" if alike else ""
            hint = "" if matches else _other_delimiter(names) or meant
            message = f"{'several columns are' if matches else 'no column'} {shortened(name)!r}{hint}"
            raise InputError(message, file=file, line=line, expected=f"one of {shortened(', '.join(names), 100)}")
        places[role] = (exact or matches)[0]
    return places


def _no_role(names: list[str], file: str | Path, line: int) -> InputError:
    expected = f"--column ROLE=NAME; it has {shortened(', '.join(names), 100)}"
    message = f"no column has the name of a role{_other_delimiter(names)}"
    return InputError(message, file=file, line=line, expected=expected)


def _other_delimiter(names: list[str]) -> str:
    """A hint where the header is one cell that holds the mark of another delimiter."""
    marks = ((name, DELIMITERS[name]) for name in ("semicolon", "tab", "comma"))
    other = next((name for name, mark in marks if len(names) == 1 and mark in names[0]), None)
    return f" (is --delimiter {other} meant?)" if other else ""
