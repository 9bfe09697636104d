"""Damping ratio and frequency against amplitude: closed forms, quantiles the other way round, cover on known truths."""

from __future__ import annotations

import tracemalloc
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping import extrapolation
from damping.extrapolation import extrapolate_loads
from damping.extrapolation.backbone import Backbone, find_backbone
from damping.extrapolation.cautions import UNKNOWN
from damping.extrapolation.curve import NO_RATIO, find_crossing, predict_forces, trace_loads
from damping.extrapolation.prediction import PARTS, Band, Loads
from damping.forces import CubicStiffness, Sum, VelocityPower, VelocitySquared, Viscous
from damping.infer.evidence import brief_evidence
from damping.infer.law import Law
from damping.predict.steady import phase_resonance, resonant_amplitude
from damping.report.forms import loads_form

M = 0.3
OMEGA_N = 10.0
FORCE = np.array([1.0, 2.0, 4.0])


def known(force, amplitude) -> Loads:
    """Predictions without discrepancy."""
    nothing = np.zeros(len(force))
    band = Band("law", 1.0, *([amplitude] * 5))
    parts = dict.fromkeys(PARTS, nothing)
    return Loads(force, 0.9, band, (band,), parts, amplitude, force, ((),) * len(force))


def backbone_of(amplitude, omega, mass_sd=0.0) -> Backbone:
    return Backbone(amplitude, np.broadcast_to(omega, amplitude.shape) * 1.0, np.full(len(amplitude), M), mass_sd)


@pytest.mark.parametrize(("viscous", "quadratic"), [(0.12, 0.0), (0.0, 0.05), (0.1, 0.05)])
def test_ratio_is_the_closed_form(viscous, quadratic, peaks):
    """C = c1 omega A + 8/(3 pi) c2 (omega A)^2 (Table 2.II, cases I and III), so zeta = c1/(2 M omega) + ... A."""
    force = Sum((*([Viscous(viscous)] * (viscous > 0.0)), *([VelocitySquared(quadratic)] * (quadratic > 0.0))))

    def ratio(A):
        return (viscous / OMEGA_N + 8.0 / (3.0 * np.pi) * quadratic * A) / (2.0 * M)

    amplitude = resonant_amplitude(force, FORCE, OMEGA_N)
    traced = trace_loads(known(FORCE, amplitude), backbone_of(amplitude, OMEGA_N), peaks(amplitude, FORCE, OMEGA_N))
    # the median of one known frequency is exact, to the 60 bisections of its quantile
    np.testing.assert_allclose(traced.damping_ratio.median, ratio(amplitude), rtol=1e-9)
    np.testing.assert_allclose(traced.q.median, 0.5 / ratio(amplitude), rtol=1e-9)
    assert traced.tested.all()


def test_a_tested_amplitude_is_tested_though_no_force_is_known_there(peaks):
    """The rows reached it, whatever the laws can say of it: a beating decay's rows were called beyond the test."""
    asked = 0.5 * FORCE
    data = peaks(asked, FORCE, OMEGA_N)
    unknown = np.full(len(asked), np.nan)
    loads = replace(known(unknown, asked), amplitude=np.append(asked, 8.0), cautions=((),) * 4)
    loads = replace(loads, average=Band("law", 1.0, *([np.full(4, np.nan)] * 5)))
    traced = trace_loads(loads, backbone_of(asked, OMEGA_N), data)
    assert traced.tested.tolist() == [True, True, True, False]


def test_an_amplitude_without_a_known_frequency_has_no_ratio_and_says_so(peaks):
    """ln A beyond what the backbone's powers of amplitude hold as numbers."""
    A = np.array([1.0, 2.0, 4.0])
    omega = OMEGA_N * (1.0 - 0.01 * A)
    asked = np.array([3.0, 1e120])
    loads = known(0.12 * OMEGA_N * asked, asked)
    traced = trace_loads(loads, backbone_of(A, omega), peaks(A, 0.12 * omega * A, omega))
    assert np.isfinite(traced.damping_ratio.median).tolist() == [NO_RATIO not in said for said in traced.cautions]
    assert NO_RATIO not in traced.cautions[0]
    assert NO_RATIO in traced.cautions[1]


