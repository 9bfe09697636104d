"""Modes of one level of a sweep: peaks of an indicator, then poles and residues of all sensors, fitted band by band.

Motions are accelerations per unit of drive, H (sensors, n). With G_k = 1/(w_k^2 - w^2 + 2 i z_k w_k w)

    H_s = c_s + e_s w^2 + sign sum_k r_sk w^2 G_k,

sign +1 for a base that shakes (r = shape x participation) and -1 for a force (r = shape/modal mass); c and e hold the
motion of the base and modes outside the band. Damping changes with amplitude within a level: z = z_p (1 + s (rho - 1)),
rho the amplitude over that at the peak, so that the ratio of level to level is not forced into any law. Residues are
linear and solved for at every step (variable projection; Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from damping.arrays import FloatArray

Complex = npt.NDArray[np.complex128]

#: A peak of the indicator rises so far above its saddles, in ln of power: a factor e in power.
PROMINENCE = 1.0
#: Modes closer than this share of their frequency are fitted together, and rows this far away belong to the band.
CLUSTER = 0.15
BAND = 0.12
#: A mode stays where its residue is so many standard errors at one sensor at least.
LEAST_T = 8.0
#: Damping ratios that a mode may have.
SMALLEST_RATIO = 1e-5
LARGEST_RATIO = 0.2
_HALVINGS = 10  # of the interval of rho, to 1e-3; then to 1e-12
_NEWTON_STEPS = 3
#: Motions below so many times the noise are no peaks.
_FLOOR = 8.0
_PASSES = 3  # over all clusters
_FEWEST_ROWS = 6


@dataclass(frozen=True)
class ModalFit:
    """Modes of one level, rising in frequency.

    ``frequency``, ``ratio``, ``slope`` (modes,): f_k in Hz, z_p and s; ``ratio_sd`` relative. ``residues``,
    ``residues_sd`` (sensors, modes); ``local`` (modes, sensors, 2 + modes): coefficients of c, of e (per Hz^2) and of
    every mode in the band of each. ``noise`` (2,): relative and constant part of the noise of H.
    """

    frequency: FloatArray
    ratio: FloatArray
    slope: FloatArray
    ratio_sd: FloatArray
    residues: FloatArray
    residues_sd: FloatArray
    local: FloatArray
    noise: FloatArray
    sign: float

    @property
    def omega(self) -> FloatArray:
        """2 pi ``frequency``."""
        return 2.0 * pi * self.frequency

    @property
    def base(self) -> FloatArray:
        """Share c of the drive's own motion in each sensor (sensors,): 1 where it is absolute, 0 where relative."""
        return np.asarray(np.median(self.local[:, :, 0], axis=0))

    def columns(self, f: FloatArray) -> Complex:
        """Columns (n, 2 + modes) at frequencies f, whose coefficients ``local`` holds."""
        return _columns(f, self.frequency, self.ratio, self.slope, self.sign)

    def rest(self, f: FloatArray, H: Complex, mode: int) -> Complex:
        """H (sensors, n) without everything but one mode: what is left is its residue times sign w^2 G and noise."""
        columns = self.columns(f)
        columns[:, 2 + mode] = 0.0
        left: Complex = H - self.local[mode] @ columns.T
        return left


