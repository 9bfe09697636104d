"""WAV files, workbooks, channels without a time step, and arrays sampled by a number beside them."""

from __future__ import annotations

import contextlib
import io
import itertools
import struct
import zipfile
from pathlib import Path

import h5py
import numpy as np
import openpyxl
import pandas as pd
import pytest
import scipy.io
import scipy.io.wavfile
from nptdms import ChannelObject, TdmsWriter

from damping.errors import InputError
from damping.formats import read_file
from damping.formats.motions import TimeHistory, time_histories
from damping.formats.series import Stated, Summary
from tests.files import write_csv, write_hdf5

RATE = 200.0
T = np.arange(400) / RATE
X = np.exp(-0.3 * T) * np.cos(30.0 * T)
SIGNAL = {"units": {"response": "m/s^2"}}


def histories(path: Path, **stated: object) -> list[TimeHistory]:
    said = Stated(**stated)
    return time_histories(read_file(path, said)[0], said, read_file(path, said)[1])


def wave(samples: np.ndarray, bits: int, code: int = 1) -> bytes:
    """A WAV file (n, channels) with a chunk of text of odd length before the samples."""
    n, channels = samples.shape
    if code == 3:
        body = samples.astype(f"<f{bits // 8}").tobytes()
    elif bits == 8:
        body = np.round(127 * samples + 128).astype("u1").tobytes()
    else:
        whole = np.round((2 ** (bits - 1) - 1) * samples).astype("<i4")
        body = whole[..., None].view("u1").reshape(n, channels, 4)[..., : bits // 8].tobytes()
    frame = channels * bits // 8
    head = b"WAVEfmt " + struct.pack("<IHHIIHH", 16, code, channels, int(RATE), int(RATE) * frame, frame, bits)
    head += b"note" + struct.pack("<I", 3) + b"abc\0" + b"data" + struct.pack("<I", len(body))
    return b"RIFF" + struct.pack("<I", len(head) + len(body)) + head + body


@pytest.mark.parametrize(("bits", "code"), [(8, 1), (16, 1), (24, 1), (32, 1), (32, 3), (64, 3)])
def test_channels_of_a_wav_file(tmp_path, bits, code):
    path, full = tmp_path / "a.wav", 250.0
    path.write_bytes(wave(np.column_stack([X, -0.5 * X]), bits, code))
    first, second = histories(path, scale={"response": full}, **SIGNAL)
    step = 2.0 ** (1 - bits) if code == 1 else 1e-7  # of integers, or of single precision
    np.testing.assert_allclose(first.signal, full * X, atol=2.0 * full * step)
    np.testing.assert_allclose(second.signal, -0.5 * full * X, atol=2.0 * full * step)
    np.testing.assert_allclose(first.t, T, rtol=1e-12)
    (one,) = histories(path, scale={"response": full}, columns={"response": "2"}, **SIGNAL)
    np.testing.assert_array_equal(one.signal, second.signal)
    with pytest.raises(InputError, match=r"parts of full scale.*--scale response="):
        histories(path, **SIGNAL)


@pytest.mark.parametrize("dtype", ["u1", "<i2", "<i4", "<f4"])
def test_wav_files_of_another_program(tmp_path, dtype):
    path = tmp_path / "a.wav"
    size = 1.0 if dtype == "<f4" else float(np.iinfo(dtype).max) / (2.0 if dtype == "u1" else 1.0)
    samples = (X * (size - 1.0 if size > 1.0 else 1.0) + (128.0 if dtype == "u1" else 0.0)).astype(dtype)
    scipy.io.wavfile.write(path, int(RATE), samples)
    (one,) = histories(path, scale={"response": 1.0}, **SIGNAL)
    np.testing.assert_allclose(one.signal, X, atol=0.02 if dtype == "u1" else 1e-4)


def test_a_broken_wav_file_is_refused(tmp_path):
    path, data = tmp_path / "a.wav", wave(X[:, None], 16)
    for content, said in ((data[:-1], "expected a whole WAV file"), (data[:30], "expected a whole WAV file")):
        path.write_bytes(content)
        with pytest.raises(InputError, match=said):
            histories(path, scale={"response": 1.0}, **SIGNAL)
    path.write_bytes(data[:20] + b"\x11" + data[21:])  # compressed
    with pytest.raises(InputError, match="Unknown wave file format"):
        histories(path, scale={"response": 1.0}, **SIGNAL)
    for content in (data[:24] + bytes(8) + data[32:], wave(X[:0, None], 16), data.replace(b"data", b"junk")):
        path.write_bytes(content)
        with pytest.raises(InputError, match="without samples or sampling rate"):
            histories(path, scale={"response": 1.0}, **SIGNAL)
    for place, byte in itertools.product(range(48), (0x00, 0xFF)):  # every byte of the head
        path.write_bytes(data[:place] + bytes([byte]) + data[place + 1 :])
        with contextlib.suppress(InputError):  # and nothing else
            read_file(path, Stated(format="wav", scale={"response": 1.0}, **SIGNAL))


def workbook(*sheets: list[list[object]]) -> bytes:
    """A workbook with these rows of cells, None for an empty one."""
    book, written = openpyxl.Workbook(), io.BytesIO()
    book.remove(book.active)
    for rows in sheets:
        sheet = book.create_sheet()
        for row in rows:
            sheet.append(row)
    book.save(written)
    return written.getvalue()


def test_a_workbook(truth, tmp_path, imported):
    """Lines about the test above the header, units below it, an empty last cell, and a second sheet."""
    path, lag = tmp_path / "a.xlsx", np.degrees(truth.lag)
    rows = zip(truth.f.tolist(), [truth.F] * len(lag), (1e3 * truth.amplitude).tolist(), lag.tolist(), strict=True)
    names = [["Prüfling", "A < B"], ["Frequenz", "Kraft", "Weg", "Phase", "Notiz"], ["Hz", "N", "mm", "°", "-"]]
    sheet = [*names, *([*row, None] for row in rows)]
    path.write_bytes(workbook(sheet))
    record = imported(path).record
    np.testing.assert_allclose(record.column("amplitude"), truth.amplitude, rtol=1e-12)
    np.testing.assert_allclose(record.column("phase"), truth.lag, rtol=1e-12)
    path.write_bytes(workbook([["Info", 1.0]], sheet, []))
    named = r"2 sheets with cells: 1 'Sheet' \(1 x 2\), 2 'Sheet1' \(44 x 5\); expected --dataset N"
    with pytest.raises(InputError, match=named):
        imported(path)
    assert len(imported(path, datasets=(2,)).record) == len(lag)
    with pytest.raises(InputError, match="0 sheets with cells"):
        imported(path, datasets=(4,))


def test_a_workbook_that_is_broken_or_unpacks_to_too_much(tmp_path):
    path, data = tmp_path / "a.xlsx", workbook([["time", "a"], *([k / 10, 0.5] for k in range(2000))])
    path.write_bytes(data)
    with pytest.raises(InputError, match="unpacks to more than 50000 bytes"):
        read_file(path, Stated(), max_size=50_000)
    random, data = np.random.default_rng(1), workbook([["time", "a"], *([k / 10, 0.5] for k in range(100))])
    for _ in range(100):
        broken = bytearray(data)
        broken[random.integers(len(data))] ^= 0xFF
        path.write_bytes(broken)
        with contextlib.suppress(InputError):  # and nothing else
            read_file(path, Stated(**SIGNAL))


def insert_rows(data: bytes, rows: str) -> bytes:
    """A workbook with further rows of XML in its first sheet, and with one long text shared by cells ``<v>0</v>``."""
    changed, kind = io.BytesIO(), "application/vnd.openxmlformats-officedocument.spreadsheetml.sharedStrings+xml"
    added = {
        "sheet1.xml": ("</sheetData>", rows),
        "Types].xml": ("</Types>", f'<Override PartName="/s" ContentType="{kind}"/>'),
    }
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(changed, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            end, text = next((pair for tail, pair in added.items() if name.endswith(tail)), ("", ""))
            new.writestr(name, old.read(name).replace(end.encode(), (text + end).encode()) if end else old.read(name))
        space = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
        new.writestr("s", f'<sst xmlns="{space}"><si><t>{"x" * 30_000}</t></si></sst>')
    return changed.getvalue()


@pytest.mark.parametrize(
    "rows",
    [
        '<row r="1000000000000"><c><v>1</v></c></row>',  # as many empty rows above it
        "<row>" + '<c t="s"><v>0</v></c>' * 900 + "</row>",  # a long text in many cells
        f"<row>{'<c><v>1</v></c>' * 900}</row>{'<row><c><v>1</v></c></row>' * 3000}",  # all as wide as the widest
    ],
    ids=["far", "shared", "wide"],
)
def test_a_small_workbook_that_would_fill_memory_is_refused(tmp_path, rows):
    path = tmp_path / "a.xlsx"
    path.write_bytes(insert_rows(workbook([["time", "a"], [0.0, 1.0]]), rows))
    with pytest.raises(InputError, match=r"a sheet of more than 1048576 rows, or of more than 2000000 characters"):
        read_file(path, Stated(**SIGNAL), max_size=2_000_000)


def test_errors_name_the_row_of_a_sheet_with_empty_rows(tmp_path):
    path = tmp_path / "a.xlsx"
    path.write_bytes(
        workbook([["Prüfling"], [None], ["time", "a"], *([k / 10, 0.5] for k in range(5)), [], [0.5, "?"]])
    )
    with pytest.raises(InputError, match="line 10, column a: '\\?' is not a number"):
        read_file(path, Stated(**SIGNAL))


def test_a_number_in_the_same_structure_says_how_a_signal_was_sampled(tmp_path):
    """The step of another signal would make every frequency wrong by its factor."""
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"slow": {"T": X, "dt": 1.0}, "fast": {"acc": X, "dt": 1.0 / RATE}})
    (one,) = histories(path, columns={"response": "fast.acc"}, **SIGNAL)
    np.testing.assert_allclose(one.t, T, rtol=1e-12)
    scipy.io.savemat(path, {"acc": X, "slow": {"dt": 1.0}, "fast": {"dt": 1.0 / RATE}})
    with pytest.raises(InputError, match=r"several sampling rates: slow\.dt, fast\.dt; expected --rate HZ"):
        histories(path, columns={"response": "acc"}, **SIGNAL)
    (one,) = histories(path, columns={"response": "acc"}, rate=RATE, **SIGNAL)
    np.testing.assert_allclose(one.t, T, rtol=1e-12)


