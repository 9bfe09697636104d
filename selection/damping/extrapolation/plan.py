"""Before any prediction: which laws take part, with what weight, and how far to go.

Weights are posterior probabilities on the rows near resonance, the same evidence that ranks: straying exponents are in
it (:mod:`damping.infer.doubt`), so that levels do not count as more than they know.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import softmax

from damping.arrays import BoolArray, FloatArray
from damping.errors import AnalysisError
from damping.extrapolation.near import Trend, describe_bistability, trend
from damping.infer.best_fit import BestFit, fit_laws
from damping.infer.doubt import JOINTS, find_joint_probability
from damping.infer.evidence import Estimate, evidence
from damping.infer.importance import Evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.ranking import prior_masses
from damping.ranking.candidates import candidate_laws, fit_distinct
from damping.ranking.verdict import FitVerdict, judge_fit
from damping.records.resonance import number_levels

#: Levels from which on predictions go farther than ``NEAREST`` times the largest tested force.
ENOUGH_LEVELS = 3
#: Times the largest tested force that fewer levels allow.
NEAREST = 1.5
#: Relative excess of a force over the limit that still counts as the limit.
ROUNDING = 1e-3


@dataclass(frozen=True)
class Planned:
    """A law that takes part: its share in the average and its evidence on the rows near resonance."""

    law: Law
    weight: float
    coordinates: Coordinates
    evidence: Evidence

    @property
    def name(self) -> str:
        """The law's name."""
        return self.law.name


@dataclass(frozen=True)
class Plan:
    """What predictions rest on.

    Attributes:
        data: rows near resonance. laws: by weight, largest first. trend: local exponents. limit: force beyond which no
            prediction is given; infinite where there is none. fit: whether the leading law fits the levels.
            bistable: caution, empty where there is none or the mass is not known. joint: probability that what
            dissipates slips, by the frequencies of the levels.
    """

    data: Observations
    laws: tuple[Planned, ...]
    trend: Trend
    limit: float
    fit: FitVerdict
    bistable: str = ""
    joint: float = JOINTS

    def allows(self, force: FloatArray) -> BoolArray:
        """Whether predictions are given at each force (forces,); measured forces are not round numbers."""
        return np.asarray(force <= self.limit * (1.0 + ROUNDING))


def load_candidates(data: Observations) -> list[Law]:
    """The candidates that predict differently on the rows near resonance."""
    return [fit.law for fit in fit_distinct(candidate_laws(), data)]


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
    chosen, reasons, fits = [], [], {}
    laws = load_candidates(data) if laws is None else laws
    for law, fit in zip(laws, fit_laws(laws, data), strict=True):
        if not isinstance(fit, AnalysisError):
            fits[law] = fit
        try:
            chosen.append(_judge(law, data, seed, estimate, fit))
        except AnalysisError as error:
            reasons.append(str(error))
        done(law.name)
    if not chosen:
        raise AnalysisError("no damping law could be fitted: " + "; ".join(reasons))
    prior = np.log(prior_masses([c.law for c, _ in chosen]))
    weights = softmax(np.array([own.log_z for _, own in chosen]) + prior)
    planned = [Planned(c.law, float(w), c, own) for (c, own), w in zip(chosen, weights, strict=True)]
    best = max(planned, key=lambda p: p.weight)
    few = number_levels(data.tested_force).max() + 1 < ENOUGH_LEVELS
    return Plan(
        data=data,
        laws=tuple(sorted(planned, key=lambda p: -p.weight)),
        trend=trend(data, float(np.median(np.hypot(*best.coordinates.scatter(best.evidence.draws))))),
        limit=float(NEAREST * data.tested_force.max()) if few else np.inf,
        fit=judge_fit(fits[best.law], (fits[p.law] for p in planned), data, seed),
        bistable=describe_bistability(data, mass) if mass else "",
        joint=find_joint_probability(data.tested_amplitude, data.tested_force, data.tested_omega, mass),
    )


def _judge(
    law: Law, data: Observations, seed: int, estimate: Estimate, fit: BestFit | AnalysisError
) -> tuple[Coordinates, Evidence]:
    """A law's evidence on the rows near resonance."""
    if isinstance(fit, AnalysisError):
        raise fit
    if not law.has_resonance:
        raise AnalysisError(f"{law.name}: friction alone sets no resonant amplitude")
    coordinates = Coordinates.of(law, data)
    return coordinates, estimate(coordinates, data, seed, fit)
