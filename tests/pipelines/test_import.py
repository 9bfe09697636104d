"""``damping import`` and ``damping export`` as stages: files in, files out, tables printed, one line of error."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import pyuff
import scipy.io
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from matplotlib.figure import Figure

import damping as dp
from damping.errors import AnalysisError, InputError
from damping.formats.series import Stated
from damping.infer.observations import observe
from damping.plots import to_png
from damping.ranking import rank_laws
from damping.ranking.candidates import candidate_laws
from damping.records.mode import read_mode
from damping.records.reading import read_record, read_table
from damping_pipelines.export import export, read_answer
from damping_pipelines.import_ import import_file, read_band, scales
from damping_pipelines.store import write_json
from damping_pipelines.terminal import parse_pairs
from damping_reed1970 import data_folder

MODE = '[mode]\nname = "plate"\nfrequency = 10.0\nmass = 2.0\n[units]\nforce = "N"\nlength = "m"\ntime = "s"\n'
# by definition
LBF = 4.4482216152605
INCH = 0.0254


@pytest.fixture
def sweep_csv(tmp_path: Path) -> Path:
    """A column map of a linear mode: 2 kg, 10 Hz, 2 %."""
    f = np.linspace(9.0, 11.0, 21)
    w, n = 2 * np.pi * f, 2 * np.pi * 10.0
    H = 1.0 / (2.0 * (n**2 - w**2 + 0.04j * n * w))
    path = tmp_path / "lab.csv"
    table = {"f [Hz]": f, "a [mm]": 1e3 * np.abs(H) * 3.0, "lag [deg]": -np.degrees(np.angle(H)), "drive [N]": 3.0}
    pd.DataFrame(table).to_csv(path, index=False)
    return path


COLUMNS = {"frequency": "f", "amplitude": "a", "lag_deg": "lag", "force": "drive"}


def test_a_file_becomes_a_record(sweep_csv: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, form = tmp_path / "record.csv", tmp_path / "form.json"
    import_file(sweep_csv, out, Stated(columns=COLUMNS, response="displacement"), json_out=str(form))
    record = read_record(out)
    assert record.sweeps == ("lab",)
    assert record.column("amplitude").max() == pytest.approx(3.0 / (0.04 * 2.0 * (20 * np.pi) ** 2), rel=1e-12)
    printed = capsys.readouterr().out
    for words in ("column 'a [mm]'", "amplitude: amplitude", "unit of response", "found in the file", "21 rows"):
        assert words in printed
    told = json.loads(form.read_text())
    assert told["format"] == "import/1"
    response = {"what": "response", "understood": "displacement", "source": "stated", "whence": "stated"}
    assert response in told["understood"]


def test_a_decay_becomes_a_record_that_is_ranked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An acceleration in g against time, two releases; the damping ratio of 1 % comes back as a viscous coefficient."""
    monkeypatch.setenv("COLUMNS", "200")  # a cell on one line, however long the path beside it
    zeta, n = 0.01, 20 * np.pi
    t = np.arange(0, 8, 0.004)
    s = n * complex(-zeta, np.sqrt(1 - zeta**2))
    tables, mode, out = [], tmp_path / "mode.toml", tmp_path / "record.csv"
    mode.write_text(MODE)
    for k, size in enumerate((0.01, 0.02)):
        x = size * (s**2 * np.exp(s * t)).real / 9.80665
        tables.append(pd.DataFrame({"sweep": f"release {k + 1}", "time": t, "response [g]": x}))
    lab = tmp_path / "lab.csv"
    pd.concat(tables).to_csv(lab, index=False)
    with pytest.raises(InputError, match="time histories; expected --ring-down --mode"):
        import_file(lab, out, Stated())
    assert not out.exists()
    import_file(lab, out, Stated(), mode, levels=6)
    said = " ".join(capsys.readouterr().out.split())
    assert "decay 'release 2'" in said
    # exp(-zeta omega t) over half a window of 6 periods, 0.3 s, and the largest reading within half a period before
    (fall,) = re.findall(r"'release 1': the start is lost to half the window: 0.3 s, .* by at most (\d+) %", said)
    assert 100 * (1 - np.exp(-zeta * n * 0.3)) - 1 < float(fall) < 100 * (1 - np.exp(-zeta * n * 0.35)) + 1
    assert re.search(r"6 levels, amplitude [\d.]+ m to [\d.]+ m,", said)
    record = read_record(out)
    assert record.sweeps[0] == "release 1 01"
    c = 2 * 2.0 * zeta * n
    # the image of the window, 1e-3 and of the second harmonic, averages out over levels of some periods
    np.testing.assert_allclose(record.column("force"), c * n * record.column("amplitude"), rtol=5e-3)
    data = observe(read_record(out))
    laws = [law for law in candidate_laws() if law.name in ("viscous", "velocity-squared")]
    best = rank_laws(data, 1, laws).candidates[0]
    assert best.name == "viscous"
    assert best.coefficients[0].value == pytest.approx(c, rel=2e-3)
    with pytest.raises(AnalysisError, match=r"lab\.csv: 'release 1': the record has 1 periods"):
        import_file(lab, out, Stated(), mode, parts=[(7.9, None)])
    with pytest.raises(InputError, match="mode is in N and the record in lbf; expected --to si"):
        import_file(lab, out, Stated(system="us"), mode)
    mode.write_text(MODE.replace('"N"', '"kg"'))  # of the size of N, and no force
    with pytest.raises(InputError, match="mode is in kg and the record in N"):
        import_file(lab, out, Stated(), mode)
    mode.write_text(MODE.replace('"m"', '"mm"'))  # of neither system: --to us would not help
    with pytest.raises(InputError, match="mode is in mm and the record in m; expected --consistent with every value"):
        import_file(lab, out, Stated(), mode)


