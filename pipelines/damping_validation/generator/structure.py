"""Memoryless forces of the true structure, functions of displacement q and velocity v.

``sign`` is the sign of the velocity, smoothed or not: the integration in time passes one that is smoothed over a few
of its steps, the averages pass the true one.

Joints with memory: elastic until they slip. Their state moves with the displacement alone, not with time.

A joint of stiffness k carries k * sum_i w_i z_i, where z_i is the stretch of its part i; without any slip z = q, so the
force beside the stuck structure is k (sum_i w_i z_i - q).

- ``jenkins``: the stretch stops at the limit (one part is a Jenkins element, many are an Iwan joint).
- ``bouc-wen``: dz/dq = 1 - (z/limit) where the motion stretches the joint further, 1 where it relieves it
  (Bouc and Wen's law with n = 1 and beta = gamma), solved exactly for a monotonic step of q.

The true structure, the true state of the rig, and what they come to at each row of a test.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Function = Callable[[Array, Array, Array, float], Array]


@dataclass(frozen=True)
class TrueLaw:
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


@dataclass(frozen=True)
class TrueJoint:
    """Stiffness (force/length), limits of the parts' stretch (length) and their weights (sum 1)."""

    kind: str
    stiffness: float
    limits: tuple[float, ...]
    weights: tuple[float, ...]

    @cached_property
    def _limits(self) -> Array:
        return np.array(self.limits)

    def start(self, q: Array) -> Array:
        """Stretch of the parts, shape (parts, *q.shape), after a first loading to ``q``."""
        return self.move(np.zeros((len(self.limits), *q.shape)), q)

    def move(self, z: Array, dq: Array) -> Array:
        """The stretch after a monotonic change ``dq`` of the displacement."""
        limits = self._limits.reshape(-1, *[1] * dq.ndim)
        if self.kind == "jenkins":
            stretched: Array = np.minimum(np.maximum(z + dq, -limits), limits)
            return stretched
        way, distance = np.sign(dq), np.abs(dq)
        along = way * z
        relieved = np.minimum(distance, np.maximum(-along, 0.0))
        along = along + relieved
        rest = limits - (limits - along) * np.exp(-(distance - relieved) / limits)
        return np.where(along < 0.0, along, rest) * way + np.where(way == 0.0, z, 0.0)

    def force(self, z: Array, q: Array) -> Array:
        """The joint's force less that of the same joint stuck."""
        carried = z[0] if len(self.limits) == 1 else np.tensordot(np.array(self.weights), z, axes=1)
        return self.stiffness * (carried - q)


Complex: TypeAlias = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Side:
    """Another mode between drive and sensor, q'' + 2 zeta omega q' + omega^2 q = drive F/M, seen as ``seen`` q."""

    omega: float
    zeta: float
    drive: float
    seen: float


@dataclass(frozen=True)
class Structure:
    """Main mode (mass, undamped omega in rad/s of the stuck state, viscous coefficient), its forces, and other modes.

    The main coordinate takes ``share`` of the force and shows ``share`` of its motion at the sensor (1 but for a drive
    at an angle to the principal planes). Other modes are per unit of the same mass.
    """

    mass: float
    omega: float
    viscous: float
    laws: tuple[TrueLaw, ...] = ()
    joints: tuple[TrueJoint, ...] = ()
    sides: tuple[Side, ...] = ()
    share: float = 1.0


@dataclass(frozen=True)
class TrueRows:
    """What the test recorded and what it truly was, one entry a row, in the order tested.

    ``sweep`` numbers the sweeps, ``force`` is the recorded force, ``omega`` the drive in rad/s, ``up`` the direction of
    all sweeps. ``drive`` is true force over recorded force, ``tuning`` the true natural frequency over the structure's,
    ``gain`` and ``lag`` what the instruments add, ``clip`` the largest displacement the sensor shows, ``leak`` a
    foreign phasor in the record.
    """

    sweep: npt.NDArray[np.int64]
    force: Array
    omega: Array
    up: bool
    drive: Array
    tuning: Array
    gain: Array
    lag: Array
    leak: Complex
    clip: float = np.inf


def plain_rows(sweep: npt.NDArray[np.int64], force: Array, omega: Array, up: bool = True) -> TrueRows:
    """Rows of a faultless rig."""
    one, zero = np.ones(force.size), np.zeros(force.size)
    return TrueRows(sweep, force, omega, up, one, one, one, zero, zero.astype(complex))


def chosen_rows(rows: TrueRows, chosen: npt.NDArray[np.bool_]) -> TrueRows:
    """The chosen rows alone."""
    arrays = ("sweep", "force", "omega", "drive", "tuning", "gain", "lag", "leak")
    return replace(rows, **{name: getattr(rows, name)[chosen] for name in arrays})


def recorded(X: Complex, rows: TrueRows) -> tuple[Array, Array]:
    """Amplitude and lag (rad, from -pi/2 to 3 pi/2) that the rig records of the displacement phasor A exp(-i phi)."""
    X = rows.gain * X * np.exp(-1j * rows.lag) + rows.leak
    lag = np.mod(-np.angle(X) + np.pi / 2, 2 * np.pi) - np.pi / 2
    return np.abs(X), lag
