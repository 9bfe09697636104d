"""A cubic spring: conservative, so it bends the resonance and dissipates nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force, ones, zeros


@dataclass(frozen=True)
class CubicStiffness(Force):
    """g = k3 q^3, hardening for k3 > 0 and softening for k3 < 0: S = (3/4) k3 A^3, C = 0. k3 in force/length^3."""

    coefficient: Floats

    name: ClassVar[str] = "cubic-stiffness"
    label: ClassVar[str] = "cubic stiffness"
    formula: ClassVar[str] = "k3 q^3"

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = 0."""
        return zeros(self.coefficient, A, omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 0."""
        return zeros(self.coefficient, A, omega)

    def in_phase(self, A: Floats, omega: Floats) -> Floats:
        """S = (3/4) k3 A^3."""
        return 0.75 * self.coefficient * (A * A * A) * ones(omega)

    def in_phase_slope(self, A: Floats, omega: Floats) -> Floats:
        """dS/d ln A = 3 S."""
        return 3.0 * self.in_phase(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """k3 (A sin(theta))^3."""
        return self.coefficient * (A * np.sin(theta)) ** 3 * ones(omega)
