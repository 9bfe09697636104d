"""Case I of Table 2.I: viscous or environmental damping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force


@dataclass(frozen=True)
class Viscous(Force):
    """g = C1 q'; energy per cycle C1 pi A^2 omega (Table 2.II, case I). C1 in force time/length."""

    coefficient: Floats

    name: ClassVar[str] = "viscous"
    label: ClassVar[str] = "viscous (case I)"
    formula: ClassVar[str] = "C1 q'"
    energy_exponents: ClassVar[tuple[float, float]] = (2.0, 1.0)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = C1 A omega."""
        return self.coefficient * (A * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = C."""
        return self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C1 A omega cos(theta)."""
        return self.coefficient * (A * omega * np.cos(theta))
