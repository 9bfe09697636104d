"""Case II of Table 2.I: displacement-proportional (structural) damping of material or slip."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force, ones


@dataclass(frozen=True)
class Displacement(Force):
    """g = C2 |q| sgn q'; energy per cycle 2 C2 A^2 (Table 2.II, case II). C2 in force/length."""

    coefficient: Floats

    name: ClassVar[str] = "displacement"
    label: ClassVar[str] = "displacement (case II)"
    formula: ClassVar[str] = "C2 |q| sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (2.0, 0.0)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/pi) C2 A, at any frequency."""
        return (2.0 / pi) * self.coefficient * A * ones(omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = C."""
        return self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C2 A |sin(theta)| sgn(cos(theta))."""
        return self.coefficient * A * np.abs(np.sin(theta)) * np.sign(np.cos(theta)) * ones(omega)
