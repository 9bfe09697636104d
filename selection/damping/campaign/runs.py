"""Runs of a campaign and their channels, and user corrections of levels, roles and units.

Corrections are a small TOML file, with the names of the printed table::

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
from typing import TypeAlias

import numpy as np

from damping.arrays import FloatArray, interpolate_logs
from damping.errors import InputError, describe_nearest
from damping.formats.headers import ORDERS
from damping.formats.levels import DRIVE, NUMBERED, find_level
from damping.formats.quantity import find_powers, unit
from damping.formats.series import Samples, Summary
from damping.records.keys import LARGEST, SMALLEST, TomlTable, read_toml
from damping.records.text import count, describe_shortened

LABEL_AGREES = 0.15  #: a control within this share of the level in its label has that level
ROLES = ("sensor", "drive", "out")
CONTROLS = ("average", "maximum")
NamedUnit: TypeAlias = tuple[str, str]  #: name of a channel and its unit


@dataclass(frozen=True)
class ChannelCorrection:
    """Corrections of a channel: ``role`` and ``unit``, empty if not stated; ``scale`` includes the sign."""

    role: str = ""
    unit: str = ""
    scale: float = 1.0


@dataclass(frozen=True)
class Corrections:
    """Levels by label of the run (None: left out), channel corrections by name, and the ``control`` strategy."""

    levels: Mapping[str, float | None] = field(default_factory=dict)
    channels: Mapping[str, ChannelCorrection] = field(default_factory=dict)
    control: str = "average"
    source: str = ""

    def of(self, name: str) -> ChannelCorrection:
        """Corrections of a channel."""
        return self.channels.get(name, ChannelCorrection())

    def is_drive(self, name: str) -> bool:
        """Whether a channel is the drive: as stated, else by its name."""
        role = self.of(name).role
        return role == "drive" or (not role and bool(DRIVE.search(name)))

    def list_drives(self, units: Mapping[str, str], usual: str = "") -> list[str]:
        """The drives among channels with their ``units`` ('' if there is none).

        They are those stated or called so, else numbered ones, else the channel with the ``usual`` name of a force,
        else the only force. Ratios such as tip / force are none, nor is a voltage that is called so beside another.
        """
        units = {name: self.of(name).unit or text for name, text in units.items()}
        free = {name: text for name, text in units.items() if not self.of(name).role and not split_ratio(text, "")}
        called = [name for name in free if DRIVE.search(name.partition(" / ")[0])]
        named = [name for name in units if self.of(name).role == "drive" or name in called]
        named = named or [name for name in free if NUMBERED.search(name.partition(" / ")[0])]
        named = [name for name in named if not units[name] or find_powers(units[name])] or named
        forces = [name for name, text in free.items() if find_powers(text) == (1, 0, 0)]
        return named or [name for name in free if name == usual] or (forces if len(forces) == 1 else [])

    def choose_drive(self, label: str, units: Mapping[str, str]) -> str | None:
        """The one drive that times are tracked by, the first of `list_drives`. InputError: several numbered ones."""
        drives = self.list_drives(units)
        if len(drives) > 1 and not self.is_drive(drives[0]):
            raise refuse_forces(label, drives)
        return drives[0] if drives else None

    def join_controls(self, values: Sequence[Samples]) -> Samples:
        """One drive (n,) from several control channels: their average, or the largest in each row."""
        stacked = np.array(values)
        if self.control == "average":
            return np.asarray(np.mean(stacked, axis=0))
        return np.asarray(np.take_along_axis(stacked, np.argmax(np.abs(stacked), axis=0)[None], axis=0)[0])

    def require_known(self, runs: Collection[str], channels: Collection[str]) -> None:
        """Raise InputError for a run or channel that the files do not have; it lists them, the nearest first."""
        for kind, stated, known in (("run", self.levels, runs), ("channel", self.channels, channels)):
            for name in stated:
                if name not in known:
                    nearest = describe_nearest(name, known) or "none"
                    others = ", ".join(sorted(set(known) - {nearest}))
                    expected = f"such as {nearest!r}{' or ' * bool(others)}{describe_shortened(others, 100)}"
                    raise InputError(f"no {kind} {name!r}", file=self.source or None, expected=expected)


def read_corrections(path: str | Path) -> Corrections:
    """The corrections in a TOML file.

    InputError: a file that cannot be read, an unknown key, or an invalid value, with its line.
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


_MOTIONS = {(0, 1, -order): name for name, order in ORDERS.items()}


@dataclass(frozen=True)
class Channel:
    """A sensor of one run: ``name`` as in the file, ``quantity``, ``unit``, values (n,) in that unit."""

    name: str
    quantity: str
    unit: str
    samples: Samples
    per_drive: bool = False  #: values are ratios to the drive
    at_drive: bool = False  #: measured at the force and along it
    #: third harmonic of a tracked time history, with the phase relative to three times that of the drive
    third: Samples | None = None

    def scaled(self, factor: float) -> Channel:
        """The channel with every value times a factor."""
        return replace(self, samples=self.samples * factor, third=None if self.third is None else self.third * factor)


