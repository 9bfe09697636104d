"""Laplace approximation of a law's posterior: the Gaussian at its mode, in place of importance sampling and chains.

    ln Z ~ ln p(x*) + (d/2) ln(2 pi) + (1/2) ln det V,      x ~ N(x*, V),

with the mode x* and the inverse Hessian V in the standard normal variables of :mod:`selection.posterior.law`. Exact for
a normal posterior; rough where a share lies at the edge of its range or two modes compete.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import ndtri

from selection.arrays import FloatArray
from selection.errors import AnalysisError
from selection.posterior.importance import Evidence
from selection.posterior.law import Coordinates
from selection.posterior.likelihood import REACH
from selection.posterior.mode import BARRIER, Negative, derivatives, negative_log_posterior
from selection.posterior.observations import Observations
from selection.posterior.proposal import Proposal, sobol

_STARTS_POWER, _STARTS = 9, 3  # 512 prior points, of which the best are followed
_DRAWS_POWER = 10  # 1024 draws: quantiles at 5 % and 95 % to 2 % of a band's width on Sobol points
_STEP = 1e-3  # of a difference quotient, standard normal variables
_LONGEST = 1.0  # Newton step in any variable
_FRACTIONS = np.array([1.0, 0.4, 0.1, 0.02])  # of a Newton step, tried at once
_MOST_STEPS, _STILL = 12, 1e-3  # steps, and gain in log density below which a start has arrived


def laplace(coordinates: Coordinates, data: Observations, seed: int = 0) -> Evidence:
    """Marginal likelihood and draws (1024, dimension) by the Gaussian at the mode.

    ``standard_error`` and ``effective_draws`` are NaN: an approximation has an error, and none that it knows.

    Raises:
        AnalysisError: the law cannot carry the measured forces.
    """
    negative = negative_log_posterior(coordinates, data)
    near = _descended(coordinates, negative)
    gradient, covariance, _ = derivatives(near, negative, np.full(near.size, _STEP))
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
    points = _normal(coordinates.dimension, _STARTS_POWER, 0)
    values = negative(points)
    best = np.argsort(values)[:_STARTS]
    if not values[best[0]] < BARRIER:
        raise AnalysisError(f"{coordinates.law.name}: no coefficient makes it carry the measured forces")
    x, value = points[best], values[best]
    for _ in range(_MOST_STEPS):
        tried = x[:, None, :] + _FRACTIONS[:, None] * _newton_steps(x, negative)[:, None, :]
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
    unit = _STEP * np.eye(d)
    corners = (unit[:, None, :] + unit[None, :, :]).reshape(d * d, d)
    stencil = np.vstack([np.zeros((1, d)), unit, -unit, corners])
    values = negative((x[:, None, :] + stencil).reshape(-1, d)).reshape(starts, -1)
    here, up, down = values[:, :1], values[:, 1 : 1 + d], values[:, 1 + d : 1 + 2 * d]
    gradient = (up - down) / (2.0 * _STEP)
    # f(x + h e_i + h e_j) - f(x + h e_i) - f(x + h e_j) + f(x), twice the diagonal's own quotient aside
    mixed = values[:, 1 + 2 * d :].reshape(starts, d, d) - up[:, :, None] - up[:, None, :] + here[:, :, None]
    hessian = mixed / _STEP**2
    hessian[:, np.arange(d), np.arange(d)] = (up + down - 2.0 * here) / _STEP**2
    eigenvalues, vectors = np.linalg.eigh(hessian)
    sizes = np.maximum(np.abs(eigenvalues), 1.0)  # the prior alone has curvature 1
    steps = -np.einsum("kij,kj->ki", vectors, np.einsum("kji,kj->ki", vectors, gradient) / sizes)
    longest = np.max(np.abs(steps), axis=1, keepdims=True)
    return np.asarray(steps * np.minimum(1.0, _LONGEST / np.maximum(longest, 1e-12)))
