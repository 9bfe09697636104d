"""Blind cases for the gap diagnosis: true structures integrated in time, measured by an imperfect rig.

This package shares no code with what diagnoses its cases: it imports numpy, scipy and itself alone.

How many cases of which kind, and the seeds of development and of the blind run.

Draws of a case: its effects at sizes spread over the gaps, its noise-free record, and what its gap is.

One blind case: a kind and a seed in, the texts of its two files and its label out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damping_validation.generator.forces import TrueEffect
from damping_validation.generator.noise import (
    Noise,
    columns,
    describe_data_text,
    describe_model_text,
    draw_noise,
    measured,
)
from damping_validation.generator.plan import Bench, Generator, draw_bench, log_uniform, without_base
from damping_validation.generator.refit import (
    FORCES,
    INSTRUMENT,
    LIBRARY,
    OUTSIDE,
    STRUCTURE,
    RecordCells,
    applied,
    draw_effect,
    gap,
    nearest_imitation,
    predicted,
    unscattered,
)
from damping_validation.generator.steady import NoSteadyStateError, true_record
from damping_validation.generator.structure import Array

__all__ = ["BlindCase", "Stratum", "draw_case", "strata"]


#: Seeds differ so that nothing chosen while developing has seen a blind case.
DEVELOPMENT_SEED = 20250
BLIND_SEED = 86400077
BLIND_CASES = 1500

NULLS = ("null:nothing", "null:parameters", "null:scatter")
PAIRS = ("pair:force-instrument", "pair:two-forces", "pair:force-structure")

#: Shares of the cases of a run; at 1500 cases 510 are null and each effect of the library has some 36.
SHARES = {"null": 0.34, "single": 0.36, "pair": 0.12, "outside": 0.18}
_KINDS = {"null": NULLS, "single": LIBRARY, "pair": PAIRS, "outside": OUTSIDE}


@dataclass(frozen=True)
class Stratum:
    """One case to draw: its kind and conditions."""

    kind: str
    field: bool


def strata(cases: int, kinds: tuple[str, ...] | None = None) -> list[Stratum]:
    """``cases`` strata, clean and field by turns within each kind; ``kinds`` alone in equal parts where given."""
    if kinds is not None:
        places = [divmod(n, len(kinds)) for n in range(cases)]
        return [Stratum(kinds[kind], (turn + kind) % 2 == 1) for turn, kind in places]
    plan: list[Stratum] = []
    left = cases
    for number, (family, share) in enumerate(SHARES.items()):
        count = left if number == len(SHARES) - 1 else min(left, round(share * cases))
        plan += strata(count, _KINDS[family])
        left -= count
    return plan


#: Gap of a single effect, sigma: from what cannot be seen to what nobody misses.
SINGLE_GAPS = (0.3, 30.0)
#: Gap of each of a pair alone, sigma.
PAIR_GAPS = (1.0, 12.0)
#: What a record of a pair leaves, in sigma, to either effect alone: less, and it does not show that there are two.
LEAST_OF_EACH = 1.0

#: Structures drawn until one gives a case of the kind that is wanted.
_DRAWS = 400
#: Sizes of an effect tried until its gap is the one that was drawn.
_TRIALS = 14
#: ln of the largest over the smallest size tried.
_LOG_RANGE = 12.0
#: ln of the gap over the one drawn at which a size is taken.
_NEAR = 0.05
#: Gap, sigma, that stands for none where its logarithm is taken.
_NOTHING = 1e-9
_MAY_SCATTER = {"null:nothing": False, "null:parameters": False, "null:scatter": True}


@dataclass(frozen=True)
class DrawnCase:
    """Everything of a case but its noise: bench, effects, noise-free record, its gap, and what each effect explains.

    ``without_each`` is, for a pair, what is left when that effect is taken away and all else refitted.
    """

    bench: Bench
    effects: tuple[TrueEffect, ...]
    noise: Noise
    cells: RecordCells
    gap: float
    without_each: tuple[float, ...]


def draw(kind: str, field: bool, rng: Generator) -> DrawnCase:
    """Draw until a steady state exists and the effect can be made large enough."""
    for _ in range(_DRAWS):
        names = _list_names(kind, rng)
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


def _list_names(kind: str, rng: Generator) -> tuple[str, ...]:
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


def _sized(
    effect: TrueEffect, bench: Bench, noise: Noise, gaps: tuple[float, float], rng: Generator
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


def _cells(record: tuple[Array, Array], noise: Noise) -> RecordCells:
    """The record with its standard deviations, which go with its own amplitude."""
    return RecordCells(*record, noise.share * record[0], noise.phase if noise.has_phase else None)


def _integrated(bench: Bench, effects: tuple[TrueEffect, ...], noise: Noise) -> DrawnCase | None:
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
    return DrawnCase(bench, effects, noise, cells, size, each)


_WRONG_PARAMETER = {"natural-frequency": 0, "viscous-coefficient": 2}  # place among the deviations
_TELLING = 1.0  # sigma


@dataclass(frozen=True)
class BlindCase:
    """Texts of ``model.toml`` and ``data.csv``, and the label (plain data)."""

    model: str
    data: str
    label: Mapping[str, Any]


def draw_case(kind: str, field: bool, seed: tuple[int, ...], name: str = "case", nearest: bool = False) -> BlindCase:
    """The case of a kind (an effect, ``null:...``, ``pair:...``) in clean or field conditions, decided by its seed.

    ``nearest`` has the label of a single effect with a gap of 1 sigma or more say which other effect of the library
    comes closest, and what it leaves (seconds of work).
    """
    rng = np.random.default_rng(seed)
    drawn = draw(kind, field, rng)
    rows = drawn.bench.rows
    amplitude, phase, wild = measured(rng, drawn.noise, drawn.cells.amplitude, drawn.cells.phase)
    table = columns(rows, drawn.noise, amplitude, phase)
    label = {
        "kind": kind,
        "family": describe_family(kind),
        "conditions": "field" if field else "clean",
        **_effects(drawn),
        **_circumstances(drawn),
        "wild_rows": np.flatnonzero(wild).tolist(),
        "sweep": table["sweep"],
        "frequency": [float(text) for text in table["frequency"]],
        "altered": _altered(drawn),
        "nearest": _nearest(drawn) if nearest and len(drawn.effects) == 1 and drawn.gap >= _TELLING else None,
    }
    return BlindCase(describe_model_text(name, drawn.bench), describe_data_text(table), label)


def describe_family(kind: str) -> str:
    """null, single, pair or outside."""
    if kind.startswith(("null:", "pair:")):
        return kind.split(":")[0]
    return "outside" if kind in OUTSIDE else "single"


def _effects(drawn: DrawnCase) -> dict[str, Any]:
    return {
        "effects": [effect.name for effect in drawn.effects],
        "gap": drawn.gap,
        "left_without_each": list(drawn.without_each),
        "sizes": [{"effect": e.name, "size": e.size, "shape": list(e.shape)} for e in drawn.effects],
    }


def _circumstances(drawn: DrawnCase) -> dict[str, Any]:
    bench = drawn.bench
    return {
        "deviation": list(bench.deviation),
        "base": [name for name, _ in bench.base],
        "scatter": list(bench.scatter),
        "scatter_declared": bench.scatter_declared,
        "levels": int(bench.rows.sweep.max()) + 1,
        "rows": int(bench.rows.omega.size),
        "up": bench.rows.up,
        "phase": drawn.noise.has_phase,
        "sd": drawn.noise.shown,
    }


def _altered(drawn: DrawnCase) -> dict[str, list[int]]:
    """Rows whose noise-free amplitude or phase the effects move by more than one sigma (wrong parameters set right)."""
    if not drawn.effects:
        return {"amplitude": [], "phase": []}
    change = np.abs(drawn.cells.distance(*true_record(*applied((), _without(drawn))))) > 1.0
    n = drawn.bench.rows.omega.size
    return {"amplitude": np.flatnonzero(change[:n]).tolist(), "phase": np.flatnonzero(change[n:]).tolist()}


def _without(drawn: DrawnCase) -> Bench:
    """The bench with its wrong parameters, if that is the effect, at their nominal values."""
    deviation = list(drawn.bench.deviation)
    for effect in drawn.effects:
        if effect.name in _WRONG_PARAMETER:
            deviation[_WRONG_PARAMETER[effect.name]] = 0.0
    return replace(drawn.bench, deviation=(deviation[0], deviation[1], deviation[2]))


def _nearest(drawn: DrawnCase) -> dict[str, Any]:
    name, left = nearest_imitation(drawn.cells, drawn.bench, tuple(effect.name for effect in drawn.effects))
    return {"effect": name, "left": left}
