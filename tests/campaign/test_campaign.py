"""A campaign of known truth: two modes 8 % apart on a shaker, one sensor reversed and one dead, and decays integrated.

The truth is made by solving each mode's own amplitude by bisection and by integrating motions in time: nothing of the
code under test.
"""

from __future__ import annotations

import json
import math
import os
import re
import tomllib
import warnings
from dataclasses import replace
from functools import cache
from itertools import product
from pathlib import Path
from unittest.mock import Mock

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
import scipy.io
from nptdms import ChannelObject, TdmsWriter
from scipy.integrate import solve_ivp

from damping.api import rank
from damping.campaign import analyse, find_notches
from damping.campaign.answer import Campaign, ModeAnswer
from damping.campaign.comparison import EarlierCampaign, compare_predictions, describe_changes
from damping.campaign.decays import decay_modes
from damping.campaign.modal_fit import Level
from damping.campaign.records import describe_lost, fit_levels, join_modes
from damping.campaign.responses import find_input
from damping.campaign.runs import CampaignRun, Corrections, DesignLevel, read_corrections
from damping.campaign.sources import read_runs
from damping.campaign.tracked import Source
from damping.campaign.values import At, Bounds, Response
from damping.errors import AnalysisError, InputError
from damping.formats.arrays import read_arrays
from damping.formats.series import Stated, Summary
from damping.predict import prepare
from damping.records.mode import Mode, read_mode
from damping.records.reading import read_record
from damping.records.record import Record
from damping_pipelines.campaign import PAGES, _read_earlier
from damping_pipelines.campaign_page import describe_answer, tabulate_damping, tabulate_modes, write_page
from damping_pipelines.manifest import digest, publish, verify
from damping_pipelines.study_files import read_settings
from tests.campaign.linear import accelerate
from tests.campaign.spectra import data_set, write_shaken, write_spectra
from tests.files import write_csv, write_hdf5

G = 9.80665
#: (Hz, damping ratio at rest, growth with amplitude in 1/m, participation).
MODES = ((41.0, 0.009, 800.0, 0.9), (44.3, 0.007, 1500.0, 0.5))
SHAPES = np.array([[1.0, 0.4], [0.7, -0.8], [-0.5, 0.9], [0.6, 0.7], [0.0, 0.0]])
LEVELS = (0.1, 0.2, 0.4)
REVERSED = 3
DEAD = 4
FREQUENCY = np.geomspace(20.0, 80.0, 600)
SIZE = 1_000_000  # bytes of a file, at most


def motion(level: float, f: np.ndarray) -> np.ndarray:
    """Absolute accelerations (sensors, n) in g under a base acceleration of ``level`` g."""
    w, base = 2 * np.pi * f, level * G
    total = np.full((len(SHAPES), len(f)), base, dtype=complex)
    for k, (f_n, ratio, growth, part) in enumerate(MODES):
        w_n = 2 * np.pi * f_n
        low, high = np.zeros_like(f), np.ones_like(f)
        for _ in range(60):
            A = 0.5 * (low + high)
            over = A * np.hypot(w_n**2 - w**2, 2 * ratio * (1 + growth * A) * w_n * w) > part * base
            low, high = np.where(over, low, A), np.where(over, A, high)
        q = -part * base / (w_n**2 - w**2 + 2j * ratio * (1 + growth * A) * w_n * w)
        total += SHAPES[:, k : k + 1] * -(w**2) * q
    return total / G


def measured(level: float, rng: np.random.Generator) -> np.ndarray:
    """What the sensors read: 0.5 % and 0.0005 g of noise, one turned round, one dead."""
    found = motion(level, FREQUENCY)
    found[REVERSED] *= -1.0
    found[DEAD] = 0.0
    noise = rng.normal(size=(2, *found.shape)) / 2**0.5
    return found + (noise[0] + 1j * noise[1]) * np.hypot(0.005 * np.abs(found), 0.0005)


def written(path: Path, kind: str = "hdf5") -> Path:
    rng = np.random.default_rng(8)
    readings = {level: measured(level, rng) for level in LEVELS}
    if kind == "hdf5":
        return write_shaken(path, FREQUENCY, readings)
    sets = []
    for level, rows in readings.items():
        names = [f"{level} g acc {s}" for s in range(len(rows))]
        if kind == "ratio":
            sets += [
                of_sensor(name, row / level, 10 + s) for s, (name, row) in enumerate(zip(names, rows, strict=True))
            ]
        else:  # as some programs write: SI values under a label of g
            drive = np.full(len(FREQUENCY), level, complex)
            sets += [
                spectrum(name, G * row, k)
                for k, (name, row) in enumerate(zip([f"{level} g control", *names], [drive, *rows], strict=True))
            ]
    path.write_text("".join(sets))
    return path


def of_sensor(title: str, values: np.ndarray, node: int, *further: str, entity: str = "SC") -> str:
    """A frequency response in g/g."""
    return data_set(title, FREQUENCY, values, *further, function=4, node=node, entity=entity, per=(12, "g"))


def spectrum(title: str, values: np.ndarray, node: int, *further: str) -> str:
    return data_set(title, FREQUENCY, values, *further, node=node)


@pytest.mark.parametrize(("kind", "name"), [("spectra", "a.uff"), ("ratio", "b.uff"), ("hdf5", "c.h5")])
def test_modes_residues_and_bad_sensors_are_found(tmp_path, kind, name):
    runs, _ = read_runs([written(tmp_path / name, kind)], 10 * SIZE)
    levels, names = fit_levels(runs), runs[0].names
    modes = join_modes(levels)
    assert len(modes) == len(MODES)
    for k, (mode, (f_n, _, _, part)) in enumerate(zip(modes, MODES, strict=True)):
        np.testing.assert_allclose(mode.frequency, f_n, rtol=1e-3)  # a tenth of the per cent that is asked for
        # 0.5 % of noise over some 30 rows in the band leaves 0.1 %; 1 % is far beyond it
        np.testing.assert_allclose(mode.residues[:3], part * SHAPES[:3, k], rtol=0.01)
        assert set(mode.left_out) == {names[REVERSED], names[DEAD]}
        assert "reversed" in mode.left_out[names[REVERSED]]
        assert "dead" in mode.left_out[names[DEAD]]


@pytest.mark.parametrize(("changed", "gain"), [(None, 1.0), (0, 1.05), (1, 1.25), (2, 0.7)])
def test_a_gain_that_changes_at_one_level_is_of_its_sensor(tmp_path, changed, gain):
    """Found from 10 % on; the residues of the others stay what they are."""
    path = written(tmp_path / "c.h5")
    with h5py.File(path, "r+") as file:
        readings = file["run_0.4g"]["accelerations"]
        if changed is not None:
            readings[changed] = readings[changed] * gain
    runs, _ = read_runs([path], 10 * SIZE)
    names = runs[0].names
    modes = join_modes(fit_levels(runs))
    told = {names[REVERSED], names[DEAD]} | ({names[changed]} if abs(gain - 1.0) > 0.1 else set())
    for k, mode in enumerate(modes):
        assert set(mode.left_out) == told
        kept = [s for s in range(3) if names[s] not in told and s != changed]
        np.testing.assert_allclose(mode.residues[kept], MODES[k][3] * SHAPES[kept, k], rtol=0.01)
        if names[changed or 0] in told:
            read = re.search(r"in run 'run_0.4g' it reads ([\d.]+) times", mode.left_out[names[changed]])
            np.testing.assert_allclose(float(read[1]), gain, rtol=0.01)


def test_of_two_runs_neither_is_the_one_with_the_right_gain(tmp_path):
    """A sensor of 1.25 times the gain in the upper run reads 1.25 times there, or 1/1.25 in the lower: that is told."""
    path = written(tmp_path / "c.h5")
    with h5py.File(path, "r+") as file:
        del file["run_0.2g"]
        readings = file["run_0.4g"]["accelerations"]
        readings[1] = readings[1] * 1.25
    runs, _ = read_runs([path], 10 * SIZE)
    told = join_modes(fit_levels(runs))[0].left_out[runs[0].names[1]]
    read = re.search(r"it reads ([\d.]+) times its reading relative to the others in the other", told)
    assert min(abs(np.log(float(read[1]) * ratio)) for ratio in (1.25, 1.0 / 1.25)) < 0.01


def test_the_word_for_a_level_is_no_part_of_a_name(tmp_path):
    """'Level 0.1 g, response 1': the sensor is 'response 1', a ratio in its unit over that of the drive."""
    rows = enumerate(motion(0.1, FREQUENCY)[:2])
    sets = [of_sensor(f"Level 0.1 g, response {s + 1}", row, 11 + s) for s, row in rows]
    (tmp_path / "a.uff").write_text("".join(sets))
    (run,), summary = read_runs([tmp_path / "a.uff"], 10 * SIZE)
    assert run.names == ["response 1", "response 2"]
    assert run.level == 0.1
    said = {what: text for what, text, _ in summary.rows}
    assert said["channel 'response 1'"] == "sensor of acceleration in g per g"


@pytest.mark.parametrize("title", ["FRF at {} g", "{} g"])
def test_functions_of_one_title_are_sensors_by_their_points(tmp_path, title):
    """Each (node, direction) is a sensor of its own over the levels; equal points are refused."""
    rows = {level: motion(level, FREQUENCY)[:3] for level in LEVELS}
    for level, values in rows.items():
        sets = [of_sensor(title.format(level), row, 11 + s) for s, row in enumerate(values)]
        (tmp_path / f"{level}.uff").write_text("".join(sets))
    runs, _ = read_runs([tmp_path / f"{level}.uff" for level in LEVELS], 10 * SIZE)
    for run, level in zip(runs, LEVELS, strict=True):
        assert run.names == ["node 11 +Z", "node 12 +Z", "node 13 +Z"]
        for channel, row in zip(run.channels, rows[level], strict=True):
            np.testing.assert_allclose(channel.samples, row, rtol=1e-10)  # eleven digits are written
    with (tmp_path / "0.2.uff").open("a") as file:
        file.write(of_sensor(title.format(0.2), rows[0.2][2], 12))
    with pytest.raises(InputError, match=r"'0.2 g' has 2 sensors 'node 12 \+Z'"):
        read_runs([tmp_path / "0.2.uff"], 10 * SIZE)


