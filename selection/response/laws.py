"""Forces in the time domain: g(q, q') as the equation of motion sees it, for the integration that checks the averages.

Nothing here comes from the averages. Motion is taken piece by piece between turning points, in each of which the
velocity has one sign, so that sgn q' is a constant and dry friction and joints need no smoothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import singledispatch

from selection.errors import AnalysisError
from selection.forces import (
    Coulomb,
    CubicStiffness,
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    Force,
    QuadraticDisplacement,
    Slip,
    Sum,
    VelocityPower,
    VelocitySquared,
    Viscous,
)

#: g(q, |q'|, sign) for a velocity of the given sign.
Law = Callable[[float, float, float], float]


@dataclass(frozen=True)
class Joint:
    """A spring of ``stiffness`` in series with a slider that holds up to ``stiffness`` times ``limit``."""

    stiffness: float
    limit: float

    def stretch(self, start: float, travel: float) -> float:
        """Stretch of the spring after a one-way ``travel`` from the stretch ``start``."""
        return min(self.limit, max(-self.limit, start + travel))


def joints_of(force: Force) -> tuple[Joint, ...]:
    """The slip joints in a force, which remember where they stick."""
    parts = force.forces if isinstance(force, Sum) else (force,)
    return tuple(Joint(float(part.stiffness), float(part.limit)) for part in parts if isinstance(part, Slip))


@singledispatch
def law(force: Force) -> Law:
    """The memoryless part of a force in the time domain.

    Raises:
        AnalysisError: the force is known by its energy per cycle alone.
    """
    raise AnalysisError(f"{force.label} has no law in the time domain: its energy per cycle alone is known")


@law.register
def _(force: Sum) -> Law:
    parts = [law(part) for part in force.forces]
    return lambda q, speed, sign: sum(part(q, speed, sign) for part in parts)


@law.register
def _(force: Slip) -> Law:
    k = float(force.stiffness)
    return lambda q, speed, sign: -k * q  # relative to the stuck state: the joint itself is added with its memory


@law.register
def _(force: Viscous) -> Law:
    c = float(force.coefficient)
    return lambda q, speed, sign: sign * c * speed


@law.register
def _(force: Displacement) -> Law:
    c = float(force.coefficient)
    return lambda q, speed, sign: sign * c * abs(q)


@law.register
def _(force: VelocitySquared) -> Law:
    c = float(force.coefficient)
    return lambda q, speed, sign: sign * c * speed * speed


@law.register
def _(force: DisplacementVelocity) -> Law:
    c = float(force.coefficient)
    return lambda q, speed, sign: sign * c * abs(q) * speed


@law.register
def _(force: QuadraticDisplacement) -> Law:
    c = float(force.coefficient)
    return lambda q, speed, sign: sign * c * q * q * speed


@law.register
def _(force: VelocityPower) -> Law:
    alpha, p = float(force.coefficient), float(force.exponent)
    return lambda q, speed, sign: sign * alpha * speed**p


@law.register
def _(force: DisplacementVelocityPower) -> Law:
    alpha, p = float(force.coefficient), float(force.exponent)
    return lambda q, speed, sign: sign * alpha * abs(q) * speed**p


@law.register
def _(force: Coulomb) -> Law:
    friction = float(force.coefficient)
    return lambda q, speed, sign: sign * friction


@law.register
def _(force: CubicStiffness) -> Law:
    k = float(force.coefficient)
    return lambda q, speed, sign: k * q * q * q
