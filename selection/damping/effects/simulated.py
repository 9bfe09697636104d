"""What may be wrong with a simulated damping force: there is less of it or more, or another law acts in its place."""

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

#: |ln| of a factor on damping up to which fits are started; a strength beyond is reached from there.
_FACTORS = (0.3, 1.0, 2.0, 4.0)
#: |ln| that no factor on damping reaches: 160 000. It keeps numbers finite and binds nothing.
_MOST_FACTOR = 12.0
#: How well the size of damping is known whose law is another: a strength, known to a factor of 4.5 (one standard
#: deviation of its ln is 1.5), to this power is known to a factor of 1.6.
_KNOWN_SIZE = 1.0 / 3.0
#: True value over the simulated one, less 1; the value itself is positive.
RELATIVE = Shape("relative", above=-1.0)


def factor_forms(effect: Effect, simulated: Mapping[str, float], scales: Scales) -> tuple[Form, Form]:
    """The two forms of a factor on a ``simulated`` force, of either sign: its |ln| is 3 tolerances and the strength.

    Told is ``relative``, and of an effect that is a force the share of the simulated one that it adds or takes away.
    """
    least = log1p(3.0 * scales.damping)
    leading, build = next(iter(simulated)), cast("Callable[..., Force]", force_class(effect.damping))

    def part(share: Floats) -> dict[str, Floats]:
        return {**simulated, leading: simulated[leading] * share}

    def change(terms: Terms, beyond: Floats) -> Terms:
        own = build(**part(np.exp(beyond + np.copysign(least, beyond))))
        forces = (
            own if number < terms.simulated and force.name == own.name else force
            for number, force in enumerate(terms.forces)
        )
        return terms._replace(forces=tuple(forces))

    def report(beyond: Floats) -> dict[str, Floats]:
        relative = np.expm1(beyond + np.copysign(least, beyond))
        return ({} if effect.corrects else part(relative)) | {"relative": relative}

    # neither side mirrors the other: both begin at 3 tolerances
    options: dict[str, Any] = {"largest": _MOST_FACTOR, "replaces": effect.damping, "sizes": _FACTORS, "mirror": ""}
    return effect.either_sign(report, change=change, **options)


def less_forms(effect: Effect, scales: Scales) -> tuple[Form, ...]:
    """The form of a simulated force of the effect that is too large; none where it is not simulated."""
    simulated = scales.simulated.get(effect.damping)
    return factor_forms(effect, simulated, scales)[1:] if simulated else ()


class Structural(Displacement):
    """Damping in proportion to displacement as of a material, k (1 + i eta): linear, without harmonics."""

    def third(self, A: Floats, omega: Floats) -> ComplexArray:
        """Zero."""
        return zeros(A, omega).astype(np.complex128)


def instead_form(effect: Effect, kind: Callable[[Floats], Force], scales: Scales) -> Form:
    """The form of a force in the place of the simulated viscous one, as where damping is structural.

    Strength: the ratio of its loss at the largest amplitude to the viscous one's, to the power 1/``_KNOWN_SIZE``.
    """
    kind = Structural if kind is Displacement else kind
    viscous = Viscous(scales.viscous).quadrature(scales.A_high, scales.omega_n)
    equal = float(viscous) / float(kind(1.0).quadrature(scales.A_high, scales.omega_n))

    def change(terms: Terms, strength: Floats) -> Terms:
        force = kind(equal * strength**_KNOWN_SIZE)
        forces = (
            force if number < terms.simulated and isinstance(own, Viscous) else own
            for number, own in enumerate(terms.forces)
        )
        return terms._replace(forces=tuple(forces))

    def report(strength: Floats) -> dict[str, Floats]:
        return {"coefficient": equal * strength**_KNOWN_SIZE, "instead": 1.0}

    return Form(effect.name, change, report, replaces=Viscous.name, whole=True)