@pytest.mark.parametrize(
    ("seconds", "entities", "names"),
    [
        (("0.2 g, tip", "0.2 g, mid"), ("SC", "SC"), ["tip", "mid"]),
        (("Hanning", "Hanning"), ("TIP", "MID"), ["TIP", "MID"]),
        (("tip", "NONE"), ("NONE", "MID"), ["node 11 +Z", "node 12 +Z"]),
    ],
)
def test_functions_of_one_title_are_named_by_a_line_that_tells_them_apart(tmp_path, seconds, entities, names):
    """The second ID line, else the entity of the response; either must name every sensor."""
    rows = motion(0.2, FREQUENCY)
    of = zip(seconds, entities, strict=True)
    sets = [of_sensor("0.2 g FRF", rows[s], 11 + s, a, entity=b) for s, (a, b) in enumerate(of)]
    (tmp_path / "a.uff").write_text("".join(sets))
    assert read_runs([tmp_path / "a.uff"], 10 * SIZE)[0][0].names == names


@pytest.mark.parametrize("ratio", [False, True])
@pytest.mark.parametrize("note", ["{} g", "Level: {} g", "qualification, {} g, 2 oct/min"])
def test_levels_in_a_further_id_line_tell_runs_apart(tmp_path, ratio, note):
    """The first ID line is the sensor's name in every run; level and readings are those of each."""
    sets = []
    for level in LEVELS:
        further = ("NONE", "NONE", note.format(level))
        if not ratio:
            sets.append(spectrum("control", np.full(len(FREQUENCY), level, complex), 1, *further))
        rows = motion(level, FREQUENCY)[:2] / (level if ratio else 1.0)
        sets += [(of_sensor if ratio else spectrum)(f"acc {s}", row, 10 + s, *further) for s, row in enumerate(rows)]
    (tmp_path / "a.uff").write_text("".join(sets))
    runs, _ = read_runs([tmp_path / "a.uff"], 10 * SIZE)
    assert [run.level for run in runs] == list(LEVELS)
    for run, level in zip(runs, LEVELS, strict=True):
        assert run.names == ["acc 0", "acc 1"]
        np.testing.assert_allclose(run.channels[1].samples, motion(level, FREQUENCY)[1] / (level if ratio else 1.0))


def test_a_range_in_a_further_id_line_is_no_level(tmp_path):
    """Sensors of 50 g and 10 g in one run; runs that nothing tells apart ask for the level."""
    rows = [np.full(len(FREQUENCY), 0.2, complex), *motion(0.2, FREQUENCY)[:2]]
    said = zip(("control", "acc 0", "acc 1"), rows, ("10 g", "50 g", "10 g"), strict=True)
    text = "".join(spectrum(name, row, 1 + k, "NONE", note) for k, (name, row, note) in enumerate(said))
    (tmp_path / "a.uff").write_text(text)
    (run,), _ = read_runs([tmp_path / "a.uff"], 10 * SIZE)
    assert (run.level, run.names) == (pytest.approx(0.2), ["acc 0", "acc 1"])
    (tmp_path / "a.uff").write_text(2 * text)
    expected = r"2 sensors 'node 2 \+Z'; expected one file per level, or levels in an ID line"
    with pytest.raises(InputError, match=expected):
        read_runs([tmp_path / "a.uff"], 10 * SIZE)


@pytest.mark.parametrize(("level", "taken"), [("1.96133 m/s^2", 0.2), ("0.2 N", None)])
def test_the_level_of_a_ratio_is_one_of_its_drive(tmp_path, level, taken):
    """Ratios to g: a level in m/s^2 is 1/9.80665 of it in g, and one in N is none."""
    (tmp_path / "a.uff").write_text(of_sensor(f"{level} tip", motion(0.2, FREQUENCY)[0] / 0.2, 11))
    if taken is None:
        with pytest.raises(InputError, match=r"without a level; expected that of the drive \(in g\)"):
            read_runs([tmp_path / "a.uff"], 10 * SIZE)
    else:
        assert read_runs([tmp_path / "a.uff"], 10 * SIZE)[0][0].level == pytest.approx(taken)


def test_scalings_in_id_lines_are_words_of_any_header(tmp_path):
    """As ``eff`` and ``pk-to-pk``; peak values are those that are expected."""
    source = Source(tmp_path / "a.uff", SIZE, Corrections(), Summary(), set(), Stated())
    source.note_scaling(["0.3 g tip", "0.3 g tip peak", "0.3 g tip eff", "peak level, pk-to-pk", "offset"])
    assert [re.search("both ([^,]*),", note)[1] for note in source.summary.notes] == ["eff", "pk-to-pk"]


def test_several_forces_are_not_averaged(tmp_path):
    """Two drives at once are named, in either kind of file."""
    path = write_spectra(tmp_path / "a.h5", FREQUENCY, {"run_1N": {"force_1": 1.0, "force_2": 1.0, "tip": 1.0}})
    with pytest.raises(InputError, match=r"run_1N: 2 drives, force_1, force_2; expected one force"):
        read_runs([path], 10 * SIZE)
    row = motion(0.2, FREQUENCY)[0]
    forces = [data_set(f"{name} 2 N", FREQUENCY, row, ordinate=(13, "N")) for name in ("left", "right")]
    (tmp_path / "a.uff").write_text("".join([*forces, spectrum("tip 2 N", row, 2)]))
    with pytest.raises(InputError, match=r"2 N: 2 drives, left, right; expected one force"):
        read_runs([tmp_path / "a.uff"], 10 * SIZE)


@pytest.mark.parametrize(("note", "said"), [("RMS spectrum", "rms"), ("peak-to-peak", "peak-to-peak"), ("peak", None)])
def test_a_scaling_in_the_id_lines_is_said(tmp_path, note, said):
    rows = {"control": np.full(len(FREQUENCY), 0.2, complex), "acc": motion(0.2, FREQUENCY)[0]}
    sets = [spectrum(f"0.2 g {name}", row, k, note) for k, (name, row) in enumerate(rows.items())]
    (tmp_path / "a.uff").write_text("".join(sets))
    cautions = [text for text in read_runs([tmp_path / "a.uff"], 10 * SIZE)[1].notes if "caution" in text]
    assert len(cautions) == (said is not None)
    assert all(f"both {said}" in text for text in cautions)


@pytest.mark.parametrize("tried", ["few_laws", pytest.param("few_draws", marks=pytest.mark.slow)])
def test_the_command_predicts_every_sensor(tmp_path, damping, no_drawing, tried, request):
    request.getfixturevalue(tried)
    out = tmp_path / "out"
    run = damping("campaign", written(tmp_path / "c.h5"), "--out", out, "--design", 0.8)
    assert run.code == 0
    assert "±: standard error. low to high: 90 % band" in run.out
    assert "peak of the sensor that moves most" in run.out
    answer = json.loads((out / "campaign.json").read_text())
    assert answer["format"] == "campaign/1"
    assert answer["levels"] == list(LEVELS)
    inside, widths = [], []
    for mode, (f_n, *_) in zip(answer["modes"], MODES, strict=True):
        at = mode["at"][-1]
        assert at["level"] == 0.8
        f = np.linspace(0.985 * f_n, 1.015 * f_n, 4001)
        peaks = np.max(np.abs(motion(0.8, f)), axis=1)
        largest = max(at["response"], key=lambda one: one["median"])
        for s, one in enumerate(at["response"]):
            assert one["sensor"] == f"accelerations[{s}]"
            assert one["unit"] == "g"
            inside.append(one["low"] <= peaks[s] <= one["high"])
            widths.append(one["high"] / one["low"])
            if one is largest:
                np.testing.assert_allclose(one["median"], peaks[s], rtol=0.06)  # what is asked of a campaign
        assert (out / "modes" / mode["name"] / "record.csv").exists()
        # frequency and mass are those of the rows beside it: no knowledge
        assert read_mode(out / "modes" / mode["name"] / "mode.toml").tolerance.from_record
    assert np.mean(inside) >= 0.8  # of six 90 % bands at most one is missed, but for one case in nine
    assert (out / "study.toml").exists()
    assert "mode-2" in (out / "report.html").read_text()
    assert max(widths) <= 1.6  # what is asked of a campaign


@pytest.mark.parametrize("name", ["study.toml", "modes/mode-1/mode.toml"])
def test_files_edited_since_the_last_run_are_not_replaced(tmp_path, damping, monkeypatch, name):
    """They were, without a word; an edit that was moved elsewhere is in nobody's way."""
    monkeypatch.setattr("damping_pipelines.campaign.analyse", Mock(side_effect=AnalysisError("at work")))
    out, source = tmp_path / "out", written(tmp_path / "c.h5")
    publish(out, dict.fromkeys((*PAGES, name), b"as written"), seed=0, versions={}, inputs={})
    assert damping("campaign", source, "--out", out).code == 1
    (out / name).write_text("as edited")
    run = damping("campaign", source, "--out", out)
    assert run.code == 2
    assert f"{name}: has been edited since an earlier run wrote it" in run.err
    assert (out / name).read_text() == "as edited"
    (out / name).unlink()
    assert damping("campaign", source, "--out", out).code == 1


def test_page_terminal_and_study_say_what_was_asked(tmp_path, damping, monkeypatch, few_laws):
    """80 columns: each row with its level and whole; the page with limits, every level, the law of a ranking."""
    monkeypatch.setenv("COLUMNS", "80")
    out, source = tmp_path / "out", written(tmp_path / "c.h5")
    run = damping("campaign", source, "--out", out, "--design", 0.8, "--limit", "accelerations[0]=8", "--quiet")
    table = run.out.split("modes of the campaign")[-1]
    rows = [line.split() for line in table.splitlines() if line.startswith("mode-1 ") and line.split()[-1] != "-"]
    rows = [row for row in rows if row[-1].replace(".", "").isdigit()]
    assert [row[1] for row in rows if "(g)" not in row] == ["0.1", "0.2", "0.4", "0.8"]
    assert [row[1:4] for row in rows if "(g)" in row] == [
        ["accelerations[0]", "(g)", level] for level in ("0.1", "0.2", "0.4", "0.8")
    ]
    said = " ".join(run.out.split())
    assert "below 0.8 g; at most" in said
    assert "dB from the 0.4 g tested at this mode" in said
    form = json.loads((out / "campaign.json").read_text())
    page = (out / "report.html").read_text()
    assert '<th scope="col"></th>' not in page  # every column has a name
    for mode in form["modes"]:
        lowest = min((at for at in mode["at"] if at["tested"]), key=lambda at: at["level"])["damping_ratio"]
        median, low, high = (f"{100.0 * lowest[name]:#.3g}" for name in ("median", "low", "high"))
        assert f"{median} ({low} to {high}) at {form['levels'][0]:g} g" in page  # 3.40, as in the terminal
        assert f"{mode['frequency']:#.5g} Hz. First law" in page
        folder = out / "modes" / mode["name"]
        ranked = rank(read_record(folder / "record.csv"), read_mode(folder / "mode.toml"))
        assert mode["law"] == ranked.ranking.candidates[0].name
        assert f"First law in the ranking of its record: {mode['law']}." in page
        assert sum(law["weight"] for law in mode["laws"]) == pytest.approx(1.0)
        for at in mode["at"]:
            for peak in at["response"]:
                assert f"{peak['median']:.4g}" in page  # tested levels too
        for notch in mode["notches"]:
            assert (f"{notch['low']:.4g}" if notch["low"] else "none") in page
    settings = tomllib.loads((out / "study.toml").read_text())
    assert [record["design_levels"] for record in settings["records"]] == [["0.8 g"]] * 2


