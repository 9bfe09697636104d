"""The search for explanations: the simulation alone, with each effect, with combinations as far as data demand them."""

from __future__ import annotations

from collections.abc import Collection
from itertools import chain, combinations, product

import numpy as np

from damping.effects.rig import AMPLITUDE_SCALE
from damping.gap.directed import ALARM, directed_tests, smallest_p
from damping.gap.fit import fit_model
from damping.gap.fitting import Fits
from damping.gap.hypotheses import (
    MOST_DOUBTING,
    MOST_SWAPPED,
    NEAR,
    SURE,
    Hypothesis,
    Way,
    leaves_noise,
    list_starts,
    list_swaps,
    order_ways,
)
from damping.gap.model import Model

#: A further effect is fitted where its linear gain in ln p is at least the first and, times the second (gains of fits
#: are larger than lines say), brings the hypothesis within ``NEAR`` of the most probable.
_GAIN = 2.5
_BEYOND_LINES = 2.0
#: The gain beside an explanation that leaves no more than noise.
_GAIN_BEYOND_NOISE = 4.5
#: Most effects of an explanation, and rows that each of them takes.
MOST_EFFECTS = 3
ROWS_PER_EFFECT = 15
#: Most fits of each number of effects beyond one, and explanations that effects are added to.
_MOST_FITS = 10
_MOST_EXTENDED = 6
_PROMISES = 0.25  #: Another law is tried where lines promise this share of what the effect in its place gains.
_HOPELESS = 0.01  #: An effect whose linear gain is this share of the largest, less ``SURE``, is not worth a fit.


