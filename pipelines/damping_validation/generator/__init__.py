"""Blind cases for the gap diagnosis: true structures integrated in time, measured by an imperfect rig.

This package shares no code with what diagnoses its cases: it imports numpy, scipy and itself alone.

A kind and a seed determine a case: structure, rig and test are drawn, the effects are sized so that their gaps range
from invisible to obvious, and the record is integrated in time and measured. The output is the texts of the two files
of the case and its label and, for a test that the diagnosis proposes, further rows of the same truth.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damping_validation.generator import plan
from damping_validation.generator.balance import TrueRows, plain_rows, recorded
from damping_validation.generator.refit import LIBRARY, OUTSIDE, RIG, DrawnCase, applied, draw, name_effect
from damping_validation.generator.rig import RIG_KINDS
from damping_validation.generator.steady import NoSteadyStateError, true_phasors, true_record

__all__ = ["BlindCase", "NoSteadyStateError", "Stratum", "draw", "draw_case", "draw_further_rows", "strata"]

BLIND_SEED = 86400077  #: none of development, so that nothing chosen there has seen a blind case

#: Effects of the library that are faults of the rig.
RIG_NAMES = frozenset(name_effect(kind) for kind in RIG_KINDS)

NULLS = ("null:nothing", "null:parameters", "null:scatter", "null:swept")
PAIRS = ("pair:force-instrument", "pair:two-forces", "pair:force-structure")

#: Shares of the cases of a run; at 2000 cases, as in the blind run, 500 are null and each kind has some 18 to 22.
SHARES = {"null": 0.25, "single": 0.35, "pair": 0.10, "outside": 0.30}
_KINDS = {"null": NULLS, "single": LIBRARY, "pair": PAIRS, "outside": OUTSIDE}


@dataclass(frozen=True)
class Stratum:
    """One case to draw: its kind and conditions."""

    kind: str
    field: bool


def strata(cases: int, kinds: tuple[str, ...] | None = None) -> list[Stratum]:
    """``cases`` strata, clean and field by turns within each kind; ``kinds`` alone in equal parts where given.

    Fewer cases than kinds are of kinds spread evenly over them.
    """
    if kinds is not None:
        if cases < len(kinds):
            kinds = tuple(kinds[n * len(kinds) // cases] for n in range(cases))
        places = [divmod(n, len(kinds)) for n in range(cases)]
        return [Stratum(kinds[kind], (turn + kind) % 2 == 1) for turn, kind in places]
    listed: list[Stratum] = []
    left = cases
    for number, (family, share) in enumerate(SHARES.items()):
        count = left if number == len(SHARES) - 1 else min(left, round(share * cases))
        listed += strata(count, _KINDS[family])
        left -= count
    return listed


_WRONG_PARAMETER = {"natural-frequency": 0, "viscous-coefficient": 2}  # place among the deviations


@dataclass(frozen=True)
class BlindCase:
    """Texts of ``model.toml`` and ``data.csv``, and the label (plain data)."""

    model: str
    data: str
    label: Mapping[str, Any]


def draw_case(kind: str, field: bool, seed: tuple[int, ...], name: str = "case") -> BlindCase:
    """The case of a kind (an effect, ``null:...``, ``pair:...``) in clean or field conditions, decided by its seed."""
    rng = np.random.default_rng(seed)
    drawn = draw(kind, field, rng)
    rows = drawn.bench.rows
    amplitude, phase, wild = plan.measured(rng, drawn.noise, drawn.cells.amplitude, drawn.cells.phase)
    truth = applied(drawn.effects, drawn.bench)[1]
    table = plan.columns(rows, drawn.noise, amplitude, phase)
    table |= plan.further_columns(rng, drawn.bench.columns, truth, drawn.third, drawn.across, float(np.max(amplitude)))
    label = {
        "kind": kind,
        "family": next(family for family, kinds in _KINDS.items() if kind in kinds),
        "conditions": "field" if field else "clean",
        **_describe_truth(drawn),
        "wild_rows": np.flatnonzero(wild).tolist(),
        "sweep": table["sweep"],
        "frequency": [float(text) for text in table["frequency"]],
        "altered": _altered(drawn),
    }
    return BlindCase(plan.describe_model_text(name, drawn.bench), plan.describe_data_text(table), label)


def _describe_truth(drawn: DrawnCase) -> dict[str, Any]:
    """Effects with their gaps, and the conditions of the measurement."""
    bench, effects = drawn.bench, drawn.effects
    return {
        "effects": [name_effect(effect.name) for effect in effects],
        "rig": [name_effect(effect.name) for effect in effects if effect.name in RIG],
        "gap": drawn.gap,
        "left_without_each": list(drawn.without_each),
        "sizes": [{"effect": e.name, "size": e.size, "shape": list(e.shape)} for e in effects],
        "deviation": list(bench.deviation),
        "base": [name for name, _ in bench.base],
        "scatter": list(bench.scatter),
        "scatter_declared": bench.scatter_declared,
        "levels": int(bench.rows.sweep.max()) + 1,
        "rows": int(bench.rows.omega.size),
        "up": bench.rows.up,
        "phase": drawn.noise.has_phase,
        "columns": list(bench.columns),
        "sd": drawn.noise.shown,
    }


def _altered(drawn: DrawnCase) -> dict[str, list[int]]:
    """Rows whose noise-free amplitude or phase the effects move by more than one sigma (wrong parameters set right)."""
    if not drawn.effects:
        return {"amplitude": [], "phase": []}
    deviation = list(drawn.bench.deviation)
    for effect in drawn.effects:
        if effect.name in _WRONG_PARAMETER:
            deviation[_WRONG_PARAMETER[effect.name]] = 0.0
    right = replace(drawn.bench, deviation=(deviation[0], deviation[1], deviation[2]))
    change = np.abs(drawn.cells.distance(*true_record(*applied((), right)))) > 1.0
    n = drawn.bench.rows.omega.size
    return {"amplitude": np.flatnonzero(change[:n]).tolist(), "phase": np.flatnonzero(change[n:]).tolist()}


def draw_further_rows(
    kind: str, field: bool, seed: tuple[int, ...], data: str, proposed: Sequence[Mapping[str, Any]], asked: set[str]
) -> str:
    """The text ``data`` of a case with the rows of a proposed test after its own, measured on the same truth.

    ``kind``, ``field``, ``seed``: as the case was drawn. ``proposed``: ``force, frequency_low, frequency_high`` (Hz),
    ``points, added_mass`` of each further sweep. ``asked``: columns that the new rows are to fill.
    NoSteadyStateError: the structure has no steady state under that drive.
    """
    drawn = draw(kind, field, np.random.default_rng(seed))
    rng = np.random.default_rng((*seed, 1))
    old = [line.split(",") for line in data.strip().split("\n")]
    rows = plan.scatter_rows(rng, _plan_further(drawn.bench, proposed), drawn.bench.scatter)
    truth = applied(drawn.effects, drawn.bench, rows)
    first, third, across = true_phasors(*truth)
    own = drawn.noise
    share, phase = (np.full(rows.omega.size, np.median(sd)) for sd in (own.share, own.phase))
    noise = replace(own, share=share, phase=phase, has_phase=own.has_phase or "phase" in asked, wild=0.0)
    table = plan.columns(rows, noise, *plan.measured(rng, noise, *recorded(first, truth[1]))[:2])
    told = asked | ({"added_mass"} if np.any(rows.added) else set())
    wanted = {*drawn.bench.columns, *(name for name, column in _ASKED.items() if column in told)}
    table |= plan.further_columns(rng, tuple(wanted), truth[1], third, across, float(np.max(drawn.cells.amplitude)))
    names = [*old[0], *(name for name in table if name not in old[0])]
    before = [dict(zip(old[0], line, strict=True)) for line in old[1:]]
    after = [dict(zip(table, line, strict=True)) for line in zip(*table.values(), strict=True)]
    every = {name: [row.get(name, _UNSAID.get(name, "")) for row in (*before, *after)] for name in names}
    return plan.describe_data_text(every)


#: Further columns of a bench by a column of the file that asks for them, and what earlier rows say in one.
_ASKED = {"third": "amplitude_3", "across": "amplitude_y", "added": "added_mass", "rate": "sweep_rate", "time": "time"}
_UNSAID = {"added_mass": "0"}


def _plan_further(bench: plan.Bench, proposed: Sequence[Mapping[str, Any]]) -> TrueRows:
    """Rows of the sweeps of a proposed test, after those of the bench and in its direction."""
    last, order = int(bench.rows.sweep.max()), 1 if bench.rows.up else -1
    omega, force, sweep, added = [], [], [], []
    for number, further in enumerate(proposed, start=1):
        count = int(further["points"])
        omega.append(2 * np.pi * np.linspace(further["frequency_low"], further["frequency_high"], count)[::order])
        force.append(np.full(count, float(further["force"])))
        sweep.append(np.full(count, last + number))
        added.append(np.full(count, float(further.get("added_mass") or 0.0)))
    rows = plain_rows(np.concatenate(sweep), np.concatenate(force), np.concatenate(omega), bench.rows.up)
    return replace(rows, added=np.concatenate(added), time=bench.rows.time[-1] + rows.time)