@cache
def decay(start: float) -> np.ndarray:
    """Two modes with viscous and quadratic damping integrated in time, seen at three floors: (rows, 4)."""
    t = np.arange(0.0, 120.0, 0.02)
    shapes = np.array([[1.0, -0.9], [0.6, 0.8], [0.3, 0.9]])
    total = np.zeros((3, len(t)))
    for k, (f_n, ratio, growth, q0) in enumerate(((0.7, 0.006, 20.0, start), (1.9, 0.008, 60.0, start / 4))):
        w_n = 2 * np.pi * f_n

        def rate(_, y, w_n=w_n, ratio=ratio, growth=growth):
            return [y[1], -(w_n**2) * y[0] - 2 * ratio * w_n * (1 + growth * abs(y[0])) * y[1]]

        found = solve_ivp(rate, (0.0, t[-1]), [q0, 0.0], t_eval=t, method="DOP853", rtol=1e-8, atol=1e-12)
        total += shapes[:, k : k + 1] * np.gradient(found.y[1], t)
    return np.column_stack([t, total.T])


def decayed(path: Path, start: float) -> Path:
    header = "time [s],roof [m/s^2],mid [m/s^2],low [m/s^2]"
    np.savetxt(path, decay(start), delimiter=",", header=header, comments="")
    return path


def test_decays_of_several_floors_give_modes_and_shapes(tmp_path):
    files = [decayed(tmp_path / f"d{k}.csv", start) for k, start in enumerate((0.005, 0.02))]
    runs, _ = read_runs(files, 10 * SIZE)
    modes = decay_modes(runs)
    assert runs[0].names == ["roof", "mid", "low"]
    assert [round(mode.mode.frequency, 2) for mode in modes] == [0.7, 1.9]
    # the second mode is seen through the skirts of the first: 2 % of the largest
    np.testing.assert_allclose(modes[0].shape, [1.0, 0.6, 0.3], atol=0.02)
    np.testing.assert_allclose(np.abs(modes[1].shape) / 1.0, np.array([0.9, 0.8, 0.9]) / 0.9, atol=0.03)


HEADER = "time [s],force [N],a [m/s^2]\n"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("a,b\n1,2\n", "a column of time"),
        (HEADER + "".join(f"{k / 100},1,x\n" for k in range(50)), "numbers in every row from line 2 on"),
        (HEADER + "".join(f"{(k / 100) ** 2},1,2\n" for k in range(50)), "not evenly spaced"),
        ("time [s],tip [m]\n" + "".join(f"{k / 100},{(-1) ** k}\n" for k in range(5)), "no mode"),
        ("frequency,force,amplitude\n1,1,1\n2,1,1\n", "'amplitude' has no phase; expected a column amplitude phase"),
        ("time [s],tip [m]\n0,1\n", "1 sample from 0 to 0 s; expected two samples or more, at rising times"),
        ("time [s],tip [m]\n2,1\n1,2\n", "2 samples from 2 to 1 s; expected two samples or more, at rising times"),
        ("\x07\x01\x02 binary \x03", "neither UFF, MAT .* nor text; expected a file of one of these"),
    ],
)
def test_what_is_no_campaign_says_what_is_expected(tmp_path, content, expected):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises((InputError, AnalysisError), match=expected):
        analyse([path])


def corrected(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def test_what_was_found_can_be_corrected(tmp_path):
    """A level, a reversed and a dead sensor, a unit: the table shows the names by which they are stated."""
    source = written(tmp_path / "c.h5")
    plain, summary = read_runs([source], 10 * SIZE)
    shown = [what for what, _, _ in summary.rows]
    assert {"run 'run_0.2g'", f"channel 'accelerations[{REVERSED}]'"} <= set(shown)
    text = (
        f'[runs."run_0.2g"]\nlevel = 0.25\n[runs."run_0.4g"]\nout = true\n[channels."accelerations[{REVERSED}]"]\n'
        f'reverse = true\n[channels."accelerations[{DEAD}]"]\nrole = "out"\n'
        '[channels."accelerations[0]"]\nunit = "m/s^2"\n'
    )
    runs, _ = read_runs([source], 10 * SIZE, read_corrections(corrected(tmp_path / "c.toml", text)))
    assert [run.level for run in runs] == [0.1, 0.25]
    by_name = {one.name: one for one in runs[0].channels}
    assert f"accelerations[{DEAD}]" not in by_name
    assert by_name["accelerations[0]"].unit == "m/s^2"
    turned = by_name[f"accelerations[{REVERSED}]"].samples
    np.testing.assert_array_equal(turned, -plain[0].channels[REVERSED].samples)


TACHO = '[channels."tacho"]\n'


@pytest.mark.parametrize("drive", ["force [N],", ""])
def test_a_channel_in_an_unknown_unit_can_be_corrected(tmp_path, drive):
    """Volts are refused with the remedy; left out, the others stay; 1 V is 10 m/s^2 where that is stated."""
    t = np.arange(0.0, 20.0 if drive else 10.0, 1e-3)
    phase = 2 * np.pi * (20.0 * t + 0.05 * t**2)
    rows = [t, *([np.sin(phase)] if drive else []), 3.0 * np.sin(phase), 0.2 * np.sin(phase)]
    path = tmp_path / "s_1N.csv"
    header = f"time [s],{drive}tip [m/s^2],tacho [V]"
    np.savetxt(path, np.column_stack(rows), delimiter=",", header=header, comments="")
    with pytest.raises(InputError, match=r"'tacho' is in V; expected .*--correct states its unit, or role = 'out'"):
        read_runs([path], 100 * SIZE)
    out = read_corrections(corrected(tmp_path / "out.toml", f'{TACHO}role = "out"\n'))
    (run,) = read_runs([path], 100 * SIZE, out)[0]
    assert run.names == ["tip"]
    right = read_corrections(corrected(tmp_path / "right.toml", f'{TACHO}unit = "m/s^2"\nscale = 10\n'))
    (other,) = read_runs([path], 100 * SIZE, right)[0]
    tip, tacho = other.channels
    assert (tacho.unit, tacho.quantity) == ("m/s^2", "acceleration")
    np.testing.assert_array_equal(tip.samples, run.channels[0].samples)
    np.testing.assert_allclose(tacho.samples, tip.samples * 2.0 / 3.0, rtol=1e-9)  # one signal of two sizes


@pytest.mark.parametrize("kind", ["spectra", "hdf5"])
def test_a_drive_and_a_spectrum_in_volts_can_be_corrected(tmp_path, kind):
    """A drive that is told by its name has a scale; a spectrum in V is left out or has its unit."""
    path = written(tmp_path / ("c.h5" if kind == "hdf5" else "c.uff"), kind)
    plain = read_runs([path], 10 * SIZE)[0][0]
    scaled = read_corrections(corrected(tmp_path / "c.toml", "[channels.control]\nscale = 1.02\n"))
    run = read_runs([path], 10 * SIZE, scaled)[0][0]
    np.testing.assert_allclose(run.drive, 1.02 * plain.drive, rtol=1e-12)
    if kind == "hdf5":
        with h5py.File(path, "a") as file:
            for group in file.values():
                group["tacho"] = np.ones(len(FREQUENCY), complex)
                group["tacho"].attrs["units"] = "V"
        with pytest.raises(InputError, match="of 'tacho' the unit 'V' is not understood"):
            read_runs([path], 10 * SIZE)
        out = read_corrections(corrected(tmp_path / "out.toml", f'{TACHO}role = "out"\n'))
        assert read_runs([path], 10 * SIZE, out)[0][0].names == plain.names


@pytest.mark.parametrize("encoding", ["utf-16", "cp1252"])
def test_tables_are_read_in_their_encoding(tmp_path, monkeypatch, encoding):
    """The run of a table is that of the same table in UTF-8, whatever its blocks cut."""
    monkeypatch.setattr("damping.campaign.tracked.BLOCK", 100_003)
    t = np.arange(0.0, 20.0, 1e-3)
    phase = 2 * np.pi * (20.0 * t + 0.05 * t**2)
    rows = "".join(f"{time:.3f};{math.sin(at):.6f};{3 * math.sin(at):.6f}\n" for time, at in zip(t, phase, strict=True))
    runs = []
    for name in ("utf-8", encoding):
        path = tmp_path / name / "s_1N.csv"
        path.parent.mkdir()
        path.write_text(f"time [s];force [N];größe [m/s²]\n{rows}".replace(".", ","), encoding=name)
        runs.append(read_runs([path], SIZE)[0][0])
    assert runs[0].names == runs[1].names == ["größe"]
    np.testing.assert_array_equal(runs[0].channels[0].samples, runs[1].channels[0].samples)
    np.testing.assert_allclose(np.abs(runs[1].channels[0].samples), 3.0, rtol=1e-4)  # six digits are written


def dwelt():
    """Times, a force of 2 N at 20 Hz and a motion of three times that."""
    t = np.arange(0.0, 20.0, 1e-3)
    x = np.sin(2 * np.pi * 20.0 * t)
    return t, 2.0 * x, 6.0 * x


def test_histories_in_mat_files_are_tracked(tmp_path):
    """They were refused with the advice to give a column of time, which was there."""
    t, force, tip = dwelt()
    scipy.io.savemat(tmp_path / "a.mat", {"Test": {"t": t, "force": force[:, np.newaxis], "tip": tip, "fs": 1e3}})
    facts = Stated(units={"force": "N", "response": "m/s^2"})
    (run,) = read_runs([tmp_path / "a.mat"], SIZE, facts=facts)[0]
    np.testing.assert_allclose([run.level, np.abs(run.channels[0].samples).max()], [2.0, 6.0], rtol=1e-6)
    with pytest.raises(InputError, match=r"column tip: a sensor has no unit.*--unit response=m/s\^2"):
        read_runs([tmp_path / "a.mat"], SIZE, facts=Stated(units={"force": "N"}))


def test_decays_in_mat_and_hdf5_files(tmp_path):
    """Groups with times and no drive; a unit is asked for, as it says what was measured."""
    t = np.arange(0.0, 20.0, 0.005)
    roof = 4.0 * np.exp(-0.01 * 2 * np.pi * 6.0 * t) * np.cos(2 * np.pi * 6.0 * t)
    scipy.io.savemat(tmp_path / "a.mat", {"t": t, "roof": roof})
    with pytest.raises(InputError, match="column roof: a sensor has no unit"):
        read_runs([tmp_path / "a.mat"], SIZE)
    named = {"time": t, "roof": (roof, "m/s^2")}
    files = {tmp_path / "a.mat": {"response": "m/s^2"}, write_hdf5(tmp_path / "b.h5", {"blow": named}): {}}
    for path, units in files.items():
        (mode,) = analyse([path], facts=Stated(units=units)).modes
        lowest = mode.places[0]
        np.testing.assert_allclose([lowest.frequency, lowest.ratio.median], [6.0, 0.01], rtol=2e-3)


def test_a_force_goes_before_a_voltage_that_is_called_drive(tmp_path):
    """As in every other file; the voltage was the drive, and the force a sensor in N, which none is."""
    t, force, tip = dwelt()
    columns = {"time [s]": t, "Drive [V]": force / 3.0, "Force cell [N]": force, "tip [m/s2]": tip}
    out = read_corrections(corrected(tmp_path / "out.toml", '[channels.Drive]\nrole = "out"\n'))
    (run,) = read_runs([write_csv(tmp_path / "a.csv", columns)], SIZE, out)[0]
    assert (run.drive_unit, run.names) == ("N", ["tip"])
    np.testing.assert_allclose(run.level, 2.0, rtol=1e-6)


def test_what_is_taken_for_a_free_decay_says_how_a_drive_is_stated(tmp_path):
    t, force, tip = dwelt()
    driven = write_csv(tmp_path / "a.csv", {"time [s]": t, "foot [m/s2]": force, "tip [m/s2]": tip})
    with pytest.raises(AnalysisError, match=r"role = 'drive' in --correct FILE.toml"):
        analyse([driven])


def test_page_of_decays_names_no_input(tmp_path, damping, few_laws, no_drawing):
    """Levels of one mode are no levels of the other, and names of runs are those of the files."""
    files = [decayed(tmp_path / f"d_{k}.csv", start) for k, start in enumerate((0.005, 0.02))]
    run = damping("campaign", *files, "--out", tmp_path / "out", "--quiet")
    form = json.loads((tmp_path / "out" / "campaign.json").read_text())
    page = (tmp_path / "out" / "report.html").read_text()
    assert "peak of the sensor" not in run.out  # it is the level
    assert len(form["levels"]) > 2
    assert f"{len(form['modes'])} modes at 2 levels." in page
    assert "input at the mode" not in page
    assert "against the amplitude of the sensor that moves most in m/s^2" in page
    assert "<li>d_0: the decay after" in page


def test_times_of_a_decay_may_be_in_ms(tmp_path):
    path = tmp_path / "d.csv"
    path.write_text("time [msec.],tip [m/s^2]\n0,0\n1,1\n")
    with pytest.raises(InputError, match=r"time in msec\.; expected one of s, .*ms"):
        read_runs([path], SIZE)
    path.write_text("time [ms],tip [m/s^2]\n" + "".join(f"{k},{math.sin(k)}\n" for k in range(50)))
    np.testing.assert_allclose(read_runs([path], SIZE)[0][0].x, 1e-3 * np.arange(50), rtol=1e-12)


@pytest.mark.parametrize(("unit", "per_second"), [("s", 1.0), ("ms", 1e3)])
def test_times_of_a_group_have_their_unit(tmp_path, unit, per_second):
    """A sine swept from 20 to 40 Hz in 10 s; times in ms were taken for seconds."""
    t = np.arange(20_000) / 2000.0
    phase = 2.0 * np.pi * (20.0 * t + t**2)
    columns = {"force": (np.sin(phase), "N"), "tip": (2.0 * np.sin(phase - 0.3), "m/s^2")}
    path = write_hdf5(tmp_path / "a.h5", {"run_1N": {"time": (per_second * t, unit)} | columns})
    (run,), _ = read_runs([path], 10 * SIZE)
    assert 20.0 < run.x[0] < 21.0  # the first and the last rows are averages over some periods
    assert 39.0 < run.x[-1] < 40.0


def test_several_control_channels_are_averaged_or_the_largest_is_taken(tmp_path):
    control = np.outer([0.09, -0.11], np.ones(len(FREQUENCY))).astype(complex)
    columns = {"control": control, "accelerations": (motion(0.1, FREQUENCY), "g")}
    path = write_spectra(tmp_path / "c.h5", FREQUENCY, {"run_0.1g": columns})
    largest = read_corrections(corrected(tmp_path / "c.toml", '[drive]\ncontrol = "maximum"\n'))
    np.testing.assert_allclose(np.abs(read_runs([path], SIZE)[0][0].drive), 0.01, rtol=1e-12)
    np.testing.assert_allclose(np.abs(read_runs([path], SIZE, largest)[0][0].drive), 0.11, rtol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[channels."acc 9"]\nrole = "drive"\n', r"no channel 'acc 9'"),
        (
            '[channels."acc 9"]\nrole = "out"\n',
            r"no channel 'acc 9'; expected such as 'accelerations\[\d\]' or accelerations\[\d\], .*control",
        ),
        ("[runs.run_0]\nlevel = 1.0\n", "no run 'run_0'; expected such as 'run_0.*g'"),
        ('[channels.control]\nrole = "boss"\n', "line 2, column role: is 'boss'; expected sensor or drive or out"),
        ('[drive]\ncontrol = "mean"\n', "is 'mean'; expected average or maximum"),
        ('[channels.control]\nunits = "g"\n', "unknown key"),
    ],
)
def test_corrections_of_what_is_not_there(tmp_path, text, message):
    source = written(tmp_path / "c.h5")
    with pytest.raises(InputError, match=message):
        read_runs([source], 10 * SIZE, read_corrections(corrected(tmp_path / "c.toml", text)))


