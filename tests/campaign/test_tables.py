"""Tables of steady states of several sensors: the same runs, modes and peaks whatever the file and its names."""

from __future__ import annotations

import json
import re

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from damping.campaign import analyse
from damping.campaign.records import describe_lost, fit_levels, join_modes
from damping.campaign.runs import ChannelCorrection, Corrections, DesignLevel
from damping.campaign.sensors import find_exchanged
from damping.campaign.sources import read_runs
from damping.errors import InputError
from damping.formats import read_file
from damping.formats.headers import parse_header
from damping.formats.levels import find_level
from damping.formats.sensors import group_columns
from damping.formats.series import Stated, Summary
from damping.formats.steady import steady_record
from tests.campaign.spectra import write_spectra
from tests.files import fill, write_csv, write_hdf5

SIZE = 10_000_000
LEVELS = (1.0, 2.0, 4.0, 8.0)  # N
MODES = ((12.0, 0.008, 40.0), (19.0, 0.006, 90.0))  # Hz, damping ratio, its growth with amplitude, 1/m
SHAPES = np.array([[1.0, 0.8], [0.7, -0.9], [0.4, 0.5]])
NAMES = ("tip", "mid", "root")
F = np.unique(np.round([*np.linspace(9.0, 25.0, 60), *np.linspace(11.4, 12.6, 41), *np.linspace(18.1, 19.9, 41)], 4))
SI = {"units": {"response": "mm", "force": "N"}}


def modal_ratio(k: int, force: float, f: np.ndarray = F) -> np.ndarray:
    """Damping ratio (n,) of a mode of mass 1 m under a force: z (1 + g A), A the amplitude of its steady state."""
    f_n, ratio, growth = MODES[k]
    w, w_n, A = 2 * np.pi * f, 2 * np.pi * f_n, np.zeros(len(f))
    for _ in range(300):
        loss = 2 * ratio * (1 + growth * A) * w_n * w
        A = 0.5 * (A + force * SHAPES[0, k] / np.hypot(w_n**2 - w**2, loss))
    return ratio * (1 + growth * A)


def move(force: float, f: np.ndarray = F) -> np.ndarray:
    """Displacements (sensors, n), mm, with the phase as lead."""
    w, q = 2 * np.pi * f, []
    for k, (f_n, *_) in enumerate(MODES):
        w_n = 2 * np.pi * f_n
        q.append(force * SHAPES[0, k] / (w_n**2 - w**2 + 2j * modal_ratio(k, force, f) * w_n * w))
    return 1e3 * SHAPES @ np.array(q)


TRUTH = {level: move(level) for level in LEVELS}


def table(level: float, phase: str = "{} phase [deg]", sign: float = 1.0) -> pd.DataFrame:
    columns = {"Frequency [Hz]": F, "Force [N]": np.full(len(F), level)}
    for name, x in zip(NAMES, TRUTH[level], strict=True):
        columns |= {f"{name} [mm]": np.abs(x), phase.format(name): sign * np.degrees(np.angle(x))}
    return pd.DataFrame(columns)


def rows_at(f: np.ndarray, level: float, moved: float = 1.0, gain: float = 1.0) -> pd.DataFrame:
    """Rows at other frequencies, of resonances ``moved`` by a factor."""
    columns = {"Frequency [Hz]": f, "Force [N]": np.full(len(f), level)}
    for name, x in zip(NAMES, gain * move(level, f / moved), strict=True):
        columns |= {f"{name} [mm]": np.abs(x), f"{name} phase [deg]": np.degrees(np.angle(x))}
    return pd.DataFrame(columns)


def all_levels(**columns: object) -> pd.DataFrame:
    return pd.concat([table(level).assign(**{k: of(level) for k, of in columns.items()}) for level in LEVELS])


def complex_columns(level: float) -> dict[str, np.ndarray]:
    return {"freq": F, "force": np.full(len(F), level)} | dict(zip(NAMES, TRUTH[level], strict=True))


def write(kind: str, folder) -> list:
    """The files of all levels."""
    files = [folder / f"sine_{level:g}N.{kind}" for level in LEVELS]
    tables = [table(level) for level in LEVELS]
    if kind in ("sweeps.csv", "levels.csv", "blocks.csv", "sheets.xlsx", "structures.mat", "groups.tdms"):
        files = [folder / kind]
    for file, level, content in zip(files, LEVELS, tables, strict=False):
        if kind == "csv":
            content.to_csv(file, index=False)
        elif kind == "xlsx":
            content.to_excel(file, index=False)
        elif kind == "mat":
            scipy.io.savemat(file, complex_columns(level))
        elif kind == "tdms":
            write_tdms(file, {"data": content})
    if kind == "sweeps.csv":
        all_levels(run=lambda level: f"{level:g} N").to_csv(files[0], index=False, sep=";", decimal=",")
    elif kind == "levels.csv":
        all_levels(**{"Level [N]": float}).to_csv(files[0], index=False)
    elif kind == "blocks.csv":
        all_levels().to_csv(files[0], index=False)
    elif kind == "groups.tdms":
        write_tdms(files[0], {f"{level:g} N": content for level, content in zip(LEVELS, tables, strict=True)})
    elif kind == "sheets.xlsx":
        with pd.ExcelWriter(files[0]) as book:
            pd.DataFrame({"about": ["the test"]}).to_excel(book, sheet_name="notes", index=False)
            for level, content in zip(LEVELS, tables, strict=True):
                content.to_excel(book, sheet_name=f"{level:g} N", index=False)
    elif kind == "structures.mat":
        runs = np.zeros(len(LEVELS), dtype=[("freq", object), ("force", object), ("x", object)])
        for k, level in enumerate(LEVELS):
            runs[k] = (F, level, TRUTH[level].T)
        scipy.io.savemat(files[0], {"run": runs})
    return files


def write_tdms(path, groups: dict[str, pd.DataFrame]) -> None:
    with TdmsWriter(path) as file:
        for group, content in groups.items():
            headers = [parse_header(name) for name in content]
            columns = zip(headers, content.to_numpy().T, strict=True)
            file.write_segment(
                [ChannelObject(group, h.name, np.array(x), properties={"unit_string": h.unit}) for h, x in columns]
            )


def require_truth(runs, names=NAMES) -> None:
    assert [run.level for run in runs] == list(LEVELS)
    for run, level in zip(runs, LEVELS, strict=True):
        assert (run.names, run.drive_unit, run.channels[0].unit) == (list(names), "N", "mm")
        np.testing.assert_allclose(run.x, F, rtol=1e-12)
        for channel, x in zip(run.channels, TRUTH[level], strict=True):
            np.testing.assert_allclose(channel.samples / run.drive, x / level, rtol=1e-9)


@pytest.mark.parametrize(
    "kind", ["csv", "xlsx", "mat", "tdms", "sweeps.csv", "levels.csv", "blocks.csv", "groups.tdms", "sheets.xlsx"]
)
def test_every_file_gives_the_same_runs(tmp_path, kind):
    runs, _ = read_runs(write(kind, tmp_path), SIZE, None, Stated(**SI) if kind == "mat" else None)
    require_truth(runs)


def test_sensors_named_by_numbers_are_not_exchanged(tmp_path):
    """Nodes 5, 3 and 4 in the columns 3, 4 and 5 of a table: a name is never taken for the place of another column."""
    nodes, files = ("5", "3", "4"), []
    for level in LEVELS:
        content = table(level).rename(columns=lambda name: name.replace(*node(name, nodes)))
        files.append(
            write_csv(tmp_path / f"{level:g} N.csv", content[sorted(content, key=lambda name: "phase" in name)])
        )
    require_truth(read_runs(files, SIZE)[0], nodes)


