"""Energy per cycle, phase offset and phase resonance against closed forms and a time integration."""

from math import pi
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.gap.rows import read_rows
from damping.infer.observations import observe
from damping.records import audit
from damping.records.check_edges import find_jump_up
from damping.records.mode import Mode
from damping.records.pairs import phase_offset
from damping.records.reading import read_record
from damping.records.record import Record, energy_per_cycle
from damping.records.resonance import find_jump, find_resonance, number_levels, tabulate_resonances

# mass, rad/s, viscous coefficient: damping ratio C/(2 M OMEGA_N) = 0.005
M = 2.0
OMEGA_N = 60.0
C = 1.2
HALF_WIDTH = C / (2 * M) / (2 * pi)  # half the half-power bandwidth, Hz


def record(force, frequency, amplitude, phase=None, **others):
    columns = {"sweep": "A", "force": force, "frequency": frequency, "amplitude": amplitude, **others}
    if phase is not None:
        columns["phase"] = phase
    return Record.trusted(pd.DataFrame(columns), "made")  # some repeat a row, which no file may


def resonance(record, sweep):
    return find_resonance(sweep, record.table[record.table["sweep"] == sweep])


def linear(frequency, force=1.5):
    """Amplitude and phase of a linear mode under a force amplitude: F/A exp(i phase) = M (omega_n^2 - w^2) + i C w."""
    w = 2 * pi * frequency
    Z = M * (OMEGA_N**2 - w**2) + 1j * C * w
    return force / np.abs(Z), np.angle(Z)


def grid(n, span=5.0):
    return OMEGA_N / (2 * pi) + np.linspace(-span, span, n) * HALF_WIDTH


LINEAR_PEAK = 1.5 / (C * OMEGA_N)  # amplitude at phase pi/2


def friction(force, friction, amplitudes, cubic=0.0):
    """Frequency (rising), amplitude, phase of M q'' + K q + cubic q^3 + h q (in quadrature) + Coulomb friction.

    For a given A below the largest, sin(phase) = (h A + 4 R/pi)/F, and both signs of cos(phase) give a frequency in
    closed form: M w^2 = K + 3/4 cubic A^2 - F cos(phase)/A. No damping here depends on frequency.
    """
    sine = (C * OMEGA_N * amplitudes + 4 * friction / pi) / force
    A, cosine = np.r_[amplitudes, amplitudes[::-1]], np.sqrt(1 - np.r_[sine, sine[::-1]] ** 2)
    cosine[len(amplitudes) :] *= -1
    w = np.sqrt(OMEGA_N**2 + (0.75 * cubic * A**2 - force * cosine / A) / M)
    return w / (2 * pi), A, np.arccos(cosine)


@pytest.mark.parametrize("n", [4, 6, 11, 40])
@pytest.mark.parametrize("control", ["force", "amplitude"])
def test_linear_resonance_is_exact(n, control):
    frequency = grid(n) + 0.13 * HALF_WIDTH  # no row at resonance
    A, phase = linear(frequency)
    F = np.full(n, 1.5)
    if control == "amplitude":
        F, A = F * LINEAR_PEAK / A, np.full(n, LINEAR_PEAK)
    found = resonance(record(F, frequency, A, phase), "A")
    assert found.method == "interpolated"
    # Z is linear in omega but for terms of second order in the distance of the rows used, in damping ratios of 0.005:
    # within one half width for the fit, 3.3 half widths between the rows of n = 4
    rel = 3e-5 if n == 40 else 3e-4
    assert found.amplitude / found.force == pytest.approx(LINEAR_PEAK / 1.5, rel=rel)
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), abs=0.01 * HALF_WIDTH)
    if control == "force" or n == 40:  # two neighbours at constant amplitude are exact in A/F only
        assert found.force == pytest.approx(1.5, rel=rel)


@pytest.mark.parametrize("tilt", [-0.2, 0.0, 0.2])
@pytest.mark.parametrize("depth", [0.0, 0.2, 0.6])
@pytest.mark.parametrize("width", [0.25, 0.5, 1.0, 2.0])
def test_the_tested_force_is_that_at_resonance(tilt, depth, width):
    """A force that rises or falls over the sweep, with a drop of ``width`` half-power bandwidths about resonance."""
    frequency = grid(41, span=3.0) + 0.026 * HALF_WIDTH
    x = (frequency - OMEGA_N / (2 * pi)) / HALF_WIDTH
    force = 1.5 * (1.0 + tilt * x) * (1.0 - depth * np.exp(-np.log(2.0) * (x / width) ** 2))
    A, phase = linear(frequency, force)
    found = resonance(record(force, frequency, A, phase), "A")
    # of the narrowest and deepest drop the lowest row but one is 5 % above its bottom
    assert found.force == pytest.approx(1.5 * (1.0 - depth), rel=0.06 if (depth, width) == (0.6, 0.25) else 0.015)
    assert found.amplitude / found.force == pytest.approx(LINEAR_PEAK / 1.5, rel=3e-4)


