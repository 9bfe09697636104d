"""Shapes of the change of resonance with amplitude, powers or joints that lose stiffness, and their prior odds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TypeAlias

import numpy as np

from damping.arrays import FloatArray
from damping.forces.joints import lose_stiffness

#: Powers of amplitude in which frequency may change: of a joint that slips fully (S/A in A^-1/2 and below) or in part,
#: of a quadratic and of a cubic spring (A, A^2), and between them.
POWERS = (-0.5, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0)
#: Slip limits of joints of one limit, over the largest tested amplitude. Joints lose no more stiffness than they have.
LIMITS = tuple(np.geomspace(0.04, 0.96, 96).tolist())
#: Largest limits of joints whose limits are spread evenly from 0, over the same amplitude.
LARGEST_LIMITS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0)
#: Prior probability that frequency does not change at all, which is rare in structures that are driven harder.
CONSTANT = 0.1
#: Prior odds of powers, joints of one limit and joints of many limits: bolted joints hardly ever have one limit.
OF_KINDS = (6.0, 1.0, 2.0)
Change: TypeAlias = Callable[[FloatArray], FloatArray]  #: of the resonance since x = 1, at x (rows,)
NO_CHANGE: Change = np.zeros_like


@dataclass(frozen=True)
class Power:
    """Change as x^p, x the amplitude over the largest tested one, normalised to 1 from x = 1/2 to x = 1."""

    exponent: float

    def __call__(self, x: FloatArray) -> FloatArray:
        """The change since x = 1."""
        return np.asarray((x**self.exponent - 1.0) / (1.0 - 0.5**self.exponent))


@dataclass(frozen=True)
class Loosening:
    """Change as the share of stiffness that joints have ``lost`` at x/``limit``, normalised to 1 up to x = 1."""

    limit: float
    lost: Callable[[FloatArray], FloatArray]

    def __call__(self, x: FloatArray) -> FloatArray:
        """The change since x = 1."""
        return np.asarray(self.lost(x / self.limit) / self.lost(np.array(1.0 / self.limit)) - 1.0)


def _lose_of_one(x: FloatArray) -> FloatArray:
    """Stiffness lost by one joint, -S/(k A) of `damping.forces.joints.Slip`."""
    return -np.asarray(lose_stiffness(1.0 / np.maximum(x, 1.0))[0])


def _lose_of_many(x: FloatArray) -> FloatArray:
    """Mean of `_lose_of_one` over limits from 0 to 1: x/2 up to x = 1, then x times its integral over 1/x."""
    cosine = 1.0 - 2.0 / np.maximum(x, 1.0)
    psi, sine = np.arccos(cosine), np.sqrt(1.0 - cosine**2)
    return x * (0.5 * (1.0 - cosine) - (sine - psi * cosine) / (2.0 * np.pi) + sine**3 / (6.0 * np.pi))


@cache
def list_kinds() -> list[tuple[Sequence[Change], FloatArray]]:
    """For each kind of change, none, by a power or by joints: its changes, and the prior probability of each."""
    powers, one_limit, many_limits = (1.0 - CONSTANT) * np.array(OF_KINDS) / sum(OF_KINDS)
    joints = [Loosening(limit, _lose_of_one) for limit in LIMITS]
    looser = [Loosening(limit, _lose_of_many) for limit in LARGEST_LIMITS]
    of_joints = [*[one_limit / len(joints)] * len(joints), *[many_limits / len(looser)] * len(looser)]
    return [
        ([NO_CHANGE], np.array([CONSTANT])),
        ([Power(exponent) for exponent in POWERS], np.full(len(POWERS), powers / len(POWERS))),
        ([*joints, *looser], np.array(of_joints)),
    ]
