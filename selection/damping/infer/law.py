"""A candidate damping law and its parameters: a sum of forces whose coefficients (and shapes) are unknown.

Each parameter is dimensionless and a known function of a standard normal variable. The prior of any law is therefore
``prod N(x_i; 0, 1)``, and a chain never meets a bound:

- ``total``: the law's damping force at the reference (geometric means over the tested resonances) relative to the
  force measured there; log-normal about 1.
- ``share`` of each force in that total: uniform over the simplex (stick-breaking), so no force is favoured and
  coefficients are >= 0.
- shapes: each with its prior (`damping.forces.shapes`).
- ``scatter``: relative scatter of one measured row; ``level_scatter``: relative scatter of the resonant amplitude from
  sweep to sweep. Both log-normal. With one sweep, or one row in every sweep, only their sum can be identified, and
  ``scatter`` is that sum.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import EllipsisType
from typing import TypeAlias

import numpy as np
from scipy.special import ndtr, ndtri

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.forces import Component, component
from damping.forces.contract import Sum
from damping.forces.shapes import Shape, Tested
from damping.infer.discrepancy import DISCREPANCY_LOG_SD, DISCREPANCY_MEDIAN, measure_nonlinearity
from damping.infer.observations import DRAWN_BITS, Observations, round_bits

TOTAL_LOG_SD = 1.0  #: standard deviation of ln(total): a factor e between a law and the measured force at the reference
SCATTER_MEDIAN = 0.011  #: prior median of a relative scatter
#: Log standard deviation of that prior: 90 % lie between 0.3 % and 4 %, from stepped sine in a laboratory to repeat
#: tests of large structures.
SCATTER_LOG_SD = 0.8
LARGEST_SCORE = 3.0  #: largest standard normal variable at the start of a search for the mode


@dataclass(frozen=True)
class Law:
    """A candidate: a sum of components. Two laws with the same components are the same law.

    InputError: a component that is neither a force nor an energy term (the message names the nearest one), or text in
    the place of a list.
    """

    components: tuple[str, ...]

    def __post_init__(self) -> None:
        listed = isinstance(self.components, Iterable) and not isinstance(self.components, str)
        if not listed or not all(isinstance(name, str) for name in self.components):
            raise InputError(f"components {self.components!r}", expected='names of forces, ("viscous", "slip")')
        object.__setattr__(self, "components", tuple(self.components))
        for name in self.components:
            component(name)

    @classmethod
    def named(cls, name: str) -> Law:
        """The law of a `name`."""
        return cls(tuple(name.split(" + ")))

    @property
    def name(self) -> str:
        """Component names joined by ``+``."""
        return " + ".join(self.components)

    @cached_property
    def parts(self) -> tuple[Component, ...]:
        """The components with their builders."""
        return tuple(component(name) for name in self.components)

    @cached_property
    def free_shapes(self) -> dict[str, Shape]:
        """The shape parameters of all components by name, such as ``velocity-power exponent``."""
        return {f"{part.name} {shape.name}": shape for part in self.parts for shape in part.free_shapes}

    @property
    def has_resonance(self) -> bool:
        """Whether the law can set a resonant amplitude: constant friction alone cannot."""
        return any(part.example.resonates for part in self.parts)

    @property
    def is_viscous(self) -> bool:
        """Whether the law is viscous damping alone."""
        return all(part.example.viscous for part in self.parts)


#: Selection of the points of parts: all, a block of them, or all with an axis that broadcasts with rows.
Index: TypeAlias = EllipsisType | slice | tuple[EllipsisType | slice, None]
EACH_WITH_ROWS: Index = (..., None)
#: A component, its leading coefficient and its shapes by name, arrays of one shape.
Part: TypeAlias = tuple[Component, FloatArray, dict[str, FloatArray]]


@dataclass(frozen=True)
class Coordinates:
    """The map from standard normal variables ``x`` (..., dimension) to the parameters of a law on a record."""

    law: Law  #: the candidate
    reference: tuple[float, float, float]  #: amplitude, omega, damping force
    tested: Tested  #: range of the test
    with_level_scatter: bool  #: whether several sweeps of several rows make both scatters parameters
    with_discrepancy: bool = False  #: whether the exponent may depart from the law's
    of_decay: bool = False  #: whether levels are judged by force at a given amplitude

    @classmethod
    def of(cls, law: Law, observations: Observations) -> Coordinates:
        """The coordinates of a law with scales from the observations."""
        amplitude = observations.tested_amplitude
        tested = Tested(float(amplitude.min()), float(amplitude.max()), observations.reference[1])
        several, of_decay = len(observations.sweeps) > 1, observations.amplitude_is_input
        return cls(law, observations.reference, tested, observations.has_repeats and several, several, of_decay)

    def scaled(self, by: tuple[float, float, float]) -> Coordinates:
        """The dimensionless coordinates over an amplitude, a frequency and a force (:meth:`Observations.scaled`)."""
        amplitude, omega, force = (float(x) for x in round_bits(np.array(self.reference) / by, DRAWN_BITS))
        low, high = (float(x) for x in round_bits(np.array(self.tested[:2]) / by[0], DRAWN_BITS))
        tested = Tested(low, high, float(round_bits(np.array(self.tested.omega / by[1]), DRAWN_BITS)))
        return replace(self, reference=(amplitude, omega, force), tested=tested)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in order."""
        shares = [f"share {part.name}" for part in self.law.parts[:-1]]
        scatters = ["scatter", "level_scatter"] if self.with_level_scatter else ["scatter"]
        discrepancy = ["discrepancy"] if self.with_discrepancy else []
        return ("total", *shares, *self.law.free_shapes, *discrepancy, *scatters)

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.names)

    def place(self, points: FloatArray) -> FloatArray:
        """Variables x (..., dimension), zero except the shapes ``points`` (..., shapes)."""
        x = np.zeros((*points.shape[:-1], self.dimension))
        x[..., len(self.law.parts) : len(self.law.parts) + points.shape[-1]] = points
        return x

    def find_variables(
        self, coefficients: FloatArray, point: FloatArray, scatter: float, least_share: float
    ) -> FloatArray:
        """The variables x (dimension,) of coefficients (parts,), shapes ``point`` (shapes,) and a relative scatter.

        Shares are at least ``least_share``, others within ``LARGEST_SCORE``: the prior vanishes at the ends.
        """
        x, parts = self.place(point), len(self.law.parts)
        unit = np.array(self.coefficients(x))
        force = coefficients / unit * np.asarray(self.shares(x))
        total = max(float(force.sum()), np.finfo(float).tiny)  # a fit may be of no damping at all
        x[0] = np.clip(np.log(total) / TOTAL_LOG_SD, -LARGEST_SCORE, LARGEST_SCORE)
        remainder = force.sum()
        for i in range(parts - 1):
            fraction = np.clip(force[i] / max(remainder, np.finfo(float).tiny), least_share, 1.0 - least_share)
            x[1 + i] = -ndtri((1.0 - fraction) ** (parts - 1 - i))
            remainder -= force[i]
        score = np.log(scatter / SCATTER_MEDIAN + 0.1) / SCATTER_LOG_SD
        x[-1 - self.with_level_scatter :] = np.clip(score, -LARGEST_SCORE, LARGEST_SCORE)
        return x

    def shares(self, x: FloatArray) -> FloatArray:
        """Shares of the components (..., parts), uniform over the simplex: Beta(1, k) fractions of the remainder."""
        n = len(self.law.parts)
        remainder = np.ones(x.shape[:-1])
        shares = []
        for i in range(n - 1):
            # the share's complement is U^(1/k): Beta(1, k) by inversion
            fraction = -np.expm1(np.log(ndtr(-x[..., 1 + i])) / (n - 1 - i))
            shares.append(remainder * fraction)
            remainder = remainder * (1.0 - fraction)
        return np.stack([*shares, remainder], axis=-1)

    def shapes(self, x: FloatArray) -> list[dict[str, FloatArray]]:
        """Shape parameters of each component, arrays of shape ``x.shape[:-1]``."""
        position = len(self.law.parts)
        result = []
        for part in self.law.parts:
            values = {}
            for shape in part.free_shapes:
                values[shape.name] = shape.prior_value(x[..., position], self.tested)
                position += 1
            result.append(values)
        return result

    def find_parts(self, x: FloatArray) -> list[Part]:
        """Each component with its leading coefficient in the units of the record (slip: stiffness), and its shapes."""
        amplitude, omega, force = self.reference
        total, shares = force * np.exp(TOTAL_LOG_SD * x[..., 0]), self.shares(x)
        return [
            (part, shares[..., i] * total / part.build(1.0, **shapes).scale(amplitude, omega), shapes)
            for i, (part, shapes) in enumerate(zip(self.law.parts, self.shapes(x), strict=True))
        ]

    def coefficients(self, x: FloatArray) -> list[FloatArray]:
        """Leading coefficient of each component."""
        return [coefficient for _, coefficient, _ in self.find_parts(x)]

    def force(self, x: FloatArray) -> Sum:
        """The damping force of the law, with parameters of shape (..., 1) that broadcast with rows."""
        return self.join(self.find_parts(x), EACH_WITH_ROWS)

    @staticmethod
    def join(parts: Sequence[Part], points: Index = ...) -> Sum:
        """The force of the parts from `find_parts` at some of their points."""
        return Sum(
            tuple(part.build(c[points], **{name: x[points] for name, x in shapes.items()}) for part, c, shapes in parts)
        )

    def scatter(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row scatter and level scatter (0 where it is not a parameter), relative; arrays ``x.shape[:-1]``."""
        scatter = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * x[..., -2:])
        if self.with_level_scatter:
            return scatter[..., 0], scatter[..., 1]
        return scatter[..., -1], np.zeros(x.shape[:-1])

    def discrepancy(self, x: FloatArray, parts: Sequence[Part] = ()) -> FloatArray:
        """Standard deviation sigma of the slope's discrepancy, 0 where it is not a parameter; array ``x.shape[:-1]``.

        ``parts``: of the law at ``x`` (``find_parts``), where known.
        """
        if not self.with_discrepancy:
            return np.zeros(x.shape[:-1])
        sigma = DISCREPANCY_MEDIAN * np.exp(DISCREPANCY_LOG_SD * x[..., -3 if self.with_level_scatter else -2])
        return np.asarray(sigma * measure_nonlinearity(self.exponents(x, parts)))

    def discrepancy_of_levels(self, x: FloatArray, parts: Sequence[Part] = ()) -> FloatArray:
        """:meth:`discrepancy` of the quantity that levels are judged by: ln A, or ln F, p times that, in a decay."""
        sigma = self.discrepancy(x, parts)
        return sigma * np.nan_to_num(self.exponents(x, parts)).mean(axis=-1) if self.of_decay else sigma

    def exponents(self, x: FloatArray, parts: Sequence[Part] = ()) -> FloatArray:
        """Local exponents p = d ln F/d ln A at both ends of the tested range, (..., 2); NaN where there is no force."""
        ends = np.reshape(self.tested[:2], (2, *[1] * (x.ndim - 1)))
        with np.errstate(all="ignore"):
            C, slope = self.join(parts or self.find_parts(x)).grow(ends, self.tested.omega)
            return np.moveaxis(np.asarray(slope / C), 0, -1)

    def force_parameters(self, x: FloatArray) -> dict[str, FloatArray]:
        """Coefficient and shapes of each component by name: ``viscous``, ``velocity-power exponent``, ..."""
        values: dict[str, FloatArray] = {}
        for part, coefficient, shapes in self.find_parts(x):
            values[part.name] = coefficient
            values |= {f"{part.name} {name}": value for name, value in shapes.items()}
        return values

    def parameters(self, x: FloatArray) -> dict[str, FloatArray]:
        """All physical parameters by name: ``force_parameters``, ``discrepancy``, ``scatter`` and ``level_scatter``."""
        values = self.force_parameters(x)
        row, level = self.scatter(x)
        if self.with_discrepancy:
            values["discrepancy"] = self.discrepancy(x)
        values["scatter"] = row
        if self.with_level_scatter:
            values["level_scatter"] = level
        return values
