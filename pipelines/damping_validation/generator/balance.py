"""The rows of a test, the readings of a sensor, and the first-harmonic balance, from which integration starts.

On q = A sin(theta) the forces have in-phase and quadrature averages S and C (``averages``), and the balance
|k - M omega^2 + i c omega + (S + i C)/A| A = F is solved row by row on a grid of amplitudes, then refined.

While the frequency moves, q = Re z(t) exp(i theta) with omega = theta' obeys, but for z'',
(2 i omega M + c) z' = F - (k - M omega^2 + i c omega + i M omega' + (S + i C)/A) z (``sweep_phasor``).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from damping_validation.generator.laws import Array, Complex, Structure, TrueJoint, TrueLaw


@dataclass(frozen=True)
class TrueRows:
    """The recorded and the true test, one entry for each row, in the order tested.

    ``sweep`` numbers the sweeps, ``force`` is the recorded force, ``omega`` the drive in rad/s, ``up`` the direction of
    all sweeps. ``drive`` is true force over recorded force, ``tuning`` the true natural frequency over the structure's,
    ``loss`` the true viscous coefficient over the structure's, ``gain`` and ``lag`` of the instruments, ``delay``
    their time delay, s, ``leak`` a foreign phasor in the record. ``added`` is a known mass, ``rate`` the true
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


CYCLES_A_ROW = 200.0  #: time between two rows of a test, cycles of the drive


def plain_rows(sweep: npt.NDArray[np.int64], force: Array, omega: Array, up: bool = True) -> TrueRows:
    """Rows of a faultless rig, each dwelt at for ``CYCLES_A_ROW``."""
    unit, zero = np.ones(force.size), np.zeros(force.size)
    time = np.cumsum(2 * np.pi * CYCLES_A_ROW / omega)
    return TrueRows(sweep, force, omega, up, unit, unit, unit, unit, zero, zero.astype(complex), zero, zero, time)


def chosen_rows(rows: TrueRows, chosen: npt.NDArray[np.bool_]) -> TrueRows:
    """The chosen rows alone."""
    return change_columns(rows, lambda name, column: column[chosen])


def change_columns(rows: TrueRows, change: Callable[[str, Array], Array]) -> TrueRows:
    """The rows with columns replaced by name; other fields stay."""
    changed: dict[str, Any] = {
        name: change(name, value) for name, value in vars(rows).items() if isinstance(value, np.ndarray)
    }
    return replace(rows, **changed)


def show_signal(signal: Array, rows: TrueRows) -> Array:
    """The reading of a displacement: compressed beyond the knee of the sensor, clipped at its limit."""
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


_ANGLES = 2 * np.pi * (np.arange(96) + 0.5) / 96
_GRID = 240
_REFINED = 2


def averages(structure: Structure, A: Array) -> dict[int, Complex]:
    """(S + i C)/A of the structure's forces at unit frequency, summed by their power of frequency, for each A."""
    total: dict[int, Complex] = {}
    for law in structure.averaged_laws:
        power = law.form.power or 0
        total[power] = total.get(power, 0.0) + _average_law(law, A, structure.omega)
    for joint in structure.joints:
        total[0] = total.get(0, 0.0) + _average_joint(joint, A)
    return total


def _average_law(law: TrueLaw, A: Array, omega: float) -> Complex:
    """By sampling; once and for all amplitudes where the force is homogeneous in q and v."""
    if law.form.degree is not None:
        shape: Complex = _average_unit(law.kind) * A.astype(complex) ** (law.form.degree - 1)
        return law.coefficient * shape
    return _sample_law(law, A, omega if law.form.power is None else 1.0)


@cache
def _average_unit(kind: str) -> complex:
    return complex(_sample_law(TrueLaw(kind, 1.0), np.ones(1))[0])


def _sample_law(law: TrueLaw, A: Array, omega: float = 1.0) -> Complex:
    q, v = A[:, None] * np.sin(_ANGLES), omega * A[:, None] * np.cos(_ANGLES)
    return _project(law.force(q, v, np.sign(v)), A)


def _project(force: Array, A: Array) -> Complex:
    average: Complex = (2 / _ANGLES.size) * (force @ (np.sin(_ANGLES) + 1j * np.cos(_ANGLES))) / A
    return average


def _average_joint(joint: TrueJoint, A: Array) -> Complex:
    """Jenkins parts in closed form, with cos(beta) = 1 - 2 L/A; else the second cycle of a sampled loop."""
    if joint.kind == "jenkins":
        share = np.minimum(np.array(joint.limits)[:, None] / A, 1.0)
        beta = np.arccos(1 - 2 * share)
        parts = (beta - np.sin(2 * beta) / 2) / np.pi + 4j / np.pi * share * (1 - share)
        average: Complex = joint.stiffness * (np.array(joint.weights) @ parts - 1)
        return average
    q = A[:, None] * np.sin(_ANGLES)
    z, path = joint.start(q[:, 0]), np.empty_like(q)
    for n in range(2 * _ANGLES.size):
        here = n % _ANGLES.size
        path[:, here] = joint.force(z, q[:, here])
        z = joint.move(z, q[:, (here + 1) % _ANGLES.size] - q[:, here])
    return _project(path, A)


def linear_stiffness(structure: Structure, rows: TrueRows) -> Complex:
    """k - (M + added) omega^2 + i c omega, and what partners add, row by row."""
    w = rows.omega
    k = structure.mass * (structure.omega * rows.tuning) ** 2
    own: Complex = k - (structure.mass + rows.added) * w**2 + 1j * structure.viscous * rows.loss * w
    for partner in structure.partners:
        own = own - structure.mass * partner.push(w)
    return own


