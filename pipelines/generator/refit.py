"""Size of a gap: what an effect leaves in the noise-free record after the simulation was refitted within its tolerance.

Free are the simulation's frequency, mass and viscous coefficient, in units of their tolerance and never beyond three of
them, and gain and frequency of each sweep where sweeps scatter, each with a unit penalty; and, where the simulation is
given effects of its own, their sizes (and, if asked, what else of them is continuous). Predictions are the
first-harmonic ones of ``averages``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from pipelines.generator.averages import main_phasor, sensor_phasor, upper_branch
from pipelines.generator.bench import Bench
from pipelines.generator.effects import KINDS, LIBRARY, applied
from pipelines.generator.kind import Effect
from pipelines.generator.laws import Array
from pipelines.generator.structure import Complex, Rows, Structure, recorded

WIDEST = 3.0  # tolerances
_LARGER = 1.2  # times the largest size drawn
_MOVED = 3.0  # factor by which a fit may move a width or place
_FIRST = 0.05  # of the largest size: where the search for an imitation starts


@dataclass(frozen=True)
class Cells:
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


def guess(structure: Structure, rows: Rows, other: bool = False) -> Complex:
    """Phasor of the main coordinate on the branch that the sweep follows, or on the other one."""
    if not (structure.laws or structure.joints):
        return main_phasor(structure, rows, False)
    return main_phasor(structure, rows, upper_branch(structure, rows) != other)


def predicted(structure: Structure, rows: Rows) -> tuple[Array, Array]:
    """Amplitude and lag that the rig records, by first-harmonic averages."""
    return recorded(sensor_phasor(structure, rows, guess(structure, rows)), rows)


def gap(cells: Cells, bench: Bench, effects: tuple[Effect, ...] = (), reshape: bool = False) -> float:
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


def _simulated(bench: Bench, effects: tuple[Effect, ...], x: Array, sweeps: int) -> tuple[Structure, Rows]:
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
        changed.append(Effect(effect.name, effect.size * size, tuple(shape)))
    return applied(tuple(changed), replace(bench, deviation=(f, m, c), rows=rows))


def unscattered(rows: Rows) -> Rows:
    """The rows with neither gain nor frequency scattered (nor changed by an effect)."""
    one = np.ones(rows.omega.size)
    return replace(rows, gain=one, tuning=one)


def nearest_imitation(cells: Cells, bench: Bench, besides: tuple[str, ...]) -> tuple[str, float]:
    """The effect of the library, but those named, that alone leaves least of this record, and what it leaves."""
    left = {name: _least(cells, bench, name) for name in LIBRARY if name not in besides}
    name = min(left, key=left.__getitem__)
    return name, left[name]


def _least(cells: Cells, bench: Bench, name: str) -> float:
    kind = KINDS[name]
    size = _FIRST * kind.most(bench)
    return min(gap(cells, bench, (Effect(name, size, shape),), reshape=True) for shape in kind.trials(bench))
