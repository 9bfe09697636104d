"""The plan of a test: force levels, frequencies, direction; in the field uneven, with repeats and wandering forces."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from pipelines.generator.laws import Array
from pipelines.generator.structure import Rows, plain_rows

Generator: TypeAlias = np.random.Generator

_LEVELS = (1, 2, 3, 4, 5, 6)
_CLEAN, _FIELD = (0.0, 0.0, 0.4, 0.3, 0.2, 0.1), (0.04, 0.12, 0.28, 0.26, 0.2, 0.1)  # how often so many levels


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_rows(rng: Generator, field: bool, top: float, omega: float, xi: float, at_least: int) -> Rows:
    """Rows at up to six levels, ``top`` the highest, over 5 to 9 half-power half-widths on either side of omega."""
    forces = _forces(rng, field, top, at_least)
    points = int(np.clip(np.clip(rng.normal(130, 35), 50, 220) / forces.size, 14, 44))
    half, centre = xi * rng.uniform(5.0, 9.0), xi * rng.uniform(-1.0, 1.0)
    dense, up = rng.uniform(0.5, 2.5), bool(rng.random() < 0.7)
    repeats, wander = field and rng.random() < 0.3, 0.03 * (field and rng.random() < 0.3)
    sweeps, frequencies, loads = [], [], []
    for number, force in enumerate(forces):
        uneven = rng.uniform(-0.35, 0.35, points) * 2 / points if field else 0.0
        offset = np.sinh(dense * (np.linspace(-1, 1, points) + uneven)) / np.sinh(dense) * half + centre
        if repeats:
            offset = np.append(offset, rng.choice(offset, size=max(2, points // 8)))
        offset = np.sort(offset) if up else np.sort(offset)[::-1]
        sweeps.append(np.full(offset.size, number))
        frequencies.append(omega * (1 + offset))
        loads.append(force * (1 + wander * rng.uniform(-1, 1, offset.size)))
    return plain_rows(np.concatenate(sweeps), np.concatenate(loads), np.concatenate(frequencies), up)


def _forces(rng: Generator, field: bool, top: float, at_least: int) -> Array:
    """Levels in about equal ratios, rising but for some tests in the field."""
    count = max(int(rng.choice(_LEVELS, p=_FIELD if field else _CLEAN)), at_least)
    ratio = log_uniform(rng, 2.0, 8.0)
    place = np.linspace(-1, 0, count) if count > 1 else np.zeros(1)
    place[1:-1] += rng.uniform(-0.2, 0.2, max(count - 2, 0)) / count
    forces: Array = top * ratio**place
    return rng.permutation(forces) if field and rng.random() < 0.2 else forces
