"""Files as laboratories have them: each the right record, or one line that names the remedy."""

from __future__ import annotations

from dataclasses import replace

import netCDF4
import numpy as np
import pandas as pd
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter
from scipy.io import wavfile

from damping.campaign import analyse
from damping.errors import InputError
from damping.formats import read_file
from damping.formats.headers import ROLES, parse_header, refuse_decibels
from damping.formats.motions import time_histories
from damping.formats.series import Stated, Summary
from damping_pipelines.commands import import_
from tests.files import write_csv, write_hdf5

CLOSE = 1e-5  # six printed digits
FORCES = (0.5, 1.2, 2.6)


def write_lines(path, lines):
    path.write_text("\n".join(lines) + "\n")
    return path


def close(record, truth, forces=FORCES):
    """The record holds the mode at each force, one sweep each."""
    assert len(record.sweeps) == len(forces)
    for sweep, force in zip(record.sweeps, forces, strict=True):
        rows = record.table[record.table["sweep"].astype(str) == sweep]
        np.testing.assert_allclose(rows["force"], force, rtol=CLOSE)
        np.testing.assert_allclose(rows["amplitude"], np.abs(truth.H) * force, rtol=CLOSE)
        if "phase" in rows:
            np.testing.assert_allclose(rows["phase"], truth.lag, atol=1e-4)  # degrees to three digits


@pytest.mark.parametrize(
    "hertz",
    [(31.7, 31.7, 31.7, 31.7), (31.72, 31.70, 31.69, 31.66), (31.70, 31.71, 31.69, 31.70)],
    ids=["one frequency", "falling", "scattered"],
)
def test_resonances_of_unlabelled_levels_are_a_sweep_each(tmp_path, imported, hertz):
    """They were taken for one sweep, of which the largest row alone was used, or refused as mixed levels."""
    forces, motions = (2.0, 4.0, 8.0, 16.0), (1.402, 2.486, 4.212, 6.835)
    rows = zip(hertz, forces, motions, strict=True)
    lines = ["Freq (Hz),Force (N),Disp (mm)", *(f"{f},{F},{A}" for f, F, A in rows)]
    record, summary = imported(write_lines(tmp_path / "peaks.csv", lines))
    assert list(record.sweeps) == [f"peaks {k}" for k in (1, 2, 3, 4)]
    np.testing.assert_allclose(record.table["force"], forces)
    np.testing.assert_allclose(record.table["amplitude"], np.array(motions) * 1e-3)
    assert any("are a sweep each" in note for note in summary.notes)


@pytest.mark.parametrize("force", [lambda f: f**2, lambda f: np.full(len(f), 2.0)], ids=["unbalance", "held"])
def test_a_short_sweep_up_a_flank_stays_one(truth, tmp_path, imported, force):
    """The force of an unbalance grows with its frequency, and the response with it."""
    f, H = truth.f[10:18:2], np.abs(truth.H[10:18:2])
    lines = [
        "Freq (Hz),Force (N),Disp (m)",
        *(f"{a},{F:.6g},{F * b:.6g}" for a, b, F in zip(f, H, force(f), strict=True)),
    ]
    assert imported(write_lines(tmp_path / "flank.csv", lines)).record.sweeps == ("flank",)


@pytest.fixture(scope="session")
def levels(truth):
    """The mode under three forces, one sweep below the other."""
    of = [np.tile(values, len(FORCES)) for values in (truth.f, truth.H)]
    return replace(truth, f=of[0], H=of[1], F=np.repeat(FORCES, len(truth.f)))


def test_rows_in_no_order_are_sorted_by_their_force(truth, levels, tmp_path, imported):
    """The sweeps of the shuffled table are those of the table in order; forces are held to a per cent."""
    force = levels.F * (1.0 + 0.01 * np.cos(np.tile(np.arange(len(truth.f)), len(FORCES))))
    rows = pd.DataFrame({"frequency": levels.f, "force": force, "displacement": levels.amplitude})
    path = write_csv(tmp_path / "a.csv", rows.sample(frac=1.0, random_state=1))
    read = imported(path, units={"response": "m", "force": "N"}, scaling="peak").record.frame
    assert read["sweep"].nunique() == len(FORCES)
    for _, sweep in read.groupby("sweep"):
        np.testing.assert_allclose(np.sort(sweep["frequency"]), truth.f, rtol=CLOSE)
        assert np.ptp(np.log(sweep["force"])) < 0.03


def test_structures_and_cells(truth, tmp_path, imported):
    run = np.zeros((1, 3), dtype=[("freq", "O"), ("force", "O"), ("disp", "O")])
    cells = np.empty((3, 3), dtype=object)
    for k, force in enumerate(FORCES):
        run[0, k] = (truth.f[:, None], np.full((len(truth.f), 1), force), 1e3 * force * truth.H[:, None])
        cells[k] = [force, truth.f[:, None], 1e3 * force * truth.H[:, None]]
    path = tmp_path / "a.mat"
    scipy.io.savemat(path, {"Test": {"Run": run}, "runs": cells})
    stated = {"units": {"response": "mm", "force": "N"}, "scaling": "peak"}
    names = {"frequency": "Test.Run.freq", "response": "Test.Run.disp", "force": "Test.Run.force"}
    close(imported(path, columns=names, **stated).record, truth)
    second = {role: name.replace("Run", "Run(2)") for role, name in names.items()}
    close(imported(path, columns=second, **stated).record, truth, FORCES[1:2])
    of_cells = {"frequency": "runs{:,2}", "response": "runs{:,3}", "force": "runs{:,1}"}
    close(imported(path, columns=of_cells, **stated).record, truth)
    one = {"frequency": "runs{3,2}", "response": "runs{3,3}"}
    close(imported(path, columns=one, forces=FORCES[2:], **stated).record, truth, FORCES[2:])
    with pytest.raises(InputError, match=r"Test\.Run \(1 x 3\), Test\.Run\.freq \(41 x 1\)"):
        imported(path, **stated)


