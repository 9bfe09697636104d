"""How much a law errs per e-fold of force beyond what it was fitted to: learnt from held-out levels, with a prior.

No law of a few terms is the structure's own. At a force F the logarithm of the resonant amplitude misses the law's by

    delta ~ N(0, (kappa d)^2),      d = |ln(F/F_nearest)| beyond the tested forces, d_1 d_2/(d_1 + d_2) between two,

beside the scatter from level to level that tests show at one force. ``kappa`` has a log-normal prior and is learnt, for
each law, from every level predicted from fewer levels below (all pairs; the pairs of one level count as one level).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import logsumexp
from scipy.stats import norm

from selection.arrays import FloatArray
from selection.compare.weights import HeldOut

#: Prior of kappa: median and log standard deviation. 90 % lies between 1.5 % and 17 % of amplitude per e-fold of force.
KAPPA_MEDIAN, KAPPA_LOG_SD = 0.05, 0.75
#: Values of kappa, equally spaced in the logarithm over 3.5 standard deviations of the prior either way.
KAPPA = KAPPA_MEDIAN * np.exp(KAPPA_LOG_SD * np.linspace(-3.5, 3.5, 57))


def prior() -> FloatArray:
    """Prior probability of each of ``KAPPA``."""
    density = norm.pdf(np.log(KAPPA / KAPPA_MEDIAN) / KAPPA_LOG_SD)
    return np.asarray(density / density.sum())


def posterior(predictions: Sequence[HeldOut]) -> FloatArray:
    """Posterior probability of each of ``KAPPA`` from one law's predictions; the prior where there are none."""
    levels = [prediction.level for prediction in predictions]
    log_p = np.log(prior())
    for prediction in predictions:
        density = prediction.log_density(KAPPA)
        log_p = log_p + np.where(np.isfinite(density), density, 0.0) / levels.count(prediction.level)
    return np.asarray(np.exp(log_p - logsumexp(log_p)))


def log_density(prediction: HeldOut) -> float:
    """Log predictive density of a held-out level, kappa averaged over its prior."""
    return float(logsumexp(prediction.log_density(KAPPA), b=prior()))


def draw(probability: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """Draws of kappa (n,) from probabilities of ``KAPPA``, spread over its cells."""
    step = np.log(KAPPA[1] / KAPPA[0])
    chosen = rng.choice(len(KAPPA), size=n, p=probability)
    return np.asarray(KAPPA[chosen] * np.exp(step * (rng.random(n) - 0.5)))


def distance(force: FloatArray, tested: FloatArray) -> FloatArray:
    """Distance d of each force (forces,) from the tested ones (sweeps,) in ln F; 0 at a tested force."""
    log_F, known = np.log(force), np.unique(np.log(tested))
    above = np.searchsorted(known, log_F)
    to_lower = np.abs(log_F - known[np.maximum(above - 1, 0)])
    to_upper = np.abs(known[np.minimum(above, len(known) - 1)] - log_F)
    between = (above > 0) & (above < len(known))
    both = np.where(between, to_lower + to_upper, 1.0)
    return np.where(between, to_lower * to_upper / both, np.minimum(to_lower, to_upper))
