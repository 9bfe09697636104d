"""Ranking of all distinct damping laws, best first, with a verdict whether any fits.

Candidates are every sum of up to ``MAX_TERMS`` forces of the library, the power laws, and a joint that yields gradually
beside viscous damping, for any record. Laws with the same predictions on a record are one entry (``equivalents``) and
share one prior mass. Each further term halves the prior probability of a number of terms, which the distinct laws of
that number share equally. With the priors of :mod:`damping.infer.law` and coefficients >= 0,

    score = -2 ln(evidence x prior),      weight = posterior probability ~ exp(-score/2).
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import softmax

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.infer.best_fit import BestFit, fit_laws
from damping.infer.evidence import Estimate, evidence
from damping.infer.importance import Evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.progress import nothing
from damping.ranking.along_sweeps import count_together
from damping.ranking.candidates import (
    Coefficient,
    candidate_laws,
    describe_tails,
    group_equivalents,
    held_out_errors,
    percent_errors,
    tabulate_coefficients,
)
from damping.ranking.verdict import FitVerdict, judge_fit
from damping.records.text import count

CRITERION = "-2 ln(evidence x prior), coefficients >= 0; each further term half as probable, its laws alike"
#: Prior probability of a number of terms over that of one term fewer. On structures of known law, bands are then
#: closest to those fitted with that law.
FURTHER = 0.5
#: Weight below which sampling of a law stops: its numbers are then rough, those of other laws are not.
NEGLIGIBLE = 1e-3
#: Effective draws for the coefficient of a power law, whose posterior has a long tail along the exponent. On three
#: levels the upper end of its interval is 3 % too low with these and differs by 4 % from seed to seed; with the draws
#: of its evidence it was 15 % and 20 %.
POWER_DRAWS = 5000.0
#: Effective draws below which a marginal likelihood is reported as uncertain: its standard error exceeds 7 %.
FEW_DRAWS = 200
#: Distance of a fitted shape from an end of its range below which it is reported to be at the edge.
EDGE = 0.01


@dataclass(frozen=True)
class Candidate:
    """A law's row of the table; missing numbers are NaN."""

    law: Law
    rank: int | None = None  #: 1 is best; None where the candidate could not be fitted
    coefficients: tuple[Coefficient, ...] = ()
    score: float = np.nan  #: see the module
    weight: float = 0.0  #: see the module
    #: root mean square percent error of resonant amplitudes, each predicted from other levels
    held_out_error: float = np.nan
    average_absolute_percent: float = np.nan  #: mean absolute percent error of resonant amplitudes as fitted
    physical: bool = False  #: whether all coefficients are >= 0, true of every fit here
    cautions: tuple[str, ...] = ()
    equivalents: tuple[str, ...] = ()  #: names of laws with the same predictions
    fit: BestFit | None = None
    evidence: Evidence | None = None

    @property
    def name(self) -> str:
        """The law's name."""
        return self.law.name

    @property
    def fitted(self) -> BestFit:
        """The best fit of a law that could be fitted, as every law with a score."""
        assert self.fit is not None
        return self.fit

    @property
    def weighed(self) -> Evidence:
        """The evidence of a law with a score."""
        assert self.evidence is not None
        return self.evidence

    @property
    def coordinates(self) -> Coordinates:
        """The map from standard normal variables to parameters, of a law that could be fitted."""
        return self.fitted.coordinates


@dataclass(frozen=True)
class Ranking:
    """All distinct laws, best first, those that could not be fitted last; ``fit``: verdict on the leading one."""

    criterion: str
    candidates: tuple[Candidate, ...]
    data: Observations
    fit: FitVerdict

    def weighted(self, least: float = 0.0) -> tuple[Candidate, ...]:
        """Candidates with a weight above ``least``."""
        return tuple(c for c in self.candidates if c.weight > least)

    def ranks(self, data: Observations) -> bool:
        """Whether the ranking is of these rows."""
        return self.data.sampled.content == replace(data, together=self.data.together).sampled.content

    def find(self, law: Law) -> Candidate:
        """The row of a law, or of its equivalent. KeyError if it is no candidate."""
        for candidate in self.candidates:
            if set(candidate.law.components) == set(law.components) or law.name in candidate.equivalents:
                return candidate
        raise KeyError(law.name)


