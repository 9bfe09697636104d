"""The discrepancy of a law's exponent: closed forms against quadrature and dense algebra."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import dblquad, quad
from scipy.special import gamma
from scipy.stats import multivariate_normal, norm

from damping.forces.joints import Slip
from damping.infer.discrepancy import (
    BENT,
    FREQUENCY_SCATTER,
    JOINT_FALL,
    JOINTS,
    LENGTH,
    LETS_GO,
    LINEAR,
    OTHER_FALLS,
    OTHER_SHARES,
    SLOPES,
    SLOWER,
    STEEPER,
    UNTOLD,
    WITHOUT_JOINT,
    JointEvidence,
    covary_discrepancy,
    extend,
    find_joint,
    measure_nonlinearity,
    place_steps,
    read_path,
)
from damping.infer.law import Coordinates, Law
from damping.infer.likelihood import DRIFT_LENGTH, covary_levels, covary_scatter, log_likelihood, residuals
from damping.infer.paths import Paths
from damping_validation.truths import draw_truth
from damping_validation.truths import sweeps as simulated_sweeps


@pytest.mark.parametrize(("a", "b"), [(0.7, 1.9), (-0.4, 1.1), (-1.0, -0.2)])
def test_covariance_is_the_double_integral(a, b):
    exact = dblquad(lambda u, v: np.exp(-abs(u - v) / LENGTH), 0.0, a, 0.0, b)[0]
    found = covary_discrepancy(np.array([a]) + 0.3, np.array([b]) + 0.3, 0.3)[0, 0]
    np.testing.assert_allclose(found, exact, rtol=1e-6)  # the kink at u = v limits the quadrature


def test_draws_given_the_levels_are_those_of_the_normal_law():
    """Mean and covariance within and beyond the test against the dense conditional normal."""
    at, within, beyond, n = np.array([-0.7, 0.0, 0.7]), np.array([0.3, 0.7]), np.array([1.2, 2.1]), 40_000
    left, variance = np.array([0.02, -0.01, 0.05]), np.array([1e-4, 4e-4, 1e-4])
    noise, grid = np.ones((n, 1, 1)) * np.diag(variance), np.concatenate([within, beyond])
    given = (np.full(n, 0.2), lambda of: (np.ones((n, 1))[of] * left, noise[of]))
    mean, drawn = Paths.draw(*given, at, np.random.default_rng(0)).follow(within, beyond)
    K = 0.04 * covary_discrepancy(np.append(at, grid), np.append(at, grid), 0.0)
    gain = K[3:, :3] @ np.linalg.inv(K[:3, :3] + np.diag(variance))
    exact = K[3:, 3:] - gain @ K[:3, 3:]
    np.testing.assert_allclose(mean[0], gain @ left, rtol=1e-9)
    np.testing.assert_allclose(drawn.mean(axis=0), gain @ left, atol=5 * 0.2 / np.sqrt(n))  # five standard errors
    np.testing.assert_allclose(drawn.var(axis=0), np.diag(exact), rtol=5 * np.sqrt(2.0 / n))
    outward = np.s_[1:, 1:]  # the largest level and what is beyond are one path
    scale = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    np.testing.assert_allclose((np.cov(drawn.T) / scale)[outward], (exact / scale)[outward], atol=5 / np.sqrt(n))


def test_paths_do_not_depend_on_how_far_they_are_followed():
    """Nor on other places within the test; a repeat of a level has nothing of its own."""
    at, steps = np.log([1.0, 1.5, 1.5, 2.0]), np.log(2.0) + place_steps(3.0)[1:]
    sigma, left, noise = np.full(500, 0.1), np.zeros((500, 4)), np.tile(1e-4 * np.eye(4), (500, 1, 1))

    def draw(within, number):
        paths = Paths.draw(sigma, lambda of: (left[of], noise[of]), at, np.random.default_rng(3))
        return paths.follow(np.log(within), steps[:number])[1]

    near, far = draw([1.2, 1.5], 2), draw([1.2, 1.3, 1.5, 1.8], 9)
    np.testing.assert_allclose(near, far[:, [0, 2, 4, 5]], atol=1e-12)  # of the order of .1


def test_steps_reach_as_far_as_is_asked():
    """Geometric steps, the first of them whatever is asked."""
    for farthest in (0.0, 1e-9, 0.15, 1.4, 20.0):
        steps = place_steps(farthest)
        assert steps[0] == 0.0
        assert steps[-1] >= farthest * (1.0 - 1e-12)
        assert len(steps) < 3 or steps[-2] < farthest
        np.testing.assert_allclose(steps, place_steps(30.0)[: len(steps)], rtol=1e-14)


def test_between_two_steps_a_path_rises_as_the_law_does():
    """Share of the way by the law's ln A; evenly in ln F where the law has no resonance."""
    steps, asked = np.array([0.0, 1.0, 3.0]), np.array([0.25, 1.0, 2.0])
    law, path = np.array([[0.0, 1.0, np.nan]]), np.array([[0.1, 2.1, 6.1]])
    found = read_path(path, law, np.array([[0.5, 1.0, np.nan]]), asked, steps)
    np.testing.assert_allclose(found, [[1.1, 2.1, 4.1]], rtol=1e-14)


