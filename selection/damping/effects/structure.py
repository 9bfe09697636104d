"""The simulation's viscous coefficient is off by more than three times its tolerance.

The simulation's natural frequency is off by more than three times its tolerance.

Planar coupling: the drive excites two close modes in principal planes at an angle (Eqs 3.1.24-3.1.35).

In-phase contribution of other modes or of rigid-body motion (section 3.1, Eqs 3.1.13-3.1.20).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import tan

import numpy as np

from damping.arrays import FloatArray, Floats
from damping.effects.contract import Effect, Form, FormVariable, Scales
from damping.effects.terms import Plane, Terms
from damping.forces.polynomial import Viscous
from damping.forces.shapes import FORCE, LENGTH, Shape

#: True value over the simulated one, less 1; the value itself is positive.
RELATIVE = Shape("relative", above=-1.0)


def simulate_viscous(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The viscous force times 1 + ``relative``."""
    factor = 1.0 + table["relative"]
    forces = (replace(f, coefficient=f.coefficient * factor) if isinstance(f, Viscous) else f for f in terms.forces)
    return replace(terms, forces=tuple(forces))


def viscous_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: relative error beyond 3 tolerances, above or below. No form without simulated viscous damping."""
    if scales.viscous == 0.0:
        return ()
    least = 3.0 * scales.damping
    above = _viscous_side(scales, 1.0, 5.0)
    return (above, _viscous_side(scales, -1.0, 0.98 - least)) if least < 0.9 else (above,)


def _viscous_side(scales: Scales, sign: float, largest: float) -> Form:
    least = 3.0 * scales.damping

    def change(terms: Terms, beyond: Floats) -> Terms:
        c = Viscous(scales.viscous * (1.0 + sign * (least + beyond)))
        return replace(terms, forces=(c, *(f for f in terms.forces if not isinstance(f, Viscous))))

    def report(beyond: Floats) -> dict[str, Floats]:
        return {"relative": sign * (least + beyond)}

    return Form(
        "viscous-coefficient", change, report, natural=0.1, largest=largest, label=f"{sign:+.0f}", replaces=Viscous.name
    )


VISCOUS_COEFFICIENT = Effect(
    name="viscous-coefficient",
    kind="parameter",
    sentence="the viscous coefficient is off by more than its tolerance",
    forms=viscous_forms,
    simulate=simulate_viscous,
    shapes=(RELATIVE,),
    corrects=Viscous.name,
)


def simulate_frequency(terms: Terms, table: Mapping[str, float]) -> Terms:
    """omega_n times 1 + ``relative``."""
    return replace(terms, omega_n=terms.omega_n * (1.0 + table["relative"]))


def frequency_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: relative error beyond 3 tolerances, above or below."""
    return _frequency_side(scales, 1.0), _frequency_side(scales, -1.0)


def _frequency_side(scales: Scales, sign: float) -> Form:
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
    forms=frequency_forms,
    simulate=simulate_frequency,
    shapes=(RELATIVE,),
    corrects="frequency",
    need="sweep",
)


#: Damping of the second plane over that of the first: the report takes them equal; a tenth more or less is usual.
DAMPING = FormVariable(centre=1.0, width=0.1, starts=(0.0,))


def planar_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: tan^2(theta). Shape: |omega_y/omega_p - 1|, a fraction of the bandwidth to the edge of the band.

    A force that is missing in the simulation may act in the first plane only, or in both.
    """
    low = 0.2 * scales.bandwidth
    apart = FormVariable.between(low, max(1.5 * scales.reach, 8.0 * low), starts=(-1.5, -0.75, 0.0, 0.75, 1.5))
    return tuple(_planar_side(apart, sign, False, _planar_side(apart, sign, True)) for sign in (1.0, -1.0))


def _planar_side(apart: FormVariable, sign: float, alike: bool, twin: Form | None = None) -> Form:
    def change(terms: Terms, weight: Floats, distance: Floats, damping: Floats) -> Terms:
        return replace(terms, plane=Plane(weight, 1.0 + sign * distance, alike, damping))

    def report(weight: Floats, distance: Floats, damping: Floats) -> dict[str, Floats]:
        values = {"angle": np.arctan(np.sqrt(weight)), "frequency_ratio": 1.0 + sign * distance}
        values |= {"damping_ratio": damping}
        return values | ({"alike": 1.0} if alike else {})

    label = ("above" if sign > 0.0 else "below") + (", damped alike" if alike else "")
    return Form("planar-coupling", change, report, 0.3, (apart, DAMPING), largest=30.0, label=label, twin=twin)


def simulate_planar(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The second plane of a table ``angle`` (rad), ``frequency_ratio``, ``damping_ratio``.

    With ``alike`` other than 0 all forces act in it too.
    """
    alike = table["alike"] != 0.0
    plane = Plane(tan(table["angle"]) ** 2, table["frequency_ratio"], alike, table["damping_ratio"])
    return replace(terms, plane=plane)


PLANAR_COUPLING = Effect(
    name="planar-coupling",
    kind="structure",
    sentence="the drive excites two close modes in principal planes at an angle",
    forms=planar_forms,
    simulate=simulate_planar,
    shapes=(
        Shape("angle"),
        Shape("frequency_ratio", above=0.0),
        Shape("damping_ratio", least=0.0, default=1.0),
        Shape("alike", least=0.0, default=0.0),
    ),
    need="sweep",
)


#: d ln R/d ln omega at omega_n: -2 of rigid-body motion, 2/(r^2 - 1) of a mode at r omega_n (-3 at r = 0.6, 1 at 1.7).
SLOPE = FormVariable(centre=-1.0, width=3.0, starts=(0.0,), linear=True)


def residual_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: the residual compliance at omega_n, displacement per force, of either sign. Shape: its slope."""
    largest = 2.0 / scales.loss  # twice that of resonance
    return _residual_side(1.0, largest), _residual_side(-1.0, largest)


def _residual_side(sign: float, largest: float) -> Form:
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


def simulate_residual(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The residual of a table ``compliance``, ``slope``."""
    return added(terms, table["compliance"], table["slope"])


RESIDUAL_MODES = Effect(
    name="residual-modes",
    kind="structure",
    sentence="other modes or rigid-body motion add an in-phase part",
    forms=residual_forms,
    simulate=simulate_residual,
    shapes=(Shape("compliance", LENGTH / FORCE), Shape("slope", default=0.0)),
    need="sweep",
)