def test_a_power_law_has_a_ratio_of_one_power_less(peaks):
    """C = b A^p omega^p, so that zeta grows as A^(p-1)."""
    amplitude = resonant_amplitude(VelocityPower(0.2, 1.65), FORCE, OMEGA_N)
    traced = trace_loads(known(FORCE, amplitude), backbone_of(amplitude, OMEGA_N), peaks(amplitude, FORCE, OMEGA_N))
    slope = np.diff(np.log(traced.damping_ratio.median)) / np.diff(np.log(amplitude))
    np.testing.assert_allclose(slope, 0.65, rtol=1e-9)


def test_a_spring_that_hardens_lowers_the_ratio_by_its_frequency(peaks):
    """zeta = C/(2 M omega(A)^2 A) with omega(A) on the backbone of a cubic spring."""
    amplitude, omega = phase_resonance(Sum((Viscous(0.12), CubicStiffness(0.5))), FORCE, M, OMEGA_N)
    bone = backbone_of(amplitude, omega)
    traced = trace_loads(known(FORCE, amplitude), bone, peaks(amplitude, FORCE, omega))
    # three levels on a curve in A^2: its evidence is largest, and other powers differ by less than 0.2 % there
    np.testing.assert_allclose(traced.frequency.median, omega / (2.0 * np.pi), rtol=2e-3)
    np.testing.assert_allclose(traced.damping_ratio.median, 0.12 / (2.0 * M * omega), rtol=4e-3)


@pytest.mark.parametrize("stiffness", [0.5, -0.2])
def test_amplitudes_are_solved_along_a_backbone_that_moves(stiffness):
    """C(A, omega(A)) = F of a cubic spring beyond the test; at the frequency of the test viscous A is F/(c omega).

    Each draw has a backbone of its own, as powers beside A^2 fit three levels too: their central 90 % hold the truth,
    and their median is within 2 % of it; the single frequency errs by more than twice as much.
    """
    amplitude, omega = phase_resonance(Sum((Viscous(0.12), CubicStiffness(stiffness))), FORCE, M, OMEGA_N)
    force = FORCE[-1:] * 1.5
    truth, _ = phase_resonance(Sum((Viscous(0.12), CubicStiffness(stiffness))), force, M, OMEGA_N)
    drawn = backbone_of(amplitude, omega).solve(Viscous(np.full((500, 1), 0.12)), force, omega[-1])
    low, median, high = np.quantile(drawn, [0.05, 0.5, 0.95])
    assert low < truth[0] < high
    assert abs(median - truth[0]) < 0.02 * truth[0]
    assert abs(force[0] / (0.12 * omega[-1]) - truth[0]) > 0.04 * truth[0]


def test_a_cubic_spring_is_followed_far_beyond_the_test():
    """omega^2 = omega_0^2 (1 + b A^2) in closed form, 8 % up in the test and 42 % up at 2.5 times its amplitude.

    A line in ln omega over A^2 says 13 % more; powers beside 2 leave less than .5 % open after five exact levels.
    """
    A = np.geomspace(0.3, 1.0, 5)
    said = backbone_of(A, OMEGA_N * np.sqrt(1.0 + 0.166 * A**2)).frequency_at(np.array([2.5]), 0.9)
    truth = OMEGA_N * np.sqrt(1.0 + 0.166 * 2.5**2) / (2.0 * np.pi)
    np.testing.assert_allclose(said.median, truth, rtol=0.005)
    assert said.low < truth < said.high


def test_a_resonance_that_becomes_bistable_beyond_the_test_is_told(peaks):
    """omega^2 = omega_0^2 (1 + b A^2) in closed form: bandwidths c/M that it has moved by at twice and four times F."""
    A = np.geomspace(0.3, 1.0, 5)

    def omega(A):
        return OMEGA_N * np.sqrt(1.0 + 0.02 * A**2)

    data, asked = peaks(A, 0.12 * omega(A) * A, omega(A)), np.array([1.0, 1.5, 2.5])
    moved = (omega(asked) - omega(A[0])) / (0.12 / M)
    assert (moved > 1.0).tolist() == [False, False, True]
    traced = trace_loads(known(0.12 * omega(asked) * asked, asked), backbone_of(A, omega(A)), data)
    assert [len(said) for said in traced.cautions] == [0, 0, 1]
    assert f"move by {moved[2]:.1f} half-power bandwidths" in traced.cautions[2][0]
    of_masses = replace(data, tested_mass=np.full(len(A), M))  # levels of several masses say nothing of a spring
    assert not any(trace_loads(known(asked, asked), backbone_of(A, omega(A)), of_masses).cautions)


