"""Notches: inputs lowered at a mode so that a sensor keeps to its limit.

The upper end of the 90 % band, below which the peak lies with 95 %, is interpolated over levels; the input at which it
meets the limit is the allowed input L. The notch begins and ends where the full input D, beside the resonance, gives
the same amplitude, and so the same z. With r^2 = (f/f_n)^2 these are the roots of |1 - r^2 + 2 i z r| = 2 z D/L,
r^2 = 1 - 2 z^2 +- 2 z sqrt((D/L)^2 - 1 + z^2), or the end of the sweep if that comes first.
"""

from collections.abc import Mapping, Sequence
from math import inf, log10, sqrt

import numpy as np

from damping.arrays import FloatArray, interpolate_logs
from damping.campaign.values import At, Notch


def find_notches(
    mode: str,
    places: Sequence[At],
    top: float,
    design: float,
    limits: Mapping[str, float],
    swept: tuple[float, float] = (0.0, inf),
    drive_unit: str = "",
) -> tuple[Notch, ...]:
    """The notch of each limited sensor at a mode, at a design level.

    Args:
        places: levels with responses and damping ratios, from well below to the design level.
        top: largest tested level.
        limits: by sensor, in its unit.
        swept: lowest and highest frequency of the sweep, Hz.
        drive_unit: of levels.
    """
    notches = []
    for sensor, limit in limits.items():
        rows = sorted(
            (at.level, response.band.high, at.ratio.high, at.frequency, response.unit)
            for at in places
            for response in at.response
            if response.sensor == sensor and at.ratio is not None
        )
        if not rows:
            continue
        level, upper, ratio, frequency = (np.array([row[k] for row in rows], dtype=float) for k in range(4))
        allowed = _invert(level, upper, limit)
        z, f = (float(np.interp(np.log(allowed), np.log(level), values)) for values in (ratio, frequency))
        low, high = _find_ends(f, z, design / allowed, swept) if allowed < design else (None, None)
        depth = max(20.0 * log10(design / allowed), 0.0)
        in_unit, more = str(rows[0][4]), 20.0 * log10(allowed / top)
        fields = (mode, sensor, in_unit, limit, design, allowed, depth, low, high, more, top, drive_unit)
        notches.append(Notch(*fields))
    return tuple(notches)


def _find_ends(frequency: float, ratio: float, times: float, swept: tuple[float, float]) -> tuple[float, float]:
    """Frequencies where a mode moves as much under ``times`` the input as at its resonance, within the sweep."""
    middle, half = 1.0 - 2.0 * ratio**2, 2.0 * ratio * sqrt(times**2 - 1.0 + ratio**2)
    low, high = (frequency * sqrt(max(square, 0.0)) for square in (middle - half, middle + half))
    return max(low, swept[0]), min(high, swept[1])


def _invert(level: FloatArray, upper: FloatArray, limit: float) -> float:
    """Level at which the upper bound meets the limit: linear on logarithmic axes, in proportion beyond the ends."""
    rising = np.maximum.accumulate(upper)
    if limit <= rising[0] or limit >= rising[-1]:
        end = 0 if limit <= rising[0] else -1
        return float(level[end] * limit / rising[end])
    return float(interpolate_logs(limit, rising, level))