def test_a_design_input_over_frequency():
    curve = DesignLevel(np.array([20.0, 40.0, 80.0]), np.array([1.0, 4.0, 1.0]))
    expected = [1.0, 4.0, 2.0, 1.0]
    np.testing.assert_allclose([curve.at(f) for f in (10.0, 40.0, 40.0 * 2**0.5, 200.0)], expected, rtol=1e-12)
    assert DesignLevel.flat(8.0).at(55.0) == 8.0  # the level that was asked for, to the last digit
    with pytest.raises(InputError, match="no level"):
        DesignLevel(np.array([2.0, 1.0]), np.array([1.0, 1.0]))


F_N = 30.0
RATIO = 0.01
#: Third harmonic of the tip at 1 N and 30 Hz, m, and its lag, rad.
THIRD, LAG_3 = 2e-7, 0.7
SWEEP = np.log(40.0 / 22.0) / 90.0  # of ln f a second: .57 octaves a minute


@cache
def driven_mode(level: float) -> tuple[np.ndarray, ...]:
    """Time, phase of the force, force and acceleration of a mode of 2 kg under a swept force."""
    fine = np.arange(0.0, 90.0, 1.0 / 4000.0)  # straight between samples: right to 3e-4 at 40 Hz
    turned = 2 * np.pi * 22.0 * (np.exp(SWEEP * fine) - 1.0) / SWEEP
    force, w_n = level * np.sin(turned), 2 * np.pi * F_N
    acceleration = accelerate(force, 1.0 / 4000.0, w_n, RATIO, 2.0)
    return fine[::4], turned[::4], force[::4], acceleration[::4]


def shaken(path: Path, level: float) -> Path:
    """A mode under a swept force: two sensors and the force in a file of any kind, a third harmonic in the sensors."""
    t, turned, force, acceleration = driven_mode(level)
    rng = np.random.default_rng(int(10 * level))
    third = -9.0 * (2 * np.pi * F_N) ** 2 * THIRD * level * np.sin(3.0 * turned - LAG_3)
    columns = {"time": t, "force": force, "tip": acceleration + third, "mid": 0.5 * (acceleration + third)}
    noisy = {name: x + (0.002 * rng.normal(size=len(t)) if name != "time" else 0.0) for name, x in columns.items()}
    units = {"time": "s", "force": "N", "tip": "m/s^2", "mid": "m/s^2"}
    if path.suffix == ".csv":
        header = ",".join(f"{name} [{units[name]}]" for name in noisy)
        np.savetxt(path, np.column_stack(list(noisy.values())), delimiter=",", header=header, comments="", fmt="%.6g")
        return path
    run, of_time = f"run_{level:g}N", {name: x for name, x in noisy.items() if name != "time"}
    if path.suffix == ".tdms":
        with TdmsWriter(path) as file:
            for name, x in of_time.items():
                properties = {"wf_increment": 1e-3, "unit_string": units[name]}
                file.write_segment([ChannelObject(run, name, x, properties)])
    elif path.suffix == ".uff":
        of = {"force": (13, 0), "tip": (12, 1), "mid": (12, 2)}  # specific data type and node
        sets = [
            {"type": 58, "binary": 1, "func_type": 1, "id1": f"{name} {level:g} N", "data": x, "x": t, "rsp_node": node,
             "rsp_dir": 3, "ref_node": 0, "ref_dir": 0, "abscissa_spacing": 1, "abscissa_spec_data_type": 17,
             "ordinate_spec_data_type": code, "orddenom_spec_data_type": 0,
             "ordinate_axis_units_lab": units[name], "abscissa_min": 0.0,
             "abscissa_inc": 1e-3, "abscissa_axis_units_lab": "s"}
            for (name, x), (code, node) in zip(of_time.items(), of.values(), strict=True)
        ]  # fmt: skip
        pyuff.UFF(str(path)).write_sets(sets, "add", force_double=True)
    else:
        with h5py.File(path, "w") as file:
            if path.suffix == ".nc4":  # the controller's layout: the force is told by its unit
                file.attrs["sample_rate"] = 1000
                file["time_data"] = np.array(list(of_time.values()))
                for name, values in {"node_number": list(of_time), "unit": [units[name] for name in of_time]}.items():
                    file[f"channels/{name}"] = np.array(values, dtype=h5py.string_dtype())
                return path
            for name, x in noisy.items():
                file[f"{run}/{name}"] = x
                file[f"{run}/{name}"].attrs["units"] = units[name]
    return path


