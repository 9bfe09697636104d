"""The best fit of a law with coefficients >= 0.

For given shapes a law is linear in its coefficients, C(A, omega) = sum_j c_j u_j(A, omega), and the distance of a row
from it (:func:`damping.infer.law.residuals`) is

    n_i = (D_i - C_i)/sqrt(g_i^2 + R_i^2),      g = dC/d ln A.

Its sum of squares over the variance of each row is minimised over c >= 0 by non-negative least squares (Lawson and
Hanson 1974), the weights taken again from the fit until they stay; shapes are searched over their prior's range.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize, minimize_scalar, nnls
from scipy.special import ndtri

from damping.arrays import FloatArray, Floats
from damping.errors import AnalysisError
from damping.forces.contract import Sum
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, TOTAL_LOG_SD, Coordinates, Law, residuals
from damping.infer.observations import Observations

#: Passes of reweighting: weights follow the fit quadratically, so that a dozen reach rounding.
REWEIGHTINGS = 12
#: Share of the force below which a coefficient is rounding.
NOTHING = 1e-12
#: Relative change of the sum of squares at which reweighting stops.
STEADY = 1e-12
#: Shares of a component, and standard normal variables, at which a search for the mode begins at the farthest.
SHARE_RANGE = (0.02, 0.98)
LARGEST_SCORE = 3.0
#: Prior probabilities at which a shape parameter is tried before it is refined: its range in 24 equal parts.
SHAPE_GRID = (np.arange(24) + 0.5) / 24.0
#: Stands for the squares of a fit that cannot be, in searches that need finite numbers.
HOPELESS = 1e12
#: Prior probabilities between which a shape is refined; step at which its search ends, standard normal variable.
EXTREME = (0.001, 0.999)
SHAPE_STEP = 1e-5


@dataclass(frozen=True)
class BestFit:
    """A law at its best coefficients >= 0.

    Attributes:
        coordinates: the law on its record. coefficients: one a component. shapes: of each component by name, ``point``
        the same as standard normal variables (shapes,).
        n: residual of each row, relative amplitude or rad (rows,). squares: sum of n^2 over the variance of the rows.
        parameters: coefficients above 0 and shapes.
    """

    coordinates: Coordinates
    coefficients: FloatArray
    shapes: tuple[dict[str, float], ...]
    point: FloatArray
    n: FloatArray
    squares: float

    @property
    def law(self) -> Law:
        """The law that was fitted."""
        return self.coordinates.law

    @property
    def force(self) -> Sum:
        """Its damping force."""
        return build_force(self.law, self.coefficients, self.shapes)

    @property
    def variables(self) -> FloatArray:
        """The standard normal variables x (dimension,) of this fit: where a search for the posterior's mode begins.

        Shares stay within ``SHARE_RANGE``: the prior has none at the ends.
        """
        x = np.zeros(self.coordinates.dimension)
        parts = len(self.law.parts)
        x[parts : parts + self.point.size] = self.point
        unit = np.array([float(c) for c in self.coordinates.coefficients(x)])
        force = self.coefficients / unit * np.asarray(self.coordinates.shares(x))
        total = max(float(force.sum()), np.finfo(float).tiny)  # a fit may be of no damping at all
        x[0] = np.clip(np.log(total) / TOTAL_LOG_SD, -LARGEST_SCORE, LARGEST_SCORE)
        left = force.sum()
        for i in range(parts - 1):
            fraction = np.clip(force[i] / max(left, np.finfo(float).tiny), *SHARE_RANGE)
            x[1 + i] = -ndtri((1.0 - fraction) ** (parts - 1 - i))
            left -= force[i]
        scatter = np.sqrt(np.mean(self.n**2)) + 0.1 * SCATTER_MEDIAN
        scatters = 1 + self.coordinates.with_level_scatter
        x[-scatters:] = np.clip(np.log(scatter / SCATTER_MEDIAN) / SCATTER_LOG_SD, -LARGEST_SCORE, LARGEST_SCORE)
        return x

    @property
    def parameters(self) -> int:
        """Numbers that were fitted and are not at their bound."""
        present = self.coefficients > 0.0
        return int(present.sum()) + sum(len(s) for s, there in zip(self.shapes, present, strict=True) if there)


def build_force(law: Law, coefficients: FloatArray, shapes: Sequence[dict[str, float]]) -> Sum:
    """The force of a law from numbers in the units of the record."""
    parts = zip(law.parts, coefficients, shapes, strict=True)
    return Sum(tuple(part.build(float(c), **values) for part, c, values in parts))


def fit_law(law: Law, data: Observations) -> BestFit:
    """The best fit of a law, sought without dimension so that units cannot move it.

    Raises:
        AnalysisError: a part of the law is never met at the tested amplitudes.
    """
    scaled = data.scaled()
    pure = Coordinates.of(law, scaled)
    free = len(law.free_shapes)
    point = np.zeros(0)
    if free:
        grid = [np.array(at) for at in product(ndtri(SHAPE_GRID), repeat=free)]
        squares = [_solve(at, pure, scaled)[1] for at in grid]
        start = grid[int(np.argmin(squares))]
        point = min(start, _refine(start, squares, pure, scaled), key=lambda at: _solve(at, pure, scaled)[1])
    solved, squares_left = _solve(point, pure, scaled)
    coordinates = Coordinates.of(law, data)
    x = _place(point, coordinates)
    per_force = np.array([float(c) for c in coordinates.coefficients(x)]) / data.reference[2]
    pure_force = solved / np.array([float(c) for c in pure.coefficients(x)])
    coefficients = pure_force * per_force * data.reference[2]
    shapes = tuple({name: float(value) for name, value in part.items()} for part in coordinates.shapes(x))
    n = np.asarray(residuals(build_force(law, coefficients, shapes), data)[0])
    return BestFit(coordinates, coefficients, shapes, point, n, squares_left if np.isfinite(n).all() else np.inf)


def _place(point: FloatArray, coordinates: Coordinates) -> FloatArray:
    """Variables x (dimension,), zero but for the shapes."""
    x = np.zeros(coordinates.dimension)
    parts = len(coordinates.law.parts)
    x[parts : parts + point.size] = point
    return x


def _refine(start: FloatArray, squares: Sequence[float], coordinates: Coordinates, data: Observations) -> FloatArray:
    """Shapes of least squares near the best of the grid: a bounded search in one variable, a simplex in several."""

    def distance(point: Floats) -> float:
        return min(_solve(np.atleast_1d(np.asarray(point)), coordinates, data)[1], HOPELESS)

    if start.size == 1:
        best = int(np.argmin(squares))
        low, high = (float(x) for x in ndtri(np.clip((best + np.array([-0.5, 1.5])) / len(SHAPE_GRID), *EXTREME)))
        nearest = minimize_scalar(distance, bounds=(low, high), method="bounded", options={"xatol": SHAPE_STEP})
        return np.array([nearest.x])
    simplex = np.vstack([start, start + 0.1 * np.eye(start.size)])
    most = 100 * start.size
    refined = minimize(
        distance,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": SHAPE_STEP, "fatol": 1e-9, "maxiter": most},
    )
    return np.asarray(refined.x)


def _solve(point: FloatArray, coordinates: Coordinates, data: Observations) -> tuple[FloatArray, float]:
    """Coefficients >= 0 at given shapes, standard normal variables (shapes,), and the squares they leave.

    A coefficient that carries less than ``NOTHING`` of the force is 0.
    """
    law = coordinates.law
    shapes = coordinates.shapes(_place(point, coordinates))
    units = [
        part.build(1.0, **{name: float(value) for name, value in values.items()})
        for part, values in zip(law.parts, shapes, strict=True)
    ]
    columns = np.stack([np.asarray(unit.quadrature(data.A, data.omega)) for unit in units], axis=1)
    slopes = np.stack([np.asarray(unit.slope(data.A, data.omega)) for unit in units], axis=1)
    if data.amplitude_is_input:
        slopes = columns
    scale = columns.max(axis=0)
    if not np.all(scale > 0.0):
        raise AnalysisError(f"{law.name}: a part of it is never met at the tested amplitudes")
    g, carried, squares = np.abs(data.D), np.zeros(len(units)), np.inf
    for _ in range(REWEIGHTINGS):
        weight = 1.0 / np.sqrt(_variance(g, data))
        carried = nnls(columns / scale * weight[:, None], data.D * weight)[0]
        carried[carried < NOTHING * carried.max()] = 0.0
        g = slopes @ (carried / scale)
        previous, squares = squares, float(np.sum((data.D - columns @ (carried / scale)) ** 2 / _variance(g, data)))
        if abs(squares - previous) <= STEADY * squares:
            break
    return carried / scale, squares


def _variance(g: FloatArray, data: Observations) -> FloatArray:
    """Variance of D - C of each row: circular scatter of the phasor, and the record's own uncertainties."""
    spread = g**2 + data.R**2
    known = g**2 * data.sd_amplitude**2 + data.R**2 * data.sd_phase**2 + data.D**2 * data.sd_force**2
    return np.asarray(SCATTER_MEDIAN**2 * np.maximum(spread, 1e-12 * data.D**2) + known)