def receptance(f: FloatArray, frequency: float, ratio: float, slope: float = 0.0) -> Complex:
    """G (n,) of a mode whose damping ratio at amplitude rho of its peak is ratio (1 + slope (rho - 1))."""
    w, w_k = 2.0 * pi * f, 2.0 * pi * frequency
    elastic = w_k**2 - w**2
    peak = 1.0 / (2.0 * ratio * w_k**2)
    if slope == 0.0:
        z = np.full_like(f, ratio)
    else:
        low, high = np.zeros_like(f), np.full_like(f, 1.5)
        for _ in range(_HALVINGS):
            rho = 0.5 * (low + high)
            z = np.maximum(ratio * (1.0 + slope * (rho - 1.0)), 0.0)
            above = rho * peak * np.hypot(elastic, 2.0 * z * w_k * w) > 1.0
            low, high = np.where(above, low, rho), np.where(above, rho, high)
        for _ in range(_NEWTON_STEPS):  # on rho^2 |1/G|^2 = 1/peak^2, from a bracket that is close
            z = ratio * (1.0 + slope * (rho - 1.0))
            inertia = (2.0 * w_k * w) ** 2
            excess = rho**2 * (elastic**2 + inertia * z**2) - 1.0 / peak**2
            rate = 2.0 * rho * (elastic**2 + inertia * z**2) + 2.0 * rho**2 * inertia * z * ratio * slope
            rho = np.clip(rho - excess / rate, low, high)
        z = np.maximum(ratio * (1.0 + slope * (rho - 1.0)), 0.0)
    found: Complex = np.asarray(1.0 / (elastic + 2j * z * w_k * w))
    return found


