"""What follows from the averages of any force: energies, the damping term, equivalents, conversion factors."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

from selection.arrays import Floats
from selection.errors import AnalysisError
from selection.forces.contract import Force
from selection.forces.gammas import B, beta

__all__ = [
    "B",
    "beta",
    "coefficient_from_energy",
    "damping_term",
    "energy_content",
    "energy_factor",
    "energy_per_cycle",
    "equivalent_viscous",
]


def energy_per_cycle(force: Force, A: Floats, omega: Floats) -> Floats:
    """Delta W per cycle = int g dq = pi A C(A, omega) (Eq 2.3.2, Table 2.II)."""
    return pi * A * force.quadrature(A, omega)


def energy_content(force: Force, A: Floats, omega: Floats, M: Floats) -> Floats:
    """Psi = Delta W/(M (A omega)^2), the loss over twice the largest kinetic energy (Eq 2.3.5, Table 2.II)."""
    return energy_per_cycle(force, A, omega) / (M * (A * omega) ** 2)


def damping_term(force: Force, A: Floats, omega: Floats, M: Floats, omega_n: Floats) -> Floats:
    """G = Delta W/(pi M omega_n^2 A^2) = C/(M omega_n^2 A), the damping term of Eq 4.2.4 and Table 4.III.

    The printed integral 4.2.2 and the factor of 4.2.5 are wrong (errata E422, E425); this is what Table 4.III holds.
    """
    return force.quadrature(A, omega) / (M * omega_n**2 * A)


def equivalent_viscous(force: Force, A: Floats, omega: Floats) -> Floats:
    """The viscous coefficient of equal energy per cycle, Delta W/(pi A^2 omega) = C/(A omega) (Eq 4.3.1)."""
    return force.quadrature(A, omega) / (A * omega)


def energy_factor(kind: type[Force], **others: Floats) -> Floats:
    """Energy per cycle over coefficient A^m omega^n, such as 8/3 of case III (Table 2.II).

    ``others`` are the parameters beside the coefficient (``exponent`` of the power laws).

    Raises:
        AnalysisError: the energy of this force is no product of powers (slip).
    """
    if kind.energy_exponents is Force.energy_exponents:
        raise AnalysisError("the energy per cycle of this force is no single product of powers of A and omega")
    build: Callable[..., Force] = kind
    return energy_per_cycle(build(1.0, **others), 1.0, 1.0)


def coefficient_from_energy(kind: type[Force], a: Floats, **others: Floats) -> Floats:
    """The force's coefficient from that of its energy term a A^m omega^n: C = a/energy_factor (Table 5.I).

    Raises:
        AnalysisError: the energy of this force is no product of powers (slip).
    """
    return a / energy_factor(kind, **others)
