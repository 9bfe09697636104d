"""Marginal likelihood of any log density by importance sampling with an adapted proposal.

    Z = int exp(log density) dx ~ mean of w,   w = exp(log density)/q,   x ~ q,

with ``q`` on scrambled Sobol points a mixture of multivariate t (see ``proposal``): one as wide as the prior, the
others started from the Gaussian at the mode and adapted to the weighted draws until enough of them count. The draws,
resampled by weight, also start the Markov chains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.errors import AnalysisError
from selection.posterior.proposal import Proposal

_POWER = 13  # 8192 draws a round: 1 % of standard error in Z for a posterior close to a t
_MOST_ROUNDS = 8  # of adaptation
_ENOUGH = 2000  # effective draws at which to stop
_LARGEST_POWER = 22  # of two: draws that still fit a small memory


@dataclass(frozen=True)
class Evidence:
    """A marginal likelihood and a weighted picture of the posterior.

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


def importance(
    log_density: Callable[[FloatArray], FloatArray],
    mode: FloatArray,
    covariance: FloatArray,
    seed: int = 0,
    least_rounds: int = 3,
) -> Evidence:
    """Evidence and weighted draws of a density over standard normal variables.

    Args:
        log_density: at points (n, d) -> (n,), ``-inf`` allowed. mode, covariance: where to begin, (d,) and (d, d).
        least_rounds: of adaptation, more where a part of the posterior lies far from the mode: few draws meet it at
            first and enough later.
    """
    proposal = Proposal.around(mode, covariance)
    rng = np.random.default_rng(seed)
    for round_ in range(_MOST_ROUNDS):
        x = proposal.sobol(_POWER, seed + round_)
        log_w = log_density(x) - proposal.log_density(x)
        w = np.exp(log_w - log_w.max())
        draws = x[rng.choice(len(x), size=len(x), p=w / w.sum())]
        effective = float(w.sum() ** 2 / np.sum(w**2))
        if round_ == _MOST_ROUNDS - 1 or (round_ >= least_rounds - 1 and effective > _ENOUGH):
            break
        proposal = Proposal.through(draws)
    return Evidence(
        log_z=float(log_w.max() + np.log(np.mean(w))),
        standard_error=float(np.std(w) / np.mean(w) / np.sqrt(len(w))),
        mode=mode,
        proposal=proposal,
        draws=draws,
        effective_draws=effective,
    )


def more_draws(
    log_density: Callable[[FloatArray], FloatArray], start: Evidence, wanted: float, seed: int = 0
) -> tuple[FloatArray, float]:
    """Posterior draws (n, dimension) that are worth ``wanted`` independent ones, n a power of two, and their worth.

    From the adapted proposal of ``start``, resampled by weight with equal spacing (systematic), which adds next to
    nothing to the error.

    Raises:
        AnalysisError: 2^22 draws are worth less.
    """
    efficiency = start.effective_draws / len(start.draws)
    power = int(np.ceil(np.log2(1.1 * wanted / efficiency)))
    while power <= _LARGEST_POWER:
        x = start.proposal.sobol(power, seed)
        log_w = log_density(x) - start.proposal.log_density(x)
        w = np.exp(log_w - log_w.max())
        effective = float(w.sum() ** 2 / np.sum(w**2))
        if effective >= wanted:
            edges = (np.arange(len(x)) + np.random.default_rng(seed).random()) / len(x)
            return x[np.minimum(np.searchsorted(np.cumsum(w) / w.sum(), edges), len(x) - 1)], effective
        power += 1
    raise AnalysisError(f"importance draws worth {wanted:g} would need more than 2^{_LARGEST_POWER}")
