"""Campaigns: files of several levels, modes and sensors to one record per mode and the response of every sensor.

Results at a tested level are measured; at a design level they come from the laws of the mode's record. A band of modal
amplitude A at a modal force F gives one of damping ratio, z = F/(2 m w^2 A).
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import hypot, inf, isfinite, pi
from pathlib import Path

import numpy as np

from damping.campaign.answer import Campaign, ModeAnswer, PredictedMode, bound_ratio, predict_at, predict_mode
from damping.campaign.bends import unbend
from damping.campaign.comparison import EarlierCampaign, compare_predictions, describe_changes
from damping.campaign.decays import answer_decays
from damping.campaign.delays import describe_delay, measure_delay
from damping.campaign.modal_fit import MOVED, Level
from damping.campaign.notches import find_notches
from damping.campaign.records import DrivenMode, describe_lost, fit_right_levels, join_modes
from damping.campaign.responses import Forecast, add_responses, describe_turned, find_input
from damping.campaign.runs import CampaignRun, Corrections, DesignLevel
from damping.campaign.sensors import check_drives, describe_shares
from damping.campaign.sources import read_runs
from damping.campaign.values import At
from damping.errors import InputError
from damping.extrapolation.curve import trace_loads
from damping.forces import damping_ratio
from damping.formats.quantity import unit
from damping.formats.series import Stated, Summary
from damping.infer import SEED
from damping.records.text import DEFAULT_MAX_SIZE
from damping.signals.windows import PERIODS

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
    before: EarlierCampaign | None = None,
    facts: Stated | None = None,
) -> Campaign:
    """Analyse the files of a campaign.

    Args:
        design: levels to predict at, in the unit of the drive; for free decays, amplitudes of the sensor that moves
            most. By default twice the top level.
        frequencies: of the modes, Hz, if they are not to be searched.
        corrections: of the content of the files.
        limits: largest allowed reading, by sensor, in its unit.
        before: what was known before these runs.
        facts: columns and units of tables of steady states.

    InputError: files that are not understood, limits or earlier predictions for free decays, which have no input, or
    earlier predictions or design levels in another unit.
    AnalysisError: no mode can be followed over the levels.
    """
    runs, summary = read_runs(files, max_size, corrections, facts)
    _require_held(runs, frequencies)
    inputs = [level if isinstance(level, DesignLevel) else DesignLevel.flat(level) for level in design]
    names = runs[0].names
    unknown = next((name for name in limits or {} if name not in names), None)
    if unknown is not None:
        raise InputError(f"--limit of no sensor {unknown!r}", expected=f"one of {', '.join(names)}")
    of = runs[0].channels[0].unit if runs[0].is_time else runs[0].drive_unit
    for text in (level.unit for level in inputs):
        _require_unit(text, of, f"--design in {text}", f"levels in {of}, the unit of the drive")
    if runs[0].is_time:
        if limits or before:
            option = "--limit" if limits else "--previous"
            raise InputError(f"{option} of free decays", expected=f"no {option}: it is for peaks under an input")
        return _with_summary(answer_decays(runs, inputs, frequencies, seed, summary), summary)
    if before:
        stated = f"levels in {before.unit} of --previous, in {of} of these files"
        _require_unit(before.unit, of, stated, "levels in one unit")
    trusted = [name for name in names if corrections and corrections.of(name).role == "sensor"]
    campaign = _with_summary(_answer_sweeps(runs, inputs, frequencies, seed, summary, trusted, limits or {}), summary)
    if before is None:
        return campaign
    outcomes, changes = compare_predictions(before, campaign), describe_changes(before, campaign)
    return replace(campaign, outcomes=outcomes, changes=changes)


def _require_unit(text: str, of: str, stated: str, expected: str) -> None:
    """InputError for levels in a unit other than that ``of`` the files; '' where one of them is not stated."""
    if text and of and text != of and not unit(text).agrees_with(unit(of)):
        raise InputError(stated, expected=expected)


def _require_held(runs: Sequence[CampaignRun], frequencies: Sequence[float]) -> None:
    """InputError for the frequency of a mode, Hz, that lies beyond the rows of all runs, or in no window of a decay."""
    low, high = min(float(run.x.min()) for run in runs), max(float(run.x.max()) for run in runs)
    if runs[0].is_time:  # the upper limit, by the sampling rate, is that of the window
        low, high = PERIODS / max(float(run.x[-1] - run.x[0]) for run in runs), inf
    for at in frequencies:
        if not low / (1.0 + MOVED) <= at <= high * (1.0 + MOVED):
            held = f"{low:.4g} to {high:.4g} Hz" if isfinite(high) else f"{low:.4g} Hz or more"
            raise InputError(f"--modes {at:g}: no run holds that frequency", expected=held)


def _answer_sweeps(
    runs: Sequence[CampaignRun],
    design: Sequence[DesignLevel],
    frequencies: Sequence[float],
    seed: int,
    summary: Summary,
    trusted: Collection[str],
    limits: Mapping[str, float],
) -> Campaign:
    """The modes of driven runs, with notes on sensors and delay in ``summary``; ``trusted`` sensors are not doubted."""
    tested = [float(run.level or 0.0) for run in runs]
    inputs = design or [DesignLevel.flat(2.0 * max(tested))]
    highest = tuple(float(level.level.max()) for level in inputs)
    check_drives(runs, trusted)
    levels, misread = fit_right_levels(runs, frequencies, trusted)
    levels = unbend(levels)
    tied = join_modes(levels, {**runs[0].left_out, **misread}, frequencies)
    summary.notes.extend([*describe_shares(levels, trusted), *describe_lost(levels, tied, frequencies)])
    summary.notes.extend(f"caution: {mode.mode.name}: {text}" for mode in tied for text in mode.cautions)
    delay = (levels[0].run.delay, measure_delay(levels)[1]) if levels[0].run.delay else None
    if delay:
        summary.note(describe_delay(*delay))
    forecasts = [_forecast(levels, mode, inputs, seed, bool(limits)) for mode in tied]
    modes = tuple(_answer_driven(levels, mode, forecasts, inputs, limits) for mode in forecasts)
    drive = "base acceleration" if runs[0].is_base_driven else "force"
    return Campaign(modes, tuple(tested), highest, runs[0].drive_unit, level_name=drive, delay=delay)


def _with_summary(campaign: Campaign, summary: Summary) -> Campaign:
    """The campaign with the summary of its files and cautions on levels that lie apart."""
    for mode in campaign.modes:
        for text in filter(None, (mode.level_caution, mode.shape_caution)):
            summary.note(f"{mode.name}: {text}")
    return replace(campaign, summary=summary)


def _forecast(
    levels: Sequence[Level], mode: DrivenMode, design: Sequence[DesignLevel], seed: int, limited: bool
) -> Forecast:
    """Frequency and damping of a mode of a driven structure at its tested, design and, if ``limited``, further levels.

    The further levels are those at which responses are needed for notches.
    """
    run, known = levels[0].run, len(levels)
    per_input = float((abs(mode.residues[mode.reference]) if run.is_base_driven else 1.0) * unit(run.drive_unit).factor)
    tested = [find_input(level, at) for level, at in zip(levels, mode.frequency, strict=True)]
    wanted = [level.at(float(mode.frequency[-1])) for level in design]
    inputs = [*tested, *wanted]
    if limited:
        inputs += np.geomspace(0.5 * min(tested), max(inputs), NOTCH_LEVELS).tolist()
    prediction = predict_mode(mode.record, mode.mode, [per_input * level for level in inputs], seed)
    curve = trace_loads(prediction.predicted.loads, prediction.prepared.backbone, prediction.prepared.data)
    steady = [_find_steady(prediction, mode, level.name, k) for k, level in enumerate(levels)]
    moved = [_is_moved(f, z, float(at)) for at, (f, z) in zip(mode.frequency, steady, strict=True)]
    straight = [k for k in range(known) if not moved[k]] or range(known)  # levels whose fit holds at the resonance
    shown = tuple(levels[k if k in straight else straight[-1]] for k in range(len(inputs)))
    places = []
    for k, (level, (frequency, z)) in enumerate(zip(levels, steady, strict=True)):
        ratio, errors = bound_ratio(z, mode.ratio_sd[k]), _find_errors(mode, level, k, frequency, z, read=moved[k])
        cautions, stated, reached = (*prediction.cautions(), *mode.cautions), float(level.run.level or 0.0), None
        if tested[k] != stated:
            reached = tested[k]
            cautions = (*cautions, f"notched: the input at this mode was {reached:.3g} {run.drive_unit}")
        places.append(At(stated, True, frequency, ratio, (), cautions, reached, *errors))
    for k in range(known, len(inputs)):
        cautions = (*prediction.cautions(curve.cautions[k]), *mode.cautions)
        places.append(predict_at(curve, k, inputs[k], cautions))
    answer = prediction.answer(places, mode.left_out, [per_input * level for level in wanted])
    return Forecast(mode, answer, shown, is_steady=not prediction.prepared.measured.notes)


def _answer_driven(
    levels: Sequence[Level],
    own: Forecast,
    forecasts: Sequence[Forecast],
    design: Sequence[DesignLevel],
    limits: Mapping[str, float],
) -> ModeAnswer:
    """A mode with the responses of its sensors at all levels, and the notches required by ``limits``."""
    run = levels[0].run
    places = [add_responses(levels, own, forecasts, k) for k in range(len(own.answer.places))]
    known = own.answer.name, places[len(levels) :], max(at.input for at in places[: len(levels)])
    swept = float(levels[-1].f.min()), float(levels[-1].f.max())
    wanted = places[len(levels) :][: len(design)]
    notches = [find_notches(*known, at.level, limits, swept, run.drive_unit) for at in wanted]
    turned = describe_turned(own, forecasts, places[: len(levels)], run.drive_unit)
    if turned:
        wanted = [replace(at, cautions=(*at.cautions, turned)) for at in wanted]
    answers = (*places[: len(levels)], *wanted)
    return replace(own.answer, places=answers, notches=tuple(chain.from_iterable(notches)), shape_caution=turned)


def _find_steady(prediction: PredictedMode, mode: DrivenMode, sweep: str, k: int) -> tuple[float, float]:
    """Frequency (Hz) and damping ratio of level number ``k``: as fitted, or F/(2 m w^2 A) at its phase resonance.

    Steady states of swept rows are at resonance under less force than was swept with, and so at another damping: their
    A is that ``prediction`` gives under the full force, by the laws of all levels, or the tested one if there is none.
    """
    prepared, loads, frequency, ratio = prediction.prepared, prediction.predicted.loads, mode.frequency, mode.ratio
    data, at = prepared.data, list(prepared.data.sweeps).index(sweep)
    w, A, F = float(data.tested_omega[at]), float(data.tested_amplitude[at]), float(data.tested_force[at])
    swept = bool(prepared.measured.notes)
    if not swept and not _is_moved(w / (2.0 * pi), float(ratio[k]), float(frequency[k])):
        return float(frequency[k]), float(ratio[k])
    if swept and isfinite(loads.average.median[k]):
        A, F = loads.average.median[k], float(loads.force[k])
    return w / (2.0 * pi), damping_ratio(F, A, prepared.mode.mass * w**2)


def _find_errors(
    mode: DrivenMode, level: Level, k: int, frequency: float, ratio: float, *, read: bool
) -> tuple[float, float]:
    """Standard errors of frequency (Hz) and damping ratio of level number ``k``, by the noise of its rows.

    If ``read`` at the phase resonance of rows: with the error of a phase, of which the slope is 1/(z f), as well.
    """
    frame = mode.record.frame
    phase = float(frame.loc[frame["sweep"] == level.name, "phase_sd"].median()) if read else 0.0
    return frequency * hypot(mode.frequency_sd[k], ratio * phase), ratio * hypot(mode.ratio_sd[k], phase)


def _is_moved(resonance: float, ratio: float, fitted: float) -> bool:
    """Whether a phase resonance (Hz) lies beside the ``fitted`` frequency by more than ``BENT``."""
    return abs(resonance / fitted - 1.0) > BENT * ratio
