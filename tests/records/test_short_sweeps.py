"""Sweeps of five to eight rows: a linear mode in closed form, a slipping joint by its describing function."""

import numpy as np
import pandas as pd
import pytest

from damping.records import audit
from damping.records.mode import Mode
from damping.records.record import Record

HERTZ, ZETA, MASS = 20.0, 0.01, 3.0
OMEGA_N = 2.0 * np.pi * HERTZ
MODE = Mode(name="own", frequency=HERTZ, mass=MASS, source="own.toml")
NOISE = 0.01


def swept(half_widths: np.ndarray, levels: int = 3, noise: float = NOISE) -> pd.DataFrame:
    """Sweeps of a linear mode at distances from resonance in half-power half-widths."""
    omega, rng, tables = OMEGA_N * (1.0 + ZETA * half_widths), np.random.default_rng(11), []
    compliance = 1.0 / (MASS * (OMEGA_N**2 - omega**2 + 2j * ZETA * OMEGA_N * omega))
    for level in range(levels):
        phasor = 2.0**level * compliance * np.exp(noise * rng.standard_normal(len(omega)))
        phase = -np.angle(phasor) + noise * rng.standard_normal(len(omega))
        columns = {"frequency": omega / (2.0 * np.pi), "amplitude": abs(phasor), "phase": phase}
        tables.append(pd.DataFrame({"sweep": f"{level}", "force": 2.0**level, **columns}))
    return pd.concat(tables, ignore_index=True)


def found_in(table: pd.DataFrame, mode: Mode | None = MODE) -> list[tuple[str, str]]:
    return [(one.check, one.verdict) for one in audit(Record(table), mode).findings]


def at_level(table: pd.DataFrame, level: str, **factors: float) -> pd.DataFrame:
    changed = {
        name: table[name].where(table["sweep"] != level, factor * table[name]) for name, factor in factors.items()
    }
    return table.assign(**changed)


@pytest.mark.parametrize("rows", [5, 7, 8])
class TestWithPhases:
    """Their phasors F/A exp(i phase) lie on a line whose slope is the mass, to about the noise."""

    def test_right_ones_are_silent(self, rows):
        assert found_in(swept(np.linspace(-3.0, 2.5, rows))) == []

    @pytest.mark.parametrize(("name", "factor"), [("force", 1.0 / 4.448), ("force", 9.81), ("amplitude", 25.4)])
    def test_another_unit_is_refused(self, rows, name, factor):
        table = swept(np.linspace(-3.0, 2.5, rows))
        assert found_in(table.assign(**{name: factor * table[name]})) == [("units", "refuse")]

    def test_the_phase_of_a_velocity_is_refused(self, rows):
        """A quarter turn off: the damping would be that of the row where the velocity is half way in phase."""
        table = swept(np.linspace(-3.0, 2.5, rows))
        found = found_in(table.assign(phase=table["phase"] - 0.5 * np.pi))
        assert "refuse" in [verdict for _, verdict in found]

    def test_the_doubled_force_of_one_level_is_named(self, rows):
        """No mode file is needed: the other levels show the mass."""
        table = at_level(swept(np.linspace(-3.0, 2.5, rows)), "1", force=2.0)
        assert "level-offset" in [check for check, _ in found_in(table, None)]


def jointed(half_widths: list[float]) -> pd.DataFrame:
    """A joint that slips at a third of the largest amplitude (bilinear hysteresis), without phases.

    |Y|^2 = (K + S/A - M omega^2)^2 + (C/A)^2; theta = arccos(1 - 2 x/A), S = k A (theta - sin(2 theta)/2)/pi - k A and
    C = 4 k x (A - x)/(pi A). With 2 zeta K A of force at the largest amplitude, half of it by the joint.
    """
    K, top = MASS * OMEGA_N**2, 1.0
    slip, force = top / 3.0, 2.0 * ZETA * K * top
    k = 0.5 * force * np.pi * top / (4.0 * slip * (top - slip))
    A = np.geomspace(0.01, 2.0, 200_000)
    theta = np.arccos(np.clip(1.0 - 2.0 * slip / A, -1.0, 1.0))
    spring = K + np.where(slip < A, k * (theta - 0.5 * np.sin(2.0 * theta)) / np.pi - k, 0.0)
    loss = np.where(slip < A, 4.0 * k * slip * (A - slip) / (np.pi * A), 0.0)
    resonance = np.sqrt(spring[np.argmin(abs(A - top))] / MASS)
    omega, found = resonance * (1.0 + ZETA * np.array(half_widths)), []
    for w in omega:
        needed = A * np.hypot(spring - MASS * w**2, loss / A + ZETA * K * w / OMEGA_N)
        found.append(A[np.argmax(needed > force)])  # the least amplitude, on which a sweep downwards ends
    return pd.DataFrame({"sweep": "1", "force": force, "frequency": omega / (2.0 * np.pi), "amplitude": found})


