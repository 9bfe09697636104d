"""All amplitudes are off by one factor: the gain of a sensor, or the reference of the mode shape.

All phases are off by one constant: a filter or a charge amplifier, the rotation of the shaker's reference.

Force drop-out: near resonance the real force falls below the recorded one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import log

import numpy as np

from damping.arrays import FloatArray, Floats
from damping.effects.contract import Effect, Form, FormVariable, Scales
from damping.effects.terms import Terms
from damping.forces.shapes import Shape


def gain_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |ln(factor)|, at most that of a factor 3, above or below 1."""
    return _gain_side(1.0), _gain_side(-1.0)


def _gain_side(sign: float) -> Form:
    def change(terms: Terms, size: Floats) -> Terms:
        return replace(terms, gain=terms.gain + sign * size)

    def report(size: Floats) -> dict[str, Floats]:
        return {"factor": np.exp(sign * size)}

    return Form("amplitude-scale", change, report, 0.1, largest=log(3.0), label=f"{sign:+.0f}")


def simulate_gain(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The reading is ``factor`` times the displacement."""
    return replace(terms, gain=terms.gain + log(table["factor"]))


AMPLITUDE_SCALE = Effect(
    name="amplitude-scale",
    kind="instrument",
    sentence="all amplitudes are off by one factor (sensor gain)",
    forms=gain_forms,
    simulate=simulate_gain,
    shapes=(Shape("factor", above=0.0),),
)


def lag_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |lag|, at most 1 rad, of either sign."""
    return _lag_side(1.0), _lag_side(-1.0)


def _lag_side(sign: float) -> Form:
    def change(terms: Terms, lag: Floats) -> Terms:
        return replace(terms, lag=terms.lag + sign * lag)

    def report(lag: Floats) -> dict[str, Floats]:
        return {"lag": sign * lag}

    return Form("phase-lag", change, report, 0.1, largest=1.0, label=f"{sign:+.0f}")


def simulate_lag(terms: Terms, table: Mapping[str, float]) -> Terms:
    """``lag`` (rad) is added to every phase."""
    return replace(terms, lag=terms.lag + table["lag"])


PHASE_LAG = Effect(
    name="phase-lag",
    kind="instrument",
    sentence="all phases are off by one constant",
    forms=lag_forms,
    simulate=simulate_lag,
    shapes=(Shape("lag"),),
    need="phase",
)


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


def dropout_forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: depth/(1 - depth). Shape: the width over omega_n, from half the bandwidth to the band measured."""
    width = FormVariable.between(0.5 * scales.bandwidth, max(scales.reach, 4.0 * scales.bandwidth), (-1.0, 0.0, 1.0))
    return tuple(_form(notch, width) for notch in NOTCHES)


def _form(notch: str, width: FormVariable) -> Form:
    def change(terms: Terms, strength: Floats, width: Floats) -> Terms:
        return notched(terms, strength / (1.0 + strength), width, notch)

    def report(strength: Floats, width: Floats) -> dict[str, Floats]:
        kind = {"lorentzian": 1.0} if notch == "lorentzian" else {}
        return {"depth": strength / (1.0 + strength), "width": width} | kind

    return Form("force-dropout", change, report, 0.2, (width,), largest=20.0, label=notch)


def simulate_dropout(terms: Terms, table: Mapping[str, float]) -> Terms:
    """The notch of a table ``depth``, ``width`` (over omega_n), Gaussian unless ``lorentzian`` is other than 0."""
    return notched(terms, table["depth"], table["width"], "lorentzian" if table["lorentzian"] else "gaussian")


FORCE_DROPOUT = Effect(
    name="force-dropout",
    kind="instrument",
    sentence="the real force falls below the recorded one near resonance",
    forms=dropout_forms,
    simulate=simulate_dropout,
    shapes=(
        Shape("depth", least=0.0, below=1.0),
        Shape("width", above=0.0),
        Shape("lorentzian", least=0.0, default=0.0),
    ),
    need="sweep",
)
