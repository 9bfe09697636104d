"""Levels of a test: sweeps of one force, and how a level's measured resonance scatters."""

from __future__ import annotations

import numpy as np

from damping.arrays import FloatArray, IntArray
from damping.infer.law import Coordinates

#: Relative difference of tested forces below which two sweeps are repeats of one level.
SAME_FORCE = 0.10


def level_numbers(force: FloatArray) -> IntArray:
    """Level of each sweep by its tested force (sweeps,), lowest 0; repeats of one force share a number."""
    order = np.argsort(force, kind="stable")
    number, first = np.zeros(len(force), dtype=np.int64), force[order[0]]
    level = 0
    for i in order:
        if force[i] > (1.0 + SAME_FORCE) * first:
            level, first = level + 1, force[i]
        number[i] = level
    return number


def resonance_scatter(coordinates: Coordinates, x: FloatArray) -> FloatArray:
    """Relative scatter of a level's measured resonance at points (draws, dimension): rows and levels, (draws,)."""
    row, level = coordinates.scatter(x)
    return np.asarray(np.hypot(row, level))
