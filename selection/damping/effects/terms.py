"""The prediction of a measured phasor from its terms.

A measured row is the phasor A exp(-i phi) under the force F. The prediction is composed of

    Z(A, omega) = M (omega_n^2 - omega^2) + (S + i C)/A              parameters and forces
    H = 1/Z, or (H_1 + t H_2)/(1 + t), H_2 = 1/(Z_2 + Delta K)       a second principal plane (3.1.24-3.1.35)
    swept_receptance(Z)                                              a frequency that moves: the motion lags behind
    H + R                                                            residual compliance of other modes (3.1.18)
    read(gain exp(-i lag) H F)                                       instruments, and loss of force

with Z at the measured amplitude, of which each plane has its share. P(u) = ln(prediction), u = ln A, therefore needs no
solution of the steady state; P'(u) gives the steady amplitude to first order (`damping.gap.model`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats, differs, join_complex, of_every
from damping.effects.contract import Drive, Instrument, Terms, add_parts
from damping.effects.detector import detect
from damping.effects.moving import swept_receptance
from damping.forces.contract import Force

NEAREST = 1e-6  #: least detuning of a row from resonance, relative to omega^2: less than any tolerance
_REFINEMENTS = 2  #: iterations for the amplitude of each path, whose share changes little


@dataclass(frozen=True)
class Prediction:
    """ln of the predicted phasor, P, and its derivatives by u = ln A and by ln omega_n, (batch, n) each.

    Real and imaginary part of P are kept apart, as residuals need them.
    """

    u: FloatArray  #: Re P, ln of the amplitude
    turned: FloatArray  #: Im P, minus the lag (rad)
    by_u: ComplexArray
    by_frequency: ComplexArray

    @property
    def P(self) -> ComplexArray:
        """Both as one complex number."""
        return join_complex(self.u, self.turned)


class _Receptance(NamedTuple):
    """Displacement per force, the part of each path in it, and the derivatives of its ln by ln A and ln omega_n."""

    H: ComplexArray
    paths: tuple[ComplexArray, ...]
    by_u: ComplexArray
    by_frequency: ComplexArray


def predict(terms: Terms, u: FloatArray, drive: Drive, every: int = 1) -> Prediction:
    """The prediction at measured ln amplitude ``u``, (n,) or (batch, n).

    ``every``: stride k; the derivative by ln omega_n is that of models 0, k, 2k ... alone.
    """
    gain, lag = terms.gain, terms.lag
    if terms.offset:
        offset = add_parts(terms.offset, drive)
        gain, lag = gain + np.real(offset), lag - np.imag(offset)
    v, per_u = _pass([reading.unread for reading in reversed(terms.readings)], u - gain)
    terms = terms.tuned(drive)
    turns = 0 if (terms.plane is None and not terms.compliance) or terms.linear else _REFINEMENTS
    receptance = _receptance(terms, drive, np.exp(v), turns, every)
    F = drive.F * np.exp(add_parts(terms.received, drive)) if terms.received else drive.F
    for limited in terms.limited:
        share, falls = limited(v)
        F, receptance = F * np.exp(share), receptance._replace(by_u=receptance.by_u + falls)
    x, y = receptance.H.real.copy(), receptance.H.imag.copy()
    real, phase = 0.5 * np.log(x * x + y * y) + np.log(F), np.arctan2(y, x)
    by_u, by_frequency = receptance.by_u, receptance.by_frequency
    if drive.resonant is not False and np.any(drive.resonant):
        real, phase, by_u, by_frequency = (
            np.where(drive.resonant, at, off)
            for at, off in zip(_at_resonance(receptance, F, every), (real, phase, by_u, by_frequency), strict=True)
        )
    real, slope = _pass([reading.read for reading in terms.readings], real)
    if terms.readings:
        by_u = slope * (by_u.real * per_u) + 1j * by_u.imag * per_u
        by_frequency = of_every(slope, every) * by_frequency.real + 1j * by_frequency.imag
    if terms.averaging:
        read, by_frequency = detect(join_complex(real, phase), by_frequency, terms, drive, every)
        real, phase = read.real, read.imag
    return Prediction(real + gain, phase - lag, by_u, by_frequency)


def _pass(instruments: Iterable[Instrument], v: FloatArray) -> tuple[FloatArray, Floats]:
    """ln amplitudes passed through instruments in series, and the total slope."""
    slope: Floats = 1.0
    for instrument in instruments:
        v, further = instrument(v)
        slope = slope * further
    return v, slope


def _at_resonance(receptance: _Receptance, F: FloatArray, every: int) -> tuple[Any, ...]:
    """Re P, Im P and derivatives with i Im(1/H) for 1/H: A = F/C where S + (K - M omega^2) A = 0 (section 4.1)."""
    stiffness = 1.0 / receptance.H
    # without damping there is no steady amplitude at resonance
    loss = np.where(stiffness.imag == 0.0, NEAREST * np.abs(stiffness), stiffness.imag)
    real = np.log(F) - np.log(np.abs(loss))
    by_u = (receptance.by_u * stiffness).imag / loss
    by_frequency = (receptance.by_frequency * of_every(stiffness, every)).imag / of_every(loss, every)
    return real, -0.5 * np.pi, by_u.astype(np.complex128), by_frequency.astype(np.complex128)


def complex_stiffness(terms: Terms, A: FloatArray, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
    """Z and dZ/d ln A at amplitude A."""
    return _add_forces(_Still.of(terms, drive), terms.forces, A, drive)


class _Still(NamedTuple):
    """Parts of Z that do not depend on amplitude: linear ``spring``, ``beside``, and factors on damping forces."""

    spring: FloatArray
    beside: Any
    own: Floats  #: factor on each of the first ``simulated`` forces
    damped: Floats  #: factor on all
    simulated: int

    @staticmethod
    def of(terms: Terms, drive: Drive) -> _Still:
        """These parts of the terms."""
        squared = np.square(drive.omega)
        detuning = np.square(terms.omega_n) - squared
        # Z of a simulation without damping is zero at its frequency
        if not detuning.all():
            detuning = np.where(detuning == 0.0, NEAREST * squared, detuning)
        spring = terms.M * drive.mass * detuning
        if differs(drive.added, 0.0):
            spring = spring - drive.added * squared
        own = drive.own * np.exp(add_parts(terms.stated, drive)) if terms.stated else drive.own
        damped = np.exp(add_parts(terms.damped, drive)) if terms.damped else 1.0
        return _Still(spring, add_parts(terms.beside, drive), own, damped, terms.simulated)


def _add_forces(
    still: _Still, forces: tuple[Force, ...], A: FloatArray, drive: Drive
) -> tuple[ComplexArray, ComplexArray]:
    """Z and dZ/d ln A with the forces at amplitude A."""
    real: Floats = still.spring
    imaginary: Floats = 0.0
    slope_real: Floats = 0.0
    slope_imaginary: Floats = 0.0
    scaled = differs(still.own, 1.0)
    for number, force in enumerate(forces):
        C, slope, S, in_phase_slope = force.averages(A, drive.omega)
        slope = slope - C
        if scaled and number < still.simulated:
            C, slope = C * still.own, slope * still.own
        imaginary = imaginary + C if number else C
        slope_imaginary = slope_imaginary + slope if number else slope
        if force.restores:
            real = real + S / A
            slope_real = slope_real + (in_phase_slope - S) / A
    damped = still.damped / A
    Z = join_complex(real, imaginary * damped)
    return Z + still.beside if np.ndim(still.beside) else Z, join_complex(slope_real, slope_imaginary * damped)


def _receptance(terms: Terms, drive: Drive, A: FloatArray, turns: int, every: int = 1) -> _Receptance:
    """H with each path's Z at the path's amplitude, iterated ``turns`` times from ``A``; ``every``: see `predict`."""
    still, compliance, amplitudes = _Still.of(terms, drive), add_parts(terms.compliance, drive), (A, A)
    ratio: Floats = 1.0 if terms.plane is None else terms.plane.ratio
    stiffer: Floats = 0.0
    if terms.plane is not None:
        stiffer = terms.M * drive.mass * np.square(terms.omega_n) * (np.square(ratio) - 1.0)
    for _ in range(turns):
        paths, _ = _list_paths(terms, drive, still, amplitudes, stiffer)
        amplitudes = _shares(terms, paths, A, sum(paths) + compliance)
    paths, changes = _list_paths(terms, drive, still, amplitudes, stiffer)
    # dZ/d ln omega_n
    by_stiffness = 2.0 * of_every(terms.M, every) * drive.mass * np.square(of_every(terms.omega_n, every))
    (per_Z, slope), *others = changes
    if len(paths) == 1 and not terms.compliance:
        return _Receptance(paths[0], paths, per_Z * slope, of_every(per_Z, every) * by_stiffness)
    by_u, by_frequency = paths[0] * per_Z * slope, of_every(paths[0] * per_Z, every) * by_stiffness
    H = paths[0] + compliance
    for per_Z, slope in others:
        by_u = by_u + paths[1] * per_Z * slope
        in_second = of_every(paths[1] * per_Z, every) * by_stiffness
        by_frequency = by_frequency + in_second * np.square(of_every(ratio, every))
        H = H + paths[1]
    per_H = np.reciprocal(H)
    return _Receptance(H, paths, by_u * per_H, by_frequency * of_every(per_H, every))


def _list_paths(
    terms: Terms, drive: Drive, still: _Still, amplitudes: tuple[FloatArray, FloatArray], stiffer: Floats
) -> tuple[tuple[ComplexArray, ...], list[tuple[ComplexArray, ComplexArray]]]:
    """Displacement per force of each plane at its amplitude; derivatives of its ln by Z, and of Z by ln A."""
    Z, slope = _add_forces(still, terms.forces, amplitudes[0], drive)
    H, per_Z = swept_receptance(Z, terms, drive)
    if terms.plane is None:
        return (H,), [(per_Z, slope)]
    t, _, in_both, damping = terms.plane
    Z, other = _add_forces(still, terms.forces if in_both else terms.viscous, amplitudes[1], drive)
    Z, other = Z.real + 1j * damping * Z.imag, other.real + 1j * damping * other.imag
    second, of_second = swept_receptance(Z + stiffer, terms, drive)
    return (H / (1.0 + t), t * second / (1.0 + t)), [(per_Z, slope), (of_second, other)]


def _shares(
    terms: Terms, paths: tuple[ComplexArray, ...], A: FloatArray, H: ComplexArray
) -> tuple[FloatArray, FloatArray]:
    """Amplitude of the motion in each plane: cos(theta) F |H_1| and sin(theta) F |H_2| if the sum ``H`` reads A."""
    per_reading = A / np.abs(H)
    if terms.plane is None:
        only = np.abs(paths[0]) * per_reading
        return only, only
    t = np.asarray(terms.plane.weight)
    first, second = (np.abs(path) * per_reading for path in paths)
    return first * np.sqrt(1.0 + t), second * np.sqrt((1.0 + t) / t)


def third_harmonic(terms: Terms, A: FloatArray, phase: FloatArray, drive: Drive) -> ComplexArray:
    """Phasor Q3 of the third harmonic at motion A sin(omega t - phase): q3 = Im Q3 exp(3 i omega t).

    It is that of the forces over the stiffness at 3 omega (the motion stays a sine): M q'' + K q = -g.
    """
    terms = terms.tuned(drive)
    harmonic = sum((force.third(A, drive.omega) for force in terms.forces), start=np.zeros(np.shape(A), complex))
    M = terms.M * drive.mass
    stiffness = M * (np.square(terms.omega_n) - 9.0 * np.square(drive.omega)) - 9.0 * drive.added * drive.omega**2
    return np.asarray(-harmonic * np.exp(-3j * phase) / stiffness)


def cross_motion(terms: Terms, A: FloatArray, drive: Drive) -> ComplexArray:
    """Phasor of the motion across the drive, F sin(theta) cos(theta) (H_1 - H_2) (3.1.24-3.1.27); 0 in one plane."""
    if terms.plane is None:
        return np.zeros(np.broadcast_shapes(np.shape(A), np.shape(terms.M)), dtype=np.complex128)
    receptance = _receptance(terms.tuned(drive), drive, A, 0)
    t = np.asarray(terms.plane.weight)
    first, second = receptance.paths[0] * (1.0 + t), receptance.paths[1] * (1.0 + t) / t
    return np.asarray(drive.F * np.sqrt(t) / (1.0 + t) * (first - second))