def node(column: str, nodes: tuple[str, ...]) -> tuple[str, str]:
    """The name of the sensor in that of a column, and its node."""
    return next((pair for pair in zip(NAMES, nodes, strict=True) if column.startswith(pair[0])), ("", ""))


def test_columns_of_arrays_in_structures_are_sensors(tmp_path):
    """One force for three columns: sensors, named as `damping import` takes one of them."""
    runs, _ = read_runs(write("structures.mat", tmp_path), SIZE, None, Stated(**SI))
    require_truth(runs, ["x(:,1)", "x(:,2)", "x(:,3)"])


@pytest.mark.parametrize(
    ("phase", "sign"),
    [("{} phase [deg]", -1.0), ("{} lag [deg]", -1.0), ("{}_lead_deg", 1.0), ("Phase {} [°]", 1.0), ("{} [deg]", 1.0)],
)
def test_phases_are_read_by_name_and_sense(tmp_path, phase, sign):
    """A phase that says neither is what a passive structure has, for modes of either sign at a sensor."""
    files = []
    for level in LEVELS:
        files.append(write_csv(tmp_path / f"{level:g} N.csv", table(level, phase, sign)))
    require_truth(read_runs(files, SIZE)[0])


@pytest.mark.parametrize(("unit", "factor"), [("deg", 180.0 / np.pi), ("rad", 1.0)])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_an_array_called_phase_with_a_unit_leads_or_lags_by_its_direction(tmp_path, unit, factor, sense):
    """It was taken for the lag of a record, as a column without a unit is: a lead hid every mode."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for level in (1.0, 2.0):
            run, H = file.create_group(f"run_{level:g}N"), move(level)[0]
            run["frequency"], run["force"] = F, np.full(len(F), level)
            run["force"].attrs["units"] = "N"
            for name, values, text in (("Acc", abs(H), "g"), ("Phase", sense * factor * np.angle(H), unit)):
                run[name] = values
                run[name].attrs["units"] = text
    for run in read_runs([tmp_path / "a.h5"], 10_000_000)[0]:
        np.testing.assert_allclose(run.channels[0].samples, move(run.level)[0], rtol=1e-9)


def test_modes_and_damping_are_the_true_ones(tmp_path):
    """Frequency to 1e-4, damping ratio at the peak to 1 %: without noise only the growth within a level is left."""
    levels = fit_levels(read_runs(write("csv", tmp_path), SIZE)[0])
    modes = join_modes(levels)
    assert len(modes) == 2
    for k, mode in enumerate(modes):
        np.testing.assert_allclose(mode.frequency, MODES[k][0], rtol=1e-4)
        np.testing.assert_allclose(mode.ratio, [modal_ratio(k, level).max() for level in LEVELS], rtol=0.01)
        assert not mode.left_out


@pytest.mark.parametrize(
    ("frequency", "force", "amplitude", "phase", "scale"),
    [
        ("Freq. (Hz)", "Force (N)", "{} Amplitude (mm)", "{} Phase(°)", 1.0),
        ("Hz", "Force (N) [rms]", "{} (mm) (rms)", "{} (deg)", 0.5**0.5),
        ("freq_Hz", "force_rms_N", "RMS {} [mm]", "{}_phase_deg", 0.5**0.5),
        ("Frequency, Hz", "Force, N", "Disp {}, mm", "Phase {}, deg", 1.0),
        ("Frequenz / Hz", "Erregerkraft / N", "{} Betrag / mm", "{} Phasenwinkel / °", 1.0),
        ("Frequenz [Hz]", "Kraft [N eff]", "{} Effektivwert [mm]", "Phase {} [°]", 0.5**0.5),
        ("Fréq. (Hz)", "Effort (N) crête-à-crête", "{} (mm) crête-à-crête", "déphasage {} (°)", 2.0),
        ("Linear [Hz]", "Force [N peak-peak]", "{} Spitze-Spitze [mm]", "φ {} [°]", 2.0),
        ('"Frequency\n(Hz)"', '"Force\n(N)"', '"{}\n(mm)"', '"{} phase\n(deg)"', 1.0),
        ("Frequency [Hz]", "Force [N]", "FRF {} / Force (mm/N)", "Phase {} / Force [°]", 1.0),
    ],
)
def test_headers_of_instruments_are_read(tmp_path, frequency, force, amplitude, phase, scale):
    level, path = 4.0, tmp_path / "sine_4N.csv"
    columns = {frequency: F, force: np.full(len(F), scale * level)}
    for name, x in zip(NAMES, TRUTH[level], strict=True):
        of_force = level if "mm/N" in amplitude else 1.0
        columns |= {amplitude.format(name): scale / of_force * np.abs(x), phase.format(name): np.degrees(np.angle(x))}
    rows = pd.DataFrame(columns).to_csv(index=False, header=False, sep=";")
    path.write_text(";".join(columns) + "\n" + rows, encoding="utf-8")
    (run,), _ = read_runs([path], SIZE)
    assert (run.level, run.drive_unit) == (pytest.approx(level), "N")
    for channel, x in zip(run.channels, TRUTH[level], strict=True):
        samples = channel.samples * (run.drive if channel.per_drive else 1.0)
        np.testing.assert_allclose(samples / run.drive, x / level, rtol=1e-9)


def write_numbers(path, decimal: str, between: str, units: bool) -> None:
    """Numbers under 2 kN as text, in a workbook or between semicolons; ``units``: in a row of their own."""

    def say(value: float) -> str:
        return f"{value:,.4f}".translate({ord(","): between, ord("."): decimal})

    content = table(2.0)
    content.iloc[:, 1:] *= [1000.0, *[1000.0, 1.0] * len(NAMES)]
    names, of = zip(*(name.rstrip("]").split(" [") for name in content), strict=True)
    content = content.map(say).set_axis(names if units else list(content), axis=1)
    content = pd.concat([pd.DataFrame([of], columns=names), content]) if units else content
    if path.suffix == ".xlsx":
        content.to_excel(path, index=False)
    else:
        content.rename(columns=lambda name: name.replace(" ", "\u00a0")).to_csv(path, index=False, sep=";")


def import_tip(content: pd.DataFrame, path) -> tuple[pd.DataFrame, Summary]:
    """The record of the first sensor of a table, as `damping import` makes it."""
    names = {"tip [mm]": "Displacement [mm]", "tip phase [deg]": "Phase [deg]"}
    content[[name for name in content if not name.startswith(NAMES[1:])]].rename(columns=names).to_csv(
        path, index=False
    )
    series, summary = read_file(path, Stated())
    return steady_record(series, Stated(), path, summary).frame, summary


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize(
    ("header", "value", "rate"),
    [
        ("sweep_rate", 0.05, np.full(len(F), 0.05)),
        ("rate (Hz/s)", 0.05, np.full(len(F), 0.05)),
        ("Sweep rate, Hz/min", 3.0, np.full(len(F), 0.05)),
        ("oct/min", 4.0, 4.0 * np.log(2.0) / 60.0 * F),
        ("sweep_rate", 0.0, np.zeros(len(F))),
        ("sweep_rate", np.where(F < 15.0, 0.05, np.nan), np.where(F < 15.0, 0.05, np.nan)),
    ],
)
def test_a_column_of_sweep_rates_is_read(tmp_path, header, value, rate, way):
    """df/dt of n octaves a minute is n ln 2/60 f; where the frequency falls, speeds are rates below 0."""
    content = table(2.0).assign(**{header: value})[::way]
    (run,), _ = read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)
    np.testing.assert_allclose(run.rate, way * rate, rtol=1e-12)
    assert run.names == [*NAMES]
    record, _ = import_tip(content, tmp_path / "b.csv")
    np.testing.assert_allclose(record["sweep_rate"], way * rate[::way], rtol=1e-12)


@pytest.mark.parametrize(("rate", "told"), [(0.05, False), (3.0, True)])
def test_a_rate_of_another_unit_is_told_by_the_times(tmp_path, rate, told):
    content = table(2.0).assign(**{"time [s]": (F - F[0]) / 0.05, "sweep_rate": rate})
    notes = import_tip(content, tmp_path / "a.csv")[1].notes
    assert any("the sweep rate is 3 Hz/s, by its frequencies and times 0.05 Hz/s" in note for note in notes) is told


@pytest.mark.parametrize(("header", "known"), [("rate", False), ("rate [Hz]", False), ("sweep_rate [mm]", True)])
def test_what_is_no_sweep_rate_is_not_taken_for_one(tmp_path, header, known):
    table(2.0).assign(**{header: 1.0}).to_csv(tmp_path / "a.csv", index=False)
    if known:
        with pytest.raises(InputError, match=r"sweep_rate in mm; expected --unit sweep_rate=UNIT of Hz/s"):
            read_runs([tmp_path / "a.csv"], SIZE)
    else:
        assert read_runs([tmp_path / "a.csv"], SIZE)[0][0].rate is None


def levels_beside(amplitude: str, phase: str, names=NAMES[:1]) -> pd.DataFrame:
    """A column of frequency, then those of each level; their names hold ``{level}`` and the ``{name}`` of a sensor."""
    columns = {"Frequency [Hz]": F}
    for level in LEVELS:
        for name, x in zip(names, TRUTH[level], strict=False):
            of = {"level": f"{level:g} N", "name": name}
            per = level if "mm/N" in amplitude else 1.0
            columns |= {amplitude.format(**of): np.abs(x) / per, phase.format(**of): np.degrees(np.angle(x))}
    return pd.DataFrame(columns)


@pytest.mark.parametrize("order", ["rising", "falling", "amplitudes first"])
@pytest.mark.parametrize(
    ("amplitude", "phase", "names"),
    [
        ("{level} amp [mm]", "{level} phase [deg]", ["amplitude"]),
        ("Amplitude @ {level} (mm)", "Phase @ {level} (°)", ["amplitude"]),
        ("{level} [mm]", "{level} [deg]", ["amplitude"]),
        ("FRF mag {level} [mm/N]", "FRF phase {level} [deg]", ["FRF"]),
        ("F={level} Displacement [mm]", "F={level} Phase [deg]", ["Displacement"]),
        ("{name}_{level} [mm]", "{name}_{level}_phase [deg]", [*NAMES]),
    ],
)
def test_levels_side_by_side_are_runs(tmp_path, amplitude, phase, names, order):
    content = levels_beside(amplitude, phase, NAMES if "{name}" in amplitude else NAMES[:1])
    columns = list(content)[1:]
    falling = [columns[k + way] for k in range(len(columns) - 2, -1, -2) for way in (0, 1)]
    columns = {"falling": falling, "amplitudes first": columns[::2] + columns[1::2]}.get(order, columns)
    content[["Frequency [Hz]", *columns]].to_excel(tmp_path / "a.xlsx", index=False)
    runs, summary = read_runs([tmp_path / "a.xlsx"], SIZE)
    assert [run.level for run in runs] == list(LEVELS)
    assert any("caution: '4 N' has no drive" in note for note in summary.notes) is ("mm/N" not in amplitude)
    for run, level in zip(runs, LEVELS, strict=True):
        assert sorted(run.names) == sorted(names)
        for channel in run.channels:
            x = TRUTH[level][NAMES.index(channel.name) if channel.name in NAMES else 0]
            samples = channel.samples * (run.drive if channel.per_drive else 1.0)
            np.testing.assert_allclose(samples, x, rtol=1e-9)
    if len(names) == 1:
        ratio = {"amplitude": "FRF mag", "angle": "FRF phase"} if "mm/N" in amplitude else {}
        stated = Stated(response="receptance" if ratio else "displacement", columns=ratio)
        series, _ = read_file(tmp_path / "a.xlsx", stated)
        record = steady_record(series, stated, "a", Summary()).frame
        assert set(record["force"]) == set(LEVELS)
        for level, rows in record.groupby("force"):
            truth = 1e-3 * TRUTH[level][0]
            np.testing.assert_allclose(rows["amplitude"] * np.exp(-1j * rows["phase"]), truth, rtol=1e-9)


@pytest.mark.parametrize("kind", ["mat", "h5", "tdms", "complex.mat", "complex.h5"])
def test_levels_side_by_side_in_a_file_of_arrays_are_runs(tmp_path, kind):
    """Names of MAT are words without units; HDF5 has units as attributes; a phasor may be one array or two."""
    content, path = levels_beside("{level} amp [mm]", "{level} phase [deg]"), tmp_path / f"a.{kind}"
    arrays = {name: column.to_numpy() for name, column in content.items()}
    kind, is_complex = path.suffix[1:], kind.startswith("complex")
    if is_complex:
        arrays = {"Frequency [Hz]": F} | {f"{level:g} N H [mm]": TRUTH[level][0] for level in LEVELS}
    words = {name: re.sub(r"(\d N )?(\w+) .*", r"\2 \1", name).strip().replace(" ", "_") for name in arrays}
    if kind == "mat":
        scipy.io.savemat(path, {words[name]: column for name, column in arrays.items()})
    elif kind == "h5":
        write_hdf5(path, {words[name]: (column, name.split("[")[1].strip("]")) for name, column in arrays.items()})
    else:
        with TdmsWriter(path) as file:
            file.write_segment([ChannelObject("g", name, column) for name, column in arrays.items()])
    runs, _ = read_runs([path], SIZE, None, Stated(**SI) if kind == "mat" else Stated())
    assert [run.level for run in runs] == list(LEVELS)
    for run, level in zip(runs, LEVELS, strict=True):
        np.testing.assert_allclose(run.channels[0].samples, TRUTH[level][0], rtol=1e-9)
    scaling = "peak" if is_complex else None  # parts do not say what they are
    stated = Stated(response="displacement", units={"response": "mm"} if kind == "mat" else {}, scaling=scaling)
    record = steady_record(read_file(path, stated)[0], stated, "a", Summary()).frame
    assert set(record["force"]) == set(LEVELS)
    for level, rows in record.groupby("force"):
        x = rows["amplitude"] * np.exp(-1j * rows["phase"])
        np.testing.assert_allclose(x, 1e-3 * TRUTH[level][0], rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda name: name.replace("2 N", "1 N"), "2 sensors are '1 N'"),
        (lambda name: name.replace("4 N phase [deg]", "remark"), "'4 N' has no phase"),
        (lambda name: name.replace("4 N amp [mm]", "4 N amp [um]"), "no drive"),
        (lambda name: name.replace("4 N amp [mm]", "4 N amp [g]"), "no drive"),
        (lambda name: name.replace("4 N", "4 g"), "forces and motions as levels in the names of columns"),
        (lambda name: name.replace("N amp", "N rms amp"), "is the level rms, or the response"),
        (lambda name: name.replace("[mm]", "[dB]"), "in decibels"),
        (lambda name: name.replace("1 N", "0 N"), "functions without a level"),
        (lambda name: name.replace("extra", "Force [N]"), r"'Force \[N\]' beside levels in the names of columns"),
        (lambda name: name.replace("extra", "control"), "'control' beside levels in the names of columns"),
    ],
)
def test_levels_side_by_side_that_are_not_alike_are_refused(tmp_path, change, message):
    content = levels_beside("{level} amp [mm]", "{level} phase [deg]").assign(extra=1.0).rename(columns=change)
    content = content.drop(columns="extra", errors="ignore")
    content.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(InputError, match=message):
        read_runs([tmp_path / "a.csv"], SIZE)
    with pytest.raises(InputError):
        steady_record(read_file(tmp_path / "a.csv", Stated())[0], Stated(), "a", Summary())


def test_sensors_called_by_their_range_are_no_levels(tmp_path):
    """Beside a force, 5 g and 50 g are no levels of it."""
    content = table(2.0).rename(columns=lambda name: name.replace("tip", "acc 5 g").replace("mid", "acc 50 g"))
    require = read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)[0]
    assert [(run.level, run.names) for run in require] == [(2.0, ["acc 5 g", "acc 50 g", "root"])]


@pytest.mark.parametrize(("system", "length"), [("si", 1.0), ("us", 0.0254)])
def test_a_base_acceleration_of_columns_is_one_in_the_record(tmp_path, system, length):
    """1 g is 9.80665 m/s^2, 386.089 in/s^2; a motion of n mm is n/25.4 in."""
    content = levels_beside("{level} amp [mm]", "{level} phase [deg]").rename(
        columns=lambda name: name.replace(" N", " g")
    )
    content.to_csv(tmp_path / "a.csv", index=False)
    stated = Stated(response="displacement", system=system)
    record = steady_record(read_file(tmp_path / "a.csv", stated)[0], stated, "a", Summary()).frame
    for level, rows in record.groupby("sweep"):
        np.testing.assert_allclose(rows["force"], float(level.split()[0]) * 9.80665 / length, rtol=1e-12)
        np.testing.assert_allclose(rows["amplitude"], 1e-3 / length * np.abs(TRUTH[float(level[0])][0]), rtol=1e-9)


@pytest.mark.parametrize("units", [False, True])
@pytest.mark.parametrize("kind", ["a.xlsx", "a.csv"])
@pytest.mark.parametrize(
    ("decimal", "between"), [(",", ""), (",", "."), (",", "\u00a0"), (",", "\u202f"), (".", ","), (".", "'")]
)
def test_numbers_of_spreadsheets_are_read(tmp_path, kind, decimal, between, units):
    write_numbers(tmp_path / kind, decimal, between, units)
    (run,), _ = read_runs([tmp_path / kind], SIZE)
    assert (run.level, run.names) == (2000.0, [*NAMES])
    for channel, x in zip(run.channels, TRUTH[2.0], strict=True):
        # half of the last digit of four, of an amplitude and of an angle in degrees
        np.testing.assert_allclose(channel.samples, 1000.0 * x, rtol=1e-6, atol=6e-5)


@pytest.mark.parametrize("kind", ["a.xlsx", "a.csv"])
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: t.assign(**{"tip [mm]": "12.5", "mid [mm]": "12,5"}), "'12,5' is not a number"),
        (lambda t: t.assign(**{"tip [mm]": "1,234", "mid [mm]": "12.5"}), "'1,234' is not .* between thousands"),
        (lambda t: t.assign(**{"tip [mm]": "12,5", "mid [mm]": "1.234"}), "'12,5' is not a number"),
    ],
)
def test_marks_that_may_be_either_are_refused(tmp_path, kind, change, message):
    content = change(table(2.0))
    path = tmp_path / kind
    content.to_excel(path, index=False) if kind == "a.xlsx" else content.to_csv(path, index=False, sep=";")
    with pytest.raises(InputError, match=message):
        read_runs([path], SIZE)


@pytest.mark.parametrize("order", ["levels at each frequency", "levels up and down", "merged cells"])
def test_rows_are_of_the_sweep_of_their_level(tmp_path, order):
    tables = [table(level) for level in LEVELS]
    if order == "levels at each frequency":
        content = pd.concat(tables).sort_values(["Frequency [Hz]", "Force [N]"])
    elif order == "levels up and down":
        content = pd.concat([one[:: 1 - 2 * (k % 2)] for k, one in enumerate(tables)])
        content["Force [N]"] *= 1.0 + 1e-4 * np.sin(np.arange(len(content)))  # as measured
    else:  # a workbook has the text of merged cells in the first of them
        first = np.arange(len(F)) == 0
        content = pd.concat(
            [one.assign(Level=np.where(first, f"{level:g} N", "")) for one, level in zip(tables, LEVELS, strict=True)]
        )
    runs, _ = read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)
    np.testing.assert_allclose([run.level for run in runs], LEVELS, rtol=1e-3)
    for run, level in zip(runs, LEVELS, strict=True):
        np.testing.assert_allclose(run.channels[1].samples, TRUTH[level][1], rtol=1e-9)


#: A tenth of a hertz apart, a half-power half-width of the lower mode; and a fifth of that about both resonances.
COARSE = np.linspace(9.0, 25.0, 161)
CLOSE = np.r_[np.linspace(11.613, 12.437, 41), np.linspace(18.613, 19.437, 41)]


@pytest.mark.parametrize("order", ["levels, then refined", "each refined", "levels two per cent apart"])
def test_rows_that_refine_a_sweep_join_it(tmp_path, order):
    levels = (1.0, 1.02) if "apart" in order else (1.0, 2.0)
    pairs = [(f, level) for level in levels for f in (COARSE, CLOSE)]
    pairs = pairs if order == "each refined" else sorted(pairs, key=lambda pair: len(pair[0]), reverse=True)
    content = pd.concat([rows_at(f, level) for f, level in pairs])
    runs, summary = read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)
    assert [run.level for run in runs] == list(levels)
    assert sum(" and join it" in note for note in summary.notes) == 2
    f = np.sort([*COARSE, *CLOSE])
    for run, level in zip(runs, levels, strict=True):
        np.testing.assert_allclose(run.x, f, rtol=1e-12)
        for channel, x in zip(run.channels, move(level, f), strict=True):
            np.testing.assert_allclose(channel.samples, x, rtol=1e-9)
    record, _ = import_tip(content, tmp_path / "b.csv")
    for level, (_, rows) in zip(levels, record.groupby("sweep", sort=False), strict=True):
        np.testing.assert_allclose(rows["amplitude"], 1e-3 * np.abs(move(level, f)[0]), rtol=1e-9)


@pytest.mark.parametrize(
    "second",
    [
        rows_at(CLOSE, 2.0, moved=1.0015),  # by a fifth of a half-width
        rows_at(CLOSE, 2.0, gain=1.1),
        rows_at(CLOSE, 4.0),
        rows_at(np.linspace(9.01, 24.9, 600), 2.0),  # a whole sweep
        rows_at(COARSE[10:-10] + 0.013, 2.0),  # no closer
        rows_at(COARSE[26:35], 2.0),  # the same rows again
    ],
    ids=["moved", "gain", "level", "whole", "no closer", "copied"],
)
def test_rows_that_do_not_agree_stay_apart(tmp_path, second):
    content = pd.concat([rows_at(COARSE, 2.0), second])
    runs, summary = read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)
    assert sorted(len(run.x) for run in runs) == sorted([len(COARSE), len(second)])
    assert any("2 sweeps one below the other" in note for note in summary.notes)
    assert import_tip(content, tmp_path / "b.csv")[0].groupby("sweep").ngroups == 2


@pytest.mark.parametrize("way", [1, -1])
def test_rows_about_a_resonance_near_the_end_of_a_sweep_join_it_only_if_they_agree(tmp_path, way):
    """They go back by less than half of the sweep."""
    for moved, rows in ((1.0, [len(COARSE) + 41]), (1.0015, [len(COARSE), 41])):
        content = pd.concat([rows_at(COARSE[::-1], 2.0), rows_at(CLOSE[:41][::way], 2.0, moved=moved)])
        assert list(import_tip(content, tmp_path / "b.csv")[0].groupby("sweep", sort=False).size()) == rows


def test_rows_of_before_a_sweep_do_not_refine_it(tmp_path):
    content = pd.concat([rows_at(COARSE, 2.0), rows_at(CLOSE, 2.0)])
    for start, sweeps in ((1000.0, 1), (-1000.0, 2)):
        timed = content.assign(**{"time [s]": [*range(len(COARSE)), *(start + np.arange(len(CLOSE)))]})
        assert import_tip(timed, tmp_path / "b.csv")[0].groupby("sweep").ngroups == sweeps


def test_a_sweep_up_and_down_is_two(tmp_path):
    """Where a joint jumps, both ways differ at the same frequencies."""
    content = table(2.0)
    pd.concat([content, content[::-1].assign(**{"tip [mm]": 1.1 * content["tip [mm]"]})]).to_csv(
        tmp_path / "a.csv", index=False
    )
    up, down = read_runs([tmp_path / "a.csv"], SIZE)[0]
    np.testing.assert_allclose(up.channels[0].samples, TRUTH[2.0][0], rtol=1e-9)
    np.testing.assert_allclose(down.channels[0].samples, 1.1 * TRUTH[2.0][0], rtol=1e-9)


def test_what_is_no_motion_is_left_out_and_said(tmp_path):
    """Hidden sheets, lists of modes, counters, texts, percentages, volts and levels in decibels."""
    with pd.ExcelWriter(tmp_path / "a.xlsx") as book:
        pd.DataFrame({"Mode": [1, 2], "Frequency [Hz]": [12.0, 19.0]}).to_excel(book, sheet_name="modes", index=False)
        for level in LEVELS:
            content = table(level).assign(**{"tip THD [%]": 1.0, "Remark": "ok", "Shaker voltage [V]": 0.1})
            content["tip [dB]"] = 20.0 * np.log10(content["tip [mm]"])
            content.to_excel(book, sheet_name=f"{level:g} N")
        table(2.0).to_excel(book, sheet_name="old 2 N", index=False)
        book.sheets["old 2 N"].sheet_state = "hidden"
    runs, summary = read_runs([tmp_path / "a.xlsx"], SIZE)
    require_truth(runs)
    assert any("Remark, Shaker voltage left out" in note for note in summary.notes)
    assert any("'modes' is skipped" in note for note in summary.notes)


def test_a_level_without_a_drive_is_taken_with_a_caution(tmp_path):
    table(4.0).drop(columns="Force [N]").to_csv(tmp_path / "sine 4,0 N.csv", index=False)
    (run,), summary = read_runs([tmp_path / "sine 4,0 N.csv"], SIZE)
    np.testing.assert_allclose(run.channels[2].samples / run.drive, TRUTH[4.0][2] / 4.0, rtol=1e-9)
    assert any("caution: 'sine 4,0 N' has no drive: 4 N of its label" in note for note in summary.notes)


@pytest.mark.parametrize("text", ["sine 0,5 g", "sine_0p5g", "0.5 g", "0.5_g up"])
def test_levels_have_decimal_marks_of_either_kind(text):
    assert find_level(text.replace("_", " ")) == (0.5, "g")


@pytest.mark.parametrize("is_complex", [True, False])
def test_units_of_arrays_say_rms(tmp_path, is_complex):
    columns = {"force": (np.full(len(F), 2.0 / np.sqrt(2.0)), "N rms")}
    for name, x in zip(NAMES, TRUTH[2.0] / np.sqrt(2.0), strict=True):
        columns |= {name: (x if is_complex else np.abs(x), "mm rms")}
        columns |= {} if is_complex else {f"{name}_phase": np.angle(x)}
    (run,), _ = read_runs([write_spectra(tmp_path / "a.h5", F, {"run_2N": columns})], SIZE)
    assert run.level == pytest.approx(2.0)
    np.testing.assert_allclose(run.channels[run.names.index("tip")].samples, TRUTH[2.0][0], rtol=1e-9)


@pytest.mark.parametrize(
    "columns",
    [
        ("Freq. (Hz)", "Force (N) [rms]", "Accel (g) (rms)", "Phase (°)"),
        ("freq_Hz", "force_rms_N", "acc_rms_g", "phase_deg"),
        ("Frequenz / Hz", "Kraft / N eff", "Beschleunigung / g eff", "Phase / °"),
    ],
)
def test_a_table_of_one_sensor_is_what_import_reads(tmp_path, columns):
    g_mm, w = 9806.65, 2 * np.pi * F
    values = (F, np.full(len(F), 2.0), w**2 * np.abs(TRUTH[2.0][0]) / g_mm, np.degrees(np.angle(-TRUTH[2.0][0])))
    write_csv(tmp_path / "a.csv", dict(zip(columns, values, strict=True)), sep=";")
    (run,), _ = read_runs([tmp_path / "a.csv"], SIZE)
    record = steady_record(*read_file(tmp_path / "a.csv", Stated())[:1], Stated(), "a.csv", Summary()).frame
    for frame_column, here in (("amplitude", run.channels[0].samples * 9.80665 / -(w**2)), ("force", run.drive)):
        np.testing.assert_allclose(record[frame_column], np.abs(here), rtol=1e-9)
    expected = np.exp(1j * np.angle(-run.channels[0].samples))
    np.testing.assert_allclose(np.exp(-1j * record["phase"]), expected, rtol=1e-9)
    np.testing.assert_allclose(record["amplitude"], np.sqrt(2.0) * 1e-3 * np.abs(TRUTH[2.0][0]), rtol=1e-9)


@pytest.mark.parametrize(
    ("headers", "found"),
    [
        (["tip [g]", "tip phase [deg]"], {"tip": {"amplitude": 0, "angle": 1}}),
        (["tip amplitude (mm)", "mid amplitude (mm)", "phase tip", "phase mid"],
         {"tip": {"amplitude": 0, "angle": 2}, "mid": {"amplitude": 1, "angle": 3}}),
        (["Accel 1 [g]", "Phase 1 [deg]", "Accel 10 [g]", "Phase 10 [deg]"],
         {"Accel 1": {"amplitude": 0, "angle": 1}, "Accel 10": {"amplitude": 2, "angle": 3}}),
        (["A1 [g]", "Phase [deg]", "A2 [g]", "Phase [deg]"],
         {"A1": {"amplitude": 0, "angle": 1}, "A2": {"amplitude": 2, "angle": 3}}),
        (["Re(tip) [g]", "Im(tip) [g]"], {"tip": {"x": 0, "y": 1}}),
        (["tip_re", "tip_im", "mid_re", "mid_im"], {"tip": {"x": 0, "y": 1}, "mid": {"x": 2, "y": 3}}),
        (["tipAmp", "tipPhase"], {"tipAmp": {"amplitude": 0, "angle": 1}}),
        (["tip [g]", "tip phase [deg]", "tip coherence"], {"tip": {"amplitude": 0, "angle": 1}}),
        (["tip_lag_deg", "tip"], {"tip": {"amplitude": 1, "lag_deg": 0}}),
        (["amplitude", "phase"], {"amplitude": {"amplitude": 0, "phase": 1}}),
        (["A1 [g]", "A2 [g]", "Ph1 [deg]", "Ph2 [deg]"],
         {"A1": {"amplitude": 0, "angle": 2}, "A2": {"amplitude": 1, "angle": 3}}),
        (["tip [g]", "tip [dB]", "tip phase [deg]"], {"tip": {"amplitude": 0, "angle": 2}}),
        (["tip Realteil [g]", "tip Imaginärteil [g]"], {"tip": {"x": 0, "y": 1}}),
    ],
)  # fmt: skip
def test_columns_are_sensors_by_their_words(headers, found):
    of = [parse_header(text) for text in headers]
    assert {one.name: dict(one.roles) for one in group_columns(of, [False] * len(of), ())} == found


def test_ratios_have_the_level_of_the_file_name(tmp_path):
    """Receptances in mm/N without a drive, in two parts."""
    files = []
    for level in LEVELS:
        columns = {"f [Hz]": F}
        for name, x in zip(NAMES, TRUTH[level] / level, strict=True):
            columns |= {f"{name} re [mm/N]": x.real, f"{name} im [mm/N]": x.imag}
        files.append(write_csv(tmp_path / f"frf_{level:g}N.csv", columns))
    runs, _ = read_runs(files, SIZE)
    for run, level in zip(runs, LEVELS, strict=True):
        assert (run.level, run.names, run.channels[0].unit, run.channels[0].per_drive) == (level, [*NAMES], "mm", True)
        np.testing.assert_allclose(run.channels[1].samples, TRUTH[level][1] / level, rtol=1e-9)
    files[0].rename(tmp_path / "frf.csv")
    with pytest.raises(InputError, match=r"functions without a level; expected that of the drive \(in N\)"):
        read_runs([tmp_path / "frf.csv"], SIZE)


def test_a_dead_sensor_says_nothing_of_the_sense_of_phases(tmp_path):
    table(2.0).assign(**{"root [mm]": 0.0}).to_csv(tmp_path / "a.csv", index=False)
    (run,), _ = read_runs([tmp_path / "a.csv"], SIZE)
    np.testing.assert_allclose(run.channels[0].samples, TRUTH[2.0][0], rtol=1e-9)


@pytest.mark.parametrize("turned", [0.0, 30.0])
def test_a_base_with_its_own_phase_drives(tmp_path, turned):
    """Control and sensors against one reference; transmissibilities in g/g need the level in the name alone."""
    content = table(2.0).set_axis([text.replace("mm", "g") for text in table(2.0)], axis=1)
    content = content.drop(columns="Force [N]")
    for name in NAMES:
        content[f"{name} phase [deg]"] += turned
    for k, size in ((1, 1.9), (2, 2.1)):
        content[f"control_{k} [g]"], content[f"control_{k} phase [deg]"] = size, turned
    (run,), _ = read_runs([write_csv(tmp_path / "base.csv", content)], SIZE)
    assert (run.level, run.drive_unit, run.is_base_driven) == (pytest.approx(2.0), "g", True)
    np.testing.assert_allclose(run.channels[2].samples / run.drive, TRUTH[2.0][2] / 2.0, rtol=1e-9)


@pytest.mark.parametrize("text", ["{} phase [deg]", "{} phase"])
def test_a_sensor_that_hardly_turns_has_the_unit_of_the_others(tmp_path, text):
    """3 degrees were refused as rad under [deg], and taken for rad without a unit; as those of a controlled base."""
    content = table(2.0, text).drop(columns="Force [N]")
    size, turn = 1.0 + 0.01 * np.sin(F), 3.0 * np.sin(3.0 * F)
    content["foot [mm]"], content[text.format("foot")] = size, turn
    content["control [g]"], content[text.format("control")] = 2.0, -turn
    (run,), _ = read_runs([write_csv(tmp_path / "base.csv", content)], SIZE)
    of = dict(zip(run.names, run.channels, strict=True))
    np.testing.assert_allclose(of["foot"].samples, size * np.exp(1j * np.radians(turn)), rtol=1e-9)
    np.testing.assert_allclose(of["mid"].samples, TRUTH[2.0][1], rtol=1e-9)
    np.testing.assert_allclose(run.drive, 2.0 * np.exp(-1j * np.radians(turn)), rtol=1e-9)


def test_a_sensor_that_resonates_tells_its_own_unit_of_angle(tmp_path):
    """Its phase turns through a resonance, in rad, whatever the others have; and a dead sensor tells nothing."""
    content = table(2.0, "{} phase [deg]")
    content["tip phase [deg]"] = np.radians(content["tip phase [deg]"])
    with pytest.raises(InputError, match="angle in degrees runs from"):
        read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)
    for dead in (False, True):
        content = table(2.0, "{} phase")
        content["tip phase"] = np.radians(content["tip phase"])
        if dead:
            for name in ("mid", "root"):
                content[f"{name} phase"] = np.radians(content[f"{name} phase"])
            content["foot [mm]"], content["foot phase"] = 0.0, np.linspace(-150.0, 150.0, len(F))
        (run,), _ = read_runs([write_csv(tmp_path / "a.csv", content)], SIZE)
        of = dict(zip(run.names, run.channels, strict=True))
        for name, truth in zip(NAMES, TRUTH[2.0], strict=True):
            np.testing.assert_allclose(of[name].samples, truth, rtol=1e-9)


def test_amplitudes_in_groups_of_hdf5_share_a_frequency(tmp_path):
    """Real arrays with phases in rad, the frequency at the top of the file, a force for each group."""
    contents = {"freq": F}
    for level in LEVELS:
        contents[f"run_{level:g}N"] = {"force": level}
        for name, x in zip(NAMES, TRUTH[level], strict=True):
            contents[f"run_{level:g}N"] |= {name: np.abs(x), f"{name}_phase": np.angle(x)}
    runs, _ = read_runs([write_hdf5(tmp_path / "a.h5", contents)], SIZE, None, Stated(**SI))
    assert [run.level for run in runs] == list(LEVELS)
    for run, level in zip(runs, LEVELS, strict=True):
        np.testing.assert_allclose(run.channels[run.names.index("mid")].samples, TRUTH[level][1], rtol=1e-9)


def test_headers_and_corrections_state_scaling_unit_and_role(tmp_path):
    """rms amplitudes become peak values; a sensor that is out needs no phase."""
    content = table(2.0).rename(columns={"tip [mm]": "tip RMS [mm]", "mid [mm]": "mid"}).assign(temperature=20.0)
    content["tip RMS [mm]"] /= np.sqrt(2.0)
    content.to_csv(tmp_path / "a.csv", index=False)
    channels = {"temperature": ChannelCorrection(role="out"), "mid": ChannelCorrection(unit="mm", scale=-1.0)}
    (run,), _ = read_runs([tmp_path / "a.csv"], SIZE, Corrections(channels=channels))
    assert run.names[1:] == ["mid", "root"]
    np.testing.assert_allclose(run.channels[0].samples, TRUTH[2.0][0], rtol=1e-9)
    np.testing.assert_allclose(run.channels[1].samples, -TRUTH[2.0][1], rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "facts", "message"),
    [
        (lambda t: t.drop(columns="mid phase [deg]"), {}, r"'mid' has no phase; .*mid phase \[deg\].*role = 'out'"),
        (lambda t: t.rename(columns={"mid [mm]": "mid"}), {}, r"the unit of 'mid' is not known.*--unit response="),
        (lambda t: t.rename(columns={"Force [N]": "F"}), {}, r"the unit of 'F' is not known.*--unit force=N"),
        (lambda t: t.drop(columns="Force [N]"), {}, r"no drive; .*--column force=NAME"),
        (lambda t: t.rename(columns={"Frequency [Hz]": "n"}), {}, r"no frequency; .*--column frequency=NAME"),
        (lambda t: t.rename(columns={"mid phase [deg]": "phase b [deg]"}), {}, r"which column belongs to 'phase b"),
        (lambda t: t, {"columns": {"amplitude": "tip [mm]"}}, r"--column amplitude of a campaign"),
        (lambda t: t, {"columns": {"force": "drive"}}, r"no column 'drive'.*; expected one of Frequency"),
        (lambda t: t.assign(**{"force 2 [N]": 1.0}), {}, r"2 drives, .*expected one force"),
        (lambda t: t.assign(**{"mid re [g]": 1.0, "mid im [g]": 1.0}), {}, r"2 sensors are 'mid'"),
        (
            lambda t: t.set_axis(
                ["f", "F [N]", "Phase [deg]", "A [g]", "Phase [deg]", "B [g]", "Phase [deg]", "C [g]"], axis=1
            ),
            {},
            r"which column belongs to 'Phase",
        ),
        (
            lambda t: t.rename(columns={"Force [N]": "Force [mV]"}),
            {},
            r"the unit 'mV' is not.*unit and scale in --corr",
        ),
        (lambda t: t.rename(columns={c: c.replace("mm", "-") for c in t}), {}, r"'tip' is not known.*response=g/g"),
        (lambda t: t.rename(columns={"tip [mm]": "tip [dB re 1 g]"}), {}, r"decibels \('tip \[dB re 1 g\]'\)"),
        (lambda t: t.iloc[:20], {}, r"lead or lag cannot be determined.*columns called lead or lag"),
    ],
)
def test_what_is_not_clear_is_asked_for(tmp_path, change, facts, message):
    columns = list(table(2.0))
    order = [*columns[:2], *columns[2::2], *columns[3::2]]  # no phase on the right of its amplitude
    change(table(2.0)[order]).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(InputError, match=message):
        read_runs([tmp_path / "a.csv"], SIZE, None, Stated(**facts))


def test_the_command_takes_columns_and_units(tmp_path, damping, no_drawing, few_laws):
    names = ["n", "pull", "tip", "tip phase", "mid", "mid phase", "root", "root phase"]
    for level in LEVELS:
        table(level).set_axis(names, axis=1).to_csv(tmp_path / f"{level:g}.csv", index=False)
    files = [tmp_path / f"{level:g}.csv" for level in LEVELS]
    options = ["--column", "frequency=n", "--column", "force=pull", "--unit", "force=N"]
    refused = damping("campaign", *files, "--out", tmp_path / "out", *options)
    assert refused.code == 2
    assert "--unit response=m/s^2" in refused.err
    done = damping("campaign", *files, "--out", tmp_path / "out", *options, "--unit", "response=mm")
    assert (done.code, done.err) == (0, "")
    answer = json.loads((tmp_path / "out" / "campaign.json").read_text())
    assert answer["levels"] == list(LEVELS)
    for mode, (f_n, *_) in zip(answer["modes"], MODES, strict=True):
        near = np.abs(F / f_n - 1.0) < 0.02
        for at, level in zip(mode["at"], LEVELS, strict=False):
            for one, x in zip(at["response"], TRUTH[level], strict=True):
                # rows lie a fifth of a half width apart: their largest is within 2 % of the peak
                np.testing.assert_allclose(one["median"], np.abs(x[near]).max(), rtol=0.02)


@pytest.mark.parametrize(
    ("units", "drive"),
    [
        ({"Force": "N", "tip": "mm"}, "Force"),
        ({"tip": "mm", "load": "N"}, "load"),
        ({"acc": "g", "control_1": "g"}, "control_1"),
        ({"tip / force": "mm/N", "load": "N"}, "load"),
        ({"drive": "V", "base": "g", "acc": "g"}, "base"),
        ({"F1": "N", "F2": "N"}, None),
    ],
)
def test_the_drive_of_channels_in_time_is_that_of_a_table(units, drive):
    """Names and units say the same in both: a ratio and a voltage beside a measured drive are no drives."""
    assert Corrections().choose_drive("a", units) == drive
    assert Corrections().list_drives(units) == ([drive] if drive else [])


def test_drives_in_several_units_are_levels_in_one(tmp_path):
    """0.449618 lbf is 2.0000 N (1 lbf = 4.4482216 N, NIST SP 811); a force is no level of a base."""
    files = write("csv", tmp_path)
    text = files[1].read_text().replace("Force [N]", "Force [lbf]")
    files[1].write_text(text.replace(f",{LEVELS[1]:.1f},", f",{LEVELS[1] / 4.4482216152605},"))
    require_truth(read_runs(files, SIZE)[0])
    files[1].write_text(text.replace("Force [lbf]", "Base [g]"))
    with pytest.raises(InputError, match="driven in g, others in N; expected one kind of drive"):
        read_runs(files, SIZE)


@pytest.mark.parametrize("names", [("tip",), NAMES])
@pytest.mark.parametrize("phase", ["{} phase [deg]", "{} lead [deg]"])
def test_a_drive_exchanged_with_a_sensor_is_named(tmp_path, names, phase):
    """With several modes the answer was of what lies between them; stated roles give the runs of the right columns."""
    for level in LEVELS:
        content = table(level, phase).filter(regex="|".join(("Frequency", "Force", *names)))
        content[phase.format("Force")] = 0.0
        swapped = {"tip [mm]": "Force [N]", "Force [N]": "tip [mm]"}
        swapped |= {phase.format(a): phase.format(b) for a, b in (("tip", "Force"), ("Force", "tip"))}
        content.rename(columns=swapped).to_csv(tmp_path / f"{level:g}N.csv", index=False)
    files = sorted(tmp_path.glob("*.csv"))
    with pytest.raises(InputError, match="the drive peaks as a sensor does, and 'tip' is steady as a drive"):
        analyse(files, max_size=SIZE)
    roles = {"tip": ChannelCorrection("drive", "N"), "Force": ChannelCorrection("sensor", "mm")}
    for run, level in zip(read_runs(files, SIZE, Corrections(channels=roles))[0], LEVELS, strict=True):
        assert (run.level, run.names) == (level, ["Force", *names[1:]])
        np.testing.assert_allclose(run.channels[0].samples / run.drive, TRUTH[level][0] / level, rtol=1e-9)


def test_a_drive_that_falls_at_resonances_or_follows_a_profile_is_no_sensor():
    """A shaker's force falls where the structure moves; a base profile moves every sensor with it."""
    H = np.abs(TRUTH[1.0])
    falls, profile = 1.0 / (1.0 + 0.2 * H[0] / H[0].mean()), np.where((F > 11.0) & (F < 13.0), 5.0, 1.0)
    for drive, rows in ((falls, F > 0.0), (profile, F > 0.0), (1.0 / H[0], F < 14.0)):  # the last holds a response
        assert not find_exchanged(drive[rows], dict(zip(NAMES, (H * drive)[:, rows], strict=True)))
    assert find_exchanged(H[0], {"force": falls, "mid": H[1]}) == "force"


