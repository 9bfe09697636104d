"""Maximum posterior by Levenberg-Marquardt steps with robust weights, several starts at once; Laplace evidence.

The weights are those of expectation maximisation for noise with outliers (`damping.gap.outliers`; Dempster, Laird and
Rubin 1977). The steps are those of Marquardt (1963), deviations of many sweeps eliminated sweep by sweep. The evidence
is Laplace's (Kass and Raftery 1995): with standard normal priors on every variable

    ln Z = ln p(data | y) - |y|^2/2 - ln det(H)/2,   H = J^T W J + 1 at the mode.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damping.arrays import BoolArray, FloatArray
from damping.gap.model import Model
from damping.gap.outliers import OUTLIER_WEIGHT, find_pattern, log_likelihood, robust_weights

_MOST_STEPS = 40  #: most steps of a fit
_SETTLED = 0.01  #: a fit has converged where a step lowers -ln(posterior) by less than this plus a share of its excess
_ROUGHLY = 1e-2  #: that share of first fits, of the excess over noise: a hundredth of it finds the same modes
_FINELY = 1e-3  #: that share of polished fits
_NOTHING = 1e-3  #: least promised gain in ln p of a step
_FIRST_DAMPING = 1e-2  #: damping (Marquardt's lambda) at the start
_EASED = 0.2  #: factor on the damping after a good step
_STIFFENED = 8.0  #: factor on the damping after a bad step
_DAMPED = 0.1  #: least damping after a bad step: less changes nothing
_STUCK = 1e3  #: damping at which a fit stops
#: Largest change of a variable (prior standard deviation 1) in one step, beyond which residuals are far from linear.
_LONGEST_STEP = 1.5
#: With more sweeps, their deviations, two of each, are eliminated sweep by sweep; with fewer, one dense solution is a
#: tenth faster.
_MANY = 24
_FAR_OFF = 1.5  #: robust scale of the residuals, over that of noise, from which a fit is far off
_TRIED = 4  #: most starts tried, those of least cost
_PATIENCE = 5  #: steps after which only the best starts go on
_SURVIVORS = 2  #: most starts that go on
_HOPELESS = 1.3  #: a start goes on if its cost is at most the best times this plus ``_BEHIND``
_BEHIND = 15.0  #: largest distance behind the best mode in ln p of a mode that is kept
_DIFFERENT = 0.5  #: least difference of two modes of the same parts, in standard deviations of a variable


@dataclass(frozen=True)
class ModelFit:
    """A mode of the posterior of a model."""

    model: Model  #: what was fitted
    y: FloatArray  #: variables at the mode (size + 2 sweeps,)
    r: FloatArray  #: residuals (m,)
    J: FloatArray  #: Jacobian (m, .)
    weights: FloatArray  #: robust weights (m,), 1 for a regular point
    #: ``log_posterior``, ``log_evidence``: natural logarithms
    log_posterior: float
    log_evidence: float
    covariance: FloatArray  #: of y

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(part.form.effect for part in self.model.parts)

    @property
    def measured(self) -> FloatArray:
        """Residuals of measured values; those of others are zero."""
        return self.r[self.model.problem.rows.measured]

    @property
    def freedom(self) -> float:
        """Residual degrees of freedom, at least 1: measured values less variables that data, not priors, determine."""
        return max(self.measured.size - len(self.y) + float(np.trace(self.covariance)), 1.0)

    @property
    def outliers(self) -> BoolArray:
        """Measured values (m,) that are taken for outliers."""
        return np.asarray(self.model.problem.rows.measured & (self.weights < OUTLIER_WEIGHT))

    @cached_property
    def outlier_pattern(self) -> str:
        """Where outliers lie that cannot be stray readings, in words; empty where all may be."""
        rows, noise = self.model.problem.rows, self.model.scatter.factor
        return find_pattern(rows, self.r, self.outliers, noise * rows.sd_amplitude) if self.outliers.any() else ""

    @property
    def has_outlier_pattern(self) -> bool:
        """Whether some outliers cannot be stray readings."""
        return bool(self.outlier_pattern)


def fit_model(
    model: Model, x: FloatArray, z: FloatArray | None = None, weights: FloatArray | None = None
) -> list[ModelFit]:
    """Distinct modes reached from starts x (starts, size), best first, with predictions at the fitted motion.

    Args:
        z: deviations of the sweeps to start from, (starts, 2 sweeps); zero where not given.
        weights: of the residuals (m,), for plain least squares; robust ones where not given.
    """
    return polish_fits(fit_roughly(model, x, z, weights), weights)


def fit_roughly(
    model: Model, x: FloatArray, z: FloatArray | None = None, weights: FloatArray | None = None, rival: float = -np.inf
) -> list[ModelFit]:
    """`fit_model` with predictions at measured amplitudes; empty if all stay far behind a ln posterior ``rival``."""
    deviations = np.zeros((len(x), 2 * model.sweeps)) if z is None else z
    weights = _weigh_peaks(model) if weights is None else weights
    y, r, J = _climb(model, np.concatenate([x, deviations], axis=1), weights, -rival)
    return _list_distinct([_fit(model, y[k], r[k], J[k], weights) for k in range(len(y))])


def polish_fits(rough: list[ModelFit], weights: FloatArray | None = None) -> list[ModelFit]:
    """Fits repeated with predictions at their own motion, which is free of the noise of measured amplitudes."""
    fits = []
    for fit in rough:
        model = fit.model.at_motion(fit.y)
        fixed = _weigh_peaks(model) if weights is None else weights
        y, r, J = _climb(model, fit.y[np.newaxis].copy(), fixed, share=_FINELY)
        fits.append(_fit(model, y[0], r[0], J[0], fixed))
    return _list_distinct(fits)


def drop_effect(fit: ModelFit, name: str) -> tuple[Model, FloatArray, FloatArray]:
    """The model of a fit without an effect, with variables and deviations of the sweeps to start from."""
    model, y = fit.model, fit.y[np.newaxis]
    kept = [x for part, x in model.own_variables(y) if part.form.effect != name]
    x = np.hstack([y[:, : len(model.problem.simulation.names)], *kept])
    parts = tuple(part for part in model.parts if part.form.effect != name)
    return replace(model, parts=parts, at=None), x, y[:, model.size :]


def _weigh_peaks(model: Model) -> FloatArray | None:
    """Weights of 1 for peaks alone, since any simulation fits the three that two outliers would leave; else None."""
    rows = model.problem.rows
    return np.ones(rows.measured.size) if rows.of_peaks else None


def _list_distinct(fits: list[ModelFit]) -> list[ModelFit]:
    """Fits that differ, best first, without those that are far behind."""
    distinct: list[ModelFit] = []
    for fit in sorted(fits, key=lambda fit: -fit.log_posterior):
        same = [other for other in distinct if other.model.parts == fit.model.parts]
        if all(np.max(np.abs(fit.y - other.y) / np.sqrt(np.diag(other.covariance))) > _DIFFERENT for other in same):
            distinct.append(fit)
    return [fit for fit in distinct if fit.log_posterior > distinct[0].log_posterior - _BEHIND]


def _climb(
    model: Model, y: FloatArray, weights: FloatArray | None, rival: float = np.inf, share: float = _ROUGHLY
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Damped Gauss-Newton steps on every start until all have converged; only the best go on to the end.

    Those are not far behind each other, nor behind the cost of a ``rival``. A fit has converged where a step gains no
    more than `_SETTLED` plus ``share`` of its cost beyond noise. In the first steps the spread of the residuals sets
    the scale of outliers.
    """
    if len(y) > _TRIED:
        r = decorrelate(model.residuals(y).r.T, model, model.scatter.correlation)[0].T
        y = y[np.argsort(_cost(r, y, _spread(r), weights) / _spread(r) ** 2)[:_TRIED]]
    r, J = _white_jacobian(model, y)
    damping, costs, scales = np.full((3, len(y)), [[_FIRST_DAMPING], [np.nan], [np.nan]])
    active = np.ones(len(y), dtype=bool)
    for step in range(_MOST_STEPS):
        if step == _PATIENCE:
            cost = _cost(r, y, np.ones(len(y)), weights)
            keep = np.argsort(cost)[:_SURVIVORS]
            keep = keep[cost[keep] < min(cost.min(), rival) * _HOPELESS + _BEHIND]
            y, r, J, damping, active, costs, scales = (a[keep] for a in (y, r, J, damping, active, costs, scales))
        at = np.flatnonzero(active)
        scale = _spread(r[at]) if step < _PATIENCE else np.ones(at.size)
        moved, promised = _solve_step(r[at], J[at], y[at], damping[at], scale, weights, model)
        worth = active[at] = (promised > _NOTHING) | (scale != 1.0)
        at, scale, new = at[worth], scale[worth], (y[at] + moved)[worth]
        if at.size == 0:
            break
        r_new, J_new = _white_jacobian(model, new)  # most steps are good: residuals alone would be one call more
        cost = costs[at] if np.array_equal(scales[at], scale) else _cost(r[at], y[at], scale, weights)
        after = _cost(r_new, new, scale, weights)
        gain = cost - after
        better = gain > 0.0
        costs[at], scales[at] = np.where(better, after, cost), scale
        y[at[better]], r[at[better]], J[at[better]] = new[better], r_new[better], J_new[better]
        damping[at] = np.where(better, damping[at] * _EASED, np.maximum(damping[at] * _STIFFENED, _DAMPED))
        little = np.where(better, _SETTLED + share * np.maximum(cost - r.shape[1], 0.0), _SETTLED)
        converged = (np.abs(gain) < little) | (damping[at] > _STUCK)
        active[at[converged & (scale == 1.0)]] = False
    return y, *(model.jacobian(y) if model.scatter.correlation else (r, J))


