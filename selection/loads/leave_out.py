"""Higher levels of a record left out and predicted from the lower ones: an honest check within the record."""

from __future__ import annotations

import numpy as np
import pandas as pd

from selection.compare.weights import FEWEST_BELOW, level_numbers
from selection.loads.plan import Plan, plan_loads
from selection.loads.prediction import Member, predict
from selection.posterior.observations import Observations


def members_of(plan: Plan, least: float = 0.0) -> list[Member]:
    """Laws of a plan with a weight above ``least``, on the draws of importance sampling."""
    laws = [law for law in plan.laws if law.weight > least]
    return [Member(law.name, law.weight, law.coordinates, law.evidence.draws, law.kappa) for law in laws]


def leave_higher_levels_out(data: Observations, level: float, seed: int = 0, mass: float | None = None) -> pd.DataFrame:
    """Predict every sweep of the higher levels from the k lowest ones, for every k >= ``FEWEST_BELOW``.

    Nothing of the higher levels is used: laws are chosen, weighed and given their discrepancy on the lower ones alone.

    Returns:
        A row a number of levels and sweep predicted: ``levels, laws, sweep, ratio, force, measured, median, low, high,
        inside, refused, linear_over_percent`` (of the measured), ``exponents``.
    """
    levels = level_numbers(data.tested_force)
    rows = []
    for below in range(FEWEST_BELOW, int(levels.max()) + 1):
        lower = data.keep_sweeps(levels < below)
        higher = np.flatnonzero(levels >= below)
        higher = higher[np.argsort(data.tested_force[higher], kind="stable")]
        plan = plan_loads(lower, seed=seed, mass=mass)
        loads = predict(members_of(plan), data.tested_force[higher], lower, level, seed, plan)
        measured = data.tested_amplitude[higher]
        linear = lower.tested_amplitude[lower.top] * loads.ratio
        rows.append(
            pd.DataFrame(
                {
                    "levels": below,
                    "laws": len(plan.laws),
                    "exponents": ", ".join(f"{p:.2f}" for p in plan.trend.p),
                    "sweep": [data.sweeps[i] for i in higher],
                    "force": loads.force,
                    "ratio": loads.ratio,
                    "measured": measured,
                    "median": loads.average.median,
                    "low": loads.average.low,
                    "high": loads.average.high,
                    "inside": (loads.average.low <= measured) & (measured <= loads.average.high),
                    "refused": np.isnan(loads.average.median),
                    "linear_over_percent": 100.0 * (linear / measured - 1.0),
                }
            )
        )
    return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame()
