"""Planar coupling: the drive excites two close modes in principal planes at an angle (Eqs 3.1.24-3.1.35)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import tan

import numpy as np

from selection.arrays import Floats
from selection.gap.effects.form import Effect, Form, Scales, Shape
from selection.gap.terms import Plane, Terms

#: Damping of the second plane over that of the first: the report takes them equal; a tenth more or less is usual.
DAMPING = Shape(centre=1.0, width=0.1, starts=(0.0,))


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: tan^2(theta). Shape: |omega_y/omega_p - 1|, a fraction of the bandwidth to the edge of the band.

    A force that is missing in the simulation may act in the first plane only, or in both.
    """
    low = 0.2 * scales.bandwidth
    apart = Shape.between(low, max(1.5 * scales.reach, 8.0 * low), starts=(-1.5, -0.75, 0.0, 0.75, 1.5))
    return tuple(_side(apart, sign, False, _side(apart, sign, True)) for sign in (1.0, -1.0))


def _side(apart: Shape, sign: float, alike: bool, twin: Form | None = None) -> Form:
    def change(terms: Terms, weight: Floats, distance: Floats, damping: Floats) -> Terms:
        return replace(terms, plane=Plane(weight, 1.0 + sign * distance, alike, damping))

    def report(weight: Floats, distance: Floats, damping: Floats) -> dict[str, Floats]:
        values = {"angle": np.arctan(np.sqrt(weight)), "frequency_ratio": 1.0 + sign * distance}
        values |= {"damping_ratio": damping}
        return values | ({"alike": 1.0} if alike else {})

    label = ("above" if sign > 0.0 else "below") + (", damped alike" if alike else "")
    return Form("planar-coupling", change, report, 0.3, (apart, DAMPING), largest=30.0, label=label, twin=twin)


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The second plane of a table ``angle`` (rad), ``frequency_ratio``, ``damping_ratio`` (1 if absent).

    With ``alike`` all forces act in it too.
    """
    damping = table.get("damping_ratio", 1.0)
    return replace(terms, plane=Plane(tan(table["angle"]) ** 2, table["frequency_ratio"], "alike" in table, damping))


PLANAR_COUPLING = Effect(
    name="planar-coupling",
    kind="structure",
    sentence="the drive excites two close modes in principal planes at an angle",
    forms=forms,
    simulate=simulate,
    keys=("angle", "frequency_ratio"),
    options=("damping_ratio", "alike"),
    need="sweep",
)
