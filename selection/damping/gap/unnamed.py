"""Is it something that the library does not name? Families of other causes, each with a few free numbers.

Each family is fitted and weighed like an effect of the library. One that is more probable than the leading explanation
says that this only imitates what is missing: a pair of forces can bend into nearly any law. Families: joints that slip
one after the other (hysteresis of any smooth backbone; Iwan 1966), a spring of a high power, a natural frequency that
moves in the course of the test, a reading that falls short as amplitudes grow.

Which effects the record cannot tell apart: how far, in units of noise, their best-fitting predictions differ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from damping.arrays import Floats
from damping.effects.contract import Effect, Form, FormVariable, Scales
from damping.effects.terms import Terms
from damping.forces.contract import Sum
from damping.forces.joints import PowerStiffness, Slip
from damping.gap.fit import ModelFit, Unknowns
from damping.gap.model import Problem
from damping.gap.search import Hypothesis, Search

#: Limits of joints that slip one after the other, over their scale; and the ends of the range that each stands for.
_LIMITS = np.geomspace(0.005, 4.0, 14)
_ENDS = np.concatenate([[0.0], np.sqrt(_LIMITS[1:] * _LIMITS[:-1]), [np.inf]])

Forms = Callable[[Scales], tuple[Form, ...]]


@dataclass(frozen=True)
class UnnamedCause:
    """A family, and by how much (ln) it is more probable than the leading explanation."""

    name: str
    log_odds: float


def fit_unnamed_causes(problem: Problem, unknown: Unknowns, leading: Hypothesis) -> list[UnnamedCause]:
    """Every family fitted in the place of the leading explanation, the most probable first."""
    search = Search(problem, list_families(problem), unknown)
    search.singles()
    found = [one for one in search.ranked() if one.effects]
    return [UnnamedCause(one.effects[0], one.log_posterior - leading.log_posterior) for one in found]


def list_families(problem: Problem) -> Mapping[str, Effect]:
    """The families for a problem, by name."""
    rows = problem.rows
    time = rows.row / max(len(rows) - 1, 1) - 0.5
    relative = rows.A / problem.scales.A_high
    found: dict[str, Forms] = {"many joints that slip": _list_joints}
    if not rows.at_resonance:
        found |= {
            "a spring of a high power": _list_springs,
            "a frequency that drifts": lambda scales: tuple(_drift(scales, time, sign) for sign in (1.0, -1.0)),
            "a reading that saturates": lambda scales: (_saturation(relative),),
        }
    return {name: Effect(name, "structure", name, forms, _never) for name, forms in found.items()}


def _list_joints(scales: Scales) -> tuple[Form, ...]:
    """Strength: the stiffness lost in all. Shapes: scale and exponent kappa of the Weibull distribution of the limits.

    An exponential distribution (kappa = 1) is the backbone 1 - exp(-q/a) of Bouc and Wen; a uniform one that of Iwan.
    """
    limit = FormVariable.between(0.1 * scales.A_low, 4.0 * scales.A_high, starts=(-1.0, 0.0, 1.0))
    kappa = FormVariable(centre=1.0, width=0.4, starts=(0.0,))

    def change(terms: Terms, stiffness: Floats, limit: Floats, kappa: Floats) -> Terms:
        beyond = [np.exp(-(end**kappa)) for end in _ENDS]
        joints = [
            Slip(stiffness * (before - after), limit * place)
            for place, (before, after) in zip(_LIMITS, pairwise(beyond), strict=True)
        ]
        return terms.with_force(Sum(tuple(joints)))

    return (Form("many joints that slip", change, _silent, scales.loss, (limit, kappa), largest=scales.stiffness),)


def _list_springs(scales: Scales) -> tuple[Form, ...]:
    """Strength: the restoring force at the largest amplitude over that amplitude. Shape: the power."""
    power = FormVariable(centre=5.0, width=0.3, starts=(0.0,))

    def side(sign: float) -> Form:
        def change(terms: Terms, stiffness: Floats, power: Floats) -> Terms:
            return terms.with_force(PowerStiffness(sign * stiffness * scales.A_high ** (1.0 - power), power))

        return Form("a spring of a high power", change, _silent, scales.loss, (power,), largest=scales.stiffness)

    return side(1.0), side(-1.0)


def _drift(scales: Scales, time: Floats, sign: float) -> Form:
    """Strength: the relative change of the frequency from the first row of the record to the last."""

    def change(terms: Terms, whole: Floats) -> Terms:
        return replace(terms, omega_n=terms.omega_n * (1.0 + sign * whole * time))

    return Form("a frequency that drifts", change, _silent, scales.bandwidth, largest=0.1)


def _saturation(relative: Floats) -> Form:
    """Strength: what the reading lacks at the largest amplitude, in ln. Shape: the power of amplitude it goes with."""
    power = FormVariable(centre=2.0, width=0.5, starts=(0.0, 1.5))

    def change(terms: Terms, lacking: Floats, power: Floats) -> Terms:
        return replace(terms, gain=terms.gain - lacking * relative**power)

    return Form("a reading that saturates", change, _silent, 0.1, (power,), largest=3.0)


def _silent(*_: Floats) -> dict[str, Floats]:
    """A family has no place in a model file."""
    return {}


def _never(terms: Terms, table: Mapping[str, float]) -> Terms:
    """No model file holds a family."""
    raise AssertionError(table)


#: Distance below which two predictions are told apart only by chance: expected log odds d^2/2 = 3, one in twenty.
INDISTINCT = 2.45
#: Odds below which an effect is no candidate for the place of another, however near its prediction.
LEAST_ODDS = 0.02


@dataclass(frozen=True)
class Group:
    """Effects that may take one another's place in the leading explanation; ``distance``: the largest to the first."""

    effects: tuple[str, ...]
    distance: float


def distance(one: ModelFit, other: ModelFit) -> float:
    """Norm of the difference of two best-fitting predictions in units of noise, wild points left out."""
    weights = np.sqrt(one.weights * other.weights)
    return float(np.sqrt(np.sum(weights * (one.r - other.r) ** 2)))


def group_equivalent_effects(hypotheses: Sequence[Hypothesis]) -> tuple[Group, ...]:
    """For each effect of the leading explanation, those that could stand in its place without being told from it.

    ``hypotheses`` are in order of probability; only those with as many effects as the first are compared with it.
    """
    leading = hypotheses[0]
    found = []
    for effect in leading.effects:
        rest = leading.key - {effect}
        members, farthest = [effect], 0.0
        for other in hypotheses[1:]:
            swapped = other.key - rest
            alive = other.log_posterior > leading.log_posterior + float(np.log(LEAST_ODDS))
            if alive and len(other.effects) == len(leading.effects) and rest <= other.key and len(swapped) == 1:
                apart = distance(leading.best, other.best)
                if apart < INDISTINCT:
                    members.append(next(iter(swapped)))
                    farthest = max(farthest, apart)
        if len(members) > 1:
            found.append(Group(tuple(members), farthest))
    return tuple(found)
