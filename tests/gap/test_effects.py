"""Physics: what the generator integrates in time is what the solver's own form of that effect predicts."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from damping.effects import CATALOGUE, with_effects
from damping.effects.contract import Scales
from damping.effects.terms import predict
from damping.gap.corrected import effect_intervals, effect_values, refitted_values
from damping.gap.diagnose import diagnose
from damping.gap.model import steady
from damping.gap.problem import setting
from damping.gap.search import Search
from damping.gap.size import fitted_terms
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_validation.generator import draw
from damping_validation.generator.effects import TrueEffect
from damping_validation.generator.plan import columns, describe_data_text, describe_model_text, force_unit
from damping_validation.generator.refit import applied
from damping_validation.generator.steady import true_record
from tests.gap.limited import limited

#: Largest root mean square, in sigma of 1 %, that an effect may leave of its own noise-free record. The forms are first
#: harmonics: at the lowest level friction is 0.4 of the force, and its third harmonic a few tenths of a per cent of the
#: motion beside resonance. One residual mode stands for three, on either side of the rows. All others are exact but for
#: what the priors pull (a fit ends within 0.01 of the largest ln p: 0.14 sigma in all of 120 values, 0.013 in each).
LEFT = {"coulomb-friction": 0.2, "residual-modes": 0.25}
EXACT = 0.02
#: Effects that the generator of blind cases does not integrate.
BEYOND = {
    *("second-mode", "drift", "time-delay", "level-offset", "sensor-saturation", "background", "sweep-rate"),
    *("velocity-power", "displacement-velocity-power"),  # asked for where they are simulated only
}
#: Effects that the generator of blind cases integrates in time; the others are held to closed forms elsewhere.
NAMES = sorted(set(CATALOGUE) - BEYOND)


@pytest.mark.parametrize(
    ("off", "damped"),
    [(1.012, 2.5), *(pytest.param(*of, marks=pytest.mark.slow) for of in ((0.988, 1.7), (1.03, 0.6)))],
)
def test_a_simulation_wrong_in_frequency_and_damping_is_named_so(lab, no_folds, off, damped, among):
    """Two planes at an angle near a right one, or two other effects, stand for a mode that is elsewhere altogether."""
    rows = lab.bench().rows
    rows = replace(rows, omega=rows.omega * off)
    cells = lab.linear(rows, omega=lab.omega * off, viscous=lab.viscous * damped)
    found = limited(among("drift"), diagnose, lab.record(rows, cells, seed=4), lab.mode())
    assert found.leading.key == {"natural-frequency", "viscous-coefficient"}
    values = effect_values(found.leading.best)
    # standard errors of 60 rows of 1 %: 1e-5 of the frequency, the mass within its tolerance of the damping
    np.testing.assert_allclose(values["natural-frequency"]["relative"], off - 1.0, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(values["viscous-coefficient"]["relative"], damped - 1.0, rtol=0.05, atol=0.0)
    own, intervals = refitted_values(found.leading.best), effect_intervals(found.leading.best)["simulation"]
    assert own.keys() == intervals.keys() == {"mass"}  # what else is free has its interval too
    assert intervals["mass"][0] < own["mass"] < intervals["mass"][1]


def test_two_planes_of_any_distance_are_a_model_that_can_be_written(lab):
    """A plane below the first at a distance beyond 1 had a frequency below 0, and its model file could not be made."""
    scales = Scales(0.01, 0.05, lab.omega, lab.mass, lab.viscous, lab.xi, 0.06, 0.001, 0.05)
    for form in CATALOGUE["planar-coupling"].forms(scales):
        table = {name: float(value) for name, value in form.report(0.3, 3.5, 1.0).items()}
        lab.mode(effects={"planar-coupling": table})  # refuses a ratio that is not above 0


@pytest.fixture(scope="session")
def fitted(lab):
    """Fits of noise-free records with a library of the true effect alone, by effect."""
    return {name: alone(name, lab.record(lab.bench().rows, lab.truth(name)), lab.mode()) for name in NAMES}


def alone(name, record, mode):
    """Hypotheses fitted with a library of one effect."""
    start = setting(record, mode)
    search = Search(start.problem, {name: CATALOGUE[name]}, start.unknowns)
    search.run()
    return search.hypotheses


@pytest.mark.parametrize("name", NAMES)
def test_an_effect_is_fitted_by_its_own_form_far_below_the_noise(fitted, name):
    null, own = fitted[name][frozenset()].best, fitted[name][frozenset({name})].best
    assert np.sqrt(np.mean(own.r**2)) < LEFT.get(name, EXACT)
    # the gap is there without it; a wrong gain of 10 sigma is the one that the free mass takes in for the most part
    assert np.sqrt(np.mean(null.r**2)) > 2.0


@pytest.mark.parametrize("name", NAMES)
def test_the_reported_table_reproduces_the_prediction_of_the_fit(fitted, name):
    own = fitted[name][frozenset({name})].best
    rows, parts = own.model.problem.rows, own.model.parts
    with_form = fitted_terms(own, deviations=False)
    without = fitted_terms(own, effects=False, deviations=False)
    with_table = with_effects(without, {name: effect_values(own)[name]})
    assert [part.form.effect for part in parts] == [name]
    a, b = (predict(terms, rows.u, rows.drive).P for terms in (with_form, with_table))
    # the same formula from the same numbers: rounding only, of ln(prediction)
    np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("name", NAMES)
def test_the_steady_state_of_the_fit_is_the_record(lab, fitted, name):
    own = fitted[name][frozenset({name})].best
    rows = own.model.problem.rows
    motion = steady(fitted_terms(own), rows, rows.u + 0.05)  # not started where it should arrive
    left = (motion.u - rows.u) / lab.noise
    # the steady state solved for, where a fit is of first order about the measured amplitude; the same bound
    assert np.sqrt(np.mean(left**2)) < LEFT.get(name, EXACT)


def test_parameters_of_damping_forces(lab, fitted):
    for name in ("displacement", "velocity-squared", "displacement-velocity", "quadratic-displacement"):
        size, _ = lab.effects[name]
        true = size * force_unit(name, lab.viscous, lab.omega, lab.A)
        found = effect_values(fitted[name][frozenset({name})].best)[name]["coefficient"]
        # the prior draws a coefficient, known to about 1 % at 1 % noise of 120 values, by a hundredth of its own
        # uncertainty; case II is parted from viscous damping (5 % free) by the width of the band only
        np.testing.assert_allclose(found, true, rtol=0.02 if name == "displacement" else 0.005, err_msg=name)


def test_parameters_of_springs_and_joints(lab, fitted):
    spring = 2 * lab.xi * lab.mass * lab.omega**2 * 4 / 3 / lab.A**2
    for name in ("stiffness-hardening", "stiffness-softening"):
        found = effect_values(fitted[name][frozenset({name})].best)[name]
        assert set(found) == {"coefficient"}  # a cubic spring, not one of exponent 2
        np.testing.assert_allclose(found["coefficient"], spring, rtol=0.002)  # 0.1 % is its uncertainty at 1 % noise
    size, (limit,) = lab.effects["slip"]
    found = effect_values(fitted["slip"][frozenset({"slip"})].best)["slip"]
    np.testing.assert_allclose(found["stiffness"], size * 2 * lab.xi * lab.mass * lab.omega**2, rtol=0.005)  # as above
    np.testing.assert_allclose(found["limit"], limit * lab.A, rtol=0.005)  # as above


def test_parameters_of_a_joint_that_yields_gradually(lab):
    """Of Bouc and Wen's law: no joints of distributed limits stand in for it, nor do two."""
    size, limit = 2.0, 0.3
    rows = lab.bench().rows
    cells = lab.cells(*true_record(*applied((TrueEffect("slip:smooth", size, (limit,)),), lab.bench())))
    own = alone("slip", lab.record(rows, cells), lab.mode())[frozenset({"slip"})].best
    assert np.sqrt(np.mean(own.r**2)) < EXACT
    found = effect_values(own)["slip"]
    assert found.keys() == {"stiffness", "limit", "smooth", "relief"}
    np.testing.assert_allclose(found["relief"], 1.0, rtol=0.02)  # 1 % noise leaves it 0.07: the prior pulls more
    np.testing.assert_allclose(found["stiffness"], size * 2 * lab.xi * lab.mass * lab.omega**2, rtol=0.01)  # as above
    np.testing.assert_allclose(found["limit"], limit * lab.A, rtol=0.01)  # as above


