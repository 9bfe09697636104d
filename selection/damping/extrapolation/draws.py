"""Draws of the next test's reading at any force: law, its discrepancy, noise; pooled over laws.

The same draws, reweighted, show the effect of another prior and of one more level.

A changed prior reweights posterior draws x by the ratio of prior densities, and each law by its mean over them:

- ``scatter``, ``discrepancy``: a log-normal prior whose median is a third or three times as large, exp(m x - m^2/2)
  with m = ln(factor)/(log standard deviation);
- ``share``: Dirichlet of concentration a third or three in place of one.

A further level is a reading drawn from the prediction there: draws are weighted by its likelihood, and the remaining
width of the band at the design force is averaged over readings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
import pandas as pd
from scipy.special import gammaln

from damping.arrays import BoolArray, FloatArray, IntArray, join_rows
from damping.extrapolation.backbone import Backbone
from damping.forces.contract import Force
from damping.infer.discrepancy import ANY_JOINT, DISCREPANCY_LOG_SD, JointEvidence
from damping.infer.law import SCATTER_LOG_SD, Coordinates
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude

#: Draws of the average over models: its upper end then differs by 0.5 % from seed to seed because of the paths.
AVERAGE_DRAWS = 40_000
#: Laws with less weight are not drawn from afresh and not shown in short tables; they are part of every average.
LEAST_WEIGHT = 0.01
FEWEST_DRAWS = 1000  #: fewest draws of a law: the band of that law is then known to 5 % of its width
#: Fewest draws of a law of at most ``LEAST_WEIGHT``: its band is then known to 10 % of its width.
FEWEST_OF_LITTLE = 250


@dataclass(frozen=True)
class Member:
    """A law in the average."""

    name: str
    weight: float
    coordinates: Coordinates
    draws: FloatArray  #: of the posterior, (draws, dimension)
    joint: JointEvidence = ANY_JOINT  #: evidence of the resonances for a slipping joint
    backbone: Backbone | None = None  #: frequencies of the resonances; None if all are equal

    def solve(self, damping: Force, force: FloatArray, data: Observations) -> FloatArray:
        """Resonant amplitudes (draws, forces) under ``force`` (forces,); ``damping``: the force of each draw."""
        omega = float(data.tested_omega[data.top])
        if self.backbone is None:
            return resonant_amplitude(damping, force[np.newaxis, :], omega, data.tested_amplitude[data.top])
        return self.backbone.solve(damping, force, omega)

    def thin(self) -> Member:
        """The member with draws evenly chosen in order of discrepancy, as many as its share of ``AVERAGE_DRAWS``.

        In that order the points of :class:`damping.infer.paths.Paths` fill the paths of similar draws.
        """
        fewest = FEWEST_DRAWS if self.weight > LEAST_WEIGHT else FEWEST_OF_LITTLE
        wanted = max(fewest, int(AVERAGE_DRAWS * self.weight))
        draws = self.draws
        if self.coordinates.with_discrepancy:
            draws = draws[np.argsort(draws[:, self.coordinates.names.index("discrepancy")], kind="stable")]
        if len(draws) > wanted:
            draws = draws[np.arange(wanted) * len(draws) // wanted]
        return replace(self, draws=draws)


@dataclass(frozen=True)
class Draws:
    """Draws of the next test's ln A by one law, in parts that add, (draws, forces).

    A draw that does not resonate has too little damping if it is ``short``; otherwise friction holds the mode.
    """

    law: FloatArray  #: the law's amplitude, corrected by the levels
    discrepancy: FloatArray
    noise: FloatArray  #: of the next reading
    resonates: BoolArray  #: whether the damping force reaches the force at any amplitude
    short: BoolArray  #: whether it is smaller than the force at the largest tested amplitude

    @property
    def total(self) -> FloatArray:
        """ln A of the next test."""
        return self.law + self.discrepancy + self.noise

    def at(self, columns: IntArray | slice) -> Draws:
        """The draws at a selection of the forces."""
        return Draws(*(getattr(self, part.name)[:, columns] for part in fields(self)))


def find_shares(members: Sequence[Member], draws: Sequence[Draws]) -> FloatArray:
    """Share of each pooled draw in the average over models, (draws,)."""
    shares = [np.full(len(s.law), m.weight / len(s.law)) for m, s in zip(members, draws, strict=True)]
    return np.concatenate(shares) / sum(m.weight for m in members)


def find_quantiles(values: FloatArray, shares: FloatArray, at: FloatArray) -> FloatArray:
    """Quantiles (quantiles, columns) of values (draws, columns) with weights ``shares`` (draws,); NaN has weight 0.

    The weight of each draw is spread evenly about it.
    """
    quantiles = []
    for column in values.T:
        order = np.argsort(column)  # NaN last
        column, share = column[order], np.where(np.isnan(column[order]), 0.0, shares[order])
        total = np.cumsum(share)
        with np.errstate(invalid="ignore"):  # a column of NaN alone has no quantiles
            quantiles.append(np.interp(at, (total - 0.5 * share) / total[-1], column))
    return np.array(quantiles).T


def amplitude_draws(member: Member, force: FloatArray, data: Observations) -> FloatArray:
    """Amplitude of each draw at each force, (draws, forces); NaN where a draw has no resonance."""
    return member.solve(member.coordinates.force(member.draws), force, data)


FACTORS = (1.0 / 3.0, 3.0)  #: factors by which each prior is changed
#: Places of a further level between the largest tested force and the design force, as shares of the distance in ln F.
ON_THE_WAY = (1.0 / 3.0, 2.0 / 3.0)
#: Quantiles of the prediction at a further level, over which as readings an expected width is averaged.
READINGS = (np.arange(24) + 0.5) / 24


def vary_priors(members: Sequence[Member], draws: Sequence[Draws], force: FloatArray, level: float) -> pd.DataFrame:
    """Predictions at ``force`` with each prior changed by each of ``FACTORS``, by reweighting the ``draws``.

    Returns:
        One row for each prior, factor and force: ``prior, factor, force, median, low, high``.
    """
    tail, rows = 0.5 * (1.0 - level), []
    total, shares = join_rows(draws).total, find_shares(members, draws)
    for prior, ratio in (("scatter", _scatter_ratio), ("share", _share_ratio), ("discrepancy", _discrepancy_ratio)):
        for factor in FACTORS:
            odds = shares * np.concatenate([ratio(member, factor) for member in members])
            with np.errstate(over="ignore"):  # of forces at which the prediction is left out
                low, median, high = np.exp(find_quantiles(total, odds, np.array([tail, 0.5, 1.0 - tail])))
            rows += [(prior, factor, *values) for values in zip(force, median, low, high, strict=True)]
    return pd.DataFrame(rows, columns=["prior", "factor", "force", "median", "low", "high"])


def _scatter_ratio(member: Member, factor: float) -> FloatArray:
    """Ratio of the changed to the assumed prior density at each draw, (draws,)."""
    columns = [-2, -1] if member.coordinates.with_level_scatter else [-1]
    return _shift_ratio(member.draws[:, columns], np.log(factor) / SCATTER_LOG_SD)


def _discrepancy_ratio(member: Member, factor: float) -> FloatArray:
    if not member.coordinates.with_discrepancy:
        return np.ones(len(member.draws))
    column = member.coordinates.names.index("discrepancy")
    return _shift_ratio(member.draws[:, [column]], np.log(factor) / DISCREPANCY_LOG_SD)


def _share_ratio(member: Member, factor: float) -> FloatArray:
    shares = member.coordinates.shares(member.draws)
    parts = shares.shape[1]
    log_norm = gammaln(parts * factor) - parts * gammaln(factor) - gammaln(parts)
    return np.asarray(np.exp(log_norm + (factor - 1.0) * np.sum(np.log(np.maximum(shares, 1e-12)), axis=1)))


def _shift_ratio(x: FloatArray, by: float) -> FloatArray:
    """N(x; by, 1)/N(x; 0, 1), over columns."""
    return np.asarray(np.exp(np.sum(by * x - 0.5 * by**2, axis=1)))


@dataclass(frozen=True)
class NextLevel:
    """The further level that would most shrink the band at a design force."""

    design: float  #: the design force
    force: float  #: of the level
    width: float  #: high/low at the design force now
    expected: float  #: the same with the level
    others: pd.DataFrame  #: ``force, expected``, one row for each candidate level, best first


def list_levels(tested_force: FloatArray, design: float) -> FloatArray:
    """Candidate forces of a further level: repeats of the tested forces, and levels on the way to the design force."""
    tested = np.unique(tested_force)
    return np.concatenate([tested, tested[-1] * (design / tested[-1]) ** np.array(ON_THE_WAY)])


@np.errstate(over="ignore")  # the width of a band may be infinite
def choose_next_level(
    members: Sequence[Member], draws: Sequence[Draws], tried: FloatArray, design: float, level: float
) -> NextLevel:
    """The level of ``tried`` (levels,) that would most shrink the band at ``design``; ``draws`` are at all these
    forces, ``design`` last."""
    pooled, shares = join_rows(draws), find_shares(members, draws)
    resonating = np.isfinite(pooled.total[:, -1])  # a draw without a resonance at the design force has no width there
    order = np.flatnonzero(resonating)[np.argsort(pooled.total[resonating, -1])]
    at_design, shares, drawn = pooled.total[order, -1], shares[order], (pooled.law + pooled.discrepancy)[order]
    # the noise of the further level spreads its readings and is independent of the noise at the design force
    sd = np.maximum(np.sqrt(shares @ pooled.noise[order] ** 2 / shares.sum()), 1e-6)
    tail = 0.5 * (1.0 - level)

    def width(weights: FloatArray) -> float:
        cumulative = np.cumsum(weights)
        low, high = np.interp(cumulative[-1] * np.array([tail, 1.0 - tail]), cumulative, at_design)
        return float(high - low)

    expected = []
    for at, noise in zip(drawn.T, sd[: len(tried)], strict=False):
        readings = find_quantiles(at[:, None], shares, READINGS)
        away = np.where(np.isnan(at), np.inf, at) / noise  # no resonance there: weight 0
        expected.append(np.mean([width(shares * np.exp(-0.5 * (away - reading / noise) ** 2)) for reading in readings]))
    table = pd.DataFrame({"force": tried, "expected": np.exp(expected)}).sort_values("expected", kind="stable")
    now = float(np.exp(width(shares)))
    return NextLevel(design, float(table["force"].iloc[0]), now, float(table["expected"].iloc[0]), table)