def test_slopes_stay_within_what_damping_can_do():
    z = np.linspace(0.0, 1.4, 8)
    paths = np.random.default_rng(1).standard_normal((200, 8)).cumsum(axis=1)
    slope = np.diff(extend(np.tile(0.7 * z, (200, 1)), paths, z, JointEvidence()), axis=1) / np.diff(z)
    assert slope.min() >= SLOPES[0] - 1e-12
    assert slope.max() <= SLOPES[1] + 1e-12
    # small discrepancies add to the law's slope, upward ones by their factor
    for slope_off, added in ((-1e-5, -1e-5), (1e-5, STEEPER * 1e-5)):
        found = extend(0.7 * z[None], slope_off * z[None], z, JointEvidence(), lets_go=False)
        np.testing.assert_allclose(found, (0.7 + added) * z[None], rtol=1e-8)


def test_a_law_without_resonance_counts_as_steep():
    z = np.array([0.0, 0.5, 1.0])
    found = extend(np.array([[0.0, np.nan, np.nan]]), np.zeros((1, 3)), z, JointEvidence())
    np.testing.assert_allclose(found, SLOPES[1] * z[None], rtol=1e-12)


def test_the_discrepancy_of_a_law_is_in_proportion_to_its_nonlinearity():
    found = measure_nonlinearity(np.array([[1.0, 1.0], [2.0, 2.0], [0.5, 0.5], [1.0, 2.0], [np.nan, 1.0]]))
    limit = 0.5 * (1.0 - SLOPES[0])  # a law without a force below a limit counts as steepest there
    np.testing.assert_allclose(found - LINEAR, [0.0, 0.5, SLOWER, 0.25, limit], rtol=1e-12)


@pytest.mark.parametrize("n", [1.3, 2.0, 3.0])
def test_loss_and_fall_of_stiffness_of_a_joint_are_bound_to_one_another(n):
    """Sliders with limits of density x^(n-2), by their closed forms one by one, against Gamma functions."""
    u = (np.arange(20_000) + 0.5) / 20_000  # x = u^4 takes the singular end off the midpoint rule
    C, _, S, _ = Slip(4.0 * u**3 * u ** (4.0 * (n - 2.0)), u**4).averages(0.25, 1.0)  # three quarters of x never slip
    expected = (n - 1.0) * gamma(n + 1.0) / (n * np.sqrt(np.pi) * gamma(n + 0.5))
    np.testing.assert_allclose(C.sum() / -S.sum(), expected, rtol=1e-4)  # u^0.2 at the end: (1/20 000)^1.2 and more
    assert n != 2.0 or expected == pytest.approx(4.0 / (3.0 * np.pi), rel=1e-12)  # Rayleigh's loop


def test_probability_of_a_joint_is_the_ratio_of_integrals():
    """Two levels: the error of the fall is that of two frequencies; the joint's fall is integrated numerically."""
    A, F, omega = np.array([1.0, 1.5]), np.array([1.0, 2.0]), np.array([10.02, 10.0])
    mass, tolerance = np.full(2, 4.0), 0.3
    per_loss = 4.0 * A[1] / F[1]
    fall = (omega[0] ** 2 - 100.0) * per_loss
    error = np.hypot(np.sqrt(2.0) * 2.0 * FREQUENCY_SCATTER * 100.0 * per_loss, tolerance * fall)
    width = np.hypot(OTHER_FALLS, error)
    other = OTHER_SHARES @ norm.pdf(fall, 0.0, width)

    def density(f):
        return 2.0 * norm.pdf(f, 0.0, JOINT_FALL) * (OTHER_SHARES @ norm.pdf(fall, f, width))

    joint = quad(density, 0.0, 9.0, points=[fall])[0]
    expected = JOINTS * joint / (JOINTS * joint + (1.0 - JOINTS) * other)
    np.testing.assert_allclose(find_joint(A, F, omega, mass, tolerance), (expected, fall, True, 0.0), rtol=1e-7)
    assert find_joint(A, F, omega, mass, 0.0).probability > 0.8
    assert find_joint(A, F, omega[::-1], mass, 0.0).probability < JOINTS
    # in other units the same; nothing known: as before
    np.testing.assert_allclose(find_joint(25.4 * A, F, omega, mass / 25.4, tolerance).probability, expected, rtol=1e-9)
    assert find_joint(A, F, np.full(2, 10.0), mass, 0.0) == JointEvidence(JOINTS, 0.0, informative=False)


