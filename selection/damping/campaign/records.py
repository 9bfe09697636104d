"""Levels of a campaign joined into modes, and each mode as a record: modal force and amplitude against frequency.

The coordinate of a mode is its motion at the sensor that moves most in it (the reference). With residues r, under base
excitation the modal force is |r_ref| times the base acceleration and the mass 1; under a force, it is the measured
force and the mass 1/|r_ref|. Only products of shape and participation, or shape and 1/mass, are known or needed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import BoolArray, ComplexArray, FloatArray, wrap_lag
from damping.campaign.delays import remove_delay
from damping.campaign.merged import add_missing, describe_excess, describe_shapes
from damping.campaign.modal_fit import LEAST_T, MOVED, Level, ModalFit, evaluate_sd, find_peaks_of, fit_level
from damping.campaign.runs import CampaignRun
from damping.campaign.sensors import find_bad_sensors, find_misread
from damping.campaign.values import make_mode
from damping.errors import AnalysisError, InputError
from damping.formats.headers import ORDERS
from damping.formats.quantity import unit
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.text import name_apart

WRITTEN = 1.5  #: rows with |cot phase| up to this are written
MOST_ROWS = 21  #: most rows of a level
FEWEST_ROWS = 3  #: fewest rows of a level
# the reasons that leave a sensor out of one mode alone: the noise hides it at some level, or the levels contradict
_UNSEEN = "it has no peak at this resonance"
_UNSTEADY = "its share of this resonance scatters from level to level"


@dataclass(frozen=True)
class DrivenMode:
    """A mode of all levels."""

    number: int
    reference: int  #: index of the sensor of the coordinate
    residues: FloatArray  #: over the levels, NaN for a sensor left out (sensors,)
    residues_sd: FloatArray  #: relative (sensors,)
    frequency: FloatArray  #: Hz (levels,)
    frequency_sd: FloatArray  #: relative (levels,)
    ratio: FloatArray  #: of damping (levels,)
    ratio_sd: FloatArray  #: relative (levels,)
    left_out: dict[str, str]  #: reasons by sensor
    cautions: tuple[str, ...]
    record: Record
    mode: Mode

    def residues_at(self, level: Level) -> tuple[FloatArray, FloatArray]:
        """Residues at one level, and their relative standard errors, NaN for a sensor left out."""
        residues = np.where(np.isfinite(self.residues), level.fit.residues[:, self.number], np.nan)
        return residues, level.fit.residues_sd[:, self.number] / np.abs(residues)


def fit_levels(runs: Sequence[CampaignRun], frequencies: Sequence[float] = ()) -> list[Level]:
    """Every level with its modes, found at one level (`_choose_first`) and followed upwards and downwards.

    InputError: sensors whose motion is not understood. AnalysisError: no mode, or a run at a single frequency.
    """
    motions = [_accelerations(run) for run in runs]
    for run, (f, _, _) in zip(runs, motions, strict=True):
        if len(np.unique(f)) < 2:
            raise AnalysisError(f"no resonance in run {run.label!r}: it has no two different frequencies above 0")
    sign = 1.0 if runs[0].is_base_driven else -1.0

    def fit(k: int, starts: Sequence[float], ratios: Sequence[float] = ()) -> ModalFit:
        f, H, drive = motions[k]
        return fit_level(f, H, starts, sign, ratios, drive)

    first, starts = (0, frequencies) if len(frequencies) else _choose_first(motions, runs[0].label, sign)
    fits = {first: fit(first, starts)}
    while not len(frequencies) and not (stays := _keep_place(fits[first].frequency, starts)).all():
        starts = [start for start, kept in zip(starts, stays, strict=True) if kept]
        fits[first] = fit(first, starts)
    if len(frequencies) and np.any(np.abs(fits[first].frequency / np.sort(frequencies) - 1.0) > MOVED):
        fits[first] = fit(first, list(fits[first].frequency), list(fits[first].ratio))
    for k in (*range(first + 1, len(runs)), *reversed(range(first))):
        near = fits[k - 1 if k > first else k + 1]
        fits[k] = fit(k, list(near.frequency), list(near.ratio))
    levels = []
    for k, name in enumerate(name_apart(f"{run.level:g} {run.drive_unit}" for run in runs)):
        has_third = all(channel.third is not None for channel in runs[k].channels)
        third = _accelerations(runs[k], 3)[1] if has_third else None
        levels.append(Level(runs[k], *motions[k], fits[k], third, name))
    return levels


def _choose_first(
    motions: Sequence[tuple[FloatArray, ComplexArray, FloatArray]], lowest: str, sign: float
) -> tuple[int, Sequence[float]]:
    """Index of the level at which modes are found, and its peaks, Hz: the lowest, unless most levels show more peaks.

    Friction hides one of two close modes at low levels. The upper median of the numbers of peaks is what most levels
    show: a jump or ringing at a single level adds peaks that are no modes. AnalysisError: the ``lowest`` run has none.
    """
    peaks = [find_peaks_of(f, H, sign) for f, H, _ in motions]
    if not peaks[0]:
        raise AnalysisError(f"no resonance in run {lowest!r}: no sensor has a peak above its noise")
    numbers = [len(of_level) for of_level in peaks]
    usual = sorted(numbers)[len(numbers) // 2]
    first = 0 if numbers[0] >= usual else numbers.index(usual)
    return first, peaks[first]


def fit_right_levels(
    runs: Sequence[CampaignRun], frequencies: Sequence[float] = (), trusted: Collection[str] = ()
) -> tuple[list[Level], dict[str, str]]:
    """Every level fitted without misread sensors and delay and with missing modes, and why sensors are misread."""
    levels = fit_levels(runs, frequencies)
    misread = find_misread(levels, trusted)
    levels = fit_levels([run.without(misread) for run in runs], frequencies) if misread else levels
    levels = remove_delay(levels, lambda runs: fit_levels(runs, frequencies))
    right = [level.run for level in levels]
    return levels if len(frequencies) else add_missing(levels, lambda at: fit_levels(right, at)), misread


def _keep_place(fitted: FloatArray, starts: Sequence[float]) -> BoolArray:
    """Whether each fitted frequency stayed nearest to its starting peak; a mode that moved to another peak is dropped.

    Such peaks are ringing at the start of a sweep, and noise. At least one mode is kept.
    """
    away = np.abs(fitted[:, np.newaxis] - np.sort(starts))
    stays: BoolArray = np.argmin(away, axis=1) == np.arange(len(fitted))
    return stays if stays.any() else np.arange(len(fitted)) == np.argmin(np.diag(away))


def _accelerations(run: CampaignRun, harmonic: int = 1) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Frequencies (n,), accelerations per unit of drive (sensors, n) and the drive's amplitude (n,), all in SI.

    The delay of the sensors is removed. ``harmonic``: 3 for the third harmonics of the sensors.
    """
    assert run.drive is not None
    drive_unit = unit(run.drive_unit)
    if run.is_base_driven and drive_unit.powers != (0, 1, -2):
        raise InputError(f"a drive in {run.drive_unit}", expected="a force, or an acceleration of the base")
    keep = run.x > 0.0
    f, drive = run.x[keep], np.asarray(run.drive)[keep] * drive_unit.factor
    w = harmonic * 2.0 * pi * f
    rows = []
    for sensor in run.channels:
        motion = np.asarray(sensor.samples if harmonic == 1 else sensor.third)[keep] * unit(sensor.unit).factor
        motion = motion * (1j * w) ** (2 - ORDERS[sensor.quantity])
        motion = motion * np.exp(1j * w * run.delay) if run.delay else motion
        rows.append(motion / drive_unit.factor if sensor.per_drive else motion / drive)
    return f, np.array(rows), np.abs(drive)


