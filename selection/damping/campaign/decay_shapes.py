"""Modes of free decays: peaks of the spectrum, and the shape in which all sensors move at each.

Close modes are told apart by the finest spectrum that the shapes demand: a peak at which no sensor moves in one shape
holds several modes.
"""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from scipy.signal import find_peaks, oaconvolve, welch

from damping.arrays import FloatArray
from damping.campaign.sensors import FOLLOWS
from damping.errors import AnalysisError
from damping.signals.windows import list_weights

PARTS = (8, 4, 2)  #: parts of a record whose spectra are averaged, from the least noise to the finest resolution
PROMINENCE = 3.0  #: least height of a peak above its saddles, in ln of power
ABOVE = 30.0  #: least power of a peak, over the median of the spectrum
_SAMPLES = 8.0  # a period must have more samples than this
_HARMONIC = 0.02  # relative deviation from a multiple, by the resolution of the spectrum
_ONE_SHAPE = 0.98  # of the motion of a sensor in one shape: if none has it, a finer spectrum may show further modes
_SAME_SHAPE = 0.98  # modal assurance criterion
_NO_PEAK = "no mode: no sensor has a peak in its spectrum above the noise"

Motion: TypeAlias = tuple[FloatArray, FloatArray]  #: times (n,) and motions (sensors, n) of a run
#: Shape (sensors,), 1 where largest, its standard error, and the share of each sensor's motion that it explains.
Shape: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


def find_loudest(motions: Sequence[Motion]) -> Motion:
    """The run that moves most."""
    return max(motions, key=lambda motion: float(np.max(np.abs(motion[1]))))


def find_shapes(
    motions: Sequence[Motion], frequencies: Sequence[float]
) -> tuple[list[float], list[Shape], dict[float, str]]:
    """Frequencies (Hz), as stated or the peaks of the smallest decay, their shapes, and why further peaks are unused.

    Shapes are those of the loudest run. AnalysisError: no peak.
    """
    loudest = find_loudest(motions)
    if frequencies:
        return list(frequencies), _list_shapes(loudest, frequencies), {}
    quietest = min(motions, key=lambda motion: float(np.max(np.abs(motion[1]))))
    fast = _peaks(*loudest, PARTS[0])[1]
    unused = dict.fromkeys(fast, f"a period must have more than {_SAMPLES:g} samples")
    at = _peaks(*quietest, PARTS[0])[0]
    if not at:
        raise AnalysisError("; ".join([_NO_PEAK, *list_unused(unused)]))
    shapes = _list_shapes(loudest, at)
    for parts in PARTS[1:]:
        if not _count_unshaped(shapes):
            break
        finer = _peaks(*quietest, parts)[0]
        split = _list_shapes(loudest, finer)
        if len(finer) > len(at) and _count_unshaped(split) < _count_unshaped(shapes):
            at, shapes = finer, split
    modal = [k for k in range(len(at)) if not _is_harmonic(k, at, [shape for shape, _, _ in shapes])]
    return [at[k] for k in modal], [shapes[k] for k in modal], unused


def describe_unshaped(follows: FloatArray, frequency: float) -> tuple[str, ...]:
    """A caution if several sensors move near a frequency, but none in one shape; ``follows`` (sensors,) its share."""
    if len(follows) < 2 or np.max(follows) >= FOLLOWS:
        return ()
    what = f"no sensor moves in one shape near {frequency:.4g} Hz, so its damping may be that of several modes"
    return (f"{what}: name them (--modes F1,F2,... in Hz)",)


def _count_unshaped(shapes: Sequence[Shape]) -> int:
    return sum(len(follows) > 1 and bool(np.max(follows) < _ONE_SHAPE) for _, _, follows in shapes)


def _list_shapes(motion: Motion, at: Sequence[float]) -> list[Shape]:
    return [_shape(*motion, frequency, [other for other in at if other != frequency]) for frequency in at]


def list_unused(peaks: Mapping[float, str]) -> list[str]:
    """Sentences on peaks (Hz) with the reason why each is not used."""
    return [f"the peak at {frequency:.4g} Hz is not used: {why}" for frequency, why in peaks.items()]


def _is_harmonic(k: int, at: Sequence[float], shapes: Sequence[FloatArray]) -> bool:
    """Whether a peak is an odd harmonic of a lower one with the same shape, as nonlinear damping generates."""
    for j in range(k):
        times = at[k] / at[j]
        odd = 2 * round((times - 1.0) / 2.0) + 1
        mac = float((shapes[k] @ shapes[j]) ** 2 / ((shapes[k] @ shapes[k]) * (shapes[j] @ shapes[j])))
        if odd >= 3 and abs(times / odd - 1.0) < _HARMONIC and mac > _SAME_SHAPE:
            return True
    return False


def _peaks(t: FloatArray, x: FloatArray, parts: int) -> tuple[list[float], list[float]]:
    """Frequencies of the peaks of the sum of all spectra, with at least four periods in a part.

    First those below an eighth of the sampling rate, whose decay can be analysed, then those above.
    """
    if len(t) < parts:
        return [], []
    rate = (len(t) - 1) / (t[-1] - t[0])
    f, spectra = welch(x, rate, window="blackmanharris", nperseg=len(t) // parts * 2, axis=1)
    power = np.log(np.sum(spectra / np.max(spectra), axis=0) + 1e-300)
    places, _ = find_peaks(power, prominence=PROMINENCE)
    floor = np.median(power) + np.log(ABOVE)
    peaks = [float(f[k]) for k in places if power[k] > floor and 4.0 * f[1] < f[k]]
    return [at for at in peaks if at < rate / _SAMPLES], [at for at in peaks if at >= rate / _SAMPLES]


def _shape(t: FloatArray, x: FloatArray, frequency: float, others: Sequence[float]) -> Shape:
    """The shape near a frequency; ``others``: frequencies of the other modes, which are filtered out."""
    dt = float((t[-1] - t[0]) / (len(t) - 1))
    thin = max(int(1.0 / (20.0 * frequency * dt)), 1)
    x = x[:, : x.shape[1] // thin * thin].reshape(len(x), -1, thin).mean(axis=2)
    weights = list_weights(frequency, others, dt * thin, x.shape[1] // PARTS[0])
    z = oaconvolve(x, weights[np.newaxis, ::-1], mode="valid", axes=1)
    u, s, vh = np.linalg.svd(z, full_matrices=False)
    turned = u[:, 0] * np.exp(-1j * np.angle(u[np.argmax(np.abs(u[:, 0])), 0]))
    shape = turned.real
    explained = s[0] * np.outer(u[:, 0], vh[0])
    follows = np.sum(np.abs(explained) ** 2, axis=1) / np.sum(np.abs(z) ** 2, axis=1)
    largest = float(shape[np.argmax(np.abs(shape))])
    rest = np.sqrt(np.sum(np.abs(z - explained) ** 2, axis=1)) / s[0]
    return shape / largest, rest / abs(largest), follows
