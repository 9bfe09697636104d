"""The examples: their records are what they say, their studies run, and they show what their pages promise."""

from __future__ import annotations

import json
import re
import runpy
import shlex
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from damping.extrapolation.plan import judge_rows, plan_loads
from damping.extrapolation.prepared import prepare_record
from damping.forces import from_damping
from damping.infer.law import Law
from damping.infer.observations import observe
from damping.predict.steady import resonant_amplitude
from damping.ranking import rank_laws, weigh_laws
from damping.records import audit
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_pipelines import study
from damping_pipelines.cli import app

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
NAMES = sorted(path.parent.name for path in EXAMPLES.glob("*/STUDY.toml"))
GENERATE = runpy.run_path(str(EXAMPLES / "generate.py"))
COMMANDS = [
    line for name in NAMES for line in re.findall(r"^damping (.+)$", (EXAMPLES / name / "README.md").read_text(), re.M)
]


def test_each_example_is_complete():
    assert NAMES == ["bolted-joint", "tank", "two-plane-mode"]
    for name in NAMES:
        assert {path.name for path in (EXAMPLES / name).iterdir()} >= {"README.md", "record.csv", "truth.toml"}
        assert name in (EXAMPLES / "README.md").read_text()


@pytest.mark.parametrize("line", COMMANDS)
def test_commands_of_the_pages_exist_and_their_files_too(line):
    words = shlex.split(line)
    assert words[0] in {command.name or command.callback.__name__ for command in app.registered_commands}
    for word in words:
        if word.startswith("examples/"):
            assert (ROOT / word).is_file()


