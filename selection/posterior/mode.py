"""Posterior mode and the Gaussian at it, from values of the log density only.

Quasi-Newton descents from the best of many prior points find the mode; Newton steps whose difference quotients are
scaled to the posterior's own width then polish it, which matters where data are so good that the width is tiny.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtri

from selection.arrays import FloatArray
from selection.errors import AnalysisError
from selection.posterior.law import Coordinates
from selection.posterior.likelihood import log_posterior
from selection.posterior.observations import Observations
from selection.posterior.proposal import sobol

_STARTS_POWER = 9  # 512 prior points: enough to meet every mode of a slip joint or an exponent
_STEP = 1e-4  # of a standard normal variable, for the descents
BARRIER = 1e8  # stands for an impossible law in the minimiser, which needs finite numbers
_WIDTHS = (1e-5, 1e-2)  # least and largest step of a difference quotient
_FRACTIONS = np.array([1.0, 0.5, 0.2, 0.05, 0.01])  # of a Newton step, tried at once
_MOST_STEPS = 20

Negative = Callable[[FloatArray], FloatArray]


def find_mode(coordinates: Coordinates, data: Observations, starts: int = 3) -> FloatArray:
    """Posterior mode in the standard normal variables, (dimension,).

    Raises:
        AnalysisError: the law cannot carry the measured forces at any parameter value tried.
    """
    negative = negative_log_posterior(coordinates, data)
    points = ndtri(sobol(coordinates.dimension, _STARTS_POWER, seed=0))
    order = np.argsort(negative(points))
    if not negative(points[order[:1]])[0] < BARRIER:
        raise AnalysisError(f"{coordinates.law.name}: no coefficient makes it carry the measured forces")
    found = [
        minimize(_value_and_gradient, points[i], (negative,), "L-BFGS-B", jac=True, options={"maxiter": 200})
        for i in order[:starts]
    ]
    return _polished(np.asarray(min(found, key=lambda result: float(result.fun)).x), negative)


def covariance_at(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Inverse Hessian of the negative log posterior at its mode, (d, d); no wider than the prior."""
    return derivatives(x, negative_log_posterior(coordinates, data), np.full(x.size, _WIDTHS[1]))[1]


def negative_log_posterior(coordinates: Coordinates, data: Observations) -> Negative:
    """Minus the log posterior, a large finite number where the law is impossible."""

    def negative(x: FloatArray) -> FloatArray:
        value = -log_posterior(x, coordinates, data)
        return np.where(np.isfinite(value), value, BARRIER + np.sum(x**2, axis=-1))

    return negative


def _value_and_gradient(x: FloatArray, negative: Negative) -> tuple[float, FloatArray]:
    """Value and central-difference gradient from one vectorised call."""
    d = x.size
    steps = _STEP * np.eye(d)
    values = negative(np.vstack([x, x + steps, x - steps]))
    return float(values[0]), (values[1 : 1 + d] - values[1 + d :]) / (2.0 * _STEP)


def _polished(x: FloatArray, negative: Negative) -> FloatArray:
    """Newton steps until none goes down."""
    widths = np.full(x.size, _STEP)
    value = float(negative(x[None, :])[0])
    for _ in range(_MOST_STEPS):
        gradient, covariance, widths = derivatives(x, negative, widths)
        tried = x - _FRACTIONS[:, None] * (covariance @ gradient)
        values = negative(tried)
        best = int(np.argmin(values))
        if not values[best] < value - 1e-10 * max(1.0, abs(value)):
            break
        x, value = tried[best], float(values[best])
    return x


def derivatives(x: FloatArray, negative: Negative, widths: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gradient and inverse Hessian by differences whose steps are a third of a standard deviation along each axis."""
    d = x.size
    here = float(negative(x[None, :])[0])
    for _ in range(3):
        curvature = np.sum(negative(np.vstack([x + np.diag(widths), x - np.diag(widths)])).reshape(2, d), axis=0)
        curvature = np.maximum((curvature - 2.0 * here) / widths**2, 1.0)
        widths = np.clip(0.3 / np.sqrt(curvature), *_WIDTHS)
    up, down = negative(x + np.diag(widths)), negative(x - np.diag(widths))
    shifts = np.array([a * np.eye(d)[i] + b * np.eye(d)[j] for i in range(d) for j in range(d) for a, b in _CORNERS])
    values = negative(x + widths * shifts).reshape(d, d, 4)
    scaled = (values[..., 0] - values[..., 1] - values[..., 2] + values[..., 3]) / 4.0
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    # in units of the widths the Hessian is of order 0.1; the prior bounds it from below
    floor = max(float(np.min(widths**2)), 1e-6 * float(eigenvalues[-1]), 1e-300)
    inverse = (vectors / np.maximum(eigenvalues, floor)) @ vectors.T
    return (up - down) / (2.0 * widths), inverse * np.outer(widths, widths), widths


_CORNERS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