def test_the_response_to_a_force_is_no_free_decay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """After a chirp has passed the resonance its response falls with the distance, not with the damping."""
    path, mode, out = tmp_path / "a.csv", tmp_path / "mode.toml", tmp_path / "record.csv"
    mode.write_text('[mode]\nname = "bench"\nfrequency = 25.0\nmass = 2.0\n')
    t = np.arange(0.0, 6.0, 0.002)
    decay = np.exp(-0.9 * t) * np.cos(2 * np.pi * 25.0 * t)
    for force, driven in ((np.sin(2 * np.pi * 26.0 * t), True), (np.where(t < 0.004, 50.0, 0.0), False)):
        pd.DataFrame({"Time [s]": t, "Force [N]": force, "Acc [m/s^2]": decay}).to_csv(path, index=False)
        if driven:
            with pytest.raises(AnalysisError, match=r"no free decay: the force acts on; choose a part without it"):
                import_file(path, out, Stated(), mode)
        else:
            import_file(path, out, Stated(), mode)
    named = Stated(columns={"response": "response"}, units={"response": "m/s^2"})
    scipy.io.savemat(tmp_path / "a.mat", {"time": t, "response": np.column_stack([decay, 0.3 * decay])})
    import_file(tmp_path / "a.mat", out, named, mode)
    assert "2 signals are taken as decays of one point" in " ".join(capsys.readouterr().out.split())


