"""`damping sweep`: the record it writes, its options, and what it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from damping.errors import AnalysisError, InputError
from damping.forces import CubicStiffness, Sum, Viscous
from damping.gap.sweeping import _label, simulated_force
from damping.predict.branches import sweep as averaged_sweep
from damping.predict.steady import steady_state
from damping.records.mode import Mode, describe_mode_to_toml, read_mode
from damping.records.reading import read_record
from damping_pipelines.tables import sweep

MODEL = """
[mode]
name = "Configuration II, first mode"
frequency = 1.664
mass = 50.78

[damping]
viscous = 1.1
displacement-velocity = 0.6
"""


@pytest.fixture
def model(tmp_path: Path) -> Path:
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    return path


def with_tables(model: Path, text: str) -> Path:
    model.write_text(MODEL + text)
    return model


def test_record_holds_the_steady_states(model: Path, tmp_path: Path) -> None:
    out = tmp_path / "record.csv"
    sweep(model, [19.37, 28.98], "1.63:1.70:15", out, "up", "ritz")
    table = read_record(out).table
    assert list(table.columns) == ["sweep", "force", "frequency", "amplitude", "phase"]
    assert table["sweep"].tolist() == ["A"] * 15 + ["B"] * 15
    np.testing.assert_allclose(table["frequency"][:15], np.linspace(1.63, 1.70, 15), rtol=1e-15)
    from damping.forces import DisplacementVelocity

    force = Sum((Viscous(1.1), DisplacementVelocity(0.6)))
    omega, omega_n = 2 * np.pi * table["frequency"].to_numpy(), 2 * np.pi * 1.664
    expected = steady_state(force, table["force"].to_numpy(), omega, 50.78, omega_n)
    # two searches for one root, each to rounding; numbers are written to the last digit
    np.testing.assert_allclose(table["amplitude"], expected.amplitude, rtol=1e-11)
    np.testing.assert_allclose(table["phase"], expected.phase, rtol=1e-10)


def test_averages_and_integration_agree(model: Path, tmp_path: Path) -> None:
    for method in ("ritz", "time"):
        sweep(model, [28.98], "1.655:1.675:5", tmp_path / f"{method}.csv", "down", method)
    averaged, integrated = (read_record(tmp_path / f"{method}.csv").table for method in ("ritz", "time"))
    assert averaged["frequency"].is_monotonic_decreasing
    np.testing.assert_array_equal(averaged["frequency"], integrated["frequency"])
    # damping of a fifth of a per cent of critical: the averages' error is of second order in amplitude, first in phase
    np.testing.assert_allclose(averaged["amplitude"], integrated["amplitude"], rtol=1e-4)
    np.testing.assert_allclose(averaged["phase"], integrated["phase"], rtol=0, atol=1e-3)


@pytest.mark.usefixtures("few_steps")
def test_the_command_writes_a_row_for_each_force_and_frequency(model: Path, tmp_path: Path, damping) -> None:
    out = tmp_path / "record.csv"
    run = damping("sweep", model, "--force", 5, "--force", 20, "--frequency", "1.6:1.7:11", "--out", out)
    assert (run.code, run.out) == (0, "")  # progress goes to standard error
    assert len(read_record(out).table) == 22


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"force": [-1.0]}, "force -1.0; expected positive numbers"),
        ({"force": [float("nan")]}, "force nan"),
        ({"force": [2.0, 2.0]}, "the same force twice"),
        ({"frequency": "1.6:1.7"}, "LO:HI:N"),
        ({"frequency": "1.6:1.7:x"}, "LO:HI:N"),
        ({"frequency": "1.7:1.6:5"}, "0 < LO < HI"),
        ({"frequency": "1.6:1.7:1"}, "N >= 2"),
        ({"frequency": "1.6:1.7:5:9"}, "LO:HI:N"),
        ({"direction": "sideways"}, "expected up or down"),
        ({"method": "magic"}, "expected ritz or time"),
    ],
)
def test_bad_options_write_nothing(model: Path, tmp_path: Path, change: dict, message: str) -> None:
    out = tmp_path / "record.csv"
    options = {"force": [5.0], "frequency": "1.6:1.7:5", "direction": "up", "method": "ritz"} | change
    with pytest.raises(InputError) as caught:
        sweep(model, out=out, **options)
    assert message in str(caught.value)
    assert not out.exists()


def test_an_effect_that_is_not_integrated_is_refused(model: Path, tmp_path: Path) -> None:
    with_tables(model, "\n[effects.planar-coupling]\nangle = 0.5\nfrequency_ratio = 1.01\n")
    with pytest.raises(AnalysisError, match=r"method time cannot simulate \[effects.planar-coupling\]"):
        sweep(model, [5.0], "1.6:1.7:5", tmp_path / "record.csv", "up", "time")
    assert not (tmp_path / "record.csv").exists()


def test_phases_beyond_one_turn_are_written_as_a_phase_meter_reads_them(model: Path, tmp_path: Path) -> None:
    """A delay of ten seconds is 17 turns at 1.7 Hz; a record holds none."""
    out, straight = tmp_path / "late.csv", tmp_path / "straight.csv"
    sweep(model, [4.0], "1.6:1.75:7", straight, "up", "ritz")
    model.write_text(MODEL + "[effects.time-delay]\ndelay = 10.0\n")
    sweep(model, [4.0], "1.6:1.75:7", out, "up", "ritz")
    late, own = read_record(out), read_record(straight)
    turned = late.column("phase") - own.column("phase") - 20.0 * np.pi * own.column("frequency")
    np.testing.assert_allclose(np.exp(1j * turned), 1.0, rtol=0.0, atol=1e-4)  # 1e-6 of detuning at resonance


def test_a_sweep_that_misses_the_mode_says_so(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Frequencies in rad/s where Hz are asked for: 10.5 for 1.664 Hz."""
    sweep(model, [4.0], "10:11:7", tmp_path / "record.csv", "up", "ritz")
    assert "the mode's 1.664 Hz is outside the swept 10 to 11 Hz" in capsys.readouterr().err
    sweep(model, [4.0], "1.6:1.7:7", tmp_path / "record.csv", "up", "ritz")
    assert "outside" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("planar-couplin", r"unknown key in \[effects\].*expected planar-coupling \(nearest"),
        (
            "phase-lag]\nlagg = 0.1\n[effects.slip",
            r"line 12, column lagg: unknown key in \[effects.phase-lag\]; expected lag",
        ),
        ("force-dropout]\ndepth = 0.5\n[effects.slip", "no width in"),
    ],
)
def test_unknown_effects_and_keys_name_the_nearest(model: Path, tmp_path: Path, table: str, message: str) -> None:
    with_tables(model, f"\n[effects.{table}]\n")
    with pytest.raises(InputError, match=message):
        sweep(model, [5.0], "1.6:1.7:5", tmp_path / "record.csv", "up", "ritz")