@pytest.mark.parametrize("offset", [-0.3, -0.01, 0.0, 0.05, 0.6])
def test_phase_offset_of_a_linear_mode_is_exact(offset):
    frequency = grid(60)
    A, phase = linear(frequency)
    # C/omega is the same for all rows of a viscous mode, so every pair gives the offset to rounding
    assert phase_offset(np.full(60, 1.5), frequency, A, phase + offset) == pytest.approx(offset, abs=1e-12)
    found = resonance(record(1.5, frequency, A, phase + offset), "A")
    assert found.phase_offset == pytest.approx(offset, abs=1e-12)
    assert found.amplitude == pytest.approx(LINEAR_PEAK, rel=3e-5)
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), abs=0.01 * HALF_WIDTH)


@pytest.mark.parametrize("cubic", [-3e4, 0.0, 3e4])
@pytest.mark.parametrize("R", [0.0, 0.5])
def test_phase_offset_whatever_friction_and_stiffness(R, cubic):
    top = (1.5 - 4 * R / pi) / (C * OMEGA_N)
    f, A, phase = friction(1.5, R, top * np.sin(np.linspace(0.1, 1.5, 30)), cubic)
    offset = phase_offset(np.full(60, 1.5), f, A, phase + 0.05)
    # damping independent of frequency, n = 0, displaces it by one damping ratio C/(2 M omega_n^2 A) of the pairs, which
    # friction makes grow as A falls; pairs of unequal amplitude add less than 0.001
    ratio = (C * OMEGA_N + 4 * R / (pi * A)) / (2 * M * OMEGA_N**2)
    assert ratio.min() - 1e-3 < offset - 0.05 < ratio.max() + 1e-3
    found = resonance(record(1.5, f, A, phase + 0.05), "A")
    # sin(phase) is 1 to second order in what is left of the offset; dA/A = F/(F - 4R/pi) times that
    assert found.amplitude == pytest.approx(top, rel=2e-3)


@pytest.mark.parametrize("ratio", [0.005, 0.2])
def test_heavy_damping_of_another_power_of_frequency_is_no_offset(ratio):
    """c omega A + loss omega^2 A^2, in closed form at each amplitude: at phase pi/2 the frequency is the mode's."""
    c, loss, force = 2 * ratio * M * OMEGA_N, 2 * M * ratio, 8 * M * OMEGA_N**2 * ratio
    frequency = OMEGA_N / (2 * pi) * np.linspace(1 - 4 * ratio, 1 + 3 * ratio, 61)  # 0.2: from 0.2 to 1.6
    w = 2 * pi * frequency
    A = np.array([_find_amplitude(force, M * (OMEGA_N**2 - x**2), c * x, loss * x**2) for x in w])
    phase = np.angle(M * (OMEGA_N**2 - w**2) + 1j * (c * w + loss * w**2 * A))
    found = resonance(record(force, frequency, A, phase), "A")
    at_resonance = force / (2 * M * OMEGA_N**2 * _find_amplitude(force, 0.0, c * OMEGA_N, loss * OMEGA_N**2))
    # of a small ratio a false offset is taken off, and moves the frequency by the ratio's square; of a large one none
    # is, and what is left is of the fit of rows as far apart as the half-power points
    assert (found.phase_offset != 0.0) == (ratio == 0.005)
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), rel=at_resonance**2 if ratio == 0.005 else 0.005)
    # an offset beyond any that such a law makes is one
    turned = resonance(record(force, frequency, A, phase + 0.75), "A")
    assert turned.phase_offset == pytest.approx(0.75, abs=at_resonance)


@pytest.mark.parametrize("ratio", [0.06, 0.1, 0.2])
def test_heavy_damping_of_displacement_is_no_offset(ratio):
    """Loss K (1 + 2 i ratio), in closed form: which feigns an offset of a little over one ratio."""
    stiffness = M * OMEGA_N**2
    frequency = OMEGA_N / (2 * pi) * np.linspace(1 - 3 * ratio, 1 + 3 * ratio, 31)
    Z = stiffness * (1 + 2j * ratio) - M * (2 * pi * frequency) ** 2
    found = resonance(record(1.5, frequency, 1.5 / np.abs(Z), np.angle(Z)), "A")
    assert found.phase_offset == 0.0
    # a false offset moves it by the ratio squared; the fit of rows as far apart as the half-power points by less
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), rel=ratio**2 / 20)


