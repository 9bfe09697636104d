"""Residuals of a fit along sweeps: their noise from row to row, runs of one sign, and rows that deviate together."""

import numpy as np
from scipy.special import ndtr

from damping.arrays import FloatArray, IntArray
from damping.infer.best_fit import BestFit
from damping.infer.likelihood import residuals
from damping.infer.observations import Observations

#: Fewest rows of a sweep for second differences and runs.
FEWEST_ROWS = 6
#: Second differences of white noise have six times its variance and, being correlated, two thirds of their number in
#: degrees of freedom.
DIFFERENCE_VARIANCE = 6.0
DIFFERENCE_FREEDOM = 2.0 / 3.0
#: Misfit along the sweeps over the scatter from row to row, above which it is smooth if runs are few too: it then has
#: at least the variance of that scatter. A stated uncertainty may be larger; it does not say that rows err apart.
SMOOTH = 1.5
MEASURED = 1e-4  #: least misfit, relative amplitude, of readings: the smooth errors of a computation are smaller
FEW_RUNS = 0.01  #: probability below which runs are few
FEWEST_INDEPENDENT = 3.0  #: independent rows of a sweep, at least: the ends and the middle of a smooth misfit


def measure_roughness(n: FloatArray, data: Observations) -> tuple[float, float]:
    """Noise of one row from second differences of ``n`` along each sweep, and its degrees of freedom (0: none)."""
    differences = [np.diff(n[rows], 2) for rows in _list_along_sweeps(data)]
    if not differences:
        return np.nan, 0.0
    every = np.concatenate(differences)
    return float(np.sqrt(np.mean(every**2) / DIFFERENCE_VARIANCE)), DIFFERENCE_FREEDOM * len(every)


def runs_probability(n: FloatArray, data: Observations) -> float:
    """Probability of as few runs of one sign about each sweep's median, by normal approximation; 1 without sweeps."""
    excess = variance = 0.0
    for rows in _list_along_sweeps(data):
        above = n[rows] > np.median(n[rows])
        plus, total = float(above.sum()), float(len(above))
        minus = total - plus
        mean = 1.0 + 2.0 * plus * minus / total
        excess += 1.0 + float(np.sum(above[1:] != above[:-1])) - mean
        variance += (mean - 1.0) * (mean - 2.0) / (total - 1.0)
    return float(ndtr(excess / np.sqrt(variance))) if variance > 0.0 else 1.0


def misfit_along_sweeps(fit: BestFit, data: Observations) -> FloatArray:
    """Residuals n (rows,) of a fit with the gain of each sweep left free."""
    n, h, _ = residuals(fit.force, data)
    gain = np.bincount(data.sweep, h * n) / np.maximum(np.bincount(data.sweep, h * h), 1e-300)
    return np.asarray(n - gain[data.sweep] * h)


def count_together(fit: BestFit, data: Observations) -> float:
    """Rows that count as one independent row, since their residuals deviate together; 1 unless the misfit is smooth.

    That is the autocorrelation time 1 + 2 sum rho_k, by the initial positive sequence (Geyer 1992). In a decay errors
    are smooth by nature, and its levels share them.
    """
    n, runs = misfit_along_sweeps(fit, data), _list_along_sweeps(data)
    noise, differences = measure_roughness(n, data)
    if data.amplitude_is_input or not differences or np.sqrt(np.mean(n**2)) < max(SMOOTH * noise, MEASURED):
        return 1.0
    if runs_probability(n, data) >= FEW_RUNS:
        return 1.0
    longest = max(map(len, runs))
    products = [np.correlate(n[rows], n[rows], "full")[len(rows) - 1 :] for rows in runs]
    rho = np.sum([np.pad(product, (0, longest - len(product))) for product in products], axis=0)
    pairs = np.add.reduceat(rho / rho[0], np.arange(0, longest, 2))
    ends = np.flatnonzero(pairs <= 0.0)
    together = 2.0 * float(np.sum(pairs[: ends[0] if ends.size else None])) - 1.0
    return float(np.clip(together, 1.0, np.mean([len(rows) for rows in runs]) / FEWEST_INDEPENDENT))


def _list_along_sweeps(data: Observations) -> list[IntArray]:
    """Indices of the rows of each sweep with at least ``FEWEST_ROWS``, by frequency."""
    return [run[np.argsort(data.omega[run], kind="stable")] for run in data.runs if len(run) >= FEWEST_ROWS]
