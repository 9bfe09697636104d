"""Progress of long work: a bar on a terminal, plain lines elsewhere, nothing on standard output."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Advance(Protocol):
    """Call it when a part is done."""

    def __call__(self, what: str, parts: int = 1) -> None:
        """Say that ``parts`` more are done; ``what`` names the last."""


@contextmanager
def progress(title: str, total: int) -> Iterator[Advance]:
    """Show that ``parts`` of ``total`` are done, on standard error.

    On a terminal a rich bar; elsewhere (a log, a pipe) a plain line whenever another part is done.
    """
    if sys.stderr.isatty():
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
