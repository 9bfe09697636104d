"""Measured motion of a node to the motion of one mode (chapter III): displacement, modal, principal, planar.

The node moves as x = X sin(omega t - phi_x) under F sin(omega t) at that node. Away from resonance every other mode
and the rigid body move in phase with the force or opposite to it, so they add X_in sin(omega t) with a signed X_in
(section 3.1). Amplitudes here carry that sign (positive below resonance); the report's A_j of Eq. 3.1.14 are their
magnitudes, and its signs in Eqs. 3.1.15-3.1.20 are those of the second of four modes, which this reproduces.

The mode bends in two principal planes of slightly different frequency (section 3.2). The force component in each plane
excites it as one degree of freedom. The damping factor xi, common to both, makes the sum of the energy losses equal to
the energy input (Eq. 3.2.15). That equation has several roots or none: `damping_roots` returns all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin

import numpy as np
from numpy.polynomial import Polynomial

from damping.arrays import STANDARD_GRAVITY_REPORT_IN_S2, FloatArray, Floats


def displacement(
    acceleration: Floats, omega: Floats, force: Floats = 1.0, unit: float = STANDARD_GRAVITY_REPORT_IN_S2
) -> Floats:
    """Amplitude of displacement, x = unit a F/omega^2 (section 3.1, Table 3.I).

    Args:
        acceleration: amplitude a of acceleration, per unit of force where ``force`` is given.
        omega: frequency, rad/s.
        force: force amplitude F that a reading per unit of force is multiplied by (the report's text leaves it out,
            its table does not: erratum E3I-5).
        unit: length/s^2 of one unit of acceleration; the report's g of 386 in/s^2 by default.
    """
    return unit * acceleration * force / omega**2


def yaw_displacement(yaw_acceleration: Floats, pitch_acceleration: Floats, pitch_displacement: Floats) -> Floats:
    """Yaw displacement of a node = (tip yaw acceleration/tip pitch acceleration) pitch displacement (Eq. 3.1.1).

    Holds if yaw and pitch have the same mode shape. Accelerations in one unit; the result in that of the displacement.
    """
    return yaw_acceleration / pitch_acceleration * pitch_displacement


@dataclass(frozen=True)
class NodeMode:
    """A mode at a node: ``phi`` node per modal displacement, ``mass`` M_j, ``omega`` omega_j in rad/s."""

    phi: float
    mass: float
    omega: float


@dataclass(frozen=True)
class NodeCorrection:
    """Correction for other motion at the node, over phi of the mode of interest; arrays over the test points.

    ``adjacent``: one array per other mode; ``rigid_body``; each is a term of Eq. 3.1.20 with its sign there.
    """

    adjacent: tuple[FloatArray, ...]
    rigid_body: FloatArray

    @property
    def total(self) -> FloatArray:
        """C_t of Eq. 3.1.20, added to the modal amplitude in phase with the force."""
        return np.asarray(np.sum(self.adjacent, axis=0) + self.rigid_body)


def node_correction(
    mode: NodeMode, others: Sequence[NodeMode], F: Floats, omega: Floats, r2_over_i: float = 0.0, omega_r: float = 0.0
) -> NodeCorrection:
    """C_t = (-X^R - sum_j phi_j Q_j)/phi over the other modes j: Eq. 3.1.20, term by term.

    Q_j = phi_j F/(M_j (omega_j^2 - omega^2)) (Eqs. 3.1.13, 3.1.14) and X^R = (R^2/I) F/(omega_R^2 - omega^2) (3.1.16),
    both signed: X^R is negative above omega_R.

    Args:
        F: force amplitude at the node.
        omega: forcing frequency, rad/s.
        r2_over_i: R^2/I (1/mass) of rigid-body rotation; 0 if the body is fixed.
        omega_r: its frequency, rad/s.
    """
    undamped = (other.phi * F / (other.mass * (other.omega**2 - omega**2)) for other in others)
    adjacent = tuple(np.asarray(-other.phi * Q / mode.phi) for other, Q in zip(others, undamped, strict=True))
    return NodeCorrection(adjacent, np.asarray(-(r2_over_i * F / (omega_r**2 - omega**2)) / mode.phi))


def modal_phase(X: Floats, phi_x: Floats, C_t: Floats, phi: float) -> Floats:
    """phi_2 = atan2(X sin phi_x, X cos phi_x + C_t phi), the modal phase lag, rad (Eq. 3.1.22)."""
    return np.arctan2(X * np.sin(phi_x), X * np.cos(phi_x) + C_t * phi)


def modal_amplitude(X: Floats, phi_x: Floats, C_t: Floats, phi: float, phi_2: Floats) -> Floats:
    """A_2 = X/phi cos(phi_2 - phi_x) + C_t cos phi_2, the modal amplitude (Eq. 3.1.23)."""
    return X / phi * np.cos(phi_2 - phi_x) + C_t * np.cos(phi_2)


def identify_r2_over_i(
    mode: NodeMode, others: Sequence[NodeMode], F: FloatArray, omega: FloatArray, omega_r: float, C_t: FloatArray
) -> float:
    """R^2/I that best fits known corrections C_t (linear least squares in Eq. 3.1.20).

    The report prints neither R nor I; its corrections of Table 3.III give R^2/I = 1.92e-4 in/(lb s^2).
    """
    per_unit = node_correction(mode, others, F, omega, 1.0, omega_r)
    remaining = C_t - np.sum(per_unit.adjacent, axis=0)
    return float(per_unit.rigid_body @ remaining / (per_unit.rigid_body @ per_unit.rigid_body))


@dataclass(frozen=True)
class PrincipalPlanes:
    """A mode in two planes (Eq. 3.2.16): ``phi`` node per modal displacement, ``mass`` M, frequencies in rad/s."""

    phi: float
    mass: float
    omega_p: float
    omega_y: float
    theta: float  #: angle from the direction of the force to the principal pitch plane, rad

    @property
    def planes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """(natural frequency, modal force per unit force) of pitch and yaw (Eqs. 3.2.4, 3.2.5)."""
        return (self.omega_p, self.phi * cos(self.theta)), (self.omega_y, -self.phi * sin(self.theta))


@dataclass(frozen=True)
class PlaneMotion:
    """Amplitude and energy loss per cycle in both planes: ``A_p, A_y, E_p, E_y``."""

    A_p: Floats
    A_y: Floats
    E_p: Floats
    E_y: Floats


@dataclass(frozen=True)
class DampingRoots:
    """Solutions of Eq. 3.2.15 at one point: ``roots`` in rising order, empty if there are none."""

    roots: FloatArray
    #: ``xi_peak``, ``energy_peak``: damping factor at which the energy loss is largest, and that energy
    xi_peak: float
    energy_peak: float


def input_energy(X: Floats, F: Floats, phi: Floats) -> Floats:
    """Delta W per cycle = pi X F sin(phi), phi the lag of X behind F (Eq. 3.2.9)."""
    return np.pi * X * F * np.sin(phi)


def viscous_energy(A: Floats, M: float, omega_j: float, xi: Floats, omega: Floats) -> Floats:
    """Delta W per cycle = 2 pi M omega_j xi A^2 omega (Eq. 3.2.11; with 3.2.12 it is 3.2.13, erratum E3213)."""
    return 2.0 * np.pi * M * omega_j * xi * A**2 * omega


def plane_motion(planes: PrincipalPlanes, F: Floats, omega: Floats, xi: Floats) -> PlaneMotion:
    """Motion in both principal planes, with r = omega/omega_j.

    Amplitudes |F|/(M omega_j^2 sqrt((1 - r^2)^2 + (2 xi r)^2)) (Eqs. 3.1.8, 3.2.12), energy losses (3.2.13, 3.2.14).
    """
    A, E = [], []
    for omega_j, g in planes.planes:
        r = omega / omega_j
        A.append(np.abs(g * F) / (planes.mass * omega_j**2 * np.hypot(1.0 - r**2, 2.0 * xi * r)))
        E.append(viscous_energy(A[-1], planes.mass, omega_j, xi, omega))
    return PlaneMotion(*A, *E)


def energy_loss(planes: PrincipalPlanes, F: Floats, omega: Floats, xi: Floats) -> Floats:
    """E_p + E_y, the right side of Eq. 3.2.15."""
    motion = plane_motion(planes, F, omega, xi)
    return motion.E_p + motion.E_y


def damping_roots(planes: PrincipalPlanes, F: float, omega: float, energy: float) -> DampingRoots:
    """All xi > 0 at which the energy loss equals ``energy`` (Eq. 3.2.15).

    Each plane loses a xi/(b + c xi^2), so the equation is a polynomial of degree four in xi: no root is missed.
    """
    (n1, d1), (n2, d2) = (_loss_fraction(planes.mass, g * F, omega_j, omega) for omega_j, g in planes.planes)
    loss, below = n1 * d2 + n2 * d1, d1 * d2
    roots = _positive_roots(energy * below - loss)
    if below(0.0) == 0.0:  # exactly at a natural frequency the loss grows without bound as xi falls
        return DampingRoots(roots, 0.0, np.inf)
    stationary = _positive_roots(loss.deriv() * below - loss * below.deriv())
    energies = np.asarray(energy_loss(planes, F, omega, stationary))
    return DampingRoots(roots, float(stationary[energies.argmax()]), float(energies.max()))


def _loss_fraction(M: float, F: float, omega_j: float, omega: float) -> tuple[Polynomial, Polynomial]:
    """Numerator a xi and denominator b + c xi^2 of one plane's energy loss (Eq. 3.2.13)."""
    r = omega / omega_j
    a = 2.0 * np.pi * F**2 * omega / (M * omega_j**3)
    return Polynomial([0.0, a]), Polynomial([(1.0 - r**2) ** 2, 0.0, (2.0 * r) ** 2])


