"""Slip damping and its velocity-squared equivalent (section 2.4), as printed and exact.

The report integrates the slip loop of Fig. 2.5 to A^2 (K - K1) - A1^2 (K - K1) (Eq 2.4.3). The parallelogram has the
area 4 (K - K1) A1 (A - A1); the printed energy is (A + A1)/(4 A1) times that, equal only at A = 3 A1 (erratum E243).
The bars over A and K in Eq 2.4.4 stand for A and K (erratum E244).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray, Floats
from selection.forces.slip import Slip
from selection.forces.velocity_squared import VelocitySquared


def printed_energy(slip: Slip, A: Floats) -> Floats:
    """(K - K1)(A^2 - A1^2) for A > A1, zero below: Eq 2.4.3 as printed (erratum E243)."""
    slipping = np.maximum(A, slip.limit)
    return slip.stiffness * (slipping**2 - slip.limit**2)


def exact_energy(slip: Slip, A: Floats) -> Floats:
    """4 (K - K1) A1 (A - A1) for A > A1, zero below: the area of the slip loop."""
    return 4.0 * slip.stiffness * slip.limit * (np.maximum(A, slip.limit) - slip.limit)


def printed_coefficient(slip: Slip, A: Floats, omega: Floats) -> Floats:
    """C3 = 3 (A^2 - A1^2)(K - K1)/(8 A^3 omega^2): Eq 2.4.4 as printed (erratum E243)."""
    return 3.0 * printed_energy(slip, A) / (8.0 * A**3 * omega**2)


def corrected_coefficient(slip: Slip, A: Floats, omega: Floats) -> Floats:
    """C3 = 3 A1 (A - A1)(K - K1)/(2 A^3 omega^2): the velocity-squared force of equal energy per cycle at A."""
    return 3.0 * exact_energy(slip, A) / (8.0 * A**3 * omega**2)


@dataclass(frozen=True)
class EquivalenceError:
    """How far a velocity-squared force stands for slip, against ``amplitude`` (> A1); arrays of one shape.

    ``coefficient_percent``: Eq 2.4.4 as printed against corrected, at each amplitude.
    ``printed_percent``, ``corrected_percent``: energy of the force with C3 fixed at the reference amplitude, printed
    or corrected, against the exact energy of the joint: what a model identified at one level does at the others.
    ``shape_percent``: with equal energy, root mean square over the cycle of the difference between the joint's force
    about its mean slope (K less what slip lost, S/A) and C3 q'^2 sgn q', over that of the former.
    """

    amplitude: FloatArray
    coefficient_percent: FloatArray
    printed_percent: FloatArray
    corrected_percent: FloatArray
    shape_percent: FloatArray


def equivalence_error(slip: Slip, amplitude: FloatArray, reference: float, points: int = 2880) -> EquivalenceError:
    """Error of the velocity-squared equivalence fixed at ``reference``, at each ``amplitude``, all above A1.

    The frequency cancels: C3 omega^2 is what the equivalence fixes (section 2.4).
    """
    A = np.asarray(amplitude, dtype=float)
    exact = np.asarray(exact_energy(slip, A))
    growth = (8.0 / 3.0) * A**3 / exact
    return EquivalenceError(
        amplitude=A,
        coefficient_percent=np.asarray(100.0 * (printed_energy(slip, A) / exact - 1.0)),
        printed_percent=np.asarray(100.0 * (printed_coefficient(slip, reference, 1.0) * growth - 1.0)),
        corrected_percent=np.asarray(100.0 * (corrected_coefficient(slip, reference, 1.0) * growth - 1.0)),
        shape_percent=_shape_percent(slip, A, points),
    )


def _shape_percent(slip: Slip, A: FloatArray, points: int) -> FloatArray:
    theta = np.linspace(0.0, 2.0 * np.pi, points, endpoint=False) + np.pi / points
    amplitude = A[..., np.newaxis]
    about_mean_slope = slip.cycle(theta, amplitude, 1.0) - slip.in_phase(amplitude, 1.0) * np.sin(theta)
    equivalent = VelocitySquared(corrected_coefficient(slip, amplitude, 1.0)).cycle(theta, amplitude, 1.0)
    residual = np.mean((about_mean_slope - equivalent) ** 2, axis=-1)
    return 100.0 * np.sqrt(residual / np.mean(np.asarray(about_mean_slope) ** 2, axis=-1))
