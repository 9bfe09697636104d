"""Motion of one node to the amplitude and phase of one mode: other modes and rigid-body motion removed (section 3.1).

The node moves as x = X sin(omega t - phi_x) under F sin(omega t) at that node. Away from resonance every other mode
and the rigid body move in phase with the force or opposite to it, so what they add is X_in sin(omega t) with a signed
X_in. Amplitudes here carry that sign (positive below resonance); the report's A_j of Eq. 3.1.14 are their magnitudes
and its signs in Eqs. 3.1.15-3.1.20 those of the second of four modes, which this reproduces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray, Floats


@dataclass(frozen=True)
class NodeMode:
    """A mode as a node sees it: ``phi`` node per modal displacement, ``mass`` M_j, ``omega`` omega_j in rad/s."""

    phi: float
    mass: float
    omega: float


@dataclass(frozen=True)
class NodeCorrection:
    """What moves at the node beside the mode of interest, over that mode's phi; arrays over the test points.

    ``adjacent``: one array per other mode; ``rigid_body``; each is a part of Eq. 3.1.20 with its sign there.
    """

    adjacent: tuple[FloatArray, ...]
    rigid_body: FloatArray

    @property
    def total(self) -> FloatArray:
        """C_t of Eq. 3.1.20, to be added to the modal amplitude in phase with the force."""
        return np.sum(self.adjacent, axis=0) + self.rigid_body


def modal_force(F: Floats, phi: float) -> Floats:
    """F_e = phi F (Eqs. 2.2.3, 3.1.11)."""
    return phi * F


def undamped_amplitude(mode: NodeMode, F: Floats, omega: Floats) -> Floats:
    """Q_j = phi F/(M_j (omega_j^2 - omega^2)): Eqs. 3.1.13 and 3.1.14, with sign."""
    return modal_force(F, mode.phi) / (mode.mass * (mode.omega**2 - omega**2))


def rigid_body_amplitude(F: Floats, omega: Floats, r2_over_i: float, omega_r: float) -> Floats:
    """X^R = (R^2/I) F/(omega_R^2 - omega^2): Eq. 3.1.16, with sign (negative above omega_R)."""
    return r2_over_i * F / (omega_r**2 - omega**2)


def node_correction(
    mode: NodeMode, others: Sequence[NodeMode], F: Floats, omega: Floats, r2_over_i: float = 0.0, omega_r: float = 0.0
) -> NodeCorrection:
    """C_t = (-X^R - sum_j phi_j Q_j)/phi over the other modes j: Eq. 3.1.20, part by part.

    Args:
        mode: the mode of interest.
        others: the modes to remove.
        F: force amplitude at the node.
        omega: forcing frequency, rad/s.
        r2_over_i: R^2/I of rigid-body rotation, 1/mass; 0 where the body is held.
        omega_r: frequency of rigid-body rotation, rad/s.
    """
    adjacent = tuple(np.asarray(-other.phi * undamped_amplitude(other, F, omega) / mode.phi) for other in others)
    rigid = np.asarray(-rigid_body_amplitude(F, omega, r2_over_i, omega_r) / mode.phi)
    return NodeCorrection(adjacent, rigid)


def modal_phase(X: Floats, phi_x: Floats, C_t: Floats, phi: float) -> Floats:
    """phi_2 = atan2(X sin phi_x, X cos phi_x + C_t phi), the modal phase lag, rad (Eq. 3.1.22)."""
    return np.arctan2(X * np.sin(phi_x), X * np.cos(phi_x) + C_t * phi)


def modal_amplitude(X: Floats, phi_x: Floats, C_t: Floats, phi: float, phi_2: Floats) -> Floats:
    """A_2 = X/phi cos(phi_2 - phi_x) + C_t cos phi_2, the modal amplitude (Eq. 3.1.23)."""
    return X / phi * np.cos(phi_2 - phi_x) + C_t * np.cos(phi_2)


def identify_r2_over_i(
    mode: NodeMode, others: Sequence[NodeMode], F: FloatArray, omega: FloatArray, omega_r: float, C_t: FloatArray
) -> float:
    """R^2/I that fits known corrections C_t best (least squares in Eq. 3.1.20, in which it is linear).

    The report prints neither R nor I; its corrections of Table 3.III give R^2/I = 1.92e-4 in/(lb s^2).
    """
    per_unit = node_correction(mode, others, F, omega, 1.0, omega_r)
    remaining = C_t - np.sum(per_unit.adjacent, axis=0)
    return float(per_unit.rigid_body @ remaining / (per_unit.rigid_body @ per_unit.rigid_body))