def test_a_first_value_and_an_increment(truth, tmp_path, imported):
    """Functions of frequency and of time in the structures of a test system."""
    path = tmp_path / "a.mat"
    of_f = {"start_value": truth.f[0], "increment": truth.f[1] - truth.f[0], "number_of_values": float(len(truth.f))}
    of_t = {"start_value": -0.5, "increment": 1.0 / RATE}
    scipy.io.savemat(
        path,
        {"H": {"x_values": of_f, "y_values": {"values": truth.H}}, "s": {"x_values": of_t, "y_values": {"values": X}}},
    )
    record = imported(path, columns={"response": "H.y_values.values"}, consistent=True, response="receptance",
                      forces=(truth.F,)).record  # fmt: skip
    np.testing.assert_allclose(record.column("frequency"), truth.f, rtol=1e-12)
    np.testing.assert_allclose(record.column("amplitude"), truth.amplitude, rtol=1e-12)
    (one,) = histories(path, columns={"response": "s.y_values.values"}, **SIGNAL)
    np.testing.assert_allclose(one.t, T - 0.5, rtol=0.0, atol=1e-12)


def test_the_frequency_of_the_same_group_and_attributes(truth, tmp_path, imported):
    runs = {f"run_{k}": {"frequency": truth.f + k, "disp": truth.H * truth.F} for k in (0, 1)}
    path = write_hdf5(tmp_path / "a.h5", runs | {"acc": X})
    with h5py.File(path, "a") as file:
        file["acc"].attrs["fs"] = RATE
    stated = {"columns": {"response": "run_1/disp"}, "consistent": True, "response": "displacement"}
    record = imported(path, forces=(truth.F,), scaling="peak", **stated).record
    np.testing.assert_array_equal(record.column("frequency"), truth.f + 1.0)
    (one,) = histories(path, columns={"response": "acc"}, **SIGNAL)
    np.testing.assert_allclose(one.t, T, rtol=1e-12)


