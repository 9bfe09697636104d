"""From the files of a campaign to its answer: every mode at every tested and design level, each sensor's peak there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp, pi
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.answer import (
    NORMAL_90,
    At,
    Campaign,
    DesignLevel,
    ModeAnswer,
    Response,
    SensorPrediction,
    compare_predictions,
)
from damping.campaign.decays import DecayMode, decay_modes
from damping.campaign.driven import answer_driven, modal_loads
from damping.campaign.records import fit_levels, tie_modes
from damping.campaign.runs import ORDERS, CampaignRun, Corrections
from damping.campaign.sources import read_runs
from damping.errors import InputError
from damping.formats.quantity import unit
from damping.formats.series import Summary
from damping.records.audit import audit

_GRID = 14  # forces at which amplitudes are predicted where amplitudes are given


def analyse(
    files: Sequence[Path],
    design: Sequence[DesignLevel | float] = (),
    frequencies: Sequence[float] = (),
    seed: int = 1970,
    max_size: int = 200_000_000,
    corrections: Corrections | None = None,
    limits: Mapping[str, float] | None = None,
    before: Sequence[SensorPrediction] = (),
) -> Campaign:
    """Everything from some files.

    Args:
        design: levels asked, in the unit of the drive; of free decays the amplitude of the sensor that moves most.
            By default twice the top level. frequencies: of the modes, Hz, where they are not to be looked for.
        corrections: of what is found in the files. limits: largest reading allowed, by sensor, in its unit. before:
            what was predicted of these runs.

    Raises:
        InputError: files that are not understood. AnalysisError: no mode that can be followed over the levels.
    """
    runs, summary = read_runs(files, max_size, corrections)
    inputs = [one if isinstance(one, DesignLevel) else DesignLevel.flat(one) for one in design]
    if runs[0].is_time:
        return _of_decays(runs, inputs, frequencies, seed, summary)
    tested = [float(run.level or 0.0) for run in runs]
    inputs = inputs or [DesignLevel.flat(2.0 * max(tested))]
    asked = tuple(float(one.level.max()) for one in inputs)
    names, levels = fit_levels(runs, frequencies)
    unknown = next((name for name in limits or {} if name not in names), None)
    if unknown is not None:
        raise InputError(f"--limit of no sensor {unknown!r}", expected=f"one of {', '.join(names)}")
    modes = tuple(answer_driven(names, levels, mode, inputs, seed, limits or {}) for mode in tie_modes(names, levels))
    campaign = Campaign(modes, tuple(tested), asked, runs[0].drive_unit, summary)
    return replace(campaign, outcomes=compare_predictions(before, campaign))


def _of_decays(
    runs: Sequence[CampaignRun],
    design: Sequence[DesignLevel],
    frequencies: Sequence[float],
    seed: int,
    summary: Summary,
) -> Campaign:
    names, modes = decay_modes(runs, frequencies)
    channel = runs[0].channels[0]
    answers = tuple(_decaying(names, runs[0], mode, design, seed) for mode in modes)
    tested = sorted({at.level for answer in answers for at in answer.places if at.tested})
    asked = tuple(float(one.level.max()) for one in design) or tuple(
        sorted({at.level for answer in answers for at in answer.places if not at.tested})
    )
    return Campaign(answers, tuple(tested), asked, channel.unit, summary)


def _decaying(
    names: Sequence[str], run: CampaignRun, mode: DecayMode, design: Sequence[DesignLevel], seed: int
) -> ModeAnswer:
    """Tested and design levels of a mode of free decays: amplitudes of the sensor that moves most, in its unit."""
    of = {channel.name: channel for channel in run.channels}[names[mode.reference]]
    table = mode.record.table.sort_values("amplitude")
    A, F, f = (table[name].to_numpy(dtype=float) for name in ("amplitude", "force", "frequency"))
    to_reading = (2.0 * pi * mode.frequency) ** ORDERS[of.quantity] / (unit(of.unit).factor if of.unit else 1.0)
    tops = np.sort(mode.tops)
    asked = [float(a) for a in tops * to_reading] + (
        [one.at(mode.frequency) for one in design] or [float(2.0 * tops[-1] * to_reading)]
    )
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
    findings = audit(mode.record, mode.mode).findings
    return ModeAnswer(
        mode.name, mode.frequency, law, tuple(places), mode.left_out, mode.record, mode.mode, forces, findings
    )


def _crossing(force: FloatArray, amplitude: FloatArray, asked: float) -> float:
    """Force at which a rising curve of amplitude reaches the one asked; NaN outside."""
    good = np.isfinite(amplitude)
    if good.sum() < 2 or not amplitude[good][0] <= asked * 1.3 or not asked <= amplitude[good][-1]:
        return float("nan")
    return float(np.exp(np.interp(np.log(asked), np.log(amplitude[good]), np.log(force[good]))))


def _list_shaped(names: Sequence[str], run: CampaignRun, mode: DecayMode, level: float) -> tuple[Response, ...]:
    """Amplitude of every sensor kept, by the shape."""
    by_name = {channel.name: channel for channel in run.channels}
    responses = []
    for s, name in enumerate(names):
        if not np.isfinite(mode.shape[s]):
            continue
        factor = (unit(by_name[names[mode.reference]].unit or "1").factor) / unit(by_name[name].unit or "1").factor
        size = abs(mode.shape[s]) * level * factor
        spread = NORMAL_90 * float(mode.shape_sd[s] / abs(mode.shape[s]))
        of = by_name[name]
        responses.append(Response(name, of.quantity, of.unit, (size, size * exp(-spread), size * exp(spread))))
    return tuple(responses)