def _solve_step(
    r: FloatArray,
    J: FloatArray,
    y: FloatArray,
    damping: FloatArray,
    scale: FloatArray,
    weights: FloatArray | None,
    model: Model,
) -> tuple[FloatArray, FloatArray]:
    """The damped step of each start, and about the decrease of minus the log posterior that an undamped one gives."""
    counts = robust_weights(r / scale[:, np.newaxis]) if weights is None else np.broadcast_to(weights, r.shape)
    if model.sweeps > _MANY:
        step, gradient = _solve_by_sweeps(r, J, y, damping, counts, model)
    else:
        weighted = J * counts[..., np.newaxis]
        H = np.swapaxes(weighted, 1, 2) @ J
        diagonal = np.arange(H.shape[1])
        H[:, diagonal, diagonal] += 1.0
        gradient = (r[:, np.newaxis] @ weighted)[:, 0] + y
        H[:, diagonal, diagonal] *= 1.0 + damping[:, np.newaxis]
        step = np.asarray(-np.linalg.solve(H, gradient[:, :, np.newaxis])[:, :, 0])
    bounded = np.minimum(np.maximum(step, -_LONGEST_STEP), _LONGEST_STEP)  # np.clip takes four times as long
    return bounded, -0.5 * np.sum(gradient * step, axis=1) * (1.0 + damping)


