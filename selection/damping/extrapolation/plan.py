"""Before any prediction: which laws take part, with what weight, how much each errs beyond its data, how far to go.

1. Plausible laws: those whose marginal likelihood on the resonances alone is within a factor ``PLAUSIBLE`` of the best
   physical one. (Rows of one sweep share their error, so counting them one by one would single out a law falsely.)
2. Weights: every level with two or more below it (the highest ``MOST_HELD_OUT``) predicted from those below
   (``damping.ranking.weights``).
3. Discrepancy of each law: kappa, from all those predictions (``damping.extrapolation.near``).
4. A limit, where the law is changing at the top of the test: p rises there, and the laws that explain the lower levels
   did not foresee the highest one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.extrapolation import near as discrepancy
from damping.extrapolation.near import Trend, at_resonance, bistability, trend
from damping.infer.evidence import Estimate, Evidence, evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.ranking.candidates import candidate_laws, fit_distinct
from damping.ranking.weights import FEWEST_BELOW, HeldOut, held_out, pseudo_bma, resonance_scatter
from damping.records.resonance import number_levels

#: Bayes factor against the best law beyond which a law takes no part ("strong", Jeffreys 1961).
PLAUSIBLE = 10.0
#: Ratio of amplitudes from which on the rows of one level say how damping changes with amplitude; a sweep at constant
#: response does not.
TELLING = 1.1
#: Probability below which the highest level was not foreseen by the laws of the lower ones.
UNFORESEEN = 0.10
#: Levels held out at most, the highest ones: what lies far below the design load says little of it.
MOST_HELD_OUT = 12


@dataclass(frozen=True)
class Planned:
    """A law that takes part.

    Attributes:
        weight: share in the average. evidence: of the law on the rows near resonance. predictions: of held-out levels.
        kappa: posterior probability of each of ``discrepancy.KAPPA``.
    """

    law: Law
    weight: float
    coordinates: Coordinates
    evidence: Evidence
    predictions: tuple[HeldOut, ...]
    kappa: FloatArray

    @property
    def name(self) -> str:
        """The law's name."""
        return self.law.name


@dataclass(frozen=True)
class Change:
    """The law changes at the top of the test.

    Attributes:
        limit: largest force at which a prediction is given: half as far beyond the test, in ln F, as the highest level
            lies above the one below it. foreseen: probability that the laws of the lower levels gave to so small an
            amplitude there.
    """

    limit: float
    foreseen: float


@dataclass(frozen=True)
class Plan:
    """What predictions rest on.

    Attributes:
        data: rows near resonance. laws: by weight, largest first. held_out: number of levels held out. trend: local
            exponents. change: None where the law is not changing at the top. bistable: caution, empty where there is
            none or the mass is not known.
    """

    data: Observations
    laws: tuple[Planned, ...]
    held_out: int
    trend: Trend
    change: Change | None
    bistable: str = ""

    @property
    def limit(self) -> float:
        """Force beyond which no prediction is given; infinite where there is none."""
        return self.change.limit if self.change else np.inf


def load_candidates(data: Observations) -> list[Law]:
    """The candidates that predict differently on what laws are judged on."""
    return [fit.law for fit in fit_distinct(candidate_laws(), _judged(data))]


