"""Fits of hypotheses on demand, kept for reuse: with a further effect, without one, or to another problem.

The evidence penalises every free shape and strength of a hypothesis (MacKay 1992), the prior every effect.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from typing import Any, Self

import numpy as np
from scipy.special import logsumexp

from damping.arrays import BoolArray
from damping.effects import list_forms
from damping.effects.contract import Effect, Form
from damping.gap.fit import ModelFit, drop_effect, fit_roughly, polish_fits
from damping.gap.hypotheses import NEAR, Hypothesis, Start, Starts, at_gap, choose_forms, list_starts
from damping.gap.model import SPREAD, Problem
from damping.gap.unknowns import Unknowns, marginalise_scatter
from damping.progress import nothing

#: Prior odds of the simulation alone against any one effect; each further effect costs a factor, the number of effects.
PRIOR_NULL = 25.0
_CLOSE_MODES = 10.0  #: Modes whose ln evidence is within this of the best are weighed.
_CLOSE = 3.0  #: Another form of an effect whose ln evidence is within this is kept when effects are added.
#: A hypothesis farther behind the best in ln evidence is not refitted at its best scatter and noise. Where levels
#: scatter by per cents, the evidence estimated from a fit at the smallest scatter is too low by up to about 120.
_WORTH = 200.0
_LOST = 100.0  #: A fit farther behind the best in ln evidence is not polished at its own motion.
_MOST_REFITTED = 8  #: Most probable hypotheses that are fitted to another problem too.
_MOST_SIMPLE = 3  #: Most probable hypotheses with one effect that are fitted to it as well.
_LOST_REFITTED = 30.0  #: A hypothesis farther behind the best in ln p is not among the most probable of all.
_STARTS = 4  #: Starts of each form that are fitted.
_MOST_FORMS = 8  #: Most forms of an effect alone that are fitted, those of the largest linear gain.
_MOST_FORMS_BESIDE = 3  #: Most forms of an effect beside others that are.
_MOST_BASES = 2  #: Modes of a hypothesis to which a further effect is added.
_ROUGH = 1.5  #: From this misfit of the base, in units of noise, starts of other sizes are fitted too.
_APART = 3.0  #: Deviation of a sweep, in units of repeatability, beyond which it hides something.


@dataclass
class Fits:
    """The hypotheses of a problem, fitted on demand and kept."""

    #: ``problem``, ``effects``: the record with its simulation, and the library
    problem: Problem
    effects: Mapping[str, Effect]
    unknown: Unknowns  #: candidates of scatter and noise
    hypotheses: dict[frozenset[str], Hypothesis] = field(default_factory=dict)  #: fitted ones, by effects
    units: dict[Form, float] = field(default_factory=dict)  #: strength of each form at which its gap equals the noise
    choices: int = 0  #: number of effects a further one is chosen from; if 0, the number that the record can show
    done: Callable[[str], None] = nothing  #: reports each hypothesis that was fitted
    forms: dict[str, tuple[Form, ...]] = field(init=False)  #: forms of each effect that the record can show
    extended: dict[str, list[Hypothesis]] = field(init=False, default_factory=dict)  #: bases extended by each effect

    def __post_init__(self) -> None:
        rows, scales = self.problem.rows, self.problem.scales
        lacking = {"phase": not rows.has_phase, "sweep": rows.at_resonance, "third": "third" not in rows.channels}
        lacking["masses"] = not np.ptp(rows.added)
        lacking["beyond"] = lacking["third"] and lacking["masses"]
        asked = {name: effect for name, effect in self.effects.items() if not lacking.get(effect.need, False)}
        self.forms = {name: forms for name, effect in asked.items() if (forms := list_forms(effect, scales))}
        self.choices = self.choices or len(self.forms)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"done": nothing}  # a finished search reports no more, also where it is sent

    def drop(self, hypothesis: Hypothesis, name: str) -> Hypothesis:
        """A hypothesis without one of its effects, fitted from its modes unless a fit not far behind it exists."""
        effects = tuple(other for other in hypothesis.effects if other != name)
        before = self.hypotheses.get(frozenset(effects))
        if before is not None and before.log_evidence > hypothesis.log_evidence - NEAR:
            return before
        starts = [drop_effect(fit, name) for fit in hypothesis.near]
        fits = list(chain.from_iterable(fit_roughly(*start) for start in starts))
        if not fits:  # the remaining effects may have no steady state: start from zero
            model, x, _ = starts[0]
            fits = fit_roughly(model, np.zeros_like(x))
        again = self._store(effects, polish_fits(fits))
        self._restore(before)
        return self.hypotheses[again.key]

    def refit(self, problem: Problem, unknown: Unknowns, kept: BoolArray | None = None, larger: float = 1.0) -> Self:
        """The best hypotheses fitted to another problem, from their modes here; no other hypothesis is tried.

        Strengths keep their units, so priors do not change. ``kept``: rows of this problem that the other one has.
        ``larger``: factor on the variance of its noise, by which odds are smaller.
        """
        make, ranked = partial(type(self), units=self.units, choices=self.choices, done=self.done), self.ranked()
        other = make(problem, self.effects, unknown)
        least = ranked[0].log_posterior - larger * _LOST_REFITTED
        probable = [hypothesis for hypothesis in ranked[:_MOST_REFITTED] if hypothesis.log_posterior > least]
        simple = [hypothesis for hypothesis in ranked if len(hypothesis.effects) == 1][:_MOST_SIMPLE]
        keys = {frozenset(), *(hypothesis.key for hypothesis in (*simple, *probable))}
        for hypothesis in ranked:
            if hypothesis.key in keys:
                other.adopt(hypothesis, kept)
        return other

    def adopt(self, hypothesis: Hypothesis, kept: BoolArray | None = None) -> None:
        """Fit a hypothesis of another problem, or of other noise, from its modes, with strengths in units of this one.

        ``kept``: rows of the other problem that this one has; all where None.
        """
        fits: list[ModelFit] = []
        rows = slice(None) if kept is None else kept
        for fit in hypothesis.near:
            sweeps = np.unique(fit.model.problem.rows.sweep[rows])
            at = None if fit.model.at is None else fit.model.at[rows]
            parts = tuple(replace(part, unit=self.units.get(part.form, part.unit)) for part in fit.model.parts)
            model = replace(fit.model, problem=self.problem, scatter=self.unknown.first, at=at, parts=parts)
            x = fit.y[np.newaxis, : model.size].copy()
            for part, (before, variables) in zip(parts, fit.model.own_variables(x), strict=True):
                variables[:, 0] += np.log(before.unit / part.unit) / SPREAD
            z = fit.y[model.size :].reshape(2, -1)[:, sweeps].reshape(1, -1)
            fits += fit_roughly(model, x, z)
        if fits:  # none where it has no steady state at the rows of this problem
            self._store(hypothesis.effects, fits)

    def ranked(self) -> list[Hypothesis]:
        """All hypotheses, most probable first."""
        return sorted(self.hypotheses.values(), key=lambda hypothesis: -hypothesis.log_posterior)

    @property
    def leading(self) -> Hypothesis:
        """The most probable hypothesis."""
        return self.ranked()[0]

    def extend(self, base: Hypothesis, name: str, starts: Starts | None = None, rival: float = -np.inf) -> None:
        """Fit a hypothesis with one more effect, from the best ``starts`` of each of its forms.

        It is given up where first fits stay far behind a ln posterior ``rival`` of another.
        """
        self.extended.setdefault(name, []).append(base)
        misfit = float(np.sqrt(np.mean(base.plain.measured**2)))
        if np.any(np.abs(base.plain.y[base.plain.model.size :]) > _APART):
            misfit = max(misfit, _ROUGH * _APART)  # outlying sweeps can hide a gap in their deviations
        most = _MOST_FORMS_BESIDE if base.effects else _MOST_FORMS
        fits: list[ModelFit] = []
        for of_form in choose_forms(starts or self.list_starts(base, name), most, misfit > _ROUGH):
            for fit in base.near[:_MOST_BASES]:
                rival = max([rival, *(mode.log_posterior for mode in fits)])
                fits += self._fit_form(fit, of_form, misfit, rival)
        if fits:
            top = max(fit.log_evidence for fit in fits)
            close = [fit for fit in fits if fit.log_evidence > top - _CLOSE_MODES]
            known = max(hypothesis.log_evidence for hypothesis in self.hypotheses.values())
            if close := polish_fits(close) if top > known - _LOST else close:  # polishing may lose the motion
                self._store((*base.effects, name), close)

    def list_starts(self, base: Hypothesis, name: str) -> Starts:
        """Starts of one more effect beside those of a hypothesis, for each of its forms."""
        return list_starts(base.plain, self.forms[name], self.units)

    def extend_once(self, base: Hypothesis, name: str, starts: Starts | None = None, rival: float = -np.inf) -> None:
        """`extend`, unless these effects together have been fitted already."""
        if base.key | {name} not in self.hypotheses:
            self.extend(base, name, starts, rival)

    def improve(self, base: Hypothesis, name: str, starts: Starts | None = None) -> None:
        """`extend`, unless an earlier fit of the same effects is as probable, or would be repeated."""
        if any(base is before for before in self.extended.get(name, ())):
            return
        earlier = self.hypotheses.get(base.key | {name})
        self.extend(base, name, starts)
        self._restore(earlier)

    def _restore(self, earlier: Hypothesis | None) -> None:
        """Keep the ``earlier`` fit of a hypothesis if it is at least as probable as the present one."""
        if earlier and earlier.log_posterior >= self.hypotheses[earlier.key].log_posterior:
            self.hypotheses[earlier.key] = earlier

    def _fit_form(self, fit: ModelFit, starts: list[Start], misfit: float, rival: float) -> list[ModelFit]:
        """Modes of a fit's model with one more form; none where all are far behind a ln posterior ``rival``.

        ``misfit``: of the fit, in units of noise.
        """
        tried = [start.x for start in starts[:_STARTS]]
        if misfit > _ROUGH:
            tried += [at_gap(start, misfit * by) for start in starts[:2] for by in (0.3, 1.0, 3.0)]
            tried += [at_gap(start, size / start.part.unit) for start in starts[:2] for size in start.part.form.sizes]
        before = fit.y[: fit.model.size] if fit.effects else np.zeros(fit.model.size)
        x = np.array([np.concatenate([before, own]) for own in tried])
        parts = (*fit.model.parts, starts[0].part)
        models = [replace(fit.model, parts=parts, at=None)]
        if not models[0].terms(x[:1]).linear:
            for i, form in [(i, part.form.twin) for i, part in enumerate(parts) if part.form.twin]:
                twin = replace(parts[i], form=form)
                models.append(replace(models[0], parts=(*parts[:i], twin, *parts[i + 1 :])))
        z = np.zeros((len(x), 2 * fit.model.sweeps))
        if fit.effects:  # the fitted deviations of the sweeps may hold beside one more effect, or hide its gap
            rival = max(rival, fit.log_posterior)
            x, z = np.concatenate([x, x]), np.concatenate([z, z + fit.y[fit.model.size :]])
        return list(chain.from_iterable(fit_roughly(model, x, z, rival=rival) for model in models))

    def _store(self, effects: tuple[str, ...], fits: list[ModelFit]) -> Hypothesis:
        """Weigh the modes over all forms of the effects, and keep the hypothesis."""
        top = max(fit.log_evidence for fit in fits)
        plain = [fit for fit in fits if fit.log_evidence > top - _CLOSE_MODES]
        least = max((hypothesis.log_evidence for hypothesis in self.hypotheses.values()), default=-np.inf) - _WORTH
        marginal = [marginalise_scatter(fit, self.unknown, least) for fit in plain]
        first = int(np.argmax([fit.log_evidence for fit in marginal]))
        forms = float(np.sum(np.log([len(self.forms.get(name, ())) or 1 for name in effects])))
        evidence = float(logsumexp([fit.log_evidence for fit in marginal])) - forms
        prior = np.log(PRIOR_NULL) if not effects else -(len(effects) - 1) * np.log(self.choices + 1.0)
        prior += sum(np.log(self.effects[name].prior) for name in effects)
        best = plain[first]
        least = best.log_evidence - _CLOSE
        rivals = [fit for fit in plain if fit.model.parts != best.model.parts and fit.log_evidence > least]
        others = tuple(sorted(rivals, key=lambda fit: -fit.log_evidence)[:1])  # the best of other forms
        hypothesis = Hypothesis(effects, marginal[first], best, others, evidence, evidence + float(prior))
        self.hypotheses[hypothesis.key] = hypothesis
        self.done(" + ".join(effects) or "no effect")
        return hypothesis
