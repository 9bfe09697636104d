"""The scorer on hand-made labels and answers whose figures are counted by hand."""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from damping.errors import InputError
from damping_validation.blind import read_sealed, read_verdicts
from damping_validation.guard import regress
from damping_validation.scorer import (
    Figure,
    Goal,
    Verdict,
    calibration_error,
    is_settled,
    judge,
    overlap_footprint,
    score,
)
from damping_validation.scorer_output import (
    SCORES,
    describe_goal_text,
    describe_verdict,
    list_answers,
    render_scores,
    tabulate_confusion,
    tabulate_kinds,
    to_markdown,
)

RIG = frozenset({"phase-lag", "amplitude-scale"})
FREQUENCIES = [1.0, 1.1, 1.2, 1.0, 1.1, 1.2]


def label(kind: str = "slip", family: str = "single", **changed: Any) -> dict[str, Any]:
    """Two sweeps of three rows."""
    effects = {"null": [], "pair": ["slip", "phase-lag"]}.get(family, [kind])
    return {
        "kind": kind,
        "family": family,
        "conditions": "clean",
        "effects": effects,
        "gap": 0.0 if family == "null" else 3.0,
        "rows": 6,
        "phase": True,
        "sweep": ["A", "A", "A", "B", "B", "B"],
        "frequency": FREQUENCIES,
        "altered": {"amplitude": [1, 2, 4], "phase": [4]},
        "rig": [name for name in effects if name in RIG],
        **changed,
    }


def answer(*effects: str, probability: float = 0.9, **changed: Any) -> dict[str, Any]:
    """Those effects lead, displacement-velocity follows."""
    explanations = [
        {"effects": list(effects), "probability": probability},
        {"effects": ["displacement-velocity"], "probability": 0.99 - probability},
    ]
    return {
        "format": "gap/1",
        "effects": list(effects),
        "explanations": explanations,
        "equivalents": [],
        "unexplained": False,
        "footprint": [],
        "gap": {"held_out": {"shrinkage": 0.99}},
        **changed,
    }


def figures(*cases: Verdict, **options: Any) -> dict[str, Figure]:
    return {figure.name: figure for figure in score(cases, **options)}


def verdict(name: str, label: dict[str, Any], answer: dict[str, Any]) -> Verdict:
    return judge(name, label, answer, RIG)


def test_the_answers_to_a_null_case_are_counted():
    said = [answer(), answer("slip"), answer(unexplained=True), {"format": "gap/1", "error": "broken"}]
    cases = [verdict(str(n), label("null:scatter", "null"), a) for n, a in enumerate(said)]
    measured = figures(*cases)
    accused = measured["null cases wrongly accused"]
    assert (accused.measured, accused.cases, accused.met) == (0.5, 4, False)
    # Clopper and Pearson's interval of 2 of 4 (tables: .0676 to .9324)
    assert accused.low == pytest.approx(0.0676, abs=5e-5)
    assert accused.high == pytest.approx(0.9324, abs=5e-5)
    assert measured["good: right or honestly short"].measured == 0.25
    assert measured["cases without an answer"].measured == 0.25
    assert measured["cases without an answer"].met is False


def test_good_is_right_equivalent_listed_or_flagged():
    group = [["velocity-squared", "displacement-velocity"]]
    cases = {
        "right": verdict("", label(), answer("slip")),
        "equivalent": verdict("", label("velocity-squared"), answer("displacement-velocity", equivalents=group)),
        "listed": verdict("", label("displacement-velocity"), answer("slip")),
        "flagged": verdict("", label(), answer("phase-lag", unexplained=True)),
        "doubted": verdict("", label(), answer("phase-lag", in_library=0.4)),
        "believed": verdict("", label(), answer("phase-lag", in_library=0.6)),
        "too many": verdict("", label(), answer("slip", "phase-lag")),
        "unseen": verdict("", label(gap=0.9), answer()),
        "failed": verdict("", label(), {"format": "gap/1", "error": "broken"}),
    }
    assert {name for name, case in cases.items() if not case.good} == {"believed", "too many", "failed"}
    measured = figures(*cases.values())
    alone = measured["right by effects alone, gap >= 1 sigma"]
    assert (alone.measured, alone.cases) == (1 / 8, 8)
    assert measured["… or a stated equivalent"].measured == 2 / 8


