"""Motion against time: even sampling, a window about a frequency, and a driven sine tracked block by block.

A free decay is seen through a window of some periods: band pass, analytic signal and noise beside the band in one
convolution.

A stepped or swept sine is demodulated by the phase of its drive. A window of some cycles of it has the phase theta(t),
a parabola through its upward crossings of zero, made exact by the drive itself. With u = t - t_c each channel is fitted
by least squares with

    x(t) = Re[(X + X' u) exp(i theta) + X_3 exp(3 i theta)] + constant,

so that X is its amplitude in the middle although the amplitude grows, theta' the frequency and theta'' its rate.
Samples are kept for the window at hand alone: a record of any length takes the memory of its longest block.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi
from typing import NamedTuple

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.errors import AnalysisError, InputError

ENOUGH = 32  #: samples a period that are enough: longer records are averaged in groups
_BESIDE = 4.5  # where noise is looked for, in 1/length above the mode: outside the main lobe of the window used there
_LARGEST_GAP = 2.5  # steps between samples that jitter; more is a gap
_UNEVEN = 0.02  # relative deviation of time steps that counts as rounding of printed times
_PARTS = 10  # of a record whose mean steps are compared
_STRETCHED = 5.0  # standard errors of a mean step by which it is another
_FEWEST_OF_DECAY = 8  # samples a period of a decay must have

MOST_KEPT = 20_000_000  #: samples of all channels within which a window must fit: as many as memory holds with ease
CYCLES = 8  #: cycles of a window
HOP = 4  #: cycles from one window to the next
#: Windows whose frequency differs by less than this share are one row: of a dwell the last but one, when it has settled
SAME_FREQUENCY = 5e-4
DWELL = 4  #: windows of a row from which on its first and last are not used: they may reach beyond the dwell
PURITY = 0.2  #: most that a window of the drive may hold beside its sine, as a share of it: more is no one frequency
_HYSTERESIS = 0.1  # of the amplitude, by which a crossing of zero must be left again to count
_FEWEST_SAMPLES = 4.0  # a cycle of a drive
ROWS_A_SIDE = 5  #: rows before and after one over which the rate of a sweep is told
STILL = 0.5  #: drift of a dwell of n windows over that of a sweep that leaves it after n, SAME_FREQUENCY f^2/(n HOP)
_REFINED = 2  # times that the phase of a window is made exact


@dataclass(frozen=True)
class Window:
    """A window: ``offsets`` (odd number, s), real ``weights`` there, the centre ``omega_0`` (rad/s)."""

    offsets: FloatArray
    weights: FloatArray
    omega_0: float

    @property
    def length(self) -> float:
        """Length, s."""
        return float(self.offsets[-1] - self.offsets[0])

    @property
    def correlation(self) -> float:
        """Time after which noise behind the window is independent: 1/(equivalent noise bandwidth), s."""
        dt = float(self.offsets[1] - self.offsets[0])
        return dt * float(np.sum(self.weights) ** 2 / np.sum(self.weights**2))

    def analytic(self, x: FloatArray) -> ComplexArray:
        """z where the window lies inside x."""
        from scipy.signal import oaconvolve  # noqa: PLC0415 - slow to import, and only long signals need it

        kernel = self.weights * np.exp(-1j * self.omega_0 * self.offsets)
        return np.asarray(oaconvolve(x, kernel[::-1], mode="valid"))

    def gain(self, s: complex) -> complex:
        """What the window makes of exp(s t); its image at the conjugate of s averages out over a level."""
        return complex(0.5 * self.weights @ np.exp((s - 1j * self.omega_0) * self.offsets))


def even_times(t: FloatArray, x: FloatArray, frequency: float) -> tuple[FloatArray, FloatArray, float, list[str]]:
    """Times and motion at an even spacing that resolves the mode, its step, and what was done.

    Times that jitter about an even spacing without a gap: a cubic spline through the samples, taken evenly. With n
    samples a period its error is (2 pi/n)^4/384 of the amplitude: 1e-3 at 8, 2e-5 at 20. Steps that grow or shrink
    along the record by more than their scatter explains are no jitter but a stretch, which would pass for a change of
    frequency: those times stay as they are, and are refused.
    """
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to import, and only free decays need it

    step, notes = np.diff(t), []
    dt = float((t[-1] - t[0]) / (len(t) - 1))
    even = t[0] + dt * np.arange(len(t))
    off = float(np.max(np.abs(t - even))) if np.isfinite(t).all() else np.inf
    gap = min(_LARGEST_GAP * dt, 1.0 / (_FEWEST_OF_DECAY * frequency))
    if np.isfinite(off) and off > _UNEVEN * dt and np.all(step > 0.0) and np.max(step) <= gap:
        parts = np.array_split(step, _PARTS)
        stretched = max(abs(np.mean(part) - dt) * np.sqrt(len(part)) for part in parts if len(part))
        if stretched <= _STRETCHED * np.std(step):
            notes = [f"times jitter by up to {100.0 * off * frequency:.2g} % of a period: resampled every {dt:.6g} s"]
            t, x, off = even, np.asarray(CubicSpline(t, x)(even), dtype=np.float64), 0.0
            dt = float((t[-1] - t[0]) / (len(t) - 1))
    if not (dt > 0.0 and off <= _UNEVEN * dt):
        raise InputError(describe_uneven(t), expected="one step throughout, rising")
    if not frequency * dt <= 1.0 / _FEWEST_OF_DECAY:
        message = f"{1.0 / (frequency * dt):.3g} samples a period of {frequency:g} Hz"
        raise InputError(message, expected=f"at least {_FEWEST_OF_DECAY}")
    return t, x, dt, notes


def describe_uneven(t: FloatArray) -> str:
    """What is wrong with times (n,) that are not evenly spaced, and where they are so least."""
    step = np.diff(t)
    k = int(np.argmax(np.abs(step - np.median(step))))
    return f"the times are not evenly spaced: {t[k]:.8g} to {t[k + 1]:.8g} s beside steps of {np.median(step):.4g} s"


def thinned(t: FloatArray, x: FloatArray, dt: float, frequency: float) -> tuple[FloatArray, FloatArray]:
    """Means of groups of samples, so that about ``ENOUGH`` a period of ``frequency`` (Hz) are left.

    A mean over k samples takes sin(k a)/(k sin a), a = pi f dt, of a sine; this is divided out at ``frequency``.
    """
    k = int(1.0 / (frequency * dt * ENOUGH))
    n = len(x) // max(k, 1) * k
    if k < 2 or n < 2 * k:
        return t, x
    angle = np.pi * frequency * dt
    kept = np.sin(k * angle) / (k * np.sin(angle))
    return t[0] + dt * (k * np.arange(n // k) + 0.5 * (k - 1)), x[:n].reshape(-1, k).mean(axis=1) / kept


def flat_window(frequency: float, periods: float, dt: float) -> Window:
    """Hann window times a + b tau^2 of area 2 and no second moment, ``periods`` of ``frequency`` (Hz) long."""
    from scipy.signal.windows import hann  # noqa: PLC0415 - slow to import, and only free decays need it

    half = round(0.5 * periods / (frequency * dt))
    offsets = dt * np.arange(-half, half + 1)
    weights = np.asarray(hann(2 * half + 3)[1:-1], dtype=np.float64)
    zeroth, second, fourth = (float(weights @ offsets**power) for power in (0, 2, 4))
    a, b = np.linalg.solve([[zeroth, second], [second, fourth]], [2.0, 0.0])
    flat = np.asarray(weights * (a + b * offsets**2), dtype=np.float64)
    return Window(np.asarray(offsets, dtype=np.float64), flat, RAD_S_PER_HZ * frequency)


def noise_beside(window: Window, x: FloatArray, z: ComplexArray) -> float:
    """Amplitude of noise in z, the window's view of x, at the end of the record.

    Taken beside the pass band, where there is noise alone, and at most what is in the band, motion or noise.
    """
    from scipy.signal.windows import blackmanharris  # noqa: PLC0415 - slow to import, and only free decays need it

    tail = np.abs(z[-(len(z) // 10 + 1) :])
    weights = np.asarray(blackmanharris(len(window.offsets)), dtype=np.float64)
    weights *= np.sqrt(np.sum(window.weights**2) / np.sum(weights**2))  # lets as much noise pass
    beside = Window(window.offsets, weights, window.omega_0 + _BESIDE * RAD_S_PER_HZ / window.length)
    floor = np.abs(beside.analytic(x[-(len(tail) + len(weights)) :]))
    return float(min(np.median(tail), np.median(floor)))


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
        blocks: samples (channels, n) of any n, one after the other. drive: place of the drive's channel, the others are
            responses in their order. step: between samples, s.

    InputError: samples that are no numbers. AnalysisError: no window of the drive is a sine that can be tracked.
    """
    kept = np.empty((0, 0))
    rows: list[_Row] = []
    group: list[_Row] = []  # windows of the last row: its first, then its second, and its last
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
        used = int(crossings[first - 1]) + 1 if first else 0  # the trough before a crossing is part of it
        kept, start = kept[:, used:], start + used
    if not rows:
        raise AnalysisError(f"the drive is no sine over {CYCLES} cycles anywhere: random and impact tests are not read")
    rows = _drop_passages(rows)
    frequency, rate, time, size, response, third, drifts, _ = (np.array(part) for part in zip(*rows, strict=True))
    rate = _smooth_rate(time, frequency, np.where(np.isnan(drifts), rate, drifts))
    rate[[row.is_dwell for row in rows]] = 0.0
    return TrackedSine(frequency, rate, time, size, response.T, third.T)


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


