"""Case IV of Table 2.I: material damping proportional to |q| q'."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force


@dataclass(frozen=True)
class DisplacementVelocity(Force):
    """g = C4 |q| q'; energy per cycle (4/3) C4 A^3 omega (Table 2.II, case IV). C4 in force time/length^2.

    The printed psi of this case, 4 C4 A/(M omega), lost a factor 3 in the denominator (erratum E2II-1).
    """

    coefficient: Floats

    name: ClassVar[str] = "displacement-velocity"
    label: ClassVar[str] = "displacement velocity (case IV)"
    formula: ClassVar[str] = "C4 |q| q'"
    energy_exponents: ClassVar[tuple[float, float]] = (3.0, 1.0)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (4/(3 pi)) C4 A^2 omega."""
        return (4.0 / (3.0 * pi)) * self.coefficient * (A * A * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 2 C."""
        return 2.0 * self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C4 A^2 omega |sin(theta)| cos(theta)."""
        return self.coefficient * (A * A * omega * np.abs(np.sin(theta)) * np.cos(theta))