def test_a_decay_begins_where_the_drive_stops(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two sine dwells in resonance that are cut off: the one before the larger motion is taken, without the dwell."""
    path, mode, out = tmp_path / "a.csv", tmp_path / "mode.toml", tmp_path / "record.csv"
    mode.write_text('[mode]\nname = "bench"\nfrequency = 25.0\nmass = 2.0\n')
    t, w, zeta, stop = np.arange(0.0, 16.0, 0.002), 2 * np.pi * 25.0, 0.01, 4.0
    since = t % 8.0 - stop
    size = np.where(t < 8.0, 0.5, 1.0) * np.exp(-zeta * w * np.maximum(since, 0.0))
    force = np.where(since < 0.0, 5.0 * np.cos(w * t), 0.0) + 0.01 * np.random.default_rng(1).standard_normal(len(t))
    pd.DataFrame({"Time [s]": t, "Force [N]": force, "Disp [m]": size * np.sin(w * t)}).to_csv(path, index=False)
    import_file(path, out, Stated(), mode)
    said = " ".join(capsys.readouterr().out.split())
    assert "12 s, where the force stops" in said
    assert "the force stops 2 times; --start 4 --end 7.998 --start 12 --end 15.998 takes each" in said
    record = read_record(out)
    # the end of the dwell lies within a sample; the image of the window 1e-3, and its slope over one level
    expected = np.exp(-zeta * w * (record.column("time") - 12.0))
    np.testing.assert_allclose(record.column("amplitude"), expected, rtol=2e-2)
    np.testing.assert_allclose(record.frame["damping_ratio"], zeta, rtol=2e-2)


def test_nothing_is_written_over_what_is_read(sweep_csv: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--out is one of the inputs"):
        import_file(sweep_csv, sweep_csv, Stated(columns=COLUMNS))
    out = tmp_path / "record.csv"
    out.write_text("an earlier result")
    with pytest.raises(InputError, match="type of the response is neither"):
        import_file(sweep_csv, out, Stated(columns=COLUMNS | {"amplitude": "lag", "lag_deg": "a"}, consistent=True))
    assert out.read_text() == "an earlier result"


def test_labels_of_files_do_no_harm(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A formula, terminal control and markup in labels: neutral on paper, on the terminal, and read back as it was."""
    lab, out = tmp_path / "lab.csv", tmp_path / "record.csv"
    label = "=HYPERLINK(1)[red]\x1b[31m"
    pd.DataFrame({"sweep": [label], "frequency": 1.0, "amplitude": 1.0, "force": 1.0}).to_csv(lab, index=False)
    import_file(lab, out, Stated(response="displacement", consistent=True))
    assert "'=HYPERLINK" in out.read_text()
    assert "\x1b" not in capsys.readouterr().out
    assert read_record(out).sweeps == (" ".join(label.split()),)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: parse_pairs("--unit", ["force"]), "--unit 'force' is not understood; expected --unit NAME=VALUE"),
        (lambda: parse_pairs("--unit", ["a=1", "a=2"]), "--unit a is given twice"),
        (lambda: scales(["force=x"]), "--scale force=x is no factor"),
        (lambda: scales(["force=0"]), "no factor"),
        (lambda: read_band("1-2"), "LO:HI in Hz"),
        (lambda: read_band("1:inf"), "LO:HI in Hz"),
    ],
)
def test_options_that_are_not_understood(call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call()


def test_options_that_are_understood() -> None:
    assert parse_pairs("--column", ["frequency=f = x", "sweep=a"]) == {"frequency": "f = x", "sweep": "a"}
    limits = parse_pairs("--limit", ["a=b [g] = 2", "c=3"], last=True)
    assert limits == {"a=b [g]": "2", "c": "3"}
    assert scales(["response=9.81"]) == {"response": 9.81}
    assert read_band("1.5:2") == (1.5, 2.0)
    assert read_band(None) is None


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("name", ["config-1-mode-2-rough", "config-2-mode-1"])
def test_universal_files_there_and_back(tmp_path: Path, name: str, text: bool) -> None:
    """The report's records, a whole sweep with phases and three peaks, exported and imported again."""
    source = data_folder() / "saturn-v" / "records" / f"{name}.csv"
    there, back = tmp_path / "a.unv", tmp_path / "b.csv"
    export(source, there, given="us", text=text)
    import_file(there, back, Stated(system="us"))
    before, after = read_record(source), read_record(back)
    assert after.sweeps == before.sweeps
    # bytes: a ratio and a product; text: 13 digits of values, 6 of frequencies
    for column, digits in (("force", 1e-12), ("amplitude", 1e-12), ("frequency", 5e-6 if text else 1e-15)):
        np.testing.assert_allclose(after.column(column), before.column(column), rtol=digits)
    phase = before.column("phase") if before.has_phase else np.full(len(before), np.pi / 2)
    np.testing.assert_allclose(after.column("phase"), phase, rtol=0, atol=1e-12)


@pytest.mark.parametrize("phased", [False, True])
def test_a_rotation_there_and_back(tmp_path: Path, phased: bool) -> None:
    """Angle by a moment about an axis: rad, or rad per N m, on the way and rad at the end."""
    f = np.linspace(14.0, 16.0, 9)
    H = 1.0 / (0.02 * ((30 * np.pi) ** 2 - (2 * np.pi * f) ** 2 + 2j * 0.02 * 30 * np.pi * 2 * np.pi * f))
    table = {"sweep": "L1", "force": 0.2, "frequency": f, "amplitude": 0.2 * np.abs(H), "phase": -np.angle(H)}
    source, mode = tmp_path / "record.csv", tmp_path / "mode.toml"
    pd.DataFrame(table).drop(columns=[] if phased else "phase").to_csv(source, index=False)
    mode.write_text(MODE.replace("2.0", "0.02").replace("10.0", "15.0").replace('"N"', '"N m"').replace('"m"', '"rad"'))
    back = tmp_path / "back.csv"
    if phased:
        export(source, tmp_path / "a.unv", mode=mode)
        import_file(tmp_path / "a.unv", back, Stated())
    else:  # as a laboratory writes it
        lab = pd.DataFrame({"Freq (Hz)": f, "Torque (mN m)": 200.0, "Angle (mrad)": 1e3 * table["amplitude"]})
        lab.to_csv(tmp_path / "lab.csv", index=False)
        import_file(tmp_path / "lab.csv", back, Stated(scaling="peak"))
    after = read_record(back)
    np.testing.assert_allclose(after.column("amplitude"), table["amplitude"], rtol=1e-12)
    np.testing.assert_allclose(after.column("force"), 0.2, rtol=1e-12)


def test_an_assumed_peak_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab, out = tmp_path / "lab.csv", tmp_path / "out.csv"
    rows = pd.DataFrame({"Freq (Hz)": [9.0, 10.0, 11.0], "Force (uN)": 5.0, "Displacement (nm)": [1.0, 2.0, 1.5]})
    for header, stated, assumed in (
        *(("Displacement (nm)", None, True), ("Displacement (nm pk)", None, False)),
        *(("Displacement (nm)", "peak", False), ("Displacement (nm)", "rms", False)),
    ):
        rows.set_axis([*rows.columns[:2], header], axis=1).to_csv(lab, index=False)
        import_file(lab, out, Stated(scaling=stated))
        said = " ".join(capsys.readouterr().out.split())
        assert ("caution: peak assumed: the file does not say (give --scaling rms" in said) == assumed
        factor = 2.0**0.5 if stated == "rms" else 1.0
        np.testing.assert_allclose(read_record(out).column("amplitude").max(), factor * 2e-9, rtol=1e-12)
        np.testing.assert_allclose(read_record(out).column("force"), 5e-6, rtol=1e-12)


@pytest.mark.parametrize("text", [False, True])
def test_pyuff_reads_what_is_exported(tmp_path: Path, text: bool) -> None:
    source = data_folder() / "saturn-v" / "records" / "config-1-mode-2-rough.csv"
    export(source, tmp_path / "a.uff", given="us", text=text)
    ratio, force = pyuff.UFF(str(tmp_path / "a.uff")).read_sets()
    record = read_record(source)
    receptance = record.column("amplitude") / record.column("force") * np.exp(-1j * record.column("phase"))
    np.testing.assert_allclose(ratio["data"], receptance, rtol=1e-11)  # 13 digits of text
    np.testing.assert_allclose(force["data"], record.column("force"), rtol=1e-11)
    np.testing.assert_allclose(ratio["x"], record.column("frequency"), rtol=5e-6)  # 6 digits of text
    assert ratio["ordinate_axis_units_lab"] == "in"
    assert (ratio["func_type"], force["func_type"]) == (4, 12)
    assert ratio["n_bytes" if not text else "num_pts"] == (24 if not text else 1) * len(record)


def test_a_sweep_without_phases_is_no_frequency_response(tmp_path: Path) -> None:
    source = data_folder() / "saturn-v" / "records" / "config-1-mode-2-pitch.csv"
    with pytest.raises(AnalysisError, match="no phases"):
        export(source, tmp_path / "a.uff")
    assert not (tmp_path / "a.uff").exists()


def test_records_and_modes_in_other_units(tmp_path: Path) -> None:
    record = tmp_path / "r.csv"
    record.write_text("sweep,force,frequency,amplitude,energy,mass,amplitude_sd,point\na,10,2,0.5,15,40,0.01,7\n")
    mode = tmp_path / "m.toml"
    mode.write_text(
        '[mode]\nfrequency = 2.0\nmass = 40.0\n[units]\nforce = "lb"\nlength = "in"\n[damping]\nviscous = 1.5\n'
    )
    export(record, tmp_path / "si.csv", units="si", mode=mode, mode_out=tmp_path / "si.toml")
    row = read_record(tmp_path / "si.csv").table.iloc[0]
    assert row["force"] == pytest.approx(10 * LBF, rel=1e-15)
    assert row["amplitude"] == pytest.approx(0.5 * INCH, rel=1e-15)
    assert row["energy"] == pytest.approx(15 * LBF * INCH, rel=1e-15)
    assert row["mass"] == pytest.approx(40 * LBF / INCH, rel=1e-15)
    assert row["amplitude_sd"] == pytest.approx(0.01 * INCH, rel=1e-15)
    assert (row["frequency"], row["point"]) == (2.0, 7.0)
    other = read_mode(tmp_path / "si.toml")
    assert (other.units.force, other.units.length) == ("N", "m")
    # the period follows from mass and stiffness in any system, and so does what is left of a cycle
    assert other.mass == pytest.approx(40 * LBF / INCH, rel=1e-15)
    assert other.damping["viscous"]["coefficient"] == pytest.approx(1.5 * LBF / INCH, rel=1e-15)
    export(tmp_path / "si.csv", tmp_path / "back.csv", units="us", mode=tmp_path / "si.toml")
    back = read_record(tmp_path / "back.csv").table
    pd.testing.assert_frame_equal(back, read_record(record).table, rtol=1e-14)
    with pytest.raises(InputError, match="the unit of force is not known"):
        export(record, tmp_path / "x.csv", units="si")


BASE = """[mode]
frequency = 10.0
drive = "base"
{mass}
[units]
force = "lbf"
length = "in"
[damping]
viscous = {viscous}
"""
DRIVEN = "sweep,force,frequency,amplitude,energy,force_sd\na,386,10,0.5,600,4\n"


@pytest.mark.parametrize(("mass", "viscous", "kilograms"), [("", 2.0, 1.0), ("mass = 0.5", 1.0, 0.5 * LBF / INCH)])
def test_a_base_is_driven_by_an_acceleration_in_any_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], mass: str, viscous: float, kilograms: float
) -> None:
    """386 in/s^2 are 386 * .0254 m/s^2; of an energy per mass length counts twice; c/m = 2/s is no matter of units."""
    record, mode = tmp_path / "r.csv", tmp_path / "m.toml"
    record.write_text(DRIVEN)
    mode.write_text(BASE.format(mass=mass, viscous=viscous))
    export(record, tmp_path / "si.csv", units="si", mode=mode, mode_out=tmp_path / "si.toml")
    assert "force in m/s²" in " ".join(capsys.readouterr().out.split())
    row = read_record(tmp_path / "si.csv").table.iloc[0]
    found = [row[name] for name in ("force", "force_sd", "amplitude", "energy")]
    np.testing.assert_allclose(found, [386 * INCH, 4 * INCH, 0.5 * INCH, 600 * INCH**2], rtol=1e-14)
    other = read_mode(tmp_path / "si.toml")
    assert (other.drive, other.units.force) == ("base", "N")
    assert other.mass == pytest.approx(kilograms, rel=1e-14)
    assert other.damping["viscous"]["coefficient"] / other.mass == pytest.approx(2.0, rel=1e-14)
    export(tmp_path / "si.csv", tmp_path / "us.csv", units="us", mode=tmp_path / "si.toml")
    pd.testing.assert_frame_equal(read_record(tmp_path / "us.csv").table, read_record(record).table, rtol=1e-14)


