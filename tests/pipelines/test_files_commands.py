"""``damping import`` and ``damping export`` as typed: every format, nothing guessed, names that would escape."""

from __future__ import annotations

import json
import os
import pickle
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
import scipy.io

from damping.records.reading import read_record

F = 3.0
f = np.linspace(9.0, 11.0, 41)
OMEGA = 2 * np.pi * f
CENTRE = 20 * np.pi
#: Receptance of 2 kg at 10 Hz with 2 per cent of critical damping, m/N.
H = 1.0 / (2.0 * (CENTRE**2 - OMEGA**2 + 0.04j * CENTRE * OMEGA))
KINDS = {"receptance": (8, 0, "m"), "mobility": (11, 1, "m/s"), "accelerance": (12, 2, "m/s^2")}
MODE = '[mode]\nname = "plate"\nfrequency = 10.0\nmass = 2.0\n[units]\nforce = "N"\nlength = "m"\n'
STATED = ("--response", "receptance", "--unit", "response=m/N", "--unit", "force=N", "--force", F)


def universal(path: Path, kind: str, *, binary: int = 0, even: int = 1, **further: object) -> Path:
    code, order, unit = KINDS[kind]
    one = {
        **{"type": 58, "binary": binary, "func_type": 4, "rsp_node": 1, "rsp_dir": 1, "ref_node": 1, "ref_dir": 1},
        **{"abscissa_spacing": even, "abscissa_spec_data_type": 18, "ordinate_spec_data_type": code},
        **{"orddenom_spec_data_type": 13, "ordinate_axis_units_lab": unit, "orddenom_axis_units_lab": "N"},
        **{"x": f, "data": H * (1j * OMEGA) ** order, "id1": kind},
    }
    pyuff.UFF(str(path)).write_sets([one | further], "add")
    return path


def close(path: Path, rtol: float) -> None:
    record = read_record(path)
    np.testing.assert_allclose(record.column("frequency"), f, rtol=min(rtol, 1e-5))
    np.testing.assert_allclose(record.column("amplitude"), np.abs(H) * F, rtol=rtol)
    np.testing.assert_allclose(record.column("force"), F, rtol=1e-12)
    np.testing.assert_allclose(record.column("phase"), -np.angle(H), rtol=0, atol=rtol)


@pytest.mark.parametrize(("kind", "binary", "even"), [("receptance", 0, 1), ("mobility", 1, 0), ("accelerance", 1, 1)])
def test_universal_files(tmp_path, damping, kind, binary, even):
    """Each kind in each form, and spacing, is read in ``formats/test_uff``; here is what the command says of them."""
    path, out = universal(tmp_path / "a.uff", kind, binary=binary, even=even), tmp_path / "r.csv"
    run = damping("import", path, "--out", out, "--force", F, "--scaling", "peak")
    assert (run.code, run.err) == (0, "")
    close(out, 3e-5)  # six digits of abscissa in text, whose rounding goes in twice (omega^2)
    for said in ("universal file", kind, "unit of response", "found in the file", "41 rows written"):
        assert said in run.out


def test_columns_and_readings(tmp_path, damping):
    out = tmp_path / "r.csv"
    u = H * F
    table = {"f [Hz]": f, "a [mm]": 1e3 * np.abs(u), "lag [deg]": -np.degrees(np.angle(H)), "drive [N]": F}
    pd.DataFrame(table).to_csv(tmp_path / "map.csv", index=False)
    roles = ("frequency=f", "amplitude=a", "lag_deg=lag", "force=drive")
    words = [word for role in roles for word in ("--column", role)]
    run = damping("import", tmp_path / "map.csv", "--out", out, *words, "--response", "displacement", "--json", "-")
    close(out, 1e-12)
    assert json.loads(run.out)["format"] == "import/1"
    rms = {"Freq (Hz)": f, "X [mV]": 1e3 * u.real / 2**0.5, "Y [mV]": 1e3 * u.imag / 2**0.5}
    pd.DataFrame(rms).to_csv(tmp_path / "lock.csv", sep="\t", index=False)
    words = ["--format", "lock-in", "--delimiter", "tab", "--response", "displacement", "--unit", "response=m"]
    words += ["--scale", "response=0.001", "--unit", "force=N", "--force", F, "--scaling", "rms"]
    assert damping("import", tmp_path / "lock.csv", "--out", out, *words).code == 0
    close(out, 1e-12)


