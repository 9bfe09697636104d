"""A frequency that moves: the motion of a swept mode lags behind, and rings once it has passed the resonance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import wofz

from damping.arrays import BoolArray, ComplexArray, FloatArray, Floats, IntArray, differs, join_complex
from damping.effects.contract import Drive, Terms, add_parts

_STILL = 1e-8  #: |alpha/p^2| below which a moving frequency has no computable effect
_SLOW = 1e-3  #: |alpha/p^2|, or p over a step, below which first-order formulas avoid cancellation
_LARGEST_EXPONENT = 50.0  #: of a ringing motion: beyond it ringing has not begun
_LEAST_RATIO = 0.01  #: of the squared ringing to the squared driving frequency, for finite numbers where nothing rings


def swept_receptance(Z: ComplexArray, terms: Terms, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
    """H and d ln H/dZ of a path of complex stiffness Z while the frequency moves at d omega/dt = alpha.

    With Z = M (i omega - lambda)(i omega - lambda*) the motion Im a exp(i theta), theta'' = alpha, has
    a = (J - 1/(i omega - lambda*)) F/(2 i M Im lambda), J' = 1 - p J, p = i omega - lambda. The envelope J is
    `_Envelope.lewis` where p moves by i alpha alone. Other changes along a sweep (damping, stiffness) enter through the
    memory of earlier rows (`_integrate`).

    A first-order envelope, 2 i M omega a' + (Z + i M alpha) a = F, turns slower by (omega - Im lambda)^2/(2 omega)
    beyond resonance, as may the reading of an instrument that tracks the frequency while the motion rings.
    ``terms.ringing`` is 0 for the motion itself, 1 for that envelope.
    """
    if not terms.moving and not differs(drive.rate, 0.0):
        H: ComplexArray = np.reciprocal(Z)
        return H, -1.0 * H  # a third of the time of -H
    alpha = find_rate(terms, drive)
    M, omega, share = terms.M * drive.mass + drive.added, drive.omega, terms.ringing
    decay, squared = 0.5 * (Z.imag / (M * omega)), Z.real / M + np.square(omega)  # -Re lambda, |lambda|^2
    ringing = np.sqrt(np.maximum(squared - decay * decay, _LEAST_RATIO * np.square(omega)))  # Im lambda
    p = join_complex(decay, omega - ringing)
    if differs(share, 0.0):
        p = p + share * ((Z - 1j * M * alpha) / (2j * M * omega) - p)
    envelope = _Envelope.of(p, alpha, terms.begun, terms.held)
    J = envelope.lewis if np.ndim(drive.sweep) == 0 else _integrate(envelope, drive)
    of_motion = (1.0 - share) / (2.0 * M * ringing)
    per_J = -1j * (of_motion + share / (2.0 * M * omega))
    of_conjugate = -1j * of_motion * np.reciprocal(join_complex(decay, omega + ringing))
    H = per_J * J - of_conjugate
    return H, per_J * per_J * envelope.by_p(envelope.lewis) * np.reciprocal(H)


def find_rate(terms: Terms, drive: Drive) -> Floats:
    """d omega/dt at each row, rad/s^2."""
    rate: Floats = add_parts(terms.moving, drive) + drive.rate * (drive.omega / terms.omega_n) ** terms.law
    return rate


def order_swept(direction: FloatArray, drive: Drive) -> tuple[IntArray, BoolArray]:
    """The order in which sweeps in a ``direction`` (n,) pass the rows, and which neighbours in it are not of one."""
    sweep = np.broadcast_to(drive.sweep, drive.omega.shape)
    order = np.lexsort((direction * drive.omega, direction, sweep))
    return order, (np.diff(sweep[order]) != 0.0) | (np.diff(direction[order]) != 0.0)


def accumulate(first: ComplexArray, further: ComplexArray, kept: ComplexArray | FloatArray) -> ComplexArray:
    """y (.., n) from y_0 = ``first`` (.., 1) and y_k = ``further``_k + ``kept``_k y_(k-1), (.., n - 1) each."""
    y: ComplexArray = np.concatenate([first, further], axis=-1)
    kept = np.concatenate([np.zeros((*kept.shape[:-1], 1)), kept], axis=-1)
    step = 1
    while step < y.shape[-1] and kept.any():  # the reach doubles with each step
        y[..., step:] += kept[..., step:] * y[..., :-step]
        kept[..., step:] *= kept[..., :-step]
        kept[..., :step] = 0.0
        step *= 2
    return y


class _Envelope(NamedTuple):
    """Solutions of J' = 1 - p J at rows (.., n) where p moves by i alpha alone."""

    #: of a sweep that began long before: I(p) = int_0^inf exp(-p s + i alpha s^2/2) ds, 1/p where alpha = 0
    lewis: ComplexArray
    smooth: ComplexArray  #: the same without the ringing that follows resonance
    start: ComplexArray  #: J at the first row of a sweep
    is_beyond: BoolArray  #: rows beyond resonance
    p: ComplexArray
    alpha: FloatArray
    held: FloatArray  #: see `damping.effects.contract.Terms`

    @staticmethod
    def of(p: ComplexArray, alpha: Floats, begun: Floats = 0.0, held: Floats = 0.0) -> _Envelope:
        """The solutions for p and alpha; ``begun``, ``held``: see `Terms`.

        I(p) = sqrt(pi/b)/2 w(z), z = i p/(2 sqrt b), b = -i alpha/2 (Lewis 1932, in terms of Fresnel integrals, which w
        contains). sqrt b = (1 - i s) sqrt(|alpha|)/2, s the sign of alpha, so that z = (i - s) p/(2 sqrt |alpha|).
        """
        p, alpha = np.broadcast_arrays(p, alpha)
        x, y = p.real, p.imag
        steady: ComplexArray = np.reciprocal(p)
        is_moving = np.abs(alpha) > _STILL * _square(p)
        sign, root = np.sign(alpha), np.sqrt(np.where(is_moving, np.abs(alpha), 1.0))
        z = join_complex((-sign * x - y) * (0.5 / root), (x - sign * y) * (0.5 / root))
        per_w = (0.5 * np.sqrt(np.pi)) * join_complex(1.0 / root, sign / root)
        lewis = np.where(is_moving, per_w * wofz(z), steady)
        smooth = np.where(is_moving, lewis - 2.0 * per_w * _decay(z * z), lewis)
        start = lewis + begun * (steady - lewis) if differs(begun, 0.0) else lewis
        is_beyond = np.where(is_moving, z.imag, x) < 0.0
        return _Envelope(lewis, smooth, start, is_beyond, p, alpha, np.broadcast_to(held, p.shape))

    def take(self, rows: IntArray | slice) -> _Envelope:
        """The envelope of some rows."""
        return _Envelope._make(part[..., rows] for part in self)

    def by_p(self, V: ComplexArray) -> ComplexArray:
        """Derivative of a solution V by p: i alpha V' = 1 - p V."""
        is_still = np.abs(self.alpha) < _STILL * _square(self.p)
        slope = (1.0 - self.p * V) * (-1j / np.where(is_still, 1.0, self.alpha))
        return np.where(is_still, -V * V, slope) if is_still.any() else slope

    def by_rate(self, V: ComplexArray, by_p: ComplexArray) -> ComplexArray:
        """Derivative of a solution V by alpha, i V''/2."""
        is_slow = np.abs(self.alpha) < _SLOW * _square(self.p)
        slope = (V + self.p * by_p) * (-0.5 / np.where(is_slow, 1.0, self.alpha))
        return np.where(is_slow, 1j * (V * V * V), slope) if is_slow.any() else slope


