"""First-harmonic steady states against closed forms and a general root finder."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from damping.effects.contract import Drive, Terms
from damping.effects.terms import complex_stiffness
from damping.forces import (
    Coulomb,
    CubicStiffness,
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
    damping_term,
)
from damping.predict.steady import backbone, balance, phase_lag, phase_resonance, resonant_amplitude, steady_state

M, omega_n = 50.78, 10.455  # first mode of Configuration II, sweep C (Table 4.V)

#: Forces with one steady state at each frequency.
DAMPING: list[Force] = [
    Viscous(1.77),
    Displacement(28.0),
    VelocitySquared(0.13),
    DisplacementVelocity(2.6),
    QuadraticDisplacement(2.9),
    VelocityPower(0.19, 1.65),
    VelocityPower(2.0, 0.4),
    DisplacementVelocityPower(3.9, 0.65),
    Sum((Viscous(0.6), Coulomb(5.0))),
    Sum((Viscous(0.5), DisplacementVelocity(1.1), VelocitySquared(0.02))),
]
ids = [force.name for force in DAMPING]


def test_viscous_response_is_the_linear_one() -> None:
    omega = omega_n * np.linspace(0.3, 2.0, 101)
    state = steady_state(Viscous(1.77), 28.98, omega, M, omega_n)
    compliance = 1 / (M * (omega_n**2 - omega**2) - 1j * 1.77 * omega)
    # closed form of a linear oscillator
    np.testing.assert_allclose(state.amplitude, 28.98 * np.abs(compliance), rtol=1e-13)
    np.testing.assert_allclose(state.phase, np.angle(compliance), rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("force", DAMPING, ids=ids)
def test_steady_states_obey_equations_4_2_3_and_4_2_4(force: Force) -> None:
    omega = omega_n * np.linspace(0.7, 1.4, 57)
    state = steady_state(force, 28.98, omega, M, omega_n)
    A, eta2 = state.amplitude, (omega / omega_n) ** 2
    G = damping_term(force, A, omega, M, omega_n)
    # Newton's method ends with errors of rounding; far from resonance the two sides are 1e2 times the damping
    np.testing.assert_allclose((1 - eta2) ** 2 + G**2, (28.98 / (M * omega_n**2 * A)) ** 2, rtol=1e-12)
    np.testing.assert_allclose(state.phase, np.arctan2(G, 1 - eta2), rtol=1e-12)


@pytest.mark.parametrize("force", DAMPING, ids=ids)
def test_steady_states_are_those_of_a_general_root_finder(force: Force) -> None:
    for ratio in (0.9, 0.998, 1.0, 1.003, 1.2):
        omega = ratio * omega_n

        def miss(A: float, omega: float = omega) -> float:
            return float(np.hypot(*balance(force, A, omega, M, omega_n)[::2])) - 28.98

        A = steady_state(force, 28.98, omega, M, omega_n).amplitude
        np.testing.assert_allclose(A, brentq(miss, 1e-9, 1e4, xtol=1e-15, rtol=1e-14), rtol=1e-10)


def test_complex_stiffness_gives_force_and_phase() -> None:
    force = Sum((Viscous(1.0), Slip(400.0, 0.02)))
    A, omega = np.array([0.01, 0.05, 0.4]), 10.3
    Z, _ = complex_stiffness(Terms(M, omega_n, force.forces), A, Drive(np.ones(3), np.full(3, omega)))
    np.testing.assert_allclose(np.abs(Z) * A, np.hypot(*balance(force, A, omega, M, omega_n)[::2]), rtol=1e-14)
    np.testing.assert_allclose(np.angle(Z), phase_lag(force, A, omega, M, omega_n), rtol=1e-14)


@pytest.mark.parametrize("force", DAMPING, ids=ids)
def test_resonant_amplitude_solves_C_equals_F(force: Force) -> None:
    F = np.array([8.0, 19.37, 24.95, 28.98, 90.0, 1e4])
    A = resonant_amplitude(force, F, omega_n)
    # an error of rounding in ln A, times the power of A in C
    np.testing.assert_allclose(force.quadrature(A, omega_n), F, rtol=1e-12)
    # and it is the steady state at omega_n
    np.testing.assert_allclose(A, steady_state(force, F, omega_n, M, omega_n).amplitude, rtol=1e-9)


def test_power_laws_in_closed_form() -> None:
    """A = (1/omega) (beta F/alpha)^(1/p) (Eq 4.3.25, erratum E4325)."""
    from damping.forces.powers import beta

    p, alpha, F = 1.859, 0.1917, np.array([19.37, 90.0])
    expected = (beta(p) * F / alpha) ** (1 / p) / omega_n
    np.testing.assert_allclose(resonant_amplitude(VelocityPower(alpha, p), F, omega_n), expected, rtol=1e-13)


@pytest.mark.parametrize("draws", [40, 5000])
def test_posterior_samples_broadcast(draws: int) -> None:
    """A draw's amplitude is that of the draw alone, of a few draws and of more than are solved at once."""
    rng = np.random.default_rng(3)
    c, d, p = (rng.uniform(low, high, (draws, 1)) for low, high in ((0.1, 2.0), (0.0, 2.0), (1.2, 2.5)))
    F, omega = np.linspace(5.0, 90.0, 6), omega_n * rng.uniform(0.9, 1.1, (draws, 6))
    A = resonant_amplitude(Sum((Viscous(c), VelocityPower(d, p))), F, omega)
    assert A.shape == (draws, 6)
    for k in (7, -7):
        alone = Sum((Viscous(c[k, 0]), VelocityPower(d[k, 0], p[k, 0])))
        one = resonant_amplitude(alone, float(F[2]), float(omega[k, 2]))
        np.testing.assert_allclose(A[k, 2], one, rtol=1e-13)  # vectorised powers may round otherwise


