"""Damping forces beside the simulated ones: II, III, IV, q^2 q' and Coulomb friction, each by its coefficient."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from selection.arrays import Floats
from selection.forces.contract import Force
from selection.forces.coulomb import Coulomb
from selection.forces.displacement import Displacement
from selection.forces.displacement_velocity import DisplacementVelocity
from selection.forces.quadratic_displacement import QuadraticDisplacement
from selection.forces.velocity_squared import VelocitySquared
from selection.gap.effects.form import Effect, Form, Scales
from selection.gap.terms import Terms


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
