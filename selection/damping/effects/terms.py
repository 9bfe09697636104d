"""What a prediction is made of, and the prediction of a measured phasor.

A measured row is the phasor A exp(-i phi) under the force F. The prediction is composed of

    Z(A, omega) = M (omega_n^2 - omega^2) + (S + i C)/A              parameters and forces
    H = 1/Z, or (H_1 + t H_2)/(1 + t), H_2 = 1/(Z_2 + Delta K)       a second principal plane (3.1.24-3.1.35)
    hurried(Z)                                                       a frequency that moves (`damping.effects.hurried`)
    H + R                                                            residual compliance of other modes (3.1.18)
    read(gain exp(-i lag) H F)                                       instruments, and what is lost of the force

with Z taken at the measured amplitude (of which each plane has its share). P(u) = ln(prediction), u = ln A, therefore
needs no solution of the steady state; with P'(u) its own steady amplitude is found from it to first order
(`damping.gap.model`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats
from damping.effects.contract import Drive, Terms, add_parts
from damping.effects.hurried import hurried

#: Times that the amplitude of each path is refined: the shares of the paths change little.
_REFINEMENTS = 2


@dataclass(frozen=True)
class Prediction:
    """ln of the predicted phasor, P, and its derivatives by u = ln A and by ln omega_n; complex, (batch, n)."""

    P: ComplexArray
    by_u: ComplexArray
    by_frequency: ComplexArray


class _Receptance(NamedTuple):
    """Displacement per force, the part of each path in it, and minus its changes by ln A and ln omega_n."""

    H: ComplexArray
    paths: tuple[ComplexArray, ...]
    by_u: ComplexArray
    by_frequency: ComplexArray


def predict(terms: Terms, u: FloatArray, drive: Drive) -> Prediction:
    """The prediction at measured ln amplitude ``u``, (n,) or (batch, n)."""
    offset = add_parts(terms.offset, drive)
    gain, lag = terms.gain + np.real(offset), terms.lag - np.imag(offset)
    v, per_u = _unread(terms, u - gain)
    A = np.exp(v)
    terms = tuned(terms, drive)
    receptance = _receptance(terms, drive, (A, A))
    if not terms.linear and (terms.plane is not None or terms.compliance):
        for _ in range(_REFINEMENTS):
            receptance = _receptance(terms, drive, _shares(terms, receptance, A))
    F = drive.F
    if terms.received:
        F = F * np.exp(add_parts(terms.received, drive))
    H = receptance.H
    P = 0.5 * np.log(H.real**2 + H.imag**2) + np.log(F) + 1j * np.arctan2(H.imag, H.real)
    by_u, by_frequency = -receptance.by_u / H, -receptance.by_frequency / H
    if np.any(drive.resonant):
        P, by_u, by_frequency = (
            np.where(drive.resonant, at, beside)
            for at, beside in zip(_at_resonance(receptance, F), (P, by_u, by_frequency), strict=True)
        )
    real, slope = _read(terms, P.real)
    if terms.readings:
        by_u, by_frequency = (slope * part.real + 1j * part.imag for part in (by_u * per_u, by_frequency))
    return Prediction(real + gain + 1j * (P.imag - lag), by_u, by_frequency)


def tuned(terms: Terms, drive: Drive) -> Terms:
    """The terms with omega_n as it is at each row: of its state, and drifting."""
    if not terms.detuned and np.all(drive.ratio == 1.0):
        return terms
    return replace(terms, omega_n=terms.omega_n * drive.ratio * np.exp(add_parts(terms.detuned, drive)), detuned=())


def _read(terms: Terms, v: FloatArray) -> tuple[FloatArray, FloatArray]:
    slope = np.ones(1)
    for reading in terms.readings:
        v, own = reading.read(v)
        slope = slope * own
    return v, slope


def _unread(terms: Terms, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    slope = np.ones(1)
    for reading in reversed(terms.readings):
        u, own = reading.unread(u)
        slope = slope * own
    return u, slope


def _at_resonance(found: _Receptance, F: FloatArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """P and its derivatives with Im(1/H) for 1/H: A = F/C where S + (K - M omega^2) A = 0 (section 4.1)."""
    stiffness = 1.0 / found.H
    # a simulation without damping loses nothing at all, and would stand still at no amplitude
    loss = np.where(stiffness.imag == 0.0, NEAREST * np.abs(stiffness), stiffness.imag)
    squared = found.H * found.H
    real = np.log(F) - np.log(np.abs(loss))
    by_u, by_frequency = (
        (-(part / squared).imag / loss).astype(np.complex128) for part in (found.by_u, found.by_frequency)
    )
    return np.asarray(real - 0.5j * np.pi), by_u, by_frequency


#: Distance from resonance, relative to omega^2, at which a row exactly at it is taken: less than any tolerance.
NEAREST = 1e-6


def complex_stiffness(terms: Terms, A: FloatArray, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
    """Z and dZ/d ln A at amplitude A."""
    detuning = np.square(terms.omega_n) - np.square(drive.omega)
    # a row exactly at the frequency of a simulation without damping: no stiffness is left to divide by
    detuning = np.where(detuning == 0.0, NEAREST * np.square(drive.omega), detuning)
    real = terms.M * drive.mass * detuning - drive.added * np.square(drive.omega)
    imaginary: Floats = 0.0
    slope_real: Floats = 0.0
    slope_imaginary: Floats = 0.0
    for number, force in enumerate(terms.forces):
        own = drive.own if number < terms.simulated else 1.0
        C, slope, S, in_phase_slope = force.averages(A, drive.omega)
        imaginary = imaginary + C * own
        slope_imaginary = slope_imaginary + (slope - C) * own
        if force.restores:
            real = real + S / A
            slope_real = slope_real + (in_phase_slope - S) / A
    damped = np.exp(add_parts(terms.damped, drive)) / A
    return (
        np.asarray(real + 1j * (imaginary * damped) + add_parts(terms.beside, drive)),
        np.asarray(slope_real + 1j * (slope_imaginary * damped)),
    )


def _receptance(terms: Terms, drive: Drive, amplitudes: tuple[FloatArray, FloatArray]) -> _Receptance:
    """H with each plane's Z at its own amplitude."""
    Z, slope = complex_stiffness(terms, amplitudes[0], drive)
    by_stiffness = 2.0 * terms.M * drive.mass * np.square(terms.omega_n)  # dZ/d ln omega_n
    H, squared = hurried(Z, terms, drive)
    by_u, by_frequency = squared * slope, squared * by_stiffness
    paths: tuple[ComplexArray, ...] = (H,)
    if terms.plane is not None:
        t, ratio, alike, damping = terms.plane
        other = terms if alike else replace(terms, forces=terms.viscous)
        Z, slope = complex_stiffness(other, amplitudes[1], drive)
        Z, slope = Z.real + 1j * damping * Z.imag, slope.real + 1j * damping * slope.imag
        second, squared = hurried(Z + 0.5 * by_stiffness * (np.square(ratio) - 1.0), terms, drive)
        squared = t * squared
        by_u = (by_u + squared * slope) / (1.0 + t)
        by_frequency = (by_frequency + squared * by_stiffness * np.square(ratio)) / (1.0 + t)
        paths = (H / (1.0 + t), t * second / (1.0 + t))
        H = paths[0] + paths[1]
    for part in terms.compliance:
        H = H + part(drive)
    return _Receptance(H, paths, by_u, by_frequency)


