"""The answer of a campaign: every mode at every tested and design level, and the peak of each sensor there.

A band of modal amplitude A at a modal force F is one of damping ratio, z = F/(2 m w^2 A), and through the motion
near resonance with that ratio, the other modes and the base in it, one of every sensor's peak.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import exp, hypot, log, pi
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.campaign.decays import DecayMode, decay_modes
from damping.campaign.loads import modal_loads
from damping.campaign.modes import receptance
from damping.campaign.records import Level, ModeFound, fit_levels, tie_modes
from damping.campaign.sources import ORDERS, CampaignRun, read_runs
from damping.formats.quantity import unit
from damping.formats.series import Summary
from damping.records.mode import Mode
from damping.records.record import Record

FORMAT = "campaign/1"
#: A peak is looked for within so many half-power half-widths of the resonance.
_SEARCHED = 1.5
_NORMAL_90 = 1.645  # half of a 90 % band in standard deviations
_GRID = 14  # forces at which amplitudes are predicted where amplitudes are given


@dataclass(frozen=True)
class Response:
    """Peak of a sensor: ``band`` is (median, low, high) in ``unit``."""

    sensor: str
    quantity: str
    unit: str
    band: tuple[float, float, float]


@dataclass(frozen=True)
class At:
    """A mode at a level; ``tested`` or a design level; bands are (median, low, high), None where there is no answer."""

    level: float
    tested: bool
    frequency: float
    ratio: tuple[float, float, float] | None
    response: tuple[Response, ...]
    cautions: tuple[str, ...]


@dataclass(frozen=True)
class ModeAnswer:
    """A mode with its record and its levels; ``law`` is the one with the largest weight."""

    name: str
    frequency: float
    law: str
    places: tuple[At, ...]
    left_out: dict[str, str]
    record: Record
    mode: Mode
    design_forces: tuple[float, ...]


@dataclass(frozen=True)
class Campaign:
    """All modes, the levels and their unit, and what was understood of the files."""

    modes: tuple[ModeAnswer, ...]
    levels: tuple[float, ...]
    design: tuple[float, ...]
    unit: str
    summary: Summary = field(default_factory=Summary)

    def to_json(self) -> dict[str, Any]:
        """The form ``campaign/1``."""
        return {
            "format": FORMAT,
            "modes": [_mode_form(mode) for mode in self.modes],
            "levels": list(self.levels),
            "design": list(self.design),
            "level_unit": self.unit,
            "audit": [],
            "understood": self.summary.table.to_dict(orient="records"),
            "notes": list(self.summary.notes),
        }

    @property
    def table(self) -> pd.DataFrame:
        """A row a mode, level and sensor."""
        rows = []
        for mode in self.modes:
            for at in mode.places:
                for one in at.response:
                    median, low, high = one.band
                    row = {"mode": mode.name, "frequency": at.frequency, "level": at.level, "tested": at.tested}
                    rows.append(
                        row | {"sensor": one.sensor, "median": median, "low": low, "high": high, "unit": one.unit}
                    )
        return pd.DataFrame(rows)


def analyse(
    files: Sequence[Path],
    design: Sequence[float] = (),
    frequencies: Sequence[float] = (),
    seed: int = 1970,
    max_size: int = 200_000_000,
) -> Campaign:
    """Everything from some files.

    Args:
        design: levels asked, in the unit of the drive; of free decays the amplitude of the sensor that moves most.
            By default twice the top level. frequencies: of the modes, Hz, where they are not to be looked for.

    Raises:
        InputError: files that are not understood. AnalysisError: no mode that can be followed over the levels.
    """
    runs, summary = read_runs(files, max_size)
    if runs[0].is_time:
        return _of_decays(runs, design, frequencies, seed, summary)
    tested = [float(run.level or 0.0) for run in runs]
    asked = tuple(design) or (2.0 * max(tested),)
    names, levels = fit_levels(runs, frequencies)
    modes = tuple(_driven(names, levels, mode, asked, seed) for mode in tie_modes(names, levels))
    return Campaign(modes, tuple(tested), asked, runs[0].drive_unit, summary)


def _driven(
    names: Sequence[str], levels: Sequence[Level], mode: ModeFound, design: Sequence[float], seed: int
) -> ModeAnswer:
    """Tested and design levels of a mode of a structure that is driven."""
    run = levels[0].run
    to_si = unit(run.drive_unit).factor
    of_force = abs(mode.residues[mode.reference]) if run.is_base_driven else 1.0
    asked = [float(level.run.level or 0.0) for level in levels] + list(design)
    drives = np.array(asked) * to_si
    loads, law, swept = modal_loads(mode.record, mode.mode, [float(of_force * drive) for drive in drives], seed)
    bands = np.array([loads.average.median, loads.average.low, loads.average.high]).T
    frequency = _frequencies(mode.frequency, bands[:, 0], len(levels))
    places = []
    for k, (level, drive) in enumerate(zip(asked, drives, strict=True)):
        tested = k < len(levels)
        fit_of = levels[k if tested else -1]
        ratio = None
        response: tuple[Response, ...] = ()
        if np.isfinite(bands[k]).all():
            w = 2.0 * pi * frequency[k]
            z, z_high, z_low = (float(of_force * drive / (2.0 * mode.mode.mass * w**2 * A)) for A in bands[k])
            ratio = (z, z_low, z_high)
            response = _list_responses(names, fit_of, mode, float(frequency[k]), (z, z_high, z_low), float(drive))
        places.append(
            At(level, tested, float(frequency[k]), ratio, response, (*swept, *mode.cautions, *loads.cautions[k]))
        )
    forces = tuple(float(of_force * drive) for drive in drives[len(levels) :])
    return ModeAnswer(
        mode.name, float(mode.frequency[0]), law, tuple(places), mode.left_out, mode.record, mode.mode, forces
    )


def _frequencies(tested: FloatArray, amplitude: FloatArray, count: int) -> FloatArray:
    """Tested frequencies, then those of the design levels on a straight line through the tested ones over amplitude."""
    known = amplitude[:count]
    beyond = amplitude[count:]
    if count < 3 or not np.isfinite(amplitude).all():
        return np.concatenate([tested, np.full(len(beyond), tested[-1])])
    slope, start = np.polyfit(known, tested, 1)
    return np.concatenate([tested, start + slope * beyond])


def _list_responses(
    names: Sequence[str],
    level: Level,
    mode: ModeFound,
    frequency: float,
    ratios: tuple[float, float, float],
    drive: float,
) -> tuple[Response, ...]:
    """Peak of every sensor kept, at the damping ratios of the median, low and high amplitude."""
    by_name = {one.name: one for one in level.run.channels}
    peaks = np.array([_peaks(level, mode, frequency, ratio) for ratio in ratios]) * drive  # (3, sensors)
    found = []
    for s, name in enumerate(names):
        if not np.isfinite(mode.residues[s]):
            continue
        of = by_name[name]
        size = peaks[:, s] / (2.0 * pi * frequency) ** (2 - ORDERS[of.quantity]) / unit(of.unit).factor
        spread = _NORMAL_90 * float(hypot(mode.residues_sd[s], level.fit.noise[0] / 3.0))
        found.append(
            Response(name, of.quantity, of.unit, _widened(float(size[0]), float(size[1]), float(size[2]), spread))
        )
    return tuple(found)


def _peaks(level: Level, mode: ModeFound, frequency: float, ratio: float) -> FloatArray:
    """|H| of each sensor (sensors,) at its peak nearest to the resonance, with the other modes and the base.

    Where a sensor has no peak there (it stands on the slope of a neighbour) it is |H| at the resonance.
    """
    fit, k = level.fit, mode.number
    f = frequency * (1.0 + _SEARCHED * ratio * np.linspace(-1.0, 1.0, 401))
    columns = fit.columns(f)
    columns[:, 2 + k] = fit.sign * (2.0 * pi * f) ** 2 * receptance(f, frequency, ratio, float(fit.slope[k]))
    coefficients = fit.local[k].copy()
    coefficients[:, 2 + k] = np.nan_to_num(mode.residues)
    size = np.abs(coefficients @ columns.T)
    middle = len(f) // 2
    inner = (size[:, 1:-1] >= size[:, :-2]) & (size[:, 1:-1] > size[:, 2:])
    places = [np.flatnonzero(row) + 1 for row in inner]
    nearest = [int(p[np.argmin(np.abs(p - middle))]) if len(p) else middle for p in places]
    return np.asarray(size[np.arange(len(size)), nearest])


def _widened(median: float, low: float, high: float, spread: float) -> tuple[float, float, float]:
    """The band with an independent spread of ln added."""
    return (
        median,
        median * exp(-hypot(log(median / low), spread)),
        median * exp(hypot(log(high / median), spread)),
    )


def _of_decays(
    runs: Sequence[CampaignRun], design: Sequence[float], frequencies: Sequence[float], seed: int, summary: Summary
) -> Campaign:
    names, modes = decay_modes(runs, frequencies)
    channel = runs[0].channels[0]
    answers = tuple(_decaying(names, runs[0], mode, design, seed) for mode in modes)
    tested = sorted({at.level for answer in answers for at in answer.places if at.tested})
    asked = tuple(design) or tuple(sorted({at.level for answer in answers for at in answer.places if not at.tested}))
    return Campaign(answers, tuple(tested), asked, channel.unit, summary)


def _decaying(
    names: Sequence[str], run: CampaignRun, mode: DecayMode, design: Sequence[float], seed: int
) -> ModeAnswer:
    """Tested and design levels of a mode of free decays: amplitudes of the sensor that moves most, in its unit."""
    of = {one.name: one for one in run.channels}[names[mode.reference]]
    table = mode.record.table.sort_values("amplitude")
    A, F, f = (table[name].to_numpy(dtype=float) for name in ("amplitude", "force", "frequency"))
    to_reading = (2.0 * pi * mode.frequency) ** ORDERS[of.quantity] / (unit(of.unit).factor if of.unit else 1.0)
    tops = np.sort(mode.tops)
    asked = [float(a) for a in tops * to_reading] + (list(design) or [float(2.0 * tops[-1] * to_reading)])
    line = np.polynomial.polynomial.polyfit(A, f, 1)
    largest = max(asked) / to_reading
    grid = np.geomspace(F[0], F[-1] * max(largest / A[-1], 1.0) ** 2.5 * 1.5, _GRID)
    loads, law, _ = modal_loads(mode.record, mode.mode, [float(force) for force in grid], seed)
    places = []
    for k, level in enumerate(asked):
        amplitude = level / to_reading
        frequency = float(line[0] + line[1] * amplitude)
        needed = [
            _crossing(grid, curve, amplitude) for curve in (loads.average.median, loads.average.high, loads.average.low)
        ]
        ratio = None
        cautions = list(mode.cautions)
        if all(np.isfinite(needed)):
            z, low, high = (force / (2.0 * (2.0 * pi * frequency) ** 2 * amplitude) for force in needed)
            ratio = (float(z), float(low), float(high))
        else:
            cautions.append("no damping ratio: the predictions do not reach this amplitude")
        if k >= len(tops):
            cautions.append(f"beyond the test: {amplitude / tops[-1]:.2f} times the largest tested amplitude")
        places.append(
            At(level, k < len(tops), frequency, ratio, _list_shaped(names, run, mode, level), tuple(cautions))
        )
    nearest = [float(_crossing(grid, loads.average.median, level / to_reading)) for level in asked[len(tops) :]]
    forces = tuple(force for force in nearest if np.isfinite(force))
    return ModeAnswer(mode.name, mode.frequency, law, tuple(places), mode.left_out, mode.record, mode.mode, forces)


def _crossing(force: FloatArray, amplitude: FloatArray, asked: float) -> float:
    """Force at which a rising curve of amplitude reaches the one asked; NaN outside."""
    good = np.isfinite(amplitude)
    if good.sum() < 2 or not amplitude[good][0] <= asked * 1.3 or not asked <= amplitude[good][-1]:
        return float("nan")
    return float(np.exp(np.interp(np.log(asked), np.log(amplitude[good]), np.log(force[good]))))


def _list_shaped(names: Sequence[str], run: CampaignRun, mode: DecayMode, level: float) -> tuple[Response, ...]:
    """Amplitude of every sensor kept, by the shape."""
    by_name = {one.name: one for one in run.channels}
    found = []
    for s, name in enumerate(names):
        if not np.isfinite(mode.shape[s]):
            continue
        factor = (unit(by_name[names[mode.reference]].unit or "1").factor) / unit(by_name[name].unit or "1").factor
        size = abs(mode.shape[s]) * level * factor
        spread = _NORMAL_90 * float(mode.shape_sd[s] / abs(mode.shape[s]))
        of = by_name[name]
        found.append(Response(name, of.quantity, of.unit, (size, size * exp(-spread), size * exp(spread))))
    return tuple(found)


def _band(band: tuple[float, float, float] | None) -> dict[str, float | None]:
    return dict(zip(("median", "low", "high"), band or (None, None, None), strict=True))


def _mode_form(mode: ModeAnswer) -> dict[str, Any]:
    lowest = min((at for at in mode.places if at.tested), key=lambda at: at.level)
    return {
        "name": mode.name,
        "frequency": mode.frequency,
        "damping_ratio": _band(lowest.ratio),
        "law": mode.law,
        "sensors_left_out": list(mode.left_out),
        "why_left_out": dict(mode.left_out),
        "at": [
            {
                "level": at.level,
                "tested": at.tested,
                "frequency": at.frequency,
                "damping_ratio": _band(at.ratio),
                "response": [
                    {"sensor": one.sensor, "quantity": one.quantity, "unit": one.unit} | _band(one.band)
                    for one in at.response
                ],
                "cautions": list(at.cautions),
            }
            for at in mode.places
        ],
    }
