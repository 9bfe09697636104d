"""The blind run: cases can be read, the diagnosis sees case files alone, the scorer gets the rest."""

from __future__ import annotations

import hashlib
import io
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from benchmarks.kills import gone, kill
from damping.errors import InputError
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_pipelines.manifest import open_folder, verify
from damping_validation.blind import blind, make_cases
from damping_validation.generator import BLIND_SEED, draw, draw_case, draw_further_rows
from damping_validation.generator.refit import DrawnCase

KINDS = ("null:scatter", "phase-lag", "velocity-squared")
#: Three cases that are quickly drawn: a null one, one of an effect in the library, one of an effect outside it.
DEVELOPMENT_SEED = 20250
QUICK_SEED = DEVELOPMENT_SEED + 9


#: What the stand-in for the diagnosis proposes: a sweep about 5 Hz with a mass and the third harmonic.
PROPOSED = {
    "what": "a sweep",
    "columns": ["force", "frequency", "amplitude", "phase", "amplitude_3"],
    "rows": [{"force": 2.0, "frequency_low": 4.5, "frequency_high": 5.5, "points": 7, "added_mass": 1.5}],
}


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_development_sees_no_blind_case():
    assert BLIND_SEED not in (DEVELOPMENT_SEED, QUICK_SEED)


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("made")
    return folder, make_cases(folder / "cases", folder / "labels.json", 3, DEVELOPMENT_SEED, KINDS, jobs=1)


def test_cases_are_models_and_records_that_can_be_read(made):
    folder, _ = made
    labels = json.loads((folder / "labels.json").read_text())["cases"]
    assert {path.name for path in (folder / "cases").iterdir()} == set(labels)
    for name, label in labels.items():
        read_mode(folder / "cases" / name / "model.toml")
        record = read_record(folder / "cases" / name / "data.csv")
        assert len(record.table) == label["rows"] == len(label["frequency"])


def test_the_seal_is_that_of_the_labels(made):
    folder, sealed = made
    assert hashlib.sha256((folder / "labels.json").read_bytes()).hexdigest() == sealed


def test_the_seed_alone_decides_the_cases(made, tmp_path):
    folder, sealed = made
    again = make_cases(tmp_path / "cases", tmp_path / "labels.json", 3, DEVELOPMENT_SEED, KINDS, jobs=2)
    assert again == sealed
    assert contents(tmp_path / "cases") == contents(folder / "cases")
    other = make_cases(tmp_path / "other", tmp_path / "other.json", 1, DEVELOPMENT_SEED + 1, KINDS[:1], jobs=1)
    assert other != sealed
    assert not set(contents(tmp_path / "other")) & set(contents(folder / "cases"))


@pytest.fixture
def diagnosis(monkeypatch, no_drawing) -> list[dict[str, object]]:
    """A diagnosis that finds nothing, and what it was given."""
    calls: list[dict[str, object]] = []

    def diagnose_folder(cases: Path, out: Path, jobs: int | None) -> int:
        run = cases.parent if (cases.parent / "sealed.json").exists() else cases.parents[1]
        sealed = json.loads((run / "sealed.json").read_text())
        labels = run / "labels.sealed.json"
        calls.append({"cases": cases, "sealed": sealed, "files": contents(cases)})
        assert sealed["sha256"] == hashlib.sha256(labels.read_bytes()).hexdigest()
        out.mkdir(exist_ok=True)
        for case in cases.iterdir():
            nothing = {"effects": [], "explanations": [{"effects": [], "probability": 0.99}], "equivalents": []}
            rest = {"unexplained": False, "footprint": [], "gap": {"held_out": None}, "next_test": PROPOSED}
            (out / f"{case.name}.json").write_text(json.dumps({"format": "gap/1", **nothing, **rest}))
        return 0

    module = ModuleType("damping_pipelines.gap")
    module.diagnose_folder = diagnose_folder  # type: ignore[attr-defined]  # a stand-in module
    monkeypatch.setitem(sys.modules, "damping_pipelines.gap", module)
    return calls


def test_a_blind_run_seals_diagnoses_and_scores(diagnosis, tmp_path):
    blind(tmp_path / "run", 3, QUICK_SEED, 1)
    (call,) = diagnosis
    assert {Path(name).name for name in call["files"]} == {"model.toml", "data.csv"}
    table = pd.read_csv(tmp_path / "run" / "table.csv").set_index("figure")
    # a third of the cases are null (strata), and finding nothing is right there and wrong everywhere else
    assert table.loc["null cases wrongly accused", "cases"] == 1
    assert table.loc["null cases wrongly accused", "measured"] == 0.0
    assert table.loc["cases without an answer", "cases"] == 3
    assert table.loc["cases without an answer", "measured"] == 0.0
    written = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"cases", "answers", "labels.sealed.json", "sealed.json", "table.md", "confusion.csv"} <= written


