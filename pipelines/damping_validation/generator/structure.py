"""The true structure, the true state of the rig, and what they come to at each row of a test."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from damping_validation.generator.laws import ELASTIC, Array, Partner, TrueJoint, TrueLaw

Complex: TypeAlias = npt.NDArray[np.complex128]


@dataclass(frozen=True)
class Side:
    """Another mode between drive and sensor, q'' + 2 zeta omega q' + omega^2 q = drive F/M, seen as ``seen`` q.

    ``across`` of it shows across the measured axis. ``loaded``: mass added to the main mode moves with this one too.
    It acts on nothing, so that its steady motion is known in closed form.
    """

    omega: float
    zeta: float
    drive: float
    seen: float
    across: float = 0.0
    loaded: bool = False


@dataclass(frozen=True)
class Structure:
    """Main mode (mass, undamped omega in rad/s of the stuck state, viscous coefficient), its forces, and other modes.

    The main coordinate takes ``share`` of the force and shows ``share`` of its motion at the sensor (1 but for a drive
    at an angle to the principal planes), ``across`` of it across the measured axis. Other modes are per unit of the
    same mass.
    """

    mass: float
    omega: float
    viscous: float
    laws: tuple[TrueLaw, ...] = ()
    joints: tuple[TrueJoint, ...] = ()
    sides: tuple[Side, ...] = ()
    share: float = 1.0
    across: float = 0.0
    partners: tuple[Partner, ...] = ()

    @property
    def averaged_laws(self) -> tuple[TrueLaw, ...]:
        """The forces whose averages a first-harmonic balance takes, those of partners that are not linear included."""
        laws = [partner.stand_in for partner in self.partners]
        return (*self.laws, *(replace(law, coefficient=law.coefficient * self.mass) for law in laws if law))

    @property
    def bent(self) -> bool:
        """Whether two steady states may exist at one frequency."""
        laws = any(law.kind in ELASTIC for law in self.laws)
        return laws or any(partner.cubic or partner.stand_in for partner in self.partners)


@dataclass(frozen=True)
class TrueRows:
    """What the test recorded and what it truly was, one entry a row, in the order tested.

    ``sweep`` numbers the sweeps, ``force`` is the recorded force, ``omega`` the drive in rad/s, ``up`` the direction of
    all sweeps. ``drive`` is true force over recorded force, ``tuning`` the true natural frequency over the structure's,
    ``loss`` the true viscous coefficient over the structure's, ``gain`` and ``lag`` what the instruments add, ``delay``
    what they add to the time, s, ``leak`` a foreign phasor in the record. ``added`` is a known mass, ``rate`` the true
    d omega/dt, rad/s^2, ``time`` in s. The sensor shows at most ``clip`` and compresses beyond ``knee``; a reading is
    a multiple of ``quantum``, and lags by ``slew`` times itself, rad/length.
    """

    sweep: npt.NDArray[np.int64]
    force: Array
    omega: Array
    up: bool
    drive: Array
    tuning: Array
    loss: Array
    gain: Array
    lag: Array
    leak: Complex
    added: Array
    rate: Array
    time: Array
    clip: float = np.inf
    knee: float = np.inf
    quantum: float = 0.0
    delay: float = 0.0
    slew: float = 0.0

    @property
    def swept(self) -> bool:
        """Whether the frequency moved while a row was taken."""
        return bool(np.any(self.rate))


#: Time between two rows of a test, cycles of the drive.
CYCLES_A_ROW = 200.0


def plain_rows(sweep: npt.NDArray[np.int64], force: Array, omega: Array, up: bool = True) -> TrueRows:
    """Rows of a faultless rig, each dwelt at for ``CYCLES_A_ROW``."""
    unit, zero = np.ones(force.size), np.zeros(force.size)
    time = np.cumsum(2 * np.pi * CYCLES_A_ROW / omega)
    return TrueRows(sweep, force, omega, up, unit, unit, unit, unit, zero, zero.astype(complex), zero, zero, time)


def chosen_rows(rows: TrueRows, chosen: npt.NDArray[np.bool_]) -> TrueRows:
    """The chosen rows alone."""
    return replace(rows, **{name: column[chosen] for name, column in _list_columns(rows).items()})


def _list_columns(rows: TrueRows) -> dict[str, Any]:
    """What rows hold one entry a row of."""
    every = {part.name: getattr(rows, part.name) for part in fields(rows)}
    return {name: value for name, value in every.items() if isinstance(value, np.ndarray)}


def joined_rows(rows: TrueRows, more: TrueRows) -> TrueRows:
    """Rows of one test and then of another of the same rig."""
    joined: dict[str, Any] = {
        name: np.concatenate([column, getattr(more, name)]) for name, column in _list_columns(rows).items()
    }
    return replace(rows, **joined)


def show_signal(signal: Array, rows: TrueRows) -> Array:
    """What the sensor shows of a displacement: compressed beyond its knee, clipped at its limit."""
    if np.isfinite(rows.knee):
        signal = rows.knee * np.tanh(signal / rows.knee)
    return np.clip(signal, -rows.clip, rows.clip)


def recorded(X: Complex, rows: TrueRows, order: int = 1) -> tuple[Array, Array]:
    """Amplitude and lag (rad, from -pi/2 to 3 pi/2) that the rig records of a phasor A exp(-i phi) of a harmonic."""
    X = rows.gain * X * np.exp(-1j * (rows.lag + order * rows.omega * rows.delay + rows.slew * np.abs(X)))
    if order == 1:
        X = X + rows.leak
    lag = np.mod(-np.angle(X) + np.pi / 2, 2 * np.pi) - np.pi / 2
    amplitude = np.abs(X)
    if rows.quantum:
        amplitude = np.maximum(np.round(amplitude / rows.quantum), 1.0) * rows.quantum
    return amplitude, lag


def side_phasors(structure: Structure, rows: TrueRows) -> list[Complex]:
    """Steady phasors of the other modes' own coordinates, row by row."""
    w, M = rows.omega, structure.mass
    return [
        side.drive * rows.force * rows.drive
        / (M * side.omega**2 - (M + rows.added * side.loaded) * w**2 + 2j * M * side.zeta * side.omega * w)
        for side in structure.sides
    ]  # fmt: skip


def project(structure: Structure, rows: TrueRows, samples: Array) -> tuple[Complex, Complex, Complex]:
    """Phasors A exp(-i phi) of signals A sin(n omega t - phi), from one cycle of the main displacement (steps, rows).

    At the sensor for n = 1 and 3, across the measured axis for n = 1.
    """
    steps = len(samples)
    angle = 2 * np.pi * np.arange(steps) / steps
    signal, across = structure.share * samples, structure.across * samples
    for side, phasor in zip(structure.sides, side_phasors(structure, rows), strict=True):
        own = (phasor * np.exp(1j * angle)[:, None]).imag
        signal, across = signal + side.seen * own, across + side.across * own
    first, third = (np.exp(1j * (np.pi / 2 - order * angle)) * 2 / steps for order in (1, 3))
    shown = show_signal(signal, rows)
    return first @ shown, third @ shown, first @ across
