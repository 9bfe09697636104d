"""A column of a CSV file while it is read: numbers as numbers, text as text, in a few times the memory of the file."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from selection.arrays import FloatArray
from selection.records.text import NUMBER, unguarded

_CODE = re.compile(r"\s*[+-]?0\d")  # 007 where no number is needed is a label, and stays one
_BETWEEN = "\0"  # is in no cell: a file that holds it is no text


class Cells:
    """Cells of one column, some thousand at a time.

    ``is_text``: every cell is text. ``is_numbers``: every cell should be a number; ``bad`` are the first cells that are
    none (or are not finite), as (row, cell). Else the column is of numbers if all its cells are, and its text is kept
    until that is known.
    """

    def __init__(self, is_text: bool, is_numbers: bool) -> None:
        self._is_text, self._is_numbers = is_text, is_numbers
        self._floats: list[FloatArray] = []
        self._joined: list[str] = []
        self._labels: list[str] = []
        self._known: dict[str, str] = {}
        self._rows = 0
        self.all_numbers = not is_text
        self.bad: list[tuple[int, str]] = []

    def add(self, cells: Sequence[str]) -> None:
        """The cells of the next rows."""
        if self._is_text:
            self._labels += [self._once(unguarded(cell.strip())) for cell in cells]
        elif self._is_numbers:
            values = floats(cells)
            for row in map(int, np.flatnonzero(~np.isfinite(values))):
                if not self._noted(cells[row]):
                    self.bad.append((self._rows + row, cells[row]))
            self._floats.append(values)
        else:
            self._undecided(cells)
        self._rows += len(cells)

    def _noted(self, cell: str) -> bool:
        """Whether a wrong cell like this one, blank or not, is noted already."""
        return any(bool(noted.strip()) == bool(cell.strip()) for _, noted in self.bad)

    def _undecided(self, cells: Sequence[str]) -> None:
        self._joined.append(_BETWEEN.join(cells))
        if self.all_numbers:
            values = floats(cells) if not any(_CODE.match(cell) for cell in cells) else np.array([np.nan])
            self.all_numbers = bool(np.isfinite(values).all())
            self._floats.append(values)
        if not self.all_numbers:
            self._floats = []

    def numbers(self) -> FloatArray:
        """The column as floats (n,), NaN where there is no number."""
        parts, self._floats, self._joined = self._floats, [], []
        return np.concatenate(parts)

    def text(self) -> list[str]:
        """The column as text."""
        for joined in self._joined:
            self._labels += [self._once(unguarded(cell)) for cell in joined.split(_BETWEEN)]
        self._joined = []
        return self._labels

    def _once(self, text: str) -> str:
        """The same object for equal labels, as long as there are few."""
        return self._known.setdefault(text, text) if len(self._known) < _FEW else self._known.get(text, text)


_FEW = 10_000


def floats(cells: Sequence[str]) -> FloatArray:
    """Numbers in the cells (n,), NaN where there is none. Digits are 0-9, without grouping marks."""
    joined = "".join(cells)
    if joined.isascii() and "_" not in joined:
        try:
            return np.fromiter(map(float, cells), dtype=np.float64, count=len(cells))
        except ValueError:
            pass  # a cell holds text: look at each
    return np.array([float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells], dtype=np.float64)
