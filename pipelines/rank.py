"""``damping rank``: candidate damping laws of a record, best first (form ``rank/1``)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from pipelines.progress import progress
from pipelines.store import write_json
from selection.compare.candidates import candidate_laws
from selection.compare.ranking import Candidate, Ranking, rank_laws
from selection.posterior.observations import Observations, observe
from selection.records.mode import Mode, read_mode
from selection.records.reading import read_record


def rank(record: Path, mode: Path, json_out: str | None, seed: int, max_size: int) -> None:
    """Rank the candidates of a record, print the table and write the form."""
    data, read = load(record, mode, max_size)
    ranking = rank_record(data, seed)
    if json_out is not None:
        write_json(json_out, rank_form(ranking))
    if json_out != "-":
        print_ranking(ranking, read, Console())


def load(record: Path, mode: Path, max_size: int) -> tuple[Observations, Mode]:
    """Read and check both files before any work."""
    read = read_record(record, max_size=max_size)
    described = read_mode(mode, max_size=max_size)
    return observe(read), described


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


def print_ranking(ranking: Ranking, mode: Mode, console: Console) -> None:
    """The table for people, cautions as notes below it."""
    units = ", ".join(unit for unit in (mode.units.force, mode.units.length, mode.units.time) if unit)
    table = Table(title=f"{mode.name}: damping laws, best first", box=SIMPLE)
    left = ("law: coefficients (T-ratio)",)
    for heading in ("", *left, "avg |%|", "held-out %", "score", "weight", "notes"):
        table.add_column(heading, justify="left" if heading in left else "right")
    notes: dict[str, int] = {}
    for c in ranking.candidates:
        numbers = [notes.setdefault(caution, len(notes) + 1) for caution in c.cautions]
        table.add_row(
            "-" if c.rank is None else str(c.rank),
            _law(c),
            *(_number(x) for x in (c.average_absolute_percent, c.held_out_error, c.score)),
            f"{c.weight:.3f}",
            " ".join(str(number) for number in numbers),
        )
    console.print(table)
    console.print(f"Criterion: {ranking.criterion}. Units: {units or 'one consistent system'}.", highlight=False)
    for note, number in notes.items():
        console.print(f"{number:3d}  {note}", highlight=False)


def _law(c: Candidate) -> str:
    """Forces with coefficients and T-ratios in one line each."""
    if not c.coefficients:
        return c.name
    return "\n".join(
        f"{x.force} {x.shape}".strip() + f": {_number(x.value)} ({_number(x.t_ratio)})" for x in c.coefficients
    )


def _number(value: float) -> str:
    """Four digits; a dash for a number that does not exist."""
    return f"{value:.4g}" if value == value else "-"