def test_a_copy_of_a_run_is_refused(tmp_path):
    for name in ("1N", "copy"):
        table(1.0).to_csv(tmp_path / f"{name}.csv", index=False)
    files = [tmp_path / "1N.csv", tmp_path / "copy.csv"]
    with pytest.raises(InputError, match="run 'copy' is run '1N' again, in every number"):
        read_runs(files, SIZE)
    (left,), _ = read_runs(files, SIZE, Corrections(levels={"copy": None}))
    assert left.label == "1N"


def test_a_mode_found_far_from_where_it_was_asked_for_is_told(tmp_path):
    """The fit of a level moves a frequency by 4 % at most: it stood at that end, with the standard error of noise."""
    files = write("csv", tmp_path)[:2]
    levels = fit_levels(read_runs(files, SIZE)[0], [12.0, 20.6])
    near = fit_levels(read_runs(files, SIZE)[0], [12.0, 19.0])
    for level, of in zip(levels, near, strict=True):
        np.testing.assert_allclose(level.fit.frequency, of.fit.frequency, rtol=1e-5)
    (told,) = describe_lost(levels, join_modes(levels, {}, [12.0, 20.6]), [12.0, 20.6])
    assert told == "caution: the mode stated near 20.6 Hz was found at 19 Hz: is it another one?"


