"""Marginal likelihood of a law on observations: its posterior mode, then importance sampling around it.

Newton steps from the best fit of the law find the mode. Their difference quotients need only values of the log density.
Steps are scaled to the posterior width, which is tiny for good data.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import product

import numpy as np

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError
from damping.infer.balanced import Balanced
from damping.infer.best_fit import BestFit, fit_law
from damping.infer.importance import BRIEF_DRAWS, FULL_DRAWS, Evidence, importance
from damping.infer.law import Coordinates
from damping.infer.observations import Observations, round_bits

FIRST_STEP = 1e-3  #: of a difference quotient, in standard normal variables, before the width of the posterior is known
STEP_RANGE = (1e-5, 1e-2)  #: range of its later steps, in the same unit
STEP_PER_SD = 0.3  #: step of a difference quotient in standard deviations of the posterior along that axis
STEP_SHARES = np.array([1.0, 0.5, 0.2, 0.05, 0.01])  #: shares of a Newton step, tried at once
MOST_STEPS = 20  #: most Newton steps
STILL = 1e-2  #: gain of log density below which the mode is reached, accurate enough to start draws
#: Least share of a component in the force where the search starts: the prior vanishes at 0. Rows of whole sweeps tell
#: far smaller shares from none, and a search from .02 alone then stays hundreds below the mode in ln density.
LEAST_SHARES = (0.02, 2e-4)
START_BITS = 12  #: binary digits of the start of the search, so that rounding in other units does not move it
STARTS = 512  #: prior points, the best of which starts a second search
#: Standard normal variables of scatters and discrepancy at which the search from the best fit may start.
SCORES = (-2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
APART = 1.0  #: distance, in joint standard deviations, from which two modes are distinct
OUTWEIGHED = 30.0  #: ln density below the other mode from which one holds no share of the posterior that counts
BARRIER = 1e8  #: finite value for an impossible law in the search

LogDensity = Callable[[FloatArray], FloatArray]
Estimate = Callable[..., Evidence]  #: a function with the arguments of `evidence` up to ``floor``


def evidence(
    coordinates: Coordinates,
    data: Observations,
    seed: int = 0,
    fit: BestFit | None = None,
    floor: float = -np.inf,
    wanted: float = FULL_DRAWS,
) -> Evidence:
    """Marginal likelihood of a law, with weighted draws of its posterior, drawn over balanced variables.

    Args:
        fit: the law's best fit on these observations, where known.
        floor: ln of a marginal likelihood below which a law does not matter.
        wanted: effective draws, by default enough for the digits that are shown.

    AnalysisError: the law cannot carry the measured forces.
    """
    posterior = Balanced.of(coordinates, data)
    starts = list_starts(posterior, start_at(fit or fit_law(coordinates.law, data), coordinates))
    try:
        modes = find_modes(posterior.log_density, *starts)
    except AnalysisError as error:
        raise AnalysisError(f"{coordinates.law.name}: {error}") from error
    drawn = importance(posterior.log_density, *modes, seed, wanted, floor)
    return replace(drawn, draws=posterior.find_points(drawn.draws))


#: `evidence` with few draws: for fleets, and for a first look at which laws matter.
brief_evidence = partial(evidence, wanted=BRIEF_DRAWS)


def start_at(fit: BestFit, coordinates: Coordinates) -> FloatArray:
    """The standard normal variables of a best fit with each least share, (n, dimension): starts of the search."""
    if not np.isfinite(fit.squares):
        return np.zeros((1, coordinates.dimension))
    scatter = float(np.sqrt(np.mean(fit.n**2)))
    shares = LEAST_SHARES if coordinates.with_level_scatter else LEAST_SHARES[:1]
    starts = [coordinates.find_variables(fit.coefficients, fit.point, scatter, least) for least in shares]
    return round_bits(np.unique(starts, axis=0), START_BITS)


def list_starts(posterior: Balanced, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Starts of the search for modes in balanced variables: of the best fit x ``starts`` (k, d), (n, d); prior, (m, d).

    The best fit is combined with every scatter and discrepancy of ``SCORES``, since either may explain its residuals.
    """
    names, z = posterior.coordinates.names, posterior.find_variables(starts)
    vary = [i for i, name in enumerate(names) if name in ("discrepancy", "scatter", "level_scatter")]
    scores = np.array(list(product(SCORES, repeat=len(vary))))
    fitted = np.repeat(z[:, None], 1 + len(scores), axis=1)
    fitted[:, 1:, vary] = scores
    anywhere = np.random.default_rng(0).standard_normal((STARTS, len(names)))
    fitted[:, 1:, 0] = anywhere[:, 0] = 0.0  # a law that fits in the mean
    return fitted.reshape(-1, len(names)), anywhere


