"""Campaigns: files of several levels, modes and sensors to one record per mode and the response of every sensor.

This module goes from the files to the result: each sensor's peak, at every mode and every tested and design level.

Results at a tested level are measured; at a design level they come from the laws of the mode's record. A band of modal
amplitude A at a modal force F gives one of damping ratio, z = F/(2 m w^2 A).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import exp, hypot, isfinite, log, pi
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.answer import (
    LEAST_SPREAD,
    NORMAL_90,
    At,
    Campaign,
    ModeAnswer,
    Response,
    SensorPrediction,
    compare_predictions,
    join_cautions,
    list_laws,
    predict_mode,
    rank_first,
)
from damping.campaign.decays import answer_decays
from damping.campaign.delays import describe_delay, measure_delay
from damping.campaign.modal_fit import Level
from damping.campaign.notches import find_notches
from damping.campaign.poles import receptance
from damping.campaign.records import DrivenMode, fit_right_levels, tie_modes
from damping.campaign.runs import LABEL_AGREES, ORDERS, Corrections, DesignLevel
from damping.campaign.sensors import describe_shares
from damping.campaign.sources import read_runs
from damping.errors import InputError
from damping.extrapolation.curve import trace_loads
from damping.extrapolation.prepared import PreparedRecord
from damping.formats.quantity import unit
from damping.formats.series import Summary
from damping.infer import SEED
from damping.records.text import DEFAULT_MAX_SIZE

_SEARCHED = 1.5  #: half of the range around a resonance that is searched for its peak, in half-power half-widths
#: Distance of the phase resonance from the fitted frequency, in half-power half-widths, beyond which a level is read at
#: the former: the fit has one frequency for a whole level, and a stiffness that changes with amplitude bends the peak.
BENT = 0.1
NOTCH_LEVELS = 10  #: levels at which responses are predicted between the lowest and the design level


def analyse(
    files: Sequence[Path],
    design: Sequence[DesignLevel | float] = (),
    frequencies: Sequence[float] = (),
    seed: int = SEED,
    max_size: int = DEFAULT_MAX_SIZE,
    corrections: Corrections | None = None,
    limits: Mapping[str, float] | None = None,
    before: Sequence[SensorPrediction] = (),
) -> Campaign:
    """Analyse the files of a campaign.

    Args:
        design: levels to predict at, in the unit of the drive; for free decays, amplitudes of the sensor that moves
            most. By default twice the top level. frequencies: of the modes, Hz, if they are not to be searched.
        corrections: of the content of the files. limits: largest allowed reading, by sensor, in its unit. before:
            predictions made before these runs.

    InputError: files that are not understood, or limits or earlier predictions for free decays, which have no input.
    AnalysisError: no mode can be followed over the levels.
    """
    runs, summary = read_runs(files, max_size, corrections)
    inputs = [level if isinstance(level, DesignLevel) else DesignLevel.flat(level) for level in design]
    names = runs[0].names
    unknown = next((name for name in limits or {} if name not in names), None)
    if unknown is not None:
        raise InputError(f"--limit of no sensor {unknown!r}", expected=f"one of {', '.join(names)}")
    if runs[0].is_time:
        if limits or before:
            option = "--limit" if limits else "--previous"
            raise InputError(f"{option} of free decays", expected=f"no {option}: it is for peaks under an input")
        return _summed_up(answer_decays(runs, inputs, frequencies, seed, summary), summary)
    tested = [float(run.level or 0.0) for run in runs]
    inputs = inputs or [DesignLevel.flat(2.0 * max(tested))]
    highest = tuple(float(level.level.max()) for level in inputs)
    trusted = [name for name in names if corrections and corrections.of(name).role == "sensor"]
    levels, misread = fit_right_levels(runs, frequencies, trusted)
    tied = tie_modes(levels, {**runs[0].left_out, **misread})
    summary.notes.extend(describe_shares(levels, trusted))
    delay = (levels[0].run.delay, measure_delay(levels)[1]) if levels[0].run.delay else None
    if delay:
        summary.note(describe_delay(*delay))
    modes = tuple(_answer_driven(levels, mode, inputs, seed, limits or {}) for mode in tied)
    drive = "base acceleration" if runs[0].is_base_driven else "force"
    known = Campaign(modes, tuple(tested), highest, runs[0].drive_unit, level_name=drive, delay=delay)
    campaign = _summed_up(known, summary)
    return replace(campaign, outcomes=compare_predictions(before, campaign))


def _summed_up(campaign: Campaign, summary: Summary) -> Campaign:
    """The campaign with the summary of its files and cautions on levels that lie apart."""
    for mode in campaign.modes:
        if mode.level_caution:
            summary.note(f"{mode.name}: {mode.level_caution}")
    return replace(campaign, summary=summary)


def _answer_driven(
    levels: Sequence[Level], mode: DrivenMode, design: Sequence[DesignLevel], seed: int, limits: Mapping[str, float]
) -> ModeAnswer:
    """Tested and design levels of a mode of a driven structure, and the notches required by ``limits``."""
    run = levels[0].run
    of_force = (abs(mode.residues[mode.reference]) if run.is_base_driven else 1.0) * unit(run.drive_unit).factor
    tested = [_find_input(level, at) for level, at in zip(levels, mode.frequency, strict=True)]
    wanted = [level.at(float(mode.frequency[-1])) for level in design]
    # levels at which responses are needed for notches
    asked = [*tested, *wanted]
    if limits:
        asked += map(float, np.geomspace(0.5 * min(tested), max(asked), NOTCH_LEVELS))
    predicted, prepared = predict_mode(mode.record, mode.mode, [of_force * level for level in asked], seed)
    loads, apart = predicted.loads, predicted.plan.fit.level_caution
    curve = trace_loads(loads, prepared.backbone, prepared.data)
    fitted = zip(levels, tested, loads.average.median, mode.frequency, mode.ratio, strict=False)
    steady = [_find_steady(prepared, lev.name, of_force * F, A, float(f), float(z)) for lev, F, A, f, z in fitted]
    moved = [_is_moved(f, z, float(at)) for at, (f, z) in zip(mode.frequency, steady, strict=True)]
    straight = [lev for lev, bent in zip(levels, moved, strict=True) if not bent] or levels
    places = []
    for k, level in enumerate(asked):
        measured = k < len(levels)
        if measured:
            spread, (frequency, z) = NORMAL_90 * float(hypot(mode.ratio_sd[k], LEAST_SPREAD)), steady[k]
            ratio = (z, z * exp(-spread), z * exp(spread))
        else:
            zeta, frequency = curve.damping_ratio, float(curve.frequency.median[k])
            ratio = (float(zeta.median[k]), float(zeta.low[k]), float(zeta.high[k]))
        cautions = (*join_cautions(prepared, apart, () if measured else curve.cautions[k]), *mode.cautions)
        of_run = levels[k] if measured else None
        shown = of_run if of_run and (all(moved) or not moved[k]) else straight[-1]
        at = frequency, ratio if isfinite(frequency) and isfinite(sum(ratio)) else None
        places.append(_answer_level(shown, of_run, mode, level, *at, cautions))
    known = mode.mode.name, places[len(tested) :], max(tested)
    swept = float(levels[-1].f.min()), float(levels[-1].f.max())
    notches = [find_notches(*known, level, limits, swept, run.drive_unit) for level in wanted]
    forces = tuple(float(of_force * level) for level in wanted)
    answers = tuple(places[: len(tested) + len(wanted)])
    fields = (mode.left_out, mode.record, mode.mode, forces, tuple(chain.from_iterable(notches)), apart)
    return ModeAnswer(rank_first(prepared, seed), answers, *fields, list_laws(predicted))


def _answer_level(
    shown: Level,
    tested: Level | None,
    mode: DrivenMode,
    level: float,
    frequency: float,
    ratio: tuple[float, float, float] | None,
    cautions: tuple[str, ...],
) -> At:
    """The responses at a ``level`` at the mode, of the run ``tested`` at it, if any, by the fit of the level ``shown``.

    Unless that is the run's own, the residues are those of all levels.
    """
    run = shown.run
    response: tuple[Response, ...] = ()
    if ratio:
        residues = mode.residues_at(shown) if shown is tested else (mode.residues, mode.residues_sd)
        drive = level * unit(run.drive_unit).factor
        response = tuple(_list_responses(shown, mode.number, residues, frequency, ratio, drive))
    stated = float(tested.run.level or 0.0) if tested else level
    if stated == level:
        return At(level, tested is not None, frequency, ratio, response, cautions)
    cautions = (*cautions, f"notched: the input at this mode was {level:.3g} {run.drive_unit}")
    return At(stated, True, frequency, ratio, response, cautions, level)


def _find_steady(
    prepared: PreparedRecord, sweep: str, force: float, amplitude: float, frequency: float, ratio: float
) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of a level: as fitted, or F/(2 m w^2 A) at the phase resonance of its rows.

    Steady states of swept rows are at resonance under less force than was swept with, and so at another damping:
    ``amplitude`` is that under the full ``force``, by the laws of all levels; if it is NaN, the tested one is used.
    """
    data, k = prepared.data, list(prepared.data.sweeps).index(sweep)
    w, A, F = float(data.tested_omega[k]), float(data.tested_amplitude[k]), float(data.tested_force[k])
    swept = bool(prepared.measured.notes)
    if not swept and not _is_moved(w / (2.0 * pi), ratio, frequency):
        return frequency, ratio
    A, F = (amplitude, force) if swept and isfinite(amplitude) else (A, F)
    return w / (2.0 * pi), F / (2.0 * prepared.mode.mass * w**2 * A)


