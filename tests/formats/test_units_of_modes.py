"""Parameters of every force and effect in other units: there and back, and the same motion swept in both systems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damping import effects, forces
from damping.arrays import INCH_M, POUND_FORCE_N
from damping.formats.quantity import convert_mode, factors
from damping.gap.sweeping import swept
from damping.records.mode import Mode, Units, describe_mode_to_toml, read_mode

US = Units("lbf", "in", "s")
MODE = Mode(name="m", frequency=2.0, mass=1.5, units=US, damping={"viscous": {"coefficient": 0.4}})
#: A table of each, sizes of which all change the motion of ``MODE`` at the force ``F`` by a per cent or more.
FORCES = {
    "viscous": {"coefficient": 0.3},
    "displacement": {"coefficient": 2.0},
    "velocity-squared": {"coefficient": 0.05},
    "displacement-velocity": {"coefficient": 0.3},
    "quadratic-displacement": {"coefficient": 0.3},
    "velocity-power": {"coefficient": 0.1, "exponent": 1.65},
    "displacement-velocity-power": {"coefficient": 0.1, "exponent": 1.3},
    "coulomb": {"coefficient": 1.0},
    "slip": {"stiffness": 8.0, "limit": 0.1},
    "dahl": {"stiffness": 8.0, "limit": 0.1},
}
EFFECTS = {
    "viscous-coefficient": {"relative": 0.3},
    "displacement": {"coefficient": 2.0},
    "velocity-squared": {"coefficient": 0.05},
    "displacement-velocity": {"coefficient": 0.3},
    "quadratic-displacement": {"coefficient": 0.3},
    "velocity-power": {"coefficient": 0.1, "exponent": 1.65},
    "displacement-velocity-power": {"coefficient": 0.1, "exponent": 1.3},
    "coulomb-friction": {"coefficient": 1.0},
    "slip": {"stiffness": 8.0, "limit": 0.1},
    "stiffness-hardening": {"coefficient": 3.0, "exponent": 2.0},
    "stiffness-softening": {"coefficient": 2.0},
    "natural-frequency": {"relative": 0.01},
    "planar-coupling": {"angle": 0.5, "frequency_ratio": 1.02, "damping_ratio": 1.1},
    "second-mode": {"compliance": 0.01, "frequency_ratio": 1.1, "loss": 0.02},
    "residual-modes": {"compliance": 0.01, "frequency_ratio": 1.5, "loss": 0.02},
    "drift": {"frequency": 0.02, "settling": 1.0},
    "amplitude-scale": {"factor": 1.1},
    "phase-lag": {"lag": -0.05},
    "time-delay": {"delay": 0.01},
    "level-offset": {"factor": 1.1, "sweep": 1.0},
    "sensor-saturation": {"level": 0.5},
    "background": {"amplitude": 0.01, "angle": 1.0, "force": 5.0},
    "sweep-rate": {"rate": 0.02},
    "force-dropout": {"depth": 0.3, "width": 0.01, "lorentzian": 1.0},
}
F = 5.0
OMEGA = 2.0 * np.pi * np.linspace(1.95, 2.05, 3)
MODES = {f"force {name}": replace(MODE, damping=MODE.damping | {name: table}) for name, table in FORCES.items()} | {
    f"effect {name}": replace(MODE, effects={name: table}) for name, table in EFFECTS.items()
}
every_mode = pytest.mark.parametrize("mode", MODES.values(), ids=MODES)


def to_si(mode: Mode) -> Mode:
    return convert_mode(mode, factors(US, "si", source=""), "si")


def test_every_force_and_effect_is_tried():
    assert set(FORCES) == set(forces.CATALOGUE)
    assert set(EFFECTS) == set(effects.CATALOGUE)


@every_mode
def test_there_and_back(mode, tmp_path):
    path = tmp_path / "mode.toml"
    path.write_text(describe_mode_to_toml(to_si(mode)))
    back = convert_mode(read_mode(path), factors(Units("N", "m", "s"), "us", source=""), "us")
    for before, after in ((mode.damping, back.damping), (mode.effects, back.effects)):
        assert before.keys() == after.keys()
        for name, table in before.items():
            assert table.keys() == after[name].keys()
            # rounding of a few products and powers
            np.testing.assert_allclose(
                [after[name][key] for key in table], list(table.values()), rtol=1e-14, atol=0.0, err_msg=name
            )


@pytest.fixture(scope="module", autouse=True)
def few_steps():
    """Between three frequencies 20 steps follow a branch as 2000 do: one state is at each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("damping.predict.branches._FEWEST_STEPS", 20)
        yield


@pytest.fixture(scope="module")
def plain(few_steps):
    """The motion of the mode itself."""
    return swept(MODE, F, OMEGA)


@every_mode
def test_the_same_motion_is_swept_in_both_systems(mode, plain):
    us, si = swept(mode, F, OMEGA), swept(to_si(mode), F * POUND_FORCE_N, OMEGA)
    # roots of one equation whose terms differ by rounding; both are found to 1e-8 squared of ln A
    np.testing.assert_allclose(si.amplitude, us.amplitude * INCH_M, rtol=1e-10, atol=0.0)
    np.testing.assert_allclose(si.phase, us.phase, rtol=0.0, atol=1e-10)
    change = np.abs(us.amplitude * np.exp(-1j * us.phase) / (plain.amplitude * np.exp(-1j * plain.phase)) - 1.0)
    assert change.max() > 0.01  # else nothing would be seen of a wrong unit


def test_the_exponent_of_an_effect_stays_as_it_is():
    table = to_si(MODES["effect stiffness-hardening"]).effects["stiffness-hardening"]
    assert table["exponent"] == 2.0
    # force per length squared, of definitions
    np.testing.assert_allclose(table["coefficient"], 3.0 * 4.4482216152605 / 0.0254**2, rtol=1e-14, atol=0.0)
    cubic = to_si(MODES["effect stiffness-softening"]).effects["stiffness-softening"]
    assert set(cubic) == {"coefficient"}  # the exponent is 3 where a file does not name it
    np.testing.assert_allclose(cubic["coefficient"], 2.0 * 4.4482216152605 / 0.0254**3, rtol=1e-14, atol=0.0)
