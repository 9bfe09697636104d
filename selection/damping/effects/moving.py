"""A frequency that moves: the motion of a swept mode lags behind, and rings once it has passed the resonance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import wofz

from damping.arrays import BoolArray, ComplexArray, FloatArray, Floats, IntArray, differs, join_complex
from damping.effects.contract import Drive, Terms, add_parts

#: |alpha/p^2| below which a moving frequency has no computable effect, and below which derivatives by p and alpha are
#: taken to first order, against cancellation.
_SLOW = 1e-8
_SLOWLY = 1e-3
_LOUDEST = 50.0  #: largest exponent of a ringing motion: beyond it ringing has not begun
#: Least squared ratio of the ringing to the driving frequency, which keeps numbers finite where nothing rings.
_RINGS = 0.01


def hurried(Z: ComplexArray, terms: Terms, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
    """H and d ln H/dZ of a path of complex stiffness Z while the frequency moves at d omega/dt = alpha.

    With Z = M (i omega - lambda)(i omega - lambda*) the motion Im a exp(i theta), theta'' = alpha, has
    a = (J - 1/(i omega - lambda*)) F/(2 i M Im lambda), J' = 1 - p J, p = i omega - lambda. Where p moves by i alpha
    alone, J is I(p) = int_0^inf exp(-p s + i alpha s^2/2) ds = sqrt(pi/b)/2 w(i p/(2 sqrt b)), b = -i alpha/2 (Lewis
    1932, in terms of Fresnel integrals, which w contains); this is 1/p where alpha = 0. Other changes along a sweep
    (damping, stiffness) enter through the memory of earlier rows (`_remembered`).

    A first-order envelope, 2 i M omega a' + (Z + i M alpha) a = F, turns slower by (omega - Im lambda)^2/(2 omega)
    beyond resonance, as may the reading of an instrument that tracks the frequency while the motion rings.
    ``terms.ringing`` is 0 for the motion itself, 1 for that envelope.
    """
    if not terms.moving and not differs(drive.rate, 0.0):
        H: ComplexArray = np.reciprocal(Z)
        return H, -1.0 * H  # a third of the time of -H
    alpha = find_rate(terms, drive)
    M, omega, share = terms.M * drive.mass + drive.added, drive.omega, terms.ringing
    loss, squared = Z.imag / (M * omega), Z.real / M + np.square(omega)
    free = np.sqrt(np.maximum(squared - 0.25 * loss * loss, _RINGS * np.square(omega)))
    p = join_complex(0.5 * loss, omega - free)
    if differs(share, 0.0):
        p = p + share * ((Z - 1j * M * alpha) / (2j * M * omega) - p)
    p, alpha = np.broadcast_arrays(p, alpha)
    memory = _Memory.of(p, alpha, terms.begun, terms.held)
    motion = memory.lewis if np.ndim(drive.sweep) == 0 else _remembered(memory, drive)
    per = -1j * ((1.0 - share) / (2.0 * M * free) + share / (2.0 * M * omega))
    other = -1j * ((1.0 - share) / (2.0 * M * free)) * np.reciprocal(join_complex(0.5 * loss, omega + free))
    H = per * motion - other
    return H, per * per * memory.by_p(memory.lewis) * np.reciprocal(H)


def find_rate(terms: Terms, drive: Drive) -> Floats:
    """d omega/dt at each row, rad/s^2."""
    rate: Floats = add_parts(terms.moving, drive) + drive.rate * (drive.omega / terms.omega_n) ** terms.law
    return rate


def order_swept(way: FloatArray, drive: Drive) -> tuple[IntArray, BoolArray]:
    """The order in which sweeps in directions ``way`` (n,) pass the rows, and which neighbours in it are not of one."""
    sweep = np.broadcast_to(drive.sweep, drive.omega.shape)
    order = np.lexsort((way * drive.omega, way, sweep))
    return order, (np.diff(sweep[order]) != 0.0) | (np.diff(way[order]) != 0.0)


def accumulate(y: ComplexArray, kept: ComplexArray | FloatArray) -> None:
    """Add to each of y (.., n), in place, the share ``kept`` of the sum before it; ``kept`` is spent."""
    step = 1
    while step < y.shape[-1] and kept.any():  # the reach doubles with each step
        y[..., step:] += kept[..., step:] * y[..., :-step]
        kept[..., step:] *= kept[..., :-step]
        kept[..., :step] = 0.0
        step *= 2


class _Memory(NamedTuple):
    """Solutions of J' = 1 - p J where p moves by i alpha alone: ``lewis`` is I(p), ``quiet`` that without ringing."""

    lewis: ComplexArray
    quiet: ComplexArray
    start: ComplexArray  #: J at the first row of a sweep
    beyond: BoolArray  #: rows beyond resonance
    p: ComplexArray
    alpha: FloatArray
    held: FloatArray  #: see `damping.effects.contract.Terms`

    @staticmethod
    def of(p: ComplexArray, alpha: FloatArray, begun: Floats = 0.0, held: Floats = 0.0) -> _Memory:
        """The solutions; 1/p where the frequency hardly moves. ``begun``, ``held``: see `Terms`."""
        x, y = p.real, p.imag
        still: ComplexArray = np.reciprocal(p)
        moving = np.abs(alpha) > _SLOW * (x * x + y * y)
        # sqrt b = (1 - i s) sqrt(|alpha|)/2, s the sign of alpha: z = (i - s) p/(2 sqrt |alpha|)
        sign, root = np.sign(alpha), np.sqrt(np.where(moving, np.abs(alpha), 1.0))
        z = join_complex((-sign * x - y) * (0.5 / root), (x - sign * y) * (0.5 / root))
        per_root = (0.5 * np.sqrt(np.pi)) * join_complex(1.0 / root, sign / root)
        lewis = np.where(moving, per_root * wofz(z), still)
        squared = z * z
        ringing = 2.0 * per_root * _exp(np.minimum(-squared.real, _LOUDEST), -squared.imag)
        quiet = np.where(moving, lewis - ringing, lewis)
        start = lewis + begun * (still - lewis) if differs(begun, 0.0) else lewis
        return _Memory(lewis, quiet, start, np.where(moving, z.imag, x) < 0.0, p, alpha, np.broadcast_to(held, p.shape))

    def take(self, rows: IntArray | slice) -> _Memory:
        """The memory of some rows."""
        return _Memory._make(part[..., rows] for part in self)

    def by_p(self, V: ComplexArray) -> ComplexArray:
        """Derivative of a solution V by p: i alpha V' = 1 - p V."""
        slow = np.abs(self.alpha) < _SLOW * _square(self.p)
        moved = (1.0 - self.p * V) * (-1j / np.where(slow, 1.0, self.alpha))
        return np.where(slow, -V * V, moved) if slow.any() else moved

    def by_rate(self, V: ComplexArray, by_p: ComplexArray) -> ComplexArray:
        """Derivative of a solution V by alpha, i V''/2."""
        slow = np.abs(self.alpha) < _SLOWLY * _square(self.p)
        moved = (V + self.p * by_p) * (-0.5 / np.where(slow, 1.0, self.alpha))
        return np.where(slow, 1j * (V * V * V), moved) if slow.any() else moved


