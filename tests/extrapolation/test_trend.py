"""Local exponents, what counts as a change of them, and bistability."""

import numpy as np
import pytest

from damping.extrapolation.near import BISTABLE, CHANGES, describe_bistability, trend


def test_a_power_law_has_one_exponent(peaks):
    F = np.array([1.0, 2.0, 5.0, 9.0])
    found = trend(peaks(F ** (1.0 / 1.7), F, 10.0), 0.02)
    np.testing.assert_allclose(found.p, 1.7, rtol=1e-12)
    np.testing.assert_allclose(found.z, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.force, np.sqrt(F[1:] * F[:-1]), rtol=1e-12)
    assert not found.rising
    assert not found.falling


def test_standard_deviation_and_change_against_simulation(peaks):
    """Linearised in the scatter: second order terms of (1 % / 0.69)^2 are far below the 2 % the simulation can see."""
    F, scatter, rng = np.array([1.0, 2.0, 4.0]), 0.01, np.random.default_rng(2)
    trends = [trend(peaks(F * np.exp(scatter * rng.standard_normal(3)), F, 10.0), scatter) for _ in range(4000)]
    p = np.array([t.p for t in trends])
    expected = trend(peaks(F, F, 10.0), scatter)
    np.testing.assert_allclose(p.std(axis=0), expected.sd, rtol=0.06)  # five standard errors of 1.1 %
    np.testing.assert_allclose(np.std([t.z for t in trends]), 1.0, rtol=0.06)


def test_repeats_of_a_level_are_averaged(peaks):
    F, A = np.array([1.0, 4.0, 1.02, 2.0]), np.array([1.0, 2.0, 1.1, 1.4])
    found = trend(peaks(A, F, 10.0), 0.02)
    first = np.log(2.0 / np.sqrt(1.02)) / np.log(1.4 / np.sqrt(1.1))
    np.testing.assert_allclose(found.p, [first, np.log(2.0) / np.log(2.0 / 1.4)], rtol=1e-12)


@pytest.mark.parametrize(("p_last", "says"), [(3.0, "rising"), (0.5, "falling")])
def test_change_at_the_top(p_last, says, peaks):
    F = np.array([1.0, 2.0, 4.0])
    A = np.array([1.0, 2.0, 2.0 * 2.0 ** (1.0 / p_last)])
    found = trend(peaks(A, F, 10.0), 0.02)
    assert abs(found.z) > CHANGES
    assert getattr(found, says)


def test_two_levels_say_nothing_of_a_change(peaks):
    found = trend(peaks(np.array([1.0, 2.0]), np.array([1.0, 2.0]), 10.0), 0.02)
    assert np.isnan(found.z)
    assert not found.rising


def test_amplitude_that_does_not_grow_has_no_exponent(peaks):
    found = trend(peaks(np.array([1.0, 0.99, 1.4]), np.array([1.0, 2.0, 4.0]), 10.0), 0.02)
    assert np.isnan(found.p[0])
    assert not found.rising
    assert not found.falling


def test_bistability_counts_half_power_bandwidths(peaks):
    """F/(M omega A) = 0.05 rad/s for M = 2, F = 1, A = 1, omega = 10."""
    shift = 0.05 * BISTABLE
    for factor, said in ((0.9, False), (1.1, True)):
        data = peaks(np.array([0.5, 1.0]), np.array([0.5, 1.0]), np.array([10.0 + factor * shift, 10.0]))
        assert bool(describe_bistability(data, 2.0)) == said
