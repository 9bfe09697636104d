"""Second term of case V of Table 2.I: damping proportional to q^2 q'."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force


@dataclass(frozen=True)
class QuadraticDisplacement(Force):
    """g = C5 q^2 q'; energy per cycle (pi/4) C5 A^4 omega (Table 5.I, case V). C5 in force time/length^3.

    With viscous damping beside it and C5 = C1 alpha this is case V, C1 (1 + alpha q^2) q' (Table 2.I, erratum E2II-2).
    """

    coefficient: Floats

    name: ClassVar[str] = "quadratic-displacement"
    label: ClassVar[str] = "quadratic displacement (second term of case V)"
    formula: ClassVar[str] = "C5 q^2 q'"
    energy_exponents: ClassVar[tuple[float, float]] = (4.0, 1.0)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = C5 A^3 omega/4."""
        return 0.25 * self.coefficient * (A * A * A * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 3 C."""
        return 3.0 * self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C5 A^3 omega sin(theta)^2 cos(theta)."""
        return self.coefficient * (A * A * A * omega * np.sin(theta) ** 2 * np.cos(theta))
