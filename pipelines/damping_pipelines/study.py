"""``damping study``: rank, sample, extrapolate, report. Everything is computed before the first file is written."""

import sys
from collections.abc import Collection, Iterable
from concurrent.futures import Executor, Future, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from damping.agreement import compare_with_diagnosis
from damping.errors import AnalysisError
from damping.extrapolation import extrapolate_loads, sample_candidate
from damping.extrapolation.curve import (
    FARTHEST,
    list_default_amplitudes,
    list_drawn_amplitudes,
    predict_forces,
    trace_loads,
)
from damping.extrapolation.draws import LEAST_WEIGHT, Member, amplitude_draws
from damping.extrapolation.plan import Plan, judge_rows, plan_loads
from damping.extrapolation.prepared import PreparedRecord, prepare_record
from damping.infer.checks import inference_data, leave_one_out, predictive_check
from damping.infer.evidence import Estimate, evidence, remember
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.progress import Advance
from damping.ranking import Candidate, Ranking, rank_laws
from damping.ranking.candidates import candidate_laws, resonant_laws
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping.records.text import AGREED, Disagreement
from damping.regression.fit import PowerLaw, fit_power_law
from damping.report.forms import list_mode_cautions
from damping.report.results import LawPosterior, RecordResult, StudyResult
from damping_pipelines import collect_drawn, give_back_memory, start_pool
from damping_pipelines import study_files as files
from damping_pipelines.manifest import digest_file, refuse_foreign, sole_writer, versions
from damping_pipelines.terminal import progress, report_findings

#: Laws whose posteriors are sampled by chains for the page and the files; predictions average all laws by weight.
MOST_SAMPLED = 6


@dataclass(frozen=True)
class Input:
    """A record of the study, read and checked."""

    settings: files.RecordSettings
    prepared: PreparedRecord


@dataclass(frozen=True)
class Task:
    """One law to sample on one record, in a separate process. ``of_source`` marks a law of the source report."""

    number: int
    record: Input
    data: Observations  #: rows as they were ranked
    candidate: Candidate
    level: float
    seed: int
    of_source: bool


def run_study(
    settings_file: Path | None,
    out: Path | None,
    seed: int | None,
    *,
    png: bool = False,
    pdf: bool = False,
    despite: Collection[str] = (),
) -> None:
    """Run a study and write its results; earlier results stay as they were if anything fails."""
    path = settings_file or files.default_study()
    settings = files.read_settings(path)
    if seed is not None:
        settings = settings.model_copy(update={"seed": seed})
    out = out or Path("results") / ("saturn-v" if settings_file is None else path.stem)
    names = dict.fromkeys([path.name, *(name for asked in settings.records for name in (asked.record, asked.mode))])
    read = [path.parent / name for name in names]
    refuse_foreign(out, files.PAGES, read)  # before the audit, which prints
    inputs = read_inputs(settings, path.parent, despite)
    digests = {name: digest_file(path.parent / name) for name in names}
    with sole_writer(out, files.PAGES, read):
        files.write_study(compute(settings, inputs, digests), out, read, png=png, pdf=pdf)
    print(f"{out / 'report.html'} written")


def read_inputs(settings: files.StudySettings, folder: Path, despite: Collection[str] = ()) -> list[Input]:
    """Read, check and audit every file of the study before any work."""
    inputs = []
    for asked in settings.records:
        record, mode = read_record(folder / asked.record), read_mode(folder / asked.mode)
        prepared = prepare_record(record, mode, report_findings(record, mode, despite))
        for line in prepared.notes:
            print(f"caution: {record.source}: {line}", file=sys.stderr)
        inputs.append(Input(asked, prepared))
    return inputs


