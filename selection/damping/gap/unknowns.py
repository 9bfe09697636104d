"""Unstated noise and repeatability: noise from the roughness of residuals, and evidence over every scatter and noise.

Differences of neighbours cancel the smooth part of residuals (Hall, Kay and Titterington 1990). Gain and frequency of
each sweep deviate by b = scatter z, z ~ N(0, 1); the noise is a factor s times its estimate; errors of neighbours have
correlation rho (Prais and Winsten 1954). Near the mode of a fit the residuals are linear in (x, b), so the evidence of
any scatter, correlation and noise is a Gaussian integral in closed form, with the fit's robust weights. Each hypothesis
is averaged over all of them separately.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from damping.arrays import ComplexArray, FloatArray, IntArray
from damping.gap.fit import ModelFit, decorrelate, fit_roughly
from damping.gap.model import Scatter
from damping.gap.outliers import OUTLIER_WEIGHT, log_likelihood
from damping.gap.rows import UNSEEN, PhasorRows
from damping.records.record import Record

_TRIMMED = 0.15  #: share of the largest values that a spread leaves out
_OF_NORMAL = 0.7215  #: root mean square of the others for a normal variable
SHARES = (0.0, 0.5, 1.0, 2.0, 4.0, 100.0)  #: constant over proportional noise at the 10 % quantile of the amplitudes
#: Stands for noise in proportion to the largest amplitude of each sweep, as of an analyser with a range for each sweep.
RANGED = np.inf
_PRICE = 2.0  #: penalty in ln p of noise with a constant part, or of ``RANGED``
CLIP = 3.0  #: deviations are clipped at this many standard deviations, against outliers
FIRST_GUESS = 0.02  #: noise assumed before anything is known, relative: of the order of a careful sine test
LEAST = 1e-6  #: smallest noise, so that computed records do not divide by zero
#: Share of a further channel that the model cannot predict: the third harmonic feeds back, axes are not square.
FURTHER_ERROR = 0.05
#: Largest reading of a cross-axis channel, over its roughness, that may be noise floor alone: noise exceeds 3.5 in one
#: of 460 readings, and the floor has hum and cross-talk of any phase too.
_FLOOR = 4.0
#: Scatter of gain, and of frequency in units of the bandwidth, with their prior probabilities.
AMPLITUDE_GRID = ((1e-6, 0.6), (0.003, 0.1), (0.006, 0.1), (0.012, 0.1), (0.025, 0.08), (0.05, 0.02))
FREQUENCY_GRID = ((1e-6, 0.6), (0.015, 0.1), (0.03, 0.1), (0.06, 0.1), (0.12, 0.09), (0.2, 0.01))
_NODES = np.linspace(-2.5, 2.5, 11)  #: nodes of ln noise, in units of its standard deviation
#: Correlation of the errors of neighbouring rows where noise is not stated, with its prior probability: unknown errors
#: of a test are as often smooth (a mode shape, a reference) as independent at every row.
CORRELATION_GRID = ((0.0, 0.55), (0.3, 0.15), (0.6, 0.15), (0.8, 0.15))
_MOST_ROUNDS = 3  #: most refits, each at the most probable scatter and noise of the fit before
#: Largest deviation of a sweep, in standard deviations, from which a refit at another scatter starts.
_FARTHEST = 2.0


def stated_noise(rows: PhasorRows) -> PhasorRows:
    """The rows with noise from the record's standard uncertainties, ``FIRST_GUESS`` where it states none."""
    sd_phase = _fill(rows.sd_phase) if rows.has_phase else np.full(len(rows), UNSEEN)
    rows = replace(rows, sd_amplitude=np.hypot(_fill(rows.sd_amplitude), rows.sd_force), sd_phase=sd_phase)
    return further_noise(rows) if rows.channels else rows


