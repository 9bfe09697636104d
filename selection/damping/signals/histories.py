"""A driven sine against time, tracked block by block.

A stepped or swept sine is demodulated by the phase of its drive. In a window of some cycles the phase theta(t) is a
parabola through the upward zero crossings of the drive, refined by a fit to the drive. With u = t - t_c each channel is
fitted by least squares with

    x(t) = Re[(X + X' u) exp(i theta) + X_3 exp(3 i theta)] + constant,

so that X is the amplitude in the middle even if the amplitude grows, theta' the frequency and theta'' its rate. Samples
are kept for the current window only: a record of any length takes the memory of its longest block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np

from damping.arrays import ComplexArray, FloatArray
from damping.errors import AnalysisError, InputError

MOST_KEPT = 20_000_000  #: samples of all channels within which a window must fit, to limit memory
CYCLES = 8  #: cycles of a window
HOP = 4  #: cycles from one window to the next
#: Windows whose frequency differs by less than this share form one row; a settled dwell uses the last window but one.
SAME_FREQUENCY = 5e-4
DWELL = 4  #: windows of a row from which its first and last are not used: they may reach beyond the dwell
PURITY = 0.2  #: largest residual of the drive in a window, over its sine: with more it is not one frequency
_HYSTERESIS = 0.1  # of the amplitude, below zero, that the drive must reach before the next crossing counts
_FEWEST_SAMPLES = 4.0  # in a cycle of the drive
ROWS_A_SIDE = 5  #: rows on either side from which the rate of a sweep is estimated
STILL = 0.5  #: largest drift of a dwell of n windows, over SAME_FREQUENCY f^2/(n HOP), the drift that would end it
_REFINED = 2  # refinements of the phase of a window


@dataclass(frozen=True)
class TrackedSine:
    """Rows of a driven test in the order of time.

    ``frequency`` Hz, ``rate`` Hz/s, ``time`` s, amplitude of the ``drive`` (n,); ``response``, ``third`` (channels, n)
    complex amplitudes of x = Re[X exp(i theta) + X_3 exp(3 i theta)], theta the phase of the drive.
    """

    frequency: FloatArray
    rate: FloatArray
    time: FloatArray
    drive: FloatArray
    response: ComplexArray
    third: ComplexArray


def track_sine(blocks: Iterable[FloatArray], drive: int, step: float) -> TrackedSine:
    """Rows of a test whose drive is a sine of any slowly changing frequency.

    Args:
        blocks: consecutive samples (channels, n) of any n.
        drive: index of the drive's channel; the others are responses in their order.
        step: between samples, s.

    InputError: samples that are not finite. AnalysisError: no window of the drive is a sine that can be tracked.
    """
    kept = np.empty((0, 0))
    rows: list[_Row] = []
    group: list[_Row] = []  # windows of the current row: the first (later the second), and the last
    start = 0
    for block in blocks:
        if not np.isfinite(block).all():
            raise InputError("samples that are no numbers", expected="finite numbers in every channel")
        kept = np.concatenate([kept, block], axis=1) if kept.size else np.asarray(block, dtype=np.float64)
        crossings = _find_crossings(kept[drive])
        first = 0
        while first + CYCLES < len(crossings):
            window = crossings[first : first + CYCLES + 1]
            row = _fit_window(kept, drive, window, step, start)
            first += HOP
            if row is None:
                continue
            if group and abs(row.frequency / group[0].frequency - 1.0) < SAME_FREQUENCY:
                windows = rows[-1].windows + 1
                until = group[-1] if windows >= DWELL else row
                drift = (until.frequency - group[0].frequency) / (until.time - group[0].time)
                rows[-1] = until._replace(drift=drift, windows=windows)
                group = [row] if windows == 2 else [group[0], row]
            else:
                rows.append(row)
                group = [row]
        if not first and kept.size > MOST_KEPT:
            raise AnalysisError(f"the drive does not rise through zero {CYCLES} times within {kept.shape[1]} samples")
        used = int(crossings[first - 1]) + 1 if first else 0  # keep the trough before the next crossing
        kept, start = kept[:, used:], start + used
    if not rows:
        what = f"the drive is no sine over {CYCLES} cycles anywhere"
        raise AnalysisError(f"{what}: random and impact tests are not supported")
    rows = _drop_passages(rows)
    frequency, rate, time, size, response, third, drifts, _ = (np.array(part) for part in zip(*rows, strict=True))
    rate = _smooth_rate(time, frequency, np.where(np.isnan(drifts), rate, drifts))
    rate[[row.is_dwell for row in rows]] = 0.0
    return TrackedSine(frequency, rate, time, size, response.T, third.T)


def _find_crossings(x: FloatArray) -> FloatArray:
    """Positions (in samples) at which x rises through zero, each after it was well below zero."""
    low = -_HYSTERESIS * 2.0**0.5 * float(np.sqrt(np.mean(x**2)))
    rising = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    below = np.flatnonzero(x < low)
    last = np.searchsorted(below, rising, side="right") - 1
    armed = np.where(last >= 0, below[np.maximum(last, 0)] if len(below) else -1, -1)
    before = np.concatenate([[-1], rising[:-1]])
    k = rising[armed > before]
    return np.asarray(k + x[k] / (x[k] - x[k + 1]))


class _Row(NamedTuple):
    """A row of a ``TrackedSine``; ``drift``: rate over its ``windows``, NaN for a single one."""

    frequency: float
    rate: float
    time: float
    drive: float
    response: ComplexArray
    third: ComplexArray
    drift: float = float("nan")
    windows: int = 1

    @property
    def is_dwell(self) -> bool:
        """Whether the frequency is constant."""
        slowest = SAME_FREQUENCY * self.frequency**2 / (self.windows * HOP)
        return self.windows >= DWELL and bool(abs(self.drift) < STILL * slowest)


def _drop_passages(rows: Sequence[_Row]) -> list[_Row]:
    """The rows without passages: rows between two dwells with fewer windows together than either dwell."""
    dwells = [k for k, row in enumerate(rows) if row.is_dwell]
    passages = {
        k
        for a, b in pairwise(dwells)
        if sum(row.windows for row in rows[a + 1 : b]) < min(rows[a].windows, rows[b].windows)
        for k in range(a + 1, b)
    }
    return [row for k, row in enumerate(rows) if k not in passages]


def _fit_window(x: FloatArray, drive: int, crossings: FloatArray, step: float, start: int) -> _Row | None:
    """The row of a window of samples that begin at ``start``; None if the drive is not a sine in it."""
    a, b = int(np.ceil(crossings[0])), int(crossings[-1])
    if b - a < _FEWEST_SAMPLES * CYCLES:
        return None
    middle = 0.5 * (crossings[0] + crossings[-1])
    u = (np.arange(a, b) - middle) / (b - a)
    cycle = np.polynomial.polynomial.polyfit((crossings - middle) / (b - a), np.arange(len(crossings)), 2)
    theta = 2.0 * pi * cycle - np.array([0.5 * pi, 0.0, 0.0])  # the drive is a sine, and Re exp(i theta) a cosine
    samples = x[:, a:b]
    for _ in range(_REFINED):
        wave = np.exp(1j * np.polynomial.polynomial.polyval(u, theta))
        basis = np.column_stack([wave, wave * u, wave * u**2])
        d, residual = _fit_real(basis, samples[drive : drive + 1])
        grown = d[0] / d[0, 0]
        theta = theta + np.array([np.angle(d[0, 0]), grown[1].imag, grown[2].imag - (grown[1] ** 2).imag / 2.0])
    if float(np.sqrt(np.mean(residual**2))) > PURITY * abs(d[0, 0]) / 2.0**0.5:
        return None
    wave = np.exp(1j * np.polynomial.polynomial.polyval(u, theta))
    amplitudes, _ = _fit_real(np.column_stack([wave, wave * u, wave**3]), samples)
    length, time = (b - a) * step, start * step + middle * step
    frequency, rate = theta[1] / (2.0 * pi * length), theta[2] / (pi * length**2)
    others = np.delete(amplitudes, drive, axis=0)
    return _Row(frequency, rate, time, float(abs(amplitudes[drive, 0])), others[:, 0], others[:, 2])


def _fit_real(basis: ComplexArray, samples: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Complex coefficients (channels, terms) of Re(basis c) + constant, and residuals (channels, n)."""
    design = np.column_stack([basis.real, -basis.imag, np.ones(len(basis))])
    solution = np.linalg.lstsq(design, samples.T)[0]
    terms = basis.shape[1]
    coefficients = np.asarray((solution[:terms] + 1j * solution[terms : 2 * terms]).T)
    return coefficients, np.asarray(samples - (design @ solution).T)


def _smooth_rate(time: FloatArray, frequency: FloatArray, rate: FloatArray) -> FloatArray:
    """Slope of the frequency over ``ROWS_A_SIDE`` rows on either side if all are of one sweep; else the given rate."""
    values = rate.copy()
    for k in range(len(time)):
        part = slice(max(k - ROWS_A_SIDE, 0), k + ROWS_A_SIDE + 1)
        t, f = time[part] - time[k], frequency[part]
        if len(t) > 2 and abs(np.sum(np.sign(np.diff(f)))) == len(t) - 1:
            values[k] = np.polyfit(t, f, 1)[0]
    return values