def test_the_band_of_a_predicted_amplitude_moves_the_frequency(peaks):
    """omega^2 = omega_0^2 (1 + b A^2) in closed form: an amplitude between 2 and 3 leaves theirs."""
    A = np.geomspace(0.3, 1.0, 5)

    def omega(A):
        return OMEGA_N * np.sqrt(1.0 + 0.02 * A**2)

    asked, ends = np.array([2.4]), np.array([2.0, 3.0])
    loads = known(0.12 * omega(asked) * asked, asked)
    said = trace_loads(
        replace(loads, average=replace(loads.average, low=ends[:1], high=ends[1:])),
        backbone_of(A, omega(A)),
        peaks(A, 0.12 * omega(A) * A, omega(A)),
    ).frequency
    # the backbone itself is known to 0.1 % there
    hertz = omega(ends) / (2.0 * np.pi)
    np.testing.assert_allclose([said.low[0], said.high[0]], hertz, rtol=3e-3)
    assert np.ptp(hertz) > 0.04 * said.median[0]


@pytest.mark.filterwarnings("error")
def test_an_end_of_a_band_beyond_all_numbers_is_no_warning(peaks):
    """Its frequency is not predicted; that of the median stays."""
    A = np.geomspace(0.3, 1.0, 5)
    omega = OMEGA_N * np.sqrt(1.0 + 0.02 * A**2)
    asked = np.array([1.0])
    loads = known(0.12 * omega[-1:] * asked, asked)
    loads = replace(loads, average=replace(loads.average, high=np.array([1e200])))
    said = trace_loads(loads, backbone_of(A, omega), peaks(A, 0.12 * omega * A, omega)).frequency
    np.testing.assert_allclose(said.median, omega[-1] / (2.0 * np.pi), rtol=1e-3)  # as well as the backbone is known


def test_mass_that_was_added_at_every_level_makes_no_mode_bistable(peaks):
    """5 % of the mass, on all levels, moves every resonance by 2.4 %, or 2.5 bandwidths c/M: the mode stays linear."""
    A, c = np.array([1.0, 2.0, 4.0]), 0.01 * M * OMEGA_N
    lower = OMEGA_N / np.sqrt(1.05)
    data = replace(peaks(A, c * lower * A, lower), added_mass=np.full(3, 0.05 * M))
    traced = trace_loads(known(c * OMEGA_N * 2.0 * A, 2.0 * A), backbone_of(A, OMEGA_N), data)
    assert not any(traced.cautions)


def test_a_resonance_that_hardly_moves_is_solved_at_its_frequency():
    amplitude, omega = phase_resonance(Sum((Viscous(0.12), CubicStiffness(1e-3))), FORCE, M, OMEGA_N)
    drawn = backbone_of(amplitude, omega).solve(Viscous(np.full((3, 1), 0.12)), FORCE * 2.0, omega[-1])
    np.testing.assert_allclose(drawn, np.tile(FORCE * 2.0 / (0.12 * omega[-1]), (3, 1)), rtol=1e-12)


def test_mass_and_amplitude_widen_the_ratio(peaks):
    amplitude = np.array([1.0, 2.0, 4.0])
    data = peaks(amplitude, FORCE, OMEGA_N)
    bare, heavy = (
        trace_loads(known(FORCE, amplitude), backbone_of(amplitude, OMEGA_N, sd), data) for sd in (0.0, 0.02)
    )
    frequency = np.log(bare.damping_ratio.high / bare.damping_ratio.median)
    # 90 % of a normal is 1.645 deviations; squares add
    whole = np.hypot(1.6449 * 0.02, frequency)
    np.testing.assert_allclose(np.log(heavy.damping_ratio.high / heavy.damping_ratio.median), whole, rtol=1e-3)


def test_crossings_are_exact_on_straight_logarithms():
    force = np.geomspace(1.0, 100.0, 7)
    asked = np.array([1.5, 3.0, 9.0, 30.0])
    found = find_crossing(force, force**0.6, asked)
    np.testing.assert_allclose(found[:3], asked[:3] ** (1.0 / 0.6), rtol=1e-9)
    assert np.isnan(found[3])  # 100^0.6 = 15.8


