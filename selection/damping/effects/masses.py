"""Wrong masses outside the library: of the mode, of added masses, and one that varies with the motion."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from damping.arrays import ComplexArray, FloatArray, Floats
from damping.effects.contract import Drive, Effect, Form, Scales, Terms
from damping.effects.forces import adds_force
from damping.forces.contract import AveragedForce
from damping.forces.joints import Spring
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape


def _list_ratios(effect: Effect) -> tuple[Form, ...]:
    """Strength: ln of actual over stated mass, of either sign: 5 % is usual, a factor of 4.5 beyond all sense."""
    return effect.either_sign(lambda log_ratio: {"relative": np.expm1(log_ratio)}, natural=0.05, largest=1.5)


OTHER_MASS: Effect = Effect(
    name="other-mass",
    kind="parameter",
    sentence="a generalized mass that differs by more than its tolerance",
    forms=lambda _: _list_ratios(OTHER_MASS),
    simulate=lambda terms, table: terms._replace(M=terms.M * (1.0 + table["relative"])),
    need="masses",  # at one mass it is a gain
)


def share_of_structure(drive: Drive) -> FloatArray:
    """Share of the structure, beside added masses, in the mass that a base shakes; 1 where a force drives."""
    shaken = np.asarray(drive.shaken)
    return np.where(shaken > 0.0, shaken / np.maximum(shaken + drive.added, 1e-300), 1.0)


def simulate_added(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """Every added mass times 1 + ``relative``, as where it is not at the antinode; a base shakes it too."""

    def received(drive: Drive) -> Floats:
        return np.log1p(table["relative"] * (1.0 - share_of_structure(drive)))

    return terms.plus(beside=lambda drive: -table["relative"] * drive.added * np.square(drive.omega), received=received)


OTHER_ADDED_MASS: Effect = Effect(
    name="other-added-mass",
    kind="instrument",
    sentence="an added mass that differs from the stated one",
    forms=lambda _: _list_ratios(OTHER_ADDED_MASS),
    simulate=simulate_added,
    need="masses",
)


#: By power p of a varying mass: -S over m A^(p+1) omega^2, and the third harmonic over -S.
_HARMONICS = {2.0: (0.5, 1.0), 1.0: (8.0 / (3.0 * np.pi), 0.2)}


@dataclass(frozen=True)
class VaryingMass(AveragedForce, Spring):
    """Inertia that grows with the motion: m (q^2 q'' + q q'^2) of power 2, m |q| q'' of power 1.

    The first is that of a beam whose end moves along (Crespo da Silva and Glynn 1978), the second that of an entrained
    fluid (Keulegan and Carpenter 1958). First harmonics are those of springs as q^3 and q |q| except for omega^2, with
    the same bend at every mass. Third harmonics are three times, and as large as, those of the springs.
    """

    power: float

    name: ClassVar[str] = "varying-mass"
    shapes: ClassVar[tuple[Shape, ...]] = (
        Shape("coefficient", FORCE * TIME**2.0 / LENGTH / LENGTH ** "power"),
        Shape("power", above=0.0),
    )

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S and dS/d ln A = (p + 1) S: see `_HARMONICS`."""
        S = -_HARMONICS[self.power][0] * self.coefficient * A ** (self.power + 1.0) * np.square(omega)
        return S, (self.power + 1.0) * S

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """A share of -S, real: see `_HARMONICS`."""
        return np.asarray(-_HARMONICS[self.power][1] * self.restoring(A, omega)[0] + 0j)


def varying_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: inertia as a stiffness at the largest amplitude; of power 2 or 1, of either sign."""

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
    simulate=adds_force(lambda table: VaryingMass(table["coefficient"], float(table["power"]))),
    need="beyond",
)
