"""Effects of a size: each changes the true structure or the true state of the rig, one function an effect.

A size is dimensionless and positive; the shape (signs, places, widths) is drawn once. ``bench`` gives the scales: A, the
resonant amplitude at the highest force, xi, and the simulation's nominal values.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pipelines.generator.bench import Bench, Generator, force_unit, log_uniform
from pipelines.generator.joints import Joint
from pipelines.generator.laws import Law
from pipelines.generator.structure import Rows, Side, Structure

Shape = tuple[float, ...]
Truth = tuple[Structure, Rows]


@dataclass(frozen=True)
class Effect:
    """An effect by name, its size and shape."""

    name: str
    size: float
    shape: Shape


@dataclass(frozen=True)
class Kind:
    """How an effect is drawn and applied: ``shape(rng, bench)``, ``apply(truth, size, shape, bench)``, ``most(bench)``."""

    shape: Callable[[Generator, Bench], Shape]
    apply: Callable[[Truth, float, Shape, Bench], Truth]
    most: Callable[[Bench], float]


def _sign(rng: Generator) -> float:
    return float(rng.choice([-1.0, 1.0]))


def _add_law(truth: Truth, *laws: Law) -> Truth:
    structure, rows = truth
    return replace(structure, laws=(*structure.laws, *laws)), rows


def _damping(name: str) -> Kind:
    """A damping force; size 1 loses at A what the viscous damping loses."""

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        unit = force_unit(name, bench.nominal.viscous, bench.nominal.omega, bench.A)
        return _add_law(truth, Law(name, size * unit))

    return Kind(lambda rng, bench: (), apply, lambda bench: 6.0)


def _friction_most(bench: Bench) -> float:
    """Friction of half the lowest force (the mass keeps moving everywhere); size 1 is pi/4 of the highest force."""
    rows = bench.rows
    held = sum(coefficient for name, coefficient in bench.base if name == "coulomb")
    top = bench.nominal.viscous * bench.nominal.omega * bench.A
    return max(float((0.5 * np.min(rows.force) - held) / (np.pi / 4 * top)), 1e-3)


def _viscous(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    factor = 1 + shape[0] * (3 + size) * bench.tolerance[2]
    return replace(structure, viscous=bench.nominal.viscous * factor), rows


def _natural_frequency(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    factor = 1 + shape[0] * (3 + size) * bench.tolerance[0]
    return replace(structure, omega=bench.nominal.omega * factor), rows


def _stiffness(sign: float) -> Kind:
    """Cubic spring mostly, else one like it: q|q|, or cubic with a quadratic term; size 1 shifts resonance by xi."""

    def shape(rng: Generator, bench: Bench) -> Shape:
        return (float(rng.choice([0, 1, 2], p=[0.8, 0.1, 0.1])), rng.uniform(0.05, 0.3))

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        unit = sign * size * 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
        if shape[0] == 1:
            return _add_law(truth, Law("odd-square", unit * 3 * np.pi / 8 / bench.A))
        laws = [Law("cubic", unit * 4 / 3 / bench.A**2)]
        if shape[0] == 2:
            k = bench.nominal.mass * bench.nominal.omega**2
            b = shape[1] * np.sqrt(abs(unit) / bench.A**2 * k)
            laws = [Law("cubic", unit * 4 / 3 / bench.A**2 + 10 / 9 * b**2 / k), Law("quadratic", b)]
        return _add_law(truth, *laws)

    return Kind(shape, apply, lambda bench: 5.0)


def _slip_shape(rng: Generator, bench: Bench) -> Shape:
    return (log_uniform(rng, 0.08, 0.6),)


def _slip(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A Jenkins joint; size 1 is a joint of stiffness 2 xi k that slips at ``shape`` times A."""
    structure, rows = truth
    unit = 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
    joint = Joint("jenkins", size * unit, (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _planar_shape(rng: Generator, bench: Bench) -> Shape:
    return (_sign(rng) * bench.xi * log_uniform(rng, 0.6, 4.5), rng.uniform(0.8, 1.25))


def _planar(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A second principal plane of other frequency; size is sin^2 of the angle of the drive to the first."""
    structure, rows = truth
    sine = float(np.sqrt(min(size, 1.0)))
    zeta = shape[1] * structure.viscous / (2 * structure.mass * structure.omega)
    side = Side(structure.omega * (1 + shape[0]), zeta, sine, sine)
    return replace(structure, share=float(np.sqrt(1 - sine**2)), sides=(*structure.sides, side)), rows


def _residual_shape(rng: Generator, bench: Bench) -> Shape:
    """Sign, then frequency ratio and weight of a lower and a higher mode and of a rigid-body motion."""
    places = (rng.uniform(0.35, 0.75), rng.uniform(1.35, 2.6), rng.uniform(0.03, 0.12))
    weights = rng.dirichlet([1.0, 1.5, 0.7]) * rng.choice([0.0, 1.0], size=3, p=[0.3, 0.7])
    if weights.sum() == 0.0:
        weights = np.array([0.0, 1.0, 0.0])
    return (_sign(rng), *places, *(weights / weights.sum()))


def _residual(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Other modes; size 1 is an in-phase motion at resonance as large as the resonant one without it."""
    structure, rows = truth
    sides = []
    for place, weight in zip(shape[1:4], shape[4:7], strict=True):
        if weight:
            static = place**2 - 1  # times omega^2: what the mode's drive meets at resonance
            seen = shape[0] * size * weight * static / (2 * bench.xi)
            sides.append(Side(bench.nominal.omega * place, 0.005, 1.0, float(seen)))
    return replace(structure, sides=(*structure.sides, *sides)), rows


def _scale(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, gain=rows.gain * (1 + shape[0] * size))


def _lag(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, lag=rows.lag + shape[0] * size)


def _dropout_shape(rng: Generator, bench: Bench) -> Shape:
    return (rng.uniform(0.8, 3.0) * bench.xi, float(rng.choice([0.0, 1.0])), rng.uniform(-0.2, 0.2) * bench.xi)


def _dropout(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The true force dips about resonance: Lorentz or Gauss shape, width a few half-power widths."""
    structure, rows = truth
    x = (rows.omega / structure.omega - 1 - shape[2]) / shape[0]
    dip = np.exp(-(x**2) / 2) if shape[1] else 1 / (1 + x**2)
    return structure, replace(rows, drive=rows.drive * (1 - size * dip))


def _iwan_shape(rng: Generator, bench: Bench) -> Shape:
    return (rng.uniform(-0.6, 0.3), log_uniform(rng, 0.3, 1.5))


def _iwan(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A joint of 12 Jenkins elements whose limits are spread by a power law up to ``shape[1]`` times A."""
    structure, rows = truth
    limits = (np.arange(12) + 0.5) / 12
    weights = limits ** shape[0]
    unit = 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
    joint = Joint("jenkins", size * unit, tuple(limits * shape[1] * bench.A), tuple(weights / weights.sum()))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _bouc_wen(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    unit = 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
    joint = Joint("bouc-wen", size * unit, (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _clearance_shape(rng: Generator, bench: Bench) -> Shape:
    return (rng.uniform(0.15, 0.6),)


def _clearance(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    unit = 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
    return _add_law(truth, Law("clearance", size * unit, shape[0] * bench.A))


def _quintic(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    unit = shape[0] * 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
    return _add_law(truth, Law("quintic", size * unit * 8 / 5 / bench.A**4))


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
    return (rng.uniform(-4.0, 4.0) * bench.xi, rng.uniform(0.4, 1.5) * bench.xi, float(rng.integers(1 << 30)))


def _line(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A foreign sine at one frequency leaks into rows near it, at a phase that differs from sweep to sweep."""
    structure, rows = truth
    phase = np.random.default_rng(int(shape[2])).uniform(0, 2 * np.pi, int(rows.sweep.max()) + 1)[rows.sweep]
    near = np.sinc((rows.omega / bench.nominal.omega - 1 - shape[0]) / shape[1])
    return structure, replace(rows, leak=size * bench.A * near * np.exp(1j * phase))


def _none(rng: Generator, bench: Bench) -> Shape:
    return ()


def _either(rng: Generator, bench: Bench) -> Shape:
    return (_sign(rng),)


def _viscous_most(bench: Bench) -> float:
    return 0.7 / bench.tolerance[2] - 3


KINDS: Mapping[str, Kind] = {
    "viscous-coefficient": Kind(_either, _viscous, _viscous_most),
    "displacement": _damping("displacement"),
    "velocity-squared": _damping("velocity-squared"),
    "displacement-velocity": _damping("displacement-velocity"),
    "quadratic-displacement": _damping("quadratic-displacement"),
    "coulomb-friction": Kind(_none, _damping("coulomb").apply, _friction_most),
    "slip": Kind(_slip_shape, _slip, lambda bench: 20.0),
    "stiffness-hardening": _stiffness(1.0),
    "stiffness-softening": _stiffness(-1.0),
    "natural-frequency": Kind(_either, _natural_frequency, lambda bench: 5 * bench.xi / bench.tolerance[0]),
    "planar-coupling": Kind(_planar_shape, _planar, lambda bench: 0.5),
    "residual-modes": Kind(_residual_shape, _residual, lambda bench: 1.0),
    "amplitude-scale": Kind(_either, _scale, lambda bench: 0.8),
    "phase-lag": Kind(_either, _lag, lambda bench: 1.0),
    "force-dropout": Kind(_dropout_shape, _dropout, lambda bench: 0.7),
    "iwan": Kind(_iwan_shape, _iwan, lambda bench: 20.0),
    "bouc-wen": Kind(_slip_shape, _bouc_wen, lambda bench: 20.0),
    "clearance": Kind(_clearance_shape, _clearance, lambda bench: 20.0),
    "quintic": Kind(_either, _quintic, lambda bench: 5.0),
    "saturation": Kind(_none, _saturation, lambda bench: 9.0),
    "drift": Kind(_either, _drift, lambda bench: 8.0),
    "interference": Kind(_line_shape, _line, lambda bench: 1.0),
}

OUTSIDE = ("iwan", "bouc-wen", "clearance", "quintic", "saturation", "drift", "interference")
LIBRARY = tuple(name for name in KINDS if name not in OUTSIDE)
FORCES = (
    "displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement", "coulomb-friction",
)  # fmt: skip
INSTRUMENT = ("amplitude-scale", "phase-lag", "force-dropout")
STRUCTURE = ("slip", "stiffness-hardening", "stiffness-softening", "planar-coupling", "residual-modes")


def applied(effects: tuple[Effect, ...], bench: Bench) -> Truth:
    """True structure and rig with the effects present."""
    truth = bench.truth(), bench.rows
    for effect in effects:
        truth = KINDS[effect.name].apply(truth, effect.size, effect.shape, bench)
    return truth


def draw_effect(name: str, rng: Generator, bench: Bench) -> Effect:
    """The effect with a drawn shape and its largest size."""
    kind = KINDS[name]
    return Effect(name, kind.most(bench), kind.shape(rng, bench))
