"""``damping gap``: the form, the files it writes, a folder of cases of which one is broken."""

from __future__ import annotations

import json
import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from damping.records.mode import Units, describe_mode_to_toml, read_mode
from damping.records.text import AGREED
from damping.report.gap import name_parameter
from damping.report.gap_page import tabulate_posterior
from damping_pipelines.cli import main
from tests.gap.limited import limited
from tests.html import Reader

KEYS = {
    *("format", "effects", "explanations", "equivalents", "unexplained", "where", "footprint", "gap", "parameters"),
    *("next_test", "intervals", "levels", "in_library", "audit", "cautions"),
}
#: What a lag is weighed against.
LIKE_A_LAG = ("phase-lag", "time-delay", "planar-coupling", "residual-modes", "displacement", "natural-frequency")
NAME = "a <script>alert(1)</script> & mode"


def command(*words):
    with pytest.raises(SystemExit) as stopped:
        main([str(word) for word in words])
    return int(stopped.value.code or 0)


@pytest.fixture(scope="module")
def case(lab, tmp_path_factory):
    """A folder with ``model.toml`` and ``data.csv`` of a lag of phase, with names that are no HTML."""
    folder = tmp_path_factory.mktemp("case")
    (folder / "model.toml").write_text(describe_mode_to_toml(lab.mode(name=NAME)))
    table = lab.measured("phase-lag", points=12).table
    table["sweep"] = "<b>" + table["sweep"] + "</b>"
    table.to_csv(folder / "data.csv", index=False)
    return folder


@pytest.fixture(scope="module")
def answered(case, tmp_path_factory):
    """The files that a run writes: answer, page, corrected model."""
    return written(case, tmp_path_factory.mktemp("answered"))


def written(case, out):
    files = [out / name for name in ("answer.json", "page.html", "corrected.toml")]
    options = zip(("--json", "--report", "--model-out"), files, strict=True)
    words = [word for option in options for word in option]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)  # it takes a while
        given = (case / "model.toml", case / "data.csv", *words, "--no-posterior")
        assert limited(LIKE_A_LAG, command, "gap", *given) == 0
    return files


def constants(text):
    """JSON that has no NaN and no infinity."""

    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_tables_of_the_page(answered, case):
    """Frequencies in the five digits of the sentences; parameters in words; a posterior told apart from its ends."""
    page = answered[1].read_text()
    first = constants(answered[0].read_text())["where"][0]
    for end in ("frequency_low", "frequency_high"):
        assert f'<td class="number">{first[end]:#.5g}</td>' in page
    assert '<th scope="col" class="number">from, Hz</th>' in page
    assert '<th scope="col" class="number">degrees of freedom</th>' in page
    cautions = re.findall(
        "<p>(.*)</p>", page.partition('<p class="callout-title">Cautions</p>')[2].partition("</div>")[0]
    )
    assert len(cautions) == len(constants(answered[0].read_text())["cautions"])
    assert all(caution[0].isupper() and caution.endswith(".") for caution in cautions)
    units = read_mode(case / "model.toml").units
    assert name_parameter("planar-coupling", "frequency_ratio", units) == ("frequency ratio", "")
    names = ("simulation: mass", "planar-coupling: frequency_ratio")
    draws = np.column_stack([np.linspace(-0.02, 0.03, 101), np.linspace(1.0248, 1.0252, 101)])
    table = tabulate_posterior(SimpleNamespace(names=names, draws=draws), units)
    assert list(table["parameter"]) == ["simulation: mass, relative", "planar-coupling: frequency ratio"]
    # quantiles of evenly spaced draws: 0.05, 0.5 and 0.95 of the way
    assert list(table.iloc[0, 1:4]) == ["−0.0175", "0.00500", "0.0275"]
    assert list(table.iloc[1, 1:4]) == ["1.0248", "1.0250", "1.0252"]


def test_a_parameter_without_tolerance_has_a_row_in_the_posterior():
    """All of its draws are equal: no interval determines its digits."""
    draws = np.column_stack([np.zeros(11), np.linspace(1.0, 2.0, 11)])
    names = ("simulation: mass", "slip: limit")
    table = tabulate_posterior(SimpleNamespace(names=names, draws=draws), Units())
    assert list(table.iloc[0, 1:4]) == ["0", "0", "0"]
    assert list(table.iloc[1, 1:4]) == ["1.05", "1.50", "1.95"]  # of evenly spaced draws


