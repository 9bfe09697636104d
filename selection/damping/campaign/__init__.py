"""Campaigns: files of several levels, modes and sensors to one record per mode and the response of every sensor.

This module goes from the files to the result: each sensor's peak, at every mode and every tested and design level.

Results at a tested level are measured; at a design level they come from the laws of the mode's record. A band of modal
amplitude A at a modal force F gives one of damping ratio, z = F/(2 m w^2 A).

A notch lowers the input at a mode so that a sensor keeps to its limit. The upper end of the 90 % band, below which the
peak lies with 95 %, is interpolated over levels; the input at which it meets the limit is the allowed input L. The
notch begins and ends where the full input D, beside the resonance, gives the same amplitude, and so the same z. With
r^2 = (f/f_n)^2 these are the roots of |1 - r^2 + 2 i z r| = 2 z D/L, r^2 = 1 - 2 z^2 +- 2 z sqrt((D/L)^2 - 1 + z^2), or
the end of the sweep if that comes first.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from math import exp, hypot, inf, log, log10, pi, sqrt
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.answer import (
    LEAST_SPREAD,
    NORMAL_90,
    At,
    Campaign,
    ModeAnswer,
    Notch,
    Response,
    SensorPrediction,
    compare_predictions,
    join_cautions,
    list_laws,
    predict_mode,
    rank_first,
)
from damping.campaign.decays import answer_decays
from damping.campaign.modal_fit import Level
from damping.campaign.poles import receptance
from damping.campaign.records import DrivenMode, fit_right_levels, tie_modes
from damping.campaign.runs import LABEL_AGREES, ORDERS, Corrections, DesignLevel
from damping.campaign.sensors import describe_shares
from damping.campaign.sources import read_runs
from damping.errors import InputError
from damping.extrapolation.prepared import PreparedRecord
from damping.formats.quantity import unit
from damping.formats.series import Summary
from damping.infer import SEED
from damping.records.text import DEFAULT_MAX_SIZE

_SEARCHED = 1.5  #: half of the range around a resonance that is searched for its peak, in half-power half-widths
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
    modes = tuple(_answer_driven(levels, mode, inputs, seed, limits or {}) for mode in tied)
    drive = "base acceleration" if runs[0].is_base_driven else "force"
    campaign = _summed_up(Campaign(modes, tuple(tested), highest, runs[0].drive_unit, level_name=drive), summary)
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
    bands = np.array([loads.average.median, loads.average.low, loads.average.high]).T
    fitted = zip(levels, tested, bands[:, 0], mode.frequency, mode.ratio, strict=False)
    steady = [_find_steady(prepared, lev.name, of_force * F, A) or (float(f), float(z)) for lev, F, A, f, z in fitted]
    frequency = _frequencies(np.array([f for f, _ in steady]), bands[:, 0], len(levels))
    places = []
    for k, level in enumerate(asked):
        measured = k < len(levels)
        ratio = None
        if measured:
            spread, z = NORMAL_90 * float(hypot(mode.ratio_sd[k], LEAST_SPREAD)), steady[k][1]
            ratio = (z, z * exp(-spread), z * exp(spread))
        elif np.isfinite(bands[k]).all():
            per_amplitude = of_force * level / (2.0 * mode.mode.mass * (2.0 * pi * frequency[k]) ** 2)
            z, high, low = (float(per_amplitude / A) for A in bands[k])
            ratio = (z, low, high)
        cautions = (*join_cautions(prepared, apart, () if measured else loads.cautions[k]), *mode.cautions)
        of_run = levels[k] if measured else None
        places.append(_answer_level(levels[-1], of_run, mode, level, float(frequency[k]), ratio, cautions))
    known = mode.mode.name, places[len(tested) :], max(tested)
    swept = float(levels[-1].f.min()), float(levels[-1].f.max())
    notches = [find_notches(*known, level, limits, swept, run.drive_unit) for level in wanted]
    forces = tuple(float(of_force * level) for level in wanted)
    answers = tuple(places[: len(tested) + len(wanted)])
    fields = (mode.left_out, mode.record, mode.mode, forces, tuple(chain.from_iterable(notches)), apart)
    return ModeAnswer(rank_first(prepared, seed), answers, *fields, list_laws(predicted))


def _answer_level(
    highest: Level,
    tested: Level | None,
    mode: DrivenMode,
    level: float,
    frequency: float,
    ratio: tuple[float, float, float] | None,
    cautions: tuple[str, ...],
) -> At:
    """The responses at a ``level`` at the mode: of the run ``tested`` at it, else by the ``highest`` level."""
    run = (tested or highest).run
    response: tuple[Response, ...] = ()
    if ratio:
        residues = mode.residues_at(tested) if tested else (mode.residues, mode.residues_sd)
        drive = level * unit(run.drive_unit).factor
        response = tuple(_list_responses(tested or highest, mode.number, residues, frequency, ratio, drive))
    stated = float(tested.run.level or 0.0) if tested else level
    if stated == level:
        return At(level, tested is not None, frequency, ratio, response, cautions)
    cautions = (*cautions, f"notched: the input at this mode was {level:.3g} {run.drive_unit}")
    return At(stated, True, frequency, ratio, response, cautions, level)


def _find_steady(prepared: PreparedRecord, sweep: str, force: float, amplitude: float) -> tuple[float, float] | None:
    """Frequency (Hz) and damping ratio F/(2 m w^2 A) of a swept level made steady; None if its rows were steady.

    Steady states of swept rows are at resonance under less force than was swept with, and so at another damping.
    ``amplitude`` is that under the full ``force``, by the laws of all levels; if it is NaN, the tested one is used.
    """
    if not prepared.measured.notes:
        return None
    data, k = prepared.data, list(prepared.data.sweeps).index(sweep)
    w, A, F = data.tested_omega[k], data.tested_amplitude[k], data.tested_force[k]
    A, F = (amplitude, force) if np.isfinite(amplitude) else (A, F)
    return float(w / (2.0 * pi)), float(F / (2.0 * prepared.mode.mass * w**2 * A))


def _find_input(level: Level, frequency: float) -> float:
    """The input at a mode in the unit of the drive: the run's level, unless it was notched there."""
    stated = float(level.run.level or 0.0)
    measured = float(np.interp(frequency, level.f, level.drive)) / unit(level.run.drive_unit).factor
    return stated if abs(measured / stated - 1.0) <= LABEL_AGREES else measured


