"""How large the gap is: residuals whitened by noise and repeatability, and their root mean square.

Also how far it shrinks on held-out levels, which neither chose nor fitted the explanation.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from damping.arrays import BoolArray, FloatArray
from damping.effects import CATALOGUE
from damping.effects.contract import Terms
from damping.gap.corrected import CONTENT
from damping.gap.fit import ModelFit, fit_model
from damping.gap.hypotheses import Hypothesis
from damping.gap.model import Model, Problem, deviated
from damping.gap.problem import Setting
from damping.gap.scatter import OUTLYING
from damping.gap.search import Search
from damping.progress import Advance, Progress, silent

MOST_FOLDS = 3  #: most levels held out, the highest first
_CLOSED = 0.8  #: an explanation that closes less of the gap of the record than this share cannot fail held out
_FAILED = 0.5  #: largest share of the held-out gap that an explanation which fails there closes


@dataclass(frozen=True)
class Gap:
    """Root mean squares (1 = noise alone) and the share of the gap that the leading explanation closes."""

    nominal: float  #: the simulation as given
    before: float  #: refitted within its tolerance
    after: float  #: with the explanation
    #: 1 - max(after^2 - 1, 0)/(before^2 - 1); None where before^2 - 1 is within its sampling error
    shrinkage: float | None


def measure_gap(leading: ModelFit) -> Gap:
    """The gap of a record before and after its leading explanation, without outliers."""
    regular = regular_values(leading)
    nominal = float(np.sqrt(np.mean(nominal_residuals(leading)[regular] ** 2)))
    after = root_mean_square(leading, regular)
    # a robust fit, or one that did not converge, may leave more than least squares
    before = after if not leading.effects and after <= nominal else root_mean_square(refitted(leading), regular)
    after = after if leading.effects else before
    return Gap(nominal, before, after, shrinkage(before, after, int(regular.sum())))


def regular_values(fit: ModelFit) -> BoolArray:
    """Whether values (m,) are measured and not treated as stray readings by a fit."""
    measured = fit.model.problem.rows.measured
    return measured if fit.has_outlier_pattern else measured & ~fit.outliers


def shrinkage(before: float, after: float, values: int) -> float | None:
    """1 - max(after^2 - 1, 0)/(before^2 - 1); None where before^2 - 1 is below two of its standard errors."""
    if before**2 - 1.0 < 2.0 * np.sqrt(2.0 / values):
        return None
    return float(1.0 - max(after**2 - 1.0, 0.0) / (before**2 - 1.0))


def root_mean_square(fit: ModelFit, regular: BoolArray) -> float:
    """sqrt((|r|^2 + |z|^2)/n) of a fit: at its mode, that of residuals whitened by noise and repeatability."""
    z = fit.y[fit.model.size :]
    r = fit.r[regular] * fit.model.scatter.dispersion
    return float(np.sqrt((r @ r + z @ z) / regular.sum()))


def refitted(leading: ModelFit) -> ModelFit:
    """The simulation alone, refitted within its tolerance by least squares to the regular values of a fit."""
    model = _alone(leading)
    weights = regular_values(leading).astype(float)
    r, J = model.jacobian(np.zeros((1, model.size + 2 * model.sweeps)))
    C = J[0, :, model.size :]
    z = -np.linalg.solve(C.T @ (C * weights[:, np.newaxis]) + np.eye(2 * model.sweeps), C.T @ (weights * r[0]))
    far = np.where(np.abs(z) > OUTLYING, z, 0.0)  # too far for the bounded steps of a fit from zero
    starts = np.vstack([np.zeros_like(far), far])[: 1 + far.any()]
    return fit_model(model, np.zeros((len(starts), model.size)), starts, weights)[0]


def fitted_terms(fit: ModelFit, effects: bool = True, deviations: bool = True) -> Terms:
    """Terms of a fit, values (1, n), with or without its effects and the deviations of its sweeps."""
    names = fit.model.problem.simulation.names
    model, x = fit.model, fit.y[: fit.model.size]
    if not effects:
        replaced = {part.form.replaces for part in fit.model.parts}
        model = Model(fit.model.problem, (), fit.model.scatter)
        x = np.where([name in replaced for name in names], 0.0, fit.y[: len(names)])
    z = fit.y[fit.model.size :] * float(deviations)
    return deviated(model.terms(x[np.newaxis]), fit.model.problem.rows, z[np.newaxis], fit.model.scatter)


def nominal_residuals(leading: ModelFit) -> FloatArray:
    """Residuals (m,) of the nominal simulation, whitened by noise and the leading fit's repeatability."""
    model = _alone(leading)
    return _whiten_residuals(model, np.zeros(model.size))


def _alone(leading: ModelFit) -> Model:
    """The simulation alone, with the leading fit's repeatability and noise without dispersion."""
    return Model(leading.model.problem, (), replace(leading.model.scatter, dispersion=1.0))


def _whiten_residuals(model: Model, x: FloatArray) -> FloatArray:
    """Residuals at variables x (size,), sweeps without deviations, whitened by noise and repeatability."""
    r, J = model.jacobian(np.concatenate([x, np.zeros(2 * model.sweeps)])[np.newaxis])
    return whitened(r[0], J[0, :, model.size :])


