"""In-phase contribution of other modes or of rigid-body motion (section 3.1, Eqs 3.1.13-3.1.20)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from selection.arrays import FloatArray, Floats
from selection.gap.effects.form import Effect, Form, Scales, Shape
from selection.gap.terms import Terms

#: d ln R/d ln omega at omega_n: -2 of rigid-body motion, 2/(r^2 - 1) of a mode at r omega_n (-3 at r = 0.6, 1 at 1.7).
SLOPE = Shape(centre=-1.0, width=3.0, starts=(0.0,), linear=True)


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the residual compliance at omega_n, displacement per force, of either sign. Shape: its slope."""
    largest = 2.0 / scales.loss  # twice that of resonance
    return _side(1.0, largest), _side(-1.0, largest)


def _side(sign: float, largest: float) -> Form:
    def change(terms: Terms, compliance: Floats, slope: Floats) -> Terms:
        return added(terms, sign * compliance, slope)

    def report(compliance: Floats, slope: Floats) -> dict[str, Floats]:
        return {"compliance": sign * compliance, "slope": slope}

    return Form("residual-modes", change, report, 0.1 * largest, (SLOPE,), largest=largest, label=f"{sign:+.0f}")


def added(terms: Terms, compliance: Floats, slope: Floats) -> Terms:
    """R = compliance (1 + slope (omega/omega_n - 1)) beside the receptance of the mode."""
    centre = terms.omega_n

    def part(omega: FloatArray) -> Floats:
        return compliance * (1.0 + slope * (omega / centre - 1.0))

    return replace(terms, compliance=(*terms.compliance, part))


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The residual of a table ``compliance``, ``slope`` (0 if absent)."""
    return added(terms, table["compliance"], table.get("slope", 0.0))


RESIDUAL_MODES = Effect(
    name="residual-modes",
    kind="structure",
    sentence="other modes or rigid-body motion add an in-phase part",
    forms=forms,
    simulate=simulate,
    keys=("compliance",),
    options=("slope",),
    need="sweep",
)