def test_the_form_has_every_key_and_the_lag_that_is_there(answered):
    found = constants(answered[0].read_text())
    assert set(found) >= KEYS
    assert found["format"] == "gap/1"
    assert found["effects"] == ["phase-lag"]
    assert found["explanations"][0]["effects"] == ["phase-lag"]
    # a lag is known to 0.0015 rad at this noise; five of them
    np.testing.assert_allclose(found["parameters"]["phase-lag"]["lag"], -0.1, rtol=0.0, atol=0.0075)
    assert found["unexplained"] is False
    assert set(found["gap"]) >= {"nominal", "before", "after", "shrinkage", "held_out"}
    assert set(found["gap"]["held_out"]) >= {"scheme", "before", "after", "shrinkage", "low", "high"}
    assert found["gap"]["nominal"] > found["gap"]["before"] > found["gap"]["after"]
    places = {"sweep", "frequency_low", "frequency_high", "quantity"}
    assert all(set(cell) == places | {"share", "z"} for cell in found["where"])
    assert all(set(cell) == places | {"size"} for cell in found["footprint"])
    assert {cell["quantity"] for cell in found["footprint"]} == {"phase"}  # a lag moves phases alone
    assert {cell["sweep"] for cell in found["footprint"]} == {"<b>A</b>", "<b>B</b>", "<b>C</b>"}
    low, high = found["intervals"]["phase-lag"]["lag"]
    assert low < found["parameters"]["phase-lag"]["lag"] < high
    assert 0.5 < found["in_library"] < 1.0
    assert {level["sweep"] for level in found["levels"]} == {"<b>A</b>", "<b>B</b>", "<b>C</b>"}
    assert set(found["levels"][0]) == {"sweep", "gain", "gain_sigma", "frequency", "frequency_sigma"}
    test = found["next_test"]
    keys = {"what", "why", "expected_log_odds", "probability", "columns", "rows", "command"}
    assert test is None or keys == set(test)
    assert found["posterior"] is None


def test_equal_input_gives_equal_bytes(case, answered, tmp_path):
    assert [path.read_bytes() for path in written(case, tmp_path)] == [path.read_bytes() for path in answered]


def test_report_and_corrected_model(answered):
    _, page, model = answered
    assert read_mode(model).effects["phase-lag"]["lag"] == pytest.approx(-0.1, rel=0.0, abs=0.0075)  # as above
    text = page.read_text()
    found = Reader(text)
    assert "alert(1)" in text  # the name is there, as text
    assert NAME not in text
    assert "<b>A</b>" not in text
    assert "alert(1)" not in "".join(re.findall(r"<script.*?</script>", text, re.DOTALL))
    assert all(link.startswith(("#", "data:")) for link in found.addresses), found.addresses
    assert not re.search(r"url\(\s*['\"]?https?:|@import", text)


def test_a_folder_with_a_broken_case(damping, case, tmp_path, monkeypatch):
    """In this process, where the library is limited; `test_no_case_of_a_folder_is_larger_than_may_be` starts one."""
    monkeypatch.setattr("damping_pipelines.gap.start_pool", lambda jobs: ThreadPoolExecutor(jobs))
    cases, out = tmp_path / "cases", tmp_path / "answers"
    model, data = ((case / name).read_text() for name in ("model.toml", "data.csv"))
    texts = {
        "fine": (model, data),
        "broken": (model, data.replace("amplitude,", "amplitudes,")),
        "other-mode": (re.sub(r"frequency = [0-9.]+", "frequency = 7.0", model, count=1), data),
    }
    for name, (toml, csv) in texts.items():
        (cases / name).mkdir(parents=True)
        (cases / name / "model.toml").write_text(toml)
        (cases / name / "data.csv").write_text(csv)
    done = limited(LIKE_A_LAG, damping, "gap", cases, "--json", out, "--jobs", 1)
    assert done.code == 1
    assert "Traceback" not in done.err
    assert {path.name for path in out.iterdir()} == {f"{name}.json" for name in texts}
    answers = {name: constants((out / f"{name}.json").read_text()) for name in texts}
    assert answers["fine"]["effects"] == ["phase-lag"]
    assert answers["fine"]["posterior"] is None  # off for a folder
    for name, says in (("broken", "amplitude"), ("other-mode", "different modes")):
        assert set(answers[name]) == {"format", "error"}
        assert answers[name]["format"] == "gap/1"
        assert says in answers[name]["error"]


