"""Force drop-out: near resonance the real force falls below the recorded one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from selection.arrays import FloatArray, Floats
from selection.gap.effects.form import Effect, Form, Scales, Shape
from selection.gap.terms import Terms

#: Shape of the notch over the distance from resonance in widths: 1 at resonance, 0 far away.
NOTCHES: dict[str, Callable[[Floats], Floats]] = {
    "gaussian": lambda x: np.exp(-0.5 * np.square(x)),
    "lorentzian": lambda x: 1.0 / (1.0 + np.square(x)),
}


def notched(terms: Terms, depth: Floats, width: Floats, notch: str) -> Terms:
    """The force times 1 - depth notch((omega/omega_n - 1)/width)."""
    centre = terms.omega_n

    def received(omega: FloatArray) -> Floats:
        return np.log1p(-depth * NOTCHES[notch]((omega / centre - 1.0) / width))

    return replace(terms, received=(*terms.received, received))


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: depth/(1 - depth). Shape: the width over omega_n, from half the bandwidth to the band measured."""
    width = Shape.between(0.5 * scales.bandwidth, max(scales.reach, 4.0 * scales.bandwidth), (-1.0, 0.0, 1.0))
    return tuple(_form(notch, width) for notch in NOTCHES)


def _form(notch: str, width: Shape) -> Form:
    def change(terms: Terms, strength: Floats, width: Floats) -> Terms:
        return notched(terms, strength / (1.0 + strength), width, notch)

    def report(strength: Floats, width: Floats) -> dict[str, Floats]:
        kind = {"lorentzian": 1.0} if notch == "lorentzian" else {}
        return {"depth": strength / (1.0 + strength), "width": width} | kind

    return Form("force-dropout", change, report, 0.2, (width,), largest=20.0, label=notch)


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The notch of a table ``depth``, ``width`` (over omega_n), Gaussian unless it has ``lorentzian``."""
    return notched(terms, table["depth"], table["width"], "lorentzian" if "lorentzian" in table else "gaussian")


FORCE_DROPOUT = Effect(
    name="force-dropout",
    kind="instrument",
    sentence="the real force falls below the recorded one near resonance",
    forms=forms,
    simulate=simulate,
    keys=("depth", "width"),
    options=("lorentzian",),
    need="sweep",
)
