"""Least-squares fit of a law in its own parameters: coefficients with standard errors and T-ratios.

Coefficients may come out negative here, which is how data say that a force is not there; shapes stay in their ranges.
Residuals are those of the likelihood, whitened by its scatter at the posterior mode, so a standard error is honest
about noise even where there are as many parameters as points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from selection.arrays import FloatArray, IntArray
from selection.forces.contract import Sum
from selection.posterior.law import EXPONENT_RANGE, Coordinates, Law
from selection.posterior.likelihood import residuals
from selection.posterior.observations import Observations


@dataclass(frozen=True)
class Fit:
    """Generalised least squares of a law.

    Attributes:
        names: parameters, coefficients first; coefficients: how many they are.
        values, std_errors: in the units of the record; standard errors are NaN where the data cannot tell the
            parameters apart. rows, parameters: counts.
        rss: sum of squared relative residuals; aic, aicc, bic: of them, rows taken as independent and the scatter
            as one more parameter; NaN where there are too few rows.
    """

    names: tuple[str, ...]
    coefficients: int
    values: FloatArray
    std_errors: FloatArray
    rows: int
    parameters: int
    rss: float
    aic: float
    aicc: float
    bic: float

    @property
    def physical(self) -> bool:
        """Whether no coefficient is negative."""
        return bool(np.all(self.values[: self.coefficients] >= 0.0))

    @property
    def t_ratios(self) -> FloatArray:
        """Value over standard error."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.values / self.std_errors


def natural_force(law: Law, values: FloatArray) -> Sum:
    """The force of a law from coefficients and then shapes, numbers in the units of the record."""
    position, forces = len(law.parts), []
    for part, coefficient in zip(law.parts, values, strict=False):
        shapes = {}
        for shape in part.shapes:
            shapes[shape] = values[position]
            position += 1
        forces.append(part.build(coefficient, **shapes))
    return Sum(tuple(forces))


def fit(coordinates: Coordinates, data: Observations, mode: FloatArray) -> Fit:
    """Fit a law, starting from its posterior mode ``mode`` (dimension,)."""
    law = coordinates.law
    start = _natural(coordinates, mode)
    row, level = (float(value[0]) for value in coordinates.scatter(mode[None, :]))
    shapes = [shape for part in law.parts for shape in part.shapes]
    low = [-np.inf] * len(law.parts) + [EXPONENT_RANGE[0] if s == "exponent" else 0.0 for s in shapes]
    high = [np.inf] * len(law.parts) + [EXPONENT_RANGE[1] if s == "exponent" else np.inf for s in shapes]
    scale = np.where(np.abs(start) > 0, np.abs(start), 1.0)

    def whitened(values: FloatArray) -> FloatArray:
        n, h, known = residuals(natural_force(law, values), data)
        z = _whiten(n, h, row**2 + known, level**2, data.sweep)
        return np.where(np.isfinite(z), z, 1e6)

    start = np.clip(start, np.array(low) + 1e-9 * scale, np.array(high) - 1e-9 * scale)
    result = least_squares(whitened, start, jac="3-point", bounds=(low, high), x_scale=scale, xtol=1e-12, ftol=1e-12)
    n = residuals(natural_force(law, result.x), data)[0]
    rss, rows, k = float(n @ n), len(n), len(start)
    return Fit(
        names=_names(law),
        coefficients=len(law.parts),
        values=result.x,
        std_errors=_standard_errors(np.asarray(result.jac) * scale, scale),
        rows=rows,
        parameters=k,
        rss=rss,
        **_criteria(rss, rows, k + 1),
    )


def _names(law: Law) -> tuple[str, ...]:
    """Parameter names: components, then their shapes."""
    return (*law.components, *(f"{part.name} {shape}" for part in law.parts for shape in part.shapes))


def _natural(coordinates: Coordinates, x: FloatArray) -> FloatArray:
    """Coefficients and shapes at one point."""
    coefficients = [float(c) for c in coordinates.coefficients(x)]
    return np.array(coefficients + [float(v) for shapes in coordinates.shapes(x) for v in shapes.values()])


def _whiten(n: FloatArray, h: FloatArray, variance: FloatArray, level: float, sweep: IntArray) -> FloatArray:
    """Residuals of unit covariance: the inverse Cholesky factor of diag(variance) + level h h^T, sweep by sweep."""
    with np.errstate(divide="ignore", invalid="ignore"):  # a force that is not there at all: no finite residual
        z = n / np.sqrt(variance)
    if level == 0.0:
        return z
    for s in np.unique(sweep):
        rows = sweep == s
        u = h[rows] / np.sqrt(variance[rows])
        uu = float(u @ u)
        # (I + t u u^T)^(-1/2) = I - (1 - 1/sqrt(1 + t uu)) u u^T / uu
        if uu > 0:
            z[rows] -= (1.0 - 1.0 / np.sqrt(1.0 + level * uu)) * u * float(u @ z[rows]) / uu
    return z


def _standard_errors(jacobian: FloatArray, scale: FloatArray) -> FloatArray:
    """Square roots of the diagonal of (J^T J)^-1, in original units; NaN where J is numerically rank deficient."""
    _, singular, vt = np.linalg.svd(jacobian, full_matrices=False)
    if len(singular) < jacobian.shape[1] or singular[-1] <= 1e-10 * singular[0]:
        return np.full(jacobian.shape[1], np.nan)
    return np.sqrt(np.sum((vt.T / singular) ** 2, axis=1)) * scale


def _criteria(rss: float, rows: int, k: int) -> dict[str, float]:
    """AIC, AICc and BIC of Gaussian residuals with ``k`` parameters, the scatter included."""
    if rows <= k or rss <= 0.0:
        return {"aic": np.nan, "aicc": np.nan, "bic": np.nan}
    deviance = rows * np.log(rss / rows)
    aic = deviance + 2.0 * k
    aicc = aic + 2.0 * k * (k + 1) / (rows - k - 1) if rows > k + 1 else np.nan
    return {"aic": aic, "aicc": aicc, "bic": deviance + k * np.log(rows)}
