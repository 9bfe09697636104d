"""A mixture of multivariate t distributions that covers a posterior: some adapted to it, one as wide as the prior.

It is both the proposal of importance sampling and an independence move of the Markov chains.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import gammaln, ndtri
from scipy.stats import chi2, qmc

from selection.arrays import FloatArray, IntArray

#: Heavier tails than a posterior close to normal, so that importance weights stay bounded.
DEGREES_OF_FREEDOM = 5.0
#: Share of the part as wide as the prior.
WIDE_SHARE = 0.15
#: Shares a posterior is cut into, across its longest axis each time: enough to follow a funnel or two modes.
PARTS = 8


@dataclass(frozen=True)
class Proposal:
    """``sum_k share_k t(mean_k, root_k root_k^T)`` in d variables.

    Attributes:
        shares: (k,), adding to 1. means: (k, d). roots: lower Cholesky factors, (k, d, d).
    """

    shares: FloatArray
    means: FloatArray
    roots: FloatArray

    @classmethod
    def around(cls, mean: FloatArray, covariance: FloatArray) -> Proposal:
        """One part with this mean and covariance, and the wide one."""
        return cls._with_wide(np.ones(1), mean[None, :], covariance[None, :, :])

    @classmethod
    def through(cls, draws: FloatArray) -> Proposal:
        """Parts fitted to posterior draws (n, d) cut into equal shares, and the wide one."""
        d = draws.shape[1]
        parts = [draws]
        while len(parts) < PARTS:
            halves = _halve(parts.pop(0))
            parts += halves
        # a part is cut off where the next begins: twice its covariance lets them overlap
        covariances = np.array([_widened(np.cov(p.T).reshape(d, d)) for p in parts])
        shares = np.array([len(p) / len(draws) for p in parts])
        return cls._with_wide(shares, np.array([p.mean(axis=0) for p in parts]), covariances)

    @classmethod
    def _with_wide(cls, shares: FloatArray, means: FloatArray, covariances: FloatArray) -> Proposal:
        d = means.shape[1]
        return cls(
            np.append((1.0 - WIDE_SHARE) * shares, WIDE_SHARE),
            np.vstack([means, np.zeros((1, d))]),
            np.concatenate([np.linalg.cholesky(covariances), np.eye(d)[None, :, :]]),
        )

    def transform(self, z: FloatArray, chi_square: FloatArray, part: IntArray) -> FloatArray:
        """Draws (n, d) from standard normals ``z`` (n, d), chi-squares (n,) and the part of each draw (n,)."""
        t = z / np.sqrt(chi_square / DEGREES_OF_FREEDOM)[:, None]
        return np.asarray(self.means[part] + np.einsum("nij,nj->ni", self.roots[part], t), dtype=np.float64)

    @cached_property
    def _inverse_roots(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self.roots), dtype=np.float64)

    @cached_property
    def _log_norms(self) -> FloatArray:
        """Log of each part's share times its density at its centre."""
        d, nu = self.means.shape[1], DEGREES_OF_FREEDOM
        norm = gammaln((nu + d) / 2) - gammaln(nu / 2) - 0.5 * d * np.log(nu * np.pi)
        return np.asarray(norm - np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(axis=1) + np.log(self.shares))

    def log_density(self, x: FloatArray) -> FloatArray:
        """Log density at x (n, d)."""
        d, nu = x.shape[1], DEGREES_OF_FREEDOM
        z = self._inverse_roots @ (x[:, None, :] - self.means)[..., None]
        parts = self._log_norms - 0.5 * (nu + d) * np.log1p(np.sum(z[..., 0] ** 2, axis=2) / nu)
        top = parts.max(axis=1)
        return np.asarray(top + np.log(np.sum(np.exp(parts - top[:, None]), axis=1)))

    def sobol(self, power: int, seed: int) -> FloatArray:
        """2^power draws on scrambled Sobol points."""
        z, chi_square, u = _standard_draws(self.means.shape[1], power, seed)
        return self.transform(z, chi_square, self._part(u))

    def __call__(self, x: FloatArray, rng: np.random.RandomState) -> tuple[FloatArray, FloatArray]:
        """A Metropolis-Hastings proposal for each walker: new points and ln q(old) - ln q(new)."""
        n, d = x.shape
        z = rng.standard_normal((n, d))
        chi_square = np.asarray(rng.chisquare(DEGREES_OF_FREEDOM, n))
        u = np.asarray(rng.random_sample(n))
        new = self.transform(z, chi_square, self._part(u))
        return new, self.log_density(x) - self.log_density(new)

    def _part(self, u: FloatArray) -> IntArray:
        """The part that a uniform variable falls into."""
        edges = np.cumsum(self.shares)[:-1]
        return np.searchsorted(edges, u).astype(np.int64)


def _widened(covariance: FloatArray) -> FloatArray:
    """Twice a covariance, its diagonal raised a little so that few different draws still give a density."""
    return 2.0 * covariance + np.diag(1e-6 * np.diag(covariance) + 1e-16)


def _halve(draws: FloatArray) -> list[FloatArray]:
    """Two equal shares of draws (n, d), cut across their longest axis."""
    centred = draws - draws.mean(axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    order = np.argsort(centred @ axis, kind="stable")
    return [draws[order[: len(order) // 2]], draws[order[len(order) // 2 :]]]


@lru_cache(maxsize=32)  # every law of as many parameters asks for the same points
def _standard_draws(dimension: int, power: int, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Standard normals (n, d), chi-squares (n,) and uniforms (n,) on one set of Sobol points."""
    u = sobol(dimension + 2, power, seed)
    return ndtri(u[:, 2:]), chi2.ppf(u[:, 1], DEGREES_OF_FREEDOM), u[:, 0]


def sobol(dimension: int, power: int, seed: int) -> FloatArray:
    """2^power scrambled Sobol points strictly inside the unit cube, (2^power, dimension)."""
    points = qmc.Sobol(dimension, scramble=True, rng=np.random.default_rng(seed)).random_base2(power)
    return np.clip(points, 1e-12, 1.0 - 1e-12)
