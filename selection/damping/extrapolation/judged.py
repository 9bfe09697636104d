"""A plan, made on the resonances alone, judged on every row of the sweeps: its verdict, and which laws take part."""

from collections.abc import Sequence
from dataclasses import replace

from damping.extrapolation.near import Plan
from damping.infer.best_fit import BestFit, fit_law, fit_laws
from damping.infer.evidence import Estimate, evidence
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.ranking import Candidate
from damping.ranking.candidates import resonant_laws
from damping.ranking.verdict import FitVerdict, is_excluded, judge_fit

#: Weight above which an excluded law is named.
LEAST_SAID = 0.05


def judge_rows(plan: Plan, all_rows: Observations, seed: int = 0, estimate: Estimate = evidence) -> Plan:
    """The plan judged on ``all_rows`` too; ``seed``: of the scatters that p-values are averaged over.

    Its verdict is that of all rows where the leading law does not fit them, even if it fits the resonances. A law that
    misses rows which other laws fit yields to one that equals it at resonance, or, where all of these miss them too, is
    left out. The scatter of the rows shows which levels lie apart; if it exceeds the stated noise, the verdict of the
    rows replaces that of the resonances.
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
            kept.append(_yield_to(allowed, member, plan.data, seed, estimate))
    leader = next((fits[member.law] for member in kept if member.law in fits), best)
    on_rows = judge_fit(leader, [fit for fit in fits.values() if fit is not leader], all_rows, seed)
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


def _yield_to(
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
