"""Levels held out, and weights from them."""

import numpy as np
import pytest
from scipy.special import softmax

from damping.errors import AnalysisError
from damping.infer.law import Law
from damping.ranking.weights import ENOUGH, held_out, pseudo_bma
from damping_validation.calibration import simulated_levels, structures


def test_weights_are_pseudo_bma_once_enough_levels_are_held_out():
    log_density = np.array([[1.0, 2.0, 0.5, 1.0], [1.5, 1.0, 0.0, 0.2]])
    np.testing.assert_allclose(pseudo_bma(log_density), softmax([4.5, 2.7]), rtol=1e-12)


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_weights_are_shrunk_towards_equal_ones(levels):
    log_density = np.array([[2.0] * levels, [0.0] * levels, [-1.0] * levels])
    trust = levels / ENOUGH
    expected = trust * softmax(log_density.sum(axis=1)) + (1.0 - trust) / 3.0
    np.testing.assert_allclose(pseudo_bma(log_density), expected, rtol=1e-12)


def test_nothing_held_out_or_nothing_predicted_gives_equal_weights():
    np.testing.assert_allclose(pseudo_bma(np.empty((4, 0))), 0.25, rtol=1e-12)
    np.testing.assert_allclose(pseudo_bma(np.full((2, 3), -np.inf)), 0.5, rtol=1e-12)


def test_a_law_that_cannot_predict_keeps_only_its_equal_share():
    found = pseudo_bma(np.array([[-np.inf, 1.0], [0.5, 0.5]]))
    np.testing.assert_allclose(found, [0.25, 0.75], rtol=1e-12)


def test_higher_levels_are_predicted_from_the_lower_ones_alone():
    """The same predictions whatever the higher levels measured."""
    structure = structures()[1]
    data = simulated_levels(structure, 5, 4.0, 0.01, np.random.default_rng(0))
    low = held_out(structure.law, data, 3)
    assert [p.level for p in low] == [3, 4]
    assert all(p.below == 3 for p in low)
    changed = type(data)(**{**vars(data), "A": data.A * [1, 1, 1, 2, 3], "tested_amplitude": data.A * [1, 1, 1, 2, 3]})
    for a, b in zip(low, held_out(structure.law, changed, 3), strict=True):
        np.testing.assert_array_equal(a.log_amplitude, b.log_amplitude)
        assert b.measured[0] > a.measured[0]
    np.testing.assert_allclose(low[1].distance, np.log(data.D[4] / data.D[2]), rtol=1e-12)


def test_prediction_is_the_laws_own():
    """Viscous: ln A = ln F - ln(c omega), so every draw misses by the same at all levels."""
    structure = structures()[0]
    data = simulated_levels(structure, 4, 4.0, 0.01, np.random.default_rng(1))
    a, b = held_out(Law(("viscous",)), data, 2)
    np.testing.assert_allclose(
        np.diff([a.log_amplitude, b.log_amplitude], axis=0)[0], np.log(data.D[3] / data.D[2]), rtol=1e-9
    )
    # the mean of two measured: standard error 0.7 %, and the prior of the scatter allows no more than a few per cent
    np.testing.assert_allclose(a.log_amplitude.mean(), np.log(data.D[2]), atol=0.03)
    assert 0.0 < a.probability_below() < 1.0


def test_a_law_that_cannot_carry_the_lower_levels_says_so(peaks):
    with pytest.raises(AnalysisError, match="coulomb"):
        held_out(Law(("coulomb",)), peaks(np.array([1.0, 2.0, 3.0]), np.array([1.0, 2.0, 3.0]), 10.0), 2)
