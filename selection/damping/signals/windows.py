"""A free decay through a window of some periods: even sampling, band pass, analytic signal and out-of-band noise."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.errors import InputError

PERIODS = 6.0  #: periods of the window: it rejects frequencies farther away than some 2/periods of that of the mode
APART = 2.0  #: least length of a window that separates two modes, over 1/(their distance)
NEIGHBOUR = 8.0  #: a mode nearer than this over the length of a window leaks into it
ENOUGH = 32  #: sufficient samples per period: denser records are averaged in groups
_BESIDE = 4.5  # where noise is measured, in 1/length above the mode: outside the main lobe of the window used there
_LARGEST_GAP = 2.5  # largest step between samples with jitter, over the mean step; a larger one is a gap
UNEVEN = 0.02  #: largest deviation from even times, over a step, that counts as rounding of printed times
_ROUNDED = 0.6  # largest deviation of rounded times from even ones, in the last digit: half, and the error of the line
_LIKE_WHOLE = 1e-3  # largest deviation from whole last digits: that of binary numbers
_ALTERNATE = 0.01  # least share of each of two steps: a sample that is missing gives one larger step
_TOGETHER = 1_000_000  # samples that are worked on together
_PARTS = 10  # parts of a record whose mean steps are compared
_STRETCHED = 5.0  # largest deviation of a part's mean step, in standard errors
_FEWEST_OF_DECAY = 8  # fewest samples per period of a decay
FLATTENED = 0.005  #: third harmonic from which flattened peaks are said: clipping or compression of some 1 %
_NEAR = 0.15  # largest distance of a motion from its mode, relative: half the main lobe of a window of 6 periods
_IN_STEP = 0.9  # least share of the third harmonic in step with the motion; a mode near it is in no step


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

    @property
    def kernel(self) -> ComplexArray:
        """The weights turned by the centre, less what they give of a constant."""
        turned = self.weights * np.exp(-1j * self.omega_0 * self.offsets)
        return np.asarray(turned - self.weights * (np.sum(turned) / np.sum(self.weights)))

    def analytic(self, x: FloatArray) -> ComplexArray:
        """Analytic signal z where the window lies inside x."""
        from scipy.signal import oaconvolve  # noqa: PLC0415 - slow to import, and only long signals need it

        kernel = self.kernel
        starts = range(0, max(len(x) - len(kernel) + 1, 1), _TOGETHER)
        parts = (x[start : start + _TOGETHER + len(kernel) - 1] for start in starts)
        return np.concatenate([oaconvolve(part, kernel[::-1], mode="valid") for part in parts])

    def gain(self, s: complex) -> complex:
        """Gain of z for the real part of exp(s t); its image at the conjugate of s averages out over a level."""
        return complex(0.5 * self.kernel @ np.exp(s * self.offsets))


def space_evenly(t: FloatArray, x: FloatArray, frequency: float) -> tuple[FloatArray, FloatArray, float, list[str]]:
    """Times and motion at an even spacing that resolves the mode, the step, and notes.

    Even times printed to few decimals are taken as even. Times with jitter but no gap are resampled evenly by a cubic
    spline. With n samples per period its error is (2 pi/n)^4/384 of the amplitude: 1e-3 at 8, 2e-5 at 20. Steps that
    grow or shrink along the record by more than their scatter are not jitter but a stretch, which would look like a
    change of frequency: such times are refused.
    """
    notes: list[str] = []
    dt = float((t[-1] - t[0]) / (len(t) - 1))
    off = _find_deviation(t, t[0], dt)
    if off > UNEVEN * dt and (digit := _find_last_digit(t)):
        slope, first = np.polyfit(np.arange(len(t)), t, 1)
        if _find_deviation(t, first, slope) <= _ROUNDED * digit:
            notes = [f"times are printed to {digit:g} s: taken as even, every {slope:.6g} s"]
            t, dt, off = first + slope * np.arange(len(t)), float(slope), 0.0
    if np.isfinite(off) and off > UNEVEN * dt:
        t, x, off, notes = _resample(t, x, dt, off, frequency)
    if not (dt > 0.0 and off <= UNEVEN * dt):
        raise InputError(describe_uneven(t), expected="one step throughout, rising")
    if not frequency * dt <= 1.0 / _FEWEST_OF_DECAY:
        message = f"{1.0 / (frequency * dt):.3g} samples a period of {frequency:g} Hz"
        raise InputError(message, expected=f"at least {_FEWEST_OF_DECAY}")
    return t, x, dt, notes


def _find_deviation(t: FloatArray, first: float, dt: float) -> float:
    """Largest deviation of times (n,) from even ones; infinite if one is no number. In parts, to need little memory."""
    starts = range(0, len(t), _TOGETHER)
    parts = ((k, t[k : k + _TOGETHER]) for k in starts)
    off = max(float(np.max(np.abs(part - (first + dt * np.arange(k, k + len(part)))))) for k, part in parts)
    return off if np.isfinite(off) else np.inf


def _find_last_digit(t: FloatArray) -> float:
    """The unit, s, to which even times (n,) were rounded: two neighbouring steps then alternate; 0 if they do not."""
    since = t - t[0]
    for digit in 10.0 ** -np.arange(1.0, 8.0):
        counts = np.rint(since / digit)
        if np.max(np.abs(since / digit - counts)) < _LIKE_WHOLE:
            steps = np.diff(counts)
            larger = float(np.mean(steps == np.max(steps)))
            return float(digit) if np.ptp(steps) == 1.0 and _ALTERNATE < larger < 1.0 - _ALTERNATE else 0.0
    return 0.0


def _resample(
    t: FloatArray, x: FloatArray, dt: float, off: float, frequency: float
) -> tuple[FloatArray, FloatArray, float, list[str]]:
    """Even times, the motion there, the deviation left and a note; all as they are if the times do not just jitter."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415 - slow to import, and only free decays need it

    step, gap = np.diff(t), min(_LARGEST_GAP * dt, 1.0 / (_FEWEST_OF_DECAY * frequency))
    parts = [part for part in np.array_split(step, _PARTS) if len(part)]
    stretched = max(abs(np.mean(part) - dt) * np.sqrt(len(part)) for part in parts)
    if not (np.all(step > 0.0) and np.max(step) <= gap and stretched <= _STRETCHED * np.std(step)):
        return t, x, off, []
    even = t[0] + dt * np.arange(len(t))
    note = f"times jitter by up to {100.0 * off * frequency:.2g} % of a period: resampled every {dt:.6g} s"
    return even, np.asarray(CubicSpline(t, x)(even), dtype=np.float64), 0.0, [note]


