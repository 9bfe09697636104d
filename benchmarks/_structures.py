"""Structures of the library's forces, which carry the force 1 at the amplitude 1 and ``OMEGA``, and one joint that no
candidate is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from damping.arrays import FloatArray, Floats
from damping.forces import component
from damping.forces.contract import AveragedForce, Force, GrowingForce, Sum
from damping.forces.shapes import FORCE, LENGTH, Shape
from damping.infer.law import Law
from damping.infer.observations import Observations
from damping.predict.steady import resonant_amplitude
from damping_validation.truths import OMEGA, peaks


@dataclass(frozen=True)
class Iwan(GrowingForce, AveragedForce):
    """Joint of sliders that slip at the displacements x with density R x^chi up to ``limit`` (Segalman 2005, no spike).

    A slider dissipates 4 x (A - x) of its strength, so E = 4 R int_0^min(A, limit) (A - x) x^(chi+1) dx.
    """

    strength: Floats
    chi: float
    limit: float

    name: ClassVar[str] = "iwan"
    label: ClassVar[str] = "Iwan joint"
    formula: ClassVar[str] = "sliders of density R x^chi up to the limit"
    shapes: ClassVar[tuple[Shape, ...]] = (
        Shape("strength", FORCE / LENGTH**2.0 / LENGTH ** "chi", least=0.0),
        Shape("chi", above=-2.0),
        Shape("limit", LENGTH, above=0.0),
    )

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = E/(pi A) = (4 R/pi) (x^m/m - x^n/(n A)), m = chi + 2, n = chi + 3, x = min(A, limit).

        dC/d ln A = (4 R/pi) x^n/(n A): a slider that only begins to slip adds nothing.
        """
        m, n = self.chi + 2.0, self.chi + 3.0
        x = np.minimum(A, self.limit)
        size, held = 4.0 / np.pi * self.strength, x**n / (n * A)
        return np.asarray(size * (x**m / m - held) + 0.0 * omega), np.asarray(size * held + 0.0 * omega)


@dataclass(frozen=True)
class KnownStructure:
    """A damping force by name; ``law`` is its own among the candidates, None where it has none."""

    name: str
    force: Sum
    law: Law | None

    def amplitude(self, force: FloatArray) -> FloatArray:
        """Resonant amplitude at each force (forces,)."""
        return resonant_amplitude(self.force, force, OMEGA)


#: Forces that are no candidates, by name.
BUILDERS: dict[str, Callable[..., Force]] = {Iwan.name: Iwan}


def carrying(share: float, name: str, **shapes: float) -> Force:
    """The force called ``name`` that carries ``share`` at the amplitude 1 and ``OMEGA``."""
    build = BUILDERS.get(name) or component(name).build
    return build(share / float(build(1.0, **shapes).quadrature(1.0, OMEGA)), **shapes)


def structures() -> tuple[KnownStructure, ...]:
    """The structures that predictions are tried on."""
    shares = {
        "viscous": {"viscous": 1.0},
        "viscous + velocity-squared": {"viscous": 0.5, "velocity-squared": 0.5},
        "viscous + quadratic-displacement": {"viscous": 0.5, "quadratic-displacement": 0.5},
        "viscous + coulomb": {"viscous": 0.7, "coulomb": 0.3},
    }
    sums = [
        KnownStructure(n, Sum(tuple(carrying(s, f) for f, s in parts.items())), Law(tuple(parts)))
        for n, parts in shares.items()
    ]
    power = Sum((carrying(1.0, "velocity-power", exponent=1.6),))
    slip = Sum((carrying(0.6, "viscous"), carrying(0.4, "slip", limit=0.5)))
    iwan = Sum((carrying(0.4, "viscous"), carrying(0.6, "iwan", chi=-0.6, limit=4.0)))
    return (
        *sums,
        KnownStructure("velocity-power", power, Law(("velocity-power",))),
        KnownStructure("viscous + slip", slip, Law(("viscous", "slip"))),
        KnownStructure("viscous + Iwan joint", iwan, None),
    )


def simulated_levels(
    structure: KnownStructure, levels: int, span: float, noise: float, rng: np.random.Generator
) -> Observations:
    """A test of ``levels`` forces, equally spaced in the logarithm from ``span``^(-1/2) to ``span``^(1/2).

    Args:
        noise: relative scatter of the measured amplitudes.
    """
    force = np.geomspace(span**-0.5, span**0.5, levels)
    return peaks(force, structure.amplitude(force) * np.exp(noise * rng.standard_normal(levels)))


#: A few candidates that differ where all resonances have one frequency: a quarter of the time of all of them.
CANDIDATES = (
    *(Law((name,)) for name in ("viscous", "velocity-squared", "quadratic-displacement", "velocity-power")),
    *(Law(("viscous", name)) for name in ("velocity-squared", "quadratic-displacement", "coulomb", "slip")),
    Law(("viscous", "velocity-squared", "coulomb")),
)
