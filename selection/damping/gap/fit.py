"""Maximum posterior by Levenberg-Marquardt steps with robust weights, several starts at once; Laplace evidence.

The noise of a residual is N(0, 1) but for a share ``WILD`` of wild points, N(0, ``WIDE``^2); the weights are those of
expectation maximisation for this mixture. The evidence is Laplace's: with standard normal priors on every variable

    ln Z = ln p(data | y) - |y|^2/2 - ln det(H)/2,   H = J^T W J + 1 at the mode.

Repeatability and noise that are not stated: evidence of a fit over a grid of both.

Gain and frequency of each sweep deviate by b = scatter z, z ~ N(0, 1), and the noise is a factor s times its estimate.
Around the mode of a fit the residuals are linear in (x, b), so the evidence of any scatter and noise is a Gaussian
integral in closed form, with the fit's robust weights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from damping.arrays import FloatArray
from damping.gap.model import Model, Scatter

#: Share of wild points and their standard deviation in units of noise.
WILD = 0.02
WIDE = 10.0
_INLIER = np.log(1.0 - WILD)
_OUTLIER = np.log(WILD / WIDE)
#: Robust weight below which a residual is taken for wild and left out of every number.
WILD_WEIGHT = 0.5
#: Most steps; decrease of -ln(posterior) at which a fit has settled; the same as a share of what it is too large.
_MOST_STEPS = 40
_SETTLED = 0.01
_ROUGHLY = 1e-3
#: Median residual, over that of noise, from which a fit is far off.
_FAR_OFF = 1.5
#: So many of the starts are tried, those that begin best; after ``_PATIENCE`` steps only ``_SURVIVORS`` go on.
_TRIED = 4
_PATIENCE = 5
_SURVIVORS = 2
#: ... of which none costs more than this factor, and so much in ln p, above the best.
_HOPELESS = 1.3
_BEHIND = 15.0


@dataclass(frozen=True)
class ModelFit:
    """A mode of the posterior of a model.

    Attributes:
        model: what was fitted. y: variables at the mode (size + 2 sweeps,). r: residuals (m,), J: Jacobian (m, .),
        weights (m,): robust weights, 1 for a regular point. log_posterior, log_evidence: natural logarithms.
        covariance: of y. log_likelihood: without the prior.
    """

    model: Model
    y: FloatArray
    r: FloatArray
    J: FloatArray
    weights: FloatArray
    log_posterior: float
    log_evidence: float
    covariance: FloatArray

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.model.effects


def fit_model(
    model: Model, x: FloatArray, z: FloatArray | None = None, weights: FloatArray | None = None
) -> list[ModelFit]:
    """Distinct modes reached from starts x (starts, size), best first, with predictions at the motion found.

    Args:
        z: deviations of the sweeps to start from, (starts, 2 sweeps); zero where not given.
        weights: of the residuals (m,), for plain least squares; robust ones where not given.
    """
    return polish_fits(fit_roughly(model, x, z, weights), weights)


def fit_roughly(
    model: Model, x: FloatArray, z: FloatArray | None = None, weights: FloatArray | None = None
) -> list[ModelFit]:
    """The same with predictions at the measured amplitudes."""
    deviations = np.zeros((len(x), 2 * model.sweeps)) if z is None else z
    y, r, J = _climb(model, np.concatenate([x, deviations], axis=1), weights)
    return _list_distinct([_fit(model, y[k], r[k], J[k], weights) for k in range(len(y))])


def polish_fits(rough: list[ModelFit], weights: FloatArray | None = None) -> list[ModelFit]:
    """Fits made again with predictions at the motion that they found: free of the noise of measured amplitudes."""
    found = []
    for one in rough:
        model = one.model.at_motion(one.y)
        y, r, J = _climb(model, one.y[np.newaxis].copy(), weights)
        found.append(_fit(model, y[0], r[0], J[0], weights))
    return _list_distinct(found)


def _list_distinct(found: list[ModelFit]) -> list[ModelFit]:
    """Fits that differ, best first, without those that are far behind."""
    found = sorted(found, key=lambda one: -one.log_posterior)
    distinct: list[ModelFit] = []
    for one in found:
        if all(_differ(one, other) for other in distinct):
            distinct.append(one)
    return [one for one in distinct if one.log_posterior > distinct[0].log_posterior - _BEHIND]


def _differ(one: ModelFit, other: ModelFit) -> bool:
    if one.model.parts != other.model.parts:
        return True
    return bool(np.max(np.abs(one.y - other.y) / _sd(other)) > 0.5)


def log_likelihood(r: FloatArray) -> FloatArray:
    """ln p of residuals (..., m) less that of m residuals of zero without wild points: sum over the last axis."""
    inlier = _INLIER - 0.5 * r * r
    outlier = _OUTLIER - 0.5 * (r / WIDE) ** 2
    return np.asarray(np.sum(np.logaddexp(inlier, outlier), axis=-1))


def robust_weights(r: FloatArray) -> FloatArray:
    """Expected inverse variance of each residual: 1 for a regular point, 1/WIDE^2 for a wild one."""
    odds = np.exp(np.minimum(_OUTLIER - _INLIER + 0.5 * (1.0 - WIDE**-2) * r * r, 50.0))
    wild = odds / (1.0 + odds)
    return np.asarray(1.0 - wild * (1.0 - WIDE**-2))


def _sd(one: ModelFit) -> FloatArray:
    return np.asarray(np.sqrt(np.diag(one.covariance)))


def _climb(model: Model, y: FloatArray, weights: FloatArray | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Damped Gauss-Newton steps on every start until all have settled; only the best go on to the end.

    In the first steps what counts as wild is measured by the spread of the residuals themselves.
    """
    if len(y) > _TRIED:
        r = _white_jacobian(model, y)[0] if model.scatter.correlation else model.residuals(y).r
        y = y[np.argsort(_cost(r, y, _spread(r), weights) / _spread(r) ** 2)[:_TRIED]]
    r, J = _white_jacobian(model, y)
    damping = np.full(len(y), 1e-2)
    active = np.ones(len(y), dtype=bool)
    for step in range(_MOST_STEPS):
        if step == _PATIENCE:
            cost = _cost(r, y, np.ones(len(y)), weights)
            keep = np.argsort(cost)[:_SURVIVORS]
            keep = keep[cost[keep] < cost.min() * _HOPELESS + _BEHIND]
            y, r, J, damping, active = (a[keep] for a in (y, r, J, damping, active))
        at = np.flatnonzero(active)
        if at.size == 0:
            break
        scale = _spread(r[at]) if step < _PATIENCE else np.ones(at.size)
        new = y[at] + _step(r[at], J[at], y[at], damping[at], scale, weights)
        new_r, new_J = _white_jacobian(model, new)
        cost = _cost(r[at], y[at], scale, weights)
        gain = cost - _cost(new_r, new, scale, weights)
        better = gain > 0.0
        won = at[better]
        y[won], r[won], J[won] = new[better], new_r[better], new_J[better]
        damping[at] = np.where(better, damping[at] * 0.2, damping[at] * 8.0)
        little = _SETTLED + _ROUGHLY * np.maximum(cost - r.shape[1], 0.0)
        settled = (better & (gain < little)) | (damping[at] > 1e6)
        active[at[settled & (scale == 1.0)]] = False
    return y, *(model.jacobian(y) if model.scatter.correlation else (r, J))


