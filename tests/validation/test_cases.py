"""Drawn cases: steady by doubling dwell and steps, decided by their seed, and labelled with what is so."""

from __future__ import annotations

import tomllib
from collections import Counter

import numpy as np
import pytest

from damping_validation.generator import (
    BLIND_CASES,
    BLIND_SEED,
    DEVELOPMENT_SEED,
    NULLS,
    PAIRS,
    draw,
    draw_case,
    strata,
)
from damping_validation.generator.refit import KINDS, LIBRARY, OUTSIDE, applied, gap
from damping_validation.generator.steady import doubling, guesses
from damping_validation.generator.structure import chosen_rows


@pytest.mark.parametrize("name", KINDS)
def test_doubling_dwell_and_steps_changes_far_less_than_the_noise(name):
    drawn = draw(name, False, np.random.default_rng([5, *name.encode()]))
    structure, rows = applied(drawn.effects, drawn.bench)
    some = np.zeros(rows.omega.size, bool)
    some[:: max(rows.omega.size // 12, 1)] = True
    rows = chosen_rows(rows, some)
    dwell, steps = doubling(structure, rows, guesses(structure, rows), dwell=2)
    assert dwell < 1e-5  # of the amplitude; the noise is at least 7e-3 (Newton stops at 1e-6)
    assert steps < 0.1 * drawn.noise.share.min()


@pytest.mark.parametrize("kind", ["null:scatter", "pair:force-instrument", "drift"])
def test_the_seed_decides_a_case(kind):
    first, again, other = (draw_case(kind, True, (3, number)) for number in (1, 1, 3))
    assert first == again
    assert first.data != other.data


def test_the_name_is_nowhere_in_the_numbers():
    first, other = draw_case("phase-lag", False, (3, 4), "one"), draw_case("phase-lag", False, (3, 4), "two")
    assert first.data == other.data
    assert first.model.replace("one", "two") == other.model


@pytest.mark.parametrize("kind", NULLS)
def test_null_cases_leave_nothing_to_explain(kind):
    for number in range(4):
        drawn = draw(kind, number % 2 == 1, np.random.default_rng([7, number]))
        # what averages differ from the integration in time, with friction in the simulation, is below a tenth of sigma
        assert drawn.gap < 0.1
        if kind == "null:nothing":
            assert drawn.bench.deviation == (0.0, 0.0, 0.0)
        assert (drawn.bench.scatter[0] > 0) == (kind == "null:scatter")


def test_gaps_spread_over_their_range():
    kinds = ("phase-lag", "amplitude-scale", "residual-modes", "planar-coupling")
    gaps = [draw(kinds[n % 4], n % 3 == 0, np.random.default_rng([9, n])).gap for n in range(16)]
    assert max(gaps) < 33.0  # drawn to 30, met to 5 %
    # log-uniform from .3 to 30 or the largest the effect can leave: of 16 about 8 lie in the lower half and 6 to 8 in
    # the upper; fewer than 2 in either has a chance of 1e-3
    assert 2 <= sum(g < 3.0 for g in gaps) <= 14


def test_a_lag_leaves_itself_over_the_noise():
    """A constant lag that no parameter imitates leaves about lag/sd in the phases, so 1/sqrt 2 of that in all cells."""
    drawn = draw("phase-lag", False, np.random.default_rng(12))
    expected = drawn.effects[0].size / drawn.noise.phase[0] / np.sqrt(2)
    assert 0.5 * expected < drawn.gap <= 1.01 * expected  # a shift of frequency takes up a part of it


def test_a_gain_alters_the_amplitudes_alone():
    label = draw_case("amplitude-scale", False, (3, 9)).label
    size, sign = label["sizes"][0]["size"], label["sizes"][0]["shape"][0]
    assert label["altered"]["phase"] == []
    share = draw("amplitude-scale", False, np.random.default_rng((3, 9))).noise.share[0]
    everywhere = abs(sign * size / (1 + sign * size)) > share
    assert len(label["altered"]["amplitude"]) == (label["rows"] if everywhere else 0)


def test_both_of_a_pair_are_needed():
    for number, kind in enumerate(PAIRS):
        drawn = draw(kind, False, np.random.default_rng([11, number]))
        assert len(drawn.effects) == 2
        assert min(drawn.without_each) >= 1.0
        assert gap(drawn.cells, drawn.bench, drawn.effects) < 0.3  # with both, only what averages differ is left


def test_another_effect_never_explains_more_than_all_is():
    label = next(
        label
        for number in range(9, 20)
        if (label := draw_case("amplitude-scale", False, (3, number), nearest=True).label)["gap"] >= 1.0
    )
    assert label["nearest"]["effect"] in LIBRARY
    assert 0.0 < label["nearest"]["left"] <= label["gap"] * 1.001  # an effect of size 0 is the simulation refitted


def test_the_model_holds_the_simulation_and_nothing_of_the_truth():
    case = draw_case("natural-frequency", False, (3, 2))
    drawn = draw("natural-frequency", False, np.random.default_rng((3, 2)))
    model = tomllib.loads(case.model)
    assert model["mode"]["frequency"] == pytest.approx(
        drawn.bench.nominal.omega / 2 / np.pi, rel=1e-8
    )  # digits written
    assert set(model) <= {"mode", "damping", "repeatability"}
    assert not any(word in case.model + case.data for word in (*KINDS, "pair", "null"))


def test_a_run_has_its_nulls_and_every_kind_in_both_conditions():
    plan = strata(BLIND_CASES)
    assert len(plan) == BLIND_CASES
    assert sum(stratum.kind in NULLS for stratum in plan) >= 500
    counts = Counter(plan)
    assert {stratum.kind for stratum in plan} == {*NULLS, *LIBRARY, *OUTSIDE, *PAIRS}
    assert all(abs(counts[s] - counts[type(s)(s.kind, not s.field)]) <= 1 for s in counts)
    assert BLIND_SEED != DEVELOPMENT_SEED
