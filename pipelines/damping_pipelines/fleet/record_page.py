"""The page of one record of a fleet: law, design loads and diagnosis in short, with what they rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.extrapolation.curve import Curve
from damping.extrapolation.plan import Plan
from damping.extrapolation.prediction import Loads
from damping.gap.diagnose import Diagnosis
from damping.infer.observations import Observations
from damping.plots import identifier, to_svg
from damping.plots.curves import design_loads
from damping.ranking import Ranking
from damping.records.audit import Audit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.report import (
    count,
    format_between,
    format_force_text,
    format_percent,
    format_quantity,
    format_share,
    format_signed,
    forms,
    number,
)
from damping.report.gap_page import (
    describe_doubts,
    describe_following,
    describe_place,
    describe_reach,
    describe_verdict,
)
from damping.report.page import (
    Block,
    Callout,
    Facts,
    FigureBlock,
    Footer,
    Link,
    Links,
    List,
    Section,
    Table,
    Text,
    render_page,
)
from damping_pipelines.fleet.dataset import FleetTask

#: The way back.
SUMMARY = Links([Link("Summary of all records", "../fleet.html")])


@dataclass(frozen=True)
class FleetLoads:
    """What extrapolation gave; ``curve``: damping there; ``bands`` over a grid of forces, None with ``--fast``."""

    plan: Plan
    design: Loads
    curve: Curve
    bands: Loads | None


@dataclass(frozen=True)
class FleetRecord:
    """What became of a record; a stage that was not asked for or failed is None, and ``reasons`` say why it failed."""

    task: FleetTask
    record: Record
    mode: Mode
    data: Observations
    audit: Audit
    ranking: Ranking | None = None
    loads: FleetLoads | None = None
    diagnosis: Diagnosis | None = None
    reasons: tuple[str, ...] = ()


def record_page(record: FleetRecord) -> str:
    """The page as HTML. Equal arguments give equal text."""
    sections = [Section("answer", "The answer first", _answer(record))]
    if record.ranking:
        sections.append(Section("law", "Which law", _build_law(record.ranking)))
    if record.loads:
        sections.append(Section("loads", "Design loads", _build_loads(record, record.loads)))
    if record.diagnosis:
        address = f"{record.task.stem.rpartition('/')[2]}-gap.html"
        sections.append(Section("gap", "The gap to the simulation", _build_gap(record.diagnosis, address)))
    sections.append(Section("basis", "What this rests on", _build_basis(record)))
    if record.audit.findings:
        lines = [str(finding) for finding in record.audit.findings]
        sections.insert(0, Section("audit", "Is the record what it seems?", [List(lines)]))
    return _describe_page(record.task, sections)


def describe_failed_page(task: FleetTask, reason: str) -> str:
    """The page of a record of which nothing could be done."""
    method = Text(f"Posteriors were to be had by {task.settings.method}.")
    answer = Section("answer", "No answer", [Callout("This record failed", [reason]), method])
    return _describe_page(task, [answer, Section("fleet", "The fleet", [SUMMARY])])


def _describe_page(task: FleetTask, sections: Sequence[Section]) -> str:
    return render_page(task.name, sections, Footer(task.seed, task.settings.versions, task.inputs))


def _answer(record: FleetRecord) -> list[Block]:
    facts = []
    if record.ranking:
        best = max(record.ranking.candidates, key=lambda candidate: candidate.weight)
        facts.append((best.name, f"law of largest weight ({format_share(best.weight)})"))
    if record.loads:
        design, units = record.loads.design, record.mode.units
        i, average = int(design.force.argmax()), design.average
        band = format_between(average.low[i], average.high[i])
        where = f"resonant amplitude at {format_force_text(design.force[i], units.force)}, {band}"
        facts.append((format_quantity(average.median[i], units.length), where))
        facts.append((format_signed(design.overprediction[i]), "linear damping over that"))
    return [
        *([Facts(facts)] if facts else []),
        *([Text(describe_verdict(record.diagnosis), lead=True)] if record.diagnosis else []),
        *([Callout("What could not be done", record.reasons)] if record.reasons else []),
    ]


def _build_law(ranking: Ranking) -> list[Block]:
    rows = [
        {
            "rank": c.rank,
            "law": c.name,
            "weight": c.weight,
            "score": c.score,
            "held_out_error": c.held_out_error,
            "average_absolute_percent": c.average_absolute_percent,
            "coefficients": "; ".join(f"{x.force} {x.shape}".strip() + f" {number(x.value)}" for x in c.coefficients),
            "cautions": "; ".join(c.cautions),
        }
        for c in ranking.candidates
    ]
    headings = {
        "score": "−2 ln Z",
        "held_out_error": "held-out error (%)",
        "average_absolute_percent": "mean |%|",
    }
    percents = dict.fromkeys(("held_out_error", "average_absolute_percent"), format_percent)
    formats = {"weight": format_share, "score": _describe_one_decimal, **percents}
    frame = pd.DataFrame(rows).astype({"rank": "Int64"})
    if frame["held_out_error"].isna().all():  # not asked for, or one level
        frame = frame.drop(columns="held_out_error")
    caption = f"Every candidate, sorted by {ranking.criterion}. Coefficients are least squares, free to be negative."
    return [Table(frame, caption, formats, headings)]


def _describe_one_decimal(value: float) -> str:
    return f"{value:.1f}".replace("-", "−") if np.isfinite(value) else "–"


def _build_loads(record: FleetRecord, loads: FleetLoads) -> list[Block]:
    design, units = loads.design, record.mode.units
    own = Text("No design force was asked for: these are multiples of the largest tested force of this record.")
    blocks: list[Block] = [] if record.task.settings.forces else [own]
    if loads.bands is not None and np.isfinite(design.average.median).any():
        blocks.append(_draw_loads(record, design, loads.bands))
    average = design.average
    frame = pd.DataFrame(
        {
            "force": design.force,
            "times tested": design.ratio,
            "median": average.median,
            "predictive": [format_between(a, b) for a, b in zip(average.low, average.high, strict=True)],
            "linear": design.linear,
            "over": design.overprediction,
            "cautions": ["; ".join(caution) for caution in design.cautions],
        }
    )
    headings = {"predictive": f"{100 * design.level:g} % predictive", "over": "linear over median"}
    caption = f"Resonant amplitude at the design forces, averaged over models by weight; {units}."
    blocks.append(Table(frame, caption, {"force": lambda force: f"{force:.6g}", "over": format_signed}, headings))
    laws = pd.DataFrame(
        {"law": [b.name for b in design.by_model], "weight": [b.weight for b in design.by_model]}
        | {
            f"at {format_force_text(force, units.force)}": [
                f"{number(b.median[i])} ({format_between(b.low[i], b.high[i])})" for b in design.by_model
            ]
            for i, force in enumerate(design.force)
        }
    )
    caption = "Laws that take part, each with its own median and interval"
    return [*blocks, Table(laws, caption, {"weight": format_share})]


def _draw_loads(record: FleetRecord, design: Loads, bands: Loads) -> FigureBlock:
    data, units, name = record.data, record.mode.units, record.task.name
    tested = pd.DataFrame({"sweep": data.sweeps, "force": data.tested_force, "amplitude": data.tested_amplitude})
    tables = (forms.tabulate_loads(bands), tested, forms.tabulate_loads(design))
    drawn = design_loads(*tables, bands.level, units.force, units.length, bands.limit)
    caption = f"Resonant amplitude against force, tested and beyond, with {100 * bands.level:g} per cent bands."
    return FigureBlock(to_svg(drawn, identifier(name), f"{name}: design loads", caption), caption)


def _build_gap(diagnosis: Diagnosis, address: str) -> list[Block]:
    lines = [
        describe_place(diagnosis),
        *describe_doubts(diagnosis),
        describe_reach(diagnosis),
        describe_following(diagnosis),
    ]
    rows = [{"explanation": " + ".join(e.effects) or "no effect", "p": e.probability} for e in diagnosis.explanations]
    return [
        List(lines),
        Table(pd.DataFrame(rows), "Explanations, most probable first", {"p": format_share}, {"p": "probability"}),
        *([Callout("Cautions", diagnosis.cautions)] if diagnosis.cautions else []),
        Links([Link("The whole diagnosis", address)]),
    ]


def _build_basis(record: FleetRecord) -> list[Block]:
    force, sweeps = record.data.tested_force, record.data.sweeps
    brief = record.loads is None or record.loads.bands is None
    method = record.task.settings.method
    lines = [
        f"{count(len(record.record), 'row')} in {count(len(sweeps), 'sweep')}; {record.mode.units}.",
        f"Tested from {number(force.min())} to {number(force.max())}.",
        f"Posteriors by {method}" + (", without errors of levels held out." if brief else "."),
    ]
    return [List(lines), SUMMARY]