def plan_loads(
    data: Observations,
    laws: Sequence[Law] | None = None,
    seed: int = 0,
    done: Callable[[str], None] = lambda name: None,
    mass: float | None = None,
    estimate: Estimate = evidence,
) -> Plan:
    """Choose and weigh laws for predictions beyond the test.

    Args:
        data: rows near resonance (``near_resonance``). laws: candidates, by default ``load_candidates``. done: called
            with each candidate's name. mass: generalized mass, to see whether the mode is bistable. estimate: of
            marginal likelihoods and posteriors.

    Raises:
        AnalysisError: no candidate can carry the measured forces.
    """
    laws = load_candidates(data) if laws is None else laws
    chosen = _plausible(data, laws, seed, done, estimate)
    top = int(number_levels(data.tested_force).max())
    splits = range(max(FEWEST_BELOW, top + 1 - MOST_HELD_OUT), top + 1)
    predictions = [
        tuple(p for below in splits for p in _held_out(law, data, below, seed, estimate)) for law, _, _ in chosen
    ]
    weights = pseudo_bma(np.array([_log_densities(found, len(splits)) for found in predictions]))
    planned = [
        Planned(law, float(weight), coordinates, own, found, discrepancy.posterior(found))
        for (law, coordinates, own), found, weight in zip(chosen, predictions, weights, strict=True)
    ]
    best = max(planned, key=lambda p: p.evidence.log_z)
    exponents = trend(data, float(np.median(resonance_scatter(best.coordinates, best.evidence.draws))))
    return Plan(
        data=data,
        laws=tuple(sorted(planned, key=lambda p: -p.weight)),
        held_out=len(splits),
        trend=exponents,
        change=_change(data, laws, seed, estimate) if exponents.rising else None,
        bistable=bistability(data, mass) if mass else "",
    )


def _log_densities(predictions: Sequence[HeldOut], levels: int) -> list[float]:
    """Log predictive density of each held-out level from all below it; minus infinity where the law has none."""
    found = [discrepancy.log_density(p) for p in predictions if p.level == p.below]
    return found if len(found) == levels else [-np.inf] * levels


def _judged(data: Observations) -> Observations:
    """What laws are judged on: the resonances alone, or all rows of one level whose amplitudes differ enough."""
    one_telling = len(data.sweeps) == 1 and data.A.max() > TELLING * data.A.min()
    return data if one_telling else at_resonance(data)


def _plausible(
    data: Observations, laws: Sequence[Law], seed: int, done: Callable[[str], None], estimate: Estimate
) -> list[tuple[Law, Coordinates, Evidence]]:
    """Laws within a factor of the best, each with its evidence on all rows near resonance."""
    judged, rows, reasons = _judged(data), [], []
    for law in laws:
        try:
            rows.append(_judge(law, judged, seed, estimate))
        except AnalysisError as error:
            reasons.append(str(error))
        done(law.name)
    best = max((own.log_z for _, own in rows), default=0.0)
    chosen = []
    for law, own in rows:
        if own.log_z <= best - np.log(PLAUSIBLE):
            continue
        coordinates = Coordinates.of(law, data)
        try:
            chosen.append((law, coordinates, estimate(coordinates, data, seed) if data.has_repeats else own))
        except AnalysisError as error:
            reasons.append(str(error))
    if not chosen:
        raise AnalysisError("no damping law could be fitted: " + "; ".join(reasons))
    return chosen


def _judge(law: Law, data: Observations, seed: int, estimate: Estimate) -> tuple[Law, Evidence]:
    """A law's evidence."""
    if not law.has_resonance:
        raise AnalysisError(f"{law.name}: friction alone sets no resonant amplitude")
    return law, estimate(Coordinates.of(law, data), data, seed)


def _held_out(law: Law, data: Observations, below: int, seed: int, estimate: Estimate) -> tuple[HeldOut, ...]:
    """Predictions of the higher levels; none where the law cannot carry the lower ones."""
    try:
        return held_out(law, data, below, seed, estimate)
    except AnalysisError:
        return ()


def _change(data: Observations, laws: Sequence[Law], seed: int, estimate: Estimate) -> Change | None:
    """Whether the laws of the lower levels, by their own evidence there, foresaw the highest."""
    levels = number_levels(data.tested_force)
    top = int(levels.max())
    fits = [p for law in laws if law.has_resonance for p in _held_out(law, data, top, seed, estimate)]
    weights = softmax(np.array([p.log_z for p in fits]))
    foreseen = float(sum(w * p.probability_below() for w, p in zip(weights, fits, strict=True)))
    if foreseen >= UNFORESEEN:
        return None
    highest, next_highest = data.tested_force.max(), data.tested_force[levels == top - 1].max()
    return Change(float(highest * np.sqrt(highest / next_highest)), foreseen)
