"""Local estimates: natural frequency and damping ratio from each row alone, gathered by level and amplitude.

Every row with a phase measures Y = F exp(i phase)/A = K - M omega^2 + (S + i C)/A. With the simulation's mass it gives

    omega_local^2 = (Re Y)/M + omega^2,    zeta_local = Im Y/(2 M omega omega_n),

whatever the law. A constant zeta is viscous damping; a change with amplitude as A^p is a force C ~ A^(p + 1), and the
same for the stiffness: p = -1 friction, 1 velocity squared, 2 q^2 q' or a cubic spring.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.gap.rows import Rows
from selection.records.mode import Mode
from selection.units import RAD_S_PER_HZ

#: How near to phase resonance a row is taken that stands for it, rad.
RESONANCE_FOUND = 0.1
#: Bands of amplitude in every sweep.
BANDS = 4
#: With fewer values only growth in proportion is tried.
FEW = 6
#: Powers of amplitude that are tried.
POWERS = np.array([-1.0, -0.5, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0])


@dataclass(frozen=True)
class LocalEstimate:
    """Mean of the rows of one sweep in one band of amplitude, with standard errors; frequency in Hz."""

    sweep: str
    amplitude: float
    frequency: float
    frequency_sd: float
    damping: float
    damping_sd: float


@dataclass(frozen=True)
class Trend:
    """How an estimate depends on amplitude: as A^``power``, better than a constant by ``gain`` in chi-square.

    ``change`` is what it changes by from the smallest to the largest amplitude.
    """

    power: float
    gain: float
    change: float


def local_estimates(rows: Rows, mode: Mode) -> tuple[LocalEstimate, ...]:
    """Estimates by sweep and amplitude band, smallest amplitude first within a sweep; none without phases.

    A row that is at phase resonance has a phase, pi/2; it is taken to be found within 0.1 rad.
    """
    if not (rows.has_phase or rows.at_resonance):
        return ()
    sd_phase = rows.sd_phase if rows.has_phase else np.full(len(rows), RESONANCE_FOUND)
    M = mode.mass * rows.mass
    size = rows.F / rows.A
    Y = size * np.exp(1j * rows.phase)
    squared, zeta = Y.real / M + rows.omega**2, Y.imag / (2.0 * M * rows.omega * mode.omega_n)
    cos, sin = np.cos(rows.phase), np.sin(rows.phase)
    sd_real = size * np.hypot(cos * rows.sd_amplitude, sin * sd_phase)
    sd_imaginary = size * np.hypot(sin * rows.sd_amplitude, cos * sd_phase)
    found = []
    for number, sweep in enumerate(rows.sweeps):
        own = np.flatnonzero(rows.sweep == number)
        for band in np.array_split(own[np.argsort(rows.u[own])], min(BANDS, max(1, len(own) // 4))):
            omega2, omega2_sd, _ = _mean(squared[band], (sd_real / M)[band])
            damping, damping_sd, weights = _mean(
                zeta[band], (sd_imaginary / (2.0 * M * rows.omega * mode.omega_n))[band]
            )
            omega = float(np.sqrt(max(omega2, 0.0)))
            frequency_sd = omega2_sd / max(2.0 * omega, 1e-300) / RAD_S_PER_HZ
            amplitude = float(weights @ rows.A[band] / weights.sum())  # where the mean damping is that of a law
            found.append(LocalEstimate(sweep, amplitude, omega / RAD_S_PER_HZ, frequency_sd, damping, damping_sd))
    return tuple(found)


def trend(amplitude: FloatArray, value: FloatArray, sd: FloatArray) -> Trend | None:
    """The power of amplitude with which values (n,) go, by weighted least squares of 1 and A^p; None below 3 values."""
    if len(value) < 3:
        return None
    relative = amplitude / amplitude.max()
    constant = _chi_square(np.ones((len(value), 1)), value, sd)[0]
    found = []
    for power in POWERS if len(value) >= FEW else [1.0]:
        chi_square, coefficients = _chi_square(np.column_stack([np.ones(len(value)), relative**power]), value, sd)
        change = coefficients[1] * float(relative.max() ** power - relative.min() ** power)
        found.append(Trend(float(power), float(constant - chi_square), float(change)))
    return max(found, key=lambda one: one.gain)


def _mean(values: FloatArray, sd: FloatArray) -> tuple[float, float, FloatArray]:
    """Weighted mean, its sd and the weights; values beyond 4 sd from the median, wild ones, are left out."""
    near = np.abs(values - np.median(values)) < 4.0 * np.hypot(sd, np.median(sd))
    weights = np.where(near | ~near.any(), np.maximum(sd, 1e-12 * np.abs(values)) ** -2.0, 0.0)
    return float(weights @ values / weights.sum()), float(weights.sum() ** -0.5), weights


def _chi_square(design: FloatArray, value: FloatArray, sd: FloatArray) -> tuple[float, FloatArray]:
    scaled = design / sd[:, np.newaxis]
    coefficients = np.linalg.lstsq(scaled, value / sd)[0]
    return float(np.sum((value / sd - scaled @ coefficients) ** 2)), np.asarray(coefficients)