@pytest.mark.parametrize("way", ["up", "down"])
def test_a_spring_as_an_effect_is_swept_as_a_spring_is(model: Path, tmp_path: Path, way: Literal["up", "down"]) -> None:
    """The effect's terms, solved over ln A, against the branches of section 4.2 with the same cubic spring."""
    with_tables(model, "\n[effects.stiffness-hardening]\ncoefficient = 3.0\n")
    sweep(model, [20.0], "1.6:1.75:40", tmp_path / "record.csv", way, "ritz")
    record, mode = read_record(tmp_path / "record.csv"), read_mode(model)
    omega = np.sort(record.column("frequency")) * 2.0 * np.pi
    found = averaged_sweep(simulated_force(mode), 20.0, omega, mode.mass, mode.omega_n, way)
    step = 1 if way == "up" else -1
    # both solve to rounding; a record holds nine digits or more
    np.testing.assert_allclose(record.column("amplitude"), found.amplitude[::step], rtol=1e-6)
    np.testing.assert_allclose(record.column("phase"), found.phase[::step], rtol=1e-6)


def test_a_force_that_falls_with_the_motion_is_swept_in_closed_form(tmp_path: Path) -> None:
    """F/(1 + (A/B)^2/4) for depth 1/5 at B and width 1/2: A + A^3/(4 B^2) = F/|Z| of a viscous mode."""
    path, level = tmp_path / "linear.toml", 0.8
    table = f"[effects.force-dropout]\ndepth = 0.2\nwidth = 0.5\nlevel = {level}\n"
    path.write_text(f'[mode]\nname = "m"\nfrequency = 1.6\nmass = 4.0\n[damping]\nviscous = 2.0\n{table}')
    sweep(path, [5.0, 25.0], "1.55:1.65:8", tmp_path / "record.csv", "up", "ritz")
    record = read_record(tmp_path / "record.csv")
    omega, A = 2.0 * np.pi * record.column("frequency"), record.column("amplitude")
    Z = 4.0 * ((2.0 * np.pi * 1.6) ** 2 - omega**2) + 2j * omega
    np.testing.assert_allclose(A + 0.25 * A**3 / level**2, record.column("force") / np.abs(Z), rtol=1e-6)
    np.testing.assert_allclose(record.column("phase"), np.angle(Z), rtol=1e-6)


