"""The user's description of a test: the schema of a CONDITION.toml, and of the raw table that it describes.

The raw table is a CSV file, one row for each steady state at one forcing frequency, with any columns; the description
selects those that are used. All numbers are in one consistent system of units; names of units are echoed, not
converted. ``docs/reference/files.md`` has an example with every key and its meaning.

Stated standard uncertainties are propagated (``damping.signals.reading``) to the record's ``force_sd``,
``amplitude_sd`` and ``phase_sd``; those of modes, angle and R^2/I cannot be stated and are not included.
"""

from collections.abc import Iterator
from math import radians
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from damping.arrays import RAD_S_PER_HZ
from damping.records.keys import OPTIONAL_COLUMNS, REQUIRED_COLUMNS

Positive = Annotated[FiniteFloat, Field(gt=0.0)]
NonNegative = Annotated[FiniteFloat, Field(ge=0.0)]
Name = Annotated[str, Field(min_length=1, max_length=80)]

#: Reserved columns of the working table.
WORKING_COLUMNS = ("sweep", "omega", "force", "amplitude", "phase", "energy", "xi")


class _DescriptionTable(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class SignalUnits(_DescriptionTable):
    """Names of units for display, and the two units that are converted."""

    force: str = ""
    length: str = ""
    time: str = ""
    frequency: Literal["Hz", "rad/s"] = "Hz"
    phase: Literal["rad", "degrees"] = "rad"

    @property
    def rad_s(self) -> float:
        """One unit of frequency in rad/s."""
        return 1.0 if self.frequency == "rad/s" else RAD_S_PER_HZ

    @property
    def rad(self) -> float:
        """One unit of phase in rad."""
        return 1.0 if self.phase == "rad" else radians(1.0)


class Raw(_DescriptionTable):
    """Columns of the raw table."""

    frequency: Name
    force: Name
    force_sd: Name | None = None
    sweep: Name | None = None
    sweep_label: Name | None = None
    keep: tuple[Name, ...] = Field(default=(), strict=False)


class Sensor(_DescriptionTable):
    """One reading: amplitude = factor * column, its quantity and its unit."""

    name: Name
    column: Name
    quantity: Literal["acceleration", "velocity", "displacement"] = "displacement"
    factor: Positive = 1.0
    unit: Positive = 1.0
    per_force: bool = False
    sd: Name | None = None


class Yaw(_DescriptionTable):
    """Yaw displacement of a node whose pitch displacement is measured (Eq. 3.1.1); names of sensors."""

    name: Name
    tip_yaw: Name
    tip_pitch: Name
    pitch: Name


class Node(_DescriptionTable):
    """The motion that represents the mode."""

    sensor: Name
    phase: Name | None = None
    phase_sd: Name | None = None
    lag: FiniteFloat = 0.0


class ModeFactor(_DescriptionTable):
    """Displacement of the node, and of the point of the force, at unit modal displacement."""

    phi: FiniteFloat
    phi_drive: FiniteFloat | None = None

    @property
    def drive(self) -> float:
        """``phi_drive``, by default ``phi``."""
        return self.phi if self.phi_drive is None else self.phi_drive


class OtherMode(ModeFactor):
    """A mode to be removed."""

    name: Name
    mass: Positive
    frequency: Positive


class RigidBody(_DescriptionTable):
    """Rigid-body rotation: its frequency, and R^2/I or the column from which it is identified."""

    frequency: NonNegative
    r2_over_i: FiniteFloat | None = None
    identify_from: Name | None = None


class Correction(_DescriptionTable):
    """Column of the total correction C_t."""

    column: Name


class Principal(_DescriptionTable):
    """The two principal planes, and the choice of root of Eq. 3.2.15."""

    theta: Annotated[FiniteFloat, Field(gt=-90.0, lt=90.0)]
    mass: Positive
    frequency_pitch: Positive
    frequency_yaw: Positive
    branch: Literal["low", "high", "near"]
    xi: Positive | None = None
    largest: Positive = 0.1


#: A contradiction in a description: the path of keys, the problem, and what was expected.
DescriptionProblem: TypeAlias = tuple[tuple[str | int, ...], str, str]


class Description(_DescriptionTable):
    """A whole CONDITION.toml."""

    title: str = ""
    units: SignalUnits = SignalUnits()
    raw: Raw
    sensors: Annotated[tuple[Sensor, ...], Field(min_length=1, strict=False)]
    yaw: tuple[Yaw, ...] = Field(default=(), strict=False)
    node: Node
    mode: ModeFactor
    modes: tuple[OtherMode, ...] = Field(default=(), strict=False)
    rigid_body: RigidBody | None = None
    correction: Correction | None = None
    principal: Principal | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Numeric columns of the raw table that are used."""
        names = [self.raw.frequency, self.raw.force, *(sensor.column for sensor in self.sensors), self.node.phase]
        names.append(self.rigid_body.identify_from if self.rigid_body else None)
        names.append(self.correction.column if self.correction else None)
        return tuple(dict.fromkeys(name for name in (*names, *self.uncertainties.values()) if name))

    @property
    def uncertainties(self) -> dict[str, str]:
        """Columns of stated standard uncertainties, by the column they belong to."""
        pairs = [(self.raw.force, self.raw.force_sd), *((sensor.column, sensor.sd) for sensor in self.sensors)]
        pairs.append((self.node.phase or "", self.node.phase_sd))
        return {column: sd for column, sd in pairs if column and sd}

    def problems(self) -> Iterator[DescriptionProblem]:
        """Contradictions, in the order of the schema."""
        yield from self._check_raw()
        yield from self._check_names()
        yield from self._check_removals()

    def _check_raw(self) -> Iterator[DescriptionProblem]:
        if (self.raw.sweep is None) == (self.raw.sweep_label is None):
            yield ("raw",), "sweeps have no label or two", "sweep = COLUMN or sweep_label = TEXT"
        if self.raw.sweep in self.columns:
            yield ("raw", "sweep"), f"column {self.raw.sweep!r} is used as a number", "a column of labels"
        meant = {*REQUIRED_COLUMNS, *OPTIONAL_COLUMNS, *WORKING_COLUMNS, *(f"{name}_sd" for name in WORKING_COLUMNS)}
        for name in self.raw.keep:
            if name in meant:
                yield ("raw", "keep"), f"column {name!r} would stand for a result", "another name"

    def _check_names(self) -> Iterator[DescriptionProblem]:
        seen = {*WORKING_COLUMNS, *self.raw.keep}
        sensors = [sensor.name for sensor in self.sensors]
        named = [(("sensors", i, "name"), sensor.name) for i, sensor in enumerate(self.sensors)]
        named += [(("yaw", i, "name"), yaw.name) for i, yaw in enumerate(self.yaw)]
        for keys, name in named:
            if name in seen:
                yield keys, f"{name!r} is taken", "a name of its own"
            seen.add(name)
        used = [(("yaw", i, key), getattr(y, key)) for i, y in enumerate(self.yaw) for key in _YAW_SENSORS]
        for path, name in [*used, (("node", "sensor"), self.node.sensor)]:
            if name not in sensors:
                yield path, f"no sensor {name!r}", f"one of {', '.join(sensors)}"

    def _check_removals(self) -> Iterator[DescriptionProblem]:
        for key in ("phi", "phi_drive"):
            if getattr(self.mode, key) == 0.0:
                yield ("mode", key), "is 0: the mode cannot be seen or driven there", "another node"
        if len({mode.name for mode in self.modes}) < len(self.modes):
            yield ("modes",), "two modes have one name", "different names"
        rigid = self.rigid_body
        if rigid is not None and (rigid.r2_over_i is None) == (rigid.identify_from is None):
            yield ("rigid_body",), "R^2/I is not given or given twice", "r2_over_i or identify_from"
        if self.correction is not None and (self.modes or rigid is not None):
            yield ("correction",), "the total correction is given and computed", "it, or modes and rigid_body"
        removed = [key for key in ("modes", "rigid_body", "correction", "principal") if getattr(self, key)]
        if self.node.phase is None and self.node.phase_sd is not None:
            yield ("node", "phase_sd"), "there is no phase that it belongs to", "phase in [node]"
        if self.node.phase is None and removed:
            yield (removed[0],), "nothing can be removed without the phase of the node", "phase in [node]"
        if self.principal is not None and (self.principal.branch == "near") != (self.principal.xi is not None):
            yield ("principal",), 'xi goes with branch = "near"', "both or neither"


_YAW_SENSORS = ("tip_yaw", "tip_pitch", "pitch")
