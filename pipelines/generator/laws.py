"""Memoryless forces of the true structure, functions of displacement q and velocity v.

``sign`` is the sign of the velocity, smoothed or not: the integration in time passes one that is smoothed over a few
of its steps, the averages pass the true one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Function = Callable[[Array, Array, Array, float], Array]


@dataclass(frozen=True)
class Law:
    """A force ``coefficient * function(q, v, sign, parameter)`` on the main coordinate; ``kind`` names the function."""

    kind: str
    coefficient: float
    parameter: float = 0.0

    def force(self, q: Array, v: Array, sign: Array) -> Array:
        """The force, in the shape of ``q`` and ``v``."""
        return self.coefficient * FUNCTIONS[self.kind](q, v, sign, self.parameter)


def _clearance(q: Array, v: Array, sign: Array, gap: float) -> Array:
    return q - np.clip(q, -gap, gap)


FUNCTIONS: Mapping[str, Function] = {
    "displacement": lambda q, v, sign, p: np.abs(q) * sign,
    "velocity-squared": lambda q, v, sign, p: v * np.abs(v),
    "displacement-velocity": lambda q, v, sign, p: np.abs(q) * v,
    "quadratic-displacement": lambda q, v, sign, p: q * q * v,
    "coulomb": lambda q, v, sign, p: sign,
    "cubic": lambda q, v, sign, p: q * q * q,
    "quadratic": lambda q, v, sign, p: q * q,
    "odd-square": lambda q, v, sign, p: q * np.abs(q),
    "quintic": lambda q, v, sign, p: q * q * q * q * q,
    "clearance": _clearance,
}

#: Power of the velocity in each force: at frequency omega its averages are omega**power times those at omega = 1.
VELOCITY_POWER: Mapping[str, int] = {
    "velocity-squared": 2,
    "displacement-velocity": 1,
    "quadratic-displacement": 1,
}

#: Degree of each force in amplitude, where it is homogeneous.
DEGREE: Mapping[str, int] = {
    "displacement": 1,
    "velocity-squared": 2,
    "displacement-velocity": 2,
    "quadratic-displacement": 3,
    "coulomb": 0,
    "cubic": 3,
    "quadratic": 2,
    "odd-square": 2,
    "quintic": 5,
}

#: Forces that jump when the velocity changes sign.
JUMPS = frozenset({"displacement", "coulomb"})
