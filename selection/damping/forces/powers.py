"""Damping forces that are products of powers of amplitude and frequency: cases I to V, power laws, energy terms."""

import re
from dataclasses import dataclass
from math import pi, sqrt
from typing import ClassVar

import numpy as np
from scipy.special import gammaln

from damping.arrays import Floats
from damping.forces.contract import AveragedForce, CoefficientForce, Force, absolute, spread
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape, Uniform, coefficient_in


class Viscous(CoefficientForce):
    """g = C1 q'; energy per cycle C1 pi A^2 omega (Table 2.II, case I). C1 in force time/length."""

    viscous: ClassVar[bool] = True
    name: ClassVar[str] = "viscous"
    label: ClassVar[str] = "viscous (case I)"
    formula: ClassVar[str] = "C1 q'"
    energy_exponents: ClassVar[tuple[float, float]] = (2.0, 1.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = C1 A omega."""
        return self.coefficient * (A * omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C1 q'."""
        return sign * self.coefficient * speed


class Displacement(CoefficientForce):
    """g = C2 |q| sgn q'; energy per cycle 2 C2 A^2 (Table 2.II, case II). C2 in force/length."""

    name: ClassVar[str] = "displacement"
    label: ClassVar[str] = "displacement (case II)"
    formula: ClassVar[str] = "C2 |q| sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (2.0, 0.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE / LENGTH),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/pi) C2 A, at any frequency."""
        return spread((2.0 / pi) * self.coefficient * A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C2 |q| sgn q'."""
        return sign * self.coefficient * absolute(q)


class VelocitySquared(CoefficientForce):
    """g = C3 q'^2 sgn q'; energy per cycle (8/3) C3 A^3 omega^2 (Table 2.II, case III). C3 in force time^2/length^2."""

    name: ClassVar[str] = "velocity-squared"
    label: ClassVar[str] = "velocity squared (case III)"
    formula: ClassVar[str] = "C3 q'^2 sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (3.0, 2.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME**2.0 / LENGTH**2.0),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (8/(3 pi)) C3 (A omega)^2."""
        return (8.0 / (3.0 * pi)) * self.coefficient * (A * omega) ** 2

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C3 q'^2 sgn q'."""
        return sign * self.coefficient * speed * speed


class DisplacementVelocity(CoefficientForce):
    """g = C4 |q| q'; energy per cycle (4/3) C4 A^3 omega (Table 2.II, case IV). C4 in force time/length^2.

    The printed psi of this case, 4 C4 A/(M omega), lost a factor 3 in the denominator (erratum E2II-1).
    """

    name: ClassVar[str] = "displacement-velocity"
    label: ClassVar[str] = "displacement velocity (case IV)"
    formula: ClassVar[str] = "C4 |q| q'"
    energy_exponents: ClassVar[tuple[float, float]] = (3.0, 1.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH**2.0),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (4/(3 pi)) C4 A^2 omega."""
        return (4.0 / (3.0 * pi)) * self.coefficient * (A * A * omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C4 |q| q'."""
        return sign * self.coefficient * absolute(q) * speed


class QuadraticDisplacement(CoefficientForce):
    """g = C5 q^2 q'; energy per cycle (pi/4) C5 A^4 omega (Table 5.I, case V). C5 in force time/length^3.

    With viscous damping beside it and C5 = C1 alpha this is case V, C1 (1 + alpha q^2) q' (Table 2.I, erratum E2II-2).
    """

    name: ClassVar[str] = "quadratic-displacement"
    label: ClassVar[str] = "quadratic displacement (second term of case V)"
    formula: ClassVar[str] = "C5 q^2 q'"
    energy_exponents: ClassVar[tuple[float, float]] = (4.0, 1.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH**3.0),)

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = C5 A^3 omega/4."""
        return 0.25 * self.coefficient * (A * A * A * omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """C5 q^2 q'."""
        return sign * self.coefficient * q * q * speed


#: Power of velocity, from 0 (Coulomb-like, case II) to 3; Table 2.I spans 0 to 2.
EXPONENT = Shape("exponent", above=0.0, prior=Uniform(0.0, 3.0), label="exponent of velocity")


def gamma_ratio(x: Floats, y: Floats) -> Floats:
    """Gamma(x)/Gamma(y) for positive arguments, without overflow."""
    return np.exp(gammaln(x) - gammaln(y))


def velocity_power_energy(p: Floats) -> Floats:
    """2 sqrt(pi) Gamma((p+2)/2)/Gamma((p+3)/2): the energy of Eq 4.3.6 over alpha A^(p+1) omega^p."""
    return 2.0 * sqrt(pi) * gamma_ratio((p + 2.0) / 2.0, (p + 3.0) / 2.0)


def beta(p: Floats) -> Floats:
    """(sqrt(pi)/2) Gamma((p+3)/2)/Gamma((p+2)/2), Eq 4.3.8: at resonance alpha = beta F/(omega A)^p (4.3.9)."""
    return 0.5 * sqrt(pi) * gamma_ratio((p + 3.0) / 2.0, (p + 2.0) / 2.0)


def B(p: Floats) -> Floats:
    """(pi/2) Gamma((p+4)/2)/Gamma((p+2)/2), Eq 4.3.18: at resonance alpha = B F/(omega^p A^(p+1)) (4.3.19)."""
    return 0.5 * pi * gamma_ratio((p + 4.0) / 2.0, (p + 2.0) / 2.0)


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
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * (TIME / LENGTH) ** "exponent"), EXPONENT)
    sums: ClassVar[bool] = False

    @property
    def energy_exponents(self) -> tuple[Floats, Floats]:
        """(p + 1, p)."""
        return self.exponent + 1.0, self.exponent

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/sqrt(pi)) alpha (A omega)^p Gamma((p+2)/2)/Gamma((p+3)/2)."""
        return self.coefficient * velocity_power_energy(self.exponent) / pi * (A * omega) ** self.exponent

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """alpha |q'|^p sgn q'."""
        return sign * self.coefficient * speed**self.exponent


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
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE / LENGTH * (TIME / LENGTH) ** "exponent"), EXPONENT)
    sums: ClassVar[bool] = False

    @property
    def energy_exponents(self) -> tuple[Floats, Floats]:
        """(p + 2, p)."""
        return self.exponent + 2.0, self.exponent

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (2/pi) alpha A (A omega)^p Gamma((p+2)/2)/Gamma((p+4)/2)."""
        p = self.exponent
        factor = 2.0 * gamma_ratio((p + 2.0) / 2.0, (p + 4.0) / 2.0) / pi
        return self.coefficient * factor * A * (A * omega) ** p

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """alpha |q| |q'|^p sgn q'."""
        return sign * self.coefficient * absolute(q) * speed**self.exponent


