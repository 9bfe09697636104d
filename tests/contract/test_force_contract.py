"""The one contract, on every force of the catalogue, on energy terms, a cubic spring and sums.

The closed forms are held against adaptive quadrature (QUADPACK) of the force over its cycle, split at the angles where
the force or a derivative of it jumps, so that the quadrature itself is good to the asked 1e-10.
"""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from damping.forces import (
    CATALOGUE,
    Coulomb,
    CubicStiffness,
    Dahl,
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    EnergyTerm,
    Force,
    PowerStiffness,
    QuadraticDisplacement,
    Slip,
    Sum,
    VelocityPower,
    VelocitySquared,
    Viscous,
    case_five,
    energy_per_cycle,
)
from damping.forces.joints import SlippingForce
from damping_reed1970.chapter_2 import loop

SINGLE = {
    "viscous": Viscous(1.768),
    "displacement": Displacement(2.5),
    "velocity-squared": VelocitySquared(0.23),
    "displacement-velocity": DisplacementVelocity(1.3),
    "quadratic-displacement": QuadraticDisplacement(0.7),
    "velocity-power": VelocityPower(0.1917, 1.859),
    "velocity-power below one": VelocityPower(0.4, 0.342),
    "displacement-velocity-power": DisplacementVelocityPower(3.89, 0.865),
    "coulomb": Coulomb(0.6),
    "slip": Slip(6.0, 0.3),
    "slip of large limit": Slip(6.0, 0.55),
    "dahl": Dahl(6.0, 0.3),
}
BESIDE = {
    "energy term": EnergyTerm(0.8, 3.0, 2.0),
    "energy term of real powers": EnergyTerm(0.8, 2.5, 0.5),
    "cubic stiffness": CubicStiffness(-0.4),
    "case V": case_five(1.0971, 1.0),
    "viscous with slip and friction": Sum((Viscous(0.5), Slip(6.0, 0.3), Coulomb(0.2))),
    "nothing": Sum(()),
}
FORCES = SINGLE | BESIDE
STATES = [(1.0, 10.47), (0.3061, 17.09), (1.7, 0.8), (0.05, 3.0)]

every_force = pytest.mark.parametrize("force", FORCES.values(), ids=FORCES)
every_state = pytest.mark.parametrize(("A", "omega"), STATES)


def parts_of(force: Force) -> tuple[Force, ...]:
    return force.forces if isinstance(force, Sum) else (force,)


def corners(force: Force, A: float) -> list[float]:
    """Angles at which some force may have a kink or jump: zeros of q and q', and the onset of slip."""
    angles = [0.0, np.pi / 2, np.pi, 3 * np.pi / 2]
    for slip in parts_of(force):
        if isinstance(slip, Slip) and slip.limit < A:
            psi = float(np.arccos(1 - 2 * slip.limit / A))
            angles += [np.pi / 2 + psi, (3 * np.pi / 2 + psi) % (2 * np.pi)]
    return [*sorted(angles), 2 * np.pi]


def average(force: Force, A: float, omega: float, weight) -> float:
    """(1/pi) times the integral of g weight over the cycle, piece by piece."""
    edges = corners(force, A)
    pieces = [
        quad(lambda t: float(force.cycle(t, A, omega)) * weight(t), low, high, epsabs=1e-13, epsrel=1e-12, limit=400)[0]
        for low, high in pairwise(edges)
    ]
    return sum(pieces) / np.pi


def size(force: Force, A: float, omega: float) -> float:
    """Largest force of the cycle, joints' springs included: the scale against which a vanishing average is zero."""
    springs = sum(float(part.stiffness) * A for part in parts_of(force) if isinstance(part, SlippingForce))
    return springs + float(np.max(np.abs(force.cycle(np.linspace(0, 2 * np.pi, 721), A, omega))))


def test_the_contract_is_run_on_every_force_of_the_catalogue() -> None:
    assert {force.name for force in SINGLE.values()} == set(CATALOGUE)
    assert all(CATALOGUE[force.name] is type(force) for force in SINGLE.values())


#: C, dC/d ln A, S and dS/d ln A, each by the function that gives it alone or with the fewest others.
AVERAGES = {
    "quadrature": lambda force, *at: force.quadrature(*at),
    "slope": lambda force, *at: force.grow(*at)[1],
    "in_phase": lambda force, *at: force.in_phase(*at),
    "in_phase_slope": lambda force, *at: force.restoring(*at)[1],
}


def evaluate(force: Force, part: str, A: Any, omega: Any) -> Any:
    """One of ``AVERAGES``."""
    return AVERAGES[part](force, A, omega)


@every_force
@every_state
def test_closed_forms_are_the_averages_of_the_cycle(force: Force, A: float, omega: float) -> None:
    # 1e-10 of the largest force: the demand on the closed forms; the quadrature is asked for 1e-12
    atol = 1e-10 * size(force, A, omega)
    np.testing.assert_allclose(force.quadrature(A, omega), average(force, A, omega, np.cos), rtol=1e-10, atol=atol)
    np.testing.assert_allclose(force.in_phase(A, omega), average(force, A, omega, np.sin), rtol=1e-10, atol=atol)


