"""Marginal likelihood of a law on observations, by importance sampling around its posterior mode."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from selection.posterior.importance import Evidence, importance
from selection.posterior.law import Coordinates
from selection.posterior.likelihood import log_posterior
from selection.posterior.mode import covariance_at, find_mode
from selection.posterior.observations import Observations

__all__ = ["Estimate", "Evidence", "evidence", "remembered"]

#: A way to the marginal likelihood and draws of a law on observations, with a seed: ``evidence``, or ``laplace``.
Estimate = Callable[[Coordinates, Observations, int], Evidence]


def evidence(coordinates: Coordinates, data: Observations, seed: int = 0) -> Evidence:
    """Marginal likelihood of a law, with weighted draws of its posterior.

    Raises:
        AnalysisError: the law cannot carry the measured forces.
    """
    mode = find_mode(coordinates, data)
    density = partial(log_posterior, coordinates=coordinates, data=data)
    return importance(density, mode, covariance_at(mode, coordinates, data), seed)


def remembered(estimate: Estimate) -> Estimate:
    """The same estimate, computed once for equal arguments: rankings and plans of peaks ask for the same ones.

    Arguments are equal where they are so in single precision: a force that was multiplied by pi A and divided again
    differs in its last bit.
    """
    known: dict[tuple[object, ...], Evidence] = {}

    def estimated(coordinates: Coordinates, data: Observations, seed: int) -> Evidence:
        arrays = (value for value in vars(data).values() if isinstance(value, np.ndarray))
        key = (coordinates, seed, data.sweeps, *(value.astype(np.float32).tobytes() for value in arrays))
        if key not in known:
            known[key] = estimate(coordinates, data, seed)
        return known[key]

    return estimated