def test_a_table_without_a_header(truth, levels, tmp_path, imported):
    path, response = tmp_path / "a.txt", levels.F * levels.H
    table = np.column_stack([levels.f, response.real, response.imag, levels.F])
    np.savetxt(path, table, fmt="%.9e", delimiter="  ", header="rig B\nup only", comments="% ")
    columns = {"frequency": "1", "x": "2", "y": "3", "force": "4"}
    found = imported(path, columns=columns, response="displacement", consistent=True, scaling="peak")
    close(found.record, truth)
    assert any("3 sweeps" in note for note in found.summary.notes)
    with pytest.raises(InputError, match="no header; expected --column ROLE=NUMBER of its 4 columns"):
        imported(path)
    with pytest.raises(InputError) as caught:
        imported(path, columns=columns)
    assert all(
        option in caught.value.expected for option in ("--response", "--unit response", "--unit force", "--scaling")
    )


HEADER = "Frequency [Hz],Force [N],Displacement [mm],Phase lag [°]"
BARE = "Frequency,Force,Displacement,Phase"


@pytest.mark.parametrize(
    ("header", "encoding", "said"),
    [
        ("Frequenz/Hz,Kraft / N,Auslenkung/mm,Phase/°", "utf-8", "columns by name"),
        (HEADER, "cp1252", "columns by name, text in Windows-1252"),
        (HEADER, "utf-16", "columns by name, text in UTF-16"),
        (f"Test 5 of 2024-01-05\noperator: A, B\n\n{HEADER}", "utf-8", "header in line 4, columns by name"),
        (f"{BARE}\nHz,N,mm,deg", "utf-8", "columns by name, units below the names"),
        (
            f"Rig B\n{BARE}\n[Hz],[N],[mm],[°]",
            "cp1252",
            "header in line 2, columns by name, units below the names, text in Windows-1252",
        ),
        ("f [Hz],Force [Newton],Disp [mm],Phase [deg]", "utf-8", "columns by name"),
    ],
)
def test_headers_as_recorders_write_them(truth, levels, tmp_path, imported, header, encoding, said):
    path = tmp_path / "a.csv"
    table = np.column_stack([levels.f, levels.F, 1e3 * levels.amplitude, np.degrees(levels.lag)])
    np.savetxt(path, table, delimiter=",", header=header, comments="", encoding=encoding)
    found = imported(path, columns={"lag_deg": "4", "amplitude": "3"} if "lag" in header else {})
    close(found.record, truth)
    assert ("table", f"comma between cells, decimal point, {said}", "found in the file") in found.summary.rows


def test_a_row_of_text_below_the_header_is_no_row_of_units(tmp_path, imported):
    path = tmp_path / "a.csv"
    path.write_text("frequency,amplitude,force\nHz,roof,N\n1,2,3\n2,2,3\n")
    with pytest.raises(InputError, match="line 2, column frequency: 'Hz' is not a number"):
        imported(path, response="displacement", consistent=True)


def test_the_time_of_a_row_stands_beside_its_frequency(truth, levels, tmp_path, imported):
    minutes = 0.5 * np.arange(len(levels.f))
    columns = {"Frequency [Hz]": levels.f, "Force [N]": levels.F, "Displacement [m]": levels.amplitude}
    columns |= {"Phase [deg]": -np.degrees(levels.lag), "Time [min]": minutes}
    found = imported(write_csv(tmp_path / "a.csv", columns))
    close(found.record, truth)
    np.testing.assert_allclose(found.record.table["time"], 60.0 * minutes, rtol=1e-12)
    path = tmp_path / "a.mat"  # of another length it is a history beside, and which is meant is asked
    scipy.io.savemat(path, {"frequency": truth.f, "time": np.arange(99.0), "response": truth.H})
    with pytest.raises(InputError, match="both frequency and time abscissa"):
        imported(path)


def test_a_force_by_its_name_belongs_to_a_stated_response(truth, levels, tmp_path, imported):
    columns = {"Frequency [Hz]": levels.f, "Force [N]": levels.F, "roof [m]": levels.amplitude, "floor [m]": 1.0}
    path = write_csv(tmp_path / "a.csv", columns)
    close(imported(path, columns={"amplitude": "roof"}, response="displacement").record, truth)


@pytest.mark.parametrize(("name", "number"), [("fs", 200.0), ("dt", 0.005), ("daq.SampleRate", 200.0)])
def test_a_number_says_how_a_history_was_sampled(tmp_path, name, number):
    group, _, own = name.rpartition(".")
    path, x = tmp_path / "a.mat", np.sin(np.arange(50.0))
    scipy.io.savemat(path, {"x1": x, **({group: {own: number}} if group else {own: number})})
    (series,), _ = read_file(path, Stated(columns={"response": "x1"}))
    assert series.is_time
    np.testing.assert_allclose(series.abscissa, 0.005 * np.arange(50), rtol=1e-12)
    np.testing.assert_array_equal(series.response, x)
    scipy.io.savemat(path, {"x1": x, "fs": 0.0})
    with pytest.raises(InputError, match="fs = 0; expected a rate in Hz"):
        read_file(path, Stated(columns={"response": "x1"}))


