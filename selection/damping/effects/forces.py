"""Damping forces beside the simulated ones: II, III, IV, q^2 q' and Coulomb friction, each by its coefficient.

An elastic joint that slips beyond an amplitude (bilinear hysteresis, Fig. 2.4c).

A restoring force with a cubic term or one like it, q |q|: the resonance bends to higher or to lower frequencies.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from damping.arrays import Floats
from damping.effects.contract import Effect, Form, FormVariable, Scales
from damping.effects.terms import Terms
from damping.forces.contract import Force
from damping.forces.joints import Coulomb, CubicStiffness, PowerStiffness, Slip
from damping.forces.polynomial import Displacement, DisplacementVelocity, QuadraticDisplacement, VelocitySquared
from damping.forces.shapes import FORCE, LENGTH, Shape


def _adds(force: Callable[[Mapping[str, float]], Force]) -> Callable[[Terms, Mapping[str, float]], Terms]:
    """The terms with the force that a table gives."""
    return lambda terms, table: terms.with_force(force(table))


def _coefficient_effect(name: str, kind: Callable[[Floats], Force], sentence: str) -> Effect:
    """The effect that adds a force of one coefficient."""
    unit = kind(1.0)

    def change(terms: Terms, coefficient: Floats) -> Terms:
        return terms.with_force(kind(coefficient))

    def report(coefficient: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient}

    def forms(scales: Scales) -> tuple[Form, ...]:
        per_coefficient = float(unit.quadrature(scales.A_high, scales.omega_n)) / scales.A_high
        return (Form(name, change, report, scales.loss / per_coefficient),)

    def force(table: Mapping[str, float]) -> Force:
        return kind(table["coefficient"])

    return Effect(name, "force", sentence, forms, _adds(force), unit.shapes, force, damping=unit.name)


DISPLACEMENT = _coefficient_effect(
    "displacement", Displacement, "damping in proportion to displacement (case II) is missing"
)
VELOCITY_SQUARED = _coefficient_effect(
    "velocity-squared", VelocitySquared, "damping with the square of velocity (III) is missing"
)
DISPLACEMENT_VELOCITY = _coefficient_effect(
    "displacement-velocity", DisplacementVelocity, "damping as |q| q' (case IV) is missing"
)
QUADRATIC_DISPLACEMENT = _coefficient_effect(
    "quadratic-displacement", QuadraticDisplacement, "damping as q^2 q' (V) is missing"
)
COULOMB_FRICTION = _coefficient_effect("coulomb-friction", Coulomb, "constant friction against velocity is missing")


def add_joint(terms: Terms, stiffness: Floats, limit: Floats) -> Terms:
    """One more slip joint: ``stiffness`` is lost beyond the amplitude ``limit``."""
    return terms.with_force(Slip(stiffness, limit))


def joint_values(stiffness: Floats, limit: Floats) -> dict[str, Floats]:
    """The parameters of the damping force."""
    return {"stiffness": stiffness, "limit": limit}


def joint_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the stiffness lost. Shape: the amplitude at which slip starts, within the measured ones."""
    limit = FormVariable.between(0.3 * scales.A_low, scales.A_high, starts=(-1.6, -0.8, 0.0, 0.6, 1.2, 1.7))
    return (Form("slip", add_joint, joint_values, scales.loss, (limit,), largest=scales.stiffness),)


def joint_force(table: Mapping[str, float]) -> Force:
    """The joint of a table ``stiffness``, ``limit``."""
    return Slip(table["stiffness"], table["limit"])


SLIP = Effect(
    name="slip",
    kind="force",
    sentence="an elastic joint slips",
    forms=joint_forms,
    simulate=_adds(joint_force),
    shapes=Slip.shapes,
    force=joint_force,
    damping=Slip.name,
)


#: Powers of the displacement that count as cubic or like it.
EXPONENTS = (3.0, 2.0)


def _stiffness_effect(name: str, sign: float, sentence: str, denied: str) -> Effect:
    """The effect of a spring of ``sign`` times its (positive) coefficient.

    With the one of the other sign, ``denied``, it would stand for a stiffness of another shape.
    """

    def change(exponent: float) -> Callable[..., Terms]:
        def apply(terms: Terms, coefficient: Floats) -> Terms:
            return terms.with_force(_spring(sign * coefficient, exponent))

        return apply

    def forms(scales: Scales) -> tuple[Form, ...]:
        return tuple(_form(name, change(p), p, scales) for p in EXPONENTS)

    def force(table: Mapping[str, float]) -> Force:
        return _spring(sign * table["coefficient"], table["exponent"])

    return Effect(
        name=name,
        kind="force",
        sentence=sentence,
        forms=forms,
        simulate=_adds(force),
        shapes=(
            Shape("coefficient", FORCE / LENGTH ** "exponent", least=0.0),
            Shape("exponent", above=0.0, default=3.0),
        ),
        force=force,
        need="sweep",
        denies=frozenset({denied}),
    )


def _form(name: str, change: Callable[..., Terms], exponent: float, scales: Scales) -> Form:
    per_amplitude = scales.A_high ** (1.0 - exponent)

    def report(coefficient: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient} | ({} if exponent == 3.0 else {"exponent": exponent})

    natural, largest = scales.loss * per_amplitude, scales.stiffness * per_amplitude
    return Form(name, change, report, natural, largest=largest, label=f"exponent {exponent:g}")


def _spring(coefficient: Floats, exponent: float) -> Force:
    return CubicStiffness(coefficient) if exponent == 3.0 else PowerStiffness(coefficient, exponent)


STIFFNESS_HARDENING = _stiffness_effect(
    "stiffness-hardening", 1.0, "the stiffness grows with amplitude", denied="stiffness-softening"
)
STIFFNESS_SOFTENING = _stiffness_effect(
    "stiffness-softening", -1.0, "the stiffness falls with amplitude", denied="stiffness-hardening"
)