def further_noise(rows: PhasorRows) -> PhasorRows:
    """Noise of further channels: the roughness along sweeps, and the share `FURTHER_ERROR` of the phasor.

    The roughness is that of the rows that measure the channel, which may be one sweep of several.
    """

    def noise(phasor: ComplexArray, sd: FloatArray, hum: float) -> FloatArray:
        measured = sd < UNSEEN
        if not measured.any():
            return sd
        subset, phasor = rows.where(measured), phasor[measured]
        floor = float(np.min(rows.sd_amplitude * rows.A))
        if not subset.at_resonance:
            parts = (roughness(subset, part / subset.A, (*SHARES, RANGED)) for part in (phasor.real, phasor.imag))
            rough = subset.A * np.hypot(*parts) / np.sqrt(2.0)
            floor = rough if np.max(rough) < np.max(np.abs(phasor)) else np.minimum(rough, floor)
            if np.max(np.abs(phasor)) < hum * np.max(rough):
                floor = np.maximum(floor, np.sqrt(0.5 * np.mean(np.abs(phasor) ** 2)))
        of_rows = np.full(len(rows), UNSEEN)
        of_rows[measured] = np.hypot(floor, FURTHER_ERROR * np.abs(phasor))
        return of_rows

    return replace(
        rows, sd_third=noise(rows.third, rows.sd_third, 0.0), sd_cross=noise(rows.cross, rows.sd_cross, _FLOOR)
    )


def is_stated(record: Record) -> tuple[bool, bool]:
    """Whether the record states the noise of amplitudes, and of phases."""
    names = ("amplitude_sd", "phase_sd")
    amplitude, phase = (name in record.frame.columns and bool(np.any(record.column(name) > 0.0)) for name in names)
    return amplitude, phase


def roughness(rows: PhasorRows, residual: FloatArray, shares: Sequence[float] = SHARES) -> FloatArray:
    """Noise (n,) of residuals (n,) that are otherwise smooth along each sweep.

    Four neighbours are combined so that any parabola through them cancels (repeated points are neighbours too); two
    where every sweep has fewer than four rows. The noise is s sqrt(1 + (rho A_low/A)^2), a share of the amplitude plus
    a constant part, or a share of the sweep's largest (``RANGED``). rho is the most likely of ``shares``. s is the root
    mean square without the largest, since an outlier is in four combinations. Rows at phase resonance alone give no
    estimate: ``FIRST_GUESS``.
    """
    width = next((w for w in (4, 2) if max(map(len, rows.runs)) >= w), 1)
    if rows.at_resonance or width == 1:
        return np.full(len(rows), FIRST_GUESS)
    weights, places = zip(
        *(_combinations(rows.omega[run], run, width) for run in rows.runs if len(run) >= width), strict=True
    )
    w, at = np.concatenate(weights), np.concatenate(places)
    combined = np.sum(w * residual[at], axis=1)
    choices = []
    for rho in shares:
        shape = np.sqrt(1.0 + (rho * np.quantile(rows.A, 0.1) / rows.A) ** 2)
        if rho == RANGED:
            shape = np.array([rows.A[run].max() for run in rows.runs])[rows.sweep] / rows.A
        of_shape = np.sqrt(np.sum(w**2 * shape[at] ** 2, axis=1))
        s = max(spread(combined / of_shape), LEAST)
        squares = np.minimum((combined / of_shape / s) ** 2, CLIP**2)
        log_p = -float(len(combined) * np.log(s) + 0.5 * np.sum(squares))
        choices.append((log_p - float(np.sum(np.log(of_shape))) - (_PRICE if rho else 0.0), s * shape))
    return max(choices, key=lambda choice: choice[0])[1]


def spread(values: FloatArray) -> float:
    """Standard deviation of normal values, robust to some outliers."""
    dropped = int(_TRIMMED * len(values))
    kept = np.sort(values**2)[: len(values) - dropped]
    return float(np.sqrt(kept.mean())) / (_OF_NORMAL if dropped else 1.0)


def _combinations(x: FloatArray, run: IntArray, width: int) -> tuple[FloatArray, IntArray]:
    """Unit-norm weights that cancel every polynomial of degree width - 2 over ``width`` neighbours; their rows."""
    places = np.arange(len(x) - width + 1)[:, np.newaxis] + np.arange(width)
    t = x[places]
    t = (t - t.mean(axis=1, keepdims=True)) / max(float(np.ptp(x)), 1e-300)
    vandermonde = np.stack([t**k for k in range(width - 1)], axis=1)
    return np.linalg.svd(vandermonde)[2][:, -1, :], run[places]  # orthogonal to all rows


