"""Parameters of forces and effects: name, unit, bounds and prior, each declared once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import inf, pi
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from damping.arrays import FloatArray
from damping.errors import InputError, list_nearest


@dataclass(frozen=True)
class Dimension:
    """Powers of ``force``, ``length`` and ``time``.

    Written as a product: ``FORCE * (TIME / LENGTH) ** "exponent"``.
    """

    force: float = 0.0
    length: float = 0.0
    time: float = 0.0
    raised: tuple[tuple[str, Dimension], ...] = ()  #: further dimensions to the power of a named parameter

    def __mul__(self, other: Dimension) -> Dimension:
        """The product: powers add."""
        return Dimension(
            self.force + other.force, self.length + other.length, self.time + other.time, self.raised + other.raised
        )

    def __truediv__(self, other: Dimension) -> Dimension:
        """The quotient."""
        return self * other**-1.0

    def __pow__(self, power: float | str) -> Dimension:
        """To the ``power``, a number or the name of a parameter."""
        if isinstance(power, str):
            return Dimension(raised=((power, self),))
        raised = tuple((name, part**power) for name, part in self.raised)
        return Dimension(power * self.force, power * self.length, power * self.time, raised)

    @property
    def of_base_drive(self) -> Dimension:
        """The dimension in a base-driven test, with acceleration in the place of force."""
        raised = tuple((name, part.of_base_drive) for name, part in self.raised)
        return Dimension(0.0, self.length + self.force, self.time - 2.0 * self.force, raised)

    def at(self, parameters: Mapping[str, float]) -> Dimension:
        """The dimension at these values of the parameters."""
        plain = replace(self, raised=())
        for name, part in self.raised:
            plain = plain * part ** parameters[name]
        return plain


PURE = Dimension()
FORCE = Dimension(force=1.0)
LENGTH = Dimension(length=1.0)
TIME = Dimension(time=1.0)
#: One turn, rad: a larger angle is in degrees, as a larger phase of a record is.
TURN = 2.0 * pi


class Tested(NamedTuple):
    """Range of a test: ``smallest`` and ``largest`` resonant amplitude, and ``omega`` of its reference, rad/s."""

    smallest: float
    largest: float
    omega: float


@dataclass(frozen=True)
class Uniform:
    """Prior of a shape parameter as a map from a standard normal variable: uniform from ``low`` to ``high``."""

    low: float
    high: float

    @property
    def text(self) -> str:
        """The prior in words, such as ``uniform from 0 to 3``."""
        return f"uniform from {self.low:g} to {self.high:g}"

    @property
    def range(self) -> tuple[float, float]:
        """Range of values for any test: ``low`` and ``high``."""
        return self.low, self.high

    def value(self, x: FloatArray, tested: Tested) -> FloatArray:
        """low + (high - low) Phi(x)."""
        return np.asarray(self.low + ndtr(x) * (self.high - self.low))


@dataclass(frozen=True)
class OfAmplitude:
    """As `Uniform`, log-uniform from ``low`` times the smallest to ``high`` times the largest tested amplitude."""

    low: float
    high: float

    @property
    def text(self) -> str:
        """The prior in words."""
        return f"log-uniform from {self.low:g} times the smallest to {self.high:g} times the largest tested amplitude"

    @property
    def range(self) -> None:
        """None: the range depends on the test."""

    def value(self, x: FloatArray, tested: Tested) -> FloatArray:
        """exp(ln a + (ln b - ln a) Phi(x)), from a to b."""
        low, high = np.log((self.low * tested.smallest, self.high * tested.largest))
        return np.asarray(np.exp(low + ndtr(x) * (high - low)))


@dataclass(frozen=True)
class Shape:
    """One parameter of a force or an effect."""

    name: str  #: as in files
    unit: Dimension = PURE  #: its dimension
    above: float = -inf  #: value > above
    least: float = -inf  #: value >= least
    below: float = inf  #: value < below
    default: float | None = None  #: value where a file does not name it; None where a file must
    prior: Uniform | OfAmplitude | None = None  #: of a parameter that is free in a law, other than the coefficient
    label: str = ""  #: for people, such as ``slip limit``; the name where empty
    switch: bool = False  #: whether it is only 0 or 1
    excludes: str = ""  #: parameter that must be 0 or absent where this one is not 0
    needs: str = ""  #: parameter without which this one means nothing, but for its default

    def prior_value(self, x: FloatArray, tested: Tested) -> FloatArray:
        """The parameter at standard normal ``x``. InputError: without a prior it cannot be free in a law."""
        if self.prior is None:
            raise InputError(f"the shape {self.name!r} of a force has no prior", expected="Shape(..., prior=...)")
        return self.prior.value(x, tested)


def coefficient_in(unit: Dimension) -> Shape:
    """The coefficient >= 0 to which a force is proportional."""
    return Shape("coefficient", unit, least=0.0)


def completed(shapes: Iterable[Shape], table: Mapping[str, float], owner: str) -> dict[str, float]:
    """The values of ``table`` completed by defaults; ``owner``: name of the table in messages.

    Raises:
        InputError: a key that is unknown (the nearest known one is named) or missing.
    """
    known = {shape.name: shape for shape in shapes}
    for key in table:
        if key not in known:
            raise InputError(f"unknown key {key!r} in {owner}", expected=list_nearest(key, known))
    values = {shape.name: table.get(shape.name, shape.default) for shape in known.values()}
    for key, value in values.items():
        if value is None:
            raise InputError(f"no {key} in {owner}", expected=", ".join(known))
    return {key: value for key, value in values.items() if value is not None}


def rescale(
    shapes: Iterable[Shape], table: Mapping[str, float], owner: str, force: float, length: float
) -> dict[str, float]:
    """The parameters of ``table`` in new units, of which ``force`` make an old unit of force and ``length`` of length.

    A unit may depend on another parameter, as that of alpha |q'|^p on p.
    """
    values = completed(shapes, table, owner)
    units = {shape.name: shape.unit.at(values) for shape in shapes}
    return {key: value * (force ** units[key].force * length ** units[key].length) for key, value in table.items()}