def _is_moved(resonance: float, ratio: float, fitted: float) -> bool:
    """Whether a phase resonance (Hz) lies beside the ``fitted`` frequency by more than ``BENT``."""
    return abs(resonance / fitted - 1.0) > BENT * ratio


def _find_input(level: Level, frequency: float) -> float:
    """The input at a mode in the unit of the drive: the run's level, unless it was notched there."""
    stated = float(level.run.level or 0.0)
    measured = float(np.interp(frequency, level.f, level.drive)) / unit(level.run.drive_unit).factor
    return stated if abs(measured / stated - 1.0) <= LABEL_AGREES else measured


def _list_responses(
    level: Level,
    k: int,
    seen: tuple[FloatArray, FloatArray],
    frequency: float,
    ratio: tuple[float, float, float],
    drive: float,
) -> Iterator[Response]:
    """Peak of every sensor kept, at a band of damping ratios (median, low, high); the largest gives the lowest peak.

    ``seen``: residues (sensors,) of mode number ``k``, NaN for a sensor left out, and their relative standard errors.
    """
    residues, residues_sd = seen
    peaks = np.array([_peaks(level, k, residues, z) for z in (ratio[0], ratio[2], ratio[1])]) * drive
    for s, sensor in enumerate(level.run.channels):
        if np.isfinite(residues[s]):
            size = peaks[:, s] / (2.0 * pi * frequency) ** (2 - ORDERS[sensor.quantity]) / unit(sensor.unit).factor
            spread = NORMAL_90 * float(hypot(residues_sd[s], level.fit.noise[0] / 3.0))
            median, low, high = (float(part) for part in size)
            below, above = hypot(log(median / low), spread), hypot(log(high / median), spread)
            band = (median, median * exp(-below), median * exp(above))
            yield Response(sensor.name, sensor.quantity, sensor.unit, band)


