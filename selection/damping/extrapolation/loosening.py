"""How a resonance may change with amplitude: in powers of it, or as joints lose stiffness; and how probable each is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from damping.arrays import FloatArray
from damping.forces.joints import lose_stiffness

#: Change of frequency with amplitude is tried in these powers of amplitude: of a joint that slips in full (S/A in
#: A^-1/2 and below) or in part, of a quadratic and of a cubic spring (A, A^2), and between ...
POWERS = (-0.5, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
#: ... and as joints lose stiffness, never more than they have: of one limit, over the largest tested amplitude, and of
#: limits spread evenly from none to a largest one.
LIMITS = tuple(np.geomspace(0.04, 0.96, 96).tolist())
LARGEST_LIMITS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
#: Prior probability that frequency does not change at all: hardly any structure that is driven harder; and how probable
#: powers, joints of one limit and of many are beside each other: joints of one limit are hardly any that is bolted.
CONSTANT = 0.1
OF_KINDS = (6.0, 1.0, 2.0)


@dataclass(frozen=True)
class Power:
    """How a resonance changes with the amplitude over the largest tested one, x: as x^p, by one from x = 1/2 to 1."""

    exponent: float

    def __call__(self, x: FloatArray) -> FloatArray:
        """The change since x = 1."""
        return np.asarray((x**self.exponent - 1.0) / (1.0 - 0.5**self.exponent))


@dataclass(frozen=True)
class Loosening:
    """The same by the share of stiffness that joints have ``lost`` at x over their ``limit``, by one up to x = 1."""

    limit: float
    lost: Callable[[FloatArray], FloatArray]

    def __call__(self, x: FloatArray) -> FloatArray:
        """The change since x = 1."""
        return np.asarray(self.lost(x / self.limit) / self.lost(np.array(1.0 / self.limit)) - 1.0)


def _lose_of_one(x: FloatArray) -> FloatArray:
    """That of one joint, -S/(k A) of `damping.forces.joints.Slip`."""
    return -np.asarray(lose_stiffness(1.0 / np.maximum(x, 1.0))[0])


def _lose_of_many(x: FloatArray) -> FloatArray:
    """The mean of `_lose_of_one` over limits from 0 to 1: x/2 up to the largest, then x times its integral over 1/x."""
    cosine = 1.0 - 2.0 / np.maximum(x, 1.0)
    psi, sine = np.arccos(cosine), np.sqrt(1.0 - cosine**2)
    return x * (0.5 * (1.0 - cosine) - (sine - psi * cosine) / (2.0 * np.pi) + sine**3 / (6.0 * np.pi))


@cache
def list_shapes() -> list[tuple[Power | Loosening | None, float]]:
    """Every shape, None of a constant, with its prior probability."""
    kinds: tuple[list[Power | Loosening], ...] = (
        [Power(exponent) for exponent in POWERS],
        [Loosening(limit, _lose_of_one) for limit in LIMITS],
        [Loosening(limit, _lose_of_many) for limit in LARGEST_LIMITS],
    )
    shares = (1.0 - CONSTANT) * np.array(OF_KINDS) / sum(OF_KINDS)
    return [
        (None, CONSTANT),
        *((shape, own / len(kind)) for kind, own in zip(kinds, shares, strict=True) for shape in kind),
    ]


def find_change(x: FloatArray, shape: Power | Loosening | None) -> FloatArray:
    """The change of a shape since x = 1, 0 of none; (rows,)."""
    return np.zeros(len(x)) if shape is None else shape(x)
