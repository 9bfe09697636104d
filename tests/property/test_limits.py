"""Limits of damping forces and of their responses: p -> 1 and alpha -> 0 are viscous; a joint that has just slipped."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.forces import (
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    Force,
    QuadraticDisplacement,
    Slip,
    Sum,
    VelocityPower,
    VelocitySquared,
    Viscous,
)
from damping.predict.steady import resonant_amplitude, steady_state

# first mode of Configuration II (Table 4.V)
M = 50.78
OMEGA_N = 10.455

few = settings(max_examples=40, deadline=None)  # a busy machine is no failure
C1 = st.floats(0.1, 10.0)
A = st.floats(0.01, 10.0)
OMEGA = st.floats(1.0, 100.0)
SMALL = st.floats(1e-9, 1e-3)
SIGNED = st.tuples(SMALL, st.sampled_from([-1.0, 1.0])).map(lambda pair: pair[0] * pair[1])


@pytest.mark.parametrize("near", [0.0, 1e-200, 1e-9, 3.0, 1e9, np.inf, np.nan])
def test_where_a_resonance_is_sought_from_does_not_matter(near):
    """c1 omega A + c2 omega^2 A^2 8/(3 pi) = F in closed form, from anywhere; to the 1e-12 that the search ends at."""
    c1, c2, F = 0.7, 0.3, np.array([1e-6, 1.0, 1e6])
    b, a = c1 * OMEGA_N, c2 * OMEGA_N**2 * 8.0 / (3.0 * np.pi)
    exact = 2.0 * F / (b + np.sqrt(b**2 + 4.0 * a * F))
    found = resonant_amplitude(Sum((Viscous(c1), VelocitySquared(c2))), F, OMEGA_N, near)
    np.testing.assert_allclose(found, exact, rtol=1e-12, atol=0.0)


@few
@given(C1, A, OMEGA, SIGNED)
def test_power_of_velocity_near_one_is_viscous(c: float, amplitude: float, omega: float, d: float) -> None:
    """d ln C/dp at p = 1 is ln(A omega) + (psi(3/2) - psi(2))/2 = ln(A omega) + 1/2 - ln 2 (section 4.3.3)."""
    ratio = VelocityPower(c, 1.0 + d).quadrature(amplitude, omega) / Viscous(c).quadrature(amplitude, omega)
    slope = np.log(amplitude * omega) + 0.5 - np.log(2.0)
    # the second derivative of ln C is below 0.1 (trigammas), but ratio - 1 squares the first: (slope d)^2/2
    assert abs(ratio - 1.0 - slope * d) <= (slope**2 + 0.2) * d**2 + 4e-15


@few
@given(C1, A, OMEGA, SIGNED)
def test_displacement_times_power_of_velocity_near_one_is_case_IV(
    c: float, amplitude: float, omega: float, d: float
) -> None:
    """d ln C/dp at p = 1 is ln(A omega) + (psi(3/2) - psi(5/2))/2 = ln(A omega) - 1/3 (section 4.3.4)."""
    near, exact = DisplacementVelocityPower(c, 1.0 + d), DisplacementVelocity(c)
    ratio = near.quadrature(amplitude, omega) / exact.quadrature(amplitude, omega)
    slope = np.log(amplitude * omega) - 1.0 / 3.0
    assert abs(ratio - 1.0 - slope * d) <= (slope**2 + 0.2) * d**2 + 4e-15


LIMITS = [
    (VelocityPower(1.77, 1.0), Viscous(1.77)),
    (DisplacementVelocityPower(1.77, 1.0), DisplacementVelocity(1.77)),
    (DisplacementVelocityPower(1.77, 0.0), Displacement(1.77)),
]


@pytest.mark.parametrize(("power", "case"), LIMITS, ids=lambda force: force.name)
def test_the_limit_itself_is_the_case_in_every_part(power: Force, case: Force) -> None:
    amplitude, omega, theta = np.array([0.01, 0.3, 2.0]), 10.4, np.linspace(0.0, 6.2, 3)
    for part in ("quadrature", "grow", "in_phase"):
        # gamma functions are right to a few units of the last digit
        found, expected = (getattr(force, part)(amplitude, omega) for force in (power, case))
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=0.0)
    np.testing.assert_allclose(*(force.cycle(theta, amplitude, omega) for force in (power, case)), rtol=1e-14, atol=0.0)


SECOND = st.sampled_from([QuadraticDisplacement, VelocitySquared])


@few
@given(C1, SMALL, st.floats(1.0, 60.0), st.floats(0.98, 1.02), SECOND)
def test_a_vanishing_second_term_leaves_viscous_damping(
    c: float, share: float, F: float, ratio: float, second: type[Force]
) -> None:
    """Amplitudes fall by no more than the share of the damping force that the second term has at the viscous one."""
    omega = ratio * OMEGA_N
    linear = float(steady_state(Viscous(c), F, omega, M, OMEGA_N).amplitude)
    alpha = share * c * omega * linear / float(second(1.0).quadrature(linear, omega))
    both = Sum((Viscous(c), second(alpha)))
    found = float(steady_state(both, F, omega, M, OMEGA_N).amplitude)
    # roots are solved to 1e-12
    assert linear * (1.0 - share) - 1e-12 * linear <= found <= linear * (1.0 + 1e-12)
    peak = F / (c * omega)
    alpha = share * F / float(second(1.0).quadrature(peak, omega))
    # at resonance c omega A (1 + share A/A_1 ...) = F: A = A_1 (1 - share) to first order; at most (2 share)^2 beyond
    resonance = float(resonant_amplitude(Sum((Viscous(c), second(alpha))), np.array([F]), omega)[0])
    assert abs(resonance / peak - (1.0 - share)) <= 4.0 * share**2 + 1e-12


@few
@given(st.floats(1.0, 100.0), st.floats(0.01, 1.0), st.floats(1e-7, 1e-4))
def test_a_joint_that_has_just_begun_to_slip(k: float, limit: float, beyond: float) -> None:
    """At A = A1 (1 + e): C = (4/pi) k A1 e and S = -(16/(3 pi)) k A1 e^(3/2), to first order; below A1 nothing."""
    joint, omega = Slip(k, limit), 10.4
    amplitude = limit * (1.0 + beyond)
    e = amplitude / limit - 1.0  # as rounded
    scale = k * limit
    # next orders: relative e in C, 3/5 e or so in S; the differences behind them are rounded at 1e-16 of k A1
    np.testing.assert_allclose(joint.quadrature(amplitude, omega) / scale, 4.0 / np.pi * e, rtol=2.0 * e, atol=1e-15)
    shift = -16.0 / (3.0 * np.pi) * e**1.5
    # cos psi = -1 + 2 e is rounded at 1e-16: d psi = 1e-16/sqrt(e), weighed by sin^2 psi = 4 e
    np.testing.assert_allclose(joint.in_phase(amplitude, omega) / scale, shift, rtol=4.0 * e, atol=2e-15)
    below = limit * (1.0 - beyond)
    for part in ("quadrature", "grow", "restoring"):
        # S of a stuck joint is (pi - pi)/pi to rounding
        np.testing.assert_allclose(getattr(joint, part)(below, omega), 0.0, rtol=0.0, atol=1e-15 * scale)


@few
@given(st.floats(1.0, 100.0), st.floats(0.01, 1.0), st.floats(1e-6, 1e-3))
def test_a_small_force_slips_a_joint_alone_just_above_its_limit(k: float, limit: float, share: float) -> None:
    """C = F gives A = A1/(1 - F/F_s), F_s = 4 k A1/pi: A1 itself as F vanishes."""
    F = share * 4.0 * k * limit / np.pi
    found = float(resonant_amplitude(Slip(k, limit), np.array([F]), OMEGA_N)[0])
    # a last Newton step of 1e-8 in ln A leaves its square over the distance from A1, 1e-6 at least
    np.testing.assert_allclose(found, limit / (1.0 - share), rtol=1e-10)
