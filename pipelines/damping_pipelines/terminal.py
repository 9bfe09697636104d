"""Terminal output of commands: progress on standard error, tables of text, findings of the audit."""

import math
import os
import sys
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import StringIO
from textwrap import wrap
from typing import Any

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions
from rich.rule import Rule
from rich.table import Table
from rich.text import Text

from damping.errors import InputError
from damping.progress import Advance
from damping.records import Audit, audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.report import end_sentence
from damping_pipelines import QUIET

_MOST_LINES = 10  #: lines of progress at most where there is no terminal: a log holds what follows them too


@contextmanager
def progress(title: str, total: int, *, each: bool = False) -> Iterator[Advance]:
    """Show that ``parts`` of ``total`` are done, on standard error: as a bar on a terminal, else as lines.

    ``each``: every part has its own line, such as a record that may have failed.
    """
    if QUIET.get():
        yield lambda what, parts=1: None
    elif sys.stderr.isatty():
        yield from _bar(title, total)
    else:
        done = 0

        def advance(what: str, parts: int = 1) -> None:
            nonlocal done
            further = _MOST_LINES * (done + parts) // max(total, 1) > _MOST_LINES * done // max(total, 1)
            done += parts
            if each or further:
                print(f"{title}: {done}/{total} {what}", file=sys.stderr, flush=True)

        yield advance


def _bar(title: str, total: int) -> Iterator[Advance]:
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415 - only a terminal needs it

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.fields[what]}", markup=False),
    )
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(title, total=total, what="")
        yield lambda what, parts=1: bar.update(task, advance=parts, what=what)


class Notes:
    """Cautions, each printed once and referred to by number."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}

    def numbers(self, cautions: Iterable[str]) -> str:
        """Numbers of cautions; new cautions are added."""
        numbers = [self._numbers.setdefault(caution, len(self._numbers) + 1) for caution in cautions]
        return " ".join(map(str, sorted(numbers)))

    def show(self, console: Console, cautions: Iterable[str] = ()) -> None:
        """Print the notes in order, then ``cautions`` about all that was printed."""
        for caution, number in self._numbers.items():
            for line in wrap(caution, console.width, initial_indent=f"{number:3d}  ", subsequent_indent="     "):
                console.print(line, soft_wrap=True)
        for caution in cautions:
            console.print(f"Caution: {end_sentence(caution)}", highlight=False)


_GAP = 2  #: characters between two columns of a table
_LEAST_NAME = 14  #: characters that a name keeps at least
#: Text as it stands: brackets hold units and parts of names from files, and ``:x:`` in a name is no emoji.
_PLAIN: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False}
WIDTH = 80  #: width where standard output is no terminal and the environment names none: a log, a mail


class PlainTable:
    """Rows of text under headings, never wider than the terminal.

    If the width is too small, headings and names break at their spaces, words of names are shortened, and finally the
    columns of numbers continue below, with the names repeated, or the first numbers where there are no names. Numbers
    are never cut. In a table without columns of numbers the cells are wrapped. ``names, numbers``: headings on the
    left, of text, and on the right.
    """

    def __init__(self, title: str, numbers: Iterable[str], names: Iterable[str] = ()) -> None:
        self.title, self.names, self.numbers = title, tuple(names), tuple(numbers)
        self.rows: list[tuple[str, ...]] = []

    def add_row(self, *cells: str) -> None:
        """A row: names, then numbers."""
        self.rows.append(cells)

    def __rich_console__(self, to: Console, options: ConsoleOptions) -> Iterator[Text]:
        """Lines that fit the console."""
        for line in self.fit(options.max_width):
            yield Text(line, no_wrap=True, overflow="ignore")

    def fit(self, width: int) -> list[str]:
        """The lines of the table in ``width`` characters."""
        count = len(self.names)
        needed = [self._width(column) for column in range(count + len(self.numbers))]
        blocks: list[list[int]] = [[]]
        room = width - sum(min(size, _LEAST_NAME) for size in needed[:count])
        room -= _GAP * (count - 1)  # a gap fewer than columns
        left = room
        for column in range(count, len(needed)):
            if blocks[-1] and left < needed[column] + _GAP:
                first = [] if count or needed[0] + _GAP + needed[column] > width else [0]  # what identifies a row
                blocks, left = [*blocks, first], room - sum(needed[at] + _GAP for at in first)
            blocks[-1].append(column)
            left -= needed[column] + _GAP
        page = StringIO()
        to = Console(file=page, width=width + _GAP, color_system=None, **_PLAIN)  # a gap follows the last column too
        for block in blocks:
            to.print("", self._draw(block, needed), sep="\n", crop=False)
        lines = [line.rstrip() for line in page.getvalue().split("\n")[1:-1]]
        return ["", *wrap(self.title, width), *lines] if self.title else lines

    def _width(self, column: int) -> int:
        """Width of a column: of names the full text; of numbers the longest cell and word of the heading."""
        cells = [line for row in self.rows for line in row[column].split("\n")]
        heading = [self.names[column]] if column < len(self.names) else self.numbers[column - len(self.names)].split()
        return max(map(cell_len, (*cells, *heading)), default=0)

    def _draw(self, block: Sequence[int], needed: Sequence[int]) -> Table:
        """Names, whose widest shrinks first, and some columns of numbers as wide as they need."""
        count = len(self.names)
        table = Table(box=None, padding=(0, _GAP, 0, 0))
        for name in self.names:
            table.add_column(name, overflow="ellipsis" if self.numbers else "fold")
        for column in block:
            table.add_column(self.numbers[column - count], justify="right", width=needed[column])
        table.add_row(*(Rule(characters="-") for _ in table.columns))
        for row in self.rows:
            table.add_row(*(row[column] for column in (*range(count), *block)))
        return table


def name_quantity(what: str, unit: str) -> str:
    """A quantity with its unit in brackets, if it has one: ``force [N]``."""
    return f"{what} [{unit}]" if unit else what


def number(value: float, digits: int = 4) -> str:
    """A number with the given digits; a dash for a missing one."""
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def number_whole(value: float, digits: int = 4, mark: str = "") -> str:
    """The same without an exponent, however large: 32000, not 3.2e+04; ``mark`` ``#``: with trailing zeros."""
    if abs(value) >= 10.0**digits - 0.5 and math.isfinite(value):
        return f"{value:.0f}"
    return f"{value:{mark}.{digits}g}".rstrip(".") if math.isfinite(value) else "-"


