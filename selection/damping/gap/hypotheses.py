"""Hypotheses that were fitted, the ways to further ones, and the order in which those are tried."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from damping.gap.fit import ModelFit
from damping.gap.starts import Start
from damping.gap.unknowns import spread

NEAR = 4.0  #: Log odds behind the most probable hypothesis from which another is far from it.
#: A fit leaves no more than noise where the spread of its m residuals is at most 1 + ``FITTING``/sqrt(m), two standard
#: errors above 1.
FITTING = 1.6
MOST_DOUBTING = 4  #: Fits beside a hypothesis that is doubted, or leaves noise.
_MOST_OF_A_BASE = 4  #: Fits beside one hypothesis that come before those beside others.
#: An effect that alone gains as much as one of the leading explanation, within this share, is fitted in its place; most
#: such fits, and leading explanations that are fitted from their other parts too.
_AS_MUCH = 0.05
MOST_SWAPPED = 3


@dataclass(frozen=True)
class Hypothesis:
    """Effects with their best fit.

    Attributes:
        effects: names, in the order found; empty for the simulation alone. best: the mode of largest evidence.
        plain: the best mode before scatter and noise were chosen, in which scatter cannot hide what an effect would
            explain. others: the best plain modes of other forms that are about as good.
        log_evidence: natural logarithm, averaged over forms (and scatters, where they are not stated).
        log_posterior: with the prior of the number of effects, not normalised.
        forms: number of forms of the last effect, over which the evidence is averaged.
    """

    effects: tuple[str, ...]
    best: ModelFit
    plain: ModelFit
    others: tuple[ModelFit, ...]
    log_evidence: float
    log_posterior: float
    forms: int

    @property
    def near(self) -> tuple[ModelFit, ...]:
        """The best plain fit and those about as good."""
        return (self.plain, *self.others)

    @property
    def key(self) -> frozenset[str]:
        """The effects as a set."""
        return frozenset(self.effects)


def leaves_noise(hypothesis: Hypothesis) -> bool:
    """Whether the best fit leaves no more than noise."""
    r = hypothesis.plain.measured
    return not hypothesis.plain.many_wild and spread(r) < 1.0 + FITTING / np.sqrt(r.size)


class Way(NamedTuple):
    """One way to a combination: an effect added to a ``base`` from ``starts``; ``hope``: the log posterior promised."""

    hope: float
    base: Hypothesis
    name: str
    starts: list[list[Start]]


def order_ways(ways: Mapping[frozenset[str], list[Way]]) -> list[frozenset[str]]:
    """Combinations in the order in which they are tried, by the first way of each.

    Lines promise most to what fits worst: a few beside each hypothesis come first, and before them a few that are added
    to one that leaves noise.
    """
    ordered = sorted(ways, key=lambda key: -ways[key][0].hope)
    of_base = Counter[frozenset[str]]()
    late = set[frozenset[str]]()
    for key in ordered:
        base = ways[key][0].base.key
        of_base[base] += 1
        late |= {key} if of_base[base] > _MOST_OF_A_BASE else set()
    first = [key for key in ordered if any(leaves_noise(way.base) for way in ways[key])][:MOST_DOUBTING]
    return sorted(ordered, key=lambda key: (key not in first, key in late))


def list_swaps(
    leading: Hypothesis, hypotheses: Mapping[frozenset[str], Hypothesis]
) -> Iterator[tuple[frozenset[str], str]]:
    """Explanations with another effect in the place of one that alone explains about as much; that effect of each.

    Gains of lines are far apart beside another effect where fits are not: of displacement and of viscous damping.
    """
    alone = {own.effects[0]: own.log_posterior for own in hypotheses.values() if len(own.effects) == 1}
    none, swaps = hypotheses[frozenset()].log_posterior, []
    for own, other in product(leading.effects, alone.keys() - leading.key):
        rest = leading.key - {own}
        if own in alone and rest in hypotheses and rest | {other} not in hypotheses:
            apart = abs(alone[other] - alone[own])
            if apart < NEAR + _AS_MUCH * (alone[own] - none):
                swaps.append((apart, other, rest))
    for _, other, rest in sorted(swaps, key=lambda swap: swap[:2])[:MOST_SWAPPED]:
        yield rest | {other}, other
