"""Excel workbooks (XLSX) to text: the cells of the first sheet that has any, between tabs, numbers with every digit.

Only values are read, those of formulas as the spreadsheet stored them; nothing is computed and no link is followed.
"""

import io
import re
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, iterparse

from damping.errors import InputError

_CELL = re.compile(r"([A-Z]{1,3})([0-9]{1,7})")
_MOST_COLUMNS = 1000  # a bound for cells far to the right
#: What a damaged file makes the readers of ZIP and XML raise.
_BROKEN = (zipfile.BadZipFile, zlib.error, ParseError, LookupError, NotImplementedError, RuntimeError, ValueError,
           EOFError, OSError)  # fmt: skip
_EXPECTED = "a workbook (XLSX), or the sheet saved as CSV"


def is_workbook(path: str | Path) -> bool:
    """Whether a packed file is a workbook."""
    try:
        with zipfile.ZipFile(path) as packed:
            return any(name.startswith("xl/") for name in packed.namelist())
    except (zipfile.BadZipFile, NotImplementedError, ValueError, OSError):
        return False


def read_workbook(data: bytes, most: int, chosen: Sequence[int]) -> bytes:
    """The sheet with cells, as lines of cells between tabs; ``chosen``: its number from 1, if there are several.

    InputError: no workbook, a broken one, one that unpacks to more than ``most`` bytes, or several sheets without a
    choice.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            if sum(part.file_size for part in packed.infolist()) > most:
                raise InputError(f"unpacks to more than {most} bytes", expected="a smaller file or a larger --max-size")
            names = packed.namelist()
            shared = list(_read_shared(packed)) if "xl/sharedStrings.xml" in names else []
            sheets = sorted((name for name in names if _SHEET.fullmatch(name)), key=_find_number)
            wanted = [sheets[k - 1] for k in chosen if 0 < k <= len(sheets)] if chosen else sheets
            tables = {_find_number(name): list(_list_rows(packed, name, shared)) for name in wanted}
    except _BROKEN as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"no workbook that can be read ({error})", expected=_EXPECTED) from None
    tables = {number: rows for number, rows in tables.items() if rows}
    if len(tables) != 1:
        sizes = ", ".join(f"{number} ({len(rows)} x {max(map(len, rows))})" for number, rows in tables.items())
        what = f"{len(tables)} sheets with cells{': ' if sizes else ''}{sizes}"
        raise InputError(what, expected="--dataset N, the number of one with cells")
    (rows,) = tables.values()
    width = max(map(len, rows))
    first = next(k for k, row in enumerate(rows) if len(row) == width)  # those above have cells of their own number
    padded = (row if k < first else [*row, *[""] * (width - len(row))] for k, row in enumerate(rows))
    return "".join("\t".join(row) + "\n" for row in padded).encode()


_SHEET = re.compile(r"xl/worksheets/sheet([0-9]{1,4})\.xml")


def _find_number(name: str) -> int:
    return int(_SHEET.fullmatch(name)[1])  # type: ignore[index]


def _list_elements(packed: zipfile.ZipFile, name: str, tag: str) -> Iterator[Element]:
    """Elements of a part by their tag without its namespace, each cleared when the next is taken."""
    with packed.open(name) as stream:
        for _, element in iterparse(stream):
            if element.tag.rpartition("}")[2] == tag:
                yield element
                element.clear()


def _read_shared(packed: zipfile.ZipFile) -> Iterator[str]:
    """Texts of cells, which cells name by their number."""
    for element in _list_elements(packed, "xl/sharedStrings.xml", "si"):
        yield _join_text(element)


def _join_text(element: Element) -> str:
    """The text of a cell in one line."""
    return " ".join("".join(part.text or "" for part in element.iter() if part.tag.endswith("}t")).split())


def _list_rows(packed: zipfile.ZipFile, name: str, shared: list[str]) -> Iterator[list[str]]:
    """The cells of every row that has one that is not empty."""
    for row in _list_elements(packed, name, "row"):
        cells: list[str] = []
        for cell in row:
            place = _CELL.fullmatch(cell.get("r", ""))
            column = _count_columns(place[1]) if place else len(cells) + 1
            if not len(cells) < column <= _MOST_COLUMNS:
                raise InputError(f"a cell at {cell.get('r')}", expected=f"cells in order, at most {_MOST_COLUMNS}")
            cells += [""] * (column - 1 - len(cells)) + [_read_cell(cell, shared)]
        if any(cells):
            yield cells


def _count_columns(letters: str) -> int:
    """A is 1, Z 26, AA 27."""
    number = 0
    for letter in letters:
        number = 26 * number + ord(letter) - ord("A") + 1
    return number


def _read_cell(cell: Element, shared: list[str]) -> str:
    """Text of a cell; '' of an empty one or one whose formula failed."""
    kind = cell.get("t", "n")
    if kind == "inlineStr":
        return _join_text(cell)
    value = next((part.text or "" for part in cell if part.tag.endswith("}v")), "")
    if kind == "s":
        place = int(value)
        return shared[place] if 0 <= place < len(shared) else ""
    return "" if kind == "e" else " ".join(value.split())