class Search(Fits):
    """Hypotheses in the order in which they promise most; what was fitted stays, whatever a search asks for next."""

    def run(self) -> Search:
        """Fit the simulation alone, every effect, and combinations."""
        self.singles()
        self.combine()
        return self

    def combine(self) -> None:
        """Add effects to what was fitted as long as the data demand them."""
        self._combine_parameters()
        for size in range(1, self._most_effects()):
            before = len(self.hypotheses)
            self._combine(size)
            if len(self.hypotheses) == before or len(self.ranked()[0].effects) <= size:
                break
        leading = self.ranked()[0]
        if len(leading.effects) == 1 < self._most_effects() and smallest_p(directed_tests(leading.best)) < ALARM:
            self._combine(1, leading)
        self._shorten()

    def _combine_parameters(self) -> None:
        """Fit the parameters of the simulation together: where several are wrong, none leads to the others alone.

        A mass that is off, with stiffness and damping in its ratio, is read as a gain.
        """
        names = [name for name in reversed(self.forms) if self.effects[name].corrects]
        names += [AMPLITUDE_SCALE.name] * (AMPLITUDE_SCALE.name in self.forms)
        together = chain.from_iterable(combinations(names, size) for size in range(1, self._most_effects() + 1))
        for *before, last in together:
            base = self.hypotheses.get(frozenset(before))
            if base and not leaves_noise(base) and base.key | {last} not in self.hypotheses:
                self.extend(base, last)

    def _shorten(self) -> None:
        """Fit the most probable explanation without each of its effects, and go on from what is more probable so.

        An effect that was added first may have stood for those that came later.
        """
        leading = self.ranked()[0]
        for name in leading.effects[:-1]:
            self.drop(leading, name)
        if len(self.ranked()[0].effects) < len(leading.effects):
            self._shorten()

    def singles(self) -> None:
        """Fit the simulation alone, which sets the units of strength, and every effect that could explain something."""
        null = self.hypotheses.get(frozenset())
        if null is None:
            model = Model(self.problem, (), self.unknown.first)
            null = self._store((), fit_model(model, np.zeros((1, model.size)))[:1], 1)
        tried = {name: list_starts(null.plain, own, {}) for name, own in self.forms.items()}
        self.units |= {some[0].part.form: some[0].part.unit for some in chain.from_iterable(tried.values())}
        gains = {name: max(start.gain for start in chain.from_iterable(some)) for name, some in tried.items()}
        for name in sorted(gains, key=lambda name: -gains[name]):  # what is far behind the best is left rough
            if gains[name] > _HOPELESS * (max(gains.values()) - SURE) and frozenset({name}) not in self.hypotheses:
                self.extend(null, name, tried[name])

    def _most_effects(self) -> int:
        """Most effects that the rows can carry; at phase resonance only, one fewer than there are levels."""
        rows = self.problem.rows
        return min(MOST_EFFECTS, rows.levels - 1 if rows.at_resonance else len(rows) // ROWS_PER_EFFECT)

    def _combine(self, size: int, doubted: Hypothesis | None = None) -> None:
        """Add one effect to hypotheses of ``size`` effects, those first that could gain most.

        Beside a ``doubted`` explanation, which fits but for a little, a few are tried that lines say cannot reach it:
        it may imitate what two do together.
        """
        ways = self._list_ways(size, doubted)
        ordered = order_ways(ways)
        for key in ordered[: MOST_DOUBTING if doubted else _MOST_FITS]:
            for way in ways[key]:
                near = way.hope > self.ranked()[0].log_posterior - NEAR or not leaves_noise(way.base)
                if near and key not in self.hypotheses:  # the next way where a fit has lost the motion
                    self.extend(way.base, way.name, way.starts)
        leading = self.ranked()[0]
        shorter = self.hypotheses.get(leading.key - {*leading.effects[-1:]}, leading)
        for key in ordered:  # what made it lead is added to bases about as good
            base, name = ways[key][0].base, ways[key][0].name
            twin = base is not shorter and base.log_posterior > shorter.log_posterior - NEAR
            if twin and name in leading.effects[-1:] and key not in self.hypotheses:
                self.extend(base, name, ways[key][0].starts)
        for key, name in list_swaps(self.ranked()[0], self.hypotheses):
            if not self.effects[name].denies & key:
                self.extend(self.hypotheses[key - {name}], name)
        self._try_other_laws()
        leading, *others = self.ranked()[:MOST_SWAPPED]
        for own in (leading, *(other for other in others if other.log_posterior > leading.log_posterior - NEAR)):
            for way in ways.get(own.key, []):  # another way may lead to a better mode
                kept = self.hypotheses[own.key]
                if (*way.base.effects, way.name) != kept.effects:
                    self.extend(way.base, way.name, way.starts)
                    if kept.log_posterior >= self.hypotheses[own.key].log_posterior:
                        self.hypotheses[own.key] = kept

    def _try_other_laws(self) -> None:
        """Fit another law in the place of the simulated one for each effect of the leading explanation of several.

        Beside the others such a law is seldom reached from modes in which the simulated one is kept.
        """
        leading = self.ranked()[0]
        whole = [name for name, own in self.forms.items() if any(form.whole for form in own)]
        bases = [self.hypotheses.get(leading.key - {own}) for own in leading.effects if len(leading.effects) > 1]
        for base, name in product(filter(None, bases), (name for name in whole if name not in leading.key)):
            starts = list_starts(base.plain, self.forms[name], self.units)
            gain = max(start.gain for start in chain.from_iterable(starts) if start.part.form.whole)
            if gain > _PROMISES * (leading.log_posterior - base.log_posterior):
                kept = self.hypotheses.get(base.key | {name})
                self.extend(base, name, starts)
                if kept and kept.log_posterior >= self.hypotheses[kept.key].log_posterior:
                    self.hypotheses[kept.key] = kept

    def _list_ways(self, size: int, doubted: Hypothesis | None) -> dict[frozenset[str], list[Way]]:
        """The ways to each combination that is worth a fit, those that promise most first."""
        best = -np.inf if doubted else self.ranked()[0].log_posterior - NEAR
        price, passed = np.log(self.choices + 1.0), doubted.key if doubted else frozenset()
        ways: dict[frozenset[str], list[Way]] = {}
        quiet = {key: own.log_posterior for key, own in self.hypotheses.items() if key and leaves_noise(own)}
        for base in [hypothesis for hypothesis in self.ranked() if len(hypothesis.effects) == size][:_MOST_EXTENDED]:
            least = _GAIN_BEYOND_NOISE if leaves_noise(base) else _GAIN
            for name in self.forms:
                key = base.key | {name}
                if name in base.effects or key in self.hypotheses or key & (self.effects[name].denies | passed):
                    continue
                if any(own <= key and p > base.log_posterior for own, p in quiet.items()):
                    continue  # that one says what more could be gained
                starts = list_starts(base.plain, self.forms[name], self.units)
                gain = max(start.gain for start in chain.from_iterable(starts))
                hope = base.log_posterior + _BEYOND_LINES * gain - price
                if gain > least and hope > best:
                    ways.setdefault(key, []).append(Way(hope, base, name, starts))
        return {key: sorted(own, key=lambda way: -way.hope) for key, own in ways.items()}

    def extend_by_gain(self, base: Hypothesis, names: Collection[str], most: int) -> None:
        """Fit a hypothesis with each of those effects of ``names`` that promise most."""
        tried = {name: list_starts(base.plain, own, self.units) for name, own in self.forms.items() if name in names}
        gains = {name: max(start.gain for start in chain.from_iterable(starts)) for name, starts in tried.items()}
        for name in sorted(gains, key=lambda name: -gains[name])[:most]:
            self.extend(base, name, tried[name])
