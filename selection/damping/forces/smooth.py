"""The smooth joint of Bouc and Wen, of which Dahl's is one: it yields gradually."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import exp, log, pi
from typing import ClassVar

import numpy as np
from scipy.special import i0e, i1e

from damping.arrays import ComplexArray, FloatArray, Floats
from damping.forces.contract import Joint, spread, zeros
from damping.forces.joints import SlippingForce

#: ln(A/A1) of the table: steps of 1 %, right to 2e-5 between; beyond it averages are powers of A.
_LN_RATIO = np.linspace(-6.0, 12.0, 1801)
LEAST_RELIEF = 0.3  #: that a model may state; a fit does not leave these limits
LARGEST_RELIEF = 6.0
#: ln(relief) of the table, Chebyshev's: a polynomial through all is right to 1e-6 of the largest value.
_LN_RELIEF = 0.5 * (
    log(LARGEST_RELIEF * LEAST_RELIEF) + log(LARGEST_RELIEF / LEAST_RELIEF) * np.polynomial.chebyshev.chebgauss(11)[0]
)
#: Differences of these nodes, 1 for a node from itself.
_APART = _LN_RELIEF[:, np.newaxis] - _LN_RELIEF + np.eye(len(_LN_RELIEF))
#: Relief less 1 that counts as none.
_NO_RELIEF = 1e-11
#: Iterations for the stretch at the turns: to the last digit at any amplitude.
_TURNS = 8
#: Travel over A1, from zero force, that cuts its bend into parts; nodes of Gauss and Legendre in each, right to 1e-11.
_BENDS = (1.0, 6.0, 40.0)
_GAUSS = np.polynomial.legendre.leggauss(20)


def _gain(relief: Floats) -> FloatArray:
    """r, the relief less 1; a tiny number for none, as limits are divided by it."""
    r = np.asarray(relief) - 1.0
    return np.where(np.abs(r) < _NO_RELIEF, _NO_RELIEF, r)


def _stretch_at_turn(a: Floats, r: FloatArray) -> FloatArray:
    """Z, the stretch at the turns of a steady cycle of amplitude a, both over A1: Z = 1 - (1 + r Z)^(1/r) exp(-2 a).

    By Newton's method from above: the equation is convex.
    """
    Z = np.minimum(2.0 * np.asarray(a), 1.0)
    for _ in range(_TURNS):
        left = np.exp(np.log1p(r * Z) / r - 2.0 * a)
        Z = Z - (Z - 1.0 + left) / (1.0 + left / (1.0 + r * Z))
    return np.asarray(Z)


def _lag(Z: Floats, r: FloatArray, travel: Floats) -> FloatArray:
    """Stretch less travel after a one-way ``travel`` from the stretch -Z <= 0, all over A1.

    The stretch is relieved to zero along an exponential of rate r, then approaches the limit.
    """
    free = np.log1p(r * Z) / r
    relieved, bent = np.minimum(travel, free), np.maximum(travel - free, 0.0)
    return np.asarray(-Z - np.expm1(-r * relieved) * (1.0 / r + Z) - relieved - (bent + np.expm1(-bent)))


@cache
def _tabulate() -> FloatArray:
    """The averages over ln(relief) and ln(A/A1), (11, 1801, 6): a relief at a time, as their loops take memory."""
    return np.stack([_average(_gain(relief)) for relief in np.exp(_LN_RELIEF)])


def _average(r: FloatArray) -> FloatArray:
    """C, dC/d ln A, S, dS/d ln A and the third harmonic, over ln(A/A1), (1801, 6), at a relief 1 + r.

    They are over k A and then over `_scale`, so that they tend to constants at both ends of the table.
    """
    a = np.exp(_LN_RATIO)
    Z = _stretch_at_turn(a, r)
    free = np.log1p(r * Z) / r
    ends = [0.0 * Z, *(np.minimum(free + bend, 2.0 * a) for bend in (0.0, *_BENDS)), 2.0 * a]
    averages = np.zeros((4, len(a)))
    # with t, tan of half the angle from the turn, the travel is 2 a t^2/(1 + t^2), and all sines and cosines follow: a
    # sine of its own takes ten times as long
    halves = [np.arcsin(np.sqrt(travel / (2.0 * a))) for travel in ends]
    for first, last in pairwise(halves):
        t = np.tan(first + 0.5 * (last - first) * (_GAUSS[0][:, np.newaxis] + 1.0))
        per = 1.0 / (1.0 + t * t)
        gone = t * t * per
        g = _GAUSS[1][:, np.newaxis] * (1.0 + _lag(Z, r, 2.0 * a * gone) / a)
        x, y = gone - per, 2.0 * t * per  # sin theta and cos theta
        waves = y, x, x * (3.0 - 4.0 * x * x), y * (4.0 * y * y - 3.0)
        averages += 2.0 * (last - first) / pi * np.array([np.einsum("na,na->a", g, wave) for wave in waves])
    C, S = averages[:2]
    slopes = averages[:2] + np.gradient(averages[:2], _LN_RATIO, axis=1)
    return np.stack([C, slopes[0], S, slopes[1], *averages[2:]], axis=-1) / _scale(a)


def _scale(a: FloatArray) -> FloatArray:
    """The size of each entry of the table, (..., 6): a/(1 + a) for S and its slope, a/(1 + a)^2 for the others."""
    partial, full = a / (1.0 + a), a / (1.0 + a) ** 2
    return np.stack([full, full, partial, partial, full, full], axis=-1)


@dataclass(frozen=True)
class SmoothJoint(Joint):
    """A joint of the law of Bouc and Wen: see `SmoothSlip`."""

    relief: Floats

    def stretch(self, start: float, travel: float) -> float:
        """z after a one-way ``travel``."""
        way, limit = 1.0 if travel > 0.0 else -1.0, float(self.limit)
        along, distance = way * start / limit, abs(travel) / limit
        if along > 0.0:
            return way * limit * (1.0 - (1.0 - along) * exp(-distance))
        return way * limit * (distance + float(_lag(-along, _gain(self.relief), distance)))


@dataclass(frozen=True)
class SmoothSlip(SlippingForce):
    """A joint that yields gradually: the law of Bouc and Wen with n = 1.

    The stretch z follows dz/dq = 1 - |z|/A1 where motion stretches the joint further, 1 + r |z|/A1 where it relieves
    it. The force is k (z - q). ``relief`` 1 + r = 2 beta/(beta + gamma) is its stiffness just after a turn at the
    limit, over k: 1 where it is relieved along a line, 2 for the law of Dahl (1968). C tends to 4 k A1/pi, as of
    `Slip`; small motion loses energy too (Wen 1976). The averages are interpolated in a table.
    """

    relief: Floats = 1.0

    @property
    def joints(self) -> tuple[Joint, ...]:
        """One."""
        return (SmoothJoint(self.stiffness, self.limit, self.relief),)

    def averages(self, A: Floats, omega: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """C, dC/d ln A, S and dS/d ln A."""
        C, C_slope, S, S_slope = (spread(values, omega) for values in self._look_up(A, slice(4)))
        return C, C_slope, S, S_slope

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """The third harmonic."""
        real, imaginary = self._look_up(A, slice(4, 6))
        return np.asarray(real + 1j * imaginary)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """k (z - q) over the steady cycle, from either turn: see `_lag`."""
        a, r, way = A / self.limit, _gain(self.relief), np.where(np.cos(theta) < 0.0, -1.0, 1.0)
        behind = _lag(_stretch_at_turn(a, r), r, a * (1.0 + way * np.sin(theta)))
        return np.asarray(self.stiffness * self.limit * way * (a + behind) + zeros(omega))

    def _look_up(self, A: Floats, entries: slice) -> FloatArray:
        """Entries of the table at A, (entries, ...): between reliefs by Lagrange, then between amplitudes along lines.

        Few reliefs differ, while each has many amplitudes: the table is made for each relief first.
        """
        a, last = np.asarray(A / self.limit), len(_LN_RATIO) - 1.0
        place = np.clip((np.log(a) - _LN_RATIO[0]) / np.ptp(_LN_RATIO) * last, 0.0, last)
        before = np.minimum(place.astype(np.int64), len(_LN_RATIO) - 2)
        reliefs, which = np.unique(self.relief, return_inverse=True)
        apart = np.log(reliefs)[:, np.newaxis, np.newaxis] - _LN_RELIEF
        weights = np.prod(np.where(np.eye(len(_LN_RELIEF)) > 0.0, 1.0, apart / _APART), axis=2)
        first, end = before.min(initial=len(_LN_RATIO)), before.max(initial=0) + 2
        nodes = _tabulate()[:, first:end, entries]
        table = (weights @ nodes.reshape(len(nodes), -1)).reshape(-1, nodes.shape[2])
        row = which.reshape(np.shape(self.relief)) * nodes.shape[1] + before - first
        below = table[row]
        values = below + (place - before)[..., np.newaxis] * (table[row + 1] - below)
        size = np.asarray(self.stiffness * A)[..., np.newaxis] * _scale(a)[..., entries]
        return np.moveaxis(size * values, -1, 0)


@dataclass(frozen=True)
class Dahl(SlippingForce):
    """A joint that yields gradually from the smallest motion on: the law of Dahl (1968).

    The stretch z follows dz/dq = 1 - (z/A1) sgn q': between the turns it is an exponential of the travel. The force is
    k (z - q), that of `SmoothSlip` with relief 2, in closed form. C grows with A^2 at first and tends to 4 k A1/pi, as
    of `Slip`. It is a candidate law beside viscous damping alone.
    """

    name: ClassVar[str] = "dahl"
    label: ClassVar[str] = "joint that yields gradually (Dahl)"
    formula: ClassVar[str] = "joint of stiffness K - K1 that yields gradually, with the stretch A1 at most"
    # alone it has no amplitude at forces over 4 k A1/pi, where structures, which have some linear damping, have one; in
    # more sums a few levels cannot tell it from `Slip`
    sums: ClassVar[bool] = False
    beside: ClassVar[tuple[str, ...]] = ("viscous",)

    @property
    def _joint(self) -> SmoothSlip:
        """The same joint as one of Bouc and Wen's law."""
        return SmoothSlip(self.stiffness, self.limit, 2.0)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """One."""
        return self._joint.joints

    def averages(self, A: Floats, omega: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """C (see `grow`), dC/d ln A, S = k A1 (2 I_1(a)/cosh a - a) and dS/d ln A, a = A/A1."""
        a, most = A / self.limit, self.stiffness * self.limit
        I_0, I_1 = (2.0 * scaled(a) / (1.0 + np.exp(-2.0 * a)) for scaled in (i0e, i1e))  # over cosh a
        S = most * (2.0 * I_1 - a)
        slope = most * (2.0 * (a * (I_0 - np.tanh(a) * I_1) - I_1) - a)
        return *self.grow(A, omega), spread(S, omega), spread(slope, omega)

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = 4 k A1 (1 - tanh(a)/a)/pi, a = A/A1, and dC/d ln A."""
        a, most = A / self.limit, self.scale(A, omega)
        turn = np.tanh(a)
        return spread(most * (1.0 - turn / a), omega), spread(most * (turn / a - 1.0 + turn * turn), omega)

    def scale(self, A: Floats, omega: Floats) -> Floats:
        """The saturation 4 k A1/pi."""
        return np.asarray(4.0 * self.stiffness * self.limit / pi)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """k (z - q) over the steady cycle, from either turn."""
        return self._joint.cycle(theta, A, omega)