@pytest.mark.parametrize("ending", ["csv", "h5", "tdms", "uff", "nc4"])
def test_histories_with_a_drive_are_tracked(tmp_path, ending, monkeypatch):
    """In blocks smaller than the file; the record has the rate, and steady states of it are those of the mode."""
    monkeypatch.setattr("damping.campaign.tracked.BLOCK", 400_000)
    monkeypatch.setattr("damping.campaign.sources.SAMPLES", 120_000)
    most = 100 * SIZE if ending == "uff" else 1  # what is read in blocks may be of any size
    run = read_runs([shaken(tmp_path / f"s_2N.{ending}", 2.0)], most)[0][0]
    assert (run.level, run.drive_unit) == (2.0, "N")
    assert {one.name for one in run.channels} == {"tip", "mid"}
    inside = (run.x > 23.0) & (run.x < 39.0)
    np.testing.assert_allclose(run.rate[inside], SWEEP * run.x[inside], rtol=0.05)
    mode = join_modes(fit_levels([run]))[0]
    steady = prepare(mode.record, mode.mode).record.table
    w, w_n = 2 * np.pi * steady["frequency"], 2 * np.pi * F_N
    Z = steady["force"] / steady["amplitude"] * np.exp(1j * steady["phase"])
    # .3 Hz/s beside a bandwidth of .6 Hz: 0.8 bandwidths in the time one takes, uncorrected 15 % off
    np.testing.assert_allclose(np.median(Z.to_numpy().imag / w), 2.0 * 2.0 * RATIO * w_n, rtol=0.05)
    np.testing.assert_allclose(mode.mode.mass, 2.0, rtol=0.1)
    # acceleration of 9 w^2 THIRD at 30 Hz, so that the motion is THIRD (30/f)^2, and its lag that of the motion
    scaled = steady["amplitude_3"] * (steady["frequency"] / F_N) ** 2
    np.testing.assert_allclose(np.median(scaled), 2.0 * THIRD, rtol=0.05)  # noise of 0.002 m/s^2 in windows of 250
    np.testing.assert_allclose(np.median(steady["phase_3"]), LAG_3, atol=0.05)


@pytest.mark.parametrize("drive", ["tip2", "force"])
def test_a_group_of_a_tdms_file_is_read_without_the_others(tmp_path, monkeypatch, drive):
    """Decays, or histories with a drive: memory does not grow with the number of runs."""
    t, read = np.arange(0.0, 30.0, 2e-3), []
    x = np.cos(2.0 * np.pi * (8.0 * t + 0.1 * t**2)) if drive == "force" else np.exp(-t) * np.cos(60.0 * t)
    with TdmsWriter(tmp_path / "a.tdms") as file:
        for (size, group), name in product(enumerate(("run 1", "run 2"), 1), ("tip", drive)):
            about = {"wf_increment": 2e-3, "unit_string": "N" if name == "force" else "m/s^2"}
            file.write_segment([ChannelObject(group, name, size * x, about)])

    def spy(*args, **named):
        found = read_arrays(*args, **named)
        read.append({name.partition("/")[0] for name in found.arrays})
        return found

    monkeypatch.setattr("damping.campaign.sources.read_arrays", spy)
    monkeypatch.setattr("damping.formats.arrays.read_arrays", spy)
    assert len(read_runs([tmp_path / "a.tdms"], SIZE)[0]) == 2
    first, *runs = read
    assert first == {"run 1", "run 2"}  # a sample of each, for what the file holds
    assert all(len(groups) <= 1 for groups in runs)


def test_rows_at_one_frequency_show_no_mode(tmp_path):
    """Where the user named a mode, they gave its damping to 5 %, by nothing but their scatter."""
    rows = "".join(f"5,1,{1.0 + 0.01 * np.sin(k)},{k}\n" for k in range(40))
    (tmp_path / "a.csv").write_text(f"frequency [Hz],force [N],tip [m],tip phase [deg]\n{rows}")
    with pytest.raises(AnalysisError, match="no resonance in run 'a': it has no two different frequencies"):
        analyse([tmp_path / "a.csv"], frequencies=[5.0])


@pytest.mark.parametrize(
    ("gap", "rows", "said"),
    [
        (0.0, 400, "no sine"),  # even ones reach the tracking
        (0.05, 400, r"not evenly spaced: 1\.99 to 2\.05 s beside steps of 0\.01 s"),
        (0.0, 1, "1 sample from 0 to 0 s"),
    ],
)
def test_times_of_functions_are_even(tmp_path, gap, rows, said):
    """Under a drive, as in tables and groups: steps of their mean gave frequencies of their own."""
    t = np.arange(rows) / 100
    t[200:] += gap
    kinds = {"force": (13, "N"), "tip": (12, "m/s^2")}
    sets = [data_set(name, t, np.ones(rows), function=1, abscissa=(17, "s"), ordinate=of) for name, of in kinds.items()]
    (tmp_path / "a.uff").write_text("".join(sets))
    with pytest.raises((InputError, AnalysisError), match=said):
        read_runs([tmp_path / "a.uff"], SIZE)


def table_of_time(path: Path, times: np.ndarray, drive: np.ndarray) -> Path:
    path.write_text(HEADER + "".join(f"{t},{x},0.5\n" for t, x in zip(times, drive, strict=True)))
    return path


def test_samples_and_times_that_are_no_numbers(tmp_path):
    times = np.arange(50) / 100
    drive = np.sin(times)
    for name, t, x in (("value", times, np.append(drive[:-1], np.nan)), ("time", np.append(times[:-1], np.nan), drive)):
        column = 2 if name == "value" else 1
        with pytest.raises(InputError, match=rf"{name}\.csv, line 51, column {column}: 'nan'; expected numbers"):
            read_runs([table_of_time(tmp_path / f"{name}.csv", t, x)], SIZE)


@pytest.mark.parametrize("cell", ["", "NaN", "inf", "n/a"])
def test_a_cell_of_a_decay_that_is_no_number(tmp_path, damping, cell):
    """Named with file, line and column, whatever stands in it; not taken for a decay without peaks."""
    path = decayed(tmp_path / "d.csv", 0.005)
    lines = path.read_text().splitlines()
    cells = lines[499].split(",")
    lines[499] = ",".join([*cells[:2], cell, *cells[3:]])
    path.write_text("\n".join(lines))
    run = damping("campaign", path, "--out", tmp_path / "out")
    assert run.code == 2
    assert f"{path}, line 500, column mid" in run.err


def test_a_gap_in_a_decay_is_named(tmp_path):
    """With the run and the times about it: 0.02 s from row to row, and 2 s once."""
    paths = [decayed(tmp_path / f"{name}.csv", start) for name, start in (("low", 0.005), ("high", 0.02))]
    lines = paths[1].read_text().splitlines()
    paths[1].write_text("\n".join(lines[:501] + lines[600:]))
    with pytest.raises(InputError, match=r"high: .*not evenly spaced: 9\.98 to 11\.98 s beside steps of 0\.02 s"):
        decay_modes(read_runs(paths, 100 * SIZE)[0])


@pytest.mark.parametrize(
    ("name", "said"), [("accelerations", r"'accelerations\[2\]'"), ("control", "drive of run_0.2g")]
)
def test_spectra_that_hold_no_number(tmp_path, name, said):
    path = written(tmp_path / "c.h5")
    with h5py.File(path, "r+") as file:
        values = file["run_0.2g"][name]
        values[(2, 77) if name == "accelerations" else 77] = np.nan
    with pytest.raises(InputError, match=rf"{said}.* no numbers, the first in row 78 of 600"):
        read_runs([path], 10 * SIZE)


def test_a_gap_between_blocks_is_seen(tmp_path, monkeypatch):
    monkeypatch.setattr("damping.campaign.tracked.BLOCK", 1000)
    times = np.arange(400) / 100
    drive = np.sin(2.0 * np.pi * 5.0 * times)
    rows = [len(f"{t},{x},0.5\n") for t, x in zip(times, drive, strict=True)]
    second = int(np.searchsorted(np.cumsum(rows), 1000)) + 1  # first row of the second block
    times[second:] += 0.05
    with pytest.raises(InputError, match="not evenly spaced"):
        read_runs([table_of_time(tmp_path / "a.csv", times, drive)], SIZE)


def test_a_drive_that_never_moves_does_not_fill_the_memory(tmp_path, monkeypatch):
    monkeypatch.setattr("damping.campaign.tracked.BLOCK", 1000)
    monkeypatch.setattr("damping.signals.histories.MOST_KEPT", 300)
    path = table_of_time(tmp_path / "a.csv", np.arange(1000) / 100, np.ones(1000))
    with pytest.raises(AnalysisError, match="does not rise through zero"):
        read_runs([path], SIZE)


def test_lines_without_end_and_lines_without_rows(tmp_path, monkeypatch):
    monkeypatch.setattr("damping.campaign.tracked.BLOCK", 1000)
    path = table_of_time(tmp_path / "a.csv", np.arange(10) / 100, np.ones(10))
    path.write_text(path.read_text() + "9" * 5000)
    with pytest.raises(InputError, match="a line of more than 1000 characters"):
        read_runs([path], SIZE)
    t = np.arange(2000) / 200
    path = table_of_time(tmp_path / "b_0N.csv", t, np.sin(2.0 * np.pi * 20.0 * t))
    path.write_text(path.read_text() + "\n" * 3000)
    run = read_runs([path], SIZE)[0][0]
    np.testing.assert_allclose(run.level, 1.0, rtol=1e-3)  # a label of no force says nothing; sine of amplitude 1


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="no regular file"):
        read_runs([tmp_path / "pipe"], SIZE)


def test_a_file_that_claims_more_than_it_holds_is_refused(tmp_path):
    """A few kilobytes with arrays of 72 GB that were never written, drawn out to 300 GB by a hole."""
    path = write_hdf5(tmp_path / "a.h5", {"time": np.arange(2000) / 200})
    with h5py.File(path, "a") as file:
        for name in ("control", "a"):
            file.create_dataset(name, (100_000, 90_000), dtype="f8", chunks=(1000, 1000))
    os.truncate(path, 300 * 10**9)
    with pytest.raises(InputError, match=r"larger than the file warrants|no frequency"):
        read_runs([path], SIZE)


def steady_peak(level: float) -> tuple[float, float]:
    """Peak of 20 level/(2 z), z = .01 (1 + level), and z: a mode whose damping grows with its input."""
    z = 0.01 * (1.0 + level)
    return 20.0 * level / (2.0 * z), z


