"""Does a law fit at all? The chance of residuals as large, or as systematic, under the noise stated or learned.

Weights only compare laws with each other: they add to one on noise, too. Two tests of the residuals n of a best fit,
whose smaller probability, doubled (Bonferroni), is the p-value:

- size: T = n^T V^-1 n against chi-square, averaged over what is known of the scatter in V = diag(s^2) + s_l^2 h h^T
  (predictive check of Gelman, Meng and Stern 1996, with the scatter's own prior in place of a posterior that the misfit
  would inflate). s is the stated uncertainty, else drawn from the prior, and no less than what the second differences
  along the sweeps show, which no smooth misfit moves;
- runs: the number of runs of one sign along the sweeps (Wald and Wolfowitz 1940), few where a misfit is smooth; asked
  where the misfit is larger than a few per cent, which is what laws of a few terms leave on real structures.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import chdtrc, ndtr

from damping.arrays import FloatArray, IntArray
from damping.infer.best_fit import BestFit
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN
from damping.infer.likelihood import residuals
from damping.infer.observations import Observations

Verdict = Literal["fits", "poor", "none fits"]
#: Probability below which a law does not fit.
UNLIKELY = 0.01
#: Draws of the scatters: the p-value is then known to 1.6 % at a half and to 0.2 % at ``UNLIKELY``.
DRAWS = 1000
#: Root mean square misfit, relative amplitude, from which on few runs speak against a law: what laws of a few
#: terms leave on real structures.
SYSTEMATIC = 0.04
#: Rows of a sweep from which on second differences and runs are looked at.
FEWEST_ROWS = 6
#: Second differences of white noise have six times its variance and, being correlated, two thirds of their number in
#: degrees of freedom.
DIFFERENCE_VARIANCE = 6.0
DIFFERENCE_FREEDOM = 2.0 / 3.0


@dataclass(frozen=True)
class FitVerdict:
    """Whether the leading law fits.

    Attributes:
        verdict: ``fits`` (p >= .01), ``none fits`` (p < .01 for every candidate), ``poor`` between.
        p_value: of the leading law. misfit: root mean square of its residuals, per cent of amplitude.
    """

    verdict: Verdict
    p_value: float
    misfit: float

    @property
    def sentence(self) -> str:
        """The verdict as an engineer would say it; empty where the law fits."""
        if self.verdict == "fits":
            return ""
        by = f"misses the measured rows by {self.misfit:.2g} % (root mean square), p = {self.p_value:.2g}"
        if self.verdict == "poor":
            return f"the leading law fits poorly: it {by}; a law of less weight fits"
        return f"no law fits: the leading law {by}"


def judge_fit(leader: BestFit, others: Iterable[BestFit], data: Observations, seed: int = 0) -> FitVerdict:
    """The verdict on the leading law, with the others asked where it does not fit."""
    p = fit_probability(leader, data, seed)
    misfit = 100.0 * float(np.sqrt(np.mean(leader.n**2)))
    if p >= UNLIKELY:
        return FitVerdict("fits", p, misfit)
    another = any(fit_probability(fit, data, seed) >= UNLIKELY for fit in others)
    return FitVerdict("poor" if another else "none fits", p, misfit)


def fit_probability(fit: BestFit, data: Observations, seed: int = 0) -> float:
    """The p-value of a best fit: the smaller of the two tests, doubled where both can be made."""
    if not np.isfinite(fit.squares):
        return 0.0
    tests = [_size_probability(fit, data, seed)]
    if np.sqrt(np.mean(fit.n**2)) > SYSTEMATIC:
        tests.append(_runs_probability(fit.n, data))
    return float(min(1.0, len(tests) * min(tests)))


def _size_probability(fit: BestFit, data: Observations, seed: int) -> float:
    """Chance of residuals as large, averaged over the scatter of rows and levels."""
    n, h, known = residuals(fit.force, data)
    freedom = max(len(n) - fit.parameters, 1)
    rng = np.random.default_rng(seed)
    row = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * rng.standard_normal(DRAWS))
    level = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * rng.standard_normal(DRAWS))
    variance = np.where(known > 0.0, known, row[:, None] ** 2)
    roughness, differences = _measure_roughness(n, data)
    if differences > 0.0:  # scaled inverse chi-square
        variance = np.maximum(variance, (roughness**2 * differences / rng.chisquare(differences, DRAWS))[:, None])
    if not (data.has_repeats and len(data.sweeps) > 1):
        level = np.zeros(DRAWS)
    discrepancy = np.sum(n**2 / variance, axis=1)
    for sweep in range(len(data.sweeps)):
        rows = data.sweep == sweep
        hh = np.sum(h[rows] ** 2 / variance[:, rows], axis=1)
        hn = np.sum(h[rows] * n[rows] / variance[:, rows], axis=1)
        discrepancy -= level**2 * hn**2 / (1.0 + level**2 * hh)
    return float(np.mean(chdtrc(freedom, discrepancy)))


def _measure_roughness(n: FloatArray, data: Observations) -> tuple[float, float]:
    """Noise of one row by the second differences of ``n`` along each sweep, and its degrees of freedom (0: none)."""
    differences = [np.diff(n[rows], 2) for rows in _list_along_sweeps(data)]
    if not differences:
        return np.nan, 0.0
    every = np.concatenate(differences)
    return float(np.sqrt(np.mean(every**2) / DIFFERENCE_VARIANCE)), DIFFERENCE_FREEDOM * len(every)


def _runs_probability(n: FloatArray, data: Observations) -> float:
    """Chance of as few runs of one sign about each sweep's median, by the normal approximation; 1 without sweeps."""
    excess = variance = 0.0
    for rows in _list_along_sweeps(data):
        above = n[rows] > np.median(n[rows])
        plus, total = float(above.sum()), float(len(above))
        minus = total - plus
        mean = 1.0 + 2.0 * plus * minus / total
        excess += 1.0 + float(np.sum(above[1:] != above[:-1])) - mean
        variance += (mean - 1.0) * (mean - 2.0) / (total - 1.0)
    return float(ndtr(excess / np.sqrt(variance))) if variance > 0.0 else 1.0


def _list_along_sweeps(data: Observations) -> list[IntArray]:
    """Indices of the rows of every sweep long enough, by frequency."""
    sweeps = [np.flatnonzero(data.sweep == sweep) for sweep in range(len(data.sweeps))]
    return [rows[np.argsort(data.omega[rows], kind="stable")] for rows in sweeps if len(rows) >= FEWEST_ROWS]
