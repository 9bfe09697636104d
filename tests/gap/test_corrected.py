"""The corrected model explains the record that corrected it, and runs."""

from __future__ import annotations

import re

import numpy as np
import pytest

from damping.agreement import simulate_resonance
from damping.api import sweep
from damping.gap.corrected import corrected_mode, effect_values, refitted_values
from damping.gap.diagnose import diagnose
from damping.records.mode import describe_mode_to_toml, read_mode
from damping.records.reading import read_record
from damping.result import DiagnosisResult
from damping_pipelines.cli import main
from damping_pipelines.gap import _describe_model
from tests.gap.limited import limited

#: A force and a parameter; one effect of each further kind.
NAMES = ("velocity-squared", "natural-frequency")
FURTHER = ("stiffness-hardening", "planar-coupling", "phase-lag")


@pytest.fixture
def written(lab, tmp_path):
    """The corrected model of a diagnosis, written and read again."""

    def write(name):
        path = tmp_path / f"{name}.toml"
        path.write_text(describe_mode_to_toml(corrected_mode(lab.diagnosed(name).leading.best)))
        return path

    return write


@pytest.mark.parametrize("name", [*NAMES, *(pytest.param(name, marks=pytest.mark.slow) for name in FURTHER)])
def test_the_corrected_model_has_no_gap(lab, written, name, among, monkeypatch, no_rivals):
    first = lab.diagnosed(name)
    assert first.leading.effects == (name,)
    monkeypatch.setattr("damping.gap.size.hold_levels_out", lambda *_: None)  # nobody asks
    again = limited(among(), diagnose, first.record, read_mode(written(name)))
    assert again.leading.effects == ()
    assert not again.unexplained
    assert again.gap.nominal < 1.2  # 1 and three standard errors of a root mean square of 120 values, 0.065
    assert again.footprint == ()


def test_a_gain_names_the_mass_that_reads_alike(lab):
    """Readings 1.1 times too large are those of F/|Z| with all of Z, mass and all, 1/1.1 as large: 10 becomes 9.09."""
    (said,) = (caution for caution in lab.diagnosed("amplitude-scale").cautions if "generalized mass" in caution)
    mass, percent, times = re.search(r"mass of (\S+) in place of 10 \((\S+) %, (\S+) times", said).groups()
    np.testing.assert_allclose(float(mass), 10.0 / 1.1, rtol=0.005)  # as the factor itself, 1 % noise over 120 values
    np.testing.assert_allclose(float(percent), 100.0 / 1.1 - 100.0, rtol=0.0, atol=0.5)  # the same half per cent
    np.testing.assert_allclose(float(times), np.log(1.1) / 0.02, rtol=0.0, atol=0.25)
    assert not any("generalized mass" in caution for caution in lab.diagnosed("velocity-squared").cautions)


def test_the_head_of_a_corrected_model_says_what_is_not_of_the_structure(lab, few_steps):
    """The sweep of a model corrected by a gain is the motion that the gain misread."""
    result = DiagnosisResult(lab.diagnosed("amplitude-scale"))
    head = " ".join(line.removeprefix("# ") for line in _describe_model(result).splitlines() if line.startswith("#"))
    assert "Part of the rig or of this test, not of the structure: amplitude-scale. `damping gap` applies it" in head
    mode = result.diagnosis.corrected
    hertz = np.array([mode.frequency * 0.999, mode.frequency])
    swept = sweep(mode, force=[5.0], frequency=hertz, structure=True)
    (own,) = simulate_resonance(mode, np.array([5.0]), 2.0 * np.pi * hertz)
    np.testing.assert_allclose(swept.table["amplitude"].iloc[-1], own, rtol=1e-9)  # of viscous damping: at omega_n
    assert swept.left_out == ("amplitude-scale",)
    assert "not of the structure" not in _describe_model(DiagnosisResult(lab.diagnosed("velocity-squared")))


def test_what_is_corrected(lab, written):
    mode = read_mode(written("velocity-squared"))
    own = lab.diagnosed("velocity-squared").leading.best
    added = effect_values(own)["velocity-squared"]["coefficient"]
    assert mode.damping["velocity-squared"]["coefficient"] == added
    refit = refitted_values(own)
    np.testing.assert_allclose(  # rounding
        mode.damping["viscous"]["coefficient"], lab.viscous * (1.0 + refit["viscous"]), rtol=1e-14, atol=0.0
    )
    assert mode.effects == {}
    assert set(read_mode(written("phase-lag")).effects) == {"phase-lag"}
    corrected = read_mode(written("natural-frequency"))
    assert (corrected.effects, set(corrected.damping)) == ({}, {"viscous"})
    # 5 tolerances of 0.1 % too low; known to 1e-5 at 1 % noise, five of them
    np.testing.assert_allclose(corrected.frequency / lab.mode().frequency, 0.995, rtol=0.0, atol=5e-5)


@pytest.mark.parametrize("form", [{}, {"smooth": 1.0}])  # of [damping], and of [effects]
def test_a_corrected_joint_loses_no_more_than_the_stiffness(lab, form, monkeypatch):
    """Of the corrected mode, which may be softer than the simulated one."""
    fitted = {"slip": {"stiffness": 1e9, "limit": 0.01} | form}
    monkeypatch.setattr("damping.gap.corrected.effect_values", lambda fit: fitted)
    mode = corrected_mode(lab.diagnosed("velocity-squared").leading.best)
    joint = (mode.effects if form else mode.damping)["slip"]
    np.testing.assert_allclose(joint["stiffness"], mode.mass * mode.omega_n**2, rtol=1e-12)


@pytest.mark.parametrize("name", ["velocity-squared", "stiffness-hardening"])
def test_the_corrected_model_can_be_swept(lab, written, tmp_path, name, few_steps):
    out, rows = tmp_path / "swept.csv", lab.bench().rows
    top = float(rows.force.max())
    hertz = np.linspace(2.82, 3.18, 13)  # the band of the test
    words = ("--force", repr(top), "--frequency", "2.82:3.18:13", "--out", str(out))
    with pytest.raises(SystemExit) as stopped:
        main(["sweep", str(written(name)), *words])
    assert not stopped.value.code
    swept = read_record(out)
    np.testing.assert_allclose(swept.column("frequency"), hertz, rtol=1e-6, atol=0.0)  # digits of the file
    # the true structure, integrated in time, at the frequencies next to these
    truth = lab.truth(name)
    own = rows.force == top
    near = np.interp(rows.omega[own] / (2 * np.pi), hertz, np.log(swept.column("amplitude")))
    beside = np.abs(rows.omega[own] / lab.omega - 1.0) > 0.035
    # A ~ 1/|omega - omega_n| there: ln A differs from a chord of 1 % of omega_n by (0.01/0.035)^2/8 = 0.01 at most, and
    # the refitted mass is known to 0.2 %
    np.testing.assert_allclose(near[beside], np.log(truth.amplitude[own][beside]), rtol=0.0, atol=0.015)
