"""What every effect declares: how it is drawn, what it does to the truth, and how a fit may look for it.

Effects of the structure: a force, a joint, a spring, a wrong parameter of the simulation, a further path from drive to
sensor. A kind is named as the library of the diagnosis names its effect; what stands after a colon is a form of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.special import gamma

from damping_validation.generator.laws import TrueJoint, TrueLaw
from damping_validation.generator.plan import Bench, Generator, force_unit, log_uniform
from damping_validation.generator.structure import Side, Structure, TrueRows

Shape: TypeAlias = tuple[float, ...]
Truth: TypeAlias = tuple[Structure, TrueRows]


@dataclass(frozen=True)
class TrueEffect:
    """An effect by name; its size is dimensionless and positive, its shape (signs, places, widths) drawn once."""

    name: str
    size: float
    shape: Shape


@dataclass(frozen=True)
class Kind:
    """An effect: shapes drawn, change of the true structure or rig at a size, largest size.

    ``free`` are the entries of a shape that a fit may move. The bench gives the scales: A, xi and the simulation's
    nominal values.
    """

    shape: Callable[[Generator, Bench], Shape]
    apply: Callable[[Truth, float, Shape, Bench], Truth]
    most: Callable[[Bench], float]
    free: tuple[int, ...] = ()


def draw_no_shape(rng: Generator, bench: Bench) -> Shape:
    """Nothing to draw."""
    return ()


def sign(rng: Generator) -> float:
    """-1 or 1."""
    return float(rng.choice([-1.0, 1.0]))


def either_sign(rng: Generator, bench: Bench) -> Shape:
    """A sign."""
    return (sign(rng),)


def with_laws(truth: Truth, *laws: TrueLaw) -> Truth:
    """The truth with forces added."""
    structure, rows = truth
    return replace(structure, laws=(*structure.laws, *laws)), rows


def stiffness_unit(bench: Bench) -> float:
    """2 xi k: the stiffness that moves the resonance by xi."""
    return 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2


_BEYOND = 3.0  # tolerances by which a wrong parameter is off at size 0


def _damping(law: str) -> Kind:
    """A damping force; size 1 loses at A what the viscous damping loses."""

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        unit = force_unit(law, bench.nominal.viscous, bench.nominal.omega, bench.A)
        return with_laws(truth, TrueLaw(law, size * unit))

    return Kind(draw_no_shape, apply, limit_friction if law == "coulomb" else lambda bench: 6.0)


def limit_friction(bench: Bench) -> float:
    """Friction of half the lowest force, so that the mass keeps moving everywhere."""
    held = sum(coefficient for name, coefficient in bench.base if name == "coulomb")
    unit = force_unit("coulomb", bench.nominal.viscous, bench.nominal.omega, bench.A)
    return (0.5 * float(np.min(bench.rows.force)) - held) / unit


def _apply_viscous(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    factor = 1 + shape[0] * (_BEYOND + size) * bench.tolerance[2]
    return replace(structure, viscous=bench.nominal.viscous * factor), rows


def _apply_frequency(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    factor = 1 + shape[0] * (_BEYOND + size) * bench.tolerance[0]
    return replace(structure, omega=bench.nominal.omega * factor), rows


def _stiffness(way: float) -> Kind:
    """Cubic spring mostly, else one like it (q|q|, cubic beside quadratic); size 1 shifts the resonance at A by xi."""

    def shape(rng: Generator, bench: Bench) -> Shape:
        return (float(rng.choice([0, 1, 2], p=[0.8, 0.1, 0.1])), rng.uniform(0.05, 0.3))

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        unit, A = way * size * stiffness_unit(bench), bench.A
        if shape[0] == 1:
            return with_laws(truth, TrueLaw("odd-square", unit * 3 * np.pi / 8 / A))
        if shape[0] == 0:
            return with_laws(truth, TrueLaw("cubic", unit * 4 / 3 / A**2))
        k = bench.nominal.mass * bench.nominal.omega**2
        quadratic = shape[1] * float(np.sqrt(abs(unit) * k)) / A
        offset = 10 / 9 * quadratic**2 / k  # the cubic spring to which the quadratic one softens
        return with_laws(truth, TrueLaw("cubic", unit * 4 / 3 / A**2 + offset), TrueLaw("quadratic", quadratic))

    return Kind(shape, apply, lambda bench: 5.0)


def draw_slip_shape(rng: Generator, bench: Bench) -> Shape:
    """The amplitude at which it slips, over A."""
    return (log_uniform(rng, 0.08, 0.6),)


def _apply_slip(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A Jenkins joint; size 1 has the stiffness 2 xi k."""
    structure, rows = truth
    joint = TrueJoint("jenkins", size * stiffness_unit(bench), (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


_PARTS = 12


def _draw_iwan_shape(rng: Generator, bench: Bench) -> Shape:
    """Power by which the parts' weights grow with their limits, and the largest limit over A."""
    return (rng.uniform(-0.6, 0.3), log_uniform(rng, 0.3, 1.5))


def _apply_iwan(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A joint of 12 Jenkins elements in parallel with limits spread evenly (parallel-series Iwan joint)."""
    structure, rows = truth
    limits = (np.arange(_PARTS) + 0.5) / _PARTS
    weights = limits ** shape[0] / np.sum(limits ** shape[0])
    reach = limits * shape[1] * bench.A
    joint = TrueJoint("jenkins", size * stiffness_unit(bench), tuple(reach.tolist()), tuple(weights.tolist()))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _apply_bouc_wen(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    joint = TrueJoint("bouc-wen", size * stiffness_unit(bench), (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


def _draw_power_shape(rng: Generator, bench: Bench) -> Shape:
    """The exponent of the spring."""
    return (float(rng.choice([1.5, 2.5, 4.0, 5.0])),)


def _power_spring(way: float) -> Kind:
    """A spring sign(q) |q|^p; size 1 shifts the resonance at A by xi: its average over A^p is 2 I(p + 1)/pi."""

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        p = shape[0]
        average = 2 / np.sqrt(np.pi) * gamma(p / 2 + 1) / gamma(p / 2 + 1.5)  # (2/pi) integral of sin^(p+1) over pi
        unit = stiffness_unit(bench) / average / bench.A ** (p - 1)
        return with_laws(truth, TrueLaw("power-spring", way * size * unit, p))

    return Kind(_draw_power_shape, apply, lambda bench: 4.0)


def _draw_planar_shape(rng: Generator, bench: Bench) -> Shape:
    """Relative distance of the second plane's frequency, and its viscous damping over the first's."""
    return (sign(rng) * bench.xi * log_uniform(rng, 0.6, 4.5), rng.uniform(0.8, 1.25))


def _apply_planar(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Two principal planes, the drive at an angle to the first whose squared sine is the size (report, 3.1.24-35)."""
    structure, rows = truth
    sine = float(np.sqrt(size))
    zeta = shape[1] * structure.viscous / (2 * structure.mass * structure.omega)
    cosine = float(np.sqrt(1 - size))
    side = Side(structure.omega * (1 + shape[0]), zeta, sine, sine, across=cosine, loaded=True)
    return replace(structure, share=cosine, across=-sine, sides=(*structure.sides, side)), rows


def _draw_residual_shape(rng: Generator, bench: Bench) -> Shape:
    """Sign; frequency ratio of a lower mode, a higher mode and a rigid-body motion; their weights (some 0)."""
    places = (rng.uniform(0.35, 0.75), rng.uniform(1.35, 2.6), rng.uniform(0.03, 0.12))
    weights = rng.dirichlet([1.0, 1.5, 0.7]) * rng.choice([0.0, 1.0], size=3, p=[0.3, 0.7])
    if weights.sum() == 0.0:
        weights = np.array([0.0, 1.0, 0.0])
    return (sign(rng), *places, *(weights / weights.sum()).tolist())


def _apply_residual(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Other modes with .5 % damping; size 1 adds in phase at resonance as much as the resonance itself is high."""
    structure, rows = truth
    sides = []
    for place, weight in zip(shape[1:4], shape[4:7], strict=True):
        if weight:
            seen = shape[0] * size * weight * abs(place**2 - 1) / (2 * bench.xi) * (1 if place > 1 else -1)
            sides.append(Side(bench.nominal.omega * place, 0.005, 1.0, seen))
    return replace(structure, sides=(*structure.sides, *sides)), rows


def _draw_second_shape(rng: Generator, bench: Bench) -> Shape:
    """Relative distance of its frequency, its damping ratio over the main one's, and the sign of its motion."""
    return (sign(rng) * bench.xi * log_uniform(rng, 1.0, 8.0), log_uniform(rng, 0.5, 2.0), sign(rng))


def apply_second_mode(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A close mode with its own mass: size is the main modal mass over its own, as seen between drive and sensor."""
    structure, rows = truth
    side = Side(bench.nominal.omega * (1 + shape[0]), bench.xi * shape[1], 1.0, shape[2] * size)
    return replace(structure, sides=(*structure.sides, side)), rows


def _draw_rigid_shape(rng: Generator, bench: Bench) -> Shape:
    """As for other modes, all of it rigid-body motion or a fixture far below."""
    return (sign(rng), 0.5, 2.0, rng.uniform(0.02, 0.2), 0.0, 0.0, 1.0)


FORCE_KINDS = {
    "viscous-coefficient": Kind(either_sign, _apply_viscous, lambda bench: 0.7 / bench.tolerance[2] - _BEYOND),
    "displacement": _damping("displacement"),
    "velocity-squared": _damping("velocity-squared"),
    "displacement-velocity": _damping("displacement-velocity"),
    "quadratic-displacement": _damping("quadratic-displacement"),
    "coulomb-friction": _damping("coulomb"),
    "slip": Kind(draw_slip_shape, _apply_slip, lambda bench: 20.0, (0,)),
    "slip:iwan": Kind(_draw_iwan_shape, _apply_iwan, lambda bench: 20.0),
    "slip:smooth": Kind(draw_slip_shape, _apply_bouc_wen, lambda bench: 20.0),
    "stiffness-hardening": _stiffness(1.0),
    "stiffness-hardening:power": _power_spring(1.0),
    "stiffness-softening": _stiffness(-1.0),
    "stiffness-softening:power": _power_spring(-1.0),
    "natural-frequency": Kind(either_sign, _apply_frequency, lambda bench: 5 * bench.xi / bench.tolerance[0]),
}
PATH_KINDS = {
    "planar-coupling": Kind(_draw_planar_shape, _apply_planar, lambda bench: 0.5, (0,)),
    "second-mode": Kind(_draw_second_shape, apply_second_mode, lambda bench: 1.0, (0,)),
    "residual-modes": Kind(_draw_residual_shape, _apply_residual, lambda bench: 1.0),
    "residual-modes:rigid": Kind(_draw_rigid_shape, _apply_residual, lambda bench: 1.0),
}
