"""The plan of a prediction, made on the rows near resonance and judged on every row of the sweeps.

It says whether the law changes at the top of the test (local exponent p = d ln F/d ln A from level to level), which
laws are averaged with what weights, and how far beyond the test predictions are given.

Weights are posterior probabilities on the rows near resonance, by the same evidence that ranks. It allows for a
discrepancy (:mod:`damping.infer.discrepancy`), so that levels do not carry more weight than their information.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import BoolArray, Floats
from damping.extrapolation.levels import Trend, describe_state, expect_scatter, find_trend, read_resonances
from damping.infer.best_fit import BestFit, fit_law, fit_laws
from damping.infer.discrepancy import ANY_JOINT, JOINTS, JointEvidence
from damping.infer.evidence import Estimate, evidence
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.progress import nothing
from damping.ranking import Candidate, Ranking, weigh_laws
from damping.ranking.candidates import resonant_laws
from damping.ranking.verdict import FitVerdict, is_excluded, judge_fit
from damping.records.mode import Mode, Units

ENOUGH_LEVELS = 3  #: fewest levels for predictions beyond ``NEAREST`` times the largest tested force
NEAREST = 1.5  #: largest force, over the largest tested force, that fewer levels allow
ROUNDING = 1e-3  #: relative excess of a force over the limit that still counts as the limit


@dataclass(frozen=True)
class Plan:
    """Laws, weights and limits of a prediction."""

    data: Observations  #: rows near resonance
    laws: tuple[Candidate, ...]  #: by weight on these rows, largest first
    trend: Trend  #: local exponents
    limit: float  #: force beyond which predictions are refused; infinite if there is none
    fit: FitVerdict  #: whether the leading law fits the levels
    bistable: str = ""  #: caution, empty if there is none or the mass is unknown
    joint: JointEvidence = ANY_JOINT  #: evidence of the levels' frequencies for a slipping joint
    excluded: str = ""  #: laws that rows away from resonance contradict
    state: str = ""  #: the mass for which predictions hold, if the levels had several
    units: Units | None = None

    @property
    def described_limit(self) -> str:
        """The limit with the name of its quantity, and its unit if that is known."""
        units = self.units or Units()
        return f"{units.drive} {self.limit:.4g} {units.force}".rstrip()

    def allows(self, force: Floats) -> BoolArray:
        """Whether predictions are given at a force, or at each of several, with the margin ``ROUNDING``."""
        return np.asarray(force <= self.limit * (1.0 + ROUNDING))


def find_repeatability(mode: Mode | None) -> float:
    """Stated relative standard uncertainty of a level's amplitude; 0 if unknown."""
    return (mode and mode.repeatability.amplitude) or 0.0


def plan_loads(
    data: Observations,
    laws: Sequence[Law],
    seed: int = 0,
    done: Callable[[str], None] = nothing,
    mode: Mode | None = None,
    estimate: Estimate = evidence,
    ranking: Ranking | None = None,
) -> Plan:
    """Choose and weigh laws for predictions beyond the test.

    Args:
        data: rows near resonance (``near_resonance``).
        laws: candidates.
        done: called with each candidate's name.
        mode: its mass shows whether the mode is bistable and whether a joint slips.
        estimate: of marginal likelihoods and posteriors.
        ranking: of the same candidates by the same seed and estimate, if already made; it serves if its rows are these.

    AnalysisError: no candidate can carry the measured forces.
    """
    if ranking and ranking.ranks(data) and not data.amplitude_is_input:
        ranked = ranking
    else:
        resonating = [law for law in laws if law.has_resonance]  # for a decay, friction alone may be ranked
        ranked = weigh_laws(data, seed, resonating or laws, done, estimate)
    data = ranked.data
    planned = tuple(row for row in ranked.candidates if row.evidence)
    scatter = np.hypot(*planned[0].coordinates.scatter(planned[0].weighed.draws))
    stated = float(np.sqrt(find_repeatability(mode) ** 2 + np.mean(data.sd_amplitude**2 + data.sd_force**2)))
    few = data.levels.max() + 1 < ENOUGH_LEVELS
    bistable, joint = read_resonances(data, mode) if mode else ("", ANY_JOINT)
    exponents = find_trend(data, float(np.median(scatter)), expect_scatter(stated))
    if joint.informative and joint.probability < JOINTS:
        joint = joint._replace(failing=exponents.failing)
    return Plan(
        data=data,
        laws=planned,
        trend=exponents,
        limit=float(NEAREST * data.tested_force.max()) if few else np.inf,
        fit=ranked.fit,
        bistable=bistable,
        joint=joint,
        state=describe_state(data, mode) if mode else "",
        units=mode.units if mode else None,
    )


