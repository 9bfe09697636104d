"""``damping compare`` and ``damping verify``: folders that studies wrote."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

_Folders = Annotated[list[Path], typer.Argument(metavar="DIR...", help="Folders that damping study wrote.")]


def compare(
    folders: _Folders,
    out: Annotated[Path, typer.Option("--out", metavar="FILE.html", help="The page written.")],
) -> None:
    """Set studies side by side: rankings, predictions, posteriors."""
    from pipelines.compare import compare as run

    run(folders, out)


def verify(folders: _Folders) -> None:
    """Check that every file of a folder is of one finished run."""
    from pipelines.compare import check

    check(folders)
