"""Forces without a name in the library that imitate those with one: contact, other powers, a spring that warms up."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.effects.contract import Effect, Form, FormVariable, Scales
from damping.effects.forces import adds_force
from damping.forces.contract import ones, zeros
from damping.forces.joints import CubicStiffness, Spring
from damping.forces.powers import VelocityPower
from damping.forces.shapes import FORCE, LENGTH, Shape

#: Power of velocity of a damping force that is none of those above: 0.3 to 8.
_POWER = FormVariable.between(0.3, 8.0, starts=(-1.0, 0.4, 1.4))


@dataclass(frozen=True)
class Contact(Spring):
    """A spring that acts beyond a ``clearance`` on both sides; on one side it has half the first harmonic.

    S = k A (1 - (2/pi)(asin x + x sqrt(1 - x^2))), x = clearance/A, above the clearance (DenHartog 1931); else 0.
    """

    coefficient: Floats
    clearance: Floats

    name: ClassVar[str] = "contact"
    shapes: ClassVar[tuple[Shape, ...]] = (
        Shape("coefficient", FORCE / LENGTH, least=0.0),
        Shape("clearance", LENGTH, above=0.0),
    )

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S, and dS/d ln A = S + (4/pi) k A x sqrt(1 - x^2)."""
        x = np.minimum(self.clearance / A, 1.0)
        root = np.sqrt(1.0 - x * x)
        k = self.coefficient * A * ones(omega)
        S: Floats = k * (1.0 - (2.0 / np.pi) * (np.arcsin(x) + x * root))
        return S, S + (4.0 / np.pi) * k * x * root

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """k (q - clip(q, -clearance, clearance))."""
        return self.coefficient * (q - np.clip(q, -self.clearance, self.clearance))


def contact_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the stiffness. Shape: the clearance, within the measured amplitudes."""
    place = FormVariable.between(0.1 * scales.A_low, 0.9 * scales.A_high, starts=(-1.0, 0.0, 0.8, 1.6))

    def report(stiffness: Floats, clearance: Floats) -> dict[str, Floats]:
        return {"coefficient": stiffness, "clearance": clearance}

    return (CONTACT.form(report, scales.loss, shapes=(place,), largest=3.0 * scales.stiffness),)


CONTACT = Effect(
    name="contact",
    kind="force",
    sentence="a spring that acts beyond a clearance",
    forms=contact_forms,
    simulate=adds_force(lambda table: Contact(table["coefficient"], table["clearance"])),
    need="sweep",
)


def power_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: C/A at the largest amplitude. Shape: the power of velocity."""

    def report(loss: Floats, power: Floats) -> dict[str, Floats]:
        unit = VelocityPower(np.ones_like(power), power).quadrature(scales.A_high, scales.omega_n) / scales.A_high
        return {"coefficient": loss / unit, "exponent": power}

    return (ANY_POWER.form(report, scales.loss, shapes=(_POWER,)),)


ANY_POWER = Effect(
    name="any-power",
    kind="force",
    sentence="a damping force with another power of velocity",
    forms=power_forms,
    simulate=adds_force(lambda table: VelocityPower(table["coefficient"], table["exponent"])),
)


@dataclass(frozen=True)
class SlowSpring(CubicStiffness):
    """A spring whose stiffness follows the mean square of the motion, K + (3/4) k A^2, as one that warms up.

    Its first harmonic is that of a cubic spring; it has no third, since the stiffness is the same all through a cycle.
    That holds of averages over cycles: ``g`` is the cubic spring's, and no model with this one is integrated in time.
    """

    name: ClassVar[str] = "slow-spring"

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """Zero: the force is k A^2 q with A constant over a cycle."""
        return zeros(A, omega).astype(np.complex128)


def slow_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the force at the largest amplitude over that amplitude, of either sign."""

    def report(stiffness: Floats) -> dict[str, Floats]:
        return {"coefficient": stiffness / scales.A_high**2}

    return SLOW_SPRING.either_sign(report, natural=scales.loss, largest=scales.stiffness)


SLOW_SPRING = Effect(
    name="slow-spring",
    kind="force",
    sentence="a stiffness that follows the mean square of the motion",
    forms=slow_forms,
    simulate=adds_force(lambda table: SlowSpring(table["coefficient"])),
    need="third",
)
