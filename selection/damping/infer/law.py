"""A candidate damping law and its parameters: a sum of forces whose coefficients (and shapes) are unknown.

The parameters are dimensionless and every one of them is a known function of a standard normal variable, so that the
prior of any law is ``prod N(x_i; 0, 1)`` and a chain never meets a wall:

- ``total``: the law's damping force at the reference (geometric means over the tested resonances) relative to the
  force measured there; log-normal about 1.
- ``share`` of each force in that total: uniform over the simplex (stick-breaking), so no force is favoured and
  coefficients are >= 0.
- shapes: as each force says of its own (`damping.forces.shapes`).
- ``scatter``: relative scatter of one measured row; ``level_scatter``: relative scatter of the resonant amplitude from
  sweep to sweep. Both log-normal. Where there is one sweep, or one row in every sweep, only their sum can be seen, and
  ``scatter`` is that.

Prior and likelihood of a damping law, pure and vectorised over points of parameter space.

Residual of a row, the distance of the measured phasor (ln A, phi) from the curve C(A, omega) = F sin(phi):

    n = (D - C) / sqrt(g^2 + R^2),      g = dC/d ln A * min(1, |D/C|),   R = F cos(phi).

(Of a free decay, where amplitude is the input, g = C: the relative error of force, which constant friction has too.)
(The factor makes the distance grow without bound for a law that is far too strong, as it does for one too weak.)
At resonance (R = 0) it is the relative error of amplitude, far from it the error of phase in rad; rows are so weighed
by what they know of damping. Circular scatter of the phasor gives n the standard deviation ``scatter`` everywhere; the
record's own uncertainties are added in quadrature. A sweep's resonance scatters as a whole by ``level_scatter``, which
moves its rows by h = g / sqrt(g^2 + R^2) each:

    cov(n) = diag(s^2) + level_scatter^2 h h^T   within a sweep.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from damping.arrays import FloatArray
from damping.forces import Component, component
from damping.forces.contract import Force, Sum
from damping.forces.shapes import Shape, Tested
from damping.infer.doubt import DOUBT_LOG_SD, DOUBT_MEDIAN, stray_covariance
from damping.infer.observations import Observations, round_bits

#: Standard deviation of ln(total): a law may miss the measured force at the reference by a factor e either way.
TOTAL_LOG_SD = 1.0
#: Median and log standard deviation of a relative scatter: 90 % of the prior lies between 0.6 % and 7 %, the range of
#: repeat tests of large structures.
SCATTER_MEDIAN = 0.02
SCATTER_LOG_SD = 0.75


@dataclass(frozen=True)
class Law:
    """A candidate: a sum of components. Two laws with the same components are the same law.

    Raises:
        InputError: a component is no force and no energy term; the nearest one is named.
    """

    components: tuple[str, ...]

    def __post_init__(self) -> None:
        for name in self.components:
            component(name)

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
        """Whether it is viscous damping alone."""
        return all(part.example.viscous for part in self.parts)


@dataclass(frozen=True)
class Coordinates:
    """The map from standard normal variables ``x`` (..., dimension) to the parameters of a law on given observations.

    Attributes:
        law: the candidate. reference: amplitude, omega, damping force. tested: what the test covers.
        with_level_scatter: whether there are several sweeps of several rows, so that both scatters are parameters.
        with_doubt: whether the local exponent may stray from the law's (:mod:`damping.infer.doubt`).
    """

    law: Law
    reference: tuple[float, float, float]
    tested: Tested
    with_level_scatter: bool
    with_doubt: bool = False

    @classmethod
    def of(cls, law: Law, observations: Observations) -> Coordinates:
        """Scales taken from the observations."""
        amplitude = observations.tested_amplitude
        tested = Tested(float(amplitude.min()), float(amplitude.max()), observations.reference[1])
        scatters = observations.has_repeats and len(observations.sweeps) > 1
        return cls(law, observations.reference, tested, scatters, len(observations.sweeps) > 1)

    def scaled(self, by: tuple[float, float, float]) -> Coordinates:
        """The same without dimension: over an amplitude, a frequency and a force (:meth:`Observations.scaled`)."""
        amplitude, omega, force = (float(x) for x in round_bits(np.array(self.reference) / by))
        low, high = (float(x) for x in round_bits(np.array(self.tested[:2]) / by[0]))
        tested = Tested(low, high, float(round_bits(np.array(self.tested.omega / by[1]))))
        return replace(self, reference=(amplitude, omega, force), tested=tested)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in order."""
        shares = [f"share {part.name}" for part in self.law.parts[:-1]]
        scatters = ["scatter", "level_scatter"] if self.with_level_scatter else ["scatter"]
        doubt = ["doubt"] if self.with_doubt else []
        return ("total", *shares, *self.law.free_shapes, *doubt, *scatters)

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.names)

    def shares(self, x: FloatArray) -> FloatArray:
        """Shares of the components (..., parts), uniform over the simplex: Beta(1, k) fractions of what is left."""
        n = len(self.law.parts)
        left = np.ones(x.shape[:-1])
        shares = []
        for i in range(n - 1):
            # the share's complement is U^(1/k): Beta(1, k) by inversion
            fraction = -np.expm1(np.log(ndtr(-x[..., 1 + i])) / (n - 1 - i))
            shares.append(left * fraction)
            left = left * (1.0 - fraction)
        return np.stack([*shares, left], axis=-1)

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

    def coefficients(self, x: FloatArray) -> list[FloatArray]:
        """Leading coefficient of each component (stiffness of a slip joint), in the units of the record."""
        amplitude, omega, force = self.reference
        total = force * np.exp(TOTAL_LOG_SD * x[..., 0])
        shares = self.shares(x)
        return [
            shares[..., i] * total / part.build(1.0, **shapes).scale(amplitude, omega)
            for i, (part, shapes) in enumerate(zip(self.law.parts, self.shapes(x), strict=True))
        ]

    def force(self, x: FloatArray) -> Sum:
        """The damping force of the law; its parameters have shape (..., 1) so that they broadcast with rows."""
        column = lambda value: np.asarray(value)[..., None]  # noqa: E731 - shorthand for one expression
        return Sum(
            tuple(
                part.build(column(c), **{name: column(value) for name, value in shapes.items()})
                for part, c, shapes in zip(self.law.parts, self.coefficients(x), self.shapes(x), strict=True)
            )
        )

    def scatter(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Row scatter and level scatter (0 where it is not a parameter), relative; arrays ``x.shape[:-1]``."""
        value = lambda column: SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * x[..., column])  # noqa: E731 - used three times
        if self.with_level_scatter:
            return value(-2), value(-1)
        return value(-1), np.zeros(x.shape[:-1])

    def doubt(self, x: FloatArray) -> FloatArray:
        """Standard deviation of the exponent's straying, 0 where it is not a parameter; array ``x.shape[:-1]``."""
        if not self.with_doubt:
            return np.zeros(x.shape[:-1])
        return np.asarray(DOUBT_MEDIAN * np.exp(DOUBT_LOG_SD * x[..., -3 if self.with_level_scatter else -2]))

    def parameters(self, x: FloatArray) -> dict[str, FloatArray]:
        """All physical parameters by name: ``viscous``, ``velocity-power exponent``, ..., ``scatter``."""
        values: dict[str, FloatArray] = {}
        for part, coefficient, shapes in zip(self.law.parts, self.coefficients(x), self.shapes(x), strict=True):
            values[part.name] = coefficient
            values |= {f"{part.name} {name}": value for name, value in shapes.items()}
        row, level = self.scatter(x)
        if self.with_doubt:
            values["doubt"] = self.doubt(x)
        values["scatter"] = row
        if self.with_level_scatter:
            values["level_scatter"] = level
        return values


#: The prior is cut off at 8 standard deviations (probability 1e-15), where numbers would overflow.
REACH = 8.0
#: Points times rows beyond which points are computed in blocks of as many: they stay in a processor's cache.
MOST = 250_000
BLOCK = 60_000
#: Sweeps up to which a product with their matrix is the quickest way to sums over each.
_FEW = 32


def residuals(force: Force, data: Observations) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``n``, its sensitivity to the level ``h``, its variance by the record's own uncertainties; each (..., rows)."""
    with np.errstate(all="ignore"):
        C = force.quadrature(data.A, data.omega)
        grown = C if data.amplitude_is_input else force.slope(data.A, data.omega)
        g = grown * np.minimum(1.0, np.abs(data.D / C))
        spread = g**2 + data.R**2
        n = (data.D - C) / np.sqrt(spread)
        known = (g**2 * data.sd_amplitude**2 + data.R**2 * data.sd_phase**2 + data.D**2 * data.sd_force**2) / spread
        return n, g / np.sqrt(spread), known


def log_likelihood(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Log likelihood at points ``x`` of shape (points, dimension); ``-inf`` where the law cannot carry the forces."""
    return by_blocks(lambda block: _log_likelihood(block, coordinates, data), x, len(data.A))


def by_blocks(work: Callable[[FloatArray], FloatArray], x: FloatArray, rows: int) -> FloatArray:
    """``work(x)``, a value a point of ``x`` (points, dimension); its arrays of (points, rows) stay small."""
    if len(x) * rows <= MOST:
        return work(x)
    step = max(1, BLOCK // rows)
    return np.concatenate([work(x[first : first + step]) for first in range(0, len(x), step)])


def _log_likelihood(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    n, h, known = residuals(coordinates.force(x), data)
    variance = coordinates.scatter(x)[0][:, None] ** 2 + known
    with np.errstate(all="ignore"):
        value = -0.5 * np.sum(np.log(2.0 * np.pi * variance), axis=-1)
        if coordinates.with_level_scatter or coordinates.with_doubt:
            nn, hh, hn = (by_sweep(product / variance, data) for product in (n**2, h**2, h * n))
            value += _of_levels(nn, hh, hn, level_covariance(x, coordinates, data))
        else:
            value -= 0.5 * np.sum(n**2 / variance, axis=-1)
    return np.where(np.isfinite(value), value, -np.inf)


def level_covariance(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Covariance of ln A of the levels about the law: scatter of each and straying of the exponent, (points, s, s)."""
    z = np.log(data.tested_force)
    strays = stray_covariance(z, z, float(np.log(coordinates.reference[2])))
    level, doubt = coordinates.scatter(x)[1], coordinates.doubt(x)
    return level[:, None, None] ** 2 * np.eye(len(z)) + doubt[:, None, None] ** 2 * strays


def _of_levels(nn: FloatArray, hh: FloatArray, hn: FloatArray, covariance: FloatArray) -> FloatArray:
    """Quadratic form and determinant of rows whose levels have a covariance K, (points,): Woodbury, B = I + S K S.

    Args:
        nn, hh, hn: sums over each sweep's rows of n^2, h^2 and h n over their variance, (points, sweeps); S = sqrt(hh).
    """
    root = np.sqrt(hh)
    B = np.eye(hh.shape[1]) + root[:, :, None] * covariance * root[:, None, :]
    fine = np.asarray(np.isfinite(B).all(axis=(1, 2)))
    factor = np.linalg.cholesky(np.where(fine[:, None, None], B, np.eye(hh.shape[1])))
    u = np.where(root > 0.0, hn / root, 0.0)
    white = np.linalg.solve(factor, u[..., None])[..., 0]
    half_log_det = np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    within = np.maximum(nn - u**2, 0.0)  # one row a level has nothing within it, and rounding is not to make it so
    return np.asarray(np.where(fine, -0.5 * np.sum(within + white**2, axis=1) - half_log_det, -np.inf))


def by_sweep(values: FloatArray, data: Observations) -> FloatArray:
    """Sums of values (points, rows) over the rows of each sweep, (points, sweeps)."""
    if len(data.sweeps) <= _FEW:
        return np.asarray(values @ np.eye(len(data.sweeps))[data.sweep])
    order = np.argsort(data.sweep, kind="stable")
    first = np.searchsorted(data.sweep[order], np.arange(len(data.sweeps)))
    return np.asarray(np.add.reduceat(values[:, order], first, axis=1))


def pointwise_log_likelihood(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Log likelihood of each sweep given the parameters, (points, sweeps); of each row where there is one sweep only.

    Rows of one sweep share their level's scatter, so a sweep is the unit that can be left out.
    """
    if len(data.sweeps) > 1:
        one = np.eye(len(data.sweeps), dtype=bool)
        return np.stack([log_likelihood(x, coordinates, data.keep_sweeps(keep)) for keep in one], axis=-1)
    n, h, known = residuals(coordinates.force(x), data)
    row, level = coordinates.scatter(x)
    variance = row[:, None] ** 2 + known + (level[:, None] * h) ** 2
    return -0.5 * (n**2 / variance + np.log(2.0 * np.pi * variance))


def log_prior(x: FloatArray) -> FloatArray:
    """Standard normal in every variable, shape (points,)."""
    result: FloatArray = -0.5 * np.sum(x**2 + np.log(2.0 * np.pi), axis=-1)
    return result


def log_posterior(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Unnormalised log posterior density at points (points, dimension); ``-inf`` beyond ``REACH``."""
    x = np.atleast_2d(x)
    inside = np.all(np.abs(x) < REACH, axis=-1)
    x = np.clip(x, -REACH, REACH)
    return np.where(inside, log_prior(x) + log_likelihood(x, coordinates, data), -np.inf)
