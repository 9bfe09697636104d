"""A mode: the assumptions of a simulation about one vibration mode, read from and written to a TOML file."""

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from damping import effects, forces
from damping.arrays import RAD_S_PER_HZ, FloatArray, to_python
from damping.forces.shapes import Shape
from damping.records.keys import TomlTable, parse_toml, read_toml
from damping.records.text import DEFAULT_MAX_SIZE, read_source

#: Range of ln mass over its standard error beyond which masses differ: ten estimates of one mass do in 1.4 % of cases.
STATES_APART = 5.0
ROUNDED = 1.0 + 1e-12  #: largest ratio of a stiffness to an equal one that was converted from other units
DRIVES = ("force", "base")  #: excitation of a structure: by a force, or by the motion of its base


@dataclass(frozen=True)
class Tolerance:
    """Relative standard uncertainty of the assumed values."""

    frequency: float = 0.001
    mass: float = 0.02
    viscous: float = 0.05
    #: the values were taken from the rows that they are compared with, and are not independent of them
    from_record: bool = False


@dataclass(frozen=True)
class Rig:
    """The test rig; None or empty if unknown."""

    planes: int | None = None  #: principal planes that can move, 1 or 2
    force: str = ""  #: ``measured`` at the structure, or ``prescribed``
    rate: float | None = None  #: of a sweep, Hz/s; 0 for dwells


@dataclass(frozen=True)
class Repeatability:
    """Relative standard uncertainty of amplitude and frequency from sweep to sweep; None: to be estimated."""

    amplitude: float | None = None
    frequency: float | None = None


@dataclass(frozen=True)
class Units:
    """Names of the units of record and mode; empty if not named: one consistent system is assumed."""

    force: str = ""
    length: str = ""
    time: str = ""

    @property
    def drive(self) -> str:
        """The quantity in the column ``force``, by its unit."""
        return "base acceleration" if self.force and self.force == self._acceleration else "force"

    @property
    def of_base_drive(self) -> "Units":
        """The units if the column ``force`` holds the acceleration of the base."""
        return replace(self, force=self._acceleration)

    @property
    def _acceleration(self) -> str:
        return f"{self.length}/{self.time}²" if self.length and self.time else ""

    def __str__(self) -> str:
        named = (f"{what} in {unit}" for what, unit in vars(self).items() if unit)
        return ", ".join(named) or "one consistent system of units"


class FixedTable(dict[str, Any]):
    """A read-only dictionary, as part of an immutable mode; a subclass of dict, so that it is written like one."""

    def _refuse(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("a mode does not change; dataclasses.replace(mode, damping={...}) makes another")

    __setitem__ = __delitem__ = __ior__ = clear = pop = popitem = setdefault = update = _refuse

    def __hash__(self) -> int:  # type: ignore[override]  # a dict has none
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple[type, tuple[dict[str, Any]]]:
        return FixedTable, (dict(self),)  # as a whole: setting single items is refused


@dataclass(frozen=True, kw_only=True)
class Mode:
    """One vibration mode as the simulation assumes it, checked like a mode file.

    ``frequency`` is the undamped natural frequency in Hz (with ``slip`` or ``dahl``: of the stuck state), ``mass`` the
    generalized mass. ``damping`` maps the name of each simulated damping force to its parameters (``coefficient``;
    ``exponent`` of the two power laws; ``stiffness`` and ``limit`` of ``slip`` and ``dahl``), ``effects`` the name of
    each other effect to its parameters. ``drive`` is ``force``, or ``base`` if the column ``force`` holds the
    acceleration of the base and ``amplitude`` the motion relative to it; the mass then only scales the damping forces,
    and defaults to 1. ``source`` says where the mode is from. Tables may be given as in a mode file: mappings, and a
    bare number for the coefficient of a force without other parameters. InputError: what :func:`read_mode` refuses.
    """

    name: str = "mode"
    frequency: float = math.nan
    mass: float = math.nan
    drive: str = "force"
    tolerance: Tolerance = Tolerance()
    repeatability: Repeatability = Repeatability()
    units: Units = Units()
    rig: Rig = Rig()
    damping: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    effects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "source", read_source(self.source))
        given = {name: getattr(self, name) for name in ("name", "frequency", "mass", "drive", "tolerance")}
        written: dict[str, Any] = {
            "mode": {name: value for name, value in given.items() if value is not getattr(type(self), name)},
            **{name: getattr(self, name) for name in ("repeatability", "units", "rig", "damping", "effects")},
        }  # without default objects, which were not given
        for name, value in _checked(TomlTable(_as_written(written), (), self.source or "mode", ""), self.name).items():
            object.__setattr__(self, name, _fixed(value))

    def find_states(self, stated: FloatArray | None, levels: int) -> FloatArray:
        """Masses (levels,) of the states in which levels were tested; ``stated`` (levels,): by the record, NaN if none.

        All are this mode's mass if that was taken from the record, or if they differ by no more than estimates of one.
        """
        same = np.full(levels, self.mass)
        if stated is None or self.tolerance.from_record:
            return same
        mass = np.where(np.isnan(stated), self.mass, stated)
        return mass if np.ptp(np.log(mass)) > STATES_APART * self.tolerance.mass else same

    def _repr_html_(self) -> str:
        return f"<pre>{escape(describe_mode_to_toml(self))}</pre>"

    @property
    def omega_n(self) -> float:
        """Undamped natural frequency, rad per unit of time: 2 pi times ``frequency``."""
        return RAD_S_PER_HZ * self.frequency

    @property
    def viscous_ratio(self) -> float:
        """Damping ratio C/(2 M omega_n) of the viscous part of the damping; 0 if there is none."""
        return self.damping.get("viscous", {}).get("coefficient", 0.0) / (2.0 * self.mass * self.omega_n)