def _find_amplitude(force, spring, damping, loss):
    """A with force^2 = A^2 (spring^2 + (damping + loss A)^2), by bisection: it grows with A."""
    low, high = 0.0, force / damping
    for _ in range(100):
        A = 0.5 * (low + high)
        low, high = (A, high) if A * np.hypot(spring, damping + loss * A) < force else (low, A)
    return A


def test_offset_needs_both_wings():
    A, phase = linear(grid(60))
    wing = grid(60) < OMEGA_N / (2 * pi) + 0.2 * HALF_WIDTH
    assert phase_offset(np.full(wing.sum(), 1.5), grid(60)[wing], A[wing], phase[wing] + 0.05) == 0.0
    assert phase_offset(np.full(60, 1.5), grid(60), A, phase + 1.0) == 0.0  # beyond 45 degrees


def test_order_direction_and_repeated_points_do_not_matter():
    frequency = grid(41)
    A, phase = linear(frequency)
    table = record(1.5, frequency, A, phase + 0.05).table
    reference = resonance(Record(table, ""), "A")
    for order in (slice(None, None, -1), np.random.default_rng(3).permutation(41)):
        found = resonance(Record(table.iloc[order].reset_index(drop=True), ""), "A")
        assert (found.force, found.frequency, found.amplitude, found.phase_offset) == pytest.approx(
            (reference.force, reference.frequency, reference.amplitude, reference.phase_offset), rel=1e-9
        )
    twice = Record.trusted(pd.concat([table, table], ignore_index=True), "")
    assert resonance(twice, "A").amplitude == pytest.approx(reference.amplitude, rel=1e-9)


def test_noise_averages_out():
    rng, frequency = np.random.default_rng(7), grid(50)
    A, phase = linear(frequency)
    draws = [
        resonance(
            record(
                1.5,
                frequency,
                A * (1 + 0.01 * rng.standard_normal(50)),
                phase + 0.05 + 0.0125 * rng.standard_normal(50),
            ),
            "A",
        )
        for _ in range(100)
    ]
    errors = np.array([[d.amplitude / LINEAR_PEAK - 1, d.phase_offset - 0.05] for d in draws])
    # 9 rows lie between the half-power points; three are spent on the fit: 1 % / sqrt(9/3) and less; 4 standard errors
    assert errors[:, 0].std() < 0.0075
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, rtol=0, atol=4 * 0.0075 / 10)
    assert all(d.method == "interpolated" for d in draws)


@pytest.mark.parametrize("cubic", [-2e6, 2e6])
def test_a_sweep_that_jumps(cubic):
    """A bistable mode, swept in the direction in which the branch of large amplitude is followed to its end."""
    f, A, phase = friction(1.5, 0.0, LINEAR_PEAK * np.sin(np.linspace(0.05, 1.55, 200)), cubic)
    below = np.arange(200)  # the rising side; its mirror is the other
    branch = below if cubic > 0 else 399 - below
    beyond = f[branch].max() * 1.002 if cubic > 0 else f[branch].min() * 0.998
    low, low_phase = linear(np.array([beyond]))  # small amplitudes are linear
    kept = slice(20, 199, 20)
    for noise in (0.0, 0.3):  # carries the phase after the jump beyond pi, or below 0: no Im Z there
        last = low_phase + noise * np.sign(cubic)
        rows = np.r_[f[branch][kept], beyond], np.r_[A[branch][kept], low], np.r_[phase[branch][kept], last]
        found = resonance(record(1.5, *rows), "A")
        assert found.method == "interpolated"
        # the last row before the jump is at sin(phase) = sin(1.41) = 0.987; equal h on both branches gives the rest
        assert found.amplitude == pytest.approx(LINEAR_PEAK, rel=5e-3)


@pytest.mark.parametrize(
    ("every", "amplitude", "lag", "said"), [(10, 0.2, 1.1, True), (29, 0.86, 0.43, False)], ids=["fallen", "falling"]
)
def test_a_row_read_during_a_jump_is_no_resonance(every, amplitude, lag, said):
    """A softening mode falls off its large branch: a dwell is over before the motion has settled on the small one.

    The row has the amplitude of the small branch and a phase of resonance, among rows that are fitted, or the reverse
    beside few rows. It moved the resonance by 9 and 13 %.
    """
    f, A, phase = friction(1.5, 0.0, LINEAR_PEAK * np.sin(np.linspace(0.05, 1.55, 200)), -2e6)
    branch = (399 - np.arange(200))[19:199:every]
    beyond = f[branch].min() * (1.0 - 0.002 * np.arange(1, 12))
    low, low_phase = linear(beyond[1:])
    rows = (
        np.r_[f[branch], beyond],
        np.r_[A[branch], amplitude * LINEAR_PEAK, low],
        np.r_[phase[branch], lag, low_phase],
    )
    swept = record(1.5, *rows)
    found = resonance(swept, "A")
    assert found.amplitude == pytest.approx(LINEAR_PEAK, rel=0.01)  # the last rows before the jump: sin(phase) > 0.99
    assert found.row < len(f[branch])
    assert said == ("outlier" in {finding.check for finding in audit(swept).findings})