@every_force
@every_state
def test_slopes_are_derivatives_in_log_amplitude(force: Force, A: float, omega: float) -> None:
    # complex step: no truncation at 1e-30, so only rounding is left
    step = 1e-30
    amplitude = np.complex128(A * (1 + 1j * step))
    for average_of, slope in (("quadrature", "slope"), ("in_phase", "in_phase_slope")):
        if isinstance(force, Dahl) and average_of == "in_phase":
            continue  # scaled Bessel functions take real numbers alone: held to differences beside its closed forms
        derivative = np.imag(evaluate(force, average_of, amplitude, omega)) / step
        found = evaluate(force, slope, A, omega)
        np.testing.assert_allclose(found, derivative, rtol=1e-13, atol=1e-13 * size(force, A, omega))


@every_force
def test_averages_at_once_are_the_four_of_them(force: Force) -> None:
    A, omega = np.array([0.3061, 1.7]), np.array([17.09, 0.8])
    for together, part in zip(force.averages(A, omega), AVERAGES, strict=True):
        alone = evaluate(force, part, A, omega)
        np.testing.assert_allclose(together + 0.0 * A, alone + 0.0 * A, rtol=1e-14, atol=1e-16)  # rounding


@every_force
@every_state
def test_energy_is_never_negative_and_is_the_area_of_the_loop(force: Force, A: float, omega: float) -> None:
    energy = float(energy_per_cycle(force, A, omega))
    assert energy >= 0.0
    if isinstance(force, EnergyTerm):
        return  # known by its energy alone: its cycle is defined from C
    # int g dq = A int g cos(theta) d theta; adaptive quadrature as above
    expected = np.pi * A * average(force, A, omega, np.cos)
    np.testing.assert_allclose(energy, expected, rtol=1e-10, atol=1e-10 * A * size(force, A, omega))
    # polygon of 4000 corners: the trapezoidal rule errs by (2 pi/4000)^2 = 2.5e-6 of force times amplitude where the
    # force is smooth, and by a few times that where its corners fall between two points; the spring adds rounding
    area = loop(force, A, omega, stiffness=12.0, points=4001).area
    np.testing.assert_allclose(area, energy, rtol=0, atol=1e-5 * A * size(force, A, omega) + 1e-14 * 12.0 * A**2)


@every_force
def test_energy_scales_with_its_exponents(force: Force) -> None:
    if force.energy_exponents is None:
        assert isinstance(force, Sum | SlippingForce | CubicStiffness)  # these have no exponents to hold
        return
    m, n = force.energy_exponents
    A, omega = 0.7, 5.0
    base = energy_per_cycle(force, A, omega)
    # products of powers: exact but for rounding of the powers
    np.testing.assert_allclose(energy_per_cycle(force, 3 * A, omega), 3**m * base, rtol=1e-13)
    np.testing.assert_allclose(energy_per_cycle(force, A, 3 * omega), 3**n * base, rtol=1e-13)


@pytest.mark.parametrize("force", SINGLE.values(), ids=SINGLE)
def test_averages_are_proportional_to_the_first_parameter(force: Force) -> None:
    first = fields(force)[0].name
    doubled = replace(force, **{first: 2 * getattr(force, first)})
    for state in STATES:
        # doubling is exact in binary arithmetic but for the order of the products
        np.testing.assert_allclose(doubled.quadrature(*state), 2 * np.asarray(force.quadrature(*state)), rtol=1e-14)
        np.testing.assert_allclose(doubled.in_phase(*state), 2 * np.asarray(force.in_phase(*state)), rtol=1e-14)


@pytest.mark.parametrize("method", AVERAGES)
def test_sums_add(method: str) -> None:
    parts = tuple(FORCES.values())
    for state in STATES:
        total = sum(evaluate(part, method, *state) for part in parts)
        # the same numbers added in the same order
        np.testing.assert_allclose(evaluate(Sum(parts), method, *state), total, rtol=1e-14)


def test_cycles_of_sums_add() -> None:
    theta = np.linspace(0.0, 6.0, 50)
    parts = tuple(FORCES.values())
    total = sum(np.asarray(part.cycle(theta, 0.9, 3.0)) for part in parts)
    np.testing.assert_allclose(Sum(parts).cycle(theta, 0.9, 3.0), total, rtol=1e-14)