def describe_uneven(t: FloatArray) -> str:
    """Message on times (n,) that are not evenly spaced, with the most uneven place."""
    step = np.diff(t)
    k = int(np.argmax(np.abs(step - np.median(step))))
    return f"the times are not evenly spaced: {t[k]:.8g} to {t[k + 1]:.8g} s beside steps of {np.median(step):.4g} s"


def average_groups(t: FloatArray, x: FloatArray, dt: float, frequency: float) -> tuple[FloatArray, FloatArray]:
    """Means of groups of samples, so that about ``ENOUGH`` per period of ``frequency`` (Hz) remain.

    A mean over k samples scales a sine by sin(k a)/(k sin a), a = pi f dt; this is divided out at ``frequency``.
    """
    k = int(1.0 / (frequency * dt * ENOUGH))
    n = len(x) // max(k, 1) * k
    if k < 2 or n < 2 * k:
        return t, x
    angle = np.pi * frequency * dt
    gain = np.sin(k * angle) / (k * np.sin(angle))
    return t[0] + dt * (k * np.arange(n // k) + 0.5 * (k - 1)), x[:n].reshape(-1, k).mean(axis=1) / gain


def make_flat_window(frequency: float, periods: float, dt: float) -> Window:
    """Hann window times a + b tau^2 of area 2 and no second moment, ``periods`` of ``frequency`` (Hz) long."""
    from scipy.signal.windows import hann  # noqa: PLC0415 - slow to import, and only free decays need it

    half = round(0.5 * periods / (frequency * dt))
    offsets = dt * np.arange(-half, half + 1)
    weights = np.asarray(hann(2 * half + 3)[1:-1], dtype=np.float64)
    zeroth, second, fourth = (float(weights @ offsets**power) for power in (0, 2, 4))
    a, b = np.linalg.solve([[zeroth, second], [second, fourth]], [2.0, 0.0])
    flat = np.asarray(weights * (a + b * offsets**2), dtype=np.float64)
    return Window(np.asarray(offsets, dtype=np.float64), flat, RAD_S_PER_HZ * frequency)


def list_weights(frequency: float, others: Sequence[float], dt: float, most: int) -> ComplexArray:
    """Weights (n,) of samples whose weighted sum is half the complex amplitude of a sine of ``frequency`` (Hz) at the
    middle sample.

    Least squares under a Hann window, with every near mode as (a + b u + c u^2) exp(i omega u), so that its decay is
    removed too. ``others``: other modes, Hz. ``most``: samples, unless ``PERIODS`` need more.
    """
    from scipy.signal.windows import hann  # noqa: PLC0415 - slow to import, and only several modes need it

    nearest = min((abs(other - frequency) for other in others), default=frequency)
    half = round(0.5 * max(PERIODS / (frequency * dt), min(APART / (nearest * dt), most)))
    u, root = np.arange(-half, half + 1) / half, np.sqrt(hann(2 * half + 3)[1:-1])
    near = [other for other in others if abs(other - frequency) * 2.0 * half * dt < NEIGHBOUR]
    turn = 1j * RAD_S_PER_HZ * dt * half * u
    waves = [np.exp(frequency * turn), *(u**power * np.exp(other * turn) for other in near for power in range(3))]
    basis = np.array([*waves, *np.conj(waves)]).T * root[:, np.newaxis]
    return np.asarray(np.linalg.pinv(basis)[0] * root)


def measure_noise(window: Window, x: FloatArray, z: ComplexArray) -> float:
    """Amplitude of noise in z, the windowed x, at the end of the record.

    It is measured beside the pass band, where there is only noise, and limited by the signal in the band.
    """
    from scipy.signal.windows import blackmanharris  # noqa: PLC0415 - slow to import, and only free decays need it

    tail = np.abs(z[-(len(z) // 10 + 1) :])
    weights = np.asarray(blackmanharris(len(window.offsets)), dtype=np.float64)
    weights *= np.sqrt(np.sum(window.weights**2) / np.sum(weights**2))  # equal noise power
    beside = Window(window.offsets, weights, window.omega_0 + _BESIDE * RAD_S_PER_HZ / window.length)
    floor = np.abs(beside.analytic(x[-(len(tail) + len(weights)) :]))
    return float(min(np.median(tail), np.median(floor)))


def describe_flat(window: Window, x: FloatArray, z: ComplexArray, order: int, shift: float) -> list[str]:
    """Caution on a motion x (n,) with flattened peaks; z: the windowed x; ``shift``: of its frequency, relative.

    A sensor at its limit turns cos a into cos a - r cos 3a + ..., r > 0: z_3 conj(z)^3 is negative throughout, weighted
    here to the largest amplitudes. A stop takes r from the fundamental too, a gain that falls as a cubic 3 r.

    A spring does so too: the force c_1 cos a + c_3 cos 3a beside K A cos a shifts the frequency by c_1/(2 K A), and the
    displacement has c_3/(8 K A) of cos 3a, its n-th derivative (-3)^n times that relative to cos a. As |c_3| <= |c_1|,
    r <= -(-3)^n ``shift``/4.
    """
    turned = replace(window, omega_0=3.0 * window.omega_0).analytic(x) * np.conj(z) ** 3
    flat = -float(np.sum(turned.real))
    third = flat / float(np.sum(np.abs(z) ** 4))
    if flat <= _IN_STEP * np.sum(np.abs(turned)) or third <= FLATTENED + max(-((-3.0) ** order) * shift / 4.0, 0.0):
        return []
    why = "a sensor or amplifier near its limit reads the top levels and their damping too small; begin later (--start)"
    said = f"caution: peaks are flattened (third harmonic {100.0 * third:.2g} %)"
    return [f"{said}: {why}, or a mode stands at three times this one"]


def describe_elsewhere(x: FloatArray, dt: float, frequency: float) -> str:
    """Where a motion x (n,) is strongest, if not near the mode at ``frequency``; '' if it is."""
    spectrum = np.abs(np.fft.rfft(x * np.hanning(len(x))))
    strongest = float(np.argmax(spectrum)) / (len(x) * dt)
    if abs(strongest / frequency - 1.0) < _NEAR:
        return ""
    where = f"strongest at {strongest:.4g} Hz, the mode is at {frequency:.4g} Hz"
    return f"; the motion is {where}: are the mode and --rate right?"
