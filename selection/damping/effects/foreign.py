"""Causes outside the library that imitate those in it: contact, other powers, lag, a warming spring."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.effects.contract import Drive, Effect, Form, FormVariable, Scales, Terms
from damping.effects.forces import adds_force
from damping.forces.contract import GrowingForce, spread, zeros
from damping.forces.joints import CubicStiffness, Spring
from damping.forces.powers import VelocityPower
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape

#: Power of velocity of a damping force outside the library.
_POWER = FormVariable.between(0.3, 8.0, starts=(-1.0, 0.4, 1.4))
#: Tangent of the lag of a relaxing force at resonance: from almost a dashpot to almost a spring.
_LAG = FormVariable.between(0.2, 5.0)

#: Displacement at which a force beyond a gap begins to act.
CLEARANCE = Shape("clearance", LENGTH, above=0.0)


def _act_beyond(linear: Floats, x: Floats) -> tuple[Floats, Floats]:
    """w (1 - (2/pi)(asin x + x r)), r = sqrt(1 - x^2), x = clearance/A, and its derivative by ln A.

    A linear force of average w ~ A has this one if it acts beyond a clearance only, a spring from 0 (DenHartog 1931).
    """
    x = np.minimum(x, 1.0)
    root = np.sqrt(1.0 - x * x)
    average: Floats = linear * (1.0 - (2.0 / np.pi) * (np.arcsin(x) + x * root))
    return average, average + (4.0 / np.pi) * linear * x * root


@dataclass(frozen=True)
class Contact(Spring):
    """A spring that acts beyond a ``clearance`` on both sides; acting on one side, it has half the first harmonic."""

    coefficient: Floats
    clearance: Floats

    name: ClassVar[str] = "contact"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("coefficient", FORCE / LENGTH, least=0.0), CLEARANCE)

    def restoring(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """S and dS/d ln A: `_act_beyond` of k A."""
        return _act_beyond(spread(self.coefficient * A, omega), self.clearance / A)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """k (q - clip(q, -clearance, clearance))."""
        return self.coefficient * (q - np.clip(q, -self.clearance, self.clearance))


@dataclass(frozen=True)
class Rub(GrowingForce):
    """Friction that acts beyond a ``clearance`` only: energy per cycle 4 R (A - clearance)."""

    coefficient: Floats
    clearance: Floats

    name: ClassVar[str] = "rub"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("coefficient", FORCE, least=0.0), CLEARANCE)

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = (4/pi) R (1 - x), x = clearance/A, and dC/d ln A = (4/pi) R x above the clearance; else 0."""
        saturation, x = (4.0 / np.pi) * self.coefficient, self.clearance / A
        return spread(saturation * (1.0 - np.minimum(x, 1.0)), omega), spread(
            np.asarray(saturation * x * (x < 1.0)), omega
        )

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """-i (4/(3 pi)) R (1 + sin 3 theta), sin theta = clearance/A: 0 below it, that of friction far above."""
        x = np.minimum(self.clearance / A, 1.0)
        size = spread(self.coefficient * (1.0 + 3.0 * x - 4.0 * x**3), omega)
        return np.asarray(-4j / (3.0 * np.pi) * size)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """R sgn q' where abs(q) > clearance."""
        return np.where(np.abs(q) > self.clearance, sign * self.coefficient, 0.0)


@dataclass(frozen=True)
class LooseDashpot(GrowingForce):
    """A dashpot that acts beyond a ``clearance`` only, as with backlash."""

    coefficient: Floats
    clearance: Floats

    name: ClassVar[str] = "loose-dashpot"
    shapes: ClassVar[tuple[Shape, ...]] = (Shape("coefficient", FORCE * TIME / LENGTH, least=0.0), CLEARANCE)

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C and dC/d ln A: `_act_beyond` of c A omega."""
        return _act_beyond(self.coefficient * A * omega, self.clearance / A)

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """i times that of cos 3 theta, -(4/pi) c A omega x (1 - x^2)^(3/2): 0 far above the clearance, and below it."""
        x = np.minimum(self.clearance / A, 1.0)
        return np.asarray(-4j / np.pi * self.coefficient * A * omega * x * (1.0 - x * x) ** 1.5)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """c q' where abs(q) > clearance."""
        return np.where(np.abs(q) > self.clearance, sign * speed * self.coefficient, 0.0)


