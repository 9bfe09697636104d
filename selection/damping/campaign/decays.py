"""Free decays of several sensors and modes: modes from spectral peaks, their shapes, records and results.

The motion of a mode is the sensors' motion projected on its shape by the pseudo-inverse of all shapes. What the shapes
leave of the other modes is rejected by the window of ``signals.ringdown``.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import pi
from typing import TypeAlias

import numpy as np
import pandas as pd

from damping.arrays import FloatArray, Floats, interpolate_logs
from damping.campaign.answer import LEVEL, NORMAL_90, Campaign, ModeAnswer, bound_ratio, predict_at, predict_mode
from damping.campaign.decay_shapes import describe_unshaped, find_loudest, find_shapes, list_unused
from damping.campaign.runs import CampaignRun, Channel, DesignLevel
from damping.campaign.sensors import find_unfit_sensors
from damping.campaign.values import At, Bounds, Response, make_mode
from damping.errors import AnalysisError, InputError, naming
from damping.extrapolation.backbone import find_backbone
from damping.extrapolation.curve import predict_forces, trace_loads
from damping.forces import damping_ratio
from damping.formats.headers import ORDERS
from damping.formats.quantity import unit
from damping.formats.series import Summary
from damping.records.mode import Mode
from damping.records.record import Record
from damping.signals.ringdown import ring_down
from damping.signals.windows import PERIODS

LEVELS = 8  #: levels that a decay is split into
_ELSEWHERE = 0.08  # largest relative difference between the frequencies of a peak and of its decay
REACH = 30.0  #: amplitudes are predicted up to this factor above and below those of the test
_ALONG = 200  # amplitudes at which readings are tabulated along the backbone

#: How a drive is stated that is not found by its name.
DRIVEN = "role = 'drive' in --correct FILE.toml"

#: Largest amplitude of each run, cautions, record of a mode of mass 1, and the mode.
FittedDecay: TypeAlias = tuple[FloatArray, tuple[str, ...], Record, Mode]


@dataclass(frozen=True)
class DecayMode:
    """A mode of free decays: ``shape`` (sensors,), 1 at ``reference``, NaN for a sensor left out.

    ``tops`` (runs,): largest displacement amplitude used of each run; ``mode`` has the frequency at the smallest
    amplitude.
    """

    reference: int
    shape: FloatArray
    shape_sd: FloatArray
    tops: FloatArray
    left_out: dict[str, str]
    cautions: tuple[str, ...]
    record: Record
    mode: Mode


def decay_modes(
    runs: Sequence[CampaignRun], frequencies: Sequence[float] = (), summary: Summary | None = None
) -> list[DecayMode]:
    """The modes of free decays; ``summary`` gets a note on each peak that is not used.

    ``frequencies``: Hz, if known; else the peaks of the spectrum of the smallest decay.

    InputError: sensors of several quantities. AnalysisError: no mode, or no decay that can be used.
    """
    names = runs[0].names
    kinds = {channel.quantity for run in runs for channel in run.channels}
    if len(kinds) > 1:
        expected = f"sensors of one quantity, or the drive, if there was one: {DRIVEN}"
        raise InputError(f"free decays of {' and '.join(sorted(kinds))}", expected=expected)
    order = ORDERS[kinds.pop()]
    motions = []  # times (n,) and motions (sensors, n) in SI, each about its mean, of each run
    for run in runs:
        x = np.array([np.asarray(channel.samples, dtype=float) * _find_factor(channel) for channel in run.channels])
        motions.append((run.x, x - np.mean(x, axis=1, keepdims=True)))
    at, shapes, unused = find_shapes(motions, frequencies)
    inverse = np.linalg.pinv(np.array([shape for shape, _, _ in shapes]).T)
    parts = [[(run.label, t, row @ x) for run, (t, x) in zip(runs, motions, strict=True)] for row in inverse]
    fitted, unusable = _fit_modes(parts, at, order, known=bool(frequencies))
    modes = []
    for k, (tops, cautions, record, mode) in fitted.items():
        shape, sd, follows = shapes[k]
        left_out = {**runs[0].left_out, **find_unfit_sensors(names, find_loudest(motions)[1], follows)}
        kept = np.array([name not in left_out for name in names])
        cautions += describe_unshaped(follows, at[k])
        reference = int(np.argmax(np.where(kept, np.abs(shape), 0.0)))
        modes.append(DecayMode(reference, np.where(kept, shape, np.nan), sd, tops, left_out, cautions, record, mode))
    if not modes:
        raise AnalysisError(f"{'; '.join(unusable.values())}; if a drive acted, say which channel is that: {DRIVEN}")
    if summary is not None:
        for note in list_unused(unused | unusable):
            summary.note(note)
    if unusable:  # without their shapes; the notes on them are already in the summary
        return decay_modes(runs, [frequency for frequency in at if frequency not in unusable])
    return modes


def _fit_modes(
    motions: Sequence[Sequence[tuple[str, FloatArray, FloatArray]]], at: Sequence[float], order: int, *, known: bool
) -> tuple[dict[int, FittedDecay], dict[float, str]]:
    """The decay of each mode, by its index in ``at``, and why each other frequency has none.

    ``known``: the frequencies were stated; AnalysisError is raised for the first without a decay.
    """
    decays: dict[int, FittedDecay] = {}
    unusable: dict[float, str] = {}
    for k, (frequency, motion) in enumerate(zip(at, motions, strict=True)):
        try:
            decay = _fit_mode(motion, frequency, order, f"mode-{len(decays) + 1}")
        except AnalysisError as error:
            if known:
                raise
            unusable[frequency] = str(error)
            continue
        *_, mode = decay
        if known or abs(mode.frequency / frequency - 1.0) <= _ELSEWHERE:
            decays[k] = decay
        else:
            unusable[frequency] = f"the decay near {frequency:g} Hz is that of {mode.frequency:g} Hz"
    return decays, unusable


def _find_factor(sensor: Channel) -> float:
    """The unit of a sensor in SI; 1 if it has none."""
    return unit(sensor.unit or "1").factor


def _fit_mode(
    motions: Sequence[tuple[str, FloatArray, FloatArray]], frequency: float, order: int, name: str
) -> FittedDecay:
    """A mode of mass 1 from its motion in each run."""
    tables: list[pd.DataFrame] = []
    tops, cautions = [], []
    for label, t, q in motions:
        try:
            with naming(label):
                decay = ring_down(t, q, order=order, mass=1.0, frequency=frequency, periods=PERIODS, levels=LEVELS)
        except AnalysisError as error:
            cautions.append(f"{label}: {error}")
            continue
        tables.append(decay.table(label))
        tops.append(float(decay.amplitude[0]))
        cautions += [f"{label}: {note}" for note in decay.notes if "lost" not in note]
    if not tables:
        raise AnalysisError(f"{name} near {frequency:g} Hz: {'; '.join(cautions)}")
    table = pd.concat(tables, ignore_index=True)
    lowest = int(np.argmin(table["amplitude"].to_numpy()))
    mode = make_mode(name, float(table["frequency"].iloc[lowest]))
    return np.array(tops), tuple(cautions), Record(table, name), mode


def answer_decays(
    runs: Sequence[CampaignRun],
    design: Sequence[DesignLevel],
    frequencies: Sequence[float],
    seed: int,
    summary: Summary,
) -> Campaign:
    """Results for free decays at every tested and design amplitude; notes are added to ``summary``."""
    answers = tuple(_answer_mode(runs[0], mode, design, seed) for mode in decay_modes(runs, frequencies, summary))
    tested = sorted({at.level for answer in answers for at in answer.places if at.tested})
    beyond = sorted({at.level for answer in answers for at in answer.places if not at.tested})
    asked = tuple(float(level.level.max()) for level in design) or tuple(beyond)
    return Campaign(answers, tuple(tested), asked, runs[0].channels[0].unit)


def _answer_mode(run: CampaignRun, mode: DecayMode, design: Sequence[DesignLevel], seed: int) -> ModeAnswer:
    """Tested and design levels of a mode of free decays: amplitudes of the sensor that moves most.

    All are in the unit of the first sensor, so that levels of all modes can be compared.
    """
    table = mode.record.frame.sort_values("amplitude", ignore_index=True)
    order, factor = ORDERS[run.channels[mode.reference].quantity], 1.0 / _find_factor(run.channels[0])

    def read(amplitude: Floats, omega: Floats) -> Floats:  # levels are readings of the sensor
        return amplitude * omega**order * factor

    backbone, top = find_backbone(mode.record, mode.mode), float(mode.tops.max())
    along = np.geomspace(float(table["amplitude"].iloc[0]) / REACH, REACH * top, _ALONG)
    hertz = backbone.frequency_at(along, LEVEL).median
    along, hertz = along[np.isfinite(hertz)], hertz[np.isfinite(hertz)]
    reading = np.asarray(read(along, 2.0 * pi * hertz))
    measured = table[table["amplitude"].isin(mode.tops)].to_dict("records")
    tested = [float(read(row["amplitude"], 2.0 * pi * row["frequency"])) for row in measured]
    beyond = [level.at(float(mode.mode.frequency)) for level in design] or [2.0 * tested[-1]]
    far = [level for level in beyond if not reading[0] <= level <= reading[-1]]
    if far:
        why = f"level {far[-1]:.4g} {run.channels[0].unit} is too far from the tested {tested[-1]:.4g}"
        raise InputError(why, expected=f"from {reading[0]:.4g} to {reading[-1]:.4g}")
    prediction = predict_mode(mode.record, mode.mode, [float(table["force"].iloc[-1])], seed)
    places, cautions = [], (*mode.cautions, *prediction.cautions())
    for row, level in zip(measured, tested, strict=True):
        f, F, sd = row["frequency"], row["force"], row["force_sd"] / row["force"]
        z = damping_ratio(F, row["amplitude"], (2.0 * pi * f) ** 2)
        errors = f * z * sd, z * sd  # the slopes of the phase and of the logarithm of amplitude have one error
        response = tuple(_list_shaped(run, mode, level))
        places.append(At(level, True, f, bound_ratio(z, sd), response, cautions, None, *errors))
    asked = interpolate_logs(beyond, reading, along)
    curve = trace_loads(predict_forces(prediction.predicted, asked, each=False), backbone, prediction.prepared.data)
    for k, level in enumerate(beyond):
        cautions = (*mode.cautions, *prediction.cautions(curve.cautions[k]))
        places.append(predict_at(curve, k, level, cautions, tuple(_list_shaped(run, mode, level))))
    return prediction.answer(places, mode.left_out, curve.force.median[np.isfinite(curve.force.median)].tolist())


def _list_shaped(run: CampaignRun, mode: DecayMode, level: float) -> Iterator[Response]:
    """Amplitude of every sensor kept, by the shape; ``level`` in the unit of the first sensor."""
    for s, sensor in enumerate(run.channels):
        if np.isfinite(mode.shape[s]):
            factor = _find_factor(run.channels[0]) / _find_factor(sensor)
            size = abs(mode.shape[s]) * level * factor
            spread = NORMAL_90 * float(mode.shape_sd[s] / abs(mode.shape[s]))
            yield Response(sensor.name, sensor.quantity, sensor.unit, Bounds.about(size, spread))
