"""Even times, and a window of some periods: band pass, analytic signal and noise beside the band in one convolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.errors import InputError

#: Samples a period that are enough: longer records are averaged in groups.
ENOUGH = 32
_BESIDE = 4.5  # where noise is looked for, in 1/length above the mode: outside the main lobe of the window used there

Signal = npt.NDArray[np.complex128]


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

    def analytic(self, x: FloatArray) -> Signal:
        """z where the window lies inside x."""
        from scipy.signal import oaconvolve  # noqa: PLC0415 - slow to import, and only long signals need it

        kernel = self.weights * np.exp(-1j * self.omega_0 * self.offsets)
        signal: Signal = oaconvolve(x, kernel[::-1], mode="valid")
        return signal

    def gain(self, s: complex) -> complex:
        """What the window makes of exp(s t); its image at the conjugate of s averages out over a level."""
        return complex(0.5 * self.weights @ np.exp((s - 1j * self.omega_0) * self.offsets))


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
    from scipy.signal.windows import hann  # noqa: PLC0415 - as above

    half = round(0.5 * periods / (frequency * dt))
    offsets = dt * np.arange(-half, half + 1)
    weights = np.asarray(hann(2 * half + 3)[1:-1], dtype=np.float64)
    zeroth, second, fourth = (float(weights @ offsets**power) for power in (0, 2, 4))
    a, b = np.linalg.solve([[zeroth, second], [second, fourth]], [2.0, 0.0])
    flat = np.asarray(weights * (a + b * offsets**2), dtype=np.float64)
    return Window(np.asarray(offsets, dtype=np.float64), flat, RAD_S_PER_HZ * frequency)


def noise_beside(window: Window, x: FloatArray, z: Signal) -> float:
    """Amplitude of noise in z, the window's view of x, at the end of the record.

    Taken beside the pass band, where there is noise alone, and at most what is in the band, motion or noise.
    """
    from scipy.signal.windows import blackmanharris  # noqa: PLC0415 - as above

    tail = np.abs(z[-(len(z) // 10 + 1) :])
    weights = np.asarray(blackmanharris(len(window.offsets)), dtype=np.float64)
    weights *= np.sqrt(np.sum(window.weights**2) / np.sum(weights**2))  # lets as much noise pass
    beside = Window(window.offsets, weights, window.omega_0 + _BESIDE * RAD_S_PER_HZ / window.length)
    floor = np.abs(beside.analytic(x[-(len(tail) + len(weights)) :]))
    return float(min(np.median(tail), np.median(floor)))


def even_times(t: FloatArray, x: FloatArray, frequency: float) -> tuple[FloatArray, FloatArray, list[str]]:
    """Times that jitter about an even spacing without a gap: a cubic spline through the samples, taken evenly.

    With n samples a period its error is (2 pi/n)^4/384 of the amplitude: 1e-3 at 8, 2e-5 at 20. Steps that grow or
    shrink along the record by more than their scatter explains are no jitter but a stretch, which would pass for a
    change of frequency: those times stay as they are.
    """
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - as above

    step = np.diff(t)
    dt = float((t[-1] - t[0]) / max(len(t) - 1, 1))
    even = t[0] + dt * np.arange(len(t))
    off = float(np.max(np.abs(t - even))) if np.isfinite(t).all() else np.inf
    gap = min(_LARGEST_GAP * dt, 1.0 / (_FEWEST_SAMPLES * frequency))
    if off <= _UNEVEN * dt or not (np.all(step > 0.0) and np.max(step) <= gap and np.isfinite(off)):
        return t, x, []
    stretched = [abs(np.mean(part) - dt) * np.sqrt(len(part)) for part in np.array_split(step, _PARTS) if len(part)]
    if max(stretched) > _STRETCHED * np.std(step):
        return t, x, []
    note = f"times jitter by up to {100.0 * off * frequency:.2g} % of a period: resampled every {dt:.6g} s"
    return even, np.asarray(CubicSpline(t, x)(even), dtype=np.float64), [note]


def find_step(t: FloatArray, frequency: float) -> float:
    """Time step of an even spacing that resolves the mode."""
    dt = float((t[-1] - t[0]) / (len(t) - 1))
    for first in range(0, len(t), _PART):
        part = t[first : first + _PART]
        off = np.abs(part - (t[0] + dt * np.arange(first, first + len(part))))
        if not (np.isfinite(dt) and dt > 0.0 and np.max(off) <= _UNEVEN * dt):
            raise InputError("the times are not evenly spaced", expected="one step throughout, rising")
    if not frequency * dt <= 1.0 / _FEWEST_SAMPLES:
        raise InputError(
            f"{1.0 / (frequency * dt):.3g} samples a period of {frequency:g} Hz", expected=f"at least {_FEWEST_SAMPLES}"
        )
    return dt


_PART = 1_000_000  # samples looked at together


_LARGEST_GAP = 2.5  # steps between samples that jitter; more is a gap


_UNEVEN = 0.02  # relative deviation of time steps that counts as rounding of printed times


_PARTS = 10  # of a record whose mean steps are compared


_STRETCHED = 5.0  # standard errors of a mean step by which it is another


_FEWEST_SAMPLES = 8  # a period must have so many