def test_frequency_of_levels_in_no_trend_is_their_mean():
    bone = backbone_of(np.array([1.0, 2.0, 3.0, 4.0]), OMEGA_N)
    said = bone.frequency_at(np.array([4.0, 40.0]), 0.9)
    np.testing.assert_allclose(said.median, OMEGA_N / (2.0 * np.pi), rtol=1e-9)
    assert np.diff(said.high - said.low) > 0.0


def test_no_frequency_is_predicted_for_another_mode():
    """Lines in a power of amplitude leave every frequency somewhere: beyond twice, or half, nothing is said."""
    A = np.array([1.0, 2.0, 3.0, 4.0])
    bone = backbone_of(A, OMEGA_N * (1.0 + 0.02 * A / 4.0))
    said = bone.frequency_at(np.array([4.0, 40.0, 4e4, 4e12]), 0.9)
    assert np.isfinite(said.median).tolist() == np.isfinite(said.low).tolist() == [True, True, False, False]


def test_a_joint_loses_no_more_stiffness_than_it_has():
    """A slider of a tenth of the stiffness, tested to 1.6 times its limit: far beyond, omega^2 is 0.9 of what it was.

    S/A by quadrature of the hysteresis loop, f = max(A1 - (A - q), -A1) on the way down, not by the closed form.
    """
    angle = np.pi * (np.arange(4000) + 0.5) / 4000.0
    A = np.array([0.3, 0.8, 1.2, 1.4, 1.6, 6.4])
    force = np.maximum(np.minimum(1.0, A)[:, None] - A[:, None] * (1.0 - np.cos(angle)), -np.minimum(1.0, A)[:, None])
    omega = OMEGA_N * np.sqrt(0.9 + 0.1 * 2.0 * np.mean(force * np.cos(angle), axis=1) / A)
    said = backbone_of(A[:-1], omega[:-1]).frequency_at(A[-1:], 0.9)
    np.testing.assert_allclose(said.median, omega[-1:] / (2.0 * np.pi), rtol=3e-3)  # the limits tried are 12 % apart
    assert said.low[0] < omega[-1] / (2.0 * np.pi) < said.high[0]


def test_bands_of_frequency_hold_the_next_reading():
    """Joints that soften as a power of amplitude not among those tried, read with noise; twice the tested amplitude."""
    rng, inside = np.random.default_rng(8), 0
    A = np.geomspace(1.0, 3.0, 4)
    trials = 40
    for _ in range(trials):
        power, loss, noise = rng.uniform(0.3, 1.6), np.exp(rng.uniform(np.log(5e-4), np.log(2e-2))), 4e-4
        true = OMEGA_N * (1.0 - loss * (np.append(A, 6.0) / 3.0) ** power)
        read = true * np.exp(noise * rng.standard_normal(5))
        said = backbone_of(A, read[:4]).frequency_at(np.array([6.0]), 0.9)
        inside += bool(said.low[0] < read[4] / (2.0 * np.pi) < said.high[0])
    # 40 trials of 0.9: a standard deviation of 0.047; two of them below
    assert inside / trials >= 0.81


def test_a_curve_that_friction_ends_is_a_line_there():
    """A = 2 (F - 1), of which nothing is known from F = 1 to 1.5, nor below: straight to the last force that holds."""
    force = np.array([0.5, 1.0, 1.5, 2.0])
    amplitude = np.array([0.0, 0.0, 1.0, 2.0])
    np.testing.assert_allclose(find_crossing(force, amplitude, np.array([1e-3, 0.5])), [1.0005, 1.25], rtol=1e-12)
    assert np.isnan(find_crossing(force[1:], np.array([np.nan, 1.0, 2.0]), np.array([0.5]))).all()
    with np.errstate(over="raise"):  # friction alone may leave next to no amplitude
        find_crossing(force, np.array([0.0, 1e-308, *np.ones(len(force) - 2)]), np.array([1e3]))


def record_of(force, amplitude, omega) -> dp.Record:
    rows = {"sweep": [f"L{i}" for i in range(len(force))], "force": force, "amplitude": amplitude}
    return dp.Record(pd.DataFrame({**rows, "frequency": omega / (2.0 * np.pi)}))


