"""Progress of long work: a bar on a terminal, plain lines elsewhere, nothing on standard output.

Tables on the terminal: numbers in columns, cautions as numbered notes below.

Worker processes that end with the process that started them.
"""

from __future__ import annotations

import math
import multiprocessing
import os
import sys
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from damping.progress import Advance
from damping_pipelines import QUIET


@contextmanager
def progress(title: str, total: int) -> Iterator[Advance]:
    """Show that ``parts`` of ``total`` are done, on standard error.

    On a terminal a rich bar; elsewhere (a log, a pipe) a plain line whenever another part is done; with ``--quiet``
    nothing.
    """
    if QUIET.get():
        yield lambda what, parts=1: None
    elif sys.stderr.isatty():
        yield from _bar(title, total)
    else:
        yield from _lines(title, total)


def _bar(title: str, total: int) -> Iterator[Advance]:
    from rich.console import Console  # noqa: PLC0415 - only a terminal needs rich
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415 - as above

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


def _lines(title: str, total: int) -> Iterator[Advance]:
    done = 0

    def advance(what: str, parts: int = 1) -> None:
        nonlocal done
        done += parts
        print(f"{title}: {done}/{total} {what}", file=sys.stderr, flush=True)

    yield advance


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
    terminal = _Terminal(markup=False)
    return terminal if terminal.is_terminal else _Terminal(width=140, markup=False)


class _Terminal(Console):
    def on_broken_pipe(self) -> None:
        """Leave it to the command line to say it: here it would end without a word."""
        raise


def end_with_parent() -> None:
    """Initializer of a pool: when the parent is gone, even killed, this process ends instead of waiting for ever."""
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)  # nobody is left who could be told

    threading.Thread(target=watch, daemon=True, name="end-with-parent").start()