def test_a_steep_peak_of_five_rows_is_a_resonance():
    """The second differences of five rows are the peak itself: taken for noise, they hid a fall to less than half."""
    table = jointed([-2.5, -1.25, 0.0, 1.25, 2.5])
    fall = table["amplitude"] / table["amplitude"].max()
    assert fall.idxmax() == 2
    assert fall[[0, 4]].max() < 0.6
    assert ("edge-of-sweep", "refuse") not in found_in(table)


@pytest.mark.parametrize("half_widths", [[-6.0, -4.5, -3.0, -2.0, -1.0], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]])
def test_five_rows_beside_the_resonance_stay_refused(half_widths):
    table = swept(np.array(half_widths)).drop(columns="phase")
    assert ("edge-of-sweep", "refuse") in found_in(table)


@pytest.mark.parametrize("power", [0.0, 2.0])
def test_a_wrong_force_is_named_whatever_bends_the_damping(power):
    """With friction, or a square, Im Y is no line in omega^2, but Re Y is: it shows the mass of every level."""
    omega, tables = OMEGA_N * (1.0 + ZETA * np.linspace(-5.0, 5.0, 15)), []
    for level, top in enumerate([0.25, 0.5, 1.0]):
        C = 2.0 * ZETA * MASS * OMEGA_N**2 * np.array([0.3, 0.7])  # viscous, and of the power, at amplitude 1
        force, A = C @ [top, top**power], np.geomspace(1e-4, 2.0, 200_000)
        inertia, loss = MASS * (OMEGA_N**2 - omega**2), C[0] * A + C[1] * A**power
        needed = np.hypot(A * inertia[:, np.newaxis], loss)
        found = np.argmax(needed > force, axis=1)
        phase = np.arctan2(loss[found], A[found] * inertia)
        columns = {"frequency": omega / (2.0 * np.pi), "amplitude": A[found], "phase": phase}
        tables.append(pd.DataFrame({"sweep": f"{level}", "force": force, **columns}))
    table = pd.concat([table[table["amplitude"] > 1e-3] for table in tables], ignore_index=True)
    assert found_in(table, None) == []
    wrong = [check for check, _ in found_in(at_level(table, "0", force=0.5), None)]
    assert "level-offset" in wrong or "amplitude-falls" in wrong


@pytest.mark.parametrize("rows", [1, 7])
def test_a_channel_that_holds_one_value_is_refused(rows):
    """It gave a damping ratio of nine times the true one without a word: force over a held amplitude grows as force."""
    table = swept(np.linspace(-2.0, 2.0, rows) if rows > 1 else np.zeros(1), levels=4)
    assert ("repeated-sweep", "refuse") in found_in(table.assign(amplitude=0.0113))


def test_a_response_held_by_its_controller_is_no_held_channel():
    """The force falls at resonance by as much as the amplitude would have grown."""
    table = swept(np.linspace(-3.0, 3.0, 9), levels=1)
    assert found_in(table.assign(force=table["force"] * 0.01 / table["amplitude"], amplitude=0.01)) == []


@pytest.mark.parametrize("rows", [5, 15])
@pytest.mark.parametrize("phase", [True, False])
def test_computed_sweeps_of_a_linear_mode_are_no_copies(rows, phase):
    """They are multiples of each other by nature; those with noise are not, and a copied one is named."""
    span = np.linspace(-4.0, 4.0, rows)
    dropped = [] if phase else ["phase"]
    assert found_in(swept(span, noise=0.0).drop(columns=dropped)) == []
    noisy = swept(span, levels=1).drop(columns=dropped)
    copy = noisy.assign(sweep="copy", force=3.0 * noisy["force"], amplitude=3.0 * noisy["amplitude"])
    assert ("repeated-sweep", "caution") in found_in(pd.concat([noisy, copy], ignore_index=True))


def test_one_digit_may_hide_what_a_force_changed():
    """0.01 stands for 0.005 to 0.015."""
    table = swept(np.zeros(1), levels=4)
    assert ("repeated-sweep", "refuse") not in found_in(table.assign(amplitude=0.01))
