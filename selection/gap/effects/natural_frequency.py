"""The simulation's natural frequency is off by more than three times its tolerance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from selection.arrays import Floats
from selection.gap.effects.form import Effect, Form, Scales
from selection.gap.terms import Terms


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """omega_n times 1 + ``relative``."""
    return replace(terms, omega_n=terms.omega_n * (1.0 + table["relative"]))


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: relative error beyond 3 tolerances, above or below."""
    return _side(scales, 1.0), _side(scales, -1.0)


def _side(scales: Scales, sign: float) -> Form:
    least = 3.0 * scales.frequency

    def change(terms: Terms, beyond: Floats) -> Terms:
        return replace(terms, omega_n=scales.omega_n * (1.0 + sign * (least + beyond)))

    def report(beyond: Floats) -> dict[str, Floats]:
        return {"relative": sign * (least + beyond)}

    natural = scales.bandwidth
    return Form("natural-frequency", change, report, natural, largest=0.3, label=f"{sign:+.0f}", replaces="frequency")


NATURAL_FREQUENCY = Effect(
    name="natural-frequency",
    kind="parameter",
    sentence="the natural frequency is off by more than its tolerance",
    forms=forms,
    simulate=simulate,
    keys=("relative",),
    need="sweep",
)
