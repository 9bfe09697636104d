"""One blind case: a kind and a seed in, the texts of its two files and its label out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipelines.generator.bench import Bench
from pipelines.generator.draw import Drawn, draw
from pipelines.generator.effects import OUTSIDE, applied
from pipelines.generator.files import data_text, model_text
from pipelines.generator.noise import columns, measured
from pipelines.generator.refit import nearest_imitation
from pipelines.generator.truth import true_record

_WRONG_PARAMETER = {"natural-frequency": 0, "viscous-coefficient": 2}  # place among the deviations
_TELLING = 1.0  # sigma


@dataclass(frozen=True)
class Case:
    """Texts of ``model.toml`` and ``data.csv``, and the label (plain data)."""

    model: str
    data: str
    label: Mapping[str, Any]


def draw_case(kind: str, field: bool, seed: tuple[int, ...], name: str = "case", nearest: bool = False) -> Case:
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
        "family": family(kind),
        "conditions": "field" if field else "clean",
        **_effects(drawn),
        **_circumstances(drawn),
        "wild_rows": np.flatnonzero(wild).tolist(),
        "sweep": table["sweep"],
        "frequency": [float(text) for text in table["frequency"]],
        "altered": _altered(drawn),
        "nearest": _nearest(drawn) if nearest and len(drawn.effects) == 1 and drawn.gap >= _TELLING else None,
    }
    return Case(model_text(name, drawn.bench), data_text(table), label)


def family(kind: str) -> str:
    """null, single, pair or outside."""
    if kind.startswith(("null:", "pair:")):
        return kind.split(":")[0]
    return "outside" if kind in OUTSIDE else "single"


def _effects(drawn: Drawn) -> dict[str, Any]:
    return {
        "effects": [effect.name for effect in drawn.effects],
        "gap": drawn.gap,
        "left_without_each": list(drawn.without_each),
        "sizes": [{"effect": e.name, "size": e.size, "shape": list(e.shape)} for e in drawn.effects],
    }


def _circumstances(drawn: Drawn) -> dict[str, Any]:
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


def _altered(drawn: Drawn) -> dict[str, list[int]]:
    """Rows whose noise-free amplitude or phase the effects move by more than one sigma (wrong parameters set right)."""
    if not drawn.effects:
        return {"amplitude": [], "phase": []}
    change = np.abs(drawn.cells.distance(*true_record(*applied((), _without(drawn))))) > 1.0
    n = drawn.bench.rows.omega.size
    return {"amplitude": np.flatnonzero(change[:n]).tolist(), "phase": np.flatnonzero(change[n:]).tolist()}


def _without(drawn: Drawn) -> Bench:
    """The bench with its wrong parameters, if that is the effect, at their nominal values."""
    deviation = list(drawn.bench.deviation)
    for effect in drawn.effects:
        if effect.name in _WRONG_PARAMETER:
            deviation[_WRONG_PARAMETER[effect.name]] = 0.0
    return replace(drawn.bench, deviation=(deviation[0], deviation[1], deviation[2]))


def _nearest(drawn: Drawn) -> dict[str, Any]:
    name, left = nearest_imitation(drawn.cells, drawn.bench, tuple(effect.name for effect in drawn.effects))
    return {"effect": name, "left": left}
