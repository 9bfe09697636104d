"""Peaks of all sensors at a mode and level, with every mode at its own frequency and damping there."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import exp, hypot, log, pi

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.answer import LEAST_SPREAD, NORMAL_90, ModeAnswer
from damping.campaign.modal_fit import SLOPES, Level, ModalFit, evaluate_sd
from damping.campaign.poles import receptance
from damping.campaign.records import DrivenMode
from damping.campaign.runs import LABEL_AGREES
from damping.campaign.values import At, Bounds, Response
from damping.formats.headers import ORDERS
from damping.formats.quantity import unit
from damping.records.text import per_cent

_SEARCHED = 1.5  #: half of the range around a resonance that is searched for its peak, in half-power half-widths
#: Change of amplitude, in ln, from which the damping within a level follows from that at two levels.
_APART = 0.05
_TOP = 0.85  #: rows with at least this share of the largest reading are on the top of a peak
#: Change of a peak beside the largest, in ln, that no fixed shape explains: five times the noise of measured peaks.
_TURNED = 5.0 * LEAST_SPREAD
_FEWEST_ON_TOP = 5  #: fewest rows by which the top of a peak is known: two more than its parabola has parameters


@dataclass(frozen=True)
class Forecast:
    """A mode, its ``answer`` without responses, and for each place in it the level whose fit is ``shown`` there."""

    mode: DrivenMode
    answer: ModeAnswer
    shown: tuple[Level, ...]
    is_steady: bool  #: whether rows are steady states, so that peaks of tested levels can be read from them


def find_input(level: Level, frequency: float) -> float:
    """The input at a mode in the unit of the drive: the run's level, unless it was notched there."""
    stated = float(level.run.level or 0.0)
    measured = float(np.interp(frequency, level.f, level.drive)) / unit(level.run.drive_unit).factor
    return stated if abs(measured / stated - 1.0) <= LABEL_AGREES else measured


def add_responses(levels: Sequence[Level], own: Forecast, forecasts: Sequence[Forecast], place: int) -> At:
    """The place of a mode with its responses, by the fit of the level ``shown``.

    At a tested level they are by its rows where the fit is another level's or misses them: one frequency and shape
    do not follow a mode that its neighbour turns. Unless the fit is the run's own, the residues are those of all
    levels. At levels that were not tested, all modes move as their ``forecasts`` say.
    """
    at, level, mode = own.answer.places[place], own.shown[place], own.mode
    if at.ratio is None:
        return at
    tested = at.tested and level is levels[place]
    if at.tested:
        residues = mode.residues_at(level) if tested else (mode.residues, mode.residues_sd)
        response = tuple(_list_responses(level, (level.fit,), mode.number, residues, at))
    else:
        response = _foresee(level, own, forecasts, place)
    if at.tested and own.is_steady:
        peaks = _read_peaks(levels[place], at)
        pairs = [(one, peaks.get(one.sensor, one.band)) for one in response]
        response = tuple(
            one if tested and one.band.low <= read.median <= one.band.high else replace(one, band=read)
            for one, read in pairs
        )
    return replace(at, response=response)


def _foresee(level: Level, own: Forecast, forecasts: Sequence[Forecast], place: int) -> tuple[Response, ...]:
    """Responses by the fit of a ``level`` as if that of the place had not been tested: all modes move, none turns."""
    others = [(one.mode.number, one.answer.places[place]) for one in forecasts]
    fits = tuple(_move_modes(level, others, part) for part in range(3))
    residues = own.mode.residues, own.mode.residues_sd
    return tuple(_list_responses(level, fits, own.mode.number, residues, own.answer.places[place]))


def _read_peaks(level: Level, at: At) -> dict[str, Bounds]:
    """Band of the peak about the resonance of each sensor of which enough rows show the top, in its unit.

    The peak is that of 1/|H|^2 as a parabola in frequency, which it is for constant damping. The band holds the noise,
    that of every measured peak, and the distance from the largest row.
    """
    assert at.ratio is not None
    near = np.flatnonzero(np.abs(level.f / at.frequency - 1.0) <= 2.0 * _SEARCHED * at.ratio.median)
    bands = {}
    sd = evaluate_sd(level.H[:, near], level.fit.noise)
    for sensor, row, error in zip(level.run.channels, np.abs(level.H[:, near]), sd, strict=True):
        top = np.flatnonzero(row >= _TOP * row.max(initial=0.0))
        whole = len(top) >= _FEWEST_ON_TOP and top[0] > 0 and top[-1] < len(row) - 1
        if not whole:
            continue
        f = (level.f[near[top]] / at.frequency - 1.0) / at.ratio.median
        a, b, c = np.polyfit(f, (row.max() / row[top]) ** 2, 2)
        least = c - b**2 / (4.0 * a) if a > 0.0 else 0.0
        if not least > 0.0:
            continue
        noise = hypot(LEAST_SPREAD, float(np.median(error[top] / row[top])) / len(top) ** 0.5)
        spread = hypot(NORMAL_90 * noise, 0.5 * log(least))
        order = (2.0 * pi * at.frequency) ** (2 - ORDERS[sensor.quantity])
        size = float(row.max() / least**0.5) * at.input * unit(level.run.drive_unit).factor / order
        size /= unit(sensor.unit).factor
        bands[sensor.name] = Bounds.about(size, spread)
    return bands


