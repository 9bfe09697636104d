"""A user's own simulation that misbehaves: in every call, not only the first, the message says what and where."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import wraps
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping.arrays import RAD_S_PER_HZ
from damping.effects import CATALOGUE, list_forms
from damping.effects.terms import predict
from damping.gap.corrected import corrected_mode, refitted_values
from damping.gap.diagnose import explain
from damping.gap.model import Model, Part, Scatter
from damping.gap.outside import name_better
from damping.gap.problem import setting
from damping.gap.simulator import Simulator
from damping.gap.simulator_checks import check_simulator
from damping.records.text import Disagreement
from damping.report.gap import describe_diagnosis, order_cautions
from tests.gap.limited import limited

MASS, FREQUENCY, LOSS = 2.0, 10.0, 0.02
STIFFNESS = MASS * (2.0 * np.pi * FREQUENCY) ** 2
FRICTION = 0.3


def impedance(frequency: np.ndarray, stiffness: float = STIFFNESS) -> np.ndarray:
    """Complex stiffness F/A of an oscillator with structural damping."""
    return stiffness * (1.0 + 1j * LOSS) - MASS * (2.0 * np.pi * frequency) ** 2


def simulate(force, frequency, *, stiffness=(STIFFNESS, 0.02)):
    return force / np.abs(impedance(frequency, stiffness)), np.angle(impedance(frequency, stiffness))


@pytest.fixture(scope="module")
def record() -> dp.Record:
    """The oscillator with constant friction R: |Z A + 4 i R/pi| = F."""
    rng, rows = np.random.default_rng(3), []
    for label, force in zip("ABC", (1.0, 2.0, 4.0), strict=True):
        frequency = FREQUENCY * (1.0 + 0.04 * np.linspace(-1.0, 1.0, 21))
        Z, lost = impedance(frequency), 4.0 * FRICTION / np.pi
        # |Z|^2 A^2 + 2 Im(Z) lost A + lost^2 - F^2 = 0
        a, b, c = np.abs(Z) ** 2, Z.imag * lost, lost**2 - force**2
        A = (np.sqrt(b**2 - a * c) - b) / a
        phase = np.angle(Z * A + 1j * lost) + 0.005 * rng.normal(size=21)
        noisy = A * (1.0 + 0.005 * rng.normal(size=21))
        rows.append(
            pd.DataFrame({"sweep": label, "force": force, "frequency": frequency, "amplitude": noisy, "phase": phase})
        )
    return dp.Record(pd.concat(rows, ignore_index=True))


@pytest.fixture(scope="module")
def mode() -> dp.Mode:
    viscous = LOSS * MASS * 2.0 * np.pi * FREQUENCY
    return dp.Mode(name="m", frequency=FREQUENCY, mass=MASS, damping={"viscous": {"coefficient": viscous}})


def diagnose(record, mode, simulator):
    """With the force that is there beside the one simulated and what is most like it."""
    library = ("coulomb-friction", "viscous-coefficient", "velocity-squared", "displacement")
    return limited(library, dp.diagnose, record, mode, simulate=simulator, compare=False)


@pytest.mark.parametrize("wrong", [0.0, -1.0, np.nan])
def test_an_amplitude_that_is_none_after_a_change_names_the_parameter_and_the_row(record, mode, wrong):
    def fails(force, frequency, *, stiffness=(STIFFNESS, 0.02)):
        A, phase = simulate(force, frequency, stiffness=stiffness)
        A[3] *= 1.0 if stiffness == STIFFNESS else wrong
        return A, phase

    with pytest.raises(dp.InputError, match=f"with stiffness = {STIFFNESS * np.exp(0.02):.6g} returns is") as caught:
        diagnose(record, mode, fails)
    assert f"at force 1 and {record.column('frequency')[3]:.5g} Hz" in str(caught.value)
    assert "amplitudes > 0" in str(caught.value)


def test_a_failure_after_a_change_names_the_parameter(record, mode):
    def fails(force, frequency, *, stiffness=(STIFFNESS, 0.02)):
        if stiffness != STIFFNESS:
            raise RuntimeError("no convergence")
        return simulate(force, frequency, stiffness=stiffness)

    with pytest.raises(dp.InputError, match=r"the simulator with stiffness = 8055\.\d+ ends with RuntimeError"):
        diagnose(record, mode, fails)


def test_a_function_that_works_in_place_changes_no_record(record, mode, no_rivals):
    def in_place(force, frequency, *, stiffness=(STIFFNESS, 0.02)):
        answer = simulate(force, frequency, stiffness=stiffness)
        force *= 0.5
        frequency *= 2.0
        return answer

    given, expected = (diagnose(record, mode, function) for function in (in_place, simulate))
    assert given.to_json() == expected.to_json()
    assert given.to_json()["effects"] == ["coulomb-friction"]
    found = given.to_json()["parameters"]["coulomb-friction"]["coefficient"]
    np.testing.assert_allclose(found, FRICTION, rtol=0.03)


def test_two_answers_to_one_call_are_refused(record, mode, no_rivals):
    rng = np.random.default_rng(1)

    def noisy(scale):
        def function(force, frequency, *, stiffness=(STIFFNESS, 0.02)):
            A, phase = simulate(force, frequency, stiffness=stiffness)
            return A * (1.0 + scale * rng.normal(size=A.size)), phase

        return function

    with pytest.raises(dp.InputError, match=r"answers the same call twice, [1-9]\.\d % apart"):
        diagnose(record, mode, noisy(0.01))
    assert diagnose(record, mode, noisy(1e-9)).to_json()["effects"] == ["coulomb-friction"]


@pytest.mark.parametrize("columns", [["phase"], []])
@pytest.mark.parametrize(
    ("taken", "said"),
    [(1.0 / (2.0 * np.pi), "at 2 pi times"), (2.0 * np.pi, r"at 1/(2 pi) times"), (1.0, ""), (1.2, ""), (2.0, "")],
)
def test_a_frequency_in_another_unit_is_told(record, mode, columns, taken, said):
    """The function takes rad/s and is given Hz, or multiplies by 2 pi twice; one of another resonance is let pass."""
    named = dp.Record(record.table[["sweep", "force", "frequency", "amplitude", *columns]])

    def function(force, frequency):
        return simulate(force, taken * frequency, stiffness=STIFFNESS)

    def of_the_band(force, frequency):
        if not 0.5 < frequency[0] / FREQUENCY < 2.0:
            raise ValueError("outside the band of the simulation")
        return function(force, frequency)

    told = check_simulator(Simulator.read(function, mode), named)
    assert [f"the simulation resembles the test {said} the frequencies" in text for text in told] == [True] * bool(said)
    assert check_simulator(Simulator.read(of_the_band, mode), named) == ()


@pytest.mark.parametrize(("factor", "said"), [(RAD_S_PER_HZ**-2.0, "1/(2 pi)"), (RAD_S_PER_HZ**2.0, "2 pi")])
def test_a_stiffness_made_with_hz_is_told(record, mode, factor, said):
    """m f^2 in the place of m (2 pi f)^2, or (2 pi)^2 times as much: far from the test at any frequency."""

    def function(force, frequency):
        return simulate(force, frequency, stiffness=factor * STIFFNESS)

    (told,) = check_simulator(Simulator.read(function, mode), record)
    assert f"resembles the test at {said} times the frequencies, with" in told
    assert "a mistake of rad/s for Hz in its stiffness?" in told
    first, further = order_cautions(Disagreement(), ["the rows are few", told])
    assert (first, further) == ([f"T{told[1:]}."], ["the rows are few"])


@pytest.mark.parametrize("factor", [0.85, pytest.param(1.5, marks=pytest.mark.slow)])
@pytest.mark.parametrize("wrong", ["mass", "stiffness"])
def test_a_parameter_beyond_its_tolerance_is_told_with_its_value(mode, wrong, factor):
    """Without friction, one value off by 16 to 40 tolerances: right within a tolerance of the other."""
    rng, frequency = np.random.default_rng(5), FREQUENCY * (1.0 + 0.04 * np.linspace(-1.0, 1.0, 41))
    n, noise = 41, 0.005
    table = {"sweep": "A", "force": 1.0, "frequency": frequency}
    table["amplitude"] = (1.0 + noise * rng.normal(size=n)) / np.abs(impedance(frequency))
    table["phase"] = np.angle(impedance(frequency)) + noise * rng.normal(size=n)
    given = {"mass": MASS, "stiffness": STIFFNESS}
    given[wrong] *= factor

    def function(force, frequency, *, mass=(given["mass"], 0.01), stiffness=(given["stiffness"], 0.01)):
        Z = stiffness * (1.0 + 1j * LOSS) - mass * (2.0 * np.pi * frequency) ** 2
        return force / np.abs(Z), np.angle(Z)

    library = {name: CATALOGUE[name] for name in ("amplitude-scale", "natural-frequency", "phase-lag")}
    found = limited(library, explain, dp.Record(pd.DataFrame(table)), mode, simulate=function)
    told = [re.search(rf"a {wrong} of (\S+) .* in the simulator explains", caution) for caution in found.cautions]
    values = [float(match[1]) for match in told if match]
    np.testing.assert_allclose(values, [given[wrong] / factor], rtol=0.01)


def test_a_default_that_is_no_pair_is_told_and_numbers_of_numpy_are_numbers(mode):
    def of(pair):
        def function(force, frequency, *, stiffness=pair):
            return simulate(force, frequency, stiffness=stiffness)

        return function

    with pytest.raises(
        dp.InputError, match=r"stiffness of the simulator has the default 7\.5; expected a default \(value"
    ):
        Simulator.read(of(7.5), mode)
    read = Simulator.read(of((np.int64(8), np.float32(0.5))), mode)
    assert read.tolerances == {"stiffness": 0.5}


@pytest.mark.filterwarnings("error")
def test_a_class_or_coroutine_is_no_function(mode):
    class Simulation:
        """A simulation that would be run by a method."""

    async def later(force, frequency):
        return force, frequency

    for given, kind in ((Simulation, "class"), (later, "coroutine")):
        wrapped = wraps(given)(lambda *_: None)  # as the command line does
        for function in (given, wrapped):
            with pytest.raises(dp.InputError, match=f"the simulator is a {kind}; expected a function"):
                Simulator.read(function, mode)


def test_a_tolerance_in_per_cent_is_told(record, mode):
    def stated(force, frequency, *, stiffness=(STIFFNESS, 2.0)):
        return simulate(force, frequency, stiffness=stiffness)

    assert check_simulator(Simulator.read(simulate, mode), record) == ()
    (told,) = check_simulator(Simulator.read(stated, mode), record)
    assert told == "the simulator states a tolerance of 200 % of stiffness: is it in per cent? 0.02 is 2 %"


def test_a_parameter_of_zero_cannot_vary_by_a_share(mode):
    def shifted(force, frequency, *, shift=(0.0, 0.1)):
        return simulate(force, frequency, stiffness=STIFFNESS + shift)

    with pytest.raises(dp.InputError, match="parameter shift of the simulator is 0; expected another number"):
        Simulator.read(shifted, mode)

    def held(force, frequency, *, shift=(0.0, 0.0)):
        return simulate(force, frequency, stiffness=STIFFNESS + shift)

    assert Simulator.read(held, mode).tolerances == {"shift": 0.0}


def swept(truth, seed: int) -> dp.Record:
    """Rows of `sprung` at true values, three levels, with noise of 0.5 % and 5 mrad."""
    rng, rows = np.random.default_rng(seed), []
    centre = np.sqrt(truth["stiffness"] / MASS) / (2.0 * np.pi)
    for label, force in zip("ABC", (1.0, 2.0, 4.0), strict=True):
        frequency = centre * (1.0 + 0.04 * np.linspace(-1.0, 1.0, 21))
        A, phase = sprung(np.full(21, force), frequency, **truth)
        A, phase = A * (1.0 + 0.005 * rng.normal(size=21)), phase + 0.005 * rng.normal(size=21)
        rows.append(
            pd.DataFrame({"sweep": label, "force": force, "frequency": frequency, "amplitude": A, "phase": phase})
        )
    return dp.Record(pd.concat(rows, ignore_index=True))


def sprung(force, frequency, *, stiffness=(STIFFNESS, 0.15), loss=(LOSS, 0.5)):
    Z = stiffness * (1.0 + 1j * loss) - MASS * (2.0 * np.pi * frequency) ** 2
    return force / np.abs(Z), np.angle(Z)


@pytest.mark.parametrize(("stiffness", "loss"), [(0.82, 0.65), (1.25, 1.8)])
def test_parameters_far_within_a_wide_tolerance_are_exact(mode, stiffness, loss):
    """A line in ln(parameter) through the stated value is 3 % of the stiffness off there, many errors of the fit."""
    truth = {"stiffness": stiffness * STIFFNESS, "loss": loss * LOSS}
    library = {name: CATALOGUE[name] for name in ("viscous-coefficient", "coulomb-friction")}
    found = limited(library, explain, swept(truth, seed=7), mode, simulate=sprung)
    assert found.leading.effects == ()
    refitted = refitted_values(found.leading.best)
    np.testing.assert_allclose(refitted["stiffness"], stiffness - 1.0, atol=0.0005)
    np.testing.assert_allclose(refitted["loss"], loss - 1.0, atol=0.005)
    assert not any("extrapolated" in caution for caution in found.cautions)


def test_parameters_that_the_refit_moved_are_told(mode, no_rivals):
    """With nothing to blame, 18 % of a stiffness stands in the text, not only in its files; what did not move does not.

    Beyond the tolerances the fit ends at their limit, and an interval there would be of that limit.
    """
    truth = {"stiffness": 0.82 * STIFFNESS, "loss": LOSS}
    found = limited((), dp.diagnose, swept(truth, seed=7), mode, simulate=sprung, compare=False)
    assert "already fits" in found.sentences[0]
    number = r"([-+]\d+\.?\d*)"
    (told,) = [sentence for sentence in found.sentences if "own parameters" in sentence]
    said = re.search(rf"stiffness {number} % \({number} to {number}; 1\.3 tolerances\)\.$", told)
    value, low, high = map(float, said.groups())
    np.testing.assert_allclose(value, -18.0, atol=0.05)
    assert low < value < high

    def sure(force, frequency, *, stiffness=(STIFFNESS, 0.02)):
        return sprung(force, frequency, stiffness=stiffness, loss=LOSS)

    record = swept(truth | {"stiffness": 0.93 * STIFFNESS}, seed=7)
    found = limited((), dp.diagnose, record, mode, simulate=sure, compare=False)
    (told,) = describe_diagnosis(replace(found.diagnosis, in_library=1.0))["refit"]
    assert "(at the limit of 3 tolerances)" in told


def test_a_parameter_beyond_its_tolerance_is_told_beside_a_force(record, mode):
    """A mass off by five tolerances, and friction: the first sentence has its value beside a gain of the sensor."""

    def function(force, frequency, *, mass=(MASS / 1.05, 0.01), stiffness=(STIFFNESS, 0.01)):
        Z = stiffness * (1.0 + 1j * LOSS) - mass * (2.0 * np.pi * frequency) ** 2
        return force / np.abs(Z), np.angle(Z)

    few = dp.Record(record.table[record.table["sweep"] != "B"])
    found = limited(("amplitude-scale", "coulomb-friction"), explain, few, mode, simulate=function)
    said = re.match(r"a mass of (\S+) .* in the simulator beside coulomb-friction \(", name_better(found.outside))
    np.testing.assert_allclose(float(said[1]), MASS, rtol=0.01)


def coupled(force, frequency, *, first=(1.0, 0.01), second=(1.04, 0.01)):
    """Two oscillators of close frequencies, the second driven through a weak spring only."""
    s = 1j * frequency / FREQUENCY
    far = second + 0.01 + 0.01 * s + s**2
    Z = STIFFNESS * (first + 0.01 + 0.01 * s + s**2 - 1e-4 / far)
    return force / np.abs(Z), np.angle(Z)


def test_a_parameter_is_sought_on_both_sides_of_its_stated_value(mode):
    """The second of two close modes lies below the first, not above: a line from above leads away from it."""
    rng, frequency = np.random.default_rng(4), FREQUENCY * (1.0 + 0.04 * np.linspace(-1.0, 1.0, 41))
    A, phase = coupled(np.ones(41), frequency, first=1.01, second=0.99)
    table = {"sweep": "A", "force": 1.0, "frequency": frequency}
    table |= {"amplitude": A * (1.0 + 0.01 * rng.normal(size=41)), "phase": phase + 0.01 * rng.normal(size=41)}
    found = limited(("planar-coupling",), explain, dp.Record(pd.DataFrame(table)), mode, simulate=coupled)
    said = re.match(r"a second of (\S+) .* in the simulator \(", name_better(found.outside))
    np.testing.assert_allclose(float(said[1]), 0.99, rtol=0.003)


def test_a_parameter_beyond_its_tolerance_is_told_where_no_effect_is(mode):
    """Nothing in the library is like a loss that is half again as large, at a tolerance of 3 %."""

    def function(force, frequency, *, loss=(LOSS / 1.5, 0.03)):
        return sprung(force, frequency, stiffness=STIFFNESS, loss=loss)

    rows = swept({"stiffness": STIFFNESS, "loss": LOSS}, seed=7)
    found = limited(("phase-lag",), dp.diagnose, rows, mode, simulate=function, compare=False)
    said = re.search(
        r"nothing in the library explains it; it would be explained by a loss of (\S+)", found.sentences[0]
    )
    np.testing.assert_allclose(float(said[1]), LOSS, rtol=0.01)


def test_a_simulator_that_fails_at_the_fitted_parameters_is_told(mode):
    def brittle(force, frequency, *, stiffness=(STIFFNESS, 0.15)):
        if stiffness < 0.9 * STIFFNESS:
            raise ArithmeticError("no convergence")
        return sprung(force, frequency, stiffness=stiffness, loss=LOSS)

    record = swept({"stiffness": 0.82 * STIFFNESS, "loss": LOSS}, seed=7)
    found = limited({}, explain, record, mode, simulate=brittle)
    (told,) = [caution for caution in found.cautions if "extrapolated" in caution]
    assert re.search(r"stiffness = \d+\.?\d* ends with ArithmeticError", told)


def test_a_simulator_without_freedom_may_be_of_another_frequency(mode):
    """1 % off in stiffness, where a line from zero to three tolerances of the mode promises nothing."""

    def fixed(force, frequency, *, stiffness=(STIFFNESS, 0.0)):
        return sprung(force, frequency, stiffness=stiffness, loss=LOSS)

    library = {name: CATALOGUE[name] for name in ("natural-frequency", "drift")}
    mode = replace(mode, damping={})  # the function has its own: nobody is told that it has none
    record = swept({"stiffness": 0.99 * STIFFNESS, "loss": LOSS}, seed=15)
    found = limited(library, explain, record, mode, simulate=fixed)
    assert found.leading.effects == ("natural-frequency",)
    assert not any("no damping" in caution for caution in found.cautions)


def test_every_effect_beside_a_simulator_is_in_the_corrected_file_as_it_was_fitted(mode):
    """The table of every form, read as a file's, makes the prediction of the fit; a law in place of the viscous too."""
    problem = setting(swept({"stiffness": STIFFNESS, "loss": LOSS}, seed=7), mode, [], sprung, (), ()).problem
    rows, simulation = problem.rows, problem.simulation
    for effect in CATALOGUE.values():
        for form in list_forms(effect, problem.scales):
            model = Model(problem, (Part(form, form.natural),), Scatter(1e-9, 1e-9))
            y = np.full((1, model.size + 2 * model.sweeps), 0.1)
            y[:, : len(simulation.names)] = 0.0
            fit = SimpleNamespace(model=model, y=y[0])
            given = replace(model, parts=())
            given = replace(given, problem=replace(problem, simulation=replace(simulation, mode=corrected_mode(fit))))
            fitted = predict(model.terms(y[:, : model.size]), rows.u, rows.drive)
            read = predict(given.terms(y[:, : given.size]), rows.u, rows.drive)
            for name in ("u", "turned"):
                np.testing.assert_allclose(getattr(read, name), getattr(fitted, name), atol=1e-6, err_msg=effect.name)
