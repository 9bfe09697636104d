"""Whether a law fits the rows at all, and whether they exclude it beside one that fits better.

Weights only compare laws with each other: they add to one even on noise. Two tests of the residuals n of a best fit
give the p-value, the smaller of both doubled (Bonferroni):

- size: T = n^T V^-1 n against chi-square, averaged over the scatters in V = diag(s^2) + s_l^2 h h^T (predictive check
  of Gelman, Meng and Stern 1996, with the prior of the scatters, since the misfit would inflate a posterior). s is the
  stated uncertainty, else drawn from the prior beside the error of reading between rows. It is at least the noise (up
  to ``ROUGHEST``) in second differences along the sweeps, which a smooth misfit does not change. Where any uncertainty
  is stated, the law is also fitted under V, and the larger p-value counts;
- runs: the number of runs of one sign along the sweeps (Wald and Wolfowitz 1940), small for a smooth misfit; used only
  for a misfit above a few per cent, which laws of a few terms leave on real structures.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import chdtrc, fdtrc

from damping.arrays import RAD_S_PER_HZ, FloatArray, Floats
from damping.infer.best_fit import BestFit, fit_law
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN
from damping.infer.likelihood import residuals
from damping.infer.observations import Observations
from damping.ranking.along_sweeps import measure_roughness, misfit_along_sweeps, runs_probability
from damping.ranking.candidates import NOISE_RANGE
from damping.records.text import describe_p, per_cent

Verdict = Literal["fits", "poor", "none fits"]
#: What the sentence of a verdict says where no law fits, and where the leading one does not.
MISFITS = ("no law fits", "fits poorly")
#: Probability below which a law does not fit.
UNLIKELY = 0.01
#: Draws of the scatters: the p-value is then known to 1.6 % at a half and to 0.2 % at ``UNLIKELY``.
DRAWS = 1000
#: Stated deviations over the scatter of a fit that make the latter negligible: its variance is 1e-4 of theirs.
FAR_ABOVE = 100.0
#: Root mean square misfit, relative amplitude, above which few runs count against a law: laws of a few terms leave as
#: much on real structures.
SYSTEMATIC = 0.04
#: Largest noise of one row, relative amplitude, that can excuse a law: rows of a resonance do not differ by more from
#: their neighbours. A uniform phase has .9.
ROUGHEST = 0.2
UNDERSTATED = 2.0  #: scatter from row to row over the stated noise, above which the stated noise is questioned
#: Levels lie apart where they scatter by this many times the noise of one row: so do 1 of 325 sweeps of structures in
#: and out of the library with exact levels (with the next condition) ...
BEYOND_ROWS = 5.0
#: ... and by at least this in ln A: repeats of one level on large structures scatter by less.
LEVELS_APART = 0.03
PEAKED = 1.15  #: amplitude per force of a row, over that at its sweep's resonance, beyond the noise of a row
FEWEST_LEVELS = 3  #: with two it is unknown which one is off


@dataclass(frozen=True)
class FitVerdict:
    """Whether the leading law fits."""

    verdict: Verdict  #: ``fits`` (p >= .01), ``none fits`` (p < .01 for every candidate), ``poor`` between
    p_value: float  #: of the leading law
    misfit: float  #: root mean square of its residuals, per cent of amplitude
    #: about levels that scatter about the law far more than their rows, or about rows that no law fits and that exceed
    #: the resonance; empty without either
    level_caution: str = ""
    #: scatter from row to row over the stated noise, if the law fits and it exceeds ``UNDERSTATED``; else 0
    rough: float = 0.0
    #: root mean square misfit along the sweeps, per cent, if the law fits but rows deviate together; else 0
    smooth: float = 0.0
    together: float = 1.0  #: rows that count as one in weights and intervals, since they deviate together
    law: str = ""  #: name of the leading law
    other: str = ""  #: where the verdict is ``poor``, name of the first law after it that fits
    #: whether weights, and so the leading law, are those of the resonances alone: on all rows another law may lead
    by_resonances: bool = False

    @property
    def sentence(self) -> str:
        """The verdict in words; empty where the law fits, no level lies apart and the stated noise is not exceeded."""
        by = f"misses the measured rows by {per_cent(self.misfit)} % (root mean square), {describe_p(self.p_value)}"
        none, poorly = MISFITS
        leading, there = "the leading law", ""
        if self.by_resonances:
            leading, there = "the law leading at resonance alone", " there"
        verdicts = {
            "fits": "",
            "poor": f"{leading}, {self.law}, {poorly}: it {by}; {self.other}, of less weight{there}, fits",
            "none fits": f"{none}: {leading}, {self.law}, {by}",
        }
        rough = f"rows scatter along the sweeps by {self.rough:.2g} times the stated noise: check that noise"
        smooth = (
            f"rows of a sweep deviate from {self.law} together, by {per_cent(self.smooth)} %: in weights and intervals"
            f" one row in {self.together:.0f} counts as independent"
        )
        further = [rough if self.rough else "", smooth if self.smooth else ""]
        return "; ".join(filter(None, [verdicts[self.verdict], self.level_caution, *further]))


def judge_fit(leader: BestFit, others: Iterable[BestFit], data: Observations, seed: int = 0) -> FitVerdict:
    """The verdict on the leading law; the others are tested where it does not fit."""
    others, p = list(others), fit_probability(leader, data, seed)
    verdict: Verdict = "fits"
    other = ""
    if p < UNLIKELY:
        other = next((fit.law.name for fit in others if fit_probability(fit, data, seed) >= UNLIKELY), "")
        verdict = "poor" if other else "none fits"
    misfit = 100.0 * float(np.sqrt(np.mean(leader.n**2)))
    levels = _describe_levels_apart(leader, data) or _describe_hidden_offset(leader, others, data)
    apart = [levels, _describe_peak(data) if verdict == "none fits" else ""]
    rough = _compare_with_stated(leader, data) if verdict == "fits" else 0.0
    smooth = 0.0
    if verdict == "fits" and data.together > 1.0:
        smooth = 100.0 * float(np.sqrt(np.mean(misfit_along_sweeps(leader, data) ** 2)))
    said = "; ".join(filter(None, apart))
    return FitVerdict(verdict, p, misfit, said, rough, smooth, data.together, leader.law.name, other)


def fit_probability(fit: BestFit, data: Observations, seed: int = 0) -> float:
    """The p-value of a best fit: that of the size test, or the smaller of two tests, doubled, for a large misfit."""
    if not np.isfinite(fit.squares):
        return 0.0
    tests = [_size_probability(fit, data, seed)]
    if np.sqrt(np.mean(fit.n**2)) > SYSTEMATIC:
        tests.append(runs_probability(fit.n, data))
    return float(min(1.0, len(tests) * min(tests)))


def _size_probability(fit: BestFit, data: Observations, seed: int) -> float:
    """Probability of residuals at least as large, averaged over the scatter of rows and levels."""
    n, _, known = residuals(fit.force, data)
    rng = np.random.default_rng(seed)
    row = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * rng.standard_normal(DRAWS))
    level = SCATTER_MEDIAN * np.exp(SCATTER_LOG_SD * rng.standard_normal(DRAWS))
    stated = (known > 0.0) & (not data.read_between)
    variance = known + np.where(stated, 0.0, row[:, None] ** 2)
    roughness, differences = measure_roughness(n, data)
    if differences > 0.0:  # scaled inverse chi-square
        rough = np.minimum(roughness**2 * differences / rng.chisquare(differences, DRAWS), ROUGHEST**2)
        variance = np.maximum(variance, rough[:, None])
    fits = [fit, _fit_under(variance, fit, data)] if data.states_uncertainty else [fit]
    return max(float(np.mean(chdtrc(_count_freedom(f), _measure_misfit(f, data, variance, level)))) for f in fits)


def _fit_under(variance: FloatArray, fit: BestFit, data: Observations) -> BestFit:
    """The best fit of the law under the ``variance`` of the test (draws, rows).

    An ordinary fit adds scatter to stated uncertainties, which gives precise rows less weight than the test does.
    """
    sd = np.sqrt(1.0 / np.mean(1.0 / variance, axis=0))
    far = FAR_ABOVE * SCATTER_MEDIAN * sd / sd.min()  # the same weights, with negligible scatter
    return fit_law(fit.law, replace(data, sd_amplitude=far, sd_phase=far, sd_force=np.zeros(len(sd))))


def _count_freedom(fit: BestFit) -> int:
    return max(len(fit.n) - fit.parameters, 1)


def _measure_misfit(fit: BestFit, data: Observations, variance: FloatArray, level: Floats) -> FloatArray:
    """n^T V^-1 n (..) from the ``variance`` of rows (.., rows) and the scatter of levels (..)."""
    n, h, _ = residuals(fit.force, data)
    misfit = np.sum(n**2 / variance, axis=-1)
    for rows in data.runs if data.has_repeats and len(data.sweeps) > 1 else ():
        hh = np.sum(h[rows] ** 2 / variance[..., rows], axis=-1)
        hn = np.sum(h[rows] * n[rows] / variance[..., rows], axis=-1)
        misfit = misfit - level**2 * hn**2 / (1.0 + level**2 * hh)
    return np.asarray(misfit)


#: Rows per independent row where laws are compared: neighbours of correlation .6 are worth a quarter.
ROWS_TOGETHER = 4.0
FREE = 10.0  #: scatter of levels, relative, that leaves their gains free


def exceed_probability(fit: BestFit, best: BestFit, data: Observations) -> float:
    """p-value of an F test: misfit of this law over that of the ``best`` one.

    The gains of levels are left free: comparison between levels is in the weights of the resonances, and a level read
    wrong must exclude no law. The scatter of rows is taken from the residuals of the best law, at least that of careful
    tests. Where it is small, laws are excluded that a larger one would allow.
    """
    free, free_best = (_count_freedom(law) / ROWS_TOGETHER for law in (fit, best))
    return float(fdtrc(free, free_best, _measure_along_sweeps(fit, data) / _measure_along_sweeps(best, data)))


def _measure_along_sweeps(fit: BestFit, data: Observations) -> float:
    """Mean square residual of a law along sweeps, with free gains of levels; at least the noise of careful tests."""
    known = residuals(fit.force, data)[2]
    variance = np.where(known > 0.0, known / max(float(np.mean(known)), 1e-300), 1.0)
    misfit = float(_measure_misfit(fit, data, variance, FREE)) / _count_freedom(fit)
    return max(misfit, float(np.mean(known)), NOISE_RANGE[0] ** 2)


def is_excluded(fit: BestFit, best: BestFit, data: Observations) -> bool:
    """Whether the rows exclude a law beside the ``best`` one."""
    return exceed_probability(fit, best, data) < UNLIKELY


def _describe_hidden_offset(leader: BestFit, others: Iterable[BestFit], data: Observations) -> str:
    """The caution about levels that lie apart from another law, which fits the sweeps far better than the leader."""
    steadiest = min((leader, *others), key=lambda fit: _measure_along_sweeps(fit, data))
    return _describe_levels_apart(steadiest, data) if is_excluded(leader, steadiest, data) else ""


def _describe_levels_apart(fit: BestFit, data: Observations) -> str:
    """The caution about levels that lie apart: by how much, and which is farthest; empty where none do.

    The fitted level scatter absorbs them, so that the law fits: ln A of level l is off by -sum(h n)/sum(h^2) over its
    rows.
    """
    n, h, _ = residuals(fit.force, data)
    noise = measure_roughness(n, data)[0]
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
        f" ({100.0 * noise:.2g} %): {data.sweeps[farthest]} deviates most, its amplitudes {per_cent(abs(by))} %"
        f" {'below' if by < 0.0 else 'above'} those implied by the others. If the law is not the cause,"
        " damping gap names it"
    )


def _describe_peak(data: Observations) -> str:
    """The caution about a sweep that peaks far above its resonance, as with two modes or planes; empty without one."""
    per_force = data.A / np.hypot(data.D, data.R) / (data.tested_amplitude / data.tested_force)[data.sweep]
    at = int(np.argmax(per_force))
    if per_force[at] < PEAKED:
        return ""
    return (
        f"{data.sweeps[data.sweep[at]]} reads {100.0 * (per_force[at] - 1.0):.0f} % more amplitude per force at"
        f" {data.omega[at] / RAD_S_PER_HZ:.4g} Hz than at the resonance of one mode, which is what is predicted"
    )


def _compare_with_stated(fit: BestFit, data: Observations) -> float:
    """Noise of one row from second differences over the stated noise, if above ``UNDERSTATED``; else 0."""
    n, _, known = residuals(fit.force, data)
    ratio, differences = measure_roughness(n / np.sqrt(known), data) if np.all(known > 0.0) else (0.0, 0.0)
    return ratio if differences and ratio > UNDERSTATED else 0.0
