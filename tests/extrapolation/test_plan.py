"""Which laws take part, what they weigh, and when a prediction is refused."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import softmax

from benchmarks._structures import CANDIDATES, simulated_levels, structures
from damping.errors import AnalysisError
from damping.extrapolation import draw_evidence, extrapolate_loads, leave_higher_levels_out
from damping.extrapolation.near import near_resonance, plan_loads
from damping.infer.doubt import JOINTS
from damping.infer.evidence import brief_evidence
from damping.infer.law import Law
from damping.ranking import prior_masses
from damping_validation.truths import draw_truth, peaks

STRUCTURES = {s.name: s for s in structures()}


def levels(name, number, noise=0.01, seed=0):
    return simulated_levels(STRUCTURES[name], number, 4.0, noise, np.random.default_rng(seed))


def test_the_resonance_says_how_far_damping_may_let_go():
    """A joint and a damper of their own code, frequencies read to 1e-4: wider either way, narrower above."""
    force, design = np.geomspace(0.6, 1.6, 4), [6.4]
    laws = [Law(("viscous",)), Law(("viscous", "velocity-squared")), Law(("viscous", "slip"))]
    for name, seed in (("Bouc-Wen", 0), ("viscous + velocity-squared", 3)):
        truth = draw_truth(name, np.random.default_rng(seed))
        data = peaks(force, truth.amplitude(force))
        data = replace(data, tested_omega=truth.omega(data.A) * (1.0 + 1e-4 * np.array([1.0, -1.0, 1.0, -1.0])))
        plan = plan_loads(data, laws, mass=truth.mass, estimate=brief_evidence)
        loads, unknown = (
            extrapolate_loads(data, design, plan=own).loads for own in (plan, replace(plan, joint=JOINTS))
        )
        higher, lower = loads.average.high / unknown.average.high, loads.average.low / unknown.average.low
        said = any("as where a joint slips" in caution for caution in loads.cautions[0])
        if name == "Bouc-Wen":
            assert plan.joint > 0.5
            assert higher > 1.02
            assert lower < 1.0
            assert said
        else:
            assert plan.joint < 0.1
            assert higher < 0.98
            np.testing.assert_allclose(lower, 1.0, rtol=0.01)  # another draw of the average: the lower end is its own
            assert not said


@pytest.mark.parametrize("number", [3, 6])
def test_weights_add_to_one_and_the_true_law_takes_part(number):
    plan = plan_loads(levels("viscous + velocity-squared", number), CANDIDATES)
    np.testing.assert_allclose(sum(law.weight for law in plan.laws), 1.0, rtol=1e-12)
    assert Law(("viscous", "velocity-squared")) in [law.law for law in plan.laws]
    assert all(a.weight >= b.weight for a, b in zip(plan.laws, plan.laws[1:], strict=False))


def test_weights_are_those_of_the_evidence():
    plan = plan_loads(levels("viscous", 3), CANDIDATES)
    log_z = np.array([law.evidence.log_z for law in plan.laws])
    prior = np.log(prior_masses([law.law for law in plan.laws]))
    np.testing.assert_allclose([law.weight for law in plan.laws], softmax(log_z + prior), rtol=1e-12)


def test_two_levels_allow_half_as_much_again_and_no_more():
    data = levels("viscous", 2)
    forces = data.tested_force.max() * np.array([1.4, 2.0])
    extrapolated = extrapolate_loads(data, forces, laws=CANDIDATES, sampler=draw_evidence)
    plan, loads = extrapolated.plan, extrapolated.loads
    np.testing.assert_allclose(plan.limit, 1.5 * data.tested_force.max(), rtol=1e-12)
    assert np.isfinite(loads.average.median[0])
    assert np.isnan([loads.average.median[1], loads.average.low[1], loads.linear[1], loads.overprediction[1]]).all()
    assert all(np.isnan(band.high[1]) for band in loads.by_model)
    assert all(np.isnan(part[1]) for part in loads.parts.values())
    assert loads.cautions[1][0].startswith("no prediction beyond 3: fewer than 3 levels")
    assert loads.limit == plan.limit


def onset(peaks, top):
    """Viscous up to the last level, where damping is larger (or smaller) by a factor."""
    F = np.array([1.0, 1.5, 2.2, 3.0, 4.0])
    A = F / 10.0 * np.array([1.002, 0.998, 1.001, 0.999, 1.0 / top])
    return peaks(A, F, 10.0)


@pytest.mark.parametrize("top", [1.25, 0.8])
def test_a_law_that_changes_at_the_top_widens_the_band(peaks, top):
    """Whether damping sets in or falls off there: at twice the force at least three times as wide as without."""
    widths = []
    for factor in (1.0, top):
        data = onset(peaks, factor)
        band = extrapolate_loads(data, [8.0], laws=CANDIDATES, sampler=draw_evidence).loads.average
        widths.append(float(np.log(band.high / band.low)[0]))
    assert widths[1] > 3.0 * widths[0]


def test_nothing_fits_is_an_analysis_error(peaks):
    data = peaks(np.array([1.0, 2.0]), np.array([1.0, 2.0]), 10.0)
    with pytest.raises(AnalysisError, match="friction alone"):
        plan_loads(data, [Law(("coulomb",))])


def test_leaving_higher_levels_out_sees_nothing_of_them(few_laws):
    data = levels("viscous + velocity-squared", 4)
    table = leave_higher_levels_out(data, 0.9)
    assert table["levels"].tolist() == [2, 2, 3]
    assert table["sweep"].tolist() == ["level 3", "level 4", "level 4"]
    lower = data.keep_sweeps(np.arange(4) < 2)
    loads = extrapolate_loads(lower, data.tested_force[2:], sampler=draw_evidence, least_weight=0.0).loads
    np.testing.assert_allclose(table["median"][:2], loads.average.median, rtol=1e-12)
    np.testing.assert_allclose(table["ratio"][:2], data.tested_force[2:] / data.tested_force[1], rtol=1e-12)


def test_a_sweep_at_constant_response_singles_out_no_law(swept):
    """One level at one amplitude: no law has half of the weight."""
    record = swept(STRUCTURES["viscous"].force, np.array([1.0]))
    table = record.table
    table["force"] = table["force"] * table["amplitude"].max() / table["amplitude"]
    table["amplitude"] = table["amplitude"].max()
    plan = plan_loads(near_resonance(record), CANDIDATES)
    assert max(law.weight for law in plan.laws) < 0.5
