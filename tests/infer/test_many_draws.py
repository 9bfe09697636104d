"""As many importance draws as are wanted; and the model that samplers are timed on is the library's own."""

import numpy as np
import pytest

from benchmarks import _contender
from damping.errors import AnalysisError
from damping.infer.importance import importance, more_draws
from damping.infer.likelihood import log_posterior


def normal(x: np.ndarray) -> np.ndarray:
    """Mean (1, -0.5), sds .3 and .1, correlation .6, up to a constant."""
    u, v = (x[:, 0] - 1.0) / 0.3, (x[:, 1] + 0.5) / 0.1
    return -0.5 * (u**2 - 1.2 * u * v + v**2) / (1.0 - 0.36)


def test_draws_are_worth_what_is_wanted():
    start = importance(normal, np.array([1.0, -0.5]), np.array([[0.09, 0.018], [0.018, 0.01]]))
    x, worth = more_draws(normal, start, 20_000, seed=3)
    assert 20_000 <= worth <= len(x)
    # 4 standard errors of 20 000 independent draws; points that fill space err less
    error = 4.0 / np.sqrt(20_000)
    np.testing.assert_allclose(x.mean(axis=0), [1.0, -0.5], rtol=0.0, atol=error * 0.3)
    np.testing.assert_allclose(x.std(axis=0), [0.3, 0.1], rtol=error, atol=0.0)
    np.testing.assert_allclose(np.corrcoef(x.T)[0, 1], 0.6, rtol=0.0, atol=error)


def test_more_than_memory_holds_is_refused():
    start = importance(normal, np.array([1.0, -0.5]), np.array([[0.09, 0.018], [0.018, 0.01]]))
    with pytest.raises(AnalysisError, match="need more than"):
        more_draws(normal, start, 1e9)


def test_samplers_are_timed_on_the_posterior_of_the_library():
    coordinates, data = _contender.target()
    x = np.random.default_rng(0).standard_normal((200, 3))
    plain = np.array([_contender.plain(point) for point in x])
    # a constant apart, of the prior and of the rows; sums of squares up to 1e7 are rounded at some 1e-15
    np.testing.assert_allclose(log_posterior(x, coordinates, data) + 3.0 * np.log(2.0 * np.pi), plain, rtol=1e-12)