def find_peaks_of(f: FloatArray, H: Complex) -> list[float]:
    """Frequencies of the peaks of sum |H_s - H_s(low)|^2 over the sensors, above the noise.

    The noise is taken from second differences, in which a smooth curve leaves nothing.
    """
    rigid = np.median(H[:, : max(len(f) // 50, 3)].real, axis=1)
    moved = H - rigid[:, None]
    rough = np.median(np.abs(np.diff(H, n=2, axis=1)), axis=1) / np.sqrt(6.0)
    floor = float(np.sum((_FLOOR * rough) ** 2))
    power = np.log(np.sum(np.abs(moved) ** 2, axis=0) + floor)
    places, _ = find_peaks(power, prominence=PROMINENCE)
    return [float(f[k]) for k in places if 2 <= k < len(f) - 2]


def fit_level(
    f: FloatArray, H: Complex, starts: Sequence[float], sign: float, ratios: Sequence[float] = ()
) -> ModalFit:
    """The modes near ``starts`` (Hz), all sensors together.

    Args:
        f: (n,) Hz. H: (sensors, n) accelerations per unit of drive. sign: +1 base, -1 force.
        ratios: damping ratios to start from; by default from the width of each peak.
    """
    frequency = np.array(sorted(starts), dtype=float)
    ratio = np.array(ratios, dtype=float) if len(ratios) else np.array([_width(f, H, at) for at in frequency])
    slope = np.full(len(frequency), 0.2)
    noise = np.array([0.01, 0.01 * float(np.median(np.abs(H)))])
    bands = [_band(f, frequency, cluster) for cluster in _clusters(frequency)]
    for _ in range(_PASSES):
        for cluster, rows in zip(_clusters(frequency), bands, strict=True):
            _fit_cluster(f[rows], H[:, rows], cluster, frequency, ratio, slope, noise, sign)
        noise = _noise(f, H, frequency, ratio, slope, noise, sign)
    return _whole(f, H, frequency, ratio, slope, noise, sign)


def _width(f: FloatArray, H: Complex, at: float) -> float:
    """Damping ratio by the half-power width of the peak of the sensor that moves most there."""
    place = int(np.argmin(np.abs(f - at)))
    of: FloatArray = np.abs(H[int(np.argmax(np.abs(H[:, place])))])
    low = high = place
    while low > 0 and of[low] > of[place] / np.sqrt(2.0):
        low -= 1
    while high < len(f) - 1 and of[high] > of[place] / np.sqrt(2.0):
        high += 1
    return float(np.clip((f[high] - f[low]) / (2.0 * at), 1e-4, 0.1))


def _clusters(frequency: FloatArray) -> list[list[int]]:
    """Modes that are fitted together."""
    groups: list[list[int]] = []
    for k, at in enumerate(frequency):
        if groups and at / frequency[groups[-1][-1]] - 1.0 < CLUSTER:
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def _band(f: FloatArray, frequency: FloatArray, cluster: Sequence[int]) -> npt.NDArray[np.int64]:
    """Rows about a cluster, and no more than half the way to its neighbours."""
    low, high = frequency[cluster[0]] * (1.0 - BAND), frequency[cluster[-1]] * (1.0 + BAND)
    if cluster[0] > 0:
        low = max(low, 0.5 * (frequency[cluster[0]] + frequency[cluster[0] - 1]))
    if cluster[-1] + 1 < len(frequency):
        high = min(high, 0.5 * (frequency[cluster[-1]] + frequency[cluster[-1] + 1]))
    rows = np.flatnonzero((f >= low) & (f <= high))
    if len(rows) < _FEWEST_ROWS:
        rows = np.sort(np.argsort(np.abs(f - frequency[cluster[0]]))[:_FEWEST_ROWS])
    return rows


def _columns(f: FloatArray, frequency: FloatArray, ratio: FloatArray, slope: FloatArray, sign: float) -> Complex:
    """Columns (n, 2 + modes) whose real coefficients give H of a sensor."""
    w = 2.0 * pi * f
    modes = [sign * w**2 * receptance(f, *one) for one in zip(frequency, ratio, slope, strict=True)]
    return np.array([np.ones_like(f), f**2, *modes], dtype=complex).T


def _solved(columns: Complex, H: Complex, sd: FloatArray) -> tuple[FloatArray, Complex]:
    """Coefficients (sensors, columns), real, and what they leave (sensors, n) over the noise."""
    found = np.empty((len(H), columns.shape[1]))
    left = np.empty_like(H)
    for s, row in enumerate(H):
        scaled = columns / sd[s][:, None]
        stacked = np.concatenate([scaled.real, scaled.imag])
        size = np.linalg.norm(stacked, axis=0)
        size[size == 0.0] = 1.0
        target = row / sd[s]
        found[s] = np.linalg.lstsq(stacked / size, np.concatenate([target.real, target.imag]), rcond=None)[0] / size
        left[s] = target - scaled @ found[s]
    return found, left


def _sd(H: Complex, noise: FloatArray) -> FloatArray:
    return np.hypot(noise[0] * np.abs(H), noise[1])


def _fit_cluster(
    f: FloatArray,
    H: Complex,
    cluster: Sequence[int],
    frequency: FloatArray,
    ratio: FloatArray,
    slope: FloatArray,
    noise: FloatArray,
    sign: float,
) -> None:
    """Improve the modes of a cluster in place, the others held."""
    sd, c = _sd(H, noise), list(cluster)
    start = frequency[c].copy()

    def trial(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        of = frequency.copy(), ratio.copy(), slope.copy()
        of[0][c], of[1][c], of[2][c] = start * (1.0 + np.split(x, 3)[0]), np.exp(np.split(x, 3)[1]), np.split(x, 3)[2]
        return of

    def left(x: FloatArray) -> FloatArray:
        rest = _solved(_columns(f, *trial(x), sign), H, sd)[1].ravel()
        return np.concatenate([rest.real, rest.imag])

    count = len(c)
    x0 = np.concatenate([np.zeros(count), np.log(ratio[c]), slope[c]])
    low = np.repeat([-0.04, np.log(SMALLEST_RATIO), -0.9], count)
    high = np.repeat([0.04, np.log(LARGEST_RATIO), 0.97], count)
    found = least_squares(left, np.clip(x0, low + 1e-9, high - 1e-9), bounds=(low, high), x_scale="jac", max_nfev=40)
    frequency[c], ratio[c], slope[c] = (part[c] for part in trial(found.x))


def _noise(
    f: FloatArray,
    H: Complex,
    frequency: FloatArray,
    ratio: FloatArray,
    slope: FloatArray,
    noise: FloatArray,
    sign: float,
) -> FloatArray:
    """Relative and constant part of the noise, by what the fit leaves in the bands: |left|^2 = 2 (a^2 |H|^2 + b^2)."""
    sizes, squares = [], []
    for cluster in _clusters(frequency):
        rows = _band(f, frequency, cluster)
        sd = _sd(H[:, rows], noise)
        rest = _solved(_columns(f[rows], frequency, ratio, slope, sign), H[:, rows], sd)[1] * sd
        sizes.append((np.abs(H[:, rows]) ** 2).ravel())
        squares.append(0.5 * (np.abs(rest) ** 2).ravel())
    size, square = np.concatenate(sizes), np.concatenate(squares)
    order = np.argsort(size)
    parts = np.array_split(order, 12)
    of = np.array([np.mean(size[p]) for p in parts if len(p)])
    has = np.array([np.median(square[p]) / 0.693 for p in parts if len(p)])  # of an exponential: median over mean
    weight = 1.0 / has.clip(min=1e-30)
    design = np.column_stack([of, np.ones_like(of)]) * weight[:, None]
    found = np.linalg.lstsq(design, has * weight, rcond=None)[0]
    least = np.quantile(has, 0.1)
    return np.sqrt([max(found[0], 1e-6), max(found[1], 0.05 * least, 1e-20)])


def _whole(
    f: FloatArray,
    H: Complex,
    frequency: FloatArray,
    ratio: FloatArray,
    slope: FloatArray,
    noise: FloatArray,
    sign: float,
) -> ModalFit:
    """Residues and standard errors of every mode in its own band, those of damping free."""
    sensors, modes = len(H), len(frequency)
    residues, residues_sd = np.zeros((sensors, modes)), np.zeros((sensors, modes))
    local, ratio_sd = np.zeros((modes, sensors, 2 + modes)), np.zeros(modes)
    for cluster in _clusters(frequency):
        rows = _band(f, frequency, cluster)
        columns = _columns(f[rows], frequency, ratio, slope, sign)
        sd = _sd(H[:, rows], noise)
        found, left = _solved(columns, H[:, rows], sd)
        freedom = max(2 * left.size - sensors * columns.shape[1] - 3 * len(cluster), 1)
        misfit = max(float(np.sum(np.abs(left) ** 2)) / freedom, 1.0)
        covariance = misfit * _covariance(f[rows], columns, found, sd, cluster, frequency, ratio, slope, sign)
        width = columns.shape[1]
        for place, k in enumerate(cluster):
            residues[:, k], local[k] = found[:, 2 + k], found
            at = [s * width + 2 + k for s in range(sensors)]
            residues_sd[:, k] = np.sqrt(np.diag(covariance)[at])
            ratio_sd[k] = np.sqrt(covariance[sensors * width + place, sensors * width + place])
    return ModalFit(frequency, ratio, slope, ratio_sd, residues, residues_sd, local, noise, sign)


def _covariance(
    f: FloatArray,
    columns: Complex,
    found: FloatArray,
    sd: FloatArray,
    cluster: Sequence[int],
    frequency: FloatArray,
    ratio: FloatArray,
    slope: FloatArray,
    sign: float,
) -> FloatArray:
    """Covariance of all coefficients, then of ln z, of f (relative) and of s of the cluster's modes."""
    sensors, width = found.shape
    steps = [(1, 1e-4), (0, 1e-6), (2, 1e-3)]
    moved = []
    for which, step in steps:
        for k in cluster:
            of = [frequency.copy(), ratio.copy(), slope.copy()]
            of[which][k] = of[which][k] + step if which == 2 else of[which][k] * (1.0 + step)
            moved.append((_columns(f, of[0], of[1], of[2], sign) - columns) / step)
    jacobian = np.zeros((2 * sd.size, sensors * width + len(moved)))
    n = len(f)
    for s in range(sensors):
        block = columns / sd[s][:, None]
        extra = np.array([(change @ found[s]) / sd[s] for change in moved]).T
        for part, of_part in ((0, "real"), (1, "imag")):
            rows = slice((2 * s + part) * n, (2 * s + part + 1) * n)
            jacobian[rows, s * width : (s + 1) * width] = getattr(block, of_part)
            jacobian[rows, sensors * width :] = getattr(extra, of_part)
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = 1.0
    inverse = np.linalg.pinv(jacobian / size, rcond=1e-10)
    return np.asarray((inverse @ inverse.T) / np.outer(size, size))
