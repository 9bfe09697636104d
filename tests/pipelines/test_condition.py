"""``damping condition`` as a stage: files in, record and steps out, every mistake named with its place."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from damping.errors import AnalysisError, InputError
from damping.infer.observations import observe
from damping.records.keys import read_toml
from damping.records.mode import read_mode
from damping.records.reading import read_record, read_table
from damping.signals import description as schema
from damping_pipelines.tables import condition

SIZE = 10**8
PRINCIPAL = """
[principal]
theta = 28.0
mass = 21.0
frequency_pitch = 11.40
frequency_yaw = 11.50
branch = "near"
xi = 0.005
"""


@pytest.fixture
def raw(saturn_data: Path) -> Path:
    return saturn_data / "raw" / "config-1-mode-2.csv"


@pytest.fixture
def config(saturn_data: Path) -> Path:
    return saturn_data / "condition.toml"


def changed(file: Path, folder: Path, old: str, new: str) -> Path:
    text = file.read_text()
    assert old in text
    path = folder / file.name
    path.write_text(text.replace(old, new, 1))
    return path


def test_the_record_is_one_that_the_other_commands_take(
    raw: Path, config: Path, saturn_data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "record.csv"
    condition(raw, config, out, None, SIZE)
    record = read_record(out)
    mode = read_mode(saturn_data / "modes" / "config-1-mode-2-rough.toml")
    assert len(record) == 15
    assert record.sweeps == ("I",)
    assert_allclose(observe(record).A, record.column("amplitude"), rtol=1e-15)
    assert mode.mass == 21.0
    printed = " ".join(capsys.readouterr().out.split())
    assert "r2_over_i = 0.000192" in printed
    assert "force in lb, length in in, time in s" in printed


def test_the_command_writes_a_record_and_its_steps(
    raw: Path, config: Path, tmp_path: Path, damping: Callable[..., Any]
) -> None:
    done = damping("condition", raw, "--config", config, "--out", tmp_path / "a.csv", "--steps", tmp_path / "steps")
    assert (done.code, done.err) == (0, "")
    assert len(read_record(tmp_path / "a.csv")) == 15
    failed = damping("condition", raw, "--config", raw, "--out", tmp_path / "b.csv")
    assert failed.code == 2
    assert failed.err.count("\n") == 1
    assert not (tmp_path / "b.csv").exists()


def test_the_steps_are_written_and_lead_to_the_record(raw: Path, config: Path, tmp_path: Path) -> None:
    condition(raw, config, tmp_path / "record.csv", tmp_path / "steps", SIZE)
    names = [file.name for file in sorted((tmp_path / "steps").iterdir())]
    steps = (
        *("displacement", "yaw-from-pitch", "node", "mode-factor"),
        *("rigid-body", "adjacent-modes", "modal-force", "record"),
    )
    assert names == [f"{number:02d}-{step}.csv" for number, step in enumerate(steps, start=1)]
    assert (tmp_path / "steps" / "08-record.csv").read_text() == (tmp_path / "record.csv").read_text()
    before, after = (read_table(tmp_path / "steps" / name) for name in (names[4], names[5]))
    removed = after[["removed mode 1", "removed mode 3", "removed mode 4"]].sum(axis=1)
    difference = [t["amplitude"] * np.exp(-1j * t["phase"]) for t in (before, after)]
    assert_allclose(difference[0] - difference[1], removed, rtol=0, atol=1e-14)  # amplitudes of order 1


def test_principal_planes_leave_out_and_name_rows_without_a_root(raw: Path, config: Path, tmp_path: Path) -> None:
    """Points 10 and 13 (erratum E3IV-1)."""
    text = tmp_path / "principal.toml"
    text.write_text(config.read_text() + PRINCIPAL)
    condition(raw, text, tmp_path / "record.csv", tmp_path / "steps", SIZE)
    record = read_record(tmp_path / "record.csv")
    assert [int(point) for point in record.table["point"]] == [*range(1, 10), 11, 12, 14, 15]
    assert "phase" not in record.table
    lines = (tmp_path / "steps" / "08-principal-planes.csv").read_text().splitlines()
    assert len(lines) == 16
    left, point = (lines[0].split(",").index(name) for name in ("left out", "point"))
    assert [line.split(",")[point] for line in lines[1:] if line.split(",")[left] == "1"] == ["10", "13"]


@pytest.mark.parametrize(
    ("old", "new", "line", "column", "words"),
    [
        ("[units]", "[unit]", 6, "unit", "unknown key; expected units"),
        ('force = "lb"', 'forse = "lb"', 7, "units, forse", "unknown key; expected force"),
        ("factor = 1e-2", "factr = 1e-2", 37, "sensors 3, factr", "unknown key; expected factor"),
        ("factor = 1e-2", "factor = -1", 37, "sensors 3, factor", "greater than 0"),
        ("factor = 1e-2", 'factor = "a"', 37, "sensors 3, factor", "'a'; expected a number"),
        ("factor = 1e-2", "factor = inf", 37, "sensors 3, factor", "finite number"),
        ('"acceleration"', '"accel"', 21, "sensors 1, quantity", "'acceleration', 'velocity' or 'displacement'"),
        ('frequency = "rad/s"', 'frequency = "rpm"', 10, "units, frequency", "'Hz' or 'rad/s'"),
        ("frequency = 16.19", "", 58, "modes 2, frequency", "missing key"),
        ('name = "3"', 'name = "1"', 52, "modes", "two modes have one name"),
        ("phi = 0.041", "phi = 0", 50, "mode, phi", "is 0"),
        ('sensor = "tail pitch"', 'sensor = "tail"', 46, "node, sensor", "one of tip pitch, tip yaw, tail pitch"),
        ('tip_yaw = "tip yaw"', 'tip_yaw = "tip"', 41, "yaw 1, tip_yaw", "no sensor 'tip'"),
        ('name = "tail yaw"', 'name = "tail pitch"', 40, "yaw 1, name", "is taken"),
        ('keep = ["point"]', 'keep = ["phase"]', 16, "raw, keep", "would stand for a result"),
        ('sweep_label = "I"', "", 12, "raw", "sweep = COLUMN or sweep_label = TEXT"),
        ('sweep_label = "I"', 'sweep = "force_lb"', 15, "raw, sweep", "is used as a number"),
        ('phase = "tail_phase_rad"', "", 52, "modes", "nothing can be removed without the phase"),
        ('identify_from = "correction_Ct2_in"', "", 70, "rigid_body", "r2_over_i or identify_from"),
        ("[rigid_body]", '[correction]\ncolumn = "x"\n\n[rigid_body]', 70, "correction", "given and computed"),
        ("[rigid_body]", PRINCIPAL.replace("xi = 0.005", "") + "[rigid_body]", 71, "principal", "both or neither"),
        ("[units]", "[units", 6, "7", "not TOML"),
        ('keep = ["point"]', 'keep = "point"', 16, "raw, keep", 'expected a list of columns, ["point"]'),
        ("[mode]                      # Table 3.II\nphi = 0.041", "", None, "mode", "missing table; expected [mode]"),
        ("title", "correction = 3\ntitle", 4, "correction", "3; expected a table"),
        ('keep = ["point"]', 'force_sd = "sd"\nkeep = ["xi_sd"]', 17, "raw, keep", "would stand for a result"),
        ('phase = "tail_phase_rad"', 'phase_sd = "sd"', 47, "node, phase_sd", "no phase that it belongs to"),
        # in the raw table
        (",967,", ",-967,", 4, "force_lb", "expected a force amplitude > 0"),
        (",11.20,", ",0,", 3, "omega_rad_s", "expected a frequency > 0"),
        (",1.503,", ",0.0,", 5, "tail_pitch_disp_in_e2", "expected an amplitude > 0"),
        (",0.3662,", ",-0.3662,", 6, "tip_yaw_accel_g_per_lb_e4", "expected an amplitude >= 0"),
        (",0.479,", ",27.4,", 6, "tail_phase_rad", "expected a phase within one turn (rad)"),
        (",0.364,", ",abc,", 5, "tail_phase_rad", "'abc' is not a number"),
        (",0.364,", ",,", 5, "tail_phase_rad", "empty cell"),
        (",tail_phase_rad,", ",phase,", 1, None, "missing column tail_phase_rad"),
        ("point,", "pont,", 1, None, "no column 'point' to keep"),
    ],
)
def test_a_mistake_in_the_description_or_the_raw_table_is_named_with_its_line(
    old: str, new: str, line: int | None, column: str | None, words: str, raw: Path, config: Path, tmp_path: Path
) -> None:
    of_table = old in raw.read_text() and old not in config.read_text()
    file = changed(raw if of_table else config, tmp_path, old, new)
    with pytest.raises(InputError) as found:
        condition(*((file, config) if of_table else (raw, file)), tmp_path / "record.csv", None, SIZE)
    error = found.value
    assert (error.file, error.line, error.column) == (str(file), line, column)
    assert words in str(error)
    assert not (tmp_path / "record.csv").exists()


def test_uncertainties_reach_the_record(raw: Path, config: Path, tmp_path: Path) -> None:
    lines = raw.read_text().splitlines()
    text = [f"{lines[0]},sd_1,sd_2,sd_3", *(f"{line},5,0.01,{0.02 if k else -1}" for k, line in enumerate(lines[1:]))]
    file = tmp_path / "raw.csv"
    file.write_text("\n".join(text) + "\n")
    stated = changed(config, tmp_path, 'keep = ["point"]', 'keep = ["point"]\nforce_sd = "sd_1"')
    stated = changed(stated, tmp_path, "factor = 1e-2", 'factor = 1e-2\nsd = "sd_2"')
    stated = changed(stated, tmp_path, 'phase = "tail_phase_rad"', 'phase = "tail_phase_rad"\nphase_sd = "sd_3"')
    with pytest.raises(InputError, match=r"line 2, column sd_3: -1; expected a standard uncertainty >= 0"):
        condition(file, stated, tmp_path / "record.csv", None, SIZE)
    file.write_text("\n".join(text).replace(",-1", ",0.02") + "\n")
    condition(file, stated, tmp_path / "record.csv", tmp_path / "steps", SIZE)
    record = read_record(tmp_path / "record.csv")
    assert_allclose(record.column("force_sd"), 0.041 * 5.0, rtol=1e-8)
    # corrections in phase with the force turn some of one into the other; far from resonance by a tenth, at it by less
    assert_allclose(record.column("amplitude_sd")[6:9], 0.0001 / 0.041, rtol=0.2)
    assert_allclose(record.column("phase_sd")[6:9], 0.02, rtol=0.2)
    assert (tmp_path / "steps" / "09-uncertainties.csv").read_text() == (tmp_path / "record.csv").read_text()


def test_the_first_mistake_in_the_file_comes_first(raw: Path, config: Path, tmp_path: Path) -> None:
    text = raw.read_text().replace(",0.479,", ",27.4,").replace(",967,", ",-967,")
    (tmp_path / "raw.csv").write_text(text.replace("\n", "\n\n", 1))  # a blank line: lines are those of the file
    with pytest.raises(InputError, match=r"line 5, column force_lb: -967"):
        condition(tmp_path / "raw.csv", config, tmp_path / "record.csv", None, SIZE)


def test_a_repeated_state_is_named_with_both_lines(raw: Path, config: Path, tmp_path: Path) -> None:
    lines = raw.read_text().splitlines()
    again = lines[3].replace("1.788", "1.789")  # a column that is not used
    (tmp_path / "raw.csv").write_text("\n".join([*lines[:6], again, *lines[6:]]) + "\n")
    with pytest.raises(InputError, match=r"line 7: gives the same row of the record as line 4"):
        condition(tmp_path / "raw.csv", config, tmp_path / "record.csv", None, SIZE)


def test_a_failed_run_leaves_earlier_results(raw: Path, config: Path, tmp_path: Path) -> None:
    out = tmp_path / "record.csv"
    out.write_text("earlier")
    inside = changed(config, tmp_path, "frequency = 6.95", "frequency = 11.40")
    with pytest.raises(AnalysisError, match="inside the swept frequencies"):
        condition(raw, inside, out, tmp_path / "steps", SIZE)
    assert out.read_text() == "earlier"
    assert not (tmp_path / "steps").exists()


def test_inputs_are_never_overwritten(raw: Path, config: Path, tmp_path: Path) -> None:
    own = tmp_path / "raw.csv"
    own.write_text(raw.read_text())
    for out in (own, tmp_path / "." / "raw.csv"):
        with pytest.raises(InputError, match="expected another file"):
            condition(own, config, out, None, SIZE)
    assert own.read_text() == raw.read_text()


def test_a_file_too_large_is_refused(raw: Path, config: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="larger than 100 bytes"):
        condition(raw, config, tmp_path / "record.csv", None, 100)


def test_the_documented_example_is_a_description(tmp_path: Path) -> None:
    """The example of the reference, as it stands, has every key and only known ones."""
    reference = (Path(__file__).parents[2] / "docs" / "reference" / "files.md").read_text()
    text = next(block for block in re.findall(r"```toml\n(.*?)```", reference, re.DOTALL) if "[[sensors]]" in block)
    # alternatives that exclude each other are shown together: take one of each
    for other in ('identify_from = "column"', "[correction]", 'column = "correction_Ct2_in"'):
        assert other in text
        text = "\n".join(line for line in text.splitlines() if not line.startswith(other))
    tail = '\n[[sensors]]\nname = "tip yaw"\ncolumn = "y"\n[[sensors]]\nname = "tail pitch"\ncolumn = "t"\n'
    file = tmp_path / "example.toml"
    file.write_text(text + tail)
    description = schema.Description.model_validate(read_toml(file).values)
    assert list(description.problems()) == []
    for name, model in (("raw", schema.Raw), ("node", schema.Node), ("principal", schema.Principal)):
        documented = getattr(description, name).model_fields_set
        assert set(model.model_fields) - documented <= {"sweep_label"}
    assert description.sensors[0].model_fields_set == set(schema.Sensor.model_fields)


def test_what_the_record_implies_is_said(config: Path, raw: Path, tmp_path: Path, damping: Callable[..., Any]) -> None:
    """Frequency, amplitude and mass at resonance, in the units of the description, and what the audit finds."""
    run = damping("condition", raw, "--config", config, "--out", tmp_path / "record.csv")
    checked = damping("check", tmp_path / "record.csv")
    assert run.code == 0
    assert run.out.count("Values implied by each sweep at its resonance") == 1
    assert next(line for line in checked.out.splitlines() if line.startswith("audit: ")) in run.out


def test_degrees_that_are_taken_for_radians_are_told_how_to_be_stated(
    tmp_path: Path, damping: Callable[..., Any]
) -> None:
    """And a quantity that is none is told which there are."""
    text = (
        '[units]\nforce = "N"\nlength = "m"\ntime = "s"\nphase = "rad"\n'
        '[raw]\nfrequency = "f"\nforce = "F"\nsweep = "run"\n'
        '[[sensors]]\nname = "n"\ncolumn = "a"\nquantity = "acceleration"\n[node]\nsensor = "n"\nphase = "lag"\n'
        "[mode]\nphi = 1.0\nphi_drive = 1.0\n"
    )
    raw, config = tmp_path / "raw.csv", tmp_path / "c.toml"
    raw.write_text("run,f,F,a,lag\n1,9.9,2.0,1.0,20\n1,10.0,2.0,3.0,90\n1,10.1,2.0,1.0,160\n")
    config.write_text(text)
    run = damping("condition", raw, "--config", config, "--out", tmp_path / "record.csv")
    assert run.code == 2
    assert "line 2, column lag: 20" in run.err
    assert 'of degrees say phase = "degrees" in [units]' in run.err
    config.write_text(text.replace('"acceleration"', '"accel"'))
    run = damping("condition", raw, "--config", config, "--out", tmp_path / "record.csv")
    assert "'accel'; expected 'acceleration', 'velocity' or 'displacement'" in run.err


PLAIN = """
[units]
force = "N"
length = "m"
time = "s"
[raw]
frequency = "f"
force = "F"
sweep = "run"
[[sensors]]
name = "tip"
column = "a"
quantity = "acceleration"
[node]
sensor = "tip"
phase = "lag"
[mode]
phi = 1.0
"""


def write_test(folder: Path, text: str = PLAIN, ceiling: float = np.inf, turn: float = 0.0) -> list[object]:
    """Two sweeps of an oscillator of 2 kg, 10 Hz and 1 %: arguments of the command; ``turn`` is added to the lag."""
    rows = []
    for label, force in (("low", 1.0), ("high", 3.0)):
        for f in np.linspace(9.5, 10.5, 31):
            Y = 2.0 * (2.0 * np.pi) ** 2 * (10.0**2 - f**2 + 2j * 0.01 * 10.0 * f)
            a = min(float(force / abs(Y) * (2.0 * np.pi * f) ** 2), ceiling)
            rows.append(f"{label},{f:.10g},{force},{a:.10g},{np.angle(Y) + turn:.10g}")
    (folder / "raw.csv").write_text("\n".join(["run,f,F,a,lag", *rows, ""]))
    (folder / "c.toml").write_text(text)
    return ["condition", folder / "raw.csv", "--config", folder / "c.toml", "--out", folder / "record.csv"]


def test_a_record_that_a_check_refuses_is_not_written(tmp_path: Path, damping: Callable[..., Any]) -> None:
    """The phase of an acceleration is half a turn smaller than that of the displacement."""
    words = write_test(tmp_path, turn=-np.pi)
    run = damping(*words)
    assert run.code == 1
    assert "phase-sign (refuse)" in run.err
    assert "lag = -pi in [node]" in run.err
    assert not (tmp_path / "record.csv").exists()
    assert damping(*words, "--despite", "phase-sign").code == 0
    assert damping(*write_test(tmp_path, PLAIN.replace("[mode]", "lag = -3.14159265\n[mode]"), turn=-np.pi)).code == 0
    found = read_record(tmp_path / "record.csv")
    peak = int(np.argmax(found.column("amplitude")))
    assert_allclose(found.column("phase")[peak], np.pi / 2, atol=1e-8)
    assert_allclose(found.column("amplitude")[peak], 3.0 / (2.0 * (2.0 * np.pi * 10.0) ** 2 * 0.02), rtol=1e-9)


def test_readings_that_stay_at_one_value_are_told(tmp_path: Path, damping: Callable[..., Any]) -> None:
    """Accelerations are clipped, so displacements have no flat top: only the raw table shows it."""
    assert "stay at" not in damping(*write_test(tmp_path)).out
    run = damping(*write_test(tmp_path, ceiling=52.5))
    assert run.code == 0
    assert "readings of tip stay at 52.5 in sweep high" in run.out
    assert "in sweep low" not in run.out


def test_a_removal_beyond_every_amplitude_is_told(tmp_path: Path, damping: Callable[..., Any]) -> None:
    """Readings in g whose unit is not stated are 9.8 times too small."""
    other = '[[modes]]\nname = "2"\nphi = 1.0\nmass = 0.02\nfrequency = 11.0\n'
    said = "mode 2 takes off up to"
    small = PLAIN.replace('"acceleration"\n', '"acceleration"\nunit = 0.01\n') + other
    assert said in " ".join(damping(*write_test(tmp_path, small), "--despite", "phase-sign").out.split())
    usual = PLAIN + other.replace("0.02", "2.0")
    assert said not in " ".join(damping(*write_test(tmp_path, usual), "--despite", "phase-sign").out.split())


def test_steps_of_two_descriptions_are_not_mixed(tmp_path: Path, damping: Callable[..., Any]) -> None:
    other = '[[modes]]\nname = "2"\nphi = 0.1\nmass = 2.0\nfrequency = 20.0\n'
    steps = tmp_path / "steps"
    (steps / "sub").mkdir(parents=True)
    (steps / "notes.csv").write_text("mine")
    assert damping(*write_test(tmp_path, PLAIN + other), "--steps", steps).code == 0
    assert damping(*write_test(tmp_path, PLAIN + other), "--steps", steps).code == 0
    before = {path.name: path.read_bytes() for path in steps.glob("*.csv")}
    run = damping(*write_test(tmp_path), "--steps", steps)
    assert run.code == 2
    assert "04-adjacent-modes.csv: is a step of another run" in run.err
    assert {path.name: path.read_bytes() for path in steps.glob("*.csv")} == before
