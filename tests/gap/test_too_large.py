"""A simulated damping force that is too large is called so; what is measured is linear or rubs, in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.gap.corrected import corrected_mode, effect_values
from damping.gap.diagnose import diagnose, explain
from damping.records.record import Record
from damping.report.gap import describe_diagnosis
from tests.gap.limited import limited

pytestmark = pytest.mark.usefixtures("no_folds")


@pytest.fixture
def simulated(lab):
    """A simulation with a force beside the viscous one, worth about half of it at the largest amplitude."""
    whole = lab.viscous * lab.omega * lab.A
    speed = lab.omega * lab.A
    tables = {
        "velocity-squared": {"coefficient": 0.5 * whole / speed**2},
        "quadratic-displacement": {"coefficient": 2.0 * whole / (speed * lab.A**2)},
        "coulomb": {"coefficient": 0.08 * whole},
        "velocity-power": {"coefficient": 0.5 * whole / speed**1.6, "exponent": 1.6},
        "slip": {"stiffness": 0.03 * lab.mass * lab.omega**2, "limit": 0.3 * lab.A},
    }
    return lambda name: lab.mode(damping={"viscous": {"coefficient": lab.viscous}, name: tables[name]})


def rub(lab, rows, friction):
    """Friction R beside viscous damping: (|K - M w^2| A)^2 + (c w A + 4 R/pi)^2 = F^2, quadratic in A; none sticks."""
    k, c, r = lab.mass * (lab.omega**2 - rows.omega**2), lab.viscous * rows.omega, 4.0 * friction / np.pi
    square = k**2 + c**2
    A = (np.sqrt((c * r) ** 2 + square * (rows.force**2 - r**2)) - c * r) / square
    return lab.cells(A, np.arctan2(c * A + r, k * A))


@pytest.mark.parametrize(
    ("force", "effect"),
    [
        ("velocity-squared", "velocity-squared"),
        ("quadratic-displacement", "quadratic-displacement"),
        ("coulomb", "coulomb-friction"),
        ("velocity-power", "velocity-power"),
        ("slip", "slip"),
    ],
)
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_simulated_force_that_is_not_there(lab, simulated, force, effect, seed, among):
    """The record is linear and viscous: a second plane was blamed, at a probability of 1."""
    mode, rows = simulated(force), lab.bench().rows
    found = limited(among(effect), diagnose, lab.record(rows, lab.linear(rows), seed), mode)
    assert (found.leading.effects, found.unexplained) == ((effect,), False)
    values, (leading, whole) = effect_values(found.leading.best)[effect], next(iter(mode.damping[force].items()))
    # no total below 0; 2 % of any of these forces are less than a sigma of a hundred values
    assert -1.0 < values["relative"] < -0.95
    np.testing.assert_allclose(values[leading], values["relative"] * whole, rtol=1e-12, atol=0.0)  # rounding
    (said,) = describe_diagnosis(found)["verdict"]
    assert f"the simulated {force} force is not there" in said
    corrected = corrected_mode(found.leading.best)
    assert (set(corrected.damping), corrected.effects) == ({"viscous"}, {})


@pytest.mark.parametrize(("true", "relative"), [(0.4, -0.6), (1.0, None), (2.5, 1.5)])
def test_a_simulated_friction_against_the_true_one(lab, simulated, true, relative, among, no_rivals):
    """Too large and too small are told by one number, true/simulated - 1; the right one is no effect."""
    mode, rows = simulated("coulomb"), lab.bench().rows
    whole = mode.damping["coulomb"]["coefficient"]
    cells = rub(lab, rows, true * 0.4 * whole)
    mode = replace(mode, damping=mode.damping | {"coulomb": {"coefficient": 0.4 * whole}})
    found = limited(among("coulomb-friction", "slip"), explain, lab.record(rows, cells, 3), mode)
    corrected = corrected_mode(found.leading.best).damping["coulomb"]["coefficient"]
    # 60 rows of 1 % know this friction to 2 % of the largest force, 0.06 of the simulated: three of them
    np.testing.assert_allclose(corrected / (0.4 * whole), true, rtol=0.0, atol=0.2)
    if relative is None:
        assert found.leading.effects == ()
    else:
        assert found.leading.effects == ("coulomb-friction",)
        own = effect_values(found.leading.best)["coulomb-friction"]
        np.testing.assert_allclose(own["relative"], relative, rtol=0.0, atol=0.2)


def test_friction_that_is_not_there_beside_values_from_the_record_itself(lab, simulated, among):
    """They are free by a factor of eight; a plane was blamed for the eighth that was left of it."""
    mode, rows = simulated("coulomb"), lab.bench().rows
    mode = replace(mode, tolerance=replace(mode.tolerance, from_record=True))
    found = limited(among("coulomb-friction", "slip"), explain, lab.record(rows, lab.linear(rows), 1), mode)
    assert found.leading.effects == ("coulomb-friction",)
    assert set(found.corrected.damping) == {"viscous"}


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (2, 3))])
@pytest.mark.parametrize("damped", [1.6, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_mass_that_is_off_is_named_beside_the_frequency_taken_from_it(lab, seed, damped, among):
    """M is 8 % larger, four tolerances, with the stiffness as simulated; 0.3 M is added in half of the rows."""
    rows, K = lab.bench().rows, lab.mass * lab.omega**2
    tables = []
    for added in (0.0, 0.3 * lab.mass):
        M = 1.08 * lab.mass + added
        at = replace(rows, omega=rows.omega * np.sqrt(lab.mass / M))
        Y = K - M * at.omega**2 + 1j * damped * lab.viscous * at.omega
        record = lab.record(at, lab.cells(at.force / np.abs(Y), np.angle(Y)), seed)
        tables.append(record.table.assign(added_mass=added, sweep=record.table["sweep"] + f"{added:g}"))
    found = limited(
        among("level-offset"), explain, Record(pd.concat(tables, ignore_index=True), "two masses"), lab.mode()
    )
    (said,) = (caution for caution in found.cautions if "but is not in the library" in caution)
    cause, beside = said.partition(" explains ")[0].split(" beside ")
    assert "a generalized mass that differs" in cause
    assert set(beside.split(" and ")) == {"natural-frequency"} | ({"viscous-coefficient"} if damped != 1.0 else set())