def rank_laws(
    data: Observations,
    seed: int = 0,
    laws: Sequence[Law] | None = None,
    done: Callable[[str], None] = nothing,
    estimate: Estimate = evidence,
    hold_out: bool = True,
    power_draws: float = POWER_DRAWS,
) -> Ranking:
    """Fit and rank candidates.

    Args:
        laws: the candidates; by default :func:`candidate_laws`.
        done: called with each candidate's name.
        estimate: of the marginal likelihood.
        hold_out: whether to compute held-out errors; else they are NaN.
        power_draws: effective draws for the coefficient of a power law; 0: those of its evidence.

    AnalysisError: no candidate could be fitted.
    """
    ranking = weigh_laws(data, seed, candidate_laws() if laws is None else laws, done, estimate)
    data = ranking.data  # which tells how many rows count as one
    ranked = [row for row in ranking.candidates if row.rank]
    held_out = _hold_levels_out([row.law for row in ranked], data) if hold_out else [(np.nan, ())] * len(ranked)
    drawn = [_draw(row, data, seed, power_draws) for row in ranked]
    described = [_describe(row, data, x, *out) for row, x, out in zip(ranked, drawn, held_out, strict=True)]
    return replace(ranking, candidates=(*described, *ranking.candidates[len(ranked) :]))


def weigh_laws(
    data: Observations,
    seed: int,
    laws: Sequence[Law],
    done: Callable[[str], None] = nothing,
    estimate: Estimate = evidence,
) -> Ranking:
    """Rank candidates as in `rank_laws`, without their coefficients and errors."""
    fits, failed = _fit_laws(laws, data)
    for row in failed:
        done(row.name)
    if fits and data.together == 1.0:  # else it is known from more laws
        closest = min(fits, key=lambda fit: fit.squares)
        data = replace(data, together=count_together(closest, data))
    groups = group_equivalents(fits, data) if fits else []
    rows = _weigh(groups, data, seed, done, estimate)
    ranked = sorted((row for row in rows if np.isfinite(row.score)), key=lambda row: row.score)
    if not ranked:
        reasons = "; ".join(c for row in rows or failed for c in row.cautions)
        raise AnalysisError(f"no damping law could be fitted: {reasons}")
    weights = softmax([-0.5 * row.score for row in ranked])
    ranked = [replace(row, rank=k, weight=float(w)) for k, (row, w) in enumerate(zip(ranked, weights, strict=True), 1)]
    best = [row.fitted for row in ranked]
    unranked = [row for row in rows if not np.isfinite(row.score)]
    return Ranking(CRITERION, (*ranked, *unranked, *failed), data, judge_fit(best[0], best[1:], data, seed))


def prior_masses(laws: Sequence[Law]) -> list[float]:
    """Prior probability of each law: a factor ``FURTHER`` per further term, shared by the laws of that number."""
    sizes = Counter(len(law.parts) for law in laws)
    total = sum(FURTHER**size for size in sizes)
    return [FURTHER ** len(law.parts) / (total * sizes[len(law.parts)]) for law in laws]


def _fit_laws(laws: Sequence[Law], data: Observations) -> tuple[list[BestFit], list[Candidate]]:
    """The best fit of every law that can be fitted, and rows with the reason why others cannot."""
    fits, failed = [], []
    for law, fit in zip(laws, fit_laws(laws, data), strict=True):
        if not (law.has_resonance or data.amplitude_is_input):
            failed.append(Candidate(law, cautions=("friction alone sets no resonant amplitude",)))
        elif not isinstance(fit, BestFit):
            failed.append(Candidate(law, cautions=(str(fit),)))
        elif not np.isfinite(fit.squares):
            failed.append(Candidate(law, cautions=(f"{law.name}: no coefficient reproduces the measured forces",)))
        else:
            fits.append(fit)
    return fits, failed