def test_instruments_and_paths_are_swept_in_closed_form(model: Path, tmp_path: Path) -> None:
    """Gain, lag, drop-out, a residual and a second plane on a viscous mode: H is a sum of two closed forms."""
    mode = read_mode(model)
    text = """
[effects.amplitude-scale]
factor = 0.9
[effects.phase-lag]
lag = 0.05
[effects.force-dropout]
depth = 0.3
width = 0.01
[effects.residual-modes]
compliance = 1e-5
[effects.planar-coupling]
angle = 0.5
frequency_ratio = 1.01
"""
    viscous = Mode(
        name="m", frequency=mode.frequency, mass=mode.mass, damping={"viscous": {"coefficient": 2.0}}, effects={}
    )
    path = tmp_path / "linear.toml"
    path.write_text(describe_mode_to_toml(viscous) + text)
    sweep(path, [5.0], "1.6:1.75:30", tmp_path / "record.csv", "up", "ritz")
    record = read_record(tmp_path / "record.csv")
    omega = record.column("frequency") * 2.0 * np.pi
    M, omega_n, t = mode.mass, mode.omega_n, np.tan(0.5) ** 2
    first, second = (1.0 / (M * ((omega_n * r) ** 2 - omega**2) + 2j * omega) for r in (1.0, 1.01))
    force = 5.0 * (1.0 - 0.3 * np.exp(-0.5 * ((omega / omega_n - 1.0) / 0.01) ** 2))
    reading = 0.9 * np.exp(-0.05j) * force * ((first + t * second) / (1.0 + t) + 1e-5)
    np.testing.assert_allclose(record.column("amplitude"), np.abs(reading), rtol=1e-6)
    np.testing.assert_allclose(record.column("phase"), -np.unwrap(np.angle(reading)), rtol=1e-6)


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("method", ["ritz", "time"])
@pytest.mark.parametrize(
    ("table", "gain"),
    [
        ("amplitude-scale]\nfactor = 0.7", 0.7),
        ("level-offset]\nfactor = 0.9\nsweep = 1.0", 1.0),
        ("level-offset]\nfactor = 0.9\nsweep = 0.0\nstate = 1.0\nforce = 1.0", 1.0),
        ("phase-lag]\nlag = 0.2\nstate = 1.0", 1.0),
        ("drift]\nfrequency_1 = 0.004\nfrequency_2 = -0.004", 1.0),
        ("drift]\nfrequency = 0.004\nsettling = 0.2", 1.0),
        ("force-dropout]\ndepth = 0.3\nwidth = 1e3", 0.7),
    ],
)
def test_a_sweep_is_of_the_structure_and_of_no_fault_of_one_test(
    model: Path, tmp_path: Path, damping, table: str, gain: float, method: str
) -> None:
    """F/|Z| of every level; without --structure what the rig makes of it, and never what was off in one test alone."""
    model.write_text(MODEL.replace("displacement-velocity = 0.6\n", "") + f"\n[effects.{table}\n")
    mode, name = read_mode(model), table.partition("]")[0]
    frequency = f"1.65:1.68:{4 if method == 'ritz' else 2}"  # one in time takes as long as ten
    words = ("--force", 5, "--force", 20, "--frequency", frequency, "--method", method, "--quiet", "--out")
    for structure in (True, *([False] if method == "ritz" else [])):
        out = tmp_path / f"{structure}.csv"
        run = damping("sweep", model, *words, out, *(["--structure"] if structure else []))
        assert (name in run.err, "--structure" in run.err, run.code) == (True, not structure and gain != 1.0, 0)
        record = read_record(out)
        omega = 2.0 * np.pi * record.column("frequency")
        expected = record.column("force") / np.abs(mode.mass * (mode.omega_n**2 - omega**2) + 1.1j * omega)
        # in time a linear mode is integrated to 1e-6 or so
        np.testing.assert_allclose(record.column("amplitude"), expected * (1.0 if structure else gain), rtol=1e-5)


def test_stiffness_effects_are_cubic_springs_or_such_as_change_in_the_same_sense() -> None:
    def of(name: str, **table: float) -> Sum:
        mode = Mode(
            name="m",
            frequency=1.0,
            mass=2.0,
            damping={"viscous": {"coefficient": 1.0}},
            effects={name: {"coefficient": 3.0, **table}},
        )
        return simulated_force(mode)  # type: ignore[return-value]  # it is a sum

    for name, sense in (("stiffness-hardening", 1.0), ("stiffness-softening", -1.0)):
        assert of(name) == Sum((Viscous(1.0), CubicStiffness(sense * 3.0)))
        for exponent in (0.4, 1.5, 5.0):
            A = np.array([0.1, 0.2])
            _, _, S, _ = of(name, exponent=exponent).averages(A, np.array([6.0, 6.0]))
            assert np.diff(S / A) * sense > 0.0


@pytest.mark.parametrize("method", ["ritz", "time"])
def test_friction_that_holds_is_no_record(model: Path, tmp_path: Path, method: str) -> None:
    with_tables(model, "coulomb = 30.0\n")
    with pytest.raises(AnalysisError, match=r"no steady motion at force 20 and 1\.6 Hz"):
        sweep(model, [20.0], "1.6:1.7:5", tmp_path / "record.csv", "up", method)


def test_many_levels_are_labelled_like_columns_of_a_sheet() -> None:
    labels = [_label(number) for number in (0, 1, 25, 26, 27, 51, 52, 701, 702)]
    assert labels == ["A", "B", "Z", "AA", "AB", "AZ", "BA", "ZZ", "AAA"]
