"""Where to start the fit of one more effect, and how much it could gain: its direction at a fit already made."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from damping.arrays import FloatArray
from damping.effects.contract import Form
from damping.gap.fit import ModelFit
from damping.gap.model import SPREAD, TYPICAL_GAP, Part

#: Strength, as a share of its natural size, at which the direction of an effect is taken; and one that is none.
_SMALL = 1e-3
_NONE = -60.0
#: Range of start values of the gap an effect opens, in units of noise.
_LOW = 0.3
_HIGH = 60.0
_FARTHEST = 3000.0
#: Gap of the natural strength, in units of noise and to first order, below which an effect opens none at first.
_UNSEEN_GAP = 1e-3
#: Forms are worth a fit whose linear gain is this share of the largest, less ``SURE``; near the noise only those that
#: gain more than ``_SLIGHT``.
_FAR = 0.2
SURE = 50.0
_SLIGHT = 0.2


@dataclass(frozen=True)
class Start:
    """A form tried at a fit: its part, the variables to start from, and its linear gain in ln p."""

    part: Part
    x: FloatArray
    gain: float


def list_starts(base: ModelFit, forms: Sequence[Form], units: Mapping[Form, float]) -> list[list[Start]]:
    """Starts of one more effect beside those of a fit, for each of its ``forms``.

    ``units``: strength of each form that opens a gap of one unit of noise, d.d unit^2 = number of residuals; found
    here where it is not known. Of two forms that mirror each other one direction d is that of the other, turned.
    """
    directions: dict[str, tuple[FloatArray, FloatArray]] = {}
    tried = []
    for form in forms:
        shapes = np.array(list(product(*(shape.starts for shape in form.shapes))), dtype=float)
        if form.mirror in directions:
            r, d = directions[form.mirror]
            d = -d
        else:
            r, d = _direction(base, form, shapes)
            directions |= {form.mirror: (r, d)} if form.mirror else {}
        tried.append(_starts(base, form, shapes, r, d, units.get(form)))
    return tried


def _starts(
    base: ModelFit, form: Form, shapes: FloatArray, r: FloatArray, d: FloatArray, unit: float | None
) -> list[Start]:
    """Starts of a form, one for every start of its shapes, the best first.

    The derivative d of the residuals r by the strength is freed of what the fitted variables can do (projected by
    their posterior). The strength is then -d.r/d.d and the gain (d.r)^2/(2 d.d).
    """
    squared, pull = _projected(base, form, r, d)
    strength = -pull / squared
    gain = np.where(strength > 0.0, 0.5 * pull**2 / squared, 0.0)
    if unit is None:
        middle = int(np.argmin(np.sum(shapes**2, axis=1)))
        opened = form.natural * float(np.sqrt(squared[middle] / base.measured.size))
        # an effect that begins beyond a threshold opens nothing at first: its natural size is then the typical one
        unit = form.natural / (opened if opened > _UNSEEN_GAP else TYPICAL_GAP)
    s = np.log(np.clip(strength / unit, _LOW, _HIGH) / TYPICAL_GAP) / SPREAD
    part = Part(form, unit)
    starts = [Start(part, np.array([s[i], *shapes[i]]), float(gain[i])) for i in range(len(shapes))]
    return sorted(starts, key=lambda start: -start.gain)


def at_gap(start: Start, gap: float) -> FloatArray:
    """Variables of a start whose strength opens the ``gap``, in units of noise."""
    return np.array([np.log(np.clip(gap, _LOW, _FARTHEST) / TYPICAL_GAP) / SPREAD, *start.x[1:]])


def choose_forms(candidates: list[list[Start]], most: int, rough: bool) -> list[list[Start]]:
    """Forms worth a fit: ``most`` of the largest linear gain; where the gap is large those it says nothing of, too."""
    ranked = sorted(candidates, key=lambda tried: -tried[0].gain)
    least = ranked[0][0].gain * _FAR - SURE
    beyond_lines = [tried for tried in ranked[most:] if tried[0].part.form.sizes and rough]
    near = [tried for tried in ranked[:most] if tried[0].gain > least or tried[0].part.form.sizes]
    return [tried for tried in near + beyond_lines if rough or tried[0].gain > _SLIGHT]


def _direction(base: ModelFit, form: Form, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals with the form at strength zero, and their derivative by the strength, (starts, m) each."""
    k = base.model.size
    model = replace(base.model, parts=(*base.model.parts, Part(form, form.natural / TYPICAL_GAP)))
    y = np.repeat(base.y[np.newaxis, :], len(shapes), axis=0)

    def residuals(strength: float) -> FloatArray:
        x = np.full((len(shapes), 1), strength / SPREAD)
        return model.residuals(np.hstack([y[:, :k], x, shapes, y[:, k:]]), len(y)).r

    none = residuals(_NONE) if form.replaces else base.r[np.newaxis]
    return none, (residuals(float(np.log(_SMALL))) - none) / (_SMALL * form.natural)


def _projected(base: ModelFit, form: Form, r: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
    """d.d and d.r with the robust weights, freed of the variables of the fit but one that the form replaces."""
    inverse = base.covariance
    if form.replaces:  # that variable held at zero
        k = base.model.problem.simulation.names.index(form.replaces)
        inverse = inverse - np.outer(inverse[k], inverse[k]) / inverse[k, k]
    weighted = d * base.weights
    freed = weighted @ base.J @ inverse
    squared = np.sum(weighted * d, axis=1) - np.sum(freed * (weighted @ base.J), axis=1)
    gradient = (r * base.weights) @ base.J + base.y
    pull = np.sum(weighted * r, axis=1) - np.sum(freed * gradient, axis=1)
    return np.maximum(squared, 1e-9 / form.natural**2), pull
