"""Causes outside the library: a spring, friction or a dashpot that acts beyond a clearance only."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.effects.contract import Effect, Form, FormVariable, Scales
from damping.effects.forces import adds_force
from damping.forces.contract import GrowingForce, spread
from damping.forces.joints import Spring, saturate
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape, coefficient_in

CLEARANCE = Shape("clearance", LENGTH, above=0.0)  #: displacement at which a force beyond a gap begins to act
_MOST_STIFFNESS = 3.0  #: largest stiffness beyond a clearance, over that of the structure


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
    """A spring that acts beyond a ``clearance`` on both sides; acting on one side, it has half the first harmonic.

    A negative coefficient is stiffness that is lost there, as where a preloaded joint opens.
    """

    coefficient: Floats
    clearance: Floats

    name: ClassVar[str] = "contact"
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE / LENGTH), CLEARANCE)

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
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE), CLEARANCE)

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = (4/pi) R (1 - x), x = clearance/A, and dC/d ln A = (4/pi) R x above the clearance; else 0."""
        return saturate((4.0 / np.pi) * self.coefficient, np.minimum(self.clearance / A, 1.0), omega)

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
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH), CLEARANCE)

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
    force: type[Contact | Rub | LooseDashpot], sentence: str, natural: Callable[[Scales], float], signed: bool = False
) -> Effect:
    """The effect of a force that acts beyond a clearance within the measured amplitudes.

    Strength: the coefficient, of scale ``natural``. Shape: the clearance. ``signed``: a stiffness of either sign.
    """

    def report(coefficient: Floats, clearance: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient, "clearance": clearance}

    def forms(scales: Scales) -> tuple[Form, ...]:
        clearance = FormVariable.between(0.1 * scales.A_low, 0.9 * scales.A_high, starts=(-1.0, 0.0, 0.8, 1.6))
        options: dict[str, Any] = {"natural": natural(scales), "shapes": (clearance,)}
        if signed:
            return effect.either_sign(report, largest=_MOST_STIFFNESS * scales.stiffness, **options)
        return (effect.form(report, **options),)

    simulate = adds_force(lambda table: force(table["coefficient"], table["clearance"]))
    effect = Effect(force.name, "force", sentence, forms, simulate, need="sweep")
    return effect


CONTACT = _build_beyond(
    Contact, "a spring that acts, or a joint that opens, beyond a clearance", lambda scales: scales.loss, signed=True
)
RUB = _build_beyond(Rub, "friction that acts beyond a clearance", lambda scales: scales.loss * scales.A_high)
LOOSE_DASHPOT = _build_beyond(
    LooseDashpot, "a damper that acts beyond a clearance", lambda scales: scales.loss / scales.omega_n
)
