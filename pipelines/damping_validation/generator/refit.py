"""All effects by name, in groups, the truth with some of them present, and the size of the gap that they leave.

A gap is the residual of an effect in the noise-free record after a refit of the simulation within its tolerance. Free
are the simulation's frequency, mass and viscous coefficient, in units of their tolerance and never beyond three of
them, and gain and frequency of each sweep where sweeps scatter, each with a unit penalty; and, where the simulation is
given effects of its own, their sizes (and, if asked, what else of them is continuous). Predictions are the
first-harmonic ones of ``balance``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from damping_validation.generator import plan
from damping_validation.generator.balance import TrueRows, guess, recorded, sensor_phasor, sweep_phasor
from damping_validation.generator.effects import FORCE_KINDS, PATH_KINDS, AppliedEffect, Kind, TrueEffect, Truth
from damping_validation.generator.laws import Array, Complex, Structure
from damping_validation.generator.rig import DRIFT_KINDS, FOREIGN_KINDS, FOREIGN_RIG, RIG_KINDS
from damping_validation.generator.steady import NoSteadyStateError, true_phasors

KINDS: Mapping[str, Kind] = {**FORCE_KINDS, **PATH_KINDS, **DRIFT_KINDS, **RIG_KINDS, **FOREIGN_KINDS}

LIBRARY = (*FORCE_KINDS, *PATH_KINDS, *DRIFT_KINDS, *RIG_KINDS)
OUTSIDE = tuple(FOREIGN_KINDS)
RIG = (*RIG_KINDS, *FOREIGN_RIG)  #: kinds whose fault is the rig's
#: Members of pairs.
FORCES = ("displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement", "coulomb-friction")
INSTRUMENT = ("amplitude-scale", "phase-lag", "force-dropout", "level-offset", "sensor-saturation", "background")
STRUCTURE = ("slip", "stiffness-hardening", "stiffness-softening", *PATH_KINDS)


def name_effect(kind: str) -> str:
    """The name of a kind in the library of the diagnosis; its own name if the library does not have it."""
    return kind.partition(":")[0]


def applied(effects: tuple[TrueEffect, ...], bench: plan.Bench, rows: TrueRows | None = None) -> Truth:
    """True structure and rig with the effects present, at the rows of the bench or at others."""
    truth = bench.truth(), bench.rows if rows is None else rows
    for effect in effects:
        kind, here = KINDS[effect.name], AppliedEffect(*truth, effect.size, effect.shape, bench)
        truth = replace(truth[0], **kind.structure(here)), replace(truth[1], **kind.rows(here))
    return truth


WIDEST = 3.0  # tolerances
_LARGER = 1.2  # times the largest size drawn
_MOVED = 3.0  # factor by which a fit may move a width or place


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


def gap(cells: RecordCells, bench: plan.Bench, effects: tuple[TrueEffect, ...] = (), reshape: bool = False) -> float:
    """Root mean square, in sigma, left after the simulation (with ``effects`` of free size) was refitted.

    ``reshape`` frees the continuous entries of the effects' shapes too.
    """
    sweeps = int(bench.rows.sweep.max()) + 1 if bench.scatter[0] > 0.0 else 0
    most = [_LARGER * KINDS[effect.name].largest(bench) / effect.size for effect in effects]
    moves = sum(len(KINDS[effect.name].free) for effect in effects) if reshape else 0
    start = np.concatenate([bench.deviation, np.zeros(2 * sweeps), np.ones(len(effects) + moves)])
    penalised = 3 + 2 * sweeps
    low = np.concatenate([np.full(penalised, -WIDEST), np.zeros(len(effects)), np.full(moves, 1 / _MOVED)])
    high = np.concatenate([np.full(penalised, WIDEST), most, np.full(moves, _MOVED)])

    def left(x: Array) -> Array:
        return np.concatenate([cells.distance(*predicted(*_simulated(bench, effects, x, sweeps))), x[:penalised]])

    fit = least_squares(
        left,
        np.clip(start, low + 1e-9, high - 1e-9),
        bounds=(low, high),
        max_nfev=30,
        xtol=1e-6,
        ftol=1e-6,
        diff_step=np.full(start.size, 1e-4),
    )
    return float(np.sqrt(np.mean(fit.fun[:-penalised] ** 2)))


def predicted(structure: Structure, rows: TrueRows) -> tuple[Array, Array]:
    """Amplitude and lag that the rig records, by first-harmonic averages."""
    main = sweep_phasor(structure, rows) if rows.swept else guess(structure, rows)
    return recorded(sensor_phasor(structure, rows, main), rows)


def _simulated(bench: plan.Bench, effects: tuple[TrueEffect, ...], x: Array, sweeps: int) -> tuple[Structure, TrueRows]:
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
    unit = np.ones(rows.omega.size)
    return replace(rows, gain=unit, tuning=unit)


SINGLE_GAPS = (0.3, 30.0)  #: gap of a single effect, sigma: from what cannot be seen to what nobody misses
PAIR_GAPS = (1.0, 12.0)  #: gap of each of a pair alone, sigma
#: What a record of a pair leaves, in sigma, to either effect alone: less, and it does not show that there are two.
LEAST_OF_EACH = 1.0

_DRAWS = 400  #: structures drawn until one gives a case of the kind that is wanted
_TRIALS = 14  #: sizes of an effect tried until its gap is the one that was drawn
_LOG_RANGE = 12.0  #: ln of the largest over the smallest size tried
_NEAR = 0.05  #: ln of the gap over the one drawn at which a size is taken
#: Gap, sigma, that stands for none where its logarithm is taken.
_NOTHING = 1e-9
_MAY_SCATTER = {"null:nothing": False, "null:parameters": False, "null:scatter": True}
_LEVELS = {"level-offset": 3, "drift:levels": 3}  #: least levels of a kind that parts one from the others
_KNOWN_RATES = (0.03, 0.4)  #: rates of a sweep that moves and says so, half-power half-widths squared


@dataclass(frozen=True)
class DrawnCase:
    """A case without its noise: bench, effects, noise-free record, its gap, and the share of each effect."""

    bench: plan.Bench
    effects: tuple[TrueEffect, ...]
    noise: plan.Noise
    cells: RecordCells
    gap: float
    without_each: tuple[float, ...]  #: for a pair, the gap without that effect, with all else refitted
    third: Complex
    across: Complex


def draw(kind: str, field: bool, rng: plan.Generator) -> DrawnCase:
    """Draw until a steady state exists and the effect can be made large enough."""
    for _ in range(_DRAWS):
        names = _list_names(kind, rng)
        bench = _bench(kind, names, field, rng)
        noise = plan.draw_noise(rng, field, bench.rows.omega.size, needs_phase="phase-lag" in names)
        effects = tuple(TrueEffect(name, KINDS[name].largest(bench), KINDS[name].draw(rng, bench)) for name in names)
        gaps = PAIR_GAPS if len(effects) > 1 else SINGLE_GAPS
        sized = [_sized(effect, bench, noise, gaps, rng) for effect in effects]
        effects = tuple(effect for effect in sized if effect is not None)
        drawn = _integrate(bench, effects, noise) if len(effects) == len(names) else None
        if drawn is not None:
            return drawn
    raise RuntimeError(f"no case of kind {kind} in {_DRAWS} draws")


def _list_names(kind: str, rng: plan.Generator) -> tuple[str, ...]:
    if kind.startswith("null:"):
        return ()
    if not kind.startswith("pair:"):
        return (kind,)
    if kind == "pair:two-forces":
        return tuple(str(name) for name in rng.choice(FORCES, size=2, replace=False))
    return (str(rng.choice(FORCES)), str(rng.choice(INSTRUMENT if kind == "pair:force-instrument" else STRUCTURE)))


def _bench(kind: str, names: tuple[str, ...], field: bool, rng: plan.Generator) -> plan.Bench:
    """A bench whose simulation does not include the effects."""
    least = max((_LEVELS.get(name, 1) for name in names), default=1)
    bench = plan.draw_bench(rng, field, _MAY_SCATTER.get(kind), levels=max(least, len(names)))
    if kind == "null:swept":
        return plan.move_frequency(bench, plan.log_uniform(rng, *_KNOWN_RATES))
    if "sweep-rate" in names:  # neither the rate nor the times that would tell it
        bench = replace(bench, columns=tuple(set(bench.columns) - {"rate", "time", "third", "across"}))
    if kind == "null:nothing":
        return replace(bench, deviation=(0.0, 0.0, 0.0))
    held = {name for name, _ in bench.base}
    added = {name.removesuffix("-friction") for name in map(name_effect, names)}
    alone = replace(bench, base=(), nominal=replace(bench.nominal, laws=()))
    return alone if held & added else bench


def _sized(
    effect: TrueEffect, bench: plan.Bench, noise: plan.Noise, gaps: tuple[float, float], rng: plan.Generator
) -> TrueEffect | None:
    """The effect at a size whose gap is log-uniform in ``gaps``; None out of its reach.

    That gap is the effect's alone, by averages and without scatter from sweep to sweep; the label's is the true one.
    """

    calm = replace(bench, scatter=(0.0, 0.0), rows=unscattered(bench.rows))

    def gap_at(log_size: float) -> float:
        sized = replace(effect, size=float(np.exp(log_size)))
        return gap(_cells(predicted(*applied((sized,), calm)), noise), calm)

    if effect.size <= 0.0:
        return None
    top = float(np.log(effect.size))
    here = gap_at(top)
    if here < 1.2 * gaps[0]:
        return None
    target = plan.log_uniform(rng, 1.1 * gaps[0], min(gaps[1], here))
    bottom, place = top - _LOG_RANGE, top
    for _ in range(_TRIALS):
        if abs(np.log(max(here, _NOTHING) / target)) < _NEAR:
            break
        bottom, top = (place, top) if here < target else (bottom, place)
        place += float(np.log(target / max(here, _NOTHING)))  # as if the gap went with the size
        if not bottom < place < top:
            place = (bottom + top) / 2
        here = gap_at(place)
    return replace(effect, size=float(np.exp(place)))


def _cells(record: tuple[Array, Array], noise: plan.Noise) -> RecordCells:
    """The record with its standard deviations, which go with its own amplitude."""
    return RecordCells(*record, noise.share * record[0], noise.phase if noise.has_phase else None)


def _integrate(bench: plan.Bench, effects: tuple[TrueEffect, ...], noise: plan.Noise) -> DrawnCase | None:
    """The noise-free record and its gap; None without a steady state, without a gap, or where one effect would do."""
    structure, rows = applied(effects, bench)
    try:
        first, third, across = true_phasors(structure, rows)
    except NoSteadyStateError:
        return None
    cells = _cells(recorded(first, rows), noise)
    values: tuple[float, ...] = ()
    if len(effects) > 1:
        values = tuple(gap(cells, bench, (*effects[:n], *effects[n + 1 :]), reshape=True) for n in range(len(effects)))
        if min(values) < LEAST_OF_EACH:
            return None
    size = gap(cells, bench)
    if effects and size < SINGLE_GAPS[0]:
        return None
    return DrawnCase(bench, effects, noise, cells, size, values, third, across)
