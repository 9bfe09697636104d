"""A base that shakes, beside added masses and further states: against motions of (m + m_a) q'' + .. = (p m + m_a) a."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import damping
from damping.effects import CATALOGUE
from damping.errors import AnalysisError
from damping.gap.corrected import effect_values
from damping.gap.designs import DESIGNS
from damping.gap.diagnose import Diagnosis, diagnose
from damping.gap.next_test import NextTest, name_command, rank_tests
from damping.gap.states import drive_by_forces
from damping.predict import prepare
from damping.records import audit
from damping.records.base_drive import find_participation
from damping.records.mode import Mode, Units
from damping.records.record import Record
from damping.report.gap import describe_diagnosis
from damping_pipelines.gap import _describe_model
from tests.gap.limited import limited

pytestmark = pytest.mark.usefixtures("no_folds")

F_N = 23.7
W_N = 2.0 * np.pi * F_N
MASS = 12.4
RATIO = 0.006
VISCOUS = 2.0 * RATIO * W_N * MASS
P = 1.3
ADDED = 6.2
NOISE = 0.005
#: Those that a wrong unit, a gain or a mass would be taken for, and the one that is there.
ASKED = (
    "velocity-squared",
    "displacement-velocity",
    "second-mode",
    "amplitude-scale",
    "level-offset",
    "natural-frequency",
)
EFFECTS = {name: CATALOGUE[name] for name in ASKED}


def shaken(levels: tuple[float, ...], added: float = 0.0, c2: float = 0.0, p: float = P, seed: int = 1) -> Record:
    """Sweeps of a structure whose damping is c q' + c2 |q'| q', a mass added; ``p`` 0: driven by forces ``levels``."""
    m = MASS + added
    w = W_N / np.sqrt(1.0 + added / MASS) * (1.0 + np.linspace(-0.03, 0.03, 25))
    rng, tables = np.random.default_rng(seed), []
    for level in levels:
        force = level * (p * MASS + added) if p else level
        Z = MASS * W_N**2 - m * w**2 + 1j * VISCOUS * w
        low, high = np.zeros_like(w), force / (VISCOUS * w)
        for _ in range(60):
            A = 0.5 * (low + high)
            over = A * np.abs(Z + 1j * c2 * 8.0 / (3.0 * np.pi) * A * w**2) > force
            low, high = np.where(over, low, A), np.where(over, A, high)
        phase = np.angle(Z + 1j * c2 * 8.0 / (3.0 * np.pi) * A * w**2)
        columns = {"sweep": f"{level:g} with {added:g}", "force": level, "frequency": w / (2.0 * np.pi)}
        columns["amplitude"] = A * np.exp(NOISE * rng.normal(size=w.size))
        columns["phase"] = phase + NOISE * rng.normal(size=w.size)
        tables.append(pd.DataFrame(columns | {"added_mass": added} if added else columns))
    return Record(pd.concat(tables, ignore_index=True), "shaken.csv")


def together(*records: Record) -> Record:
    """Several records as one; without an added mass it is 0."""
    return Record(pd.concat([record.table for record in records], ignore_index=True), "shaken.csv")


@pytest.fixture(scope="module")
def mode() -> Mode:
    """The simulation, in kg and N."""
    return Mode(name="shaken", frequency=F_N, mass=MASS, drive="base", damping={"viscous": VISCOUS})


@pytest.fixture(scope="module")
def by_force(mode) -> Mode:
    return replace(mode, drive="force")


@pytest.fixture(scope="module")
def heavier(mode) -> Mode:
    """The simulation with the mass added, stiffness and damping as before."""
    return replace(mode, mass=MASS + ADDED, frequency=F_N / np.sqrt(1.0 + ADDED / MASS))


@pytest.fixture(scope="module")
def quadratic(mode) -> Diagnosis:
    """Velocity-squared damping at four levels of the base, one state."""
    return limited(EFFECTS, diagnose, shaken((0.05, 0.1, 0.2, 0.4), c2=100.0), mode)