def _solve_by_sweeps(
    r: FloatArray, J: FloatArray, y: FloatArray, damping: FloatArray, counts: FloatArray, model: Model
) -> tuple[FloatArray, FloatArray]:
    """The damped step and the gradient of each start: a value moves with both deviations of its own sweep alone.

    With blocks D (2, 2) of the deviations z of each sweep and B beside the variables x, D is eliminated (Schur):
    (A - sum B^T D^-1 B) x = g_x - sum B^T D^-1 g_z, then z = D^-1 (g_z - B x). The cost grows with the rows alone.
    """
    k, sweeps, of_value = model.size, model.sweeps, model.problem.rows.sweep_of_values
    order = np.argsort(of_value, kind="stable")
    first = np.searchsorted(of_value[order], np.arange(sweeps))
    places = k + of_value[order, np.newaxis] + [0, sweeps]
    Jx, Jz = J[:, order, :k], J[:, order[:, np.newaxis], places]
    weighted, stiff = counts[:, order, np.newaxis] * np.concatenate([Jz, Jx], axis=2), 1.0 + damping
    both = np.concatenate([Jz, Jx, r[:, order, np.newaxis]], axis=2)
    of_sweeps = np.add.reduceat(weighted[:, :, :2, np.newaxis] * both[:, :, np.newaxis], first, axis=1)
    D, B, g_z = of_sweeps[..., :2], of_sweeps[..., 2:-1], of_sweeps[..., -1]
    products = np.swapaxes(weighted[:, :, 2:], 1, 2) @ both[:, :, 2:]
    A, g_x = products[..., :-1], products[..., -1] + y[:, :k]
    g_z = g_z + np.swapaxes(y[:, k:].reshape(len(y), 2, sweeps), 1, 2)
    for block in (A, D):
        size = np.arange(block.shape[-1])
        block[..., size, size] = (block[..., size, size] + 1.0) * stiff.reshape(-1, *[1] * (block.ndim - 2))
    freed = np.linalg.solve(D, np.concatenate([B, g_z[..., np.newaxis]], axis=-1))
    reduced = np.einsum("bsik,bsij->bkj", B, freed)
    x = np.linalg.solve(A - reduced[..., :-1], (g_x - reduced[..., -1])[..., np.newaxis])
    z = freed[..., -1] - (freed[..., :-1] @ x[:, np.newaxis])[..., 0]
    step, gradient = (
        np.hstack([of_x, np.swapaxes(of_z, 1, 2).reshape(len(y), 2 * sweeps)])
        for of_x, of_z in ((-x[..., 0], -z), (g_x, g_z))
    )
    return step, gradient