def describe_turned(own: Forecast, forecasts: Sequence[Forecast], tested: Sequence[At], drive_unit: str) -> str:
    """A caution if a peak grows otherwise, beside the largest, than modes of fixed shape foresee.

    It is judged from the lowest to the highest tested level.
    """
    first, last = tested[0], tested[-1]
    largest = first.largest
    if largest is None or last.ratio is None:
        return ""
    apart = dict[str, float]()
    for place, at, sign in ((0, first, -1.0), (len(tested) - 1, last, 1.0)):
        foreseen = {peak.sensor: peak.band.median for peak in _foresee(own.shown[-1], own, forecasts, place)}
        for peak in at.response:
            apart[peak.sensor] = apart.get(peak.sensor, 0.0) + sign * log(peak.band.median / foreseen[peak.sensor])
    apart = {sensor: change - apart[largest.sensor] for sensor, change in apart.items()}
    most = max(apart, key=lambda sensor: abs(apart[sensor]))
    if abs(apart[most]) <= _TURNED:
        return ""
    by = f"{per_cent(100.0 * abs(exp(apart[most]) - 1.0))} % {'more' if apart[most] > 0.0 else 'less'}"
    return (
        f"from {first.input:.3g} to {last.input:.3g} {drive_unit} the peak of {most!r} grows by {by}, beside that of "
        f"{largest.sensor!r}, than a fixed shape allows: "
        "it turns with the level, and bands beyond the test assume that it stays"
    )


def _move_modes(level: Level, others: Sequence[tuple[int, At]], part: int) -> ModalFit:
    """The fit of a level with modes, by number, as they are at another; ``part`` of bands: 0 median, 1 low, 2 high.

    Within the level, damping is the tested friction and a line in amplitude through the ratios of both levels.
    """
    fit = level.fit
    frequency, ratio, slope, friction = (v.copy() for v in (fit.frequency, fit.ratio, fit.slope, fit.friction))
    for k, at in others:
        if at.ratio is None:
            continue
        z, f = float(fit.ratio[k]), float(fit.frequency[k])
        frequency[k], ratio[k] = at.frequency, at.ratio[part]
        # amplitude is input/(z f^2)
        grown = at.input / find_input(level, f) * z / at.ratio.median * (f / at.frequency) ** 2
        friction[k] *= z / at.ratio.median / grown
        if abs(log(grown)) > _APART:
            rest = z / at.ratio.median - 1.0 - friction[k] * (grown - 1.0)
            slope[k] = np.clip(rest / (1.0 / grown - 1.0), *SLOPES)
        friction[k] = min(friction[k], 1.0, 1.0 + slope[k])
    return replace(fit, frequency=frequency, ratio=ratio, slope=slope, friction=friction)


def _list_responses(
    level: Level, fits: Sequence[ModalFit], k: int, seen: tuple[FloatArray, FloatArray], at: At
) -> Iterator[Response]:
    """Peak of every sensor kept, at a band of damping ratios (median, low, high); the largest gives the lowest peak.

    ``fits``: by the median, low and high ratios of all modes, or a single one. ``seen``: residues (sensors,) of mode
    number ``k``, NaN for a sensor left out, and their relative standard errors.
    """
    assert at.ratio is not None
    residues, residues_sd = seen
    drive = at.input * unit(level.run.drive_unit).factor
    ratios, still = (at.ratio.median, at.ratio.high, at.ratio.low), level.fit
    peaks = np.array([foresee_peaks(still, fits[0], k, residues, z) for z in ratios]) * drive
    moved = [foresee_peaks(still, fit, k, residues, at.ratio.median) * drive for fit in fits[1:]]
    beside = np.array(moved or [peaks[0]])
    for s, sensor in enumerate(level.run.channels):
        if np.isfinite(residues[s]):
            size = peaks[:, s] / (2.0 * pi * at.frequency) ** (2 - ORDERS[sensor.quantity]) / unit(sensor.unit).factor
            by_others = float(np.max(np.abs(np.log(beside[:, s] / peaks[0, s]))))
            spread = hypot(NORMAL_90 * float(hypot(residues_sd[s], fits[0].noise[0] / 3.0)), by_others)
            median, low, high = (float(part) for part in size)
            below, above = hypot(log(median / low), spread), hypot(log(high / median), spread)
            yield Response(sensor.name, sensor.quantity, sensor.unit, Bounds.about(median, below, above))


def foresee_peaks(still: ModalFit, fit: ModalFit, k: int, residues: FloatArray, ratio: float) -> FloatArray:
    """|H| of each sensor (sensors,) at its peak nearest to the resonance, including the other modes and the base.

    For a sensor without a peak there (on the flank of a neighbouring mode) it is |H| at the resonance. Where the other
    modes of the ``fit`` moved from those ``still`` there, their motion changes by the residues of their own bands: in
    the band of this mode those of far modes, the base and e are large numbers whose sum alone is known.
    """
    frequency = float(fit.frequency[k])
    f = frequency * (1.0 + _SEARCHED * ratio * np.linspace(-1.0, 1.0, 401))
    columns = still.columns(f)
    change = fit.columns(f) - columns
    G = receptance(f, frequency, ratio, float(fit.slope[k]), float(fit.friction[k]))
    columns[:, 2 + k], change[:, 2 + k] = fit.sign * (2.0 * pi * f) ** 2 * G, 0.0
    coefficients = still.local[k].copy()
    coefficients[:, 2 + k] = np.nan_to_num(residues)
    size = np.abs(coefficients @ columns.T + still.residues @ change[:, 2:].T)
    middle = len(f) // 2
    inner = (size[:, 1:-1] >= size[:, :-2]) & (size[:, 1:-1] > size[:, 2:])
    places = [np.flatnonzero(row) + 1 for row in inner]
    nearest = [int(p[np.argmin(np.abs(p - middle))]) if len(p) else middle for p in places]
    return np.asarray(size[np.arange(len(size)), nearest])
