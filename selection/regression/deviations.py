"""Deviations of a fit and what the SHARE program prints of them (report, section 5.2, items a to i)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from selection.arrays import FloatArray
from selection.regression.fit import Fit

#: Upper ends of the bands of |percent deviation| in the break-down; what is beyond the last is a band of its own.
BANDS = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@dataclass(frozen=True)
class Deviations:
    """Deviation = observed - fitted; percent = 100 deviation/observed, NaN where observed is 0; all (n,)."""

    observed: FloatArray
    fitted: FloatArray
    deviation: FloatArray
    percent: FloatArray

    @property
    def average_absolute(self) -> float:
        """Mean of |deviation|."""
        return float(np.abs(self.deviation).mean())

    @property
    def average_absolute_percent(self) -> float:
        """Mean of |percent| over observations other than 0; NaN if there are none."""
        return _over(np.mean, self.percent)

    @property
    def largest_absolute(self) -> float:
        """Largest |deviation|."""
        return float(np.abs(self.deviation).max())

    @property
    def largest_absolute_percent(self) -> float:
        """Largest |percent| over observations other than 0; NaN if there are none."""
        return _over(np.max, self.percent)


def _over(statistic: Callable[[FloatArray], np.floating], percent: FloatArray) -> float:
    known = np.abs(percent[~np.isnan(percent)])
    return float(statistic(known)) if len(known) else np.nan


def deviations_of(fit: Fit) -> Deviations:
    """The deviations of a fit."""
    with np.errstate(divide="ignore", invalid="ignore"):
        percent = np.where(fit.observed == 0.0, np.nan, 100.0 * fit.deviations / fit.observed)
    return Deviations(fit.observed, fit.fitted, fit.deviations, percent)


@dataclass(frozen=True)
class Band:
    """Observations with low <= |percent deviation| < high: how many, and how many per cent of all."""

    low: float
    high: float
    number: int
    percent: float


def breakdown(deviations: Deviations, ends: tuple[float, ...] = BANDS) -> list[Band]:
    """The observations broken down by number and by percent, per band of percent deviation (item i).

    The last band is open; observations of 0, which have no percent, are in none.
    """
    edges = (0.0, *ends, np.inf)
    size = np.abs(deviations.percent)
    numbers = [int(((size >= low) & (size < high)).sum()) for low, high in pairwise(edges)]
    rows = zip(pairwise(edges), numbers, strict=True)
    return [Band(low, high, number, 100.0 * number / len(size)) for (low, high), number in rows]


@dataclass(frozen=True)
class Sums:
    """The "goodness-of-fit" sums of fitted E, observed E-bar and E - E-bar, and of their squares."""

    fitted: float
    observed: float
    difference: float
    fitted_squared: float
    observed_squared: float
    difference_squared: float


def goodness_of_fit(fit: Fit) -> Sums:
    """The sums over all observations. The difference is the report's fitted - observed: minus the deviation."""
    columns = (fit.fitted, fit.observed, -fit.deviations)
    with np.errstate(over="ignore"):
        return Sums(*(float(c.sum()) for c in columns), *(float(c @ c) for c in columns))
