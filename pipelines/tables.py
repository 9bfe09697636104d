"""Tables on the terminal: numbers in columns, cautions as numbered notes below."""

from __future__ import annotations

import math
from collections.abc import Iterable

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table


class Notes:
    """Cautions, each said once and referred to by number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def numbers(self, cautions: Iterable[str]) -> str:
        """Numbers of cautions, new ones added."""
        return " ".join(str(self._numbers.setdefault(caution, len(self._numbers) + 1)) for caution in cautions)

    def show(self, console: Console) -> None:
        """Print the notes in order."""
        for caution, number in self._numbers.items():
            console.print(f"{number:3d}  {caution}", highlight=False)


def show_cautions(console: Console, cautions: Iterable[str]) -> None:
    """Cautions about all that was printed."""
    for caution in cautions:
        console.print(f"Caution: {caution}.", highlight=False)


def plain_table(title: str, right: Iterable[str], left: Iterable[str] = ()) -> Table:
    """A table whose cells never wrap: ``left``-aligned headings first, then ``right``-aligned ones."""
    table = Table(title=title, box=SIMPLE, title_justify="left")
    for heading in left:
        table.add_column(heading, no_wrap=True)
    for heading in right:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def number(value: float, digits: int = 4) -> str:
    """A number to so many digits; a dash for one that does not exist."""
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def console() -> Console:
    """Standard output, wide enough for the tables where it is no terminal.

    Brackets are text: units stand in them, and names from files may.
    """
    found = Console(markup=False)
    return found if found.is_terminal else Console(width=140, markup=False)
