"""The time by which all sensors lag the drive, from the phases of every mode and level.

With a delay T every motion is H exp(-i w T): its phase falls in proportion to frequency, equally at all sensors.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import floor, log10, sqrt

import numpy as np

from damping.campaign.modal_fit import Level
from damping.campaign.runs import CampaignRun

#: Least share of the squared misfit that a delay removes. On random campaigns without one 0.1 is removed where modes
#: bend, 0.4 where two modes show one peak; with one that turns the modes by 0.1 rad, 3 % of a peak, 0.8.
EXPLAINS = 0.5
NOISIEST = 0.05  #: largest relative noise that may remain: more is that of modes which were not found
LEAST_T = 5.0  #: least delay in standard errors
_PASSES = 4  # fits, each with the delay left by the one before; the first is linear in it


def measure_delay(levels: Sequence[Level]) -> tuple[float, float, float]:
    """Delay in s that is left in the levels, its standard error, and the share of the squared misfit that it removes.

    The error is widened by the scatter between levels and bands.
    """
    delay, sd, square = np.concatenate([level.fit.delay for level in levels]).T
    weight = sd**-2.0
    mean = float(weight @ delay / weight.sum())
    scatter = float(weight @ (delay - mean) ** 2) / max(len(delay) - 1, 1)
    return mean, sqrt(max(scatter, 1.0) / weight.sum()), float(mean**2 * weight.sum() / square.sum())


def remove_delay(levels: list[Level], fit: Callable[[Sequence[CampaignRun]], list[Level]]) -> list[Level]:
    """The levels fitted again by ``fit`` without the delay that their runs then name, if there is one."""
    delay, error, share = measure_delay(levels)
    if abs(delay) < LEAST_T * error or share < EXPLAINS:
        return levels
    right = levels
    for _ in range(_PASSES):
        right = fit([replace(level.run, delay=level.run.delay + delay) for level in right])
        delay, error, _ = measure_delay(right)
        if abs(delay) < error:
            break
    return right if np.median([level.fit.noise[0] for level in right]) < NOISIEST else levels


def describe_delay(delay: float, error: float) -> str:
    """A removed ``delay`` (s) with its standard error in one sentence."""
    lag, digits = "lags" if delay > 0.0 else "leads", max(1 - floor(log10(1e3 * error)), 0)
    time = f"{1e3 * abs(delay):.{digits}f} ± {1e3 * error:.{digits}f} ms"
    return f"every sensor {lag} the drive by {time}, by phases in proportion to frequency: removed from all phases"