@pytest.mark.parametrize(
    "states",
    ["two of a base", "a force and a base", "a base and a force", "added, in a column", "added, in a mode file"],
)
def test_nothing_is_found_where_nothing_is_wrong(mode, by_force, heavier, states):
    one, two, pushed = shaken((0.05, 0.2)), shaken((0.1, 0.4), seed=2), shaken((0.5, 2.0), p=0.0, seed=3)
    loaded = shaken((0.1, 0.2), added=ADDED, seed=4)
    first, *further = {
        "two of a base": [(one, mode), (two, mode)],
        "a force and a base": [(pushed, by_force), (two, mode)],
        "a base and a force": [(one, mode), (pushed, by_force)],
        "added, in a column": [(together(one, loaded), mode)],
        "added, in a mode file": [(one, mode), (Record(loaded.table.drop(columns="added_mass")), heavier)],
    }[states]
    found = limited(EFFECTS, diagnose, *first, states=further)
    assert found.leading.effects == ()
    assert found.gap.before < 1.2  # four standard errors of 100 rows with two values each are 0.2
    assert any("participation of 1." in caution for caution in found.cautions)


def test_an_added_mass_is_measured_beside_the_participation(mode):
    """The structure 1.5 % heavier than simulated: frequencies tell it, whatever the participation."""
    true = 1.015
    one, loaded = shaken((0.05, 0.2)), shaken((0.1, 0.2), added=ADDED, seed=4)
    simulated = replace(mode, mass=MASS / true, damping={"viscous": VISCOUS / true})
    fit = limited({}, diagnose, together(one, loaded), simulated).leading.best
    relative = dict(zip(fit.model.problem.simulation.names, fit.y, strict=False))
    # tolerance of 2 %; the frequency is known to 1e-5, its ratio to the mass is a sixth
    np.testing.assert_allclose(relative["mass"] * 0.02, np.log(true), rtol=0.0, atol=0.001)


def test_damping_of_a_base_driven_state_is_found_beside_an_added_mass(mode, no_rivals):
    c2 = 100.0
    record = together(shaken((0.05, 0.1, 0.2, 0.4), c2=c2), shaken((0.2,), added=ADDED, c2=c2, seed=4))
    found = limited(EFFECTS, diagnose, record, mode)
    assert found.leading.effects == ("velocity-squared",)
    coefficient = effect_values(found.leading.best)["velocity-squared"]["coefficient"]
    np.testing.assert_allclose(coefficient, c2 / (P * MASS), rtol=0.03, atol=0.0)  # 1 %: 125 rows of 0.5 %, p to 0.5 %
    assert not found.unexplained


@pytest.mark.parametrize(
    ("error", "damped", "cause"),
    [(1.01, 1.0, {"natural-frequency"}), (1.0, 2.0, {"viscous-coefficient"}), (1.0, 1.0, set())],
)
def test_a_wrong_model_of_a_base_driven_record_is_named(mode, error, damped, cause, among):
    """The rows tell the participation, not what the model claims to know: a gain is all that they cannot tell."""
    wrong = replace(mode, frequency=F_N / error, damping={"viscous": {"coefficient": VISCOUS / damped}})
    found = limited(among("level-offset"), diagnose, shaken((0.05, 0.1, 0.2, 0.4)), wrong)
    assert found.leading.key == cause
    assert all("amplitude-scale" not in one.effects for one in found.hypotheses)


def test_an_unknown_participation_is_no_damping(mode):
    """At resonance alone q = p a/(c omega): p of 1.3 in place of 1 reads as viscous damping off by -23 %."""
    table = shaken((0.05, 0.1, 0.2, 0.4)).table
    peaks = table.loc[table.groupby("sweep")["amplitude"].idxmax()].drop(columns="phase")
    found = limited(EFFECTS | {"viscous-coefficient": CATALOGUE["viscous-coefficient"]}, diagnose, Record(peaks), mode)
    assert found.leading.effects == ()
    assert any("do not determine the participation" in caution for caution in found.cautions)


def test_a_next_test_is_told_as_the_record_holds_it(quadratic):
    """Half the modal mass is 6.2 kg and not 6.2/(p m), and the base keeps its acceleration."""
    proposed = [test for test in quadratic.next_tests if "added_mass" in test.columns]
    assert proposed
    for test in proposed:
        (run,) = test.rows
        share = run["added_mass"] / MASS
        # the participation is taken from the rows: 0.5 %
        assert min(abs(share / 0.2 - 1.0), abs(share / 0.5 - 1.0)) < 1e-9
        assert min(abs(run["force"] / 0.4 - 1.0), abs(run["force"] / 0.8 - 1.0)) < 1e-9  # the highest, or twice that
    assert {round(test.rows[0]["force"], 9) for test in quadratic.next_tests} <= {0.4, 0.8, 0.025}