@pytest.mark.parametrize("value", ["fast", [1.0, 2.0], [], h5py.Empty("f")])
def test_an_attribute_that_is_no_number_says_nothing_about_sampling(tmp_path, value):
    path = write_hdf5(tmp_path / "a.h5", {"acc": X, "number": {"fs": RATE}})
    with h5py.File(path, "a") as file:
        file["acc"].attrs["rate"] = value
    (one,) = histories(path, columns={"response": "acc"}, **SIGNAL)
    np.testing.assert_allclose(one.t, T, rtol=1e-12)


def test_the_only_motion_beside_the_time_is_the_response(tmp_path):
    path = tmp_path / "a.csv"
    np.savetxt(path, np.column_stack([T, 1e3 * X]), delimiter=",", header="time [s],sig [mm/s]", comments="")
    (one,) = histories(path)
    assert one.order == 1
    np.testing.assert_allclose(one.signal, X, rtol=1e-12)
    np.savetxt(path, np.column_stack([T, T, T]), delimiter=",", header="time [s],a [mm/s],b [mm/s]", comments="")
    with pytest.raises(InputError, match="which column is the response"):
        histories(path)


def test_tdms_channels_without_a_time_step(truth, tmp_path, imported):
    path = tmp_path / "a.tdms"
    columns = {"Frequency": ("Hz", truth.f), "Disp": ("mm", 1e3 * truth.amplitude), "Force": ("N", 0 * truth.f + 3.0)}
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject("S", name, x, {"unit_string": u}) for name, (u, x) in columns.items()])
    names = {"frequency": "Frequency", "amplitude": "Disp", "force": "Force"}
    record = imported(path, columns=names).record
    np.testing.assert_allclose(record.column("amplitude"), truth.amplitude, rtol=1e-12)
    with pytest.raises(InputError, match="which column is the response"):
        imported(path)
    counts = np.round(2e4 * X).astype(np.int16)
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject("S", "Acc", counts, {"unit_string": "m/s^2"})])
    (one,) = histories(path, columns={"response": "Acc"}, rate=RATE)
    np.testing.assert_allclose(one.t, T, rtol=1e-12)


