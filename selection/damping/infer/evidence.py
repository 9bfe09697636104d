"""Posterior mode and the Gaussian at it, from values of the log density only.

Newton steps from the best fit of the law find the mode; their difference quotients are scaled to the posterior's own
width, which matters where data are so good that the width is tiny.

Marginal likelihood of a law on observations, by importance sampling around its posterior mode.

Laplace approximation of a law's posterior: the Gaussian at its mode, in place of importance sampling and chains.

    ln Z ~ ln p(x*) + (d/2) ln(2 pi) + (1/2) ln det V,      x ~ N(x*, V),

with the mode x* and the inverse Hessian V in the standard normal variables of :mod:`damping.infer.law`. Exact for
a normal posterior; rough where a share lies at the edge of its range or two modes compete.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from scipy.special import ndtri

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.infer.best_fit import fit_law
from damping.infer.importance import Evidence, Proposal, importance, sobol
from damping.infer.law import REACH, Coordinates, log_posterior
from damping.infer.observations import Observations

_STEP = 1e-4  # of a standard normal variable, for the descents
BARRIER = 1e8  # stands for an impossible law in the minimiser, which needs finite numbers
_WIDTHS = (1e-5, 1e-2)  # least and largest step of a difference quotient
_FRACTIONS = np.array([1.0, 0.5, 0.2, 0.05, 0.01])  # of a Newton step, tried at once
_MOST_STEPS = 20

Negative = Callable[[FloatArray], FloatArray]


def find_mode(coordinates: Coordinates, data: Observations) -> FloatArray:
    """Posterior mode in the standard normal variables, (dimension,): Newton steps from the best fit.

    Raises:
        AnalysisError: the law cannot carry the measured forces at any parameter value tried.
    """
    negative = negative_log_posterior(coordinates, data)
    fit = replace(fit_law(coordinates.law, data), coordinates=coordinates)
    start = fit.variables if np.isfinite(fit.squares) else np.zeros(coordinates.dimension)
    if not negative(start[None, :])[0] < BARRIER:  # a shape out of the prior's range: the best of prior points instead
        points = _normal(coordinates.dimension, _LAPLACE_STARTS_POWER, 0)
        start = points[np.argmin(negative(points))]
    if not negative(start[None, :])[0] < BARRIER:
        raise AnalysisError(f"{coordinates.law.name}: no coefficient makes it carry the measured forces")
    return _polished(start, negative)


def covariance_at(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Inverse Hessian of the negative log posterior at its mode, (d, d); no wider than the prior."""
    return derivatives(x, negative_log_posterior(coordinates, data), np.full(x.size, _WIDTHS[1]))[1]


def negative_log_posterior(coordinates: Coordinates, data: Observations) -> Negative:
    """Minus the log posterior, a large finite number where the law is impossible."""

    def negative(x: FloatArray) -> FloatArray:
        value = -log_posterior(x, coordinates, data)
        return np.where(np.isfinite(value), value, BARRIER + np.sum(x**2, axis=-1))

    return negative


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


__all__ = ["Estimate", "Evidence", "evidence", "remembered"]

#: A way to the marginal likelihood and draws of a law on observations, with a seed: ``evidence``, or ``laplace``.
Estimate = Callable[[Coordinates, Observations, int], Evidence]


def evidence(coordinates: Coordinates, data: Observations, seed: int = 0) -> Evidence:
    """Marginal likelihood of a law, with weighted draws of its posterior.

    Raises:
        AnalysisError: the law cannot carry the measured forces.
    """
    coordinates, data = coordinates.scaled(data.reference), data.scaled()
    mode = find_mode(coordinates, data)
    density = partial(log_posterior, coordinates=coordinates, data=data)
    return importance(density, mode, covariance_at(mode, coordinates, data), seed)


def remembered(estimate: Estimate) -> Estimate:
    """The same estimate, computed once for equal arguments: rankings and plans of peaks ask for the same ones.

    Arguments are equal where they are so in single precision: a force that was multiplied by pi A and divided again
    differs in its last bit.
    """
    known: dict[tuple[object, ...], Evidence] = {}

    def estimated(coordinates: Coordinates, data: Observations, seed: int) -> Evidence:
        arrays = (value for value in vars(data).values() if isinstance(value, np.ndarray))
        key = (coordinates, seed, data.sweeps, *(value.astype(np.float32).tobytes() for value in arrays))
        if key not in known:
            known[key] = estimate(coordinates, data, seed)
        return known[key]

    return estimated