def _fill(sd: FloatArray) -> FloatArray:
    """Uncertainties with unstated ones (0) replaced by the median of the others, or by ``FIRST_GUESS``."""
    stated = sd > 0.0
    return np.where(stated, sd, np.median(sd[stated]) if stated.any() else FIRST_GUESS)


@dataclass(frozen=True)
class Unknowns:
    """Candidates of scatter, correlation and noise with prior probabilities; one of each where all are stated."""

    scatters: tuple[tuple[float, float], ...]  #: candidates (amplitude, frequency)
    correlations: tuple[float, ...]  #: of neighbours
    noises: tuple[float, ...]  #: factors on the noise
    log_prior: FloatArray  #: ln prior probabilities, (scatters, correlations, noises)
    first: Scatter  #: the start of a search

    def scatter(self, index: int) -> Scatter:
        """The candidate of a flat index."""
        i, j, k = np.unravel_index(index, self.log_prior.shape)
        return Scatter(*self.scatters[i], self.noises[k], self.first.dispersion, self.correlations[j])


def list_unknowns(scatter: Scatter | None, bandwidth: float, noise_error: float, dispersion: float) -> Unknowns:
    """The candidates.

    Args:
        scatter: repeatability as stated; None where it is not.
        bandwidth: unit of the scatter of frequency.
        noise_error: standard deviation of the ln of the estimated noise; 0 where the noise is stated.
        dispersion: residuals of the best explanation over noise.
    """
    noises, p_noise = [1.0], np.ones(1)
    correlations: tuple[tuple[float, float], ...] = ((0.0, 1.0),)
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


def list_evidences(fit: ModelFit, unknown: Unknowns, outliers: bool = True) -> FloatArray:
    """ln evidence of the model of a fit with each scatter, correlation and noise, in the shape of their prior.

    Without ``outliers`` every value counts in full, since an outlier at one noise is regular at another.
    The factor on the noise is of amplitudes and phases alone: further channels leave less than their noise, most of
    which is a share of the phasor that the model may not predict (``FURTHER_ERROR``). Errors e along a sweep of
    correlation rho are independent as (e_i - rho e_(i-1))/sqrt(1 - rho^2).
    """
    k, sweeps = fit.model.size, fit.model.sweeps
    scale = _scales(fit.model.scatter, k, sweeps)
    outliers = outliers and not fit.model.problem.rows.of_peaks
    weights = fit.weights if outliers else np.ones(len(fit.r))
    root = np.sqrt(weights)
    J = fit.J / scale * root[:, np.newaxis]
    start = fit.r * root - J @ (fit.y * scale)  # residuals at x = 0, b = 0
    precision = (fit.model.scatter.noise / np.array(unknown.noises)) ** 2
    rows, own = fit.model.problem.rows, fit.model.problem.rows.values_of_mode
    regular = float(np.sum(weights[:own][rows.measured[:own]] > OUTLIER_WEIGHT))
    robust = float(log_likelihood(fit.r)) + 0.5 * float(weights @ fit.r**2) if outliers else 0.0
    base = robust + 0.5 * regular * np.log(precision) - regular * np.log(fit.model.scatter.noise)
    products, log_dets = [], []
    for rho in unknown.correlations:
        white, log_det = decorrelate(np.column_stack([J, start]), fit.model, rho)
        of_mode, further = (part.T @ part for part in (white[:own], white[own:]))
        products.append(np.multiply.outer(precision, of_mode) + further)
        log_dets.append(log_det)
    integrated = _integrate(np.concatenate(products), sweeps, unknown.scatters)
    return np.asarray(base + np.array(log_dets)[:, np.newaxis] + integrated.reshape(unknown.log_prior.shape))


