"""The contract of every damping force: its first-harmonic averages over a steady cycle.

Over the steady cycle q = A sin(theta), q' = A omega cos(theta) (Eqs 2.3.3, 2.3.4) a force g has the averages

    S(A, omega) = (1/pi) int_0^{2 pi} g sin(theta) d theta     in phase with displacement
    C(A, omega) = (1/pi) int_0^{2 pi} g cos(theta) d theta     in phase with velocity (quadrature)

They give the energy per cycle pi A C (Eq 2.3.2), the damping term G (Eq 4.2.2), the resonant amplitude at a force F
(C = F) and the complex stiffness K - M omega^2 + (S + i C)/A.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import reduce
from operator import add
from typing import ClassVar, NoReturn

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats
from damping.errors import AnalysisError
from damping.forces.shapes import Shape

#: Points of half a cycle, of which the other half is the opposite: the third harmonic of friction is right to 1 %.
_THETA = np.pi * (np.arange(24) + 0.5).reshape(-1, 1, 1) / 24
_THIRD: ComplexArray = 2j * np.exp(-3j * _THETA[:, 0, 0]) / 24


@dataclass(frozen=True)
class Joint:
    """A spring of ``stiffness`` in series with a slider that holds up to ``stiffness`` times ``limit``."""

    stiffness: Floats
    limit: Floats

    def stretch(self, start: float, travel: float) -> float:
        """Stretch of the spring after a one-way ``travel`` from the stretch ``start``."""
        return float(min(self.limit, max(-self.limit, start + travel)))


class Force(ABC):
    """A force g(q, q') described by its first-harmonic averages and properties.

    Parameters are the fields of the (frozen dataclass) subclass: numbers or arrays that broadcast with ``A`` and
    ``omega``. The averages are proportional to the first field. ``A`` is the amplitude of the displacement and
    ``omega`` the frequency in rad/s, both positive; results have the broadcast shape of parameters, A and omega.
    """

    #: Whether the force is C q', the simulated damping where nothing else is known (3.1.28).
    viscous: ClassVar[bool] = False
    #: Whether the force may be a term of a sum: one with a free exponent would imitate the other terms.
    sums: ClassVar[bool] = True
    #: Of a force that is no term of sums: the other forces of its candidate law.
    beside: ClassVar[tuple[str, ...]] = ()

    @property
    @abstractmethod
    def shapes(self) -> tuple[Shape, ...]:
        """Its parameters, in the order of the fields."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in files and on the command line, such as ``viscous``."""

    @property
    def label(self) -> str:
        """Name for people, such as ``viscous (case I)``; by default ``name``."""
        return self.name

    @property
    def formula(self) -> str:
        """The force as plain text, such as ``C1 q'``; by default ``name``."""
        return self.name

    @abstractmethod
    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C(A, omega), the first-harmonic part in phase with velocity; unit of force."""

    @abstractmethod
    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """The force in time at the displacement ``q`` and the velocity ``sign`` times ``speed``, without its joints.

        ``sign`` is 1 or -1, so that friction is defined where the velocity is zero; numbers or arrays that broadcast.
        """

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C and dC/d ln A in closed form: (m - 1) C where the energy is a A^m omega^n; others override it."""
        C, exponents = self.quadrature(A, omega), self.energy_exponents
        assert exponents is not None, f"{self.name} states neither energy_exponents nor grow"
        return C, (exponents[0] - 1.0) * C

    def averages(self, A: Floats, omega: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """C, dC/d ln A, S and dS/d ln A together."""
        return *self.grow(A, omega), *(self.restoring(A, omega) if self.restores else (0.0, 0.0))

    @property
    def joints(self) -> tuple[Joint, ...]:
        """Springs with sliders, which have memory and act in addition to `g`; by default none."""
        return ()

    @property
    def restores(self) -> bool:
        """Whether the force has a part in phase with displacement."""
        return type(self).restoring is not Force.restoring

    @property
    def resonates(self) -> bool:
        """Whether the force alone can set a resonant amplitude: C changes with amplitude."""
        return True

    @property
    def linear(self) -> bool:
        """Whether the averages are proportional to amplitude."""
        exponents = self.energy_exponents
        return not self.restores and exponents is not None and bool(np.all(np.asarray(exponents[0]) == 2.0))

    @property
    def parts(self) -> tuple[Force, ...]:
        """The forces of a sum; of a single force, itself."""
        return (self,)

    def scale(self, A: Floats, omega: Floats) -> Floats:
        """Characteristic size of the force at amplitude A, never zero: C."""
        return self.quadrature(A, omega)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """The force at the angle ``theta`` of the steady cycle q = A sin(theta), including joints in their steady loop.

        A joint's spring is stretched by min(limit, A) at the turning points, and slips at the limit.
        """
        q, cosine = A * np.sin(theta), np.cos(theta)
        force = self.g(q, A * omega * np.abs(cosine), np.sign(cosine)) + zeros(theta, A, omega)
        turning_side = np.where(cosine < 0.0, 1.0, -1.0)  # last turning point at q = +A or -A
        for joint in self.joints:
            stretch = turning_side * np.minimum(joint.limit, A) + (q - turning_side * A)
            force = force + joint.stiffness * np.clip(stretch, -joint.limit, joint.limit)
        return force

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """Phasor of the third harmonic, 2i times the mean over the cycle of the force and exp(-3 i theta); (batch, n).

        Where the energy is a product of powers, cycles at all A and omega have one form.
        """
        if self.energy_exponents is None:
            return np.asarray(np.tensordot(_THIRD, np.asarray(self.cycle(_THETA, A, omega)), 1))
        first = np.asarray(A)[..., :1], np.asarray(omega)[..., :1]
        size = self.quadrature(*first)
        harmonic = np.tensordot(_THIRD, np.asarray(self.cycle(_THETA, *first)), 1)
        return np.asarray(harmonic / np.where(size == 0.0, 1.0, size) * self.quadrature(A, omega))

    @property
    def energy_exponents(self) -> tuple[Floats, Floats] | None:
        """(m, n) when the energy per cycle is a constant times A^m omega^n, else ``None``."""
        return None

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S and dS/d ln A in closed form; zero for a pure damping force."""
        return zeros(A, omega), zeros(A, omega)

    def in_phase(self, A: Floats, omega: Floats) -> Floats:
        """S(A, omega), the first-harmonic part in phase with displacement."""
        return self.restoring(A, omega)[0]


@dataclass(frozen=True)
class CoefficientForce(Force):
    """A force with one parameter, the coefficient to which it is proportional."""

    coefficient: Floats


class GrowingForce(Force):
    """A force that computes C and dC/d ln A together, in `grow`."""

    @abstractmethod
    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C and dC/d ln A."""

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C: see `grow`."""
        return self.grow(A, omega)[0]


class AveragedForce(Force):
    """A force known only by its averages; its cycle is the equivalent viscous one, C cos(theta)."""

    def g(self, q: Floats, speed: Floats, sign: Floats) -> NoReturn:
        """AnalysisError: there is no law in time."""
        raise AnalysisError(f"{self.label} has no law in the time domain: its energy per cycle alone is known")

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """C cos(theta)."""
        return self.quadrature(A, omega) * np.cos(theta)


def zeros(*arrays: Floats) -> FloatArray:
    """Zeros of the broadcast shape of ``arrays``."""
    return np.zeros(np.broadcast_shapes(*(np.shape(array) for array in arrays)))


def absolute(x: Floats) -> Floats:
    """|x|; for a float without numpy, which is slow in the equation of motion."""
    return abs(x) if isinstance(x, float) else np.abs(x)


def spread(values: Floats, omega: Floats) -> Floats:
    """Values broadcast with omega."""
    shape = np.broadcast_shapes(np.shape(values), np.shape(omega))
    return values if shape == np.shape(values) else values * np.ones(shape)


def _add(values: list[Floats], A: Floats, omega: Floats) -> Floats:
    """The sum of values, or zeros of the shape of A and omega if there are none."""
    return reduce(add, values) if values else zeros(A, omega)


@dataclass(frozen=True)
class Sum(Force):
    """Forces acting together: averages, slopes and cycles add (section 5.1). The empty sum is no force."""

    forces: tuple[Force, ...]

    shapes: ClassVar[tuple[Shape, ...]] = ()  #: a sum has no parameters besides those of its parts

    @property
    def name(self) -> str:
        """Names of the parts joined by ``+``."""
        return " + ".join(force.name for force in self.forces) or "none"

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' C."""
        return _add([force.quadrature(A, omega) for force in self.forces], A, omega)

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """Sums of the parts' C and dC/d ln A."""
        grown = [force.grow(A, omega) for force in self.forces]
        return _add([C for C, _ in grown], A, omega), _add([slope for _, slope in grown], A, omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """Sum of the parts' g."""
        return sum(force.g(q, speed, sign) for force in self.forces)

    @property
    def joints(self) -> tuple[Joint, ...]:
        """The joints of all parts."""
        return tuple(joint for force in self.forces for joint in force.joints)

    @property
    def restores(self) -> bool:
        """Whether some part restores."""
        return any(force.restores for force in self.forces)

    @property
    def resonates(self) -> bool:
        """Whether some part resonates."""
        return any(force.resonates for force in self.forces)

    @property
    def linear(self) -> bool:
        """Whether all parts are linear."""
        return all(force.linear for force in self.forces)

    @property
    def parts(self) -> tuple[Force, ...]:
        """The parts of all forces."""
        return tuple(part for force in self.forces for part in force.parts)

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' cycles."""
        return sum((force.cycle(theta, A, omega) for force in self.forces), start=zeros(theta, A, omega))

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """Sums of the parts' S and dS/d ln A."""
        pairs = [force.restoring(A, omega) for force in self.forces]
        return _add([S for S, _ in pairs], A, omega), _add([slope for _, slope in pairs], A, omega)

    @property
    def energy_exponents(self) -> tuple[Floats, Floats] | None:
        """The exponents of a single part, else ``None``."""
        return self.forces[0].energy_exponents if len(self.forces) == 1 else None
