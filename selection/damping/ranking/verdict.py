"""Whether a law fits the rows at all, and whether they exclude it beside one that fits better.

Weights only compare laws with each other: they add to one on noise, too. Two tests of the residuals n of a best fit,
whose smaller probability, doubled (Bonferroni), is the p-value:

- size: T = n^T V^-1 n against chi-square, averaged over what is known of the scatter in V = diag(s^2) + s_l^2 h h^T
  (predictive check of Gelman, Meng and Stern 1996, with the scatter's own prior in place of a posterior that the misfit
  would inflate). s is the stated uncertainty, else drawn from the prior, and no less than what the second differences
  along the sweeps show, which no smooth misfit moves, up to ``ROUGHEST``; where any is stated the law is fitted under V
  for it;
- runs: the number of runs of one sign along the sweeps (Wald and Wolfowitz 1940), few where a misfit is smooth; asked
  where the misfit is larger than a few per cent, which is what laws of a few terms leave on real structures.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtr

from damping.arrays import RAD_S_PER_HZ, FloatArray, Floats, IntArray
from damping.infer.best_fit import BestFit, fit_law
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN
from damping.infer.likelihood import residuals
from damping.infer.observations import Observations
from damping.ranking.candidates import NOISE_RANGE

Verdict = Literal["fits", "poor", "none fits"]
#: Probability below which a law does not fit.
UNLIKELY = 0.01
#: Draws of the scatters: the p-value is then known to 1.6 % at a half and to 0.2 % at ``UNLIKELY``.
DRAWS = 1000
#: Stated deviations over the scatter of a fit from which on that counts for nothing: its square is 1e-4 of theirs.
FAR_ABOVE = 100.0
#: Root mean square misfit, relative amplitude, from which on few runs speak against a law: what laws of a few
#: terms leave on real structures.
SYSTEMATIC = 0.04
#: Rows of a sweep from which on second differences and runs are looked at.
FEWEST_ROWS = 6
#: Second differences of white noise have six times its variance and, being correlated, two thirds of their number in
#: degrees of freedom.
DIFFERENCE_VARIANCE = 6.0
DIFFERENCE_FREEDOM = 2.0 / 3.0
#: Noise of one row, relative amplitude, that is the most a law is excused by: rows that differ by more from their
#: neighbours on a resonance are of no resonance. A uniform phase has .9.
ROUGHEST = 0.2
#: Times the stated noise, by which rows scatter from one to the next, from which on it is asked whether that is right.
UNDERSTATED = 2.0
#: Levels lie apart where they scatter by this times the noise of one row: of 325 sweeps of structures in and out of the
#: library whose levels are exact, 1 does (with the next).
BEYOND_ROWS = 5.0
#: and, ln A, by this at least: repeats of one level on large structures scatter by less.
LEVELS_APART = 0.03
#: Amplitude per force of a row, over that at its sweep's resonance, that is no noise of a row.
PEAKED = 1.15
FEWEST_LEVELS = 3  #: of two, neither is the one that is off


@dataclass(frozen=True)
class FitVerdict:
    """Whether the leading law fits.

    Attributes:
        verdict: ``fits`` (p >= .01), ``none fits`` (p < .01 for every candidate), ``poor`` between.
        p_value: of the leading law. misfit: root mean square of its residuals, per cent of amplitude.
        level_caution: what is said of levels that scatter about the leading law far more than their rows do, or of rows
            that no law fits and that read far more than a resonance; empty if none do.
        rough: times the stated noise by which the rows of a law that fits scatter, from ``UNDERSTATED`` on; else 0.
    """

    verdict: Verdict
    p_value: float
    misfit: float
    level_caution: str = ""
    rough: float = 0.0

    @property
    def sentence(self) -> str:
        """The verdict as an engineer would say it; empty where the law fits and no level lies apart."""
        by = f"misses the measured rows by {self.misfit:.2g} % (root mean square), p = {self.p_value:.2g}"
        said = {
            "fits": "",
            "poor": f"the leading law fits poorly: it {by}; a law of less weight fits",
            "none fits": f"no law fits: the leading law {by}",
        }
        rough = f"rows scatter along the sweeps by {self.rough:.2g} times the stated noise: is the stated noise right?"
        return "; ".join(filter(None, [said[self.verdict], self.level_caution, rough if self.rough else ""]))


def judge_fit(leader: BestFit, others: Iterable[BestFit], data: Observations, seed: int = 0) -> FitVerdict:
    """The verdict on the leading law, with the others asked where it does not fit."""
    others, p = list(others), fit_probability(leader, data, seed)
    verdict: Verdict = "fits"
    if p < UNLIKELY:
        another = any(fit_probability(fit, data, seed) >= UNLIKELY for fit in others)
        verdict = "poor" if another else "none fits"
    misfit = 100.0 * float(np.sqrt(np.mean(leader.n**2)))
    levels = _describe_levels_apart(leader, data) or _describe_hidden_offset(leader, others, data)
    apart = [levels, _describe_peak(data) if verdict == "none fits" else ""]
    rough = _compare_with_stated(leader, data) if verdict == "fits" else 0.0
    return FitVerdict(verdict, p, misfit, "; ".join(filter(None, apart)), rough)


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
    n, _, known = residuals(fit.force, data)
    rng = np.random.default_rng(seed)
    row = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * rng.standard_normal(DRAWS))
    level = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * rng.standard_normal(DRAWS))
    variance = np.where(known > 0.0, known, row[:, None] ** 2)
    roughness, differences = _measure_roughness(n, data)
    if differences > 0.0:  # scaled inverse chi-square
        rough = np.minimum(roughness**2 * differences / rng.chisquare(differences, DRAWS), ROUGHEST**2)
        variance = np.maximum(variance, rough[:, None])
    fits = [fit, _fit_under(variance, fit, data)] if data.states_uncertainty else [fit]
    return max(
        float(np.mean(chdtrc(_count_freedom(own), _measure_discrepancy(own, data, variance, level)))) for own in fits
    )


def _fit_under(variance: FloatArray, fit: BestFit, data: Observations) -> BestFit:
    """The law at its best under the ``variance`` of the test (draws, rows): that of a fit has scatter beside what is
    stated, so that rows which state little miss the law by more than they need to.
    """
    sd = np.sqrt(1.0 / np.mean(1.0 / variance, axis=0))
    far = FAR_ABOVE * SCATTER_MEDIAN * sd / sd.min()  # the same weights, and no scatter beside them
    return fit_law(fit.law, replace(data, sd_amplitude=far, sd_phase=far, sd_force=np.zeros(len(sd))))


def _count_freedom(fit: BestFit) -> int:
    return max(len(fit.n) - fit.parameters, 1)


def _measure_discrepancy(fit: BestFit, data: Observations, variance: FloatArray, level: Floats) -> FloatArray:
    """n^T V^-1 n (..) by the ``variance`` of rows (.., rows) and the scatter of levels (..)."""
    n, h, _ = residuals(fit.force, data)
    discrepancy = np.sum(n**2 / variance, axis=-1)
    for sweep in range(len(data.sweeps)) if data.has_repeats and len(data.sweeps) > 1 else ():
        rows = data.sweep == sweep
        hh = np.sum(h[rows] ** 2 / variance[..., rows], axis=-1)
        hn = np.sum(h[rows] * n[rows] / variance[..., rows], axis=-1)
        discrepancy = discrepancy - level**2 * hn**2 / (1.0 + level**2 * hh)
    return np.asarray(discrepancy)


#: Rows whose errors count as one where laws are compared: neighbours that go together as .6 are worth a quarter.
ROWS_TOGETHER = 4.0
#: Scatter of levels, relative, that leaves their gains free.
FREE = 10.0


def exceed_probability(fit: BestFit, best: BestFit, data: Observations) -> float:
    """Probability, by an F test, of a misfit as much larger than the ``best`` law's as this one's is.

    The gains of levels are left free: what levels say of each other is in the weights of the resonances, and one that
    is read wrong excludes no law. The rows' own scatter is what the best law leaves of them, or the least of careful
    tests: where it is small, a law that a larger one would allow is excluded none the less.
    """
    free, free_best = (_count_freedom(own) / ROWS_TOGETHER for own in (fit, best))
    return float(fdtrc(free, free_best, _measure_along_sweeps(fit, data) / _measure_along_sweeps(best, data)))


def _measure_along_sweeps(fit: BestFit, data: Observations) -> float:
    """Mean square of what a law misses of the rows, levels' gains left free; no less than noise of careful tests."""
    known = residuals(fit.force, data)[2]
    variance = np.where(known > 0.0, known / max(float(np.mean(known)), 1e-300), 1.0)
    left = float(_measure_discrepancy(fit, data, variance, FREE)) / _count_freedom(fit)
    return max(left, float(np.mean(known)), NOISE_RANGE[0] ** 2)