def _frequencies(tested: FloatArray, amplitude: FloatArray, count: int) -> FloatArray:
    """Tested frequencies, then those of further levels on the straight line through the tested ones over amplitude."""
    beyond = amplitude[count:]
    if count < 3 or not np.isfinite(amplitude).all():
        return np.concatenate([tested, np.full(len(beyond), tested[-1])])
    slope, start = np.polyfit(amplitude[:count], tested, 1)
    return np.concatenate([tested, start + slope * beyond])


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
    peaks = np.array([_peaks(level, k, residues, frequency, z) for z in (ratio[0], ratio[2], ratio[1])]) * drive
    for s, sensor in enumerate(level.run.channels):
        if np.isfinite(residues[s]):
            size = peaks[:, s] / (2.0 * pi * frequency) ** (2 - ORDERS[sensor.quantity]) / unit(sensor.unit).factor
            spread = NORMAL_90 * float(hypot(residues_sd[s], level.fit.noise[0] / 3.0))
            median, low, high = (float(part) for part in size)
            below, above = hypot(log(median / low), spread), hypot(log(high / median), spread)
            band = (median, median * exp(-below), median * exp(above))
            yield Response(sensor.name, sensor.quantity, sensor.unit, band)


def _peaks(level: Level, k: int, residues: FloatArray, frequency: float, ratio: float) -> FloatArray:
    """|H| of each sensor (sensors,) at its peak nearest to the resonance, including the other modes and the base.

    For a sensor without a peak there (on the flank of a neighbouring mode) it is |H| at the resonance.
    """
    fit = level.fit
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


def find_notches(
    mode: str,
    places: Sequence[At],
    top: float,
    design: float,
    limits: Mapping[str, float],
    swept: tuple[float, float] = (0.0, inf),
    drive_unit: str = "",
) -> tuple[Notch, ...]:
    """The notch of each limited sensor at a mode, at a design level.

    Args:
        places: levels with responses and damping ratios, from well below to the design level. top: largest tested
            level. limits: by sensor, in its unit. swept: lowest and highest frequency of the sweep, Hz. drive_unit: of
            levels.
    """
    notches = []
    for sensor, limit in limits.items():
        rows = sorted(
            (at.level, response.band[2], at.ratio[2], at.frequency, response.unit)
            for at in places
            for response in at.response
            if response.sensor == sensor and at.ratio is not None
        )
        if not rows:
            continue
        level, upper, ratio, frequency = (np.array([row[k] for row in rows], dtype=float) for k in range(4))
        allowed = _invert(level, upper, limit)
        z, f = (float(np.interp(np.log(allowed), np.log(level), values)) for values in (ratio, frequency))
        low, high = _find_ends(f, z, design / allowed, swept) if allowed < design else (None, None)
        depth = max(20.0 * log10(design / allowed), 0.0)
        in_unit, more = str(rows[0][4]), 20.0 * log10(allowed / top)
        fields = (mode, sensor, in_unit, limit, design, allowed, depth, low, high, more, top, drive_unit)
        notches.append(Notch(*fields))
    return tuple(notches)


def _find_ends(frequency: float, ratio: float, times: float, swept: tuple[float, float]) -> tuple[float, float]:
    """Frequencies where a mode moves as much under ``times`` the input as at its resonance, within the sweep."""
    middle, half = 1.0 - 2.0 * ratio**2, 2.0 * ratio * sqrt(times**2 - 1.0 + ratio**2)
    low, high = (frequency * sqrt(max(square, 0.0)) for square in (middle - half, middle + half))
    return max(low, swept[0]), min(high, swept[1])


def _invert(level: FloatArray, upper: FloatArray, limit: float) -> float:
    """Level at which the upper bound meets the limit: linear on logarithmic axes, in proportion beyond the ends."""
    rising = np.maximum.accumulate(upper)
    if limit <= rising[0] or limit >= rising[-1]:
        end = 0 if limit <= rising[0] else -1
        return float(level[end] * limit / rising[end])
    return float(np.exp(np.interp(np.log(limit), np.log(rising), np.log(level))))
