"""From a record to a band: structures integrated in time, whole sweeps with faults, refusals in the form."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks._structures import structures
from damping.extrapolation import extrapolate_loads
from damping.extrapolation.prepared import near_resonance
from damping.forces import CubicStiffness, Sum
from damping.infer.law import Law
from damping.predict.steady import phase_resonance
from damping.records.record import record_to_csv
from damping_reed1970 import data_folder
from damping_validation.generator.balance import plain_rows
from damping_validation.generator.laws import Structure, TrueJoint
from damping_validation.generator.steady import guesses, steady

STRUCTURES = {s.name: s for s in structures()}
M = 0.3
OMEGA_N = 10.0


def slip_in_time(force: np.ndarray) -> np.ndarray:
    """Resonant amplitudes with a joint that slips, by integration of the motion at frequencies of phase resonance."""
    whole = STRUCTURES["viscous + slip"].force
    viscous, slip = whole.forces
    joint = TrueJoint("jenkins", slip.stiffness, (slip.limit,), (1.0,))
    structure = Structure(M, OMEGA_N, viscous.coefficient, joints=(joint,))
    _, omega = phase_resonance(whole, force, M, OMEGA_N)
    rows = plain_rows(np.zeros(len(force), int), force, omega)
    return np.abs(steady(structure, rows, guesses(structure, rows))[0])


def test_bands_hold_resonances_integrated_in_time(peaks):
    force = np.array([0.5, 0.8, 1.25, 2.0, 3.0])
    amplitude = slip_in_time(force)
    noise = np.exp(0.01 * np.random.default_rng(5).standard_normal(4))
    data = peaks(amplitude[:4] * noise, force[:4], OMEGA_N)
    band = extrapolate_loads(data, force[4:], fresh=False).loads.average
    assert np.all((band.low < amplitude[4:]) & (amplitude[4:] < band.high))


def test_bands_from_whole_sweeps_with_faults(swept):
    """A hardening spring, a phase offset of 3 degrees, drop-out of 20 % and noise; the Iwan joint is no candidate."""
    iwan = STRUCTURES["viscous + Iwan joint"]
    force = Sum((*iwan.force.forces, CubicStiffness(0.05)))
    record = swept(force, np.geomspace(0.5, 2.0, 4), noise=0.01, offset=np.radians(3.0), dropout=0.2, seed=2)
    data = near_resonance(record)
    design = data.tested_force.max() * np.array([1.5, 4.0])
    band = extrapolate_loads(data, design, fresh=False).loads.average
    true = iwan.amplitude(design)
    assert np.all((band.low < true) & (true < band.high))
    np.testing.assert_allclose(band.median, true, rtol=0.1)  # what is asked of a structure that no candidate is


#: One that lets go, one of a free power and one of two terms, for all.
FEW = (Law(("viscous", "slip")), Law(("velocity-power",)), Law(("viscous", "velocity-squared")))


@pytest.mark.parametrize("laws", [FEW, pytest.param(None, marks=pytest.mark.slow)], ids=["few", "all"])
def test_rounding_of_a_force_moves_no_band(peaks, laws):
    """In pounds the points between the test and 60 N round otherwise than in newtons: the draws must be the same."""
    force, amplitude = np.array([10.0, 20.0, 40.0]), np.array([1.0, 1.7, 2.9])
    lb = 4.4482216152605
    newtons = extrapolate_loads(peaks(amplitude, force, OMEGA_N), [60.0], laws=laws).loads.average
    pounds = extrapolate_loads(peaks(amplitude, force / lb, OMEGA_N), [60.0 / lb], laws=laws).loads.average
    for end in ("low", "median", "high"):  # 1e-6 where weights agree to as much; other draws move ends by 3e-3
        np.testing.assert_allclose(getattr(pounds, end), getattr(newtons, end), rtol=1e-6)


@pytest.fixture
def mode() -> Path:
    return data_folder() / "saturn-v" / "modes" / "config-2-mode-1.toml"


@pytest.mark.sampling
def test_a_refusal_has_null_values_and_a_caution(tmp_path, mode, damping, few_laws):
    """Two levels say nothing of twice the force."""
    path, out = tmp_path / "onset.csv", tmp_path / "loads.json"
    rows = [(3.0, 0.2997), (4.0, 0.33)]
    lines = [f"L{i},{F},1.666,{A}" for i, (F, A) in enumerate(rows)]
    path.write_text("\n".join(["sweep,force,frequency,amplitude", *lines]) + "\n")
    run = damping("extrapolate", path, "--mode", mode, "--force", 4.4, "--force", 8, "--json", out)
    assert run.code == 0
    form = json.loads(out.read_text())
    near, far = form["predictions"]
    assert near["low"] < near["median"] < near["high"]
    for name in ("median", "low", "high", "linear", "linear_overprediction_percent"):
        assert far[name] is None
    assert all(m["median"] is None and m["low"] is None and m["high"] is None for m in far["by_model"])
    assert "no prediction beyond the force 6 lb: fewer than 3 levels" in far["cautions"][0]
    np.testing.assert_allclose(far["extrapolation_ratio"], 2.0, rtol=1e-12)
    np.testing.assert_allclose(form["limit"], 6.0, rtol=1e-12)
    for row in form["sensitivity"]:  # other priors allow no more than the answer does
        assert all((row[name] is None) == (row["force"] == 8.0) for name in ("median", "low", "high"))


@pytest.mark.sampling
def test_the_form_shows_parts_exponents_and_other_priors(mode, damping, few_draws):
    record = data_folder() / "saturn-v" / "records" / "config-2-mode-1.csv"
    run = damping("extrapolate", record, "--mode", mode, "--force", 90, "--json", "-")
    assert run.code == 0
    form = json.loads(run.out)
    (prediction,) = form["predictions"]
    assert set(prediction["parts_percent"]) == {"measurement_noise", "parameters", "between_model", "discrepancy"}
    assert len(form["sensitivity"]) == 6
    assert form["next_level"]["expected"] < form["next_level"]["width"]
    assert form["limit"] is None
    # Table 4.II: (19.37, 1.229), (24.95, 1.439), (28.98, 1.567)
    expected = np.log([24.95 / 19.37, 28.98 / 24.95]) / np.log([1.439 / 1.229, 1.567 / 1.439])
    np.testing.assert_allclose([e["p"] for e in form["local_exponents"]], expected, rtol=1e-9)
    np.testing.assert_allclose(sum(m["weight"] for m in prediction["by_model"]), 1.0, rtol=1e-9)


@pytest.mark.sampling
def test_a_record_of_whole_sweeps_goes_through_the_command(tmp_path, damping, swept, few_laws):
    path, mode = tmp_path / "sweeps.csv", tmp_path / "mode.toml"
    mode.write_text('[mode]\nname = "swept"\nfrequency = 1.5915494\nmass = 0.5\n')  # those of ``swept``
    pair = STRUCTURES["viscous + velocity-squared"]
    record = swept(pair.force, np.array([0.5, 1.0, 2.0]), noise=0.005, offset=0.05)
    path.write_text(record_to_csv(record.table))
    run = damping("extrapolate", path, "--mode", mode, "--force", 3, "--json", "-")
    assert run.code == 0
    (prediction,) = json.loads(run.out)["predictions"]
    true = float(pair.amplitude(np.array([3.0]))[0])
    assert prediction["low"] < true < prediction["high"]
    # tested forces are found to a per cent: the noise of 0.5 % and the offset both enter
    np.testing.assert_allclose(prediction["extrapolation_ratio"], 1.5, rtol=0.01)


@pytest.mark.sampling
def test_a_refused_first_force_leaves_the_unit_of_the_others(tmp_path, damping, few_laws):
    """Two levels of 3 and 4 mm: twice the force is refused, and what is predicted beside it is in mm all the same."""
    path, mode = tmp_path / "two.csv", tmp_path / "mode.toml"
    path.write_text("sweep,force,frequency,amplitude\na,3.0,5.0,0.003\nb,4.0,5.0,0.004\n")
    mode.write_text('[mode]\nname = "m"\nfrequency = 5.0\nmass = 100.0\n[units]\nforce = "N"\nlength = "m"\n')
    run = damping("extrapolate", path, "--mode", mode, "--force", 8, "--force", 4.4)
    assert "amplitude at resonance [mm]" in run.out
