"""Marginal likelihood of a law by importance sampling around its posterior mode.

    Z = int likelihood(x) N(x; 0, I) dx ~ mean of w,   w = likelihood(x) N(x; 0, I) / q(x),   x ~ q,

with ``q`` on scrambled Sobol points a mixture of multivariate t: one as wide as the prior, the others started from the
Gaussian at the mode and adapted to the weighted draws until enough of them count. The draws, resampled by weight, also
start the Markov chains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.posterior.law import Coordinates
from selection.posterior.likelihood import log_posterior
from selection.posterior.mode import covariance_at, find_mode
from selection.posterior.observations import Observations
from selection.posterior.proposal import Proposal

_ROUNDS, _ENOUGH = 8, 2000  # most adaptations; effective draws at which to stop
_POWER = 13  # 8192 draws: 1 % of standard error in Z for a posterior close to a t


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


def evidence(coordinates: Coordinates, data: Observations, seed: int = 0) -> Evidence:
    """Marginal likelihood of a law on observations.

    Raises:
        AnalysisError: the law cannot carry the measured forces.
    """
    mode = find_mode(coordinates, data)
    proposal = Proposal.around(mode, covariance_at(mode, coordinates, data))
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
