"""What every effect declares: how it is drawn, what it does to the truth, and how a fit may look for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

from pipelines.generator.bench import Bench
from pipelines.generator.laws import Law
from pipelines.generator.plan import Generator
from pipelines.generator.structure import Rows, Structure

Shape: TypeAlias = tuple[float, ...]
Truth: TypeAlias = tuple[Structure, Rows]


@dataclass(frozen=True)
class Effect:
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


def with_laws(truth: Truth, *laws: Law) -> Truth:
    """The truth with forces added."""
    structure, rows = truth
    return replace(structure, laws=(*structure.laws, *laws)), rows


def stiffness_unit(bench: Bench) -> float:
    """2 xi k: the stiffness that moves the resonance by xi."""
    return 2 * bench.xi * bench.nominal.mass * bench.nominal.omega**2
