"""Conditioning against the report's tables, against linear systems solved directly, and against a dense search."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.optimize import least_squares

from damping.signals import (
    NodeMode,
    PrincipalPlanes,
    branch,
    damping_roots,
    displacement,
    energy_loss,
    identify_r2_over_i,
    input_energy,
    mean_coefficient,
    modal_amplitude,
    modal_phase,
    nearest_root,
    node_correction,
    plane_motion,
    yaw_displacement,
)
from damping_reed1970 import load_table, load_text
from damping_reed1970.chapter_3 import PLANES, PlanarOscillator, find_roots, pitch_response, yaw_response

OMEGA = np.linspace(11.0, 12.0, 41)
OSCILLATOR = PlanarOscillator(M=21.0, C=2.3, omega_p=11.40, omega_y=11.50, theta=radians(28))


def test_displacement_is_the_integral_of_acceleration_twice() -> None:
    omega, unit = 11.39, 386.0
    x = displacement(3.507e-4, omega, 922.0)
    assert_allclose(x * omega**2 / unit, 3.507e-4 * 922.0, rtol=1e-14)
    assert_allclose(x, 0.961, rtol=0.005)  # Table 3.I point 8, slide rule
    assert_allclose(yaw_displacement(2.062, 3.507, 3.98), 2.34, rtol=0, atol=0.005)  # Table 3.I point 8, half a unit


@pytest.fixture(scope="module")
def chain() -> tuple[NodeMode, list[NodeMode], np.ndarray]:
    """Four modes with damping in the second only, and a rigid body: the response of the tail, by superposition."""
    table = load_table("3_II")[["tail_mode_factor_phi_t", "modal_mass_lb_s2_per_in", "modal_omega_rad_s"]]
    modes = [NodeMode(*row) for row in table.to_numpy().tolist()]
    F, damping = 950.0, (0.0, 2.3, 0.0, 0.0)
    tail = sum(
        m.phi**2 * F / (m.mass * (m.omega**2 - OMEGA**2) + 1j * c * OMEGA) for m, c in zip(modes, damping, strict=True)
    )
    return modes[1], [modes[0], *modes[2:]], tail + 1.92e-4 * F / (1.0 - OMEGA**2)


def test_the_second_mode_is_recovered_from_the_tail(chain: tuple[NodeMode, list[NodeMode], np.ndarray]) -> None:
    mode, others, tail = chain
    X, phi_x = np.abs(tail), -np.angle(tail)
    C_t = node_correction(mode, others, 950.0, OMEGA, r2_over_i=1.92e-4, omega_r=1.0).total
    phi_2 = modal_phase(X, phi_x, C_t, mode.phi)
    A_2 = modal_amplitude(X, phi_x, C_t, mode.phi, phi_2)
    alone = mode.phi * 950.0 / (mode.mass * (mode.omega**2 - OMEGA**2) + 2.3j * OMEGA)
    assert_allclose(A_2 * np.exp(-1j * phi_2), alone, rtol=1e-12)  # removing what was added: rounding


def test_r2_over_i_is_identified(chain: tuple[NodeMode, list[NodeMode], np.ndarray]) -> None:
    mode, others, _ = chain
    F = np.full_like(OMEGA, 950.0)
    C_t = node_correction(mode, others, F, OMEGA, r2_over_i=1.92e-4, omega_r=1.0).total
    assert_allclose(identify_r2_over_i(mode, others, F, OMEGA, 1.0, C_t), 1.92e-4, rtol=1e-12)  # noise-free: rounding


def test_planar_response_solves_the_coupled_equations() -> None:
    M, C, omega_p, omega_y, theta = OSCILLATOR[:5]
    K_p, K_y, c, s = M * omega_p**2, M * omega_y**2, np.cos(theta), np.sin(theta)  # turned into the vehicle's axes
    pp, yy, py = K_p * c**2 + K_y * s**2, K_p * s**2 + K_y * c**2, (K_p - K_y) * s * c
    for omega in OMEGA:
        dynamic = -M * omega**2 + 1j * C * omega
        solved = np.linalg.solve([[pp + dynamic, py], [py, yy + dynamic]], [38.0, 0.0])
        found = [pitch_response(OSCILLATOR, 38.0, omega), yaw_response(OSCILLATOR, 38.0, omega)]
        # the matrix is close to singular at resonance (damping 0.5 per cent): eps/0.005, with a margin
        assert_allclose(found, solved, rtol=1e-11, atol=1e-13)


def printed_amplitude_and_phase(
    oscillator: PlanarOscillator, F_p: float, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and phase lag (0 to 2 pi) by the report's own formulas (Eqs. 3.1.31, 3.1.34, 3.1.35)."""
    M, C, omega_p, omega_y, theta = oscillator[:5]
    N1 = -(omega**2) + omega_p**2 * np.sin(theta) ** 2 + omega_y**2 * np.cos(theta) ** 2
    N2 = -C / M * omega
    N3 = (omega_p**2 - omega**2) * (omega_y**2 - omega**2) - (C / M) ** 2 * omega**2
    N4 = -C / M * omega * ((omega_p**2 - omega**2) + (omega_y**2 - omega**2))
    sine, cosine = N2 * N3 - N1 * N4, N1 * N3 + N2 * N4
    return np.hypot(sine, cosine) / (N3**2 + N4**2) * F_p / M, np.mod(np.arctan2(sine, cosine), 2.0 * np.pi)