@pytest.mark.parametrize(
    ("header", "of_lag", "order"),
    [
        ("Phase (deg)", np.degrees, 0),
        ("Phase [deg]", lambda lag: -np.degrees(lag), 0),
        ("phase", lambda lag: -lag, 0),
        ("Phase A/F [deg]", lambda lag: 180.0 - np.degrees(lag), 2),
    ],
)
def test_lead_and_lag_by_the_turn(truth, levels, tmp_path, imported, header, of_lag, order):
    motion = levels.amplitude * (2 * np.pi * levels.f) ** order
    columns = {"Freq [Hz]": levels.f, "F [N]": levels.F, "A [m/s^2]" if order else "Displacement [m]": motion}
    close(imported(write_csv(tmp_path / "a.csv", columns | {header: of_lag(levels.lag)})).record, truth)


def test_noise_of_the_tails_does_not_turn_the_phase_of_a_velocity(tmp_path, imported):
    """Read as lead or as lag a velocity absorbs energy: its turn alone decides, also with noise of 8 % of the peak.

    Of twenty sweeps of one mode of 1 % damping the turn is -1.4 with a standard deviation of 0.13.
    """
    f = np.linspace(14.0, 23.0, 120)
    w, w_n = 2 * np.pi * f, 2 * np.pi * 18.0
    v = 1j * w / (w_n**2 - w**2 + 0.02j * w_n * w)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        read = v / np.max(np.abs(v)) + 0.08 * (rng.normal(size=len(f)) + 1j * rng.normal(size=len(f)))
        angle = np.degrees(np.angle(read))
        columns = {"Hz": f, "Force [N]": 1.0, "Velocity [m/s]": np.abs(read), "Phase [deg]": angle}
        summary = imported(write_csv(tmp_path / "a.csv", columns)).summary
        assert ("phase", "a lead of the response") in [row[:2] for row in summary.rows]


def test_one_column_of_phases_has_one_sense(truth, tmp_path, imported):
    """Two sweeps that turn opposite ways in one column: one of them is misread, or not of a passive structure."""
    phase = np.degrees(truth.lag)
    whole = {"sweep": ["a"] * len(truth.f) + ["b"] * len(truth.f), "frequency [Hz]": np.tile(truth.f, 2)}
    whole |= {"force [N]": truth.F, "disp [m]": np.tile(truth.amplitude, 2)}
    path = write_csv(tmp_path / "a.csv", whole | {"phase [deg]": [*phase, *phase]})
    assert len(imported(path).record) == 2 * len(truth.f)
    write_csv(path, whole | {"phase [deg]": [*phase, *-phase]})
    with pytest.raises(InputError, match="the phase of 'b' is a lead of the response, unlike that of sweeps before it"):
        imported(path)


def test_an_angle_said_to_be_in_rad_is_none_in_degrees(truth, levels, tmp_path, imported):
    columns = {"Freq [Hz]": levels.f, "F [N]": levels.F, "Displacement [m]": levels.amplitude}
    path = write_csv(tmp_path / "a.csv", columns | {"Phase (rad)": np.degrees(levels.lag)})
    with pytest.raises(InputError, match=r"angle in rad up to 1\d\d.*expected at most 2 pi, or --column lag_deg=NAME"):
        imported(path)
    taken = imported(write_csv(path, columns | {"Phase (rad)": levels.lag}))
    close(taken.record, truth)
    assert ("unit of angle", "rad", "found in the file") in taken.summary.rows


def test_a_force_that_sags_in_its_last_digit_begins_no_sweep(truth, tmp_path, imported):
    """Up at one force, that gives way near resonance, and down again at another."""
    up = np.where(np.abs(truth.f - 10.0) < 0.3, 2.9, 3.0)
    force, f, H = np.concatenate([up, 0.0 * up + 6.0]), *(np.concatenate([x, x[::-1]]) for x in (truth.f, truth.H))
    table = {"frequency": f, "force [N]": force, "amplitude [mm]": 1e3 * force * np.abs(H), "phase": -np.angle(H)}
    record = imported(write_csv(tmp_path / "a.csv", table)).record
    assert [len(record.of(label)) for label in record.sweeps] == [len(up), len(up)]


def test_a_row_taken_again_is_of_its_sweep(truth, tmp_path, imported):
    """Its force differs in the last digit; that of the next level, at the same frequency, differs by more."""
    n, again = len(truth.f), np.r_[np.arange(len(truth.f)), -1]
    for factor, rows in ((1.01, [n + 1]), (2.0, [n, 1])):
        force = np.r_[np.full(n, 3.0), 3.0 * factor]
        amplitude = 1e3 * force * np.abs(truth.H[again])
        table = {"frequency": truth.f[again], "force [N]": force, "amplitude [mm]": amplitude}
        record = imported(write_csv(tmp_path / "a.csv", table)).record
        assert [len(record.of(label)) for label in record.sweeps] == rows


