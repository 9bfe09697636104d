"""The slip joint, its velocity-squared equivalent, and hysteresis loops as drawn in Figs 2.4 and 2.5."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import i1e

from damping.forces import Slip, VelocitySquared, Viscous, energy_per_cycle
from damping.forces.smooth import Dahl, SmoothJoint, SmoothSlip
from damping_reed1970.chapter_2 import equivalence_error, equivalent_coefficient, exact_energy, loop, printed_energy

#: K = 10, K1 = 4, A1 = .3: the example of erratum E243.
K = 10.0
K1 = 4.0
A1 = 0.3
SLIP = Slip(K - K1, A1)
EXACT = 1e-13  # rounding of closed forms


def parallelogram(A: float) -> float:
    """Shoelace area of the loop of Fig. 2.4c from its corners: slope K over 2 A1, slope K1 over the rest."""
    top = K1 * A + (K - K1) * A1
    q = np.array([A, A - 2 * A1, -A, -A + 2 * A1])
    force = np.array([top, top - 2 * A1 * K, -top, -top + 2 * A1 * K])
    return 0.5 * abs(float(np.dot(q, np.roll(force, -1)) - np.dot(force, np.roll(q, -1))))


def test_energy_of_the_slip_loop_is_the_area_of_its_parallelogram() -> None:
    np.testing.assert_allclose(parallelogram(1.0), 5.04, rtol=EXACT)  # erratum E243
    for A in (0.31, 0.5, 0.9, 1.0, 4.0):
        np.testing.assert_allclose(exact_energy(SLIP, A), parallelogram(A), rtol=1e-12)
        np.testing.assert_allclose(energy_per_cycle(SLIP, A, 7.0), parallelogram(A), rtol=1e-12)


def test_printed_energy_is_right_only_at_three_times_the_limit() -> None:
    np.testing.assert_allclose(printed_energy(SLIP, 1.0), 5.46, rtol=EXACT)
    A = np.array([0.4, 0.9, 1.0, 3.0])
    ratio = printed_energy(SLIP, A) / exact_energy(SLIP, A)
    np.testing.assert_allclose(ratio, (A + A1) / (4 * A1), rtol=1e-12)
    np.testing.assert_allclose(ratio[1], 1.0, rtol=1e-12)


def test_no_energy_while_stuck() -> None:
    A = np.array([0.1, 0.3])
    np.testing.assert_array_equal(exact_energy(SLIP, A), 0.0)
    np.testing.assert_array_equal(printed_energy(SLIP, A), 0.0)


def test_equivalent_coefficients() -> None:
    A, omega = 1.0, 6.0
    # Eq 2.4.4 as printed, and with the exact energy (erratum E243)
    printed = equivalent_coefficient(printed_energy(SLIP, A), A)
    np.testing.assert_allclose(printed, 3 * (A**2 - A1**2) * (K - K1) / (8 * A**3), rtol=EXACT)
    corrected = equivalent_coefficient(exact_energy(SLIP, A), A)
    np.testing.assert_allclose(corrected, 3 * A1 * (A - A1) * (K - K1) / (2 * A**3), rtol=EXACT)
    equivalent = VelocitySquared(float(corrected) / omega**2)
    np.testing.assert_allclose(energy_per_cycle(equivalent, A, omega), exact_energy(SLIP, A), rtol=EXACT)


def test_error_of_the_equivalence_against_amplitude() -> None:
    A = np.array([0.5, 1.0, 2.0])
    error = equivalence_error(SLIP, A, reference=1.0)
    np.testing.assert_allclose(error.coefficient_percent, 100 * ((A + A1) / (4 * A1) - 1), rtol=1e-12)
    # C3 fixed at A = 1: its energy grows as A^3, the joint's as A - A1
    np.testing.assert_allclose(error.corrected_percent, 100 * (A**3 * 0.7 / (A - A1) - 1), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(error.printed_percent[1], 100 * (5.46 / 5.04 - 1), rtol=1e-12)
    assert np.all(error.shape_percent > 0)
    assert np.all(error.shape_percent < 100)  # equal first harmonics: the difference is smaller than the force


def test_loop_of_the_slip_joint_has_the_slopes_of_figure_2_4c() -> None:
    drawn = loop(SLIP, 1.0, 2.0, stiffness=K, points=2001)
    slopes = np.diff(drawn.force) / np.where(np.diff(drawn.q) == 0, np.nan, np.diff(drawn.q))
    moving = np.abs(np.diff(drawn.q)) > 1e-4
    # every piece of the loop has one of the two slopes, but for the four pieces that hold a corner
    near = np.minimum(np.abs(slopes - K), np.abs(slopes - K1))[moving]
    assert np.count_nonzero(near > 1e-6) <= 4
    # the parallelogram's end: K1 A + (K - K1) A1
    np.testing.assert_allclose(np.max(drawn.force), K1 + (K - K1) * A1, rtol=1e-6)


def test_loops_are_closed_and_odd() -> None:
    for force in (Viscous(1.3), VelocitySquared(0.4), SLIP):
        drawn = loop(force, 1.2, 3.0, stiffness=5.0, points=721)
        np.testing.assert_allclose(drawn.q[-1], drawn.q[0], rtol=0, atol=1e-14)
        # one point apart at the closing angle, which rounding may put on the other side of a corner
        np.testing.assert_allclose(drawn.force[-1], drawn.force[0], rtol=0, atol=1e-12)
        np.testing.assert_allclose(drawn.force[:361], -drawn.force[360:], rtol=0, atol=1e-12)


def test_viscous_loop_is_an_ellipse() -> None:
    drawn = loop(Viscous(1.3), 1.2, 3.0)
    # (q/A)^2 + (g/(C A omega))^2 = 1 (Fig. 2.4a)
    np.testing.assert_allclose((drawn.q / 1.2) ** 2 + (drawn.force / (1.3 * 1.2 * 3.0)) ** 2, 1.0, rtol=1e-13)


def yield_smoothly(z: float, q: np.ndarray, relief: float = 1.0) -> np.ndarray:
    """Stretch at rising displacements q (n,) from z on: dz/dq = 1 - beta z - gamma |z|, integrated.

    The limit is 1/(beta + gamma) = 1, and the relief 2 beta.
    """
    beta = 0.5 * relief

    def rate(_: float, z: np.ndarray) -> np.ndarray:
        return 1.0 - beta * z - (1.0 - beta) * np.abs(z)

    stretched = solve_ivp(rate, q[[0, -1]], [z], t_eval=q, rtol=1e-10, atol=1e-12)
    return np.asarray(stretched.y[0])


SMOOTH = [*((a, 1.0) for a in (0.05, 0.4, 1.5, 6.0, 60.0)), (0.4, 2.0), (6.0, 2.0), (1.5, 1.4), (0.4, 0.4), (1.5, 5.0)]


@pytest.mark.parametrize(("a", "relief"), SMOOTH)
def test_averages_of_a_smooth_joint_are_those_of_its_loop(a: float, relief: float) -> None:
    """The loop closes where half a cycle from -Z ends at Z."""
    Z = brentq(lambda Z: yield_smoothly(-Z, np.array([-a, a]), relief)[-1] - Z, 1e-6, 1.0, xtol=1e-12)
    theta = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 4_001)
    q = a * np.sin(theta)
    g = 6.0 * A1 * (yield_smoothly(-Z, q, relief) - q)
    C, S, sine, cosine = (2 / np.pi * np.trapezoid(g * wave, theta) for wave in (
        np.cos(theta), np.sin(theta), np.sin(3 * theta), np.cos(3 * theta)
    ))  # fmt: skip
    joint, omega = SmoothSlip(6.0, A1, relief), np.array([7.0])
    A = np.array([a * A1])
    own = joint.averages(A, omega)
    # the trapezoid of 4000 points, and a table with steps of 1 % that is interpolated along lines
    np.testing.assert_allclose([own[0][0], own[2][0]], [C, S], rtol=2e-5)
    np.testing.assert_allclose(joint.third(A, omega)[0], sine + 1j * cosine, rtol=1e-4)
    before, after = (joint.averages(by * A, omega) for by in (1 / 1.02, 1.02))
    slopes = [(after[k][0] - before[k][0]) / (2 * np.log(1.02)) for k in (0, 2)]
    np.testing.assert_allclose([own[1][0], own[3][0]], slopes, rtol=1e-3, atol=1e-3 * C)  # steps of 2 %, of the table
    np.testing.assert_allclose(joint.cycle(theta, A, omega), g, rtol=0.0, atol=1e-8)  # the integrator's
    np.testing.assert_allclose(joint.cycle(theta + np.pi, A, omega), -g, rtol=0.0, atol=1e-8)  # and the way back


def test_a_smooth_joint_beyond_its_table() -> None:
    """Energy 4 k A1 A and no stiffness left at large amplitudes; averages in proportion to A^2 at small ones."""
    joint, omega = SmoothSlip(6.0, A1), 7.0
    for A in (2000.0, 2e6):  # C = 4 k A1 (1 - 1.25 A1/A)/pi where Z = 1
        C, _, S, _ = joint.averages(np.array([A]), omega)
        expected = [4.0 * 6.0 * A1 / np.pi * (1.0 - 1.25 * A1 / A), -6.0]
        np.testing.assert_allclose([C[0], S[0] / A], expected, rtol=1e-4)
    small, twice = (joint.averages(np.array([A]), omega) for A in (1e-5, 2e-5))
    np.testing.assert_allclose([twice[k][0] / small[k][0] for k in (0, 2)], 4.0, rtol=1e-3)  # A/A1 of the end


@pytest.mark.parametrize("a", [0.05, 1.0, 40.0])
def test_averages_of_a_joint_of_dahl_are_closed(a: float) -> None:
    """C = (4/pi) k A1 (1 - tanh(a)/a), S = k A1 (2 I_1(a)/cosh(a) - a): z is an exponential between the turns."""
    at = np.array([a * A1]), np.array([7.0])
    C, C_slope, S, S_slope = np.ravel(SmoothSlip(6.0, A1, 2.0).averages(*at))
    expected = 4.0 / np.pi * (1.0 - np.tanh(a) / a), 4.0 * i1e(a) / (1.0 + np.exp(-2.0 * a)) - a
    np.testing.assert_allclose([C, S], 6.0 * A1 * np.array(expected), rtol=3e-5)  # of the table, as above
    closed = Dahl(6.0, A1)
    np.testing.assert_allclose(np.ravel(closed.averages(*at))[::2], 6.0 * A1 * np.array(expected), rtol=1e-12)
    # slopes are differences over 1 % of the table; the third harmonic is by 24 points of the loop, which has corners
    np.testing.assert_allclose(np.ravel(closed.averages(*at))[1::2], [C_slope, S_slope], rtol=1e-3, atol=1e-3 * C)
    np.testing.assert_allclose(closed.third(*at)[0], SmoothSlip(6.0, A1, 2.0).third(*at), rtol=1e-2)
    after, before = (closed.in_phase(by * at[0], at[1])[0] for by in (np.exp(1e-4), np.exp(-1e-4)))
    slope = closed.restoring(*at)[1][0]
    np.testing.assert_allclose(slope, (after - before) / 2e-4, rtol=1e-7)  # of the step, squared, and rounding


@pytest.mark.parametrize("relief", [1.0, 2.0])
@pytest.mark.parametrize(("start", "travel"), [(0.2, 0.5), (-0.25, 0.1), (-0.25, 0.9), (0.1, -0.6), (0.1, 0.0)])
def test_a_smooth_joint_follows_its_differential_equation(start: float, travel: float, relief: float) -> None:
    joint, way = SmoothJoint(6.0, A1, relief), -1.0 if travel < 0.0 else 1.0
    expected = start
    if travel:
        expected = way * A1 * yield_smoothly(way * start / A1, np.array([0.0, abs(travel) / A1]), relief)[-1]
    np.testing.assert_allclose(joint.stretch(start, travel), expected, rtol=1e-8)  # the integrator's
    halfway = joint.stretch(start, 0.5 * travel)
    np.testing.assert_allclose(joint.stretch(halfway, 0.5 * travel), joint.stretch(start, travel), rtol=EXACT)
