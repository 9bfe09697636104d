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

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from pathlib import Path
from typing import TypeAlias

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError, describe_nearest
from damping.formats.quantity import find_powers, unit
from damping.formats.series import Samples, Summary
from damping.records.keys import TomlTable, read_toml
from damping.records.text import count, describe_shortened

#: What a label says of a level: a number with a unit.
LEVEL = re.compile(r"(?<![\w.])(?:run[_ -]?)?(?:[A-Za-z]+\s*=\s*)?(\d+(?:\.\d+)?)[\s_]*(mN|kN|N|g|m/s\^?2)(?![\w/])")
DRIVE = re.compile(r"(?i)\b(control|ctrl|drive|base|input|force|shaker|reference)\b")  #: names of channels that drive
LABEL_AGREES = 0.15  #: a control that is off from the level in its label by no more than this is that level
ROLES = ("sensor", "drive", "out")
CONTROLS = ("average", "maximum")
NamedUnit: TypeAlias = tuple[str, str]  #: name of a channel and its unit


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

    def is_drive(self, name: str) -> bool:
        """Whether a channel is the drive: as stated, else by its name."""
        role = self.of(name).role
        return role == "drive" or (not role and bool(DRIVE.search(name)))

    def choose_drive(self, units: Mapping[str, str]) -> str | None:
        """The channel that is the drive, of all by their units: as stated, by its name, or the only force."""
        named = next((name for name in units if self.is_drive(name)), None)
        free = {name: self.of(name).unit or text for name, text in units.items() if not self.of(name).role}
        forces = [name for name, text in free.items() if find_powers(text) == (1, 0, 0)]
        return named or (forces[0] if len(forces) == 1 else None)

    def join_controls(self, values: Sequence[Samples]) -> Samples:
        """One drive (n,) of several control channels: their average, or at each row the one that is largest."""
        stacked = np.array(values)
        if self.control == "average":
            return np.asarray(np.mean(stacked, axis=0))
        return np.asarray(np.take_along_axis(stacked, np.argmax(np.abs(stacked), axis=0)[None], axis=0)[0])

    def require_known(self, runs: Collection[str], channels: Collection[str]) -> None:
        """InputError for a run or channel that the files do not have, naming the nearest one."""
        for what, stated, known in (("run", self.levels, runs), ("channel", self.channels, channels)):
            for name in stated:
                if name not in known:
                    nearest = describe_nearest(name, known) or "none"
                    raise InputError(f"no {what} {name!r}", file=self.source or None, expected=f"such as {nearest!r}")


def read_corrections(path: str | Path) -> Corrections:
    """The corrections in a TOML file.

    InputError: a file that is none, an unknown key, or a value that is not what it should be, with its line.
    """
    top = read_toml(path)
    top.only("drive", "runs", "channels")
    drive, runs, channels = top.table("drive", "control"), top.table("runs"), top.table("channels")
    control = drive.text("control", default="average")
    if control not in CONTROLS:
        raise drive.error("control", f"is {control!r}", " or ".join(CONTROLS))
    levels = {}
    for name in runs.values:
        run = runs.table(name, "level", "out")
        levels[name] = None if run.truth("out") else run.number("level", above=0.0)
    known = ("role", "unit", "scale", "reverse")
    corrected = {name: _read_channel(channels.table(name, *known)) for name in channels.values}
    return Corrections(levels, corrected, control, str(path))


def _read_channel(channel: TomlTable) -> ChannelCorrection:
    role, text = channel.text("role", default=""), channel.text("unit", default="")
    if role and role not in ROLES:
        raise channel.error("role", f"is {role!r}", " or ".join(ROLES))
    if text:
        unit(text, what=f"unit of {channel.path[-1]!r}")
    scale = channel.number("scale", default=1.0, above=0.0, below=inf)
    return ChannelCorrection(role, text, -scale if channel.truth("reverse") else scale)


ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2}  #: order of the time derivative of displacement
_MOTIONS = {(0, 1, 0): "displacement", (0, 1, -1): "velocity", (0, 1, -2): "acceleration"}


@dataclass(frozen=True)
class Channel:
    """A sensor of one run: ``name`` as in the file, ``quantity``, ``unit``, values (n,) in that unit.

    ``per_drive``: values are ratios to the drive; ``at_drive``: measured where the force acts, along it; ``third``: the
    third harmonic of a history that was tracked, its phase at three times that of the drive.
    """

    name: str
    quantity: str
    unit: str
    samples: Samples
    per_drive: bool = False
    at_drive: bool = False
    third: Samples | None = None

    def scaled(self, factor: float) -> Channel:
        """The channel with every value times a factor."""
        third = None if self.third is None else self.third * factor
        return replace(self, samples=self.samples * factor, third=third)


