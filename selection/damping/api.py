"""From a record to an answer: the functions of ``import damping as dp``, each of which checks, computes and returns.

Whatever is wrong with an argument is an InputError at once, before any work.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.extrapolation import check_loads, extrapolate_loads
from damping.extrapolation.near import near_resonance
from damping.gap.corrected import sample_effects
from damping.gap.diagnose import diagnose as diagnose_gap
from damping.gap.model import Simulate
from damping.gap.problem import State
from damping.gap.sweeping import Direction, Method, simulate_sweeps
from damping.infer.observations import observe
from damping.predict.measured import as_driven_by_force, prepare
from damping.progress import Progress, silent, single_threaded
from damping.ranking import rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records.audit import Audit, audit
from damping.records.keys import describe_nearest
from damping.records.mode import Mode
from damping.records.record import Record
from damping.regression.design import list_required_columns, take_columns
from damping.regression.program import regression
from damping.regression.selecting import Choice
from damping.regression.terms import list_columns_of, parse_terms
from damping.result import (
    ConditionResult,
    DiagnosisResult,
    LoadsResult,
    RankingResult,
    RegressionResult,
    SweepResult,
)
from damping.signals.description import Description
from damping.signals.reading import check_raw, describe, read_description
from damping.signals.uncertainty import condition_steps

#: Seed of everything sampled, that of the command line.
SEED = 1970


def _check_kind(value: object, kind: type, name: str) -> None:
    """InputError unless ``value`` is of its kind."""
    if not isinstance(value, kind):
        raise InputError(f"{name} is a {type(value).__name__}", expected=f"a {kind.__name__}")


def check(record: Record, mode: Mode | None = None) -> Audit:
    """Whether a record is what it seems to be, beside the mode that simulates it: what ``damping check`` says.

    Raises:
        InputError: an argument of another kind.
    """
    _check_kind(record, Record, "record")
    if mode is not None:
        _check_kind(mode, Mode, "mode")
    return audit(record, mode)


def _admit(record: Record, mode: Mode | None, despite: Collection[str]) -> Audit:
    """The audit of a record that may be worked on; Refused where a finding refuses that is not in ``despite``."""
    findings = check(record, mode)
    findings.require(despite)
    return findings


@single_threaded
def rank(
    record: Record,
    mode: Mode | None = None,
    *,
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> RankingResult:
    """Every candidate damping law of a record, best first, as ``damping rank`` lists them.

    Args:
        mode: where given, cautions say what is odd about it beside the record. progress: shows how far the work is.
        despite: checks of the audit whose refusal is passed over, such as ``("phase-sign",)``.

    Args:
        despite: checks of the audit whose refusal is passed over.

    Raises:
        InputError: an argument of another kind.
        AnalysisError: no candidate could be fitted.
    """
    findings = _admit(record, mode, despite)
    measured = prepare(record, mode)
    data = observe(measured.record)
    laws = candidate_laws()
    with progress("ranking", len(laws)) as done:
        return RankingResult(rank_laws(data, seed, laws, done), measured.mode, findings, measured.said)


@single_threaded
def extrapolate(
    record: Record,
    mode: Mode,
    forces: Sequence[float],
    level: float = 0.9,
    *,
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> LoadsResult:
    """Resonant amplitude at each force, as ``damping extrapolate`` predicts it.

    Args:
        forces: force amplitudes, in the unit of the record (of a base-driven mode the base's acceleration).
        level: content of the bands, between 0 and 1.

    Raises:
        InputError: a force or a level that is none, or an argument of another kind.
        AnalysisError: the levels do not allow a prediction.
    """
    _check_kind(record, Record, "record")
    _check_kind(mode, Mode, "mode")
    asked = check_loads(forces, level)
    findings = _admit(record, mode, despite)
    measured = prepare(record, mode)
    of = measured.mode or mode
    found = extrapolate_loads(near_resonance(measured.record), asked, level, seed, mode=of, progress=progress)
    return LoadsResult(found, of, found.plan.data, findings, measured.said)


@single_threaded
def diagnose(
    record: Record,
    mode: Mode,
    *,
    states: Sequence[State] = (),
    simulate: Simulate | None = None,
    posterior: bool = False,
    seed: int = SEED,
    despite: Collection[str] = (),
    progress: Progress = silent,
) -> DiagnosisResult:
    """Why a record departs from the simulation ``mode``, as ``damping gap`` diagnoses it.

    Args:
        states: records of further states of the structure (masses added, fuel levels, ring-downs), each with its mode:
            the effects are shared.
        simulate: a simulation of your own: ``function(force, frequency, *, name=(value, tolerance), ...)`` returns
            amplitude and phase lag, (n,) each; ``mode`` stands for it where an effect needs a mass or a frequency.
        posterior: whether the strengths of the leading explanation are sampled too.

    Raises:
        InputError: an argument of another kind.
        AnalysisError: model and record are of different modes, or there are too many rows.
    """
    _check_kind(mode, Mode, "mode")
    findings = _admit(record, mode, despite)
    for own, state in states:
        _check_kind(own, Record, "record of a state")
        _check_kind(state, Mode, "mode of a state")
        _admit(own, state, despite)
    forced, said = as_driven_by_force(record, mode)
    found = diagnose_gap(record, forced, states=states, simulate=simulate)
    found = replace(found, cautions=(*map(str, findings.findings), *said, *found.cautions))
    if not posterior:
        return DiagnosisResult(found, audit=findings)
    with progress("posterior", 1) as done:
        sampled = sample_effects(found.leading.best, seed)
        done("done")
    return DiagnosisResult(found, sampled, findings)


@single_threaded
def regress(
    frame: pd.DataFrame,
    *,
    response: str,
    terms: str | Sequence[str],
    select: str = "none",
    criterion: str = "bic",
    nonnegative: bool = False,
    t_stop: float | None = None,
    source: str = "table",
) -> RegressionResult:
    """The regression program of 1970 on any table, as ``damping regress`` runs it.

    Args:
        response: name of the dependent column. terms: products of powers of columns, ``"A^2*omega, A^3*omega^2"`` or
            a list. select, criterion, nonnegative, t_stop: how terms are selected. source: of the table, for messages.

    Raises:
        InputError: terms that cannot be parsed, a selection that does not exist, a column that is missing or
            no numbers.
        AnalysisError: a fit that cannot be made; a rank-deficient design names its columns.
    """
    _check_kind(frame, pd.DataFrame, "table")
    parsed = parse_terms(terms if isinstance(terms, str) else ", ".join(terms))
    choice = Choice(select, criterion, nonnegative, t_stop)
    wanted = response.strip()
    if not wanted:
        raise InputError("the name of the response is empty", expected="a column of the table")
    names = tuple(dict.fromkeys([wanted, *list_columns_of(parsed)]))
    table = frame.reset_index(drop=True)
    _check_numbers(table, list_required_columns(names, [str(name) for name in table.columns]), source)
    return RegressionResult(regression(take_columns(table, names, source), wanted, parsed, choice, Path(source).name))


def _check_numbers(table: pd.DataFrame, names: Sequence[str], source: str) -> None:
    """InputError for the first column that is missing, or holds what is no finite number; ``sweep`` may be text."""
    for name in names:
        if name not in table.columns:
            hint = describe_nearest(name, map(str, table.columns))
            raise InputError(f"no column {name!r}", file=source, expected=f"{hint} or another column")
        if name == "sweep" and not pd.api.types.is_numeric_dtype(table[name]):
            continue
        numbers = pd.to_numeric(table[name], errors="coerce").to_numpy(np.float64)
        if not np.isfinite(numbers).all():
            row = int(np.argmin(np.isfinite(numbers)))
            message = f"{str(table[name].iloc[row])!r} in row {row}"
            raise InputError(message, file=source, column=name, expected="a finite number")


@single_threaded
def condition(frame: pd.DataFrame, description: Mapping[str, object] | Description | str | Path) -> ConditionResult:
    """A raw accelerometer table to the record of one mode, as ``damping condition`` does it.

    Args:
        description: the keys of a CONDITION.toml, or the path of one (:mod:`damping.signals.description`).

    Raises:
        InputError: a description or a table that contradicts itself.
        AnalysisError: the steps that are asked for cannot be done on this table.
    """
    _check_kind(frame, pd.DataFrame, "table")
    if isinstance(description, str | Path):
        described = read_description(description)
    else:
        described = description if isinstance(description, Description) else describe(description)
    steps = condition_steps(check_raw(frame, described), described)
    name = described.title or "conditioned"
    return ConditionResult(Record(steps[-1].after, name), name, steps)


@single_threaded
def sweep(
    mode: Mode,
    *,
    force: float | Sequence[float],
    frequency: Sequence[float] | FloatArray,
    direction: Direction = "up",
    method: Method = "ritz",
    progress: Progress = silent,
) -> SweepResult:
    """Steady-state sweeps of a model, as ``damping sweep`` computes them.

    Args:
        force: one amplitude or several, each a sweep. frequency: Hz, rising. method: ``ritz`` or ``time``.

    Raises:
        InputError: an argument that is not what it should be.
        AnalysisError: the model has an effect that is not simulated, or no steady state somewhere in a sweep.
    """
    _check_kind(mode, Mode, "mode")
    levels = [float(level) for level in np.atleast_1d(np.asarray(force, dtype=float))]
    hertz = np.asarray(frequency, dtype=float)
    return SweepResult(simulate_sweeps(mode, levels, hertz, direction, method, progress), mode.name)
