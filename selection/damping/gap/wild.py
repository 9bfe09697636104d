"""Noise with wild points: its likelihood, the weights of residuals, and which wild points are no stray readings.

A residual is N(0, 1), or with probability ``WILD`` a wild point, N(0, ``WIDE``^2) (Box and Tiao 1968).
"""

from math import comb

import numpy as np
from scipy.special import erfc

from damping.arrays import BoolArray, FloatArray
from damping.gap.rows import PhasorRows

#: Share of wild points and their standard deviation in units of noise.
WILD = 0.02
WIDE = 10.0
_INLIER = np.log(1.0 - WILD)
_OUTLIER = np.log(WILD / WIDE)
#: Robust weight below which a residual is taken for wild.
WILD_WEIGHT = 0.5
#: Largest share of one quantity's values that may be stray readings; extra number allowed in a short record.
MOST_WILD = 0.05
_FEW_WILD = 2.0
_NEIGHBOURS = 3  #: three wild neighbours occur by chance in one of 2000 sweeps of 60 rows; two in one of 40
#: Wild amplitudes at the peak of a sweep, or at one frequency, are no stray readings if less probable than this.
_BY_CHANCE = 0.003


def log_likelihood(r: FloatArray) -> FloatArray:
    """ln p of residuals (..., m) less that of m residuals of zero without wild points: sum over the last axis."""
    squared = r * r
    log_odds = _log_odds(squared)
    # np.logaddexp takes ten times as long
    added = np.maximum(log_odds, 0.0) + np.log1p(np.exp(-np.abs(log_odds)))
    return np.asarray(_INLIER * r.shape[-1] + np.sum(added - 0.5 * squared, axis=-1))


def robust_weights(r: FloatArray) -> FloatArray:
    """Expected inverse variance of each residual: 1 for a regular point, 1/WIDE^2 for a wild one."""
    odds = np.exp(np.minimum(_log_odds(r * r), 50.0))
    return np.asarray(1.0 - odds / (1.0 + odds) * (1.0 - WIDE**-2))


def _log_odds(squared: FloatArray) -> FloatArray:
    """ln of the odds that residuals of these squares are wild."""
    return np.asarray((_OUTLIER - _INLIER) + 0.5 * (1.0 - WIDE**-2) * squared)


def find_pattern(rows: PhasorRows, r: FloatArray, wild: BoolArray, sd_amplitude: FloatArray) -> str:
    """Where wild values (m,) lie that cannot be stray readings, in words; empty where all may be.

    Stray readings are few and lie at random places. Three wild neighbours in a sweep are not stray. Nor is a wild
    amplitude at the peak of its sweep, where a sensor clips, unless chance puts one as large there in at least one
    record of 300. Nor are those at one frequency in several sweeps (a line, a beat, a first row before the rig has
    settled), at the same odds.

    Args:
        r: residuals (m,).
        sd_amplitude: noise in whose units the amplitude residuals are, relative, (n,).
    """
    n = len(rows)
    by_quantity, seen = wild.reshape(-1, n), rows.seen.reshape(-1, n).sum(axis=1)
    wild_rows = np.asarray(by_quantity.any(axis=0))
    if np.any(by_quantity.sum(axis=1) > np.minimum(MOST_WILD * seen + _FEW_WILD, 0.5 * seen)):
        return f"in {wild_rows.sum()} of {n} rows, too many to be stray"
    adjacent = [
        wild_rows[run][k : k + _NEIGHBOURS].all() for run in rows.runs for k in range(len(run) - _NEIGHBOURS + 1)
    ]
    if any(adjacent):
        return "side by side, too close together to be stray"
    u = rows.u - r[:n] * sd_amplitude - np.log(rows.F)  # fitted ln amplitude per force
    peaks = [run[np.argmax(u[run])] for run in rows.runs]
    chance = min(1.0, by_quantity[0].sum() * len(peaks) / n)
    if any(by_quantity[0][k] and chance * erfc(abs(r[k]) / (WIDE * np.sqrt(2.0))) < _BY_CHANCE for k in peaks):
        return "at the peak of a sweep, too far to be there by chance"
    repeated = _count_repeats(rows, wild_rows)
    return f"at one frequency in {repeated} sweeps, too many to be stray" if repeated else ""


def _count_repeats(rows: PhasorRows, wild_rows: BoolArray) -> int:
    """Most sweeps with a wild row at one frequency, to half the distance of rows; 0 where chance explains as many.

    Of p wild rows, k of L sweeps have one at some of n frequencies by chance in at most n binomial(L, k) p^k records.
    """
    share, sweeps = float(wild_rows.mean()), len(rows.runs)
    wild_at, within, of = list[float](), list[float](), list[int]()
    for number, run in enumerate(rows.runs):
        step = np.concatenate([[np.inf], np.abs(np.diff(rows.omega[run])), [np.inf]])
        within += (0.5 * np.minimum(step[1:], step[:-1])[wild_rows[run]]).tolist()
        wild_at += rows.omega[run][wild_rows[run]].tolist()
        of += [number] * int(wild_rows[run].sum())
    at, owner = np.array(wild_at), np.array(of)
    most = max((len(set(owner[np.abs(at - here) <= half])) for here, half in zip(at, within, strict=True)), default=0)
    return most if max(map(len, rows.runs)) * comb(sweeps, most) * share**most < _BY_CHANCE else 0
