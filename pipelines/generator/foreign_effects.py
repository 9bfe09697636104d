"""Effects outside the library of the diagnosis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipelines.generator.bench import Bench
from pipelines.generator.force_effects import slip_shape
from pipelines.generator.joints import Joint
from pipelines.generator.kind import Kind, Shape, Truth, either_sign, no_shape, stiffness_unit, with_laws
from pipelines.generator.laws import Law
from pipelines.generator.plan import Generator, log_uniform

_PARTS = 12


def _iwan_shape(rng: Generator, bench: Bench) -> Shape:
    """Power by which the parts' weights grow with their limits, and the largest limit over A."""
    return (rng.uniform(-0.6, 0.3), log_uniform(rng, 0.3, 1.5))


def _iwan(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A joint of 12 Jenkins elements in parallel with limits spread evenly (parallel-series Iwan joint)."""
    structure, rows = truth
    limits = (np.arange(_PARTS) + 0.5) / _PARTS
    weights = limits ** shape[0] / np.sum(limits ** shape[0])
    reach = limits * shape[1] * bench.A
    joint = Joint("jenkins", size * stiffness_unit(bench), tuple(reach.tolist()), tuple(weights.tolist()))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _bouc_wen(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    joint = Joint("bouc-wen", size * stiffness_unit(bench), (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _clearance_shape(rng: Generator, bench: Bench) -> Shape:
    """The gap over A."""
    return (rng.uniform(0.15, 0.6),)


def _clearance(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    return with_laws(truth, Law("clearance", size * stiffness_unit(bench), shape[0] * bench.A))


def _quintic(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    return with_laws(truth, Law("quintic", shape[0] * size * stiffness_unit(bench) * 8 / 5 / bench.A**4))


def _saturation(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The sensor clips at A/(1 + size)."""
    structure, rows = truth
    return structure, replace(rows, clip=bench.A / (1 + size))


def _drift(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The natural frequency moves by size times xi in the course of the test, as with temperature."""
    structure, rows = truth
    time = np.linspace(-0.5, 0.5, rows.omega.size)
    return structure, replace(rows, tuning=rows.tuning * (1 + shape[0] * size * bench.xi * time))


def _line_shape(rng: Generator, bench: Bench) -> Shape:
    """Place and width of the line, relative to resonance, and the seed of its phases."""
    return (rng.uniform(-4.0, 4.0) * bench.xi, rng.uniform(0.4, 1.5) * bench.xi, float(rng.integers(1 << 30)))


def _line(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A foreign sine leaks into rows near it as through a rectangular window, at one phase a sweep."""
    structure, rows = truth
    phase = np.random.default_rng(int(shape[2])).uniform(0, 2 * np.pi, int(rows.sweep.max()) + 1)[rows.sweep]
    near = np.sinc((rows.omega / bench.nominal.omega - 1 - shape[0]) / shape[1])
    return structure, replace(rows, leak=rows.leak + size * bench.A * near * np.exp(1j * phase))


FOREIGN_KINDS = {
    "iwan": Kind(_iwan_shape, _iwan, lambda bench: 20.0),
    "bouc-wen": Kind(slip_shape, _bouc_wen, lambda bench: 20.0),
    "clearance": Kind(_clearance_shape, _clearance, lambda bench: 20.0),
    "quintic": Kind(either_sign, _quintic, lambda bench: 5.0),
    "saturation": Kind(no_shape, _saturation, lambda bench: 9.0),
    "drift": Kind(either_sign, _drift, lambda bench: 8.0),
    "interference": Kind(_line_shape, _line, lambda bench: 1.0),
}