def test_a_next_test_is_of_the_first_state(mode, by_force):
    """Proposed in the column of its record, an acceleration, and not as the force that drove the second state."""
    states = [(shaken((0.05, 0.1, 0.2, 0.4), c2=100.0), mode), (shaken((9.0,), p=0.0, c2=100.0, seed=3), by_force)]
    (record, counted), *further = states
    found = limited(EFFECTS, diagnose, record, counted, states=further)
    assert found.leading.effects == ("velocity-squared",)
    command = name_command(states, None)
    runs = [design.plan(found.setting.problem) for design in DESIGNS]
    assert all(np.all(run.state == 0.0) and np.all(run.shaken == 1.0) for run in runs)
    tests = rank_tests(found.hypotheses, found.hypotheses, found.in_library, command, found.unit)
    assert all(test.rows[0]["force"] < 1.0 for test in tests)


def test_the_corrected_model_stands_beside_the_record_with_its_added_masses(mode, no_rivals):
    """In kg and driven by the base, as the record is: it fits as it is."""
    c2 = 100.0
    record = together(shaken((0.05, 0.1, 0.2, 0.4), c2=c2), shaken((0.2,), added=ADDED, c2=c2, seed=4))
    corrected = limited({"velocity-squared": EFFECTS["velocity-squared"]}, diagnose, record, mode).corrected
    assert corrected.drive == "base"
    # the participation is known to 0.5 %, the coefficient to 1 %
    np.testing.assert_allclose(corrected.damping["velocity-squared"]["coefficient"], c2, rtol=0.03, atol=0.0)
    np.testing.assert_allclose(corrected.mass, MASS, rtol=0.01, atol=0.0)
    again = limited(EFFECTS, diagnose, record, corrected)
    assert again.leading.effects == ()
    assert again.gap.nominal < 1.2


@pytest.mark.parametrize("heavier", [False, True])
def test_sizes_and_the_corrected_model_name_the_units_of_their_numbers(mode, heavier):
    """Divided by p m, c2 is 1/m times N/(m/s^2 kg); beside added masses the corrected model is in N as given."""
    c2, mode = 100.0, replace(mode, units=Units("N", "m", "s"))
    record = shaken((0.05, 0.1, 0.2, 0.4), c2=c2)
    if heavier:
        record = together(record, shaken((0.2,), added=ADDED, c2=c2, seed=4))
    found = limited({"velocity-squared": EFFECTS["velocity-squared"]}, diagnose, record, mode)
    run = {"force": 0.2, "frequency_low": 20.0, "frequency_high": 30.0, "points": 40, "added_mass": 0.5}
    found.__dict__["next_tests"] = (NextTest("it", "why", 9.0, 0.99, ("force",), (run,), "damping gap"),)
    said = "Run 40 points from 20.00 to 30.00 Hz at base acceleration 0.200 m/s², added mass 0.500 N·s²/m."
    assert said in describe_diagnosis(found)["following"]
    (size,) = describe_diagnosis(found)["sizes"]
    told = float(re.search(r"coefficient: ([0-9.]+) 1/m ", size).group(1))
    np.testing.assert_allclose(told, c2 / (P * MASS), rtol=0.03, atol=0.0)  # the coefficient to 1 %
    assert found.units.force == "m/s²"
    assert found.corrected.units.force == ("N" if heavier else "m/s²")


def test_the_head_of_a_corrected_model_tells_the_participation_that_a_sweep_needs(mode, no_rivals, few_steps):
    """Swept with that many times the acceleration, it repeats the amplitudes measured."""
    record = together(shaken((0.1, 0.2, 0.4)), shaken((0.2,), added=ADDED, seed=4))
    result = damping.diagnose(record, mode, posterior=False, compare=False)
    head = " ".join(line.removeprefix("# ") for line in _describe_model(result).splitlines() if line.startswith("#"))
    p = float(re.search(r"participation is ([0-9.]+) here, and 1 in `damping sweep`", head).group(1))
    np.testing.assert_allclose(p, P, rtol=0.02, atol=0.0)  # known to 0.5 %
    rows = record.table.loc[record.table["sweep"] == "0.4 with 0"]
    swept = damping.sweep(result.diagnosis.corrected, force=[0.4 * p], frequency=rows["frequency"].to_numpy())
    ratio = swept.table["amplitude"].to_numpy() / rows["amplitude"].to_numpy()
    np.testing.assert_allclose(np.mean(ratio), 1.0, rtol=0.0, atol=0.01)  # noise of 0.5 % over 25 rows