@pytest.mark.parametrize("name", NAMES)
def test_records_are_made_from_the_truth(name):
    """A few points integrated again, against the committed ones, whose rig is imperfect."""
    committed = read_record(EXAMPLES / name / "record.csv").table
    F = committed["force"].min()
    level = committed[committed["force"] == F]
    some = level.iloc[:: max(1, len(level) // 3)]
    exact = GENERATE["record"](name, [F], some["frequency"].to_numpy())
    # four standard deviations of the rig: row and level together, and phase
    spread = 4.0 * np.hypot(GENERATE["ROW"], GENERATE["LEVEL"])
    np.testing.assert_allclose(np.log(some["amplitude"].to_numpy() / exact["amplitude"]), 0.0, rtol=0.0, atol=spread)
    np.testing.assert_allclose(some["phase"], exact["phase"], rtol=0.0, atol=4.0 * GENERATE["PHASE"])


@pytest.mark.parametrize(
    ("name", "law"), [("tank", ("viscous", "quadratic-displacement")), ("bolted-joint", ("viscous", "slip"))]
)
def test_the_true_law_wins_and_its_coefficients_are_found(name, law):
    others = (Law(("viscous",)), Law(("viscous", "velocity-squared")), Law(("viscous", "displacement-velocity")))
    ranking = rank_laws(observe(read_record(EXAMPLES / name / "record.csv")), 1, (Law(law), *others))
    best = ranking.candidates[0]
    assert best.law == Law(law)
    assert best.weight > 0.99
    truth = read_mode(EXAMPLES / name / "truth.toml").damping
    wanted = []
    for force in law:
        value = truth[force]
        wanted += list(value.values()) if isinstance(value, dict) else [value]
    found = [c.value for c in best.coefficients]
    # "to a few per cent": the levels err by 1 per cent each, which the coefficients of four levels inherit
    np.testing.assert_allclose(found, wanted, rtol=0.04, atol=0.0)


def test_numbers_of_the_pages():
    """Resonant amplitudes of the structures behind the data at the design forces, as the pages state them."""
    for name, F, said in (("tank", 24.0, "0.125 m"), ("bolted-joint", 48.0, "2.57 mm")):
        truth = read_mode(EXAMPLES / name / "truth.toml")
        omega = truth.omega_n if name == "tank" else 2.0 * np.pi * 17.57  # of the slipping panel
        A = resonant_amplitude(from_damping(truth.damping), np.array([F]), omega)[0]
        assert f"{A:.3g} {said.split()[1]}" == said
        assert said in " ".join((EXAMPLES / name / "README.md").read_text().split())


@pytest.mark.slow
@pytest.mark.sampling
def test_a_study_runs_shortened(tmp_path, monkeypatch, damping, check_page, one_process):
    """The tank's study on two candidate laws: every stage, every file, and its page on a telephone."""
    laws = (Law(("viscous",)), Law(("viscous", "quadratic-displacement")))
    monkeypatch.setattr(study, "candidate_laws", lambda *_: laws)
    monkeypatch.setattr(study, "resonant_laws", lambda: laws)
    shutil.copytree(EXAMPLES / "tank", tmp_path / "tank")
    assert damping("study", tmp_path / "tank" / "STUDY.toml", "--out", tmp_path / "out").code == 0
    page = (tmp_path / "out" / "report.html").read_text()
    assert "viscous + quadratic-displacement" in page
    loads = json.loads((tmp_path / "out" / "summary.json").read_text())["records"][0]["loads"]["predictions"]
    assert loads[1]["low"] < 0.125 < loads[1]["high"]  # the truth at 24 N
    check_page(tmp_path / "out" / "report.html", (390, "dark"), (1280, "light"))


@pytest.mark.slow
def test_a_study_predicts_what_the_command_predicts(tmp_path, damping, one_process):
    """Digit for digit, laws of little weight included: the draws of both are the same."""
    folder = EXAMPLES / "bolted-joint"
    assert damping("study", folder / "STUDY.toml", "--out", tmp_path).code == 0
    (record,) = json.loads((tmp_path / "summary.json").read_text())["records"]
    forces = [word for row in record["loads"]["predictions"] for word in ("--force", row["force"])]
    seed = tomllib.loads((folder / "STUDY.toml").read_text())["seed"]
    words = (folder / "record.csv", "--mode", folder / "panel.toml", *forces, "--seed", seed, "--json", "-")
    loads = json.loads(damping("extrapolate", *words).out)
    for ours, its in zip(record["loads"]["predictions"], loads["predictions"], strict=True):
        assert [ours[k] for k in ("median", "low", "high")] == [its[k] for k in ("median", "low", "high")]


def test_a_misfit_of_ranking_and_prediction_is_one_verdict_on_a_page():
    """Where no law fits, the law that leads on the resonances was said to miss the rows by a second figure."""
    folder = EXAMPLES / "two-plane-mode"
    record, mode = read_record(folder / "record.csv"), read_mode(folder / "model.toml")
    prepared = prepare_record(record, mode, audit(record, mode))
    ranking = weigh_laws(prepared.all_rows, 1, [Law(("viscous",)), Law(("velocity-squared",))])
    plan = plan_loads(prepared.data, [Law(("displacement",)), Law(("slip",))], 1)
    own = judge_rows(plan, prepared.all_rows, 1).fit
    assert plan.fit.verdict == "fits"  # of the resonances
    assert own.verdict == ranking.fit.verdict == "none fits"
    assert own.sentence != ranking.fit.sentence
    assert own.law in own.sentence
    assert study.judge_plan(plan, ranking, prepared.all_rows, 1).fit == ranking.fit


@pytest.mark.slow
def test_the_second_plane_is_found(tmp_path, damping, check_page):
    """On every third row: the effect, its angle and its frequency, and no force; and the page that says so."""
    folder = EXAMPLES / "two-plane-mode"
    pd.read_csv(folder / "record.csv").iloc[::3].to_csv(tmp_path / "record.csv", index=False)
    page = tmp_path / "gap.html"
    words = ("--no-posterior", "--report", page, "--json", "-")
    run = damping("gap", folder / "model.toml", tmp_path / "record.csv", *words)
    assert run.code == 0
    found = json.loads(run.out)
    assert found["effects"] == ["planar-coupling"]
    plane = found["parameters"]["planar-coupling"]
    # 25 degrees and 1.025, to a tenth of each as the page says "near"
    np.testing.assert_allclose(plane["angle"], np.radians(25.0), rtol=0.1, atol=0.0)
    np.testing.assert_allclose(plane["frequency_ratio"] - 1.0, 0.025, rtol=0.1, atol=0.0)
    assert found["gap"]["held_out"]["shrinkage"] > 0.9
    check_page(page, (390, "light"), (1280, "dark"))
