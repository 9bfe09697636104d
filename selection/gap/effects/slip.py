"""An elastic joint that slips beyond an amplitude (bilinear hysteresis, Fig. 2.4c)."""

from __future__ import annotations

from collections.abc import Mapping

from selection.arrays import Floats
from selection.forces.slip import Slip
from selection.gap.effects.form import Effect, Form, Scales, Shape
from selection.gap.terms import Terms


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