def is_excluded(fit: BestFit, best: BestFit, data: Observations) -> bool:
    """Whether the rows exclude a law beside the ``best`` one."""
    return exceed_probability(fit, best, data) < UNLIKELY


def _describe_hidden_offset(leader: BestFit, others: Iterable[BestFit], data: Observations) -> str:
    """What to say of a level that lies apart beside another law, which fits the sweeps far better than the leader."""
    steadiest = min((leader, *others), key=lambda fit: _measure_along_sweeps(fit, data))
    return _describe_levels_apart(steadiest, data) if is_excluded(leader, steadiest, data) else ""


def _describe_levels_apart(fit: BestFit, data: Observations) -> str:
    """What to say of levels that lie apart: by how much, and which is farthest; empty where none do.

    The level scatter that is learnt with a law takes them in, so that the law fits: ln A of level l is off by
    b_l = sum(h n)/sum(h^2) over its rows.
    """
    n, h, _ = residuals(fit.force, data)
    noise = _measure_roughness(n, data)[0]
    if len(data.sweeps) < FEWEST_LEVELS or not noise > 0.0:
        return ""
    off = -np.bincount(data.sweep, h * n) / np.maximum(np.bincount(data.sweep, h * h), 1e-300)
    scatter = float(np.std(off, ddof=1))
    if scatter < max(BEYOND_ROWS * noise, LEVELS_APART):
        return ""
    from_others = [float(b - np.median(np.delete(off, level))) for level, b in enumerate(off)]
    farthest = int(np.argmax(np.abs(from_others)))
    by = 100.0 * np.expm1(from_others[farthest])
    return (
        f"levels scatter about {fit.law.name} by {100.0 * scatter:.2g} %, {scatter / noise:.0f} times their rows"
        f" ({100.0 * noise:.2g} %): {data.sweeps[farthest]} deviates most, its amplitudes {abs(by):.2g} %"
        f" {'below' if by < 0.0 else 'above'} those implied by the others. If the law is not the cause,"
        " damping gap names it"
    )