@pytest.mark.parametrize("across", [False, True])
def test_sensors_of_an_array_are_named_by_row_or_column(tmp_path, across):
    """As h5py counts rows, and as every table names columns; in the drive's g, which the label states and it reads."""
    X = TRUTH[2.0].T if across else TRUTH[2.0]
    path = write_spectra(tmp_path / "a.h5", F, {"run_0.3g": {"control": 0.3, "acc": (X, "g")}})
    (run,), _ = read_runs([path], SIZE)
    assert run.names == (["acc(:,1)", "acc(:,2)", "acc(:,3)"] if across else ["acc[0]", "acc[1]", "acc[2]"])
    assert (run.label, run.level, run.drive_unit) == ("run_0.3g", 0.3, "g")
    np.testing.assert_array_equal([channel.samples for channel in run.channels], TRUTH[2.0])


@pytest.mark.parametrize(
    ("columns", "stated", "message"),
    [
        ({"control": 0.3, "acc": TRUTH[2.0]}, {}, r"the unit of 'acc\[0\]' is not known"),
        ({"control": 2.1, "acc": (TRUTH[2.0], "g")}, {}, "the unit of 'control' is not known"),
        # two exciters
        ({"force": (np.full((2, len(F)), 0.3 + 0j), "N"), "acc": (TRUTH[2.0], "g")}, {}, "2 columns of force"),
        (
            {"control_1": 0.3, "control_2": 0.3, "acc": (TRUTH[2.0], "g")},
            {"force": "N"},
            "2 drives, control_1, control_2; expected one force",
        ),
    ],
)
def test_what_a_group_does_not_say_is_asked_for(tmp_path, columns, stated, message):
    with pytest.raises(InputError, match=message):
        read_runs([write_spectra(tmp_path / "a.h5", F, {"run_0.3g": columns})], SIZE, None, Stated(units=stated))


