"""Masses without a name in the library: of the mode, of what was added, and one that varies with the motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.effects.contract import Drive, Effect, Form, Scales, Terms
from damping.effects.forces import adds_force
from damping.forces.contract import AveragedForce
from damping.forces.joints import Spring
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape


def mass_forms(_: Scales) -> tuple[Form, ...]:
    """Strength: ln of the mass over the simulated one, of either sign."""
    return OTHER_MASS.either_sign(_report_ratio, natural=0.05, largest=1.5)


def _report_ratio(log_ratio: Floats) -> dict[str, Floats]:
    return {"relative": np.expm1(log_ratio)}


OTHER_MASS = Effect(
    name="other-mass",
    kind="parameter",
    sentence="a generalized mass that is off by more than its tolerance",
    forms=mass_forms,
    simulate=lambda terms, table: terms._replace(M=terms.M * (1.0 + table["relative"])),
    need="masses",  # at one mass it is a gain
)


def added_forms(_: Scales) -> tuple[Form, ...]:
    """Strength: ln of what the added masses are over what is stated, of either sign."""
    return OTHER_ADDED_MASS.either_sign(_report_ratio, natural=0.05, largest=1.5)


def simulate_added(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """Every added mass times 1 + ``relative``, as where it sits beside the antinode; a base shakes it too."""

    def received(drive: Drive) -> Floats:
        shaken = np.asarray(drive.shaken)
        return np.log1p(
            table["relative"] * np.where(shaken > 0.0, drive.added / np.maximum(shaken + drive.added, 1e-300), 0.0)
        )

    return terms.plus(beside=lambda drive: -table["relative"] * drive.added * np.square(drive.omega), received=received)


OTHER_ADDED_MASS = Effect(
    name="other-added-mass",
    kind="instrument",
    sentence="added mass that is not as stated",
    forms=added_forms,
    simulate=simulate_added,
    need="masses",
)


@dataclass(frozen=True)
class VaryingMass(AveragedForce, Spring):
    """Inertia that grows with the motion as m q^2: m (q^2 q'' + q q'^2), as of a beam whose end moves along.

    S = -(1/2) m A^3 omega^2. Its first harmonic is that of a cubic spring but for omega^2, which bends the same way at
    every mass; its third one is three times as large (Crespo da Silva and Glynn 1978).
    """

    name: ClassVar[str] = "varying-mass"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("coefficient", FORCE * TIME**2.0 / LENGTH**3.0),)

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S and dS/d ln A = 3 S."""
        S = -0.5 * self.coefficient * (A * A * A) * np.square(omega)
        return S, 3.0 * S

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """(1/2) m A^3 omega^2, real: -S."""
        return np.asarray(-self.restoring(A, omega)[0] + 0j)


@dataclass(frozen=True)
class CarriedMass(AveragedForce, Spring):
    """Inertia that grows with the motion as m |q|: m |q| q'', as of a fluid that is carried along.

    S = -(8/(3 pi)) m A^2 omega^2 (Keulegan and Carpenter 1958); first and third harmonic are those of a spring as q |q|
    but for omega^2.
    """

    name: ClassVar[str] = "carried-mass"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("coefficient", FORCE * TIME**2.0 / LENGTH**2.0),)

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S and dS/d ln A = 2 S."""
        S = -8.0 / (3.0 * np.pi) * self.coefficient * (A * A) * np.square(omega)
        return S, 2.0 * S

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """(8/(15 pi)) m A^2 omega^2, real: -S/5."""
        return np.asarray(-0.2 * self.restoring(A, omega)[0] + 0j)


def varying_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the stiffness that the inertia is worth at the largest amplitude; as m q^2 or as m |q|, either sign."""

    def of_power(power: float) -> tuple[Form, Form]:
        def report(stiffness: Floats) -> dict[str, Floats]:
            return {"coefficient": stiffness / (scales.omega_n**2 * scales.A_high**power), "power": power}

        return VARYING_MASS.either_sign(report, f"{power:g}", natural=scales.loss, largest=scales.stiffness)

    return of_power(2.0) + of_power(1.0)


VARYING_MASS = Effect(
    name="varying-mass",
    kind="force",
    sentence="a mass that varies with the motion",
    forms=varying_forms,
    simulate=adds_force(lambda table: (VaryingMass if table["power"] > 1.0 else CarriedMass)(table["coefficient"])),
    need="beyond",
)
