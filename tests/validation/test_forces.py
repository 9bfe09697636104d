"""Forces and joints of the generator against Table 2.II and closed forms."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from damping_validation.generator.balance import averages
from damping_validation.generator.laws import Structure, TrueJoint, TrueLaw

A = np.array([0.3, 1.0, 2.5])

#: Energy loss per cycle over coefficient at omega = 1 (report, Table 2.II; friction 4 A), and what elastic forces add
#: to the stiffness: 3/4 k A^2, 8/(3 pi) k A, 5/8 k A^4.
LOSSES = {
    "displacement": 2 * A**2,
    "velocity-squared": 8 / 3 * A**3,
    "displacement-velocity": 4 / 3 * A**3,
    "quadratic-displacement": np.pi / 4 * A**4,
    "coulomb": 4 * A,
}
STIFFNESSES = {"cubic": 3 / 4 * A**2, "odd-square": 8 / (3 * np.pi) * A, "quintic": 5 / 8 * A**4, "quadratic": 0 * A}

# 96 points a cycle sample a kink to about (2 pi/96)^2 = .4 %, a jump between two points exactly, a smooth force exactly
SAMPLED = 5e-3


def average(*laws: TrueLaw, joints: tuple[TrueJoint, ...] = ()) -> np.ndarray:
    return sum(averages(Structure(1.0, 1.0, 1.0, laws, joints), A).values())


@pytest.mark.parametrize("kind", LOSSES)
def test_damping_forces_lose_what_table_2_II_says(kind):
    found = average(TrueLaw(kind, 2.0))
    np.testing.assert_allclose(np.pi * A**2 * found.imag, 2.0 * LOSSES[kind], rtol=SAMPLED, atol=0)
    np.testing.assert_allclose(found.real, 0.0, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", STIFFNESSES)
def test_elastic_forces_stiffen_and_lose_nothing(kind):
    found = average(TrueLaw(kind, 2.0))
    np.testing.assert_allclose(found.real, 2.0 * STIFFNESSES[kind], rtol=SAMPLED, atol=1e-12)
    np.testing.assert_allclose(found.imag, 0.0, rtol=0, atol=1e-12)


def test_a_clearance_stiffens_as_a_dead_zone():
    """Dead zone of half-width g: N = k - (2k/pi)(asin r + r sqrt(1 - r^2)), r = g/A (Gelb and Vander Velde, 1968)."""
    gap = 0.5
    r = np.minimum(gap / A, 1.0)
    expected = 3.0 * (1 - 2 / np.pi * (np.arcsin(r) + r * np.sqrt(1 - r**2)))
    np.testing.assert_allclose(average(TrueLaw("clearance", 3.0, gap)).real, expected, rtol=SAMPLED, atol=1e-12)


def loop(joint: TrueJoint, amplitude: float, n: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """Displacement and the joint's full force over the second cycle of a sine."""
    q = amplitude * np.sin(2 * np.pi * np.arange(2 * n + 1) / n)
    z, forces = joint.start(np.zeros(1)), []
    for before, after in pairwise(q):
        z = joint.move(z, np.array([after - before]))
        forces.append(joint.force(z, np.array([after]))[0] + joint.stiffness * after)
    return q[n + 1 :], np.array(forces)[n:]


def test_a_jenkins_joint_loses_four_limits_times_the_slip():
    """W = 4 k L (A - L) for A > L, none below."""
    for amplitude in A:
        q, force = loop(TrueJoint("jenkins", 3.0, (0.5,), (1.0,)), float(amplitude))
        lost = np.sum(force * np.gradient(q))
        expected = 4 * 3.0 * 0.5 * max(amplitude - 0.5, 0.0)
        # a loop of 2000 points closes to about (2 pi/2000)^2 of its corners, the energy to a few of them
        assert lost == pytest.approx(expected, rel=2e-3, abs=2e-3)


@pytest.mark.parametrize("limits", [(0.5,), (0.1, 0.4, 2.0)])
def test_averages_of_joints_are_those_of_their_loops(limits):
    joint = TrueJoint("jenkins", 3.0, limits, tuple([1 / len(limits)] * len(limits)))
    found = average(joints=(joint,))
    for amplitude, value in zip(A, found, strict=True):
        q, force = loop(joint, float(amplitude))
        theta = 2 * np.pi * np.arange(1, q.size + 1) / q.size
        phasor = 2 / q.size * np.sum(force * (np.sin(theta) + 1j * np.cos(theta))) / amplitude - joint.stiffness
        assert value == pytest.approx(phasor, rel=2e-3, abs=2e-3)  # the loop's 2000 points


@pytest.mark.parametrize("kind", ["jenkins", "bouc-wen"])
def test_a_joint_moves_alike_in_one_step_or_two(kind):
    joint = TrueJoint(kind, 1.0, (0.7,), (1.0,))
    rng = np.random.default_rng(5)
    z, dq = rng.uniform(-0.7, 0.7, (1, 50)), rng.normal(size=50)
    twice = joint.move(joint.move(z, 0.3 * dq), 0.7 * dq)
    np.testing.assert_allclose(twice, joint.move(z, dq), rtol=0, atol=1e-12)  # rounding
    assert np.all(np.abs(twice) <= 0.7)


def test_a_bouc_wen_joint_follows_its_differential_equation():
    """dz/dq = 1 - (1 + sign(z dq)) |z| / (2 L): n = 1 and beta = gamma; 1 when relieved, 1 - |z|/L when stretched."""
    joint, z, dq = TrueJoint("bouc-wen", 1.0, (0.7,), (1.0,)), 0.4, -1e-4
    exact = joint.move(np.array([[z]]), np.array([10_000 * dq]))[0, 0]
    for _ in range(10_000):
        z += dq * (1 - (1 + np.sign(z * dq)) * abs(z) / (2 * 0.7))
    assert exact == pytest.approx(z, abs=1e-4)  # Euler steps of 1e-4
