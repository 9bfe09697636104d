"""How a table of text is laid out: its delimiter, decimal mark, comments and header, found in its first lines."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

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
