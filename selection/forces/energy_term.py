"""One term a A^m omega^n of an energy polynomial (Eq 5.1.2) as a force."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import Floats
from selection.forces.contract import Force


@dataclass(frozen=True)
class EnergyTerm(Force):
    """The force whose energy per cycle is a A^m omega^n: C = (a/pi) A^(m-1) omega^n (Eqs 5.1.1, 5.1.2).

    For terms of a polynomial that no force of the catalogue gives. Only the average is known, so the cycle is the
    equivalent viscous one, C cos(theta).
    """

    coefficient: Floats
    amplitude_power: float
    frequency_power: float

    @property
    def name(self) -> str:
        """The term as typed in a polynomial, such as ``A^2*omega``."""
        parts = [_power("A", self.amplitude_power), _power("omega", self.frequency_power)]
        return "*".join(part for part in parts if part) or "1"

    @property
    def label(self) -> str:
        """The term as energy per cycle."""
        return f"energy term {self.name}"

    @property
    def formula(self) -> str:
        """The energy per cycle."""
        return f"E = a {self.name}"

    @property
    def energy_exponents(self) -> tuple[Floats, Floats]:
        """(m, n)."""
        return self.amplitude_power, self.frequency_power

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (a/pi) A^(m-1) omega^n."""
        return self.coefficient / np.pi * A ** (self.amplitude_power - 1.0) * omega**self.frequency_power

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = (m - 1) C."""
        return (self.amplitude_power - 1.0) * self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C cos(theta)."""
        return self.quadrature(A, omega) * np.cos(theta)


def _power(symbol: str, power: float) -> str:
    if power == 0.0:
        return ""
    return symbol if power == 1.0 else f"{symbol}^{power:g}"
