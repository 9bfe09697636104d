"""``damping rank``: candidate damping laws of a record, best first (form ``rank/1``).

``damping extrapolate``: resonant amplitude beyond the test, with bands (form ``loads/1``).
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import damping
from damping.extrapolation import LEAST_WEIGHT, check_loads
from damping.extrapolation.prediction import PARTS
from damping.ranking import Candidate
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping.result import LoadsResult, RankingResult
from damping_pipelines.check import report_findings
from damping_pipelines.store import refuse_inputs, write_plain
from damping_pipelines.terminal import Notes, console, number, plain_table, progress, show_cautions


def rank(
    record: Path, mode: Path, json_out: str | None, seed: int, max_size: int, despite: Collection[str] = ()
) -> None:
    """Rank the candidates of a record, print the table and write the form."""
    refuse_inputs("--json", json_out, record, mode)
    read, described = load(record, mode, max_size)
    report_findings(read, described, despite)
    ranking = damping.rank(read, described, seed=seed, despite=despite, progress=progress)
    if json_out is not None:
        write_plain(json_out, ranking.to_json())
    if json_out != "-":
        print_ranking(ranking, described)


def load(record: Path, mode: Path, max_size: int) -> tuple[Record, Mode]:
    """Read and check both files before any work."""
    return read_record(record, max_size=max_size), read_mode(mode, max_size=max_size)


def print_ranking(result: RankingResult, mode: Mode) -> None:
    """The table for people."""
    out, notes = console(), Notes()
    units = ", ".join(unit for unit in (mode.units.force, mode.units.length, mode.units.time) if unit)
    headings = ("avg |%|", "held-out %", "score", "weight", "notes")
    table = plain_table(f"{mode.name}: damping laws, best first", headings, ("", "law: coefficient (T-ratio)"))
    numbers = result.table[["average_absolute_percent", "held_out_error", "score"]].to_numpy(float)
    shown = [(c, row) for c, row in zip(result.ranking.candidates, numbers, strict=True) if c.weight > LEAST_WEIGHT]
    if result.ranking.fit.sentence:
        out.print(result.ranking.fit.sentence.capitalize(), style="bold red")
    for c, errors in shown:
        table.add_row(
            "-" if c.rank is None else str(c.rank),
            _describe_law(c),
            *(number(x) for x in errors),
            f"{c.weight:.3f}",
            notes.numbers(c.cautions),
        )
    out.print(table)
    criterion = result.ranking.criterion
    out.print(f"Criterion: {criterion}. Units: {units or 'one consistent system'}.", highlight=False)
    rest = len(result) - len(shown)
    out.print(f"{rest} further laws weigh less than {LEAST_WEIGHT:.0%} or nothing: --json lists them", highlight=False)
    notes.show(out)
    show_cautions(out, result.cautions)


def _describe_law(c: Candidate) -> str:
    """Each parameter with its T-ratio on a line, and how many laws predict the same."""
    if not c.coefficients:
        return c.name
    lines = [f"{x.force} {x.shape}".strip() + f": {number(x.value)} ({number(x.t_ratio)})" for x in c.coefficients]
    if c.equivalents:
        more = f" and {len(c.equivalents) - 1} more" if len(c.equivalents) > 1 else ""
        lines.append(f"  same as {c.equivalents[0]}{more}")
    return "\n".join(lines)


def extrapolate(
    record: Path,
    mode: Path,
    forces: list[float],
    level: float,
    json_out: str | None,
    seed: int,
    max_size: int,
    despite: Collection[str] = (),
) -> None:
    """Predict resonant amplitudes at design forces, print the table and write the form."""
    refuse_inputs("--json", json_out, record, mode)
    check_loads(forces, level)
    read, described = load(record, mode, max_size)
    report_findings(read, described, despite)
    loads = damping.extrapolate(read, described, forces, level, seed=seed, despite=despite, progress=progress)
    if json_out is not None:
        write_plain(json_out, loads.to_json())
    if json_out != "-":
        print_loads(loads)


def print_loads(result: LoadsResult) -> None:
    """The table for people, with the parts of the spread and what the weights rest on."""
    out, notes, mode = console(), Notes(), result.mode
    loads, plan = result.extrapolation.loads, result.extrapolation.plan
    length = f" [{mode.units.length}]" if mode.units.length else ""
    headings = ("force", "times tested", "median", "low", "high", "linear", "linear over by %", "notes")
    table = plain_table(f"{mode.name}: resonant amplitude{length}", headings)
    shares = plain_table(
        "Standard deviations in that, % of amplitude", ("force", *(p.replace("_", " ") for p in PARTS))
    )
    for row, cautions in zip(result.table.to_dict("records"), loads.cautions, strict=True):
        over, low, high = (number(row[f"linear_overprediction_{end}"], 3) for end in ("percent", "low", "high"))
        table.add_row(
            f"{row['force']:g}",
            f"{row['extrapolation_ratio']:.2f}",
            *(number(row[name]) for name in ("median", "low", "high", "linear")),
            f"{over} ({low} to {high})",
            notes.numbers(cautions),
        )
        shares.add_row(f"{row['force']:g}", *(number(row[f"sd_percent_{name}"], 2) for name in PARTS))
    out.print(table)
    out.print(f"low to high: {100 * loads.level:g} % predictive band, averaged over models by weight.", highlight=False)
    out.print(shares)
    laws = ", ".join(f"{band.name} {band.weight:.2f}" for band in loads.by_model)
    out.print(f"Laws by weight: {laws}.", highlight=False)
    if len(plan.trend.p):
        exponents = ", ".join(f"{p:.2f} ± {sd:.2f}" for p, sd in zip(plan.trend.p, plan.trend.sd, strict=True))
        out.print(f"Local exponent p = d ln F/d ln A, from level to level: {exponents}.", highlight=False)
    _print_what_if(result)
    notes.show(out)
    show_cautions(out, result.cautions)


def _print_what_if(result: LoadsResult) -> None:
    """Bands with other priors, and what to test next."""
    out, further = console(), result.extrapolation.choose_next_level()
    varied, forces = result.extrapolation.vary_priors(), result.extrapolation.loads.force
    table = plain_table("The same with other priors", ("prior", "times", *(f"{force:g}" for force in forces)))
    for (prior, factor), rows in varied.groupby(["prior", "factor"], sort=False):
        ends = rows[["median", "low", "high"]].to_numpy(float)
        bands = (f"{number(median)} ({number(low)} to {number(high)})" for median, low, high in ends)
        table.add_row(str(prior), f"{factor:.2g}", *bands)
    out.print(table)
    if further is not None:
        out.print(
            f"One more level would shrink the band at {further.design:g} most at the force {further.force:.4g}: from "
            f"high/low {further.width:.2f} to {further.expected:.2f} expected.",
            highlight=False,
        )