def test_a_group_swept_down_is_read_by_rising_frequency(tmp_path):
    """And real values without a phase are no responses beside complex ones."""
    columns = {"control": (0.3, "g"), "tip": (TRUTH[2.0][0, ::-1], "g"), "heat": np.full(len(F), 20.0)}
    (run,), summary = read_runs([write_spectra(tmp_path / "a.h5", F[::-1], {"run_0.3g": columns})], SIZE)
    np.testing.assert_array_equal(run.x, F)
    np.testing.assert_array_equal([channel.samples for channel in run.channels], TRUTH[2.0][:1])
    assert "run_0.3g: heat left out: no complex values" in summary.notes


def test_a_point_in_the_name_of_a_group_is_part_of_a_level(tmp_path):
    """A file with no drive has the level of its label: 0.3 g, not 3 g."""
    columns = {"tip": (np.abs(TRUTH[2.0][0]), "g/g"), "tip_lag": (-np.angle(TRUTH[2.0][0]), "rad")}
    (run,), _ = read_runs([write_spectra(tmp_path / "a.h5", F, {"run_0.3g": columns})], SIZE)
    assert (run.label, run.level) == ("run_0.3g", 0.3)


def test_groups_against_time_and_frequency_are_runs_of_one_file(tmp_path):
    """A group that was tracked stands beside one of spectra; each is read as alone."""
    columns = {"control": (0.3, "g"), "tip": (TRUTH[2.0][0], "g")}
    path = write_spectra(tmp_path / "a.h5", F, {"run_0.3g": columns})
    t = np.arange(0.0, 10.0, 5e-3)
    sine = np.sin(2 * np.pi * (9.0 + 0.1 * t) * t) * (1.0 + 1e-3 * t)  # a gain of both: no ceiling
    with h5py.File(path, "r+") as file:
        fill(file, {"run_0.6g": {"time": (t, "s"), "control": (0.6 * sine, "g"), "tip": (1.8 * sine, "g")}})
    spectra, tracked = read_runs([path], SIZE)[0]
    assert [(run.label, run.level) for run in (spectra, tracked)] == [("run_0.3g", 0.3), ("run_0.6g", 0.6)]
    np.testing.assert_array_equal(spectra.channels[0].samples, TRUTH[2.0][0])
    ratio = tracked.channels[0].samples / tracked.drive
    np.testing.assert_allclose(ratio, 3.0, rtol=1e-9)  # one signal of two sizes


