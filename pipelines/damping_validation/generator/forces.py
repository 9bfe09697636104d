"""What every effect declares: how it is drawn, what it does to the truth, and how a fit may look for it.

Effects that are a force or a wrong parameter of the simulation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from damping_validation.generator.plan import Bench, Generator, force_unit, log_uniform
from damping_validation.generator.structure import Structure, TrueJoint, TrueLaw, TrueRows

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

    ``trials`` are shapes from which a fit may start (for the label's nearest imitation), ``free`` those entries of a
    shape that it may move. The bench gives the scales: A, xi and the simulation's nominal values.
    """

    shape: Callable[[Generator, Bench], Shape]
    apply: Callable[[Truth, float, Shape, Bench], Truth]
    most: Callable[[Bench], float]
    trials: Callable[[Bench], tuple[Shape, ...]] = lambda bench: ((),)
    free: tuple[int, ...] = ()


def no_shape(rng: Generator, bench: Bench) -> Shape:
    """Nothing to draw."""
    return ()


def sign(rng: Generator) -> float:
    """-1 or 1."""
    return float(rng.choice([-1.0, 1.0]))


def either_sign(rng: Generator, bench: Bench) -> Shape:
    """A sign."""
    return (sign(rng),)


def both_signs(bench: Bench) -> tuple[Shape, ...]:
    """Both signs, for a fit."""
    return ((1.0,), (-1.0,))


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

    return Kind(no_shape, apply, _friction_most if law == "coulomb" else lambda bench: 6.0)


def _friction_most(bench: Bench) -> float:
    """Friction of half the lowest force, so that the mass keeps moving everywhere."""
    held = sum(coefficient for name, coefficient in bench.base if name == "coulomb")
    unit = force_unit("coulomb", bench.nominal.viscous, bench.nominal.omega, bench.A)
    return (0.5 * float(np.min(bench.rows.force)) - held) / unit


def _viscous(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    factor = 1 + shape[0] * (_BEYOND + size) * bench.tolerance[2]
    return replace(structure, viscous=bench.nominal.viscous * factor), rows


def _frequency(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
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

    return Kind(shape, apply, lambda bench: 5.0, lambda bench: ((0.0, 0.0),))


def slip_shape(rng: Generator, bench: Bench) -> Shape:
    """The amplitude at which it slips, over A."""
    return (log_uniform(rng, 0.08, 0.6),)


def _slip(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A Jenkins joint; size 1 has the stiffness 2 xi k."""
    structure, rows = truth
    joint = TrueJoint("jenkins", size * stiffness_unit(bench), (shape[0] * bench.A,), (1.0,))
    return replace(structure, joints=(*structure.joints, joint)), rows


FORCE_KINDS = {
    "viscous-coefficient": Kind(either_sign, _viscous, lambda bench: 0.7 / bench.tolerance[2] - _BEYOND, both_signs),
    "displacement": _damping("displacement"),
    "velocity-squared": _damping("velocity-squared"),
    "displacement-velocity": _damping("displacement-velocity"),
    "quadratic-displacement": _damping("quadratic-displacement"),
    "coulomb-friction": _damping("coulomb"),
    "slip": Kind(slip_shape, _slip, lambda bench: 20.0, lambda bench: ((0.1,), (0.25,), (0.6,)), (0,)),
    "stiffness-hardening": _stiffness(1.0),
    "stiffness-softening": _stiffness(-1.0),
    "natural-frequency": Kind(either_sign, _frequency, lambda bench: 5 * bench.xi / bench.tolerance[0], both_signs),
}
