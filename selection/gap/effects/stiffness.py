"""A restoring force with a cubic term or one like it, q |q|: the resonance bends to higher or to lower frequencies."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from selection.arrays import Floats
from selection.forces.contract import Force
from selection.forces.cubic_stiffness import CubicStiffness
from selection.gap.effects.form import Effect, Form, Scales
from selection.gap.effects.power_stiffness import PowerStiffness
from selection.gap.terms import Terms

#: Powers of the displacement that count as cubic or like it.
EXPONENTS = (3.0, 2.0)


def _effect(name: str, sign: float, sentence: str) -> Effect:
    """The effect of a spring of ``sign`` times its (positive) coefficient."""

    def change(exponent: float) -> Callable[..., Terms]:
        def apply(terms: Terms, coefficient: Floats) -> Terms:
            return terms.with_force(_spring(sign * coefficient, exponent))

        return apply

    def forms(scales: Scales) -> tuple[Form, ...]:
        return tuple(_form(name, change(p), p, scales) for p in EXPONENTS)

    def simulate(terms: Terms, table: Mapping[str, float]) -> Terms:
        return change(table.get("exponent", 3.0))(terms, table["coefficient"])

    return Effect(name, "force", sentence, forms, simulate, need="sweep", keys=("coefficient",), options=("exponent",))


def _form(name: str, change: Callable[..., Terms], exponent: float, scales: Scales) -> Form:
    per_amplitude = scales.A_high ** (1.0 - exponent)

    def report(coefficient: Floats) -> dict[str, Floats]:
        return {"coefficient": coefficient} | ({} if exponent == 3.0 else {"exponent": exponent})

    natural, largest = scales.loss * per_amplitude, scales.stiffness * per_amplitude
    return Form(name, change, report, natural, largest=largest, label=f"exponent {exponent:g}")


def _spring(coefficient: Floats, exponent: float) -> Force:
    return CubicStiffness(coefficient) if exponent == 3.0 else PowerStiffness(coefficient, exponent)


STIFFNESS_HARDENING = _effect("stiffness-hardening", 1.0, "the stiffness grows with amplitude")
STIFFNESS_SOFTENING = _effect("stiffness-softening", -1.0, "the stiffness falls with amplitude")