def test_mass_is_that_of_the_rows_and_what_was_added_is_taken_off(peaks):
    amplitude = resonant_amplitude(Viscous(0.12), FORCE, OMEGA_N)
    record = record_of(FORCE, amplitude, np.full(3, OMEGA_N))
    mode = dp.Mode(name="m", frequency=OMEGA_N / (2.0 * np.pi), mass=M)
    np.testing.assert_allclose(find_backbone(record, mode).mass, M, rtol=1e-12)
    # the last sweep with a quarter of the mass added, at the frequency that follows: the backbone is the bare one's
    table = record.table
    last = table["sweep"] == table["sweep"].iloc[-1]
    slowed = table.assign(
        added_mass=np.where(last, 0.25 * M, 0.0), frequency=table["frequency"] / np.where(last, np.sqrt(1.25), 1.0)
    )
    bare = find_backbone(dp.Record(slowed), mode)
    np.testing.assert_allclose(bare.omega, find_backbone(record, mode).omega, rtol=1e-12)
    # masses of three states, at the frequencies that follow of one stiffness: predictions are for the last
    mass = np.array([1.2, 1.1, 0.9]) * M
    emptied = record.table.assign(mass=mass, frequency=record.table["frequency"] * np.sqrt(M / mass))
    of_last = find_backbone(dp.Record(emptied), mode)
    np.testing.assert_allclose(of_last.omega, OMEGA_N * np.sqrt(M / mass[-1]), rtol=1e-12)
    np.testing.assert_allclose(of_last.mass, mass[-1], rtol=1e-12)
    np.testing.assert_allclose(of_last.stiffness_at(amplitude), M * OMEGA_N**2, rtol=1e-12)
    heavy = dp.Record(record.table.assign(mass=2.0 * M))
    traced = trace_loads(known(FORCE, amplitude), find_backbone(heavy, mode), peaks(amplitude, FORCE, OMEGA_N))
    np.testing.assert_allclose(traced.damping_ratio.median, 0.12 / (4.0 * M * OMEGA_N), rtol=1e-9)


LAWS = (Law(("viscous", "velocity-squared")), Law(("velocity-power",)))
TRUE = Sum((Viscous(0.06), VelocitySquared(0.012)))


@pytest.fixture
def few_laws(few_laws, monkeypatch):
    """Two laws in place of all, and draws of the normal approximation: the curve is tested here, not the laws."""
    monkeypatch.setattr(extrapolation, "resonant_laws", lambda: LAWS)
    monkeypatch.setattr(extrapolation, "evidence", brief_evidence)


def test_force_for_an_amplitude_is_the_inverse(peaks, few_laws):
    force = np.geomspace(1.0, 4.0, 4)
    data = peaks(resonant_amplitude(TRUE, force, OMEGA_N), force, OMEGA_N)
    there = extrapolate_loads(data, [6.0], laws=LAWS, estimate=brief_evidence)
    A = there.loads.average
    back = predict_forces(there, [float(A.median[0]), float(A.high[0])])
    # the same draws on a grid of 24 forces instead of one: Monte Carlo of the ends, 3 % of the band
    np.testing.assert_allclose(back.average.median[0], 6.0, rtol=0.01)
    np.testing.assert_allclose(back.average.low[1], 6.0, rtol=0.03)
    assert loads_form(back)["predictions"][0]["amplitude"] == A.median[0]
    # an amplitude asked for beside far ones has the force that it has alone, but for other draws
    beside = predict_forces(there, float(A.median[0]) * np.array([1.0, 50.0, 0.02]))
    np.testing.assert_allclose(beside.average.median[0], back.average.median[0], rtol=0.005)
    beyond = predict_forces(
        extrapolate_loads(data.take_sweeps(np.arange(4) > 1), [4.0], laws=LAWS, estimate=brief_evidence), [50.0]
    )
    assert np.isnan(beyond.average.median[0])  # two levels go no farther than 1.5 times the force
    assert "no prediction" in beyond.cautions[0][0]


@pytest.mark.parametrize("share", [150.0, 1e6])
def test_uncertainties_of_many_times_the_value_leave_nothing_known(share, few_laws):
    """Readings known to a factor of e^150 say nothing of any load, and no warning of numbers out of range appears."""
    force, M = np.geomspace(1.0, 8.0, 4), 2.0
    A = resonant_amplitude(VelocitySquared(0.02), force, OMEGA_N)
    table = {"sweep": list("abcd"), "force": force, "frequency": OMEGA_N / (2.0 * np.pi), "amplitude": A}
    record = dp.Record(pd.DataFrame({**table, "amplitude_sd": share * A, "force_sd": share * force}))
    mode = dp.Mode(name="m", frequency=OMEGA_N / (2.0 * np.pi), mass=M, damping={"viscous": {"coefficient": 0.2}})
    by_force = dp.extrapolate(record, mode, [4.0, 8e3, 1e-3]).to_json()["predictions"]
    by_amplitude = dp.curve(record, mode, A[-1] * np.array([2.0, 1e4, 1e-4])).to_json()["rows"]
    ends = [row["damping_ratio"][end] for row in (*by_force, *by_amplitude) for end in ("median", "low", "high")]
    assert ends == [None] * 18
    assert all(UNKNOWN in row["cautions"] for row in by_force)


