"""A frequency that moves: the motion of a swept mode lags behind, and rings once it has passed the resonance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import wofz

from damping.arrays import BoolArray, ComplexArray, FloatArray, Floats, differs
from damping.effects.contract import Drive, Terms, add_parts

#: |alpha/p^2| below which a moving frequency changes nothing that can be computed, and below which its own change is
#: taken to first order: differences of nearly equal numbers say less.
_SLOW = 1e-8
_SLOWLY = 1e-3
#: Exponent up to which what rings is counted: where it is larger nothing has begun to ring.
_LOUDEST = 50.0
#: Least square of the frequency that rings over that of the drive: numbers stay finite where nothing does.
_RINGS = 0.01


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
