"""Options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

MAX_SIZE = 200_000_000
DEFAULT_SEED = 1970

Json = Annotated[str | None, typer.Option("--json", metavar="FILE", help="Write the JSON form; - is stdout.")]
Seed = Annotated[int, typer.Option("--seed", help="Seed of everything that is sampled.")]
MaxSize = Annotated[int, typer.Option("--max-size", help="Largest input file accepted, bytes.")]
RecordArgument = Annotated[Path, typer.Argument(metavar="RECORD.csv", help="Record: one row a measured steady state.")]
ModeOption = Annotated[Path, typer.Option("--mode", metavar="MODE.toml", help="Mode: frequency, mass, units.")]
