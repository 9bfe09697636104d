"""The mode with planar coupling: two principal planes at an angle to the force and to the reading (Eqs. 3.1.24-3.1.35).

Phasors: a motion A sin(omega t - phi) under F sin(omega t) is the complex number A exp(-i phi).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from selection.arrays import FloatArray, Floats

ComplexArray = npt.NDArray[np.complex128]


class PlanarOscillator(NamedTuple):
    """Mass M, viscous coefficient C (equal in all directions), principal frequencies in rad/s, angle theta in rad.

    Fields may be arrays that broadcast with the frequency.
    """

    M: Floats
    C: Floats
    omega_p: Floats
    omega_y: Floats
    theta: Floats


class Stiffness(NamedTuple):
    """Stiffness in the vehicle's pitch and yaw directions: ``pp``, ``yy`` and the coupling ``py``."""

    pp: Floats
    yy: Floats
    py: Floats


def vehicle_stiffness(K_p: Floats, K_y: Floats, theta: Floats) -> Stiffness:
    """Principal stiffnesses K_p, K_y turned by theta into the vehicle's axes (Eqs. 3.1.24-3.1.26).

    With omega^2 = K/M the same holds for frequencies squared.
    """
    c, s = np.cos(theta), np.sin(theta)
    return Stiffness(K_p * c**2 + K_y * s**2, K_p * s**2 + K_y * c**2, (K_p - K_y) * s * c)


def pitch_response(oscillator: PlanarOscillator, F_p: Floats, omega: Floats) -> ComplexArray:
    """Phasor of the pitch motion under F_p in pitch: the sum over both principal planes.

    F_p/M [cos^2 theta/(omega_p^2 - omega^2 + i omega C/M) + sin^2 theta/(omega_y^2 - omega^2 + i omega C/M)],
    identical with Eqs. 3.1.30-3.1.35.
    """
    M, C, omega_p, omega_y, theta = oscillator
    pitch, yaw = _receptance(M, C, omega_p, omega), _receptance(M, C, omega_y, omega)
    return F_p * (np.cos(theta) ** 2 * pitch + np.sin(theta) ** 2 * yaw)


def yaw_response(oscillator: PlanarOscillator, F_p: Floats, omega: Floats) -> ComplexArray:
    """Phasor of the yaw motion under F_p in pitch (from Eqs. 3.1.27, 3.1.28): zero for theta = 0."""
    M, C, omega_p, omega_y, theta = oscillator
    pitch, yaw = _receptance(M, C, omega_p, omega), _receptance(M, C, omega_y, omega)
    return F_p * np.sin(theta) * np.cos(theta) * (pitch - yaw)


def amplitude(response: ComplexArray) -> FloatArray:
    """A of a phasor A exp(-i phi)."""
    return np.abs(response)


def phase(response: ComplexArray) -> FloatArray:
    """Lag phi of a phasor A exp(-i phi), rad, between 0 and 2 pi."""
    return np.mod(-np.angle(response), 2.0 * np.pi)


def pitch_amplitude_and_phase(oscillator: PlanarOscillator, F_p: Floats, omega: Floats) -> tuple[Floats, Floats]:
    """Amplitude and phase lag (0 to 2 pi) by the report's own formulas (Eqs. 3.1.31, 3.1.34, 3.1.35)."""
    M, C, omega_p, omega_y, theta = oscillator
    N1 = -(omega**2) + omega_p**2 * np.sin(theta) ** 2 + omega_y**2 * np.cos(theta) ** 2
    N2 = -C / M * omega
    N3 = (omega_p**2 - omega**2) * (omega_y**2 - omega**2) - (C / M) ** 2 * omega**2
    N4 = -C / M * omega * ((omega_p**2 - omega**2) + (omega_y**2 - omega**2))
    sine, cosine = N2 * N3 - N1 * N4, N1 * N3 + N2 * N4
    return np.hypot(sine, cosine) / (N3**2 + N4**2) * F_p / M, np.mod(np.arctan2(sine, cosine), 2.0 * np.pi)


def _receptance(M: Floats, C: Floats, omega_j: Floats, omega: Floats) -> ComplexArray:
    return np.asarray(1.0 / (M * (omega_j**2 - omega**2) + 1j * C * omega))
