"""Repeatability that is not stated: evidence of a fit over a grid of scatters of gain and frequency.

Gain and frequency of each sweep deviate by b = scatter z, z ~ N(0, 1). Around the mode of a fit the residuals are
linear in (x, b), so the evidence of any scatter is a Gaussian integral in closed form, with the fit's robust weights.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from selection.arrays import FloatArray
from selection.gap.fit import Fit, fit, log_likelihood
from selection.gap.model import Scatter

#: Scatter of gain, and of frequency in units of the bandwidth, with their prior probabilities.
AMPLITUDE_GRID = np.array([1e-6, 0.003, 0.006, 0.012, 0.025])
FREQUENCY_GRID = np.array([1e-6, 0.015, 0.03, 0.06, 0.12, 0.25])
AMPLITUDE_PRIOR = np.array([0.6, 0.1, 0.1, 0.1, 0.1])
FREQUENCY_PRIOR = np.array([0.6, 0.08, 0.08, 0.08, 0.08, 0.08])


def grid(bandwidth: float) -> tuple[list[Scatter], FloatArray]:
    """All scatters considered and the logarithms of their prior probabilities."""
    pairs = [Scatter(a, f) for a in AMPLITUDE_GRID for f in FREQUENCY_GRID * bandwidth]
    return pairs, np.log(np.outer(AMPLITUDE_PRIOR, FREQUENCY_PRIOR)).ravel()


def evidences(one: Fit, scatters: list[Scatter]) -> FloatArray:
    """ln evidence of the model of a fit with each scatter, (scatters,)."""
    k, sweeps = one.model.size, one.model.sweeps
    own = _scales(one.model.scatter, k, sweeps)
    J = one.J / own
    weighted = J * one.weights[:, np.newaxis]
    start = one.r - J @ (one.y * own)  # residuals at x = 0, b = 0
    N, h = weighted.T @ J, weighted.T @ start
    scale = np.stack([_scales(scatter, k, sweeps) for scatter in scatters])
    H = N * scale[:, :, np.newaxis] * scale[:, np.newaxis, :] + np.eye(len(own))
    g = h * scale
    solved = np.linalg.solve(H, g[:, :, np.newaxis])[:, :, 0]
    robust = float(log_likelihood(one.r)) + 0.5 * float(one.weights @ one.r**2)
    least = 0.5 * float(one.weights @ start**2) - 0.5 * np.sum(g * solved, axis=1)
    return np.asarray(robust - least - 0.5 * np.linalg.slogdet(H)[1])


def with_scatter(one: Fit, least: float) -> Fit:
    """The fit at the most probable scatter, its evidence averaged over all scatters.

    It is made again at that scatter where its evidence comes up to ``least``: others do not matter.
    """
    scatters, log_prior = grid(one.model.problem.scales.bandwidth)
    found = evidences(one, scatters) + log_prior
    best = scatters[int(np.argmax(found))]
    if best != one.model.scatter and float(logsumexp(found)) > least:
        one = _refitted(one, best)
        found = evidences(one, scatters) + log_prior
    return replace(one, log_evidence=float(logsumexp(found)))


def _refitted(one: Fit, scatter: Scatter) -> Fit:
    k, sweeps = one.model.size, one.model.sweeps
    z = one.y[k:] * _scales(one.model.scatter, 0, sweeps) / _scales(scatter, 0, sweeps)
    model = replace(one.model, scatter=scatter)
    return fit(model, one.y[np.newaxis, :k], np.clip(z, -2.0, 2.0)[np.newaxis])[0]


def _scales(scatter: Scatter, variables: int, sweeps: int) -> FloatArray:
    return np.repeat([1.0, scatter.amplitude, scatter.frequency], [variables, sweeps, sweeps])
