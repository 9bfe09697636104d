"""All phases are off by one constant: a filter or a charge amplifier, the rotation of the shaker's reference."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from selection.arrays import Floats
from selection.gap.effects.form import Effect, Form, Scales
from selection.gap.terms import Terms


def forms(scales: Scales) -> tuple[Form, ...]:
    """Strength: |lag|, at most 1 rad, of either sign."""
    return _side(1.0), _side(-1.0)


def _side(sign: float) -> Form:
    def change(terms: Terms, lag: Floats) -> Terms:
        return replace(terms, lag=terms.lag + sign * lag)

    def report(lag: Floats) -> dict[str, Floats]:
        return {"lag": sign * lag}

    return Form("phase-lag", change, report, 0.1, largest=1.0, label=f"{sign:+.0f}")


def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
    """``lag`` (rad) is added to every phase."""
    return replace(terms, lag=terms.lag + table["lag"])


PHASE_LAG = Effect(
    name="phase-lag",
    kind="instrument",
    sentence="all phases are off by one constant",
    forms=forms,
    simulate=simulate,
    keys=("lag",),
    need="phase",
)