def _peaks(level: Level, k: int, residues: FloatArray, ratio: float) -> FloatArray:
    """|H| of each sensor (sensors,) at its peak nearest to the resonance, including the other modes and the base.

    Modes keep the distances of the level: neighbours move with amplitude too. For a sensor without a peak there (on the
    flank of a neighbouring mode) it is |H| at the resonance.
    """
    fit, frequency = level.fit, float(level.fit.frequency[k])
    f = frequency * (1.0 + _SEARCHED * ratio * np.linspace(-1.0, 1.0, 401))
    columns = fit.columns(f)
    columns[:, 2 + k] = (
        fit.sign * (2.0 * pi * f) ** 2 * receptance(f, frequency, ratio, float(fit.slope[k]), float(fit.friction[k]))
    )
    coefficients = fit.local[k].copy()
    coefficients[:, 2 + k] = np.nan_to_num(residues)
    size = np.abs(coefficients @ columns.T)
    middle = len(f) // 2
    inner = (size[:, 1:-1] >= size[:, :-2]) & (size[:, 1:-1] > size[:, 2:])
    places = [np.flatnonzero(row) + 1 for row in inner]
    nearest = [int(p[np.argmin(np.abs(p - middle))]) if len(p) else middle for p in places]
    return np.asarray(size[np.arange(len(size)), nearest])
