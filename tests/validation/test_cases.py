"""Drawn cases: steady by doubling dwell and steps, decided by their seed, and labelled with what is so."""

from __future__ import annotations

import tomllib
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from damping_validation.generator import NULLS, PAIRS, draw, draw_case, strata
from damping_validation.generator.balance import chosen_rows, recorded
from damping_validation.generator.effects import TrueEffect
from damping_validation.generator.refit import KINDS, LIBRARY, OUTSIDE, applied, gap, name_effect, predicted
from damping_validation.generator.steady import STEPS, TrueMotion, guesses, steady, steady_state, true_record

#: What a kind is at size zero: parameters three tolerances off, else the simulation itself.
WRONG = {"viscous-coefficient", "natural-frequency"}
#: A size at which each leaves a clear trace, where one would be too large for these rows.
MODERATE = {"coulomb-friction": 0.1, "stribeck": 0.1, "dithered-friction": 0.1, "planar-coupling": 0.2}


@pytest.fixture(scope="module")
def few(bench):
    """Every third row of the bench: what the physics of a kind needs."""
    return replace(bench, rows=chosen_rows(bench.rows, np.arange(bench.rows.omega.size) % 3 == 0))


#: Steps of a cycle, a quarter of those of a case: without jumps they are 1e-4 of the amplitude off.
COARSE = STEPS // 4


def integrated(structure, rows):
    """Amplitude and phase, in few steps."""
    return recorded(steady(structure, rows, guesses(structure, rows), COARSE)[0], rows)


@pytest.fixture(scope="module")
def plain(few):
    """What its simulation does: amplitude and phase, integrated and by averages."""
    simulation = applied((), few)
    return integrated(*simulation), predicted(*simulation)


def effect_on(name, bench, size):
    return TrueEffect(name, size, KINDS[name].draw(np.random.default_rng([5, *name.encode()]), bench))


@pytest.mark.parametrize("name", sorted(set(KINDS) - WRONG))
def test_at_no_strength_every_kind_is_the_simulation(name, few, plain):
    structure, rows = applied((effect_on(name, few, 1e-9),), few)
    # Newton stops at 1e-6 of the amplitude; a moving frequency, of which there are averages alone, leaves what one
    # row's dwell left, e^-(0.7/rate) = 0
    record, expected = (true_record, plain[1]) if rows.swept else (integrated, plain[0])
    np.testing.assert_allclose(record(structure, rows), expected, rtol=3e-6, atol=3e-6)


#: Largest distance of the averages from the motion, of the amplitude: the third harmonic of friction far from resonance
#: at the lower force, and forces bound to a speed whose averages are taken at resonance for rows up to 6 % beside it.
NEAR = 7e-3


@pytest.mark.parametrize("name", sorted(set(KINDS) - {"sweep-rate"}))
def test_averages_start_the_integration_near_its_end(name, few, plain):
    """An independent method: the first-harmonic balance against the motion that was integrated, at a moderate size."""
    effect = effect_on(name, few, MODERATE.get(name, 0.3 * min(KINDS[name].largest(few), 2.0)))
    structure, rows = applied((effect,), few)
    (amplitude, phase), (near, lag) = integrated(structure, rows), predicted(structure, rows)
    apart = np.abs(near * np.exp(-1j * lag) - amplitude * np.exp(-1j * phase)) / amplitude
    assert np.max(apart) < NEAR
    without, at = plain[1]
    assert np.max(np.abs(without * np.exp(-1j * at) - amplitude * np.exp(-1j * phase)) / amplitude) > 2 * NEAR


#: One each with friction, a joint and a partner; others of their kinds.
STEADY, FURTHER = ("coulomb-friction", "slip:smooth", "sloshing-tank"), ("stop", "heated-spring", "rub")


@pytest.mark.parametrize("name", [*STEADY, *(pytest.param(name, marks=pytest.mark.slow) for name in FURTHER)])
def test_doubling_dwell_and_steps_changes_far_less_than_the_noise(name, few):
    structure, rows = applied((effect_on(name, few, MODERATE.get(name, 0.5)),), few)
    motion = TrueMotion(structure, rows)
    state = steady_state(motion, guesses(structure, rows))
    once = motion.harmonics(state)[0]
    for _ in range(4):
        state = motion.cycle(state)[0]
    dwelt = motion.harmonics(state)[0]
    finer = steady(structure, rows, guesses(structure, rows), 2 * STEPS)[0]
    assert np.max(np.abs(dwelt - once) / np.abs(once)) < 1e-5  # the noise is at least 7e-3 (Newton stops at 1e-6)
    assert np.max(np.abs(finer - once) / np.abs(once)) < 7e-4  # a tenth of the least noise


def test_there_are_forty_kinds_and_half_as_many_in_no_library():
    assert len(KINDS) >= 40
    assert len(OUTSIDE) >= 20
    assert {name_effect(kind) for kind in LIBRARY}.isdisjoint(map(name_effect, OUTSIDE))


#: Kinds with a seed that is quickly drawn, and so is the next.
@pytest.mark.parametrize(("kind", "seed"), [("null:scatter", 1), ("pair:force-instrument", 3), ("drift", 5)])
def test_the_seed_decides_a_case(kind, seed):
    first, again, other = (draw_case(kind, True, (3, number)) for number in (seed, seed, seed + 1))
    assert first == again
    assert first.data != other.data


def test_the_name_is_nowhere_in_the_numbers():
    first, other = draw_case("phase-lag", False, (3, 4), "one"), draw_case("phase-lag", False, (3, 4), "two")
    assert first.data == other.data
    assert first.model.replace("one", "two") == other.model


@pytest.mark.parametrize("kind", NULLS)
def test_null_cases_leave_nothing_to_explain(kind):
    for number in (4, 5):  # quickly drawn
        drawn = draw(kind, number % 2 == 1, np.random.default_rng([7, number]))
        # what averages differ from the integration in time, with friction in the simulation, is below a tenth of sigma
        assert drawn.gap < 0.1
        if kind == "null:nothing":
            assert drawn.bench.deviation == (0.0, 0.0, 0.0)
        if kind != "null:swept":  # which scatters or not, by chance
            assert (drawn.bench.scatter[0] > 0) == (kind == "null:scatter")


@pytest.mark.slow
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
    plan = strata(2000)
    assert len(plan) == 2000
    assert sum(stratum.kind in NULLS for stratum in plan) >= 500
    counts = Counter(plan)
    assert {stratum.kind for stratum in plan} == {*NULLS, *LIBRARY, *OUTSIDE, *PAIRS}
    assert all(abs(counts[s] - counts[type(s)(s.kind, not s.field)]) <= 1 for s in counts)
