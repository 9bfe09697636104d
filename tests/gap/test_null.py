"""Honest simulations: scatter from sweep to sweep, outliers and parameters within tolerance are no effect."""

from __future__ import annotations

import numpy as np
import pytest

from damping.effects import CATALOGUE
from damping.gap.corrected import effect_values
from damping.gap.directed import basis, directed_tests, unexplained
from damping.gap.problem import setting
from damping.gap.search import search_hypotheses
from damping.gap.weighing import cover_probability, weigh_hypotheses
from damping.records.record import Record

GAIN = 0.01
JITTER = 3e-4
SEEDS = range(6)
#: Of six honest simulations, at a rate of 1 % wrongly accused, two or more would be accused once in 680 times.
MOST = 1
#: The first two of them, of which none may be accused, and all.
PARTS = pytest.mark.parametrize(("seeds", "most"), [(SEEDS[:2], 0), pytest.param(SEEDS, MOST, marks=pytest.mark.slow)])


@pytest.fixture(scope="module")
def scattered(lab):
    """Records of viscous damping in closed form, each sweep with its own gain and frequency."""

    def record(seed, wild=0.0, levels=4):
        rows = lab.bench(levels=levels, points=18).rows
        rng = np.random.default_rng((7, seed))
        gain = 1.0 + GAIN * rng.normal(size=levels)[rows.sweep]
        omega = lab.omega * (1.0 + JITTER * rng.normal(size=levels)[rows.sweep])
        return lab.record(rows, lab.linear(rows, gain=gain, omega=omega), seed, wild)

    return record


def found(record, mode, library=CATALOGUE):
    """Effects of the leading explanation, and whether it leaves something unexplained."""
    known, search = search_hypotheses(setting(record, mode), library)
    leading = search.ranked()[0]
    left = known.dispersion > 1.0 or unexplained(leading.best, directed_tests(leading.best), library)
    return leading.effects, left


@PARTS
def test_scatter_that_is_stated_accuses_nobody(lab, scattered, seeds, most):
    answers = [found(scattered(seed), lab.mode(GAIN, JITTER)) for seed in seeds]
    assert sum(bool(effects) or left for effects, left in answers) <= most, answers


@PARTS
def test_scatter_that_is_not_stated_is_estimated_and_accuses_nobody(lab, scattered, seeds, most):
    answers = [found(scattered(seed), lab.mode(None, None)) for seed in seeds]
    assert sum(bool(effects) or left for effects, left in answers) <= most, answers


@pytest.mark.parametrize("shift", [0.012, pytest.param(-0.012, marks=pytest.mark.slow)])
def test_levels_that_scatter_do_not_hide_a_simple_cause(lab, shift, among):
    """A wrong natural frequency, unstated scatter of 3 % and no phase: drift with an offset level, or slip, led."""
    rows = lab.bench(5, 12).rows
    gain = np.exp(np.random.default_rng(3).normal(0.0, 0.03, 5))[rows.sweep]
    true = lab.linear(rows, omega=2.0 * np.pi * lab.mode().frequency * (1.0 + shift), gain=gain)
    record = Record(lab.record(rows, true, 3).frame.drop(columns=["phase", "phase_sd"]))
    _, search = search_hypotheses(setting(record, lab.mode(None, None)), among("drift", "level-offset", "slip"))
    leading = search.ranked()[0]
    assert leading.effects == ("natural-frequency",)
    assert effect_values(leading.best)["natural-frequency"]["relative"] == pytest.approx(shift, abs=0.001)


def test_scatter_left_out_makes_honest_simulations_look_guilty(lab, scattered):
    few = {name: CATALOGUE[name] for name in ("natural-frequency", "stiffness-hardening", "stiffness-softening")}
    answers = [found(scattered(seed), lab.mode(0.0, 0.0), few) for seed in SEEDS]
    # four gains of 1 sigma over 11 rows each add 44 to chi-square on average, of which the mass (free by 2 %) takes in
    # a quarter, and the frequencies add about as much: nearly all, all but one of six (more so with more effects)
    assert sum(bool(effects) or left for effects, left in answers) >= len(SEEDS) - 1, answers


@pytest.mark.parametrize("repeatability", [(GAIN, JITTER), pytest.param((None, None), marks=pytest.mark.slow)])
def test_outliers_accuse_nobody(lab, scattered, repeatability):
    answers = [found(scattered(seed, wild=0.03), lab.mode(*repeatability)) for seed in range(10, 12)]
    assert not any(effects for effects, _ in answers), answers  # two at 1 %: once in 50 times, and seeds are fixed
    assert sum(left for _, left in answers) <= MOST, answers


@pytest.mark.parametrize(
    ("omega", "viscous"), [(1.5, -1.5), (-2.0, 0.5), (0.5, 2.0)], ids=["both", "frequency", "viscous"]
)
def test_parameters_within_tolerance_are_not_accused(lab, omega, viscous):
    rows = lab.bench().rows
    true = {"omega": lab.omega * (1 + 0.001 * omega), "viscous": lab.viscous * (1 + 0.05 * viscous)}
    assert found(lab.record(rows, lab.linear(rows, **true), 3), lab.mode()) == ((), False)


@pytest.mark.parametrize("side", [-1, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("name", "unit"), [("natural-frequency", 0.001), ("viscous-coefficient", 0.05)])
def test_parameters_far_beyond_tolerance_are_named(lab, name, unit, side):
    rows = lab.bench().rows
    key, nominal = ("omega", lab.omega) if name == "natural-frequency" else ("viscous", lab.viscous)
    cells = lab.linear(rows, **{key: nominal * (1.0 + side * 5.0 * unit)})  # 5 tolerances
    _, search = search_hypotheses(setting(lab.record(rows, cells, 3), lab.mode()), CATALOGUE)
    explanations = cover_probability(weigh_hypotheses(search.ranked()))
    assert explanations[0].effects == (name,)
    # at 1 % noise of 120 values frequency and damping are known to 1e-5 and 0.2 %; only damping of case II is linear
    # too: it is viscous damping with a coefficient that falls as 1/omega, by 6 % to either end of the band
    alike = {(name,), ("displacement",)} if (name, side) == ("viscous-coefficient", 1) else {(name,)}
    assert {one.effects for one in explanations} <= alike


@pytest.mark.parametrize("size", [4, 6, 7])
@pytest.mark.parametrize("places", [np.linspace(0.0, 2.0, 30) ** 2, np.repeat([1.0, 3.0], 4)])
def test_splines_of_directed_tests_hold_every_parabola(size, places):
    """Also where knots at quantiles all but coincide. Beyond the places they stay as at the ends."""
    at = np.concatenate([places, np.linspace(places.min(), places.max(), 40)])
    splines, powers = basis(places, size, at), np.column_stack([np.ones_like(at), at, at**2])
    fitted = splines.T @ np.linalg.lstsq(splines.T, powers)[0]
    np.testing.assert_allclose(fitted, powers, rtol=0.0, atol=1e-12)  # roundings of numbers up to 16
    near, far = (basis(places, size, np.array(beyond)) for beyond in ([-1.0, 5.0], [-9.0, 90.0]))
    np.testing.assert_array_equal(near, far)
    assert splines.min() >= 0.0
    np.testing.assert_allclose(splines.sum(axis=0), 1.0, rtol=1e-14)
