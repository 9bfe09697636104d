"""Levels of a test by their forces."""

import numpy as np

from damping.ranking.weights import level_numbers


def test_levels_are_forces_and_repeats_share_one():
    assert level_numbers(np.array([0.158, 0.471, 0.029, 0.148, 0.275, 0.483])).tolist() == [1, 3, 0, 1, 2, 3]
    assert level_numbers(np.array([5.0])).tolist() == [0]
    # a chain of small steps does not become one level: each is compared with the first of its level
    assert level_numbers(np.array([1.0, 1.07, 1.14, 1.21])).tolist() == [0, 0, 1, 1]