def test_no_case_of_a_folder_is_larger_than_may_be(damping, case, tmp_path):
    done = damping("gap", case.parent, "--json", tmp_path, "--jobs", 1, "--max-size", 10)
    assert done.code == 1
    answer = json.loads((tmp_path / f"{case.name}.json").read_text())
    assert "larger than 10 bytes" in answer["error"]


def test_words_that_name_no_diagnosis_are_refused_in_one_line(damping, case, tmp_path):
    model, data = case / "model.toml", case / "data.csv"
    (tmp_path / "empty").mkdir()
    for words, says in (
        ((tmp_path / "none.toml", data), "none.toml"),
        ((case, "--report", tmp_path / "page.html", "--json", tmp_path), "one record"),
        ((case, "--posterior", "--json", tmp_path), "--posterior is for one record"),
        ((model, data, "--jobs", 2), "--jobs is for a folder"),
        ((case.parent,), "--json"),
        ((tmp_path / "empty", "--json", tmp_path / "out"), "holds no case"),
        ((model, "--json", tmp_path / "out"), "folder"),
        ((model,), f"{model}: no record beside it"),
        ((model, data, "--report", tmp_path / "page.pdf"), "expected a name ending in .html or .htm"),
    ):
        done = damping("gap", *words)
        assert (done.code, done.out) == (2, ""), words
        assert says in done.err
        assert len(done.err.strip().splitlines()) == 1


def test_a_record_given_twice_is_bad_input(damping, case):
    model, data = case / "model.toml", case / "data.csv"
    done = damping("gap", model, data, "--with", model, data)
    assert (done.code, done.out) == (2, "")
    *findings, refused = done.err.strip().splitlines()
    assert all("(caution)" in finding for finding in findings)
    assert refused.endswith(
        "the rows of states 1 and 2 are identical in every column; expected each measured state once"
    )


def test_an_analysis_that_cannot_be_done(damping, case, tmp_path):
    other = tmp_path / "other.toml"
    text = (case / "model.toml").read_text()
    other.write_text(re.sub(r"frequency = [0-9.]+", "frequency = 7.0", text, count=1))
    earlier = tmp_path / "answer.json"
    earlier.write_text("earlier")
    done = damping("gap", other, case / "data.csv", "--json", earlier)
    assert (done.code, done.out) == (1, "")
    assert "different modes" in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert earlier.read_text() == "earlier"


EXAMPLE = Path(__file__).parents[2] / "examples" / "own-simulation"


def test_prints_of_a_simulator_are_no_part_of_the_answer(damping, tmp_path, monkeypatch):
    """Standard output holds the form alone; a simulator that reports its calls must not break who reads it."""
    monkeypatch.chdir(EXAMPLE)
    loud = """import two_beams

print("loaded")


def frame(force, frequency, *, joint=(2500.0, 0.1)):
    print("called")
    return two_beams.frame(force, frequency, bending=140.0, joint=joint, loss=0.02)
"""
    (tmp_path / "loud.py").write_text(loud)
    monkeypatch.syspath_prepend(tmp_path)
    words = ("model.toml", "record.csv", "--simulator", "loud:frame", "--no-posterior", "--json", "-")
    done = limited(("coulomb-friction",), damping, "gap", *words)
    assert done.code == 0
    form = json.loads(done.out)
    assert {"loaded", "called"} <= set(done.err.splitlines())
    # one free parameter; what a mode file states beside it is held, and both ends of its interval are the value
    simulated, intervals = form["parameters"]["simulation"], form["intervals"]["simulation"]
    assert simulated.keys() == intervals.keys()
    assert intervals["frequency"] == [simulated["frequency"]] * 2
    low, high = intervals["joint"]
    assert low < simulated["joint"] < high