@pytest.mark.parametrize("heavier", [False, True])
def test_local_estimates_are_of_the_mass_that_the_base_shakes(mode, heavier):
    record = shaken((0.05, 0.1, 0.2))
    if heavier:
        record = together(record, shaken((0.2,), added=ADDED, seed=4))
    local = limited({}, diagnose, record, mode).local
    # 0.5 % of a row, 0.5 % of the participation
    np.testing.assert_allclose([one.damping for one in local], RATIO, rtol=0.03, atol=0.0)
    np.testing.assert_allclose([one.frequency for one in local], F_N, rtol=1e-3, atol=0.0)


def test_the_participation_is_one_of_all_sweeps():
    """p of bare sweeps; of sweeps with an added mass alone from (m + m_a)/(p m + m_a)."""
    bare, loaded = shaken((0.05, 0.2)), shaken((0.1, 0.2), added=ADDED, seed=4)
    for asked in ([(bare, MASS, 0.0), (loaded, MASS, 0.0)], [(loaded, MASS, 0.0)]):
        known = find_participation(asked)
        assert known.known
        np.testing.assert_allclose(known.value, P, rtol=4.0 * known.spread, atol=0.0)  # four standard errors
    unseen = Record(bare.table.iloc[:1].drop(columns="phase"))  # one row alone
    assert not find_participation([(unseen, MASS, 0.0)]).known


def test_added_masses_are_shaken_before_laws_are_fitted(mode):
    """F = a (1 + m_a/(p m)) on 1/p + m_a/(p m), as audited."""
    record = together(shaken((0.05, 0.2)), shaken((0.2,), added=ADDED, seed=4))
    table = prepare(record, mode).record.table
    loaded = table["added_mass"] > 0.0
    np.testing.assert_allclose(table["added_mass"][loaded], ADDED / (P * MASS), rtol=0.02, atol=0.0)
    np.testing.assert_allclose(table["force"][loaded], 0.2 * (1.0 + ADDED / (P * MASS)), rtol=0.02, atol=0.0)
    found = audit(record, mode)
    assert found.verdict == "ok"
    np.testing.assert_allclose(found.implied["mass"], 1.0 / P, rtol=0.03, atol=0.0)  # of 25 rows of 0.5 %


def test_uncertainties_and_energies_go_with_the_force(mode):
    plain = together(shaken((0.05, 0.2)), shaken((0.2,), added=ADDED, seed=4))
    record = Record(plain.table.assign(force_sd=0.01 * plain.table["force"]))
    (shaken_record, _), *_ = drive_by_forces([(record, mode)]).states
    np.testing.assert_allclose(shaken_record.column("force_sd"), 0.01 * shaken_record.column("force"), rtol=1e-12)


def test_a_state_of_another_stiffness_has_its_own_participation(mode):
    """Half as stiff, participation 0.7: its frequency and its participation are its own."""
    w = W_N / np.sqrt(2.0) * (1.0 + np.linspace(-0.03, 0.03, 25))
    rng, tables = np.random.default_rng(8), []
    for level in (0.1, 0.4):
        q = 0.7 * MASS * level / (0.5 * MASS * W_N**2 - MASS * w**2 + 1j * VISCOUS * w)
        columns = {"sweep": f"{level:g}", "force": level, "frequency": w / (2.0 * np.pi)}
        columns["amplitude"] = np.abs(q) * np.exp(NOISE * rng.normal(size=w.size))
        tables.append(pd.DataFrame(columns | {"phase": -np.angle(q) + NOISE * rng.normal(size=w.size)}))
    soft = Record(pd.concat(tables, ignore_index=True), "soft.csv")
    other = replace(mode, frequency=F_N / np.sqrt(2.0))
    found = limited(EFFECTS, diagnose, shaken((0.05, 0.2)), mode, states=[(soft, other)])
    assert found.leading.effects == ()
    said = [caution for caution in found.cautions if "participation" in caution]
    assert [caution.split(":")[0] for caution in said] == ["base drive of state 1", "base drive of state 2"]
    assert " 0.7" in said[1] or " 0.69" in said[1]


def test_a_simulator_is_of_one_state(mode):
    def simulate(force, frequency):
        return force, frequency

    one = shaken((0.05, 0.2))
    with pytest.raises(AnalysisError, match="one state without added mass"):
        diagnose(one, mode, states=[(shaken((0.1,), seed=2), mode)], simulate=simulate)
