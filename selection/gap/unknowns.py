"""Repeatability and noise that are not stated: evidence of a fit over a grid of both.

Gain and frequency of each sweep deviate by b = scatter z, z ~ N(0, 1), and the noise is a factor s times its estimate.
Around the mode of a fit the residuals are linear in (x, b), so the evidence of any scatter and noise is a Gaussian
integral in closed form, with the fit's robust weights.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import logsumexp

from selection.arrays import FloatArray
from selection.gap.fit import WILD_WEIGHT, Fit, fit, log_likelihood
from selection.gap.model import Scatter

#: Scatter of gain, and of frequency in units of the bandwidth, with their prior probabilities.
AMPLITUDE_GRID = ((1e-6, 0.6), (0.003, 0.1), (0.006, 0.1), (0.012, 0.1), (0.025, 0.1))
FREQUENCY_GRID = ((1e-6, 0.6), (0.015, 0.08), (0.03, 0.08), (0.06, 0.08), (0.12, 0.08), (0.25, 0.08))
#: Nodes and weights of N(0, 1) in five points (Gauss-Hermite).
_NODES = ((-2.857, 0.01126), (-1.3556, 0.22208), (0.0, 0.53333), (1.3556, 0.22208), (2.857, 0.01126))


@dataclass(frozen=True)
class Unknowns:
    """Every scatter and noise considered with its prior probability; one where both are stated.

    Attributes:
        all: the candidates. log_prior: logarithms of their probabilities. first: the one that a search begins with.
    """

    all: tuple[Scatter, ...]
    log_prior: FloatArray
    first: Scatter

    @property
    def known(self) -> bool:
        """Whether there is nothing to choose."""
        return len(self.all) == 1


def unknowns(scatter: Scatter | None, bandwidth: float, noise_error: float, dispersion: float) -> Unknowns:
    """The candidates.

    Args:
        scatter: repeatability as stated; None where it is not. bandwidth: unit of the scatter of frequency.
        noise_error: standard deviation of the ln of the estimated noise; 0 where the noise is stated.
        dispersion: by how much every explanation misses the record by more than noise.
    """
    noises = [(float(np.exp(noise_error * x)), p) for x, p in _NODES] if noise_error > 0.0 else [(1.0, 1.0)]
    if scatter is not None:
        found = [(replace(scatter, noise=s, dispersion=dispersion), p) for s, p in noises]
        first = replace(scatter, dispersion=dispersion)
    else:
        found = [
            (Scatter(a, f * bandwidth, s, dispersion), p_a * p_f * p_s)
            for (a, p_a), (f, p_f), (s, p_s) in product(AMPLITUDE_GRID, FREQUENCY_GRID, noises)
        ]
        first = Scatter(0.003, 0.03 * bandwidth, 1.0, dispersion)
    return Unknowns(tuple(one for one, _ in found), np.log([p for _, p in found]), first)


def evidences(one: Fit, scatters: tuple[Scatter, ...]) -> FloatArray:
    """ln evidence of the model of a fit with each scatter and noise, (scatters,)."""
    k, sweeps = one.model.size, one.model.sweeps
    own = _scales(one.model.scatter, k, sweeps)
    J = one.J / own
    weighted = J * one.weights[:, np.newaxis]
    start = one.r - J @ (one.y * own)  # residuals at x = 0, b = 0
    N, h = weighted.T @ J, weighted.T @ start
    scale = np.stack([_scales(scatter, k, sweeps) for scatter in scatters])
    precision = (one.model.scatter.noise / np.array([scatter.noise for scatter in scatters])) ** 2
    H = N * scale[:, :, np.newaxis] * scale[:, np.newaxis, :] * precision[:, np.newaxis, np.newaxis] + np.eye(len(own))
    g = h * scale * precision[:, np.newaxis]
    solved = np.linalg.solve(H, g[:, :, np.newaxis])[:, :, 0]
    regular = float(np.sum(one.weights > WILD_WEIGHT))
    robust = float(log_likelihood(one.r)) + 0.5 * float(one.weights @ one.r**2) + 0.5 * regular * np.log(precision)
    least = 0.5 * float(one.weights @ start**2) * precision - 0.5 * np.sum(g * solved, axis=1)
    return np.asarray(robust - least - 0.5 * np.linalg.slogdet(H)[1] - regular * np.log(one.model.scatter.noise))


def settled(one: Fit, unknown: Unknowns, least: float) -> Fit:
    """The fit at the most probable scatter and noise, its evidence averaged over all of them.

    It is made again at these where its evidence comes up to ``least``: others do not matter.
    """
    if unknown.known:
        return one
    found = evidences(one, unknown.all) + unknown.log_prior
    best = unknown.all[int(np.argmax(found))]
    if best != one.model.scatter and float(logsumexp(found)) > least:
        one = _refitted(one, best)
        found = evidences(one, unknown.all) + unknown.log_prior
    return replace(one, log_evidence=float(logsumexp(found)))


def _refitted(one: Fit, scatter: Scatter) -> Fit:
    k, sweeps = one.model.size, one.model.sweeps
    z = one.y[k:] * _scales(one.model.scatter, 0, sweeps) / _scales(scatter, 0, sweeps)
    model = replace(one.model, scatter=scatter)
    return fit(model, one.y[np.newaxis, :k], np.clip(z, -2.0, 2.0)[np.newaxis])[0]


def _scales(scatter: Scatter, variables: int, sweeps: int) -> FloatArray:
    return np.repeat([1.0, scatter.amplitude, scatter.frequency], [variables, sweeps, sweeps])
