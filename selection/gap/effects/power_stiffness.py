"""A spring whose force is a power of the displacement: conservative, the cubic one is that of exponent 3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force, ones, zeros
from selection.forces.gammas import velocity_power_energy


@dataclass(frozen=True)
class PowerStiffness(Force):
    """g = k |q|^p sgn q: S = k A^p B(p), B = 2 Gamma(p/2 + 1)/(sqrt(pi) Gamma((p + 3)/2)).

    k in force/length^p. C = 0.
    """

    coefficient: Floats
    exponent: Floats

    name: ClassVar[str] = "power-stiffness"
    label: ClassVar[str] = "stiffness of a power"
    formula: ClassVar[str] = "k |q|^p sgn q"

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = 0."""
        return zeros(self.coefficient, A, omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 0."""
        return zeros(self.coefficient, A, omega)

    def in_phase(self, A: Floats, omega: Floats) -> Floats:
        """S = k B(p) A^p."""
        return self.coefficient * velocity_power_energy(self.exponent) / np.pi * A**self.exponent * ones(omega)

    def in_phase_slope(self, A: Floats, omega: Floats) -> Floats:
        """dS/d ln A = p S."""
        return self.exponent * self.in_phase(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """k A^p |sin(theta)|^p sgn(sin(theta))."""
        sine = np.sin(theta)
        return self.coefficient * (A * np.abs(sine)) ** self.exponent * np.sign(sine) * ones(omega)