_LAPLACE_STARTS_POWER = 9  # 512 prior points, of which the best are followed
_STARTS = 3
_DRAWS_POWER = 10  # 1024 draws: quantiles at 5 % and 95 % to 2 % of a band's width on Sobol points
_LAPLACE_STEP = 1e-3  # of a difference quotient, standard normal variables
_LONGEST = 1.0  # Newton step in any variable
_LAPLACE_FRACTIONS = np.array([1.0, 0.4, 0.1, 0.02])  # of a Newton step, tried at once
_LAPLACE_MOST_STEPS = 12  # steps, and gain in log density below which a start has arrived
_STILL = 1e-3


def laplace(coordinates: Coordinates, data: Observations, seed: int = 0) -> Evidence:
    """Marginal likelihood and draws (1024, dimension) by the Gaussian at the mode.

    ``standard_error`` and ``effective_draws`` are NaN: an approximation has an error, and none that it knows.

    Raises:
        AnalysisError: the law cannot carry the measured forces.
    """
    coordinates, data = coordinates.scaled(data.reference), data.scaled()
    negative = negative_log_posterior(coordinates, data)
    near = _descended(coordinates, negative)
    gradient, covariance, _ = derivatives(near, negative, np.full(near.size, _LAPLACE_STEP))
    ends = np.vstack([near - covariance @ gradient, near])  # one more step, where it gains
    mode = ends[np.argmin(negative(ends))]
    root = np.linalg.cholesky(covariance)
    log_z = -float(negative(mode[None, :])[0]) + 0.5 * mode.size * np.log(2.0 * np.pi)
    normal = _normal(mode.size, _DRAWS_POWER, seed)
    return Evidence(
        log_z=log_z + float(np.sum(np.log(np.diagonal(root)))),
        standard_error=np.nan,
        mode=mode,
        proposal=Proposal.around(mode, covariance),
        draws=np.clip(mode + normal @ root.T, -REACH, REACH),
        effective_draws=np.nan,
    )


@lru_cache(maxsize=16)  # every law of as many variables asks for the same points
def _normal(dimension: int, power: int, seed: int) -> FloatArray:
    """2^power standard normal points that fill space, (2^power, dimension)."""
    return np.asarray(ndtri(sobol(dimension, power, seed)))


def _descended(coordinates: Coordinates, negative: Negative) -> FloatArray:
    """A point close to the mode: Newton steps from the best of many prior points, all starts at once."""
    points = _normal(coordinates.dimension, _LAPLACE_STARTS_POWER, 0)
    values = negative(points)
    best = np.argsort(values)[:_STARTS]
    if not values[best[0]] < BARRIER:
        raise AnalysisError(f"{coordinates.law.name}: no coefficient makes it carry the measured forces")
    x, value = points[best], values[best]
    for _ in range(_LAPLACE_MOST_STEPS):
        tried = x[:, None, :] + _LAPLACE_FRACTIONS[:, None] * _newton_steps(x, negative)[:, None, :]
        found = negative(tried.reshape(-1, x.shape[1])).reshape(len(x), -1)
        chosen = np.argmin(found, axis=1)
        rows = np.arange(len(x))
        gain = value - found[rows, chosen]
        x = np.where(gain[:, None] > 0.0, tried[rows, chosen], x)
        value = np.minimum(value, found[rows, chosen])
        if np.all(gain < _STILL):
            break
    return np.asarray(x[np.argmin(value)])


def _newton_steps(x: FloatArray, negative: Negative) -> FloatArray:
    """Newton step of each start (starts, d), downhill whatever the curvature."""
    starts, d = x.shape
    unit = _LAPLACE_STEP * np.eye(d)
    corners = (unit[:, None, :] + unit[None, :, :]).reshape(d * d, d)
    stencil = np.vstack([np.zeros((1, d)), unit, -unit, corners])
    values = negative((x[:, None, :] + stencil).reshape(-1, d)).reshape(starts, -1)
    here, up, down = values[:, :1], values[:, 1 : 1 + d], values[:, 1 + d : 1 + 2 * d]
    gradient = (up - down) / (2.0 * _LAPLACE_STEP)
    # f(x + h e_i + h e_j) - f(x + h e_i) - f(x + h e_j) + f(x), twice the diagonal's own quotient aside
    mixed = values[:, 1 + 2 * d :].reshape(starts, d, d) - up[:, :, None] - up[:, None, :] + here[:, :, None]
    hessian = mixed / _LAPLACE_STEP**2
    hessian[:, np.arange(d), np.arange(d)] = (up + down - 2.0 * here) / _LAPLACE_STEP**2
    eigenvalues, vectors = np.linalg.eigh(hessian)
    sizes = np.maximum(np.abs(eigenvalues), 1.0)  # the prior alone has curvature 1
    steps = -np.einsum("kij,kj->ki", vectors, np.einsum("kji,kj->ki", vectors, gradient) / sizes)
    longest = np.max(np.abs(steps), axis=1, keepdims=True)
    return np.asarray(steps * np.minimum(1.0, _LONGEST / np.maximum(longest, 1e-12)))