def _positive_roots(equation: Polynomial) -> FloatArray:
    """Positive real roots in rising order, polished by Newton's method."""
    z = equation.roots()
    roots = np.sort(z[(np.abs(z.imag) < 1e-7 * np.abs(z)) & (z.real > 0)].real)
    for _ in range(3):  # each step squares the remaining error
        roots = roots - equation(roots) / equation.deriv()(roots)
    return roots


def nearest_roots(points: Sequence[DampingRoots], xi: Floats, largest: float = np.inf) -> FloatArray:
    """The root of each point nearest to its ``xi``, of those below ``largest``; NaN if none."""
    near = np.broadcast_to(xi, len(points))
    return np.array([nearest_root(p.roots[p.roots < largest], of) for p, of in zip(points, near, strict=True)])


def nearest_root(roots: FloatArray, xi: float) -> float:
    """The root nearest to ``xi``; NaN if there is none."""
    return float(roots[np.argmin(np.abs(roots - xi))]) if roots.size else np.nan


def branch(points: Sequence[DampingRoots], which: int, largest: float = np.inf) -> FloatArray:
    """One root per point: the lowest (``which`` 0) or the highest (-1) of those below ``largest``; NaN if none."""
    kept = [point.roots[point.roots < largest] for point in points]
    return np.array([roots[which] if roots.size else np.nan for roots in kept])


def mean_coefficient(M: float, omega: FloatArray, xi: FloatArray) -> float:
    """C_1 = (2 M/m) sum_i omega_i xi_i over the m points with a xi (Eq. 3.2.18)."""
    return float(2.0 * M * np.nanmean(omega * xi))
