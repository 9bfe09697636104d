"""The true structure, the true state of the rig, and their effect on each row of a test."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.generator.joints import Joint
from pipelines.generator.laws import Array, Law


@dataclass(frozen=True)
class Side:
    """Another mode on the path from drive to sensor: M q'' + 2 zeta omega M q' + omega^2 M q = drive * F, seen * ``seen``."""

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
    laws: tuple[Law, ...] = ()
    joints: tuple[Joint, ...] = ()
    sides: tuple[Side, ...] = ()
    share: float = 1.0


@dataclass(frozen=True)
class Rows:
    """What the test recorded and what it was, one entry a row.

    ``sweep`` numbers the sweeps, ``force`` is the recorded force, ``omega`` the drive in rad/s, ``up`` the direction of
    all sweeps. ``drive`` is true force over recorded force, ``tuning`` the true natural frequency over the structure's,
    ``gain`` and ``lag`` what the instruments add; ``clip`` the largest displacement the sensor shows; ``leak`` a foreign
    phasor in the record.
    """

    sweep: npt.NDArray[np.int64]
    force: Array
    omega: Array
    up: bool
    drive: Array
    tuning: Array
    gain: Array
    lag: Array
    clip: float = np.inf
    leak: npt.NDArray[np.complex128] | None = None


def plain_rows(sweep: npt.NDArray[np.int64], force: Array, omega: Array, up: bool = True) -> Rows:
    """Rows of a faultless rig."""
    one, zero = np.ones(force.size), np.zeros(force.size)
    return Rows(sweep, force, omega, up, one, one, one, zero)


def recorded(X: npt.NDArray[np.complex128], rows: Rows) -> tuple[Array, Array]:
    """Amplitude and lag (rad, in -pi/2..3 pi/2) that the rig records of the displacement phasor X = A exp(-i phi)."""
    X = rows.gain * X * np.exp(-1j * rows.lag)
    if rows.leak is not None:
        X = X + rows.leak
    lag = np.mod(-np.angle(X) + np.pi / 2, 2 * np.pi) - np.pi / 2
    return np.abs(X), lag