@pytest.mark.parametrize(
    ("left_out", "asked"),
    [
        ("ordinate_spec_data_type", "--response receptance or mobility or accelerance"),
        ("ordinate_axis_units_lab", "--unit response="),
        ("--force", "--force"),
    ],
)
def test_what_neither_file_nor_user_says_is_asked_for(tmp_path, damping, left_out, asked):
    further = {left_out: {"ordinate_spec_data_type": 0}.get(left_out, "")}
    if left_out == "ordinate_spec_data_type":  # nor does the unit tell
        further["ordinate_axis_units_lab"] = ""
    path, out = universal(tmp_path / "a.uff", "accelerance", **further), tmp_path / "r.csv"
    force = () if left_out == "--force" else ("--force", F)
    run = damping("import", path, "--out", out, *force)
    assert run.code == 2
    assert asked in run.err
    assert run.err.count("\n") == 1
    assert not out.exists()


def test_a_ring_down(tmp_path, damping):
    """What it needs and what means nothing beside it is said; `test_import` has the numbers of its record."""
    (tmp_path / "m.toml").write_text(MODE)
    t, zeta = np.arange(0, 8, 0.004), 0.01
    s = CENTRE * complex(-zeta, np.sqrt(1 - zeta**2))
    signal = {"time": t, "response [m]": 0.01 * np.exp(s * t).real}
    pd.DataFrame(signal).to_csv(tmp_path / "t.csv", index=False)
    words = ("import", tmp_path / "t.csv", "--out", tmp_path / "r.csv")
    run = damping(*words)
    assert run.code == 2
    assert "--ring-down --mode MODE.toml of free decays" in run.err
    assert "--mode MODE.toml with the frequency and mass" in damping(*words, "--ring-down").err
    assert "--levels without --ring-down" in damping(*words, "--levels", 5).err
    decays = (*words, "--ring-down", "--mode", tmp_path / "m.toml", "--levels", 5)
    for option in ("--force=1", "--band=5:20", "--scaling=rms", "--scaling=force=rms", "--reverse"):
        assert f"{option.split('=')[0]} beside --ring-down" in damping(*decays, option).err
    for option in ("--scale force=2", "--unit force=lbf"):
        assert f"{option.split('=')[0]} beside --ring-down" in damping(*decays, *option.split()).err
    run = damping(*decays)
    assert run.code == 0, run.err
    assert len(read_record(tmp_path / "r.csv")) <= 5


def test_several_ring_downs_of_one_file(tmp_path, damping):
    """Two decays from the same amplitude, of which each is a decay of its own in one record."""
    (tmp_path / "m.toml").write_text(MODE)
    t, zeta = np.arange(0, 16, 0.004), 0.01
    s = CENTRE * complex(-zeta, np.sqrt(1 - zeta**2))
    pd.DataFrame({"time": t, "response [m]": 0.01 * np.exp(s * (t % 8.0)).real}).to_csv(tmp_path / "t.csv", index=False)
    words = ("import", tmp_path / "t.csv", "--out", tmp_path / "r.csv", "--ring-down", "--mode", tmp_path / "m.toml")
    assert "2 times --start and 1 times --end" in damping(*words, "--start", 0, "--start", 8, "--end", 7).err
    assert "7 s before 6 s" in damping(*words, "--start", 0, "--start", 6, "--end", 7, "--end", 16).err
    assert "2 s before 2 s" in damping(*words, "--start", 0, "--end", 1, "--start", 2, "--end", 2).err
    assert damping(*words, "--start", 0, "--start", 8).code == 0
    assert damping(*words, "--start", 0, "--end", 7.9, "--start", 8, "--end", 15.9).code == 0
    record = read_record(tmp_path / "r.csv")
    assert record.is_decay
    first, second = (rows for _, rows in record.frame.groupby("decay"))
    assert list(first["sweep"]) != list(second["sweep"])
    np.testing.assert_allclose(first["time"] + 8.0, second["time"], rtol=0, atol=0.004)
    np.testing.assert_allclose(first["force"], second["force"], rtol=1e-6)


