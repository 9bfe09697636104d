"""Draws of a case: its effects at sizes spread over the gaps, its noise-free record, and what its gap is."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipelines.generator.bench import Bench, draw_bench, without_base
from pipelines.generator.effects import FORCES, INSTRUMENT, STRUCTURE, applied, draw_effect
from pipelines.generator.kind import Effect
from pipelines.generator.laws import Array
from pipelines.generator.noise import Noise, draw_noise
from pipelines.generator.plan import Generator, log_uniform
from pipelines.generator.refit import Cells, gap, predicted, unscattered
from pipelines.generator.steady import NoSteadyStateError
from pipelines.generator.truth import true_record

#: Gaps in sigma: of a single effect, and of each of a pair alone.
SINGLE_GAPS, PAIR_GAPS = (0.3, 30.0), (1.0, 12.0)
#: What a record of a pair leaves, in sigma, to either effect alone: less, and it does not show that there are two.
LEAST_OF_EACH = 1.0

_DRAWS = 400
_TRIALS, _LOG_RANGE, _NEAR, _NOTHING = 14, 12.0, 0.05, 1e-9
_MAY_SCATTER = {"null:nothing": False, "null:parameters": False, "null:scatter": True}


@dataclass(frozen=True)
class Drawn:
    """Everything of a case but its noise: bench, effects, noise-free record, its gap, and what each effect explains.

    ``without_each`` is, for a pair, what is left when that effect is taken away and all else refitted.
    """

    bench: Bench
    effects: tuple[Effect, ...]
    noise: Noise
    cells: Cells
    gap: float
    without_each: tuple[float, ...]


def draw(kind: str, field: bool, rng: Generator) -> Drawn:
    """Draw until a steady state exists and the effect can be made large enough."""
    for _ in range(_DRAWS):
        names = _names(kind, rng)
        bench = _bench(kind, names, field, rng)
        noise = draw_noise(rng, field, bench.rows.omega.size, needs_phase="phase-lag" in names)
        effects = tuple(draw_effect(name, rng, bench) for name in names)
        sized = [
            _sized(effect, bench, noise, PAIR_GAPS if len(effects) > 1 else SINGLE_GAPS, rng) for effect in effects
        ]
        effects = tuple(effect for effect in sized if effect is not None)
        found = _integrated(bench, effects, noise) if len(effects) == len(names) else None
        if found is not None:
            return found
    raise RuntimeError(f"no case of kind {kind} in {_DRAWS} draws")


def _names(kind: str, rng: Generator) -> tuple[str, ...]:
    """Names of the effects of a kind."""
    if kind.startswith("null:"):
        return ()
    if not kind.startswith("pair:"):
        return (kind,)
    if kind == "pair:two-forces":
        return tuple(str(name) for name in rng.choice(FORCES, size=2, replace=False))
    return (str(rng.choice(FORCES)), str(rng.choice(INSTRUMENT if kind == "pair:force-instrument" else STRUCTURE)))


def _bench(kind: str, names: tuple[str, ...], field: bool, rng: Generator) -> Bench:
    """A bench on which the effects are something that its simulation does not hold."""
    bench = draw_bench(rng, field, _MAY_SCATTER.get(kind), levels=2 if len(names) > 1 else 1)
    if kind == "null:nothing":
        return replace(bench, deviation=(0.0, 0.0, 0.0))
    held = {name for name, _ in bench.base}
    return without_base(bench) if held & {name.removesuffix("-friction") for name in names} else bench


def _sized(effect: Effect, bench: Bench, noise: Noise, gaps: tuple[float, float], rng: Generator) -> Effect | None:
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
    target = log_uniform(rng, 1.1 * gaps[0], min(gaps[1], here))
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


def _cells(record: tuple[Array, Array], noise: Noise) -> Cells:
    """The record with its standard deviations, which go with its own amplitude."""
    return Cells(*record, noise.share * record[0], noise.phase if noise.has_phase else None)


def _integrated(bench: Bench, effects: tuple[Effect, ...], noise: Noise) -> Drawn | None:
    """The noise-free record and its gap; None without a steady state, without a gap, or where one effect would do."""
    try:
        cells = _cells(true_record(*applied(effects, bench)), noise)
    except NoSteadyStateError:
        return None
    each: tuple[float, ...] = ()
    if len(effects) > 1:
        each = tuple(gap(cells, bench, (*effects[:n], *effects[n + 1 :]), reshape=True) for n in range(len(effects)))
        if min(each) < LEAST_OF_EACH:
            return None
    size = gap(cells, bench)
    if effects and size < SINGLE_GAPS[0]:
        return None
    return Drawn(bench, effects, noise, cells, size, each)
