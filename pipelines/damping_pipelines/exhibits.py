"""Exhibits: packages beside the study that join it and bring commands of their own, imported when they are asked for.

This is the one place that knows them, by name; an exhibit imports what it needs from here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

from damping.errors import InputError

if TYPE_CHECKING:  # the command line names the commands of exhibits before anything heavy is loaded
    from damping.extrapolation.prediction import Loads
    from damping.ranking import Ranking
    from damping.report.results import Exhibit

#: The exhibit that ``source_report = true`` of the settings asks for.
SOURCE_REPORT = "damping_reed1970.exhibit"
#: Modules with ``COMMANDS``: functions that become commands, by name.
COMMANDS = ("damping_validation.commands",)


class StartedExhibit(Protocol):
    """An exhibit whose longest work is under way in other processes."""

    def finish(self, rankings: Mapping[str, Ranking], loads: Mapping[str, Loads]) -> Exhibit:
        """Wait for it and do the rest; ``rankings`` and ``loads`` (of records with design forces) by record."""


class ExhibitModule(Protocol):
    """What the module of an exhibit has."""

    def start(self, pool: Executor, seed: int) -> StartedExhibit:
        """Start what needs no results of the study."""

    def settings_file(self) -> Path:
        """Settings of the study that the exhibit is about."""


def source_report() -> ExhibitModule:
    """The reproduction of the source report."""
    return cast(ExhibitModule, import_module(SOURCE_REPORT))


def exhibit_commands() -> dict[str, Callable[..., Any]]:
    """Commands of all exhibits, by name."""
    commands: dict[str, Callable[..., Any]] = {}
    for module in COMMANDS:
        commands |= import_module(module).COMMANDS
    return commands


def shipped_folder(package: Path, name: str) -> Path:
    """Folder ``name`` of the data that a package ships: in the package itself, or in ``data`` of the repository.

    Args:
        package: folder of the package.

    Raises:
        InputError: neither exists (an incomplete installation).
    """
    choices = (package / "_data" / name, package.parents[1] / "data" / name)
    for folder in choices:
        if folder.is_dir():
            return folder
    raise InputError(f"the data {name} are not installed", expected=f"a folder {choices[0]} or {choices[1]}")