@pytest.mark.parametrize("power", [0.2, 2.0, 3.0])
def test_a_coarse_sweep_of_damping_far_from_viscous(power):
    """Steps of 2.2 half-widths, one row near resonance: beside it D = 1.5 (A/top)^p has another 1/Im Z altogether."""
    K, frequency = M * OMEGA_N**2, OMEGA_N / (2 * pi) + HALF_WIDTH * np.array([-4.3, -2.1, 0.1, 2.3, 4.5])
    spring = K - M * (2 * pi * frequency) ** 2

    def excess(A, k):
        return (spring * A)[k] ** 2 + (1.5 * (A[k] / LINEAR_PEAK) ** power) ** 2 - 1.5**2

    low, high = np.zeros(5), np.full(5, LINEAR_PEAK)
    for _ in range(60):  # bisections
        A = 0.5 * (low + high)
        above = np.array([excess(A, k) > 0.0 for k in range(5)])
        low, high = np.where(above, low, A), np.where(above, A, high)
    phase = np.arctan2(1.5 * (A / LINEAR_PEAK) ** power, spring * A)
    found = resonance(record(1.5, frequency, A, phase), "A")
    assert found.amplitude == pytest.approx(LINEAR_PEAK, rel=0.03)  # as for a row at |cot| < 0.25
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), abs=0.05 * HALF_WIDTH)  # Re Z is nearly linear


def test_an_antiresonance_is_no_row_in_transition():
    """A mode of unit mass and frequency with an absorber of a hundredth: a trough with the phase of a resonance."""
    w = np.linspace(0.8, 1.2, 61) + 0.2 * 0.4 / 61
    share, joint = 0.01, 0.01 * (1.0 + 0.004j * w)
    Z = 1.0 - w**2 + 0.01j * w + joint - joint**2 / (joint - share * w**2)
    swept = record(1.0, 10.0 * w, 1.0 / np.abs(Z), np.angle(Z))
    assert "outlier" not in {finding.check for finding in audit(swept).findings}


@pytest.mark.parametrize("cubic", [-2e6, 2e6])
@pytest.mark.parametrize("growth", [0.0, 3.0])
def test_a_sweep_that_jumps_past_resonance(cubic, growth):
    """A bistable mode swept against its bend: the small branch to its fold, then the large one beside resonance.

    With h A (1 + growth (A/top)^2) in quadrature both branches are closed form, as in ``friction``.
    """
    top = LINEAR_PEAK

    def damping(A):
        return C * OMEGA_N * A * (1 + growth * (A / top) ** 2)

    A = np.linspace(0.02, 1.0, 20001) * top
    A = A[damping(A) < 1.5]
    cubic *= (top / A[-1]) ** 2  # bent alike
    phase = np.arcsin(damping(A) / 1.5)
    squared = OMEGA_N**2 + 0.75 * cubic * A**2 / M
    side = np.sign(cubic)  # the small branch above resonance of a hardening spring, the large one below it
    small, large = (np.sqrt(squared + s * side * 1.5 * np.cos(phase) / A / M) / (2 * pi) for s in (1.0, -1.0))
    fold = int(np.argmin(side * small))
    before = small[fold] + side * HALF_WIDTH * (0.1 + 0.4 * np.arange(20)[::-1])
    after = small[fold] - side * HALF_WIDTH * (0.3 + 0.4 * np.arange(12))
    amplitude, lag = (
        np.r_[
            np.interp(side * before, side * small[fold::-1], own[fold::-1]), np.interp(side * after, side * large, big)
        ]
        for own, big in ((A, A), (pi - phase, phase))
    )
    lag = lag if cubic > 0 else pi - lag
    swept = record(1.5, np.r_[before, after], amplitude, lag)
    found = resonance(swept, "A")
    assert (found.method, found.amplitude) == ("beside", amplitude.max())
    assert found.amplitude < 0.95 * A[-1]  # it is none at the force of the sweep, 1.5
    assert found.force == pytest.approx(damping(found.amplitude), rel=1e-6)
    bent = np.sqrt(OMEGA_N**2 + 0.75 * cubic * found.amplitude**2 / M) / (2 * pi)
    assert found.frequency == pytest.approx(bent, abs=0.01 * HALF_WIDTH)
    said = [f.what for f in audit(swept).findings if f.check == "edge-of-sweep"]
    assert len(said) == 1
    assert f"sweep A between {before[-1]:.4g} and {after[0]:.4g} Hz" in said[0]

    # without phases the largest reading is taken; backwards it is the end of the branch, where the sweep jumps down
    columns = np.r_[before, after], amplitude
    up, down = (audit(record(1.5, *(column[::way] for column in columns))) for way in (1, -1))
    said, said_backwards = ([f.what for f in found.findings if "jumps up" in f.what] for found in (up, down))
    assert len(said) == 1
    assert f"sweep A between {before[-1]:.4g} and {after[0]:.4g} Hz" in said[0]
    assert not said_backwards


