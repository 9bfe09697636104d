"""The gamma-function factors of section 4.3.

Velocity raised to a real power, Eq 4.3.3.

Displacement times velocity raised to a real power, Eq 4.3.4.

One term a A^m omega^n of an energy polynomial (Eq 5.1.2) as a force.

What follows from the averages of any force: energies, the damping term, equivalents, conversion factors.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt
from typing import ClassVar

import numpy as np
from scipy.special import gammaln

from damping.arrays import Floats
from damping.errors import AnalysisError
from damping.forces.contract import AveragedForce, Force, absolute
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape, Uniform, coefficient_in

#: Power of velocity, from 0 (Coulomb-like, case II) to 3; Table 2.I spans 0 to 2.
EXPONENT = Shape("exponent", above=0.0, prior=Uniform(0.0, 3.0), label="exponent of velocity")


def gamma_ratio(x: Floats, y: Floats) -> Floats:
    """Gamma(x)/Gamma(y) for positive arguments, without overflow."""
    return np.exp(gammaln(x) - gammaln(y))


def velocity_power_energy(p: Floats) -> Floats:
    """2 sqrt(pi) Gamma((p+2)/2)/Gamma((p+3)/2): the energy of Eq 4.3.6 over alpha A^(p+1) omega^p."""
    return 2.0 * sqrt(pi) * gamma_ratio((p + 2.0) / 2.0, (p + 3.0) / 2.0)


def displacement_velocity_power_energy(p: Floats) -> Floats:
    """2 Gamma((p+2)/2)/Gamma((p+4)/2) = 4/(p+2): the energy of Eq 4.3.7 over alpha A^(p+2) omega^p."""
    return 2.0 * gamma_ratio((p + 2.0) / 2.0, (p + 4.0) / 2.0)


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

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = p C."""
        return self.exponent * self.quadrature(A, omega)

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
        factor = displacement_velocity_power_energy(self.exponent) / pi
        return self.coefficient * factor * A * (A * omega) ** self.exponent

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A = (p + 1) C."""
        return (self.exponent + 1.0) * self.quadrature(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """alpha |q| |q'|^p sgn q'."""
        return sign * self.coefficient * absolute(q) * speed**self.exponent


@dataclass(frozen=True)
class EnergyTerm(AveragedForce):
    """The force whose energy per cycle is a A^m omega^n: C = (a/pi) A^(m-1) omega^n (Eqs 5.1.1, 5.1.2).

    For terms of a polynomial that no force of the catalogue gives.
    """

    coefficient: Floats
    amplitude_power: float
    frequency_power: float

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """The coefficient; the powers are no parameters."""
        return (coefficient_in(FORCE * LENGTH ** (1.0 - self.amplitude_power) * TIME**self.frequency_power),)

    @property
    def resonates(self) -> bool:
        """Whether C grows with amplitude."""
        return self.amplitude_power > 1.0

    @property
    def name(self) -> str:
        """The term as typed in a polynomial, such as ``A^2*omega``."""
        parts = [_describe_power("A", self.amplitude_power), _describe_power("omega", self.frequency_power)]
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


#: One factor of a term: a symbol and its power.
_FACTOR = re.compile(r"(A|omega)(?:\^(-?\d+(?:\.\d+)?))?")


def term_powers(name: str) -> tuple[float, float] | None:
    """(m, n) of a term A^m*omega^n by its name, such as ``A^2*omega``; None where it is none."""
    if name == "1":
        return 0.0, 0.0
    powers = {"A": 0.0, "omega": 0.0}
    for text in name.split("*"):
        factor = _FACTOR.fullmatch(text)
        if factor is None:
            return None
        powers[factor[1]] += float(factor[2] or 1.0)
    return powers["A"], powers["omega"]


def _describe_power(symbol: str, power: float) -> str:
    if power == 0.0:
        return ""
    return symbol if power == 1.0 else f"{symbol}^{power:g}"


__all__ = [
    "B",
    "beta",
    "coefficient_from_energy",
    "damping_term",
    "energy_content",
    "energy_factor",
    "energy_per_cycle",
    "equivalent_viscous",
]


def energy_per_cycle(force: Force, A: Floats, omega: Floats) -> Floats:
    """Delta W per cycle = int g dq = pi A C(A, omega) (Eq 2.3.2, Table 2.II)."""
    return pi * A * force.quadrature(A, omega)


def energy_content(force: Force, A: Floats, omega: Floats, M: Floats) -> Floats:
    """Psi = Delta W/(M (A omega)^2), the loss over twice the largest kinetic energy (Eq 2.3.5, Table 2.II)."""
    return energy_per_cycle(force, A, omega) / (M * (A * omega) ** 2)


def damping_term(force: Force, A: Floats, omega: Floats, M: Floats, omega_n: Floats) -> Floats:
    """G = Delta W/(pi M omega_n^2 A^2) = C/(M omega_n^2 A), the damping term of Eq 4.2.4 and Table 4.III.

    The printed integral 4.2.2 and the factor of 4.2.5 are wrong (errata E422, E425); this is what Table 4.III holds.
    """
    return force.quadrature(A, omega) / (M * omega_n**2 * A)


def equivalent_viscous(force: Force, A: Floats, omega: Floats) -> Floats:
    """The viscous coefficient of equal energy per cycle, Delta W/(pi A^2 omega) = C/(A omega) (Eq 4.3.1)."""
    return force.quadrature(A, omega) / (A * omega)


def energy_factor(kind: type[Force], **others: Floats) -> Floats:
    """Energy per cycle over coefficient A^m omega^n, such as 8/3 of case III (Table 2.II).

    ``others`` are the parameters beside the coefficient (``exponent`` of the power laws).

    Raises:
        AnalysisError: the energy of this force is no product of powers (slip).
    """
    if kind.energy_exponents is Force.energy_exponents:
        raise AnalysisError("the energy per cycle of this force is no single product of powers of A and omega")
    build: Callable[..., Force] = kind
    return energy_per_cycle(build(1.0, **others), 1.0, 1.0)


def coefficient_from_energy(kind: type[Force], a: Floats, **others: Floats) -> Floats:
    """The force's coefficient from that of its energy term a A^m omega^n: C = a/energy_factor (Table 5.I).

    Raises:
        AnalysisError: the energy of this force is no product of powers (slip).
    """
    return a / energy_factor(kind, **others)
