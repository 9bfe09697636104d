"""Causes outside the library that imitate those in it: other powers, a film, falling friction, lag, a warm spring."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.effects.contract import Drive, Effect, Form, FormVariable, Scales, Terms
from damping.effects.forces import adds_force
from damping.forces.contract import Force, GrowingForce, spread, zeros
from damping.forces.joints import CubicStiffness
from damping.forces.powers import VelocityPower
from damping.forces.shapes import FORCE, LENGTH, TIME, Shape, coefficient_in

#: Power of velocity, or of displacement, of a damping force outside the library.
_POWER = FormVariable.between(0.3, 8.0, starts=(-1.0, 0.4, 1.4))
#: Tangent of the lag of a relaxing force at resonance: from almost a dashpot to almost a spring.
_LAG = FormVariable.between(0.2, 5.0)
#: What the largest motion leaves of a film, over that motion: nearly touching, to a film that hardly feels it.
_LEFT = FormVariable.between(0.03, 1.5)
_CLOSEST = 0.99  #: largest amplitude over the thickness of a film at which its force is evaluated


@dataclass(frozen=True)
class DisplacementPower(Force):
    """g = R |q|^m sgn q', hysteresis at any speed: energy per cycle 4 R A^(m+1)/(m+1). Cases: 0 friction, 1 case II."""

    coefficient: Floats
    exponent: Floats

    name: ClassVar[str] = "displacement-power"
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE / LENGTH ** "exponent"), Shape("exponent", above=0.0))

    @property
    def energy_exponents(self) -> tuple[Floats, Floats]:
        """(m + 1, 0)."""
        return self.exponent + 1.0, 0.0

    def quadrature(self, A: Floats, omega: Floats) -> Floats:
        """C = (4/pi) R A^m/(m + 1)."""
        return spread((4.0 / np.pi) * self.coefficient * A**self.exponent / (self.exponent + 1.0), omega)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """R |q|^m sgn q'."""
        return sign * self.coefficient * np.abs(q) ** self.exponent


#: Damping forces of one power, by what it is a power of.
POWERS: dict[str, type[VelocityPower | DisplacementPower]]
POWERS = {"velocity": VelocityPower, "displacement": DisplacementPower}


def power_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: C/A at the largest amplitude. Shape: the power of velocity, or that of displacement."""

    def form(of: str) -> Form:
        def report(loss: Floats, power: Floats) -> dict[str, Floats]:
            unit = POWERS[of](np.ones_like(power), power).quadrature(scales.A_high, scales.omega_n) / scales.A_high
            return {"coefficient": loss / unit, of: power}

        return ANY_POWER.form(report, scales.loss, shapes=(_POWER,))

    return tuple(map(form, POWERS))


ANY_POWER = Effect(
    name="any-power",
    kind="force",
    sentence="a damping force with another power of velocity or displacement",
    forms=power_forms,
    simulate=adds_force(
        lambda table: next(force(table["coefficient"], table[of]) for of, force in POWERS.items() if of in table)
    ),
)


@dataclass(frozen=True)
class SqueezedFilm(GrowingForce):
    """A film of thickness h between plates, one of which moves by q: c q'/(1 - q/h)^3 (Reynolds 1886).

    Films on both sides, half as strong each, have the same first harmonic.
    """

    coefficient: Floats
    thickness: Floats

    name: ClassVar[str] = "squeezed-film"
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE * TIME / LENGTH), Shape("thickness", LENGTH, above=0.0))

    def grow(self, A: Floats, omega: Floats) -> tuple[Floats, Floats]:
        """C = c A omega/(1 - x^2)^(3/2), x = A/h, and dC/d ln A = C (1 + 2 x^2)/(1 - x^2)."""
        square = np.minimum(A / self.thickness, _CLOSEST) ** 2
        loss: Floats = self.coefficient * A * omega / (1.0 - square) ** 1.5
        return loss, loss * (1.0 + 2.0 * square) / (1.0 - square)

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """-3 i c A omega x^2 (1 + 3 r)/((1 + r) r)^3, r^2 = 1 - x^2: from the series of 1/(1 - x sin theta)^2."""
        square = np.minimum(A / self.thickness, _CLOSEST) ** 2
        r = np.sqrt(1.0 - square)
        return np.asarray(-3j * self.coefficient * A * omega * square * (1.0 + 3.0 * r) / ((1.0 + r) * r) ** 3)

    def g(self, q: Floats, speed: Floats, sign: Floats) -> Floats:
        """c q'/(1 - q/h)^3."""
        return sign * self.coefficient * speed / (1.0 - np.minimum(q / self.thickness, _CLOSEST)) ** 3


def film_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: C/A at the largest amplitude. Shape: what that amplitude leaves of the film, over the amplitude."""

    def report(loss: Floats, left: Floats) -> dict[str, Floats]:
        thickness = scales.A_high * (1.0 + left)
        unit = SqueezedFilm(1.0, thickness).quadrature(scales.A_high, scales.omega_n) / scales.A_high
        return {"coefficient": loss / unit, "thickness": thickness}

    return (SQUEEZED_FILM.form(report, scales.loss, shapes=(_LEFT,)),)


SQUEEZED_FILM = Effect(
    name="squeezed-film",
    kind="force",
    sentence="a film that is squeezed, whose damping grows without bound as the motion nears its thickness",
    forms=film_forms,
    simulate=adds_force(lambda table: SqueezedFilm(table["coefficient"], table["thickness"])),
)


@dataclass(frozen=True)
class FallingFriction(GrowingForce):
    """Friction that falls with speed, R sgn q'/(1 + (q'/v)^2), as of a film that begins to carry (Stribeck 1902)."""

    coefficient: Floats
    speed: Floats

    name: ClassVar[str] = "falling-friction"
    shapes: ClassVar[tuple[Shape, ...]] = (coefficient_in(FORCE), Shape("speed", LENGTH / TIME, above=0.0))

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