@pytest.mark.parametrize("force", SINGLE.values(), ids=SINGLE)
@pytest.mark.parametrize("method", AVERAGES)
def test_parameters_amplitudes_and_frequencies_broadcast(force: Force, method: str) -> None:
    """A posterior sample of parameters, shape (walkers, 1), over states of shape (states,), equals one by one."""
    scales = np.array([[0.5], [1.0], [1.5]])
    sample = replace(force, **{f.name: getattr(force, f.name) * scales for f in fields(force)})
    A, omega = np.array([0.2, 0.9, 1.4, 2.0]), np.array([3.0, 4.0, 5.0, 6.0])
    values = np.broadcast_to(evaluate(sample, method, A, omega), (3, 4))
    for i, scale in enumerate(scales[:, 0]):
        one = replace(force, **{f.name: getattr(force, f.name) * scale for f in fields(force)})
        each = [float(evaluate(one, method, a, w)) for a, w in zip(A, omega, strict=True)]
        # the same formula element by element; only vectorised powers may round otherwise
        np.testing.assert_allclose(values[i], each, rtol=1e-13)


def test_forces_are_told_apart_by_their_names_labels_and_formulas() -> None:
    """One sentence for each; of a sum and of a term of energy they are made of their parts."""
    for kinds in ([SINGLE[name] for name in CATALOGUE], BESIDE.values()):
        for said in ("name", "label", "formula"):
            assert len({getattr(force, said) for force in kinds} - {""}) == len(kinds)
    assert BESIDE["viscous with slip and friction"].name == "viscous + slip + coulomb"
    term = BESIDE["energy term"]
    assert (term.name, term.label, term.formula) == ("A^3*omega^2", "energy term A^3*omega^2", "E = a A^3*omega^2")


@every_force
def test_results_have_the_shape_of_the_states(force: Force) -> None:
    A, omega = np.ones((3, 1)), np.ones(4)
    assert [np.shape(evaluate(force, part, A, omega)) for part in AVERAGES] == [(3, 4)] * 4
    assert np.shape(force.cycle(np.zeros((2, 1, 1)), A, omega)) == (2, 3, 4)


@every_force
@every_state
def test_facts_are_what_the_averages_do(force: Force, A: float, omega: float) -> None:
    levels = A * np.array([0.5, 1.0, 2.0, 100.0])
    S, C = force.in_phase(levels, omega), force.quadrature(levels, omega)
    assert force.restores or np.all(S == 0.0)
    # what sets a resonance has a C that grows with amplitude; a spring, or nothing at all, has no C
    if np.any(C != 0.0):
        assert force.resonates == (C[-1] > C[0] * (1.0 + 1e-12))
    if force.linear:
        np.testing.assert_allclose(C, C[0] * levels / levels[0], rtol=1e-13, atol=0.0)  # rounding
        assert np.all(S == 0.0)
    # memory is what g, a function of the instant, cannot give: a spring that is stuck has neither
    assert bool(force.joints) == any(isinstance(part, SlippingForce) for part in parts_of(force))


@pytest.mark.parametrize("kind", CATALOGUE.values(), ids=CATALOGUE)
def test_parameters_are_the_fields_in_order(kind: type[Force]) -> None:
    assert [shape.name for shape in kind.shapes] == [field.name for field in fields(kind)]
    assert all(shape.prior is not None for shape in kind.shapes[1:])


def by_dimension(kind: type[Force], force: float, length: float, time: float) -> None:
    """C in other units is C times the unit of force, when parameters, A and omega are converted by their dimensions."""
    values = {shape.name: 1.3 if shape.name == "exponent" else 0.4 for shape in kind.shapes}
    units = {shape.name: shape.unit.at(values) for shape in kind.shapes}
    scale = {name: force**unit.force * length**unit.length * time**unit.time for name, unit in units.items()}
    A, omega = 1.7, 5.0
    before = kind(**values)
    after = kind(**{name: value * scale[name] for name, value in values.items()})
    for average in ("quadrature", "in_phase"):
        np.testing.assert_allclose(
            getattr(after, average)(A * length, omega / time),
            force * getattr(before, average)(A, omega),
            rtol=1e-12,  # rounding of powers
            atol=0.0,
        )


@pytest.mark.parametrize("kind", [*CATALOGUE.values(), CubicStiffness, PowerStiffness], ids=lambda kind: kind.name)
def test_units_are_those_of_the_averages(kind: type[Force]) -> None:
    by_dimension(kind, 4.448, 1.0, 1.0)
    by_dimension(kind, 1.0, 0.0254, 1.0)
    by_dimension(kind, 1.0, 1.0, 1e-3)


@pytest.mark.parametrize(("force", "length", "time"), [(4.448, 1.0, 1.0), (1.0, 0.0254, 1.0), (1.0, 1.0, 1e-3)])
def test_units_of_an_energy_term_are_those_of_its_powers(force: float, length: float, time: float) -> None:
    before, A, omega = EnergyTerm(0.8, 2.5, 0.5), 1.7, 5.0
    unit = before.shapes[0].unit.at({})
    scale = force**unit.force * length**unit.length * time**unit.time
    after = replace(before, coefficient=0.8 * scale).quadrature(A * length, omega / time)
    np.testing.assert_allclose(after, force * before.quadrature(A, omega), rtol=1e-12, atol=0.0)  # rounding of powers
