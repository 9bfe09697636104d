"""First-harmonic steady states: where the integration in time starts, and how large an effect is to be drawn.

The force on q = A sin(theta) is averaged over a cycle by sampling (the functions of ``laws`` and ``joints`` themselves), and
the balance |k - M omega^2 + i c omega + (S + i C)/A| A = F is solved row by row on a grid of amplitudes.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.generator.laws import VELOCITY_POWER, Array
from pipelines.generator.structure import Rows, Structure

Complex = npt.NDArray[np.complex128]
_ANGLES = 2 * np.pi * (np.arange(96) + 0.5) / 96
_GRID = 600


def averages(structure: Structure, A: Array) -> dict[int, Complex]:
    """(S + i C)/A of the structure's forces at unit frequency, summed by their power of frequency, for each A."""
    q = A[:, None] * np.sin(_ANGLES)
    v = A[:, None] * np.cos(_ANGLES)
    total: dict[int, Complex] = {}
    for law in structure.laws:
        power = VELOCITY_POWER.get(law.kind, 0)
        total[power] = total.get(power, 0.0) + _project(law.force(q, v, np.sign(v)), A)
    for joint in structure.joints:
        z, path = joint.start(q[:, 0]), np.empty_like(q)
        for n in range(2 * _ANGLES.size):  # the second cycle is the closed loop
            here = n % _ANGLES.size
            path[:, here] = joint.force(z, q[:, here])
            z = joint.move(z, q[:, (here + 1) % _ANGLES.size] - q[:, here])
        total[0] = total.get(0, 0.0) + _project(path, A)
    return total


def _project(force: Array, A: Array) -> Complex:
    return (2 / _ANGLES.size) * (force @ (np.sin(_ANGLES) + 1j * np.cos(_ANGLES))) / A


def main_phasor(structure: Structure, rows: Rows, upper: bool) -> Complex:
    """Phasor of the main coordinate at each row; of several steady states the one of largest or smallest amplitude."""
    M, w = structure.mass, rows.omega
    F = structure.share * rows.force * rows.drive
    Z0 = M * ((structure.omega * rows.tuning) ** 2 - w**2) + 1j * structure.viscous * w
    if not (structure.laws or structure.joints):
        return F / Z0
    largest = np.max(F / (structure.viscous * structure.omega)) * 1.5
    smallest = np.min(F / np.abs(Z0)) * 1e-2
    A = np.geomspace(smallest, largest, _GRID)
    Z = Z0[:, None] + sum(np.outer(w**power, part) for power, part in averages(structure, A).items())
    misfit = np.log(np.abs(Z) * A / F[:, None])
    crossing = (misfit[:, :-1] < 0) & (misfit[:, 1:] >= 0)
    crossing[:, -1] |= ~crossing.any(axis=1)
    k = _GRID - 2 - np.argmax(crossing[:, ::-1], axis=1) if upper else np.argmax(crossing, axis=1)
    r = np.arange(w.size)
    part = np.clip(-misfit[r, k] / (misfit[r, k + 1] - misfit[r, k]), 0.0, 1.0)
    amplitude = A[k] * (A[1] / A[0]) ** part
    angle = np.angle(Z[r, k] * (1 - part) + Z[r, k + 1] * part)
    return amplitude * np.exp(-1j * angle)


def sensor_phasor(structure: Structure, rows: Rows, main: Complex) -> Complex:
    """What the sensor sees when the main coordinate moves with ``main``: other modes added, clipped where it clips."""
    X = structure.share * main
    for side in structure.sides:
        zeta = 2j * side.zeta * side.omega * rows.omega
        load = side.drive * rows.force * rows.drive / structure.mass
        X = X + side.seen * load / (side.omega**2 - rows.omega**2 + zeta)
    return X * clipped_share(np.abs(X), rows.clip)


def clipped_share(A: Array, clip: float) -> Array:
    """First harmonic of A sin(theta) clipped at +-clip, over A."""
    ratio = np.minimum(clip / A, 1.0)
    return (2 / np.pi) * (np.arcsin(ratio) + ratio * np.sqrt(1 - ratio**2))


def upper_branch(structure: Structure, rows: Rows) -> bool:
    """Which of several steady states the sweep follows: the upper one if it runs the way the resonance bends."""
    A = np.geomspace(1e-3, 1.0, 30) * np.max(rows.force / (structure.viscous * structure.omega))
    stiffening = float(np.sum(averages(structure, A).get(0, np.zeros(A.size)).real))
    return (stiffening >= 0) == rows.up
