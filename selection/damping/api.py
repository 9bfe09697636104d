"""The functions of ``import damping as dp``, from record to result; a bad argument raises InputError at once."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from damping.answers import CurveResult, LoadsResult, RankingResult
from damping.arrays import FloatArray, Numbers, join_rows, read_floats
from damping.errors import InputError, check_flags, check_kind, check_whole
from damping.extrapolation import predict_record
from damping.extrapolation.curve import FARTHEST, list_default_amplitudes, predict_forces, trace_loads
from damping.extrapolation.prepared import prepare_record
from damping.extrapolation.requested import list_asked
from damping.infer import SEED
from damping.progress import Progress, silent, undisturbed, watch
from damping.ranking import rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records import audit
from damping.records.mode import Mode
from damping.records.reading import take_numbers
from damping.records.record import Record
from damping.records.text import AGREED
from damping.result import AuditResult, ConditionResult, DiagnosisResult, RegressionResult, SweepResult

if TYPE_CHECKING:
    from damping.gap.problem import State
    from damping.gap.simulator import Simulate
    from damping.gap.sweeping import Direction, Method
    from damping.signals.description import Description


def check(record: Record, mode: Mode | None = None) -> AuditResult:
    """Audit a record, and the mode that simulates it, as ``damping check`` does."""
    check_kind(record, Record, "record")
    check_kind(mode, type(None) if mode is None else Mode, "mode")
    return AuditResult(**vars(audit(record, mode)), record=record)


@undisturbed
def rank(
    record: Record,
    mode: Mode | None = None,
    *,
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> RankingResult:
    """Every candidate damping law of a record without the phase offset that an audit finds, as ``damping rank`` does.

    Args:
        mode: cautions name its contradictions with the record and, where no law fits, the objections of its diagnosis.
        progress: shows how far the work is.
        despite: checks of the audit whose refusal is overridden, such as ``("phase-sign",)``.

    Raises:
        AnalysisError: no candidate could be fitted.
    """
    check_whole(seed=seed)
    prepared = prepare_record(record, mode, check(record, mode).require(despite))
    laws = candidate_laws()
    with watch(progress)("ranking", len(laws)) as done:
        ranking = rank_laws(prepared.all_rows, seed, laws, done)
    if mode is None or ranking.fit.verdict != "none fits":
        return RankingResult(ranking, prepared)
    from damping.agreement import doubt_misfit  # noqa: PLC0415 - where a law fits, no diagnosis is loaded

    return RankingResult(ranking, prepared, doubt_misfit(prepared, ranking.fit, progress))


@undisturbed
def extrapolate(
    record: Record,
    mode: Mode,
    forces: Numbers = (),
    level: float = 0.9,
    *,
    amplitudes: Numbers = (),
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> LoadsResult:
    """Resonant amplitude at each force, or the force for each amplitude, as ``damping extrapolate`` predicts it.

    Args:
        forces: force amplitudes, in the unit of the record.
        level: content of the bands, between 0 and 1.
        amplitudes: amplitudes to find the force for, instead of ``forces``.

    Raises:
        InputError: an invalid force, amplitude or level, both forces and amplitudes, or an argument of a wrong type.
        AnalysisError: the levels do not allow a prediction.
    """
    from damping.agreement import compare_with_diagnosis  # noqa: PLC0415 - as above

    at, under = list_asked(amplitudes, "amplitude", level), list_asked(forces, "force", level)
    if len(at) and len(under):
        raise InputError("forces beside amplitudes", expected="one of them: a prediction is of the other")
    if not len(at) and not len(under):
        raise InputError("no list of forces", expected="one force amplitude > 0 or more")
    check_kind(mode, Mode, "mode")
    check_whole(seed=seed)
    prepared = prepare_record(record, mode, check(record, mode).require(despite))
    predicted = predict_record(prepared, under, (1.0,), level, seed, progress=watch(progress))
    predicted = replace(predicted, loads=predict_forces(predicted, at)) if len(at) else predicted
    against = compare_with_diagnosis(prepared, predicted, progress)
    return LoadsResult(predicted, prepared, against)


@undisturbed
def curve(
    record: Record,
    mode: Mode,
    amplitudes: Numbers = (),
    forces: Numbers = (),
    level: float = 0.9,
    *,
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> CurveResult:
    """Damping ratio, Q and frequency at each amplitude and force, as ``damping curve`` lists them.

    Args:
        amplitudes, forces: points of the curve; by default over the test and beyond it.
        level: content of the bands.

    Raises:
        InputError: an invalid amplitude, force or level, or an argument of a wrong type.
        AnalysisError: the levels do not allow a prediction.
    """
    from damping.agreement import compare_with_diagnosis  # noqa: PLC0415 - as above

    at, under = list_asked(amplitudes, "amplitude", level), list_asked(forces, "force", level)
    check_kind(mode, Mode, "mode")
    check_whole(seed=seed)
    prepared = prepare_record(record, mode, check(record, mode).require(despite))
    predicted = predict_record(prepared, under, FARTHEST, level, seed, progress=watch(progress))
    reached = at if len(at) or len(under) else list_default_amplitudes(predicted)
    asked = [predict_forces(predicted, reached, each=False)] if len(reached) else []
    asked += [predicted.loads] if len(under) else []
    compared = replace(predicted, loads=asked[0]) if len(at) and not len(under) else predicted
    against = compare_with_diagnosis(prepared, compared, progress)
    traced = join_rows([trace_loads(loads, prepared.backbone, prepared.data) for loads in asked])
    return CurveResult(predicted, prepared, against, curve=traced)


@undisturbed
def diagnose(
    record: Record,
    mode: Mode,
    *,
    states: Iterable[State] = (),
    simulate: Simulate | None = None,
    posterior: bool = False,
    compare: bool = True,
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> DiagnosisResult:
    """Why a record departs from the simulation ``mode``, as ``damping gap`` diagnoses it.

    Args:
        states: records of further states (masses added, fuel levels, ring-downs) with their modes; effects are shared.
        simulate: a user's simulation: ``function(force, frequency, *, name=(value, tolerance), ...)`` returns amplitude
            and phase lag, (n,) each; where an effect needs a mass or a frequency, ``mode`` supplies it.
        posterior: whether to sample the strengths of the leading explanation too.
        compare: whether to compare the result with the ranked laws.

    Raises:
        AnalysisError: model and record are of different modes, rows are too many, or all at resonance without damping.
    """
    from damping.agreement import compare_with_ranking  # noqa: PLC0415 - loads the diagnosis, which few functions need
    from damping.gap import corrected  # noqa: PLC0415 - as above
    from damping.gap import diagnose as diagnosis  # noqa: PLC0415 - as above

    check_kind(mode, Mode, "mode")
    check_whole(seed=seed)
    check_flags(posterior=posterior, compare=compare)
    progress = watch(progress)
    none = not isinstance(states, Iterable) or getattr(states, "ndim", 1) == 0  # an array without axes has no items
    states = () if none else tuple(states)  # an iterator can be read once only
    if none or not all(isinstance(pair, tuple | list) and len(pair) == 2 for pair in states):
        raise InputError("states are no pairs", expected="(record, mode) of each state")
    findings = check(record, mode).require(despite, diagnosed=True)
    for state_record, state_mode in states:
        check_kind(state_mode, Mode, "mode of a state")
        check(state_record, state_mode).require(despite, diagnosed=True)
    gap = diagnosis.diagnose(record, mode, states=states, simulate=simulate, progress=progress)
    is_compared = compare and not (states or simulate)
    against = compare_with_ranking(gap.record, gap, findings, seed, progress) if is_compared else AGREED
    sampled = corrected.sample_effects(gap.leading.best, seed, progress) if posterior else None
    cautions = (*findings.list_cautions(), *gap.cautions, *(sampled.cautions if sampled else ()))
    return DiagnosisResult(replace(gap, cautions=cautions), sampled, findings, against)


@undisturbed
def regress(
    frame: pd.DataFrame | Record,
    *,
    response: str,
    terms: str | Sequence[str],
    select: str = "none",
    criterion: str = "bic",
    nonnegative: bool = False,
    t_stop: float | None = None,
    source: str = "",
) -> RegressionResult:
    """The regression program of 1970 on any table, or on that of a record, as ``damping regress`` runs it.

    Args:
        response: name of the dependent column.
        terms: products of powers of columns, ``"A^2*omega, A^3*omega^2"`` or a list.
        select, criterion, nonnegative, t_stop: how terms are selected.
        source: the file, as of a record.

    Raises:
        InputError: terms that cannot be parsed, a selection that does not exist, a column missing or without numbers.
        AnalysisError: a fit that cannot be made; a rank-deficient design names its columns.
    """
    from damping.regression import list_columns_for, parse_terms  # noqa: PLC0415 - other functions need no regression
    from damping.regression.design import list_required_columns, take_columns  # noqa: PLC0415 - as above
    from damping.regression.program import regression  # noqa: PLC0415 - as above
    from damping.regression.selecting import Choice  # noqa: PLC0415 - as above

    table, of = (frame.frame, frame.source) if isinstance(frame, Record) else (frame, "table")
    for name, value, kind in (("table", table, pd.DataFrame), ("response", response, str), ("source", source, str)):
        check_kind(value, kind, name)
    if not (isinstance(terms, str | Sequence) and all(isinstance(term, str) for term in terms)):
        raise InputError(f"terms is of type {type(terms).__name__}", expected="a text, or a list of terms")
    parsed = parse_terms(terms if isinstance(terms, str) else ", ".join(terms))
    choice = Choice(select, criterion, nonnegative, t_stop)
    names, source = list_columns_for(response, parsed), source or of
    table = table.set_axis([str(name) for name in table.columns], axis=1).reset_index(drop=True)
    labels = {"sweep"}.difference(names)  # no numbers, unless a term takes them so
    table = take_numbers(table, list_required_columns(names, list(table.columns)), source, labels)
    return RegressionResult(regression(take_columns(table, names, source), names[0], parsed, choice, Path(source).name))


@undisturbed
def condition(frame: pd.DataFrame, description: Mapping[str, object] | Description | str | Path) -> ConditionResult:
    """Reduce a raw accelerometer table to the record of one mode, as ``damping condition`` does.

    Args:
        description: the keys of a CONDITION.toml, or the path of one (:mod:`damping.signals.description`).

    Raises:
        InputError: a description or a table that contradicts itself.
        AnalysisError: a requested step cannot be done on this table.
    """
    from damping.signals.reading import check_raw, condition_steps, list_doubts, read_description  # noqa: PLC0415 - its schema loads slowly

    check_kind(frame, pd.DataFrame, "table")
    described = read_description(description)
    steps = condition_steps(raw := check_raw(frame, described), described)
    named = Record(steps[-1].after, described.title or "conditioned")
    return ConditionResult(named, named.source, steps=steps, doubts=list_doubts(raw, described, steps))


@undisturbed
def sweep(
    mode: Mode,
    *,
    force: Numbers,
    frequency: Sequence[float] | FloatArray,
    direction: Direction = "up",
    method: Method = "ritz",
    structure: bool = False,
    progress: Progress = silent,
) -> SweepResult:
    """Steady-state sweeps of a model, as ``damping sweep`` computes them.

    Args:
        force: one amplitude or several, each a sweep.
        frequency: Hz, rising.
        method: ``ritz`` or ``time``.
        structure: whether to leave out effects of the rig. Effects of one test are always left out.

    Raises:
        InputError: an invalid argument.
        AnalysisError: an effect of the model cannot be simulated, or a sweep has a point without a steady state.
    """
    from damping.effects import list_lasting  # noqa: PLC0415 - as the next
    from damping.gap.sweeping import simulate_sweeps  # noqa: PLC0415 - loads the diagnosis, which few functions need

    check_kind(mode, Mode, "mode")
    check_flags(structure=structure)
    levels, hertz = read_floats(force), read_floats(frequency)
    if levels is None or hertz is None:
        raise InputError("force or frequency is no number", expected="numbers, or lists of them, none masked")
    kept = list_lasting(mode.effects, of_rig=not structure)
    swept = simulate_sweeps(replace(mode, effects=kept), levels.tolist(), hertz, direction, method, watch(progress))
    left_out = tuple(name for name in mode.effects if name not in kept)
    of_rig = tuple(name for name in kept if name not in list_lasting(kept))
    return SweepResult(swept, mode.name, left_out, of_rig, mode.frequency)
