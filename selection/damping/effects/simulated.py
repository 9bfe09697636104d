"""Errors of a simulated damping force: less or more of it, or another law in its place."""

from collections.abc import Callable, Mapping
from math import log1p
from typing import Any, cast

import numpy as np

from damping.arrays import ComplexArray, Floats
from damping.effects.contract import Effect, Form, Scales, Terms
from damping.forces import force_class
from damping.forces.contract import Force, zeros
from damping.forces.powers import Displacement, Viscous
from damping.forces.shapes import Shape

#: |ln| of factors on damping from which fits start; larger ones are reached from there.
_FACTORS = (0.3, 1.0, 2.0, 4.0)
_MOST_FACTOR = 12.0  #: |ln| that no factor on damping reaches (160 000), to keep numbers finite
#: Prior of the size of damping of another law: a strength has a factor of 4.5 (standard deviation 1.5 of its ln); to
#: this power, a factor of 1.6.
_KNOWN_SIZE = 1.0 / 3.0
RELATIVE = Shape("relative", above=-1.0)  #: true over simulated value, less 1; the true value is positive


def factor_forms(effect: Effect, simulated: Mapping[str, float], scales: Scales) -> tuple[Form, Form]:
    """The two forms of a factor on a ``simulated`` force, above or below 1: its |ln| is 3 tolerances plus the strength.

    The report holds ``relative`` and, for an effect that is a force, the force that it adds or subtracts.
    """
    least = log1p(3.0 * scales.damping)
    leading, build = next(iter(simulated)), cast("Callable[..., Force]", force_class(effect.damping))

    def part(share: Floats) -> dict[str, Floats]:
        return {**simulated, leading: simulated[leading] * share}

    def change(terms: Terms, beyond: Floats) -> Terms:
        return _exchange(terms, effect.damping, build(**part(np.exp(beyond + np.copysign(least, beyond)))))

    def report(beyond: Floats) -> dict[str, Floats]:
        relative = np.expm1(beyond + np.copysign(least, beyond))
        return ({} if effect.corrects else part(relative)) | {"relative": relative}

    # neither side mirrors the other: both begin at 3 tolerances
    options: dict[str, Any] = {"largest": _MOST_FACTOR, "replaces": effect.damping, "sizes": _FACTORS, "mirror": ""}
    return effect.either_sign(report, change=change, **options)


def _exchange(terms: Terms, name: str, other: Force) -> Terms:
    """The terms with the simulated force called ``name`` replaced by another."""
    forces = (
        other if number < terms.simulated and force.name == name else force for number, force in enumerate(terms.forces)
    )
    return terms._replace(forces=tuple(forces))


def less_forms(effect: Effect, scales: Scales) -> tuple[Form, ...]:
    """The form for a simulated force of this effect that is too large; none where it is not simulated."""
    simulated = scales.simulated.get(effect.damping)
    return factor_forms(effect, simulated, scales)[1:] if simulated else ()


class Structural(Displacement):
    """Damping proportional to displacement as of a material, k (1 + i eta): linear, without harmonics."""

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """Zero."""
        return zeros(A, omega).astype(np.complex128)


def instead_form(effect: Effect, kind: Callable[[Floats], Force], scales: Scales) -> Form:
    """The form of a force that replaces the simulated viscous one, as where damping is structural.

    Strength: its loss at the largest amplitude over that of the viscous force, to the power 1/``_KNOWN_SIZE``.
    """
    kind = Structural if kind is Displacement else kind
    viscous = Viscous(scales.viscous).quadrature(scales.A_high, scales.omega_n)
    equal = float(viscous) / float(kind(1.0).quadrature(scales.A_high, scales.omega_n))

    def change(terms: Terms, strength: Floats) -> Terms:
        return _exchange(terms, Viscous.name, kind(equal * strength**_KNOWN_SIZE))

    def report(strength: Floats) -> dict[str, Floats]:
        return {"coefficient": equal * strength**_KNOWN_SIZE, "instead": 1.0}

    return Form(effect.name, change, report, replaces=Viscous.name, whole=True)
