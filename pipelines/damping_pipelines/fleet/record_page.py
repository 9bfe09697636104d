"""The page of one record of a fleet: law, design loads and diagnosis in short, with what they rest on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import Loads
from damping.gap.diagnose import Diagnosis
from damping.infer.observations import Observations
from damping.plots import identifier, to_svg
from damping.plots.curves import design_loads
from damping.ranking import Ranking
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
from damping.report.gap_page import describe_following, describe_verdict, list_doubts, place, reach
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
    describe_page,
)


@dataclass(frozen=True)
class FleetRecord:
    """What became of a record; a stage that was not asked for or failed is None.

    Attributes:
        method: how posteriors were had. bands: over a grid of forces, None where they were not wanted.
        gap_report: address of the diagnosis' own page. findings: of the audit. reasons: of stages that failed.
        own_forces: whether design forces are multiples of the record's own largest force.
    """

    name: str
    mode: Mode
    record: Record
    data: Observations
    method: str
    ranking: Ranking | None
    design: Loads | None
    bands: Loads | None
    diagnosis: Diagnosis | None
    gap_report: str
    findings: tuple[str, ...]
    reasons: tuple[str, ...]
    own_forces: bool
    seed: int
    versions: Mapping[str, str]
    inputs: Mapping[str, str]


def record_page(record: FleetRecord) -> str:
    """The page as HTML. Equal arguments give equal text."""
    sections = [Section("answer", "The answer first", _answer(record))]
    if record.ranking:
        sections.append(Section("law", "Which law", _build_law(record.ranking)))
    if record.design:
        sections.append(Section("loads", "Design loads", _build_loads(record, record.design)))
    if record.diagnosis:
        sections.append(Section("gap", "The gap to the simulation", _build_gap(record.diagnosis, record.gap_report)))
    sections.append(Section("basis", "What this rests on", _build_basis(record)))
    if record.findings:
        sections.insert(0, Section("audit", "Is the record what it seems?", [List(record.findings)]))
    return describe_page(record.name, sections, Footer(record.seed, record.versions, record.inputs))


def describe_failed_page(
    name: str, reason: str, method: str, seed: int, versions: Mapping[str, str], inputs: Mapping[str, str]
) -> str:
    """The page of a record of which nothing could be done."""
    blocks: list[Block] = [Callout("This record failed", [reason]), Text(f"Posteriors were to be had by {method}.")]
    return describe_page(name, [Section("answer", "No answer", blocks), _build_back()], Footer(seed, versions, inputs))


def _build_back() -> Section:
    return Section("fleet", "The fleet", [Links([Link("Summary of all records", "../fleet.html")])])


def _answer(record: FleetRecord) -> list[Block]:
    blocks: list[Block] = []
    facts = []
    if record.ranking:
        best = max(record.ranking.candidates, key=lambda candidate: candidate.weight)
        facts.append((best.name, f"law of largest weight ({format_share(best.weight)})"))
    if record.design:
        i, unit = int(record.design.force.argmax()), record.mode.units
        average = record.design.average
        facts.append(
            (
                format_quantity(average.median[i], unit.length),
                f"resonant amplitude at {format_force_text(record.design.force[i], unit.force)}, "
                f"{format_between(average.low[i], average.high[i])}",
            )
        )
        facts.append((format_signed(record.design.overprediction[i]), "linear damping over that"))
    if facts:
        blocks.append(Facts(facts))
    if record.diagnosis:
        blocks.append(Text(describe_verdict(record.diagnosis), lead=True))
    if record.reasons:
        blocks.append(Callout("What could not be done", record.reasons))
    return blocks


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
    formats = {
        "weight": format_share,
        "held_out_error": format_percent,
        "average_absolute_percent": format_percent,
        "score": _describe_one_decimal,
    }
    frame = pd.DataFrame(rows).astype({"rank": "Int64"})
    if frame["held_out_error"].isna().all():  # not asked for, or one level
        frame = frame.drop(columns="held_out_error")
    caption = f"Every candidate, sorted by {ranking.criterion}. Coefficients are least squares, free to be negative."
    return [Table(frame, caption, formats, headings)]


def _describe_one_decimal(value: float) -> str:
    return f"{value:.1f}".replace("-", "−") if np.isfinite(value) else "–"


def _build_loads(record: FleetRecord, design: Loads) -> list[Block]:
    blocks: list[Block] = []
    if record.own_forces:
        blocks.append(
            Text("No design force was asked for: these are multiples of the largest tested force of this record.")
        )
    if record.bands is not None and np.isfinite(design.average.median).any():
        blocks.append(_figure(record, design, record.bands))
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
    blocks.append(
        Table(
            frame,
            f"Resonant amplitude at the design forces, averaged over models by weight; {record.mode.units}.",
            {"force": lambda force: f"{force:.6g}", "over": format_signed},
            headings,
        )
    )
    weights = pd.DataFrame(
        {"law": [b.name for b in design.by_model], "weight": [b.weight for b in design.by_model]}
        | {
            f"at {format_force_text(force, record.mode.units.force)}": [
                f"{number(b.median[i])} ({format_between(b.low[i], b.high[i])})" for b in design.by_model
            ]
            for i, force in enumerate(design.force)
        }
    )
    blocks.append(
        Table(weights, "Laws that take part, each with its own median and interval", {"weight": format_share})
    )
    return blocks


def _figure(record: FleetRecord, design: Loads, bands: Loads) -> FigureBlock:
    data, units = record.data, record.mode.units
    tested = pd.DataFrame({"sweep": data.sweeps, "force": data.tested_force, "amplitude": data.tested_amplitude})
    drawn = design_loads(
        forms.tabulate_loads(bands),
        tested,
        forms.tabulate_loads(design),
        bands.level,
        units.force,
        units.length,
        bands.limit,
    )
    said = f"Resonant amplitude against force, tested and beyond, with {100 * bands.level:g} per cent bands."
    return FigureBlock(to_svg(drawn, identifier(record.name), f"{record.name}: design loads", said), said)


def _build_gap(diagnosis: Diagnosis, gap_report: str) -> list[Block]:
    said = [place(diagnosis), *list_doubts(diagnosis), reach(diagnosis)]
    rows = [{"explanation": " + ".join(e.effects) or "no effect", "p": e.probability} for e in diagnosis.explanations]
    return [
        List([*said, describe_following(diagnosis)]),
        Table(pd.DataFrame(rows), "Explanations, most probable first", {"p": format_share}, {"p": "probability"}),
        *([Callout("Cautions", diagnosis.cautions)] if diagnosis.cautions else []),
        Links([Link("The whole diagnosis", gap_report)]),
    ]


def _build_basis(record: FleetRecord) -> list[Block]:
    data = record.data
    spoken = [
        f"{count(len(record.record), 'row')} in {count(len(data.sweeps), 'sweep')}; {record.mode.units}.",
        f"Tested from {number(data.tested_force.min())} to {number(data.tested_force.max())}.",
        f"Posteriors by {record.method}" + (", without errors of levels held out." if record.bands is None else "."),
    ]
    return [List(spoken), Links([Link("Summary of all records", "../fleet.html")])]
