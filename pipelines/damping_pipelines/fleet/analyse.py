"""The work on each record: from its files to its row and pages, without other output."""

import ctypes
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from damping import report
from damping.agreement import compare, describe_misfit
from damping.answers import LoadsResult, RankingResult
from damping.api import diagnose
from damping.errors import DampingError, escape_control
from damping.extrapolation import predict_record
from damping.extrapolation.curve import Curve
from damping.extrapolation.prediction import Loads
from damping.extrapolation.prepared import PreparedRecord, prepare_record
from damping.infer.evidence import Estimate, brief_evidence, evidence, remember
from damping.plots import identifier
from damping.ranking import POWER_DRAWS, Ranking, rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records import audit
from damping.records.mode import Units
from damping.records.text import Disagreement
from damping.report import forms, page
from damping.report.figures import draw_design_loads
from damping.report.gap import describe_diagnosis, tabulate_hypotheses
from damping.report.gap_page import render_gap_page
from damping.report.results import collect_holders
from damping.report.screens import describe_load
from damping.report.study import list_laws
from damping.report.tables import describe_coefficients, tabulate_by_model, tabulate_design
from damping.result import DiagnosisResult
from damping_pipelines import collect_drawn, give_back_memory
from damping_pipelines.fleet.dataset import MULTIPLES, SCHEMA, FleetResult, FleetTask, read_files, row_of
from damping_pipelines.store import to_json

DRAWN = 40  #: forces of a drawn band: fewer than elsewhere, as a fleet has many pages
Made = TypeVar("Made")
# How reasons begin that are no record's own: such a record is tried again when the fleet is run again.
DIED = "workers died"
INTERNAL = "internal error"
OTHER_CODE = "a worker computes with other code"
OUT_OF_TIME = "out of time"
BY_CHANCE = (DIED, INTERNAL, OTHER_CODE, OUT_OF_TIME)
#: The way back from the page of a record.
SUMMARY = page.Links([page.Link("Summary of all records", "../fleet.html")])


@dataclass(frozen=True)
class FleetRecord:
    """The results of a record; a stage that was not requested or failed is None, and ``reasons`` give the failures."""

    task: FleetTask
    prepared: PreparedRecord
    ranking: RankingResult | None = None
    loads: LoadsResult | None = None
    bands: Loads | None = None  #: over a grid of forces, None with ``--fast``
    diagnosis: DiagnosisResult | None = None
    reasons: tuple[str, ...] = ()


class OutOfTimeError(BaseException):
    """The work exceeded its time limit; not an ``Exception``, so that no handler on the way catches it."""


