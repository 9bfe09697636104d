"""Headings of laboratories: phases of each channel, scalings, parts, the only motion, loads, levels in decibels."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from damping.errors import InputError
from damping.formats import read_file
from damping.formats.headers import parse_header
from damping.formats.levels import DRIVE
from damping.formats.quantity import unit
from damping.formats.series import Stated

FORCES = (2.0, 3.0, 8.0)
SETTING = ("Frequency [Hz]", "Force [N]")
GRAVITY = 9.80665


def write(path, truth, headers, motion, sep=","):
    """A table of three sweeps; ``motion`` gives its columns after frequency and force, from the displacement (n,)."""
    parts = []
    for force in FORCES:
        columns = [truth.f, np.full(len(truth.f), force), *motion(force * truth.H)]
        parts.append(pd.DataFrame(dict(zip(headers, columns, strict=True))))
    pd.concat(parts).to_csv(path, index=False, sep=sep)
    return path


def close(record, truth):
    """The record holds the mode at each force, with its phases."""
    for sweep, force in zip(record.sweeps, FORCES, strict=True):
        rows = record.table[record.table["sweep"].astype(str) == sweep]
        np.testing.assert_allclose(rows["force"], force, rtol=1e-9)
        np.testing.assert_allclose(rows["amplitude"], force * np.abs(truth.H), rtol=1e-9)
        np.testing.assert_allclose(rows["phase"], truth.lag, rtol=0, atol=1e-9)


def acceleration(truth, X):
    return -((2 * np.pi * truth.f) ** 2) * X


@pytest.mark.parametrize(
    "header",
    ["Acc phase [deg]", "Acc Phase", "Relative Phase (deg)", "theta [deg]", "Winkel [Grad]", "Phase [degré]"],
)
def test_a_phase_is_one_by_any_word_for_it(truth, tmp_path, imported, header):
    """It was left out unless its name began with it, and each sweep gave its resonance alone."""
    path = write(
        tmp_path / "a.csv",
        truth,
        [*SETTING, "Acc [m/s^2]", header],
        lambda X: (np.abs(acceleration(truth, X)), np.degrees(np.angle(acceleration(truth, X)))),
    )
    close(imported(path).record, truth)


@pytest.mark.parametrize("header", ["Force phase [deg]", "Phase of force [deg]"])
def test_the_phase_of_a_force_is_subtracted(truth, tmp_path, imported, header):
    """Both against one reference: e^(i a)/e^(i b) = e^(i (a - b)), at any b, a wandering one included."""
    b = 30.0 + 20.0 * np.sin(truth.f)
    names = [*SETTING, header, "Acceleration [m/s^2]", "Acc phase [deg]", "Velocity [m/s]", "Vel phase [deg]"]
    w = 2 * np.pi * truth.f
    path = write(
        tmp_path / "a.csv",
        truth,
        names,
        lambda X: (
            b,
            np.abs(acceleration(truth, X)),
            np.degrees(np.angle(acceleration(truth, X))) + b,
            w * np.abs(X),
            np.degrees(np.angle(1j * X)) + b,
        ),
    )
    found = imported(path)
    close(found.record, truth)
    assert "the phase of the force is subtracted from that of the response" in found.summary.notes


@pytest.mark.parametrize(("b", "of_force"), [(0.0, None), (30.0, None), (30.0, True), (30.0, False)])
def test_a_bare_phase_beside_that_of_the_force(truth, tmp_path, imported, b, of_force):
    """Whether it is against the force is asked, unless the force is the reference."""
    shift = 0.0 if of_force is False else b
    path = write(
        tmp_path / "a.csv",
        truth,
        [*SETTING, "Force phase [deg]", "Disp [m]", "Phase [deg]"],
        lambda X: (np.full(len(X), b), np.abs(X), np.degrees(np.angle(X)) + shift),
    )
    columns = {} if of_force is None else {"amplitude": "Disp", "angle": "Phase"}
    columns |= {"force_angle": "Force phase"} if of_force else {}
    if b and of_force is None:
        with pytest.raises(InputError, match=r"'Phase \[deg\]' against the force, or .*--column force_angle=NAME"):
            imported(path)
        return
    close(imported(path, columns=columns).record, truth)


@pytest.mark.parametrize(
    ("header", "name", "scaling"),
    [
        ("Disp p2p [mm]", "Disp", "peak-to-peak"),
        ("Disp pk2pk [mm]", "Disp", "peak-to-peak"),
        ("Disp ptp [mm]", "Disp", "peak-to-peak"),
        ("Disp [in D.A.]", "Disp", "peak-to-peak"),
        ("Disp [mm DA]", "Disp", "peak-to-peak"),
        ("Disp double amplitude [mm]", "Disp", "peak-to-peak"),
        ("Weg (SS) [mm]", "Weg", "peak-to-peak"),
        ("Weg [mm ss]", "Weg", "peak-to-peak"),
        ("Schwingweite [mm]", "Schwingweite", "peak-to-peak"),
        ("Déplacement c-c [mm]", "Déplacement", "peak-to-peak"),
        ("Déplacement crête-crête [mm]", "Déplacement", "peak-to-peak"),
        ("Déplacement pic à pic [mm]", "Déplacement", "peak-to-peak"),
        ("Acc [g o-p]", "Acc", "peak"),
        ("arms [g]", "a", "rms"),
        ("Accel grms", "Accel", "rms"),
        ("Force_Npk", "Force", "peak"),
        ("Acc tip grms", "Acc tip grms", "rms"),
        ("Accel loss", "Accel loss", None),
        ("class [mm]", "class", None),
        ("Dada [mm]", "Dada", None),
        ("force [daN]", "force", None),
    ],
)
def test_words_for_a_scaling(header, name, scaling):
    """Peak to peak is twice the amplitude, whatever it is called."""
    parsed = parse_header(header)
    assert (parsed.name, parsed.scaling) == (name, scaling)


@pytest.mark.parametrize(
    ("header", "of"),
    [
        ("Magnitude (m/N)", lambda force, X: np.abs(X) / force),
        ("Inertance [1/kg]", None),
        ("Ampl. [mm]", lambda _, X: 1e3 * np.abs(X)),
        ("x [mm]", lambda _, X: 1e3 * np.abs(X)),
    ],
)
def test_the_only_motion_beside_a_phase_is_the_response(truth, tmp_path, imported, header, of):
    """The coherence and its phase beside it are none."""
    of = of or (lambda force, X: np.abs(acceleration(truth, X)) / force)
    factor = -1.0 if header.startswith("Inertance") else 1.0
    path = write(
        tmp_path / "a.csv",
        truth,
        [*SETTING, header, "Phase [deg]", "Coherence"],
        lambda X: (
            of(float(np.abs(X[0] / truth.H[0])), X),
            np.degrees(np.angle(factor * X)),
            np.ones(len(X)),
        ),
    )
    close(imported(path).record, truth)


def test_an_only_motion_without_a_phase_is_asked_for(truth, tmp_path, imported):
    path = write(tmp_path / "a.csv", truth, [*SETTING, "gap [mm]"], lambda X: (np.abs(X),))
    with pytest.raises(InputError, match=r"which column is the response. gap \[mm\]"):
        imported(path)


@pytest.mark.parametrize("names", [("Re X [mm]", "Im X [mm]"), ("disp real [mm]", "disp imag [mm]")])
@pytest.mark.parametrize("turned", [0.0, 1.0])
def test_two_parts_of_one_name_are_a_response(truth, tmp_path, imported, names, turned):
    """Beside parts of the force, both may have any reference; of two pairs of motions none is taken."""
    turn = np.exp(1j * turned)
    headers = ["Frequency [Hz]", "Shaker [N]", *names, "Force re [N]", "Force im [N]"]
    path = write(
        tmp_path / "a.csv",
        truth,
        headers,
        lambda X: (
            1e3 * (turn * X).real,
            1e3 * (turn * X).imag,
            (turn * X / truth.H).real,
            (turn * X / truth.H).imag,
        ),
    )
    close(imported(path, scaling="peak").record, truth)
    two = pd.read_csv(path).assign(**{"tip re [mm]": 1.0, "tip im [mm]": 1.0})
    two.to_csv(path, index=False)
    with pytest.raises(InputError, match="which column is the response"):
        imported(path, scaling="peak")


def test_a_load_is_a_force_in_a_unit_of_it_alone(truth, tmp_path, imported):
    headers = ["Frequency [Hz]", "Load [N]", "Disp [m]", "Phase [deg]"]
    path = write(tmp_path / "a.csv", truth, headers, lambda X: (np.abs(X), np.degrees(np.angle(X))))
    close(imported(path).record, truth)
    pd.read_csv(path).assign(**{"Force [kN]": lambda t: 1e-3 * t["Load [N]"], "Load [N]": 7.0}).to_csv(
        path, index=False
    )
    close(imported(path).record, truth)


def test_a_level_in_decibels_is_no_label(truth, tmp_path, imported):
    """It made a sweep of each row."""
    path = write(
        tmp_path / "a.csv",
        truth,
        [*SETTING, "Disp [m]", "Phase [deg]", "Level [dB]"],
        lambda X: (np.abs(X), np.degrees(np.angle(X)), 20 * np.log10(np.abs(X))),
    )
    close(imported(path).record, truth)


@pytest.mark.parametrize(
    ("text", "factor"), [("daN", 10.0), ("kp", GRAVITY), ("kip", 4448.2216152605), ("gal", 0.01), ("Gal", 0.01)]
)
def test_further_units(text, factor):
    """By definition: the kilopond is the weight of a kilogram, the gal 1 cm/s^2."""
    assert unit(text).factor == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("name", ["Steuerung", "Regelkanal 1", "voie pilote", "Anregung", "Excitation"])
def test_channels_that_drive_have_names_in_several_languages(name):
    assert DRIVE.search(name)
    assert not DRIVE.search("Regelungstechnik")


@pytest.mark.parametrize("date", ["", "2024-01-05 ", "05.01.2024 ", "1/5/2024 "])
@pytest.mark.parametrize("mark", [".", ","])
def test_clock_times_are_seconds(tmp_path, date, mark):
    """Over midnight too: seconds since the start as of the same signal with times in s."""
    t = 86399.5 + 0.005 * np.arange(200)
    path = tmp_path / "a.csv"
    with path.open("w") as file:
        file.write("Time;Acc [g]\n")
        for k, s in enumerate(t):
            seconds = f"{s % 60:06.3f}".replace(".", mark)
            file.write(f"{date}{int(s) // 3600 % 24:02}:{int(s) // 60 % 60:02}:{seconds};{k}{mark}5\n")
    (series,), _ = read_file(path, Stated())
    np.testing.assert_allclose(series.abscissa - series.abscissa[0], t - t[0], rtol=0, atol=1e-9)
    np.testing.assert_allclose(series.response, np.arange(200) + 0.5)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("Frequency [Hz],Set force [N],Measured force [N],Disp [mm]\n1,2,3,4\n", "the force. Set force .N., Measured"),
        ("Frequency [Hz],Kraft [V],Disp [mm]\n1,2,3\n", r"the force. Kraft \[V\]; expected --column force=NAME"),
        ("Acc [g]\n1\n2\n", "no abscissa; .*--rate HZ of a signal without times"),
        ("Frequency [Hz],Force [N],Disp [mm]\n1,2,0.25-0.03i\n", "'0.25-0.03i' is not a number .a complex number"),
        ("Frequency [Hz],Force [N],Disp [mm]\n1,2,(0.25-0.03j)\n", "is not a number .a complex number"),
        ("Frequency [Hz],Force [N],Disp [mm]\n1,10:00:05,3\n", "is not a number .a clock time"),
    ],
)
def test_messages_say_what_the_file_has(tmp_path, imported, content, message):
    path = tmp_path / "a.csv"
    path.write_text(content)
    with pytest.raises(InputError, match=message):
        imported(path)
