"""Time integration: against exact solutions, and the averages against it for every force."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from scipy.integrate import quad

from damping.errors import AnalysisError
from damping.forces import (
    CATALOGUE,
    Coulomb,
    CubicStiffness,
    Displacement,
    DisplacementVelocity,
    DisplacementVelocityPower,
    EnergyTerm,
    Force,
    QuadraticDisplacement,
    Slip,
    Sum,
    VelocityPower,
    VelocitySquared,
    Viscous,
)
from damping.forces.smooth import Dahl, SmoothSlip
from damping.predict.branches import branches, sweep
from damping.predict.integrate import Oscillator, State, TimeState, advance, steady_state_in_time, sweep_in_time

M, omega_n, F = 2.0, 10.0, 5.0
K = M * omega_n**2


def in_time(force: Force, ratio: float, drive: float = F, **options) -> TimeState:
    return steady_state_in_time(force, drive, ratio * omega_n, M, omega_n, **options)


def test_viscous_motion_is_the_exact_solution() -> None:
    """Transient and steady part of the linear oscillator from rest, in closed form."""
    c, w = 1.0, 9.3
    oscillator = Oscillator(Viscous(c), F, w, M, omega_n)
    state = advance(oscillator, State(0.0, 0.0, 0.0, (0.0,) * len(oscillator.force.joints), np.zeros(2)), 3)
    X = F / (K - M * w**2 + 1j * c * w)  # q = Im(X exp(i w t)) + exp(-d t)(a cos + b sin)
    d = c / (2 * M)
    wd = math.sqrt(omega_n**2 - d**2)
    a = -X.imag
    b = (-X.real * w + d * a) / wd
    t = state.t
    exact = (X * np.exp(1j * w * t)).imag + math.exp(-d * t) * (a * math.cos(wd * t) + b * math.sin(wd * t))
    # integrator tolerance 1e-11 a step, a hundred steps
    np.testing.assert_allclose(state.q, exact, rtol=0, atol=1e-9 * abs(X))


def den_hartog(R: float, w: float) -> complex:
    """First harmonic A exp(-i phase) of the exact non-stop motion with friction R (Den Hartog 1931).

    In the half cycle of falling q (velocity < 0, friction +R on the other side) after a maximum at the time 0,
    q = R/K + a cos(w_n t) + b sin(w_n t) + c cos(w t) + d sin(w t), drive F cos(w t + psi). Antisymmetry,
    q(pi/w) = -q(0), and rest at both ends fix a, b and d; c^2 + d^2 = P^2 with P = F/(K - M w^2).
    """
    half = math.pi / w
    angle = omega_n * half
    a, b = np.linalg.solve(
        [[1 + math.cos(angle), math.sin(angle)], [-math.sin(angle), 1 + math.cos(angle)]], [-2 * R / K, 0.0]
    )
    d = -b * omega_n / w
    P = F / (K - M * w**2)
    c = math.sqrt(P**2 - d**2)  # positive: the forced part, as the whole motion, is at its maximum near the time 0

    def q(t: float) -> float:
        own = R / K + a * math.cos(omega_n * t) + b * math.sin(omega_n * t)
        return own + c * math.cos(w * t) + d * math.sin(w * t)

    def v(t: float) -> float:
        own = omega_n * (b * math.cos(omega_n * t) - a * math.sin(omega_n * t))
        return own + w * (d * math.cos(w * t) - c * math.sin(w * t))

    assert max(v(t) for t in np.linspace(1e-6, half - 1e-6, 500)) < 0.0, "the mass stops: no such motion"
    cosine = 2 / half * quad(lambda t: q(t) * math.cos(w * t), 0, half, epsabs=1e-13)[0]
    sine = 2 / half * quad(lambda t: q(t) * math.sin(w * t), 0, half, epsabs=1e-13)[0]
    # drive: c cos + d sin = P cos(w t + psi); harmonic of q relative to it, as q = A sin(w t' - phase)
    return complex(cosine, -sine) / complex(c, -d) * P


@pytest.mark.parametrize("ratio", [0.8, 0.95, 1.05, 1.2])
@pytest.mark.parametrize("R", [0.5, 2.0, 3.0])
def test_dry_friction_is_den_hartogs_exact_solution(R: float, ratio: float) -> None:
    exact = den_hartog(R, ratio * omega_n)
    found = in_time(Coulomb(R), ratio)
    # windows agree to 1e-6
    np.testing.assert_allclose(found.amplitude, abs(exact), rtol=2e-6)
    np.testing.assert_allclose(found.phase, -np.angle(exact), rtol=0, atol=2e-6)


def test_a_held_mass_does_not_move() -> None:
    found = in_time(Coulomb(5.5), 0.9)
    assert found.amplitude == 0.0


def test_a_joint_that_never_slips_is_a_spring() -> None:
    # the mode's frequency is that of the stuck joint: no trace of it is left
    plain, stuck = in_time(Viscous(1.0), 0.9), in_time(Sum((Viscous(1.0), Slip(80.0, 10.0))), 0.9)
    np.testing.assert_allclose(stuck.amplitude, plain.amplitude, rtol=1e-7)  # both to 1e-8 or so


#: Force, relative tolerance of amplitude, tolerance of phase (rad). G = C/(K A) is .01 to .03 at these resonances.
AGREEMENT: dict[str, tuple[Force, float, float]] = {
    # a linear oscillator has one harmonic: windows agree to 1e-6, and so does this
    "viscous": (Viscous(1.0), 2e-6, 2e-6),
    # the force jumps by 2 C2 A at the turning points, whose timing the third harmonic (C2/(8 K) of A) shifts: an
    # in-phase error of 0.7 C2/K = .035 of the damping force, seen in the phase and on the flanks in the amplitude
    "displacement": (Displacement(10.0), 2e-2, 4e-2),
    # third harmonic of the force 1/5 of the first, of the motion G/40; it comes back through the slope of the force
    "velocity-squared": (VelocitySquared(0.3), 1e-3, 4e-3),
    # as above, third harmonic of the force 3/5 of the first, with the sign that shifts the phase less
    "displacement-velocity": (DisplacementVelocity(2.0), 1e-3, 3e-3),
    # third harmonic of the force as large as the first one
    "quadratic-displacement": (QuadraticDisplacement(5.0), 1.5e-3, 6e-3),
    # between viscous and velocity squared
    "velocity-power": (VelocityPower(0.5, 1.6), 5e-4, 2e-3),
    # between displacement and displacement velocity, without the jump at the turning points
    "displacement-velocity-power": (DisplacementVelocityPower(3.0, 0.6), 3e-3, 8e-3),
    # 4 R/pi is 0.4 of the drive: on the flanks, where A is small, the square wave moves the mass by a third harmonic of
    # 0.4 %, which shifts the turning points; at resonance it hardly matters
    "coulomb": (Sum((Coulomb(1.5), Viscous(0.5))), 2e-2, 2e-3),
    # bilinear, without jumps: third harmonic of the joint's force 0.2 to 0.3 of its first, of the motion up to 1e-3
    "slip": (Sum((Slip(20.0, 0.2), Viscous(0.5))), 1e-3, 1e-3),
    # as above; less of a third harmonic, since it yields gradually
    "smooth slip": (Sum((SmoothSlip(20.0, 0.2), Viscous(0.5))), 1e-3, 1e-3),
    "dahl": (Sum((Dahl(20.0, 0.2), Viscous(0.5))), 1e-3, 1e-3),
    # third harmonic of the spring's force k3 A^3/4, of the motion k3 A^2/(32 K) of A, 2e-4
    "cubic-stiffness": (Sum((CubicStiffness(5.0), Viscous(1.0))), 1e-5, 5e-5),
}


def test_every_force_of_the_catalogue_is_compared() -> None:
    assert set(CATALOGUE) <= set(AGREEMENT)


#: Below and at resonance; of Dahl's joint above, since it settles for a hundred periods at resonance.
QUICK = {(name, ratio) for name in AGREEMENT for ratio in (0.9, 1.05 if name == "dahl" else 1.0)}


@pytest.mark.parametrize(
    ("name", "ratio"),
    [
        pytest.param(*at, marks=[] if at in QUICK else pytest.mark.slow)
        for at in product(AGREEMENT, (0.9, 0.99, 1.0, 1.05))
    ],
)
def test_averages_agree_with_time(name: str, ratio: float) -> None:
    force, of_amplitude, of_phase = AGREEMENT[name]
    averaged = branches(force, F, np.array([ratio * omega_n]), M, omega_n)
    assert np.count_nonzero(~np.isnan(averaged.amplitude)) == 1
    found = in_time(force, ratio)
    np.testing.assert_allclose(averaged.amplitude[0, 0], found.amplitude, rtol=of_amplitude)
    np.testing.assert_allclose(averaged.phase[0, 0], found.phase, rtol=0, atol=of_phase)


def test_friction_near_sticking_is_where_one_harmonic_is_worst() -> None:
    """Below resonance the averages fall short of the motion by 1, 19, 46 and then 130 % as friction nears the drive."""
    ratio, short = 0.8, []
    for R in (1.0, 3.0, 3.5, 3.8):
        averaged = branches(Coulomb(R), F, np.array([ratio * omega_n]), M, omega_n).amplitude[0, 0]
        short.append(in_time(Coulomb(R), ratio).amplitude / averaged - 1)
    # to the digit that says how bad it is
    np.testing.assert_allclose(short, [0.010, 0.188, 0.461, 1.306], rtol=0.02)


def test_averages_are_exact_in_the_limit_of_light_damping() -> None:
    """The error of the phase is of first order in the damping term, that of the resonant amplitude of second order."""
    errors = []
    for c in (20.0, 10.0, 5.0):  # drive in proportion: the same amplitude
        averaged = branches(Displacement(c), c / 2, np.array([omega_n]), M, omega_n)
        found = in_time(Displacement(c), 1.0, drive=c / 2)
        errors.append([found.amplitude / averaged.amplitude[0, 0] - 1, found.phase - averaged.phase[0, 0]])
    ratio = np.array(errors)[:-1] / np.array(errors)[1:]
    np.testing.assert_allclose(ratio, [[4.0, 2.0], [4.0, 2.0]], rtol=0.02)  # higher orders of the larger of two


DUFFING = Sum((CubicStiffness(5.0), Viscous(0.5)))


def test_unstable_branch_is_left_and_stable_ones_are_kept() -> None:
    w, drive = 10.8, 20.0
    averaged = branches(DUFFING, drive, np.array([w]), M, omega_n)
    np.testing.assert_array_equal(averaged.stable, [[True, False, True]])
    ends = []
    for A, phase in zip(averaged.amplitude[0], averaged.phase[0], strict=True):
        start = State(0.0, -A * math.sin(phase), A * w * math.cos(phase), (), np.zeros(2))
        ends.append(steady_state_in_time(DUFFING, drive, w, M, omega_n, start=start).amplitude)
    low, middle, high = averaged.amplitude[0]
    # third harmonic k3 A^2/(32 (K - 9 M w^2)) of A on the upper branch
    np.testing.assert_allclose([ends[0], ends[2]], [low, high], rtol=5e-3)
    assert min(abs(ends[1] / low - 1), abs(ends[1] / high - 1)) < 5e-3
    assert abs(ends[1] / middle - 1) > 0.1


@pytest.mark.slow
@pytest.mark.parametrize("direction", ["up", "down"])
def test_sweeps_in_time_jump_where_the_averages_do(direction) -> None:
    omega = np.linspace(10.0, 12.0, 9)
    averaged = sweep(DUFFING, 20.0, omega, M, omega_n, direction).amplitude
    found = [state.amplitude for state in sweep_in_time(DUFFING, 20.0, omega, M, omega_n, direction)]
    # as above; a jump at another frequency would be a factor of five
    np.testing.assert_allclose(found[:: 1 if direction == "up" else -1], averaged, rtol=5e-3)


def test_energy_terms_have_no_law_in_time() -> None:
    with pytest.raises(AnalysisError, match=r"energy term A\^3 has no law in the time domain"):
        in_time(Sum((Viscous(1.0), EnergyTerm(1.0, 3.0, 0.0))), 0.9)