@contextmanager
def limit_time(seconds: float) -> Iterator[None]:
    """Raise :class:`OutOfTimeError` in the calling thread when the block takes longer than ``seconds``.

    It is raised between two instructions of Python: a single call into native code is waited for.
    """
    thread = ctypes.c_ulong(threading.get_ident())
    over, lock = False, threading.Lock()

    def stop() -> None:
        with lock:
            if not over:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(OutOfTimeError))

    timer = threading.Timer(min(seconds, threading.TIMEOUT_MAX), stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            over = True
        timer.cancel()


def analyse(task: FleetTask) -> FleetResult:
    """Rank, extrapolate and, if there is a model, diagnose; a stage that fails gives its reason.

    Equal tasks give equal results on any worker and in any order.
    """
    if task.problem:
        return failed(task, task.problem)
    try:
        with limit_time(task.settings.time_limit):
            return _analyse(task)
    except OutOfTimeError:
        return failed(task, f"{OUT_OF_TIME}: it took more than {task.settings.time_limit:g} s (--time-limit)")
    finally:
        give_back_memory()  # draws of one record leave holes that those of the next do not fill


def analyse_each(tasks: Iterable[FleetTask]) -> Iterator[FleetResult]:
    """Results of tasks, one by one in this process."""
    collect_drawn()
    return map(analyse, tasks)


def failed(task: FleetTask, reason: str) -> FleetResult:
    """The row and the page of a record for which every stage failed."""
    row = row_of(task) | {"reason": reason}
    method = page.Text(f"Posteriors were to be had by {task.settings.method}.")
    answer = page.Section("answer", "No answer", [page.Callout("This record failed", [reason]), method])
    sections = [answer, page.Section("fleet", "The fleet", [SUMMARY])]
    return FleetResult(row, {row["report"]: page.render_page(task.name, sections, _build_footer(task))})


def _analyse(task: FleetTask) -> FleetResult:
    try:
        record, mode = read_files(task)
        diagnosed = task.is_model or bool(mode.damping)
        prepared = prepare_record(record, mode, audit(record, mode).require(task.settings.despite, diagnosed=diagnosed))
    except DampingError as error:
        return failed(task, escape_control(str(error)))
    read = _complete(task, prepared, diagnosed)
    pages = {row_of(task)["report"]: record_page(read)}
    if gap := read.diagnosis:
        pages[f"{task.stem}-gap.html"] = render_gap_page(gap.diagnosis, None, gap.against, _build_footer(task))
    return FleetResult(row_of(task) | _columns(read), pages)


def _complete(task: FleetTask, prepared: PreparedRecord, diagnosed: bool) -> FleetRecord:
    """The stages of a record, each independent of failures of the others."""
    settings, ranking, loads, bands, diagnosis = task.settings, None, None, None, None
    estimate, reasons = remember(brief_evidence if settings.fast else evidence), list[str]()

    def attempt(stage: str, work: Callable[[], Made]) -> Made | None:
        try:
            return work()
        except DampingError as error:
            reasons.append(f"{stage}: {escape_control(str(error))}")
            return None

    if attempt("rank and extrapolate", lambda: prepared.findings.require(settings.despite)):
        ranking = attempt("rank", lambda: _rank(task, prepared, estimate))
        loads = attempt("extrapolate", lambda: _predict(task, prepared, estimate, ranking))
    if diagnosed and (diagnosis := attempt("gap", lambda: _diagnose(task, prepared))):
        # contradictions between diagnosis and laws
        if ranking and ranking.ranking.fit.verdict == "none fits":
            misfit = describe_misfit(ranking.ranking.fit, diagnosis.diagnosis)
            ranking = replace(ranking, against=Disagreement(on_rows=misfit))
        if loads:
            against = compare(loads.extrapolation, diagnosis.diagnosis)
            loads, diagnosis = replace(loads, against=against), replace(diagnosis, against=against)
    if loads and not settings.fast:
        bands = loads.extrapolation.predict_drawn(prepared.data.tested_force, DRAWN)
    return FleetRecord(task, prepared, ranking, loads, bands, diagnosis, tuple(reasons))


def _rank(task: FleetTask, prepared: PreparedRecord, estimate: Estimate) -> RankingResult:
    full = not task.settings.fast
    draws = POWER_DRAWS if full else 0.0
    laws = candidate_laws()
    ranking = rank_laws(prepared.all_rows, task.seed, laws, estimate=estimate, hold_out=full, power_draws=draws)
    return RankingResult(ranking, prepared)


def _predict(
    task: FleetTask, prepared: PreparedRecord, estimate: Estimate, ranking: RankingResult | None
) -> LoadsResult:
    asked = np.array(task.settings.forces), MULTIPLES, task.settings.level, task.seed
    ranked = ranking.ranking if ranking else None
    return LoadsResult(predict_record(prepared, *asked, estimate=estimate, ranking=ranked, fresh=False), prepared)


def _diagnose(task: FleetTask, prepared: PreparedRecord) -> DiagnosisResult:
    record, mode = prepared.given
    assert mode is not None  # of a fleet every record has one
    return diagnose(record, mode, compare=False, despite=task.settings.despite)


def _columns(record: FleetRecord) -> dict[str, Any]:
    """The columns of a record; those of stages without results stay empty."""
    ranking, loads, diagnosis = record.ranking, record.loads, record.diagnosis
    done = [part for part in (ranking, loads, diagnosis) if part is not None]
    columns: dict[str, Any] = _loads_columns(loads) if loads else {}
    if ranking:
        best = max(ranking.ranking.candidates, key=lambda candidate: candidate.weight)
        columns |= {name: getattr(best, name) for name in ("weight", "average_absolute_percent", "held_out_error")}
        columns |= {"law": best.name, "rank_form": to_json(ranking.to_json())}
    if diagnosis:
        parts, gap = ("nominal", "before", "after", "shrinkage"), diagnosis.diagnosis
        columns |= {f"gap_{part}": getattr(gap.gap, part) for part in parts}
        columns["effects"], columns["unexplained"] = list(gap.leading.effects), gap.unexplained
        columns["effects_probability"] = gap.hypotheses[0].probability
        columns["gap_form"] = to_json(diagnosis.to_json())
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


def _loads_columns(predicted: LoadsResult) -> dict[str, Any]:
    """The prediction at the largest design force with the damping there, and the form."""
    loads, best = predicted.loads, predicted.extrapolation.plan.laws[0]
    i = int(loads.force.argmax())
    row = predicted.table.iloc[i]
    return {
        "load_law": best.name,
        "load_weight": best.weight,
        "design_force": row["force"],
        **{name: row[name] for name in SCHEMA.names if name in row},
        "cautions": [*predicted.against, *loads.cautions[i]],
        "loads_form": to_json(predicted.to_json(whole=False)),
    }


def record_page(record: FleetRecord) -> str:
    """The page as HTML. Equal arguments give equal text."""
    ranking, loads, units = record.ranking, record.loads, record.prepared.mode.units
    diagnosis = record.diagnosis.diagnosis if record.diagnosis else None
    cautions = [*(ranking.cautions if ranking else ()), *(loads.cautions if loads else ())]
    values = {
        "record": record,
        "sentences": describe_diagnosis(diagnosis) if diagnosis else None,
        "best": ranking.ranking.weighted()[0] if ranking else None,
        "load": describe_load(loads.loads, loads.curve, units) if loads else {},
        "cautions": dict.fromkeys(cautions),
        "at_forces": _list_cautions(loads.loads, units) if loads else [],
    }
    parts: dict[str, page.Block] = {"summary": SUMMARY}
    if ranking:
        parts["laws"] = _tabulate_laws(ranking.ranking, units)
    if loads:
        parts |= _build_loads(record, loads.loads, loads.curve)
    if diagnosis:
        listed = tabulate_hypotheses(diagnosis).query("listed")[["explanation", "probability"]]
        parts["explanations"] = page.Table(listed, {"probability": report.format_share})
        address = f"{record.task.stem.rpartition('/')[2]}-gap.html"
        parts["diagnosis"] = page.Links([page.Link("The whole diagnosis", address)])
    sections = page.write_sections(Path(__file__).with_name("record_page.txt"), values, parts)
    return page.render_page(record.task.name, sections, _build_footer(record.task))


def _build_footer(task: FleetTask) -> page.Footer:
    return page.Footer(task.seed, task.settings.versions, task.inputs)


def _tabulate_laws(ranking: Ranking, units: Units) -> page.Table:
    frame = forms.tabulate_candidates(ranking).drop(columns=["score_standard_error", "physical", "equivalents"])
    texts = [describe_coefficients(candidate, units) for candidate in ranking.candidates]
    frame.insert(len(frame.columns) - 1, "coefficients", texts)
    if frame["held_out_error"].isna().all():  # not asked for, or one level
        frame = frame.drop(columns="held_out_error")
    return list_laws(frame)


def _list_cautions(design: Loads, units: Units) -> list[tuple[str, list[str]]]:
    """Each caution of design forces once, with the forces."""
    forces = [report.format_force_text(force, units.force) for force in design.force]
    return collect_holders(zip(forces, design.cautions, strict=True))


def _build_loads(record: FleetRecord, design: Loads, curve: Curve) -> dict[str, page.Block]:
    name, data, units = record.task.name, record.prepared.all_rows, record.prepared.mode.units
    frame = tabulate_design(design, curve, units)
    headings = {"band": f"{100 * design.level:g} % predictive band"}
    laws = tabulate_by_model(design, units.force).rename(columns={"model": "law"})
    laws.insert(1, "weight", [band.weight for band in design.by_model])
    drawn = draw_design_loads(name, data, units, design, record.bands)
    return {
        "loads by force": page.Table(frame, {"times tested": report.number}, headings),
        "loads by law": page.Table(laws, {"weight": report.format_share}),
        **({"loads": page.FigureBlock(drawn.to_svg(identifier(name)))} if drawn else {}),
    }
