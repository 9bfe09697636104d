"""What if a prior were another, or one more level were tested? The same draws, counted otherwise.

A prior's change reweights posterior draws x by the ratio of prior densities, and each law by its mean over them:

- ``scatter``, ``discrepancy``: a log-normal prior whose median is a third or three times as large, exp(m x - m^2/2)
  with m = ln(factor)/(log standard deviation);
- ``share``: Dirichlet of concentration a third or three in place of one.

A level more is a reading drawn from the prediction there: draws are weighed by its likelihood, and the width of the
band at the design force that is left is averaged over readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import gammaln

from damping.arrays import FloatArray
from damping.extrapolation.draws import Member, Spread, pool
from damping.infer.doubt import DOUBT_LOG_SD
from damping.infer.law import SCATTER_LOG_SD

#: Priors are tried at a third and at three times what they are.
FACTORS = (1.0 / 3.0, 3.0)
#: Where a further level may lie between the largest tested force and the design force, in shares of the way in ln F.
ON_THE_WAY = (1.0 / 3.0, 2.0 / 3.0)
#: Readings that an expected width is averaged over: quantiles of the prediction there.
READINGS = (np.arange(24) + 0.5) / 24


def vary_priors(
    members: Sequence[Member], spreads: Sequence[Spread], force: FloatArray, level: float, seed: int
) -> pd.DataFrame:
    """Predictions at ``force`` with each prior changed by each of ``FACTORS``, by reweighting the draws ``spreads``.

    Returns:
        A row a prior, factor and force: ``prior, factor, force, median, low, high``.
    """
    tail, rows = 50.0 * (1.0 - level), []
    for prior, ratio in (("scatter", _of_scatter), ("share", _of_shares), ("discrepancy", _of_doubt)):
        for factor in FACTORS:
            odds = [ratio(member, factor) for member in members]
            weights = np.array([m.weight * w.mean() for m, w in zip(members, odds, strict=True)])
            drawn = pool(spreads, weights / weights.sum(), np.random.default_rng(seed), odds).total
            low, median, high = np.exp(np.percentile(drawn, [tail, 50.0, 100.0 - tail], axis=0))
            rows += [(prior, factor, *values) for values in zip(force, median, low, high, strict=True)]
    return pd.DataFrame(rows, columns=["prior", "factor", "force", "median", "low", "high"])


def _of_scatter(member: Member, factor: float) -> FloatArray:
    """Ratio of prior densities of each draw, (draws,)."""
    columns = [-2, -1] if member.coordinates.with_level_scatter else [-1]
    return _shifted(member.draws[:, columns], np.log(factor) / SCATTER_LOG_SD)


def _of_doubt(member: Member, factor: float) -> FloatArray:
    if not member.coordinates.with_doubt:
        return np.ones(len(member.draws))
    return _shifted(member.draws[:, [member.coordinates.names.index("doubt")]], np.log(factor) / DOUBT_LOG_SD)


def _of_shares(member: Member, factor: float) -> FloatArray:
    shares = member.coordinates.shares(member.draws)
    k = shares.shape[1]
    log_norm = gammaln(k * factor) - k * gammaln(factor) - gammaln(k)
    return np.asarray(np.exp(log_norm + (factor - 1.0) * np.sum(np.log(np.maximum(shares, 1e-12)), axis=1)))


def _shifted(x: FloatArray, by: float) -> FloatArray:
    """N(x; by, 1)/N(x; 0, 1), over columns."""
    return np.asarray(np.exp(np.sum(by * x - 0.5 * by**2, axis=1)))


@dataclass(frozen=True)
class NextLevel:
    """The further level that would most shrink the band at a design force.

    Attributes:
        design, force: design force, and force of the level. width, expected: high/low there now, and with the level.
        others: ``force, expected``, a row a level that was tried, best first.
    """

    design: float
    force: float
    width: float
    expected: float
    others: pd.DataFrame


def list_levels(tested_force: FloatArray, design: float) -> FloatArray:
    """Forces of a further level that are tried: repeats of the tested ones, and levels on the way to the design."""
    tested = np.unique(tested_force)
    return np.concatenate([tested, tested[-1] * (design / tested[-1]) ** np.array(ON_THE_WAY)])


def choose_next_level(
    members: Sequence[Member], spreads: Sequence[Spread], tried: FloatArray, design: float, level: float, seed: int
) -> NextLevel:
    """The level of ``tried`` (levels,) that would most shrink the band at ``design``.

    Args:
        spreads: draws at the forces ``tried``, then ``design``.
    """
    weights = np.array([m.weight for m in members])
    pooled = pool(spreads, weights / weights.sum(), np.random.default_rng(seed))
    drawn = pooled.law + pooled.stray
    # the level's own noise is fresh: readings there are spread by it, and it says nothing of the noise at the design
    sd = np.maximum(np.sqrt(np.mean(pooled.noise**2, axis=0)), 1e-6)
    at_design, tail = pooled.total[:, -1], 0.5 * (1.0 - level)
    order = np.argsort(at_design)

    def width(odds: FloatArray) -> float:
        cumulative = np.cumsum(odds[order]) / odds.sum()
        low, high = at_design[order][np.minimum(np.searchsorted(cumulative, [tail, 1.0 - tail]), len(order) - 1)]
        return float(high - low)

    def expected_width(at: FloatArray, noise: float) -> float:
        readings = np.quantile(at, READINGS)
        return float(np.mean([width(np.exp(-0.5 * ((at - reading) / noise) ** 2)) for reading in readings]))

    expected = [expected_width(drawn[:, i], float(sd[i])) for i in range(len(tried))]
    table = pd.DataFrame({"force": tried, "expected": np.exp(expected)}).sort_values("expected", kind="stable")
    now = float(np.exp(width(np.ones(len(order)))))
    return NextLevel(design, float(table["force"].iloc[0]), now, float(table["expected"].iloc[0]), table)