def test_a_universal_file_says_that_a_base_is_driven(tmp_path: Path) -> None:
    """The reference is of data type 12 (acceleration), in ASCII, and is not read back as a force."""
    record, mode, out = tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "a.uff"
    record.write_text(DRIVEN)
    mode.write_text(BASE.format(mass="", viscous=2.0).replace("length =", 'time = "s"\nlength ='))
    export(record, out, mode=mode, text=True)
    axes = [line.split() for line in out.read_text("ascii").splitlines() if "in/s^2" in line]
    assert [axis[0] for axis in axes] == ["12", "12"]
    with pytest.raises(InputError, match="neither in the file nor stated: unit of the force"):
        import_file(out, tmp_path / "back.csv", Stated())


def test_a_record_that_cannot_be_written_leaves_the_earlier_mode(tmp_path: Path) -> None:
    """A universal file needs phases in a sweep of several rows."""
    record, mode, before = tmp_path / "r.csv", tmp_path / "m.toml", tmp_path / "us.toml"
    record.write_text("sweep,force,frequency,amplitude\na,3,9.9,0.01\na,3,10,0.02\na,3,10.1,0.01\n")
    mode.write_text('[mode]\nfrequency = 10.0\nmass = 2.0\n[units]\nforce = "N"\nlength = "m"\n')
    before.write_text("as it was")
    with pytest.raises(AnalysisError, match="has no phases"):
        export(record, tmp_path / "a.uff", units="us", mode=mode, mode_out=before)
    assert before.read_text() == "as it was"