def find_modes(log_density: LogDensity, fitted: FloatArray, anywhere: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The modes reached from the best of points ``fitted`` (n, d) and of ``anywhere`` (m, d).

    A joint that slips fully below the test and one that does so within it are two modes: few draws around one reach the
    other. A single one if they are equal, or one is ``OUTWEIGHED``.

    Returns:
        The modes (k, d), and the inverse Hessians there (k, d, d), no wider than the prior.

    AnalysisError: every point is impossible.
    """

    def negative(x: FloatArray) -> FloatArray:
        value = -log_density(x)
        return np.where(np.isfinite(value), value, BARRIER + np.sum(x**2, axis=-1))

    near, far = np.split(negative(np.vstack([fitted, anywhere])), [len(fitted)])
    both = (fitted, near), (anywhere, far)
    starts = [points[np.argmin(values)] for points, values in both if values.min() < BARRIER]
    if not starts:
        raise AnalysisError("no coefficient reproduces the measured forces")
    modes, covariances = descend(np.array(starts), negative)
    values, difference = negative(modes), modes[-1] - modes[0]
    apart = difference @ np.linalg.solve(covariances.sum(axis=0), difference) > APART**2
    if apart and np.ptp(values) < OUTWEIGHED:
        return modes, covariances
    best = int(np.argmin(values)) if apart else 0  # of equal ones that from the best fit
    return modes[best : best + 1], covariances[best : best + 1]


def descend(x: FloatArray, negative: LogDensity) -> tuple[FloatArray, FloatArray]:
    """Newton steps from each start (k, d) until none gains; the final points (k, d) and inverse Hessians (k, d, d).

    All starts step together: a call with few points costs as much as one with many.
    """
    x, moving, covariances = x.copy(), list(range(len(x))), np.empty((*x.shape, x.shape[1]))
    widths = np.full(x.shape, FIRST_STEP)
    around = np.split(negative(np.vstack([x[i] + _surround(widths[i]) for i in moving])), len(x))
    for _ in range(MOST_STEPS):
        expanded, tried = [], []
        for i in moving:
            value, gradient, covariances[i], widths[i] = expand(around[i], widths[i])
            steps = x[i] - STEP_SHARES[:, None] * (covariances[i] @ gradient)
            expanded.append(value)
            # the surroundings of the full step, most often the best, in the same call
            tried.append(np.vstack([steps, steps[0] + _surround(widths[i])]))
        values = np.split(negative(np.vstack(tried)), len(moving))
        for i, value, points, step_values in zip(tuple(moving), expanded, tried, values, strict=True):
            best = int(np.argmin(step_values[: len(STEP_SHARES)]))
            if not step_values[best] < value - STILL:
                moving.remove(i)
                continue
            x[i] = points[best]
            around[i] = negative(x[i] + _surround(widths[i])) if best else step_values[len(STEP_SHARES) :]
        if not moving:
            break
    return x, covariances


def _surround(widths: FloatArray) -> FloatArray:
    """Points of central differences of ``widths`` (d,): centre, up and down each axis, up and down in each pair."""
    steps = np.diag(widths)
    i, j = _list_pairs(len(widths))
    pairs = steps[i] + steps[j]
    return np.vstack([np.zeros((1, len(widths))), steps, -steps, pairs, -pairs])


@cache
def _list_pairs(d: int) -> tuple[IntArray, IntArray]:
    """Both axes of each pair of ``d`` axes."""
    return np.triu_indices(d, 1)


def expand(values: FloatArray, widths: FloatArray) -> tuple[float, FloatArray, FloatArray, FloatArray]:
    """Value, gradient and inverse Hessian from ``values`` around a point (`_surround`); and improved widths (d,).

    f_ij = (f(+i+j) - f(+i) - f(+j) + 2 f - f(-i) - f(-j) + f(-i-j)) / (2 h_i h_j).
    """
    d = len(widths)
    i, j = _list_pairs(d)
    here, up, down = float(values[0]), values[1 : 1 + d], values[1 + d : 1 + 2 * d]
    both, neither = values[1 + 2 * d :].reshape(2, -1)
    hessian = np.diag(up + down - 2.0 * here)
    hessian[i, j] = hessian[j, i] = 0.5 * (both + neither + 2.0 * here - up[i] - up[j] - down[i] - down[j])
    # in units of the widths; the prior bounds eigenvalues from below
    eigenvalues, vectors = np.linalg.eigh(hessian)
    floor = max(float(np.min(widths**2)), 1e-6 * float(eigenvalues[-1]), 1e-300)
    inverse = (vectors / np.maximum(eigenvalues, floor)) @ vectors.T
    curvature = np.maximum(np.diagonal(hessian) / widths**2, 1.0)
    better = np.clip(STEP_PER_SD / np.sqrt(curvature), *STEP_RANGE)
    return here, (up - down) / (2.0 * widths), inverse * np.outer(widths, widths), better


def remember(estimate: Estimate) -> Estimate:
    """The estimate with a cache; computed again if a ``floor`` that stopped it has fallen.

    Rankings and plans of peaks need the same estimates. Observations are compared after the rounding with which they
    are sampled: a force multiplied by pi A and divided again differs in its last bit.
    """
    known: dict[tuple[object, ...], tuple[float, Evidence]] = {}

    def estimated(
        coordinates: Coordinates, data: Observations, seed: int, fit: BestFit | None = None, floor: float = -np.inf
    ) -> Evidence:
        key = coordinates, seed, *data.sampled.content
        before, drawn = known.get(key, (np.inf, None))
        if drawn is None or (floor < before and drawn.falls_below(before) and not drawn.falls_below(floor)):
            drawn = estimate(coordinates, data, seed, fit, floor)
            known[key] = floor, drawn
        return drawn

    return estimated
