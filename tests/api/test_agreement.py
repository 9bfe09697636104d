"""Ranking and diagnosis say in their first line where one holds alive what leaves the other's band."""

from dataclasses import replace

import numpy as np
import pytest

import damping as dp
from damping import extrapolation
from damping.agreement import simulate_resonance
from damping_reed1970 import data_folder


@pytest.fixture(scope="module")
def flagship() -> tuple[dp.Record, dp.Mode]:
    """Configuration II, first mode: three peaks, and a simulation whose damping is their mean (Tables 4.I, 4.II)."""
    folder = data_folder() / "saturn-v"
    return dp.read_record(folder / "records" / "config-2-mode-1.csv"), dp.read_mode(
        folder / "modes" / "config-2-mode-1.toml"
    )


@pytest.fixture(scope="module", autouse=True)
def planned_once():
    """Laws are weighed for the loads of a record once, not for either side of every comparison."""
    plan, made = extrapolation.plan_loads, {}

    def find(data, laws, seed, done, mode, estimate):
        key = (data.A.tobytes(), data.D.tobytes(), tuple(laws), seed, mode.mass, mode.tolerance, estimate)
        if key not in made:
            made[key] = plan(data, laws, seed, done, mode, estimate)
        return made[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(extrapolation, "plan_loads", find)
        yield


def test_values_from_the_same_rows_are_no_conflict(flagship):
    """``from_record``: the mean of the rows does not hold the damping, and no living explanation leaves the band."""
    record, mode = flagship
    loads = dp.extrapolate(record, mode, [90.0])
    assert loads.against == ()
    assert dp.diagnose(record, mode).against == ()


def test_both_say_where_they_disagree(flagship):
    """The same values as independent knowledge: slip is alive and goes where the band does not."""
    record, mode = flagship
    mode = replace(mode, tolerance=replace(mode.tolerance, from_record=False))
    loads, diagnosis = dp.extrapolate(record, mode, [90.0]), dp.diagnose(record, mode)
    (said,) = loads.against
    prediction = loads.to_json()["predictions"][0]
    assert f"{prediction['median']:.4g}" in said
    assert loads.to_json()["cautions"][0] == said
    assert diagnosis.to_json()["cautions"][0] == diagnosis.against[0]
    assert diagnosis.sentences[0].startswith("Ranking and diagnosis disagree")


def test_the_resonance_of_a_simulation_is_that_of_its_damping(flagship, few_laws):
    """A = F/(c omega_n) of viscous damping (Eq. 4.1.7)."""
    record, mode = flagship
    loads = dp.extrapolate(record, mode, [30.0, 90.0]).loads
    expected = loads.force / (1.643 * 2.0 * np.pi * mode.frequency)
    np.testing.assert_allclose(simulate_resonance(mode, loads), expected, rtol=1e-9)