_MOST_DECIMALS = 6  #: of a value whose error is smaller still


def number_with_error(value: float, error: float | None) -> str:
    """A value with the decimals of two digits of its error, ``11.393 ± 0.012``; without one if there is no error."""
    if error is None or not error > 0.0:
        return number_whole(value)
    decimals = max(1 - math.floor(math.log10(error)), 0)
    shown = f"{error:.{decimals}f}" if decimals <= _MOST_DECIMALS else number_whole(error, 2)
    return f"{value:.{min(decimals, _MOST_DECIMALS)}f} ± {shown}"


def parse_number(text: str) -> float:
    """The number in a word; NaN if it is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def parse_pairs(
    option: str, words: Sequence[str], meaning: str = "NAME=VALUE", *, last: bool = False
) -> dict[str, str]:
    """``KEY=VALUE`` words of a repeated option, cut at the first ``=``, or at the ``last`` where keys are free names.

    InputError for a word without the form of its ``meaning``, or a key given twice.
    """
    values: dict[str, str] = {}
    for word in words:
        key, mark, value = (part.strip() for part in (word.rpartition("=") if last else word.partition("=")))
        if not (mark and key and value):
            raise InputError(f"{option} {word!r} is not understood", expected=f"{option} {meaning}")
        if key in values:
            raise InputError(f"{option} {key} is given twice", expected="each once")
        values[key] = value
    return values


def console() -> Console:
    """Standard output; if it is no terminal, its width is ``COLUMNS`` of the environment, else ``WIDTH``."""
    terminal = _Terminal(**_PLAIN)
    if terminal.is_terminal or os.environ.get("COLUMNS", "").isdecimal():
        return terminal
    return _Terminal(width=WIDTH, **_PLAIN)


class _Terminal(Console):
    def on_broken_pipe(self) -> None:
        """Leave the error to the command line, which reports it."""
        raise


def print_lines(line: str, notes: Iterable[str] = ()) -> None:
    """Print a line, and notes as a list below it."""
    for text in (line, *(f"- {note}" for note in notes)):
        console().print(text)


def suggest(*lines: str) -> None:
    """Suggest the next command; nothing with ``--quiet``."""
    if not QUIET.get():
        for number, line in enumerate(lines):
            console().print(("Next: " if number == 0 else "      ") + line, soft_wrap=True)


def report_findings(record: Record, mode: Mode | None, despite: Collection[str], *, diagnosed: bool = False) -> Audit:
    """The audit of a record before any work on it; its findings go to standard error.

    Refused: a finding refuses that is not among the checks named in ``despite``; ``diagnosed``: see `Audit.require`.
    """
    findings = audit(record, mode)
    findings.require(despite, diagnosed=diagnosed)
    for finding in findings.findings:
        print(f"damping: {record.source}: {finding}", file=sys.stderr)
    return findings