def test_a_notch_keeps_the_upper_bound_at_its_limit():
    """Against the closed form of one resonance: at the ends of the notch the whole input gives the limit."""
    places = []
    for level in np.geomspace(0.1, 2.0, 40):
        peak, z = steady_peak(level)
        response = Response("tip", "acceleration", "g", Bounds(0.9 * peak, 0.8 * peak, peak))
        places.append(At(float(level), False, 50.0, Bounds(z, z, z), (response,), ()))
    allowed = 0.7
    limit, z = steady_peak(allowed)
    notch = find_notches("mode-1", places, 0.5, 2.0, {"tip": limit, "absent": 1.0})
    assert len(notch) == 1
    np.testing.assert_allclose(notch[0].level, allowed, rtol=1e-3)  # straight lines between 40 levels
    np.testing.assert_allclose(notch[0].depth_db, 20 * np.log10(2.0 / allowed), atol=0.01)
    np.testing.assert_allclose(notch[0].more_db, 20 * np.log10(allowed / 0.5), atol=0.01)
    for end in (notch[0].low, notch[0].high):
        assert end is not None
        r = end / 50.0
        np.testing.assert_allclose(20.0 * 2.0 / abs(1.0 - r**2 + 2j * z * r), limit, rtol=2e-3)
    none = find_notches("mode-1", places, 0.5, 0.6, {"tip": limit})[0]
    assert (none.low, none.depth_db) == (None, 0.0)
    assert "no notch; at most +2.9 dB from the 0.5 tested at this mode" in str(none)


