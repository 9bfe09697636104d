"""Fits of hypotheses: the simulation alone, with each effect, and with combinations as far as the data demand them.

The evidence pays for every shape and strength that a hypothesis leaves free (MacKay 1992), the prior for every effect.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, product

import numpy as np
from scipy.special import logsumexp

from damping.arrays import BoolArray
from damping.effects.contract import Effect, Form
from damping.effects.rig import AMPLITUDE_SCALE
from damping.gap.directed import ALARM, directed_tests, smallest_p
from damping.gap.fit import ModelFit, drop_effect, fit_model, fit_roughly, polish_fits
from damping.gap.hypotheses import (
    MOST_DOUBTING,
    MOST_SWAPPED,
    NEAR,
    SURE,
    Hypothesis,
    Start,
    Way,
    at_gap,
    choose_forms,
    leaves_noise,
    list_starts,
    list_swaps,
    order_ways,
)
from damping.gap.model import Model, Problem
from damping.gap.unknowns import Unknowns, marginalise_scatter

#: Prior odds of the simulation alone against any one effect; each further effect costs as much as there are effects.
PRIOR_NULL = 25.0
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
_CLOSE_MODES = 10.0  #: Modes whose evidence is within this of the best are weighed.
_CLOSE = 3.0  #: Another form of an effect whose evidence is within this is kept when effects are added.
_WORTH = 12.0  #: ln evidence behind the best from which a hypothesis is not fitted again at its own scatter and noise.
_LOST = 100.0  #: ln evidence behind the best from which predictions are not taken again at a fit's own motion.
#: Hypotheses, the most probable of all and of one effect, that are fitted to another problem too.
_AGAIN = 6
_AGAIN_SIMPLE = 3
_LOST_AGAIN = 30.0  #: ln p behind the best from which hypotheses of several effects are not fitted to another problem.
#: Starts of each form that are fitted; from this misfit of the base, in units of noise, starts of other sizes too.
_STARTS = 4
#: Forms of one effect that are fitted, alone and beside others: those of the largest linear gain, none far behind.
_MOST_FORMS = 8
_MOST_FORMS_BESIDE = 3
_MOST_BASES = 2  #: Modes of a hypothesis that are gone on from.
_ROUGH = 1.5
_APART = 3.0  #: Deviation of a sweep, in units of repeatability, beyond which it hides something.
_HOPELESS = 0.01  #: An effect whose linear gain is this share of the largest, less ``SURE``, is not worth a fit.


@dataclass
class Search:
    """The hypotheses of a problem, fitted on demand.

    Attributes:
        problem, effects: the record with its simulation, and the library. unknown: what scatter and noise may be.
        hypotheses: fitted ones, by effects. units: the strength of each form at which its gap equals the noise.
        choices: how many effects a further one is chosen from; those that the record can show where 0.
    """

    problem: Problem
    effects: Mapping[str, Effect]
    unknown: Unknowns
    hypotheses: dict[frozenset[str], Hypothesis] = field(default_factory=dict)
    units: dict[Form, float] = field(default_factory=dict)
    choices: int = 0
    forms: dict[str, tuple[Form, ...]] = field(init=False)

    def __post_init__(self) -> None:
        rows = self.problem.rows
        lacking = {"phase": not rows.has_phase, "sweep": rows.at_resonance, "third": "third" not in rows.channels}
        lacking["masses"] = not np.ptp(rows.added)
        asked = {name: effect for name, effect in self.effects.items() if not lacking.get(effect.need, False)}
        self.forms = {name: own for name, effect in asked.items() if (own := effect.forms(self.problem.scales))}
        self.choices = self.choices or len(self.forms)

    def run(self) -> Search:
        """Fit the simulation alone, every effect, and combinations."""
        self.singles()
        self.combine()
        return self

    def combine(self) -> None:
        """Add effects to what was fitted as long as the data demand them."""
        if not leaves_noise(self.hypotheses[frozenset()]):
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
        base = self.hypotheses[frozenset()]
        names = [name for name in reversed(self.forms) if self.effects[name].corrects or name == AMPLITUDE_SCALE.name]
        for name in sorted(names, key=lambda name: name == AMPLITUDE_SCALE.name)[: self._most_effects()]:
            if base.key | {name} not in self.hypotheses:
                self.extend(base, name)
            base = self.hypotheses.get(base.key | {name}, base)

    def _shorten(self) -> None:
        """Fit the most probable explanation without each of its effects, and go on from what is more probable so.

        An effect that was added first may have stood for those that came later.
        """
        leading = self.ranked()[0]
        for name in leading.effects[:-1]:
            self.drop(leading, name)
        if len(self.ranked()[0].effects) < len(leading.effects):
            self._shorten()

    def drop(self, hypothesis: Hypothesis, name: str) -> Hypothesis:
        """A hypothesis without one of its effects, from its modes: a fit far behind it may have lost its own."""
        effects = tuple(other for other in hypothesis.effects if other != name)
        before = self.hypotheses.get(frozenset(effects))
        if before is not None and before.log_evidence > hypothesis.log_evidence - _LOST:
            return before
        fits = [fit_roughly(*drop_effect(fit, name)) for fit in hypothesis.near]
        again = self._store(effects, polish_fits(list(chain.from_iterable(fits))), len(self.forms[effects[-1]]))
        if before is not None and before.log_posterior > again.log_posterior:
            self.hypotheses[before.key] = before
        return self.hypotheses[again.key]

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

    def again(self, problem: Problem, unknown: Unknowns, kept: BoolArray | None = None) -> Search:
        """The same best hypotheses fitted to another problem, from the modes found: no other is tried.

        Strengths keep their units, so that priors stay what they are. ``kept``: which rows the problem has of this one.
        """
        other = Search(problem, self.effects, unknown, units=self.units)
        sweeps = np.unique(self.problem.rows.sweep[slice(None) if kept is None else kept])
        ranked = self.ranked()
        probable = [own for own in ranked[:_AGAIN] if own.log_posterior > ranked[0].log_posterior - _LOST_AGAIN]
        simple = [hypothesis for hypothesis in ranked if len(hypothesis.effects) == 1][:_AGAIN_SIMPLE]
        worth = {hypothesis.key: hypothesis for hypothesis in (self.hypotheses[frozenset()], *simple, *probable)}
        for hypothesis in sorted(worth.values(), key=lambda hypothesis: -hypothesis.log_posterior):
            fits = []
            for fit in hypothesis.near:
                at = fit.model.at if kept is None or fit.model.at is None else fit.model.at[kept]
                model = replace(fit.model, problem=problem, scatter=unknown.first, at=at)
                z = fit.y[model.size :].reshape(2, -1)[:, sweeps].reshape(1, -1)
                fits.append(fit_roughly(model, fit.y[np.newaxis, : model.size], z))
            other._store(hypothesis.effects, list(chain.from_iterable(fits)), hypothesis.forms)
        return other

    def ranked(self) -> list[Hypothesis]:
        """All hypotheses, most probable first."""
        return sorted(self.hypotheses.values(), key=lambda hypothesis: -hypothesis.log_posterior)

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
        leading, *others = self.ranked()[:MOST_SWAPPED]
        for own in (leading, *(other for other in others if other.log_posterior > leading.log_posterior - NEAR)):
            for way in ways.get(own.key, []):  # another way may lead to a better mode
                kept = self.hypotheses[own.key]
                if (*way.base.effects, way.name) != kept.effects:
                    self.extend(way.base, way.name, way.starts)
                    if kept.log_posterior >= self.hypotheses[own.key].log_posterior:
                        self.hypotheses[own.key] = kept

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

    def extend(self, base: Hypothesis, name: str, candidates: list[list[Start]] | None = None) -> None:
        """Fit a hypothesis with one more effect, from the best starts of each of its forms."""
        candidates = candidates or list_starts(base.plain, self.forms[name], self.units)
        rough = float(np.sqrt(np.mean(base.plain.measured**2)))
        if np.any(np.abs(base.plain.y[base.plain.model.size :]) > _APART):
            rough = max(rough, _ROUGH * _APART)  # sweeps that lie apart hide a gap in their deviations
        promising = choose_forms(candidates, _MOST_FORMS_BESIDE if base.effects else _MOST_FORMS, rough > _ROUGH)
        fits: list[ModelFit] = []
        for tried, fit in product(promising, base.near[:_MOST_BASES]):
            fits += self._fits(fit, tried, rough, base, max((own.log_posterior for own in fits), default=-np.inf))
        if fits:
            top = max(fit.log_evidence for fit in fits)
            worth = [fit for fit in fits if fit.log_evidence > top - _CLOSE_MODES]
            known = max(hypothesis.log_evidence for hypothesis in self.hypotheses.values())
            if worth := polish_fits(worth) if top > known - _LOST else worth:  # none where their own motion is lost
                self._store((*base.effects, name), worth, len(candidates))

    def _fits(self, fit: ModelFit, tried: list[Start], rough: float, base: Hypothesis, rival: float) -> list[ModelFit]:
        """Modes of a fit's model with one more form, none far behind a ln posterior ``rival``."""
        own = [start.x for start in tried[:_STARTS]]
        if rough > _ROUGH:
            own += [at_gap(start, rough * by) for start in tried[:2] for by in (0.3, 1.0, 3.0)]
            own += [at_gap(start, size / start.part.unit) for start in tried[:2] for size in start.part.form.sizes]
        head = fit.y[: fit.model.size] if base.effects else np.zeros(fit.model.size)
        x = np.array([np.concatenate([head, start]) for start in own])
        parts = (*fit.model.parts, tried[0].part)
        models = [replace(fit.model, parts=parts, at=None)]
        if not models[0].terms(x[:1]).linear:
            forms = [(i, part.form.twin) for i, part in enumerate(parts) if part.form.twin]
            twins = [(*parts[:i], replace(parts[i], form=twin), *parts[i + 1 :]) for i, twin in forms]
            models += [replace(models[0], parts=twin) for twin in twins]
        z = np.zeros((len(x), 2 * fit.model.sweeps))
        if base.effects:  # what the fit says of the sweeps may hold beside one more effect, or hide what it explains
            rival = max(rival, fit.log_posterior)
            x, z = np.concatenate([x, x]), np.concatenate([z, z + fit.y[fit.model.size :]])
        return list(chain.from_iterable(fit_roughly(model, x, z, rival=rival) for model in models))

    def _store(self, effects: tuple[str, ...], fits: list[ModelFit], forms: int) -> Hypothesis:
        """Weigh the modes of all ``forms`` that the last effect may have, and remember the hypothesis."""
        top = max(fit.log_evidence for fit in fits)
        plain = [fit for fit in fits if fit.log_evidence > top - _CLOSE_MODES]
        least = max((hypothesis.log_evidence for hypothesis in self.hypotheses.values()), default=-np.inf) - _WORTH
        near = [marginalise_scatter(fit, self.unknown, least) for fit in plain]
        first = int(np.argmax([fit.log_evidence for fit in near]))
        evidence = float(logsumexp([fit.log_evidence for fit in near])) - float(np.log(forms))
        prior = np.log(PRIOR_NULL) if not effects else -(len(effects) - 1) * np.log(self.choices + 1.0)
        prior += sum(np.log(self.effects[name].prior) for name in effects)
        best = plain[first]
        least = best.log_evidence - _CLOSE
        rest = [fit for fit in plain if fit.model.parts != best.model.parts and fit.log_evidence > least]
        others = tuple(sorted(rest, key=lambda fit: -fit.log_evidence)[:1])  # the nearest of other forms
        hypothesis = Hypothesis(effects, near[first], best, others, evidence, evidence + float(prior), forms)
        self.hypotheses[hypothesis.key] = hypothesis
        return hypothesis
