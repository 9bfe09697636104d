"""Options that several commands share, and how a command is delegated to the module that does its work."""

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

from typer import Argument, Option

MAX_SIZE = 200_000_000
DEFAULT_SEED = 1970  #: the year of the report; `damping.infer.SEED`, which this module is too light to import
MOST_PROCESSES = 1024  #: processes of one machine
NONE: list[Any] = []  #: what an option that can be repeated is where it is not given

Json = Annotated[str | None, Option("--json", metavar="FILE", help="Write the JSON form; - is stdout.")]
Seed = Annotated[int, Option(min=0, help="Seed of all random draws.")]
MaxSize = Annotated[int, Option(min=1, help="Largest accepted input file, bytes.")]
Despite = Annotated[list[str], Option(metavar="CHECK", help="Continue although this check refuses; repeatable.")]
RecordArgument = Annotated[Path, Argument(metavar="RECORD.csv", help="Record: one row per measured steady state.")]
ModeOption = Annotated[Path, Option(metavar="MODE.toml", help="Mode: frequency, mass, units.")]
Plot = Annotated[Path | None, Option(metavar="FILE", help="Write a figure (.svg or .png).")]
Forces = Annotated[list[float], Option(metavar="F", help="Force at resonance; repeatable.")]
Amplitudes = Annotated[list[float], Option(metavar="A", help="Amplitude at resonance; repeatable.")]
Level = Annotated[float, Option(help="Probability of the bands.")]
Folder = Annotated[Path, Option(metavar="DIR", help="Folder for the results.")]
RecordOut = Annotated[Path, Option(metavar="RECORD.csv", help="Record to write.")]
Folders = Annotated[list[Path], Argument(metavar="DIR...", help="Folders of finished runs.")]
Jobs = Annotated[int | None, Option(min=1, max=MOST_PROCESSES, help="Processes.")]

Command = Callable[..., None]


def delegate(module: str, function: str = "") -> Callable[[Command], Command]:
    """The work of a command: a function (of the same name) of a module that is loaded when the command runs."""

    def decorate(options: Command) -> Command:
        @wraps(options)
        def run(**given: Any) -> None:
            getattr(import_module(module, "damping_pipelines"), function or options.__name__)(**given)

        return run

    return decorate
