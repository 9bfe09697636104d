"""First-harmonic steady states: where the integration in time starts, and how large an effect is to be drawn.

On q = A sin(theta) the forces have in-phase and quadrature averages S and C (``averages``), and the balance
|k - M omega^2 + i c omega + (S + i C)/A| A = F is solved row by row on a grid of amplitudes, then refined.

All effects by name, in groups, and the truth with some of them present.

Size of a gap: what an effect leaves in the noise-free record after the simulation was refitted within its tolerance.

Free are the simulation's frequency, mass and viscous coefficient, in units of their tolerance and never beyond three of
them, and gain and frequency of each sweep where sweeps scatter, each with a unit penalty; and, where the simulation is
given effects of its own, their sizes (and, if asked, what else of them is continuous). Predictions are the
first-harmonic ones of ``averages``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import least_squares

from damping_validation.generator.forces import FORCE_KINDS, Kind, TrueEffect, Truth
from damping_validation.generator.paths import FOREIGN_KINDS, PATH_KINDS, RIG_KINDS
from damping_validation.generator.plan import Bench, Generator
from damping_validation.generator.structure import (
    DEGREE,
    VELOCITY_POWER,
    Array,
    Complex,
    Structure,
    TrueJoint,
    TrueLaw,
    TrueRows,
    recorded,
)

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


def _law_average(law: TrueLaw, A: Array) -> Complex:
    """By sampling; once and for all amplitudes where the force is homogeneous in q and v."""
    if law.kind in DEGREE:
        shape: Complex = _unit_average(law.kind) * A.astype(complex) ** (DEGREE[law.kind] - 1)
        return law.coefficient * shape
    return _sampled(law, A)


@cache
def _unit_average(kind: str) -> complex:
    return complex(_sampled(TrueLaw(kind, 1.0), np.ones(1))[0])


def _sampled(law: TrueLaw, A: Array) -> Complex:
    q, v = A[:, None] * np.sin(_ANGLES), A[:, None] * np.cos(_ANGLES)
    return _projected(law.force(q, v, np.sign(v)), A)


def _projected(force: Array, A: Array) -> Complex:
    average: Complex = (2 / _ANGLES.size) * (force @ (np.sin(_ANGLES) + 1j * np.cos(_ANGLES))) / A
    return average


def _joint_average(joint: TrueJoint, A: Array) -> Complex:
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


def main_phasor(structure: Structure, rows: TrueRows, upper: bool) -> Complex:
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


def sensor_phasor(structure: Structure, rows: TrueRows, main: Complex) -> Complex:
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


def upper_branch(structure: Structure, rows: TrueRows) -> bool:
    """Which of several steady states the sweep follows: the upper one if it runs the way the resonance bends."""
    A = np.geomspace(1e-3, 1.0, 30) * np.max(rows.force) / (structure.viscous * structure.omega)
    stiffening = float(np.sum(averages(structure, A).get(0, np.zeros(A.size)).real))
    return (stiffening >= 0) == rows.up


KINDS: Mapping[str, Kind] = {**FORCE_KINDS, **PATH_KINDS, **RIG_KINDS, **FOREIGN_KINDS}

LIBRARY = (*FORCE_KINDS, *PATH_KINDS, *RIG_KINDS)
OUTSIDE = tuple(FOREIGN_KINDS)
#: Members of pairs.
FORCES = (
    "displacement",
    "velocity-squared",
    "displacement-velocity",
    "quadratic-displacement",
    "coulomb-friction",
)
INSTRUMENT = tuple(RIG_KINDS)
STRUCTURE = ("slip", "stiffness-hardening", "stiffness-softening", *PATH_KINDS)


def applied(effects: tuple[TrueEffect, ...], bench: Bench) -> Truth:
    """True structure and rig with the effects present."""
    truth = bench.truth(), bench.rows
    for effect in effects:
        truth = KINDS[effect.name].apply(truth, effect.size, effect.shape, bench)
    return truth


def draw_effect(name: str, rng: Generator, bench: Bench) -> TrueEffect:
    """The effect with a drawn shape and its largest size."""
    return TrueEffect(name, KINDS[name].most(bench), KINDS[name].shape(rng, bench))


WIDEST = 3.0  # tolerances
_LARGER = 1.2  # times the largest size drawn
_MOVED = 3.0  # factor by which a fit may move a width or place
_FIRST = 0.05  # of the largest size: where the search for an imitation starts


@dataclass(frozen=True)
class RecordCells:
    """A noise-free record and its standard deviations; ``phase_sd`` is None in a record without phase."""

    amplitude: Array
    phase: Array
    amplitude_sd: Array
    phase_sd: Array | None

    def distance(self, amplitude: Array, phase: Array) -> Array:
        """Differences of another record in standard deviations: amplitudes, then phases."""
        parts = [(amplitude - self.amplitude) / self.amplitude_sd]
        if self.phase_sd is not None:
            parts.append((np.mod(phase - self.phase + np.pi, 2 * np.pi) - np.pi) / self.phase_sd)
        return np.concatenate(parts)


def guess(structure: Structure, rows: TrueRows, other: bool = False) -> Complex:
    """Phasor of the main coordinate on the branch that the sweep follows, or on the other one."""
    if not (structure.laws or structure.joints):
        return main_phasor(structure, rows, False)
    return main_phasor(structure, rows, upper_branch(structure, rows) != other)


def predicted(structure: Structure, rows: TrueRows) -> tuple[Array, Array]:
    """Amplitude and lag that the rig records, by first-harmonic averages."""
    return recorded(sensor_phasor(structure, rows, guess(structure, rows)), rows)


def gap(cells: RecordCells, bench: Bench, effects: tuple[TrueEffect, ...] = (), reshape: bool = False) -> float:
    """Root mean square, in sigma, left after the simulation (with ``effects`` of free size) was refitted.

    ``reshape`` frees the continuous entries of the effects' shapes too.
    """
    sweeps = int(bench.rows.sweep.max()) + 1 if bench.scatter[0] > 0.0 else 0
    most = [_LARGER * KINDS[effect.name].most(bench) / effect.size for effect in effects]
    moves = sum(len(KINDS[effect.name].free) for effect in effects) if reshape else 0
    start = np.concatenate([bench.deviation, np.zeros(2 * sweeps), np.ones(len(effects) + moves)])
    penalised = 3 + 2 * sweeps
    low = np.concatenate([np.full(penalised, -WIDEST), np.zeros(len(effects)), np.full(moves, 1 / _MOVED)])
    high = np.concatenate([np.full(penalised, WIDEST), most, np.full(moves, _MOVED)])

    def left(x: Array) -> Array:
        return cells.distance(*predicted(*_simulated(bench, effects, x, sweeps)))

    def left_and_penalty(x: Array) -> Array:
        return np.concatenate([left(x), x[:penalised]])

    fit = least_squares(
        left_and_penalty,
        np.clip(start, low + 1e-9, high - 1e-9),
        bounds=(low, high),
        max_nfev=30,
        xtol=1e-6,
        ftol=1e-6,
        diff_step=np.full(start.size, 1e-4),
    )
    return float(np.sqrt(np.mean(left(fit.x) ** 2)))


def _simulated(bench: Bench, effects: tuple[TrueEffect, ...], x: Array, sweeps: int) -> tuple[Structure, TrueRows]:
    """The simulation at the free values: deviations, gains and frequencies of sweeps, factors of sizes and shapes."""
    (f, m, c), rest = x[:3].tolist(), x[3:]
    rows = unscattered(bench.rows)
    if sweeps:
        gain, tune = (1 + sd * part for sd, part in zip(bench.scatter, rest[: 2 * sweeps].reshape(2, -1), strict=True))
        rows = replace(rows, gain=gain[rows.sweep], tuning=tune[rows.sweep])
    sizes, moves = np.split(rest[2 * sweeps :], [len(effects)])
    factors, changed = iter(moves.tolist()), []
    for effect, size in zip(effects, sizes.tolist(), strict=True):
        shape = list(effect.shape)
        for entry in KINDS[effect.name].free if moves.size else ():
            shape[entry] *= next(factors)
        changed.append(TrueEffect(effect.name, effect.size * size, tuple(shape)))
    return applied(tuple(changed), replace(bench, deviation=(f, m, c), rows=rows))


def unscattered(rows: TrueRows) -> TrueRows:
    """The rows with neither gain nor frequency scattered (nor changed by an effect)."""
    one = np.ones(rows.omega.size)
    return replace(rows, gain=one, tuning=one)


def nearest_imitation(cells: RecordCells, bench: Bench, besides: tuple[str, ...]) -> tuple[str, float]:
    """The effect of the library, but those named, that alone leaves least of this record, and what it leaves."""
    left = {name: _least(cells, bench, name) for name in LIBRARY if name not in besides}
    name = min(left, key=left.__getitem__)
    return name, left[name]


def _least(cells: RecordCells, bench: Bench, name: str) -> float:
    kind = KINDS[name]
    size = _FIRST * kind.most(bench)
    return min(gap(cells, bench, (TrueEffect(name, size, shape),), reshape=True) for shape in kind.trials(bench))