def join_modes(
    levels: Sequence[Level], misread: Mapping[str, str] | None = None, asked: Sequence[float] = ()
) -> list[DrivenMode]:
    """Modes of all levels in order of frequency, without those that no sensor shows. AnalysisError: none is left.

    ``misread``: sensors already removed from the levels, and why. ``asked``: frequencies that the user named, Hz.
    """
    left_out = {**(misread or {}), **find_bad_sensors(levels)}
    numbers = range(len(levels[0].fit.frequency))
    modes: list[DrivenMode] = []
    for k in numbers:
        if mode := _join_mode(levels, k, left_out, f"mode-{len(modes) + 1}"):
            modes.append(mode)
    if modes:
        return modes
    near = ", ".join(f"{at:.4g}" for at in sorted(asked) or levels[0].fit.frequency)
    seen = f"of the modes sought near {near} Hz none stands {LEAST_T:g} standard errors out of the noise"
    remedy = "name others, or none" if len(asked) else "name the modes"
    merged = [text for k in numbers for text in describe_excess(levels, k)]
    raise AnalysisError("; ".join([f"{seen} at every level: {remedy} (--modes F1,F2,... in Hz)", *merged]))


def describe_lost(levels: Sequence[Level], modes: Sequence[DrivenMode], asked: Sequence[float] = ()) -> list[str]:
    """Modes that are ``asked`` for, or stand out of the noise at some level, but are none of the ``modes``.

    Also those found far from where they were asked for.
    """
    names, unit, frequency = levels[0].run.names, levels[0].run.drive_unit, levels[0].fit.frequency
    near, lost = sorted(asked) or frequency, []
    for stated, found in zip(sorted(asked), frequency, strict=False):
        if abs(found / stated - 1.0) > MOVED:
            lost.append(
                f"caution: the mode stated near {stated:.4g} Hz was found at {found:.4g} Hz: is it another one?"
            )
    usable = [modes[0].left_out.get(name, _UNSEEN) in (_UNSEEN, _UNSTEADY) for name in names]
    for k in set(range(len(frequency))) - {mode.number for mode in modes}:
        clear = [np.abs(level.fit.residues[:, k]) > LEAST_T * level.fit.residues_sd[:, k] for level in levels]
        showing = np.any(clear, axis=0)
        what = f"the mode near {near[k]:.4g} Hz is left out, because"
        if np.any(showing & usable):
            places = (f"{level.fit.frequency[k]:.4g} Hz at {level.run.level:.4g} {unit}".rstrip() for level in levels)
            what += f" its levels do not agree ({', '.join(places)})"
            lost.append(f"{what}: a level in which it moved away or is hidden needs its own campaign")
        elif showing.any():
            shown = ", ".join(name for name, shows in zip(names, showing, strict=True) if shows)
            lost.append(f"{what} only sensors left out show it ({shown})")
        elif len(asked):
            lost.append(f"{what} no sensor shows it {LEAST_T:g} standard errors out of the noise")
    return lost


