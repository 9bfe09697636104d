"""Coulomb friction: a constant force against the velocity."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force, ones, zeros


@dataclass(frozen=True)
class Coulomb(Force):
    """g = R sgn q'; energy per cycle 4 R A (Eq 4.3.6 with p = 0). R in force.

    The first harmonic is the constant 4 R/pi: friction alone has no resonant amplitude, below a force 4 R/pi there is
    none to speak of and above it none is finite.
    """

    coefficient: Floats

    name: ClassVar[str] = "coulomb"
    label: ClassVar[str] = "Coulomb friction"
    formula: ClassVar[str] = "R sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (1.0, 0.0)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = 4 R/pi at any amplitude and frequency."""
        return (4.0 / pi) * self.coefficient * ones(A, omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 0."""
        return zeros(self.coefficient, A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """R sgn(cos(theta))."""
        return self.coefficient * np.sign(np.cos(theta)) * ones(A, omega)
