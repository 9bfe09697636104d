"""Noise with outliers: its likelihood, the weights of residuals, and which outliers are no stray readings.

A residual is N(0, 1), or with probability ``OUTLIER_SHARE`` an outlier, N(0, ``OUTLIER_SD``^2) (Box and Tiao 1968).
"""

from math import comb

import numpy as np
from scipy.special import erfc

from damping.arrays import BoolArray, FloatArray
from damping.gap.rows import PhasorRows

OUTLIER_SHARE = 0.02  #: share of outliers
OUTLIER_SD = 10.0  #: their standard deviation in units of noise
_INLIER = np.log(1.0 - OUTLIER_SHARE)
_OUTLIER = np.log(OUTLIER_SHARE / OUTLIER_SD)
OUTLIER_WEIGHT = 0.5  #: robust weight below which a residual is taken for an outlier
MOST_OUTLIERS = 0.05  #: largest share of one quantity's values that may be stray readings
_FEW_OUTLIERS = 2.0  #: number of stray readings allowed beyond that share, for short records
_NEIGHBOURS = 3  #: three outlying neighbours occur by chance in one of 2000 sweeps of 60 rows; two in one of 40
#: Outlying amplitudes at the peak of a sweep, or at one frequency, are no stray readings if less probable than this.
_BY_CHANCE = 0.003


def log_likelihood(r: FloatArray) -> FloatArray:
    """ln p of residuals (..., m) less that of m residuals of zero without outliers: sum over the last axis."""
    squared = r * r
    log_odds = _log_odds(squared)
    # np.logaddexp takes ten times as long
    added = np.maximum(log_odds, 0.0) + np.log1p(np.exp(-np.abs(log_odds)))
    return np.asarray(_INLIER * r.shape[-1] + np.sum(added - 0.5 * squared, axis=-1))


def robust_weights(r: FloatArray) -> FloatArray:
    """Expected inverse variance of each residual: 1 for a regular point, 1/OUTLIER_SD^2 for an outlier."""
    odds = np.exp(np.minimum(_log_odds(r * r), 50.0))
    return np.asarray(1.0 - odds / (1.0 + odds) * (1.0 - OUTLIER_SD**-2))


def _log_odds(squared: FloatArray) -> FloatArray:
    """ln of the odds that residuals of these squares are outliers."""
    return np.asarray((_OUTLIER - _INLIER) + 0.5 * (1.0 - OUTLIER_SD**-2) * squared)


def find_pattern(rows: PhasorRows, r: FloatArray, outliers: BoolArray, sd_amplitude: FloatArray) -> str:
    """Where outliers (m,) lie that cannot be stray readings, in words; empty where all may be.

    Stray readings are few and lie at random places. Three outlying neighbours in a sweep are not stray. Nor is an
    outlying amplitude at the peak of its sweep, where a sensor clips, unless chance puts one as large there in at least
    one record of 300. Nor are those at one frequency in several sweeps (a line, a beat, a first row before the rig has
    settled), at the same odds.

    Args:
        r: residuals (m,).
        sd_amplitude: noise in whose units the amplitude residuals are, relative, (n,).
    """
    n = len(rows)
    by_quantity, measured = outliers.reshape(-1, n), rows.measured.reshape(-1, n).sum(axis=1)
    outlying_rows = np.asarray(by_quantity.any(axis=0))
    if np.any(by_quantity.sum(axis=1) > np.minimum(MOST_OUTLIERS * measured + _FEW_OUTLIERS, 0.5 * measured)):
        return f"in {outlying_rows.sum()} of {n} rows, too many to be stray"
    adjacent = [
        outlying_rows[run][k : k + _NEIGHBOURS].all() for run in rows.runs for k in range(len(run) - _NEIGHBOURS + 1)
    ]
    if any(adjacent):
        return "side by side, too close together to be stray"
    u = rows.u - r[:n] * sd_amplitude - np.log(rows.F)  # fitted ln amplitude per force
    peaks = [run[np.argmax(u[run])] for run in rows.runs]
    chance = min(1.0, by_quantity[0].sum() * len(peaks) / n)
    if any(by_quantity[0][k] and chance * erfc(abs(r[k]) / (OUTLIER_SD * np.sqrt(2.0))) < _BY_CHANCE for k in peaks):
        return "at the peak of a sweep, too far to be there by chance"
    repeated = _count_repeats(rows, outlying_rows)
    return f"at one frequency in {repeated} sweeps, too many to be stray" if repeated else ""


def _count_repeats(rows: PhasorRows, outlying_rows: BoolArray) -> int:
    """Most sweeps with an outlying row at one frequency, to half the distance of rows; 0 where chance explains as many.

    Of a share p, k of L sweeps have one at some of n frequencies by chance in at most n binomial(L, k) p^k records.
    """
    share, sweeps = float(outlying_rows.mean()), len(rows.runs)
    outliers_at, within, of = list[float](), list[float](), list[int]()
    for number, run in enumerate(rows.runs):
        step = np.concatenate([[np.inf], np.abs(np.diff(rows.omega[run])), [np.inf]])
        within += (0.5 * np.minimum(step[1:], step[:-1])[outlying_rows[run]]).tolist()
        outliers_at += rows.omega[run][outlying_rows[run]].tolist()
        of += [number] * int(outlying_rows[run].sum())
    at, owner = np.array(outliers_at), np.array(of)
    most = max((len(set(owner[np.abs(at - here) <= half])) for here, half in zip(at, within, strict=True)), default=0)
    return most if max(map(len, rows.runs)) * comb(sweeps, most) * share**most < _BY_CHANCE else 0
