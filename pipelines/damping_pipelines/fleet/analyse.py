"""One record from files to its row and its pages: what a worker does. Nothing stays behind, nothing is printed."""

from __future__ import annotations

import ctypes
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np

from damping.errors import DampingError, InputError, escape_control
from damping.extrapolation import draw_evidence, extrapolate_loads
from damping.extrapolation.backbone import find_backbone
from damping.extrapolation.curve import Curve, trace_loads
from damping.extrapolation.near import near_resonance
from damping.extrapolation.plan import Plan
from damping.extrapolation.prediction import Loads
from damping.gap.diagnose import Diagnosis, diagnose
from damping.infer.evidence import Estimate, brief_evidence, evidence, remember
from damping.infer.observations import Observations, observe
from damping.predict.measured import prepare
from damping.ranking import Ranking, rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records.audit import Audit, audit
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping.report.gap_page import describe_gap_page
from damping_pipelines.fleet.dataset import gap_columns, loads_columns, ranking_columns, report_stem, row_of
from damping_pipelines.fleet.inputs import MULTIPLES, FleetResult, FleetTask
from damping_pipelines.fleet.record_page import FleetRecord, describe_failed_page, record_page

#: Stem of the model file while it is read; a mode without a name gets that of the record instead.
_UNNAMED = "mode-without-a-name"
#: Forces over which bands are drawn.
_GRID = 40
Found = TypeVar("Found")
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


def _analyse(task: FleetTask) -> FleetResult:
    try:
        record, mode = _read(task)
        found = audit(record, mode)
        found.require(task.settings.despite)
        measured = prepare(record, mode)
        record, mode = measured.record, measured.mode or mode
        data = observe(record)
    except DampingError as error:
        return failed(task, escape_control(str(error)))
    return _Analysis(task, record, mode, data, found).result()


def failed(task: FleetTask, reason: str) -> FleetResult:
    """The row and the page of a record that failed."""
    row = row_of(task) | {"reason": reason}
    settings = task.settings
    page = describe_failed_page(task.name, reason, settings.method, task.seed, settings.versions, _inputs(task))
    return FleetResult(row, {row["report"]: page})


def _inputs(task: FleetTask) -> dict[str, str]:
    names = ("data.csv", "model.toml") if task.is_model else (f"{task.name}.csv", f"{task.name}.toml")
    return dict(zip(names, task.digests, strict=True))


def _read(task: FleetTask) -> tuple[Record, Mode]:
    """Record and mode; messages name the files as the user knows them."""
    names = dict(zip(("record.csv", f"{_UNNAMED}.toml"), _inputs(task), strict=True))
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


class _Analysis:
    """The stages of one record; each is tried whatever became of the others."""

    def __init__(self, task: FleetTask, record: Record, mode: Mode, data: Observations, found: Audit) -> None:
        self.task, self.record, self.mode, self.data, self.audit = task, record, mode, data, found
        self.estimate: Estimate = remember(brief_evidence if task.settings.fast else evidence)
        self.reasons: list[str] = []

    def result(self) -> FleetResult:
        """Everything, as a row and pages."""
        task = self.task
        row = row_of(task) | {
            "mode": self.mode.name,
            "units_force": self.mode.units.force,
            "units_length": self.mode.units.length,
            "rows": len(self.record),
            "levels": len(self.data.sweeps),
            "largest_tested_force": self.data.tested_force.max(),
            "audit": "; ".join(escape_control(str(finding)) for finding in self.audit.findings),
        }
        pages: dict[str, str] = {}
        ranking = self._tried("rank", self._rank)
        loads = self._tried("extrapolate", self._loads)
        diagnosed = task.is_model or bool(self.mode.damping)
        diagnosis = self._tried("gap", self._gap) if diagnosed else None
        row |= ranking_columns(ranking) if ranking else {}
        row |= loads_columns(loads.design, loads.plan, loads.curve) if loads else {}
        if diagnosis:
            row |= gap_columns(diagnosis)
            pages[f"{report_stem(task)}-gap.html"] = describe_gap_page(
                diagnosis, None, task.seed, task.settings.versions, _inputs(task)
            )
        done = [part for part in (ranking, loads, diagnosis) if part is not None]
        row["status"] = "failed" if not done else "partial" if self.reasons else "done"
        row["reason"] = "; ".join(self.reasons)
        pages[row["report"]] = record_page(self._page(ranking, loads, diagnosis))
        return FleetResult(row, pages)

    def _tried(self, stage: str, work: Callable[[], Found]) -> Found | None:
        try:
            return work()
        except DampingError as error:
            self.reasons.append(f"{stage}: {escape_control(str(error))}")
            return None

    def _rank(self) -> Ranking:
        fast = self.task.settings.fast
        return rank_laws(self.data, self.task.seed, candidate_laws(), estimate=self.estimate, hold_out=not fast)

    def _gap(self) -> Diagnosis:
        return diagnose(self.record, self.mode)

    def _loads(self) -> _Predicted:
        settings, seed = self.task.settings, self.task.seed
        data = near_resonance(self.record)
        largest = data.tested_force.max()
        forces = np.array(settings.forces) if settings.forces else largest * np.array(MULTIPLES)
        predicted = extrapolate_loads(
            data,
            forces,
            settings.level,
            seed,
            mode=self.mode,
            estimate=self.estimate,
            sampler=draw_evidence,
        )
        bands = None
        if not settings.fast:
            grid = np.linspace(0.8 * data.tested_force.min(), 1.05 * max(forces.max(), largest), _GRID)
            bands = predicted.predict_at(grid)
        backbone = find_backbone(self.record, self.mode, self.audit.implied)
        curve = trace_loads(predicted.loads, backbone, predicted.plan.data)
        return _Predicted(predicted.plan, predicted.loads, curve, bands)

    def _page(self, ranking: Ranking | None, loads: _Predicted | None, diagnosis: Diagnosis | None) -> FleetRecord:
        task = self.task
        return FleetRecord(
            name=task.name,
            mode=self.mode,
            record=self.record,
            data=self.data,
            method=task.settings.method,
            ranking=ranking,
            design=loads.design if loads else None,
            bands=loads.bands if loads else None,
            diagnosis=diagnosis,
            gap_report=f"{Path(report_stem(task)).name}-gap.html",
            findings=tuple(map(str, self.audit.findings)),
            reasons=tuple(self.reasons),
            own_forces=not task.settings.forces,
            seed=task.seed,
            versions=task.settings.versions,
            inputs=_inputs(task),
        )


@dataclass(frozen=True)
class _Predicted:
    """What extrapolation gave; ``curve``: damping there; ``bands`` over a grid of forces, None with ``--fast``."""

    plan: Plan
    design: Loads
    curve: Curve
    bands: Loads | None


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