def test_parameters_of_the_second_plane(lab, fitted):
    size, (apart, damping) = lab.effects["planar-coupling"]
    found = effect_values(fitted["planar-coupling"][frozenset({"planar-coupling"})].best)["planar-coupling"]
    # as identified at 1 % noise to about 0.005 rad and 3e-5, of which the prior costs little
    np.testing.assert_allclose(found["angle"], np.arcsin(np.sqrt(size)), rtol=0.0, atol=0.002)
    np.testing.assert_allclose(found["frequency_ratio"], 1.0 + apart, rtol=0.0, atol=3e-5)
    # the generator's second plane has the first's damping ratio: its coefficient is as much larger as its frequency
    np.testing.assert_allclose(found["damping_ratio"], damping * (1.0 + apart), rtol=0.01)


def test_parameters_of_the_instruments(lab, fitted):
    def values(name):
        return effect_values(fitted[name][frozenset({name})].best)[name]

    # the mass may be off by 2 % at the cost of one unit: a factor of gain is known to a part of that
    np.testing.assert_allclose(values("amplitude-scale")["factor"], 1.1, rtol=0.005)
    np.testing.assert_allclose(values("phase-lag")["lag"], -0.1, rtol=0.0, atol=5e-4)  # half of 1 %/sqrt(60) rad
    size, (width, _, _) = lab.effects["force-dropout"]
    found = values("force-dropout")
    assert "lorentzian" not in found  # the dip is a Gaussian one
    # both are known to about 1 % at this noise
    np.testing.assert_allclose([found["depth"], found["width"]], [size, width], rtol=0.005)


