"""Case I of Table 2.I: viscous or environmental damping.

Case II of Table 2.I: displacement-proportional (structural) damping of material or slip.

Case III of Table 2.I: velocity-squared (environmental, turbulent) damping.

Case IV of Table 2.I: material damping proportional to |q| q'.

Second term of case V of Table 2.I: damping proportional to q^2 q'.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import ClassVar

from damping.arrays import Floats
from damping.forces.contract import Force, absolute, ones
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape, coefficient_in


@dataclass(frozen=True)
class Viscous(Force):
    """g = C1 q'; energy per cycle C1 pi A^2 omega (Table 2.II, case I). C1 in force time/length."""

    coefficient: Floats

    viscous: ClassVar[bool] = True
    name: ClassVar[str] = "viscous"
    label: ClassVar[str] = "viscous (case I)"
    formula: ClassVar[str] = "C1 q'"
    energy_exponents: ClassVar[tuple[float, float]] = (2.0, 1.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = C1 A omega."""
        return self.coefficient * (A * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = C."""
        return self.quadrature(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C1 q'."""
        return sign * self.coefficient * speed


@dataclass(frozen=True)
class Displacement(Force):
    """g = C2 |q| sgn q'; energy per cycle 2 C2 A^2 (Table 2.II, case II). C2 in force/length."""

    coefficient: Floats

    name: ClassVar[str] = "displacement"
    label: ClassVar[str] = "displacement (case II)"
    formula: ClassVar[str] = "C2 |q| sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (2.0, 0.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE / LENGTH),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/pi) C2 A, at any frequency."""
        return (2.0 / pi) * self.coefficient * A * ones(omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = C."""
        return self.quadrature(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C2 |q| sgn q'."""
        return sign * self.coefficient * absolute(q)


@dataclass(frozen=True)
class VelocitySquared(Force):
    """g = C3 q'^2 sgn q'; energy per cycle (8/3) C3 A^3 omega^2 (Table 2.II, case III). C3 in force time^2/length^2."""

    coefficient: Floats

    name: ClassVar[str] = "velocity-squared"
    label: ClassVar[str] = "velocity squared (case III)"
    formula: ClassVar[str] = "C3 q'^2 sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (3.0, 2.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME**2.0 / LENGTH**2.0),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (8/(3 pi)) C3 (A omega)^2."""
        return (8.0 / (3.0 * pi)) * self.coefficient * (A * omega) ** 2

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 2 C."""
        return 2.0 * self.quadrature(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C3 q'^2 sgn q'."""
        return sign * self.coefficient * speed * speed


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
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH**2.0),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (4/(3 pi)) C4 A^2 omega."""
        return (4.0 / (3.0 * pi)) * self.coefficient * (A * A * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 2 C."""
        return 2.0 * self.quadrature(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C4 |q| q'."""
        return sign * self.coefficient * absolute(q) * speed


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
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH**3.0),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = C5 A^3 omega/4."""
        return 0.25 * self.coefficient * (A * A * A * omega)

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = 3 C."""
        return 3.0 * self.quadrature(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C5 q^2 q'."""
        return sign * self.coefficient * q * q * speed
