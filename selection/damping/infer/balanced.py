"""The posterior of a law over variables in which a few ellipsoids cover it, for importance sampling and chains.

Given all other parameters, data fix the total force within the scatter and discrepancy of the levels. Over the
variables x of a law (:mod:`damping.infer.law`) the posterior is therefore thin and curved. It is neither over z, in
which x_1, the logarithm of the total, is counted from the value t that fits best:

    x_1 = t + s z_1,      t = sum_l a_l t_l,     a = S^-1 1/(1' S^-1 1),      s = sqrt(levels/1' S^-1 1)/median scatter.

At x_1 = t_l the law fits the measured forces of level l, sum w C D/sum w C^2 = 1 over its rows, w = 1/(D^2 + R^2). S is
the covariance of the levels from scatter and discrepancy (generalised least squares): where the discrepancy is large,
the middle of the test alone fixes it. t and s are functions of x_2, x_3, ...; p(z) = p(x) s.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from damping.arrays import FloatArray, drop_repeats
from damping.infer.law import SCATTER_MEDIAN, TOTAL_LOG_SD, Coordinates, Part
from damping.infer.likelihood import (
    FEWEST_POINTS,
    REACH,
    by_blocks,
    covary_unit_discrepancy,
    find_averages,
    log_prior,
    sum_by_sweep,
    sum_rows,
    weigh_levels,
)
from damping.infer.observations import Observations

#: Largest deviation of a level, in ln force, that enters t: a level that the law misses by more is no guide.
FARTHEST = 3.0
#: Points times levels computed at once, 8 MB for each of half a dozen arrays: 150 000 draws at a hundred levels would
#: take 1 GB together. Blocks are otherwise as large as can be, so that few levels are one.
_MOST = 1_000_000


@dataclass(frozen=True)
class _Balance:
    """x with x_1 = 0; the law's parts there, without exp(x_1); sigma; a (points, levels) and s (points,)."""

    x: FloatArray
    parts: list[Part]
    sigma: FloatArray
    a: FloatArray
    s: FloatArray


@dataclass(frozen=True)
class Balanced:
    """The posterior of a law on observations over the variables z."""

    coordinates: Coordinates
    data: Observations

    @classmethod
    def of(cls, coordinates: Coordinates, data: Observations) -> Balanced:
        """The posterior in the units in which it is sampled, from coordinates and data in those of a record."""
        return cls(coordinates.scaled(data.reference), data.sampled)

    def log_density(self, z: FloatArray) -> FloatArray:
        """Unnormalised log posterior density at points z (points, dimension); ``-inf`` beyond ``REACH``."""
        return by_blocks(lambda points: self._weigh(z[points]), len(z), len(self.data.sweeps), _MOST)

    def _weigh(self, z: FloatArray) -> FloatArray:
        """`log_density` of so few points that their levels fit in memory."""
        balance = self._prepare(z)
        x, row = balance.x, self.coordinates.scatter(balance.x)[0]

        def weigh(points: slice) -> FloatArray:
            C, grown = find_averages(self.coordinates.join(balance.parts, points), self.data)
            x_1 = self._find_total(C, balance.a[points]) + balance.s[points] * z[points, 0]
            x[points, 0] = np.clip(x_1, -REACH, REACH)
            factor = np.exp(TOTAL_LOG_SD * x[points, 0])[:, None]
            return sum_rows(factor * C, factor * grown, row[points], self.coordinates, self.data)

        sums = by_blocks(weigh, len(z), len(self.data.A), fewest=FEWEST_POINTS)
        inside = (np.abs(x) < REACH).all(axis=1)
        likelihood = weigh_levels(sums, x, balance.sigma, self.coordinates, self.data)
        return np.where(inside, log_prior(x) + likelihood + np.log(balance.s), -np.inf)

    def find_points(self, z: FloatArray) -> FloatArray:
        """x at z, (points, dimension)."""
        new, which = drop_repeats(z)  # resampled draws repeat
        x, s = self._find_best_totals(z[new])
        x[:, 0] += s * z[new, 0]
        return np.asarray(x[which])

    def find_variables(self, x: FloatArray) -> FloatArray:
        """z at x, (points, dimension)."""
        best, s = self._find_best_totals(x)
        return np.column_stack([(x[:, 0] - best[:, 0]) / s, x[:, 1:]])

    def _find_best_totals(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """x at z (points, dimension) with z_1 = 0; and s (points,)."""

        def find(some: slice) -> FloatArray:
            balance = self._prepare(z[some])

            def find_total(points: slice) -> FloatArray:
                C, _ = find_averages(self.coordinates.join(balance.parts, points), self.data)
                return self._find_total(C, balance.a[points])

            balance.x[:, 0] = by_blocks(find_total, len(balance.x), len(self.data.A), fewest=FEWEST_POINTS)
            return np.vstack([balance.x.T, balance.s])

        found = by_blocks(find, len(z), len(self.data.sweeps), _MOST)
        return found[:-1].T, found[-1]

    def _prepare(self, z: FloatArray) -> _Balance:
        """All that does not depend on z_1."""
        x = np.clip(z, -REACH, REACH, order="F")
        x[:, 0] = 0.0
        parts, (row, level) = self.coordinates.find_parts(x), self.coordinates.scatter(x)
        sigma = self.coordinates.discrepancy_of_levels(x, parts)
        variances, directions = self._of_levels
        variance = level**2 + self._per_level * (row**2 + self._known) + np.multiply.outer(variances, sigma**2)
        of_direction = np.ascontiguousarray((directions.sum(axis=0)[:, None] / variance).T)
        precision = of_direction @ directions.sum(axis=0)
        return _Balance(
            x,
            parts,
            sigma,
            np.asfortranarray(of_direction @ directions.T / precision[:, None]),
            np.sqrt(len(variances) / precision) / SCATTER_MEDIAN,
        )

    @cached_property
    def _of_levels(self) -> tuple[FloatArray, FloatArray]:
        """Principal variances and directions of the discrepancy of levels, (levels,) and (levels, levels)."""
        variance, directions = np.linalg.eigh(covary_unit_discrepancy(self.coordinates, self.data))
        return np.maximum(variance, 0.0), directions

    @cached_property
    def _per_level(self) -> float:
        """Mean over levels of 1/(number of independent rows)."""
        return float(np.mean(self.data.together / self.data.rows_per_sweep))

    @cached_property
    def _known(self) -> float:
        """Mean stated variance of a row."""
        return float(np.mean(self.data.sd_amplitude**2 + self.data.sd_force**2 + self.data.sd_phase**2))

    def _find_total(self, C: FloatArray, a: FloatArray) -> FloatArray:
        """t (points,) of a law with averages C (points, rows)."""
        data = self.data
        weight = 1.0 / (data.D**2 + data.R**2)
        with np.errstate(all="ignore"):
            over, under = sum_by_sweep(C * (weight * data.D), data), sum_by_sweep(C * C * weight, data)
            total = np.log(over.sum(axis=1) / under.sum(axis=1))
            deviation = np.clip(np.log(over / under) - total[:, None], -FARTHEST, FARTHEST)
            deviation[np.isnan(deviation)] = 0.0
            t = (total + np.sum(a * deviation, axis=1)) / TOTAL_LOG_SD
        t[np.isnan(t)] = 0.0
        return np.asarray(np.clip(t, -REACH, REACH))
