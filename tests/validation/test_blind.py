"""The blind run: cases can be read, the diagnosis sees case files alone, the scorer gets the rest."""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path
from types import ModuleType

import pandas as pd
import pytest

from damping.errors import InputError
from damping.records.mode import read_mode
from damping.records.reading import read_record
from damping_validation.blind import DIAGNOSIS_SEED, blind, make_cases
from damping_validation.generator import DEVELOPMENT_SEED

KINDS = ("null:scatter", "phase-lag", "velocity-squared")
#: Three cases that are quickly drawn: a null one, one of an effect in the library, one of an effect outside it.
QUICK_SEED = DEVELOPMENT_SEED + 9


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> tuple[Path, str]:
    folder = tmp_path_factory.mktemp("made")
    return folder, make_cases(folder / "cases", folder / "labels.json", 6, DEVELOPMENT_SEED, KINDS, jobs=1)


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
    again = make_cases(tmp_path / "cases", tmp_path / "labels.json", 6, DEVELOPMENT_SEED, KINDS, jobs=2)
    assert again == sealed
    assert contents(tmp_path / "cases") == contents(folder / "cases")
    other = make_cases(tmp_path / "other", tmp_path / "other.json", 6, DEVELOPMENT_SEED + 1, KINDS, jobs=2)
    assert other != sealed
    assert not set(contents(tmp_path / "other")) & set(contents(folder / "cases"))


@pytest.fixture
def diagnosis(monkeypatch) -> list[dict[str, object]]:
    """A diagnosis that finds nothing, and what it was given."""
    calls: list[dict[str, object]] = []

    def diagnose_folder(cases: Path, out: Path, *, jobs: int | None, seed: int) -> int:
        sealed = json.loads((cases.parent / "sealed.json").read_text())
        labels = cases.parent / "labels.sealed.json"
        calls.append({"cases": cases, "seed": seed, "sealed": sealed, "files": contents(cases)})
        assert sealed["sha256"] == hashlib.sha256(labels.read_bytes()).hexdigest()
        out.mkdir(exist_ok=True)
        for case in cases.iterdir():
            nothing = {"effects": [], "explanations": [{"effects": [], "probability": 0.99}], "equivalents": []}
            rest = {"unexplained": False, "footprint": [], "gap": {"held_out": None}}
            (out / f"{case.name}.json").write_text(json.dumps({"format": "gap/1", **nothing, **rest}))
        return 0

    module = ModuleType("damping_pipelines.gap")
    module.diagnose_folder = diagnose_folder  # type: ignore[attr-defined]  # a stand-in module
    monkeypatch.setitem(sys.modules, "damping_pipelines.gap", module)
    return calls


def test_a_blind_run_seals_diagnoses_and_scores(diagnosis, tmp_path):
    blind(tmp_path / "run", 3, QUICK_SEED, 2)
    (call,) = diagnosis
    assert call["seed"] == DIAGNOSIS_SEED
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
    labels = (run / "labels.sealed.json").stat().st_mtime_ns
    blind(run, 3, QUICK_SEED, 1)
    assert (run / "labels.sealed.json").stat().st_mtime_ns == labels
    (run / "labels.sealed.json").write_text("{}")
    blind(run, 3, QUICK_SEED, 1)
    assert len(json.loads((run / "labels.sealed.json").read_text())["cases"]) == 3


def test_cases_of_another_run_are_left_alone(diagnosis, tmp_path):
    (tmp_path / "cases" / "0000").mkdir(parents=True)
    with pytest.raises(InputError, match="another run"):
        blind(tmp_path, 3, DEVELOPMENT_SEED, 1)
    with pytest.raises(InputError, match="0 cases"):
        blind(tmp_path / "empty", 0, DEVELOPMENT_SEED, 1)
    assert not diagnosis
