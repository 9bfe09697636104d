"""Weights of laws from whole levels held out, the higher predicted from the lower.

A level is one force (:func:`damping.records.resonance.number_levels`). Every level with at least two below it is
predicted from those below, as a design load is from the test. The log predictive densities, added over those levels,
give pseudo-BMA weights

    w_m  ~  exp(sum_j ln p_m(A_j | levels below j)),

shrunk towards equal ones while fewer than ``ENOUGH`` levels are held out. Points within a sweep share their error, so
no point-wise leave-one-out value is used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp, ndtr, softmax

from damping.arrays import FloatArray, Floats, IntArray
from damping.infer.evidence import Estimate, evidence
from damping.infer.law import Coordinates, Law
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude
from damping.records.resonance import number_levels

#: Levels below a held-out one, at least; held-out levels from which on weights are not shrunk.
FEWEST_BELOW, ENOUGH = 2, 4
#: Draws kept of each prediction: a density in its bulk is then known to 3 %.
DRAWS = 1024
#: Sweeps of a level taken together: memory does not grow with their number.
SWEEPS_AT_ONCE = 8


@dataclass(frozen=True)
class HeldOut:
    """Resonant amplitudes of one level as a law predicts them from levels below.

    Attributes:
        level: its number, lowest 0. below: number of (lowest) levels that the law was fitted to.
        log_z: log marginal likelihood of the law on those.
        measured: ln of the resonant amplitude of each sweep of the level, (sweeps,).
        distance: ln of its force over the largest one fitted to, (sweeps,).
        log_amplitude: ln of the law's amplitude, (draws, sweeps); NaN where a draw has no resonance.
        scatter: relative scatter of a measured resonance, (draws,).
    """

    level: int
    below: int
    log_z: float
    measured: FloatArray
    distance: FloatArray
    log_amplitude: FloatArray
    scatter: FloatArray

    def log_density(self, kappa: FloatArray) -> FloatArray:
        """Log predictive density of the measured, mean over sweeps, for each ``kappa`` (k,); shape (k,).

        Normal about each draw with variance scatter^2 + (kappa distance)^2; a draw without resonance counts as 0.
        """
        parts = np.array_split(np.arange(len(self.measured)), -(-len(self.measured) // SWEEPS_AT_ONCE))
        return np.asarray(np.mean(np.concatenate([self._log_densities(kappa, part) for part in parts], axis=1), axis=1))

    def _log_densities(self, kappa: FloatArray, part: IntArray) -> FloatArray:
        """Log predictive density of some sweeps, (k, part)."""
        variance = self.scatter[:, None, None] ** 2 + (kappa[:, None] * self.distance[part]) ** 2
        squared = (self.measured[part] - self.log_amplitude[:, None, part]) ** 2 / variance
        value = np.where(np.isfinite(squared), -0.5 * (squared + np.log(2.0 * np.pi * variance)), -np.inf)
        return np.asarray(logsumexp(value, axis=0) - np.log(len(value)))

    def probability_below(self) -> float:
        """Predictive probability, without any discrepancy, of an amplitude below the measured; mean over sweeps.

        A draw without resonance has an unbounded amplitude.
        """
        z = (self.measured - self.log_amplitude) / self.scatter[:, None]
        return float(np.mean(ndtr(np.where(np.isfinite(z), z, -np.inf))))


def held_out(
    law: Law, data: Observations, below: int, seed: int = 0, estimate: Estimate = evidence
) -> tuple[HeldOut, ...]:
    """Every level above the ``below`` lowest, predicted by a law fitted to those.

    Raises:
        AnalysisError: the law cannot carry the forces of the lower levels.
    """
    levels = number_levels(data.tested_force)
    lower = data.keep_sweeps(levels < below)
    coordinates = Coordinates.of(law, lower)
    found = estimate(coordinates, lower, seed)
    x = found.draws[:: len(found.draws) // DRAWS]
    scatter = resonance_scatter(coordinates, x)
    largest = lower.tested_force.max()
    predictions = []
    for level in range(below, int(levels.max()) + 1):
        force, measured = data.tested_force[levels == level], data.tested_amplitude[levels == level]
        with np.errstate(invalid="ignore"):
            amplitude = np.log(resonant_amplitude(coordinates.force(x), force[None, :], lower.tested_omega[lower.top]))
        distance = np.log(force / largest)
        predictions.append(
            HeldOut(level, below, found.log_z, np.log(measured), distance, np.asarray(amplitude), scatter)
        )
    return tuple(predictions)


def resonance_scatter(coordinates: Coordinates, x: FloatArray) -> FloatArray:
    """Relative scatter of a level's measured resonance at points (draws, dimension): rows and levels, (draws,)."""
    row, level = coordinates.scatter(x)
    return np.asarray(np.hypot(row, level))


def pseudo_bma(log_density: FloatArray) -> FloatArray:
    """Weights of laws (laws,) from their log predictive densities of each held-out level, (laws, levels).

    With n < ``ENOUGH`` levels, n/ENOUGH parts pseudo-BMA and the rest equal.
    """
    laws, levels = log_density.shape
    total = log_density.sum(axis=1)
    trust = min(1.0, levels / ENOUGH) if np.isfinite(total).any() else 0.0
    equal: Floats = np.full(laws, 1.0 / laws)
    return np.asarray(trust * softmax(total) + (1.0 - trust) * equal if trust > 0.0 else equal)