def _join_mode(levels: Sequence[Level], k: int, left_out: Mapping[str, str], name: str) -> DrivenMode | None:
    """Mode ``k`` of every level from the sensors that are not left out.

    None if none of them shows it, or if the one that moves most does at every level, but not alike: what is left are
    sensors near a node, whose small readings are mostly of other modes.
    """
    (mean, error), sensors = _average_residues(levels, k), levels[0].run.names
    usable: BoolArray = np.array([sensor not in left_out for sensor in sensors])
    is_seen = np.abs(mean) > LEAST_T * error
    kept, scatters = usable & is_seen, _is_clear(levels, k) & ~is_seen
    if not kept.any() or scatters[np.argmax(np.where(usable, np.abs(mean), -1.0))]:
        return None
    why = dict(zip(sensors, np.where(scatters, _UNSTEADY, _UNSEEN).tolist(), strict=True))
    unseen = {sensor: why[sensor] for sensor, missing in zip(sensors, usable & ~is_seen, strict=True) if missing}
    residues, relative = np.where(kept, mean, np.nan), error / np.abs(mean)
    reference = int(np.nanargmax(np.abs(residues)))
    mass = 1.0 if levels[0].run.is_base_driven else 1.0 / abs(float(mean[reference]))
    mode = make_mode(name, float(levels[0].fit.frequency[k]), mass, float(relative[reference]))
    record = Record(pd.concat([_tabulate(level, k, residues, reference) for level in levels], ignore_index=True), name)
    cautions = (*describe_excess(levels, k), *describe_shapes(levels, k, kept))
    left_out = {**left_out, **unseen}
    fields = ("frequency", "frequency_sd", "ratio", "ratio_sd")
    poles = {field: np.array([getattr(level.fit, field)[k] for level in levels]) for field in fields}
    return DrivenMode(
        k, reference, residues, relative, **poles, left_out=left_out, cautions=cautions, record=record, mode=mode
    )


