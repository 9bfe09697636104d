"""Runs of a campaign and their channels, and what a person corrects of them: levels, roles, units.

Corrections are a small TOML file. Names are those of the table that is shown::

    [drive]
    control = "maximum"                       # of several control channels; else their average
    [runs."run_0.3g"]
    level = 0.32                              # in the unit of the drive; or out = true
    [channels."acc 3"]
    role = "sensor"                           # or "drive", or "out"
    unit = "m/s^2"
    scale = 1.02                              # of the values
    reverse = true                            # mounted the other way round
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.quantity import unit
from damping.formats.series import Samples
from damping.records.keys import TomlTable, describe_nearest, read_toml

ROLES = ("sensor", "drive", "out")
CONTROLS = ("average", "maximum")


@dataclass(frozen=True)
class ChannelCorrection:
    """What is stated of a channel: ``role`` and ``unit`` empty where not; ``scale`` holds the sign."""

    role: str = ""
    unit: str = ""
    scale: float = 1.0


@dataclass(frozen=True)
class Corrections:
    """By label of a run its level (None: left out), by name of a channel what is stated of it, and the ``control``."""

    levels: Mapping[str, float | None] = field(default_factory=dict)
    channels: Mapping[str, ChannelCorrection] = field(default_factory=dict)
    control: str = "average"
    source: str = ""

    def of(self, name: str) -> ChannelCorrection:
        """What is stated of a channel."""
        return self.channels.get(name, ChannelCorrection())

    def require_known(self, runs: Collection[str], channels: Collection[str]) -> None:
        """InputError for a run or channel that the files do not have, naming the nearest one."""
        for what, stated, known in (("run", self.levels, runs), ("channel", self.channels, channels)):
            for name in stated:
                if name not in known:
                    nearest = describe_nearest(name, known) or "none"
                    raise InputError(f"no {what} {name!r}", file=self.source or None, expected=f"such as {nearest!r}")


def read_corrections(path: str | Path) -> Corrections:
    """The corrections in a TOML file.

    Raises:
        InputError: a file that is none, an unknown key, or a value that is not what it should be, with its line.
    """
    top = read_toml(path)
    top.only("drive", "runs", "channels")
    drive, runs, channels = top.table("drive"), top.table("runs"), top.table("channels")
    drive.only("control")
    control = drive.text("control", default="average")
    if control not in CONTROLS:
        raise drive.error("control", f"is {control!r}", " or ".join(CONTROLS))
    return Corrections(
        {name: _read_level(runs.table(name)) for name in runs.values},
        {name: _read_channel(channels.table(name)) for name in channels.values},
        control,
        str(path),
    )


def _read_level(run: TomlTable) -> float | None:
    run.only("level", "out")
    return None if run.truth("out") else run.number("level", above=0.0)


def _read_channel(channel: TomlTable) -> ChannelCorrection:
    channel.only("role", "unit", "scale", "reverse")
    role, text = channel.text("role", default=""), channel.text("unit", default="")
    if role and role not in ROLES:
        raise channel.error("role", f"is {role!r}", " or ".join(ROLES))
    if text:
        unit(text, what=f"unit of {channel.path[-1]!r}")
    scale = channel.number("scale", default=1.0, above=0.0, below=inf)
    return ChannelCorrection(role, text, -scale if channel.truth("reverse") else scale)


ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2}


_MOTIONS = {(0, 1, 0): "displacement", (0, 1, -1): "velocity", (0, 1, -2): "acceleration"}


@dataclass(frozen=True)
class Channel:
    """A sensor of one run: ``name`` as in the file, ``quantity``, ``unit``, values (n,) in that unit.

    ``per_drive``: values are ratios to the drive; ``at_drive``: measured where the force acts, along it.
    """

    name: str
    quantity: str
    unit: str
    values: Samples
    per_drive: bool = False
    at_drive: bool = False


@dataclass(frozen=True)
class CampaignRun:
    """One level: ``x`` (n,) Hz or s, the drive (n,) in ``drive_unit`` (None in a free decay) and its sensors.

    ``rate`` (n,): Hz/s at which the frequency moved, where it is known.
    """

    label: str
    level: float | None
    drive_unit: str
    x: FloatArray
    drive: Samples | None
    channels: tuple[Channel, ...]
    is_time: bool = False
    rate: FloatArray | None = None

    @property
    def is_base_driven(self) -> bool:
        """Whether the drive is a motion."""
        return not self.is_time and unit(self.drive_unit).powers != (1, 0, 0)


def correct_run(run: CampaignRun, stated: Corrections) -> CampaignRun:
    """A run with its level and channels as stated; a unit that is stated says the quantity too."""
    channels = []
    for one in run.channels:
        of = stated.of(one.name)
        if of.role == "out":
            continue
        text = of.unit or one.unit
        quantity = describe_quantity(text, one.name) if of.unit else one.quantity
        values = one.values * of.scale if of.scale != 1.0 else one.values
        channels.append(replace(one, unit=text, quantity=quantity, values=values))
    return replace(run, level=stated.levels.get(run.label, run.level), channels=tuple(channels))


def describe_quantity(text: str, name: str) -> str:
    """What a unit is one of. InputError where that is no motion."""
    powers = unit(text, what=f"unit of {name!r}").powers if text else (0, 1, -2)
    if powers not in _MOTIONS:
        raise InputError(f"{name!r} is in {text}", expected="a displacement, velocity or acceleration")
    return _MOTIONS[powers]


def list_common_sensors(runs: Sequence[CampaignRun]) -> list[str]:
    """Names of the sensors that every run has, in the order of the first. InputError where there is none."""
    names = [one.name for one in runs[0].channels]
    kept = [name for name in names if all(name in {one.name for one in run.channels} for run in runs)]
    if not kept:
        raise InputError("no sensor is in every run", expected="runs of one set of sensors")
    return kept


def values_of(run: CampaignRun, names: Sequence[str]) -> Samples:
    """Values (sensors, n) of a run."""
    by_name: Mapping[str, Channel] = {one.name: one for one in run.channels}
    return np.array([by_name[name].values for name in names])