@dataclass(frozen=True)
class CampaignRun:
    """One level: ``x`` (n,) Hz or s, the drive (n,) in ``drive_unit`` (None in a free decay) and its sensors.

    ``rate`` (n,): Hz/s at which the frequency moved, where it is known. ``left_out``: sensors that are not among the
    channels because of what they read, each with why.
    """

    label: str
    level: float | None
    drive_unit: str
    x: FloatArray
    drive: Samples | None
    channels: tuple[Channel, ...]
    is_time: bool = False
    rate: FloatArray | None = None
    left_out: Mapping[str, str] = field(default_factory=dict)

    @property
    def is_base_driven(self) -> bool:
        """Whether the drive is a motion."""
        return not self.is_time and unit(self.drive_unit).powers != (1, 0, 0)

    @property
    def names(self) -> list[str]:
        """Names of the sensors."""
        return [channel.name for channel in self.channels]

    def without(self, sensors: Collection[str]) -> CampaignRun:
        """The run without some sensors."""
        return replace(self, channels=tuple(channel for channel in self.channels if channel.name not in sensors))


@dataclass(frozen=True)
class DesignLevel:
    """A design input: ``level`` (n,) in the unit of the drive over ``frequency`` (n,) Hz; one of each: everywhere."""

    frequency: FloatArray
    level: FloatArray

    def __post_init__(self) -> None:
        rising = len(self.frequency) == 1 or bool(np.all(np.diff(self.frequency) > 0.0))
        if not (rising and np.all(np.isfinite(self.level)) and np.all(self.level > 0.0) and self.frequency[0] > 0.0):
            raise InputError("--design is no level", expected="levels > 0 over rising frequencies > 0")

    @classmethod
    def flat(cls, level: float) -> DesignLevel:
        """One level at all frequencies."""
        return cls(np.array([1.0]), np.array([float(level)]))

    def at(self, frequency: float) -> float:
        """The level there, straight between the corners on logarithmic axes, flat beyond the ends."""
        if len(self.level) == 1:
            return float(self.level[0])
        corners = np.log(self.frequency), np.log(self.level)
        return float(np.exp(np.interp(np.log(frequency), *corners)))


def describe_quantity(text: str, name: str) -> str:
    """What a unit is one of; that of no unit an acceleration. InputError where that is no motion."""
    powers = find_powers(text) if text else (0, 1, -2)
    if powers not in _MOTIONS:
        expected = "a displacement, velocity or acceleration (--correct states its unit, or role = 'out')"
        raise InputError(f"{name!r} is in {describe_shortened(text)}", expected=expected)
    return _MOTIONS[powers]


def keep_common_sensors(runs: Sequence[CampaignRun]) -> list[CampaignRun]:
    """The runs with the sensors that every run has, in the order of the first.

    InputError: there is none, or two of one run have one name.
    """
    for run in runs:
        name = next((name for name in run.names if run.names.count(name) > 1), None)
        if name is not None:
            message = f"run {run.label!r} has {run.names.count(name)} sensors {name!r}"
            expected = "one file per level, or levels in an ID line (0.4 g); distinct titles, nodes or directions"
            raise InputError(message, expected=expected)
    kept = [name for name in runs[0].names if all(name in run.names for run in runs)]
    if not kept:
        raise InputError("no sensor is in every run", expected="runs of one set of sensors")
    by_name = [{channel.name: channel for channel in run.channels} for run in runs]
    left_out = {name: why for run in runs for name, why in run.left_out.items()}
    channels = (tuple(own[name] for name in kept) for own in by_name)
    return [replace(run, channels=own, left_out=left_out) for run, own in zip(runs, channels, strict=True)]


def find_level(text: str) -> tuple[float, str] | None:
    """A level and its unit in a label; None where there is none."""
    match = LEVEL.search(text)
    return (float(match[1]), match[2].replace("m/s2", "m/s^2")) if match else None


def summarise_runs(runs: Sequence[CampaignRun], summary: Summary) -> None:
    """One row for each run and for each channel: what can be corrected, by the names that a correction uses."""
    for run in runs:
        drive = "free decay" if run.is_time else f"level {run.level:g} {run.drive_unit}"
        kind = "" if run.is_time else (", base drive" if run.is_base_driven else ", driven by a force")
        span = f"{run.x[0]:g} to {run.x[-1]:g} {'s' if run.is_time else 'Hz'}, {count(len(run.x), 'row')}"
        sensors = count(len(run.channels), "sensor")
        summary.add(f"run {run.label!r}", f"{drive}{kind}; {span}; {sensors}", "found in the file")
    for name, (channel, drive_unit) in {c.name: (c, run.drive_unit) for run in runs for c in run.channels}.items():
        per = f" per {drive_unit}" if channel.per_drive else ""
        text = f"sensor of {channel.quantity} in {channel.unit or 'no unit'}{per}"
        summary.add(f"channel {name!r}", text, "found in the file")