@pytest.mark.parametrize("growth", [0.0, 1.0])
@pytest.mark.parametrize("rig", ["held", "unloaded"])
def test_the_resonance_of_a_force_that_falls_there_is_where_the_response_per_force_is_largest(rig, growth):
    """A controller that holds the response, or a shaker with inductance, whose largest amplitude is beside resonance.

    |Z| is least at resonance, where it is the damping force over the amplitude; no phases are recorded, 0.3 % noise.
    """
    rng = np.random.default_rng(6)
    frequency = grid(41)
    w, motion = 2 * pi * frequency, np.full(41, LINEAR_PEAK)
    for _ in range(200 if rig == "unloaded" else 1):
        Z = M * (OMEGA_N**2 - w**2) + 1j * C * w * (1 + growth * motion / LINEAR_PEAK)
        motion = motion if rig == "held" else 0.5 * motion + 0.5 * 6.0 / np.abs(Z + (3 + 3j) * C * w)
    force, amplitude = (column * (1 + 0.003 * rng.standard_normal(41)) for column in (np.abs(Z) * motion, motion))
    swept = record(force, frequency, amplitude)
    found = resonance(swept, "A")
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), abs=0.3 * HALF_WIDTH)
    true = C * OMEGA_N * (1 + growth * found.amplitude / LINEAR_PEAK)
    # 0.3 half-widths from resonance |Z| is 4 % above C omega, and the noise of a ratio is 0.4 %
    assert found.force / found.amplitude == pytest.approx(true, rel=0.05)
    assert np.argmax(amplitude) != found.row
    assert observe(swept).D.tolist() == [found.force]  # laws are weighed there too


@pytest.mark.parametrize("known", ["phase", "energy"])
def test_a_dwell_beside_resonance_has_its_force_in_quadrature(known):
    """Sweeps of one row, 0.6 half-widths below and above: C omega A at their amplitudes, as a ranking takes it."""
    frequency = OMEGA_N / (2 * pi) + np.array([-0.6, 0.6]) * HALF_WIDTH
    A, phase = linear(frequency, force=np.array([1.0, 2.0]))
    damping = C * 2 * pi * frequency * A
    columns = {"phase": phase} if known == "phase" else {"energy": pi * damping * A}
    data = observe(record([1.0, 2.0], frequency, A, sweep=["A", "B"], **columns))
    np.testing.assert_allclose(data.tested_force, damping, rtol=1e-12)
    np.testing.assert_allclose(data.D, data.tested_force, rtol=1e-12)


def test_the_largest_row_beside_resonance_has_the_damping_force_of_its_energy():
    """Rows from 0.8 half-widths on, without phases: |Z| is 28 % above C omega, which the energy holds."""
    frequency = OMEGA_N / (2 * pi) + np.array([-1.6, -1.2, -0.8, 0.9, 1.4]) * HALF_WIDTH
    A, phase = linear(frequency)
    found = resonance(record(1.5, frequency, A, energy=pi * 1.5 * A * np.sin(phase)), "A")
    assert (found.method, found.row) == ("peak", 2)
    assert found.force == pytest.approx(C * 2 * pi * frequency[2] * A[2], rel=1e-12)


@pytest.mark.parametrize("row", [3, 12, 19, 27])
def test_one_low_reading_of_the_force_is_no_resonance(row):
    frequency = grid(41)
    force = np.full(41, 1.5)
    force[row] *= 0.5
    assert resonance(record(force, frequency, linear(frequency)[0]), "A").row == 20


