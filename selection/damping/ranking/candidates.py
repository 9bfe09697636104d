"""The laws that compete: which of them predict the same, how far they err fitted and held out, and whether any fits.

Weights only compare laws with each other: they add to one on noise, too. Two tests of the residuals n of a best fit,
whose smaller probability, doubled (Bonferroni), is the p-value:

- size: T = n^T V^-1 n against chi-square, averaged over what is known of the scatter in V = diag(s^2) + s_l^2 h h^T
  (predictive check of Gelman, Meng and Stern 1996, with the scatter's own prior in place of a posterior that the misfit
  would inflate). s is the stated uncertainty, else drawn from the prior, and no less than what the second differences
  along the sweeps show, which no smooth misfit moves;
- runs: the number of runs of one sign along the sweeps (Wald and Wolfowitz 1940), few where a misfit is smooth; asked
  where the misfit is larger than a few per cent, which is what laws of a few terms leave on real structures.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.special import chdtrc, ndtr

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError
from damping.forces import CATALOGUE
from damping.forces.contract import Force
from damping.infer.best_fit import BestFit, build_force, fit_laws
from damping.infer.law import SCATTER_LOG_SD, SCATTER_MEDIAN, Law
from damping.infer.likelihood import residuals
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude

#: Terms of a law, at most: a fourth is never needed to describe a few levels, and never told from three.
MAX_TERMS = 3
#: Two laws are equivalent where their best predictions differ by less than this share of the noise ...
INDISTINCT = 0.1
#: ... at every row and at this multiple of the largest tested force.
BEYOND = 1.5
#: Range of what counts as noise where the record does not state it, relative: that of repeat tests of large structures.
NOISE_RANGE = (0.003, 0.07)
#: Relative noise of a row where few rows tell it: of repeat tests of large structures, so that laws whose difference no
#: further test of that kind would show count as equal.
NOISE = 0.02


def candidate_laws(named: Iterable[Law] = ()) -> list[Law]:
    """Every sum of up to ``MAX_TERMS`` forces of the library, and each power law alone; the same for every record.

    ``named``: further laws that somebody asks for.
    """
    terms = [name for name, kind in CATALOGUE.items() if kind.sums]
    sums = [Law(names) for size in range(1, MAX_TERMS + 1) for names in combinations(terms, size)]
    laws = [*sums, *(Law((name,)) for name, kind in CATALOGUE.items() if not kind.sums)]
    known = {frozenset(law.components) for law in laws}
    return [*laws, *(law for law in named if frozenset(law.components) not in known)]


def load_candidates(data: Observations) -> list[Law]:
    """The candidates that predict loads differently on rows near resonance, of each kind the one with fewest terms.

    There may be none.
    """
    tried = fit_laws([law for law in candidate_laws() if law.has_resonance], data)
    fits = [fit for fit in tried if isinstance(fit, BestFit) and np.isfinite(fit.squares)]
    return [group[0].law for group in group_equivalents(fits, data, learn_noise(fits, data))] if fits else []


def learn_noise(fits: Sequence[BestFit], data: Observations) -> FloatArray:
    """Relative noise of each row (rows,): as the record states it, else by the fit that leaves least.

    The latter is s^2 = (s_0^2 + n^T n)/(1 + rows - parameters), one prior observation of scatter ``NOISE``, within
    ``NOISE_RANGE``.
    """
    finite = (f for f in fits if np.isfinite(f.squares))
    scatter = min(np.sqrt((NOISE**2 + f.n @ f.n) / (1.0 + max(len(f.n) - f.parameters, 0))) for f in finite)
    learnt = np.full(len(data.A), float(np.clip(scatter, *NOISE_RANGE)))
    stated = np.hypot(data.sd_amplitude, np.hypot(data.sd_phase, data.sd_force))
    return np.where(stated > 0.0, stated, learnt)


def group_equivalents(fits: Sequence[BestFit], data: Observations, noise: FloatArray) -> list[list[BestFit]]:
    """Laws that predict the same, the one with fewest terms (then first) leading its group.

    Two laws are of one group where their best predictions differ by less than ``INDISTINCT`` of the noise at every row
    and at ``BEYOND`` times the largest tested force: a further term that changes nothing does not make another law.
    """
    omega, force = data.tested_omega[data.top], BEYOND * data.tested_force[data.top]
    order = sorted(fits, key=lambda fit: len(fit.law.parts))
    n = np.array([fit.n for fit in order])
    beyond: dict[int, float] = {}

    def predict_beyond(i: int) -> float:
        if i not in beyond:
            beyond[i] = float(np.log(resonant_amplitude(order[i].force, force, omega)))
        return beyond[i]

    groups: dict[int, list[BestFit]] = {}
    for i, fit in enumerate(order):
        leaders = np.array([*groups], int)
        on_rows = leaders[np.all(np.abs(n[leaders] - n[i]) < INDISTINCT * noise, axis=1)]
        for leader in on_rows.tolist():
            ends = predict_beyond(i), predict_beyond(leader)
            if abs(ends[0] - ends[1]) < INDISTINCT * noise.max() or bool(np.isnan(ends).all()):
                groups[leader].append(fit)
                break
        else:
            groups[i] = [fit]
    return list(groups.values())


#: Times that a law is fitted without some of the sweeps, at most.
MOST_FOLDS = 20


def percent_errors(force: Force, data: Observations) -> FloatArray:
    """100 (predicted/measured - 1) of the resonant amplitude of each sweep at its tested force, (sweeps,).

    Where the force has no resonance at a tested force the error is NaN. Of a free decay, where amplitude is the input,
    it is the error of the force at the tested amplitude.
    """
    if data.amplitude_is_input:  # a decay: its force is what a law predicts
        tested = force.quadrature(data.tested_amplitude, data.tested_omega)
        return 100.0 * (np.asarray(tested) / data.tested_force - 1.0)
    amplitude = resonant_amplitude(force, data.tested_force, data.tested_omega)
    return 100.0 * (amplitude / data.tested_amplitude - 1.0)


def held_out_errors(laws: Sequence[Law], data: Observations) -> list[FloatArray | None]:
    """Percent errors of each sweep predicted by each law fitted to all other sweeps, (sweeps,).

    None of a law that cannot carry the forces of the other sweeps. More than ``MOST_FOLDS`` sweeps are left out in as
    many groups, neighbours in the record in different ones.
    """
    folds = min(len(data.sweeps), MOST_FOLDS)
    fold = np.arange(len(data.sweeps)) % folds
    fits = fit_laws(laws, *(data.keep_sweeps(fold != out) for out in range(folds)))
    return [_predict_left_out(law, fits[i :: len(laws)], fold, data) for i, law in enumerate(laws)]


def _predict_left_out(
    law: Law, fits: Sequence[BestFit | AnalysisError], fold: IntArray, data: Observations
) -> FloatArray | None:
    """Percent errors of all sweeps at once, (sweeps,): each by the fit without its ``fold`` (sweeps,)."""
    fitted = [fit for fit in fits if isinstance(fit, BestFit)]
    if len(fitted) < len(fits):
        return None
    coefficients = np.array([fit.coefficients for fit in fitted])[fold].T
    shapes = [
        {name: np.array([own[name] for own in part])[fold] for name in part[0]}
        for part in zip(*(fit.shapes for fit in fitted), strict=True)
    ]
    return percent_errors(build_force(law, coefficients, shapes), data)


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
#: Levels lie apart where they scatter by this times the noise of one row: of 325 sweeps of structures in and out of the
#: library whose levels are exact, 1 does (with the next).
BEYOND_ROWS = 5.0
#: and, ln A, by this at least: repeats of one level on large structures scatter by less.
LEVELS_APART = 0.03
FEWEST_LEVELS = 3  #: of two, neither is the one that is off


@dataclass(frozen=True)
class FitVerdict:
    """Whether the leading law fits.

    Attributes:
        verdict: ``fits`` (p >= .01), ``none fits`` (p < .01 for every candidate), ``poor`` between.
        p_value: of the leading law. misfit: root mean square of its residuals, per cent of amplitude.
        apart: what is said of levels that scatter about the leading law far more than their rows do; empty if none do.
    """

    verdict: Verdict
    p_value: float
    misfit: float
    apart: str = ""

    @property
    def sentence(self) -> str:
        """The verdict as an engineer would say it; empty where the law fits and no level lies apart."""
        by = f"misses the measured rows by {self.misfit:.2g} % (root mean square), p = {self.p_value:.2g}"
        said = {
            "fits": "",
            "poor": f"the leading law fits poorly: it {by}; a law of less weight fits",
            "none fits": f"no law fits: the leading law {by}",
        }
        return "; ".join(filter(None, [said[self.verdict], self.apart]))


def judge_fit(leader: BestFit, others: Iterable[BestFit], data: Observations, seed: int = 0) -> FitVerdict:
    """The verdict on the leading law, with the others asked where it does not fit."""
    p = fit_probability(leader, data, seed)
    verdict: Verdict = "fits"
    if p < UNLIKELY:
        another = any(fit_probability(fit, data, seed) >= UNLIKELY for fit in others)
        verdict = "poor" if another else "none fits"
    misfit = 100.0 * float(np.sqrt(np.mean(leader.n**2)))
    return FitVerdict(verdict, p, misfit, _describe_levels_apart(leader, data))


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
        f"levels scatter about the leading law by {100.0 * scatter:.2g} %, {scatter / noise:.0f} times their rows"
        f" ({100.0 * noise:.2g} %): {data.sweeps[farthest]} is farthest off, its amplitudes {abs(by):.2g} %"
        f" {'below' if by < 0.0 else 'above'} what the others imply; damping gap names what is wrong, if not the law"
    )


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