def _integrate(products: FloatArray, sweeps: int, scatters: Sequence[tuple[float, float]]) -> FloatArray:
    """ln of the Gaussian integral over variables and deviations of sweeps, (scatters, products).

    That is -(r.r - g^T H^-1 g + ln det H)/2, g = D J^T r, H = 1 + D J^T J D, from the ``products`` of (J, r) with
    itself at each noise and correlation, (products, n, n). D is 1 for variables, else the scatter of gain or frequency.
    A row lies in one sweep, so the deviations make blocks of two by two. These are eliminated first, then the variables
    one by one, for all scatters and products at once.
    """
    k, scattered = products.shape[-1] - 1 - 2 * sweeps, len(scatters)
    kept, gain = np.array([*range(k), -1]), np.arange(k, k + sweeps)  # variables and residuals; gains
    frequency = gain + sweeps
    a, f = np.array(scatters).T[:, np.newaxis]  # (1, scatters) each
    of_gain, of_frequency, of_both = (
        products[:, rows, columns][..., np.newaxis]
        for rows, columns in ((gain, gain), (frequency, frequency), (gain, frequency))
    )
    first, second, both = 1.0 + a * a * of_gain, 1.0 + f * f * of_frequency, a * f * of_both
    det = first * second - both * both
    inverse = np.concatenate([a * a * second / det, f * f * first / det, -a * f * both / det], axis=1)
    u, v = products[:, gain][..., kept], products[:, frequency][..., kept]
    outer = np.concatenate(
        [_multiply_outer(u, u), _multiply_outer(v, v), _multiply_outer(u, v) + _multiply_outer(v, u)], axis=1
    )
    flat = outer.reshape(*outer.shape[:2], -1)
    eliminated = np.swapaxes(flat, 1, 2) @ inverse  # (products, pairs of variables and residuals, scatters)
    eliminated = np.moveaxis(eliminated.reshape(-1, k + 1, k + 1, scattered), 0, -1)
    reduced = np.moveaxis(products[:, kept[:, np.newaxis], kept], 0, -1)[:, :, np.newaxis] - eliminated
    reduced[range(k), range(k)] += 1.0
    log_det = np.sum(np.log(det), axis=1).T
    for j in range(k):
        column = reduced[j + 1 :, j]
        log_det += np.log(reduced[j, j])
        reduced[j + 1 :, j + 1 :] -= column[:, np.newaxis] * (column / reduced[j, j])
    return np.asarray(-0.5 * (reduced[k, k] + log_det))


def _multiply_outer(u: FloatArray, v: FloatArray) -> FloatArray:
    """Outer product of each row of u with the same row of v, (.., rows, entries, entries)."""
    return u[..., :, np.newaxis] * v[..., np.newaxis, :]


def marginalise_scatter(fit: ModelFit, unknown: Unknowns, least: float) -> ModelFit:
    """The fit at the most probable scatter and noise, with its evidence averaged over all of them.

    It is repeated there if its ln evidence reaches ``least``; other hypotheses do not matter. Where noise is not
    stated, every point may be regular at a larger noise: the answer must not depend on the first estimate.
    """
    if unknown.log_prior.size == 1:
        return fit  # there is nothing to choose
    for _ in range(_MOST_ROUNDS):
        evidences = list_evidences(fit, unknown) + unknown.log_prior
        likely = evidences
        if len(unknown.noises) > 1 and not fit.model.problem.rows.of_peaks:
            likely = max(evidences, list_evidences(fit, unknown, outliers=False) + unknown.log_prior, key=np.max)
        best = unknown.scatter(int(np.argmax(likely)))
        if best == fit.model.scatter or float(logsumexp(likely)) < least:
            break
        k, sweeps = fit.model.size, fit.model.sweeps
        z = fit.y[k:] * _scales(fit.model.scatter, 0, sweeps) / _scales(best, 0, sweeps)
        again = replace(fit.model, scatter=best)
        fit = fit_roughly(again, fit.y[np.newaxis, :k], np.clip(z, -_FARTHEST, _FARTHEST)[np.newaxis])[0]
    else:
        evidences = list_evidences(fit, unknown) + unknown.log_prior
    return replace(fit, log_evidence=float(logsumexp(evidences)))


def _scales(scatter: Scatter, variables: int, sweeps: int) -> FloatArray:
    return np.repeat([1.0, scatter.amplitude, scatter.frequency], [variables, sweeps, sweeps])
