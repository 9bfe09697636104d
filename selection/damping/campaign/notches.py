"""Notches: how far and how wide the input must be lowered at a mode so that a sensor keeps to its limit.

The upper end of the 90 % band, below which the peak lies with 95 %, is interpolated over levels; the level at which it
meets the limit is allowed. With the whole input D and the allowed one L the peak within the notch is the limit; where
the whole input gives as much beside the resonance, at f (1 +- z sqrt((D/L)^2 - 1)), the amplitude is the same and with
it the damping ratio z: there the notch begins and ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import log10, sqrt

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.answer import At

#: Levels at which responses are predicted between the lowest and the design level.
LEVELS = 10


@dataclass(frozen=True)
class Notch:
    """What a limit of a sensor asks at one mode.

    ``limit`` in the sensor's ``unit``, ``level`` the largest input there that keeps it, ``depth_db`` below the
    ``design`` level, ``low`` to ``high`` Hz (None where none is needed); ``more_db``: at most so much more than the top
    level tested.
    """

    mode: str
    sensor: str
    unit: str
    limit: float
    design: float
    level: float
    depth_db: float
    low: float | None
    high: float | None
    more_db: float

    def __str__(self) -> str:
        more = f"at most {self.more_db:+.1f} dB from the top level tested"
        if self.low is None or self.high is None:
            return f"{self.mode}, {self.sensor} <= {self.limit:g} {self.unit}: no notch; {more}"
        notch = f"notch {self.depth_db:.1f} dB from {self.low:.4g} to {self.high:.4g} Hz"
        return f"{self.mode}, {self.sensor} <= {self.limit:g} {self.unit}: {notch} below {self.design:.4g}; {more}"


def list_levels(tested: Sequence[float], design: Sequence[float]) -> list[float]:
    """Levels (in the unit of the drive) at which responses are needed for notches."""
    return [float(level) for level in np.geomspace(0.5 * min(tested), max(*tested, *design), LEVELS)]


def find_notches(
    mode: str, places: Sequence[At], top: float, design: float, limits: Mapping[str, float]
) -> tuple[Notch, ...]:
    """The notch of each limited sensor at a mode, at a design level.

    Args:
        places: levels with responses and damping ratios, from well below to the design level. top: largest tested.
        limits: by sensor, in its unit.
    """
    found = []
    for sensor, limit in limits.items():
        rows = sorted(
            (at.level, one.band[2], at.ratio[2], at.frequency, one.unit)
            for at in places
            for one in at.response
            if one.sensor == sensor and at.ratio is not None
        )
        if not rows:
            continue
        level, upper, ratio, frequency = (np.array([row[k] for row in rows], dtype=float) for k in range(4))
        allowed = _invert(level, upper, limit)
        z, f = (float(np.interp(np.log(allowed), np.log(level), of)) for of in (ratio, frequency))
        half = z * sqrt(max((design / allowed) ** 2 - 1.0, 0.0))
        ends = (f * (1.0 - half), f * (1.0 + half)) if allowed < design else (None, None)
        depth = max(20.0 * log10(design / allowed), 0.0)
        unit, more = str(rows[0][4]), 20.0 * log10(allowed / top)
        found.append(Notch(mode, sensor, unit, limit, design, allowed, depth, *ends, more))
    return tuple(found)


def _invert(level: FloatArray, upper: FloatArray, limit: float) -> float:
    """Level at which the upper bound meets the limit, straight on logarithmic axes; in proportion beyond the ends."""
    rising = np.maximum.accumulate(upper)
    if limit <= rising[0] or limit >= rising[-1]:
        end = 0 if limit <= rising[0] else -1
        return float(level[end] * limit / rising[end])
    return float(np.exp(np.interp(np.log(limit), np.log(rising), np.log(level))))
