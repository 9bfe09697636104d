"""Excel workbooks (XLSX) to text: the cells of a sheet between tabs, numbers in full.

Only values are read, those of formulas as the spreadsheet stored them; nothing is computed and no link is followed.
"""

import io
import warnings
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from damping.errors import AnalysisError, InputError
from damping.formats.cells import are_in_threes, find_decimal, write_plainly
from damping.records.text import describe_shortened

if TYPE_CHECKING:
    from openpyxl.worksheet._read_only import ReadOnlyWorksheet

MOST_COLUMNS = 1000  #: Columns that are read: a bound for a stray cell far to the right.
MOST_ROWS = 1_048_576  #: Rows of a sheet, by its format: a damaged number of a row is as many rows without a cell.
_EXPECTED = "a workbook (XLSX), or its sheet saved as CSV"


def is_workbook(path: str | Path) -> bool:
    """Whether a file is packed as a workbook is."""
    try:
        with zipfile.ZipFile(path) as packed:
            return any(name.startswith("xl/") for name in packed.namelist())
    except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError):  # it is none, or its directory is damaged
        return False


def read_workbook(data: bytes, most: int, chosen: Sequence[int], decimal: str) -> bytes:
    """The one sheet with cells as text; ``chosen``: its number from 1, if several have; ``decimal`` as below.

    InputError: as of :func:`list_sheets`, or several sheets without a choice.
    """
    sheets = list_sheets(data, most, decimal, chosen)
    if len(sheets) != 1:
        lines = {sheet: text.splitlines() for sheet, text in sheets.items()}
        widths = {sheet: max(row.count(b"\t") for row in rows) + 1 for sheet, rows in lines.items()}
        sizes = ", ".join(
            f"{number} {describe_shortened(title)!r} ({len(rows)} x {widths[number, title]})"
            for (number, title), rows in lines.items()
        )
        what = f"{len(sheets)} sheets with cells{': ' if sizes else ''}{sizes}"
        raise InputError(what, expected="--dataset N, the number of one with cells")
    return next(iter(sheets.values()))


def list_sheets(data: bytes, most: int, decimal: str, chosen: Sequence[int] = ()) -> dict[tuple[int, str], bytes]:
    """Sheets with cells by number from 1 and title: rows as lines, cells between tabs; hidden ones if chosen.

    ``decimal``: of numbers written as text, which have points here: ``point``, ``comma`` or ``auto``.

    InputError: no workbook, a broken one, one that unpacks to more than ``most`` bytes or whose sheet is as much text.
    AnalysisError: openpyxl is not installed.
    """
    try:
        from openpyxl import load_workbook  # noqa: PLC0415 - for this format alone
    except ModuleNotFoundError:
        needed = "a workbook needs the package openpyxl, which is not installed"
        raise AnalysisError(f"{needed} (pip install 'damping-selection[formats]')") from None
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            if sum(part.file_size for part in packed.infolist()) > most:
                raise InputError(f"unpacks to more than {most} bytes", expected="a smaller file or a larger --max-size")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of styles and checks of cells, which are not read
            book = load_workbook(io.BytesIO(data), read_only=True, data_only=True, keep_links=False)
        sheets = enumerate(book.worksheets, 1)
        wanted = [(k, of) for k, of in sheets if (k in chosen if chosen else of.sheet_state == "visible")]
        tables = {(k, str(sheet.title)): list(_list_rows(sheet, most)) for k, sheet in wanted}
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes the readers of ZIP, XML and cells raise
        raise InputError(f"no workbook that can be read ({error})", expected=_EXPECTED) from None
    return {key: _write_rows(rows, decimal) for key, rows in tables.items() if any(rows)}


def _write_rows(rows: Sequence[list[object]], decimal: str) -> bytes:
    width = max(map(len, rows))
    first = next(k for k, row in enumerate(rows) if len(row) == width)  # those above have cells of their own number
    padded = (row if k < first or not row else [*row, *[""] * (width - len(row))] for k, row in enumerate(rows))
    if decimal == "auto":
        texts = {cell for row in rows for cell in row if isinstance(cell, str)}
        decimal = "point" if are_in_threes(texts) else find_decimal(texts)

    def write(cell: object) -> str:
        return write_plainly(cell, decimal) if decimal != "point" and isinstance(cell, str) else str(cell)

    return "".join("\t".join(map(write, row)) + "\n" for row in padded).encode()


def _list_rows(sheet: "ReadOnlyWorksheet", most: int) -> Iterator[list[object]]:
    """The cells of every row up to its last, texts without breaks; none of an empty row.

    InputError: more than ``MOST_ROWS`` or ``MOST_COLUMNS``, or cells that are together more than ``most`` characters:
    many cells may hold one long text, and a table has as many cells in every row as in its widest.
    """
    width = size = 0
    sheet.reset_dimensions()  # as stated, all rows of a sheet with a stray cell would be as wide as that
    for number, row in enumerate(sheet.iter_rows(values_only=True), 1):
        size += sum(len(value) for value in row if isinstance(value, str))
        width = max(width, len(row))
        if number > MOST_ROWS or size + number * min(width, MOST_COLUMNS) > most:
            what = f"a sheet of more than {MOST_ROWS} rows, or of more than {most} characters"
            raise InputError(what, expected="a smaller sheet, or a larger --max-size")
        cells = [" ".join(str(value or "").split()) if isinstance(value, str | None) else value for value in row]
        while cells and cells[-1] == "":
            cells.pop()
        if len(cells) > MOST_COLUMNS:
            raise InputError(f"a cell in column {len(cells)}", expected=f"at most {MOST_COLUMNS} columns")
        yield cells
