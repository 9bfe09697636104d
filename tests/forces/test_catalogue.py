"""The catalogue: names, parameters, and messages that list the choices."""

from __future__ import annotations

import numpy as np
import pytest

from damping.errors import InputError
from damping.forces import (
    CATALOGUE,
    EnergyTerm,
    Slip,
    Sum,
    VelocityPower,
    Viscous,
    from_damping,
    list_parameter_names,
    make,
)

NAMES = [
    *("viscous", "displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement"),
    *("velocity-power", "displacement-velocity-power", "coulomb", "slip", "dahl"),
]


def test_names_are_those_of_the_file_formats() -> None:
    assert list(CATALOGUE) == NAMES
    assert all(force.name == name for name, force in CATALOGUE.items())


def test_parameters_are_listed_in_their_order() -> None:
    assert list_parameter_names("viscous") == ("coefficient",)
    assert list_parameter_names("velocity-power") == ("coefficient", "exponent")
    assert list_parameter_names("slip") == ("stiffness", "limit")


def test_a_force_is_made_by_its_name() -> None:
    assert make("viscous", coefficient=1.77) == Viscous(1.77)
    assert make("slip", stiffness=40.0, limit=0.01) == Slip(40.0, 0.01)


def test_a_misspelt_force_names_the_nearest_one() -> None:
    with pytest.raises(InputError, match="unknown damping force 'viscos'; expected 'viscous'"):
        make("viscos", coefficient=1.0)


def test_an_unknown_force_lists_all() -> None:
    with pytest.raises(InputError) as caught:
        make("xyzzy", coefficient=1.0)
    assert all(name in str(caught.value) for name in NAMES)


@pytest.mark.parametrize("parameters", [{}, {"limit": 1.0}, {"coefficient": 1.0, "exponent": 2.0}])
def test_wrong_parameters_say_what_was_expected(parameters: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"expected coefficient$"):
        make("viscous", **parameters)


def test_a_table_of_damping_is_a_sum() -> None:
    table = {"viscous": {"coefficient": 1.77}, "velocity-power": {"coefficient": 0.19, "exponent": 1.65}}
    force = from_damping(table)
    assert force == Sum((Viscous(1.77), VelocityPower(0.19, 1.65)))
    assert force.name == "viscous + velocity-power"


def test_an_empty_table_is_no_force() -> None:
    force = from_damping({})
    assert force.name == "none"
    np.testing.assert_array_equal(force.quadrature(np.ones(3), 2.0), np.zeros(3))


@pytest.mark.parametrize(
    ("powers", "name"),
    [
        ((3.0, 2.0), "A^3*omega^2"),
        ((1.0, 0.0), "A"),
        ((2.0, 1.0), "A^2*omega"),
        ((2.5, -1.0), "A^2.5*omega^-1"),
        ((0, 0), "1"),
    ],
)
def test_energy_terms_are_named_as_in_a_polynomial(powers: tuple[float, float], name: str) -> None:
    assert EnergyTerm(1.0, *powers).name == name
