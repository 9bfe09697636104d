"""Marginal likelihood of any log density by importance sampling with an adapted proposal.

    Z = int exp(log density) dx ~ mean of w,   w = exp(log density)/q,   x ~ q,

with ``q`` a mixture (:mod:`damping.infer.proposal`) adapted to the weighted draws until enough of them are effective.
The draws, resampled by weight, also start the Markov chains, which choose among further draws of the mixture.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from damping.arrays import FloatArray
from damping.infer.proposal import Proposal, fill_space

ROUNDS = (2048, 1024, 1024, 2048, 4096, 8192)  #: draws of each round: more where few were not enough
BRIEF_DRAWS = 250  #: effective draws of a first look at a law: its marginal likelihood is then known to 6 %
FULL_DRAWS = 1000  #: effective draws of a full estimate: to 3 %
#: Least effective draws to which a proposal is fitted: with fewer, weights are tempered until there are as many.
FITTED_TO = 20.0
LEAST_DRAWS = 200.0  #: effective draws that suffice after ``ROUNDS``
MOST_ROUNDS = 16  #: to reach them: a narrow ridge (a joint that slips almost fully) is found step by step
#: ln evidence below the floor from which a law is negligible, for what draws may have missed. With this and the next
#: two, no law with half a per cent was dropped by mistake in 6700 estimates on 220 simulated records.
MISSED = 3.0
JUDGED_BY = 50.0  #: effective draws from which that margin holds; for fewer it is larger in inverse proportion
LEAST_JUDGED = 10.0  #: effective draws below which no law is taken as negligible by its evidence
#: A law is negligible, however few draws are effective, where the ln density of the highest lies below the floor by
#: this. In 420 simulated records 2000 laws did so in their first draws; after all rounds the nearest was 64 below.
HOPELESS = 200.0
IMPORTANT = 4.6  #: ln evidence above the floor below which a law has less than a tenth of the largest weight
OF_UNIMPORTANT = 0.5  #: share of the effective draws for such a law: its weight is still known better than the largest
SETTLED = 0.1  #: change of ln evidence in a round below which it has converged
CLOSE = 0.25  #: share of effective draws in the first round above which no adaptation is needed
_HALVINGS = 20  #: bisections for the tempering exponent: to 1e-6
_fill_space = lru_cache(maxsize=16)(fill_space)  #: shared by all laws of as many variables; at most 9 MB


@dataclass(frozen=True)
class Evidence:
    """A marginal likelihood and draws of the posterior."""

    log_z: float  #: natural logarithm of the marginal likelihood
    standard_error: float  #: of log_z, Monte Carlo
    #: resampled by weight, (draws, dimension); with fewer than ``LEAST_JUDGED`` effective ones by tempered weights, so
    #: that they spread more widely than the posterior
    draws: FloatArray
    effective_draws: float  #: 1/sum of squared normalised weights
    highest: float = np.inf  #: largest ln density of a draw

    @property
    def proposal(self) -> Proposal:
        """A proposal fitted to the draws."""
        return Proposal.through(self.draws, self.effective_draws)

    def falls_below(self, log_z: float) -> bool:
        """Whether ln of the marginal likelihood is below ``log_z``, with a margin for what the draws missed."""
        missed = MISSED * max(1.0, JUDGED_BY / self.effective_draws)
        judged = self.effective_draws >= LEAST_JUDGED and self.log_z + missed < log_z
        return judged or self.highest + HOPELESS < log_z


def importance(
    log_density: Callable[[FloatArray], FloatArray],
    mode: FloatArray,
    covariance: FloatArray,
    seed: int = 0,
    wanted: float = FULL_DRAWS,
    floor: float = -np.inf,
    least_rounds: int = 1,
) -> Evidence:
    """Evidence and weighted draws of a density over standard normal variables.

    Draws of all rounds are kept. They are weighted by the mixture of the proposals of all rounds (adaptive multiple
    importance sampling: Cornuet, Marin, Mira and Robert 2012), so that no draw has a large weight where any proposal
    draws often. While few draws carry the weight, the next proposal is fitted to tempered weights w^beta, which lead
    from the proposals to the density step by step.

    Args:
        log_density: at points (n, d) -> (n,), ``-inf`` allowed.
        mode, covariance: start, (d,) and (d, d), or several modes (k, d) and (k, d, d).
        wanted: effective draws at which to stop; after ``ROUNDS``, ``LEAST_DRAWS`` are enough.
        floor: ln of a marginal likelihood below which no further round is worth its time.
        least_rounds: of adaptation; more where part of the posterior is far from the mode, where few draws reach it at
            first.
    """
    proposals, proposal, sizes = [], Proposal.around(np.atleast_2d(mode), covariance), np.empty(0)
    x, log_p = np.empty((0, mode.shape[-1])), np.empty(0)
    q = np.empty((0, 0))  # density of each draw under each proposal, (draws, proposals)
    rounds, before = max(least_rounds, len(ROUNDS)), -np.inf
    for round_ in range(max(rounds, MOST_ROUNDS)):
        proposals.append(proposal)
        space = _fill_space(x.shape[1], ROUNDS[min(round_, len(ROUNDS) - 1)], seed + round_)
        new = proposal.transform(*space)
        of_old = proposal.density(x)[:, None]
        q = np.vstack([np.hstack([q, of_old]), np.stack([earlier.density(new) for earlier in proposals], axis=1)])
        x, log_p, sizes = np.vstack([x, new]), np.append(log_p, log_density(new)), np.append(sizes, len(new))
        log_w = log_p - np.log(q @ (sizes / len(x)))
        weighed = replace(_weigh(x, log_w, seed), highest=float(log_p.max()))
        settled = abs(weighed.log_z - before) < SETTLED
        before = weighed.log_z
        enough = OF_UNIMPORTANT * wanted if settled and before < floor + IMPORTANT else wanted
        if round_ >= rounds - 1:
            enough = min(enough, LEAST_DRAWS)
        adapted = round_ >= least_rounds - 1 and (round_ or weighed.effective_draws > CLOSE * len(x))
        if weighed.falls_below(floor) or (adapted and weighed.effective_draws > enough):
            break
        proposal = (weighed if weighed.effective_draws >= FITTED_TO else _temper(x, log_w, seed)).proposal
    if weighed.effective_draws >= LEAST_JUDGED:
        return weighed
    return replace(weighed, draws=_temper(x, log_w, seed).draws)  # too few have a spread of their own


def _temper(x: FloatArray, log_w: FloatArray, seed: int) -> Evidence:
    """Draws resampled by their weights to the largest power that leaves ``FITTED_TO`` effective ones."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        power = 0.5 * (low + high)
        w = np.exp(power * (log_w - log_w.max()))
        low, high = (power, high) if w.sum() ** 2 >= FITTED_TO * np.sum(w**2) else (low, power)
    return _weigh(x, low * np.where(np.isfinite(log_w), log_w, -np.inf) if low > 0.0 else log_w, seed)


def _weigh(x: FloatArray, log_w: FloatArray, seed: int) -> Evidence:
    """Evidence of draws x (n, d) with log weights (n,), by systematic resampling."""
    w = np.exp(log_w - log_w.max())
    edges = (np.arange(len(w)) + np.random.default_rng(seed).random()) / len(w)
    chosen = np.minimum(np.searchsorted(np.cumsum(w) / w.sum(), edges), len(w) - 1)
    return Evidence(
        log_z=float(log_w.max() + np.log(np.mean(w))),
        standard_error=float(np.std(w) / np.mean(w) / np.sqrt(len(w))),
        draws=x[chosen],
        effective_draws=float(w.sum() ** 2 / np.sum(w**2)),
    )


def draw_again(
    log_density: Callable[[FloatArray], FloatArray], proposal: Proposal, number: int, seed: int = 0
) -> Evidence:
    """Evidence of ``number`` fresh draws, free of the bias of rounds that stop once enough draws are effective."""
    x = proposal.draw(number, seed)
    return _weigh(x, log_density(x) - proposal.log_density(x), seed)
