"""What to know before using a prediction, in words."""

from __future__ import annotations

from collections.abc import Sequence

from selection.compare.weights import ENOUGH, level_numbers
from selection.loads.plan import Plan
from selection.posterior.observations import Observations

_WORDS = {2: "two", 3: "three", 4: "four"}


def cautions(
    force: float, predicted: bool, data: Observations, weights: Sequence[float], plan: Plan | None
) -> tuple[str, ...]:
    """Cautions on the prediction at one force, the gravest first.

    Args:
        predicted: whether there is one. weights: of the laws that take part.
    """
    largest = data.tested_force[data.top]
    said = _of_plan(force, plan) if plan else []
    if not predicted and not (plan and force > plan.limit):
        said.append("no prediction: the damping force does not reach this force at any amplitude")
    if force > largest:
        said.append(f"beyond the test: {force / largest:.2f} times the largest tested force")
    return tuple(said + _of_test(force, data) + _of_weights(weights, plan))


def _of_plan(force: float, plan: Plan) -> list[str]:
    """What the trend of p says, and how far the resonance moved."""
    return [*_of_trend(force, plan), *([plan.bistable] if plan.bistable else [])]


def _of_trend(force: float, plan: Plan) -> list[str]:
    p, change = plan.trend, plan.change
    if change:
        foreseen = f"the laws of the lower levels gave the highest one a probability of {100.0 * change.foreseen:.0f} %"
        if force > change.limit:
            return [f"no prediction beyond {change.limit:.4g}: p is rising ({p.words}), and {foreseen}"]
        return [f"p is rising ({p.words}), and {foreseen}: no prediction beyond {change.limit:.4g}"]
    if p.falling:
        return [f"p is falling at the top of the test ({p.words}): amplitudes may grow faster than any law here says"]
    return [f"p is rising with level ({p.words}), as the laws here foresee"] if p.rising else []


def _of_test(force: float, data: Observations) -> list[str]:
    """What the tested levels cannot say."""
    said = []
    levels = int(level_numbers(data.tested_force).max()) + 1
    if levels == 1:
        said.append("one force level: how damping changes with amplitude rests on the candidates, not on data")
    elif levels < 5:
        said.append(f"{_WORDS[levels]} points: p from {levels - 2} degree{'s' * (levels != 3)} of freedom")
    span = data.tested_force.max() / data.tested_force.min()
    if levels > 1 and force / data.tested_force.max() > span:
        said.append(f"farther beyond the test than the test is wide (largest over smallest tested force {span:.2f})")
    return said


def _of_weights(weights: Sequence[float], plan: Plan | None) -> list[str]:
    """How well the laws are told apart."""
    said = []
    if weights and max(weights) < 0.5 * sum(weights):
        said.append("no law has more than half of the weight")
    if plan and plan.held_out < ENOUGH and len(plan.laws) > 1:
        levels = f"{plan.held_out} level{'s' * (plan.held_out != 1)} held out"
        said.append(f"{levels}: weights drawn towards equal ones over {len(plan.laws)} plausible laws")
    return said
