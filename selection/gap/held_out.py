"""How far the gap shrinks on levels that neither chose nor fitted the explanation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from selection.arrays import BoolArray, FloatArray
from selection.gap.fit import Fit
from selection.gap.model import Model, Problem
from selection.gap.problem import Setting
from selection.gap.search import Search
from selection.gap.size import nominal_residuals, refitted, regular_values, shrinkage, whitened

#: Most levels held out, the highest first; content of the interval.
MOST_FOLDS, CONTENT = 3, 0.9


@dataclass(frozen=True)
class Fold:
    """One level held out: what the others chose, and sums of the ``count`` squared whitened residuals of the level."""

    sweeps: tuple[str, ...]
    effects: tuple[str, ...]
    count: int
    nominal: float
    before: float
    after: float


@dataclass(frozen=True)
class HeldOut:
    """Held-out shrinkage over all folds.

    Attributes:
        scheme: in words. nominal, before, after: root mean squares of the simulation as given, refitted on the other
            levels, and with the explanation found there. shrinkage, low, high: with its interval; None where before
            is within its sampling error.
    """

    scheme: str
    folds: tuple[Fold, ...]
    nominal: float
    before: float
    after: float
    shrinkage: float | None
    low: float | None
    high: float | None


def held_out(setting: Setting, search: Search, leading: Fit) -> HeldOut | None:
    """Hold out each level in turn, the highest first, at most ``MOST_FOLDS``; None with one level.

    Every hypothesis of ``search`` is fitted again to the other levels, and the most probable of them is chosen there.
    ``leading`` is the fit to the whole record: its wild points are left out of the comparison, and nothing else.
    """
    rows = setting.problem.rows
    levels = np.unique(rows.level)[::-1][:MOST_FOLDS]
    if rows.levels < 2:
        return None
    regular = regular_values(leading)
    folds = tuple(_fold(setting, search, int(level), regular) for level in levels)
    values = sum(fold.count for fold in folds)
    nominal, before, after = (
        float(np.sqrt(sum(getattr(fold, name) for fold in folds) / values)) for name in ("nominal", "before", "after")
    )
    scheme = f"each of the {len(folds)} highest force levels predicted from all others, the highest first"
    if len(folds) == rows.levels:
        scheme = "each force level predicted from all others, the highest first"
    return HeldOut(scheme, folds, nominal, before, after, *_interval(before, after, values))


def _interval(before: float, after: float, values: int) -> tuple[float | None, float | None, float | None]:
    """Shrinkage with the interval from the sampling errors of the two mean squares."""
    middle = shrinkage(before, after, values)
    if middle is None:
        return None, None, None
    gained = before**2 - 1.0
    error = np.hypot(after**2, (1.0 - middle) * before**2) * np.sqrt(2.0 / values) / gained
    reach = float(norm.ppf(0.5 + 0.5 * CONTENT) * error)
    raw = 1.0 - (after**2 - 1.0) / gained
    return middle, float(min(raw - reach, middle)), float(max(middle, min(1.0, raw + reach)))


def _fold(setting: Setting, search: Search, level: int, regular: BoolArray) -> Fold:
    """Choose and fit without a level, and predict it."""
    whole = setting.problem
    out = whole.rows.level[whole.rows.sweep] == level
    train = replace(whole, rows=whole.rows.where(~out))
    test = replace(whole, rows=whole.rows.where(out))
    chosen = search.again(train, setting.unknowns).ranked()[0].best
    counted = regular[np.tile(out, regular.size // out.size)]
    after = _predicted(chosen, test)
    before = _predicted(refitted(chosen), test)
    nominal = nominal_residuals(replace(chosen, model=replace(chosen.model, problem=test)))
    sums = [float(np.sum(r[counted] ** 2)) for r in (nominal, before, after)]
    return Fold(test.rows.sweeps, chosen.effects, int(counted.sum()), *sums)


def _predicted(chosen: Fit, test: Problem) -> FloatArray:
    """Whitened residuals of rows that a fit has not seen."""
    model = Model(test, chosen.model.parts, replace(chosen.model.scatter, dispersion=1.0))
    y = np.concatenate([chosen.y[: chosen.model.size], np.zeros(2 * model.sweeps)])
    r, J = model.jacobian(y[np.newaxis])
    return whitened(r[0], J[0, :, model.size :])
