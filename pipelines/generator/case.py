"""One blind case: a kind and a draw in, the text of its two files and its label out.

What the label calls the gap is computed from the noise-free record integrated in time, less what a refit of the
simulation within its tolerance explains (``refit.gap``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from pipelines.generator.averages import clipped_share
from pipelines.generator.bench import Bench, Generator, draw_bench, log_uniform
from pipelines.generator.effects import (
    FORCES,
    INSTRUMENT,
    KINDS,
    LIBRARY,
    OUTSIDE,
    STRUCTURE,
    Effect,
    applied,
    draw_effect,
)
from pipelines.generator.files import data_text, model_text
from pipelines.generator.laws import Array
from pipelines.generator.noise import Noise, columns, draw_noise, measured
from pipelines.generator.refit import Cells, gap, guess, predicted
from pipelines.generator.steady import NoSteadyStateError, steady
from pipelines.generator.structure import Rows, Structure, recorded

_DRAWS = 200
LOWEST_GAP, HIGHEST_GAP = 0.3, 30.0


@dataclass(frozen=True)
class Case:
    """Texts of ``model.toml`` and ``data.csv``, and the label (plain data)."""

    model: str
    data: str
    label: Mapping[str, Any]


@dataclass(frozen=True)
class Drawn:
    """Everything of a case but the noise: bench, effects, noise-free record and its gaps."""

    bench: Bench
    effects: tuple[Effect, ...]
    noise: Noise
    cells: Cells
    gap: float
    members: tuple[float, ...]


def draw_case(kind: str, field: bool, seed: tuple[int, ...], name: str = "case") -> Case:
    """The case of a kind (an effect, ``pair:...``, ``null:...``) in clean or field conditions, by seed alone."""
    rng = np.random.default_rng(seed)
    drawn = _draw(kind, field, rng)
    cells, rows = drawn.cells, drawn.bench.rows
    amplitude, phase, wild = measured(rng, drawn.noise, cells.amplitude, cells.phase)
    table = columns(rows, drawn.noise, amplitude, phase)
    label = {
        "kind": kind,
        "effects": [effect.name for effect in drawn.effects],
        "family": family(kind),
        "conditions": "field" if field else "clean",
        "gap": drawn.gap,
        "gap_of_each": list(drawn.members),
        "sizes": [{"effect": e.name, "size": e.size, "shape": list(e.shape)} for e in drawn.effects],
        "deviation": list(drawn.bench.deviation),
        "scatter": list(drawn.bench.scatter),
        "scatter_declared": drawn.bench.scatter_declared,
        "levels": int(rows.sweep.max()) + 1,
        "rows": int(rows.omega.size),
        "phase": drawn.noise.has_phase,
        "sd": drawn.noise.shown,
        "wild_rows": np.flatnonzero(wild).tolist(),
        "altered": _altered(drawn),
    }
    return Case(model_text(name, drawn.bench), data_text(table), label)


def family(kind: str) -> str:
    """null, single, pair or outside."""
    if kind.startswith(("null", "pair")):
        return kind.split(":")[0]
    return "outside" if kind in OUTSIDE else "single"


def _draw(kind: str, field: bool, rng: Generator) -> Drawn:
    for _ in range(_DRAWS):
        found = _attempt(kind, field, rng)
        if found is not None:
            return found
    raise RuntimeError(f"no case of kind {kind} in {_DRAWS} draws")


def _attempt(kind: str, field: bool, rng: Generator) -> Drawn | None:
    """One draw; None where no steady state exists or the effect cannot be made large enough."""
    names = _names(kind, rng)
    bench = draw_bench(rng, field, {"null:nothing": False, "null:parameters": False, "null:scatter": True}.get(kind), 2 if len(names) > 1 else 1)  # fmt: skip
    if kind == "null:nothing":
        bench = replace(bench, deviation=(0.0, 0.0, 0.0))
    if any(law.kind == name.removesuffix("-friction") for law in bench.nominal.laws for name in names):
        bench = replace(bench, base=(), nominal=replace(bench.nominal, laws=()))
    effects = tuple(draw_effect(name, rng, bench) for name in names)
    plain = recorded_by_averages((), bench)
    noise = draw_noise(rng, field, plain[0], needs_phase="phase-lag" in names)
    for number in range(len(effects)):
        low = 1.0 if len(effects) > 1 else LOWEST_GAP
        effects = _sized(effects, number, bench, noise, low, 12.0 if len(effects) > 1 else HIGHEST_GAP, rng)
        if not effects:
            return None
    return _integrated(bench, effects, noise, pair=len(effects) > 1)


def _names(kind: str, rng: Generator) -> tuple[str, ...]:
    if kind.startswith("null"):
        return ()
    if not kind.startswith("pair"):
        return (kind,)
    if kind == "pair:two-forces":
        first, second = rng.choice(FORCES, size=2, replace=False)
        return (str(first), str(second))
    other = INSTRUMENT if kind == "pair:force-instrument" else STRUCTURE
    return (str(rng.choice(FORCES)), str(rng.choice(other)))


def recorded_by_averages(effects: tuple[Effect, ...], bench: Bench) -> tuple[Array, Array]:
    """Amplitude and phase of the noise-free record by first-harmonic averages."""
    return predicted(*applied(effects, bench))


def _cells(record: tuple[Array, Array], noise: Noise) -> Cells:
    """Standard deviations in proportion to the record's own amplitude."""
    return Cells(*record, noise.amplitude, noise.phase if noise.has_phase else None)


