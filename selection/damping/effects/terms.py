"""What a prediction is made of, and the prediction of a measured phasor.

A measured row is the phasor A exp(-i phi) under the force F. The prediction is composed of

    Z(A, omega) = M (omega_n^2 - omega^2) + (S + i C)/A              parameters and forces
    H = 1/Z, or (H_1 + t H_2)/(1 + t), H_2 = 1/(Z_2 + Delta K)       a second principal plane (3.1.24-3.1.35)
    hurried(Z)                                                       a frequency that moves: the motion lags behind
    H + R                                                            residual compliance of other modes (3.1.18)
    read(gain exp(-i lag) H F)                                       instruments, and what is lost of the force

with Z at the measured amplitude (of which each plane has its share). P(u) = ln(prediction), u = ln A, so needs no
solution of the steady state; with P'(u) its own steady amplitude follows to first order (`damping.gap.model`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from scipy.special import wofz

from damping.arrays import BoolArray, ComplexArray, FloatArray, Floats, differs
from damping.effects.contract import Drive, Instrument, Terms, add_parts

#: Distance from resonance, relative to omega^2, at which a row exactly at it is taken: less than any tolerance.
NEAREST = 1e-6
#: Times that the amplitude of each path is refined: the shares of the paths change little.
_REFINEMENTS = 2
#: |alpha/p^2| below which a moving frequency changes nothing that can be computed, and below which its own change is
#: taken to first order: differences of nearly equal numbers say less.
_SLOW = 1e-8
_SLOWLY = 1e-3
#: Exponent up to which what rings is counted: where it is larger nothing has begun to ring.
_LOUDEST = 50.0
#: Least square of the frequency that rings over that of the drive: numbers stay finite where nothing does.
_RINGS = 0.01


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


def predict(terms: Terms, u: FloatArray, drive: Drive, every: int = 1) -> Prediction:
    """The prediction at measured ln amplitude ``u``, (n,) or (batch, n).

    ``every``: stride k; the derivative by ln omega_n is given of models 0, k, 2k ... alone.
    """
    offset = add_parts(terms.offset, drive)
    gain, lag = terms.gain + np.real(offset), terms.lag - np.imag(offset)
    v, per_u = _pass([reading.unread for reading in reversed(terms.readings)], u - gain)
    A = np.exp(v)
    terms = terms.tuned(drive)
    receptance = _receptance(terms, drive, (A, A), every)
    if (terms.plane is not None or terms.compliance) and not terms.linear:
        for _ in range(_REFINEMENTS):
            receptance = _receptance(terms, drive, _shares(terms, receptance, A), every)
    F = drive.F * np.exp(add_parts(terms.received, drive))
    x, y = receptance.H.real.copy(), receptance.H.imag.copy()
    real, phase = 0.5 * np.log(x * x + y * y) + np.log(F), np.arctan2(y, x)
    per_H = -1.0 / receptance.H
    by_u, by_frequency = receptance.by_u * per_H, receptance.by_frequency * _of_every(per_H, every)
    if drive.resonant is not False and np.any(drive.resonant):
        real, phase, by_u, by_frequency = (
            np.where(drive.resonant, at, beside)
            for at, beside in zip(_at_resonance(receptance, F, every), (real, phase, by_u, by_frequency), strict=True)
        )
    real, slope = _pass([reading.read for reading in terms.readings], real)
    if terms.readings:
        by_u = slope * (by_u.real * per_u) + 1j * by_u.imag * per_u
        by_frequency = _of_every(slope, every) * by_frequency.real + 1j * by_frequency.imag
    return Prediction(_join(real + gain, phase - lag), by_u, by_frequency)


def _of_every(values: Any, every: int) -> Any:
    """Values (batch, n) of models 0, k, 2k ..., k = ``every``; values that all models share stay."""
    return values[::every] if np.ndim(values) > 1 else values


def _join(real: Floats, imaginary: Floats) -> ComplexArray:
    """real + i imaginary, without what multiplying complex numbers takes."""
    same = np.shape(real) == np.shape(imaginary)
    joined = np.empty(np.shape(real) if same else np.broadcast(real, imaginary).shape, dtype=np.complex128)
    joined.real, joined.imag = real, imaginary
    return joined


def _pass(instruments: Iterable[Instrument], v: FloatArray) -> tuple[FloatArray, Floats]:
    """What instruments make of ln amplitudes, one after the other, and the slope of all of them."""
    slope: Floats = 1.0
    for instrument in instruments:
        v, own = instrument(v)
        slope = slope * own
    return v, slope


def _at_resonance(receptance: _Receptance, F: FloatArray, every: int) -> tuple[Any, ...]:
    """Re P, Im P and derivatives with Im(1/H) for 1/H: A = F/C where S + (K - M omega^2) A = 0 (section 4.1)."""
    stiffness = 1.0 / receptance.H
    # a simulation without damping loses nothing at all, and would stand still at no amplitude
    loss = np.where(stiffness.imag == 0.0, NEAREST * np.abs(stiffness), stiffness.imag)
    squared = receptance.H * receptance.H
    real = np.log(F) - np.log(np.abs(loss))
    by_u = -(receptance.by_u / squared).imag / loss
    by_frequency = -(receptance.by_frequency / _of_every(squared, every)).imag / _of_every(loss, every)
    return real, -0.5 * np.pi, by_u.astype(np.complex128), by_frequency.astype(np.complex128)


def complex_stiffness(terms: Terms, A: FloatArray, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
    """Z and dZ/d ln A at amplitude A."""
    detuning = np.square(terms.omega_n) - np.square(drive.omega)
    # a row exactly at the frequency of a simulation without damping: no stiffness is left to divide by
    if not detuning.all():
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
    Z = _join(real, imaginary * damped)
    return Z + add_parts(terms.beside, drive) if terms.beside else Z, _join(slope_real, slope_imaginary * damped)


def _receptance(terms: Terms, drive: Drive, amplitudes: tuple[FloatArray, FloatArray], every: int = 1) -> _Receptance:
    """H with each plane's Z at its own amplitude; ``every``: see `predict`."""
    Z, slope = complex_stiffness(terms, amplitudes[0], drive)
    # dZ/d ln omega_n
    by_stiffness = 2.0 * _of_every(terms.M, every) * drive.mass * np.square(_of_every(terms.omega_n, every))
    H, squared = hurried(Z, terms, drive)
    by_u, by_frequency = squared * slope, _of_every(squared, every) * by_stiffness
    paths: tuple[ComplexArray, ...] = (H,)
    if terms.plane is not None:
        t, ratio, in_both, damping = terms.plane
        other = terms if in_both else terms._replace(forces=terms.viscous)
        Z, slope = complex_stiffness(other, amplitudes[1], drive)
        Z, slope = Z.real + 1j * damping * Z.imag, slope.real + 1j * damping * slope.imag
        stiffer = terms.M * drive.mass * np.square(terms.omega_n) * (np.square(ratio) - 1.0)
        second, squared = hurried(Z + stiffer, terms, drive)
        squared = t * squared
        by_u = (by_u + squared * slope) / (1.0 + t)
        in_second = _of_every(squared, every) * by_stiffness * np.square(_of_every(ratio, every))
        by_frequency = (by_frequency + in_second) / (1.0 + _of_every(t, every))
        paths = (H / (1.0 + t), t * second / (1.0 + t))
        H = paths[0] + paths[1]
    for part in terms.compliance:
        H = H + part(drive)
    return _Receptance(H, paths, by_u, by_frequency)