def test_integers_of_16_bits_are_no_larger_than_their_file_warrants(tmp_path):
    """Nine million samples: 18 MB in the file, 72 MB as numbers."""
    path, n = tmp_path / "a.tdms", 9_000_000
    with TdmsWriter(path) as file:
        about = {"unit_string": "m/s^2", "wf_increment": 1e-3}
        file.write_segment([ChannelObject("S", "Acc", np.ones(n, dtype=np.int16), about)])
    assert len(read_file(path, Stated())[0][0].response) == n


def test_a_table_of_a_signal_without_times(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Acc [m/s^2]\n" + "".join(f"{x!r}\n" for x in X.tolist()))
    (one,) = histories(path, rate=RATE)
    np.testing.assert_allclose(one.t, T, rtol=1e-12)
    np.testing.assert_allclose(one.signal, X, rtol=1e-12)
    with pytest.raises(InputError, match="--unit time beside --rate, which gives times in s"):
        histories(path, rate=RATE, units={"time": "ms"})  # they became a thousand times too short
    path.write_text("Time [s],Acc [m/s^2]\n0,1\n1,2\n")
    with pytest.raises(InputError, match="--rate beside a column of times"):
        histories(path, rate=RATE)


def test_a_stated_unit_beside_that_of_the_file_is_said(tmp_path):
    """A signal in volts needs its sensitivity: without one, readings pass for those of the stated unit."""
    path = write_csv(tmp_path / "a.csv", {"Time [s]": T, "Acc [mV]": 10.0 * X})
    said = r"a voltage; expected --unit response=UNIT .* --scale response=VALUE of one mV"
    with pytest.raises(InputError, match=said):
        histories(path)
    for scale, cautions in ({}, 1), ({"response": 0.1}, 0):
        stated, summary = Stated(**SIGNAL, scale=scale), Summary()
        (one,) = time_histories(read_file(path, stated)[0], stated, summary)
        np.testing.assert_allclose(one.signal, 10.0 * X * scale.get("response", 1.0), rtol=1e-12)
        assert len([note for note in summary.notes if "the file says mV and m/s^2 is stated" in note]) == cautions


@pytest.mark.parametrize("what", ["sweep_rate=oct/min", "energy=J", "mass=kg", "frequency=rpm"])
def test_a_unit_of_what_the_file_has_not_is_said(tmp_path, what):
    path = write_csv(tmp_path / "a.csv", {"Time [s]": T, "Acc [m/s^2]": X})
    name, unit = what.split("=")
    (said,) = (note for note in read_file(path, Stated(units={name: unit}))[1].notes if "--unit" in note)
    assert said.startswith(f"caution: --unit {what} changes nothing")
    assert not any("--unit" in note for note in read_file(path, Stated(units={"time": "s"}))[1].notes)


def test_a_motion_in_rms_is_said(tmp_path):
    """A recorder that divides every sample by the square root of 2, or writes the rms of a second each second."""
    path = tmp_path / "a.csv"
    for header, cautions in ("Acc [g rms]", 1), ("Acc [g pk]", 0), ("Acc [g]", 0):
        pd.DataFrame({"Time [s]": T, header: X}).to_csv(path, index=False)
        for scale, expected in ({}, cautions), ({"response": 2.0**0.5}, 0):
            stated, summary = Stated(scale=scale), Summary()
            time_histories(read_file(path, stated)[0], stated, summary)
            assert len([note for note in summary.notes if "says rms" in note and "response=1.414" in note]) == expected
    pd.DataFrame({"Time [s]": T, "Acc RMS [g]": np.abs(X)}).to_csv(path, index=False)
    with pytest.raises(InputError, match="holds rms values against time; expected the motion itself"):
        histories(path)


@pytest.mark.parametrize(("mark", "decimal"), [(".", "point"), (",", "comma")])
def test_marks_between_thousands_are_no_decimals(tmp_path, imported, mark, decimal):
    """Whole numbers of a spreadsheet: 12.345 (German) or 12,345 (English) is twelve thousand."""
    path = tmp_path / "a.csv"
    rows = "".join(f"{24 + k};2;{7 + k}{mark}553;{170 - 9 * k}\n" for k in range(5))
    path.write_text("Frequency [Hz];Force [N];Accel [mm/s^2 pk];Phase [deg]\n" + rows)
    message = rf"7[{mark}]553 beside whole numbers: a decimal {decimal}, or a mark between thousands"
    with pytest.raises(InputError, match=message):
        imported(path)
    assert imported(path, decimal=decimal).record.column("amplitude")[0] < 1e-3
    table = path.read_text()
    for frequency in (f"24{mark}5;", "1024;"):  # a number with other decimals, or thousands without a mark, tells
        path.write_text(table.replace("24;", frequency))
        assert len(imported(path).record) == 5


def test_sweeps_beside_levels_are_labelled_as_of_any_array(tmp_path):
    """The number 1 of a sweep, in a file of arrays with a name for each level."""
    f = np.tile(np.linspace(1.0, 3.0, 9), 2)
    levels = {f"{level:g} g": level * np.exp(-1j * f) for level in (0.5, 1.0)}
    path = write_hdf5(tmp_path / "a.h5", {"frequency": f, "run": np.repeat([1.0, 2.0], 9)} | levels)
    series, _ = read_file(path, Stated())
    assert [row.label for row in series] == ["1", "2"] * 2
    np.testing.assert_array_equal(series[3].response, np.exp(-1j * f[9:]))


@pytest.mark.parametrize("course", ["sine", "noise", "blow", "release", "pull"])
def test_a_force_that_acts_on_is_no_free_decay(course):
    random = np.random.default_rng(1)
    force = {
        "sine": 5.0 * np.sin(40.0 * T),
        "noise": random.normal(size=len(T)),
        "blow": np.where(T < 0.02, 100.0, 0.0) + random.normal(size=len(T)),  # a sensor's noise of 1 %
        "release": np.where(T < 0.1, 100.0, 0.0) + 3.0,  # and an offset
        "pull": np.where(T < 1.2, 100.0, 0.0),  # held for most of the time
    }[course]
    since = 1.25 if course == "pull" else 0.3
    history, driven = TimeHistory("a", T, X, 2, force), course in ("sine", "noise")
    assert history.is_driven(since, 1.8) == driven
    assert not TimeHistory("a", T, X, 2).is_driven(0.3, 1.8)
    stops = {"blow": 0.02, "release": 0.1, "pull": 1.2}
    free = history.list_free(0.3)
    assert [end for _, end in free] == ([] if driven else [T[-1]])
    np.testing.assert_allclose([start for start, _ in free], [stops[course]] if free else [], rtol=0, atol=2 * T[1])


@pytest.mark.parametrize(("name", "motion"), [("fréquence (Hz)", "accélération (m/s²)"), ("Frequence [Hz]", "deplacement [mm]")])  # fmt: skip  # noqa: E501
def test_french_headers(truth, tmp_path, imported, name, motion):
    path = tmp_path / "a.csv"
    rows = zip(truth.f, truth.amplitude, strict=True)
    path.write_text(f"{name};force (N);{motion}\n" + "".join(f"{f:.4f};3;{a:.9f}\n".replace(".", ",") for f, a in rows))
    assert len(imported(path).record) == len(truth.f)


def test_a_rate_beside_an_array_of_times_is_refused(tmp_path):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"acc": X, "t": T})
    with pytest.raises(InputError, match="--rate beside an array of times"):
        read_file(path, Stated(columns={"response": "acc", "time": "t"}, rate=RATE, **SIGNAL))
