"""Levels of a campaign joined into modes, and each mode as a record: modal force and amplitude against frequency.

The coordinate of a mode is its motion at the sensor that moves most in it (the reference). With residues r, under base
excitation the modal force is |r_ref| times the base acceleration and the mass 1; under a force, it is the measured
force and the mass 1/|r_ref|. Only products of shape and participation, or shape and 1/mass, are known or needed.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
import pandas as pd

from damping.arrays import BoolArray, ComplexArray, FloatArray, wrap_lag
from damping.campaign.delays import remove_delay
from damping.campaign.merged import describe_excess, split_merged
from damping.campaign.modal_fit import LEAST_T, MOVED, Level, evaluate_sd, find_peaks_of, fit_level
from damping.campaign.runs import CampaignRun
from damping.campaign.sensors import find_bad_sensors, find_misread
from damping.errors import AnalysisError, InputError
from damping.formats.headers import ORDERS
from damping.formats.quantity import unit
from damping.records.mode import Mode, Tolerance, Units
from damping.records.record import Record
from damping.records.text import name_apart

WRITTEN = 1.5  #: rows with |cot phase| up to this are written
MOST_ROWS = 21  #: most rows of a level
FEWEST_ROWS = 3  #: fewest rows of a level
CONTROLLED = 0.1  #: a drive whose readings range over less than this share of their median is controlled to be constant
ALIKE = 0.9  #: least modal assurance criterion between the shapes of two levels
_UNSEEN = "it has no peak at this resonance"  # the reason that leaves a sensor out of one mode alone


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
    first, starts = (0, frequencies) if len(frequencies) else _choose_first(runs, motions)
    sign = 1.0 if runs[0].is_base_driven else -1.0
    f, H, drive = motions[first]
    fits = {first: fit_level(f, H, starts, sign, (), _hold_steady(drive))}
    while not len(frequencies) and not (stays := _keep_place(fits[first].frequency, starts)).all():
        starts = [start for start, kept in zip(starts, stays, strict=True) if kept]
        fits[first] = fit_level(f, H, starts, sign, (), _hold_steady(drive))
    if len(frequencies) and np.any(np.abs(fits[first].frequency / np.sort(frequencies) - 1.0) > MOVED):
        fits[first] = fit_level(f, H, list(fits[first].frequency), sign, list(fits[first].ratio), _hold_steady(drive))
    for k in (*range(first + 1, len(runs)), *reversed(range(first))):
        (f, H, drive), near = motions[k], fits[k - 1 if k > first else k + 1]
        fits[k] = fit_level(f, H, list(near.frequency), sign, list(near.ratio), _hold_steady(drive))
    levels = []
    names = name_apart(f"{run.level:g} {run.drive_unit}" for run in runs)
    for k, (run, name, motion) in enumerate(zip(runs, names, motions, strict=True)):
        third = None if any(channel.third is None for channel in run.channels) else _accelerations(run, 3)[1]
        levels.append(Level(run, *motion, fits[k], third, name))
    return levels


def _choose_first(
    runs: Sequence[CampaignRun], motions: Sequence[tuple[FloatArray, ComplexArray, FloatArray]]
) -> tuple[int, Sequence[float]]:
    """Index of the level at which modes are found, and its peaks, Hz: the lowest, unless most levels show more peaks.

    Friction hides one of two close modes at low levels. The upper median of the numbers of peaks is what most levels
    show: a jump or ringing at a single level adds peaks that are no modes. AnalysisError: the lowest level has none.
    """
    sign = 1.0 if runs[0].is_base_driven else -1.0
    peaks = [find_peaks_of(f, H, sign) for f, H, _ in motions]
    if not peaks[0]:
        raise AnalysisError(f"no resonance in run {runs[0].label!r}: no sensor has a peak above its noise")
    numbers = [len(of_level) for of_level in peaks]
    most = sorted(numbers)[len(numbers) // 2]
    first = next(k for k, number in enumerate(numbers) if (k == 0 and number >= most) or number == most)
    return first, peaks[first]


def fit_right_levels(
    runs: Sequence[CampaignRun], frequencies: Sequence[float] = (), trusted: Collection[str] = ()
) -> tuple[list[Level], dict[str, str]]:
    """Every level fitted without misread sensors and delay and with merged modes split, and why sensors are misread."""
    levels = fit_levels(runs, frequencies)
    misread = find_misread(levels, trusted)
    levels = fit_levels([run.without(misread) for run in runs], frequencies) if misread else levels
    levels = remove_delay(levels, lambda runs: fit_levels(runs, frequencies))
    right = [level.run for level in levels]
    return levels if len(frequencies) else split_merged(levels, lambda at: fit_levels(right, at)), misread


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
        samples = np.asarray(sensor.samples if harmonic == 1 else sensor.third)[keep]
        motion = samples * unit(sensor.unit).factor * (1j * w) ** (2 - ORDERS[sensor.quantity])
        motion = motion * np.exp(1j * w * run.delay) if run.delay else motion
        rows.append(motion / drive_unit.factor if sensor.per_drive else motion / drive)
    return f, np.array(rows), np.abs(drive)


def tie_modes(
    levels: Sequence[Level], misread: Mapping[str, str] | None = None, asked: Sequence[float] = ()
) -> list[DrivenMode]:
    """Modes of all levels in order of frequency, without those that no sensor shows. AnalysisError: none is left.

    ``misread``: sensors already removed from the levels, and why. ``asked``: frequencies that the user named, Hz.
    """
    out = {**(misread or {}), **find_bad_sensors(levels)}
    modes: list[DrivenMode] = []
    for k in range(len(levels[0].fit.frequency)):
        mode = _tie(levels, k, dict(out), len(modes) + 1)
        if mode is not None:
            modes.append(mode)
    if not modes:
        near = ", ".join(f"{at:.4g}" for at in sorted(asked) or levels[0].fit.frequency)
        seen = f"of the modes sought near {near} Hz none stands {LEAST_T:g} standard errors out of the noise"
        merged = [text for k in range(len(levels[0].fit.frequency)) for text in describe_excess(levels, k)]
        remedy = "name others, or none" if len(asked) else "name the modes"
        raise AnalysisError("; ".join([f"{seen} at every level: {remedy} (--modes F1,F2,... in Hz)", *merged]))
    return modes


def describe_lost(levels: Sequence[Level], tied: Sequence[DrivenMode], asked: Sequence[float] = ()) -> list[str]:
    """Modes that are ``asked`` for, or stand out of the noise at some level, but are none of those ``tied``.

    Also those found far from where they were asked for.
    """
    near = sorted(asked) or levels[0].fit.frequency
    lost = [
        f"caution: the mode stated near {stated:.4g} Hz was found at {found:.4g} Hz: is it another one?"
        for stated, found in zip(sorted(asked), levels[0].fit.frequency, strict=False)
        if abs(found / stated - 1.0) > MOVED
    ]
    names, unit = levels[0].run.names, levels[0].run.drive_unit
    usable = [tied[0].left_out.get(name, _UNSEEN) == _UNSEEN for name in names]
    for k in set(range(len(levels[0].fit.frequency))) - {mode.number for mode in tied}:
        clear = [np.abs(level.fit.residues[:, k]) > LEAST_T * level.fit.residues_sd[:, k] for level in levels]
        showing = np.any(clear, axis=0)
        what = f"the mode near {near[k]:.4g} Hz is left out, because"
        if np.any(showing & usable):
            found = (f"{level.fit.frequency[k]:.4g} Hz at {level.run.level:g} {unit}".rstrip() for level in levels)
            what += f" its levels do not agree ({', '.join(found)})"
            lost.append(f"{what}: a level in which it moved away or is hidden needs its own campaign")
        elif showing.any():
            shown = ", ".join(name for name, shows in zip(names, showing, strict=True) if shows)
            lost.append(f"{what} only sensors left out show it ({shown})")
        elif len(asked):
            lost.append(f"{what} no sensor shows it {LEAST_T:g} standard errors out of the noise")
    return lost


def _tie(levels: Sequence[Level], k: int, left_out: dict[str, str], number: int) -> DrivenMode | None:
    """Mode ``k`` of every level from the sensors that are not left out; None if none of them shows it."""
    names = levels[0].run.names
    r = np.array([level.fit.residues[:, k] for level in levels])
    sd = np.array([level.fit.residues_sd[:, k] for level in levels]).clip(min=1e-300)
    mean = np.sum(r / sd**2, axis=0) / np.sum(1.0 / sd**2, axis=0)
    scatter = np.sqrt(np.mean((r - mean) ** 2, axis=0) / max(len(levels) - 1, 1))
    error = np.hypot(np.sqrt(1.0 / np.sum(1.0 / sd**2, axis=0)), scatter)
    usable: BoolArray = np.array([name not in left_out for name in names])
    seen = np.abs(mean) > LEAST_T * error
    if not (usable & seen).any():
        return None
    unseen = (name for name, missing in zip(names, usable & ~seen, strict=True) if missing)
    left_out |= dict.fromkeys(unseen, _UNSEEN)
    kept = usable & seen
    reference = int(np.argmax(np.where(kept, np.abs(mean), 0.0)))
    cautions = describe_excess(levels, k)
    for level, row in zip(levels[1:], r[1:, kept], strict=True):
        lowest = r[0, kept]
        mac = float((row @ lowest) ** 2 / ((row @ row) * (lowest @ lowest)))
        if mac < ALIKE:
            cautions += (f"at {level.run.level:g} {level.run.drive_unit} the shape is another (MAC {mac:.2f})",)
    residues = np.where(kept, mean, np.nan)
    names_of = ("frequency", "frequency_sd", "ratio", "ratio_sd")
    poles = {name: np.array([getattr(level.fit, name)[k] for level in levels]) for name in names_of}
    relative = error / np.abs(mean)
    mass_sd = max(0.005, float(relative[reference]))
    mode = Mode(
        name=f"mode-{number}",
        frequency=float(poles["frequency"][0]),
        mass=float(1.0 if levels[0].run.is_base_driven else 1.0 / abs(mean[reference])),
        tolerance=Tolerance(frequency=0.001, mass=mass_sd, viscous=0.05, from_record=True),
        units=Units("N", "m", "s"),
    )
    record = _record(levels, k, residues, reference, mode.name)
    return DrivenMode(
        k, reference, residues, relative, **poles, left_out=left_out, cautions=cautions, record=record, mode=mode
    )


def _record(levels: Sequence[Level], k: int, residues: FloatArray, reference: int, name: str) -> Record:
    """Rows near resonance of every level: the sensors' motion without the other modes, weighted by their residues."""
    kept = np.isfinite(residues)
    r = residues[kept]
    tables = []
    for level in levels:
        rows = _rows_near(level, k)
        f, H = level.f[rows], level.H[:, rows]
        rest = level.fit.rest(f, H, k)[kept]
        sd = evaluate_sd(H[kept], level.fit.noise)
        weight = r[:, None] / sd**2
        p = np.sum(weight * rest, axis=0) / np.sum(weight * r[:, None], axis=0)
        error = 1.0 / np.sqrt(np.sum((r[:, None] / sd) ** 2, axis=0)) / np.abs(p)
        drive = _hold_steady(level.drive[rows])
        w = 2.0 * pi * f
        factor = abs(residues[reference])
        amplitude = factor * np.abs(p) * drive / w**2
        lag = -np.angle(p * level.fit.sign)
        table = pd.DataFrame(
            {
                "sweep": level.name,
                "force": factor * drive if level.run.is_base_driven else drive,
                "frequency": f,
                "amplitude": amplitude,
                "phase": wrap_lag(lag),
                "amplitude_sd": error * amplitude,
                "phase_sd": error,
            }
        )
        if level.run.rate is not None:
            table["sweep_rate"] = level.run.rate[level.run.x > 0.0][rows]
        if level.third is not None and not level.run.is_base_driven:  # a base motion contains a third harmonic too
            p = np.sum(weight * level.third[:, rows][kept], axis=0) / np.sum(weight * r[:, None], axis=0)
            table["amplitude_3"] = factor * np.abs(p) * drive / (3.0 * w) ** 2
            # cos(3 theta + a) = -sin(3 w t + a) where the drive is cos(theta) = sin(w t)
            table["phase_3"] = np.angle(-np.conj(p * level.fit.sign))
        tables.append(table)
    return Record(pd.concat(tables, ignore_index=True), name)


def _hold_steady(drive: FloatArray) -> FloatArray:
    """The drive (n,); its median if it is controlled, as its scatter is then that of the readings."""
    middle = np.median(drive)
    return np.full_like(drive, middle) if np.ptp(drive) < CONTROLLED * middle else drive


def _rows_near(level: Level, k: int) -> np.ndarray:
    """Rows about a resonance, evenly thinned if there are many."""
    at, ratio = level.fit.frequency[k], level.fit.ratio[k]
    cot = np.abs(level.f / at - at / level.f) / (2.0 * ratio)
    rows = np.flatnonzero(cot <= WRITTEN)
    if len(rows) < FEWEST_ROWS:
        rows = np.sort(np.argsort(cot)[:FEWEST_ROWS])
    step = -(-len(rows) // MOST_ROWS)
    return rows[::step]