def _is_clear(levels: Sequence[Level], k: int) -> BoolArray:
    """Whether mode ``k`` stands out of the noise at every level, (sensors,)."""
    clear = [np.abs(level.fit.residues[:, k]) > LEAST_T * level.fit.residues_sd[:, k] for level in levels]
    return np.asarray(np.all(clear, axis=0))


def _average_residues(levels: Sequence[Level], k: int) -> tuple[FloatArray, FloatArray]:
    """Residues of mode ``k``, averaged over the levels, and their standard errors by noise and scatter, (sensors,)."""
    r = np.array([level.fit.residues[:, k] for level in levels])
    sd = np.array([level.fit.residues_sd[:, k] for level in levels]).clip(min=1e-300)
    weight = np.sum(1.0 / sd**2, axis=0)
    mean = np.sum(r / sd**2, axis=0) / weight
    scatter = np.sqrt(np.mean((r - mean) ** 2, axis=0) / max(len(levels) - 1, 1))
    return mean, np.hypot(np.sqrt(1.0 / weight), scatter)


def _tabulate(level: Level, k: int, residues: FloatArray, reference: int) -> pd.DataFrame:
    """Rows of a record near a resonance at one level: the motion of mode ``k`` alone, by weighted least squares.

    The motion p (n,) per unit of drive is that of which all sensors show the share of their ``residues``.
    """
    rows, kept, run = _rows_near(level, k), np.isfinite(residues), level.run
    f, H, r = level.f[rows], level.H[:, rows], residues[kept, np.newaxis]
    sd = evaluate_sd(H[kept], level.fit.noise)

    def average(motion: ComplexArray) -> ComplexArray:
        return np.asarray(np.sum(r / sd**2 * motion[kept], axis=0) / np.sum(r / sd**2 * r, axis=0))

    p = average(level.fit.rest(f, H, k))
    error = 1.0 / np.sqrt(np.sum((r / sd) ** 2, axis=0)) / np.abs(p)
    drive, w, share = level.steady_drive[rows], 2.0 * pi * f, abs(residues[reference])
    amplitude = share * np.abs(p) * drive / w**2
    columns: dict[str, Any] = {
        "sweep": level.name,
        "force": share * drive if run.is_base_driven else drive,
        "frequency": f,
        "amplitude": amplitude,
        "phase": wrap_lag(-np.angle(p * level.fit.sign)),
        "amplitude_sd": error * amplitude,
        "phase_sd": error,
    }
    if run.rate is not None:
        columns["sweep_rate"] = run.rate[run.x > 0.0][rows]
    if level.third is not None and not run.is_base_driven:  # a base motion contains a third harmonic too
        p = average(level.third[:, rows])
        columns["amplitude_3"] = share * np.abs(p) * drive / (3.0 * w) ** 2
        # cos(3 theta + a) = -sin(3 w t + a) where the drive is cos(theta) = sin(w t)
        columns["phase_3"] = np.angle(-np.conj(p * level.fit.sign))
    return pd.DataFrame(columns)


def _rows_near(level: Level, k: int) -> np.ndarray:
    """Rows about a resonance, evenly thinned if there are many."""
    at, ratio = level.fit.frequency[k], level.fit.ratio[k]
    cot = np.abs(level.f / at - at / level.f) / (2.0 * ratio)
    rows = np.flatnonzero(cot <= WRITTEN)
    if len(rows) < FEWEST_ROWS:
        rows = np.sort(np.argsort(cot)[:FEWEST_ROWS])
    step = -(-len(rows) // MOST_ROWS)
    return rows[::step]
