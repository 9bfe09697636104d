"""The page of one record of a fleet: law, design loads and diagnosis in short, with what they rest on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from damping.extrapolation.curve import Curve
from damping.extrapolation.near import Plan
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
    format_between,
    format_decimals,
    format_force_text,
    format_percent,
    format_quantity,
    format_share,
    format_signed,
    forms,
    number,
)
from damping.report.gap_page import describe_diagnosis
from damping.report.page import (
    Block,
    Callout,
    Facts,
    FigureBlock,
    Footer,
    Link,
    Links,
    Section,
    Table,
    Text,
    render_page,
)
from damping.report.tables import tabulate_by_model
from damping.report.text import write_sections
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
    loads, diagnosis = record.loads, record.diagnosis
    values = {"record": record, "told": describe_diagnosis(diagnosis) if diagnosis else None}
    parts: dict[str, Block] = {"summary": SUMMARY}
    if record.ranking or loads:
        parts["facts"] = _collect_facts(record)
    if record.ranking:
        parts["laws"] = _tabulate_laws(record.ranking)
    if loads:
        parts |= _build_loads(record, loads)
    if diagnosis:
        rows = [(" + ".join(e.effects) or "no effect", e.probability) for e in diagnosis.explanations]
        explanations = pd.DataFrame(rows, columns=["explanation", "p"])
        parts["explanations"] = Table(explanations, "", {"p": format_share}, {"p": "probability"})
        address = f"{record.task.stem.rpartition('/')[2]}-gap.html"
        parts["diagnosis"] = Links([Link("The whole diagnosis", address)])
    return _describe_page(record.task, write_sections(Path(__file__).with_suffix(".txt"), values, parts))


def describe_failed_page(task: FleetTask, reason: str) -> str:
    """The page of a record of which nothing could be done."""
    method = Text(f"Posteriors were to be had by {task.settings.method}.")
    answer = Section("answer", "No answer", [Callout("This record failed", [reason]), method])
    return _describe_page(task, [answer, Section("fleet", "The fleet", [SUMMARY])])


def _describe_page(task: FleetTask, sections: Sequence[Section]) -> str:
    return render_page(task.name, sections, Footer(task.seed, task.settings.versions, task.inputs))


def _collect_facts(record: FleetRecord) -> Facts:
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
    return Facts(facts)


def _tabulate_laws(ranking: Ranking) -> Table:
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
    formats = {"weight": format_share, "score": lambda value: format_decimals(value, 1), **percents}
    frame = pd.DataFrame(rows).astype({"rank": "Int64"})
    if frame["held_out_error"].isna().all():  # not asked for, or one level
        frame = frame.drop(columns="held_out_error")
    return Table(frame, "", formats, headings)


def _build_loads(record: FleetRecord, loads: FleetLoads) -> dict[str, Block]:
    design, units = loads.design, record.mode.units
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
    formats = {"force": lambda force: f"{force:.6g}", "over": format_signed}
    laws = tabulate_by_model(design, units.force).rename(columns={"model": "law"})
    laws.insert(1, "weight", [band.weight for band in design.by_model])
    tables = {
        "loads by force": Table(frame, "", formats, headings),
        "loads by law": Table(laws, "", {"weight": format_share}),
    }
    if loads.bands is None or not np.isfinite(average.median).any():
        return {**tables}
    return {**tables, "loads": _draw_loads(record, design, loads.bands)}


def _draw_loads(record: FleetRecord, design: Loads, bands: Loads) -> FigureBlock:
    data, units, name = record.data, record.mode.units, record.task.name
    tested = pd.DataFrame({"sweep": data.sweeps, "force": data.tested_force, "amplitude": data.tested_amplitude})
    tables = (forms.tabulate_loads(bands), tested, forms.tabulate_loads(design))
    drawn = design_loads(*tables, bands.level, units.force, units.length, bands.limit)
    caption = f"Resonant amplitude against force, tested and beyond, with {100 * bands.level:g} per cent bands."
    return FigureBlock(to_svg(drawn, identifier(name), f"{name}: design loads", caption), caption)
