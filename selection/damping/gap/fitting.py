"""Fits of hypotheses, made on demand and remembered: of one with a further effect, without one, to another problem.

The evidence pays for every shape and strength that a hypothesis leaves free (MacKay 1992), the prior for every effect.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import chain, product
from typing import Self

import numpy as np
from scipy.special import logsumexp

from damping.arrays import BoolArray
from damping.effects import list_forms
from damping.effects.contract import Effect, Form
from damping.gap.fit import ModelFit, drop_effect, fit_roughly, polish_fits
from damping.gap.hypotheses import Hypothesis, Start, at_gap, choose_forms, list_starts
from damping.gap.model import SPREAD, Problem
from damping.gap.unknowns import Unknowns, marginalise_scatter

#: Prior odds of the simulation alone against any one effect; each further effect costs as much as there are effects.
PRIOR_NULL = 25.0
_CLOSE_MODES = 10.0  #: Modes whose evidence is within this of the best are weighed.
_CLOSE = 3.0  #: Another form of an effect whose evidence is within this is kept when effects are added.
_WORTH = 12.0  #: ln evidence behind the best from which a hypothesis is not fitted again at its own scatter and noise.
_LOST = 100.0  #: ln evidence behind the best from which predictions are not taken again at a fit's own motion.
#: Hypotheses, the most probable of all and of one effect, that are fitted to another problem too.
_AGAIN = 8
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


@dataclass
class Fits:
    """The hypotheses of a problem, fitted on demand and remembered.

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
        lacking["beyond"] = lacking["third"] and lacking["masses"]
        asked = {name: effect for name, effect in self.effects.items() if not lacking.get(effect.need, False)}
        self.forms = {name: own for name, effect in asked.items() if (own := list_forms(effect, self.problem.scales))}
        self.choices = self.choices or len(self.forms)

    def drop(self, hypothesis: Hypothesis, name: str) -> Hypothesis:
        """A hypothesis without one of its effects, from its modes: a fit far behind it may have lost its own."""
        effects = tuple(other for other in hypothesis.effects if other != name)
        before = self.hypotheses.get(frozenset(effects))
        if before is not None and before.log_evidence > hypothesis.log_evidence - _LOST:
            return before
        starts = [drop_effect(fit, name) for fit in hypothesis.near]
        fits = list(chain.from_iterable(fit_roughly(*start) for start in starts))
        if not fits:  # what is left of the effects may have no steady state: from none of them
            model, x, _ = starts[0]
            fits = fit_roughly(model, np.zeros_like(x))
        again = self._store(effects, polish_fits(fits), len(self.forms[effects[-1]]))
        if before is not None and before.log_posterior > again.log_posterior:
            self.hypotheses[before.key] = before
        return self.hypotheses[again.key]

    def again(self, problem: Problem, unknown: Unknowns, kept: BoolArray | None = None, larger: float = 1.0) -> Self:
        """The same best hypotheses fitted to another problem, from the modes found: no other is tried.

        Strengths keep their units, so that priors stay what they are. ``kept``: which rows the problem has of this one.
        ``larger``: by how much the variance of its noise is larger, and odds are smaller.
        """
        other = type(self)(problem, self.effects, unknown, units=self.units)
        ranked = self.ranked()
        least = ranked[0].log_posterior - larger * _LOST_AGAIN
        probable = [hypothesis for hypothesis in ranked[:_AGAIN] if hypothesis.log_posterior > least]
        simple = [hypothesis for hypothesis in ranked if len(hypothesis.effects) == 1][:_AGAIN_SIMPLE]
        worth = {hypothesis.key: hypothesis for hypothesis in (self.hypotheses[frozenset()], *simple, *probable)}
        for hypothesis in sorted(worth.values(), key=lambda hypothesis: -hypothesis.log_posterior):
            other.adopt(hypothesis, kept)
        return other

    def adopt(self, hypothesis: Hypothesis, kept: BoolArray | None = None) -> None:
        """Fit a hypothesis of another problem, or of other noise, from its modes, strengths in units of this one.

        ``kept``: which rows this problem has of the other; all where None.
        """
        fits: list[ModelFit] = []
        for fit in hypothesis.near:
            sweep = fit.model.problem.rows.sweep
            sweeps = np.unique(sweep if kept is None else sweep[kept])
            at = fit.model.at if kept is None or fit.model.at is None else fit.model.at[kept]
            parts = tuple(replace(part, unit=self.units.get(part.form, part.unit)) for part in fit.model.parts)
            model = replace(fit.model, problem=self.problem, scatter=self.unknown.first, at=at, parts=parts)
            x = fit.y[np.newaxis, : model.size].copy()
            for part, (before, own) in zip(parts, fit.model.own_variables(x), strict=True):
                own[:, 0] += np.log(before.unit / part.unit) / SPREAD
            z = fit.y[model.size :].reshape(2, -1)[:, sweeps].reshape(1, -1)
            fits += fit_roughly(model, x, z)
        if fits:  # none where the other problem's rows have no steady state of it
            self._store(hypothesis.effects, fits, hypothesis.forms)

    def ranked(self) -> list[Hypothesis]:
        """All hypotheses, most probable first."""
        return sorted(self.hypotheses.values(), key=lambda hypothesis: -hypothesis.log_posterior)

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