def test_three_axes_broadcast_as_two_do() -> None:
    """A = F/(c omega) (Eq. 4.1.7) where forces have more rows than are solved at once for a batch of shapes."""
    c, F = np.linspace(1.0, 2.0, 7)[:, None, None], np.linspace(1.0, 9.0, 12_000).reshape(4000, 3)
    A = resonant_amplitude(Sum((Viscous(c), Viscous(c))), F, omega_n)
    np.testing.assert_allclose(A, F / (2.0 * c * omega_n), rtol=1e-11)


@pytest.mark.parametrize("unit", [1e-9, 1e-3, 1.0, 1e6])
def test_amplitudes_do_not_depend_on_the_unit_of_length(unit: float) -> None:
    """A length unit times smaller makes coefficients of A^m smaller by its m-th power."""
    F = np.array([2.0, 20.0, 200.0])
    base = resonant_amplitude(Sum((Viscous(1.0), DisplacementVelocity(0.7), Slip(30.0, 0.1))), F, 10.0)
    scaled = Sum((Viscous(unit * 1.0), DisplacementVelocity(unit**2 * 0.7), Slip(unit * 30.0, 0.1 / unit)))
    np.testing.assert_allclose(resonant_amplitude(scaled, F, 10.0) * unit, base, rtol=1e-12)


def test_friction_that_holds_has_no_resonance() -> None:
    force = Sum((Coulomb(10.0), Viscous(1.0)))
    threshold = 40 / np.pi
    F = np.array([5.0, 0.999 * threshold, 1.001 * threshold, 50.0])
    A = resonant_amplitude(force, F, 10.0)
    np.testing.assert_array_equal(np.isnan(A), [True, True, False, False])
    np.testing.assert_allclose(A[2:], (F[2:] - threshold) / 10.0, rtol=1e-10)  # cancellation of three digits


def test_friction_or_slip_alone_has_no_resonance_above_saturation() -> None:
    assert np.all(np.isnan(resonant_amplitude(Coulomb(10.0), np.array([1.0, 12.7, 12.8, 100.0]), 10.0)))
    limit = 4 * 40.0 * 0.01 / np.pi
    F = np.array([0.1, 0.9 * limit, 1.01 * limit])
    A = resonant_amplitude(Slip(40.0, 0.01), F, 10.0)
    # C = limit (1 - A1/A)
    np.testing.assert_allclose(A[:2], 0.01 / (1 - F[:2] / limit), rtol=1e-11)
    assert np.isnan(A[2])


