"""Damping forces beside the simulated ones: II, III, IV, q^2 q' and Coulomb friction, each by its coefficient.

An elastic joint that slips beyond an amplitude (bilinear hysteresis, Fig. 2.4c).

A restoring force with a cubic term or one like it, q |q|: the resonance bends to higher or to lower frequencies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from damping.arrays import Floats
from damping.forces.contract import Force
from damping.forces.joints import Coulomb, CubicStiffness, PowerStiffness, Slip
from damping.forces.polynomial import Displacement, DisplacementVelocity, QuadraticDisplacement, VelocitySquared
from damping.effects.contract import Effect, Form, Scales, Shape
from damping.effects.terms import Terms


def _effect(name: str, force: str, build: Callable[[Floats], Force], sentence: str) -> Effect:
    """The effect that adds the force that ``build`` makes of its coefficient."""

    def change(terms: Terms, coefficient: Floats) -> Terms:
        return terms.with_force(build(coefficient))

    def report(coefficient: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient}

    def forms(scales: Scales) -> tuple[Form, ...]:
        per_coefficient = float(build(1.0).quadrature(scales.A_high, scales.omega_n)) / scales.A_high
        return (Form(name, change, report, scales.loss / per_coefficient),)

    def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
        return change(terms, table["coefficient"])

    return Effect(name, "force", sentence, forms, simulate, force=force, keys=("coefficient",))


DISPLACEMENT = _effect(
    "displacement", "displacement", Displacement, "damping in proportion to displacement (case II) is missing"
)
VELOCITY_SQUARED = _effect(
    "velocity-squared", "velocity-squared", VelocitySquared, "damping with the square of velocity (III) is missing"
)
DISPLACEMENT_VELOCITY = _effect(
    "displacement-velocity", "displacement-velocity", DisplacementVelocity, "damping as |q| q' (case IV) is missing"
)
QUADRATIC_DISPLACEMENT = _effect(
    "quadratic-displacement", "quadratic-displacement", QuadraticDisplacement, "damping as q^2 q' (V) is missing"
)
COULOMB_FRICTION = _effect("coulomb-friction", "coulomb", Coulomb, "constant friction against velocity is missing")


def change(terms: Terms, stiffness: Floats, limit: Floats) -> Terms:
    """One more slip joint: ``stiffness`` is lost beyond the amplitude ``limit``."""
    return terms.with_force(Slip(stiffness, limit))


def report(stiffness: Floats, limit: Floats) -> dict[str, Floats]:
    """The parameters of the damping force."""
    return {"stiffness": stiffness, "limit": limit}


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the stiffness lost. Shape: the amplitude at which slip starts, within the measured ones."""
    limit = Shape.between(0.3 * scales.A_low, scales.A_high, starts=(-1.6, -0.8, 0.0, 0.6, 1.2, 1.7))
    return (Form("slip", change, report, scales.loss, (limit,), largest=scales.stiffness),)


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The joint of a table ``stiffness``, ``limit``."""
    return change(terms, table["stiffness"], table["limit"])


SLIP = Effect("slip", "force", "an elastic joint slips", forms, simulate, force="slip", keys=("stiffness", "limit"))


#: Powers of the displacement that count as cubic or like it.
EXPONENTS = (3.0, 2.0)


def _stiffness_effect(name: str, sign: float, sentence: str) -> Effect:
    """The effect of a spring of ``sign`` times its (positive) coefficient."""

    def change(exponent: float) -> Callable[..., Terms]:
        def apply(terms: Terms, coefficient: Floats) -> Terms:
            return terms.with_force(_spring(sign * coefficient, exponent))

        return apply

    def forms(scales: Scales) -> tuple[Form, ...]:
        return tuple(_form(name, change(p), p, scales) for p in EXPONENTS)

    def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
        return change(table.get("exponent", 3.0))(terms, table["coefficient"])

    return Effect(name, "force", sentence, forms, simulate, need="sweep", keys=("coefficient",), options=("exponent",))


def _form(name: str, change: Callable[..., Terms], exponent: float, scales: Scales) -> Form:
    per_amplitude = scales.A_high ** (1.0 - exponent)

    def report(coefficient: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient} | ({} if exponent == 3.0 else {"exponent": exponent})

    natural, largest = scales.loss * per_amplitude, scales.stiffness * per_amplitude
    return Form(name, change, report, natural, largest=largest, label=f"exponent {exponent:g}")


def _spring(coefficient: Floats, exponent: float) -> Force:
    return CubicStiffness(coefficient) if exponent == 3.0 else PowerStiffness(coefficient, exponent)


STIFFNESS_HARDENING = _stiffness_effect("stiffness-hardening", 1.0, "the stiffness grows with amplitude")
STIFFNESS_SOFTENING = _stiffness_effect("stiffness-softening", -1.0, "the stiffness falls with amplitude")