@pytest.mark.parametrize(("design", "ends"), [(30.0, (True, True)), (240.0, (False, True)), (1200.0, (False, False))])
def test_a_wide_notch_ends_where_the_motion_is_as_large(design, ends):
    """One resonance of 5 % at 50 Hz, 20 level/|1 - r^2 + 2 i z r|, of any width: its ends, or those of the sweep."""
    z, swept, limit = 0.05, (20.0, 120.0), 20.0 * 20.0 / 0.1  # the limit at a level of 20
    places = []
    for level in np.geomspace(1.0, 1300.0, 40):
        response = Response("tip", "acceleration", "g", Bounds(1.0, 0.5, 20.0 * level / (2.0 * z)))
        places.append(At(float(level), False, 50.0, Bounds(z, z, z), (response,), ()))
    (notch,) = find_notches("mode-1", places, 10.0, design, {"tip": limit}, swept)
    for end, of_sweep, inner in zip((notch.low, notch.high), swept, ends, strict=True):
        r = end / 50.0
        if inner:
            np.testing.assert_allclose(20.0 * design / abs(1.0 - r**2 + 2j * z * r), limit, rtol=1e-9)
        else:
            assert end == of_sweep
            assert 20.0 * design / abs(1.0 - r**2 + 2j * z * r) > limit


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limits": {"ridge": 1.0}}, "--limit of no sensor 'ridge'; expected one of roof, mid, low"),
        ({"limits": {"roof": 1.0}}, "--limit of free decays; expected no --limit"),
        ({"before": EarlierCampaign({})}, "--previous of free decays"),
    ],
)
def test_what_free_decays_have_not_is_refused(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        analyse([decayed(tmp_path / "d.csv", 0.005)], **options)


def test_levels_in_another_unit_are_refused_before_the_work(tmp_path, monkeypatch):
    """A level in N, earlier or to be designed for, says nothing of a drive in m/s^2; one in m/s2 does."""
    monkeypatch.setattr("damping.campaign.fit_right_levels", lambda *_: pytest.fail("analysed"))
    contents = {"control": (np.ones(30), "m/s^2"), "tip": (np.ones(30) + 1.0j, "m/s^2")}
    write_hdf5(tmp_path / "sine.h5", {"frequency": (np.arange(5.0, 35.0), "Hz")} | contents)
    peak = {"sensor": "tip", "unit": "m/s^2", "median": 1.0, "low": 0.9, "high": 1.1}
    mode = {"name": "a", "frequency": 20.0, "at": [{"level": 1.0, "response": [peak]}]}
    form = {"format": "campaign/1", "modes": [mode]}
    for stated, error, said in (
        ({"level_unit": "N"}, InputError, r"levels in N of --previous, in m/s\^2 of these files; expected levels"),
        ({"level_unit": "m/s2"}, pytest.fail.Exception, "analysed"),
        ({}, pytest.fail.Exception, "analysed"),
    ):
        (tmp_path / "campaign.json").write_text(json.dumps(form | stated))
        with pytest.raises(error, match=said):
            analyse([tmp_path / "sine.h5"], before=_read_earlier(tmp_path / "campaign.json"))
    for stated, error, said in (
        ("N", InputError, r"--design in N; expected levels in m/s\^2, the unit of the drive"),
        ("m/s2", pytest.fail.Exception, "analysed"),
        ("", pytest.fail.Exception, "analysed"),
    ):
        with pytest.raises(error, match=said):
            analyse([tmp_path / "sine.h5"], design=[DesignLevel(np.array([20.0]), np.array([1.0]), stated)])


def predicted(level: float, tested: bool) -> At:
    """The closed form of :func:`steady_peak` as predicted, 10 % either way."""
    peak = steady_peak(level)[0]
    response = Response("tip", "acceleration", "g", Bounds(peak, 0.9 * peak, 1.1 * peak))
    return At(level, tested, 50.0, None, (response,), ())


def test_a_run_is_held_against_what_was_predicted(bare_mode):
    """Tested before: nothing is said; new: the peak beside the band; a notched run counts with its input there."""
    before = EarlierCampaign({50.0: [predicted(level, level < 1.0) for level in np.geomspace(0.5, 2.0, 9)]})
    places = [
        At(level, True, 50.0, None, (Response("tip", "acceleration", "g", Bounds(size, size, size)),), (), reached)
        for level, reached, size in (
            (0.5, None, 1.0),
            (1.5, None, 1.05 * steady_peak(1.5)[0]),
            (1.9, 1.2, 1.3 * steady_peak(1.2)[0]),
            (4.0, None, 1.0),
        )
    ]
    found = compare_predictions(before, Campaign((bare_mode(50.3, places),), (), (), "g"))
    assert [(one.level, one.held) for one in found] == [(1.5, True), (1.2, False)]
    # straight between nine levels, 1.19 apart: a tenth of a per cent
    np.testing.assert_allclose([one.above_db for one in found], 20 * np.log10([1.05, 1.3]), atol=0.02)
    assert "OUTSIDE" in str(found[1])
    elsewhere = [replace(at, frequency=60.0) for at in places]  # a mode's frequency is that of its levels
    assert compare_predictions(before, Campaign((bare_mode(60.0, elsewhere),), (), (), "g")) == ()


def known(*tested: float, predicted: float | None = None) -> EarlierCampaign:
    """One mode of 50 Hz and a damping ratio of 1 % at each level."""
    places = [place(level, 50.0, 0.01) for level in tested]
    if predicted is not None:
        places.append(replace(place(predicted, 50.0, 0.01), tested=False))
    return EarlierCampaign({50.0: places})


def banded(value: float) -> Bounds:
    return Bounds(value, 0.98 * value, 1.02 * value)


def place(level: float, frequency: float, z: float, gain: float = 1.0) -> At:
    """A measured level: peaks of two sensors, 2/z and 1/z times the level, 2 % either way; ``gain``: of root."""
    peaks = [
        Response(name, "acceleration", "g", banded(share * level / z)) for name, share in (("tip", 2.0), ("root", gain))
    ]
    return At(level, True, frequency, banded(z), tuple(peaks), ())


@pytest.mark.parametrize(
    ("frequency", "z", "gain", "words"),
    [
        (50.0, 0.01, 1.0, []),
        (50.2, 0.0102, 1.01, []),
        (50.0, 0.02, 1.0, ["damping 2 % (1, 0.98 to 1.02 then, OUTSIDE)", "tip -6.0 dB", "root -6.0 dB"]),
        (49.0, 0.01, 1.0, ["49 Hz (50 then, -2.0 %)"]),
        (50.0, 0.01, 0.5, ["root -6.0 dB"]),
    ],
)
def test_levels_that_were_tested_before_are_compared(bare_mode, frequency, z, gain, words):
    before = known(0.5, 1.0, predicted=2.0)
    places = [place(level, frequency, z, gain) for level in (0.5, 1.0)]
    lines = describe_changes(before, Campaign((bare_mode(frequency, places),), (), (), "g"))
    if not words:
        assert lines == ("every level was tested before, and frequency, damping and peaks are the same",)
        return
    assert [line.split(":")[0] for line in lines] == [
        "mode-1 at 0.5 g, tested before, has changed",
        "mode-1 at 1 g, tested before, has changed",
    ]
    assert all(word in line for line in lines for word in words)
    assert all(("OUTSIDE" in line, "dB" in line) == (z > 0.015, z > 0.015 or gain < 0.9) for line in lines)


def test_a_new_level_has_its_frequency_and_damping_beside_the_predicted(bare_mode):
    before = known(0.5, 1.0, predicted=2.0)
    mode = bare_mode(50.0, [place(1.0, 50.0, 0.01), place(2.0, 49.5, 0.013), place(4.0, 50.0, 0.01)])
    assert describe_changes(before, Campaign((mode,), (), (), "g")) == (
        "mode-1 at 2 g: 49.5 Hz (50 predicted, -1.0 %); damping 1.3 % (1, 0.98 to 1.02 predicted, OUTSIDE)",
        "mode-1 at 4 g: outside the levels of the earlier campaign, nothing to compare",
    )
    (as_predicted,) = describe_changes(before, Campaign((bare_mode(50.0, [place(2.0, 49.999, 0.01)]),), (), (), "g"))
    assert as_predicted.startswith("mode-1 at 2 g: 49.999 Hz (50 predicted, +0.0 %)")
    unknown = EarlierCampaign({50.0: [replace(at, ratio=None) for at in before.modes[50.0]]})
    assert describe_changes(unknown, Campaign((replace(mode, places=mode.places[1:]),), (), (), "g")) == (
        "mode-1 at 2 g: the earlier campaign has no frequency and damping there",
        "mode-1 at 4 g: outside the levels of the earlier campaign, nothing to compare",
    )


def test_a_single_level_is_compared_with_itself(bare_mode):
    mode = bare_mode(49.0, [place(1.0, 49.0, 0.01)])
    (line,) = describe_changes(known(1.0), Campaign((mode,), (), (), "g"))
    assert line.startswith("mode-1 at 1 g, tested before, has changed: 49 Hz (50 then, -2.0 %)")


def test_modes_without_a_counterpart_are_named(bare_mode):
    before = known(0.5, 1.0)
    mode = bare_mode(46.0, [place(level, 46.0, 0.01) for level in (0.5, 1.0)])
    assert describe_changes(before, Campaign((mode,), (), (), "g")) == (
        "mode-1, 46 Hz: the earlier campaign has no mode within 5 %, the nearest at 50 Hz",
        "the mode of the earlier campaign at 50 Hz: none here within 5 %",
    )
    assert describe_changes(EarlierCampaign({}), Campaign((mode,), (), (), "g")) == ()


def test_of_two_close_modes_the_nearer_is_compared(bare_mode):
    """Both lie within the 5 % that make a mode the same."""
    modes = {50.0: 0.01, 51.5: 0.02}
    levels = {f: [replace(place(level, f, z), tested=False) for level in (0.5, 2.0)] for f, z in modes.items()}
    before = EarlierCampaign(levels)
    for frequency, z in modes.items():
        mode = bare_mode(frequency, [place(1.0, frequency, z)])
        found = compare_predictions(before, Campaign((mode,), (), (), "g"))
        np.testing.assert_allclose([one.above_db for one in found], 0.0, atol=1e-9)


def test_a_mode_that_moves_away_at_one_level_is_named(tmp_path, few_laws):
    """It stands 1000 standard errors out of the noise at three levels, and 8 % lower at the fourth."""
    rng = np.random.default_rng(8)
    f = np.linspace(22.0, 80.0, 350)

    def reading(first: float) -> np.ndarray:
        modes = [g * f**2 / (at**2 - f**2 + 2j * z * at * f) for at, z, g in ((first, 0.012, 1.3), (58.0, 0.012, -0.5))]
        return (1.0 + sum(modes)) * (1.0 + 0.004 * rng.normal(size=len(f)))

    levels = {0.1: 32.0, 0.2: 32.0, 0.4: 32.0, 0.8: 29.5}
    runs = {f"run_{x}g": {"control": (x, "g"), "tip": (x * reading(first), "g")} for x, first in levels.items()}
    found = analyse([write_spectra(tmp_path / "sine.h5", f, runs)])
    assert [round(mode.frequency) for mode in found.modes] == [58]
    (note,) = (note for note in found.summary.notes if "left out" in note)
    assert note.startswith("the mode near 32 Hz is left out, because its levels do not agree (32 Hz at 0.1 g")


def test_a_mode_that_only_sensors_left_out_show_is_named(tmp_path):
    """Of one level nobody can say that its levels do not agree."""
    rng, f = np.random.default_rng(8), np.linspace(22.0, 80.0, 350)
    first, second = (f**2 / (at**2 - f**2 + 2j * 0.012 * at * f) for at in (32.0, 58.0))
    motions = {"tip": 1.0 + second, "mid": 1.0 - 0.5 * second, "back": -1.0 - first - 0.2 * second}
    read = {name: (0.1 * x * (1.0 + 0.004 * rng.normal(size=len(f))), "g") for name, x in motions.items()}
    path = write_spectra(tmp_path / "sine.h5", f, {"run_0.1g": {"control": (0.1, "g")} | read})
    levels = fit_levels(read_runs([path], 10 * SIZE)[0])
    tied = join_modes(levels)
    assert [round(mode.mode.frequency) for mode in tied] == [58]
    (note,) = describe_lost(levels, tied)
    assert note == "the mode near 32 Hz is left out, because only sensors left out show it (back)"


def test_a_mode_that_is_asked_for_and_not_there_is_named(tmp_path):
    """By the frequency that was asked for, wherever the fit went from it."""
    rng, f = np.random.default_rng(9), np.linspace(45.0, 75.0, 200)
    tip = 0.1 * (1.0 + f**2 / (58.0**2 - f**2 + 1.4j * f)) * (1.0 + 0.004 * rng.normal(size=len(f)))
    path = write_spectra(tmp_path / "sine.h5", f, {"run_0.1g": {"control": (0.1, "g"), "tip": (tip, "g")}})
    runs, asked = read_runs([path], 10 * SIZE)[0], (300.0, 58.0)
    levels = fit_levels(runs, asked)
    tied = join_modes(levels, asked=asked)
    assert [round(mode.mode.frequency) for mode in tied] == [58]
    (note,) = describe_lost(levels, tied, asked)
    assert note == "the mode near 300 Hz is left out, because no sensor shows it 8 standard errors out of the noise"
    with pytest.raises(AnalysisError, match=r"of the modes sought near 300 Hz none stands 8 standard .*: name others"):
        join_modes(fit_levels(runs, [300.0]), asked=[300.0])
    with pytest.raises(InputError, match=r"--modes 300: no run holds that frequency; expected 45 to 75 Hz"):
        analyse([path], frequencies=asked)


def test_a_mode_with_less_than_a_window_in_every_decay_is_refused(tmp_path):
    """A window of six periods of 0.1 Hz takes 60 s, each decay 20 s."""
    t = np.arange(0.0, 20.0, 0.01)
    q = np.exp(-0.1 * t) * np.cos(2 * np.pi * 2.0 * t)
    write_csv(tmp_path / "a.csv", {"time [s]": t, "roof [m/s2]": q, "mid [m/s2]": 0.5 * q})
    with pytest.raises(InputError, match=r"--modes 0\.1: no run holds that frequency; expected 0\.300\d Hz or more"):
        analyse([tmp_path / "a.csv"], frequencies=[0.1, 2.0])


def test_the_page_of_a_repeated_campaign_says_what_changed(bare_mode):
    before = known(0.5, 1.0)
    mode = bare_mode(50.0, [place(level, 50.0, 0.02) for level in (0.5, 1.0)])
    answer = Campaign((mode,), (0.5, 1.0), (), "g", level_name="force")
    answer = replace(answer, changes=describe_changes(before, answer))
    (section,) = (section for section in write_page(answer) if section.title == "Predicted and measured")
    text = str(section)
    assert "No peak was predicted." in text
    assert "mode-1 at 0.5 g, tested before, has changed" in text


@pytest.fixture
def bare_mode():
    """A mode of nothing but its frequency and levels."""

    def make(frequency: float, places: list[At]) -> ModeAnswer:
        table = pd.DataFrame({"sweep": ["a"], "force": [1.0], "frequency": [frequency], "amplitude": [1.0]})
        mode = Mode(name="mode-1", frequency=frequency, mass=1.0)
        return ModeAnswer("viscous", tuple(places), {}, Record(table, "r"), mode, ())

    return make


def test_a_notched_run_is_taken_at_its_input():
    f = np.linspace(40.0, 60.0, 201)
    drive = np.where(np.abs(f - 50.0) < 3.0, 4.0, 10.0)
    run = CampaignRun("r", 10.0, "N", f, drive.astype(complex), ())
    level = Level(run, f, np.zeros((0, 201)), drive, None)
    assert find_input(level, 50.0) == 4.0
    assert find_input(level, 45.0) == 10.0


def test_rows_beside_a_notch_are_fitted_at_their_own_input(tmp_path, few_laws):
    """0.1 g near the first mode and 0.8 g beside it: peak and damping are those of 0.1 g alone."""
    level = np.where(np.abs(FREQUENCY - 41.0) < 1.3, 0.1, 0.8)
    readings = np.where(level == 0.1, motion(0.1, FREQUENCY), motion(0.8, FREQUENCY))[:3]
    noise = np.random.default_rng(5).normal(size=(2, *readings.shape)) * 0.005 / 2**0.5
    columns = {"control": level.astype(complex), "accelerations": (readings * (1.0 + noise[0] + 1j * noise[1]), "g")}
    write_spectra(tmp_path / "a.h5", FREQUENCY, {"run_0.8g": columns})
    levels = fit_levels(read_runs([tmp_path / "a.h5"], 10 * SIZE)[0], [41.0, 44.3])
    fine = np.linspace(40.5, 41.5, 2001)
    base, (f_n, ratio, growth, part) = 0.1 * G, MODES[0]
    A = part * base / (2 * ratio * (2 * np.pi * f_n) ** 2)
    for _ in range(60):  # at resonance A (1 + growth A) is what the base gives
        A = part * base / (2 * ratio * (1 + growth * A) * (2 * np.pi * f_n) ** 2)
    # 0.5 % of noise over some 20 rows and three sensors; without the input of each row 6 % were missed
    np.testing.assert_allclose(levels[0].fit.ratio[0], ratio * (1 + growth * A), rtol=0.01)
    mode = analyse([tmp_path / "a.h5"], [0.8], [41.0, 44.3]).modes[0]
    peaks = {peak.sensor: peak.band[0] for peak in mode.places[0].response}
    assert mode.places[0].reached == pytest.approx(0.1)
    for s, true in enumerate(np.max(np.abs(motion(0.1, fine)), axis=1)[:3]):
        np.testing.assert_allclose(peaks[f"accelerations[{s}]"], true, rtol=0.01)


def test_a_form_that_is_no_campaign(tmp_path, damping):
    wrong = tmp_path / "campaign.json"
    wrong.write_text('{"format": "rank/1"}')
    run = damping("campaign", wrong, "--out", tmp_path / "out", "--previous", wrong)
    assert run.code == 2
    assert "campaign.json" in run.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["tip=1", "tip=2"], "--limit tip is given twice; expected each once"),
        (["tip"], "--limit 'tip' is not understood; expected --limit SENSOR=VALUE"),
        (["tip=0"], "--limit tip=0 is no limit; expected SENSOR=VALUE"),
    ],
)
def test_limits_that_are_not_understood(tmp_path, damping, words, message):
    source = written(tmp_path / "c.h5")
    run = damping(
        "campaign", source, "--out", tmp_path / "out", *(part for word in words for part in ("--limit", word))
    )
    assert run.code == 2
    assert message in run.err


def test_modes_with_design_levels_of_their_own_are_one_table(bare_mode):
    """Levels of two modes differ where each has the unit of its own motion, or the input is a curve."""
    modes = tuple(bare_mode(f, [At(f, False, f, Bounds(0.01, 0.009, 0.011), (), ())]) for f in (10.0, 20.0))
    notched = bare_mode(10.0, [At(12.0, True, 10.0, Bounds(0.01, 0.009, 0.011), (), (), 7.82)])
    (said,) = tabulate_modes(Campaign((notched,), (), (), "N"))["damping ratio at the lowest level, %"]
    assert said == "1.00 (0.900 to 1.10) at 12 N, notched: 7.82 N at the mode"
    (hertz,) = tabulate_damping(bare_mode(41.0, [At(0.1, True, 41.0, Bounds(0.01, 0.009, 0.011), (), ())]), "g")[
        "frequency, Hz"
    ]
    assert hertz == "41.000"  # of a mode whose error is not known the five digits of the terminal
    table = tabulate_modes(Campaign(modes, (), (), "g"))
    assert not table.isna().any(axis=None)
    assert list(table["damping ratio at the last design level, %"]) == [
        "1.00 (0.900 to 1.10) at 10 g",
        "1.00 (0.900 to 1.10) at 20 g",
    ]