def _square(z: ComplexArray) -> FloatArray:
    """|z|^2."""
    return z.real * z.real + z.imag * z.imag


def _exp(real: FloatArray, imaginary: FloatArray) -> ComplexArray:
    """exp(real + i imaginary), in a third of the time of np.exp for complex numbers."""
    size = np.exp(real)
    return join_complex(size * np.cos(imaginary), size * np.sin(imaginary))


def _remembered(memory: _Memory, drive: Drive) -> ComplexArray:
    """J with all changes along each sweep, (batch, n).

    V is ``quiet`` between rows beyond resonance, else ``lewis``: neither rings there, and both are smooth from row to
    row. The rest d = J - V follows d' = -p d - (p' - i alpha) dV/dp - alpha' dV/dalpha - V F'/F; where the force of the
    row reached acts from the row before on (``held``), the motion there, not J, continues.
    """
    ways = np.sign(memory.alpha)
    if ways.ndim > 1 and np.any(ways != ways[:1]):  # models that sweep in different directions differ in row order
        parts = np.broadcast_arrays(*memory)
        return np.stack([_remembered(_Memory._make(part[k] for part in parts), drive) for k in range(len(ways))])
    order, first = order_swept(ways.reshape(-1, ways.shape[-1])[0], drive)
    memory, omega, F = memory.take(order), drive.omega[order], drive.F[order]
    last, row = memory.take(slice(-1)), memory.take(slice(1, None))  # pairs of neighbours
    beyond = row.beyond & last.beyond  # the quiet solution diverges before resonance
    V, before = (np.where(beyond, part.quiet, part.lewis) for part in (row, last))
    by_p = 0.5 * (row.by_p(V) + last.by_p(before))
    by_rate = row.by_rate(V, by_p)
    rate = 0.5 * (row.alpha + last.alpha)
    # a dwell has no memory
    first = first | (rate == 0.0)
    time = np.abs(np.diff(omega) / np.where(rate == 0.0, 1.0, rate))
    phase_decay = (0.5 * time) * (row.p + last.p)
    decay = _exp(np.minimum(-phase_decay.real, _LOUDEST), -phase_decay.imag)
    is_small = _square(phase_decay) <= _SLOWLY**2
    share = np.where(is_small, 1.0, (1.0 - decay) * np.reciprocal(np.where(is_small, 1.0, phase_decay)))
    force = F[:-1] / F[1:]
    evenly = by_p * (row.p - last.p - 1j * (rate * time)) + by_rate * (row.alpha - last.alpha)
    evenly = evenly + (0.5 * (1.0 - force) * (1.0 - row.held)) * (V + before)
    moved = evenly * share + ((1.0 - force) * row.held) * decay * before
    decay = np.where(first, 0.0, decay * force)
    motion, kept = np.empty(memory.p.shape, dtype=np.complex128), np.zeros(memory.p.shape, dtype=np.complex128)
    motion[..., 0], kept[..., 1:] = memory.start[..., 0], decay
    motion[..., 1:] = np.where(first, row.start, V - before * decay - moved)
    accumulate(motion, kept)
    return motion[..., np.argsort(order)]