LEAST_SAID = 0.05  #: weight above which an excluded law is named


def judge_rows(plan: Plan, all_rows: Observations, seed: int = 0, estimate: Estimate = evidence) -> Plan:
    """The plan judged on ``all_rows`` too; ``seed``: of the scatters that p-values are averaged over.

    A law that misses rows which other laws fit is replaced by one of the same predictions at resonance that fits them,
    and left out if there is none. The verdict on all rows replaces that on the resonances where the leading law does
    not fit all rows, or where these scatter by more than the stated noise. All rows also show which levels lie apart.
    """
    if len(all_rows.A) == len(plan.data.A):
        return plan
    laws = [member.law for member in plan.laws] + resonant_laws()
    fits = {fit.law: fit for fit in fit_laws(laws, all_rows) if isinstance(fit, BestFit)}
    best = min(fits.values(), key=lambda fit: fit.squares)
    missing, kept = list[Candidate](), list[Candidate]()
    for member in plan.laws:
        equal = [fits[law] for law in (member.law, *map(Law.named, member.equivalents)) if law in fits]
        allowed = [fit for fit in equal if not is_excluded(fit, best, all_rows)]
        if equal and not allowed:
            missing.append(member)
        else:
            kept.append(_replace_by_equal(allowed, member, plan.data, seed, estimate))
    leader = next((fits[member.law] for member in kept if member.law in fits), best)
    others = [fit for fit in fits.values() if fit is not leader]
    on_rows = replace(judge_fit(leader, others, all_rows, seed), by_resonances=True)
    fit = plan.fit
    if on_rows.verdict != "fits" or on_rows.rough:
        fit = on_rows
    elif fit.verdict != "none fits" and kept and kept[0] is not plan.laws[0]:
        fit = _judge_laws([member.law for member in kept], plan.data, seed)
    if fit.verdict == "none fits":
        return replace(plan, fit=fit)
    plan = replace(plan, fit=replace(fit, level_caution=on_rows.level_caution or fit.level_caution))
    if not kept:
        return plan
    total = sum(member.weight for member in kept)
    names = ", ".join(f"{member.name} ({member.weight:.2f})" for member in missing if member.weight > LEAST_SAID)
    note = f"laws left out, since rows away from resonance contradict them (weight by resonances alone): {names}"
    rescaled = tuple(replace(member, weight=member.weight / total) for member in kept)
    return replace(plan, laws=rescaled, excluded=note if names else "")


def _replace_by_equal(
    allowed: Sequence[BestFit], member: Candidate, data: Observations, seed: int, estimate: Estimate
) -> Candidate:
    """``member``, or, if it is not ``allowed``, the shortest of its equals that is, fitted to the same resonances."""
    if not allowed or any(fit.law == member.law for fit in allowed):
        return member
    law = min(allowed, key=lambda fit: (len(fit.law.parts), fit.squares)).law
    fit = fit_law(law, data)
    drawn = estimate(fit.coordinates, data, seed, fit)
    return replace(member, law=law, fit=fit, evidence=drawn)


def _judge_laws(laws: Sequence[Law], data: Observations, seed: int) -> FitVerdict:
    """The verdict on the first of ``laws``, with the others as alternatives."""
    leader, *others = [fit for fit in fit_laws(laws, data) if isinstance(fit, BestFit)]
    return judge_fit(leader, others, data, seed)