def test_the_page_begins_with_the_answer(bare_mode, no_drawing):
    """The largest peak of each unit with its band, trends from bands that are apart, cautions with their modes."""
    tip, gap = (
        Response("tip", "acceleration", "g", Bounds(8.0, 7.0, 9.0)),
        Response("gap", "displacement", "mm", Bounds(2.0, 1.0, 3.0)),
    )
    asked = At(4.0, False, 50.0, banded(0.03), (tip, gap), ("beyond the test: 2.00 times", "no law leads"))
    grows = bare_mode(50.0, [place(1.0, 50.0, 0.01), place(2.0, 50.0, 0.02), asked])
    same = bare_mode(70.0, [place(1.0, 70.0, 0.01), place(2.0, 70.0, 0.01)])
    same = replace(same, mode=replace(same.mode, name="mode-2"), left_out={"root": "clipped"})
    summary = Summary(
        notes=["caution: mode-2: of that mode", "caution: rms or peak?", "the mode near 9 Hz is lost", "a remark"]
    )
    answer = Campaign((grows, same), (1.0, 2.0), (4.0,), "g", summary, level_name="force")
    values = describe_answer(answer)
    assert [(one["level"], one["peak"], one["band"], one["sensor"]) for one in values["largest"]] == [
        ("4 g", "8.00 g", "7.00 to 9.00 g", "tip"),
        ("4 g", "2.00 mm", "1.00 to 3.00 mm", "gap"),
    ]
    assert values["least"] is None
    assert values["trends"] == ["grows in mode-1 (by 100 %)", "stays within its band in mode-2"]
    assert values["beyond"] == 2.0
    assert values["doubts"] == ["rms or peak?", "the mode near 9 Hz is lost"]
    of_answer = [own for own in values["gravest"] if "beyond-model" not in own[0]]  # a finding on the bare record
    assert of_answer == [("no law leads", ["mode-1"]), ("root is left out: clipped", ["mode-2"])]
    page = str(write_page(answer)[0])
    assert "Largest predicted response: at 4 g expect 8.00 g (7.00 to 9.00 g, 90 % predictive band) at tip" in page
    assert "; at 4 g expect 2.00 mm" in page
    page = str(write_page(replace(answer, modes=(same,)))[0])
    assert "Nothing is predicted at a design level. Largest measured response: at 2 g, 400 g (" in page
    assert "90 % band of the measurement) at tip in mode-2" in page
    assert "Least damping: 3.00 % of critical (" in str(write_page(replace(answer, level_name="amplitude"))[0])


def test_a_mode_that_the_audit_refuses(tmp_path, damping, monkeypatch, bare_mode):
    """A lead for a lag, in whatever way it came there: nothing is written, and the check is named."""
    r = np.linspace(0.94, 1.06, 21)
    response = 10.0 / (1.0 - r**2 + 0.04j * r)
    columns = {"sweep": "A", "force": 10.0, "frequency": 41.0 * r, "amplitude": np.abs(response)}
    record = Record(pd.DataFrame({**columns, "phase": np.angle(response)}), "mode-1")
    refused = replace(bare_mode(41.0, []), record=record)
    monkeypatch.setattr("damping_pipelines.campaign.analyse", lambda *_: Campaign((refused,), LEVELS, (0.8,), "g"))
    run = damping("campaign", written(tmp_path / "c.h5"), "--out", tmp_path / "out")
    assert run.code == 1
    assert "mode-1: phase-sign (refuse)" in run.err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("header", "rows", "said"),
    [
        ("frequency [rpm],level [g rms]", "1200,1\n4800,2\n", ""),
        ("frequency [furlong],level", "20,1\n80,2\n", "design.csv: frequency in furlong; expected one of hz"),
    ],
)
def test_a_table_of_design_levels_is_in_the_units_of_its_header(tmp_path, damping, monkeypatch, header, rows, said):
    """1200 and 4800 a minute are 20 and 80 Hz; 1 g rms is a sine of sqrt(2) g."""
    asked = []

    def analyse(sources, levels, *_):
        asked.extend(levels)
        return Campaign((), LEVELS, (0.8,), "g")

    monkeypatch.setattr("damping_pipelines.campaign.analyse", analyse)
    (tmp_path / "design.csv").write_text(f"{header}\n{rows}")
    (tmp_path / "run.csv").write_text("lo")
    run = damping("campaign", tmp_path / "run.csv", "--out", tmp_path / "out", "--design", tmp_path / "design.csv")
    assert (run.code, said in run.err) == (2 if said else 0, True)
    if not said:
        np.testing.assert_allclose(asked[0].frequency, [20.0, 80.0], rtol=1e-15)
        np.testing.assert_allclose(asked[0].level, [2**0.5, 8**0.5], rtol=1e-15)


def test_the_terminal_gives_the_reason_of_a_dash(tmp_path, damping, monkeypatch, bare_mode):
    why = "no prediction: friction locks the mode at this force"
    held = At(0.2, False, np.nan, None, (), ("beyond the test: 2.00 times the largest tested force", why))
    mode = bare_mode(41.0, [At(0.1, True, 41.0, Bounds(0.01, 0.009, 0.011), (), ()), held])
    answer = Campaign((mode,), (0.1,), (0.2,), "g", level_name="base acceleration")
    monkeypatch.setattr("damping_pipelines.campaign.analyse", lambda *_: answer)
    (tmp_path / "run.csv").write_text("lo")
    run = damping("campaign", tmp_path / "run.csv", "--out", tmp_path / "out")
    assert run.code == 0
    assert run.out.count("mode-1 at") == 1
    assert f"- mode-1 at 0.2 g: {why}" in " ".join(run.out.split())


def test_a_study_file_holds_any_name(tmp_path, damping, monkeypatch, bare_mode):
    """A quote, a backslash and a control character in the name of a file, and a quote in the unit of the drive."""
    places = [At(level, level < 20.0, 41.0, Bounds(0.01, 0.009, 0.011), (), ()) for level in (10.0, 20.0)]
    mode = replace(bare_mode(41.0, places), design_forces=(2.0,))
    answer = Campaign((mode,), LEVELS, (0.8,), 'g"')
    monkeypatch.setattr("damping_pipelines.campaign.analyse", lambda *_: answer)
    path = tmp_path / 'a"b\\c\x01.csv'
    path.write_text("lo")
    assert damping("campaign", path, "--out", tmp_path / "out").code == 0
    settings = read_settings(tmp_path / "out" / "study.toml")
    assert settings.title == f"Campaign: {path.name}"
    assert settings.records[0].design_levels == ('20 g"',)


def test_every_file_that_was_read_is_sealed(tmp_path, damping, monkeypatch):
    """Files of one name are told apart; corrections and tables of design levels are inputs, too."""
    monkeypatch.setattr("damping_pipelines.campaign.analyse", lambda *_: Campaign((), LEVELS, (0.8,), "g"))
    names = ("lo/run.csv", "hi/run.csv", "correct.toml", "design.csv")
    for name, text in zip(names, ("lo", "hi", "# nothing\n", "frequency,level\n20,1\n80,2\n"), strict=True):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    low, high, correct, design = (tmp_path / name for name in names)
    words = ("--design", design, "--design", 0.8, "--correct", correct)
    assert damping("campaign", low, high, "--out", tmp_path / "out", *words).code == 0
    inputs = verify(tmp_path / "out").manifest.inputs
    assert set(inputs) == {"run.csv", "run.csv (2)", "correct.toml", "design.csv"}
    assert (inputs["run.csv"], inputs["run.csv (2)"]) == (digest(b"lo"), digest(b"hi"))


def test_messages_name_the_file_and_the_place(tmp_path, damping):
    """A drive without unit, a blank cell, random excitation, a file that is given twice, and too few seconds."""
    t, rng = np.arange(0.0, 60.0, 0.005), np.random.default_rng(3)

    def table(name: str, drive: np.ndarray, header: str = "force [N]") -> Path:
        rows = np.column_stack([t[: len(drive)], drive, 0.1 * drive])
        path = tmp_path / name
        np.savetxt(path, rows, delimiter=",", header=f"time [s],{header},a [m/s2]", comments="", fmt="%.8g")
        return path

    sine = np.sin(2.0 * np.pi * 5.0 * t)
    bare, noise = table("bare.csv", sine, "force"), table("noise.csv", rng.standard_normal(len(t)))
    blank, short = table("blank.csv", sine), table("short.csv", sine[:600])
    lines = blank.read_text().splitlines()
    lines[101] = lines[101].rpartition(",")[0] + ","
    blank.write_text("\n".join(lines))
    for files, said in (
        ([bare], f"{bare}, column force: the drive has no unit"),
        ([blank], f"{blank}, line 102, column 3: an empty cell; expected numbers in every row"),
        ([noise], f"{noise}, run noise: the drive is no sine over 8 cycles anywhere: random"),
        ([noise, noise], f"{noise}: is given twice"),
        ([short], "no resonance in run 'short'"),
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            run = damping("campaign", *files, "--out", tmp_path / "out")
        assert run.code != 0
        assert f"damping: {said}" in run.err
        assert run.err.count("\n") == 1


@pytest.mark.parametrize(
    ("unit", "factor"), [(None, np.ones(len(FREQUENCY))), ("oct/min", FREQUENCY * np.log(2.0) / 60.0)]
)
def test_the_sweep_rate_of_a_group_is_read(tmp_path, unit, factor):
    """One number for the run or one for each row; 1 oct/min is f ln 2/60 Hz/s. It is no sensor."""
    file = written(tmp_path / "a.h5")
    with h5py.File(file, "r+") as groups:
        for k, group in enumerate(groups.values()):
            group["sweep_rate"] = 0.5 if k else np.full(len(FREQUENCY), 0.5)
            if unit:
                group["sweep_rate"].attrs["units"] = unit
    runs, summary = read_runs([file], SIZE)
    assert not any("sweep_rate" in note for note in summary.notes)
    for run in runs:
        assert "sweep_rate" not in run.names
        np.testing.assert_allclose(run.rate, 0.5 * factor, rtol=1e-12)