class _Row(NamedTuple):
    """A row of a ``TrackedSine``; ``drift``: rate over its ``windows``, NaN of one alone."""

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
        """Whether its frequency stays."""
        slowest = SAME_FREQUENCY * self.frequency**2 / (self.windows * HOP)
        return self.windows >= DWELL and bool(abs(self.drift) < STILL * slowest)


def _drop_passages(rows: Sequence[_Row]) -> list[_Row]:
    """The rows without those between two dwells that have fewer windows together than either of the two."""
    dwells = [k for k, row in enumerate(rows) if row.is_dwell]
    passages = {
        k
        for a, b in pairwise(dwells)
        if sum(row.windows for row in rows[a + 1 : b]) < min(rows[a].windows, rows[b].windows)
        for k in range(a + 1, b)
    }
    return [row for k, row in enumerate(rows) if k not in passages]


def _fit_window(x: FloatArray, drive: int, crossings: FloatArray, step: float, start: int) -> _Row | None:
    """The row of a window of samples that begin at ``start``; None where the drive is no sine in it."""
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
        d, left = _fit_real(basis, samples[drive : drive + 1])
        grown = d[0] / d[0, 0]
        theta = theta + np.array([np.angle(d[0, 0]), grown[1].imag, grown[2].imag - (grown[1] ** 2).imag / 2.0])
    if float(np.sqrt(np.mean(left**2))) > PURITY * abs(d[0, 0]) / 2.0**0.5:
        return None
    wave = np.exp(1j * np.polynomial.polynomial.polyval(u, theta))
    amplitudes, _ = _fit_real(np.column_stack([wave, wave * u, wave**3]), samples)
    long, time = (b - a) * step, start * step + middle * step
    frequency, rate = theta[1] / (2.0 * pi * long), theta[2] / (pi * long**2)
    others = np.delete(amplitudes, drive, axis=0)
    return _Row(frequency, rate, time, float(abs(amplitudes[drive, 0])), others[:, 0], others[:, 2])


def _fit_real(basis: ComplexArray, samples: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Complex coefficients (channels, k) of Re(basis c) + constant, and what is left (channels, n)."""
    design = np.column_stack([basis.real, -basis.imag, np.ones(len(basis))])
    solution = np.linalg.lstsq(design, samples.T)[0]
    k = basis.shape[1]
    return np.asarray((solution[:k] + 1j * solution[k : 2 * k]).T), np.asarray(samples - (design @ solution).T)


def _smooth_rate(time: FloatArray, frequency: FloatArray, rate: FloatArray) -> FloatArray:
    """Slope of the frequency over some rows before and after, where these are of one sweep; else the row's own rate."""
    values = rate.copy()
    for k in range(len(time)):
        part = slice(max(k - ROWS_A_SIDE, 0), k + ROWS_A_SIDE + 1)
        t, f = time[part] - time[k], frequency[part]
        if len(t) > 2 and abs(np.sum(np.sign(np.diff(f)))) == len(t) - 1:
            values[k] = np.polyfit(t, f, 1)[0]
    return values
