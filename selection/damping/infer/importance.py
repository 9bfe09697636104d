"""A mixture of multivariate t distributions that covers a posterior: some adapted to it, one as wide as the prior.

It is both the proposal of importance sampling and an independence move of the Markov chains.

Marginal likelihood of any log density by importance sampling with an adapted proposal.

    Z = int exp(log density) dx ~ mean of w,   w = exp(log density)/q,   x ~ q,

with ``q`` on scrambled Sobol points a mixture of multivariate t (see ``proposal``): one as wide as the prior, the
others started from the Gaussian at the mode and adapted to the weighted draws until enough of them count. The draws,
resampled by weight, also start the Markov chains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.special import gammaln, ndtri
from scipy.stats import chi2, qmc

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError

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


_POWER = 13  # 8192 draws a round: 1 % of standard error in Z for a posterior close to a t
_MOST_ROUNDS = 8  # of adaptation
_ENOUGH = 2000  # effective draws at which to stop
_LARGEST_POWER = 22  # of two: draws that still fit a small memory


@dataclass(frozen=True)
class Evidence:
    """A marginal likelihood and a weighted picture of the posterior.

    Attributes:
        log_z: natural logarithm of the marginal likelihood. standard_error: its Monte Carlo standard error.
        mode: x of largest posterior density, (dimension,). proposal: adapted to the posterior.
        draws: resampled by weight, (8192, dimension).
        effective_draws: 1/sum of squared normalised weights.
    """

    log_z: float
    standard_error: float
    mode: FloatArray
    proposal: Proposal
    draws: FloatArray
    effective_draws: float


def importance(
    log_density: Callable[[FloatArray], FloatArray],
    mode: FloatArray,
    covariance: FloatArray,
    seed: int = 0,
    least_rounds: int = 3,
) -> Evidence:
    """Evidence and weighted draws of a density over standard normal variables.

    Args:
        log_density: at points (n, d) -> (n,), ``-inf`` allowed. mode, covariance: where to begin, (d,) and (d, d).
        least_rounds: of adaptation, more where a part of the posterior lies far from the mode: few draws meet it at
            first and enough later.
    """
    proposal = Proposal.around(mode, covariance)
    rng = np.random.default_rng(seed)
    for round_ in range(_MOST_ROUNDS):
        x = proposal.sobol(_POWER, seed + round_)
        log_w = log_density(x) - proposal.log_density(x)
        w = np.exp(log_w - log_w.max())
        draws = x[rng.choice(len(x), size=len(x), p=w / w.sum())]
        effective = float(w.sum() ** 2 / np.sum(w**2))
        if round_ == _MOST_ROUNDS - 1 or (round_ >= least_rounds - 1 and effective > _ENOUGH):
            break
        proposal = Proposal.through(draws)
    return Evidence(
        log_z=float(log_w.max() + np.log(np.mean(w))),
        standard_error=float(np.std(w) / np.mean(w) / np.sqrt(len(w))),
        mode=mode,
        proposal=proposal,
        draws=draws,
        effective_draws=effective,
    )


def more_draws(
    log_density: Callable[[FloatArray], FloatArray], start: Evidence, wanted: float, seed: int = 0
) -> tuple[FloatArray, float]:
    """Posterior draws (n, dimension) that are worth ``wanted`` independent ones, n a power of two, and their worth.

    From the adapted proposal of ``start``, resampled by weight with equal spacing (systematic), which adds next to
    nothing to the error.

    Raises:
        AnalysisError: 2^22 draws are worth less.
    """
    efficiency = start.effective_draws / len(start.draws)
    power = int(np.ceil(np.log2(1.1 * wanted / efficiency)))
    while power <= _LARGEST_POWER:
        x = start.proposal.sobol(power, seed)
        log_w = log_density(x) - start.proposal.log_density(x)
        w = np.exp(log_w - log_w.max())
        effective = float(w.sum() ** 2 / np.sum(w**2))
        if effective >= wanted:
            edges = (np.arange(len(x)) + np.random.default_rng(seed).random()) / len(x)
            return x[np.minimum(np.searchsorted(np.cumsum(w) / w.sum(), edges), len(x) - 1)], effective
        power += 1
    raise AnalysisError(f"importance draws worth {wanted:g} would need more than 2^{_LARGEST_POWER}")