def test_sealed_cases_are_used_again_by_the_same_run_alone(diagnosis, tmp_path):
    run = tmp_path / "run"
    blind(run, 3, QUICK_SEED, 1)
    labels, first = (run / "labels.sealed.json").stat().st_mtime_ns, contents(run)
    verify(run)
    assert {name for name in first if name != "manifest.json"} == set(open_folder(run).manifest.outputs)
    blind(run, 3, QUICK_SEED, 1)
    verify(run)
    assert (run / "labels.sealed.json").stat().st_mtime_ns == labels
    unequal = {name for name, content in contents(run).items() if content != first[name]}
    assert unequal <= {"table.csv", "table.md", "table.png", "table.svg", "report.html", "manifest.json"}  # seconds
    (run / "labels.sealed.json").write_text("{}")
    make_cases(run / "cases", run / "labels.sealed.json", 3, QUICK_SEED, jobs=1)
    assert (run / "labels.sealed.json").read_bytes() == first["labels.sealed.json"]


def test_cases_of_another_run_are_left_alone(diagnosis, tmp_path):
    (tmp_path / "cases" / "0000").mkdir(parents=True)
    with pytest.raises(InputError, match="another run"):
        blind(tmp_path, 3, DEVELOPMENT_SEED, 1)
    with pytest.raises(InputError, match="0 cases"):
        blind(tmp_path / "empty", 0, DEVELOPMENT_SEED, 1)
    assert not diagnosis


def test_proposed_tests_are_made_on_the_truth_and_diagnosed_again(diagnosis, tmp_path, capsys):
    run = tmp_path / "run"
    blind(run, 3, QUICK_SEED, 1, follow=True)
    verify(run)
    assert capsys.readouterr().out.startswith("Of 3 generated cases of 3 kinds")
    assert [call["cases"].parent.name for call in diagnosis] == ["run", "next"]
    for name in (path.name for path in (run / "cases").iterdir()):
        before = read_record(run / "cases" / name / "data.csv").table
        after = read_record(run / "next" / "cases" / name / "data.csv").table
        assert len(after) == len(before) + 7
        pd.testing.assert_frame_equal(after.iloc[: len(before)][list(before)], before)
        new = after.iloc[len(before) :]
        assert new["added_mass"].tolist() == [1.5] * 7
        assert new["amplitude_3"].notna().all()
        assert set(new["sweep"]).isdisjoint(before["sweep"])
        model = run / "cases" / name / "model.toml"
        assert (run / "next" / "cases" / name / "model.toml").read_bytes() == model.read_bytes()
    table = pd.read_csv(run / "table.csv").set_index("figure")
    settled = table.loc["settled by the test proposed, cause in the library"]
    # the stand-in sees nothing: it settles the null case, and not the one of an effect in the library
    assert (settled["measured"], settled["cases"]) == (0.5, 2)


def test_added_rows_are_of_the_same_truth():
    """A lag of the instruments is in the rows of the proposed test as it was in the case's own."""
    seed = next(seed for seed in range(50) if not draw_lag(seed).bench.base)  # viscous damping alone
    drawn, case = draw_lag(seed), draw_case("phase-lag", False, (3, seed))
    bench, (effect,) = drawn.bench, drawn.effects
    band = [float(omega) / (2 * np.pi) for omega in (bench.rows.omega.min(), bench.rows.omega.max())]
    row = {"force": float(bench.rows.force.max()), "frequency_low": band[0], "frequency_high": band[1], "points": 15}
    text = draw_further_rows("phase-lag", False, (3, seed), case.data, [row], set())
    new = pd.read_csv(io.StringIO(text)).iloc[-15:]
    omega, truth = 2 * np.pi * new["frequency"].to_numpy(), bench.truth()
    own = np.angle(truth.mass * (truth.omega**2 - omega**2) + 1j * truth.viscous * omega)
    # five standard deviations of the mean of 15 readings, and of the scatter of a sweep's natural frequency
    error = 5 * (drawn.noise.phase[0] / np.sqrt(15) + bench.scatter[1] / bench.xi)
    assert np.mean(new["phase"].to_numpy() - own) == pytest.approx(effect.size * effect.shape[0], abs=error)


def draw_lag(seed: int) -> DrawnCase:
    return draw("phase-lag", False, np.random.default_rng((3, seed)))


#: Processes of a blind run at work, which say so in a file each.
WORKING = """
import pathlib, time

def work(number):
    pathlib.Path(f"{number}.begun").touch()
    time.sleep(60)

if __name__ == "__main__":
    from damping_validation import blind  # here alone: the processes at work need none of it
    list(blind._each(work, list(range(8)), 2))
"""


def test_processes_end_with_a_killed_parent(tmp_path):
    (tmp_path / "run.py").write_text(WORKING)
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "run.py"], cwd=tmp_path, env=os.environ | paths, start_new_session=True
    ) as run:
        while len(list(tmp_path.glob("*.begun"))) < 2:
            assert run.poll() is None
            time.sleep(0.05)
        kill(run.pid)
    gone(run.pid)