def test_no_sweep_of_a_linear_mode_jumps_up():
    """|A/F| of a linear mode falls beside its largest row by at least its rise, whatever the step; 3 % noise."""
    rng = np.random.default_rng(2)
    for step in np.tile([0.1, 0.4, 1.0, 3.0], 50):
        frequency = grid(31, span=15.0 * step) + rng.uniform(-0.5, 0.5) * step * HALF_WIDTH
        A = linear(frequency)[0] * (1 + 0.03 * rng.standard_normal(31))
        assert find_jump_up(np.full(31, 1.5), frequency, A) is None


def test_a_coarse_sweep_of_a_linear_mode_does_not_jump():
    """Neighbours 1 to 6 half-widths apart, 3 % noise: however far the phase steps, the resonance stays."""
    rng = np.random.default_rng(1)
    for step in np.tile([1.0, 2.0, 4.0, 6.0], 50):
        frequency = grid(9, span=4.0 * step) + rng.uniform(-0.5, 0.5) * step * HALF_WIDTH
        A, phase = linear(frequency)
        noisy = A * (1 + 0.03 * rng.standard_normal(9)), phase + 0.03 * rng.standard_normal(9)
        assert find_jump(np.full(9, 1.5), frequency, *noisy) is None


def test_repeated_points_alone():
    frequency = np.repeat(grid(2, span=0.7), 4)
    A, phase = linear(frequency)
    found = resonance(record(1.5, frequency, A, phase), "A")
    # Z is linear in omega to second order in 0.7 damping ratios of 0.005
    assert (found.force, found.amplitude) == pytest.approx((1.5, LINEAR_PEAK), rel=3e-5)


@pytest.mark.parametrize("ends", [-1.0, -4.0, 1.5])
def test_a_sweep_that_ends_beside_its_resonance_tells_the_damping_there(ends):
    """Half-power half-widths from resonance: of a linear mode C omega A at the last row, and its natural frequency."""
    frequency = grid(41)
    frequency = frequency[np.sign(ends) * (frequency - OMEGA_N / (2 * pi)) > abs(ends) * HALF_WIDTH]
    A, phase = linear(frequency)
    found = resonance(record(1.5, frequency, A, phase), "A")
    nearest = int(np.argmax(A))
    assert (found.method, found.row, found.amplitude) == ("beside", nearest, A[nearest])
    # Re Z is a line in omega^2 and Im Z is C omega: rounding alone, larger by Z over C omega
    assert found.force == pytest.approx(C * 2 * pi * frequency[nearest] * A[nearest], rel=1e-12)
    assert found.frequency == pytest.approx(OMEGA_N / (2 * pi), rel=1e-9)


def test_friction_is_read_beside_resonance_at_the_amplitude_that_was_reached():
    """h A + 4 R/pi at the last row, which the force of the sweep, 1.5, is not."""
    reached = (1.5 - 4 * 0.3 / pi) / (C * OMEGA_N) * np.linspace(0.1, 0.7, 40)
    frequency, A, phase = (values[: len(reached)] for values in friction(1.5, 0.3, reached))  # rising, below resonance
    found = resonance(record(1.5, frequency, A, phase), "A")
    assert found.method == "beside"
    assert found.force == pytest.approx(C * OMEGA_N * reached[-1] + 4 * 0.3 / pi, rel=1e-12)  # 1.18


def test_a_bent_resonance_beside_the_rows_is_that_of_the_amplitude_that_was_reached():
    """M omega^2 = K + (3/4) cubic A^2 at the last amplitude; the frequency moves by 40 half-widths on the way there."""
    cubic = 4e7
    reached = 1.5 / (C * OMEGA_N) * np.linspace(0.1, 0.7, 40)
    frequency, A, phase = (values[: len(reached)] for values in friction(1.5, 0.0, reached, cubic))
    found = resonance(record(1.5, frequency, A, phase), "A")
    bent = np.sqrt(OMEGA_N**2 + 0.75 * cubic * reached[-1] ** 2 / M) / (2 * pi)
    assert (found.method, found.amplitude) == ("beside", A.max())
    assert found.frequency == pytest.approx(bent, rel=1e-9)  # three columns that hold Re Z exactly
    assert abs(bent - frequency[-1]) > 0.5 * HALF_WIDTH


def test_without_phases_the_largest_amplitude_is_taken_for_the_resonance():
    frequency = grid(41)
    A, phase = linear(frequency)
    # phases counted as lead pass -pi/2, not pi/2
    assert resonance(record(1.5, frequency, A, -phase), "A").method == "peak"
    assert resonance(record(1.5, frequency, A), "A").method == "peak"


