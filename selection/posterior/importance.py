"""Marginal likelihood of any log density by importance sampling, adapted until enough draws count.

    Z = int exp(log density) dx ~ mean of w,   w = exp(log density)/q,   x ~ q,

with ``q`` a mixture of multivariate t (see ``proposal``), first about the mode, then fitted to the weighted draws.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from selection.arrays import FloatArray
from selection.posterior.evidence import Evidence
from selection.posterior.proposal import Proposal

_LEAST, _MOST, _ENOUGH = 3, 12, 2000  # rounds of adaptation; effective draws at which to stop
_POWER = 13  # 8192 draws a round


def importance(
    log_density: Callable[[FloatArray], FloatArray], mode: FloatArray, covariance: FloatArray, seed: int = 0
) -> Evidence:
    """Evidence and weighted draws of a density over standard normal variables.

    The round with the most effective draws is kept: adaptation wanders where a posterior has several parts.

    Args:
        log_density: at points (n, d) -> (n,), ``-inf`` allowed. mode, covariance: where to begin, (d,) and (d, d).
    """
    proposal = Proposal.around(mode, covariance)
    rng = np.random.default_rng(seed)
    best: Evidence | None = None
    for round_ in range(_MOST):
        x = proposal.sobol(_POWER, seed + round_)
        log_w = log_density(x) - proposal.log_density(x)
        w = np.exp(log_w - log_w.max())
        draws = x[rng.choice(len(x), size=len(x), p=w / w.sum())]
        effective = float(w.sum() ** 2 / np.sum(w**2))
        if best is None or effective > best.effective_draws:
            log_z = float(log_w.max() + np.log(np.mean(w)))
            error = float(np.std(w) / np.mean(w) / np.sqrt(len(w)))
            best = Evidence(log_z, error, mode, proposal, draws, effective)
        if round_ + 1 >= _LEAST and best.effective_draws > _ENOUGH:
            break
        proposal = Proposal.through(draws)
    assert best is not None  # there was a round
    return best
