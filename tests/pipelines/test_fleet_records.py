"""A record of a fleet: its row, forms and page say what the commands say of it alone."""

import html
import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping import agreement
from damping.effects import CATALOGUE
from damping.gap import diagnose
from damping.records.record import record_to_csv
from damping.report import number
from damping_pipelines.fleet.analyse import analyse
from damping_pipelines.fleet.dataset import FleetResult, FleetSettings, find_cases, tasks_of
from damping_reed1970 import data_folder

pytestmark = pytest.mark.usefixtures("no_drawing")
#: A linear mode: Hz, kg, damping ratio, and its viscous coefficient, N/(m/s).
FREQUENCY, MASS, RATIO = 10.0, 2.0, 0.01
VISCOUS = 4.0 * np.pi * FREQUENCY * RATIO * MASS
LEVELS = (1.0, 2.0, 4.0)
NOISE = 0.005
#: Of the simulated viscous coefficient over the true one.
TOO_LARGE = 1.3
#: What a fleet calls the numbers of a gap.
GAP = ("nominal", "before", "after", "shrinkage")


def sweep_linear_mode(scale: float = 1.0) -> pd.DataFrame:
    """Sweeps through the mode, with noise; ``scale``: of forces and amplitudes."""
    rng, f = np.random.default_rng(3), np.linspace(9.3, 10.7, 12)
    omega, own = 2.0 * np.pi * f, 2.0 * np.pi * FREQUENCY
    tables = []
    for level, force in enumerate(LEVELS):
        motion = force / (MASS * (own**2 - omega**2 + 2j * RATIO * own * omega))
        error = NOISE * rng.standard_normal((2, len(f)))
        columns = {"sweep": f"L{level}", "force": scale * force, "frequency": f}
        columns |= {"amplitude": scale * np.abs(motion) * np.exp(error[0]), "phase": error[1] - np.angle(motion)}
        tables.append(pd.DataFrame(columns))
    return pd.concat(tables, ignore_index=True)


def write_model(viscous: float = VISCOUS, more: str = "") -> str:
    """A model file of the mode."""
    damping = f"[damping]\nviscous = {viscous}\n" if viscous else ""
    return f"[mode]\nfrequency = {FREQUENCY}\nmass = {MASS}\n{more}{damping}"


def write_case(folder: Path, table: pd.DataFrame, model: str) -> tuple[Path, Path]:
    """A record with its model as ``cases`` of one: the paths of both files."""
    (case := folder / "c1").mkdir(parents=True)
    record, mode = case / "data.csv", case / "model.toml"
    record.write_text(record_to_csv(table))
    mode.write_text(model)
    return record, mode


def analyse_only(folder: Path, **settings: Any) -> FleetResult:
    """What a fleet makes of the only record of a folder."""
    asked = {"seed": 0, "fast": True, "level": 0.9, "forces": (), "versions": {}, "max_size": 10_000_000}
    (task,) = tasks_of(find_cases(folder), FleetSettings(**{**asked, **settings}))
    return analyse(task)