def test_an_added_mass_on_a_base_is_a_mass(tmp_path: Path) -> None:
    record, mode = tmp_path / "r.csv", tmp_path / "m.toml"
    record.write_text("sweep,force,frequency,amplitude,added_mass\na,386,10,0.5,0.2\n")
    mode.write_text(BASE.format(mass="mass = 1.0", viscous=2.0))
    export(record, tmp_path / "si.csv", units="si", mode=mode, mode_out=tmp_path / "si.toml")
    assert read_record(tmp_path / "si.csv").table["added_mass"][0] == pytest.approx(0.2 * LBF / INCH, rel=1e-14)
    assert read_mode(tmp_path / "si.toml").mass == pytest.approx(LBF / INCH, rel=1e-14)


def test_without_a_mode_the_drive_is_not_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "r.csv").write_text(DRIVEN)
    export(tmp_path / "r.csv", tmp_path / "si.csv", units="si", given="us")
    assert "taken as a force" in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize("named", [True, False])
def test_loads_under_base_accelerations_in_other_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], named: bool
) -> None:
    one = {"force": 386.0, "median": 2.0, "low": 1.0, "high": 3.0, "linear": 2.5, "by_model": []}
    units = {"units": {"force": "in/s²", "length": "in", "time": "s"}} if named else {}
    (tmp_path / "loads.json").write_text(json.dumps({"format": "loads/1", "level": 0.9, "predictions": [one]} | units))
    (tmp_path / "m.toml").write_text(BASE.format(mass="", viscous=2.0))
    export(tmp_path / "loads.json", tmp_path / "a.parquet", units="si", mode=None if named else tmp_path / "m.toml")
    assert "force in m/s²" in " ".join(capsys.readouterr().out.split())
    found = pd.read_parquet(tmp_path / "a.parquet").iloc[0]
    np.testing.assert_allclose([found["force"], found["median"]], [386 * INCH, 2 * INCH], rtol=1e-14)