def test_nothing_is_said_three_decades_beyond_the_test(peaks, few_laws):
    """At 1e6 lb the Saturn V had a damping ratio of 4e-274 to 5e275 %: no number is known there, and that is said."""
    force = np.geomspace(1.0, 4.0, 4)
    omega = OMEGA_N * (1.0 - 0.002 * np.arange(4))
    data = peaks(resonant_amplitude(TRUE, force, omega), force, omega)
    there = extrapolate_loads(data, [8.0, 4e7, 4e9], laws=LAWS, estimate=brief_evidence)
    assert [UNKNOWN in said for said in there.loads.cautions] == [False, True, True]
    assert np.isfinite(there.loads.average.high).tolist() == [True, False, False]
    assert np.isnan([band.high[1:] for band in there.loads.by_model]).all()
    assert there.next_level is None
    back = predict_forces(there, data.tested_amplitude.max() * np.array([2.0, 1e4]))
    assert [UNKNOWN in said for said in back.cautions] == [False, True]
    assert np.isfinite(back.average.high).tolist() == [True, False]


def test_a_band_of_frequency_that_leaves_the_mode_gives_no_ratio(peaks):
    """Two readings 3 % apart: 30 times beyond them their power of amplitude may have halved the frequency, or not."""
    A = np.array([1.0, 2.0])
    omega = OMEGA_N * np.array([1.0, 0.97])
    loads = known(0.12 * OMEGA_N * (asked := np.array([2.0, 60.0])), asked)
    traced = trace_loads(loads, backbone_of(A, omega), peaks(A, 0.12 * omega * A, omega))
    assert [NO_RATIO in said for said in traced.cautions] == [False, True]
    assert np.isnan([part.high[1] for part in (traced.frequency, traced.damping_ratio)]).all()


def test_the_force_for_a_small_amplitude_goes_to_that_of_friction(peaks, few_laws):
    """F = 4 R/pi + c omega A (Table 2.I); below 4 R/pi nothing moves, and nothing was told of amplitudes just above."""
    held, per_amplitude = 0.7, 0.12 * OMEGA_N
    A = np.array([0.3, 0.8, 2.0])
    data = peaks(A, held + per_amplitude * A, OMEGA_N)
    there = extrapolate_loads(data, [4.0], laws=(Law(("viscous", "coulomb")),), estimate=brief_evidence)
    asked = A[0] * np.array([1e-4, 0.05, 0.3, 0.7])
    said = predict_forces(there, asked).average
    true = held + per_amplitude * asked
    np.testing.assert_allclose(said.median, true, rtol=0.0, atol=0.04)  # one of 16 steps between 0.4 and 1
    np.testing.assert_allclose(said.median[2:], true[2:], rtol=0.002)  # where the curve is known on both sides
    assert np.all((said.low < true) & (true < said.high))
    assert np.all(np.isfinite(said.high))


@pytest.mark.slow
def test_ratio_and_frequency_hold_the_truth(peaks):
    """A known structure read with 2 % of noise: the ratio that the next test would show, in and beyond the test."""
    rng = np.random.default_rng(3)
    force, asked = np.geomspace(1.0, 4.0, 5), np.array([4.0, 8.0])
    inside, trials = np.zeros(2), 16
    for _ in range(trials):
        noise = np.exp(0.02 * rng.standard_normal(7))
        A = resonant_amplitude(TRUE, np.append(force, asked), OMEGA_N) * noise
        data = peaks(A[:5], force, OMEGA_N)
        loads = extrapolate_loads(data, asked, laws=LAWS, estimate=brief_evidence).loads
        said = trace_loads(loads, backbone_of(A[:5], OMEGA_N * np.exp(2e-4 * rng.standard_normal(5))), data)
        true = asked / (2.0 * M * OMEGA_N**2 * A[5:])
        inside += (said.damping_ratio.low < true) & (true < said.damping_ratio.high)
        assert np.all((said.frequency.low < OMEGA_N / 6.25) & (said.frequency.high > OMEGA_N / 6.32))
    # 16 trials of 0.9 are 12 or more in 98 of a hundred
    assert np.all(inside >= 12)


