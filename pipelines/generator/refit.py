"""Size of a gap: what an effect leaves in the noise-free record after the simulation was refitted within its tolerance.

Free are the simulation's frequency, mass and viscous coefficient, in units of their tolerance and never beyond three of
them, and gain and frequency of each sweep where sweeps scatter, each with a unit penalty; and, for one of a pair, the
size and shape of the other. Predictions are the first-harmonic ones of ``averages``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from pipelines.generator.averages import Complex, main_phasor, sensor_phasor, upper_branch
from pipelines.generator.bench import Bench, deviated
from pipelines.generator.effects import KINDS, Effect, applied
from pipelines.generator.laws import Array
from pipelines.generator.structure import Rows, Structure, recorded

WIDEST = 3.0  # tolerances


@dataclass(frozen=True)
class Cells:
    """A noise-free record and its standard deviations; ``phase_sd`` is None in a record without phase."""

    amplitude: Array
    phase: Array
    amplitude_sd: Array
    phase_sd: Array | None

    def distance(self, amplitude: Array, phase: Array) -> Array:
        """Differences to another record in standard deviations: amplitudes, then phases."""
        parts = [(amplitude - self.amplitude) / self.amplitude_sd]
        if self.phase_sd is not None:
            parts.append((np.mod(phase - self.phase + np.pi, 2 * np.pi) - np.pi) / self.phase_sd)
        return np.concatenate(parts)


def predicted(structure: Structure, rows: Rows) -> tuple[Array, Array]:
    """Amplitude and lag that the rig records, by first-harmonic averages."""
    return recorded(sensor(structure, rows), rows)


def guess(structure: Structure, rows: Rows) -> Complex:
    """Phasor of the main coordinate on the branch that the sweep follows."""
    nonlinear = bool(structure.laws or structure.joints)
    return main_phasor(structure, rows, nonlinear and upper_branch(structure, rows))


def sensor(structure: Structure, rows: Rows) -> Complex:
    """Phasor at the sensor, by averages."""
    return sensor_phasor(structure, rows, guess(structure, rows))


def gap(cells: Cells, bench: Bench, effects: tuple[Effect, ...] = ()) -> float:
    """Root mean square, in sigma, left after the simulation (with ``effects``, their sizes free) was refitted."""
    sweeps = int(bench.rows.sweep.max()) + 1
    scatter = bench.scatter[0] > 0.0
    sizes = [effect.size for effect in effects]

    def left(x: Array) -> Array:
        structure, rows = _simulated(bench, x[:3], effects, x[3 : 3 + len(effects)])
        if scatter:
            gain, tune = x[3 + len(effects) :].reshape(2, sweeps)
            rows = replace(
                rows,
                gain=rows.gain * (1 + bench.scatter[0] * gain)[rows.sweep],
                tuning=rows.tuning * (1 + bench.scatter[1] * tune)[rows.sweep],
            )
        return cells.distance(*predicted(structure, rows))

    free = 3 + len(effects) + (2 * sweeps if scatter else 0)
    penalised = np.r_[np.ones(3, bool), np.zeros(len(effects), bool), np.ones(free - 3 - len(effects), bool)]
    first = np.zeros(free)
    first[:3] = np.clip(bench.deviation, -WIDEST, WIDEST)
    first[3 : 3 + len(effects)] = 1.0
    bound = np.where(penalised, WIDEST, np.inf)
    low = np.where(penalised, -bound, 0.0)
    high = np.where(penalised, bound, [*([1.0] * 3), *(KINDS[e.name].most(bench) / s * 1.5 for e, s in zip(effects, sizes, strict=True)), *([1.0] * (free - 3 - len(effects)))])  # fmt: skip
    fit = least_squares(
        _with_penalty(left, penalised), np.clip(first, low + 1e-9, high - 1e-9), bounds=(low, high), max_nfev=30,
        x_scale=1.0, xtol=1e-6, ftol=1e-6, diff_step=1e-4,
    )  # fmt: skip
    return float(np.sqrt(np.mean(left(fit.x) ** 2)))


def _with_penalty(left: Callable[[Array], Array], penalised: Array) -> Callable[[Array], Array]:
    return lambda x: np.concatenate([left(x), x[penalised]])


def _simulated(bench: Bench, deviation: Array, effects: tuple[Effect, ...], factors: Array) -> tuple[Structure, Rows]:
    """The simulation with the given deviations, effects added at factors of their sizes; the rig is the faultless one."""
    d = (float(deviation[0]), float(deviation[1]), float(deviation[2]))
    plain = replace(bench, deviation=d, rows=_unscattered(bench.rows))
    scaled = tuple(replace(e, size=e.size * float(f)) for e, f in zip(effects, factors, strict=True))
    return applied(scaled, plain)


def _unscattered(rows: Rows) -> Rows:
    one = np.ones(rows.omega.size)
    return replace(rows, gain=one, tuning=one)


def nominal(bench: Bench) -> Structure:
    """The simulation as given."""
    return deviated(bench.nominal, bench.tolerance, (0.0, 0.0, 0.0))
