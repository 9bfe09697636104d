"""What a record cannot tell apart is reported together, and what it can is not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.special import expit, logit

from damping.effects import CATALOGUE
from damping.gap import next_test, weighing
from damping.gap.designs import DESIGNS, FLOOR
from damping.gap.diagnose import diagnose
from damping.gap.next_test import WORTH, NextTest, name_command
from damping.gap.rows import UNSEEN
from damping.gap.size import Gap, HeldOut, HeldOutFold, describe_held_out
from damping.gap.weighing import COVER, INDISTINCT, PER_BEYOND, distance
from damping.records.reading import read_record
from damping.records.record import Record
from damping.report.gap import describe_diagnosis
from tests.gap.limited import limited

ROW = {"force", "frequency_low", "frequency_high", "points", "added_mass"}


def test_velocity_squared_and_displacement_velocity_are_one_in_a_narrow_band(lab):
    """Both lose energy as A^3, with omega^2 and omega: 6 % apart at the ends of the band, where damping is not seen."""
    found = lab.diagnosed("velocity-squared")
    assert found.leading.effects[0] in ("velocity-squared", "displacement-velocity")
    assert [set(group.effects) for group in found.groups] == [{"velocity-squared", "displacement-velocity"}]
    assert {one.effects for one in found.explanations[:2]} == {("velocity-squared",), ("displacement-velocity",)}
    first, second = (one.hypothesis for one in found.explanations[:2])
    apart = distance(first.best, second.best)
    np.testing.assert_allclose(found.groups[0].distance, apart, rtol=1e-12, atol=0.0)  # rounding
    assert apart < INDISTINCT
    # evidences of two forces of one strength and one prior differ by chance alone, and by less than these sigma allow
    assert abs(first.log_evidence - second.log_evidence) < 0.5 * INDISTINCT**2


@pytest.mark.parametrize("name", ["stiffness-hardening", "planar-coupling"])
def test_effects_that_differ_stand_alone(lab, name):
    found = lab.diagnosed(name)
    assert found.leading.effects == (name,)
    assert found.groups == ()
    others = [one.hypothesis for one in found.hypotheses if len(one.effects) == 1 and one.effects != (name,)]
    assert min(distance(found.leading.best, other.best) for other in others) > INDISTINCT


def test_explanations_are_the_shortest_list_that_reaches_its_cover(lab):
    for name in ("velocity-squared", "planar-coupling"):
        found = lab.diagnosed(name)
        p = [one.probability for one in found.hypotheses]
        # what is missing to 1 is left to causes that nobody fitted: at most a third of what the library does not hold
        assert found.in_library + 0.65 * (1.0 - found.in_library) - 1e-12 <= sum(p) <= 1.0 + 1e-12
        assert p == sorted(p, reverse=True)
        n = len(found.explanations)
        assert found.explanations == found.hypotheses[:n]
        assert sum(p[:n]) >= COVER * sum(p) > sum(p[: n - 1])
        assert () in {one.effects for one in found.hypotheses}  # no effect is one of the hypotheses


def test_the_next_test_for_what_differs_by_a_power_of_frequency(lab):
    """It is told by a test that changes frequency or distorts: not by one that repeats what was measured."""
    found = lab.diagnosed("velocity-squared")
    assert found.next_test == found.next_tests[0]
    assert min(test.expected_log_odds for test in found.next_tests) >= WORTH
    assert all(test.columns and test.rows for test in found.next_tests)
    assert all(set(row) == ROW for test in found.next_tests for row in test.rows)
    # 20 and 50 per cent of mass move the frequency by 9 and 18 per cent, and the ratio of the two forces with it
    heavier = [test for test in found.next_tests if "added_mass" in test.columns]
    assert heavier
    assert all(0.0 < row["added_mass"] <= 0.5 * lab.mass * 1.1 for test in heavier for row in test.rows)
    assert not any("amplitude_y" in test.columns for test in found.next_tests)  # neither has a second plane


def test_the_mildest_test_that_settles_the_case_comes_first(lab):
    """By the rule of answers: what the library holds at its odds, the rest at odds tempered by 6 or, of both, by 2."""
    found = lab.diagnosed("velocity-squared")
    pair = replace(found, explanations=found.explanations[:2], hypotheses=found.explanations[:2])
    first, second = (own.hypothesis.log_posterior for own in pair.explanations)
    assert len(pair.next_tests) > 3
    for test in pair.next_tests:
        D = test.expected_log_odds
        odds = first - second + D - 2.0 * np.sqrt(2.0 * D)  # missed by one test in forty
        heavier, third = ("added_mass" in test.columns), ("amplitude_3" in test.columns)
        assert test.is_beyond == (heavier or third)
        outside = np.array([min(expit(odds / 5.0), 0.65), expit(odds / 6.0), expit(odds / 2.0)])
        told = {heavier, heavier + third}  # third harmonics tell where they are above noise: test_unexplained.py
        # what tells beyond first harmonics makes it likelier that the library holds the cause
        known = expit(logit(found.in_library) + PER_BEYOND * np.array([bool(number) for number in told]))
        wanted = known * expit(odds) + (1.0 - known) * outside[list(map(int, told))]
        assert np.isclose(test.probability, wanted, rtol=1e-9, atol=0.0).any()
    order = [design.what for design in DESIGNS]
    settle = [order.index(test.what) for test in pair.next_tests if test.probability >= COVER]
    others = [test.probability for test in pair.next_tests if test.probability < COVER]
    assert settle
    assert pair.next_test == pair.next_tests[0]
    assert settle == sorted(settle)
    assert others == sorted(others, reverse=True)
    assert all(test.probability >= COVER for test in pair.next_tests[: len(settle)])


def test_what_is_unexplained_is_so_after_any_test(lab):
    """By the rule of answers no measurement then counts beyond first harmonics, so that no test settles the case."""
    found = lab.diagnosed("velocity-squared")
    pair = replace(found, explanations=found.explanations[:2], hypotheses=found.explanations[:2])
    assert pair.next_test is not None
    doubted = replace(pair, unexplained=True)
    first, second = (own.hypothesis.log_posterior for own in pair.explanations)
    assert any(test.is_beyond for test in doubted.next_tests)
    for test in doubted.next_tests:
        D = test.expected_log_odds
        odds = first - second + D - 2.0 * np.sqrt(2.0 * D)
        known = found.in_library
        wanted = known * expit(odds) + (1.0 - known) * min(expit(odds / 5.0), 0.65)
        np.testing.assert_allclose(test.probability, wanted, rtol=1e-9, atol=0.0)  # rounding
    assert doubted.next_test is None
    assert replace(doubted, understated=SimpleNamespace()).next_test == pair.next_test  # nothing but the noise is wrong


def test_two_runs_are_proposed_where_none_settles_the_case_alone(lab):
    """What two runs tell of a rival is at least what either does: each is a part of the same Gaussian vector."""
    found = lab.diagnosed("velocity-squared")
    pair = replace(found, explanations=found.explanations[:2], hypotheses=found.explanations[:2])
    assert max(test.probability for test in pair.next_tests) >= COVER
    assert all(len(test.rows) == 1 for test in pair.next_tests)
    weak = [own for own in DESIGNS if own.heavier == 0.0 and own.factor == 1.0 and own.width]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("damping.gap.next_test.DESIGNS", weak)
        doubted = replace(pair, in_library=0.1)
        first, *others = doubted.next_tests
    alone = {test.what: test for test in others if len(test.rows) == 1}
    assert max(test.probability for test in alone.values()) < COVER <= first.probability
    assert len(first.rows) == 2
    reasons = first.why.split("; ")
    assert len(set(reasons)) == len(reasons)  # what holds for both runs is said once
    parts = [alone[what] for what in first.what.split("; and ") if what in alone]
    assert parts
    for part in parts:
        assert first.expected_log_odds >= part.expected_log_odds
        assert set(part.columns) <= set(first.columns)
        assert part.rows[0] in first.rows


def test_a_test_that_settles_nothing_is_told_and_is_no_next_test(lab):
    """The sweep at the highest force, run again, is all that can be measured: it leaves what it leaves."""
    found = lab.diagnosed("velocity-squared")
    pair = replace(found, explanations=found.explanations[:2], hypotheses=found.explanations[:2], in_library=0.1)
    again = next(own for own in DESIGNS if own.columns == ("amplitude_3", "phase_3"))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("damping.gap.next_test.DESIGNS", [again])
        (only,) = pair.next_tests
        assert only.probability < COVER
        assert pair.next_test is None
        words = describe_diagnosis(pair)["following"][0]
    assert words.startswith("No possible test is expected to settle this; the most informative is a sweep")


def test_the_rows_of_a_next_test_are_read_beside_the_record(lab, tmp_path, among):
    """They come after it, fill the columns that no row of it may lack, and are as noisy as what it measured."""
    record = lab.measured("velocity-squared")
    table = record.table.assign(time=60.0 * np.arange(len(record)))
    found = limited(among("displacement-velocity"), diagnose, Record(table), lab.mode())
    test = found.next_test
    run, further = test.rows[0], table.tail(20).reset_index(drop=True)
    further = further.assign(sweep="Z", frequency=np.linspace(run["frequency_low"], run["frequency_high"], 20))
    further = further[["sweep", *(name for name in test.columns if name in further)]]
    path = tmp_path / "record.csv"
    pd.concat([table, further]).to_csv(path, index=False)
    assert len(read_record(path)) == len(record) + 20  # every cell that must be filled is
    assert "time" in test.columns  # without which the times of all rows count for nothing
    problem = found.leading.best.model.problem
    design = next(own for own in DESIGNS if own.channel == "third")
    step = 1.0 / (len(record) - 1.0)
    np.testing.assert_allclose(design.plan(problem).time, 0.5 + step * (1.0 + np.arange(40)), rtol=1e-12, atol=0.0)
    third = np.where(problem.rows.sweep == 0, 3e-6, UNSEEN)
    measured = replace(problem, rows=replace(problem.rows, sd_third=third))
    np.testing.assert_array_equal(design.plan(measured).sd_third, 3e-6)


def test_the_vicinity_of_resonance_is_where_a_hardening_spring_has_moved_it(lab):
    """The largest amplitude of the highest level, not the frequency of small motion, is in the middle of the run."""
    record = lab.measured("stiffness-hardening")
    problem = lab.diagnosed("stiffness-hardening").leading.best.model.problem
    top = record.table[record.table.force == record.table.force.max()]
    resonance = float(top.frequency[top.amplitude.idxmax()])
    run = next(own for own in DESIGNS if not own.width).plan(problem).omega / (2.0 * np.pi)
    assert run.mean() == pytest.approx(resonance, rel=1e-12)


def test_a_harmonic_analyser_is_as_noisy_with_mass_added_as_without(lab):
    """3e-4 of the largest amplitude of the sweep that is run again, wherever the mass moves the resonance."""
    found = lab.diagnosed("velocity-squared")
    problem = found.leading.best.model.problem
    largest = problem.rows.A.max()
    again = [own for own in DESIGNS if own.channel == "third" and own.width == own.factor == 1.0 and not own.lowest]
    assert {own.heavier for own in again} == {0.0, 0.2, 0.5}
    for design in again:
        # of the rows nearest in frequency: near resonance they lie a third of the half-power half-width apart
        np.testing.assert_allclose(design.plan(problem).sd_third, FLOOR * largest, rtol=0.05)


def test_a_record_without_phases_is_asked_for_none(lab, among):
    """A column is filled in every row: rows with phases after rows without could not be read."""
    record = lab.measured("velocity-squared")
    found = limited(
        among("displacement-velocity"), diagnose, Record(record.table.drop(columns=["phase", "phase_sd"])), lab.mode()
    )
    assert found.next_tests
    assert not any("phase" in test.columns for test in found.next_tests)


def test_no_test_is_proposed_where_one_explanation_is_listed(lab):
    assert lab.diagnosed("stiffness-hardening").next_test is None
    found = lab.diagnosed("velocity-squared")
    assert found.hypotheses[1].probability > 0.1
    assert replace(found, explanations=found.explanations[:1]).next_test is None


def test_no_test_is_proposed_where_friction_would_hold_the_mode_in_each(lab, monkeypatch):
    """With a friction of 1.5 times the largest force in the leading explanation the answer was an internal error."""
    found = lab.diagnosed("velocity-squared")
    monkeypatch.setattr("damping.gap.next_test._resonates", lambda terms, rows: False)
    held = replace(found)
    assert held.next_tests == ()
    assert held.next_test is None


def test_where_nothing_is_blamed_only_more_than_first_harmonics_of_one_state_is_proposed(lab):
    """These raise no probability beyond .95; where an effect is blamed they are proposed all the same."""
    found = lab.diagnosed("planar-coupling")
    first, nothing = found.hypotheses[0], next(own for own in found.hypotheses if not own.effects)
    blamed, cleared = (replace(found, explanations=pair).next_tests for pair in ((first, nothing), (nothing, first)))
    assert any(not test.is_beyond for test in blamed)
    assert cleared
    assert all(test.is_beyond for test in cleared)


def test_no_test_is_proposed_for_a_reason(lab):
    """One explanation is left, or a cause without a name: not that no test in the world would tell."""
    found = lab.diagnosed("velocity-squared")
    one = replace(found, explanations=found.explanations[:1], in_library=0.9)
    for case, why in ((one, "only one explanation is left"), (replace(one, in_library=0.2), "cannot be predicted")):
        (said,) = describe_diagnosis(case)["following"]
        assert said.startswith("No further test is proposed: ")
        assert why in said


def test_the_command_of_a_next_test_names_files_as_given_with_states_and_simulator(lab):
    def of(name):
        return Record(lab.measured("").table, f"{name}/data.csv"), lab.mode(source=f"{name}/model.toml")

    one, two = of("old tests/one"), of("two")
    files = "'old tests/one/model.toml' 'old tests/one/data.csv'"
    assert name_command([one], None) == f"damping gap {files}"
    both = f"damping gap {files} --with two/model.toml two/data.csv"
    assert name_command([one, two], None) == both
    assert name_command([one, two], diagnose) == f"{both} --simulator damping.gap.diagnose:diagnose"
    assert name_command([one, two], lambda force, frequency: (force, frequency)).endswith("MODULE:FUNCTION")
    found = limited(["velocity-squared"], diagnose, lab.measured("velocity-squared"), lab.mode(), states=[two])
    assert found.states == (two,)


@dataclass(frozen=True)
class Known:
    """A hypothesis whose probability is known and whose prediction is that of all others."""

    effects: tuple[str, ...]
    log_posterior: float
    best: None = None

    @property
    def key(self):
        return frozenset(self.effects)


def test_the_rig_is_looked_at_first_only_where_it_alone_could_do_it(monkeypatch):
    """A gain that needs a second plane beside it does not spare the structure."""
    monkeypatch.setattr(weighing, "distance", lambda fit, other: 0.0)
    ranked = [
        Known(("second-mode",), 0.0),
        Known(("residual-modes",), -1.0),
        Known(("amplitude-scale", "planar-coupling"), -1.0),
    ]
    (group,) = weighing.group_equivalent_effects(ranked, CATALOGUE)
    assert group.rig == 0
    assert group.ways == (("second-mode",), ("residual-modes",), ("amplitude-scale", "planar-coupling"))
    assert set(group.effects) == {"second-mode", "residual-modes", "amplitude-scale", "planar-coupling"}
    (group,) = weighing.group_equivalent_effects([*ranked, Known(("force-dropout",), -1.0)], CATALOGUE)
    assert (group.rig, group.ways[0]) == (1, ("force-dropout",))


def test_places_and_doubts_are_told_as_they_are(lab):
    """A cell of one row is at a frequency, and effects that do together what one does are not told one by one."""
    found = lab.diagnosed("stiffness-hardening")
    cell = replace(found.where[0], frequency_low=2.98765, frequency_high=2.98765)
    group = weighing.Group((("phase-lag",), ("amplitude-scale", "planar-coupling")), 1.0, 1)
    told = describe_diagnosis(replace(found, where=(cell, *found.where[1:]), groups=(group,)))
    assert " at 2.9876 Hz" in told["place"][0]
    assert "cannot separate phase-lag and amplitude-scale + planar-coupling" in told["doubts"][0]


def test_what_another_choice_fails_at_is_not_told_of_the_explanation():
    """Levels held out that chose another effect speak of the choice, and no share of a gap is below nothing."""
    gap = Gap(9.0, 8.0, 1.0, 1.0)

    def said(effects):
        fold = HeldOutFold(("A",), effects, 20, 400.0, 300.0, 900.0)
        held_out = HeldOut(9.0, 8.0, 13.0, -1.4, -1.9, -1.0, "each", (fold,))
        (caution,) = describe_held_out(Known(("velocity-squared",), 0.0), gap, held_out)
        return caution

    assert said(("velocity-squared",)) == "the explanation fails on held-out levels: it closes none of their gap"
    assert "displacement is chosen, which closes none of the held-out gap" in said(("displacement",))
    assert "no effect is chosen" in said(())


@pytest.mark.parametrize(
    ("blamed", "beyond", "told"), [(True, False, True), (False, True, True), (False, False, False)]
)
def test_rivals_that_different_tests_tell_are_told_by_both(monkeypatch, blamed, beyond, told):
    """One test parts A and one B: together both, with the smaller log odds of the two, 50.

    Where nothing is blamed, first harmonics of one state say no more.
    """
    odds = {("r1", "A"): 50.0, ("r1", "B"): 0.0, ("r2", "A"): 0.0, ("r2", "B"): 50.0}
    rivals = [
        SimpleNamespace(effects=effects, hypothesis=SimpleNamespace(best=name), probability=0.3)
        for name, effects in (("L", ("L",) if blamed else ()), ("A", ("A",)), ("B", ("B",)))
    ]
    design = SimpleNamespace(joins=lambda other: True)
    runs = [SimpleNamespace(design=design, misfits=((name, "A"), (name, "B")), predicted=None) for name in ("r1", "r2")]
    values = {
        "_predict_runs": lambda *_: runs,
        "_odds": lambda misfits, rival: sum(odds[own] for own in misfits),
        "_describe_test": lambda own, D, p, *_: NextTest(
            str(len(own)), "", D, p, ("added_mass",) if beyond else (), (), ""
        ),
        "count_beyond": lambda *_: 1,
        "distance": lambda *_: 10.0,
        "foresee_probability": lambda *_: 0.99,
    }
    for name, value in values.items():
        monkeypatch.setattr(next_test, name, value)
    tests = next_test.rank_tests(rivals, rivals, 0.8, "command")
    assert [(test.what, test.expected_log_odds) for test in tests] == ([("2", pytest.approx(50.0))] if told else [])


def test_tests_that_are_joined_are_different_runs():
    """A sweep is not joined with the same sweep whose third harmonic is measured too, but with every other."""
    again, third = (test for test in DESIGNS if test.what.startswith("a sweep at the highest force"))
    near = next(test for test in DESIGNS if "near resonance" in test.what and not test.channel)
    across = next(test for test in DESIGNS if test.channel == "cross")
    assert [test.joins(again) for test in (third, across, near)] == [False, False, True]
    assert [third.joins(test) for test in (again, across, near)] == [False, True, True]