def test_a_foreign_cause_is_good_only_with_a_flag():
    foreign = label("tank", "outside")
    assert verdict("", foreign, answer("slip", unexplained=True)).good
    assert not verdict("", foreign, answer("slip")).good
    assert verdict("", label("tank", "outside", gap=0.5), answer()).good
    assert verdict("", foreign, answer("slip", probability=0.97)).confidently_wrong
    assert not verdict("", foreign, answer("slip", probability=0.97, in_library=0.1)).confidently_wrong


def test_confidence_in_a_wrong_answer():
    wrong = [
        verdict("", label(), answer("phase-lag", probability=0.97)),
        verdict("", label(), answer(probability=0.97)),  # nothing, where there is a gap
        verdict("", label("null:nothing", "null"), answer("slip", probability=0.96)),
    ]
    assert all(case.confidently_wrong for case in wrong)
    fine = [
        verdict("", label(), answer("phase-lag", probability=0.94)),
        verdict("", label(), answer("phase-lag", probability=0.97, unexplained=True)),
        verdict("", label(gap=0.8), answer(probability=0.97)),
        verdict("", label(), answer("slip", probability=0.99)),
    ]
    assert not any(case.confidently_wrong for case in fine)
    assert figures(*wrong, *fine)["confidently wrong"].measured == pytest.approx(3 / 7)


def test_the_fault_of_the_rig_put_on_the_structure():
    lag = label("phase-lag")
    cases = [
        verdict("", lag, answer("slip")),
        verdict("", lag, answer("amplitude-scale")),  # wrong, but of the rig
        verdict("", lag, answer("slip", unexplained=True)),
        verdict("", label("null:nothing", "null"), answer("slip")),
        verdict("", label("slip"), answer("coulomb-friction")),  # the structure's own fault
    ]
    assert [case.wrongs_structure for case in cases] == [True, False, False, True, False]
    row = figures(*cases)["rig fault or none put on the structure"]
    assert (row.measured, row.cases) == (0.5, 4)


def test_two_effects_may_be_matched_to_equivalents_in_any_order():
    groups = [["slip", "coulomb-friction"], ["phase-lag", "residual-modes"]]
    pair = label("pair:two-forces", "pair")
    assert verdict("", pair, answer("residual-modes", "coulomb-friction", equivalents=groups)).right_or_equivalent
    assert not verdict("", pair, answer("residual-modes", "displacement", equivalents=groups)).right_or_equivalent
    assert not verdict("", pair, answer("slip", equivalents=groups)).right_or_equivalent


def test_pairs_are_named_when_both_are_among_the_effects():
    pair = label("pair:two-forces", "pair")
    cases = [
        verdict("", pair, a) for a in (answer("phase-lag", "slip"), answer("slip"), answer("slip", "displacement"))
    ]
    assert figures(*cases)["both of a pair named"].measured == pytest.approx(1 / 3)


def test_a_proposed_test_settles_a_case_when_the_truth_leads_beyond_95_per_cent():
    after = [answer("slip", probability=0.97), answer("slip", probability=0.9), answer("phase-lag", probability=0.99)]
    cases = [verdict("", label(), one) for one in after]
    assert [is_settled(case) for case in cases] == [True, False, False]
    foreign = verdict("", label("tank", "outside"), answer("slip", probability=0.99))
    measured = figures(*cases, followed=[*cases, foreign])["settled by the test proposed, cause in the library"]
    assert (measured.measured, measured.cases) == (pytest.approx(1 / 3), 3)
    assert "settled by the test proposed, cause in the library" not in figures(*cases)


