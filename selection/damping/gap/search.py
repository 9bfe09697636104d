"""The search for explanations: the simulation alone, with each effect, and with combinations that the data demand."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from itertools import chain, combinations, product

import numpy as np

from damping.effects.contract import Effect
from damping.effects.rig import AMPLITUDE_SCALE
from damping.errors import AnalysisError
from damping.gap.fit import fit_model
from damping.gap.fitting import Fits
from damping.gap.hypotheses import NEAR, SURE, Addition, Hypothesis, Starts, find_gain, leaves_noise, order_combinations
from damping.gap.model import Model
from damping.gap.problem import Setting
from damping.gap.unknowns import spread
from damping.progress import nothing

_GAIN = 2.5  #: Least linear gain in ln p of an effect that is added to a hypothesis.
_GAIN_BEYOND_NOISE = 4.5  #: The same where that hypothesis leaves no more than noise.
_BEYOND_LINES = 2.0  #: A fit is expected to gain this many times the linear gain, since fits gain more than lines.
MOST_EFFECTS = 3  #: Most effects of an explanation.
ROWS_PER_EFFECT = 15  #: Fewest rows for each effect of an explanation.
_MOST_FITS = 12  #: Most combinations tried for each number of effects beyond one.
_MOST_EXTENDED = 6  #: Most explanations with one number of effects to which a further effect is added.
_AS_MUCH = 0.5  #: An effect of a pair is exchanged for another whose linear gain is more than this share of its own.
_FAR_OFF = 1.5  #: A pair that leaves more than this, in units of noise, is not worth exchanging effects.
_MOST_EXCHANGED = 3  #: Most effects that are tried in the place of each effect of a pair.
_MOST_NEAR = 3  #: Most leading explanations that are fitted from each side.
DISPERSED = 4.0  #: Excess of the spread over noise, in its standard errors 0.8/sqrt(n), from which noise is enlarged.
MOST_DISPERSIONS = 3  #: Most times that noise is enlarged.
#: With fewer rows, noise that is not stated is not enlarged to the residuals of the best explanation.
FEW_ROWS = 40
#: Most times that noise which is not stated is estimated anew from the residuals of the leading explanation.
MOST_NOISES = 3
#: Most probable explanations by several effects at one noise estimate that are fitted at the next one too.
MOST_CARRIED = 8
_PROMISES = 0.25  #: Another law is tried if its linear gain exceeds this share of the gain of the effect it replaces.
_HOPELESS = 0.01  #: An effect is worth a fit if its linear gain exceeds this share of the largest less ``SURE``.


class Search(Fits):
    """Search over hypotheses, by expected log posterior; fitted hypotheses are kept for every later step.

    A base is a hypothesis to which an effect is added; the linear gain of that effect is the gain in ln p by the
    derivative of the residuals at the base. The leading hypothesis is the most probable of those fitted.
    """

    def run(self) -> Search:
        """Fit the simulation alone, every effect, and combinations."""
        self.fit_single_effects()
        self.combine()
        return self

    def fit_single_effects(self) -> None:
        """Fit the simulation alone, which sets the units of strength, and every effect with a linear gain worth it."""
        null = self.hypotheses.get(frozenset()) or self._fit_simulation()
        starts = self._order_starts(null, self.forms)  # best first: fits far behind are not polished
        for of_form in chain.from_iterable(starts.values()):
            self.units[of_form[0].part.form] = of_form[0].part.unit
        gains = {name: find_gain(of_effect) for name, of_effect in starts.items()}
        least = _HOPELESS * (max(gains.values(), default=0.0) - SURE)
        # a simulator has its own parameters: those of its mode begin 3 tolerances off, far from where lines hold
        is_own = self.problem.simulation.simulator is not None
        for name, gain in gains.items():
            if gain > least or (is_own and self.effects[name].corrects):
                self.extend_once(null, name, starts[name])

    def _fit_simulation(self) -> Hypothesis:
        """Fit the simulation without effects. AnalysisError: its residuals are beyond the numbers."""
        model = Model(self.problem, (), self.unknown.first)
        fits = fit_model(model, np.zeros((1, model.size)))[:1]
        if not fits:
            message = "the uncertainties of the rows are too small to compare the simulation with them"
            raise AnalysisError(f"{message}: state those of the readings, or none")
        return self._store((), fits)

    def combine(self) -> None:
        """Add effects to fitted hypotheses as long as the data demand them."""
        self._combine_parameters()
        for size in range(1, self._most_effects()):
            before = len(self.hypotheses)
            self._add_effect(size)
            if len(self.hypotheses) == before or len(self.leading.effects) <= size:
                break
        self._shorten()

    def _most_effects(self) -> int:
        """Most effects that the rows support; where every sweep is one row, one fewer than there are levels."""
        rows = self.problem.rows
        of_rows = 0 if rows.at_resonance else len(rows) // ROWS_PER_EFFECT
        of_levels = rows.level_count - 1 if rows.at_resonance or rows.of_peaks else 0
        return min(MOST_EFFECTS, max(of_rows, of_levels))

    def _combine_parameters(self) -> None:
        """Fit the parameters of the simulation together: where several are wrong, a single one may gain too little.

        A wrong mass, with stiffness and damping in its ratio, reads as a gain.
        """
        names = [name for name in reversed(self.forms) if self.effects[name].corrects]
        names += [AMPLITUDE_SCALE.name] if AMPLITUDE_SCALE.name in self.forms else []
        for size in range(1, self._most_effects() + 1):
            for *others, last in combinations(names, size):
                base = self.hypotheses.get(frozenset(others))
                if base and not leaves_noise(base):
                    self.extend_once(base, last)

    def _shorten(self) -> None:
        """Fit the most probable explanation without each of its effects; repeat if a shorter one is more probable.

        An effect that was added early may have stood in for later ones.
        """
        leading = self.leading
        if len(leading.effects) > 1:
            for name in leading.effects:
                self.drop(leading, name)
        if len(self.leading.effects) < len(leading.effects):
            self._shorten()

    def _order_starts(self, base: Hypothesis, names: Iterable[str]) -> dict[str, Starts]:
        """Starts of further effects beside those of a hypothesis, those of the largest linear gain first."""
        starts = {name: self.list_starts(base, name) for name in names}
        return dict(sorted(starts.items(), key=lambda of_name: -find_gain(of_name[1])))

    def _add_effect(self, size: int) -> None:
        """Add one effect to hypotheses of ``size`` effects, those of the largest expected log posterior first."""
        additions = self._list_additions(size)
        ordered = order_combinations(additions)
        for key in ordered[:_MOST_FITS]:
            for addition in additions[key]:  # the next one where a fit has no steady state
                leading = self.leading
                if addition.expected > leading.log_posterior - NEAR or not leaves_noise(addition.base):
                    self.extend_once(addition.base, addition.name, addition.starts, leading.plain.log_posterior)
        self._add_last_effect([additions[key][0] for key in ordered])
        self._exchange_effects()
        self._add_to_corrections()
        self._try_other_laws()
        best = self.ranked()[:_MOST_NEAR]
        for near in [hypothesis for hypothesis in best if hypothesis.log_posterior > best[0].log_posterior - NEAR]:
            self._fit_from_each_side(near)

    def _list_additions(self, size: int) -> dict[frozenset[str], list[Addition]]:
        """Additions to hypotheses of ``size`` effects that are worth a fit, by combination, the most probable first."""
        least_posterior = self.leading.log_posterior - NEAR
        price = np.log(self.choices + 1.0)
        fitting = [hypothesis for hypothesis in self.hypotheses.values() if hypothesis.key and leaves_noise(hypothesis)]
        extended = [hypothesis for hypothesis in self.ranked() if len(hypothesis.effects) == size][:_MOST_EXTENDED]
        additions = defaultdict[frozenset[str], list[Addition]](list)
        for base, name in product(extended, self.forms):
            key = base.key | {name}
            if name in base.key or key in self.hypotheses or key & self.effects[name].denies:
                continue
            if any(part.key <= key and part.log_posterior > base.log_posterior for part in fitting):
                continue  # the linear gain beside that part is the one to trust
            starts = self.list_starts(base, name)
            gain = find_gain(starts)
            expected = base.log_posterior + _BEYOND_LINES * gain - price
            if gain > (_GAIN_BEYOND_NOISE if leaves_noise(base) else _GAIN) and expected > least_posterior:
                additions[key].append(Addition(expected, base, name, starts))
        for to_key in additions.values():
            to_key.sort(key=lambda addition: -addition.expected)
        return additions

    def _add_last_effect(self, additions: Iterable[Addition]) -> None:
        """Add the last effect of the leading explanation to bases about as good as the one to which it was added."""
        leading = self.leading
        shorter = self.hypotheses.get(frozenset(leading.effects[:-1]), leading)
        for _, base, name, starts in additions:
            is_as_good = base is not shorter and base.log_posterior > shorter.log_posterior - NEAR
            if is_as_good and name in leading.effects[-1:]:
                self.extend_once(base, name, starts)

    def _exchange_effects(self) -> None:
        """Fit a leading pair with each of its effects replaced by others of about the same linear gain.

        Beside another effect, linear gains can differ where fits do not (displacement and viscous damping), and a fit
        from one side may stop far from the best mode. A pair that leaves far more than noise is not worth it.
        """
        leading = self.leading
        if not (len(leading.effects) == 2 and spread(leading.best.measured) < _FAR_OFF):
            return
        for replaced in leading.effects:
            base = self.hypotheses.get(leading.key - {replaced})
            if base is None:
                continue
            others = [name for name in self.forms.keys() - leading.key if not self.effects[name].denies & base.key]
            starts = self._order_starts(base, sorted((replaced, *others)))
            least = _AS_MUCH * find_gain(starts.pop(replaced))
            for name in [name for name in starts if find_gain(starts[name]) > least][:_MOST_EXCHANGED]:
                self.extend_once(base, name, starts[name])
                pair = self.hypotheses.get(base.key | {name})
                if pair and pair.log_posterior < leading.log_posterior - NEAR:
                    self._fit_from_each_side(pair)

    def _add_to_corrections(self) -> None:
        """Add each effect of the leading explanation to the best hypothesis that only corrects the simulation.

        A simulation with two wrong parameters and a missing law is far off until all three are fitted: linear gains
        are too small there, and effects that imitate one of the three lead.
        """
        leading = self.leading
        for base in self.ranked():
            if len(base.effects) == len(leading.effects) - 1 and all(self.effects[name].corrects for name in base.key):
                for name in leading.key - base.key:
                    if not base.key & self.effects[name].denies:
                        self.extend_once(base, name)
                return

    def _fit_from_each_side(self, hypothesis: Hypothesis) -> None:
        """Fit a combination of several effects from each base of one effect fewer, and keep the best."""
        if len(hypothesis.effects) < 2:
            return
        for name in sorted(hypothesis.effects):
            base, kept = self.hypotheses.get(hypothesis.key - {name}), self.hypotheses[hypothesis.key]
            if base and kept.effects[-1] != name:  # else the kept fit is from that base
                self.improve(base, name)

    def _try_other_laws(self) -> None:
        """Where the leading explanation has several effects, fit another law of damping in the place of each.

        Beside the others such a law is seldom reached from modes in which the simulated law is kept.
        """
        leading = self.leading
        if len(leading.effects) < 2:
            return
        bases = [self.hypotheses.get(leading.key - {replaced}) for replaced in leading.effects]
        laws = [name for name, forms in self.forms.items() if any(form.whole for form in forms)]
        for base, law in product(filter(None, bases), [law for law in laws if law not in leading.key]):
            starts = self.list_starts(base, law)
            gain = max(start.gain for start in chain.from_iterable(starts) if start.part.form.whole)
            if gain > _PROMISES * (leading.log_posterior - base.log_posterior):
                self.improve(base, law, starts)

    def extend_by_gain(self, base: Hypothesis, names: Collection[str], most: int) -> None:
        """Fit a hypothesis with each of the ``most`` effects of ``names`` of the largest linear gain."""
        starts = self._order_starts(base, [name for name in self.forms if name in names])
        for name in list(starts)[:most]:
            self.extend(base, name, starts[name])


def search_hypotheses(
    setting: Setting, effects: Mapping[str, Effect], done: Callable[[str], None] = nothing
) -> tuple[Setting, Search]:
    """The finished search of a setting, and the setting with its noise (where not stated) and its dispersion.

    Where even the best explanation misses by more than noise, all are compared again with noise enlarged to its
    residuals. If no explanation is the whole truth, the one with the smallest residuals should lead, not one that
    happens to agree with a part of the rows.
    """
    setting, search = _search_with_noise(setting, effects, done)
    if not setting.noise_known and len(setting.problem.rows) < FEW_ROWS:
        return setting, search  # the noise prior of so few rows is wide enough
    for _ in range(MOST_DISPERSIONS):
        r = search.leading.best.measured
        excess = spread(r)
        if excess < 1.0 + DISPERSED * 0.8 / np.sqrt(len(r)):
            break
        setting = replace(setting, dispersion=setting.dispersion * excess)
        search = search.refit(setting.problem, setting.unknowns, larger=excess**2)
    return setting, search


def _search_with_noise(
    setting: Setting, effects: Mapping[str, Effect], done: Callable[[str], None]
) -> tuple[Setting, Search]:
    """A search with the stated noise; else with noise from its leading explanation's residuals, iterated to stability.

    The first estimate is from the simulation alone, too large if that is wrong; the next from the best single effect.
    """
    if setting.noise_known:
        return setting, Search(setting.problem, effects, setting.unknowns, done=done).run()
    for _ in range(2):
        setting = setting.with_noise_of(Search(setting.problem, {}, setting.unknowns).run().leading.best)
    search, is_combined = Search(setting.problem, effects, setting.unknowns, done=done), False
    search.fit_single_effects()
    for _ in range(MOST_NOISES):
        better = setting.with_noise_of(search.leading.best)
        if not better.has_noise_of(setting):
            several = [hypothesis for hypothesis in search.ranked() if len(hypothesis.effects) > 1][:MOST_CARRIED]
            setting, search = better, Search(better.problem, effects, better.unknowns, done=done)
            search.fit_single_effects()
            for hypothesis in several:
                search.adopt(hypothesis)
        elif is_combined:
            break
        search.combine()
        is_combined = True
    return setting, search
