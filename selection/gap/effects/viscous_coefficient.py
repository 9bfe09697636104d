"""The simulation's viscous coefficient is off by more than three times its tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from selection.arrays import Floats
from selection.forces.viscous import Viscous
from selection.gap.effects.form import Effect, Form, Scales
from selection.gap.terms import Terms


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The viscous force times 1 + ``relative``."""
    factor = 1.0 + table["relative"]
    forces = (Viscous(f.coefficient * factor) if isinstance(f, Viscous) else f for f in terms.forces)
    return replace(terms, forces=tuple(forces))


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: relative error beyond 3 tolerances, above or below. No form without simulated viscous damping."""
    if scales.viscous == 0.0:
        return ()
    least = 3.0 * scales.damping
    return (_side(scales, 1.0, 5.0), _side(scales, -1.0, 0.98 - least)) if least < 0.9 else (_side(scales, 1.0, 5.0),)


def _side(scales: Scales, sign: float, largest: float) -> Form:
    least = 3.0 * scales.damping

    def change(terms: Terms, beyond: Floats) -> Terms:
        c = Viscous(scales.viscous * (1.0 + sign * (least + beyond)))
        return replace(terms, forces=(c, *(f for f in terms.forces if not isinstance(f, Viscous))))

    def report(beyond: Floats) -> dict[str, Floats]:
        return {"relative": sign * (least + beyond)}

    return Form(
        "viscous-coefficient", change, report, natural=0.1, largest=largest, label=f"{sign:+.0f}", replaces="viscous"
    )


VISCOUS_COEFFICIENT = Effect(
    name="viscous-coefficient",
    kind="parameter",
    sentence="the viscous coefficient is off by more than its tolerance",
    forms=forms,
    simulate=simulate,
    keys=("relative",),
)