def _weigh(
    groups: Sequence[Sequence[BestFit]],
    data: Observations,
    seed: int,
    done: Callable[[str], None],
    estimate: Estimate,
) -> list[Candidate]:
    """The row of each group of equivalent laws with its score; an AnalysisError becomes a caution.

    Laws that fit best come first, so that ``NEGLIGIBLE`` ones are recognised early.
    """
    prior = np.log(prior_masses([group[0].law for group in groups]))
    misfit = [round(group[0].squares, 3) + len(group[0].law.parts) for group in groups]  # an order independent of units
    rows, best = dict[int, Candidate](), -np.inf
    for i in sorted(range(len(groups)), key=misfit.__getitem__):
        fit, names = groups[i][0], tuple(other.law.name for other in groups[i][1:])
        try:
            weighed = estimate(fit.coordinates, data, seed, fit, best + np.log(NEGLIGIBLE) - prior[i])
        except AnalysisError as error:
            rows[i] = Candidate(fit.law, cautions=(str(error),), equivalents=names)
        else:
            score = -2.0 * float(weighed.log_z + prior[i])
            best = max(best, -0.5 * score)
            rows[i] = Candidate(fit.law, score=score, physical=True, equivalents=names, fit=fit, evidence=weighed)
        for name in (fit.law.name, *names):
            done(name)
    return [rows[i] for i in range(len(groups))]


def _draw(row: Candidate, data: Observations, seed: int, power_draws: float) -> FloatArray:
    """Posterior draws for the coefficients of a law: those of its evidence, or ``power_draws`` for a power law."""
    if power_draws and row.weight > NEGLIGIBLE and not all(part.example.sums for part in row.law.parts):
        return evidence(row.coordinates, data, seed, row.fit, wanted=power_draws).draws
    return row.weighed.draws


def _describe(
    row: Candidate, data: Observations, x: FloatArray, held_out: float, held_out_cautions: tuple[str, ...]
) -> Candidate:
    """The row with coefficients from posterior draws x, errors and cautions; ``held_out_cautions``: about its error."""
    coefficients = tabulate_coefficients(row.coordinates, x)
    return replace(
        row,
        coefficients=coefficients,
        held_out_error=held_out,
        average_absolute_percent=float(np.mean(np.abs(percent_errors(row.fitted.force, data)))),
        cautions=(*_list_cautions(row, data), *describe_tails(coefficients), *held_out_cautions),
    )


@np.errstate(over="ignore")  # an amplitude that overflows has an infinite error
def _hold_levels_out(laws: Sequence[Law], data: Observations) -> list[tuple[float, tuple[str, ...]]]:
    """Held-out error of each law in per cent, or NaN with the reason."""
    if len(data.sweeps) < 2:
        return [(np.nan, ("one level: nothing to hold out",))] * len(laws)
    failed = np.nan, ("with a level left out it cannot reach the other forces",)
    errors = held_out_errors(laws, data)
    return [failed if error is None else (float(np.sqrt(np.mean(error**2))), ()) for error in errors]


def _list_cautions(row: Candidate, data: Observations) -> tuple[str, ...]:
    """Cautions about the numbers of the row."""
    cautions = []
    freedom = len(data.A) - len(row.law.parts) - len(row.law.free_shapes)
    if freedom < 3:
        degrees = f"{count(freedom, 'degree')} of freedom" if freedom >= 0 else "more parameters than points"
        cautions.append(f"{count(len(data.A), 'point')}, {degrees}: the spread depends on the prior")
    fitted = [value for shapes in row.fitted.shapes for value in shapes.values()]
    for (name, shape), value in zip(row.law.free_shapes.items(), fitted, strict=True):
        edges = shape.prior.range if shape.prior else None
        if edges is not None and not edges[0] + EDGE < value < edges[1] - EDGE:
            cautions.append(f"{name} is at the edge of its range")
    if (levels := int(data.levels.max()) + 1) < 3:
        cautions.append(f"{count(levels, 'level')}: amplitude dependence hardly tested")
    if row.weight < NEGLIGIBLE and row.weighed.effective_draws < FEW_DRAWS:
        cautions.append("negligible weight, so few draws: its numbers are rough")
    elif row.weighed.effective_draws < FEW_DRAWS:
        doubt = 200 * row.weighed.standard_error
        cautions.append(f"marginal likelihood uncertain by {doubt:.0f} % (2 standard errors)")
    return tuple(cautions)
