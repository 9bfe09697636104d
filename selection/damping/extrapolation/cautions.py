"""Cautions on a prediction: why there is none, and what the tested levels do not show."""

from collections.abc import Iterable, Sequence

import numpy as np

from damping.extrapolation.plan import ENOUGH_LEVELS, NEAREST, ROUNDING, Plan
from damping.infer.discrepancy import LIKELY
from damping.infer.observations import Observations

_WORDS = {2: "two", 3: "three", 4: "four"}

REFUSAL = "no prediction"  #: beginning of a caution that says why there is no prediction
#: Caution beyond a test without nonlinearity: on dampers that saturate just above it, and on parts that begin to rub
#: there, such bands held 2 of 43 next tests at four times the largest force; of linear modes 56 of 61.
STAYS_LINEAR = (
    "linear laws have most of the weight and are continued beyond the test: damping that saturates, or sets in, there "
    "is not allowed for"
)
#: Largest predicted amplitude over the largest tested one, and largest ratio of the ends of a band: three decades,
#: where tests seldom span one.
NOTHING_KNOWN = 1000.0
#: Why there is no prediction beyond it.
UNKNOWN = (
    f"{REFUSAL}: nothing is known there (an amplitude over {NOTHING_KNOWN:g} times the largest tested one, or a band "
    "whose ends lie as far apart)"
)
#: Beginning of the caution that a prediction is beyond the largest tested force or amplitude.
BEYOND_TEST = "beyond the test"


def find_refusal(cautions: Iterable[str]) -> str:
    """Why there is no prediction, of its cautions; empty if none says so."""
    return next((caution for caution in cautions if caution.startswith(REFUSAL)), "")


def list_cautions(
    force: float,
    amplitude: float,
    data: Observations,
    weights: Sequence[float],
    plan: Plan | None,
    without: tuple[float, float] = (0.0, 0.0),
    unknown: np.bool_ | bool = False,
) -> tuple[str, ...]:
    """Cautions on the prediction at one force, the gravest first.

    Args:
        amplitude: predicted amplitude, NaN if none.
        weights: of the averaged laws.
        without: probabilities of no resonance at this force, because friction locks the mode and because no amplitude
            balances it.
        unknown: whether the prediction is left out since it is beyond ``NOTHING_KNOWN``.
    """
    refused = np.isnan(amplitude) and not (plan and not plan.allows(force))
    cautions = [UNKNOWN if unknown else _describe_refusal(*without)] if refused else []
    cautions += _list_plan_cautions(force, plan, banded=not np.isnan(amplitude)) if plan else []
    cautions += _list_test_limits(force, amplitude, data)
    if weights and max(weights) < 0.5 * sum(weights):
        cautions.append("no law has more than half of the weight in the prediction")
    return tuple(cautions)


def _describe_refusal(held: float, unreached: float) -> str:
    """Why there is no prediction: the more probable of the two reasons."""
    why = "the damping force does not reach this force at any amplitude"
    if held > unreached:
        why = "friction locks the mode at this force"
    probability = f"{max(held, unreached):.2f}"
    return f"{REFUSAL}: {why}" if probability == "1.00" else f"{REFUSAL}: with probability {probability} {why}"


def _list_plan_cautions(force: float, plan: Plan, *, banded: bool) -> list[str]:
    """Cautions on the fit of the laws, the shift of the resonance, a slipping joint, and the trend of p.

    ``banded``: whether there is a band, so that a caution can say what the band allows for.
    """
    allowed = ", and the band allows for it" if banded else ""
    p, cautions = plan.trend, [plan.fit.sentence, plan.bistable, plan.excluded, plan.state]
    beyond = force > plan.data.tested_force.max() * (1.0 + ROUNDING)
    linear = sum(law.weight for law in plan.laws if all(part.example.linear for part in law.law.parts)) > 0.5
    if beyond and banded and linear:
        cautions.append(STAYS_LINEAR)
    if beyond and not plan.joint.informative and plan.allows(force):
        either = ": the band allows for either" if banded and not linear else ""
        cautions.append(f"all levels have one frequency, so a joint cannot be told from a damper{either}")
    elif beyond and plan.joint.probability > LIKELY:
        cautions.append(
            f"the resonance falls as with a slipping joint (probability {plan.joint.probability:.2f}): damping may "
            f"stop growing beyond the test{allowed}"
        )
    if not plan.allows(force):
        few = f"fewer than {ENOUGH_LEVELS} levels do not show how damping continues"
        more = "add one (runs at one force, as where a notch lowers one to another, are one level)"
        cautions.append(f"{REFUSAL} beyond the {plan.described_limit}: {few}; {more}")
    elif p.falling or (p.rising and p.p[-1] > p.p[0]):
        way = "falling" if p.falling else "rising"
        ends = f": damping may stop growing{allowed}" if p.falling else ""
        exponents = f"{p.p[0]:.2f} between the lowest levels, {p.p[-1]:.2f} between the highest"
        cautions.append(f"force grows as a {way} power of amplitude ({exponents}){ends}")
    return [sentence for sentence in cautions if sentence]


def _list_test_limits(force: float, amplitude: float, data: Observations) -> list[str]:
    """Limits of the tested levels for a prediction, by its force, or for a decay by its amplitude."""
    of, asked, tested = "force", force, data.tested_force
    if data.amplitude_is_input:
        of, asked, tested = "amplitude", amplitude, data.tested_amplitude
    largest, levels, lines = tested.max(), int(data.levels.max()) + 1, []
    if asked > largest * (1.0 + ROUNDING):
        lines.append(f"{BEYOND_TEST}: {asked / largest:.2f} times the largest tested {of}")
    if asked < (smallest := tested.min()) / NEAREST:
        unseen = "damping that shows at small motion alone, such as friction, is not in the levels or the band"
        lines.append(f"below the test: {asked / smallest:.2g} times the smallest tested {of}; {unseen}")
    if levels == 1:
        lines.append(f"one {of} level: how damping changes with amplitude follows from the candidates, not from data")
    elif levels < 5:
        lines.append(f"{_WORDS[levels]} {of} levels say little about how damping grows with amplitude")
    span = largest / smallest
    if levels > 1 and asked / largest > span:
        lines.append(f"extrapolated by more than the tested range (largest over smallest tested {of} {span:.2f})")
    return lines
