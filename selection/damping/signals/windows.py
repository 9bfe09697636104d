"""A free decay through a window of some periods: even sampling, band pass, analytic signal and noise beside it."""

from dataclasses import dataclass

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.errors import InputError

ENOUGH = 32  #: samples a period that are enough: longer records are averaged in groups
_BESIDE = 4.5  # where noise is looked for, in 1/length above the mode: outside the main lobe of the window used there
_LARGEST_GAP = 2.5  # steps between samples that jitter; more is a gap
UNEVEN = 0.02  #: deviation of times from even ones, over a step, that counts as rounding of printed times
_PARTS = 10  # of a record whose mean steps are compared
_STRETCHED = 5.0  # standard errors of a mean step by which it is another
_FEWEST_OF_DECAY = 8  # samples a period of a decay must have


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
    if np.isfinite(off) and off > UNEVEN * dt and np.all(step > 0.0) and np.max(step) <= gap:
        parts = np.array_split(step, _PARTS)
        stretched = max(abs(np.mean(part) - dt) * np.sqrt(len(part)) for part in parts if len(part))
        if stretched <= _STRETCHED * np.std(step):
            notes = [f"times jitter by up to {100.0 * off * frequency:.2g} % of a period: resampled every {dt:.6g} s"]
            t, x, off = even, np.asarray(CubicSpline(t, x)(even), dtype=np.float64), 0.0
    if not (dt > 0.0 and off <= UNEVEN * dt):
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