def test_planar_response_is_the_printed_one() -> None:
    A, phi = printed_amplitude_and_phase(OSCILLATOR, 38.0, OMEGA)
    response = pitch_response(OSCILLATOR, 38.0, OMEGA)
    assert_allclose(np.abs(response), A, rtol=1e-11)  # two forms of one expression, cancelling near resonance
    assert_allclose(np.mod(-np.angle(response), 2.0 * np.pi), phi, rtol=1e-11)


def test_planar_response_without_an_angle_is_one_mode() -> None:
    single = OSCILLATOR._replace(theta=0.0)
    expected = 38.0 / (21.0 * (11.4**2 - OMEGA**2) + 2.3j * OMEGA)
    assert_allclose(pitch_response(single, 38.0, OMEGA), expected, rtol=1e-13)
    assert np.all(yaw_response(single, 38.0, OMEGA) == 0.0)


def test_energy_lost_in_the_planes_is_put_in_by_the_force() -> None:
    xi = 0.005
    planes = PrincipalPlanes(0.041, 21.0, 11.40, 11.50, radians(28))
    motion = plane_motion(planes, 922.0, OMEGA, xi)
    put_in = 0.0
    for (omega_j, g), A in zip(planes.planes, (motion.A_p, motion.A_y), strict=True):
        lag = np.arctan2(2 * xi * OMEGA / omega_j, 1 - (OMEGA / omega_j) ** 2)  # Eq. 3.1.12
        put_in = put_in + input_energy(A, abs(g) * 922.0, lag)
    assert_allclose(energy_loss(planes, 922.0, OMEGA, xi), put_in, rtol=1e-12)


@settings(max_examples=60, deadline=None)
@given(split=st.floats(0.002, 0.4), theta=st.floats(0.03, 1.5), omega=st.floats(11.2, 11.9), share=st.floats(0.05, 1.2))
def test_no_root_is_missed(split: float, theta: float, omega: float, share: float) -> None:
    planes = PrincipalPlanes(0.041, 21.0, 11.40, 11.40 + split, theta)
    xi = np.geomspace(1e-7, 30.0, 20001)
    loss = energy_loss(planes, 930.0, omega, xi)
    energy = share * loss.max()
    found = damping_roots(planes, 930.0, omega, energy)
    bracketed = np.flatnonzero(np.diff(np.sign(loss - energy)))
    # the search sees pairs of roots only if they are further apart than its step of 0.1 per cent
    seen = [k for k, root in enumerate(found.roots) if xi[0] < root < xi[-1]]
    if abs(share - 1.0) > 1e-5:
        assert len(seen) == len(bracketed)
    assert_allclose(found.roots[seen], xi[bracketed], rtol=2e-3)
    # 1e-6: near the top the loss is flat in xi, the step of 0.1 per cent costs its square
    assert_allclose(found.energy_peak, loss.max(), rtol=1e-6)
    # a root at the top is double: its residual is of the size of rounding in the polynomial
    assert_allclose(energy_loss(planes, 930.0, omega, found.roots), np.full(found.roots.size, energy), rtol=1e-9)