def read_mode(path: str | Path, *, max_size: int = DEFAULT_MAX_SIZE) -> Mode:
    """The mode in a TOML file, checked.

    Raises InputError, naming file, line and key, for a file that cannot be read or is not TOML; a missing or unknown
    key (the nearest known is named); a value of the wrong type, NaN, infinite or of a magnitude beyond 1e-50..1e50;
    frequency or mass <= 0; a negative tolerance or repeatability; a parameter of a force or effect out of its bounds.
    """
    return Mode(**_checked(read_toml(path, max_size), Path(path).stem), source=str(path))


def parse_mode(data: bytes, source: str, name: str) -> Mode:
    """The mode in the bytes of the file ``source``; ``name`` if it has none. InputError: as of :func:`read_mode`."""
    return Mode(**_checked(parse_toml(data, source), name), source=source)


def _checked(top: TomlTable, name: str) -> dict[str, Any]:
    """The fields of a mode (without ``source``) from the tables of its file; ``name``: the default name."""
    top.only("mode", "repeatability", "units", "rig", "damping", "effects")
    mode = top.table("mode", "name", "frequency", "mass", "drive", "tolerance", required=True)
    drive = mode.text("drive", default="force")
    if drive not in DRIVES:
        raise mode.error("drive", f"is {drive!r}", '"force" or "base"')
    units = top.table("units", "force", "length", "time")
    tolerance = mode.table("tolerance", *vars(Tolerance()))
    repeatability = top.table("repeatability", "amplitude", "frequency")
    damping, others = top.table("damping", *forces.CATALOGUE), top.table("effects", *effects.CATALOGUE)
    sizes = ("frequency", "mass", "viscous")
    simulated = {name: _force(damping, name) for name in damping.values}
    frequency = mode.number("frequency", above=0.0)
    mass = mode.number("mass", above=0.0, default=1.0 if drive == "base" else None)
    further = {name: _parameters(others.table(name), effects.CATALOGUE[name].shapes) for name in others.values}
    whole = mass * (RAD_S_PER_HZ * frequency) ** 2
    for written, read in ((damping, simulated), (others, further)):
        for name, lost in ((name, values.get("stiffness", 0.0)) for name, values in read.items()):
            if lost > ROUNDED * whole:
                expected = f"at most {whole:.6g}, the stiffness of the mode, mass times (2 pi frequency)^2"
                raise written.table(name).error("stiffness", f"is {lost:g}", expected)
    return {
        "name": mode.text("name", default=name),
        "frequency": frequency,
        "mass": mass,
        "drive": drive,
        "tolerance": Tolerance(
            **{key: tolerance.number(key, default=getattr(Tolerance, key), least=0.0) for key in sizes},
            from_record=tolerance.truth("from_record"),
        ),
        "repeatability": Repeatability(*(repeatability.known(key, least=0.0) for key in ("amplitude", "frequency"))),
        "units": Units(*(units.text(what, default="") for what in ("force", "length", "time"))),
        "rig": _rig(top.table("rig", "planes", "force", "rate")),
        "damping": simulated,
        "effects": further,
    }