@pytest.mark.parametrize(("options", "off"), [((), ""), (("--text",), "off by up to 0.003 Hz")])
def test_frequencies_that_text_rounds(tmp_path, damping, options, off):
    """1000.003 Hz in E13.5 is 1000.00: rows a hundredth of a hertz apart become one frequency."""
    rows = (f"A,1,1000.00{k},0.{k}1,1.{k}" for k in (1, 2, 3))
    (tmp_path / "r.csv").write_text("\n".join(["sweep,force,frequency,amplitude,phase", *rows]))
    run = damping("export", tmp_path / "r.csv", "--out", tmp_path / "r.uff", "--from", "si", *options)
    assert run.code == 0
    assert off in run.out
    assert ("off by" in run.out) == bool(off)


@pytest.mark.parametrize("words", [("a.uff",), ("a.unv", "--text")])
def test_there_and_back(tmp_path, damping, words):
    path, out, back = universal(tmp_path / "in.uff", "mobility", even=0), tmp_path / "r.csv", tmp_path / "b.csv"
    damping("import", path, "--out", out, "--force", F, "--scaling", "peak")
    name, *options = words
    assert damping("export", out, "--out", tmp_path / name, "--from", "si", *options).code == 0
    assert damping("import", tmp_path / name, "--out", back).code == 0
    close(back, 3e-5)
    assert "--text beside --out 'o.csv'" in damping("export", out, "--out", tmp_path / "o.csv", "--text").err
    assert damping("export", back, "--out", tmp_path / "us.csv", "--from", "si", "--units", "us").code == 0
    assert (
        damping("export", tmp_path / "us.csv", "--out", tmp_path / "si.csv", "--from", "us", "--units", "si").code == 0
    )
    close(tmp_path / "si.csv", 3e-5)


def test_spreadsheets_execute_nothing(tmp_path, damping):
    """Text of every file that a command copies to a CSV: a cell that begins with = + - @ gets an apostrophe."""
    bad = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(1)"]
    lines = [f'"{label}",{k + 1},10,0.1,{label}' for k, label in enumerate(bad)]
    (tmp_path / "r.csv").write_text("sweep,force,frequency,amplitude,=note\n" + "\n".join(lines) + "\n")
    assert damping("export", tmp_path / "r.csv", "--out", tmp_path / "o.csv").code == 0
    cells = [cell.strip('"') for line in (tmp_path / "o.csv").read_text().splitlines() for cell in line.split(",")]
    assert not [cell for cell in cells if cell.startswith(("=", "+", "@", "-"))]
    assert read_record(tmp_path / "o.csv").sweeps == tuple(bad)
    title = universal(tmp_path / "a.uff", "receptance", id1="=HYPERLINK(1)")
    assert damping("import", title, "--out", tmp_path / "i.csv", "--force", F, "--scaling", "peak").code == 0
    assert "\n'=HYPERLINK(1)," in (tmp_path / "i.csv").read_text()
    form = {"format": "loads/1", "level": 0.9, "predictions": [{"force": 1.0, "median": 1, "low": 1, "high": 1}]}
    form["predictions"][0]["by_model"] = [{"name": "=cmd"}]
    (tmp_path / "l.json").write_text(json.dumps(form))
    assert damping("export", tmp_path / "l.json", "--out", tmp_path / "l.csv").code == 0
    assert "\n'=cmd," in (tmp_path / "l.csv").read_text()


