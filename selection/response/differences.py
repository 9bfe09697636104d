"""Damped against undamped response curves (section 4.2, Figs 4.3 to 4.9).

At an amplitude A the undamped curve lies at the distance u = F/(M omega_n^2 A) from the backbone eta^2 = 1, the damped
one at sqrt(u^2 - G^2) (Eq 4.2.4). The horizontal difference of the two is delta, their vertical difference at the
damped curve's frequency epsilon. Sides: -1 below resonance, +1 above. For pure damping (no in-phase part). NaN where
the curve has no point of that amplitude: above the resonant one, and below resonance under the static one.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from selection.arrays import FloatArray, Floats
from selection.forces.contract import Force
from selection.forces.derived import damping_term

Side = Literal[-1, 1]


def undamped_distance(A: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """u = F/(M omega_n^2 A), the distance |1 - eta^2| of the undamped curve from the backbone (Eqs 4.2.8, 4.2.9)."""
    return np.asarray(F / (M * omega_n**2 * A))


def damped_distance(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1) -> FloatArray:
    """|1 - eta^2| of the damped curve at the amplitude A: sqrt(u^2 - G(A, omega)^2), omega that of the curve itself.

    The report takes G at omega_n; the two differ by the relative width of the resonance. NaN above the resonance.
    """
    u = undamped_distance(A, F, M, omega_n)
    distance = np.zeros(np.shape(u))
    with np.errstate(invalid="ignore"):
        for _ in range(50):  # G changes by a small share of itself over the curve: each turn adds digits
            omega = omega_n * np.sqrt(1.0 + side * distance)
            previous, distance = distance, np.sqrt(u**2 - damping_term(force, A, omega, M, omega_n) ** 2)
            if not np.any(np.abs(distance - previous) > 1e-15):
                break
    return np.asarray(distance)


def horizontal_difference(
    force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1
) -> FloatArray:
    """Delta = u - |1 - eta^2| of the damped curve at the amplitude A (Figs 4.3, 4.7)."""
    return undamped_distance(A, F, M, omega_n) - damped_distance(force, A, F, M, omega_n, side)


def measured_difference(A: Floats, omega: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """delta_e = F/(M omega_n^2 A) - |1 - eta^2| of data points (A, omega) (Eq 4.2.8)."""
    return undamped_distance(A, F, M, omega_n) - np.abs(1.0 - (omega / omega_n) ** 2)


def vertical_difference(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1) -> FloatArray:
    """Epsilon: undamped amplitude less A at the frequency where the damped curve has the amplitude A (Figs 4.3, 4.8).

    It grows without bound towards the resonance, where the undamped amplitude is infinite.
    """
    with np.errstate(divide="ignore"):
        return F / (M * omega_n**2 * damped_distance(force, A, F, M, omega_n, side)) - A


def percent_error_undamped(
    force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: Side = -1
) -> FloatArray:
    """100 delta/u, the error of Eq 4.2.9, which neglects damping, at the amplitude A (Fig 4.9).

    For case I, 100 (1 - sqrt(1 - (A/A_m)^2)) but for the frequency in G: 13.4 % at half the resonant amplitude.
    """
    return 100.0 * horizontal_difference(force, A, F, M, omega_n, side) / undamped_distance(A, F, M, omega_n)