def whitened(r: FloatArray, C: FloatArray) -> FloatArray:
    """(1 + C C^T)^(-1/2) r with the symmetric root, for which entries stay closest to their rows.

    Args:
        r: residuals in units of noise, (m,).
        C: their derivatives by deviations of sweeps in units of repeatability.
    """
    U, S, _ = np.linalg.svd(C, full_matrices=False)
    return np.asarray(r - U @ ((1.0 - 1.0 / np.sqrt(1.0 + S**2)) * (U.T @ r)))


@dataclass(frozen=True)
class HeldOutFold:
    """One level held out: the effects chosen without it, and sums of its ``count`` squared whitened residuals."""

    sweeps: tuple[str, ...]
    effects: tuple[str, ...]
    count: int
    nominal: float
    before: float
    after: float


@dataclass(frozen=True)
class HeldOut(Gap):
    """The gap over all held-out levels, refitted and explained by the others; ``scheme`` in words.

    ``low``, ``high``: interval of the shrinkage, of content `CONTENT`; None where the shrinkage is.
    """

    low: float | None
    high: float | None
    scheme: str
    folds: tuple[HeldOutFold, ...]


def describe_held_out(leading: Hypothesis, gap: Gap, held_out: HeldOut | None) -> list[str]:
    """The caution where an explanation closes the gap, but not on levels that did not choose it."""
    if held_out is None or held_out.shrinkage is None or gap.shrinkage is None:
        return []
    if _list_passing(leading.effects) or gap.shrinkage < _CLOSED or held_out.shrinkage > _FAILED:
        return []
    closed = f"{100.0 * held_out.shrinkage:.0f} %" if held_out.shrinkage > 0.0 else "none"
    others = {" + ".join(fold.effects) or "no effect" for fold in held_out.folds if set(fold.effects) != leading.key}
    if others:
        chosen = f"without one of them {' or '.join(sorted(others))} is chosen"
        return [f"the explanation depends on single levels: {chosen}, which closes {closed} of the held-out gap"]
    return [f"the explanation fails on held-out levels: it closes {closed} of their gap"]


def _list_passing(names: Sequence[str]) -> list[str]:
    """Those of the effects that are of one test, or of one level of it."""
    return [name for name in names if CATALOGUE[name].passing]


def hold_levels_out(setting: Setting, search: Search, leading: ModelFit, progress: Progress = silent) -> HeldOut | None:
    """Hold out each level in turn, the highest first, at most ``MOST_FOLDS``; None with one level.

    The best hypotheses of ``search`` are fitted again to the other levels, and the most probable one there is chosen.
    ``leading``: the fit to the whole record, whose outliers are left out of the comparison.
    """
    rows = setting.problem.rows
    levels = np.unique(rows.levels)[::-1][:MOST_FOLDS]
    if rows.level_count < 2:
        return None
    regular = regular_values(leading)
    with progress("holding levels out", len(levels)) as advance:
        folds = tuple(_fold(setting, search, int(level), regular, advance) for level in levels)
    values = sum(fold.count for fold in folds)
    nominal, before, after = (
        float(np.sqrt(sum(getattr(fold, name) for fold in folds) / values)) for name in ("nominal", "before", "after")
    )
    scheme = f"each of the {len(folds)} highest force levels predicted from all others, the highest first"
    if len(folds) == rows.level_count:
        scheme = "each force level predicted from all others, the highest first"
    if passing := _list_passing(leading.effects):
        scheme += f"; what {' and '.join(passing)} changes in one level, the others cannot predict"
    return HeldOut(nominal, before, after, *_interval(before, after, values), scheme, folds)


def _interval(before: float, after: float, values: int) -> tuple[float | None, float | None, float | None]:
    """Shrinkage with its interval, from the sampling errors of the two mean squares."""
    middle = shrinkage(before, after, values)
    if middle is None:
        return None, None, None
    gained = before**2 - 1.0
    error = np.hypot(after**2, (1.0 - middle) * before**2) * np.sqrt(2.0 / values) / gained
    reach = float(ndtri(0.5 + 0.5 * CONTENT) * error)
    raw = 1.0 - (after**2 - 1.0) / gained
    return middle, float(min(raw - reach, middle)), float(max(middle, min(1.0, raw + reach)))


def _fold(setting: Setting, search: Search, level: int, regular: BoolArray, advance: Advance) -> HeldOutFold:
    """Choose and fit a hypothesis without a level, and predict that level."""
    problem = setting.problem
    out = problem.rows.levels[problem.rows.sweep] == level
    train = replace(problem, rows=problem.rows.where(~out))
    test = replace(problem, rows=problem.rows.where(out))
    chosen = search.refit(train, setting.unknowns, ~out).leading.best
    counted = regular[np.tile(out, regular.size // out.size)]
    after, before = _predicted(chosen, test), _predicted(refitted(chosen), test)
    nominal = nominal_residuals(replace(chosen, model=replace(chosen.model, problem=test)))
    sums = [float(np.sum(r[counted] ** 2)) for r in (nominal, before, after)]
    advance(f"sweep {', '.join(test.rows.sweeps)}")
    return HeldOutFold(test.rows.sweeps, chosen.effects, int(counted.sum()), *sums)


def _predicted(chosen: ModelFit, test: Problem) -> FloatArray:
    """Whitened residuals of held-out rows."""
    model = Model(test, chosen.model.parts, replace(chosen.model.scatter, dispersion=1.0))
    return _whiten_residuals(model, chosen.y[: chosen.model.size])