def _sized(
    effects: tuple[Effect, ...], number: int, bench: Bench, noise: Noise, low: float, high: float, rng: Generator
) -> tuple[Effect, ...]:
    """The effects with that one given a size whose gap (alone, by averages) is log-uniform in low..high; () if it has none."""
    effect = effects[number]

    def gap_at(log_size: float) -> float:
        sized = (replace(effect, size=float(np.exp(log_size))),)
        record = recorded_by_averages(sized, bench)
        return gap(_cells(record, _noise_for(noise, record[0])), bench)

    most = np.log(effect.size)
    largest = gap_at(most)
    if largest < 1.2 * low:
        return ()
    target = log_uniform(rng, low, min(high, largest / 1.05))
    bottom, top = most - 12.0, most
    for _ in range(14):
        middle = (bottom + top) / 2
        here = gap_at(middle)
        if abs(np.log(max(here, 1e-9) / target)) < 0.05:
            break
        bottom, top = (middle, top) if here < target else (bottom, middle)
    return (*effects[:number], replace(effect, size=float(np.exp(middle))), *effects[number + 1 :])


def _noise_for(noise: Noise, A: Array) -> Noise:
    """The same noise on a record of other amplitudes: its standard deviations keep their share of the amplitude."""
    return replace(noise, amplitude=noise.share * A)


def true_record(structure: Structure, rows: Rows) -> tuple[Array, Array]:
    """Amplitude and phase of the noise-free record, integrated in time to the steady state."""
    return recorded(steady(structure, rows, guess(structure, rows)), rows)


def _integrated(bench: Bench, effects: tuple[Effect, ...], noise: Noise, pair: bool) -> Drawn | None:
    """The noise-free record and its gaps; None where no stable steady state is found."""
    try:
        record = true_record(*applied(effects, bench))
    except NoSteadyStateError:
        return None
    noise = _noise_for(noise, record[0])
    cells = _cells(record, noise)
    members = tuple(gap(cells, bench, (*effects[:n], *effects[n + 1 :])) for n in range(len(effects))) if pair else ()
    if pair and min(members) < 1.0:
        return None
    return Drawn(bench, effects, noise, cells, gap(cells, bench), members)


def _altered(drawn: Drawn) -> dict[str, list[int]]:
    """Rows whose noise-free amplitude or phase the effects change by more than one sigma."""
    bench = drawn.bench
    deviation = list(bench.deviation)
    for effect in drawn.effects:
        if effect.name in ("natural-frequency", "viscous-coefficient"):
            deviation[0 if effect.name == "natural-frequency" else 2] = 0.0
    without = replace(bench, deviation=(deviation[0], deviation[1], deviation[2]))
    change = np.abs(drawn.cells.distance(*true_record(*applied((), without)))) > 1.0 if drawn.effects else None
    n = bench.rows.omega.size
    if change is None:
        return {"amplitude": [], "phase": []}
    return {"amplitude": np.flatnonzero(change[:n]).tolist(), "phase": np.flatnonzero(change[n:]).tolist()}
