"""Which effects the record cannot tell apart: how far, in units of noise, their best-fitting predictions differ."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selection.gap.fit import Fit
from selection.gap.search import Hypothesis

#: Distance below which two predictions are told apart only by chance: expected log odds d^2/2 = 3, one in twenty.
INDISTINCT = 2.45
#: Odds below which an effect is no candidate for the place of another, however near its prediction.
LEAST_ODDS = 0.02


@dataclass(frozen=True)
class Group:
    """Effects that may take one another's place in the leading explanation; ``distance``: the largest to the first."""

    effects: tuple[str, ...]
    distance: float


def distance(one: Fit, other: Fit) -> float:
    """Norm of the difference of two best-fitting predictions in units of noise, wild points left out."""
    weights = np.sqrt(one.weights * other.weights)
    return float(np.sqrt(np.sum(weights * (one.r - other.r) ** 2)))


def equivalents(hypotheses: Sequence[Hypothesis]) -> tuple[Group, ...]:
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
