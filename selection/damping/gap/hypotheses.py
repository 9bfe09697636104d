"""Fitted hypotheses, additions of effects to them, and the order in which combinations are tried.

The derivative of the residuals by a further effect, at an existing fit, gives its start values and its linear gain.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from damping.arrays import FloatArray
from damping.effects.contract import Form
from damping.gap.fit import ModelFit
from damping.gap.model import SPREAD, TYPICAL_GAP, Part
from damping.gap.unknowns import spread

NEAR = 4.0  #: A hypothesis within these log odds of the most probable one is near it.
#: A fit leaves no more than noise where the spread of its m residuals is below 1 + ``FITTING``/sqrt(m), two standard
#: errors above 1.
FITTING = 1.6
_MOST_FIRST = 4  #: Combinations with bases that leave only noise that are tried before others.
_MOST_OF_A_BASE = 4  #: Combinations with one base that are tried before those with others.
_SMALL = 1e-3  #: Strength, as a share of its natural size, for the derivative by an effect.
_NONE = -60.0  #: ln of a strength that is practically zero.
#: Standard normal variables of the strength from which forms that replace something are started, (sizes, 1).
_SIZES = np.array([[0.0], [-1.2], [1.2], [-2.4], [2.4]])
_LOW = 0.3  #: Smallest start value of the gap that an effect opens, in units of noise.
_HIGH = 60.0  #: Largest start value of that gap by the linear gain.
_FARTHEST = 3000.0  #: Largest start value of that gap where it is given.
#: First-order gap of the natural strength, in units of noise, below which an effect has no first-order gap.
_UNSEEN_GAP = 1e-3
_FAR = 0.2  #: A form is worth a fit if its linear gain exceeds this share of the largest, less ``SURE``.
SURE = 50.0  #: Difference in ln p that leaves no doubt, even between linear estimates.
_SLIGHT = 0.2  #: Least linear gain of a form worth a fit where the base fits nearly to the noise.


@dataclass(frozen=True)
class Start:
    """A form tried at a fit: its part, the variables to start from, and its linear gain in ln p."""

    part: Part
    x: FloatArray
    gain: float


Starts = list[list[Start]]  #: of an effect, those of each form apart


@dataclass(frozen=True)
class Hypothesis:
    """Effects with their best fit."""

    effects: tuple[str, ...]  #: names, in the order found; empty for the simulation alone
    best: ModelFit  #: the mode of largest evidence
    #: the best mode before scatter and noise were chosen, where scatter cannot hide the gap of an effect
    plain: ModelFit
    others: tuple[ModelFit, ...]  #: the best plain modes of other forms that are about as good
    log_evidence: float  #: natural logarithm, averaged over forms (and scatters, where they are not stated)
    log_posterior: float  #: log_evidence plus ln of the prior of the effects, not normalised

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
    return not hypothesis.plain.has_outlier_pattern and spread(r) < 1.0 + FITTING / np.sqrt(r.size)


class Addition(NamedTuple):
    """An effect ``name`` that is to be added to a ``base`` from ``starts``; ``expected``: log posterior of the two."""

    expected: float
    base: Hypothesis
    name: str
    starts: Starts


def order_combinations(additions: Mapping[frozenset[str], Sequence[Addition]]) -> list[frozenset[str]]:
    """Combinations in the order in which they are tried, by the first addition that leads to each.

    Linear gains are largest where the fit is worst. So a few combinations with each base come first, and before them a
    few with a base that leaves only noise.
    """
    ordered = sorted(additions, key=lambda key: -additions[key][0].expected)
    of_base = Counter[frozenset[str]]()
    late = set[frozenset[str]]()
    for key in ordered:
        base = additions[key][0].base.key
        of_base[base] += 1
        if of_base[base] > _MOST_OF_A_BASE:
            late.add(key)
    first = [key for key in ordered if any(leaves_noise(addition.base) for addition in additions[key])][:_MOST_FIRST]
    return sorted(ordered, key=lambda key: (key not in first, key in late))


def list_starts(base: ModelFit, forms: Sequence[Form], units: Mapping[Form, float]) -> Starts:
    """Starts of one more effect beside those of a fit, for each of its ``forms``.

    ``units``: strength of each form that opens a gap of one unit of noise, d.d unit^2 = number of residuals; computed
    here where missing. The derivatives d of two forms that mirror each other have opposite signs.
    """
    directions: dict[str, tuple[FloatArray, FloatArray]] = {}
    tried: Starts = []
    for form in forms:
        if form.whole:
            tried.append(_list_whole_starts(base, form))
            continue
        shapes = np.array(list(product(*(shape.starts for shape in form.shapes))), dtype=float)
        if form.mirror in directions:
            r, d = directions[form.mirror]
            d = -d
        else:
            r, d = _differentiate(base, form, shapes)
            if form.mirror:
                directions[form.mirror] = r, d
        tried.append(_list_form_starts(base, form, shapes, r, d, units.get(form)))
    return tried


def _list_form_starts(
    base: ModelFit, form: Form, shapes: FloatArray, r: FloatArray, d: FloatArray, unit: float | None
) -> list[Start]:
    """Starts of a form, one for every start of its shapes, the best first.

    The derivative d of the residuals r by the strength is projected free of the fitted variables, by their posterior.
    The strength is then -d.r/d.d and the gain (d.r)^2/(2 d.d).
    """
    squared, pull = _project(base, form, r, d)
    strength = -pull / squared
    gain = np.where(strength > 0.0, 0.5 * pull**2 / squared, 0.0)
    if unit is None:
        middle = int(np.argmin(np.sum(shapes**2, axis=1)))
        opened = form.natural * float(np.sqrt(squared[middle] / base.measured.size))
        # an effect with a threshold has no first-order gap: its natural strength then opens the typical gap
        unit = form.natural / (opened if opened > _UNSEEN_GAP else TYPICAL_GAP)
    s = np.log(np.clip(strength / unit, _LOW, _HIGH) / TYPICAL_GAP) / SPREAD
    part = Part(form, unit)
    starts = [Start(part, np.array([s[i], *shapes[i]]), float(gain[i])) for i in range(len(shapes))]
    return sorted(starts, key=lambda start: -start.gain)


def _list_whole_starts(base: ModelFit, form: Form) -> list[Start]:
    """Starts of a form that replaces something, of several sizes, the best first; gains are those of the whole step."""
    part, k = Part(form, form.natural / TYPICAL_GAP), base.model.size
    model, y = replace(base.model, parts=(*base.model.parts, part)), np.repeat(base.y[np.newaxis], len(_SIZES), axis=0)
    d = model.residuals(np.hstack([y[:, :k], _SIZES, y[:, k:]]), len(y)).r - base.r
    squared, pull = _project(base, form, base.r[np.newaxis], d)
    gain = np.where(pull < 0.0, 0.5 * pull**2 / squared, 0.0)
    starts = [Start(part, size, float(of_size)) for size, of_size in zip(_SIZES, gain, strict=True)]
    return sorted(starts, key=lambda start: -start.gain)


def find_gain(starts: Sequence[Sequence[Start]]) -> float:
    """The largest linear gain of an effect with the ``starts`` of each of its forms."""
    return max(start.gain for of_form in starts for start in of_form)


def at_gap(start: Start, gap: float) -> FloatArray:
    """Variables of a start whose strength opens the ``gap``, in units of noise."""
    return np.array([np.log(np.clip(gap, _LOW, _FARTHEST) / TYPICAL_GAP) / SPREAD, *start.x[1:]])


def choose_forms(candidates: Starts, most: int, rough: bool) -> Starts:
    """Forms worth a fit: ``most`` by linear gain and, where the gap is large, those with no useful linear gain."""
    ranked = sorted(candidates, key=lambda tried: -tried[0].gain)
    least = ranked[0][0].gain * _FAR - SURE
    beyond_lines = [tried for tried in ranked[most:] if tried[0].part.form.sizes and rough]
    near = [tried for tried in ranked[:most] if tried[0].gain > least or tried[0].part.form.sizes]
    return [tried for tried in near + beyond_lines if rough or tried[0].gain > _SLIGHT]


def _differentiate(base: ModelFit, form: Form, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals with the form at strength zero, and their derivative by the strength, (1 or starts, m) each."""
    k = base.model.size
    model = replace(base.model, parts=(*base.model.parts, Part(form, form.natural / TYPICAL_GAP)))
    y = np.repeat(base.y[np.newaxis, :], len(shapes), axis=0)

    def residuals(strength: float) -> FloatArray:
        x = np.full((len(shapes), 1), strength / SPREAD)
        return model.residuals(np.hstack([y[:, :k], x, shapes, y[:, k:]]), len(y)).r

    zero = residuals(_NONE) if form.replaces else base.r[np.newaxis]
    return zero, (residuals(float(np.log(_SMALL))) - zero) / (_SMALL * form.natural)


def _project(base: ModelFit, form: Form, r: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """d.d and d.r with the robust weights, projected free of the fitted variables except one that the form replaces."""
    inverse = base.covariance
    if form.replaces:  # that variable held at zero
        k = base.model.problem.simulation.names.index(form.replaces)
        inverse = inverse - np.outer(inverse[k], inverse[k]) / inverse[k, k]
    weighted = d * base.weights
    shared = weighted @ base.J
    freed = shared @ inverse
    squared = np.sum(weighted * d, axis=1) - np.sum(freed * shared, axis=1)
    gradient = (r * base.weights) @ base.J + base.y
    pull = np.sum(weighted * r, axis=1) - np.sum(freed * gradient, axis=1)
    return np.maximum(squared, 1e-9 / form.natural**2), pull
