"""One record from files to its row and its pages: what a worker does. Nothing stays behind, nothing is printed."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from damping import report
from damping.errors import DampingError, escape_control
from damping.extrapolation import predict_record
from damping.extrapolation.curve import Curve, trace_loads
from damping.extrapolation.near import Plan
from damping.extrapolation.prediction import Loads
from damping.extrapolation.prepared import PreparedRecord, prepare_record
from damping.gap.diagnose import Diagnosis, diagnose
from damping.infer.evidence import Estimate, brief_evidence, evidence, remember
from damping.plots import identifier, to_svg
from damping.plots.curves import design_loads
from damping.ranking import Ranking, rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records import audit
from damping.records.mode import Mode
from damping.report import forms, page
from damping.report.gap import describe_diagnosis, render_gap_page, tabulate_hypotheses
from damping.report.tables import describe_coefficients, tabulate_by_model, tabulate_design
from damping_pipelines.fleet.dataset import MULTIPLES, SCHEMA, FleetResult, FleetTask, read_files, row_of
from damping_pipelines.processes import OutOfTimeError, limit_time
from damping_pipelines.store import to_json

#: Forces over which bands are drawn.
_GRID = 40
Made = TypeVar("Made")
#: How the reason of a record begins that was given up: it is tried again when the fleet is run again.
OUT_OF_TIME = "out of time"
#: The way back from the page of a record.
SUMMARY = page.Links([page.Link("Summary of all records", "../fleet.html")])


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
    prepared: PreparedRecord
    ranking: Ranking | None = None
    loads: FleetLoads | None = None
    diagnosis: Diagnosis | None = None
    reasons: tuple[str, ...] = ()


def analyse(task: FleetTask) -> FleetResult:
    """Rank, extrapolate and, where there is a model, diagnose; a stage that cannot be done gives its reason.

    Equal tasks give equal results, wherever and in whatever company they run.
    """
    if task.problem:
        return failed(task, task.problem)
    try:
        with limit_time(task.settings.time_limit):
            return _analyse(task)
    except OutOfTimeError:
        return failed(task, f"{OUT_OF_TIME}: it took more than {task.settings.time_limit:g} s (--time-limit)")


def failed(task: FleetTask, reason: str) -> FleetResult:
    """The row and the page of a record of which nothing could be done."""
    row = row_of(task) | {"reason": reason}
    method = page.Text(f"Posteriors were to be had by {task.settings.method}.")
    answer = page.Section("answer", "No answer", [page.Callout("This record failed", [reason]), method])
    sections = [answer, page.Section("fleet", "The fleet", [SUMMARY])]
    return FleetResult(row, {row["report"]: page.render_page(task.name, sections, _build_footer(task))})


def _analyse(task: FleetTask) -> FleetResult:
    try:
        record, mode = read_files(task)
        findings = audit(record, mode)
        findings.require(task.settings.despite)
        prepared = prepare_record(record, mode, findings)
    except DampingError as error:
        return failed(task, escape_control(str(error)))
    return _complete(FleetRecord(task, prepared))


def _complete(read: FleetRecord) -> FleetResult:
    """The stages of a record, each tried whatever became of the others, as a row and pages."""
    task, prepared, fast = read.task, read.prepared, read.task.settings.fast
    estimate, reasons = remember(brief_evidence if fast else evidence), list[str]()

    def attempt(stage: str, work: Callable[[], Made]) -> Made | None:
        try:
            return work()
        except DampingError as error:
            reasons.append(f"{stage}: {escape_control(str(error))}")
            return None

    rank = partial(rank_laws, prepared.all_rows, task.seed, candidate_laws(), estimate=estimate, hold_out=not fast)
    ranking = attempt("rank", rank)
    loads = attempt("extrapolate", lambda: _predict_loads(read, estimate))
    diagnosed = task.is_model or bool(prepared.mode.damping)
    diagnosis = attempt("gap", lambda: diagnose(prepared.measured.record, prepared.mode)) if diagnosed else None
    record = replace(read, ranking=ranking, loads=loads, diagnosis=diagnosis, reasons=tuple(reasons))
    row = row_of(task) | _columns(record)
    pages = {row["report"]: record_page(record)}
    if diagnosis:
        pages[f"{task.stem}-gap.html"] = render_gap_page(diagnosis, None, _build_footer(task))
    return FleetResult(row, pages)


def _predict_loads(read: FleetRecord, estimate: Estimate) -> FleetLoads:
    task, settings, prepared = read.task, read.task.settings, read.prepared
    asked = np.array(settings.forces), MULTIPLES, settings.level, task.seed
    predicted = predict_record(prepared, *asked, estimate=estimate, fresh=False)
    bands = None
    if not settings.fast:
        tested = prepared.data.tested_force
        ends = 0.8 * tested.min(), 1.05 * max(predicted.loads.force.max(), tested.max())
        bands = predicted.predict_at(np.linspace(*ends, _GRID))
    curve = trace_loads(predicted.loads, prepared.backbone, predicted.plan.data)
    return FleetLoads(predicted.plan, predicted.loads, curve, bands)


def _columns(record: FleetRecord) -> dict[str, Any]:
    """The columns of a record that was read; those of a stage that was not done stay empty."""
    ranking, loads, diagnosis = record.ranking, record.loads, record.diagnosis
    done = [part for part in (ranking, loads, diagnosis) if part is not None]
    columns: dict[str, Any] = _loads_columns(loads) if loads else {}
    if ranking:
        best = max(ranking.candidates, key=lambda candidate: candidate.weight)
        columns |= {name: getattr(best, name) for name in ("weight", "average_absolute_percent", "held_out_error")}
        columns |= {"law": best.name, "rank_form": to_json(forms.rank_form(ranking))}
    if diagnosis:
        parts = ("nominal", "before", "after", "shrinkage")
        columns |= {f"gap_{part}": getattr(diagnosis.gap, part) for part in parts}
        columns["effects"], columns["unexplained"] = list(diagnosis.leading.effects), diagnosis.unexplained
        columns["effects_probability"] = diagnosis.hypotheses[0].probability
        columns["gap_form"] = to_json(forms.gap_form(diagnosis))
    return {
        "mode": record.prepared.mode.name,
        "units_force": record.prepared.mode.units.force,
        "units_length": record.prepared.mode.units.length,
        "rows": len(record.prepared.measured.record),
        "levels": len(record.prepared.all_rows.sweeps),
        "largest_tested_force": record.prepared.all_rows.tested_force.max(),
        "audit": "; ".join(escape_control(str(finding)) for finding in record.prepared.findings.findings),
        **columns,
        "status": "failed" if not done else "partial" if record.reasons else "done",
        "reason": "; ".join(record.reasons),
    }


def _loads_columns(predicted: FleetLoads) -> dict[str, Any]:
    """The prediction at the largest design force with the damping there, and the form."""
    loads, best = predicted.design, predicted.plan.laws[0]
    i = int(loads.force.argmax())
    row = forms.tabulate_loads(loads, predicted.curve).iloc[i]
    return {
        "load_law": best.name,
        "load_weight": best.weight,
        "design_force": row["force"],
        **{name: row[name] for name in SCHEMA.names if name in row},
        "cautions": list(loads.cautions[i]),
        "loads_form": to_json(forms.loads_form(loads, predicted.plan, predicted.curve)),
    }


def record_page(record: FleetRecord) -> str:
    """The page as HTML. Equal arguments give equal text."""
    loads, diagnosis = record.loads, record.diagnosis
    values = {"record": record, "told": describe_diagnosis(diagnosis) if diagnosis else None}
    parts: dict[str, page.Block] = {"summary": SUMMARY}
    if record.ranking or loads:
        parts["facts"] = _collect_facts(record)
    if record.ranking:
        parts["laws"] = _tabulate_laws(record.ranking, record.prepared.mode)
    if loads:
        parts |= _build_loads(record, loads)
    if diagnosis:
        listed = tabulate_hypotheses(diagnosis).query("listed")[["explanation", "probability"]]
        parts["explanations"] = page.Table(listed, "", {"probability": report.format_share})
        address = f"{record.task.stem.rpartition('/')[2]}-gap.html"
        parts["diagnosis"] = page.Links([page.Link("The whole diagnosis", address)])
    sections = page.write_sections(Path(__file__).with_name("record_page.txt"), values, parts)
    return page.render_page(record.task.name, sections, _build_footer(record.task))


def _build_footer(task: FleetTask) -> page.Footer:
    return page.Footer(task.seed, task.settings.versions, task.inputs)


def _collect_facts(record: FleetRecord) -> page.Facts:
    facts = []
    if record.ranking:
        best = max(record.ranking.candidates, key=lambda candidate: candidate.weight)
        facts.append((best.name, f"law of largest weight ({report.format_share(best.weight)})"))
    if record.loads:
        design, units = record.loads.design, record.prepared.mode.units
        i, average = int(design.force.argmax()), design.average
        band = report.format_length_band(average.low[i], average.high[i], units.length)
        where = f"resonant amplitude at {report.format_force_text(design.force[i], units.force)}"
        where += f" ({band}, {100 * design.level:g} % predictive band)"
        facts.append((report.format_length(average.median[i], units.length), where))
        facts.append((report.format_signed(design.overprediction[i]), "linear damping over that"))
    return page.Facts(facts)


def _tabulate_laws(ranking: Ranking, mode: Mode) -> page.Table:
    frame = forms.tabulate_candidates(ranking).drop(columns=["score_standard_error", "physical", "equivalents"])
    texts = [describe_coefficients(candidate, mode.units) for candidate in ranking.candidates]
    frame.insert(len(frame.columns) - 1, "coefficients", texts)
    headings = {"score": "−2 ln Z", "held_out_error": "held-out error (%)", "average_absolute_percent": "mean |%|"}
    percents = dict.fromkeys(("held_out_error", "average_absolute_percent"), report.format_percent)
    formats = {"weight": report.format_share, "score": lambda value: report.format_decimals(value, 1), **percents}
    if frame["held_out_error"].isna().all():  # not asked for, or one level
        frame = frame.drop(columns="held_out_error")
    return page.Table(frame, "", formats, headings)


def _build_loads(record: FleetRecord, loads: FleetLoads) -> dict[str, page.Block]:
    design, units = loads.design, record.prepared.mode.units
    frame = tabulate_design(design, loads.curve, units)
    frame["cautions"] = ["; ".join(caution) for caution in design.cautions]
    headings = {"band": f"{100 * design.level:g} % predictive band"}
    laws = tabulate_by_model(design, units.force).rename(columns={"model": "law"})
    laws.insert(1, "weight", [band.weight for band in design.by_model])
    blocks: dict[str, page.Block] = {
        "loads by force": page.Table(frame, "", {"times tested": report.number}, headings),
        "loads by law": page.Table(laws, "", {"weight": report.format_share}),
    }
    if loads.bands is not None and np.isfinite(design.average.median).any():
        blocks["loads"] = _draw_loads(record, design, loads.bands)
    return blocks


def _draw_loads(record: FleetRecord, design: Loads, bands: Loads) -> page.FigureBlock:
    data, units, name = record.prepared.all_rows, record.prepared.mode.units, record.task.name
    tables = (forms.tabulate_loads(bands), forms.tabulate_tested(data), forms.tabulate_loads(design))
    drawn = design_loads(*tables, bands.level, units.force, units.length, bands.limit)
    band = f"{100 * bands.level:g} per cent predictive band"
    caption = f"Resonant amplitude against force, tested and beyond, with its {band}."
    return page.FigureBlock(to_svg(drawn, identifier(name), f"{name}: design loads", caption), caption)