def test_kinds_are_counted_in_the_order_of_their_families():
    cases = [
        verdict("", label("tank", "outside"), answer("slip", unexplained=True)),
        verdict("", label(), answer("slip")),
        verdict("", label(), answer("phase-lag", probability=0.99)),
        verdict("", label("null:nothing", "null"), answer()),
    ]
    table = tabulate_kinds(cases)
    assert table["kind"].tolist() == ["null:nothing", "slip", "tank"]
    assert table["cases"].tolist() == [1, 2, 1]
    assert table["good"].tolist() == [1, 1, 1]
    assert table["confidently_wrong"].tolist() == [0, 1, 0]
    sentence = describe_verdict(score(cases), cases)
    assert sentence.startswith(
        "Of 4 generated cases of 3 kinds, 1 of them in no library: right or honestly short in 75.0 %"
    )


def test_footprints_are_compared_cell_by_cell():
    """Truly altered: rows 1, 2, 4 of the amplitude, row 4 of the phase."""
    footprint = [
        {"sweep": "A", "frequency_low": 1.1, "frequency_high": 1.2, "quantity": "amplitude", "size": 3.0},
        {"sweep": "B", "frequency_low": 1.1, "frequency_high": 1.2, "quantity": "phase", "size": 2.0},
    ]
    assert overlap_footprint(label(), footprint) == pytest.approx(3 / 5)
    assert overlap_footprint(label(), []) == 0.0
    assert overlap_footprint(label(altered={"amplitude": [], "phase": []}), []) is None


def test_held_out_shrinkage_counts_where_the_class_is_right():
    def case(shrinkage: float | None, gap: float, *said: str) -> Verdict:
        return verdict("", label(gap=gap), answer(*said, gap={"held_out": {"shrinkage": shrinkage}}))

    cases = [
        *(case(0.9 + n / 100, 3.0, "slip") for n in range(11)),
        case(0.1, 3.0, "phase-lag"),
        case(None, 3.0, "slip"),
    ]
    measured = figures(*cases, case(0.85, 1.5, "slip"))  # the last is too small a gap
    median = measured["held-out shrinkage, right, gap >= 2 sigma: median"]
    assert (median.measured, median.cases) == (pytest.approx(0.95), 11)
    assert median.low < 0.95 < median.high
    assert measured["held-out shrinkage, right, gap >= 2 sigma: 10th percentile"].measured == pytest.approx(0.91)


def test_calibration_error_is_the_mean_misfit_of_ten_bins():
    """Bins .9-1: mean .95, 1 of 2 right; .6-.7: .6, right. (2 |.5 - .95| + |1 - .6|)/3."""
    pairs = np.array([[0.92, 1.0], [0.98, 0.0], [0.6, 1.0]])
    assert calibration_error(pairs) == pytest.approx((2 * 0.45 + 0.4) / 3)
    assert calibration_error(np.array([[1.0, 1.0]])) == 0.0


def test_processor_time_is_that_of_the_answers_or_of_the_whole():
    typical = verdict("", label(rows=150), answer("slip", cpu_seconds=1.5))
    small = verdict("", label(rows=60), answer("slip", cpu_seconds=0.1))
    name = "processor time per case of 120 to 180 points, s"
    assert figures(typical, small, processor_seconds=10.0)[name].measured == 1.5
    silent = verdict("", label(rows=150), answer("slip"))
    assert figures(silent, silent, processor_seconds=10.0)["processor time per case, all of it, s"].measured == 5.0


def test_labels_changed_after_the_sealing_are_refused(tmp_path):
    content = json.dumps({"cases": {"one": label()}}).encode()
    labels = tmp_path / "labels.sealed.json"
    labels.write_bytes(content)
    sealed = hashlib.sha256(content).hexdigest()
    assert read_sealed(labels, tmp_path, sealed)[0].leading is None  # no answer is a failed one
    labels.write_bytes(content.replace(b"slip", b"iwan"))
    with pytest.raises(InputError, match="sealed"):
        read_sealed(labels, tmp_path, sealed)


