"""The structures that predictions are tried on: what they claim to be."""

import numpy as np
import pytest
from scipy.integrate import quad

from benchmarks._structures import Iwan, carrying, simulated_levels, structures
from damping.forces.joints import Slip
from damping_validation import truths
from damping_validation.truths import MOST_IN_JOINTS, OMEGA, RATIOS_OF_DAMPING, draw_truth, peaks


@pytest.mark.parametrize("A", [0.3, 3.9, 4.1, 30.0])
def test_iwan_energy_is_that_of_its_sliders(A):
    R, chi, limit = 0.7, -0.6, 4.0
    energy, error = quad(lambda x: 4.0 * (A - x) * x * R * x**chi, 0.0, min(A, limit), epsabs=1e-12)
    found = np.pi * A * Iwan(R, chi, limit).quadrature(A, OMEGA)
    np.testing.assert_allclose(found, energy, rtol=1e-8, atol=error)


def test_iwan_energy_is_the_area_of_its_masing_loop():
    """Independently: the loop from the backbone by Masing's rule, area by the trapezoidal rule."""
    R, chi, limit, A = 0.7, -0.6, 4.0, 2.5

    def backbone(x):
        m, n = chi + 2.0, chi + 1.0
        x = np.minimum(x, limit)
        return R * (x**m / m + x * (limit**n - x**n) / n)

    q = -A * np.cos(np.linspace(0.0, np.pi, 20001))
    loading = -backbone(A) + 2.0 * backbone((A + q) / 2.0)
    area = 2.0 * np.trapezoid(loading, q)  # the unloading branch is its mirror image
    np.testing.assert_allclose(area, np.pi * A * Iwan(R, chi, limit).quadrature(A, OMEGA), rtol=1e-5)


@pytest.mark.parametrize("A", [0.3, 3.0, 4.5, 30.0])
def test_the_slope_of_an_iwan_joint_is_a_difference_of_its_averages(A):
    joint, h = Iwan(0.7, -0.6, 4.0), 1e-6
    numeric = (joint.quadrature(A * np.exp(h), OMEGA) - joint.quadrature(A * np.exp(-h), OMEGA)) / (2.0 * h)
    np.testing.assert_allclose(joint.grow(A, OMEGA)[1], numeric, rtol=1e-7)  # truncation h^2, rounding 1e-16/h


@pytest.mark.parametrize("structure", structures(), ids=lambda s: s.name)
def test_every_structure_carries_one_at_one(structure):
    np.testing.assert_allclose(structure.force.quadrature(1.0, OMEGA), 1.0, rtol=1e-12)
    np.testing.assert_allclose(structure.amplitude(np.array([1.0])), 1.0, rtol=1e-9)
    A = structure.amplitude(np.array([0.5, 1.0, 4.0]))
    np.testing.assert_allclose(structure.force.quadrature(A, OMEGA), [0.5, 1.0, 4.0], rtol=1e-9)


def test_noise_is_what_it_says():
    rng = np.random.default_rng(1)
    structure = structures()[0]
    data = simulated_levels(structure, 4000, 4.0, 0.02, rng)
    error = np.log(data.A / structure.amplitude(data.D))
    # standard deviation of 4000 draws known to 1.1 %: five of these
    np.testing.assert_allclose(error.std(), 0.02, rtol=0.056)
    np.testing.assert_allclose(data.D[-1] / data.D[0], 4.0, rtol=1e-12)


def test_a_share_of_a_law_carries_that_share_at_one():
    np.testing.assert_allclose(carrying(0.3, "coulomb").quadrature(5.0, OMEGA), 0.3, rtol=1e-12)
    data = peaks(np.array([1.0, 2.0]), np.array([1.0, 1.5]))
    np.testing.assert_array_equal(data.D, data.tested_force)


def test_springs_of_joints_are_those_of_sliders():
    """S and C of one slider, of Iwan's, and of Bouc and Wen's law far from its knee, against closed forms."""
    A, x = np.exp(truths._TABLE), (np.arange(60) + 0.5) / 60.0
    C, _, S, _ = Slip(1.0, 0.5).averages(A, OMEGA)
    np.testing.assert_allclose(truths._slip(0.5)[0.0], S + A + 1j * C, rtol=1e-9, atol=1e-10)  # A up to e^9
    C, _, S, _ = Slip(np.full((60, 1), 1.0 / x.sum()), x[:, None]).averages(A, OMEGA)
    iwan = truths._iwan(0.0, 0.0)
    # midpoints of 400 angles: 1e-4 of a loop with kinks
    np.testing.assert_allclose(iwan, (S + A / x.sum()).sum(axis=0) + 1j * C.sum(axis=0), rtol=1e-3, atol=1e-4)
    bouc = truths._bouc_wen(2.0)
    np.testing.assert_allclose(bouc.real[:40] / A[:40], 1.0, rtol=0.02)  # stuck below a twentieth of the limit
    np.testing.assert_allclose(bouc.imag[-40:], 4.0 / np.pi, rtol=0.02)  # slipping in full


def test_a_resonance_falls_with_its_joint_alone():
    """Both of a seed have the same geometric spring, or none: then the damper's stays and the joint's falls."""
    at, still = np.array([1e-2, 0.5, 1.0, 2.0, 4.0]), 0
    for seed in range(12):
        joint, damper = (draw_truth(name, np.random.default_rng(seed)) for name in ("Iwan joint", "saturating"))
        assert RATIOS_OF_DAMPING[0] <= 0.5 / (damper.mass * OMEGA**2) <= RATIOS_OF_DAMPING[1]
        if np.ptp(damper.omega(at)) < 1e-9 * OMEGA:
            falls, still = -np.diff(joint.omega(at) ** 2) / OMEGA**2, still + 1
            assert falls.min() > 0.0
            assert falls.sum() < MOST_IN_JOINTS
    assert 4 <= still <= 11  # two in three, one false alarm in a hundred


def test_damping_is_that_at_the_frequency_of_the_resonance():
    """Viscous C = c omega A where a spring moves omega: C/(omega A) is one number."""
    rng = np.random.default_rng(5)
    viscous = next(t for t in (draw_truth("viscous", rng) for _ in range(50)) if np.ptp(t.log_omega) > 0.01)
    ratio = viscous.log_C - viscous.log_omega - truths._TABLE
    np.testing.assert_allclose(ratio, -np.log(OMEGA), atol=1e-12)
    np.testing.assert_allclose(viscous.omega(np.array([1.0])), OMEGA, rtol=1e-12)