def compute(settings: files.StudySettings, inputs: list[Input], digests: dict[str, str]) -> StudyResult:
    """The whole computation: rankings, posteriors, predictions, and the source report if asked for."""
    with start_pool() as pool:
        rankings, predicted = _weigh(pool, settings, inputs)
        started = [files.source_report().start(pool, settings.seed)] if settings.source_report else []
        sampled = _sample(pool, list(_tasks(settings, inputs, rankings)))
        give_back_memory()
        collect_drawn()  # from here on
        records = tuple(
            _record_result(record, rankings[k], predicted[k], tuple(law for task, law in sampled if task.number == k))
            for k, record in enumerate(inputs)
        )
        named = {record.name: record.ranking for record in records}
        loads = {record.name: record.design for record in records if record.design}
        exhibits = tuple(exhibit.finish(named, loads) for exhibit in started)
    return StudyResult(settings.title, settings.seed, settings.level, records, digests, versions(), exhibits)


def _weigh(
    pool: Executor, settings: files.StudySettings, inputs: list[Input]
) -> tuple[list[Ranking], list[Future[dict[str, Any]]]]:
    """Rank every record and start its predictions, first of all, while the other processes are small."""
    estimate = remember(evidence)
    laws = [candidate_laws(map(Law, record.settings.laws)) for record in inputs]
    with progress("ranking", sum(map(len, laws))) as done:
        rankings = []
        for record, candidates in zip(inputs, laws, strict=True):
            advance = _prefixed(done, record.settings.name)
            rankings.append(rank_laws(record.prepared.all_rows, settings.seed, candidates, advance, estimate))
    plans = zip(inputs, rankings, _plan(inputs, settings.seed, estimate), strict=True)
    return rankings, [pool.submit(predict_inputs, *own, settings.level, settings.seed) for own in plans]


def _plan(inputs: list[Input], seed: int, estimate: Estimate) -> list[Plan | None]:
    """The laws for predictions and their weights; None if there are none and no design load is requested.

    AnalysisError: no law can carry the forces of a record with design forces.
    """
    candidates = resonant_laws()
    plans: list[Plan | None] = []
    with progress("weighing laws", len(inputs) * len(candidates)) as done:
        for record in inputs:
            prepared, advance = record.prepared, _prefixed(done, record.settings.name)
            try:
                plans.append(plan_loads(prepared.data, candidates, seed, advance, prepared.mode, estimate))
            except AnalysisError:
                if record.settings.design_forces:
                    raise
                plans.append(None)
    return plans


def _prefixed(done: Advance, prefix: str) -> Advance:
    """Progress that names its record."""
    return lambda what, parts=1: done(f"{prefix}: {what}", parts)


def _tasks(settings: files.StudySettings, inputs: list[Input], rankings: list[Ranking]) -> Iterable[Task]:
    """Laws to sample: the ``MOST_SAMPLED`` of largest weight and those in the settings, each once, best first."""
    for number, (record, ranking) in enumerate(zip(inputs, rankings, strict=True)):
        named = [ranking.find(Law(law)) for law in record.settings.laws]
        for candidate in ranking.candidates:
            of_source = any(candidate is other for other in named)
            leads = candidate.rank is not None and candidate.rank <= MOST_SAMPLED and candidate.weight > LEAST_WEIGHT
            if candidate.evidence is not None and (leads or of_source):
                yield Task(number, record, ranking.data, candidate, settings.level, settings.seed, of_source)


def _sample(pool: Executor, tasks: list[Task]) -> list[tuple[Task, LawPosterior]]:
    """Sample every law, one process per core; results are in the order of ``tasks``."""
    with progress("sampling", len(tasks)) as done:
        futures = [pool.submit(sample_law, task) for task in tasks]
        for future in as_completed(futures):
            law = future.result()
            done(law.law.name + (f" FAILED: {law.posterior.failure}" if law.posterior.failure else ""))
    return [(task, future.result()) for task, future in zip(tasks, futures, strict=True)]


