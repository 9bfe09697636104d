"""A record: steady states measured or computed in one or more sweeps, validated on creation, and its CSV text."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from operator import itemgetter
from typing import NamedTuple

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, to_python
from damping.errors import InputError
from damping.records import keys
from damping.records.summary import MOST_SHOWN, Summarised
from damping.records.text import count, describe_meant, describe_separator, describe_shortened, guarded, read_source


class _CopiedTable:
    """The rows of a record: set on creation, and copied at each access."""

    def __get__(self, record: Record | None, owner: type) -> pd.DataFrame:
        if record is None:
            raise AttributeError  # gives the field no default
        return record._rows.copy(deep=pd.__version__ < "3")  # pandas 3 copies cells as they are written

    def __set__(self, record: Record, table: pd.DataFrame) -> None:
        vars(record)["_rows"] = table


@dataclass(frozen=True, eq=False, repr=False)
class Record(Summarised):
    """Steady states, one in each row.

    ``table`` has the columns ``sweep`` (text), ``force``, ``frequency`` (Hz), ``amplitude`` and if given ``phase``
    (rad, lag of displacement behind force), ``energy`` (per cycle), ``mass``, ``amplitude_sd``, ``phase_sd``,
    ``force_sd``, ``added_mass``, ``amplitude_3``, ``phase_3``, ``amplitude_y``, ``phase_y``, ``sweep_rate`` (Hz/s),
    ``time`` (s; floats) and ``decay`` (text), then any others unchanged; rows in file order, index 0..n-1. ``source``
    is the origin, for messages. Records are equal if rows and source are equal.

    A record is immutable: ``table``, also called ``frame``, is a copy at each access; an edited copy makes another
    record. InputError: a problem found by :func:`find_problems`, a column that is missing or not numbers, or no rows.
    """

    table: _CopiedTable = _CopiedTable()
    source: str = "record"
    _rows: pd.DataFrame = field(init=False)
    frame = table

    def __post_init__(self) -> None:
        vars(self)["source"] = read_source(self.source)
        table = _tabulate_typed(self._rows, self.source)
        problems = find_problems(table)
        if problems:
            first = min(problems, key=lambda problem: (problem.row, problem.place(table)))
            what, place = first.describe("row", range(len(table))), _name_row(self._rows.index, first.row)
            message = f"{place} is {what}" if first.column is None else f"{what} in {place}"
            raise InputError(message, file=self.source or None, column=first.column, expected=first.expected)
        vars(self)["_rows"] = table

    @classmethod
    def trusted(cls, frame: pd.DataFrame, source: str) -> Record:
        """A record of rows that are known to be valid; nothing is checked or copied."""
        record = object.__new__(cls)
        vars(record).update(_rows=frame, source=source)
        return record

    def __len__(self) -> int:
        return len(self._rows)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record):
            return NotImplemented
        return self.source == other.source and self.frame.equals(other.frame)

    @property
    def title(self) -> str:
        """The source, and the numbers of rows and sweeps."""
        return f"{self.source}: {count(len(self), 'row')} in {count(len(self.sweeps), 'sweep')}"

    @property
    def shown(self) -> pd.DataFrame:
        """The first rows."""
        return self.frame.head(MOST_SHOWN)

    @property
    def sweeps(self) -> tuple[str, ...]:
        """Labels of the sweeps in order of appearance."""
        return tuple(str(label) for label in self.frame["sweep"].drop_duplicates())

    @property
    def has_phase(self) -> bool:
        """Whether phases were recorded."""
        return "phase" in self.frame.columns

    @property
    def is_decay(self) -> bool:
        """Whether rows are from free decays: labels in ``decay``, or one-row sweeps whose amplitude falls with time."""
        if "decay" in self._rows and _are_labels(self._rows["decay"]).any():
            return True
        if "time" not in self.frame.columns or len(self.sweeps) != len(self) or len(self) < 2:
            return False
        order = np.argsort(self.column("time"), kind="stable")
        return bool(np.all(np.diff(self.column("amplitude")[order]) < 0.0))

    @property
    def input(self) -> str:
        """Column that defines levels: for a decay the amplitude, from which its force follows, else the force."""
        return "amplitude" if self.is_decay else "force"

    def column(self, name: str, default: float | None = None) -> FloatArray:
        """A numeric column as a new array (n,); ``default`` replaces blank cells or a missing column."""
        if default is None:
            return self._rows[name].to_numpy(dtype=np.float64, copy=True)
        values = self.column(name) if name in self._rows.columns else np.full(len(self), np.nan)
        return np.where(np.isnan(values), float(default), values)

    def relative_sd(self, name: str) -> FloatArray:
        """Standard uncertainty of ``amplitude`` or ``force`` over its value (n,); 0 where none is stated."""
        return self.column(f"{name}_sd", 0.0) / self.column(name)

    def masses(self, mode_mass: float) -> FloatArray:
        """Generalized mass of each row (n,): that stated in the row, else ``mode_mass``."""
        return self.column("mass", mode_mass)

    @property
    def added_masses(self) -> FloatArray:
        """Known mass added to the structure in each row (n,); 0 where none is stated."""
        return self.column("added_mass", 0.0)

    def of(self, sweep: str) -> Record:
        """The rows of one sweep. InputError if there is no such sweep."""
        if sweep not in self.sweeps:
            raise InputError(f"no sweep {sweep!r}", file=self.source, expected=f"one of {', '.join(self.sweeps)}")
        return Record.trusted(self.frame[self.frame["sweep"] == sweep].reset_index(drop=True), self.source)


class CellProblem(NamedTuple):
    """A problem with a cell of a record, or (``column`` None) with a row; ``twin``: the row that it repeats."""

    row: int
    column: str | None
    message: str
    expected: str
    twin: int | None = None

    def describe(self, kind: str, numbers: Sequence[int] | np.ndarray) -> str:
        """The message; a twin is named by its number in ``numbers`` (rows,), which count ``kind`` (lines or rows)."""
        return self.message if self.twin is None else f"{self.message} to {kind} {int(numbers[self.twin])}"

    def place(self, table: pd.DataFrame) -> int:
        """Index of the column; -1 for a whole row."""
        return -1 if self.column is None else list(table.columns).index(self.column)


def find_problems(table: pd.DataFrame) -> list[CellProblem]:
    """The first cell of each column outside the range of the record schema, and the first repeated row.

    Problems are force, frequency, amplitude, energy or mass <= 0, |phase| > 2 pi (degrees), a negative standard
    uncertainty (zero means none is stated), magnitudes beyond 1e-50..1e50, and rows identical in every column.
    """
    problems = []
    for name in filter(table.columns.__contains__, keys.COLUMN_TESTS):
        values = table[name].to_numpy(dtype=np.float64)
        bad = [(~test(values) & ~np.isnan(values), wanted) for test, wanted in keys.COLUMN_TESTS[name]]
        failing = [(int(np.argmax(rows)), wanted) for rows, wanted in bad if rows.any()]
        if failing:
            row, wanted = min(failing, key=itemgetter(0))
            problems.append(CellProblem(row, name, f"{values[row]:g}", wanted))
    try:
        repeats = table.duplicated().to_numpy()
    except TypeError:  # lists in a further column have no hash: compared as text
        table = table.astype(str)
        repeats = table.duplicated().to_numpy()
    if repeats.any():
        second = int(np.argmax(repeats))
        twin = int(np.argmax(table.iloc[: second + 1].duplicated(keep="last").to_numpy()))
        problems.append(CellProblem(second, None, "identical in every column", "each measured state once", twin))
    return problems


def require_columns(
    required: Iterable[str], names: Sequence[str], file: str | None = None, line: int | None = None
) -> None:
    """Raise InputError that names the missing required columns, if any."""
    required = tuple(required)
    if not (missing := [name for name in required if name not in names]):
        return
    hint = describe_separator(names) or describe_meant(missing[0], names, likeness=0.6)
    other = " (damping import reads other tables)" * (missing == list(keys.REQUIRED_COLUMNS))
    hint = hint or (f" among {describe_shortened(', '.join(names), 80)}{other}" if names else "")
    message = f"missing column{'s' if len(missing) > 1 else ''} {', '.join(missing)}{hint}"
    of_text = ", separated by commas" if line is not None else ""
    raise InputError(message, file=file, line=line, expected=f"columns {', '.join(required)}{of_text}")


def _name_row(index: pd.Index, row: int) -> str:
    """A row by its position from 0, and by its index label if that differs."""
    label = str(index[row])
    return f"row {row}" if label == str(row) else f"row {row} (labelled {describe_shortened(label)})"


def _are_labels(cells: pd.Series) -> np.ndarray:
    return (cells.notna() & (cells.astype(str).str.strip() != "")).to_numpy(dtype=bool)


def _tabulate_typed(table: pd.DataFrame, source: str) -> pd.DataFrame:
    """A checked copy with labels as text and numbers as floats, rows numbered from 0."""
    file = source or None
    if not isinstance(table, pd.DataFrame):
        raise InputError("no table", file=file, expected=f"a DataFrame with columns {', '.join(keys.REQUIRED_COLUMNS)}")
    if table.empty:
        raise InputError("no data rows", file=file, expected="at least one row")
    require_columns(keys.REQUIRED_COLUMNS, [str(name) for name in table.columns], file)
    typed = table.reset_index(drop=True)
    repeated = table.columns[table.columns.duplicated()]
    if len(repeated):
        raise InputError("two columns of this name", file=file, column=str(repeated[0]), expected="each name once")
    for name in filter(typed.columns.__contains__, (*keys.REQUIRED_COLUMNS, *keys.OPTIONAL_COLUMNS)):
        cells = typed[name]
        if name in keys.TEXT_COLUMNS:
            typed[name], good, expected = cells.astype(str).astype(object), _are_labels(cells), "text"
        else:
            typed[name], expected = read_numbers(cells, name, file), keys.IN_TEXT.get(name, keys.A_NUMBER)
            may_be_blank = cells.isna().to_numpy(dtype=bool) & (name in keys.BLANK_COLUMNS)
            good = np.isfinite(typed[name].to_numpy()) | may_be_blank
        if not good.all():
            row = int(np.argmin(good))
            expected = keys.IN_BLANK.get(name, expected) if pd.isna(cells.iloc[row]) else expected
            message = f"{describe_shortened(str(cells.iloc[row]))!r} in {_name_row(table.index, row)}"
            raise InputError(message, file=file, column=name, expected=expected)
    return typed


def read_numbers(cells: pd.Series, name: str, file: str | None, also: str = "") -> FloatArray:
    """The cells of a column from memory as numbers (n,), NaN for text and blanks.

    InputError: values of a kind in ``keys.NO_NUMBERS`` that is not ``also`` taken, or a number too large.
    """
    if cells.dtype == np.float64:
        return cells.to_numpy(copy=True)
    cells = pd.Series([to_python(cell) for cell in cells], dtype=object) if cells.dtype == object else cells
    kind = pd.api.types.infer_dtype(cells)
    kinds = {pd.api.types.infer_dtype([cell]) for cell in cells} if kind.startswith("mixed") else {kind}
    for kind in sorted(kinds & keys.NO_NUMBERS.keys() - {also}):
        raise InputError(f"holds {kind} values", file=file, column=name, expected=keys.NO_NUMBERS[kind])
    try:
        return np.asarray(pd.to_numeric(cells, errors="coerce").astype(np.float64))
    except (OverflowError, TypeError) as error:  # TypeError: masked, or with a unit
        what = "a number too large" if isinstance(error, OverflowError) else "holds values that are no numbers"
        raise InputError(what, file=file, column=name, expected=keys.A_NUMBER) from None


def energy_per_cycle(record: Record) -> FloatArray:
    """Energy input per cycle of each row (n,), in force times length.

    The column ``energy``; else pi F A sin(phase) (report, section 3.2), which noise may make negative; else, without
    phases, pi F A in the row of largest amplitude of each sweep, taken to be at phase resonance, and NaN elsewhere.
    """
    if "energy" in record.frame.columns:
        return record.column("energy")
    largest = math.pi * record.column("force") * record.column("amplitude")
    if record.has_phase:
        return largest * np.sin(record.column("phase"))
    peaks = record.frame.groupby("sweep", sort=False)["amplitude"].idxmax().to_numpy()
    energy = np.full(len(record), np.nan)
    energy[peaks] = largest[peaks]
    return energy


_BLOCK = 20_000  # rows written together
_QUOTED = re.compile(r'[,"\r\n]')  # the csv module does not quote a lone carriage return


def record_to_csv(record: Record | pd.DataFrame) -> str:
    """A record or any table as CSV: UTF-8 text, commas, LF line ends, no index; NaN and None are empty cells.

    Floats are written as the shortest decimals that read back to the same number, integers without a point. A text
    cell or column name that begins with ``=``, ``+``, ``-``, ``@``, tab or carriage return, which a spreadsheet may
    execute, gets a leading apostrophe unless it is a plain number; ``read_table`` and ``read_record`` remove it.
    """
    table = record.frame if isinstance(record, Record) else record
    parts = [",".join(_describe_cell(str(name)) for name in table.columns) + "\n"]
    for start in range(0, len(table), _BLOCK):
        block = table.iloc[start : start + _BLOCK]
        columns = [[_describe_cell(value) for value in block.iloc[:, i].tolist()] for i in range(block.shape[1])]
        parts.append("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)))
    return "".join(parts)


def _describe_cell(value: object) -> str:
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float | np.floating):
        return repr(float(value))
    text = guarded(value) if isinstance(value, str) else str(value)
    return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text