def _fixed(value: Any) -> Any:
    """A field with its tables made read-only."""
    return FixedTable((key, _fixed(inner)) for key, inner in value.items()) if isinstance(value, dict) else value


def _as_written(value: Any) -> Any:
    """A field as written in a mode file: tables as dictionaries without unstated values, plain numbers."""
    if isinstance(value, Tolerance | Repeatability | Units | Rig):
        value = {key: stated for key, stated in vars(value).items() if stated is not None and stated != ""}
    if isinstance(value, Mapping):
        return {key: _as_written(inner) for key, inner in value.items()}
    return to_python(value)


def _rig(table: TomlTable) -> Rig:
    planes, rate, force = table.known("planes"), table.known("rate"), table.text("force", default="")
    if planes not in (None, 1.0, 2.0):
        raise table.error("planes", f"is {planes:g}", "1 or 2")
    if force not in ("", "measured", "prescribed"):
        raise table.error("force", f"is {force!r}", '"measured" or "prescribed"')
    return Rig(None if planes is None else int(planes), force, rate)


def _force(damping: TomlTable, name: str) -> dict[str, float]:
    """Parameters of one damping force; a bare number is the value of its only parameter."""
    shapes = forces.shapes_of(name)
    if len(shapes) == 1 and not isinstance(damping.values[name], dict):
        return {shapes[0].name: _number(damping, name, shapes[0])}
    expected = f"{{{', '.join(f'{shape.name} = ...' for shape in shapes)}}}"
    table = damping.table(name, expected=expected)
    of_effect = {shape.name for shape in effects.CATALOGUE[name].shapes} if name in effects.CATALOGUE else set()
    if keys := [key for key in table.values if key in of_effect - {shape.name for shape in shapes}]:
        where = f"[effects.{name}]"
        raise table.error(keys[0], f"a key of {where}, not of [damping.{name}]", f"{expected}, or all of it in {where}")
    return _parameters(table, shapes)


def _parameters(table: TomlTable, shapes: tuple[Shape, ...]) -> dict[str, float]:
    """The numbers of a table; those with a default may be absent."""
    table.only(*(shape.name for shape in shapes))
    given = [shape for shape in shapes if shape.default is None or shape.name in table.values]
    return {shape.name: _number(table, shape.name, shape) for shape in given}


def _number(table: TomlTable, key: str, shape: Shape) -> float:
    number = table.number(key, above=shape.above, least=shape.least, below=shape.below)
    if shape.switch and number not in (0.0, 1.0):
        raise table.error(key, f"is {number:g}", "0 or 1")
    if number and table.values.get(shape.excludes):
        raise table.error(key, f"stands beside {shape.excludes}", "one of the two")
    if shape.needs and number != shape.default and not table.values.get(shape.needs):
        raise table.error(key, f"is {number:g}, which says nothing without {shape.needs}", f"{shape.needs} beside it")
    return number


def describe_mode_to_toml(mode: Mode) -> str:
    """The TOML file of a mode; reading it gives the same mode, except ``source``, to the last digit."""
    groups = {
        "mode": {"name": mode.name, "frequency": mode.frequency, "mass": mode.mass}
        | ({"drive": mode.drive} if mode.drive != "force" else {}),
        "mode.tolerance": {key: value for key, value in vars(mode.tolerance).items() if value is not False},
        **{name: _as_written(getattr(mode, name)) for name in ("repeatability", "units", "rig")},
        # a force with one parameter is written as the bare number
        "damping": {
            name: next(iter(parameters.values())) if len(parameters) == 1 else parameters
            for name, parameters in mode.damping.items()
        },
        **{f"effects.{name}": parameters for name, parameters in mode.effects.items()},
    }
    shown = {name: _list_pairs(of) for name, of in groups.items() if of or name.startswith("effects.")}
    return "\n".join("\n".join([f"[{name}]", *pairs, ""]) for name, pairs in shown.items())


def _list_pairs(table: Mapping[str, Any]) -> list[str]:
    names = (key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else quote_toml(key) for key in table)
    return [f"{name} = {_describe_value(value)}" for name, value in zip(names, table.values(), strict=True)]


def _describe_value(value: str | float | Mapping[str, float]) -> str:
    if isinstance(value, str):
        return quote_toml(value)
    if isinstance(value, Mapping):
        return f"{{{', '.join(_list_pairs(value))}}}"
    return "true" if value is True else repr(float(value))


def quote_toml(text: str) -> str:
    """A TOML basic string: escaped as in JSON, and the delete character too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
