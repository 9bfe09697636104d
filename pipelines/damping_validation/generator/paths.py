"""Effects that add a path from drive to sensor: a second principal plane, other modes and rigid-body motion.

Effects of the instruments: gain, lag, and a true force below the recorded one.

Effects outside the library of the diagnosis.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damping_validation.generator.forces import (
    Kind,
    Shape,
    Truth,
    both_signs,
    either_sign,
    no_shape,
    sign,
    slip_shape,
    stiffness_unit,
    with_laws,
)
from damping_validation.generator.plan import Bench, Generator, log_uniform
from damping_validation.generator.structure import Side, TrueJoint, TrueLaw


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


def _list_planar_trials(bench: Bench) -> tuple[Shape, ...]:
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


def _list_residual_trials(bench: Bench) -> tuple[Shape, ...]:
    return tuple((way, 0.55, 1.8, 0.05, low, 1 - low, 0.0) for way in (-1.0, 1.0) for low in (0.0, 1.0))


PATH_KINDS = {
    "planar-coupling": Kind(_planar_shape, _planar, lambda bench: 0.5, _list_planar_trials, (0,)),
    "residual-modes": Kind(_residual_shape, _residual, lambda bench: 1.0, _list_residual_trials),
}


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


def _list_dropout_trials(bench: Bench) -> tuple[Shape, ...]:
    return tuple((1.7 * bench.xi, form, 0.0) for form in (0.0, 1.0))


RIG_KINDS = {
    "amplitude-scale": Kind(either_sign, _scale, lambda bench: 0.8, both_signs),
    "phase-lag": Kind(either_sign, _lag, lambda bench: 1.0, both_signs),
    "force-dropout": Kind(_dropout_shape, _dropout, lambda bench: 0.7, _list_dropout_trials, (0,)),
}


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
    joint = TrueJoint("jenkins", size * stiffness_unit(bench), tuple(reach.tolist()), tuple(weights.tolist()))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _bouc_wen(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    joint = TrueJoint("bouc-wen", size * stiffness_unit(bench), (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _clearance_shape(rng: Generator, bench: Bench) -> Shape:
    """The gap over A."""
    return (rng.uniform(0.15, 0.6),)


def _clearance(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    return with_laws(truth, TrueLaw("clearance", size * stiffness_unit(bench), shape[0] * bench.A))


def _quintic(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    return with_laws(truth, TrueLaw("quintic", shape[0] * size * stiffness_unit(bench) * 8 / 5 / bench.A**4))


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
