"""Marginal likelihood of any log density by importance sampling with an adapted proposal.

    Z = int exp(log density) dx ~ mean of w,   w = exp(log density)/q,   x ~ q,

with ``q`` a mixture of multivariate t (see ``proposal``): first about the mode, then fitted to the weighted draws,
several times over, since a part of the posterior far from the mode is met by few draws at first and by enough later.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from selection.arrays import FloatArray
from selection.posterior.evidence import Evidence
from selection.posterior.proposal import Proposal

_ROUNDS = 7  # of adaptation
_POWER = 13  # 8192 draws a round


def importance(
    log_density: Callable[[FloatArray], FloatArray], mode: FloatArray, covariance: FloatArray, seed: int = 0
) -> Evidence:
    """Evidence and weighted draws of a density over standard normal variables.

    Args:
        log_density: at points (n, d) -> (n,), ``-inf`` allowed. mode, covariance: where to begin, (d,) and (d, d).
    """
    proposal = Proposal.around(mode, covariance)
    rng = np.random.default_rng(seed)
    for round_ in range(_ROUNDS):
        x = proposal.sobol(_POWER, seed + round_)
        log_w = log_density(x) - proposal.log_density(x)
        w = np.exp(log_w - log_w.max())
        draws = x[rng.choice(len(x), size=len(x), p=w / w.sum())]
        if round_ < _ROUNDS - 1:
            proposal = Proposal.through(draws)
    return Evidence(
        log_z=float(log_w.max() + np.log(np.mean(w))),
        standard_error=float(np.std(w) / np.mean(w) / np.sqrt(len(w))),
        mode=mode,
        proposal=proposal,
        draws=draws,
        effective_draws=float(w.sum() ** 2 / np.sum(w**2)),
    )
