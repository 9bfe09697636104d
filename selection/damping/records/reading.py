"""Reading CSV tables and records: every cell is checked, and the first problem in file order is named.

File content is never evaluated. A cell is a number or text.
"""

import re
from array import array
from collections.abc import Collection, Container, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, IntArray
from damping.errors import InputError, check_whole, describe_nearest, naming
from damping.records import keys
from damping.records.record import CellProblem, Record, find_problems, read_numbers, require_columns
from damping.records.text import (
    DEFAULT_MAX_SIZE,
    NUMBER,
    CsvRows,
    count,
    describe_separator,
    describe_shortened,
    read_bytes,
    unguarded,
)

MOST_ROWS = 250_000  #: most rows of a table: a bound on memory and time
MOST_COLUMNS = 2000  #: most columns of a header: a bound on memory and time
_BLOCK = 100_000  # cells processed together
_FEW = 10_000  # most different labels of a column that are stored once each
_BETWEEN = "\0"  # occurs in no cell: a file with a NUL byte is refused as not text
_CODE = re.compile(r"\s*[+-]?0\d")  # labels such as 007 stay text in columns that need no numbers


def read_table(
    path: str | Path,
    *,
    required: Iterable[str] = (),
    text_columns: Iterable[str] = (),
    max_size: int = DEFAULT_MAX_SIZE,
) -> pd.DataFrame:
    """The table of a CSV file (UTF-8, commas, one header row), rows in file order, index 0..n-1.

    ``required`` columns must exist and, unless they are among ``text_columns``, hold a finite number in every cell.
    Any other column becomes floats if all its cells are numbers and otherwise stays text; ``text_columns`` are always
    text.

    Raises InputError, naming file, line and column, for the first problem in file order: a file that is missing, a
    folder, larger than ``max_size`` bytes, empty, not UTF-8 or without data rows; missing, repeated or nameless
    columns; a row with more or fewer cells than the header; text, NaN, infinity or an empty cell in place of a number.
    """
    needed, text = tuple(required), tuple(text_columns)
    columns = _Columns(required=needed, numbers=[name for name in needed if name not in text], text=text)
    with naming(path):
        scan = _scan(read_bytes(path, max_size), columns)
        scan.raise_first()
    return scan.frame


def read_record(path: str | Path, *, max_size: int = DEFAULT_MAX_SIZE) -> Record:
    """The record of a CSV file, checked.

    Raises InputError for all that ``read_table`` refuses, for the problems that
    :func:`damping.records.record.find_problems` finds, and for an unlabelled sweep. A cell of ``mass`` may be empty:
    the mode file's mass then holds.
    """
    check_whole(max_size=max_size)
    with naming(path):
        if str(path).lower().endswith(".toml"):
            raise InputError("a TOML file in the place of a record", expected="RECORD.csv")
        return parse_record(read_bytes(path, max_size), str(path))


def parse_record(data: bytes, source: str) -> Record:
    """The record in the bytes of a CSV file that is called ``source``. InputError: as of :func:`read_record`."""
    numbers = [name for name in keys.REQUIRED_COLUMNS + keys.OPTIONAL_COLUMNS if name not in keys.TEXT_COLUMNS]
    columns = _Columns(keys.REQUIRED_COLUMNS, numbers, keys.TEXT_COLUMNS, keys.BLANK_COLUMNS)
    with naming(source):
        scan = _scan(data, columns)
        for problem in find_problems(scan.frame):
            scan.add(problem)
        scan.raise_first()
    return Record.trusted(scan.frame, source)


@dataclass(frozen=True)
class _Columns:
    """Columns that must exist, hold numbers, hold text, and may have empty cells among their numbers."""

    required: Sequence[str]
    numbers: Collection[str]
    text: Collection[str]
    blank: Collection[str] = ()


@dataclass
class _Scan:
    """Result of one pass over a file: the table, the line on which each row starts, and problems with their places."""

    frame: pd.DataFrame
    lines: IntArray
    problems: list[tuple[int, int, InputError]] = field(default_factory=list)

    def add(self, problem: CellProblem) -> None:
        """Note a problem with a cell, or with a row as a whole."""
        line, message = int(self.lines[problem.row]), problem.describe("line", self.lines)
        error = InputError(message, line=line, column=problem.column, expected=problem.expected)
        self.problems.append((line, problem.place(self.frame), error))

    def raise_first(self) -> None:
        """Raise the first problem in file order, if there is one."""
        if self.problems:
            raise min(self.problems, key=lambda problem: problem[:2])[2]


def _scan(data: bytes, columns: _Columns) -> _Scan:
    """Read a table; problems with the file or its header are raised, problems with rows are noted."""
    rows = CsvRows(data)
    header_line, header = next(rows, (1, []))
    if not header:
        raise rows.problem or InputError("the file is empty", expected="a header row")
    names = _list_names(header, header_line)
    require_columns(columns.required, names, line=header_line)
    growing: dict[str, list[str]] = {name: [] for name in names}
    lines, problem = _data(rows, list(growing.values()), describe_separator(names))
    if not len(lines):
        raise problem or InputError("no data rows", expected="at least one row below the header")
    scan = _Scan(pd.DataFrame(columns=names), lines)
    if problem is not None:
        scan.problems.append((problem.line or 0, -1, problem))
    scan.frame = pd.DataFrame({name: _column(scan, name, growing.pop(name), columns) for name in names}, copy=False)
    return scan


