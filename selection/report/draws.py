"""Draws of the parameters of a law, before and after the test."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from selection.arrays import FloatArray
from selection.posterior.law import Coordinates
from selection.report.results import LawPosterior

#: Draws of a prior: the 5 % point of a density is then known to 1 % of its spread.
PRIOR_DRAWS = 40_000


@lru_cache(maxsize=32)
def prior_draws(coordinates: Coordinates) -> dict[str, FloatArray]:
    """Draws of the prior of each parameter: standard normal variables through ``coordinates.parameters``."""
    x = np.random.default_rng(0).standard_normal((PRIOR_DRAWS, coordinates.dimension))
    return coordinates.parameters(x)


def posterior_draws(sampled: LawPosterior) -> dict[str, FloatArray]:
    """Draws of the posterior of each parameter, ensembles after one another."""
    return {name: values.ravel() for name, values in sampled.posterior.parameters().items()}