@pytest.fixture(scope="module")
def ranking(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = data_folder() / "saturn-v"
    data = read_record(folder / "records" / "config-2-mode-1.csv")
    path = tmp_path_factory.mktemp("forms") / "rank.json"
    write_json(path, dp.rank(data, seed=1).to_json())
    return path


def test_a_ranking_as_csv_and_parquet(ranking: Path, tmp_path: Path) -> None:
    export(ranking, tmp_path / "rank.csv")
    export(ranking, tmp_path / "rank.parquet")
    form = json.loads(ranking.read_text())
    parquet = pd.read_parquet(tmp_path / "rank.parquet")
    assert set(parquet["model"]) == {model["name"] for model in form["models"]}
    first = form["models"][0]
    mine = parquet[(parquet["model"] == first["name"]) & (parquet["parameter"] == "coefficient")]
    assert list(mine["value"]) == [force["coefficient"] for force in first["forces"]]
    assert mine["score"].iloc[0] == first["score"]
    assert {"exponent"} <= set(parquet["parameter"])
    csv = read_table(tmp_path / "rank.csv", required=["model", "weight"], text_columns=["model"])
    np.testing.assert_array_equal(csv["weight"], parquet["weight"])


def test_loads_as_csv_and_parquet(tmp_path: Path) -> None:
    member = {"name": "=viscous", "weight": 1.0, "median": 2.0, "low": 1.0, "high": 3.0}
    one = {"force": 10.0, "median": 2.0, "low": 1.0, "high": None, "cautions": ["@far", "b"], "by_model": [member]}
    one |= {"frequency": 12.5, "damping_ratio": {"median": 0.02, "low": 0.015, "high": 0.03}}
    source = tmp_path / "loads.json"
    source.write_text(json.dumps({"format": "loads/1", "level": 0.9, "predictions": [one], "more": 1}))
    export(source, tmp_path / "loads.parquet")
    export(source, tmp_path / "loads.csv")
    parquet = pd.read_parquet(tmp_path / "loads.parquet")
    assert list(parquet["model"]) == ["", "=viscous"]
    assert list(parquet["median"]) == [2.0, 2.0]
    assert np.isnan(parquet["high"].iloc[0])
    there = parquet[["frequency", "damping_ratio", "damping_ratio_low", "damping_ratio_high"]]
    assert there.iloc[0].tolist() == [12.5, 0.02, 0.015, 0.03]
    assert there.iloc[1].isna().all()
    assert parquet["cautions"].iloc[0] == "@far; b"
    text = (tmp_path / "loads.csv").read_text()
    assert "'=viscous" in text  # what a spreadsheet would execute
    assert "'@far" in text


def test_a_curve_is_the_table_that_python_gives(tmp_path: Path, few_laws: None) -> None:
    """Columns and numbers of ``CurveResult.table``; in other units forces and amplitudes move and ratios stay."""
    data = data_folder() / "saturn-v"
    record, mode = (data / folder / f"config-2-mode-1.{end}" for folder, end in (("records", "csv"), ("modes", "toml")))
    curve = dp.curve(dp.read_record(record), dp.read_mode(mode), amplitudes=[1.0, 2.0])
    (tmp_path / "curve.json").write_text(json.dumps(curve.to_json()))
    for units in (None, "si"):
        export(tmp_path / "curve.json", tmp_path / "curve.csv", units=units)
        found, own = pd.read_csv(tmp_path / "curve.csv"), curve.table
        assert list(found.columns) == [*own.columns, "level"]
        moved = {"amplitude": INCH, "force": LBF} if units else {}
        for name in own.columns.drop(["tested", "cautions"]):
            np.testing.assert_allclose(found[name], own[name] * moved.get(name.split("_")[0], 1.0), rtol=1e-13)
        assert list(found["tested"]) == list(own["tested"])
        assert list(found["cautions"]) == list(own["cautions"])


def test_loads_in_other_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    member = {"name": "viscous", "weight": 1.0, "median": 2.0, "low": 1.0, "high": 3.0}
    one = {"force": 10.0, "median": 2.0, "low": 1.0, "high": None, "linear": 2.5, "linear_overprediction_percent": 25.0}
    source, mode = tmp_path / "loads.json", tmp_path / "m.toml"
    content = {"format": "loads/1", "level": 0.9, "predictions": [one | {"cautions": ["far"], "by_model": [member]}]}
    source.write_text(json.dumps(content))
    export(source, tmp_path / "from.parquet", units="si", given="us")
    said = capsys.readouterr().out
    assert "force in N, length in m" in " ".join(said.split())
    assert "cautions are text" in said
    found = pd.read_parquet(tmp_path / "from.parquet")
    np.testing.assert_allclose(found["force"], 10 * LBF, rtol=1e-15)
    for name, values in {"median": [2, 2], "low": [1, 1], "high": [np.nan, 3], "linear": [2.5, np.nan]}.items():
        np.testing.assert_allclose(found[name], np.array(values) * INCH, rtol=1e-15)
    assert list(found["weight"])[1] == 1.0
    assert found["linear_overprediction_percent"].iloc[0] == 25.0
    mode.write_text(MODE.replace('"N"', '"lbf"').replace('"m"', '"in"'))
    export(source, tmp_path / "mode.parquet", units="si", mode=mode)
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "mode.parquet"), found)
    with pytest.raises(InputError, match=r"the unit of force is not known; expected \[units\] of a mode, or --from"):
        export(source, tmp_path / "x.csv", units="us")
    with pytest.raises(InputError, match="--mode-out is for records"):
        export(source, tmp_path / "x.csv", units="us", mode=mode, mode_out=tmp_path / "x.toml")


