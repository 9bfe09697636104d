"""Velocity raised to a real power, Eq 4.3.3."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force
from selection.forces.gammas import velocity_power_energy


@dataclass(frozen=True)
class VelocityPower(Force):
    """g = alpha |q'|^p sgn q'; energy per cycle 2 sqrt(pi) alpha A^(p+1) omega^p Gamma((p+2)/2)/Gamma((p+3)/2) (4.3.6).

    p = 1 is case I, p = 2 case III, p = 0 Coulomb friction. alpha in force (time/length)^p.
    """

    coefficient: Floats
    exponent: Floats

    name: ClassVar[str] = "velocity-power"
    label: ClassVar[str] = "velocity power (4.3.3)"
    formula: ClassVar[str] = "alpha |q'|^p sgn q'"

    @property
    def energy_exponents(self) -> tuple[Floats, Floats]:
        """(p + 1, p)."""
        return self.exponent + 1.0, self.exponent

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/sqrt(pi)) alpha (A omega)^p Gamma((p+2)/2)/Gamma((p+3)/2)."""
        return self.coefficient * velocity_power_energy(self.exponent) / pi * (A * omega) ** self.exponent

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = p C."""
        return self.exponent * self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """Alpha (A omega |cos(theta)|)^p sgn(cos(theta))."""
        cosine = np.cos(theta)
        return self.coefficient * (A * omega * np.abs(cosine)) ** self.exponent * np.sign(cosine)
