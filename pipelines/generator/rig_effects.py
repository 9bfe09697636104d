"""Effects of the instruments: gain, lag, and a true force below the recorded one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.generator.bench import Bench
from pipelines.generator.kind import Kind, Shape, Truth, both_signs, either_sign
from pipelines.generator.plan import Generator


def _scale(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, gain=rows.gain * (1 + shape[0] * size))


def _lag(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, lag=rows.lag + shape[0] * size)


def _dropout_shape(rng: Generator, bench: Bench) -> Shape:
    """Relative half-width of the dip, its form (0 Lorentz, 1 Gauss), and its centre off resonance."""
    return (rng.uniform(0.8, 3.0) * bench.xi, float(rng.choice([0.0, 1.0])), rng.uniform(-0.2, 0.2) * bench.xi)


def _dropout(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The true force is (1 - size dip) of the recorded one about resonance."""
    structure, rows = truth
    x = (rows.omega / structure.omega - 1 - shape[2]) / shape[0]
    dip = np.exp(-(x**2) / 2) if shape[1] else 1 / (1 + x**2)
    return structure, replace(rows, drive=rows.drive * (1 - size * dip))


def _dropout_trials(bench: Bench) -> tuple[Shape, ...]:
    return tuple((1.7 * bench.xi, form, 0.0) for form in (0.0, 1.0))


RIG_KINDS = {
    "amplitude-scale": Kind(either_sign, _scale, lambda bench: 0.8, both_signs),
    "phase-lag": Kind(either_sign, _lag, lambda bench: 1.0, both_signs),
    "force-dropout": Kind(_dropout_shape, _dropout, lambda bench: 0.7, _dropout_trials, (0,)),
}
