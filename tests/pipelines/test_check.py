"""``damping check`` and the audit before every command: exit codes, form, the way past; examples that once crashed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from damping.records.mode import read_mode
from damping_pipelines.store import write_text

ROOT = Path(__file__).parents[2]
MODE = "[mode]\nfrequency = 10.0\nmass = 2.0\n[damping.viscous]\ncoefficient = 5.0\n"
#: Model and record of examples with a row exactly at the frequency of a mode, where a model without damping has none.
AT_RESONANCE = (("tank/tank.toml", "tank/record.csv"), ("bolted-joint/panel.toml", "bolted-joint/record.csv"))


@pytest.fixture
def files(tmp_path) -> tuple[Path, Path, Path]:
    """A right record of a linear mode at three levels, the same with its phase negated, and the mode."""
    w_n = 2.0 * np.pi * 10.0
    hertz = np.linspace(9.0, 11.0, 15)
    w = 2.0 * np.pi * hertz
    rng = np.random.default_rng(1)
    tables = []
    for sweep, F in (("A", 1.0), ("B", 2.0), ("C", 4.0)):
        response = F / (2.0 * (w_n**2 - w**2) + 5.0j * w)
        noise = np.exp(0.01 * rng.normal(size=len(w)))
        columns = {"sweep": sweep, "force": F, "frequency": hertz, "amplitude": np.abs(response) * noise}
        tables.append(pd.DataFrame({**columns, "phase": -np.angle(response) + 0.01 * rng.normal(size=len(w))}))
    table = pd.concat(tables)
    right, wrong, mode = tmp_path / "right.csv", tmp_path / "wrong.csv", tmp_path / "mode.toml"
    write_text(right, table.to_csv(index=False))
    write_text(wrong, table.assign(phase=-table["phase"]).to_csv(index=False))
    write_text(mode, MODE)
    return right, wrong, mode


def test_exit_codes_and_form(files, damping):
    right, wrong, mode = files
    run = damping("check", right, "--mode", mode)
    assert (run.code, run.err) == (0, "")
    assert run.out.startswith("audit: ok")
    # C/(2 M omega_n) = 5/(4 2 pi 10)
    assert run.out.splitlines()[-1].split() == ["mode", "file", "10", "-", "-", "2", "0.01989", "-"]
    run = damping("check", wrong, "--mode", mode, "--json", "-")
    assert run.code == 1
    form = json.loads(run.out)
    assert (form["format"], form["verdict"]) == ("audit/1", "refuse")
    assert [finding["check"] for finding in form["findings"]] == ["phase-sign"]
    assert form["findings"][0]["sweeps"] == ["A", "B", "C"]
    assert set(form["findings"][0]) == {"check", "verdict", "what", "advice", "sweeps"}
    assert damping("check", right.parent / "none.csv").code == 2
    assert damping("check", right, "--json", right).code == 2
    # the true mass, 2, within the noise of 45 rows at one per cent
    implied = pd.DataFrame(json.loads(damping("check", right, "--mode", mode, "--json", "-").out)["implied"])
    np.testing.assert_allclose(implied["mass"], 2.0, rtol=0.05)


def commands(record: Path, mode: Path, folder: Path) -> dict[str, tuple[object, ...]]:
    """Every command that audits, on one record."""
    study = folder / "STUDY.toml"
    write_text(
        study, f'title = "t"\nseed = 1\n[[record]]\nname = "r"\nrecord = "{record.name}"\nmode = "{mode.name}"\n'
    )
    cases = folder / "cases"
    write_text(cases / "one.csv", record.read_text())
    write_text(cases / "one.toml", mode.read_text())
    write_text(folder / "structures" / "one" / "record.csv", record.read_text())
    write_text(folder / "structures" / "one" / "mode.toml", mode.read_text())
    columns = ("--column", "sweep=sweep", "--column", "phase=phase", "--response", "displacement", "--consistent")
    return {
        "rank": ("rank", record, "--mode", mode),
        "extrapolate": ("extrapolate", record, "--mode", mode, "--force", "8"),
        "gap": ("gap", mode, record, "--no-posterior"),
        "import": ("import", record, "--out", folder / "imported.csv", *columns),
        "export": ("export", record, "--out", folder / "exported.csv"),
        "bands": ("bands", folder / "structures", "--out", folder / "bands"),
        "fleet": ("fleet", cases, "--out", folder / "fleet", "--fast", "--workers", "0"),
    }


@pytest.mark.parametrize("name", ["rank", "extrapolate", "gap", "export", "bands", "fleet"])
def test_the_audit_refuses_and_despite_is_the_way_past(files, damping, tmp_path, name, few_laws):
    _, wrong, mode = files
    words = commands(wrong, mode, tmp_path)[name]
    run = damping(*words)
    assert run.code == 1
    assert f"{dict(fleet='one.csv', bands='record.csv').get(name, wrong.name)}: phase-sign (refuse)" in run.err
    assert "--despite phase-sign" in run.err
    run = damping(*words, "--despite", "phase-sign", *(("--replace",) if name == "fleet" else ()))
    assert run.code == 0, run.err
    run = damping(*words, "--despite", "phase")
    assert run.code != 0
    assert "no check 'phase'" in run.err + run.out


@pytest.mark.parametrize(("model", "record"), AT_RESONANCE)
def test_a_row_at_the_frequency_of_the_mode(damping, model, record, few_laws, tmp_path):
    """It once divided by zero and ended with an internal error. Those rows, and every third of the others."""
    mode, measured = ROOT / "examples" / model, tmp_path / "record.csv"
    table = pd.read_csv(ROOT / "examples" / record)
    at = np.abs(table["frequency"] / read_mode(mode).frequency - 1.0) < 1e-12
    assert at.any()
    table[at | (table.index % 3 == 0)].to_csv(measured, index=False)
    for words in (
        ("check", measured, "--mode", mode),
        ("rank", measured, "--mode", mode),
        ("gap", mode, measured, "--no-posterior"),
    ):
        run = damping(*words)
        assert run.code == 0, f"{words[0]}: {run.err}"
        assert "internal error" not in run.err
        assert "Warning" not in run.err
