"""Structures whose damping is known, to try predictions on: laws that compete, and one that does not.

All carry the force 1 at the amplitude 1 and the frequency ``OMEGA``. The Iwan joint stands for what no candidate is:
its microslip dissipates as a power of amplitude that no candidate has beside a viscous part, and it saturates when the
whole joint slides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selection.arrays import FloatArray, Floats
from selection.forces.catalogue import make
from selection.forces.contract import Force, Sum
from selection.posterior.law import Law
from selection.posterior.observations import Observations
from selection.response.ritz import resonant_amplitude

#: Frequency of every simulated resonance, rad/s.
OMEGA = 10.0


@dataclass(frozen=True)
class Iwan(Force):
    """Joint of sliders that slip at the displacements x with density R x^chi up to ``limit`` (Segalman 2005, no spike).

    A slider dissipates 4 x (A - x) of its strength, so E = 4 R int_0^min(A, limit) (A - x) x^(chi+1) dx. Only the
    average is given, so the cycle is the equivalent viscous one, C cos(theta).
    """

    strength: Floats
    chi: float
    limit: float

    name: ClassVar[str] = "iwan"
    label: ClassVar[str] = "Iwan joint"
    formula: ClassVar[str] = "sliders of density R x^chi up to the limit"

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = E/(pi A) = (4 R/pi) (x^m/m - x^n/(n A)), m = chi + 2, n = chi + 3, x = min(A, limit)."""
        m, n = self.chi + 2.0, self.chi + 3.0
        x = np.minimum(A, self.limit)
        return np.asarray(4.0 / np.pi * self.strength * (x**m / m - x**n / (n * A)) + 0.0 * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = (4 R/pi) x^n/(n A): a slider that only begins to slip adds nothing."""
        n = self.chi + 3.0
        x = np.minimum(A, self.limit)
        return np.asarray(4.0 / np.pi * self.strength * x**n / (n * A) + 0.0 * omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C cos(theta)."""
        return self.quadrature(A, omega) * np.cos(theta)


@dataclass(frozen=True)
class Structure:
    """A damping force by name; ``law`` is its own among the candidates, None where it has none."""

    name: str
    force: Sum
    law: Law | None

    def amplitude(self, force: FloatArray) -> FloatArray:
        """Resonant amplitude at each force (forces,)."""
        return resonant_amplitude(self.force, force, OMEGA)


def carrying(share: float, name: str, **shapes: float) -> Force:
    """The force called ``name`` that carries ``share`` at the amplitude 1 and ``OMEGA``."""
    if name == "iwan":
        return Iwan(share / float(Iwan(1.0, **shapes).quadrature(1.0, OMEGA)), **shapes)
    scale = "stiffness" if name == "slip" else "coefficient"
    return make(name, **{scale: share / float(make(name, **{scale: 1.0}, **shapes).quadrature(1.0, OMEGA))}, **shapes)


def structures() -> tuple[Structure, ...]:
    """The structures that predictions are tried on."""
    shares = {
        "viscous": {"viscous": 1.0},
        "viscous + velocity-squared": {"viscous": 0.5, "velocity-squared": 0.5},
        "viscous + quadratic-displacement": {"viscous": 0.5, "quadratic-displacement": 0.5},
        "viscous + coulomb": {"viscous": 0.7, "coulomb": 0.3},
    }
    sums = [
        Structure(n, Sum(tuple(carrying(s, f) for f, s in parts.items())), Law(tuple(parts)))
        for n, parts in shares.items()
    ]
    power = Sum((carrying(1.0, "velocity-power", exponent=1.6),))
    slip = Sum((carrying(0.6, "viscous"), carrying(0.4, "slip", limit=0.5)))
    iwan = Sum((carrying(0.4, "viscous"), carrying(0.6, "iwan", chi=-0.6, limit=4.0)))
    return (
        *sums,
        Structure("velocity-power", power, Law(("velocity-power",))),
        Structure("viscous + slip", slip, Law(("viscous", "slip"))),
        Structure("viscous + Iwan joint", iwan, None),
    )


def peaks(force: FloatArray, amplitude: FloatArray) -> Observations:
    """One row a level, at phase resonance, both (levels,)."""
    n = len(force)
    zero = np.zeros(n)
    omega = np.full(n, OMEGA)
    return Observations(
        A=amplitude,
        omega=omega,
        D=force,
        R=zero,
        sweep=np.arange(n),
        sd_amplitude=zero,
        sd_force=zero,
        sd_phase=zero,
        sweeps=tuple(f"level {i + 1}" for i in range(n)),
        tested_force=force,
        tested_amplitude=amplitude,
        tested_omega=omega,
    )


def simulated_levels(
    structure: Structure, levels: int, span: float, noise: float, rng: np.random.Generator
) -> Observations:
    """A test of ``levels`` forces, equally spaced in the logarithm from ``span``^(-1/2) to ``span``^(1/2).

    Args:
        noise: relative scatter of the measured amplitudes.
    """
    force = np.geomspace(span**-0.5, span**0.5, levels)
    return peaks(force, structure.amplitude(force) * np.exp(noise * rng.standard_normal(levels)))