def test_names_lead_nowhere(tmp_path, damping, monkeypatch):
    """Labels and names in files never become paths; ``STUDY.toml``, whose names do, refuses others than plain ones."""
    folder = tmp_path / "deep" / "work"
    folder.mkdir(parents=True)
    monkeypatch.chdir(folder)
    title = universal(folder / "a.uff", "receptance", id1="../../../escaped")
    assert damping("import", title, "--out", "r.csv", "--force", F, "--scaling", "peak").code == 0
    assert damping("export", "r.csv", "--out", "o.uff", "--from", "si").code == 0
    for name in ("../up", "a/b", "/abs", "..", "", "a\\b", "con\x00"):
        text = f'title = "t"\n[[records]]\nname = {json.dumps(name)}\nrecord = "r.csv"\nmode = "m.toml"\n'
        (folder / "S.toml").write_text(text)
        run = damping("study", "S.toml", "--out", "s")
        assert run.code == 2
        assert "S.toml" in run.err
    assert sorted(os.listdir(tmp_path)) == ["deep"]
    assert sorted(os.listdir(tmp_path / "deep")) == ["work"]
    assert sorted(os.listdir(folder)) == ["S.toml", "a.uff", "o.uff", "r.csv"]


def test_an_output_that_is_a_link_is_followed_and_a_loop_is_no_file(tmp_path, damping):
    """An output that is a link is followed, never replaced; a link to itself is no file."""
    path, kept = universal(tmp_path / "a.uff", "receptance"), tmp_path / "kept"
    kept.write_text("mine")
    (tmp_path / "r.csv").symlink_to(kept)
    assert damping("import", path, "--out", tmp_path / "r.csv", "--force", F, "--scaling", "peak").code == 0
    assert kept.read_text().startswith("sweep,force,frequency")
    assert (tmp_path / "r.csv").is_symlink()
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    for words in (("import", tmp_path / "loop"), ("export", tmp_path / "loop")):
        run = damping(*words, "--out", tmp_path / "x.csv")
        assert run.code == 2
        assert "Too many levels of symbolic links" in run.err
    (tmp_path / "self.uff").symlink_to(path)
    run = damping("import", tmp_path / "self.uff", "--out", path, "--force", F, "--scaling", "peak")
    assert run.code == 2
    assert "--out is one of the inputs" in run.err


def test_two_outputs_are_two_files(tmp_path, damping, monkeypatch):
    """By whatever path: nothing is written, and the line names both options."""
    monkeypatch.chdir(tmp_path)
    universal(tmp_path / "a.uff", "receptance")
    (tmp_path / "m.toml").write_text(MODE)
    words = ("import", "a.uff", "--force", F, "--scaling", "peak")
    run = damping(*words, "--out", "x", "--json", tmp_path / "." / "x")
    assert run.code == 2
    assert run.err.endswith(": --json is the file of --out; expected another file for each output\n")
    assert not (tmp_path / "x").exists()
    assert damping(*words, "--out", "r.csv", "--json", "r.json").code == 0
    run = damping("export", "r.csv", "--mode", "m.toml", "--units", "us", "--out", "o.csv", "--mode-out", "./o.csv")
    assert run.code == 2
    assert "--mode-out is the file of --out" in run.err
    assert not (tmp_path / "o.csv").exists()


class Opened:
    """Unpickling it makes a folder."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("name", ["a.csv", "a.mat", "a.h5", "a.uff", "a.json", "a.npy", "a.toml", "a.nc", "a.pkl"])
def test_pickles_are_never_loaded(tmp_path, damping, name):
    made = tmp_path / "made"
    data = pickle.dumps(Opened(made))
    if name == "a.npy":
        np.save(tmp_path / "a", np.array([Opened(made)], dtype=object), allow_pickle=True)
    elif name == "a.mat":
        scipy.io.savemat(tmp_path / "a", {"frequency": np.frombuffer(data, np.uint8)})
    elif name == "a.h5":
        with h5py.File(tmp_path / name, "w") as file:
            file["frequency"] = np.void(data)
    else:
        (tmp_path / name).write_bytes(data)
    for words in (
        ("import", tmp_path / name, "--consistent", "--response", "displacement"),
        ("export", tmp_path / name),
        ("export", tmp_path / name, "--mode", tmp_path / name, "--units", "si"),
    ):
        run = damping(*words, "--out", tmp_path / "o.csv")
        assert run.code == 2
        assert run.err.count("\n") == 1
    assert not made.exists()
    pickle.loads(data)  # made above: loading it does the harm, so that the commands truly did not load it
    assert made.exists()
