"""Modes of one level of a sweep: peaks of an indicator, then poles and residues of all sensors, fitted band by band.

Residues are linear and solved for at every step (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import find_peaks

from damping.arrays import FloatArray
from damping.campaign.modal_fit import (
    Complex,
    ModalFit,
    complete_fit,
    estimate_noise,
    evaluate_columns,
    evaluate_sd,
    list_clusters,
    list_rows,
    solve_residues,
)

#: A peak of the indicator rises so far above its saddles, in ln of power: a factor e in power.
PROMINENCE = 1.0
#: A mode stays where its residue is so many standard errors at one sensor at least.
LEAST_T = 8.0
#: Damping ratios that a mode may have.
SMALLEST_RATIO = 1e-5
LARGEST_RATIO = 0.2
#: Motions below so many times the noise are no peaks.
_FLOOR = 8.0
_PASSES = 3  # over all clusters


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
    bands = [list_rows(f, frequency, cluster) for cluster in list_clusters(frequency)]
    for _ in range(_PASSES):
        for cluster, rows in zip(list_clusters(frequency), bands, strict=True):
            _fit_cluster(f[rows], H[:, rows], cluster, frequency, ratio, slope, noise, sign)
        noise = estimate_noise(f, H, frequency, ratio, slope, noise, sign)
    return complete_fit(f, H, frequency, ratio, slope, noise, sign)


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
    sd, c = evaluate_sd(H, noise), list(cluster)
    start = frequency[c].copy()

    def trial(x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        of = frequency.copy(), ratio.copy(), slope.copy()
        of[0][c], of[1][c], of[2][c] = start * (1.0 + np.split(x, 3)[0]), np.exp(np.split(x, 3)[1]), np.split(x, 3)[2]
        return of

    def left(x: FloatArray) -> FloatArray:
        rest = solve_residues(evaluate_columns(f, *trial(x), sign), H, sd)[1].ravel()
        return np.concatenate([rest.real, rest.imag])

    count = len(c)
    x0 = np.concatenate([np.zeros(count), np.log(ratio[c]), slope[c]])
    low = np.repeat([-0.04, np.log(SMALLEST_RATIO), -0.9], count)
    high = np.repeat([0.04, np.log(LARGEST_RATIO), 0.97], count)
    found = least_squares(left, np.clip(x0, low + 1e-9, high - 1e-9), bounds=(low, high), x_scale="jac", max_nfev=40)
    frequency[c], ratio[c], slope[c] = (part[c] for part in trial(found.x))
