"""One record from files to its row and its pages: what a worker does. Nothing stays behind, nothing is printed."""

from __future__ import annotations

import ctypes
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from damping.errors import DampingError, InputError, escape_control
from damping.extrapolation import draw_evidence, extrapolate_loads
from damping.extrapolation.backbone import find_backbone
from damping.extrapolation.curve import trace_loads
from damping.extrapolation.near import near_resonance
from damping.gap.diagnose import Diagnosis, diagnose
from damping.infer.evidence import Estimate, brief_evidence, evidence, remember
from damping.infer.observations import observe
from damping.predict.measured import prepare
from damping.ranking import Ranking, rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records.audit import audit
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping.report.forms import gap_form, loads_form, rank_form
from damping.report.gap import render_gap_page
from damping_pipelines.fleet.dataset import MULTIPLES, FleetResult, FleetTask, row_of
from damping_pipelines.fleet.record_page import FleetLoads, FleetRecord, describe_failed_page, record_page
from damping_pipelines.store import to_json

#: Stem of the model file while it is read; a mode without a name gets that of the record instead.
_UNNAMED = "mode-without-a-name"
#: Forces over which bands are drawn.
_GRID = 40
Made = TypeVar("Made")
#: How the reason of a record begins that was given up: it is tried again when the fleet is run again.
OUT_OF_TIME = "out of time"


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
    """The row and the page of a record that failed."""
    row = row_of(task) | {"reason": reason}
    return FleetResult(row, {row["report"]: describe_failed_page(task, reason)})


def _analyse(task: FleetTask) -> FleetResult:
    try:
        record, mode = _read(task)
        findings = audit(record, mode)
        findings.require(task.settings.despite)
        measured = prepare(record, mode)
        data = observe(measured.record)
    except DampingError as error:
        return failed(task, escape_control(str(error)))
    return _complete(FleetRecord(task, measured.record, measured.mode or mode, data, findings))


def _read(task: FleetTask) -> tuple[Record, Mode]:
    """Record and mode; messages name the files as the user knows them."""
    names = dict(zip(("record.csv", f"{_UNNAMED}.toml"), task.inputs, strict=True))
    with tempfile.TemporaryDirectory(prefix="damping-fleet-") as folder:
        paths = [Path(folder, name) for name in names]
        for path, content in zip(paths, (task.record_text, task.model_text), strict=True):
            with path.open("wb") as stream:
                stream.write(content or b"")
        try:
            record, mode = read_record(paths[0]), read_mode(paths[1])
        except InputError as error:
            known = names[Path(error.file).name] if error.file else None
            raise InputError(
                error.message, file=known, line=error.line, column=error.column, expected=error.expected
            ) from error
    first, second = names.values()
    name = task.name if mode.name == _UNNAMED else mode.name
    return replace(record, source=first), replace(mode, source=second, name=name)


def _complete(read: FleetRecord) -> FleetResult:
    """The stages of a record, each tried whatever became of the others, as a row and pages."""
    task, fast = read.task, read.task.settings.fast
    estimate, reasons = remember(brief_evidence if fast else evidence), list[str]()

    def attempt(stage: str, work: Callable[[], Made]) -> Made | None:
        try:
            return work()
        except DampingError as error:
            reasons.append(f"{stage}: {escape_control(str(error))}")
            return None

    def rank() -> Ranking:
        return rank_laws(read.data, task.seed, candidate_laws(), estimate=estimate, hold_out=not fast)

    ranking = attempt("rank", rank)
    loads = attempt("extrapolate", lambda: _predict_loads(read, estimate))
    diagnosed = task.is_model or bool(read.mode.damping)
    diagnosis = attempt("gap", lambda: diagnose(read.record, read.mode)) if diagnosed else None
    record = replace(read, ranking=ranking, loads=loads, diagnosis=diagnosis, reasons=tuple(reasons))
    row = row_of(task) | _columns(record)
    pages = {row["report"]: record_page(record)}
    if diagnosis:
        versions = task.settings.versions
        pages[f"{task.stem}-gap.html"] = render_gap_page(diagnosis, None, task.seed, versions, task.inputs)
    return FleetResult(row, pages)