@dataclass(frozen=True)
class CampaignRun:
    """One level: ``x`` (n,) Hz or s, the drive (n,) in ``drive_unit`` (None in a free decay) and its sensors."""

    label: str
    level: float | None
    drive_unit: str
    x: FloatArray
    drive: Samples | None
    channels: tuple[Channel, ...]
    rate: FloatArray | None = None  #: sweep rate in Hz/s, if known (n,)
    #: sensors removed from the channels because of their readings, with reasons
    left_out: Mapping[str, str] = field(default_factory=dict)
    delay: float = 0.0  #: time in s by which all sensors lag the drive; channels are as in the file

    @property
    def is_time(self) -> bool:
        """Whether it is a free decay."""
        return self.drive is None

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
    """A design input: ``level`` (n,) in the unit of the drive over ``frequency`` (n,) Hz; a single pair is constant."""

    frequency: FloatArray
    level: FloatArray
    unit: str = ""  #: as stated, if it is

    def __post_init__(self) -> None:
        wrong = self.level[~((self.level >= SMALLEST) & (self.level <= LARGEST))]
        if wrong.size:
            expected = f"levels > 0, of a magnitude of {SMALLEST:g} to {LARGEST:g}"
            raise InputError(f"--design is no level: level {wrong[0]:g}", expected=expected)
        steps = np.diff(self.frequency, prepend=0.0)
        if not np.all(steps > 0.0):
            fault = f"--design is no level: frequency {self.frequency[int(np.argmin(steps > 0.0))]:g} Hz"
            raise InputError(fault, expected="frequencies > 0, each above the last")

    @classmethod
    def flat(cls, level: float) -> DesignLevel:
        """The same level at all frequencies."""
        return cls(np.array([1.0]), np.array([float(level)]))

    def at(self, frequency: float) -> float:
        """The level at a frequency: linear between corners on logarithmic axes, constant beyond the ends."""
        if len(self.level) == 1:
            return float(self.level[0])
        return float(interpolate_logs(frequency, self.frequency, self.level))


def describe_quantity(text: str, name: str) -> str:
    """Quantity of motion by its unit; acceleration if there is no unit. InputError for other quantities."""
    powers = find_powers(text) if text else (0, 1, -2)
    if powers not in _MOTIONS:
        expected = "a displacement, velocity or acceleration (--correct states its unit, or role = 'out')"
        raise InputError(f"{name!r} is in {describe_shortened(text)}", expected=expected)
    return _MOTIONS[powers]


def is_motion(text: str) -> bool:
    """Whether a unit is of a displacement, velocity or acceleration, or of its ratio to a drive."""
    return find_powers(text) in _MOTIONS or split_ratio(text, "") is not None


def split_ratio(text: str, drive: str) -> tuple[str, str] | None:
    """Units of motion and drive of a ratio, such as (m/s^2)/N; None of a motion.

    ``drive``: its unit; if '', that of a force or an acceleration.
    """
    motion, _, per = text.rpartition("/")
    powers, known = find_powers(per), [find_powers(drive)] if drive else [(1, 0, 0), (0, 1, -2)]
    of_motion = find_powers(motion) if motion else None
    return (motion.strip().removeprefix("(").removesuffix(")"), per.strip()) if of_motion and powers in known else None


def keep_common_sensors(runs: Sequence[CampaignRun]) -> list[CampaignRun]:
    """The runs reduced to the sensors that every run has, in the order of the first.

    InputError: there is no such sensor, or two sensors of a run have the same name.
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
    common = (tuple(channels[name] for name in kept) for channels in by_name)
    return [replace(run, channels=channels, left_out=left_out) for run, channels in zip(runs, common, strict=True)]


def find_level_of_ratio(label: str, per: str) -> tuple[float, str]:
    """The level of ratios to a drive, and the unit of the drive, which is ``per`` unless that is ''.

    InputError: the label has no level in a unit of the drive.
    """
    level = find_level(label)
    if level is None or not level[0] > 0.0 or find_powers(per or level[1]) != find_powers(level[1]):
        of = f"that of the drive{f' (in {per})' if per else ''}"
        expected = f"{of} in an ID line, a label or the name of the file, such as 0.5 g or 2 N"
        raise InputError("functions without a level", expected=expected)
    of_drive = per or level[1]
    return level[0] * (unit(level[1]).factor / unit(of_drive).factor), of_drive


def refuse_forces(label: str, names: Sequence[str]) -> InputError:
    """The error of several forces at once."""
    expected = "one force, or controls of one base (--correct: role = 'sensor' or 'out' of the others)"
    return InputError(f"{label}: {len(names)} drives, {', '.join(names[:4])}", expected=expected)


def summarise_runs(runs: Sequence[CampaignRun], summary: Summary) -> None:
    """Add one row for each run and channel that can be corrected, under the name that a correction uses."""
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
