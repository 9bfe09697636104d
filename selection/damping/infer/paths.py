"""Paths of the discrepancy (:mod:`damping.infer.discrepancy`) given the residuals of levels, by Matheron's rule.

A path is drawn at the levels, then outward place by place, so that no place depends on those farther out; places within
the test are drawn separately. Given the levels, g at a place is a sum over them of weights times covariances. Only the
covariances depend on the place: the weights, which cost most by far, are found once and serve all places.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from damping.arrays import FloatArray
from damping.infer.discrepancy import covary_discrepancy

_MOST_COVARIANCES = 250_000  #: of draws whose levels are followed together, 2 MB: they stay in a processor's cache
#: Square roots of primes: steps of quasi-random points (Richtmyer 1951) for the directions in which paths differ most.
_STEPS = np.sqrt([2.0, 3.0, 5.0, 7.0, 11.0, 13.0])
_STEPS_BEYOND = 4  #: how many of them are of the first places beyond the test; the others are of the levels
#: Eigenvalue of a covariance of levels, over the largest, taken as rounding: repeats of one force add none.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Paths:
    """The mean and one path of g for each draw of a law, given its levels."""

    at: FloatArray  #: ln F of the levels, rising
    sigma: FloatArray  #: of each draw, (draws,)
    of_mean: FloatArray  #: weights of the covariances with the levels in the mean, (draws, levels)
    of_path: FloatArray  #: the same in the path, (draws, levels)
    points: FloatArray  #: normal variables of the first places beyond the test, (places, draws)
    beyond: np.random.SeedSequence  #: of those of all places beyond the test
    within: FloatArray  #: normal variable common to the places within the test, (draws, 1)

    @classmethod
    def draw(
        cls,
        sigma: FloatArray,
        compare: Callable[[slice], tuple[FloatArray, FloatArray]],
        at: FloatArray,
        rng: np.random.Generator,
    ) -> Paths:
        """Paths through the levels. Neighbouring draws fill the principal directions: band ends err a third as much.

        Args:
            sigma: of each draw, (draws,).
            compare: at a slice of the draws, ln A of the levels less the law's, (draws, levels), and the covariance of
                its errors, (draws, levels, levels).
            at: ln F of the levels, rising.
            rng: of all that is random.
        """
        number, known = len(sigma), _know_levels(tuple(at))
        by_levels, by_beyond, by_within, by_errors = rng.spawn(4)
        places = np.arange(number)[:, None] * _STEPS + rng.random(len(_STEPS))
        points = ndtri(np.clip(places % 1.0, 1e-12, 1.0 - 1e-12)).T
        x = by_levels.standard_normal((len(at), number))
        spread = points[_STEPS_BEYOND:][: len(at)]
        x[len(at) - len(spread) :] = spread[::-1]  # directions of largest variance are last
        of_path = (known.directions @ x).T  # first g at the levels, then weights
        del x
        of_mean = np.empty(of_path.shape)
        step = max(1, _MOST_COVARIANCES // len(at) ** 2)
        for part in (slice(first, first + step) for first in range(0, number, step)):
            (residual, own), size, levels = compare(part), sigma[part, None], of_path[part]
            errors = (np.linalg.cholesky(own) @ by_errors.standard_normal((*levels.shape, 1)))[..., 0]
            square = (size**2)[..., None] * known.covariance + own
            wanted = np.stack([residual, residual - size * levels - errors], axis=-1)
            solved = np.linalg.solve(square, wanted) * (size**2)[..., None]
            of_mean[part] = solved[..., 0]
            of_path[part] = solved[..., 1] + size * (levels @ known.inverse)
        seeds, inner = by_beyond.bit_generator.seed_seq, by_within.standard_normal((number, 1))
        # numpy types the seed of a bit generator as a protocol; that of a spawned generator is a SeedSequence
        return cls(at, sigma, of_mean, of_path, points[:_STEPS_BEYOND], seeds, inner)  # type: ignore[arg-type]

    def follow(self, within: FloatArray, beyond: FloatArray) -> tuple[FloatArray, FloatArray]:
        """g at places ``within`` the test and ``beyond`` it, in ln F, rising: mean and path, each (draws, places)."""
        to_levels, sd_within, root_beyond = _know_places(tuple(self.at), tuple(within), tuple(beyond))
        outward = np.random.default_rng(self.beyond).standard_normal((len(beyond), len(self.sigma)))
        outward[: len(self.points)] = self.points[: len(beyond)]
        path = self.of_path @ to_levels.T
        path[:, len(within) :] += (root_beyond @ outward).T * self.sigma[:, None]
        path[:, : len(within)] += self.within * sd_within * self.sigma[:, None]
        return self.of_mean @ to_levels.T, path


class _KnownLevels(NamedTuple):
    """g at the levels, for sigma = 1; each (levels, levels)."""

    covariance: FloatArray
    inverse: FloatArray  #: pseudo-inverse of the covariance
    directions: FloatArray  #: principal directions times standard deviations


@lru_cache(maxsize=16)  # shared by all laws on a record
def _know_levels(at: tuple[float, ...]) -> _KnownLevels:
    """What is known of g at levels of ln F ``at``."""
    levels = np.array(at)
    covariance = covary_discrepancy(levels, levels, float(np.mean(at)))
    variance, directions = np.linalg.eigh(covariance)
    directions *= np.copysign(1.0, directions[-1])  # a sign that does not depend on rounding
    inverse = np.asarray(np.linalg.pinv(covariance, rcond=_ROUNDING, hermitian=True), dtype=np.float64)
    return _KnownLevels(covariance, inverse, directions * np.sqrt(np.maximum(variance, 0.0)))


@lru_cache(maxsize=16)  # as above
def _know_places(
    at: tuple[float, ...], within: tuple[float, ...], beyond: tuple[float, ...]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """For sigma = 1, the covariance of places, those within the test first, with the levels, (places, levels).

    And, given the levels, the standard deviations within the test and the Cholesky factor of the covariance beyond it.
    """
    levels, places, origin = np.array(at), np.array([*within, *beyond]), float(np.mean(at))
    to_levels = covary_discrepancy(places, levels, origin)
    rest = covary_discrepancy(places, places, origin) - to_levels @ _know_levels(at).inverse @ to_levels.T
    outer = rest[len(within) :, len(within) :] + _ROUNDING * np.eye(len(beyond))
    sd_within = np.asarray(np.sqrt(np.maximum(np.diag(rest)[: len(within)], 0.0)))
    return to_levels, sd_within, np.asarray(np.linalg.cholesky(outer), dtype=np.float64)