def _white_jacobian(model: Model, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (batch, m) and their Jacobian (batch, m, .), decorrelated along sweeps."""
    r, J = model.jacobian(y)
    if not model.scatter.correlation:
        return r, J
    columns = np.moveaxis(np.concatenate([r[:, :, np.newaxis], J], axis=2), 0, 1)
    white = np.moveaxis(decorrelate(columns, model, model.scatter.correlation)[0], 1, 0)
    return white[:, :, 0], white[:, :, 1:]


def _spread(r: FloatArray) -> FloatArray:
    """Scale of the residuals of each start for the detection of outliers, 1 unless the start is far off."""
    ordered = np.sort(np.abs(r), axis=1)  # np.median takes several times as long
    scale = 1.4826 * 0.5 * (ordered[:, (r.shape[1] - 1) // 2] + ordered[:, r.shape[1] // 2])
    return np.where(scale > _FAR_OFF, scale, 1.0)


def _cost(r: FloatArray, y: FloatArray, scale: FloatArray, weights: FloatArray | None) -> FloatArray:
    """Minus the log posterior."""
    prior = 0.5 * np.sum(y * y, axis=1)
    if weights is not None:
        return np.asarray(prior + 0.5 * r**2 @ weights)
    return np.asarray(prior - scale**2 * log_likelihood(r / scale[:, np.newaxis]))


def _fit(model: Model, y: FloatArray, r: FloatArray, J: FloatArray, weights: FloatArray | None) -> ModelFit:
    posterior = -float(_cost(r[np.newaxis], y[np.newaxis], np.ones(1), weights)[0])
    counts = robust_weights(r) if weights is None else weights
    rooted = decorrelate(J * np.sqrt(counts)[:, np.newaxis], model, model.scatter.correlation)[0]
    H = rooted.T @ rooted + np.eye(len(y))
    evidence = posterior - 0.5 * float(np.linalg.slogdet(H)[1])
    return ModelFit(model, y, r, J, counts, posterior, evidence, np.asarray(np.linalg.inv(H)))


def decorrelate(columns: FloatArray, model: Model, rho: float) -> tuple[FloatArray, float]:
    """Columns (m, ..) freed of the correlation rho of neighbours, and ln of the determinant of that map.

    Neighbours are values of one quantity at consecutive rows of a sweep that measure it.
    """
    if rho == 0.0:
        return columns, 0.0
    follows, size = model.problem.rows.follows, np.sqrt(1.0 - rho**2)
    white = columns.copy()
    white[follows] = (columns[follows] - rho * columns[np.flatnonzero(follows) - 1]) / size
    return white, -float(follows.sum()) * float(np.log(size))
