"""Stepped and swept sine in time to rows: every channel demodulated by the phase of the drive, block by block.

A window of some cycles of the drive has the phase theta(t), a parabola through its upward crossings of zero, made exact
by the drive itself. With u = t - t_c each channel is fitted by least squares with

    x(t) = Re[(X + X' u) exp(i theta) + X_3 exp(3 i theta)] + constant,

so that X is its amplitude in the middle although the amplitude grows, theta' the frequency and theta'' its rate. What
is left over is the noise, and with it the uncertainty of X. Samples are kept for the window at hand alone: a record of
any length takes the memory of its longest block.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import pi

import numpy as np
import numpy.typing as npt

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError

Complex = npt.NDArray[np.complex128]

#: Samples of all channels within which a window must fit: as many as memory holds with ease.
MOST_KEPT = 20_000_000
#: Cycles of a window, and from one window to the next.
CYCLES = 8
HOP = 4
#: Rows whose frequency differs by less than this share are one: of a dwell the last counts, where it has settled.
SAME_FREQUENCY = 5e-4
#: Most that a window of the drive may hold beside its sine, as a share of it: more is no one frequency.
PURITY = 0.2
_HYSTERESIS = 0.1  # of the amplitude, by which a crossing of zero must be left again to count
_FEWEST_SAMPLES = 4.0  # a cycle
#: Rows before and after one over which the rate of a sweep is told.
ROWS_A_SIDE = 5
_REFINED = 2  # times that the phase of a window is made exact


@dataclass(frozen=True)
class TrackedSine:
    """Rows of a driven test in the order of time.

    ``frequency`` Hz, ``rate`` Hz/s, ``time`` s, amplitude of the ``drive`` (n,); ``response``, ``third`` (channels, n)
    complex amplitudes of x = Re[X exp(i theta) + X_3 exp(3 i theta)], theta the phase of the drive; ``response_sd``
    (channels, n) of each part of X, from what the window leaves.
    """

    frequency: FloatArray
    rate: FloatArray
    time: FloatArray
    drive: FloatArray
    response: Complex
    third: Complex
    response_sd: FloatArray


def track_sine(blocks: Iterable[FloatArray], drive: int, step: float) -> TrackedSine:
    """Rows of a test whose drive is a sine of any slowly changing frequency.

    Args:
        blocks: samples (channels, n) of any n, one after the other. drive: place of the drive's channel, the others are
            responses in their order. step: between samples, s.

    Raises:
        InputError: samples that are no numbers. AnalysisError: no window of the drive is a sine that can be tracked.
    """
    kept = np.empty((0, 0))
    start, rows = 0, _Windows()
    for block in blocks:
        if not np.isfinite(block).all():
            raise InputError("samples that are no numbers", expected="finite numbers in every channel")
        kept = np.concatenate([kept, block], axis=1) if kept.size else np.asarray(block, dtype=np.float64)
        crossings = _find_crossings(kept[drive])
        first = 0
        while first + CYCLES < len(crossings):
            window = crossings[first : first + CYCLES + 1]
            rows.add(_fit_window(kept, drive, window, step), start * step)
            first += HOP
        if not first and kept.size > MOST_KEPT:
            raise AnalysisError(f"the drive does not rise through zero {CYCLES} times within {kept.shape[1]} samples")
        used = int(crossings[first - 1]) + 1 if first else 0  # the trough before a crossing is part of it
        kept, start = kept[:, used:], start + used
    return rows.collect()


def _find_crossings(x: FloatArray) -> FloatArray:
    """Places (in samples) at which x rises through zero, each after it was well below."""
    low = -_HYSTERESIS * 2.0**0.5 * float(np.sqrt(np.mean(x**2)))
    rising = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
    below = np.flatnonzero(x < low)
    last = np.searchsorted(below, rising, side="right") - 1
    armed = np.where(last >= 0, below[np.maximum(last, 0)] if len(below) else -1, -1)
    before = np.concatenate([[-1], rising[:-1]])
    k = rising[armed > before]
    return np.asarray(k + x[k] / (x[k] - x[k + 1]))


@dataclass(frozen=True)
class _Window:
    """One row: ``t`` in s from the first sample at hand, frequency, rate, drive, responses, thirds and their sd."""

    t: float
    frequency: float
    rate: float
    drive: float
    response: Complex
    third: Complex
    sd: FloatArray


def _fit_window(x: FloatArray, drive: int, crossings: FloatArray, step: float) -> _Window | None:
    """The row of a window; None where the drive is no sine in it."""
    a, b = int(np.ceil(crossings[0])), int(crossings[-1])
    if b - a < _FEWEST_SAMPLES * CYCLES:
        return None
    middle = 0.5 * (crossings[0] + crossings[-1])
    u = (np.arange(a, b) - middle) / (b - a)
    cycle = np.polynomial.polynomial.polyfit((crossings - middle) / (b - a), np.arange(len(crossings)), 2)
    theta = 2.0 * pi * cycle - np.array([0.5 * pi, 0.0, 0.0])  # the drive is a sine, and Re exp(i theta) a cosine
    samples = x[:, a:b]
    for _ in range(_REFINED):
        phase = np.polynomial.polynomial.polyval(u, theta)
        wave = np.exp(1j * phase)
        basis = np.column_stack([wave, wave * u, wave * u**2])
        d, left = _fit_real(basis, samples[drive : drive + 1])
        grown = d[0] / d[0, 0]
        theta = theta + np.array([np.angle(d[0, 0]), grown[1].imag, grown[2].imag - (grown[1] ** 2).imag / 2.0])
    if float(np.sqrt(np.mean(left**2))) > PURITY * abs(d[0, 0]) / 2.0**0.5:
        return None
    phase = np.polynomial.polynomial.polyval(u, theta)
    wave = np.exp(1j * phase)
    amplitudes, left = _fit_real(np.column_stack([wave, wave * u, wave**3]), samples)
    long = (b - a) * step
    others = [k for k in range(len(x)) if k != drive]
    sd = np.std(left, axis=1) * np.sqrt(2.0 / (b - a))
    frequency, rate = theta[1] / (2.0 * pi * long), theta[2] / (pi * long**2)
    size = float(abs(amplitudes[drive, 0]))
    return _Window(middle * step, frequency, rate, size, amplitudes[others, 0], amplitudes[others, 2], sd[others])


def _fit_real(basis: Complex, samples: FloatArray) -> tuple[Complex, FloatArray]:
    """Complex coefficients (channels, k) of Re(basis c) + constant, and what is left (channels, n)."""
    design = np.column_stack([basis.real, -basis.imag, np.ones(len(basis))])
    solution = np.linalg.lstsq(design, samples.T)[0]
    k = basis.shape[1]
    return np.asarray((solution[:k] + 1j * solution[k : 2 * k]).T), np.asarray(samples - (design @ solution).T)


class _Windows:
    """Windows as they come, those of one frequency as one."""

    def __init__(self) -> None:
        self._rows: list[_Window] = []
        self._times: list[float] = []
        self._counts: list[int] = []
        self._anchor = 0.0

    def add(self, row: _Window | None, start: float) -> None:
        if row is None:
            return
        same = bool(self._rows) and abs(row.frequency / self._anchor - 1.0) < SAME_FREQUENCY
        if same:
            self._rows[-1], self._times[-1] = row, start + row.t
            self._counts[-1] += 1
        else:
            self._rows.append(row)
            self._times.append(start + row.t)
            self._counts.append(1)
            self._anchor = row.frequency

    def collect(self) -> TrackedSine:
        """All rows. AnalysisError where there is none."""
        if not self._rows:
            raise AnalysisError(f"the drive is no sine over {CYCLES} cycles anywhere")
        frequency, rate, drive = (
            np.array([getattr(row, name) for row in self._rows]) for name in ("frequency", "rate", "drive")
        )
        response, third, sd = (
            np.array([getattr(row, name) for row in self._rows]).T for name in ("response", "third", "sd")
        )
        time = np.array(self._times)
        rate = np.where(np.array(self._counts) == 1, _smooth_rate(time, frequency, rate), rate)
        return TrackedSine(frequency, rate, time, drive, response, third, sd)


def _smooth_rate(time: FloatArray, frequency: FloatArray, rate: FloatArray) -> FloatArray:
    """Slope of the frequency over some rows before and after, where these are of one sweep; else the row's own rate."""
    values = rate.copy()
    for k in range(len(time)):
        part = slice(max(k - ROWS_A_SIDE, 0), k + ROWS_A_SIDE + 1)
        t, f = time[part] - time[k], frequency[part]
        if len(t) > 2 and abs(np.sum(np.sign(np.diff(f)))) == len(t) - 1:
            values[k] = np.polyfit(t, f, 1)[0]
    return values
