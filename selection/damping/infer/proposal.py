"""A mixture of multivariate t that covers a posterior: the proposal of importance sampling and chains.

One component is as wide as the prior. The others start from the Gaussian at the mode and are adapted to weighted draws
by expectation and maximisation (Cappe et al. 2008, adaptive importance sampling in general mixture classes).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln, ndtri

from damping.arrays import FloatArray

DEGREES_OF_FREEDOM = 5.0  #: heavier tails than of a nearly normal posterior, so that importance weights stay bounded
WIDE_SHARE = 0.3  #: share of the component as wide as the prior in the first proposal, and in those fitted to draws
LEAST_WIDE = 0.2  #: least share of that component in proposals improved by expectation and maximisation
#: Share, beside the wide component, of one over all draws: it samples tails that few draws have reached (a large
#: scatter leaves shares open) before their weights are large.
BROAD_SHARE = 0.3
BROAD = 4.0  #: its covariance over that of all draws: twice as wide
#: Share in the first proposal, beside the wide component, of one around the mode: a second mode (small scatter, large
#: discrepancy) lies a few standard deviations off. For a viscous law on three resonances the ln evidence was .035 short
#: without it and is .009 short with it (by 1.5 million draws).
FAR_SHARE = 0.4
FAR = 9.0  #: its covariance over that at the mode: three times as wide
#: Components fitted to draws, split across the longest axis each time: enough for a funnel or two modes.
PARTS = 8
#: Draws whose densities are computed at once, so that intermediate arrays stay in a processor's cache.
BLOCK = 1024
#: Rounding of the first means and roots, in conditional standard deviations given the variables before.
ROUNDED = 2.0**-12
MOST_FITTED = 1024  #: most draws to which a proposal is fitted
#: Share of the total covariance added to each component's, times the effective draws: few different draws then still
#: cover their surroundings.
BLUR = 20.0
LEAST_BLUR = 0.1  #: least share that is added, however many draws there are


@dataclass(frozen=True)
class Proposal:
    """``sum_k share_k t(mean_k, root_k root_k^T)`` in d variables."""

    shares: FloatArray  #: (k,), adding to 1
    means: FloatArray  #: (k, d)
    roots: FloatArray  #: lower Cholesky factors, (k, d, d)

    @classmethod
    def around(cls, means: FloatArray, covariances: FloatArray) -> Proposal:
        """Two components for each mean (k, d) and covariance (k, d, d), one of them ``FAR`` wider, and the wide one.

        Both are rounded, since their last digits differ between processors and adaptation amplifies that.
        """
        k, d = means.shape
        roots = np.linalg.cholesky(covariances.reshape(k, d, d))
        step = ROUNDED * np.exp2(np.round(np.log2(np.diagonal(roots, axis1=1, axis2=2))))
        roots = np.round(roots / step[..., None]) * step[..., None]
        covariances, means = roots @ roots.transpose(0, 2, 1), np.round(means / step) * step
        shares = np.repeat([(1.0 - FAR_SHARE) / k, FAR_SHARE / k], k)
        return cls._with_wide(shares, np.tile(means, (2, 1)), np.concatenate([covariances, FAR * covariances]))

    @classmethod
    def through(cls, draws: FloatArray, worth: float) -> Proposal:
        """Components fitted to posterior draws (n, d), of effective size ``worth``, and the wide one."""
        draws = draws[:: max(1, len(draws) // MOST_FITTED)]
        parts = [draws]
        while len(parts) < PARTS:  # halve each across its longest axis
            part = parts.pop(0)
            centred = part - part.mean(axis=0)
            axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
            axis *= np.copysign(1.0, axis[np.argmax(np.abs(axis))])  # a sign that does not depend on rounding
            order = np.argsort(centred @ axis, kind="stable")
            parts += [part[order[: len(part) // 2]], part[order[len(part) // 2 :]]]
        total = _covary(draws)
        least = max(BLUR / worth, LEAST_BLUR) * total + np.diag(1e-6 * np.diag(total) + 1e-16)
        # parts are disjoint: twice the covariance lets the components overlap
        covariances = np.array([2.0 * _covary(p) + least for p in parts])
        shares = np.array([len(p) / len(draws) for p in parts])
        return cls._with_wide(shares, np.array([p.mean(axis=0) for p in parts]), covariances)._improve(draws, least)

    def _improve(self, draws: FloatArray, least: FloatArray) -> Proposal:
        """One step of expectation and maximisation on draws (n, d); ``least`` is added to each covariance."""
        d, growth = draws.shape[1], self._grow(draws)
        of_part = self._heights[:, None] * growth ** (-0.5 * (DEGREES_OF_FREEDOM + d))
        of_part /= of_part.sum(axis=0)
        number = of_part.sum(axis=1)
        kept = np.flatnonzero(number[:-1] > d)
        weight = (of_part * ((1.0 + d / DEGREES_OF_FREEDOM) / growth))[kept]
        means = weight @ draws / weight.sum(axis=1, keepdims=True)
        centred = draws - means[:, None]
        covariances = (centred * weight[..., None]).transpose(0, 2, 1) @ centred / number[kept, None, None] + least
        shares = (1.0 - BROAD_SHARE) * number[kept] / number[kept].sum()
        return self._with_wide(
            np.append(shares, BROAD_SHARE),
            np.vstack([means, draws.mean(axis=0)]),
            np.concatenate([covariances, BROAD * (_covary(draws) + least)[None]]),
            max(number[-1] / number.sum(), LEAST_WIDE),
        )

    @classmethod
    def _with_wide(
        cls, shares: FloatArray, means: FloatArray, covariances: FloatArray, wide: float = WIDE_SHARE
    ) -> Proposal:
        d = means.shape[1]
        return cls(
            np.append((1.0 - wide) * shares, wide),
            np.vstack([means, np.zeros((1, d))]),
            np.concatenate([np.linalg.cholesky(covariances), np.eye(d)[None, :, :]]),
        )

    def transform(self, z: FloatArray, chi_square: FloatArray, u: FloatArray) -> FloatArray:
        """Draws (n, d) from standard normals ``z`` (n, d), chi-squares (n,) and uniform variables (n,), which select
        components."""
        part = np.searchsorted(np.cumsum(self.shares)[:-1], u)
        t = z / np.sqrt(chi_square / DEGREES_OF_FREEDOM)[:, None]
        return np.asarray(self.means[part] + np.einsum("nij,nj->ni", self.roots[part], t), dtype=np.float64)

    @cached_property
    def _whitening(self) -> tuple[FloatArray, FloatArray]:
        """Matrix (d k, d) and offsets (d k, 1) that whiten x (d, n) for each component, axis by axis."""
        d, inverse = self.means.shape[1], np.asarray(np.linalg.inv(self.roots), dtype=np.float64)
        offsets = -inverse @ self.means[..., None]
        return inverse.swapaxes(0, 1).reshape(-1, d), offsets.swapaxes(0, 1).reshape(-1, 1)

    @cached_property
    def _heights(self) -> FloatArray:
        """Each component's share times its density at its centre."""
        d, nu = self.means.shape[1], DEGREES_OF_FREEDOM
        norm = gammaln((nu + d) / 2) - gammaln(nu / 2) - 0.5 * d * np.log(nu * np.pi)
        log_volume = np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(axis=1)
        return np.asarray(np.exp(norm - log_volume + np.log(self.shares)))

    def _grow(self, x: FloatArray) -> FloatArray:
        """1 + (squared distance of x (n, d) from each component)/nu, (k, n)."""
        whitening, origin = self._whitening
        white = whitening @ x.T
        white += origin
        white *= white
        return np.asarray(1.0 + white.reshape(x.shape[1], len(self.shares), len(x)).sum(axis=0) / DEGREES_OF_FREEDOM)

    def density(self, x: FloatArray) -> FloatArray:
        """Density at x (n, d), positive since the wide component has heavy tails."""
        power = -0.5 * (DEGREES_OF_FREEDOM + x.shape[1])
        blocks = np.array_split(x, 1 + len(x) // BLOCK)
        return np.concatenate([self._heights @ self._grow(block) ** power for block in blocks])

    def log_density(self, x: FloatArray) -> FloatArray:
        """ln of `density`."""
        return np.asarray(np.log(self.density(x)))

    def draw(self, number: int, seed: int) -> FloatArray:
        """Draws (number, d) from space-filling points."""
        return self.transform(*fill_space(self.means.shape[1], number, seed))

    def draw_random(self, number: int, rng: np.random.RandomState) -> FloatArray:
        """Independent draws (number, d)."""
        z = rng.standard_normal((number, self.means.shape[1]))
        chi_square = np.asarray(rng.chisquare(DEGREES_OF_FREEDOM, number))
        return self.transform(z, chi_square, np.asarray(rng.random_sample(number)))


def fill_space(d: int, number: int, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Space-filling arguments of `Proposal.transform`: (number, d), (number,), (number,)."""
    rng = np.random.default_rng(seed)
    u = fill_cube(d + 1, number, rng)
    return ndtri(u[:, 1:]), np.asarray(rng.chisquare(DEGREES_OF_FREEDOM, number)), u[:, 0]


def _covary(draws: FloatArray) -> FloatArray:
    """Covariance (d, d) of draws (n, d)."""
    centred = draws - draws.mean(axis=0)
    return np.asarray(centred.T @ centred / max(len(draws) - 1, 1))


def fill_cube(dimension: int, number: int, rng: np.random.Generator) -> FloatArray:
    """Points strictly inside the unit cube, (number, dimension): one in each of ``number`` equal slices of every axis.

    A Latin hypercube (McKay, Beckman and Conover 1979). For the laws here it is as accurate as Sobol points of
    scipy.stats, whose import takes half a second.
    """
    slices = rng.permuted(np.tile(np.arange(number)[:, None], (1, dimension)), axis=0)
    return np.clip((slices + rng.random((number, dimension))) / number, 1e-12, 1.0 - 1e-12)