def main_phasor(structure: Structure, rows: TrueRows, upper: bool) -> Complex:
    """Phasor of the main coordinate at each row; of several steady states the one of largest or smallest amplitude."""
    w = rows.omega
    F = structure.share * rows.force * rows.drive
    linear = linear_stiffness(structure, rows)
    if not (structure.averaged_laws or structure.joints):
        return F / linear
    A = np.geomspace(np.min(F / np.abs(linear)) / 10, np.max(F / w) / structure.viscous * 1.02, _GRID)
    Z = linear[:, None] + sum(w[:, None] ** power * part for power, part in averages(structure, A).items())
    misfit = np.log((Z.real**2 + Z.imag**2) * (A / F[:, None]) ** 2) / 2
    crossing = (misfit[:, :-1] < 0) & (misfit[:, 1:] >= 0)
    crossing[:, -1] |= ~crossing.any(axis=1)
    k = _GRID - 2 - np.argmax(crossing[:, ::-1], axis=1) if upper else np.argmax(crossing, axis=1)
    row = np.arange(w.size)
    low, high = np.log(A[k]), np.log(A[k + 1])
    below, above = misfit[row, k], misfit[row, k + 1]
    here, Z_here = low, Z[row, k]
    for _ in range(_REFINED + 1):  # regula falsi
        here = low - below * np.clip((high - low) / (above - below), 0.0, None)
        Z_here = linear + sum(w**power * part for power, part in averages(structure, np.exp(here)).items())
        miss = np.log(np.abs(Z_here) / F) + here
        low, below = np.where(miss < 0, here, low), np.where(miss < 0, miss, below)
        high, above = np.where(miss < 0, high, here), np.where(miss < 0, above, miss)
    phasor: Complex = np.exp(here - 1j * np.angle(Z_here))
    return phasor


def sensor_phasor(structure: Structure, rows: TrueRows, main: Complex) -> Complex:
    """The reading for a motion ``main`` of the main coordinate: other modes added, clipped and compressed."""
    X = structure.share * main
    for side, own in zip(structure.sides, side_phasors(structure, rows), strict=True):
        X = X + side.seen * own
    if np.isinf(rows.clip) and np.isinf(rows.knee):
        return X
    shown = show_signal(np.abs(X)[:, None] * np.sin(_ANGLES), rows)
    return np.asarray(X * (2 / _ANGLES.size) * (shown @ np.sin(_ANGLES)) / np.abs(X))


def guess(structure: Structure, rows: TrueRows, other: bool = False) -> Complex:
    """Phasor of the main coordinate on the branch that the sweep follows, or on the other one.

    Of two it follows the upper one if it runs the way the resonance bends.
    """
    A = np.geomspace(1e-3, 1.0, 30) * np.max(rows.force) / (structure.viscous * structure.omega)
    stiffening = averages(structure, A).get(0, np.zeros(A.size)).real
    upper = (float(np.sum(stiffening)) >= 0) == rows.up
    return main_phasor(structure, rows, upper != other)


#: Change of frequency in a step of a moving sweep, half-power half-widths: each step is exact for a fixed frequency.
_SWEEP_STEP = 0.2


def sweep_phasor(structure: Structure, rows: TrueRows) -> Complex:
    """Phasor of the main coordinate when the frequency moves through the rows of each sweep, dwelt at before."""
    X = guess(structure, rows)
    for number in np.unique(rows.sweep):
        place = np.flatnonzero(rows.sweep == number)
        z = X[place[0]]
        for before, here in pairwise(place.tolist()):
            z = _move(structure, rows, z, before, here)
            X[here] = z
    return X


def _move(structure: Structure, rows: TrueRows, z: complex, before: int, here: int) -> complex:
    """The phasor at a row from the one before it.

    In each step its distance from the steady one, which moves evenly, decays as at the frequency half way.
    """
    span, rate = rows.omega[here] - rows.omega[before], rows.rate[here]
    if span == 0.0:  # read twice on the way
        return z
    row = chosen_rows(rows, np.arange(rows.omega.size) == here)
    if rate * span <= 0.0:  # dwelt at, or met against its own direction
        return complex(guess(structure, row)[0])
    count = int(np.ceil(abs(span) / (_SWEEP_STEP * structure.viscous / (2 * structure.mass)))) or 1
    M, c = structure.mass + row.added[0], structure.viscous * row.loss[0]
    F, h = structure.share * row.force[0] * row.drive[0], span / rate / count
    k, nonlinear = structure.mass * (structure.omega * row.tuning[0]) ** 2, structure.averaged_laws or structure.joints

    def stiffness(w: float, amplitude: float) -> complex:
        total = k - M * w**2 + 1j * c * w + 1j * M * rate
        total -= sum(structure.mass * partner.push(np.array([w]))[0] for partner in structure.partners)
        if nonlinear:
            total += sum(w**n * mean[0] for n, mean in averages(structure, np.array([amplitude])).items())
        return complex(total)

    for start in np.linspace(rows.omega[before], rows.omega[here], count, endpoint=False):
        middle, end, after = start + rate * h / 2, start + rate * h, z
        first = F / stiffness(start, abs(z))
        for _ in range(2):  # with the amplitude at the end as at the start, then as found
            last, mean = F / stiffness(end, abs(after)), stiffness(middle, (abs(z) + abs(after)) / 2)
            pull = -mean / (2j * middle * M + c)
            decay = np.exp(pull * h)
            after = last + (z - first) * decay + (last - first) / h * (1 - decay) / pull
        z = after
    return complex(z)
