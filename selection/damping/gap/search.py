"""The search for explanations: the simulation alone, with each effect, and with combinations that the data demand."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import chain, combinations, islice, product

import numpy as np

from damping.effects.contract import Effect
from damping.effects.rig import AMPLITUDE_SCALE
from damping.errors import AnalysisError
from damping.gap.fit import fit_model
from damping.gap.fitting import Fits
from damping.gap.hypotheses import (
    NEAR,
    SURE,
    Hypothesis,
    Start,
    Way,
    find_gain,
    leaves_noise,
    list_starts,
    order_ways,
)
from damping.gap.model import Model
from damping.gap.problem import Setting
from damping.gap.unknowns import spread
from damping.progress import nothing

#: A further effect is fitted where its linear gain in ln p exceeds the first and, times the second (fits gain more than
#: linear estimates), brings the hypothesis within ``NEAR`` of the most probable.
_GAIN = 2.5
_BEYOND_LINES = 2.0
_GAIN_BEYOND_NOISE = 4.5  #: the first of these where the base leaves no more than noise
#: Most effects of an explanation, and fewest rows for each of them.
MOST_EFFECTS = 3
ROWS_PER_EFFECT = 15
#: Most combinations tried for each number of effects beyond one, and most explanations that effects are added to.
_MOST_FITS = 12
_MOST_EXTENDED = 6
#: An effect whose linear gain beside the rest of the leading explanation exceeds this share of that of an effect in it
#: is fitted in its place, if the leading explanation leaves less than the second, in units of noise; most such fits for
#: each effect, and most leading explanations that are fitted from each side.
_AS_MUCH = 0.5
_FAR_OFF = 1.5
_MOST_EXCHANGED = 3
_MOST_NEAR = 3
#: Excess of the spread over noise, in its standard errors 0.8/sqrt(n), from which noise is enlarged; most times.
DISPERSED = 4.0
MOST_DISPERSIONS = 3
#: With fewer rows, noise that is not stated is not enlarged to the residuals of the best explanation.
FEW_ROWS = 40
#: Most times that noise which is not stated is estimated anew from the residuals of the leading explanation.
MOST_NOISES = 3
#: Most probable explanations by several effects at one noise estimate that are fitted at the next one too.
MOST_CARRIED = 8
_PROMISES = 0.25  #: Another law is tried if its linear gain exceeds this share of the gain of the effect it replaces.
_HOPELESS = 0.01  #: An effect is worth a fit if its linear gain exceeds this share of the largest less ``SURE``.


class Search(Fits):
    """Search over hypotheses, by expected log posterior; fitted hypotheses are kept for every later step."""

    def run(self) -> Search:
        """Fit the simulation alone, every effect, and combinations."""
        self.singles()
        self.combine()
        return self

    def combine(self) -> None:
        """Add effects to fitted hypotheses as long as the data demand them."""
        self._combine_parameters()
        for size in range(1, self._most_effects()):
            before = len(self.hypotheses)
            self._combine(size)
            if len(self.hypotheses) == before or len(self.ranked()[0].effects) <= size:
                break
        self._shorten()

    def _combine_parameters(self) -> None:
        """Fit the parameters of the simulation together: where several are wrong, a single one may gain too little.

        A wrong mass, with stiffness and damping in its ratio, reads as a gain.
        """
        names = [name for name in reversed(self.forms) if self.effects[name].corrects]
        names += [AMPLITUDE_SCALE.name] * (AMPLITUDE_SCALE.name in self.forms)
        together = chain.from_iterable(combinations(names, size) for size in range(1, self._most_effects() + 1))
        for *before, last in together:
            base = self.hypotheses.get(frozenset(before))
            if base and not leaves_noise(base) and base.key | {last} not in self.hypotheses:
                self.extend(base, last)

    def _shorten(self) -> None:
        """Fit the most probable explanation without each of its effects; repeat if a shorter one is more probable.

        An effect that was added early may have stood in for later ones.
        """
        leading = self.ranked()[0]
        for name in leading.effects if len(leading.effects) > 1 else ():
            self.drop(leading, name)
        if len(self.ranked()[0].effects) < len(leading.effects):
            self._shorten()

    def singles(self) -> None:
        """Fit the simulation alone, which sets the units of strength, and every effect with a linear gain worth it."""
        null = self.hypotheses.get(frozenset())
        if null is None:
            model = Model(self.problem, (), self.unknown.first)
            fits = fit_model(model, np.zeros((1, model.size)))[:1]
            if not fits:  # residuals are beyond the numbers
                message = "the uncertainties of the rows are too small to compare the simulation with them"
                raise AnalysisError(f"{message}: state those of the readings, or none")
            null = self._store((), fits)
        tried = self._order_starts(null, self.forms)  # best first: fits far behind are not polished
        self.units |= {starts[0].part.form: starts[0].part.unit for starts in chain.from_iterable(tried.values())}
        least = _HOPELESS * (max(map(find_gain, tried.values()), default=0.0) - SURE)
        for name, starts in tried.items():
            if find_gain(starts) > least and frozenset({name}) not in self.hypotheses:
                self.extend(null, name, starts)

    def _order_starts(self, base: Hypothesis, names: Iterable[str]) -> dict[str, list[list[Start]]]:
        """Starts of further effects beside those of a hypothesis, those of the largest linear gain first."""
        starts = {name: list_starts(base.plain, self.forms[name], self.units) for name in names}
        return dict(sorted(starts.items(), key=lambda of_name: -find_gain(of_name[1])))

    def _most_effects(self) -> int:
        """Most effects that the rows support; with phase resonances only, one fewer than there are levels."""
        rows = self.problem.rows
        return min(MOST_EFFECTS, rows.level_count - 1 if rows.at_resonance else len(rows) // ROWS_PER_EFFECT)

    def _combine(self, size: int) -> None:
        """Add one effect to hypotheses of ``size`` effects, those of the largest expected log posterior first."""
        ways = self._list_ways(size)
        ordered = order_ways(ways)
        for key in ordered[:_MOST_FITS]:
            for way in ways[key]:
                leading = self.ranked()[0]
                worth = way.hope > leading.log_posterior - NEAR or not leaves_noise(way.base)
                if worth and key not in self.hypotheses:  # the next way if a fit lost the motion
                    self.extend(way.base, way.name, way.starts, leading.plain.log_posterior)
        leading = self.ranked()[0]
        shorter = self.hypotheses.get(leading.key - {*leading.effects[-1:]}, leading)
        for key in ordered:  # add the last effect of the leading explanation to bases about as good
            base, name = ways[key][0].base, ways[key][0].name
            twin = base is not shorter and base.log_posterior > shorter.log_posterior - NEAR
            if twin and name in leading.effects[-1:] and key not in self.hypotheses:
                self.extend(base, name, ways[key][0].starts)
        self._exchange()
        self._try_other_laws()
        leading, *others = self.ranked()[:_MOST_NEAR]
        for near in (leading, *(other for other in others if other.log_posterior > leading.log_posterior - NEAR)):
            self._fit_from_each_side(near.key)

    def _exchange(self) -> None:
        """Fit a leading pair with each of its effects replaced by others of about the same linear gain.

        Beside another effect, linear gains can differ where fits do not (displacement and viscous damping), and a fit
        from one side may stop far from the best mode. A pair that leaves far more than noise is not worth it.
        """
        leading = self.ranked()[0]
        worth = len(leading.effects) == 2 and spread(leading.best.measured) < _FAR_OFF
        for replaced in leading.effects if worth else ():
            base = self.hypotheses.get(leading.key - {replaced})
            if base is None:
                continue
            others = [name for name in self.forms.keys() - leading.key if not self.effects[name].denies & base.key]
            tried = self._order_starts(base, sorted((replaced, *others)))
            least = _AS_MUCH * find_gain(tried.pop(replaced))
            for name, starts in islice(tried.items(), _MOST_EXCHANGED):
                key = base.key | {name}
                if find_gain(starts) > least:
                    if key not in self.hypotheses:
                        self.extend(base, name, starts)
                    if key in self.hypotheses and self.hypotheses[key].log_posterior < leading.log_posterior - NEAR:
                        self._fit_from_each_side(key)

    def _fit_from_each_side(self, key: frozenset[str]) -> None:
        """Fit a combination of several effects from each base of one effect fewer, and keep the best."""
        for name in sorted(key) if len(key) > 1 else ():
            base, kept = self.hypotheses.get(key - {name}), self.hypotheses.get(key)
            if base and (kept is None or kept.effects[-1] != name):
                self.improve(base, name)

    def _try_other_laws(self) -> None:
        """Where the leading explanation has several effects, fit another law of damping in the place of each.

        Beside the others such a law is seldom reached from modes in which the simulated law is kept.
        """
        leading = self.ranked()[0]
        whole = [name for name, forms in self.forms.items() if any(form.whole for form in forms)]
        bases = [self.hypotheses.get(leading.key - {effect}) for effect in leading.effects if len(leading.effects) > 1]
        for base, name in product(filter(None, bases), (name for name in whole if name not in leading.key)):
            starts = list_starts(base.plain, self.forms[name], self.units)
            gain = max(start.gain for start in chain.from_iterable(starts) if start.part.form.whole)
            if gain > _PROMISES * (leading.log_posterior - base.log_posterior):
                self.improve(base, name, starts)

    def _list_ways(self, size: int) -> dict[frozenset[str], list[Way]]:
        """The ways to each combination that is worth a fit, those of the largest expected log posterior first."""
        best = self.ranked()[0].log_posterior - NEAR
        price = np.log(self.choices + 1.0)
        ways: dict[frozenset[str], list[Way]] = {}
        quiet = {key: old.log_posterior for key, old in self.hypotheses.items() if key and leaves_noise(old)}
        for base in [hypothesis for hypothesis in self.ranked() if len(hypothesis.effects) == size][:_MOST_EXTENDED]:
            least = _GAIN_BEYOND_NOISE if leaves_noise(base) else _GAIN
            for name in self.forms:
                key = base.key | {name}
                if name in base.effects or key in self.hypotheses or key & self.effects[name].denies:
                    continue
                if any(part <= key and p > base.log_posterior for part, p in quiet.items()):
                    continue  # the linear gain beside that part is the one to trust
                starts = list_starts(base.plain, self.forms[name], self.units)
                gain = find_gain(starts)
                hope = base.log_posterior + _BEYOND_LINES * gain - price
                if gain > least and hope > best:
                    ways.setdefault(key, []).append(Way(hope, base, name, starts))
        return {key: sorted(to_key, key=lambda way: -way.hope) for key, to_key in ways.items()}

    def extend_by_gain(self, base: Hypothesis, names: Collection[str], most: int) -> None:
        """Fit a hypothesis with each of the ``most`` effects of ``names`` of the largest linear gain."""
        tried = self._order_starts(base, (name for name in self.forms if name in names))
        for name, starts in islice(tried.items(), most):
            self.extend(base, name, starts)


def search_hypotheses(
    start: Setting, effects: Mapping[str, Effect], done: Callable[[str], None] = nothing
) -> tuple[Setting, Search]:
    """The finished search of a setting, and the setting with its noise (where not stated) and its dispersion.

    Where even the best explanation misses by more than noise, all are compared again with noise enlarged to its
    residuals. If no explanation is the whole truth, the one with the smallest residuals should lead, not one that
    happens to agree with a part of the rows.
    """
    known, search = _search_with_noise(start, effects, done)
    if not known.noise_known and len(known.problem.rows) < FEW_ROWS:
        return known, search  # the noise prior of so few rows is wide enough
    for _ in range(MOST_DISPERSIONS):
        r = search.ranked()[0].best.measured
        excess = spread(r)
        if excess < 1.0 + DISPERSED * 0.8 / np.sqrt(len(r)):
            break
        known = replace(known, dispersion=known.dispersion * excess)
        search = search.again(known.problem, known.unknowns, larger=excess**2)
    return known, search


def _search_with_noise(
    start: Setting, effects: Mapping[str, Effect], done: Callable[[str], None]
) -> tuple[Setting, Search]:
    """A search with the stated noise; else with noise from its leading explanation's residuals, iterated to stability.

    The first estimate is from the simulation alone, too large if that is wrong; the next from the best single effect.
    """
    if start.noise_known:
        return start, Search(start.problem, effects, start.unknowns, done=done).run()
    for _ in range(2):
        start = start.with_noise_of(Search(start.problem, {}, start.unknowns).run().ranked()[0].best)
    search, combined = Search(start.problem, effects, start.unknowns, done=done), False
    search.singles()
    for _ in range(MOST_NOISES):
        better = start.with_noise_of(search.ranked()[0].best)
        if not better.has_noise_of(start):
            several = [hypothesis for hypothesis in search.ranked() if len(hypothesis.effects) > 1][:MOST_CARRIED]
            start, search = better, Search(better.problem, effects, better.unknowns, done=done)
            search.singles()
            for hypothesis in several:
                search.adopt(hypothesis)
        elif combined:
            break
        search.combine()
        combined = True
    return start, search