def _list_names(header: list[str], line: int) -> list[str]:
    """Column names, stripped; each must be nonempty and unique."""
    if len(header) > MOST_COLUMNS:
        raise InputError(f"{len(header)} columns", line=line, expected=f"at most {MOST_COLUMNS}")
    names = [unguarded(name.strip()) for name in header]
    seen: set[str] = set()
    for position, name in enumerate(names):
        if not name:
            raise InputError(f"column {position + 1} has no name", line=line, expected="a name in each cell")
        if name in seen:
            raise InputError("occurs twice", line=line, column=describe_shortened(name), expected="each column once")
        seen.add(name)
    return names


def _data(rows: CsvRows, growing: Sequence[list[str]], remark: str) -> tuple[IntArray, InputError | None]:
    """Lines of the rows up to the first unreadable or ragged row, and the problem with that row.

    ``remark`` on the header goes with a ragged row. Cells are joined to their columns in blocks of rows, so that memory
    stays at a few times the size of the file.
    """
    lines = array("q")
    block: list[list[str]] = []
    problem = None
    for line, row in rows:
        if len(row) != len(growing):
            message = f"{count(len(row), 'cell')} in the row{remark}"
            problem = InputError(message, line=line, expected=f"{len(growing)} as in the header")
            break
        if len(lines) == MOST_ROWS:
            problem = InputError(f"more than {MOST_ROWS} rows", line=line, expected="a smaller table")
            break
        lines.append(line)
        block.append(row)
        if len(block) * len(growing) >= _BLOCK:
            _grow(growing, block)
            block = []
    _grow(growing, block)
    return np.frombuffer(lines, dtype=np.int64) if lines else np.empty(0, np.int64), problem or rows.problem


def _grow(growing: Sequence[list[str]], block: list[list[str]]) -> None:
    for column, cells in zip(growing, zip(*block, strict=True), strict=False):  # no block, nothing to add
        column.append(_BETWEEN.join(cells))


def _column(scan: _Scan, name: str, blocks: Sequence[str], columns: _Columns) -> pd.Series:
    """One column as floats or as text; the first invalid cell is noted as a problem."""
    if name in columns.text:
        text = _list_labels(blocks, strip=True)
        if name in columns.required and "" in text:
            scan.add(CellProblem(text.index(""), name, "empty cell", "text"))
        return pd.Series(text, dtype=object)
    numbers: list[FloatArray] = []
    for block in blocks:
        cells = block.split(_BETWEEN)
        values = _read_floats(cells)
        wrong = np.flatnonzero(~np.isfinite(values))
        if name not in columns.numbers and (len(wrong) or any(_CODE.match(cell) for cell in cells)):
            return pd.Series(_list_labels(blocks, strip=False), dtype=object)
        bad = next((int(k) for k in wrong if name not in columns.blank or cells[k].strip()), None)
        if bad is not None:
            row = sum(map(len, numbers)) + bad
            special = keys.IN_TEXT if cells[bad].strip() else keys.IN_BLANK
            expected = special.get(name, keys.A_NUMBER)
            scan.add(CellProblem(row, name, _describe_wrong(cells[bad]), expected))
        numbers.append(values)
    return pd.Series(np.concatenate(numbers), copy=False)


def _list_labels(blocks: Sequence[str], *, strip: bool) -> list[str]:
    """The column as text; equal labels share one object as long as there are few."""
    known: dict[str, str] = {}
    labels = []
    for cell in (cell for block in blocks for cell in block.split(_BETWEEN)):
        text = unguarded(cell.strip() if strip else cell)
        labels.append(known.setdefault(text, text) if len(known) < _FEW else known.get(text, text))
    return labels


def _read_floats(cells: Sequence[str]) -> FloatArray:
    """Numbers in the cells (n,), NaN for other content. Digits are 0-9, without grouping marks."""
    joined = "".join(cells)
    if joined.isascii() and "_" not in joined:
        try:
            return np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
        except ValueError:
            pass  # some cell holds text
    return np.array([float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells], dtype=np.float64)


def _describe_wrong(cell: str) -> str:
    text = cell.strip()
    if not text:
        return "empty cell"
    try:
        float(text)
    except ValueError:
        return f"{describe_shortened(text)!r} is not a number"
    return f"{describe_shortened(text)!r} is not a finite number written with the digits 0-9"


def require_column(
    table: pd.DataFrame, name: str, file: str | Path | None = None, line: int | None = None, why: str = ""
) -> None:
    """InputError for a missing or repeated column; ``file``, ``line`` of the header, ``why`` the column is needed."""
    if name not in table.columns:
        nearest = describe_nearest(name, map(str, table.columns))
        expected = f"{nearest} or another column" if nearest else "a table with columns"
        raise InputError(f"no column {name!r}{why}", file=file, line=line, expected=expected)
    if list(table.columns).count(name) > 1:
        raise InputError("two columns of this name", file=file, line=line, column=name, expected="each name once")


def take_numbers(
    table: pd.DataFrame, names: Iterable[str], source: str | None = None, text: Container[str] = ()
) -> pd.DataFrame:
    """The table with the columns of ``names`` as floats; those in ``text`` that hold no numbers stay as they are.

    InputError: a column that is missing, repeated, or has a cell without a finite number (or, in ``text``, a label).
    """
    numbers: dict[str, FloatArray] = {}
    for name in names:
        require_column(table, name, source)
        good, expected = table[name].notna().to_numpy(dtype=bool), "text"
        if name not in text or pd.api.types.is_numeric_dtype(table[name]):
            numbers[name] = read_numbers(table[name], name, source, also="boolean")  # 0 and 1 say whether
            good, expected = np.isfinite(numbers[name]), keys.A_NUMBER
        if not good.all():
            row = int(np.argmin(good))
            message = f"{str(table[name].iloc[row])!r} in row {row}"
            raise InputError(message, file=source, column=name, expected=expected)
    return table.assign(**numbers)
