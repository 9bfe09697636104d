"""Prior and likelihood of a damping law, pure and vectorised over points of parameter space.

Residual of a row, the distance of the measured phasor (ln A, phi) from the curve C(A, omega) = F sin(phi):

    n = (D - C) / sqrt(g^2 + R^2),      g = dC/d ln A * min(1, |D/C|),   R = F cos(phi).

In a free decay amplitude is the input and g = C: n is the relative error of force, which constant friction has too. The
factor min(1, |D/C|) makes the distance grow without bound for a law that is far too strong, as for one too weak. At
resonance (R = 0) n is the relative error of amplitude, far from it the error of phase in rad; so rows count by their
information on damping. Circular scatter of the phasor gives n the standard deviation ``scatter`` everywhere; the stated
uncertainties are added in quadrature. A sweep's resonance scatters as a whole by ``level_scatter``, which moves each of
its rows by h = g / sqrt(g^2 + R^2):

    cov(n) = diag(s^2) + level_scatter^2 h h^T   within a sweep.

Where rows of a sweep deviate together (``Observations.together``), the log likelihood of rows given the level is
divided by the number that counts as one (a composite likelihood; Varin, Reid and Firth 2011).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from damping.arrays import FloatArray
from damping.forces.contract import Force
from damping.infer.discrepancy import OF_FRICTION
from damping.infer.law import Coordinates
from damping.infer.levels import (
    correlate_drift,
    covary_places,
    integrate_curves,
    integrate_levels,
    scale_each,
    split_covariance,
)
from damping.infer.observations import Observations

REACH = 8.0  #: the prior is cut off at 8 standard deviations (probability 1e-15), where numbers would overflow
#: Points times rows computed at once: half a dozen such arrays stay in 1 MB, the second-level cache of a processor.
BLOCK = 15_000
FEWEST_POINTS = 16  #: fewest points computed at once, of any number of rows: loops along points are then long enough
#: Fewest points whose covariances of levels are worked on at once: with fewer, calls take longer than numbers.
_FEWEST_COVARIANCES = 4
#: Correlation length of the drift of a decay in ln A: a level or two of the usual steps of a fifth.
DRIFT_LENGTH = 0.4
#: Most sweeps for which a matrix product is the fastest way to sums over each, and a factor of their covariance cheap.
_FEW = 32


def residuals(force: Force, data: Observations) -> tuple[FloatArray, FloatArray, FloatArray]:
    """``n``, its sensitivity ``h`` to the level, its variance by stated uncertainties; each (..., rows)."""
    n, h, known = _residuals(*_average(force, data.A, data.omega, data), data)
    return n, h, np.zeros(n.shape) if known is None else known


def find_averages(force: Force, data: Observations) -> tuple[FloatArray, FloatArray]:
    """C and g at each row of a force with parameters (points,), each (points, rows).

    Points are neighbours in memory: they are many and rows often few, so that loops along points are several times as
    fast, here and in all that is computed from these arrays.
    """
    C, grown = _average(force, data.A[:, None], data.omega[:, None], data)
    return C.T, grown.T


def _average(force: Force, A: FloatArray, omega: FloatArray, data: Observations) -> tuple[FloatArray, FloatArray]:
    """C and g = dC/d ln A (C twice where amplitude is the input)."""
    with np.errstate(all="ignore"):
        if data.amplitude_is_input:
            C = grown = force.quadrature(A, omega)
        else:
            C, grown = force.grow(A, omega)
        return np.asarray(C), np.asarray(grown)


def _residuals(
    C: FloatArray, grown: FloatArray, data: Observations
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """`residuals` from averages; None for a variance that no row states."""
    with np.errstate(all="ignore"):
        # in place: the arrays of a block stay in a processor's cache
        h = np.abs(data.D / C)
        h = np.minimum(h, 1.0, out=h)
        h *= grown
        size = h * h
        size += data.R**2
        size = np.sqrt(size, out=size)
        n = data.D - C
        n /= size
        h /= size
        if not data.states_uncertainty:
            return n, h, None
        return n, h, h**2 * data.sd_amplitude**2 + data.variance / size**2


def log_likelihood(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Log likelihood at points ``x`` of shape (points, dimension); ``-inf`` where the law cannot carry the forces."""
    parts, row = coordinates.find_parts(x), coordinates.scatter(x)[0]

    def weigh(points: slice) -> FloatArray:
        return sum_rows(*find_averages(coordinates.join(parts, points), data), row[points], coordinates, data)

    sums = by_blocks(weigh, len(x), len(data.A), fewest=FEWEST_POINTS)
    return weigh_levels(sums, x, coordinates.discrepancy_of_levels(x, parts), coordinates, data)