def test_loads_know_their_units_and_what_was_asked(tmp_path: Path) -> None:
    """Forces for amplitudes: the band is one of forces, in the units that the form names."""
    source, out = tmp_path / "loads.json", tmp_path / "loads.parquet"
    one = {"amplitude": 1.0, "median": 2.0, "low": 1.0, "high": 3.0, "linear": 2.5, "by_model": []}
    content = {"format": "loads/1", "level": 0.9, "predictions": [one], "units": {"force": "lbf", "length": "in"}}
    source.write_text(json.dumps(content))
    export(source, out, units="si")
    found = pd.read_parquet(out)
    expected = [[2 * LBF, LBF, 3 * LBF, 2.5 * LBF]]
    np.testing.assert_allclose(found[["median", "low", "high", "linear"]], expected, rtol=1e-15)
    np.testing.assert_allclose(found["amplitude"], INCH, rtol=1e-15)
    assert "force" not in found
    source.write_text(json.dumps(content | {"predictions": [one | {"force": 1.0}]}))
    with pytest.raises(InputError, match=r"predictions.0: force or amplitude is required, and not both"):
        export(source, out)


def test_a_ranking_is_not_converted(ranking: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--units is for all but a ranking.*expected a ranking of"):
        export(ranking, tmp_path / "x.csv", units="us", given="si")


def test_units_said_twice_agree(tmp_path: Path) -> None:
    record, mode = tmp_path / "r.csv", tmp_path / "m.toml"
    record.write_text("sweep,force,frequency,amplitude\na,10,10,0.5\n")  # near the frequency of the mode
    mode.write_text(MODE)
    message = r"m\.toml: force is in N and --from us says lbf; expected one of them"
    with pytest.raises(InputError, match=message):
        export(record, tmp_path / "x.csv", units="si", mode=mode, given="us")
    mode.write_text(MODE.replace('"N"', '"lb"').replace('"m"', '"mm"'))
    with pytest.raises(InputError, match="length is in mm and --from us says in"):
        export(record, tmp_path / "x.csv", units="si", mode=mode, given="us")
    assert not (tmp_path / "x.csv").exists()
    mode.write_text(MODE.replace('"N"', '"lb"').replace('"m"', '"in"'))  # another name of the same unit
    export(record, tmp_path / "x.csv", units="si", mode=mode, given="us")
    assert read_record(tmp_path / "x.csv").column("force")[0] == pytest.approx(10 * LBF, rel=1e-15)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ('{"format": "gap/1"}', "expected a form rank/1, loads/1 or curve/1"),
        ('{"format": "rank/1", "criterion": "bic", "models": []}', "models"),
        ('{"format": "loads/1", "level": 0.9, "predictions": [{"force": "x"}]}', "predictions.0.force"),
        ("{" * 100000, "expected a form"),
        ('{"format": "rank/1"', "expected a form"),
    ],
)
def test_forms_that_are_none(tmp_path: Path, content: str, message: str) -> None:
    source = tmp_path / "form.json"
    source.write_text(content)
    with pytest.raises(InputError, match=message):
        export(source, tmp_path / "a.csv")
    assert not (tmp_path / "a.csv").exists()


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.dictionaries(
        st.sampled_from(["format", "models", "criterion", "level", "predictions"]),
        st.sampled_from(["rank/1", "loads/1", 1, None, [], [{}], {}]),
    )
)
def test_any_form_is_a_table_or_an_error(tmp_path: Path, form: dict[str, object]) -> None:
    path = tmp_path / "form.json"
    path.write_text(json.dumps(form))
    with pytest.raises(InputError):
        read_answer(path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"out": "a.xlsx"}, "no known format; expected a name ending in .uff"),
        ({"units": "cgs", "given": "us"}, "--units 'cgs' is unknown"),
        ({"given": "metric"}, "--from 'metric' is unknown"),
        ({"mode_out": Path("x.toml")}, "--mode-out without a mode"),
    ],
)
def test_export_options_that_are_not_understood(tmp_path: Path, options: dict[str, object], message: str) -> None:
    source = data_folder() / "saturn-v" / "records" / "config-2-mode-1.csv"
    out = tmp_path / str(options.pop("out", "a.csv"))
    with pytest.raises(InputError, match=message):
        export(source, out, **options)


def test_a_form_is_no_record(ranking: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no record"):
        export(ranking, tmp_path / "a.uff")


def test_a_figure_as_png() -> None:
    figure = Figure(figsize=(2, 1))
    figure.add_subplot().plot([1, 2])
    image = to_png(figure, dpi=100)
    assert image.startswith(b"\x89PNG\r\n\x1a\n")
    assert image[16:24] == (200).to_bytes(4, "big") + (100).to_bytes(4, "big")  # width and height of the header
    assert to_png(figure, dpi=100) == image