def limit_effects(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """These effects are the library of a diagnosis."""
    monkeypatch.setattr(diagnose, "CATALOGUE", {name: CATALOGUE[name] for name in names})


@pytest.mark.parametrize("moving", ["a sweep", "a base"])
def test_a_fleet_diagnoses_the_record_that_gap_does(moving, tmp_path, few_laws, monkeypatch, no_rivals):
    """As it was swept (not its steady states), and as its base was driven (not turned into a force)."""
    swept = moving == "a sweep"
    limit_effects(monkeypatch, "viscous-coefficient", "sweep-rate")
    table = sweep_linear_mode().assign(sweep_rate=0.04 if swept else 0.0)
    model = write_model(TOO_LARGE * VISCOUS, "" if swept else 'drive = "base"\n')
    files = write_case(tmp_path, table, model)
    row = analyse_only(tmp_path).row
    diagnosis = dp.diagnose(dp.read_record(files[0]), dp.read_mode(files[1]), compare=False)
    alone, form = diagnosis.to_json(), json.loads(row["gap_form"])
    assert row["effects"] == form["effects"] == alone["effects"]
    assert [row[f"gap_{name}"] for name in GAP] == [alone["gap"][name] for name in GAP]
    assert form["parameters"] == alone["parameters"]
    if not swept:
        assert row["effects"] == ["viscous-coefficient"]
        found = form["parameters"]["viscous-coefficient"]["relative"]
        assert found == pytest.approx(1.0 / TOO_LARGE - 1.0, abs=0.01)  # some standard errors


def test_forms_of_a_fleet_are_whole(tmp_path, few_laws, monkeypatch):
    """Findings of the audit and cautions, with what was done before: an offset that was taken off."""
    limit_effects(monkeypatch, "phase-lag", "viscous-coefficient")
    table = sweep_linear_mode()
    files = write_case(tmp_path, table.assign(phase=table["phase"] + 0.25), write_model())
    row, record, mode = analyse_only(tmp_path).row, dp.read_record(files[0]), dp.read_mode(files[1])
    findings = dp.check(record, mode).to_json()["findings"]
    assert [finding["check"] for finding in findings] == ["phase-offset"]
    commands = {
        "rank_form": dp.rank(record, mode),
        "loads_form": dp.extrapolate(record, mode, [2.0 * max(LEVELS)]),
        "gap_form": dp.diagnose(record, mode, compare=False),
    }
    for name, command in commands.items():
        form, alone = json.loads(row[name]), command.to_json()
        assert form["audit"] == alone["audit"] == findings
        assert set(form) >= {"format", "audit", "cautions"}
        if name != "loads_form":
            assert form["cautions"] == alone["cautions"]
    for name in ("rank_form", "loads_form"):
        assert any("was removed" in caution for caution in json.loads(row[name])["cautions"])
    (told,) = (caution for caution in json.loads(row["gap_form"])["cautions"] if caution.startswith("phase-offset: "))
    assert "too large" in told
    assert "the column phase" not in told  # a diagnosis that blames the phase lag does not ask to change the phases


def test_a_fleet_says_where_ranking_and_diagnosis_disagree(tmp_path, monkeypatch):
    """First in both forms and in the row, with the numbers of the prediction; the gap is explained once."""
    saturn, calls, explain = data_folder() / "saturn-v", [], diagnose.explain
    monkeypatch.setattr(diagnose, "explain", lambda *given, **named: calls.append(given) or explain(*given, **named))
    limit_effects(monkeypatch, "slip", "velocity-squared", "displacement-velocity", "viscous-coefficient")
    monkeypatch.setattr(agreement, "KEPT", 0.05)  # of the flagship, what leaves the band is one in eleven
    model = (saturn / "modes" / "config-2-mode-1.toml").read_text()
    table = pd.read_csv(saturn / "records" / "config-2-mode-1.csv")
    write_case(tmp_path, table, model.replace("from_record = true", "from_record = false"))
    row = analyse_only(tmp_path, forces=(90.0,)).row
    loads, gap = json.loads(row["loads_form"]), json.loads(row["gap_form"])
    said = loads["cautions"][0]
    assert said.startswith("ranking and diagnosis disagree at the force 90 lb")
    assert f"predict {loads['predictions'][0]['median']:.3g} in (" in said
    assert gap["cautions"][0] == row["cautions"][0] == said
    assert len(calls) == 1


def test_a_level_that_is_off_is_diagnosed_and_not_ranked(tmp_path, few_laws, monkeypatch, no_rivals):
    """As ``gap`` names what other commands refuse; without a simulation nothing can name it."""
    limit_effects(monkeypatch, "level-offset")
    table = sweep_linear_mode()
    table.loc[table["sweep"] == "L0", "amplitude"] *= 0.4
    write_case(tmp_path / "model", table, write_model())
    row = analyse_only(tmp_path / "model").row
    assert row["status"] == "partial"
    assert row["reason"].startswith("rank and extrapolate: c1/data.csv: level-offset (refuse)")
    assert row["effects"] == ["level-offset"]
    assert row["rank_form"] is row["loads_form"] is None
    (factor,) = json.loads(row["gap_form"])["parameters"]["level-offset"].values()
    assert factor == pytest.approx(0.4, rel=0.02)
    record, _ = write_case(tmp_path / "other", table, write_model(0.0))
    record.rename(tmp_path / "c1.csv")
    (tmp_path / "c1.toml").write_text(write_model(0.0))
    assert analyse_only(tmp_path).row["reason"].startswith("c1.csv: level-offset (refuse)")


def test_the_page_of_a_record_draws_small_metres_in_smaller_ones(tmp_path, few_laws, monkeypatch, no_rivals):
    """Millimetres are no 0.00501 m, and the figure says its numbers in words, as that of a study."""
    limit_effects(monkeypatch, "viscous-coefficient")
    scale = 0.1
    units = '[units]\nforce = "N"\nlength = "m"\ntime = "s"\n'
    write_case(tmp_path, sweep_linear_mode(scale), write_model(0.0).replace("[mode]", f"{units}[mode]"))
    force = 2.0 * max(LEVELS) * scale
    made = analyse_only(tmp_path, fast=False, forces=(force,))
    row, text = made.row, " ".join(html.unescape(made.pages[made.row["report"]]).split())
    true = force / (MASS * 2.0 * RATIO * (2.0 * np.pi * FREQUENCY) ** 2)
    assert row["median"] == pytest.approx(true, rel=0.02)
    median, low, high = (number(1e3 * row[name]) for name in ("median", "low", "high"))
    described = f"at 0.8 N median {median} mm ({low} to {high}), linear"
    assert described in text
    assert "(mm)" in text
    assert "−2 ln Zπ" in text
    assert "−2 ln Z<" not in text
