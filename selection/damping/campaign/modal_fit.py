"""The model of the motions of one level, its residues, noise and standard errors.

Motions are accelerations per unit of drive, H (sensors, n). With G_k = 1/(w_k^2 - w^2 + 2 i z_k w_k w)

    H_s = c_s + e_s w^2 + sign sum_k r_sk w^2 G_k,

sign +1 for a base that shakes (r = shape x participation) and -1 for a force (r = shape/modal mass); c and e hold the
motion of the base and modes outside the band. Damping changes with amplitude within a level: z = z_p (1 + s (rho - 1)),
rho the amplitude over that at the peak, so that the ratio of level to level is not forced into any law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

import numpy as np
import numpy.typing as npt

from damping.arrays import FloatArray

Complex = npt.NDArray[np.complex128]


#: Modes closer than this share of their frequency are fitted together, and rows this far away belong to the band.
CLUSTER = 0.15


BAND = 0.12


_HALVINGS = 10  # of the interval of rho, to 1e-3; then to 1e-12


_NEWTON_STEPS = 3


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
        return evaluate_columns(f, self.frequency, self.ratio, self.slope, self.sign)

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


def list_clusters(frequency: FloatArray) -> list[list[int]]:
    """Modes that are fitted together."""
    groups: list[list[int]] = []
    for k, at in enumerate(frequency):
        if groups and at / frequency[groups[-1][-1]] - 1.0 < CLUSTER:
            groups[-1].append(k)
        else:
            groups.append([k])
    return groups


def list_rows(f: FloatArray, frequency: FloatArray, cluster: Sequence[int]) -> npt.NDArray[np.int64]:
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


def evaluate_columns(
    f: FloatArray, frequency: FloatArray, ratio: FloatArray, slope: FloatArray, sign: float
) -> Complex:
    """Columns (n, 2 + modes) whose real coefficients give H of a sensor."""
    w = 2.0 * pi * f
    modes = [sign * w**2 * receptance(f, *one) for one in zip(frequency, ratio, slope, strict=True)]
    return np.array([np.ones_like(f), f**2, *modes], dtype=complex).T


def solve_residues(columns: Complex, H: Complex, sd: FloatArray) -> tuple[FloatArray, Complex]:
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


def evaluate_sd(H: Complex, noise: FloatArray) -> FloatArray:
    """Standard deviation (sensors, n) of each part of H."""
    return np.hypot(noise[0] * np.abs(H), noise[1])


def estimate_noise(
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
    for cluster in list_clusters(frequency):
        rows = list_rows(f, frequency, cluster)
        sd = evaluate_sd(H[:, rows], noise)
        rest = solve_residues(evaluate_columns(f[rows], frequency, ratio, slope, sign), H[:, rows], sd)[1] * sd
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


def complete_fit(
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
    for cluster in list_clusters(frequency):
        rows = list_rows(f, frequency, cluster)
        columns = evaluate_columns(f[rows], frequency, ratio, slope, sign)
        sd = evaluate_sd(H[:, rows], noise)
        found, left = solve_residues(columns, H[:, rows], sd)
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
            moved.append((evaluate_columns(f, of[0], of[1], of[2], sign) - columns) / step)
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
