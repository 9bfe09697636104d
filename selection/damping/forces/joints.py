"""Coulomb friction, the slip joint of Fig. 2.4c, and nonlinear springs."""

from abc import abstractmethod
from dataclasses import dataclass
from math import pi
from typing import ClassVar

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.forces.contract import CoefficientForce, GrowingForce, Joint, absolute, spread, zeros
from damping.forces.powers import velocity_power_energy
from damping.forces.shapes import FORCE, LENGTH, OfAmplitude, Shape, coefficient_in

#: Amplitude at which a joint starts to slip; far below or above the tested motion slip cannot be seen.
LIMIT = Shape("limit", LENGTH, above=0.0, prior=OfAmplitude(0.1, 1.0), label="slip limit")


class Coulomb(CoefficientForce):
    """g = R sgn q'; energy per cycle 4 R A (Eq 4.3.6 with p = 0). R in force.

    The first harmonic is the constant 4 R/pi, so friction alone has no resonant amplitude: a smaller force does not
    move the mode, a larger one moves it without bound.
    """

    name: ClassVar[str] = "coulomb"
    label: ClassVar[str] = "Coulomb friction"
    formula: ClassVar[str] = "R sgn q'"
    energy_exponents: ClassVar[tuple[float, float]] = (1.0, 0.0)
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE),)
    resonates: ClassVar[bool] = False

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = 4 R/pi at any amplitude and frequency."""
        return (4.0 / pi) * self.coefficient + zeros(A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """R sgn q'."""
        return sign * self.coefficient


def lose_stiffness(held: Floats) -> tuple[Floats, Floats]:
    """S/(k A) of a joint that slips, and its derivative by ln A, from ``held`` = A1/A <= 1: see `Slip.averages`.

    psi = pi - 2 asin sqrt(1 - A1/A), which is accurate where slip has just begun.
    """
    sine = 2.0 * np.sqrt(held * (1.0 - held))
    S = -(2.0 * np.arcsin(np.sqrt(1.0 - held)) + (1.0 - 2.0 * held) * sine) / pi
    return S, -(4.0 / pi) * held * sine


def saturate(most: Floats, held: Floats, omega: Floats) -> tuple[Floats, Floats]:
    """C = ``most`` (1 - held) and dC/d ln A of a force that acts above an amplitude; ``held`` is that over A, or 1."""
    return spread(most * (1.0 - held), omega), spread(np.asarray(most * held * (held < 1.0)), omega)


@dataclass(frozen=True)
class SlippingForce(GrowingForce):
    """Force of joints that slip, less that of the same joints stuck, ``stiffness`` times q.

    It is zero while they stick; the mode's frequency is that of the stuck state.
    """

    stiffness: Floats  #: k, what slip loses (force/length)
    limit: Floats  #: A1, the amplitude at which it starts or at which it is complete

    name: ClassVar[str] = "slip"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("stiffness", FORCE / LENGTH, least=0.0), LIMIT)

    @abstractmethod
    def averages(self, A: Floats, omega: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """C, dC/d ln A, S and dS/d ln A."""

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C and dC/d ln A: see `averages`."""
        return self.averages(A, omega)[:2]

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S and dS/d ln A: see `averages`."""
        _, _, S, slope = self.averages(A, omega)
        return spread(S, omega), spread(slope, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """-k q: the integrator adds the joints with their memory; here their stuck stiffness is subtracted."""
        return -self.stiffness * q

    @property
    def joints(self) -> tuple[Joint, ...]:
        """One joint of stiffness k that holds up to k A1."""
        return (Joint(self.stiffness, self.limit),)


@dataclass(frozen=True)
class Slip(SlippingForce):
    """One joint of stiffness k = K - K1 that sticks up to the amplitude A1.

    The joint follows the displacement with slope k between the forces -k A1 and k A1 and slips at either; its loop is a
    parallelogram of area 4 k A1 (A - A1), which is the energy per cycle (the printed Eq 2.4.3 is not: erratum E243).
    Both averages saturate: C tends to 4 k A1/pi.
    """

    label: ClassVar[str] = "slip joint (bilinear)"
    formula: ClassVar[str] = "bilinear joint of stiffness K - K1 that slips at A1"

    def averages(self, A: Floats, omega: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """C = 4 k A1 (A - A1)/(pi A), S = k A ((psi - sin psi cos psi)/pi - 1), cos psi = 1 - 2 A1/A, above A1; else 0.

        psi is the angle of a half cycle in which the joint sticks, pi without slip. dC/d ln A = 4 k A1^2/(pi A) above
        A1, dS/d ln A = S - (4/pi) k A1 sin psi.
        """
        held = self._held(A)
        size, (S, turned) = self.stiffness * A, lose_stiffness(held)
        return *saturate(self.scale(A, omega), held, omega), size * S, size * (S + turned)

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C and dC/d ln A: see `averages`."""
        return saturate(self.scale(A, omega), self._held(A), omega)

    def _held(self, A: Floats) -> Floats:
        """A1/A, 1 while the joint sticks."""
        return self.limit / np.maximum(A, self.limit)

    def scale(self, A: Floats, omega: Floats) -> Floats:
        """The saturation 4 k A1/pi: C is zero while the joint sticks."""
        return np.asarray(4.0 * self.stiffness * self.limit / pi)

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """-(i/(3 pi)) k A sin^2(psi) exp(-2 i psi), psi as in `averages`: the integral of the loop by parts."""
        held = self._held(A)
        squared = 4.0 * held * (1.0 - held)
        turned = (1.0 - 2.0 * held - 1j * np.sqrt(squared)) ** 2
        return np.asarray(-1j / (3.0 * pi) * self.stiffness * (A * squared) * turned)


class Spring(GrowingForce, CoefficientForce):
    """A force of the displacement alone: it bends the resonance and dissipates nothing."""

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = 0 and dC/d ln A = 0."""
        nothing = zeros(self.coefficient, A, omega)
        return nothing, nothing


class CubicStiffness(Spring):
    """g = k3 q^3, hardening for k3 > 0 and softening for k3 < 0: S = (3/4) k3 A^3, C = 0. k3 in force/length^3."""

    name: ClassVar[str] = "cubic-stiffness"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("coefficient", FORCE / LENGTH**3.0),)

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S = (3/4) k3 A^3 and dS/d ln A = 3 S."""
        S = spread(0.75 * self.coefficient * (A * A * A), omega)
        return S, 3.0 * S

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """k3 q^3."""
        return self.coefficient * q * q * q


@dataclass(frozen=True)
class PowerStiffness(Spring):
    """g = k |q|^p sgn q: S = k A^p B(p), B = 2 Gamma(p/2 + 1)/(sqrt(pi) Gamma((p + 3)/2)). k in force/length^p."""

    exponent: Floats

    name: ClassVar[str] = "power-stiffness"
    shapes: ClassVar[tuple[Shape, ...]] = (
        Shape("coefficient", FORCE / LENGTH ** "exponent"),
        Shape("exponent", above=0.0),
    )

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S = k B(p) A^p and dS/d ln A = p S."""
        S = spread(self.coefficient * velocity_power_energy(self.exponent) / np.pi * A**self.exponent, omega)
        return S, self.exponent * S

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """k |q|^p sgn q."""
        return self.coefficient * absolute(q) ** self.exponent * np.sign(q)
