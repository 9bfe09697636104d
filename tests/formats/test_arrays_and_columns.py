"""MAT, HDF5 and CSV files written by the libraries that people use are read back; so are lock-in readings."""

from __future__ import annotations

import subprocess
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest
import scipy.io

from damping.errors import InputError
from damping.formats import read_file
from damping.formats.arrays import read_arrays
from damping.formats.series import Stated
from tests.files import write_csv, write_hdf5

SI = {"units": {"response": "m/N", "force": "N"}, "response": "receptance"}
#: Roundings of a few operations in double precision.
CLOSE = 1e-13


def close(record, truth) -> None:
    np.testing.assert_allclose(record.column("frequency"), truth.f, rtol=CLOSE)
    np.testing.assert_allclose(record.column("amplitude"), truth.amplitude, rtol=CLOSE)
    np.testing.assert_allclose(record.column("phase"), truth.lag, rtol=0, atol=CLOSE)


def mat73(path: Path, **variables: np.ndarray) -> Path:
    """A MAT file of version 7.3 as MATLAB writes it: HDF5 behind a text of 512 bytes, axes reversed, compounds."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in variables.items():
            values = np.atleast_2d(values).T
            if np.iscomplexobj(values):
                pair = np.empty(values.shape, dtype=[("real", "<f8"), ("imag", "<f8")])
                pair["real"], pair["imag"] = values.real, values.imag
                values = pair
            file.create_dataset(name, data=values).attrs["MATLAB_class"] = np.bytes_("double")
    text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, HDF5 schema 1.00 .".ljust(116) + bytes(8) + b"\x00\x02IM"
    with path.open("r+b") as stream:
        stream.write(text)
    return path


@pytest.mark.parametrize("compressed", [True, False])
def test_mat_of_version_5(truth, tmp_path, imported, compressed):
    """Arrays, and fields of a structure."""
    path, structure = tmp_path / "a.mat", {"f": truth.f, "frf": {"H11": truth.H}}
    contents = {"f": truth.f, "frf": truth.H, "note": "text", "c": {"a": 1}, "test": structure}
    scipy.io.savemat(path, contents, do_compression=compressed)
    for frequency, response in (("f", "frf"), ("test.f", "test.frf.H11")):
        found = imported(path, columns={"frequency": frequency, "response": response}, forces=(truth.F,), **SI)
        close(found.record, truth)
        assert ("format", "MAT file, version 5", "found in the file") in found.summary.rows


def test_mat_of_version_73(truth, tmp_path, imported):
    path = mat73(tmp_path / "a.mat", f=truth.f, frf=truth.H)
    found = imported(path, columns={"frequency": "f", "response": "frf"}, forces=(truth.F,), **SI)
    close(found.record, truth)
    assert ("format", "MAT file, version 7.3", "found in the file") in found.summary.rows


@pytest.mark.parametrize(
    "options", [{}, {"compression": "gzip", "shuffle": True, "chunks": (7,)}, {"compression": "lzf"}]
)
def test_hdf5_packed_or_not_is_read(truth, tmp_path, imported, options):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("run/f", data=truth.f, **options)
        file.create_dataset("run/frf", data=truth.H, **options)
    found = imported(path, columns={"frequency": "run/f", "response": "/run/frf"}, forces=(truth.F,), **SI)
    close(found.record, truth)


def test_units_in_attributes_of_hdf5(truth, tmp_path, imported):
    """Of either name, text or bytes."""
    path = write_hdf5(tmp_path / "a.h5", {"frequency": truth.f, "response": (1e3 * truth.H, "mm/N"), "force": truth.F})
    with h5py.File(path, "a") as file:
        file["force"].attrs["unit"] = np.bytes_("N")
    found = imported(path, scaling="peak")
    close(found.record, truth)
    assert ("response", "receptance", "follows from its unit") in found.summary.rows


@pytest.mark.parametrize(("unit", "times"), [("mm rms", 1e3 / np.sqrt(2.0)), ("mm p-p", 2e3), ("mm", 1e3)])
def test_scalings_in_the_units_of_arrays(truth, tmp_path, imported, unit, times):
    """A force in N pk beside it is of its own."""
    values = {"frequency": truth.f, "amplitude": (times * truth.amplitude, unit), "force": (3.0, "N pk")}
    found = imported(write_hdf5(tmp_path / "a.h5", values))
    np.testing.assert_allclose(found.record.column("amplitude"), truth.amplitude, rtol=1e-12)
    np.testing.assert_array_equal(found.record.column("force"), 3.0)
    found = imported(write_hdf5(tmp_path / "a.h5", values | {"force": (3.0, "N")}))
    assert any("the force is taken as peak" in note for note in found.summary.notes) == (unit != "mm")


def hdf5(path: Path, **variables: np.ndarray) -> Path:
    return write_hdf5(path, variables)


def mat5(path: Path, **variables: np.ndarray) -> Path:
    scipy.io.savemat(path, variables)
    return path


@pytest.mark.parametrize("name", ["time", "t"])
def test_the_unit_of_times_beside_a_named_signal(tmp_path, name):
    """Times that are found by their name, of the role or a usual one, were taken for seconds whatever their unit."""
    ms = np.arange(50.0)
    path = write_hdf5(tmp_path / "a.h5", {"acc": np.sin(ms), name: (ms, "ms")})
    (series,), _ = read_file(path, Stated(columns={"response": "acc"}))
    np.testing.assert_allclose(series.abscissa, 1e-3 * ms, rtol=1e-15, atol=0.0)


@pytest.mark.parametrize(
    ("name", "number", "unit"), [("dt", 5.0, "ms"), ("fs", 0.2, "kHz"), ("fs", 200.0, "samples/s")]
)
def test_the_unit_of_a_step_or_rate(tmp_path, name, number, unit):
    path = write_hdf5(tmp_path / "a.h5", {"response": np.sin(np.arange(50.0)), name: (number, unit)})
    (series,), _ = read_file(path, Stated())
    np.testing.assert_allclose(series.abscissa, 0.005 * np.arange(50), rtol=1e-12, atol=0.0)


@pytest.mark.parametrize("write", [mat5, mat73, hdf5])
def test_columns_under_one_force_may_be_sensors(truth, tmp_path, imported, write):
    """Two sensors became sweeps of one, whose amplitudes differ under the same force, without a word."""
    H = np.column_stack([truth.H, 0.8 * truth.H])
    path = write(tmp_path / "a.dat", frequency=truth.f, response=H, force=np.full(len(truth.f), 2.0))
    notes = imported(path, scaling="peak", **SI).summary.notes
    assert any("of several sensors keep one (--column 'response=NAME(:,1)')" in note for note in notes)
    with pytest.raises(InputError, match="or --column force=NAME"):  # named columns alone are read
        imported(path, scaling="peak", columns={"response": "response(:,1)"}, **SI)
    kept = imported(path, scaling="peak", columns={"response": "response(:,1)", "force": "force"}, **SI)
    np.testing.assert_allclose(kept.record.column("amplitude"), 2.0 * np.abs(truth.H), rtol=CLOSE)


@pytest.mark.parametrize("turned", [False, True])
def test_a_column_a_sweep(truth, tmp_path, imported, turned):
    path = tmp_path / "a.mat"
    H = np.column_stack([truth.H, 2 * truth.H, 3 * truth.H])
    scipy.io.savemat(path, {"frequency": truth.f, "response": H.T if turned else H, "force": [1.0, 2.0, 4.0]})
    read = imported(path, labels=("a", "b", "c"), scaling="peak", **SI)
    found = read.record
    assert found.sweeps == ("a", "b", "c")
    assert not any("of several sensors" in note for note in read.summary.notes)
    for k, label in enumerate(found.sweeps):
        one = found.of(label)
        np.testing.assert_allclose(one.column("amplitude"), np.abs(truth.H) * (k + 1) * 2.0**k, rtol=CLOSE)
        np.testing.assert_allclose(one.column("force"), 2.0**k, rtol=CLOSE)


def test_names_of_roles_need_no_map_and_others_do(truth, tmp_path, imported):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"omega": 2 * np.pi * truth.f, "real": truth.H.real, "imag": truth.H.imag, "force": truth.F})
    close(imported(path, scaling="peak", **SI).record, truth)
    scipy.io.savemat(path, {"f1": truth.f, "h1": truth.H})
    said = r"no array has the name of a role; expected --column ROLE=NAME; it has f1 \(1 x 41\)"
    with pytest.raises(InputError, match=said):
        imported(path, **SI)
    with pytest.raises(InputError, match=r"no array 'h2'; expected f1 \(1 x 41\), h1 \(1 x 41\)"):
        imported(path, columns={"frequency": "f1", "response": "h2"}, **SI)


@pytest.mark.parametrize("name", ["freq", "Frequency", "f"])
def test_usual_names_of_an_abscissa_need_no_map(truth, tmp_path, imported, name):
    """Beside a force F, which is told from f, and a rate of sampling, which says nothing of spectra."""
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {name: truth.f, "frf": truth.H, "F": 3.0 * truth.f, "fs": 1000.0})
    close(imported(path, columns={"response": "frf"}, forces=(truth.F,), **SI).record, truth)
    stated = {"columns": {"response": "frf"}, "forces": (truth.F / 2**0.5,), "force_scaling": "rms"}
    close(imported(path, **stated, **SI).record, truth)  # it was passed over


def test_csv_with_a_column_map(truth, tmp_path, imported):
    """Amplitude of acceleration in g and its lead in degrees, by level, semicolons, lines before the header."""
    w = 2 * np.pi * truth.f
    H = -(w**2) * truth.H
    table = {"Run": "r1", "Freq [Hz]": truth.f, "Acc [g]": np.abs(H) * truth.F / 9.80665}
    path = write_csv(
        tmp_path / "a.csv", table | {"Phase (deg)": np.degrees(np.angle(H)), "Drive [N]": truth.F}, sep=";"
    )
    path.write_text("made by a rig\nat noon\n" + path.read_text())
    columns = {"sweep": "Run", "frequency": "Freq", "amplitude": "Acc", "lead_deg": "Phase", "force": "Drive [N]"}
    stated = {"columns": columns, "delimiter": "semicolon", "skip": 2}
    found = imported(path, response="acceleration", **stated)
    close(found.record, truth)
    assert found.record.sweeps == ("r1",)
    assert ("unit of response", "g", "found in the file") in found.summary.rows
    assert ("column 'Acc [g]'", "amplitude: amplitude of the response", "stated") in found.summary.rows
    rms = imported(path, response="acceleration", scaling="rms", **stated).record
    np.testing.assert_allclose(rms.column("amplitude"), truth.amplitude * 2**0.5, rtol=CLOSE)
    # 'g' is the unit of an acceleration and of nothing else here
    assert ("response", "acceleration", "follows from its unit") in imported(path, **stated).summary.rows


def test_decimal_commas(truth, tmp_path, imported):
    """As German and French spreadsheets write: semicolons between cells, commas in numbers."""
    table = pd.DataFrame({"frequency": truth.f, "amplitude": truth.amplitude, "force": truth.F})
    path = tmp_path / "a.csv"
    table.to_csv(path, index=False, sep=";", decimal=",")
    stated = {"response": "displacement", "consistent": True, "delimiter": "semicolon"}
    record = imported(path, decimal="comma", **stated).record
    np.testing.assert_array_equal(record.column("amplitude"), truth.amplitude)  # digits are kept, only the mark differs
    with pytest.raises(InputError, match=r"is --decimal comma meant\?\).*a number with a decimal point"):
        imported(path, decimal="point", **stated)
    found = imported(path, response="displacement", consistent=True).record  # both marks are seen in the lines
    np.testing.assert_array_equal(found.column("amplitude"), truth.amplitude)
    table.to_csv(path, index=False, sep=";")
    with pytest.raises(InputError, match=r"is --decimal point meant"):
        imported(path, decimal="comma", **stated)
    path.write_text("frequency;amplitude;force\n1.234,5;1;1\n")
    assert imported(path, decimal="comma", **stated).record.column("frequency") == 1234.5
    with pytest.raises(InputError, match=r"'1\.234,5' is not a number;") as caught:
        imported(path, decimal="point", **stated)
    assert "meant" not in caught.value.message
    path.write_text("frequency;amplitude;force\n1.234;0,5;1\n")
    with pytest.raises(InputError, match=r"'1\.234' is not a number .*without marks between thousands"):
        imported(path, decimal="comma", **stated)
    with pytest.raises(InputError, match="--decimal comma beside --delimiter comma"):
        imported(path, decimal="comma", delimiter="comma", response="displacement", consistent=True)


def test_statements_that_nothing_heeds_are_refused(tmp_path, imported):
    table, universal, array = tmp_path / "a.csv", tmp_path / "a.uff", tmp_path / "a.mat"
    table.write_text("frequency,amplitude,force\n1,2,3\n")
    universal.write_text("    -1\n    58\n")
    scipy.io.savemat(array, {"frequency": [1.0], "amplitude": [2.0], "force": [3.0]})
    for path, given, option, kind in (
        (table, {"datasets": (1,)}, "--dataset", "csv"),
        (universal, {"columns": {"force": "F"}}, "--column", "uff"),
        (universal, {"skip": 2}, "--skip", "uff"),
        (array, {"skip": 2}, "--skip", "mat5"),
    ):
        said = f"{option} means nothing in a file of format {kind}; expected no {option}"
        with pytest.raises(InputError, match=said):
            imported(path, response="displacement", consistent=True, **given)


def test_line_ends_of_any_system(tmp_path, imported):
    (tmp_path / "a.csv").write_bytes(b"frequency,amplitude,force\r1,2,3\r1.5,4,5\r")
    found = imported(tmp_path / "a.csv", response="displacement", consistent=True).record
    np.testing.assert_array_equal(found.column("amplitude"), [2.0, 4.0])


def test_csv_without_phases(truth, tmp_path, imported):
    columns = {"frequency": truth.f, "amplitude": truth.amplitude, "force": truth.F}
    found = imported(write_csv(tmp_path / "a.csv", columns), response="displacement", consistent=True)
    assert not found.record.has_phase
    assert any("no phases" in note for note in found.summary.notes)


def test_negative_parts_of_a_force_are_no_amplitudes(truth, tmp_path, imported):
    path = tmp_path / "a.mat"
    parts = {"force_x": -truth.F * np.ones_like(truth.f), "force_y": 0 * truth.f}
    whole = {"frequency": truth.f, "real": -truth.H.real * truth.F, "imag": -truth.H.imag * truth.F}
    scipy.io.savemat(path, whole | parts)
    close(imported(path, response="displacement", consistent=True, scaling="peak").record, truth)
    scipy.io.savemat(path, whole | {"force": (-truth.F + 0j) * np.ones_like(truth.f)})
    close(imported(path, response="displacement", consistent=True, scaling="peak").record, truth)
    scipy.io.savemat(path, {"frequency": truth.f, "response": np.column_stack([truth.H] * 2), "force": [1.0, -4.0]})
    with pytest.raises(InputError, match="force -4 in row 1 of sweep 2"):
        imported(path, scaling="peak", **SI)


def test_rows_left_out_are_counted_by_reason(tmp_path, imported):
    path = tmp_path / "a.csv"
    rows = ["1,1,1", "0,1,1", "-1,1,1", "2,nan,1", "3,,1", "inf,1,1", "4,1,NA", "5,0,1", "6,1,0", "nan,nan,nan"]
    stated = {"response": "displacement", "consistent": True}
    path.write_text("\n".join(["frequency,amplitude,force", *rows]) + "\n")
    counts = (
        "1 at 0 Hz, 3 without a frequency > 0, 2 with no finite response, 1 with no finite force, "
        "1 with a response of 0, 1 with a force of 0"
    )
    found = imported(path, **stated)
    assert len(found.record) == 1
    assert f"9 rows of 'a' left out: {counts}" in found.summary.notes
    path.write_text("\n".join(["frequency,amplitude,force", *rows[1:]]) + "\n")
    with pytest.raises(InputError) as caught:
        imported(path, **stated)
    assert caught.value.message == f"no row of 'a' is a steady state: of 9, {counts}"
    path.write_text("frequency,amplitude,force\n1,1,1\n2,nan,1\n")
    with pytest.raises(InputError) as caught:
        imported(path, band=(5.0, 6.0), **stated)
    assert caught.value.message == "no row of 'a' is a steady state within 5 to 6 Hz: of 2, 1 with no finite response"


def test_standard_uncertainties_and_energies_are_converted(truth, tmp_path, imported):
    path = tmp_path / "a.csv"
    w = 2 * np.pi * truth.f
    acceleration = truth.amplitude * w**2
    energy = np.pi * truth.F * truth.amplitude * np.sin(truth.lag)
    # the lag of an acceleration is pi less than that of its displacement
    table = {"frequency": truth.f, "amplitude": acceleration, "lag_deg": np.degrees(truth.lag) - 180.0}
    table |= {"amplitude_sd": 0.01 * acceleration, "force": truth.F, "force_sd": 0.02 * truth.F}
    write_csv(path, table | {"energy": energy, "mass": 2.0})
    units = {"response": "m/s^2", "force": "N", "energy": "J", "mass": "kg"}
    found = imported(path, response="acceleration", units=units).record
    close(found, truth)
    np.testing.assert_allclose(found.column("amplitude_sd"), 0.01 * truth.amplitude, rtol=CLOSE)
    us = imported(path, response="acceleration", units=units, system="us").record
    # 1 lbf = 4.4482216152605 N and 1 in = 0.0254 m by definition; mass lbf s^2/in
    np.testing.assert_allclose(us.column("energy"), energy / (4.4482216152605 * 0.0254), rtol=CLOSE)
    np.testing.assert_allclose(us.column("mass"), 2.0 * 0.0254 / 4.4482216152605, rtol=CLOSE)
    np.testing.assert_allclose(us.column("force_sd"), 0.02 * truth.F / 4.4482216152605, rtol=CLOSE)
    with pytest.raises(InputError, match="unit of mass is neither"):
        imported(path, response="acceleration", units={k: v for k, v in units.items() if k != "mass"})


def test_lock_in_readings(truth, tmp_path, imported):
    """X and Y in volts rms at 100 mV per m/s^2, R and theta beside them; the drive as the reference."""
    w = 2 * np.pi * truth.f
    volts = -(w**2) * truth.H * truth.F / 2**0.5 * 0.1
    table = {"Frequency (Hz)": truth.f, "X (V)": volts.real, "Y (V)": volts.imag, "R (V)": np.abs(volts)}
    table["Theta"] = np.degrees(np.angle(volts))
    path = write_csv(tmp_path / "sweep.txt", table, sep="\t")
    stated = {"format": "lock-in", "delimiter": "tab", "response": "acceleration", "forces": (truth.F,)}
    stated |= {"units": {"response": "m/s^2", "force": "N"}, "scale": {"response": 10.0}}
    found = imported(path, scaling="rms", **stated)
    close(found.record, truth)
    with pytest.raises(InputError, match="peak or rms is neither"):
        imported(path, **stated)
    with pytest.raises(InputError, match="unit of response 'V' is not understood"):
        imported(path, **(stated | {"units": {"force": "N"}, "scaling": "rms"}))


def test_two_lock_in_channels(truth, tmp_path, imported):
    """Response and force against one reference: their phases are subtracted."""
    drive = truth.F * np.exp(-0.4j)
    motion = truth.H * drive
    table = {"f": truth.f, "X": motion.real, "Y": motion.imag, "X2": drive.real, "Y2": drive.imag}
    path = write_csv(tmp_path / "sweep.csv", table)
    found = imported(path, format="lock-in", response="displacement", consistent=True, scaling="peak").record
    close(found, truth)
    np.testing.assert_allclose(found.column("force"), truth.F, rtol=CLOSE)


@pytest.mark.parametrize("columns", [{}, {"y": "y"}])
@pytest.mark.parametrize("write", [mat5, hdf5])
def test_an_imaginary_part_alone_is_no_response(tmp_path, imported, write, columns):
    path = write(tmp_path / "a.dat", a=np.arange(9.0), y=np.arange(9.0))
    with pytest.raises(InputError, match=r"which column is the response\? a, y; expected --column response=NAME"):
        imported(path, columns=columns, rate=100.0)


@pytest.mark.parametrize(
    ("content", "columns", "message"),
    [
        ("a,b\n1,2\n", {"frequency": "f"}, r"line 1: no column 'f'; expected one of a, b"),
        ("freq,b\n1,2\n", {"frequency": "frq"}, r"no column 'frq' \(is 'freq' meant\?\)"),
        ("f,f\n1,2\n", {"frequency": "f"}, "several columns are 'f'"),
        ("f,a\n" + 200 * "1,2\n" + "end\n", {"frequency": "f", "amplitude": "a"}, "line 202: 1 cell in the row; expe"),
        ("f,a\n1,2\n1,2,3\n", {"frequency": "f", "amplitude": "a"}, "line 3: 3 cells in the row; expected 2"),
        ("f,a\n1,x\n", {"frequency": "f", "amplitude": "a"}, "line 2, column a: 'x' is not a number"),
        ("f,a\n", {"frequency": "f", "amplitude": "a"}, "no data rows"),
        ("f,a\n1,2\n", {"frequency": "f"}, "which column is the response. a;"),
        ("g,a\n1,2\n", {"amplitude": "a"}, "no abscissa"),
        ("f,a\n1,2\n", {"frequency": "f", "omega": "f", "amplitude": "a"}, "both frequency and omega"),
        ("f,a\n1,2\n", {"frequency": "f", "x": "a"}, "x and y need each other"),
        ("f,a\n1,2\n", {"frequency": "f", "response": "a"}, "a response of real values"),
        ('f,a\n1,"2\n', {"frequency": "f", "amplitude": "a"}, "a quote that is opened"),
        ("f,a\n1,2\n1,2\n", {"frequency": "f", "amplitude": "a"}, "has a row twice, at 1 Hz"),
        ("f,a\n1,1e60\n", {"frequency": "f", "amplitude": "a"}, "a magnitude of 1e-50 to 1e"),
        ("f,a\n1,\n2,nan\n", {"frequency": "f", "amplitude": "a"}, "no row of 'a' is a steady state"),
        (
            "f,a\n1,1\n2,-0.5\n",
            {"frequency": "f", "amplitude": "a"},
            "amplitude -0.5 in row 2; expected amplitude >= 0",
        ),
        ("frequency,amplitude,phase\n1,-3,0.5\n", {}, "amplitude -3 in row 1; expected amplitude >= 0"),
        ("frequency,amplitude\n\u0661,2\n", {}, "is not a number"),
    ],
)
def test_bad_columns_are_named(tmp_path, imported, content, columns, message):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        imported(path, columns=columns, response="displacement", consistent=True, forces=(1.0,))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("frequency,amplitude,force\n1,1,1\n2,1,-2\n", "force -2 in row 2; expected force >= 0"),
        ("frequency,real,imag,force\n1,1,1,-2\n", "force -2 in row 1"),
        (
            "frequency,force,amplitude,force\n1,2,3,4\n",
            "line 1: several columns are 'force'; expected one, or --column",
        ),
    ],
)
def test_bad_forces_are_named(tmp_path, imported, content, message):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        imported(path, response="displacement", consistent=True, scaling="peak")


@pytest.mark.parametrize(
    ("mark", "stated", "hint"),
    [(";", "comma", "semicolon"), ("\t", "comma", "tab"), (",", "tab", "comma"), ("; ", "tab", "semicolon")],
)
def test_another_delimiter_is_hinted_at(tmp_path, imported, mark, stated, hint):
    path = tmp_path / "a.csv"
    path.write_text(mark.join(["frequency", "amplitude", "force"]) + "\n" + mark.join("123") + "\n")
    said = rf"\(is --delimiter {hint} meant\?\); expected"
    with pytest.raises(InputError, match="no column has the name of a role " + said):
        imported(path, delimiter=stated)
    with pytest.raises(InputError, match="no column 'frequency' " + said):
        imported(path, columns={"frequency": "frequency"}, delimiter=stated)
    path.write_text("one\n1\n")
    with pytest.raises(InputError, match="no column has the name of a role; expected"):
        imported(path)


def test_what_is_of_no_format(tmp_path, imported):
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"frequency": np.arange(5.0), "amplitude": np.arange(5.0)}, format="4")
    version_4 = path.read_bytes()
    for content in (version_4, np.random.default_rng(1).bytes(3000), b"PK\x03\x04" + bytes(100)):
        path.write_bytes(content)
        said = r"a\.mat: neither UFF, MAT 5 to 7\.3, HDF5, TDMS, LVM nor text; expected .*-v7"
        with pytest.raises(InputError, match=said):
            imported(path)
    path.write_bytes(b"frequency,amplitude \xff\x81\n1,2\n")  # 0x81 is no character of Windows-1252 either
    with pytest.raises(InputError, match="line 1: byte 0xff"):
        imported(path)


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        ({"format": "uf"}, r"--format 'uf' is unknown \(is 'uff' meant\?\)"),
        ({"response": "accelerence"}, r"is 'accelerance' meant\?"),
        ({"scaling": "RMS!"}, "--scaling"),
        ({"columns": {"freqency": "a"}}, r"is 'frequency' meant\?"),
        ({"units": {"lenght": "m"}}, "--unit 'lenght' is unknown"),
        ({"units": {"force": "N"}, "consistent": True}, "--consistent beside --unit"),
        ({"band": (3.0, 2.0)}, "--band is no band"),
        ({"system": "cgs"}, "expected si, us"),
    ],
)
def test_statements_are_checked_first(tmp_path, stated, message):
    with pytest.raises(InputError, match=message):
        read_file(tmp_path / "there is no such file", Stated(**stated))


def test_what_is_no_array_of_numbers(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["text"] = "words"
        file["objects"] = np.array([b"a", b"bc"], dtype=h5py.string_dtype())
        file["reference"] = np.array([file["text"].ref], dtype=h5py.ref_dtype)
        file["table"] = np.zeros(3, dtype=[("a", "f8"), ("b", "f8")])
    for name in ("text", "objects", "reference", "table"):
        with pytest.raises(InputError, match="no array of numbers"):
            read_arrays(path, "hdf5", [name], 10**6)


def test_nothing_outside_the_file_is_read(tmp_path):
    """External and virtual data, external and soft links: a file must not make us read another one."""
    secret = tmp_path / "secret"
    secret.write_bytes(np.arange(4.0).tobytes())
    other = write_hdf5(tmp_path / "other.h5", {"x": np.arange(4.0)})
    path = tmp_path / "a.h5"
    layout = h5py.VirtualLayout(shape=(4,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(other), "x", shape=(4,))
    with h5py.File(path, "w") as file:
        file.create_dataset("external", shape=(4,), dtype="f8", external=[(str(secret), 0, 32)])
        file.create_virtual_dataset("virtual", layout)
        file["link"] = h5py.ExternalLink(str(other), "x")
    for name in ("external", "virtual"):
        with pytest.raises(InputError, match="outside the file"):
            read_arrays(path, "hdf5", [name], 10**6)
    found = read_arrays(path, "hdf5", ["link"], 10**6)
    assert not found.arrays
    assert "link" not in found.known


def test_arrays_larger_than_the_file_warrants(tmp_path):
    """A few kilobytes that unpack to gigabytes."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("huge", shape=(10**12,), dtype="f8", chunks=(10**6,), compression="gzip")
    with pytest.raises(InputError, match="larger than the file warrants"):
        read_arrays(path, "hdf5", ["huge"], 10**9)
    mat = tmp_path / "a.mat"
    scipy.io.savemat(mat, {"zeros": np.zeros(10**7)}, do_compression=True)
    assert mat.stat().st_size < 10**6
    with pytest.raises(InputError, match="than its size warrants"):  # the limit on the memory of the reader
        read_arrays(mat, "mat5", ["zeros"], 10**9)


def test_what_is_no_file(tmp_path, imported):
    import os

    os.mkfifo(tmp_path / "pipe")
    for name, message in (("none", "no such file"), (".", "is a folder"), ("pipe", "no regular file")):
        with pytest.raises(InputError, match=message):
            imported(tmp_path / name)


def test_a_process_of_its_own_reads_a_file_and_is_given_up(tmp_path, monkeypatch):
    """Every other test reads by children of one process; here the start itself, and its end, are tested."""
    monkeypatch.setattr("damping.formats.arrays.subprocess", subprocess)
    path = tmp_path / "a.h5"
    write_hdf5(path, {"x": [1.0, 2.0]})
    assert read_arrays(path, "hdf5", ["x"], 10_000).arrays["x"][0].tolist() == [1.0, 2.0]
    monkeypatch.setattr("damping.formats.arrays.LONGEST", 0.01)
    with pytest.raises(InputError, match="not read within"):
        read_arrays(path, "hdf5", ["x"], 10_000)