def _square(z: ComplexArray) -> FloatArray:
    """|z|^2."""
    return z.real * z.real + z.imag * z.imag


def _decay(z: ComplexArray) -> ComplexArray:
    """exp(-z), its growth bounded; in a third of the time of np.exp for complex numbers."""
    size = np.exp(np.minimum(-z.real, _LARGEST_EXPONENT))
    return join_complex(size * np.cos(-z.imag), size * np.sin(-z.imag))


def _integrate(envelope: _Envelope, drive: Drive) -> ComplexArray:
    """J with all changes along each sweep, (batch, n)."""
    directions = np.sign(envelope.alpha)
    if directions.ndim > 1 and np.any(directions != directions[:1]):  # sweeps in two directions differ in row order
        models = zip(*np.broadcast_arrays(*envelope), strict=True)
        return np.stack([_integrate(_Envelope._make(model), drive) for model in models])
    order, is_first = order_swept(directions.reshape(-1, directions.shape[-1])[0], drive)
    J = _integrate_in_order(envelope.take(order), drive.omega[order], drive.F[order], is_first)
    return J[..., np.argsort(order)]


def _integrate_in_order(envelope: _Envelope, omega: FloatArray, F: FloatArray, is_first: BoolArray) -> ComplexArray:
    """J of rows in the order in which they are passed; ``is_first`` (n - 1,): a further row with which a sweep begins.

    V is ``smooth`` between rows beyond resonance, else ``lewis``: neither rings there, and both vary little from row to
    row. The rest d = J - V follows d' = -p d - (p' - i alpha) dV/dp - alpha' dV/dalpha - V F'/F; where the force of the
    row reached acts from the row before on (``held``), the motion there, not J, continues.
    """
    before, after = envelope.take(slice(-1)), envelope.take(slice(1, None))  # neighbouring rows
    rate, force = 0.5 * (after.alpha + before.alpha), F[:-1] / F[1:]
    is_first = is_first | (rate == 0.0)  # a dwell has no memory
    time = np.abs(np.diff(omega) / np.where(rate == 0.0, 1.0, rate))
    exponent = (0.5 * time) * (after.p + before.p)  # the integral of p over the step
    decay, is_small = _decay(exponent), _square(exponent) <= _SLOW**2
    mean_decay = np.where(is_small, 1.0, (1.0 - decay) * np.reciprocal(np.where(is_small, 1.0, exponent)))
    is_smooth = after.is_beyond & before.is_beyond  # the smooth solution diverges before resonance
    V_before, V = (np.where(is_smooth, row.smooth, row.lewis) for row in (before, after))
    by_p = 0.5 * (after.by_p(V) + before.by_p(V_before))
    change = by_p * (after.p - before.p - 1j * (rate * time)) + after.by_rate(V, by_p) * (after.alpha - before.alpha)
    change = change + (0.5 * (1.0 - force) * (1.0 - after.held)) * (V + V_before)
    change = change * mean_decay + ((1.0 - force) * after.held) * decay * V_before
    kept = np.where(is_first, 0.0, decay * force)
    further = np.where(is_first, after.start, V - V_before * kept - change)
    return accumulate(envelope.start[..., :1], further, kept)
