"""Case III of Table 2.I: velocity-squared (environmental, turbulent) damping."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force


@dataclass(frozen=True)
class VelocitySquared(Force):
    """g = C3 q'^2 sgn q'; energy per cycle (8/3) C3 A^3 omega^2 (Table 2.II, case III). C3 in force time^2/length^2."""

    coefficient: Floats

    name: ClassVar[str] = "velocity-squared"
    label: ClassVar[str] = "velocity squared (case III)"
    formula: ClassVar[str] = "C3 q'^2 sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (3.0, 2.0)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (8/(3 pi)) C3 (A omega)^2."""
        return (8.0 / (3.0 * pi)) * self.coefficient * (A * omega) ** 2

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 2 C."""
        return 2.0 * self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C3 (A omega cos(theta))^2 sgn(cos(theta))."""
        cosine = np.cos(theta)
        return self.coefficient * ((A * omega) ** 2 * cosine * np.abs(cosine))
