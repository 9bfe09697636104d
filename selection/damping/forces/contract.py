"""The one contract of every damping force: its first-harmonic averages over a steady cycle.

Over the steady cycle q = A sin(theta), q' = A omega cos(theta) (Eqs 2.3.3, 2.3.4) a force g has the averages

    S(A, omega) = (1/pi) int_0^{2 pi} g sin(theta) d theta     in phase with displacement
    C(A, omega) = (1/pi) int_0^{2 pi} g cos(theta) d theta     in phase with velocity (quadrature)

and from them follow the energy per cycle pi A C (Eq 2.3.2), the damping term G (Eq 4.2.2), the resonant amplitude at
a force F (C = F) and the complex stiffness K - M omega^2 + (S + i C)/A.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from damping.arrays import FloatArray, Floats


class Force(ABC):
    """A force g(q, q') described by its first-harmonic averages.

    Parameters are the fields of the (frozen dataclass) subclass: numbers or arrays that broadcast with ``A`` and
    ``omega``. The averages are proportional to the first field. ``A`` is the amplitude of the displacement and
    ``omega`` the frequency in rad/s, both positive; results have the broadcast shape of parameters, A and omega.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """Name in files and on the command line, such as ``viscous``."""

    @property
    @abstractmethod
    def label(self) -> str:
        """Name for people, such as ``viscous (case I)``."""

    @property
    @abstractmethod
    def formula(self) -> str:
        """The force as plain text, such as ``C1 q'``."""

    @abstractmethod
    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C(A, omega), the first-harmonic part in phase with velocity; unit of force."""

    @abstractmethod
    def slope(self, A: Floats, omega: Floats) -> Floats:
        """dC/d ln A in closed form; unit of force."""

    @abstractmethod
    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """The force itself at the angle ``theta`` of the steady cycle q = A sin(theta)."""

    @property
    def energy_exponents(self) -> tuple[Floats, Floats] | None:
        """(m, n) when the energy per cycle is a constant times A^m omega^n, else ``None``."""
        return None

    def in_phase(self, A: Floats, omega: Floats) -> Floats:
        """S(A, omega), the first-harmonic part in phase with displacement; zero for a pure damping force."""
        return zeros(A, omega)

    def in_phase_slope(self, A: Floats, omega: Floats) -> Floats:
        """dS/d ln A in closed form."""
        return zeros(A, omega)


def zeros(*arrays: Floats) -> FloatArray:
    """Zeros of the broadcast shape of ``arrays``."""
    return np.zeros(np.broadcast_shapes(*(np.shape(array) for array in arrays)))


def ones(*arrays: Floats) -> FloatArray:
    """Ones of the broadcast shape of ``arrays``."""
    return np.ones(np.broadcast_shapes(*(np.shape(array) for array in arrays)))


@dataclass(frozen=True)
class Sum(Force):
    """Forces acting together: averages, slopes and cycles add (section 5.1). The empty sum is no force."""

    forces: tuple[Force, ...]

    #: What joins the names of the parts.
    JOINT: ClassVar[str] = " + "

    @property
    def name(self) -> str:
        """Names of the parts joined by ``+``."""
        return self.JOINT.join(force.name for force in self.forces) or "none"

    @property
    def label(self) -> str:
        """Labels of the parts joined by ``+``."""
        return self.JOINT.join(force.label for force in self.forces) or "none"

    @property
    def formula(self) -> str:
        """Formulas of the parts joined by ``+``."""
        return self.JOINT.join(force.formula for force in self.forces) or "0"

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' C."""
        return sum((force.quadrature(A, omega) for force in self.forces), start=zeros(A, omega))

    def slope(self, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' dC/d ln A."""
        return sum((force.slope(A, omega) for force in self.forces), start=zeros(A, omega))

    def cycle(self, theta: Floats, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' cycles."""
        return sum((force.cycle(theta, A, omega) for force in self.forces), start=zeros(theta, A, omega))

    def in_phase(self, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' S."""
        return sum((force.in_phase(A, omega) for force in self.forces), start=zeros(A, omega))

    def in_phase_slope(self, A: Floats, omega: Floats) -> Floats:
        """Sum of the parts' dS/d ln A."""
        return sum((force.in_phase_slope(A, omega) for force in self.forces), start=zeros(A, omega))

    @property
    def energy_exponents(self) -> tuple[Floats, Floats] | None:
        """The parts' common exponents when there is just one part, else ``None``."""
        return self.forces[0].energy_exponents if len(self.forces) == 1 else None