def test_a_stiff_joint_that_starts_to_slip_is_no_trap() -> None:
    """Newton's steps from both sides of the kink at the slip limit lead across it: C = F is solved all the same."""
    coefficient, stiffness = np.geomspace(1e-3, 1.0, 25)[:, None, None], np.geomspace(1.0, 1e4, 25)[:, None]
    force = Sum((Viscous(coefficient), Slip(stiffness, 0.0372)))
    F = np.array([3.0, 30.0, 90.0])
    A = resonant_amplitude(force, F, 500.0)
    # an error of rounding in ln A, times the slope of ln C, up to some hundreds where the joint lets go
    np.testing.assert_allclose(force.quadrature(A, 500.0), np.broadcast_to(F, A.shape), rtol=1e-11)


def test_falling_damping_gives_the_stable_amplitude_or_none() -> None:
    """C = omega (2 A - (2/(3 pi)) A^2) has its largest value at A = 3 pi/2; below it the smaller root is meant."""
    force = Sum((Viscous(2.0), DisplacementVelocity(-0.5)))
    F = np.array([0.1, 5.0, 20.0, 1e3])
    a, b = 2.0 * omega_n, 4 / (3 * np.pi) * 0.5 * omega_n
    roots = (a - np.sqrt(a**2 - 4 * b * F[:3])) / (2 * b)
    A = resonant_amplitude(force, F, omega_n)
    np.testing.assert_allclose(A[:3], roots, rtol=1e-11)
    assert np.isnan(A[3])


def test_backbone_of_a_cubic_spring_and_of_a_joint() -> None:
    A = np.array([0.1, 1.0, 3.0])
    # S/A = (3/4) k3 A^2
    expected = np.sqrt(omega_n**2 + 30 * A**2 / M)
    np.testing.assert_allclose(backbone(CubicStiffness(40.0), A, M, omega_n), expected, rtol=1e-14)
    # a joint far beyond its limit has lost all its stiffness but 2 A1/A times sin psi: tends to K1
    far = backbone(Slip(400.0, 1e-9), 1.0, M, omega_n)
    np.testing.assert_allclose(far, np.sqrt(omega_n**2 - 400.0 / M), rtol=1e-9)
    assert np.isnan(backbone(CubicStiffness(-1e6), 1.0, M, omega_n))


def test_phase_resonance_of_a_hardening_spring() -> None:
    """A omega = F/c and omega^2 = omega_n^2 + (3/4) k3 A^2/M together are a quadratic in omega^2."""
    c, k3, F = 0.1, 40.0, 10.0
    A, omega = phase_resonance(Sum((CubicStiffness(k3), Viscous(c))), F, M, omega_n)
    squared = np.max(np.roots([1.0, -(omega_n**2), -0.75 * k3 * (F / c) ** 2 / M]))
    np.testing.assert_allclose(omega, np.sqrt(squared), rtol=1e-11)
    np.testing.assert_allclose(A, F / (c * np.sqrt(squared)), rtol=1e-11)


def test_phase_resonance_of_pure_damping_is_at_omega_n() -> None:
    A, omega = phase_resonance(Viscous(1.77), np.array([10.0, 20.0]), M, omega_n)
    np.testing.assert_array_equal(omega, omega_n)
    np.testing.assert_allclose(A, np.array([10.0, 20.0]) / (1.77 * omega_n), rtol=1e-14)


def test_no_steady_state_is_nan() -> None:
    assert np.isnan(steady_state(Coulomb(10.0), 12.0, 9.0, M, omega_n).amplitude)  # friction holds: 4 R/pi = 12.7
    assert np.isnan(steady_state(Sum(()), 12.0, omega_n, M, omega_n).amplitude)  # nothing limits the resonance
    # friction alone off resonance: (kappa A)^2 + (4 R/pi)^2 = F^2
    expected = np.sqrt(20.0**2 - (40 / np.pi) ** 2) / (M * (omega_n**2 - 81.0))
    np.testing.assert_allclose(steady_state(Coulomb(10.0), 20.0, 9.0, M, omega_n).amplitude, expected, rtol=1e-12)