def _predict_loads(read: FleetRecord, estimate: Estimate) -> FleetLoads:
    settings, data = read.task.settings, near_resonance(read.record)
    largest = data.tested_force.max()
    forces = np.array(settings.forces) if settings.forces else largest * np.array(MULTIPLES)
    predicted = extrapolate_loads(
        data, forces, settings.level, read.task.seed, mode=read.mode, estimate=estimate, sampler=draw_evidence
    )
    bands = None
    if not settings.fast:
        grid = np.linspace(0.8 * data.tested_force.min(), 1.05 * max(forces.max(), largest), _GRID)
        bands = predicted.predict_at(grid)
    backbone = find_backbone(read.record, read.mode, read.audit.implied)
    curve = trace_loads(predicted.loads, backbone, predicted.plan.data)
    return FleetLoads(predicted.plan, predicted.loads, curve, bands)


def _columns(record: FleetRecord) -> dict[str, Any]:
    """The columns of a record that was read; those of a stage that was not done stay empty."""
    done = [part for part in (record.ranking, record.loads, record.diagnosis) if part is not None]
    return {
        "mode": record.mode.name,
        "units_force": record.mode.units.force,
        "units_length": record.mode.units.length,
        "rows": len(record.record),
        "levels": len(record.data.sweeps),
        "largest_tested_force": record.data.tested_force.max(),
        "audit": "; ".join(escape_control(str(finding)) for finding in record.audit.findings),
        **(_ranking_columns(record.ranking) if record.ranking else {}),
        **(_loads_columns(record.loads) if record.loads else {}),
        **(_gap_columns(record.diagnosis) if record.diagnosis else {}),
        "status": "failed" if not done else "partial" if record.reasons else "done",
        "reason": "; ".join(record.reasons),
    }


def _ranking_columns(ranking: Ranking) -> dict[str, Any]:
    """The law of largest weight, and the form."""
    best = max(ranking.candidates, key=lambda candidate: candidate.weight)
    return {
        "law": best.name,
        "weight": best.weight,
        "average_absolute_percent": best.average_absolute_percent,
        "held_out_error": best.held_out_error,
        "rank_form": to_json(rank_form(ranking)),
    }


def _loads_columns(predicted: FleetLoads) -> dict[str, Any]:
    """The prediction at the largest design force with the damping there, and the form."""
    loads, best, ratio = predicted.design, predicted.plan.laws[0], predicted.curve.damping_ratio
    i = int(loads.force.argmax())
    return {
        "load_law": best.name,
        "load_weight": best.weight,
        "design_force": loads.force[i],
        "extrapolation_ratio": loads.ratio[i],
        **{name: getattr(loads.average, name)[i] for name in ("median", "low", "high")},
        "frequency": predicted.curve.frequency.median[i],
        "damping_ratio": ratio.median[i],
        "damping_ratio_low": ratio.low[i],
        "damping_ratio_high": ratio.high[i],
        "linear": loads.linear[i],
        "linear_overprediction_percent": loads.overprediction[i],
        "linear_overprediction_low": loads.overprediction_low[i],
        "linear_overprediction_high": loads.overprediction_high[i],
        "cautions": list(loads.cautions[i]),
        "loads_form": to_json(loads_form(loads, predicted.plan, predicted.curve)),
    }


def _gap_columns(diagnosis: Diagnosis) -> dict[str, Any]:
    """The leading explanation, and the form."""
    return {
        "effects": list(diagnosis.leading.effects),
        "effects_probability": diagnosis.hypotheses[0].probability,
        "unexplained": diagnosis.unexplained,
        **{f"gap_{name}": getattr(diagnosis.gap, name) for name in ("nominal", "before", "after", "shrinkage")},
        "gap_form": to_json(gap_form(diagnosis)),
    }


class OutOfTimeError(BaseException):
    """The work took longer than it may; beside ``Exception``, so that no handler on its way takes it for its own."""


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

    timer = threading.Timer(seconds, stop)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        with lock:
            over = True
        timer.cancel()