@pytest.mark.parametrize("name", sorted(CATALOGUE))
@pytest.mark.parametrize("sweeps", [1, 3, 6])
def test_a_model_file_takes_whatever_a_fit_may_say(name, sweeps):
    """Every form at four standard deviations of each of its shapes: the table that it reports is within its bounds."""
    scales = Scales(
        1e-4, 1e-3, 150.0, 40.0, 100.0, bandwidth=0.008, reach=0.05, frequency=0.01, damping=0.1, sweeps=sweeps
    )
    bounds = {shape.name: shape for shape in CATALOGUE[name].shapes}
    for form in CATALOGUE[name].forms(scales):
        for moved, far in product(range(len(form.shapes) or 1), (-4.0, 4.0)):
            shapes = [variable.value(far if k == moved else 0.0) for k, variable in enumerate(form.shapes)]
            table = dict(form.report(form.natural, *shapes))
            assert table.pop("instead", 0.0) == form.whole  # a corrected model has the force in its place
            for key, value in table.items():
                bound = bounds[key]
                assert max(bound.least, np.nextafter(bound.above, np.inf)) <= value < bound.below, key


def test_wrong_parameters_of_the_simulation(fitted):
    own = fitted["viscous-coefficient"][frozenset({"viscous-coefficient"})].best
    # drawn 3 + 5 tolerances of 5 % too high, and 3 + 2 of 0.1 % too low; uncertainty at 1 % noise 0.2 % and 1e-5
    np.testing.assert_allclose(effect_values(own)["viscous-coefficient"]["relative"], 0.4, rtol=0.0, atol=5e-4)
    own = fitted["natural-frequency"][frozenset({"natural-frequency"})].best
    np.testing.assert_allclose(effect_values(own)["natural-frequency"]["relative"], -0.005, rtol=0.0, atol=1e-5)


@pytest.mark.parametrize("name", ["slip", "residual-modes", "force-dropout"])
def test_drawn_cases_are_fitted_too(name, tmp_path):
    """As the blind cases are: other forces in the simulation, sweeps that scatter, parameters off; but no noise."""
    drawn = draw(name, False, np.random.default_rng((97, 1)))
    bench, cells = drawn.bench, drawn.cells
    (tmp_path / "data.csv").write_text(
        describe_data_text(columns(bench.rows, drawn.noise, cells.amplitude, cells.phase))
    )
    (tmp_path / "model.toml").write_text(
        describe_model_text("drawn", replace(bench, scatter_declared=bench.scatter[0] > 0.0))
    )
    own = alone(name, read_record(tmp_path / "data.csv"), read_mode(tmp_path / "model.toml"))[frozenset({name})].best
    # 0.3 sigma shift chi-square of 200 values by 18, less than its standard deviation of 20: it is not seen. The centre
    # of a drawn dip of force lies off resonance, where the form has it
    assert np.sqrt(np.mean(own.r**2)) < 0.3
