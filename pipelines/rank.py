"""``damping rank``: candidate damping laws of a record, best first (form ``rank/1``)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pipelines.progress import progress
from pipelines.store import refuse_inputs, write_json
from pipelines.tables import Notes, console, number, plain_table, show_cautions
from selection.compare.candidates import candidate_laws
from selection.compare.ranking import Candidate, Ranking, rank_laws
from selection.posterior.observations import Observations, observe
from selection.records.mode import Mode, read_mode
from selection.records.reading import read_record
from selection.units import RAD_S_PER_HZ

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
