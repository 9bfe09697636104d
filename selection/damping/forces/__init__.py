"""The damping forces by name, and functions of the averages of any force (`contract.Force`)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import pi
from typing import TypeVar

from damping.arrays import FloatArray, Floats
from damping.errors import AnalysisError, InputError, describe_nearest
from damping.forces.contract import Force, Sum
from damping.forces.joints import Coulomb, CubicStiffness, PowerStiffness, Slip
from damping.forces.powers import (
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    EnergyTerm,
    QuadraticDisplacement,
    VelocityPower,
    VelocitySquared,
    Viscous,
    term_powers,
)
from damping.forces.shapes import Shape
from damping.forces.smooth import Dahl

_Number = TypeVar("_Number", float, FloatArray, Floats)

#: The forces of Table 2.I, the two power laws of section 4.3, Coulomb friction, the slip joint of Fig. 2.4c and Dahl's.
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
    "dahl": Dahl,
}


def force_class(name: str) -> type[Force]:
    """The class of the force called ``name``.

    Raises:
        InputError: no such force; the message names the nearest one, or lists all.
    """
    if name in CATALOGUE:
        return CATALOGUE[name]
    near = describe_nearest(name, CATALOGUE, likeness=0.6)
    expected = f"{near!r}" if near else "one of " + ", ".join(CATALOGUE)
    raise InputError(f"unknown damping force {name!r}", expected=expected)


def shapes_of(name: str) -> tuple[Shape, ...]:
    """The parameters of a force, the one it is proportional to first; InputError for an unknown name."""
    return component(name).example.shapes


def list_parameter_names(name: str) -> tuple[str, ...]:
    """Names of the parameters of a force, the one it is proportional to first; InputError for an unknown name."""
    return tuple(shape.name for shape in shapes_of(name))


@dataclass(frozen=True)
class Component:
    """A term of a law: a force with free parameters."""

    name: str  #: of the force, or of the energy term
    build: Callable[..., Force]  #: the force from its parameters, the leading one first
    example: Force  #: the force with all parameters 1, for facts that do not depend on them

    @property
    def free_shapes(self) -> tuple[Shape, ...]:
        """The free parameters other than the first, to which the force is proportional."""
        return self.example.shapes[1:]


def component(name: str) -> Component:
    """The force called ``name``, or the energy term ``A^m*omega^n``.

    Raises:
        InputError: neither; the message names the nearest force, or lists all.
    """
    powers = None if name in CATALOGUE else term_powers(name)
    if powers is not None:
        term = EnergyTerm(1.0, *powers)
        return Component(name, partial(EnergyTerm, amplitude_power=powers[0], frequency_power=powers[1]), term)
    kind = force_class(name)
    build: Callable[..., Force] = kind
    # ``shapes`` is a property of the contract and a value of each class in the catalogue, which mypy cannot see
    return Component(name, build, build(**{shape.name: 1.0 for shape in kind.shapes}))  # type: ignore[attr-defined]


def make(name: str, **parameters: Floats) -> Force:
    """The force called ``name`` with its parameters, numbers or arrays that broadcast.

    Raises:
        InputError: no such force, or parameters other than ``list_parameter_names(name)``.
    """
    wanted = list_parameter_names(name)
    if set(parameters) != set(wanted):
        given = ", ".join(parameters) or "nothing"
        raise InputError(f"damping force {name!r} was given {given}", expected=", ".join(wanted))
    build: Callable[..., Force] = force_class(name)
    return build(**parameters)


def from_damping(table: Mapping[str, Mapping[str, float]]) -> Sum:
    """The sum of forces of a ``[damping]`` table, force name to its parameters; an empty table is no damping.

    Raises:
        InputError: an unknown force or parameter.
    """
    return Sum(tuple(make(name, **parameters) for name, parameters in table.items()))


def case_five(coefficient: Floats, alpha: Floats) -> Sum:
    """Case V of Table 2.I, C1 (1 + alpha q^2) q': viscous and quadratic-displacement with C5 = C1 alpha."""
    return Sum((Viscous(coefficient), QuadraticDisplacement(coefficient * alpha)))


def energy_per_cycle(force: Force, A: Floats, omega: Floats) -> Floats:
    """Delta W per cycle = int g dq = pi A C(A, omega) (Eq 2.3.2, Table 2.II)."""
    return pi * A * force.quadrature(A, omega)


def damping_term(force: Force, A: Floats, omega: Floats, M: Floats, omega_n: Floats) -> Floats:
    """G = Delta W/(pi M omega_n^2 A^2) = C/(M omega_n^2 A), the damping term of Eq 4.2.4 and Table 4.III.

    The printed integral 4.2.2 and the factor of 4.2.5 are wrong (errata E422, E425); Table 4.III has this value.
    """
    return force.quadrature(A, omega) / (M * omega_n**2 * A)


def damping_ratio(F: _Number, A: _Number, stiffness: _Number) -> _Number:
    """zeta = F/(2 M omega^2 A), the part of critical damping at the resonance omega, where F balances it: C = F.

    ``A``: amplitude. ``stiffness``: M omega^2. Units: those of one system, such as N, m and N/m. Source: half of G of
    Eq. 4.2.4, and the viscous A = F/(C omega) of Eq. 4.1.7 with C = 2 M omega zeta.
    """
    return F / (2.0 * stiffness * A)


def energy_factor(kind: type[Force], **others: Floats) -> Floats:
    """Energy per cycle over coefficient A^m omega^n, such as 8/3 of case III (Table 2.II).

    ``others``: the parameters other than the coefficient (``exponent`` of the power laws).

    Raises:
        AnalysisError: the energy of this force is no product of powers (slip).
    """
    if kind.energy_exponents is Force.energy_exponents:
        raise AnalysisError("the energy per cycle of this force is no single product of powers of A and omega")
    build: Callable[..., Force] = kind
    return energy_per_cycle(build(1.0, **others), 1.0, 1.0)


def coefficient_from_energy(kind: type[Force], a: Floats, **others: Floats) -> Floats:
    """The coefficient C = a/energy_factor of a force of energy a A^m omega^n (Table 5.I); errors as `energy_factor`."""
    return a / energy_factor(kind, **others)


__all__ = [
    "CATALOGUE", "Component", "Coulomb", "CubicStiffness", "Dahl", "Displacement", "DisplacementVelocity",
    "DisplacementVelocityPower", "EnergyTerm", "Force", "PowerStiffness", "QuadraticDisplacement", "Slip", "Sum",
    "VelocityPower", "VelocitySquared", "Viscous", "case_five", "coefficient_from_energy", "component", "damping_ratio",
    "damping_term", "energy_factor", "energy_per_cycle", "force_class", "from_damping", "list_parameter_names", "make",
    "shapes_of",
]  # fmt: skip