def _shares(terms: Terms, receptance: _Receptance, A: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude of the motion in each plane: cos(theta) F |H_1| and sin(theta) F |H_2| when the sum reads A."""
    per_reading = A / np.abs(receptance.H)
    if terms.plane is None:
        own = np.abs(receptance.paths[0]) * per_reading
        return own, own
    t = np.asarray(terms.plane.weight)
    first, second = (np.abs(path) * per_reading for path in receptance.paths)
    return first * np.sqrt(1.0 + t), second * np.sqrt((1.0 + t) / t)


def third_harmonic(terms: Terms, A: FloatArray, phase: FloatArray, drive: Drive) -> ComplexArray:
    """Phasor Q3 of the third harmonic at motion A sin(omega t - phase): q3 = Im Q3 exp(3 i omega t).

    That of the forces over the stiffness at 3 omega (the motion itself stays a sine): M q'' + K q = -g.
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
    receptance = _receptance(terms.tuned(drive), drive, (A, A))
    t = np.asarray(terms.plane.weight)
    first, second = receptance.paths[0] * (1.0 + t), receptance.paths[1] * (1.0 + t) / t
    return np.asarray(drive.F * np.sqrt(t) / (1.0 + t) * (first - second))


def hurried(Z: ComplexArray, terms: Terms, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
    """H and -dH/dZ of a path of complex stiffness Z while the frequency moves at d omega/dt = alpha.

    With Z = M (i omega - lambda)(i omega - lambda*) the motion Im a exp(i theta), theta'' = alpha, has
    a = (J - 1/(i omega - lambda*)) F/(2 i M Im lambda), J' = 1 - p J, p = i omega - lambda. Where p moves by i alpha
    alone, J is I(p) = int_0^inf exp(-p s + i alpha s^2/2) ds = sqrt(pi/b)/2 w(i p/(2 sqrt b)), b = -i alpha/2 (Lewis
    1932, whose Fresnel integrals w contains), which is 1/p where alpha = 0. What else changes along a sweep (damping,
    stiffness) comes with the memory of the rows before (`_remembered`).

    An envelope of first order, 2 i M omega a' + (Z + i M alpha) a = F, turns slower by (omega - Im lambda)^2/(2 omega)
    beyond resonance; so may what an instrument that tracks the frequency reads of a motion that rings beside it.
    ``terms.ringing`` is 0 for the motion itself, 1 for that envelope.
    """
    if not terms.moving and not differs(drive.rate, 0.0):
        H = 1.0 / Z
        return H, H * H
    alpha = add_parts(terms.moving, drive) + drive.rate * (drive.omega / terms.omega_n) ** terms.law
    M, omega, share = terms.M * drive.mass + drive.added, drive.omega, terms.ringing
    loss, squared = Z.imag / (M * omega), Z.real / M + np.square(omega)
    own = np.sqrt(np.maximum(squared - 0.25 * loss * loss, _RINGS * np.square(omega)))
    p = 0.5 * loss + 1j * (omega - own)
    p, alpha = np.broadcast_arrays(p + share * ((Z - 1j * M * alpha) / (2j * M * omega) - p), alpha)
    memory = _Memory.of(p, alpha, terms.begun)
    motion = memory.lewis if np.ndim(drive.sweep) == 0 else _remembered(memory, drive)
    per = (1.0 - share) / (2j * M * own) + share / (2j * M * omega)
    other = (1.0 - share) / (2j * M * own) / (0.5 * loss + 1j * (omega + own))
    return per * motion - other, -per * per * memory.by_p(memory.lewis)


class _Memory(NamedTuple):
    """Solutions of J' = 1 - p J where p moves by i alpha alone: ``lewis`` is I(p), ``quiet`` does not ring.

    ``start``: J at the first row of a sweep.
    """

    lewis: ComplexArray
    quiet: ComplexArray
    start: ComplexArray
    beyond: BoolArray
    p: ComplexArray
    alpha: FloatArray

    @staticmethod
    def of(p: ComplexArray, alpha: FloatArray, begun: Floats = 0.0) -> _Memory:
        """Both solutions; 1/p where the frequency hardly moves. ``begun``: see `damping.effects.contract.Terms`."""
        moving = np.abs(alpha) > _SLOW * np.abs(p) ** 2
        root = np.sqrt(np.where(moving, -0.5j * alpha, p * p))
        z = 0.5j * p / root
        lewis = np.where(moving, 0.5 * np.sqrt(np.pi) / root * wofz(z), 1.0 / np.where(moving, 1.0, p))
        squared = z * z
        ringing = np.sqrt(np.pi) / root * np.exp(np.minimum(-squared.real, _LOUDEST) - 1j * squared.imag)
        quiet, start = np.where(moving, lewis - ringing, lewis), lewis + begun * (1.0 / p - lewis)
        return _Memory(lewis, quiet, start, z.imag < 0.0, p, alpha)

    def by_p(self, V: ComplexArray) -> ComplexArray:
        """Derivative of a solution V by p: i alpha V' = 1 - p V."""
        slow = np.abs(self.alpha) < _SLOW * np.abs(self.p) ** 2
        return np.where(slow, -V * V, (1.0 - self.p * V) / (1j * np.where(slow, 1.0, self.alpha)))

    def by_rate(self, V: ComplexArray, by_p: ComplexArray) -> ComplexArray:
        """Derivative of a solution V by alpha, i V''/2."""
        slow = np.abs(self.alpha) < _SLOWLY * np.abs(self.p) ** 2
        return np.where(slow, 1j * V**3, (V + self.p * by_p) / (-2.0 * np.where(slow, 1.0, self.alpha)))


def _remembered(memory: _Memory, drive: Drive) -> ComplexArray:
    """J with all that changes along each sweep, (batch, n).

    V is ``quiet`` between rows beyond resonance, else ``lewis``: neither rings there, and both change evenly from row
    to row. The rest d = J - V follows d' = -p d - (p' - i alpha) dV/dp - alpha' dV/dalpha.
    """
    ways = np.sign(memory.alpha)
    if ways.ndim > 1 and np.any(ways != ways[:1]):  # the order of the rows is that of the way
        parts = np.broadcast_arrays(*memory)
        return np.stack([_remembered(_Memory._make(part[k] for part in parts), drive) for k in range(len(ways))])
    way, sweep = ways.reshape(-1, ways.shape[-1])[0], np.asarray(drive.sweep)
    order = np.lexsort((way * drive.omega, way, sweep))
    memory = _Memory._make(part[..., order] for part in memory)
    p, alpha, omega, F = memory.p, memory.alpha, drive.omega[order], drive.F[order]
    first = (np.diff(sweep[order], prepend=np.nan) != 0.0) | (np.diff(way[order], prepend=np.nan) != 0.0)
    last = _Memory._make(np.roll(part, 1, -1) for part in memory)
    beyond = memory.beyond & last.beyond  # what is quiet beyond resonance grows without limit before it
    V, before = (np.where(beyond, own.quiet, own.lewis) for own in (memory, last))
    by_p = 0.5 * (memory.by_p(V) + last.by_p(before))
    by_rate = memory.by_rate(V, by_p)
    rate = 0.5 * (alpha + last.alpha)
    first = first | (rate == 0.0)  # a dwell remembers nothing
    time = np.abs((omega - np.roll(omega, 1)) / np.where(rate == 0.0, 1.0, rate))
    turned = 0.5 * (p + last.p) * time
    decay = np.exp(np.minimum(-turned.real, _LOUDEST) - 1j * turned.imag)
    share = np.where(np.abs(turned) > _SLOWLY, (1.0 - decay) / np.where(turned == 0.0, 1.0, turned), 1.0)
    force = np.roll(F, 1) / F  # which goes evenly from row to row
    moved = by_p * (p - last.p - 1j * rate * time) + by_rate * (alpha - last.alpha) + 0.5 * (V + before) * (1.0 - force)
    decay = np.where(first, 0.0, decay * force)
    motion = np.where(first, memory.start, V - before * decay - moved * share)
    for step in 2 ** np.arange(int(len(order) - 1).bit_length()):  # each row reaches twice as far back
        motion[..., step:] = motion[..., step:] + decay[..., step:] * motion[..., :-step]
        decay[..., step:] = decay[..., step:] * decay[..., :-step]
        decay[..., :step] = 0.0
    return motion[..., np.argsort(order)]