@pytest.mark.parametrize("header", ["Lag [deg]", "Tip lag [deg]", "Nacheilung (°)"])
def test_a_lag_is_a_phase_and_what_is_not_read_is_listed(truth, levels, tmp_path, imported, header):
    columns = {"Frequency [Hz]": levels.f, "Force [N]": levels.F, "Displacement [m]": levels.amplitude}
    columns |= {"Cabin": levels.f + 273.0, header: np.degrees(levels.lag)}
    taken = imported(write_csv(tmp_path / "a.csv", columns))
    close(taken.record, truth)
    assert ("columns not read", "'Cabin'", "no known name (--column)") in taken.summary.rows


def test_each_column_is_scaled_by_its_header(truth, levels, tmp_path, imported):
    rms = levels.amplitude * (2 * np.pi * levels.f) ** 2 / 9.80665 / 2**0.5
    columns = {"Frequency [Hz]": levels.f, "Force [N pk]": levels.F, "Accel [g rms]": rms}
    close(imported(write_csv(tmp_path / "a.csv", columns)).record, truth)


@pytest.mark.parametrize(
    ("force", "motion", "said"),
    [
        ("Force [N rms]", "Accel [g]", "caution: peak assumed"),
        ("Force [N]", "Accel [g rms]", "caution: the force is taken as peak, beside a response in rms"),
        ("Force [N]", "Accel [g pk]", ""),
        ("Force [N pp]", "Accel [g pk]", ""),
    ],
)
def test_a_header_without_scaling_beside_one_with_it_gets_a_caution(levels, tmp_path, imported, force, motion, said):
    columns = {"Frequency [Hz]": levels.f, force: levels.F, motion: levels.amplitude}
    path = write_csv(tmp_path / "a.csv", columns)
    cautions = [note for note in imported(path).summary.notes if note.startswith("caution")]
    assert len(cautions) == bool(said)
    assert all(caution.startswith(said) for caution in cautions)
    stated = {"scaling": "rms", "force_scaling": "rms"}
    assert not any("caution" in note for note in imported(path, **stated).summary.notes)


@pytest.mark.parametrize(
    ("force", "motion"),
    [
        ("Force RMS [N]", "Displ RMS [mm]"),
        ("Force [N] rms", "Displacement eff. (mm)"),
        ("force N rms", "amplitude rms mm"),
        ("Kraft in N eff", "Weg_rms [mm]"),
    ],
)
def test_a_scaling_beside_the_bracket_is_heeded(truth, levels, tmp_path, imported, force, motion):
    """sqrt(2) times what is rms, wherever the header says it."""
    rms = {force: levels.F / 2**0.5, motion: 1e3 * levels.amplitude / 2**0.5}
    path = write_csv(tmp_path / "a.csv", {"Frequency [Hz]": levels.f} | rms)
    close(imported(path).record, truth)
    by_title = {"amplitude": motion.rsplit(" ", 1)[0] if "[" in motion or "(" in motion else motion, "force": force}
    stated = {"columns": by_title, "response": "displacement"}
    close(imported(path, **stated).record, truth)


def test_a_unit_after_a_blank_is_one(truth, levels, tmp_path, imported):
    columns = {"sweep": np.repeat(["a", "b", "c"], len(truth.f)), "frequency Hz": levels.f, "force mN": 1e3 * levels.F}
    columns |= {"amplitude µm": 1e6 * levels.amplitude, "phase rad": levels.lag}
    close(imported(write_csv(tmp_path / "a.csv", columns)).record, truth)


def test_one_word_of_a_name_tells_what_a_column_is(truth, levels, tmp_path, imported):
    """Where its unit agrees, and no other column could be meant: two motions, or two forces, are asked for."""
    columns = {"Excitation freq [Hz]": levels.f, "Drive force (N)": levels.F}
    columns |= {"Tip_displacement (mm)": 1e3 * levels.amplitude, "Phase (deg)": np.degrees(levels.lag)}
    path, table = tmp_path / "a.csv", pd.DataFrame(columns)
    close(imported(write_csv(path, table)).record, truth)
    # the phase of a stated amplitude is taken by its name
    write_csv(path, table.rename(columns={"Tip_displacement (mm)": "w (mm)"}))
    found = imported(path, columns={"amplitude": "w"}, response="displacement").record
    assert "phase" in found.table
    close(found, truth)
    for further, said in (("Root displacement (mm)", "which column is the response"), ("Static force (N)", "force")):
        write_csv(path, table.assign(**{further: 1.0}))
        with pytest.raises(InputError, match=said):
            imported(path)


@pytest.mark.parametrize("name", ["A", "v"])
def test_a_letter_without_a_unit_says_no_type(truth, levels, tmp_path, imported, name):
    """``A`` is an amplitude to some and an acceleration to others; its unit tells, or the user is asked."""
    path = write_csv(tmp_path / "a.csv", {"f [Hz]": levels.f, "F [N]": levels.F, name: levels.amplitude})
    with pytest.raises(InputError, match="type of the response is neither in the file nor stated; expected --response"):
        imported(path, consistent=True)
    close(imported(path, units={"response": "m"}).record, truth)


@pytest.mark.parametrize("text", ["roof N", "roof S [g]", "roof pk", "Level 1", "accel N", "rms", "phase g"])
def test_names_of_sensors_keep_their_last_word(text):
    assert parse_header(text).name == text.removesuffix(" [g]")


