"""The best fit of a law with coefficients >= 0, what it predicts, and which laws predict the same.

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
from scipy.optimize import minimize, nnls
from scipy.special import ndtri

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.forces.contract import Sum
from damping.infer.law import SCATTER_MEDIAN, Coordinates, Law, residuals
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude

#: Passes of reweighting: weights follow the fit quadratically, so that a dozen reach rounding.
REWEIGHTINGS = 12
#: Relative change of the sum of squares at which reweighting stops.
STEADY = 1e-12
#: Prior probabilities at which a shape parameter is tried before it is refined: its range in 24 equal parts.
SHAPE_GRID = (np.arange(24) + 0.5) / 24.0
#: Two laws are equivalent where their best predictions differ by less than this share of the noise ...
INDISTINCT = 0.1
#: ... at every row and at this multiple of the largest tested force.
BEYOND = 1.5
#: Range of what counts as noise where the record does not state it, relative: that of repeat tests of large structures.
NOISE_RANGE = (0.003, 0.07)


@dataclass(frozen=True)
class BestFit:
    """A law at its best coefficients >= 0.

    Attributes:
        coordinates: the law on its record. coefficients: one a component. shapes: of each component by name.
        n: residual of each row, relative amplitude or rad (rows,). squares: sum of n^2 over the variance of the rows.
        parameters: coefficients above 0 and shapes.
    """

    coordinates: Coordinates
    coefficients: FloatArray
    shapes: tuple[dict[str, float], ...]
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
    def parameters(self) -> int:
        """Numbers that were fitted and are not at their bound."""
        present = self.coefficients > 0.0
        return int(present.sum()) + sum(len(s) for s, there in zip(self.shapes, present, strict=True) if there)


def build_force(law: Law, coefficients: FloatArray, shapes: Sequence[dict[str, float]]) -> Sum:
    """The force of a law from numbers in the units of the record."""
    parts = zip(law.parts, coefficients, shapes, strict=True)
    return Sum(tuple(part.build(float(c), **values) for part, c, values in parts))


def fit_law(law: Law, data: Observations) -> BestFit:
    """The best fit of a law.

    Raises:
        AnalysisError: no coefficients make it carry the measured forces.
    """
    coordinates = Coordinates.of(law, data)
    free = sum(len(part.shapes) for part in law.parts)
    if free == 0:
        return _fit_at(np.zeros(0), coordinates, data)
    grid = ndtri(SHAPE_GRID)
    tried = [np.array(point) for point in product(grid, repeat=free)]
    squares = [_fit_at(point, coordinates, data).squares for point in tried]
    start = tried[int(np.argmin(squares))]
    width = 0.1 * np.ones(free)
    simplex = np.vstack([start, start + np.diag(width)])
    refined = minimize(
        lambda point: _fit_at(point, coordinates, data).squares,
        start,
        method="Nelder-Mead",
        options={"initial_simplex": simplex, "xatol": 1e-7, "fatol": 1e-9, "maxiter": 100 * free},
    )
    return min((_fit_at(point, coordinates, data) for point in (start, refined.x)), key=lambda fit: fit.squares)


def _fit_at(point: FloatArray, coordinates: Coordinates, data: Observations) -> BestFit:
    """Non-negative least squares at given shapes, standard normal variables (shapes,)."""
    law = coordinates.law
    x = np.zeros(coordinates.dimension)
    x[len(law.parts) : len(law.parts) + point.size] = point
    shapes = tuple({name: float(value) for name, value in part.items()} for part in coordinates.shapes(x))
    units = [part.unit(dict(values)) for part, values in zip(law.parts, shapes, strict=True)]
    columns = np.stack([np.asarray(unit.quadrature(data.A, data.omega)) for unit in units], axis=1)
    slopes = np.stack([np.asarray(unit.slope(data.A, data.omega)) for unit in units], axis=1)
    if not np.all(columns.max(axis=0) > 0.0):
        raise AnalysisError(f"{law.name}: a part of it is never met at the tested amplitudes")
    scale = columns.max(axis=0)
    g, coefficients, squares = np.abs(data.D), np.zeros(len(units)), np.inf
    for _ in range(REWEIGHTINGS):
        weight = 1.0 / np.sqrt(_variance(g, data))
        coefficients = nnls(columns / scale * weight[:, None], data.D * weight)[0] / scale
        g = slopes @ coefficients
        previous, squares = squares, float(np.sum((data.D - columns @ coefficients) ** 2 / _variance(g, data)))
        if abs(squares - previous) <= STEADY * squares:
            break
    n = residuals(build_force(law, coefficients, shapes), data)[0]
    return BestFit(coordinates, coefficients, shapes, np.asarray(n), squares if np.isfinite(n).all() else np.inf)


def _variance(g: FloatArray, data: Observations) -> FloatArray:
    """Variance of D - C of each row: circular scatter of the phasor, and the record's own uncertainties."""
    spread = g**2 + data.R**2
    known = g**2 * data.sd_amplitude**2 + data.R**2 * data.sd_phase**2 + data.D**2 * data.sd_force**2
    return np.asarray(SCATTER_MEDIAN**2 * np.maximum(spread, 1e-12 * data.D**2) + known)


def learn_noise(fits: Sequence[BestFit], data: Observations) -> FloatArray:
    """Relative noise of each row (rows,): as the record states it, else by the fit that leaves least.

    The latter is s^2 = (s_0^2 + n^T n)/(1 + rows - parameters), one prior observation of scatter s_0, within
    ``NOISE_RANGE``.
    """
    scatter = min(
        np.sqrt((SCATTER_MEDIAN**2 + f.n @ f.n) / (1.0 + max(len(f.n) - f.parameters, 0)))
        for f in fits
        if np.isfinite(f.squares)
    )
    learnt = np.full(len(data.A), float(np.clip(scatter, *NOISE_RANGE)))
    stated = np.hypot(data.sd_amplitude, np.hypot(data.sd_phase, data.sd_force))
    return np.where(stated > 0.0, stated, learnt)


def group_equivalents(fits: Sequence[BestFit], data: Observations, noise: FloatArray) -> list[list[BestFit]]:
    """Laws that predict the same, the one with fewest terms (then first) leading its group.

    Two laws are of one group where their best predictions differ by less than ``INDISTINCT`` of the noise at every row
    and at ``BEYOND`` times the largest tested force: a further term that changes nothing does not make another law.
    """
    omega, force = data.tested_omega[data.top], BEYOND * data.tested_force[data.top]
    beyond = {id(f): float(np.log(resonant_amplitude(f.force, force, omega))) for f in fits}
    groups: list[list[BestFit]] = []
    for f in sorted(fits, key=lambda f: len(f.law.parts)):
        for group in groups:
            near = np.all(np.abs(f.n - group[0].n) < INDISTINCT * noise)
            further = abs(beyond[id(f)] - beyond[id(group[0])])
            none_resonates = np.isnan(beyond[id(f)]) and np.isnan(beyond[id(group[0])])
            if near and (further < INDISTINCT * noise.max() or none_resonates):
                group.append(f)
                break
        else:
            groups.append([f])
    return groups