@pytest.mark.parametrize("rows", [(0.82, -0.9, -0.3), (0.7, -0.88, -0.35)])
@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_coarse_sweeps_without_phases_are_read_between_their_rows(power, rows):
    """C of a power of amplitude: both sides of a resonance are known in closed form, whose nearest row reads 90 %."""
    tables, peaks, shares = [], [1e-3, 2e-3, 4e-3], np.append(rows, 0.3)
    for label, peak in zip("ABC", peaks, strict=True):
        A, loss = np.abs(shares) * peak, C * OMEGA_N * np.abs(shares * peak / 2e-3) ** (power - 1.0)
        F = C * OMEGA_N * (peak / 2e-3) ** (power - 1.0) * peak
        square = OMEGA_N**2 + np.sign(shares) * np.sqrt((F / A) ** 2 - loss**2) / M
        tables.append(record(F, np.sqrt(square) / (2 * pi), A, sweep=label).frame)
    coarse = Record(pd.concat(tables, ignore_index=True), "made")
    found = tabulate_resonances(coarse)
    # exact for a power of amplitude once the turns for A_r and for the power have settled
    np.testing.assert_allclose(found["amplitude"], peaks, rtol=0.01)
    np.testing.assert_allclose(found["frequency"], OMEGA_N / (2 * pi), rtol=1e-3)
    said = [f for f in audit(coarse).findings if f.check == "edge-of-sweep"]
    assert [f.verdict for f in said] == ["caution"]
    assert "above the largest reading" in said[0].what


def test_one_row_a_sweep_is_at_resonance():
    table = pd.DataFrame({"sweep": ["b", "a"], "force": [1.0, 2.0], "frequency": [3.0, 4.0], "amplitude": [5.0, 6.0]})
    rows = tabulate_resonances(Record(table, "made"))
    assert list(rows.columns) == ["sweep", "force", "frequency", "amplitude", "phase_offset", "method", "row"]
    assert rows.to_numpy().tolist() == [["b", 1.0, 3.0, 5.0, 0.0, "row", 0], ["a", 2.0, 4.0, 6.0, 0.0, "row", 1]]
    np.testing.assert_allclose(energy_per_cycle(Record(table, "made")), [5 * pi, 12 * pi], rtol=1e-15)


def test_energy_per_cycle():
    table = pd.DataFrame(
        {
            "sweep": ["a", "a", "b", "a"],
            "force": [1.0, 2.0, 3.0, 4.0],
            "frequency": 1.0,
            "amplitude": [1.0, 3.0, 2.0, 3.0],
        }
    )
    largest = pi * np.array([1.0, 6.0, 6.0, 12.0])
    nan = np.nan  # the first row of largest amplitude stands for its sweep
    np.testing.assert_allclose(energy_per_cycle(Record(table, "")), [nan, largest[1], largest[2], nan], rtol=1e-15)
    phase = np.array([0.1, -0.1, 1.0, 3.3])
    expected = largest * np.sin(phase)
    np.testing.assert_allclose(energy_per_cycle(Record(table.assign(phase=phase), "")), expected, rtol=1e-15)
    given = np.array([4.0, 3.0, 2.0, 1.0])
    assert energy_per_cycle(Record(table.assign(phase=phase, energy=given), "")).tolist() == given.tolist()


VALUES = st.floats(min_value=1e-50, max_value=1e50) | st.sampled_from([1.0, 2.0])
ROWS = st.lists(
    st.tuples(st.sampled_from("ab"), VALUES, VALUES, VALUES, st.floats(-2 * pi, 2 * pi)), min_size=1, max_size=30
)


@settings(deadline=None, max_examples=100)
@given(rows=ROWS)
def test_any_record_has_finite_resonances(rows):
    table = pd.DataFrame(rows, columns=["sweep", "force", "frequency", "amplitude", "phase"])
    found = tabulate_resonances(Record.trusted(table, ""))
    assert len(found) == table["sweep"].nunique()
    assert np.isfinite(found[["force", "frequency", "amplitude", "phase_offset"]].to_numpy()).all()
    assert (table["sweep"].to_numpy()[found["row"]] == found["sweep"]).all()


