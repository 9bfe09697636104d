"""The true structure, the true state of the rig, and what they come to at each row of a test."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from pipelines.generator.joints import Joint
from pipelines.generator.laws import Array, Law

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
    laws: tuple[Law, ...] = ()
    joints: tuple[Joint, ...] = ()
    sides: tuple[Side, ...] = ()
    share: float = 1.0


@dataclass(frozen=True)
class Rows:
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


def plain_rows(sweep: npt.NDArray[np.int64], force: Array, omega: Array, up: bool = True) -> Rows:
    """Rows of a faultless rig."""
    one, zero = np.ones(force.size), np.zeros(force.size)
    return Rows(sweep, force, omega, up, one, one, one, zero, zero.astype(complex))


def chosen_rows(rows: Rows, chosen: npt.NDArray[np.bool_]) -> Rows:
    """The chosen rows alone."""
    arrays = ("sweep", "force", "omega", "drive", "tuning", "gain", "lag", "leak")
    return replace(rows, **{name: getattr(rows, name)[chosen] for name in arrays})


def recorded(X: Complex, rows: Rows) -> tuple[Array, Array]:
    """Amplitude and lag (rad, from -pi/2 to 3 pi/2) that the rig records of the displacement phasor A exp(-i phi)."""
    X = rows.gain * X * np.exp(-1j * rows.lag) + rows.leak
    lag = np.mod(-np.angle(X) + np.pi / 2, 2 * np.pi) - np.pi / 2
    return np.abs(X), lag
