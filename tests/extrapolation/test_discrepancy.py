"""kappa: its prior, what it learns, and the distance that it goes with."""

import numpy as np
import pytest
from scipy.stats import lognorm, norm

from damping.extrapolation.near import KAPPA, KAPPA_LOG_SD, KAPPA_MEDIAN, distance, draw, log_density, posterior, prior
from damping.ranking.weights import HeldOut


def prediction(error, d, level=2, below=2, scatter=0.01):
    """A law that predicts 0 with a known scatter; measured ``error`` at distance ``d``."""
    error = np.atleast_1d(error)
    return HeldOut(level, below, 0.0, error, np.full(len(error), d), np.zeros((8, len(error))), np.full(8, scatter))


def test_prior_is_log_normal():
    quantiles = [0.05, 0.5, 0.95]
    found = np.interp(quantiles, np.cumsum(prior()), KAPPA * np.exp(0.5 * np.log(KAPPA[1] / KAPPA[0])))
    exact = lognorm(KAPPA_LOG_SD, scale=KAPPA_MEDIAN).ppf(quantiles)
    np.testing.assert_allclose(found, exact, rtol=0.01)  # linear between cells of 9 %
    values = draw(prior(), 20_000, np.random.default_rng(0))
    # standard error of the mean log: 0.75/sqrt(20000) = 0.005; five of these
    np.testing.assert_allclose(np.log(values / KAPPA_MEDIAN).mean(), 0.0, atol=0.027)
    np.testing.assert_allclose(np.log(values).std(), KAPPA_LOG_SD, rtol=0.03)


def test_density_is_the_normal_one():
    found = prediction([0.05, -0.02], 0.7).log_density(np.array([0.1]))
    expected = norm.logpdf([0.05, -0.02], 0.0, np.hypot(0.01, 0.07)).mean()
    np.testing.assert_allclose(found, [expected], rtol=1e-12)


def test_posterior_is_prior_times_likelihood():
    found = posterior([prediction(0.15, 1.0)])
    weight = prior() * norm.pdf(0.15, 0.0, np.hypot(0.01, KAPPA))
    np.testing.assert_allclose(found, weight / weight.sum(), rtol=1e-9)
    np.testing.assert_allclose(
        np.exp(log_density(prediction(0.15, 1.0))),
        np.sum(prior() * norm.pdf(0.15, 0.0, np.hypot(0.01, KAPPA))),
        rtol=1e-9,
    )


def test_learns_kappa_from_many_levels():
    rng = np.random.default_rng(3)
    for true in (0.02, 0.15):
        held = [prediction(rng.normal(0.0, np.hypot(0.01, true)), 1.0, level=i) for i in range(60)]
        p = posterior(held)
        mean = float(np.exp(np.sum(p * np.log(KAPPA))))
        # 60 errors give a standard deviation to 9 %; noise of half the smaller kappa adds a quarter to that
        np.testing.assert_allclose(mean, true, rtol=0.35)


def test_pairs_of_one_level_count_as_one():
    once = posterior([prediction(0.1, 0.8)])
    twice = posterior([prediction(0.1, 0.8, below=2), prediction(0.1, 0.8, below=3)])
    np.testing.assert_allclose(twice, once, rtol=1e-9)


def test_without_predictions_the_prior_stays():
    np.testing.assert_allclose(posterior([]), prior(), rtol=1e-12)


def test_a_law_without_resonance_teaches_nothing():
    nothing = HeldOut(2, 2, 0.0, np.zeros(1), np.ones(1), np.full((8, 1), np.nan), np.full(8, 0.01))
    np.testing.assert_allclose(posterior([nothing]), prior(), rtol=1e-12)
    assert log_density(nothing) == -np.inf
    assert nothing.probability_below() == 0.0


@pytest.mark.parametrize(
    ("force", "expected"),
    [(8.0, np.log(2.0)), (0.5, np.log(2.0)), (4.0, 0.0), (1.0, 0.0), (np.sqrt(2.0), 0.25 * np.log(2.0))],
)
def test_distance(force, expected):
    """Beyond the test the distance to the nearest level; halfway between two, d_1 d_2/(d_1 + d_2) = d/4."""
    found = distance(np.array([force]), np.array([4.0, 1.0, 2.0]))
    np.testing.assert_allclose(found, [expected], rtol=1e-12, atol=1e-12)
