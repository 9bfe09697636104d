"""What commands write over and what never: inputs, a user's own files, pipes, links; standard output full or closed."""

from __future__ import annotations

import os
import re
import shutil
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping.errors import InputError
from damping.extrapolation.prediction import PARTS
from damping_pipelines import manifest
from damping_pipelines.cli import main
from damping_pipelines.manifest import (
    MANIFEST,
    describe_code,
    digest,
    digest_code,
    digest_source,
    publish,
    sole_writer,
    verify,
)
from damping_pipelines.store import write_text
from damping_validation import bands

MOST_ROWS = 100_000
ROOT = Path(__file__).parents[2]
MODE = "[mode]\nfrequency = 1.65\nmass = 1.0\n[damping.viscous]\ncoefficient = 0.2\n"
PUBLISHED = {"seed": 1, "versions": {}, "inputs": {}}


def test_a_link_is_followed(tmp_path):
    real, link = tmp_path / "elsewhere" / "file.csv", tmp_path / "link.csv"
    write_text(real, "old")
    link.symlink_to(real)
    write_text(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    dangling = tmp_path / "dangling.csv"
    dangling.symlink_to(tmp_path / "elsewhere" / "later.csv")
    write_text(dangling, "new")
    assert dangling.is_symlink()
    assert (tmp_path / "elsewhere" / "later.csv").read_text() == "new"
    ring = tmp_path / "ring.csv"
    ring.symlink_to(ring)
    with pytest.raises(InputError, match="cannot be written"):
        write_text(ring, "new")


def test_a_pipe_is_written_to(tmp_path):
    pipe, got = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write_text(pipe, "text")
    reader.join()
    assert got == ["text"]
    assert pipe.is_fifo()


def test_a_device_is_written_to():
    write_text(Path("/dev/null"), "text")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(InputError, match="No space left"):
        write_text(Path("/dev/full"), "text")


@pytest.mark.parametrize("name", ["a.csv", "figures/b.svg"])
def test_a_file_that_no_manifest_names_is_refused(tmp_path, name):
    write_text(tmp_path / name, "measured")
    with pytest.raises(InputError, match="is no result of an earlier run; expected another --out, or that file moved"):
        publish(tmp_path, {"a.csv": b"new", "figures/b.svg": b"new"}, **PUBLISHED)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [tmp_path / name]
    assert (tmp_path / name).read_text() == "measured"
    with pytest.raises(InputError, match="no result of an earlier run"), sole_writer(tmp_path, [name]):
        raise AssertionError


def test_a_manifest_of_somebody_else_is_refused(tmp_path):
    write_text(tmp_path / MANIFEST, "mine")
    with pytest.raises(InputError, match="is no manifest of damping"):
        publish(tmp_path, {"a.csv": b"new"}, **PUBLISHED)
    assert (tmp_path / MANIFEST).read_text() == "mine"


def test_other_files_in_the_folder_stay(tmp_path):
    write_text(tmp_path / "notes.txt", "mine")
    for content in (b"first", b"second"):
        publish(tmp_path, {"a.csv": content}, **PUBLISHED)
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert verify(tmp_path).read("a.csv") == b"second"


def test_a_run_killed_among_its_moves_is_finished(tmp_path, monkeypatch):
    """All was staged and a first file moved: the next run finds the results whole, and no file of its own foreign."""
    moved = []

    def move_once(source, target):
        if ".staged" not in str(target):
            if moved:
                raise KeyboardInterrupt
            moved.append(target)
        real(source, target)

    real = os.replace
    monkeypatch.setattr(os, "replace", move_once)
    with pytest.raises(KeyboardInterrupt):
        publish(tmp_path, {"a.csv": b"a", "b.csv": b"b"}, **PUBLISHED)
    monkeypatch.undo()
    with sole_writer(tmp_path, ["a.csv", "b.csv"]):
        assert verify(tmp_path).manifest.outputs == {"a.csv": digest(b"a"), "b.csv": digest(b"b")}


def test_bands_of_a_record_of_one_level(tmp_path, damping, few_laws, no_drawing):
    """No level can be left out, and no force beyond 1.5 times the tested one is predicted: the page says both."""
    write_text(tmp_path / "records" / "one" / "record.csv", "sweep,force,frequency,amplitude\nL1,1,10,0.01\n")
    write_text(tmp_path / "records" / "one" / "mode.toml", '[mode]\nname = "panel"\nfrequency = 10.0\nmass = 2.0\n')
    run = damping("bands", tmp_path / "records", "--out", tmp_path / "out")
    assert run.code == 0, run.err
    page = (tmp_path / "out" / "README.md").read_text()
    assert "No record has three levels" in page
    assert re.search(r"\bnan\b", page) is None
    assert "at most 1.8 | refused: no prediction beyond the force 1.5" in page
    assert (tmp_path / "out" / "one-left-out.csv").read_text().count("\n") == 1  # the header


def test_bands_are_sealed_and_write_over_nothing(tmp_path, damping, monkeypatch):
    records, out = tmp_path / "records", tmp_path / "out"
    (records / "one").mkdir(parents=True)
    write_text(records / "one" / "record.csv", "x")
    write_text(records / "one" / "mode.toml", "x")
    one = bands.BandResult("one", *[None] * 5)
    monkeypatch.setattr(bands, "predict_structure", lambda *_: one)
    monkeypatch.setattr(bands, "draw_real_bands", lambda band: None)
    monkeypatch.setattr(bands.plots, "to_png", lambda figure: b"png")
    monkeypatch.setattr(bands.forms, "tabulate_loads", lambda at: None)
    monkeypatch.setattr(bands, "record_to_csv", lambda table: "csv")
    monkeypatch.setattr(bands, "render_page", lambda results, seed: "page")
    for name in ("README.md", "one.csv"):
        write_text(out / name, "mine")
        run = damping("bands", records, "--out", out)
        assert run.code == 2
        assert f"{name}: is no result of an earlier run" in run.err
        assert (out / name).read_text() == "mine"
        (out / name).unlink()
    for _ in range(2):
        assert damping("bands", records, "--out", out).code == 0
    assert damping("verify", out).code == 0
    (out / "one.csv").write_text("changed")
    run = damping("verify", out)
    assert run.code != 0
    assert "one.csv: is not from the run of the manifest" in run.out + run.err


def render_bands(monkeypatch, names, **left_out):
    """The page on structures of these names and modes; ``left_out``: of the check with levels held out."""
    over = [f"linear_overprediction_{end}" for end in ("percent", "low", "high")]
    row = dict.fromkeys(("force", "median", "low", "high", *over, *(f"sd_percent_{name}" for name in PARTS)), 1.0)
    rows = pd.DataFrame([row | {"extrapolation_ratio": ratio} for ratio in bands.RATIOS])
    monkeypatch.setattr(bands.forms, "tabulate_loads", lambda at: rows)
    columns = ("refused", "inside", "median", "measured", "levels", "linear_over_percent")
    checks = pd.DataFrame([dict.fromkeys(columns, 0) | left_out]).astype({"refused": bool})
    nothing = SimpleNamespace(laws=[], trend=SimpleNamespace(p=[]), cautions=[])
    results = [
        bands.BandResult(name, dp.Mode(name=mode, frequency=1.0, mass=1.0), nothing, nothing, nothing, checks)
        for name, mode in names.items()
    ]
    return bands.render_page(results, seed=1)


def test_structures_of_one_mode_name_are_told_apart_by_their_folders(monkeypatch):
    """In the table of goals and in the headings; a name that no other has stays, and so does a known record's title."""
    names = {"a": "bracket", "b": "bracket", "c": "arm", "d": "a", "eth-beam": "bracket"}
    titles = {"a": "a", "b": "b", "c": "arm", "d": "d", "eth-beam": bands.CITATIONS["eth-beam"]["title"]}
    assert bands.title_structures(names) == titles
    assert bands.title_structures({"a": "bracket"}) == {"a": "bracket"}
    assert bands.title_structures({"a": "a", "b": "b"}) == {"a": "a", "b": "b"}
    page = render_bands(monkeypatch, {name: mode for name, mode in names.items() if name != "eth-beam"})
    assert re.findall(r"^## (.*)$", page, re.MULTILINE) == ["a", "b", "arm", "d"]
    assert re.findall(r"^\| (\w+): high/low at 1.5", page, re.MULTILINE) == ["a", "b", "arm", "d"]


def test_bands_whose_checks_were_all_refused(monkeypatch):
    """No median errs by nothing, nothing is over by -0 %, and the picture of a folder with a space is found."""
    page = render_bands(monkeypatch, {"arm 1": "arm"}, refused=True, median=np.nan, linear_over_percent=-0.3)
    assert "The median errs" not in page
    assert "1.5 times).\nLinear damping from the same levels overpredicts by up to 0 %." in page
    assert "![Bands of arm 1](arm%201.png)" in page


def test_a_study_writes_over_no_measured_file(tmp_path, damping):
    """``--out .``, where a file of the user has the name of an output: told before any work."""
    folder = tmp_path / "joint"
    shutil.copytree(ROOT / "examples" / "bolted-joint", folder)
    write_text(folder / "summary.json", "mine")
    run = damping("study", folder / "STUDY.toml", "--out", folder)
    assert run.code == 2
    assert "summary.json: is no result of an earlier run" in run.err
    assert (folder / "summary.json").read_text() == "mine"


def campaign_of(folder: Path) -> dict[str, bytes]:
    """What a campaign leaves, its records those of an example: contents by name."""
    example = ROOT / "examples" / "bolted-joint"
    files = {f"modes/{path.name}": path.read_bytes() for path in example.iterdir() if path.suffix in (".csv", ".toml")}
    study = files.pop("modes/STUDY.toml").decode()
    study = re.sub(r'(record|mode) = "', r'\1 = "modes/', study)
    files |= {"study.toml": study.encode(), "campaign.json": b"{}", "report.html": b"page"}
    publish(folder, files, **PUBLISHED)
    return files


def test_no_command_removes_what_another_left(tmp_path, damping):
    """Told before any work, in one line, and nothing is lost: neither inputs of this very run nor earlier answers."""
    folder, records = tmp_path / "c", tmp_path / "records"
    files = campaign_of(folder)
    shutil.copytree(folder / "modes", records)
    (records / "one").mkdir()
    for name in ("record.csv", "mode.toml"):
        write_text(records / "one" / name, "x")
    for words in (
        ("study", ROOT / "examples" / "bolted-joint" / "STUDY.toml"),
        ("study",),
        ("fleet", records, "--workers", 0),
        ("blind", "--cases", 1),
        ("bands", records),
        ("calibrate", "--quick"),
    ):
        run = damping(*words, "--out", folder)
        line = f"damping: {folder}: holds results of damping campaign, which damping {words[0]} would replace"
        assert (run.code, run.err) == (2, f"{line}; expected another --out\n")
    run = damping("study", folder / "study.toml", "--out", folder)
    assert run.code == 2
    assert run.err.count("\n") == 1
    assert "study.toml: is an input, and --out would replace the results that contain it" in run.err
    run = damping("campaign", folder / "modes" / "record.csv", "--out", folder)
    assert (run.code, "is an input" in run.err) == (2, True)
    assert {name: (folder / name).read_bytes() for name in files} == files
    assert verify(folder)


@pytest.mark.parametrize("command", ["fleet", "bands"])
def test_a_folder_of_records_gets_no_results(tmp_path, damping, command):
    write_text(tmp_path / "a.csv", "x")
    run = damping(command, tmp_path, "--out", tmp_path)
    assert (run.code, run.err.count("\n")) == (2, 1)
    assert "--out is one of the inputs, which are never overwritten" in run.err
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


def test_a_command_replaces_its_own_results(tmp_path):
    """A rerun has the outputs that every run of it has; other outputs of the earlier run go."""
    for left in ("campaign.json", "summary.json", "fleet.html", "README.md"):
        publish(tmp_path / left, {left: b"1", "only-old.csv": b"1"}, **PUBLISHED)
        with sole_writer(tmp_path / left, (left,), [tmp_path / "elsewhere.csv"]):
            publish(tmp_path / left, {left: b"2"}, **PUBLISHED)
        assert sorted(path.name for path in (tmp_path / left).iterdir()) == sorted((left, MANIFEST))


def test_outputs_of_a_folder_are_no_inputs(tmp_path, damping):
    """``--steps`` and ``--plots`` name folders, whose files must not be what was read."""
    data = tmp_path / "x.csv"
    write_text(data, "y,x\n" + "".join(f"{2.0 * i + i % 3},{i}\n" for i in range(12)))
    plots = tmp_path / "plots"
    words = ("--response", "y", "--terms", "x", "--plots", plots)
    assert damping("regress", data, *words).code == 0
    drawn = sorted(plots.iterdir())[0]
    data.replace(drawn)  # the table now stands where the drawing goes
    data.symlink_to(drawn)
    run = damping("regress", data, *words)
    assert run.code == 2
    assert "--plots is one of the inputs" in run.err
    assert drawn.read_text().startswith("y,x")


@pytest.mark.parametrize("points", ["1000000000", str(MOST_ROWS + 1)])
def test_a_sweep_of_too_many_points(tmp_path, damping, points):
    write_text(tmp_path / "m.toml", MODE)
    out = tmp_path / "out.csv"
    run = damping("sweep", tmp_path / "m.toml", "--force", "1", "--frequency", f"1.6:1.7:{points}", "--out", out)
    assert run.code == 2
    assert run.err.count("\n") == 1
    assert f"{points} points; expected {MOST_ROWS} points at most" in run.err
    forces = [word for _ in range(2) for word in ("--force", "1")]
    most = f"1.6:1.7:{MOST_ROWS}"
    run = damping("sweep", tmp_path / "m.toml", *forces, "--frequency", most, "--out", out)
    assert f"{2 * MOST_ROWS} rows; expected {MOST_ROWS} rows" in run.err
    assert not out.exists()


@pytest.mark.parametrize("option", [("--jobs", "1000000"), ("--jobs", "0"), ("--cases", "1000000000")])
def test_a_number_that_sets_the_work_has_its_limit(tmp_path, damping, option):
    run = damping("blind", "--out", tmp_path / "out", *option)
    assert run.code == 2
    assert run.err.count("\n") == 1
    assert option[0] in run.err
    assert not (tmp_path / "out").exists()


#: ``python -m damping_pipelines.cli check`` with standard output full, or closed by its reader.
CHECK = """import os, runpy, sys
if sys.argv[1] == "closed":
    read, write = os.pipe()
    os.close(read)
    os.dup2(write, 1)
sys.argv[1] = "check"
runpy.run_module("damping_pipelines.cli", run_name="__main__", alter_sys=True)
"""


@pytest.mark.parametrize("output", ["full", "closed"])
@pytest.mark.parametrize("words", [(), ("--json", "-")])
def test_standard_output_that_takes_nothing(output, words, forking):
    record = ROOT / "examples" / "bolted-joint" / "record.csv"
    run = forking.run(CHECK, output, record, *words, out=Path("/dev/full"))
    assert run.returncode == 1
    assert run.stderr.count("\n") == 1
    assert run.stderr.startswith("damping: standard output ")


def test_keys_hold_the_source(monkeypatch, tmp_path):
    """One more module, and every key is another."""
    before = digest_code()
    assert describe_code()["source"] == digest_source()
    digest_source.cache_clear()
    assert digest_code() == before
    other = tmp_path / "damping_validation"
    shutil.copytree(ROOT / "pipelines" / "damping_validation", other)
    (other / "more.py").write_text("")
    spec = type("Spec", (), {"submodule_search_locations": [str(other)]})
    real = manifest.find_spec
    monkeypatch.setattr(manifest, "find_spec", lambda name: spec if name == "damping_validation" else real(name))
    digest_source.cache_clear()
    assert digest_code() != before
    digest_source.cache_clear()


@pytest.mark.parametrize(
    ("stream", "words", "code"), [("stdout", ["--version"], 0), ("stderr", ["check", "none.csv"], 2)]
)
def test_a_stream_that_was_closed_before_the_start_is_no_error(monkeypatch, stream, words, code):
    """As under a service, or after ``>&-``; Python then has None for the stream."""
    monkeypatch.setattr(sys, stream, None)
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == code