@dataclass(frozen=True)
class EnergyTerm(AveragedForce):
    """The force whose energy per cycle is a A^m omega^n: C = (a/pi) A^(m-1) omega^n (Eqs 5.1.1, 5.1.2).

    It stands for terms of a polynomial that are no force of the catalogue.
    """

    coefficient: Floats
    amplitude_power: float
    frequency_power: float

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The coefficient; the powers are fixed."""
        return (coefficient_in(FORCE * LENGTH ** (1.0 - self.amplitude_power) * TIME**self.frequency_power),)

    @property
    def resonates(self) -> bool:
        """Whether C grows with amplitude."""
        return self.amplitude_power > 1.0

    @property
    def name(self) -> str:
        """The term as typed in a polynomial, such as ``A^2*omega``."""
        powers = (("A", self.amplitude_power), ("omega", self.frequency_power))
        factors = (symbol if power == 1.0 else f"{symbol}^{power:g}" for symbol, power in powers if power != 0.0)
        return "*".join(factors) or "1"

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


#: One factor of a term: a symbol and its power.
_FACTOR = re.compile(r"(A|omega)(?:\^(-?\d+(?:\.\d+)?))?")


def term_powers(name: str) -> tuple[float, float] | None:
    """(m, n) of a term A^m*omega^n by its name, such as ``A^2*omega``; None for another name."""
    if name == "1":
        return 0.0, 0.0
    powers = {"A": 0.0, "omega": 0.0}
    for text in name.split("*"):
        factor = _FACTOR.fullmatch(text)
        if factor is None:
            return None
        powers[factor[1]] += float(factor[2] or 1.0)
    return powers["A"], powers["omega"]