def steady_state(frequency, force, loss, cubic):
    """Fundamental harmonic of M q'' + 4 C q' + loss q'|q'| + K q + cubic q^3 = F sin(w t) by RK4, all frequencies."""
    w, steps, cycles = 2 * pi * frequency, 64, 150  # exp(-150 * 2 pi * ratio) of the transient is left, ratio >= 0.02
    dt = 2 * pi / w / steps
    q, v = np.zeros_like(w), np.zeros_like(w)

    def acceleration(q, v, k):
        pull = force * np.sin(2 * pi * k / steps) - 4 * C * v - loss * v * np.abs(v) - M * OMEGA_N**2 * q - cubic * q**3
        return pull / M

    sine, cosine = np.zeros_like(w), np.zeros_like(w)
    for k in range(steps * cycles):
        if k >= steps * (cycles - 1):
            sine, cosine = sine + q * np.sin(2 * pi * k / steps), cosine + q * np.cos(2 * pi * k / steps)
        a1 = acceleration(q, v, k)
        v2, a2 = v + dt / 2 * a1, acceleration(q + dt / 2 * v, v + dt / 2 * a1, k + 0.5)
        v3, a3 = v + dt / 2 * a2, acceleration(q + dt / 2 * v2, v + dt / 2 * a2, k + 0.5)
        v4, a4 = v + dt * a3, acceleration(q + dt * v3, v + dt * a3, k + 1)
        q, v = q + dt / 6 * (v + 2 * v2 + 2 * v3 + v4), v + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return 2 / steps * np.hypot(sine, cosine), np.arctan2(-cosine, sine)


@pytest.mark.parametrize("cubic", [0.0, 4e3])
def test_against_time_integration(cubic):
    """Energy balance at resonance, pi F A = pi (4 C w A^2 + 8/(3 pi) loss w^2 A^3), with w from the record itself."""
    frequency, force, loss = grid(31, span=24.0) + 0.01, 150.0, 1.5
    A, phase = steady_state(frequency, force, loss, cubic)
    found = resonance(record(force, frequency, A, phase + 0.04), "A")
    w = 2 * pi * found.frequency
    b, a = 4 * C * w, 8 / (3 * pi) * loss * w**2
    balance = (-b + np.sqrt(b**2 + 4 * a * force)) / (2 * a)
    # harmonics above the first change A by less than 0.1 %, the fit of five to ten rows by as much
    assert found.amplitude == pytest.approx(balance, rel=3e-3)
    # viscous and quadratic damping, n = 1 and 2: no more than one damping ratio, here up to 0.05
    ratio = force / balance / (2 * M * w**2)
    assert abs(found.phase_offset - 0.04) < ratio


def test_levels_are_forces_and_repeats_share_one():
    assert number_levels(np.array([0.158, 0.471, 0.029, 0.148, 0.275, 0.483])).tolist() == [1, 3, 0, 1, 2, 3]
    assert number_levels(np.array([5.0])).tolist() == [0]
    # a chain of small steps does not become one level: each is compared with the first of its level
    assert number_levels(np.array([1.0, 1.07, 1.14, 1.21])).tolist() == [0, 0, 1, 1]


def test_ranking_and_diagnosis_number_levels_alike():
    """10 and 10.7 are one level to both, 15 another."""
    levels = {"a": 10.0, "b": 10.7, "c": 15.0}
    rows = [(name, F, f, 1.0 / (1.0 + abs(f - 2.0))) for name, F in levels.items() for f in (1.9, 2.0, 2.1)]
    record = Record(pd.DataFrame(rows, columns=["sweep", "force", "frequency", "amplitude"]), "made")
    assert number_levels(observe(record).tested_force).tolist() == [0, 0, 1]
    assert read_rows(record, Mode(name="m", frequency=2.0, mass=1.0)).levels.tolist() == [0, 0, 1]


@pytest.mark.parametrize("example", ["tank", "bolted-joint"])
def test_the_order_of_rows_moves_nothing(example):
    """Without a time rows that make no legs up or down are taken by frequency: neighbours are those of the sweep."""
    measured = read_record(Path(__file__).parents[2] / "examples" / example / "record.csv")
    own = measured.table.groupby("sweep", sort=False)
    mixed = Record(pd.concat([rows.sample(frac=1.0, random_state=1) for _, rows in own]))
    columns = ["sweep", "force", "frequency", "amplitude", "phase_offset"]
    pd.testing.assert_frame_equal(tabulate_resonances(mixed)[columns], tabulate_resonances(measured)[columns])
    # bit by bit the same, and so is what is drawn: sweeps in any order too
    for rows in (mixed.table, measured.table.sample(frac=1.0, random_state=2)):
        assert observe(Record(rows)).content == observe(measured).content


def test_a_held_response_does_not_jump_up():
    """Forces fall at resonance; noise of 1 % makes the largest amplitude beside it."""
    frequency = OMEGA_N / (2 * pi) * (1.0 + 0.03 * np.arange(-4, 5))
    amplitude = LINEAR_PEAK * (1.0 + 0.01 * np.array([0.0, -1.0, 1.0, 2.0, 0.0, -1.0, 1.0, 0.0, -1.0]))
    w = 2 * pi * frequency
    force = np.abs(M * (OMEGA_N**2 - w**2) + 1j * C * w) * amplitude
    assert find_jump_up(force, frequency, amplitude) is None
