"""``damping rank``: candidate damping laws of a record, best first (form ``rank/1``).

``damping extrapolate``: resonant amplitude beyond the test, with bands (form ``loads/1``).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damping import extrapolation as members
from damping.arrays import RAD_S_PER_HZ
from damping.errors import InputError
from damping.extrapolation import LEAST_WEIGHT
from damping.extrapolation.near import near_resonance
from damping.extrapolation.plan import Plan, load_candidates, plan_loads
from damping.extrapolation.prediction import PARTS, Loads, Member, predict
from damping.infer.observations import Observations, observe
from damping.predict.sweep_rate import as_steady
from damping.ranking import Candidate, Ranking, rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping_pipelines.store import refuse_inputs, write_json
from damping_pipelines.terminal import Notes, console, number, plain_table, progress, show_cautions

#: Factor between the frequency of a mode and the tested ones from which on a mistake of units is likely (2 pi is one).
_FAR = 1.5


def rank(record: Path, mode: Path, json_out: str | None, seed: int, max_size: int) -> None:
    """Rank the candidates of a record, print the table and write the form."""
    refuse_inputs("--json", json_out, record, mode)
    data, read = load(record, mode, max_size)
    ranking = rank_record(data, seed)
    if json_out is not None:
        write_json(json_out, {**rank_form(ranking), "cautions": mode_cautions(data, read)})
    if json_out != "-":
        print_ranking(ranking, read, mode_cautions(data, read))


def load(record: Path, mode: Path, max_size: int) -> tuple[Observations, Mode]:
    """Read and check both files before any work."""
    read = read_record(record, max_size=max_size)
    described = read_mode(mode, max_size=max_size)
    return observe(read), described


def mode_cautions(data: Observations, mode: Mode) -> list[str]:
    """What is odd about the mode beside the record: nothing, or a frequency far from every tested one."""
    low, high = (float(omega) / RAD_S_PER_HZ for omega in (data.omega.min(), data.omega.max()))
    if low / _FAR <= mode.frequency <= high * _FAR:
        return []
    tested = f"{low:.4g}" if low == high else f"{low:.4g} to {high:.4g}"
    return [f"the mode's frequency, {mode.frequency:.4g} Hz, is far from those of the record, {tested} Hz"]


def rank_record(data: Observations, seed: int) -> Ranking:
    """Rank with progress shown."""
    laws = candidate_laws(data)
    with progress("ranking", len(laws)) as done:
        return rank_laws(data, seed, laws, done)


def rank_form(ranking: Ranking) -> dict[str, Any]:
    """The form ``rank/1``; shape parameters and further criteria are extra keys."""
    return {
        "format": "rank/1",
        "criterion": ranking.criterion,
        "models": [_model(candidate) for candidate in ranking.candidates],
    }


def _model(candidate: Candidate) -> dict[str, Any]:
    fit = candidate.fit
    return {
        "rank": candidate.rank,
        "name": candidate.name,
        "forces": _forces(candidate),
        "score": candidate.score,
        "weight": candidate.weight,
        "held_out_error": candidate.held_out_error,
        "average_absolute_percent": candidate.average_absolute_percent,
        "physical": candidate.physical,
        "cautions": list(candidate.cautions),
        "aic": fit.aic if fit else None,
        "aicc": fit.aicc if fit else None,
        "bic": fit.bic if fit else None,
    }


def _forces(candidate: Candidate) -> list[dict[str, Any]]:
    """One entry a force; its shape parameters are nested by name."""
    entries: list[dict[str, Any]] = []
    for c in candidate.coefficients:
        numbers = {"std_error": c.std_error, "t_ratio": c.t_ratio, "low": c.low, "high": c.high}
        if c.shape:
            owner = next(entry for entry in entries if entry["name"] == c.force)
            owner[c.shape] = {"value": c.value, **numbers}
        else:
            entries.append({"name": c.force, "coefficient": c.value, **numbers})
    return entries or [{"name": name, "coefficient": None, **_NOTHING} for name in candidate.law.components]


_NOTHING = dict.fromkeys(("std_error", "t_ratio", "low", "high"))


def print_ranking(ranking: Ranking, mode: Mode, cautions: Sequence[str] = ()) -> None:
    """The table for people, with ``cautions`` about the whole of it."""
    out, notes = console(), Notes()
    units = ", ".join(unit for unit in (mode.units.force, mode.units.length, mode.units.time) if unit)
    headings = ("avg |%|", "held-out %", "score", "weight", "notes")
    table = plain_table(f"{mode.name}: damping laws, best first", headings, ("", "law: coefficient (T-ratio)"))
    for c in ranking.candidates:
        table.add_row(
            "-" if c.rank is None else str(c.rank),
            _law(c),
            *(number(x) for x in (c.average_absolute_percent, c.held_out_error, c.score)),
            f"{c.weight:.3f}",
            notes.numbers(c.cautions),
        )
    out.print(table)
    out.print(f"Criterion: {ranking.criterion}. Units: {units or 'one consistent system'}.", highlight=False)
    notes.show(out)
    show_cautions(out, cautions)


def _law(c: Candidate) -> str:
    """Each parameter with its T-ratio on a line."""
    if not c.coefficients:
        return c.name
    return "\n".join(
        f"{x.force} {x.shape}".strip() + f": {number(x.value)} ({number(x.t_ratio)})" for x in c.coefficients
    )


def extrapolate(
    record: Path, mode: Path, forces: list[float], level: float, json_out: str | None, seed: int, max_size: int
) -> None:
    """Predict resonant amplitudes at design forces, print the table and write the form."""
    refuse_inputs("--json", json_out, record, mode)
    check_forces(forces, level)
    read, described = read_record(record, max_size=max_size), read_mode(mode, max_size=max_size)
    read, swept = as_steady(read, described.mass, described.frequency)
    data = near_resonance(read)
    plan = plan_record(data, described, seed)
    sampled = sample_members(plan, np.array(forces), seed)
    repeatability = described.repeatability.amplitude or 0.0
    loads = predict(sampled, np.array(forces), data, level, seed, plan, repeatability)
    cautions = [*swept, *mode_cautions(data, described)]
    if json_out is not None:
        write_json(json_out, {**loads_form(loads), **plan_form(plan), "cautions": cautions})
    if json_out != "-":
        _print(loads, plan, described, cautions)


def check_forces(forces: list[float], level: float) -> None:
    """InputError unless forces are positive numbers and the level lies strictly between 0 and 1."""
    for force in forces:
        if not (math.isfinite(force) and force > 0.0):
            raise InputError(f"--force {force:g}", expected="a force amplitude > 0")
    if not 0.0 < level < 1.0:
        raise InputError(f"--level {level:g}", expected="a probability between 0 and 1, such as 0.9")


def plan_record(data: Observations, mode: Mode, seed: int) -> Plan:
    """Choose and weigh laws, with progress shown."""
    laws = load_candidates(data)
    with progress("weighing laws", len(laws)) as done:
        return plan_loads(data, laws, seed, done, mode.mass)


def sample_members(plan: Plan, forces: np.ndarray, seed: int) -> list[Member]:
    """Sample every law with weight (:func:`damping.extrapolation.sample_members`), with progress shown."""
    with progress("sampling", sum(law.weight > LEAST_WEIGHT for law in plan.laws)) as done:
        return members.sample_members(plan, forces, seed, done)


def loads_form(loads: Loads) -> dict[str, Any]:
    """The form ``loads/1``; credible bands and the parts of the predictive spread (per cent) are extra keys."""
    predictions = []
    for i, force in enumerate(loads.force):
        predictions.append(
            {
                "force": force,
                "median": loads.average.median[i],
                "low": loads.average.low[i],
                "high": loads.average.high[i],
                "credible_low": loads.average.credible_low[i],
                "credible_high": loads.average.credible_high[i],
                "parts_percent": {name: part[i] for name, part in loads.parts.items()},
                "linear": loads.linear[i],
                "linear_overprediction_percent": loads.overprediction[i],
                "linear_overprediction_low": loads.overprediction_low[i],
                "linear_overprediction_high": loads.overprediction_high[i],
                "extrapolation_ratio": loads.ratio[i],
                "cautions": list(loads.cautions[i]),
                "by_model": [
                    {"name": b.name, "weight": b.weight, "median": b.median[i], "low": b.low[i], "high": b.high[i]}
                    for b in loads.by_model
                ],
            }
        )
    return {"format": "loads/1", "level": loads.level, "predictions": predictions}


def plan_form(plan: Plan) -> dict[str, Any]:
    """Extra keys of ``loads/1``: what the weights rest on, the local exponents, the limit."""
    p = plan.trend
    exponents = [{"force": force, "p": value, "sd": sd} for force, value, sd in zip(p.force, p.p, p.sd, strict=True)]
    return {"held_out_levels": plan.held_out, "local_exponents": exponents, "limit": plan.limit}


def _print(loads: Loads, plan: Plan, mode: Mode, cautions: Sequence[str]) -> None:
    out, notes = console(), Notes()
    length = f" [{mode.units.length}]" if mode.units.length else ""
    headings = ("force", "times tested", "median", "low", "high", "linear", "linear over by %", "notes")
    table = plain_table(f"{mode.name}: resonant amplitude{length}", headings)
    shares = plain_table(
        "Standard deviations in that, % of amplitude", ("force", *(p.replace("_", " ") for p in PARTS))
    )
    for i, force in enumerate(loads.force):
        over = f"{number(loads.overprediction[i], 3)} ({number(loads.overprediction_low[i], 3)} to "
        table.add_row(
            f"{force:g}",
            f"{loads.ratio[i]:.2f}",
            *(number(band[i]) for band in (loads.average.median, loads.average.low, loads.average.high, loads.linear)),
            over + f"{number(loads.overprediction_high[i], 3)})",
            notes.numbers(loads.cautions[i]),
        )
        shares.add_row(f"{force:g}", *(number(loads.parts[name][i], 2) for name in PARTS))
    out.print(table)
    out.print(f"low to high: {100 * loads.level:g} % predictive band, averaged over models by weight.", highlight=False)
    out.print(shares)
    laws = ", ".join(f"{band.name} {band.weight:.2f}" for band in loads.by_model)
    held = f"{plan.held_out} level{'s' * (plan.held_out != 1)} held out"
    out.print(f"Laws by weight ({held}): {laws}.", highlight=False)
    if len(plan.trend.p):
        exponents = ", ".join(f"{p:.2f} ± {sd:.2f}" for p, sd in zip(plan.trend.p, plan.trend.sd, strict=True))
        out.print(f"Local exponent p = d ln F/d ln A, from level to level: {exponents}.", highlight=False)
    notes.show(out)
    show_cautions(out, cautions)