def _build_beyond(
    force: type[Contact | Rub | LooseDashpot], sentence: str, natural: Callable[[Scales], float], **rest: Any
) -> Effect:
    """The effect of a force that acts beyond a clearance within the measured amplitudes.

    Strength: the coefficient, of scale ``natural``. Shape: the clearance. ``rest``: fields of `Form` by the scales.
    """

    def report(coefficient: Floats, clearance: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient, "clearance": clearance}

    def forms(scales: Scales) -> tuple[Form, ...]:
        clearance = FormVariable.between(0.1 * scales.A_low, 0.9 * scales.A_high, starts=(-1.0, 0.0, 0.8, 1.6))
        options = {name: of(scales) for name, of in rest.items()}
        return (effect.form(report, natural(scales), shapes=(clearance,), **options),)

    simulate = adds_force(lambda table: force(table["coefficient"], table["clearance"]))
    effect = Effect(force.name, "force", sentence, forms, simulate, need="sweep")
    return effect


CONTACT = _build_beyond(
    Contact,
    "a spring that acts beyond a clearance",
    lambda scales: scales.loss,
    largest=lambda scales: 3.0 * scales.stiffness,
)
RUB = _build_beyond(Rub, "friction that acts beyond a clearance", lambda scales: scales.loss * scales.A_high)
LOOSE_DASHPOT = _build_beyond(
    LooseDashpot, "a damper that acts beyond a clearance", lambda scales: scales.loss / scales.omega_n
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
class FallingFriction(GrowingForce):
    """Friction that falls with speed, R sgn q'/(1 + (q'/v)^2), as of a film that begins to carry (Stribeck 1902)."""

    coefficient: Floats
    speed: Floats

    name: ClassVar[str] = "falling-friction"
    shapes: ClassVar[tuple[Shape, ...]] = (
        Shape("coefficient", FORCE, least=0.0),
        Shape("speed", LENGTH / TIME, above=0.0),
    )

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = (4/pi) R h, h = asinh(x)/(x sqrt(1 + x^2)), x = A omega/v, and dC/d ln A = (4/pi) R dh/d ln x."""
        x = A * omega / self.speed
        square = x * x
        h = np.arcsinh(x) / (x * np.sqrt(1.0 + square))
        friction = (4.0 / np.pi) * self.coefficient
        return friction * h, friction * (1.0 - h * (1.0 + 2.0 * square)) / (1.0 + square)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """R sgn q'/(1 + (q'/v)^2)."""
        return sign * self.coefficient / (1.0 + (speed / self.speed) ** 2)


def falling_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the friction. Shape: the speed at which half of it remains."""
    fastest = scales.A_high * scales.omega_n
    shapes = (FormVariable.between(0.1 * fastest, fastest),)

    def report(friction: Floats, speed: Floats) -> dict[str, Floats]:
        return {"coefficient": friction, "speed": speed}

    return (FALLING_FRICTION.form(report, scales.loss * scales.A_high, shapes=shapes),)


FALLING_FRICTION = Effect(
    name="falling-friction",
    kind="force",
    sentence="friction that falls with speed",
    forms=falling_forms,
    simulate=adds_force(lambda table: FallingFriction(table["coefficient"], table["speed"])),
)


@dataclass(frozen=True)
class SlowSpring(CubicStiffness):
    """A spring whose stiffness follows the mean square of the motion, K + (3/4) k A^2, as of a spring that warms up.

    Its first harmonic is that of a cubic spring. It has no third, since the stiffness is constant over a cycle. ``g``
    is that of the cubic spring: no model with this force is integrated in time.
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


def lag_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the loss over A at resonance. Shape: tangent of the lag there."""

    def report(loss: Floats, lag: Floats) -> dict[str, Floats]:
        return {"stiffness": loss * (lag + 1.0 / lag), "time": lag / scales.omega_n}

    return (MEMORY.form(report, scales.loss, shapes=(_LAG,)),)


def simulate_memory(terms: Terms, table: Mapping[str, Floats]) -> Terms:
    """Z plus k i omega tau/(1 + i omega tau): a spring k in series with a dashpot k tau (Maxwell), as of rubber."""
    stiffness, time = table["stiffness"], table["time"]

    def part(drive: Drive) -> Floats:
        turned = 1j * drive.omega * time
        return np.asarray(stiffness * turned / (1.0 + turned))

    return terms.plus(beside=part)


MEMORY = Effect(
    name="memory",
    kind="structure",
    sentence="a force that lags the motion, as in rubber or a fluid, and adds stiffness and damping",
    forms=lag_forms,
    simulate=simulate_memory,
    need="sweep",  # at resonance alone it is a damper
)


#: Foreign causes that count once (`damping.effects.FOREIGN`).
SINGLE = (SLOW_SPRING, RUB, LOOSE_DASHPOT, FALLING_FRICTION, MEMORY)
