"""All branches, their stability, and sweeps with jumps."""

from __future__ import annotations

import numpy as np
import pytest

from damping.forces import Coulomb, CubicStiffness, DisplacementVelocity, Slip, Sum, Viscous
from damping.predict.branches import branches, is_stable, sweep
from damping.predict.steady import balance, steady_state

M, omega_n = 2.0, 10.0
DUFFING = Sum((Viscous(0.5), CubicStiffness(5.0)))


def duffing_amplitudes(F: float, omega: float, c: float = 0.5, k3: float = 5.0) -> np.ndarray:
    """((K - M omega^2) + (3/4) k3 a)^2 a + (c omega)^2 a = F^2 in a = A^2: a cubic, by its companion matrix."""
    kappa, s = M * (omega_n**2 - omega**2), 0.75 * k3
    roots = np.roots([s**2, 2 * kappa * s, kappa**2 + (c * omega) ** 2, -(F**2)])
    real = roots[np.abs(roots.imag) < 1e-9 * np.abs(roots)].real
    return np.sqrt(np.sort(real[real > 0]))


def test_branches_of_a_cubic_spring_are_the_roots_of_a_cubic() -> None:
    omega = np.linspace(8.0, 13.0, 101)
    found = branches(DUFFING, 20.0, omega, M, omega_n)
    assert found.amplitude.shape == (101, 3)
    for row, w in zip(found.amplitude, omega, strict=True):
        expected = duffing_amplitudes(20.0, float(w))
        assert np.count_nonzero(~np.isnan(row)) == expected.size
        # the companion matrix loses about half the digits of close roots
        np.testing.assert_allclose(row[: expected.size], expected, rtol=1e-7)


def test_close_pairs_near_a_fold_are_found() -> None:
    """Between two neighbouring points of the amplitude grid (4 %): the extremum inside the cell separates the pair."""
    lows, highs = 11.0, 11.5  # three roots and one
    for _ in range(30):
        middle = 0.5 * (lows + highs)
        lows, highs = (middle, highs) if duffing_amplitudes(20.0, middle).size == 3 else (lows, middle)
    inside, outside = branches(DUFFING, 20.0, np.array([lows - 1e-6, highs + 1e-6]), M, omega_n).amplitude
    assert np.count_nonzero(~np.isnan(inside)) == 3
    assert np.count_nonzero(~np.isnan(outside)) == 1
    assert inside[2] / inside[1] < 1.01


@pytest.mark.parametrize(
    ("force", "F"),
    [
        (DUFFING, 20.0),
        (Sum((Viscous(0.3), Slip(60.0, 0.3))), 3.0),
        (Sum((Viscous(0.5), CubicStiffness(-5.0), DisplacementVelocity(0.2))), 6.0),
    ],
    ids=["hardening", "slip", "softening"],
)
def test_every_branch_needs_the_given_force(force: Sum, F: float) -> None:
    omega = np.linspace(8.0, 12.0, 81)
    found = branches(force, F, omega, M, omega_n)
    there = ~np.isnan(found.amplitude)
    needed = np.hypot(*balance(force, found.amplitude, omega[:, np.newaxis], M, omega_n)[::2])
    # Newton's method in ln A ends at rounding, times the steepness of F(A)
    np.testing.assert_allclose(needed[there], F, rtol=1e-11)
    assert np.all(there[:, 0])
    np.testing.assert_array_equal(np.isnan(found.phase), ~there)
    assert np.all(np.diff(found.amplitude, axis=1)[there[:, 1:]] > 0)


def test_the_middle_branch_is_unstable() -> None:
    found = branches(DUFFING, 20.0, np.array([9.0, 10.8, 12.5]), M, omega_n)
    np.testing.assert_array_equal(found.stable, [[True, False, False], [True, False, True], [True, False, False]])


def test_stability_is_that_of_the_slow_flow() -> None:
    """Eigenvalues of the averaged equations' Jacobian, by finite differences of the flow itself."""
    F, omega = 20.0, 10.8

    def flow(state: np.ndarray) -> np.ndarray:
        A, phi = state
        C = float(DUFFING.quadrature(A, omega))
        X = M * (omega_n**2 - omega**2) * A + float(DUFFING.in_phase(A, omega))
        return np.array([F * np.sin(phi) - C, (F * np.cos(phi) - X) / A]) / (2 * M * omega)

    found = branches(DUFFING, F, np.array([omega]), M, omega_n)
    for A, phi, stable in zip(found.amplitude[0], found.phase[0], found.stable[0], strict=True):
        state = np.array([A, phi])
        np.testing.assert_allclose(flow(state), 0.0, rtol=0, atol=1e-10)  # a steady state, to rounding
        columns = [
            (flow(state + step) - flow(state - step)) / 2e-6 for step in (np.array([1e-6, 0]), np.array([0, 1e-6]))
        ]
        growth = np.linalg.eigvals(np.column_stack(columns)).real.max()
        assert (growth < 0) == stable


def test_undamped_motion_off_resonance_counts_as_stable() -> None:
    assert is_stable(Sum(()), 1.0, 9.0, M, omega_n)


def test_sweeps_jump_up_and_down_at_the_folds() -> None:
    omega = np.linspace(9.0, 13.0, 401)
    up, down = (sweep(DUFFING, 20.0, omega, M, omega_n, way) for way in ("up", "down"))
    several = np.array([duffing_amplitudes(20.0, float(w)).size == 3 for w in omega])
    differ = ~np.isclose(up.amplitude, down.amplitude, rtol=1e-6, atol=0.0)
    np.testing.assert_array_equal(differ, several)  # hysteresis exactly where there are two stable states
    for w, high, low in zip(omega[several], up.amplitude[several], down.amplitude[several], strict=True):
        expected = duffing_amplitudes(20.0, float(w))
        np.testing.assert_allclose([low, high], expected[[0, 2]], rtol=1e-7)  # as above


def test_single_valued_sweeps_are_the_steady_states_whatever_the_direction() -> None:
    force = Sum((Viscous(0.5), DisplacementVelocity(0.4)))
    omega = np.linspace(9.0, 11.0, 41)
    expected = steady_state(force, 4.0, omega, M, omega_n)
    for way in ("up", "down"):
        found = sweep(force, 4.0, omega, M, omega_n, way)
        # two independent searches, each to rounding
        np.testing.assert_allclose(found.amplitude, expected.amplitude, rtol=1e-11)
        np.testing.assert_allclose(found.phase, expected.phase, rtol=1e-11)


def test_friction_that_holds_has_no_branch() -> None:
    found = branches(Coulomb(3.0), 3.0, np.array([9.0, 10.0]), M, omega_n)
    assert np.all(np.isnan(found.amplitude))
    assert not np.any(found.stable)
    assert np.all(np.isnan(sweep(Coulomb(3.0), 3.0, np.array([9.0, 10.0]), M, omega_n).amplitude))


def test_one_frequency_is_a_sweep_too() -> None:
    found = sweep(Viscous(0.5), 3.0, np.array([9.5]), M, omega_n)
    np.testing.assert_allclose(found.amplitude, steady_state(Viscous(0.5), 3.0, 9.5, M, omega_n).amplitude, rtol=1e-12)
