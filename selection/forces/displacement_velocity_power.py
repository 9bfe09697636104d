"""Displacement times velocity raised to a real power, Eq 4.3.4."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force
from selection.forces.gammas import displacement_velocity_power_energy


@dataclass(frozen=True)
class DisplacementVelocityPower(Force):
    """g = alpha |q| |q'|^p sgn q'; energy per cycle 2 alpha A^(p+2) omega^p Gamma((p+2)/2)/Gamma((p+4)/2) (4.3.7).

    p = 0 is case II, p = 1 case IV. alpha in force/length (time/length)^p.
    """

    coefficient: Floats
    exponent: Floats

    name: ClassVar[str] = "displacement-velocity-power"
    label: ClassVar[str] = "displacement times velocity power (4.3.4)"
    formula: ClassVar[str] = "alpha |q| |q'|^p sgn q'"

    @property
    def energy_exponents(self) -> tuple[Floats, Floats]:
        """(p + 2, p)."""
        return self.exponent + 2.0, self.exponent

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/pi) alpha A (A omega)^p Gamma((p+2)/2)/Gamma((p+4)/2)."""
        factor = displacement_velocity_power_energy(self.exponent) / pi
        return self.coefficient * factor * A * (A * omega) ** self.exponent

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = (p + 1) C."""
        return (self.exponent + 1.0) * self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """Alpha A |sin(theta)| (A omega |cos(theta)|)^p sgn(cos(theta))."""
        cosine = np.cos(theta)
        power = (A * omega * np.abs(cosine)) ** self.exponent
        return self.coefficient * A * np.abs(np.sin(theta)) * power * np.sign(cosine)
