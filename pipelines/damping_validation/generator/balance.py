"""First-harmonic balance of a true structure: where the integration in time starts, and how large an effect is drawn.

On q = A sin(theta) the forces have in-phase and quadrature averages S and C (``averages``), and the balance
|k - M omega^2 + i c omega + (S + i C)/A| A = F is solved row by row on a grid of amplitudes, then refined.

While the frequency moves, q = Re z(t) exp(i theta) with omega = theta' obeys, but for z'',
(2 i omega M + c) z' = F - (k - M omega^2 + i c omega + i M omega' + (S + i C)/A) z (``sweep_phasor``).
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np

from damping_validation.generator.laws import DEGREE, RATE_BOUND, VELOCITY_POWER, Array, TrueJoint, TrueLaw
from damping_validation.generator.structure import (
    Complex,
    Structure,
    TrueRows,
    chosen_rows,
    recorded,
    show_signal,
    side_phasors,
)

_ANGLES = 2 * np.pi * (np.arange(96) + 0.5) / 96
_GRID = 240
_REFINED = 2


def averages(structure: Structure, A: Array) -> dict[int, Complex]:
    """(S + i C)/A of the structure's forces at unit frequency, summed by their power of frequency, for each A."""
    total: dict[int, Complex] = {}
    for law in structure.averaged_laws:
        power = VELOCITY_POWER.get(law.kind, 0)
        total[power] = total.get(power, 0.0) + _average_law(law, A, structure.omega)
    for joint in structure.joints:
        total[0] = total.get(0, 0.0) + _average_joint(joint, A)
    return total


def _average_law(law: TrueLaw, A: Array, omega: float) -> Complex:
    """By sampling; once and for all amplitudes where the force is homogeneous in q and v."""
    if law.kind in DEGREE:
        shape: Complex = _average_unit(law.kind) * A.astype(complex) ** (DEGREE[law.kind] - 1)
        return law.coefficient * shape
    return _sample_law(law, A, omega if law.kind in RATE_BOUND else 1.0)


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
    """What the sensor sees when the main coordinate moves with ``main``: other modes added, clipped and compressed."""
    X = structure.share * main
    for side, own in zip(structure.sides, side_phasors(structure, rows), strict=True):
        X = X + side.seen * own
    if np.isinf(rows.clip) and np.isinf(rows.knee):
        return X
    shown = show_signal(np.abs(X)[:, None] * np.sin(_ANGLES), rows)
    return np.asarray(X * (2 / _ANGLES.size) * (shown @ np.sin(_ANGLES)) / np.abs(X))


def guess(structure: Structure, rows: TrueRows, other: bool = False) -> Complex:
    """Phasor of the main coordinate on the branch that the sweep follows, or on the other one."""
    if not (structure.averaged_laws or structure.joints):
        return main_phasor(structure, rows, False)
    return main_phasor(structure, rows, upper_branch(structure, rows) != other)


def upper_branch(structure: Structure, rows: TrueRows) -> bool:
    """Which of several steady states the sweep follows: the upper one if it runs the way the resonance bends."""
    A = np.geomspace(1e-3, 1.0, 30) * np.max(rows.force) / (structure.viscous * structure.omega)
    stiffening = float(np.sum(averages(structure, A).get(0, np.zeros(A.size)).real))
    return (stiffening >= 0) == rows.up


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
    count = int(np.ceil(abs(span) / (_SWEEP_STEP * structure.viscous / (2 * structure.mass)))) or 1
    if rate * span <= 0.0:  # dwelt at, or met against its own direction
        return complex(guess(structure, chosen_rows(rows, np.arange(rows.omega.size) == here))[0])
    row = chosen_rows(rows, np.arange(rows.omega.size) == here)
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


def predicted(structure: Structure, rows: TrueRows) -> tuple[Array, Array]:
    """Amplitude and lag that the rig records, by first-harmonic averages."""
    main = sweep_phasor(structure, rows) if rows.swept else guess(structure, rows)
    return recorded(sensor_phasor(structure, rows, main), rows)
