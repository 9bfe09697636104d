"""Every damping force by name, written out in full.

Damping forces: one contract (`contract.Force`), one short module a force, the catalogue, what follows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from difflib import get_close_matches

from damping.arrays import Floats
from damping.errors import InputError
from damping.forces.contract import Force, Sum
from damping.forces.joints import Coulomb, CubicStiffness, Slip
from damping.forces.polynomial import (
    Displacement,
    DisplacementVelocity,
    QuadraticDisplacement,
    VelocitySquared,
    Viscous,
)
from damping.forces.powers import DisplacementVelocityPower, EnergyTerm, VelocityPower

#: The forces of Table 2.I, the two power laws of section 4.3, Coulomb friction and the slip joint of Fig. 2.4c.
CATALOGUE: dict[str, type[Force]] = {
    "viscous": Viscous,
    "displacement": Displacement,
    "velocity-squared": VelocitySquared,
    "displacement-velocity": DisplacementVelocity,
    "quadratic-displacement": QuadraticDisplacement,
    "velocity-power": VelocityPower,
    "displacement-velocity-power": DisplacementVelocityPower,
    "coulomb": Coulomb,
    "slip": Slip,
}


def force_class(name: str) -> type[Force]:
    """The class of the force called ``name``.

    Raises:
        InputError: no such force; the message names the nearest one, or lists all.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    near = get_close_matches(name, CATALOGUE, n=1)
    expected = f"{near[0]!r}" if near else "one of " + ", ".join(CATALOGUE)
    raise InputError(f"unknown damping force {name!r}", expected=expected)


def parameter_names(name: str) -> tuple[str, ...]:
    """Names of the parameters of a force, the one it is proportional to first.

    Raises:
        InputError: no such force.
    """
    return tuple(field.name for field in fields(force_class(name)))  # type: ignore[arg-type]  # all are dataclasses


def make(name: str, **parameters: Floats) -> Force:
    """The force called ``name`` with its parameters, numbers or arrays that broadcast.

    Raises:
        InputError: no such force, or parameters other than ``parameter_names(name)``.
    """
    wanted = parameter_names(name)
    if set(parameters) != set(wanted):
        given = ", ".join(parameters) or "nothing"
        raise InputError(f"damping force {name!r} was given {given}", expected=", ".join(wanted))
    build: Callable[..., Force] = force_class(name)
    return build(**parameters)


def from_damping(table: Mapping[str, Mapping[str, float]]) -> Sum:
    """The sum of forces of a ``[damping]`` table: force name to its parameters; an empty table is no damping.

    Raises:
        InputError: an unknown force or parameter.
    """
    return Sum(tuple(make(name, **parameters) for name, parameters in table.items()))


def case_five(coefficient: Floats, alpha: Floats) -> Sum:
    """Case V of Table 2.I, C1 (1 + alpha q^2) q': viscous and quadratic-displacement with C5 = C1 alpha."""
    return Sum((Viscous(coefficient), QuadraticDisplacement(coefficient * alpha)))


__all__ = [
    "CATALOGUE",
    "Coulomb",
    "CubicStiffness",
    "Displacement",
    "DisplacementVelocity",
    "DisplacementVelocityPower",
    "EnergyTerm",
    "Force",
    "QuadraticDisplacement",
    "Slip",
    "Sum",
    "VelocityPower",
    "VelocitySquared",
    "Viscous",
    "case_five",
    "from_damping",
    "make",
    "parameter_names",
]