def sample_law(task: Task) -> LawPosterior:
    """Sample one law and check it against its data."""
    data, forces = task.data, np.array(task.record.settings.design_forces)
    posterior = sample_candidate(task.candidate, data, forces, task.seed)
    sampled = Member(task.candidate.name, task.candidate.weight, posterior.coordinates, posterior.draws)
    amplitude = amplitude_draws(sampled, data.tested_force, data)
    groups = inference_data(posterior, data)
    return LawPosterior(
        law=task.candidate.law,
        weight=task.candidate.weight,
        posterior=posterior,
        leave_one_out=leave_one_out(groups, data),
        check=predictive_check(posterior, data, amplitude, task.level, task.seed),
        of_source=task.of_source,
        file=files.to_netcdf(files.add_damping_ratio(groups, posterior, data, task.record.prepared.backbone)),
    )


def predict_inputs(record: Input, ranking: Ranking, plan: Plan | None, level: float, seed: int) -> dict[str, Any]:
    """Predictions of one record by field of `RecordResult`, none without a plan.

    It runs in a separate process, since its draws take as much memory as everything else.
    """
    if plan is None:
        return {}
    prepared, asked = record.prepared, np.array(record.settings.design_forces)
    plan, tested = judge_plan(plan, ranking, prepared.all_rows, seed), prepared.all_rows.tested_force
    forces = asked if len(asked) else np.array(FARTHEST) * tested.max()
    predicted = extrapolate_loads(plan.data, forces, level, seed, mode=prepared.mode, plan=plan)
    against = compare_with_diagnosis(prepared, predicted) if len(asked) else AGREED
    amplitudes = list_default_amplitudes(predicted)
    curve, drawn = (
        trace_loads(predict_forces(predicted, at, each=False), prepared.backbone, plan.data)
        for at in (amplitudes, list_drawn_amplitudes(amplitudes, plan.data))
    )
    result: dict[str, Any] = {"against": against, "curve": replace(curve, cautions=_warn(against, curve.cautions))}
    result["drawn_curve"] = drawn
    if len(asked):
        design_curve = trace_loads(predicted.loads, prepared.backbone, plan.data)
        result |= {
            "bands": predicted.predict_drawn(tested),
            "design": replace(predicted.loads, cautions=_warn(against, design_curve.cautions)),
            "design_curve": design_curve,
            "next_level": predicted.next_level,
        }
    give_back_memory()
    return result


def judge_plan(plan: Plan, ranking: Ranking, all_rows: Observations, seed: int) -> Plan:
    """The plan judged on all rows; where it fails as the ranking does, with the ranking's verdict: a page has one."""
    plan = judge_rows(plan, all_rows, seed)
    return replace(plan, fit=ranking.fit) if plan.fit.verdict == ranking.fit.verdict != "fits" else plan


def _record_result(
    record: Input, ranking: Ranking, predicted: Future[dict[str, Any]], posteriors: tuple[LawPosterior, ...]
) -> RecordResult:
    prepared = record.prepared
    return RecordResult(
        name=record.settings.name,
        title=record.settings.title or prepared.mode.name,
        record=prepared.measured.record,
        mode=prepared.mode,
        data=prepared.all_rows,
        ranking=ranking,
        posteriors=posteriors,
        power_laws=_list_power_laws(prepared.all_rows),
        findings=prepared.findings.findings,
        backbone=prepared.backbone,
        note=record.settings.note,
        remarks=(*prepared.notes_of_loads, *list_mode_cautions(prepared.all_rows, prepared.mode)),
        design_levels=record.settings.design_levels,
        **predicted.result(),
    )


def _warn(against: Disagreement, cautions: Iterable[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Cautions of each prediction, after the disagreements that concern all of them."""
    return tuple((*against, *own) for own in cautions)


def _list_power_laws(data: Observations) -> tuple[PowerLaw, ...]:
    """Both forms of section 4.3 from the tested resonances; none with fewer than two different amplitudes."""
    try:
        F, A, omega = data.tested_force, data.tested_amplitude, data.tested_omega
        return (fit_power_law(F, A, omega), fit_power_law(F, A, omega, "displacement-velocity-power"))
    except AnalysisError:
        return ()