def _white_jacobian(model: Model, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Residuals (batch, m) and their Jacobian (batch, m, .), freed of the correlation of neighbours."""
    r, J = model.jacobian(y)
    if not model.scatter.correlation:
        return r, J
    columns = np.moveaxis(np.concatenate([r[:, :, np.newaxis], J], axis=2), 0, 1)
    white = np.moveaxis(decorrelate(columns, model, model.scatter.correlation)[0], 1, 0)
    return white[:, :, 0], white[:, :, 1:]


def _spread(r: FloatArray) -> FloatArray:
    """Scale of the residuals of each start, 1 unless it is far off: what counts as wild meanwhile."""
    scale = 1.4826 * np.median(np.abs(r), axis=1)
    return np.where(scale > _FAR_OFF, scale, 1.0)


def _cost(r: FloatArray, y: FloatArray, scale: FloatArray, weights: FloatArray | None) -> FloatArray:
    """Minus the log posterior."""
    prior = 0.5 * np.sum(y * y, axis=1)
    if weights is not None:
        return np.asarray(prior + 0.5 * r**2 @ weights)
    return np.asarray(prior - scale**2 * log_likelihood(r / scale[:, np.newaxis]))


def _step(
    r: FloatArray, J: FloatArray, y: FloatArray, damping: FloatArray, scale: FloatArray, weights: FloatArray | None
) -> FloatArray:
    counts = robust_weights(r / scale[:, np.newaxis]) if weights is None else weights
    weighted = J * counts[..., np.newaxis]
    H = np.swapaxes(weighted, 1, 2) @ J
    diagonal = np.arange(H.shape[1])
    H[:, diagonal, diagonal] += 1.0
    gradient = np.einsum("bmk,bm->bk", weighted, r) + y
    H[:, diagonal, diagonal] *= 1.0 + damping[:, np.newaxis]
    step = -np.linalg.solve(H, gradient[:, :, np.newaxis])[:, :, 0]
    return np.clip(step, -1.5, 1.5)


def _fit(model: Model, y: FloatArray, r: FloatArray, J: FloatArray, weights: FloatArray | None) -> ModelFit:
    posterior = -float(_cost(r[np.newaxis], y[np.newaxis], np.ones(1), weights)[0])
    counts = robust_weights(r) if weights is None else weights
    rooted = decorrelate(J * np.sqrt(counts)[:, np.newaxis], model, model.scatter.correlation)[0]
    H = rooted.T @ rooted + np.eye(len(y))
    return ModelFit(
        model,
        y,
        r,
        J,
        counts,
        posterior,
        posterior - 0.5 * float(np.linalg.slogdet(H)[1]),
        np.asarray(np.linalg.inv(H)),
    )


#: Scatter of gain, and of frequency in units of the bandwidth, with their prior probabilities.
AMPLITUDE_GRID = ((1e-6, 0.6), (0.003, 0.1), (0.006, 0.1), (0.012, 0.1), (0.025, 0.1))
FREQUENCY_GRID = ((1e-6, 0.6), (0.015, 0.08), (0.03, 0.08), (0.06, 0.08), (0.12, 0.08), (0.25, 0.08))
#: Nodes of ln noise, in units of its standard deviation.
_NODES = np.linspace(-2.5, 2.5, 11)
#: Correlation of the errors of neighbouring rows where noise is not stated, with its prior probability: what is not
#: known of a test is as often a smooth error (a mode shape, a reference) as one that is new at every row.
CORRELATION_GRID = ((0.0, 0.55), (0.3, 0.15), (0.6, 0.15), (0.8, 0.15))


@dataclass(frozen=True)
class Unknowns:
    """Every scatter, correlation and noise considered with its prior probability; one of each where all are stated.

    Attributes:
        scatters: candidates (amplitude, frequency). correlations: of neighbours. noises: factors on the noise.
        log_prior: logarithms of their probabilities, (scatters, correlations, noises). first: what a search begins
            with.
    """

    scatters: tuple[tuple[float, float], ...]
    correlations: tuple[float, ...]
    noises: tuple[float, ...]
    log_prior: FloatArray
    first: Scatter

    @property
    def known(self) -> bool:
        """Whether there is nothing to choose."""
        return self.log_prior.size == 1

    def scatter(self, index: int) -> Scatter:
        """The candidate of a flat index."""
        i, j, k = np.unravel_index(index, self.log_prior.shape)
        return Scatter(*self.scatters[i], self.noises[k], self.first.dispersion, self.correlations[j])


def list_unknowns(scatter: Scatter | None, bandwidth: float, noise_error: float, dispersion: float) -> Unknowns:
    """The candidates.

    Args:
        scatter: repeatability as stated; None where it is not. bandwidth: unit of the scatter of frequency.
        noise_error: standard deviation of the ln of the estimated noise; 0 where the noise is stated.
        dispersion: by how much every explanation misses the record by more than noise.
    """
    noises, p_noise, correlations = [1.0], np.ones(1), ((0.0, 1.0),)
    if noise_error > 0.0:
        noises = [float(factor) for factor in np.exp(noise_error * _NODES)]
        p_noise = np.exp(-0.5 * _NODES**2) / np.sum(np.exp(-0.5 * _NODES**2))
        correlations = CORRELATION_GRID
    if scatter is not None:
        pairs = [((scatter.amplitude, scatter.frequency), 1.0)]
        first = replace(scatter, dispersion=dispersion)
    else:
        pairs = [((a, f * bandwidth), p_a * p_f) for (a, p_a), (f, p_f) in product(AMPLITUDE_GRID, FREQUENCY_GRID)]
        first = Scatter(0.003, 0.03 * bandwidth, 1.0, dispersion)
    p_pair, p_correlation = (np.array([p for _, p in part]) for part in (pairs, correlations))
    log_prior = np.log(p_pair[:, np.newaxis, np.newaxis] * p_correlation[:, np.newaxis] * p_noise)
    return Unknowns(
        tuple(pair for pair, _ in pairs), tuple(rho for rho, _ in correlations), tuple(noises), log_prior, first
    )


def list_evidences(one: ModelFit, unknown: Unknowns) -> FloatArray:
    """ln evidence of the model of a fit with each scatter, correlation and noise, in the shape of their prior.

    Errors e of neighbours along a sweep with correlation rho are those of (e_i - rho e_(i-1))/sqrt(1 - rho^2) without.
    """
    k, sweeps = one.model.size, one.model.sweeps
    own = _scales(one.model.scatter, k, sweeps)
    root = np.sqrt(one.weights)
    J = one.J / own * root[:, np.newaxis]
    start = one.r * root - J @ (one.y * own)  # residuals at x = 0, b = 0
    scale = np.stack([np.repeat([1.0, a, f], [k, sweeps, sweeps]) for a, f in unknown.scatters])
    precision = (one.model.scatter.noise / np.array(unknown.noises)) ** 2
    regular = float(np.sum(one.weights > WILD_WEIGHT))
    robust = float(log_likelihood(one.r)) + 0.5 * float(one.weights @ one.r**2)
    base = robust + 0.5 * regular * np.log(precision) - regular * np.log(one.model.scatter.noise)
    found = []
    for rho in unknown.correlations:
        white, log_det = decorrelate(np.column_stack([start, J]), one.model, rho)
        h, N = white[:, 1:].T @ white[:, 0], white[:, 1:].T @ white[:, 1:]
        values, vectors = np.linalg.eigh(N * scale[:, :, np.newaxis] * scale[:, np.newaxis, :])
        g = np.einsum("skj,sk->sj", vectors, h * scale)[:, np.newaxis, :]
        H = 1.0 + np.maximum(values, 0.0)[:, np.newaxis, :] * precision[:, np.newaxis]
        gained = 0.5 * np.sum((g * precision[:, np.newaxis]) ** 2 / H, axis=2) - 0.5 * np.sum(np.log(H), axis=2)
        found.append(base + log_det - 0.5 * float(white[:, 0] @ white[:, 0]) * precision + gained)
    return np.stack(found, axis=1)


def decorrelate(columns: FloatArray, model: Model, rho: float) -> tuple[FloatArray, float]:
    """Columns (m, ..) as they are without the correlation of neighbours, and ln of the determinant of the change."""
    if rho == 0.0:
        return columns, 0.0
    sweep = np.tile(model.problem.rows.sweep, len(columns) // len(model.problem.rows))
    follows = np.concatenate([[False], sweep[1:] == sweep[:-1]])
    follows[:: len(model.problem.rows)] = False
    size = np.sqrt(1.0 - rho**2)
    white = columns.copy()
    white[follows] = (columns[follows] - rho * columns[np.flatnonzero(follows) - 1]) / size
    return white, -float(follows.sum()) * float(np.log(size))


def marginalise_scatter(one: ModelFit, unknown: Unknowns, least: float) -> ModelFit:
    """The fit at the most probable scatter and noise, its evidence averaged over all of them.

    It is made again at these where its evidence comes up to ``least``: others do not matter.
    """
    if unknown.known:
        return one
    found = list_evidences(one, unknown) + unknown.log_prior
    best = unknown.scatter(int(np.argmax(found)))
    if best != one.model.scatter and float(logsumexp(found)) > least:
        one = _refitted(one, best)
        found = list_evidences(one, unknown) + unknown.log_prior
    return replace(one, log_evidence=float(logsumexp(found)))


def _refitted(one: ModelFit, scatter: Scatter) -> ModelFit:
    k, sweeps = one.model.size, one.model.sweeps
    z = one.y[k:] * _scales(one.model.scatter, 0, sweeps) / _scales(scatter, 0, sweeps)
    model = replace(one.model, scatter=scatter)
    return fit_roughly(model, one.y[np.newaxis, :k], np.clip(z, -2.0, 2.0)[np.newaxis])[0]


def _scales(scatter: Scatter, variables: int, sweeps: int) -> FloatArray:
    return np.repeat([1.0, scatter.amplitude, scatter.frequency], [variables, sweeps, sweeps])