def test_at_a_natural_frequency_the_loss_has_no_upper_bound() -> None:
    found = damping_roots(PLANES, 922.0, PLANES.omega_p, 114.5)
    assert (found.xi_peak, found.energy_peak) == (0.0, np.inf)
    assert_allclose(energy_loss(PLANES, 922.0, PLANES.omega_p, found.roots), 114.5, rtol=1e-10)
    assert found.roots.size == 1


def test_roots_of_table_3_iv() -> None:
    """Erratum E3IV-1: two roots at 13 points, none at 10 and 13; the mean on each branch."""
    table = load_table("3_IV").query("corrected_row == 0")
    roots, xi, omega = find_roots(table), table["xi"].to_numpy(), table["omega_rad_s"].to_numpy()
    assert [len(point.roots) for point in roots] == [2] * 9 + [0, 2, 2, 0, 2, 2]
    low, high = branch(roots, 0), branch(roots, -1)
    taken_low = np.abs(low - xi) < np.abs(high - xi)
    assert (np.flatnonzero(taken_low) + 1).tolist() == [1, 2, 3, 4, 5, 6, 14, 15]
    # every printed xi lies within 5 per cent of the root that it stands for (trial and error; largest: point 1)
    nearest = np.array([nearest_root(p.roots, x) for p, x in zip(roots, xi, strict=True)])
    there = ~np.isnan(nearest)
    assert_allclose(nearest[there], xi[there], rtol=0.05)
    assert_allclose(mean_coefficient(21.0, omega, xi), 2.30, rtol=0, atol=0.005)  # Eq. 3.2.18, printed digits
    # the extremes of the erratum: at the points without a root, the xi of the largest energy
    peak = np.array([point.xi_peak for point in roots])
    low_mean = mean_coefficient(21.0, omega, np.where(there, low, peak))
    high_mean = mean_coefficient(21.0, omega, np.where(there, branch(roots, -1, largest=0.05), peak))
    proof = load_text("errata").set_index("id")["proof"]["E3IV-1"]
    assert f"C1={low_mean:.3f}" in proof
    assert f"below .05 {high_mean:.3f}" in proof


def test_planar_coupling_explains_the_frequencies_that_the_report_read_off_its_plot() -> None:
    """Eqs. 3.1.36, 3.1.37: omega_p = 11.40, omega_y = 11.50; theta and M as in Eq. 3.2.16, xi near the example's."""
    table, motion = load_table("3_III", "corrected"), load_table("3_I")
    omega, F = motion["omega_rad_s"].to_numpy(), 0.041 * motion["force_lb"].to_numpy(dtype=float)
    measured = table["modal_amplitude_A2_in"] * np.exp(-1j * table["modal_phase_rad"])

    def residual(x: np.ndarray) -> np.ndarray:
        model = pitch_response(PlanarOscillator(21.0, x[2], x[0], x[1], radians(28)), F, omega)
        return np.concatenate([(model - measured).to_numpy().real, (model - measured).to_numpy().imag])

    omega_p, omega_y, C = least_squares(residual, [11.35, 11.55, 2.0], x_scale=[0.1, 0.1, 1.0]).x
    # read off a plot to 0.01 rad/s
    assert_allclose([omega_p, omega_y], [11.40, 11.50], rtol=0, atol=0.01)
    # two digits of the worked example (section 3.2), .0059
    assert_allclose(C / (2 * 21.0 * 11.40), 0.0059, rtol=0, atol=0.00005)