def _shares(terms: Terms, found: _Receptance, A: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude of the motion in each plane: cos(theta) F |H_1| and sin(theta) F |H_2| when the sum reads A."""
    per_reading = A / np.abs(found.H)
    if terms.plane is None:
        own = np.abs(found.paths[0]) * per_reading
        return own, own
    t = np.asarray(terms.plane.weight)
    first, second = (np.abs(path) * per_reading for path in found.paths)
    return first * np.sqrt(1.0 + t), second * np.sqrt((1.0 + t) / t)


#: Points of half a cycle (the other is its opposite) from which the third harmonic of a force is taken: right to one in
#: a hundred for friction, better for others.
_CYCLE = 24


def third_harmonic(terms: Terms, A: FloatArray, phase: FloatArray, drive: Drive) -> ComplexArray:
    """Phasor Q3 of the third harmonic at motion A sin(omega t - phase): q3 = Im Q3 exp(3 i omega t).

    That of the forces over the stiffness at 3 omega (the motion itself stays a sine): M q'' + K q = -g.
    """
    terms = tuned(terms, drive)
    theta = np.pi * (np.arange(_CYCLE) + 0.5).reshape(-1, 1, 1) / _CYCLE
    cycle: Floats = 0.0
    for force in terms.forces:
        cycle = cycle + np.asarray(force.cycle(theta, A, drive.omega))
    if np.ndim(cycle) == 0:
        return np.zeros(np.broadcast_shapes(np.shape(A), np.shape(terms.M)), dtype=np.complex128)
    harmonic = 2j * np.mean(cycle * np.exp(-3j * theta), axis=0)
    M = terms.M * drive.mass
    stiffness = M * (np.square(terms.omega_n) - 9.0 * np.square(drive.omega)) - 9.0 * drive.added * drive.omega**2
    return np.asarray(-harmonic * np.exp(-3j * phase) / stiffness)


def cross_motion(terms: Terms, A: FloatArray, drive: Drive) -> ComplexArray:
    """Phasor of the motion across the drive, F sin(theta) cos(theta) (H_1 - H_2) (3.1.24-3.1.27); 0 in one plane."""
    if terms.plane is None:
        return np.zeros(np.broadcast_shapes(np.shape(A), np.shape(terms.M)), dtype=np.complex128)
    receptance = _receptance(tuned(terms, drive), drive, (A, A))
    t = np.asarray(terms.plane.weight)
    first, second = receptance.paths[0] * (1.0 + t), receptance.paths[1] * (1.0 + t) / t
    return np.asarray(drive.F * np.sqrt(t) / (1.0 + t) * (first - second))