def test_the_discrepancy_of_a_joint_is_larger_and_that_of_a_damper_smaller_upwards():
    z = np.array([0.0, 1.0, 2.0])
    far = LETS_GO * (1.0 / JOINTS - 1.0) * (1.0 - np.exp(-1.0 / LENGTH))  # what is left to a joint that is certain
    certain = [(fall, 1.0, share * far) for fall, share in ((-1.0, 0.0), (0.1, 0.2), (0.7, 1.0), (4.0, 0.25))]
    untold = UNTOLD * (1.0 - 0.7) / BENT * (1.0 - np.exp(-1.0 / LENGTH))  # no resonance tells
    for fall, up, least in (*certain, (np.nan, 1.0, untold), (0.0, 1.0 / WITHOUT_JOINT, 0.0)):
        joint = JointEvidence(float(up == 1.0), fall, informative=True) if np.isfinite(fall) else JointEvidence()
        for slope_off, factor in ((1e-5, STEEPER * up), (-1e-5, 1.0)):
            near, beyond = np.log(np.diff(extend(0.7 * z[None], slope_off * z[None], z, joint)[0]) / 0.7)
            own = factor * slope_off / 0.7
            np.testing.assert_allclose(near, own, rtol=1e-3)  # second order: 1e-5 of it
            np.testing.assert_allclose(beyond, np.copysign(np.hypot(own, least), own), rtol=1e-3)


def test_damping_in_proportion_to_amplitude_departs_as_far_whether_a_resonance_tells_or_not():
    z, paths = np.array([[0.0, 1.0, 2.0]]), np.array([[0.0, 0.1, 0.3]])
    told, untold = (extend(z, paths, z[0], joint) for joint in (JointEvidence(informative=True), JointEvidence()))
    np.testing.assert_allclose(untold, told, rtol=1e-14)  # q = 1


def test_levels_of_a_decay_drift_together(peaks):
    """As much again as each scatters, forgotten over ``DRIFT_LENGTH`` in ln A; levels of a forced test do not."""
    forced = peaks(np.array([1.0, 1.2, 2.0]), np.array([1.0, 1.2, 2.0]), 10.0)
    row, level = np.array([0.02, 0.05]), np.array([0.0, 0.01])
    apart = np.abs(np.subtract.outer(np.log(forced.A), np.log(forced.A)))
    own = level[:, None, None] ** 2 * np.eye(3)
    np.testing.assert_allclose(covary_scatter(row, level, forced), own, rtol=1e-12)
    drift = row[:, None, None] ** 2 * np.exp(-apart / DRIFT_LENGTH)
    decay = replace(forced, amplitude_is_input=True)
    np.testing.assert_allclose(covary_scatter(row, level, decay), own + drift, rtol=1e-12)


def test_likelihood_is_the_dense_normal_one():
    """Rows, levels and discrepancy in one covariance matrix, written out."""
    rng = np.random.default_rng(4)
    data = simulated_sweeps(draw_truth("saturating", rng).amplitude, np.array([0.6, 1.0, 1.7]), 0.02, 0.01, rng)
    c = Coordinates.of(Law(("viscous", "velocity-squared")), data)
    x = 0.3 * rng.standard_normal((3, c.dimension))
    n, h, known = residuals(c.force(x), data)
    shared = covary_levels(x, c, data, c.discrepancy_of_levels(x))
    for i, value in enumerate(log_likelihood(x, c, data)):
        H = np.eye(3)[data.sweep] * h[i][:, None]
        covariance = np.diag(c.scatter(x)[0][i] ** 2 + known[i]) + H @ shared[i] @ H.T
        np.testing.assert_allclose(value, multivariate_normal.logpdf(n[i], cov=covariance), rtol=1e-9)
