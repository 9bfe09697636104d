"""All amplitudes are off by one factor: the gain of a sensor, or the reference of the mode shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import log

import numpy as np

from selection.arrays import Floats
from selection.gap.effects.form import Effect, Form, Scales
from selection.gap.terms import Terms


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |ln(factor)|, at most that of a factor 3, above or below 1."""
    return _side(1.0), _side(-1.0)


def _side(sign: float) -> Form:
    def change(terms: Terms, size: Floats) -> Terms:
        return replace(terms, gain=terms.gain + sign * size)

    def report(size: Floats) -> dict[str, Floats]:
        return {"factor": np.exp(sign * size)}

    return Form("amplitude-scale", change, report, 0.1, largest=log(3.0), label=f"{sign:+.0f}")


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The reading is ``factor`` times the displacement."""
    return replace(terms, gain=terms.gain + log(table["factor"]))


AMPLITUDE_SCALE = Effect(
    name="amplitude-scale",
    kind="instrument",
    sentence="all amplitudes are off by one factor (sensor gain)",
    forms=forms,
    simulate=simulate,
    keys=("factor",),
)
