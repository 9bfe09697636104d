"""First-harmonic steady states: where the integration in time starts, and how large an effect is to be drawn.

On q = A sin(theta) the forces have in-phase and quadrature averages S and C (``averages``), and the balance
|k - M omega^2 + i c omega + (S + i C)/A| A = F is solved row by row on a grid of amplitudes, then refined.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from pipelines.generator.joints import Joint
from pipelines.generator.laws import DEGREE, VELOCITY_POWER, Array, Law
from pipelines.generator.structure import Complex, Rows, Structure

_ANGLES = 2 * np.pi * (np.arange(96) + 0.5) / 96
_GRID = 240
_REFINED = 2


def averages(structure: Structure, A: Array) -> dict[int, Complex]:
    """(S + i C)/A of the structure's forces at unit frequency, summed by their power of frequency, for each A."""
    total: dict[int, Complex] = {}
    for law in structure.laws:
        power = VELOCITY_POWER.get(law.kind, 0)
        total[power] = total.get(power, 0.0) + _law_average(law, A)
    for joint in structure.joints:
        total[0] = total.get(0, 0.0) + _joint_average(joint, A)
    return total


def _law_average(law: Law, A: Array) -> Complex:
    """By sampling; once and for all amplitudes where the force is homogeneous in q and v."""
    if law.kind in DEGREE:
        shape: Complex = _unit_average(law.kind) * A.astype(complex) ** (DEGREE[law.kind] - 1)
        return law.coefficient * shape
    return _sampled(law, A)


@cache
def _unit_average(kind: str) -> complex:
    return complex(_sampled(Law(kind, 1.0), np.ones(1))[0])


def _sampled(law: Law, A: Array) -> Complex:
    q, v = A[:, None] * np.sin(_ANGLES), A[:, None] * np.cos(_ANGLES)
    return _projected(law.force(q, v, np.sign(v)), A)


def _projected(force: Array, A: Array) -> Complex:
    average: Complex = (2 / _ANGLES.size) * (force @ (np.sin(_ANGLES) + 1j * np.cos(_ANGLES))) / A
    return average


def _joint_average(joint: Joint, A: Array) -> Complex:
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
    return _projected(path, A)


def main_phasor(structure: Structure, rows: Rows, upper: bool) -> Complex:
    """Phasor of the main coordinate at each row; of several steady states the one of largest or smallest amplitude."""
    w = rows.omega
    F = structure.share * rows.force * rows.drive
    linear: Complex = structure.mass * ((structure.omega * rows.tuning) ** 2 - w**2) + 1j * structure.viscous * w
    if not (structure.laws or structure.joints):
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


def sensor_phasor(structure: Structure, rows: Rows, main: Complex) -> Complex:
    """What the sensor sees when the main coordinate moves with ``main``: other modes added, clipped where it clips."""
    X = structure.share * main
    for side in structure.sides:
        impedance = side.omega**2 - rows.omega**2 + 2j * side.zeta * side.omega * rows.omega
        X = X + side.seen * side.drive * rows.force * rows.drive / structure.mass / impedance
    return X * clipped_share(np.abs(X), rows.clip)


def clipped_share(A: Array, clip: float) -> Array:
    """First harmonic of A sin(theta) clipped at +-clip, over A: (2/pi)(arcsin r + r sqrt(1 - r^2)), r = clip/A <= 1."""
    ratio = np.minimum(clip / A, 1.0)
    share: Array = (2 / np.pi) * (np.arcsin(ratio) + ratio * np.sqrt(1 - ratio**2))
    return share


def upper_branch(structure: Structure, rows: Rows) -> bool:
    """Which of several steady states the sweep follows: the upper one if it runs the way the resonance bends."""
    A = np.geomspace(1e-3, 1.0, 30) * np.max(rows.force) / (structure.viscous * structure.omega)
    stiffening = float(np.sum(averages(structure, A).get(0, np.zeros(A.size)).real))
    return (stiffening >= 0) == rows.up
