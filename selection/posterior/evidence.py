"""Marginal likelihood of a law by importance sampling around its posterior mode.

    Z = int likelihood(x) N(x; 0, I) dx ~ mean of w,   w = likelihood(x) N(x; 0, I) / q(x),   x ~ q,

with ``q`` on scrambled Sobol points a mixture of multivariate t: one as wide as the prior, the others started from the
Gaussian at the mode and adapted to the weighted draws until enough of them count. The draws, resampled by weight, also
start the Markov chains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import ndtri

from selection.arrays import FloatArray
from selection.errors import AnalysisError
from selection.posterior.law import Coordinates
from selection.posterior.likelihood import log_posterior
from selection.posterior.observations import Observations
from selection.posterior.proposal import Proposal, sobol

_ROUNDS, _ENOUGH = 8, 2000  # most adaptations; effective draws at which to stop
_POWER = 13  # 8192 draws: 1 % of standard error in Z for a posterior close to a t
_STARTS_POWER = 9  # 512 prior points in search of the mode: enough to meet every mode of a slip joint or an exponent
_STEP = 1e-4  # of a standard normal variable: truncation and rounding errors of the difference quotients balance
_BARRIER = 1e8  # stands for an impossible law in the minimiser, which needs finite numbers


@dataclass(frozen=True)
class Evidence:
    """A law's marginal likelihood and a weighted picture of its posterior.

    Attributes:
        log_z: natural logarithm of the marginal likelihood. standard_error: its Monte Carlo standard error.
        mode: x of largest posterior density, (dimension,). proposal: adapted to the posterior.
        draws: resampled by weight, (8192, dimension).
        effective_draws: 1/sum of squared normalised weights.
    """

    log_z: float
    standard_error: float
    mode: FloatArray
    proposal: Proposal
    draws: FloatArray
    effective_draws: float


def find_mode(coordinates: Coordinates, data: Observations, starts: int = 3) -> FloatArray:
    """Posterior mode in the standard normal variables, the best of several quasi-Newton descents.

    Raises:
        AnalysisError: the law cannot carry the measured forces at any parameter value tried.
    """

    def value_and_gradient(x: FloatArray) -> tuple[float, FloatArray]:
        values = _negative(_star(x), coordinates, data)
        d = x.size
        return float(values[0]), (values[1 : 1 + d] - values[1 + d :]) / (2.0 * _STEP)

    points = ndtri(sobol(coordinates.dimension, _STARTS_POWER, seed=0))
    order = np.argsort(_negative(points, coordinates, data))
    if not _negative(points[order[:1]], coordinates, data)[0] < _BARRIER:
        raise AnalysisError(f"{coordinates.law.name}: no coefficient makes it carry the measured forces")
    found = [
        minimize(value_and_gradient, points[i], jac=True, method="L-BFGS-B", options={"maxiter": 200})
        for i in order[:starts]
    ]
    return np.asarray(min(found, key=lambda result: float(result.fun)).x)


def evidence(coordinates: Coordinates, data: Observations, seed: int = 0) -> Evidence:
    """Marginal likelihood of a law on observations.

    Raises:
        AnalysisError: the law cannot carry the measured forces.
    """
    mode = find_mode(coordinates, data)
    proposal = Proposal.around(mode, _inverse_hessian(mode, coordinates, data))
    rng = np.random.default_rng(seed)
    for round_ in range(_ROUNDS):
        x = proposal.sobol(_POWER, seed + round_)
        log_w = log_posterior(x, coordinates, data) - proposal.log_density(x)
        top = float(np.max(log_w))
        w = np.exp(log_w - top)
        share = w / w.sum()
        draws = x[rng.choice(len(x), size=len(x), p=share)]
        effective = 1.0 / float(np.sum(share**2))
        if round_ >= 2 and effective > _ENOUGH:
            break
        if round_ < _ROUNDS - 1:
            proposal = Proposal.through(draws)
    return Evidence(
        log_z=top + float(np.log(np.mean(w))),
        standard_error=float(np.std(w) / np.mean(w) / np.sqrt(len(w))),
        mode=mode,
        proposal=proposal,
        draws=draws,
        effective_draws=effective,
    )


def _negative(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Minus the log posterior, a large finite number where the law is impossible."""
    value = -log_posterior(x, coordinates, data)
    return np.where(np.isfinite(value), value, _BARRIER + np.sum(x**2, axis=-1))


def _star(x: FloatArray) -> FloatArray:
    """The point and its neighbours one step up and one step down each axis, (1 + 2d, d)."""
    steps = _STEP * np.eye(x.size)
    return np.vstack([x, x + steps, x - steps])


def _inverse_hessian(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Covariance of the Gaussian at the mode, limited to at most the prior's (eigenvalues in [1e-8, 1])."""
    d, step = x.size, 1e-3
    shifts = np.array([a * np.eye(d)[i] + b * np.eye(d)[j] for i in range(d) for j in range(d) for a, b in _CORNERS])
    values = _negative(x + step * shifts, coordinates, data).reshape(d, d, 4)
    hessian = (values[..., 0] - values[..., 1] - values[..., 2] + values[..., 3]) / (4.0 * step**2)
    eigenvalues, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
    return np.asarray((vectors / np.clip(eigenvalues, 1.0, 1e8)) @ vectors.T)


_CORNERS = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