@pytest.mark.parametrize("text", ["{", "[]", '{"format": "rank/1"}'])
def test_an_answer_of_another_form_is_refused(tmp_path, text):
    (tmp_path / "one.json").write_text(text)
    with pytest.raises(InputError, match=r"one\.json"):
        read_verdicts({"cases": {"one": label()}}, tmp_path)


def test_confusion_counts_every_case_once():
    cases = [
        verdict("", label("null:nothing", "null"), answer()),
        verdict("", label(), answer("slip")),
        verdict("", label(), answer("phase-lag")),
        verdict("", label(gap=0.5), answer("slip")),
        verdict("", label("iwan", "outside"), answer("slip", unexplained=True)),
        verdict("", label("pair:two-forces", "pair"), answer("phase-lag", "slip")),
        verdict("", label("pair:two-forces", "pair"), {"format": "gap/1", "error": "broken"}),
    ]
    matrix = tabulate_confusion(cases)
    assert list(matrix.index) == ["null:nothing", "slip", "pair:two-forces", "iwan"]
    assert matrix.to_numpy().sum() == 6
    assert matrix.loc["null:nothing", "none"] == 1
    assert matrix.loc["slip", "slip"] == 1
    assert matrix.loc["slip", "phase-lag"] == 1
    assert matrix.loc["iwan", "flagged"] == 1
    assert matrix.loc["pair:two-forces", "both of the pair"] == 1
    assert matrix.loc["pair:two-forces", "no answer"] == 1
    answers = ["1 none", "1 slip and 1 phase-lag", "1 both of the pair and 1 no answer", "1 flagged"]
    assert list(list_answers(matrix)["answers"]) == answers


def test_goals_read_as_they_are_meant():
    assert describe_goal_text(Goal(high=0.01), True) == "<= 1 %"
    assert describe_goal_text(Goal(0.94, 0.98), True) == "94-98 %"
    assert describe_goal_text(Goal(high=1.5), False) == "<= 1.5"
    assert describe_goal_text(Goal(), True) == ""
    assert Figure("share", Goal(0.94, 0.98), 0.95).met
    assert not Figure("share", Goal(0.94, 0.98), 0.99).met
    assert Figure("share", Goal(), 0.5).met is None


def test_everything_is_rendered():
    cases = [verdict("", label(), answer("slip")), verdict("", label("null:nothing", "null"), answer())]
    cases.append(replace(cases[0], probability=0.7, iou=0.5))
    figures = score(cases)
    files = render_scores(figures, cases, 1)
    assert set(files) == set(SCORES)
    table = pd.read_csv(io.BytesIO(files["table.csv"]))
    assert list(table["figure"]) == [figure.name for figure in figures]
    assert to_markdown(figures).count("\n") == len(figures) + 2
    again = render_scores(score(cases), cases, 1)
    for name in set(files) - {"table.png", "confusion.png"}:
        assert again[name] == files[name]


def test_the_regression_of_doubts_gives_the_log_odds_of_its_answers():
    """A doubt that holds in 1 of 4 answers within the library, in 3 of 4 without: log odds -/+ ln 3 about even ones."""
    counts = {(0, True): 300, (1, True): 100, (0, False): 100, (1, False): 300}
    answers = [
        (np.array([1.0, 0.0, -float(doubt)]), held) for (doubt, held), count in counts.items() for _ in range(count)
    ]
    # the library holds 1.5 causes for each that it does not; the prior shrinks a slope of error 0.16 by 0.3 %
    np.testing.assert_allclose(regress(answers), [np.log(1.5 * 3.0), 0.0, np.log(9.0)], rtol=0.0, atol=0.02)