@pytest.mark.usefixtures("few_laws")
@pytest.mark.parametrize("reading", [0.99, 1.01])
def test_the_largest_tested_force_is_tested_whichever_way_its_reading_is_off(reading):
    """The laws' amplitude there lies beside the reading, which is noisy; the force itself was applied."""
    force = np.geomspace(1.0, 4.0, 4)
    amplitude = resonant_amplitude(TRUE, force, OMEGA_N) * np.array([1.0, 1.0, 1.0, reading])
    mode = dp.Mode(name="m", frequency=OMEGA_N / (2.0 * np.pi), mass=M)
    asked = dp.curve(record_of(force, amplitude, np.full(4, OMEGA_N)), mode, forces=[1.0, 4.0, 4.1])
    assert asked.table["tested"].tolist() == [True, True, False]


@pytest.mark.usefixtures("few_laws")
def test_curve_goes_over_the_test_and_beyond():
    force = np.geomspace(1.0, 4.0, 4)
    amplitude = resonant_amplitude(TRUE, force, OMEGA_N)
    mode = dp.Mode(name="m", frequency=OMEGA_N / (2.0 * np.pi), mass=M)
    result = dp.curve(record_of(force, amplitude, np.full(4, OMEGA_N)), mode)
    table = result.table
    assert table["tested"].any()
    assert not table["tested"].all()
    np.testing.assert_allclose(table["amplitude"].iloc[0], amplitude[0], rtol=1e-12)
    true = 0.5 * (0.06 / OMEGA_N + 8.0 / (3.0 * np.pi) * 0.012 * table["amplitude"]) / M
    assert np.all((table["damping_ratio_low"] < true) & (true < table["damping_ratio_high"]))
    row = result.to_json()["rows"][0]
    assert set(row) >= {"amplitude", "force", "frequency", "damping_ratio", "q", "tested"}
    assert set(row["damping_ratio"]) == {"median", "low", "high"}
    asked = dp.curve(record_of(force, amplitude, np.full(4, OMEGA_N)), mode, amplitudes=[2.0], forces=[3.0])
    assert asked.table["amplitude"].tolist()[0] == 2.0
    assert asked.table["force"].tolist()[1] == 3.0


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"amplitudes": [-1.0]}, "amplitude -1.*expected an amplitude > 0"),
        ({"forces": [0.0]}, "force 0.*expected a force amplitude > 0"),
        ({"amplitudes": [1.0], "level": 2.0}, "level 2.*expected a probability"),
        ({"amplitudes": [1.0], "level": "0.9"}, "level '0.9'; expected a probability"),
        ({"forces": ["5"]}, "force '5'; expected a force amplitude > 0"),
    ],
)
def test_what_cannot_be_asked(asked, said):
    mode = dp.Mode(name="m", frequency=1.0, mass=M)
    with pytest.raises(dp.InputError, match=said):
        dp.curve(record_of(FORCE, FORCE, np.full(3, 6.28)), mode, **asked)
    with pytest.raises(dp.InputError, match="beside"):
        dp.extrapolate(record_of(FORCE, FORCE, np.full(3, 6.28)), mode, [1.0], amplitudes=[1.0])


def test_the_frequencies_of_a_trace_take_no_more_memory_than_a_few():
    """At once, the mixtures of a figure's trace took 100 MB; the frequencies are those of each amplitude alone."""
    backbone = backbone_of(np.array([1.0, 2.0, 4.0]), OMEGA_N * np.array([1.0, 0.999, 0.996]))
    along = np.geomspace(0.5, 8.0, 300)

    def peak(amplitude):
        tracemalloc.start()
        found = backbone.frequency_at(amplitude, 0.9)
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most, found

    few, (most, found) = peak(along[:100])[0], peak(along)
    assert most < 1.5 * few
    for i in (0, 99, 100, 299):
        np.testing.assert_allclose(found.low[i], backbone.frequency_at(along[i : i + 1], 0.9).low[0], rtol=1e-9)
