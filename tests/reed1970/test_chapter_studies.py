"""Studies of chapters II and IV: loops, slip, response curves and differences, lines through the sweeps."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest
from scipy import stats

from damping.forces import energy_per_cycle
from damping.forces.joints import Slip
from damping.predict.steady import steady_state
from damping_reed1970.chapter_2 import REFERENCE, equal_amplitudes, hysteresis_loops, printed_energy, slip_equivalent
from damping_reed1970.chapter_4 import PRINTED, SWEEP_C, resonances
from damping_reed1970.chapter_4.amplitude_frequency import RATIOS, amplitude_frequency, section_4_2_points
from damping_reed1970.chapter_4.levels import tabulate_chance_of_exponent
from damping_reed1970.chapter_4.lines import coefficient_lines, force_amplitude_lines

CURVES = amplitude_frequency(SWEEP_C["M"], SWEEP_C["omega_n"], SWEEP_C["F_e"], SWEEP_C["A_m"], (1.0, 100.0))


def test_loop_areas_are_energies() -> None:
    found = hysteresis_loops()
    # trapezoidal rule over 1440 steps: of the order of (pi/720)^2 = 2e-5 of the loss
    np.testing.assert_allclose(found.areas["area"], found.areas["energy_per_cycle"], rtol=2e-5, atol=0.0)
    assert set(found.areas["force"]) == {*found.loops}
    assert len(found.loops) == 10  # nine forces and case V
    same = found.areas.set_index("force").drop("slip")["energy_per_cycle"]
    np.testing.assert_allclose(same, same.iloc[0], rtol=1e-12, atol=0.0)
    for loop in found.loops.values():
        # closed; the mean of the loop's force over the cycle is nought: no force here pushes one way
        np.testing.assert_allclose([loop.q[0], loop.force[0]], [loop.q[-1], loop.force[-1]], rtol=0.0, atol=1e-12)


def test_slip_and_its_equivalent() -> None:
    found = slip_equivalent()
    A, exact = found.energies["amplitude"].to_numpy(), found.energies["exact"].to_numpy()
    # the printed energy is (A + A1)/(4 A1) times the exact one (erratum E243)
    np.testing.assert_allclose(found.energies["printed"] / exact, (A + 1.0) / 4.0, rtol=1e-12, atol=0.0)
    # corner polygon of the joint: exact area, whatever the steps; and equal energy of the equivalent at the reference
    energy = float(energy_per_cycle(Slip(0.75, 1.0), REFERENCE, 1.0))
    np.testing.assert_allclose(found.slip.area, energy, rtol=1e-9, atol=0.0)
    np.testing.assert_allclose(found.corrected.area, energy, rtol=2e-5, atol=0.0)  # trapezoidal rule, as above
    printed = float(printed_energy(Slip(0.75, 1.0), REFERENCE))
    np.testing.assert_allclose(found.printed.area, printed, rtol=2e-5, atol=0.0)
    # C3 fixed: the equivalent's energy grows with the cube of amplitude
    growth = found.energies["corrected_equivalent"] / A**3
    np.testing.assert_allclose(growth, energy / REFERENCE**3, rtol=1e-12, atol=0.0)


def test_amplitudes_at_which_slip_and_its_stand_ins_lose_the_same() -> None:
    energies = slip_equivalent().energies
    # (A + 1)/4 = 1 at A = 3; 3 (A - 1) = (3/8) A^3 at 2 and sqrt(5) - 1. Straight lines between 300 amplitudes
    np.testing.assert_allclose(equal_amplitudes(energies, "printed"), [3.0], rtol=1e-5, atol=0.0)
    found = equal_amplitudes(energies, "corrected_equivalent")
    np.testing.assert_allclose(found, [sqrt(5.0) - 1.0, 2.0], rtol=1e-4, atol=0.0)


@pytest.mark.parametrize("curve", CURVES.curves, ids=lambda curve: curve.name)
@pytest.mark.parametrize("side", [0, 1])
def test_curves_are_steady_states(curve, side: int) -> None:  # type: ignore[no-untyped-def]  # a CaseCurve
    away = slice(0, -1)  # at the peak itself the curve's slope is infinite
    omega = CURVES.omega_n * np.sqrt(curve.eta_squared[side, away])
    state = steady_state(curve.force, CURVES.F, omega, CURVES.M, CURVES.omega_n)
    # near the peak amplitude changes by the square of a distance known to rounding
    np.testing.assert_allclose(state.amplitude, CURVES.amplitude[away], rtol=1e-9, atol=0.0)
    np.testing.assert_allclose(state.phase, curve.phase[side, away], rtol=0.0, atol=1e-6)


def test_every_case_passes_the_measured_resonance() -> None:
    assert CURVES.amplitude[-1] == CURVES.A_m
    for curve in CURVES.curves:
        force = float(curve.force.quadrature(CURVES.A_m, CURVES.omega_n))
        np.testing.assert_allclose(force, SWEEP_C["F_e"], rtol=1e-12, atol=0.0)
        # damping falls with frequency, so the curve has the amplitude A_m once more a little below resonance, at the
        # distance n G^2 for damping like omega^n, n <= 2; there the phase is n G from a quarter turn
        G = SWEEP_C["F_e"] / (SWEEP_C["M"] * SWEEP_C["omega_n"] ** 2 * SWEEP_C["A_m"])
        np.testing.assert_allclose(curve.eta_squared[:, -1], 1.0, rtol=0.0, atol=2.01 * G**2)
        np.testing.assert_allclose(curve.phase[:, -1], np.pi / 2.0, rtol=0.0, atol=2.01 * G)


def test_case_i_in_closed_form() -> None:
    curve = CURVES.curves[0]
    xi = SWEEP_C["F_e"] / (2.0 * SWEEP_C["M"] * SWEEP_C["omega_n"] ** 2 * SWEEP_C["A_m"])
    u = 2.0 * xi / RATIOS[:-1]
    # (1 - eta^2)^2 + (2 xi eta)^2 = u^2, the lower root; its error is that of a difference of numbers near 1
    eta_squared = 1.0 - 2.0 * xi**2 - np.sqrt(u**2 - 4.0 * xi**2 + 4.0 * xi**4)
    np.testing.assert_allclose(curve.eta_squared[0, :-1], eta_squared, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(curve.delta[:-1], u - (1.0 - eta_squared), rtol=0.0, atol=1e-12)


def test_what_section_4_2_says_of_the_curves() -> None:
    widths = CURVES.widths.query("amplitude_over_resonant == 0.5").set_index("case")["width_eta_squared"]
    # "Case I has the narrowest spike and Case IV is the widest", III slightly inside IV, II slightly outside I, V wider
    # than IV for alpha = 100
    assert widths["case I"] < widths["case II"] or widths["case II"] == pytest.approx(widths["case I"], rel=1e-3)
    assert widths["case II"] < widths["case V, α = 1"] < widths["case IV"] < widths["case V, α = 100"]
    assert widths["case III"] == pytest.approx(widths["case IV"], rel=1e-3)
    points = section_4_2_points(CURVES).set_index("quantity")
    error = points.loc["per cent error at half the resonant amplitude"]
    # 100 (1 - sqrt(3)/2) with G at omega_n; "a maximum error of 14 percent"
    assert error["computed_with_G_at_omega_n"] == pytest.approx(100.0 * (1.0 - sqrt(0.75)), rel=1e-9)
    assert error["computed"] < error["printed"]
    distance = points.loc["distance of the undamped curve at A = 1.01 in", "computed"]
    assert distance == pytest.approx(0.005169, abs=5e-7)  # E4-8, six decimals
    assert PRINTED["curves"]["delta"] == pytest.approx(points.loc["delta at A = 1.01 in", "computed"], rel=0.01)


def test_lines_of_figure_4_1() -> None:
    found = coefficient_lines(1)
    line = found.lines.query("cases == 'I + IV'")
    F, A, omega = resonances(1, "corrected")
    fitted = stats.linregress(A, F / (omega * A))
    expected = fitted.intercept + fitted.slope * line["amplitude_in"]
    # two-parameter line: rounding
    np.testing.assert_allclose(line["C_1_lb_s_per_in"], expected, rtol=1e-10, atol=0.0)
    at_rest = line.iloc[0]
    half = stats.t.ppf(0.95, 1) * fitted.intercept_stderr
    np.testing.assert_allclose(at_rest["high"] - at_rest["C_1_lb_s_per_in"], half, rtol=1e-9, atol=0.0)


def test_lines_of_figure_4_10() -> None:
    for mode in (1, 2):
        found = force_amplitude_lines(mode)
        F, A, _ = resonances(mode, "corrected")
        slope, intercept = np.polyfit(np.log(A), np.log(F), 1)
        expected = (found.lines["force_lb"] / np.exp(intercept)) ** (1.0 / slope)
        np.testing.assert_allclose(found.lines["refitted"], expected, rtol=1e-9, atol=0.0)
        assert (found.lines["low"] < found.lines["refitted"]).all()
        # printed and linear lines go through sweep C
        for column, p in (("printed_slope", found.exponents[1]), ("linear", 1.0)):
            anchored = F[2] * (found.lines[column] / A[2]) ** p
            np.testing.assert_allclose(anchored, found.lines["force_lb"], rtol=1e-10, atol=0.0)


def test_chance_of_the_exponents_by_simulation() -> None:
    rng, runs = np.random.default_rng(3), 200_000
    for row in tabulate_chance_of_exponent().to_dict("records"):
        _, A, _ = resonances(row["mode"], "corrected")
        x = np.log(A) + 0.01 * rng.standard_normal((runs, 3))  # linear damping: ln F = constant + ln A, A read with 1 %
        x = x - x.mean(axis=1, keepdims=True)
        slope = (x @ np.log(A)) / np.sum(x * x, axis=1)
        # the spread of the slopes is known to 0.16 per cent from so many runs (0.65 at four standard errors), and to
        # 0.3 in first order of 1 per cent over the range of ln A; the chance, 2.3 to 2.6 standard deviations out,
        # changes by up to 7.7 times as much
        chance = stats.norm.sf((row["p"] - 1.0) / (5.0 * slope.std()))
        np.testing.assert_allclose(row["chance_at_5_percent"], chance, rtol=0.075, atol=0.0)
        at_needed = stats.norm.sf((row["p"] - 1.0) / (row["needed_percent"] * slope.std()))
        np.testing.assert_allclose(at_needed, 0.05, rtol=0.075, atol=0.0)