def test_a_number_too_large_to_be_squared_is_no_number(tmp_path):
    """A row of a table without it is left out; in arrays and signals, which have no gaps, it is refused."""
    f = np.linspace(45.0, 55.0, 60)
    H = 1.0 / (50.0**2 - f**2 + 2j * f)
    motion = np.abs(H)
    motion[7] = 1e200
    columns = {"frequency [Hz]": f, "force [N]": 1.0, "tip [mm]": motion, "tip lag [deg]": -np.angle(H, deg=True)}
    (run,), summary = read_runs([write_csv(tmp_path / "sine_1N.csv", columns)], SIZE)
    assert len(run.x) == 59
    assert any("1 row of" in note and "left out" in note for note in summary.notes)
    path = write_spectra(tmp_path / "sine.h5", f, {"run_1N": {"force": (1.0, "N"), "tip": (motion + 0j, "mm")}})
    with pytest.raises(InputError, match=r"'tip' holds values beyond 1e\+50, the first in row 8 of 60"):
        read_runs([path], SIZE)
    path = write_csv(tmp_path / "decay.csv", {"time [s]": f - 45.0, "tip [mm]": motion})
    with pytest.raises(InputError, match=r"line 9, .*1e.200") as refused:
        read_runs([path], SIZE)
    assert refused.value.column == "tip [mm]"


@pytest.mark.parametrize(
    ("frequency", "level", "said"),
    [
        ([25.0, 40.0], [0.5, np.nan], "--design is no level: level nan"),
        ([25.0, 40.0], [0.5, 1e308], r"--design is no level: level 1e\+308"),
        ([25.0, 25.0], [0.5, 0.4], "--design is no level: frequency 25 Hz"),
        ([-1.0, 25.0], [0.5, 0.4], "--design is no level: frequency -1 Hz"),
    ],
)
def test_a_design_level_names_the_number_that_is_none(frequency, level, said):
    with pytest.raises(InputError, match=said):
        DesignLevel(np.array(frequency), np.array(level))