def _describe_peak(data: Observations) -> str:
    """What to say of a sweep that peaks far above its resonance, as of two modes or planes; empty where none does."""
    per_force = data.A / np.hypot(data.D, data.R) / (data.tested_amplitude / data.tested_force)[data.sweep]
    at = int(np.argmax(per_force))
    if per_force[at] < PEAKED:
        return ""
    return (
        f"{data.sweeps[data.sweep[at]]} reads {100.0 * (per_force[at] - 1.0):.0f} % more amplitude per force at"
        f" {data.omega[at] / RAD_S_PER_HZ:.4g} Hz than at the resonance of one mode, which is what is predicted"
    )


def _measure_roughness(n: FloatArray, data: Observations) -> tuple[float, float]:
    """Noise of one row by the second differences of ``n`` along each sweep, and its degrees of freedom (0: none)."""
    differences = [np.diff(n[rows], 2) for rows in _list_along_sweeps(data)]
    if not differences:
        return np.nan, 0.0
    every = np.concatenate(differences)
    return float(np.sqrt(np.mean(every**2) / DIFFERENCE_VARIANCE)), DIFFERENCE_FREEDOM * len(every)


def _compare_with_stated(fit: BestFit, data: Observations) -> float:
    """Noise of one row by the second differences over what every row states, from ``UNDERSTATED`` on; else 0."""
    n, _, known = residuals(fit.force, data)
    ratio, differences = _measure_roughness(n / np.sqrt(known), data) if np.all(known > 0.0) else (0.0, 0.0)
    return ratio if differences and ratio > UNDERSTATED else 0.0


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