def test_a_simulation_of_the_users_own_is_the_baseline(damping, tmp_path, monkeypatch, among):
    monkeypatch.chdir(EXAMPLE)
    out = tmp_path / "answer.json"
    words = ("model.toml", "record.csv", "--simulator", "two_beams:frame", "--no-posterior", "--json", out)
    corrected = tmp_path / "corrected.toml"
    assert limited(among("coulomb-friction", "slip"), damping, "gap", *words, "--model-out", corrected).code == 0
    head = corrected.read_text().replace("\n# ", " ")
    assert "`damping sweep` does not reproduce the test. `damping gap` with the simulator applies the effects" in head
    assert "beside it: give it bending = " in head
    np.testing.assert_allclose(float(re.search(r"joint = ([0-9.]+)", head).group(1)), 2150.0, rtol=0.05)
    found = constants(out.read_text())
    assert found["effects"] == ["coulomb-friction"]
    # 6 mN by the README of the example; 75 rows of 1 per cent know it to 1.5 per cent
    np.testing.assert_allclose(found["parameters"]["coulomb-friction"]["coefficient"], 0.006, rtol=0.05)
    # simulated 2500 within 10 per cent, made with 2150; the compliance bends a little over so far
    np.testing.assert_allclose(found["parameters"]["simulation"]["joint"], 2150 / 2500 - 1, rtol=0.0, atol=0.05)
    again = limited(among("coulomb-friction"), damping, "gap", corrected, *words[1:])  # nothing is left to explain
    assert again.code == 0
    closed = json.loads(out.read_text())
    assert (closed["effects"], closed["unexplained"]) == ([], False)
    for name in ("two_beams", "two_beams:nothing", "no_module:frame"):
        done = damping("gap", "model.toml", "record.csv", "--simulator", name)
        assert (done.code, done.out) == (2, "")
    (tmp_path / "positional.py").write_text(
        "def plate(force, frequency, mass=(2.0, 0.05)):\n    return force, frequency\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    done = damping("gap", "model.toml", "record.csv", "--simulator", "positional:plate")
    assert (done.code, done.out) == (2, "")
    assert "by position" in done.err
    quitting = "import sys\n\ndef plate(force, frequency):\n    sys.exit(3)\n"
    for name, text in (("quits", quitting), ("quits_at_once", f"{quitting}plate(1, 2)\n"), ("no_python", "def")):
        (tmp_path / f"{name}.py").write_text(text)
        done = damping("gap", "model.toml", "record.csv", "--simulator", f"{name}:plate")
        assert (done.code, done.out) == (2, "")
        assert "simulator" in done.err.splitlines()[-1]


def test_a_state_without_its_record(damping, case):
    done = damping("gap", case / "model.toml", case / "data.csv", "--with", case / "model.toml")
    assert done.code == 2
    assert "1 record for 2 models" in done.err


def test_files_of_one_name_are_told_apart_on_the_page(lab, tmp_path, monkeypatch, damping):
    """States of one structure in folders of their own: each record stands there with its own digest."""
    answer = SimpleNamespace(diagnosis=None, posterior=None, against=AGREED, sentences=())
    monkeypatch.setattr("damping.diagnose", lambda *_, **__: answer)
    monkeypatch.setattr("damping.report.gap_page.render_gap_page", lambda *given: json.dumps(given[-1].inputs))
    words = []
    for points in (12, 14):
        folder = tmp_path / f"{points}"
        folder.mkdir()
        (folder / "model.toml").write_text(describe_mode_to_toml(lab.mode()))
        lab.measured("phase-lag", points=points).table.to_csv(folder / "data.csv", index=False)
        words += ["--with"] * bool(words) + [folder / "model.toml", folder / "data.csv"]
    assert damping("gap", *words, "--report", tmp_path / "page.html").code == 0
    inputs = json.loads((tmp_path / "page.html").read_text())
    assert {"data.csv", "data.csv (2)"} < set(inputs)
    assert inputs["data.csv"] != inputs["data.csv (2)"]