def by_blocks(
    work: Callable[[slice], FloatArray], number: int, rows: int, most: int = BLOCK, fewest: int = 1
) -> FloatArray:
    """``work`` for ``number`` points, (..., points), in blocks of at most ``most`` points times ``rows``.

    Blocks have at least ``fewest`` points.
    """
    step = max(fewest, most // rows)
    if number <= step:
        return work(slice(None))
    return np.concatenate([work(slice(first, first + step)) for first in range(0, number, step)], axis=-1)


def sum_rows(
    C: FloatArray, grown: FloatArray, row: FloatArray, coordinates: Coordinates, data: Observations
) -> FloatArray:
    """Sufficient sums of rows with averages ``C`` and ``grown`` and scatters ``row`` (points,), (1 + sums, points).

    The log density of independent rows at n = 0; then sums over each sweep of n^2/variance and, where levels have
    errors as a whole, of h^2/variance and h n/variance.
    """
    n, h, known = _residuals(C, grown, data)
    variance = row[:, None] ** 2
    if known is not None:
        variance = variance + known
    with np.errstate(all="ignore"):
        value = -0.5 * n.shape[1] * np.mean(np.log(2.0 * np.pi * np.ascontiguousarray(variance)), axis=1)
        sums = [_sum_over(n * n, variance, data)]
        if coordinates.with_level_scatter or coordinates.with_discrepancy:
            sums += [_sum_over(h * h, variance, data), _sum_over(h * n, variance, data)]
    return np.vstack([value, *(of.T for of in sums)]) / data.together


def weigh_levels(
    sums: FloatArray, x: FloatArray, sigma: FloatArray, coordinates: Coordinates, data: Observations
) -> FloatArray:
    """Log likelihood (points,) from :func:`sum_rows`; ``sigma``: of the slope's discrepancy, (points,)."""
    value = sums[0]
    with np.errstate(all="ignore"):
        if coordinates.with_level_scatter or coordinates.with_discrepancy:
            levels = len(data.sweeps)
            many = levels > _FEW and not data.amplitude_is_input  # the drift of a decay is too rough for few curves

            def weigh(points: slice) -> FloatArray:
                if many:
                    curves = split_covariance(*_place_levels(coordinates, data))
                    level = coordinates.scatter(x[points])[1]
                    misfit, log_determinant = integrate_curves(sums[:, points], level, sigma[points], *curves)
                else:
                    covariance = covary_levels(x[points], coordinates, data, sigma[points])
                    misfit, log_determinant = integrate_levels(sums[:, points], covariance)
                return np.asarray(-0.5 * misfit - 0.5 * log_determinant)

            # half of a symmetric matrix is worked on
            size = levels if many else (levels**2 + 1) // 2
            value = value + by_blocks(weigh, len(x), size, fewest=1 if many else _FEWEST_COVARIANCES)
        else:
            value = value - 0.5 * np.sum(sums[1:], axis=0)
    return np.where(np.isfinite(value), value, -np.inf)


def measure_misfit(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """n^T V^-1 n at points x (points, dimension), (points,); V: covariance of n by the scatters alone.

    If the law holds and errors are normal, it is chi-square with as many degrees of freedom as there are rows.
    """
    data = replace(data, together=1.0)  # every row has a residual, also where several count as one
    row, level = coordinates.scatter(x)

    def weigh(points: slice) -> FloatArray:
        averages = find_averages(coordinates.join(coordinates.find_parts(x[points])), data)
        sums = sum_rows(*averages, row[points], coordinates, data)
        if not (coordinates.with_level_scatter or coordinates.with_discrepancy):
            return np.asarray(np.sum(sums[1:], axis=0))
        return integrate_levels(sums, covary_scatter(row[points], level[points], data))[0]

    return by_blocks(weigh, len(x), max(len(data.A), len(data.sweeps) ** 2))


def _sum_over(values: FloatArray, variance: FloatArray, data: Observations) -> FloatArray:
    """Sums of values (points, rows)/variance over sweeps, (points, sweeps); variance (points, rows) or (points, 1)."""
    if variance.shape[1] == 1:
        return np.asarray(sum_by_sweep(values, data) / variance)
    return sum_by_sweep(values / variance, data)


def covary_levels(x: FloatArray, coordinates: Coordinates, data: Observations, sigma: FloatArray) -> FloatArray:
    """Covariance of ln A of the levels about the law: their scatter and discrepancy, (points, s, s).

    ``sigma``: standard deviation of the slope's discrepancy, (points,).
    """
    covariance = scale_each(covary_unit_discrepancy(coordinates, data), sigma**2)
    if coordinates.with_level_scatter or data.amplitude_is_input:  # else levels have no errors of their own
        covariance += covary_scatter(*coordinates.scatter(x), data)
    return covariance


def covary_unit_discrepancy(coordinates: Coordinates, data: Observations) -> FloatArray:
    """Covariance of ln A of the levels for a discrepancy of 1, (s, s)."""
    return covary_places(*_place_levels(coordinates, data))


def _place_levels(coordinates: Coordinates, data: Observations) -> tuple[tuple[float, ...], float]:
    """ln F of the levels, and where the discrepancy begins; ln A where that is the input.

    The forces of a decay are noisy: from ln F itself a discrepancy would tell them all, beside a law of any force.
    """
    at, begin = (data.tested_amplitude, 0) if data.amplitude_is_input else (data.tested_force, 2)
    return tuple(np.log(at)), float(np.log(coordinates.reference[begin]))


def covary_scatter(row: FloatArray, level: FloatArray, data: Observations) -> FloatArray:
    """Covariance of the errors of whole levels, (points, s, s), from scatters (points,).

    Levels of one decay also drift together, by as much as each scatters: they are neighbours in one envelope and share
    trends of its baseline, of temperature or of a neighbouring mode.
    """
    if not data.amplitude_is_input:
        return scale_each(np.eye(len(data.sweeps)), level**2)
    covariance = scale_each(correlate_drift(tuple(np.log(data.tested_amplitude)), DRIFT_LENGTH), row**2)
    np.einsum("pjj->pj", covariance)[...] += level[:, None] ** 2
    return covariance


def find_level_exponents(force: Force, data: Observations) -> FloatArray:
    """p = d ln C/d ln A at each tested amplitude, (..., sweeps), at least 1/``OF_FRICTION``."""
    with np.errstate(all="ignore"):
        C, slope = force.grow(data.tested_amplitude, data.tested_omega)
        return np.asarray(np.maximum(np.nan_to_num(slope / C), 1.0 / OF_FRICTION))


def sum_by_sweep(values: FloatArray, data: Observations) -> FloatArray:
    """Sums of values (points, rows) over the rows of each sweep, (points, sweeps)."""
    if data.row_of_sweep is not None:
        return values[:, data.row_of_sweep]
    if len(data.sweeps) <= _FEW:
        # with the rows of a point together, so that the order of summation does not depend on that of the memory
        return np.asarray(np.ascontiguousarray(values) @ data.membership)
    order = np.argsort(data.sweep, kind="stable")
    first = np.searchsorted(data.sweep[order], np.arange(len(data.sweeps)))
    return np.asarray(np.add.reduceat(values[:, order], first, axis=1))


def pointwise_log_likelihood(x: FloatArray, coordinates: Coordinates, data: Observations) -> FloatArray:
    """Log likelihood of each sweep given the parameters, (points, sweeps); of each row where there is one sweep only.

    Rows of one sweep share the scatter of their level, so the unit to leave out is a sweep.
    """
    if len(data.sweeps) > 1:
        each = np.eye(len(data.sweeps), dtype=bool)
        return np.stack([log_likelihood(x, coordinates, data.take_sweeps(keep)) for keep in each], axis=-1)
    n, h, known = residuals(coordinates.force(x), data)
    row, level = coordinates.scatter(x)
    variance = row[:, None] ** 2 + known + (level[:, None] * h) ** 2
    return -0.5 * (n**2 / variance + np.log(2.0 * np.pi * variance))


def log_prior(x: FloatArray) -> FloatArray:
    """Standard normal in every variable, shape (points,)."""
    result: FloatArray = -0.5 * np.sum(x**2 + np.log(2.0 * np.pi), axis=-1)
    return result
