"""Effects that add a path from drive to sensor: a second principal plane, other modes and rigid-body motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.generator.bench import Bench
from pipelines.generator.kind import Kind, Shape, Truth, sign
from pipelines.generator.plan import Generator, log_uniform
from pipelines.generator.structure import Side


def _planar_shape(rng: Generator, bench: Bench) -> Shape:
    """Relative distance of the second plane's frequency, and its viscous damping over the first's."""
    return (sign(rng) * bench.xi * log_uniform(rng, 0.6, 4.5), rng.uniform(0.8, 1.25))


def _planar(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Two principal planes, the drive at an angle to the first whose squared sine is the size (report, 3.1.24-35)."""
    structure, rows = truth
    sine = float(np.sqrt(size))
    zeta = shape[1] * structure.viscous / (2 * structure.mass * structure.omega)
    side = Side(structure.omega * (1 + shape[0]), zeta, sine, sine)
    return replace(structure, share=float(np.sqrt(1 - size)), sides=(*structure.sides, side)), rows


def _planar_trials(bench: Bench) -> tuple[Shape, ...]:
    return tuple((way * far * bench.xi, 1.0) for way in (-1.0, 1.0) for far in (0.8, 2.5))


def _residual_shape(rng: Generator, bench: Bench) -> Shape:
    """Sign; frequency ratio of a lower mode, a higher mode and a rigid-body motion; their weights (some 0)."""
    places = (rng.uniform(0.35, 0.75), rng.uniform(1.35, 2.6), rng.uniform(0.03, 0.12))
    weights = rng.dirichlet([1.0, 1.5, 0.7]) * rng.choice([0.0, 1.0], size=3, p=[0.3, 0.7])
    if weights.sum() == 0.0:
        weights = np.array([0.0, 1.0, 0.0])
    return (sign(rng), *places, *(weights / weights.sum()).tolist())


def _residual(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Other modes with .5 % damping; size 1 adds in phase at resonance as much as the resonance itself is high."""
    structure, rows = truth
    sides = []
    for place, weight in zip(shape[1:4], shape[4:7], strict=True):
        if weight:
            seen = shape[0] * size * weight * abs(place**2 - 1) / (2 * bench.xi) * (1 if place > 1 else -1)
            sides.append(Side(bench.nominal.omega * place, 0.005, 1.0, seen))
    return replace(structure, sides=(*structure.sides, *sides)), rows


def _residual_trials(bench: Bench) -> tuple[Shape, ...]:
    return tuple((way, 0.55, 1.8, 0.05, low, 1 - low, 0.0) for way in (-1.0, 1.0) for low in (0.0, 1.0))


PATH_KINDS = {
    "planar-coupling": Kind(_planar_shape, _planar, lambda bench: 0.5, _planar_trials, (0,)),
    "residual-modes": Kind(_residual_shape, _residual, lambda bench: 1.0, _residual_trials),
}