def test_lines_about_the_test_with_as_many_cells_as_the_table(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("Operator;A. B.\nRate;512 Hz\n\nTime;Accel\ns;g\n" + "".join(f"0,{k};{k},5\n" for k in range(9)))
    (one,) = read_file(path, Stated())[0]
    np.testing.assert_allclose(one.abscissa, 0.1 * np.arange(9), rtol=1e-12)
    np.testing.assert_allclose(one.response, np.arange(9) + 0.5, rtol=1e-12)
    assert one.facts.units["response"] == "g"


def test_rows_under_names_of_no_role_are_no_missing_rows(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("sweep,speed,load,motion\na,24,1,2\n")
    with pytest.raises(InputError, match=r"no column has the name of a role; .* it has sweep, speed, load, motion"):
        read_file(path, Stated())


def test_readings_of_an_amplifier_leave_the_drive_as_it_is(truth, levels, tmp_path, imported):
    rms = 1e6 * levels.F * levels.H / 2**0.5
    columns = {"Frequency (Hz)": levels.f, "X (um)": rms.real, "Y (um)": rms.imag, "R (um)": np.abs(rms)}
    path = write_csv(tmp_path / "a.csv", columns | {"Force (mN)": 1e3 * levels.F})
    close(imported(path, scaling="rms").record, truth)
    doubled = imported(path, scaling="rms", force_scaling="rms").record
    np.testing.assert_allclose(doubled.column("force")[0], FORCES[0] * 2**0.5, rtol=CLOSE)


@pytest.mark.parametrize(
    "headings",
    [
        ("Messung", "Frequenz [Hz]", "Kraft [N]", "Weg [mm]", "Phase [Grad]"),
        ("Lauf", "f/Hz", "F/N", "Weg/mm", "phi/°"),
        ("essai", "fréquence (Hz)", "effort (N)", "déplacement (mm)", "déphasage (°)"),
        ("ensayo", "frecuencia (Hz)", "fuerza (N)", "desplazamiento (mm)", "fase (grados)"),
        ("prova", "frequenza (Hz)", "forza (N)", "spostamento (mm)", "fase (°)"),
    ],
)
def test_headings_in_several_languages(truth, levels, tmp_path, imported, headings):
    labels = [f"L{F:g}" for F in levels.F]
    values = (labels, levels.f, levels.F, 1e3 * levels.amplitude, np.degrees(levels.lag))
    path = write_csv(tmp_path / "a.csv", dict(zip(headings, values, strict=True)), sep=";", decimal=",")
    close(imported(path).record, truth)


@pytest.mark.parametrize("exchanged", [False, True])
def test_round_responses_beside_measured_forces_are_held_or_exchanged(tmp_path, imported, exchanged):
    """Somebody chooses 4, 8, 12 N; nobody chooses 0.527 g."""
    force, a = [4.0, 8.0, 12.0], [0.527, 0.933, 1.268]
    values = (a, force) if exchanged else (force, a)
    columns = {"Run": list("abc"), "Frequency (Hz)": [25.0, 25.01, 24.99]}
    columns |= {"Force (N)": values[0], "Acceleration (g)": values[1]}
    notes = imported(write_csv(tmp_path / "levels.csv", columns)).summary.notes
    assert any("their two headings are exchanged" in note for note in notes) == exchanged


def test_positions_are_no_readings(tmp_path):
    t = np.arange(0.0, 20.0, 0.02)
    path = write_csv(tmp_path / "roll.csv", {"time": t, "x": t, "y": t, "z": t, "phi": np.cos(t)})
    with pytest.raises(InputError, match=r"which column is the response.*--column response=NAME.*--unit response"):
        read_file(path, Stated())
    silent = Stated(columns={"response": "phi"})
    with pytest.raises(InputError, match=r"the unit of 'phi', an angle by its name.*--unit response=rad or deg"):
        time_histories(*read_file(path, silent)[:1], silent, Summary())
    stated = Stated(columns={"response": "phi"}, units={"response": "rad"})
    series, summary = read_file(path, stated)
    history = time_histories(series, stated, summary)[0]
    np.testing.assert_allclose(history.signal, np.cos(t), rtol=1e-12)  # rad as it is


@pytest.mark.parametrize(("header", "of_hertz"), [("Freq [kHz]", 1e-3), ("Speed [rpm]", 60.0), ("Frequency (Hz)", 1.0)])
def test_units_of_the_abscissa(truth, levels, tmp_path, imported, header, of_hertz):
    columns = {header: of_hertz * levels.f, "F [N]": levels.F, "Disp [m]": levels.amplitude}
    path = write_csv(tmp_path / "a.csv", columns)
    stated = {"frequency": header, "amplitude": "Disp", "force": "F"} if "rpm" in header else {}
    record = imported(path, columns=stated, response="displacement").record
    close(record, truth)
    np.testing.assert_allclose(record.column("frequency")[: len(truth.f)], truth.f, rtol=1e-12)
    if stated:
        with pytest.raises(InputError, match="frequency in furlongs; expected --unit frequency=UNIT of hz"):
            imported(path, columns=stated, response="displacement", units={"frequency": "furlongs"})


def test_times_in_milliseconds(tmp_path):
    columns = {"Time [ms]": 10.0 * np.arange(50), "Acc [g]": np.cos(np.arange(50))}
    series, _ = read_file(write_csv(tmp_path / "a.csv", columns), Stated())
    np.testing.assert_allclose(series[0].abscissa, 0.01 * np.arange(50), rtol=1e-12)


@pytest.mark.parametrize(
    ("names", "said", "message"),
    [
        (("x", "y"), {}, "parts of one complex response, or two motions.*--column x=x --column y=y"),
        (("roof", "mid"), {}, "which column is the response. roof, mid; .*--column response=NAME .* response=UNIT$"),
        (("A", "Ph"), {"amplitude": "A", "phase": "Ph"}, "phase in rad up to 170; expected .*--column lag_deg=NAME"),
        (("A", "Rd"), {"amplitude": "A", "lag_deg": "Rd"}, "lag_deg in degrees runs from .*; expected .*phase=NAME"),
    ],
)
def test_what_would_be_a_guess_is_asked(tmp_path, names, said, message):
    """A real column is no half of a complex one unless said, and no angle is wrapped."""
    f = np.linspace(9.0, 11.0, 21)
    values = {"x": f, "y": f, "roof": f, "mid": f, "A": f, "Ph": np.linspace(5, 170, 21), "Rd": np.linspace(0.1, 3, 21)}
    columns = {"frequency": f, "force": 1.0} | {name: values[name] for name in names}
    path = write_csv(tmp_path / "a.csv", columns)
    with pytest.raises(InputError, match=message):
        read_file(path, Stated(columns=said))


def test_campaigns_are_advised_for_what_they_read(tmp_path):
    """Tables of time are one, and those of frequency if each sensor has a phase."""
    t = 0.01 * np.arange(50)
    write_csv(tmp_path / "a.csv", {"time": t, "roof [g]": np.cos(t), "mid [g]": np.sin(t)})
    with pytest.raises(InputError, match=r"which column is the response.* response=NAME; damping campaign for all$"):
        read_file(tmp_path / "a.csv", Stated())
    scipy.io.savemat(tmp_path / "a.mat", {"freq": t, "roof": t, "mid": t, "force": 1.0})
    with pytest.raises(InputError, match=r"which column is the response\? roof, mid; .* response=UNIT$"):
        read_file(tmp_path / "a.mat", Stated())
    pd.DataFrame({"freq": t, "roof": t, "mid": t, "roof phase": t, "force": 1.0}).to_csv(tmp_path / "a.csv")
    with pytest.raises(InputError, match=r"which column is the .*else amplitude=NAME.*; damping campaign for all$"):
        read_file(tmp_path / "a.csv", Stated())
    with pytest.raises(InputError, match=r"'roof' has no phase; expected a column roof phase"):
        analyse([tmp_path / "a.mat"])


@pytest.mark.parametrize("cell", ["", "NaN", "inf"])
def test_a_cell_of_a_time_history_that_is_no_number(tmp_path, cell):
    """Its line is that in the file, blank lines counted; a force beside it is not used."""
    rows = "".join(f"{k / 100},{cell if k == 30 else k},\n" + ("\n" if k == 5 else "") for k in range(50))
    (tmp_path / "a.csv").write_text(f"time [s],acceleration [g],force [N]\n{rows}")
    with pytest.raises(InputError, match=r"line 33, column acceleration \[g\]: ('NaN'|'inf'|an empty cell); expected"):
        read_file(tmp_path / "a.csv", Stated())


def test_motions_against_time_are_no_parts(tmp_path):
    path = tmp_path / "a.mat"
    t = np.arange(0.0, 5.0, 0.01)
    scipy.io.savemat(path, {"time": t, "x": np.cos(t), "y": np.sin(t)})
    with pytest.raises(InputError, match="x and y"):
        read_file(path, Stated())
    with pytest.raises(InputError, match="no parts of a complex response; expected --column response=NAME"):
        read_file(path, Stated(columns={"x": "x", "y": "y"}))


def test_help_names_every_role():
    text = import_.__doc__ or ""
    assert all(role in text for role in ROLES)


def test_german_spreadsheet(tmp_path):
    path = tmp_path / "a.csv"
    rows = [f"{0.01 * k:.4f};{np.cos(k):.5f};".replace(".", ",") for k in range(50)]
    path.write_text("\ufeffZeit [s];Weg [mm];Bemerkung\r\n" + "\r\n".join(rows) + "\r\n", encoding="utf-8")
    series, summary = read_file(path, Stated())
    history = time_histories(series, Stated(), summary)[0]
    np.testing.assert_allclose(history.signal, 1e-3 * np.cos(np.arange(50)), atol=6e-9)  # five decimals of mm


def test_channels_of_a_controller(tmp_path):
    path = tmp_path / "a.nc4"
    with netCDF4.Dataset(path, "w") as file:
        file.sample_rate = 256
        file.createDimension("response_channels", 2)
        file.createDimension("time_samples", None)
        data = file.createVariable("time_data", "f8", ("response_channels", "time_samples"))
        data[:] = [np.arange(100.0), -np.arange(100.0)]
        channels = file.createGroup("channels")
        for name, values in {"node_number": ("12", "15"), "node_direction": ("Z+", "Z+"), "unit": ("g", "g")}.items():
            variable = channels.createVariable(name, str, ("response_channels",))
            for k, value in enumerate(values):
                variable[k] = value
    series, _ = read_file(path, Stated())
    assert [one.label for one in series] == ["12 Z+", "15 Z+"]
    np.testing.assert_allclose(series[0].abscissa[1], 1 / 256, rtol=1e-15)
    assert series[1].facts.units["response"] == "g"
    assert series[1].response[99] == -99.0


def decaying(k: float) -> np.ndarray:
    """An acceleration of a free decay, m/s^2."""
    t = np.arange(0.0, 4.0, 0.01)
    return np.asarray(k * np.exp(-0.3 * t) * np.cos(30.0 * t))


def test_the_part_that_is_asked_for(tmp_path):
    """Samples and times between two times are those of the whole file; the rest of the file does not enter memory."""
    t = 2.0 + np.arange(50_000) / 512.0
    x = np.random.default_rng(1).standard_normal(len(t))
    with TdmsWriter(tmp_path / "a.tdms") as file:
        about = {"wf_increment": 1 / 512.0, "wf_start_offset": 2.0, "unit_string": "m"}
        file.write_segment([ChannelObject("g", "response", x, properties=about)])
    write_hdf5(tmp_path / "a.h5", {"time": t, "response": np.array([x, 2.0 * x]).T})
    write_hdf5(tmp_path / "b.h5", {"response": x, "fs": 512.0})
    later = np.where(t < 10.0, t, 10.0 + 3.0 * (t - 10.0))  # the first times are closer than the others
    write_hdf5(tmp_path / "late.h5", {"time": later, "response": x})
    scipy.io.savemat(tmp_path / "a.mat", {"time": t, "response": x})
    wavfile.write(tmp_path / "a.wav", 512, x)
    for name in ("a.tdms", "a.h5", "b.h5", "late.h5", "a.mat", "a.wav"):
        stated = {"columns": {"response": "response"}} if name == "b.h5" else {}
        stated |= {"scale": {"response": 1.0}} if name == "a.wav" else {}
        whole, part, beyond, after = (
            read_file(tmp_path / name, Stated(**stated, span=span))[0]
            for span in (None, (40.0, 60.0), (1000.0, 2000.0), (40.0, np.inf))
        )
        assert len(part) == len(whole)
        for of_part, of_rest, of_whole in zip(part, after, whole, strict=True):
            for of, end in ((of_part, 60.0), (of_rest, np.inf)):
                kept = (of.abscissa >= 40.0) & (of.abscissa <= end)
                asked = (of_whole.abscissa >= 40.0) & (of_whole.abscissa <= end)
                np.testing.assert_array_equal(of.response[kept], of_whole.response[asked])
                np.testing.assert_allclose(of.abscissa[kept], of_whole.abscissa[asked], rtol=1e-12)
            fewest = len(t) if name == "late.h5" else 20 * 512
            assert fewest <= len(of_part.response) <= fewest + 5
        assert len(beyond[0].response) == len(t)  # whose times the message on a wrong part names
    write_hdf5(tmp_path / "f.h5", {"time": t, "response": x, "force": np.where(t < 3.0, 1.0, 0.0)})
    (driven,) = read_file(tmp_path / "f.h5", Stated(span=(40.0, 60.0)))[0]
    assert len(driven.response) == len(t)  # the largest force tells whether it acts on


def test_channels_of_tdms(tmp_path):
    path = tmp_path / "a.tdms"
    properties = {"wf_increment": 0.01, "wf_start_offset": 0.5, "unit_string": "m/s^2"}
    with TdmsWriter(path) as file:
        file.write_segment([ChannelObject("Decay", "Acc 7Z", decaying(2.0), properties)])
    series, summary = read_file(path, Stated())
    history = time_histories(series, Stated(), summary)[0]
    assert (history.label, history.order) == ("Decay/Acc 7Z", 2)
    np.testing.assert_allclose(history.t, 0.5 + 0.01 * np.arange(400), rtol=1e-12)
    np.testing.assert_array_equal(history.signal, decaying(2.0))
    with pytest.raises(InputError, match=r"no channel 'Acc 8Z'; expected Decay/Acc 7Z \(400\)"):
        read_file(path, Stated(columns={"response": "Acc 8Z"}))


def test_segments_of_labview(tmp_path):
    """Two segments with headers of their own and a comment in the first row alone: two decays."""
    head = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n"
    head += "Multi_Headings\tYes\nX_Columns\tOne\nTime_Pref\tAbsolute\n***End_of_Header***\t\n\t\n"
    parts = []
    for k in (1.0, 2.0):
        part = "Channels\t1\t\nSamples\t400\t\nY_Unit_Label\tm/s^2\t\nX_Dimension\tTime\t\nX0\t0.0\t\nDelta_X\t0.01\t\n"
        part += "***End_of_Header***\t\t\nX_Value\tAcc\tComment\n"
        rows = [f"{0.01 * n:.6f}\t{x:.6f}" for n, x in enumerate(decaying(k))]
        parts.append(part + rows[0] + "\treleased\n" + "\n".join(rows[1:]) + "\n\t\n")
    path = tmp_path / "a.lvm"
    path.write_text(head + "".join(parts))
    series, summary = read_file(path, Stated())
    assert [one.label for one in series] == ["1/Acc", "2/Acc"]
    for one, k in zip(time_histories(series, Stated(), summary), (1.0, 2.0), strict=True):
        np.testing.assert_allclose(one.signal, decaying(k), atol=6e-7)  # six decimals
        np.testing.assert_allclose(one.t[1], 0.01, rtol=1e-12)


@pytest.mark.parametrize("header", ["Acceleration [dB]", "Accel (dB re 1 um/s2)", "Accel_dB", "HdB", "level in DB"])
def test_decibels_are_no_amplitudes_in_any_unit(levels, tmp_path, imported, header):
    """120 + 20 lg a is above zero: with a unit that is stated it would pass for an amplitude."""
    decibels = 120.0 + 20.0 * np.log10(levels.amplitude * (2 * np.pi * levels.f) ** 2)
    path = write_csv(tmp_path / "a.csv", {"Frequency [Hz]": levels.f, "Force [N]": levels.F, header: decibels})
    by_place = {"amplitude": "3", "force": "2", "frequency": "1"}
    for units in ({"response": "m/s^2"}, {}):
        with pytest.raises(InputError, match=r"amplitude in decibels .*10\^\(dB/20\)"):
            imported(path, columns=by_place, response="acceleration", units=units)
    scipy.io.savemat(tmp_path / "a.mat", {"frequency": levels.f, "force": levels.F, "HdB": decibels})
    names = {"frequency": "frequency", "force": "force", "amplitude": "HdB"}
    with pytest.raises(InputError, match="amplitude in decibels"):
        imported(tmp_path / "a.mat", columns=names, response="acceleration", units={"response": "m/s^2", "force": "N"})


@pytest.mark.parametrize("text", ["feedback [g]", "dbl [mm]", "Sandbox"])
def test_other_words_are_no_decibels(text):
    refuse_decibels("amplitude", text)


def test_a_sensor_against_the_force_is_told_how(truth, levels, tmp_path, imported):
    """Its phase is pi off: no turn is passive, the reverse of one is; as told, the record is right."""
    columns = {"Frequency [Hz]": levels.f, "Force [N]": levels.F, "Displacement [mm]": 1e3 * levels.amplitude}
    path = write_csv(tmp_path / "a.csv", columns | {"Phase [deg]": 180.0 - np.degrees(levels.lag)})
    with pytest.raises(InputError, match=r"--reverse \(a sensor mounted against the force\), or --column"):
        imported(path)
    close(imported(path, reverse=True).record, truth)


def test_a_ratio_is_not_asked_for_a_scaling(truth, tmp_path, imported):
    """An accelerance in g/N has none; what is missing is the unit of the force."""
    a = truth.H * -((2 * np.pi * truth.f) ** 2) / 9.80665
    path = write_csv(tmp_path / "a.csv", {"Frequency [Hz]": truth.f, "Real [g/N]": a.real, "Imag [g/N]": a.imag})
    with pytest.raises(InputError, match="the unit of the force is neither") as error:
        imported(path, forces=(2.0,))
    assert error.value.expected == "--unit force=N"
    close(imported(path, forces=(2.0,), units={"force": "N"}).record, truth, (2.0,))


@pytest.mark.parametrize(
    ("phase", "uncertainty", "said"),
    [
        ("Phase [deg]", "phase_sd [deg]", ("degrees", "found in the file")),
        ("Phase [deg]", "phase_sd", ("degrees", "that of the phase")),
        ("lag_deg", "phase_sd", ("degrees", "that of the phase")),
        ("lag_deg", "phase_sd [rad]", ("rad", "found in the file")),
        ("Phase [rad]", "phase_sd [deg]", ("degrees", "found in the file")),
        ("Phase [rad]", "phase_sd", ("rad", "that of the phase")),
    ],
)
def test_the_uncertainty_of_a_phase_is_in_rad(truth, tmp_path, imported, phase, uncertainty, said):
    """2 degrees are 2 pi/180 rad: by its own header, else by the unit of the phase."""
    names = ("Frequency [Hz]", "Force [N]", "Displacement [m]", phase, uncertainty)
    degrees = "rad" not in phase
    lag = np.degrees(truth.lag) if degrees else truth.lag
    sd = 2.0 if said[0] == "degrees" else np.pi / 90.0
    values = (truth.f, truth.F, truth.amplitude, lag, sd)
    found = imported(write_csv(tmp_path / "a.csv", dict(zip(names, values, strict=True))))
    np.testing.assert_allclose(found.record.column("phase_sd"), np.pi / 90.0, rtol=1e-12)  # roundings
    np.testing.assert_allclose(found.record.column("phase"), truth.lag, rtol=0.0, atol=1e-12)
    assert ("unit of phase_sd", *said) in found.summary.rows


def test_attributes_say_degrees(truth, tmp_path, imported):
    contents = {"frequency": truth.f, "force": (truth.F, "N"), "amplitude": (truth.amplitude, "m")}
    contents |= {"phase": (np.degrees(truth.lag), "deg"), "phase_sd": (np.full(41, 2.0), "deg")}
    found = imported(write_hdf5(tmp_path / "a.h5", contents), response="displacement").record
    np.testing.assert_allclose(found.column("phase"), truth.lag, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found.column("phase_sd"), np.pi / 90.0, rtol=1e-12)


@pytest.mark.parametrize("header", ["Phase [deg]", "Phase [rad]", "lag_deg", "phase"])
def test_a_phase_without_a_number_is_none(truth, tmp_path, imported, header):
    columns = {"Frequency [Hz]": truth.f, "Force [N]": truth.F, "Displacement [m]": truth.amplitude}
    found = imported(write_csv(tmp_path / "a.csv", columns | {header: np.nan, "phase_sd": np.nan}))
    assert not {"phase", "phase_sd"} & set(found.record.table)
    np.testing.assert_allclose(found.record.column("amplitude"), truth.amplitude, rtol=1e-12)
    assert any("holds no number" in note for note in found.summary.notes)


@pytest.mark.parametrize(("text", "scaling"), [("acc1rms", "rms"), ("tip_rms_g", "rms"), ("app", None), ("rms1", None)])
def test_a_scaling_may_follow_the_number_of_a_sensor(text, scaling):
    assert parse_header(text).scaling == scaling
