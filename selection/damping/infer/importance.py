"""Marginal likelihood of any log density by importance sampling with an adapted proposal.

    Z = int exp(log density) dx ~ mean of w,   w = exp(log density)/q,   x ~ q,

with ``q`` a mixture of multivariate t that covers the posterior: one part as wide as the prior, the others started from
the Gaussian at the mode and adapted to the weighted draws by expectation and maximisation until enough of them
count (Cappe et al. 2008, adaptive importance sampling in general mixture classes). The draws, resampled by weight, also
start the Markov chains, which choose among further draws of the mixture.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import gammaln, ndtri

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError

#: Heavier tails than a posterior close to normal, so that importance weights stay bounded; an integer.
DEGREES_OF_FREEDOM = 5.0
#: Share of the part as wide as the prior: of the first proposal, and at least of those adapted to draws.
WIDE_SHARE = 0.3
LEAST_WIDE = 0.2
#: Share, beside the wide part, of one part over all that was found, and its covariance over that: tails that few draws
#: have met (a large scatter leaves shares open) are drawn from before their weights are large.
BROAD_SHARE = 0.3
BROAD = 4.0
#: Share of the first proposal beside the wide part that reaches around the mode, and its covariance over that there: a
#: second mode of the posterior (small scatter, large doubt) lies a few standard deviations off. Of a viscous law on
#: three resonances the ln of the evidence was .035 short without it and is .009 short with it (by 1.5 million draws).
FAR_SHARE = 0.4
FAR = 9.0
#: Shares a posterior is cut into, across its longest axis each time: enough to follow a funnel or two modes.
PARTS = 8
#: Draws that a proposal is fitted to.
MOST_FITTED = 1024
#: Share of the whole covariance added to each part's, so that few different draws still reach around themselves: this
#: over the effective draws, and no less than the second.
BLUR = 20.0
LEAST_BLUR = 0.1


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
        """A part with this mean and covariance, one that reaches farther, and the wide one."""
        shares = np.array([1.0 - FAR_SHARE, FAR_SHARE])
        return cls._with_wide(shares, np.array([mean, mean]), np.array([covariance, FAR * covariance]))

    @classmethod
    def through(cls, draws: FloatArray, worth: float) -> Proposal:
        """Parts fitted to posterior draws (n, d) worth so many independent ones, and the wide one."""
        draws = draws[:: max(1, len(draws) // MOST_FITTED)]
        parts = [draws]
        while len(parts) < PARTS:
            parts += _halve(parts.pop(0))
        whole = _covary(draws)
        least = max(BLUR / worth, LEAST_BLUR) * whole + np.diag(1e-6 * np.diag(whole) + 1e-16)
        # a part is cut off where the next begins: twice its covariance lets them overlap
        covariances = np.array([2.0 * _covary(p) + least for p in parts])
        shares = np.array([len(p) / len(draws) for p in parts])
        return cls._with_wide(shares, np.array([p.mean(axis=0) for p in parts]), covariances)._improve(draws, least)

    def _improve(self, draws: FloatArray, least: FloatArray) -> Proposal:
        """One step of expectation and maximisation on draws (n, d); ``least`` is added to each covariance."""
        of_part, growth = self._densities(draws)
        of_part /= of_part.sum(axis=1, keepdims=True)
        number = of_part.sum(axis=0)
        kept = np.flatnonzero(number[:-1] > draws.shape[1])
        weight = (of_part * ((1.0 + draws.shape[1] / DEGREES_OF_FREEDOM) / growth))[:, kept].T
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

    def transform(self, z: FloatArray, chi_square: FloatArray, part: IntArray) -> FloatArray:
        """Draws (n, d) from standard normals ``z`` (n, d), chi-squares (n,) and the part of each draw (n,)."""
        t = z / np.sqrt(chi_square / DEGREES_OF_FREEDOM)[:, None]
        return np.asarray(self.means[part] + np.einsum("nij,nj->ni", self.roots[part], t), dtype=np.float64)

    @cached_property
    def _whitening(self) -> FloatArray:
        """x @ this + ``_white_origin``: x as each part sees it, all parts side by side; (d, k d)."""
        inverse = np.linalg.inv(self.roots)
        return np.asarray(inverse.transpose(2, 0, 1).reshape(len(inverse[0]), -1), dtype=np.float64)

    @cached_property
    def _white_origin(self) -> FloatArray:
        return np.asarray(-np.einsum("kij,kj->ki", np.linalg.inv(self.roots), self.means).ravel())

    @cached_property
    def _heights(self) -> FloatArray:
        """Each part's share times its density at its centre."""
        d, nu = self.means.shape[1], DEGREES_OF_FREEDOM
        norm = gammaln((nu + d) / 2) - gammaln(nu / 2) - 0.5 * d * np.log(nu * np.pi)
        log_volume = np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(axis=1)
        return np.asarray(np.exp(norm - log_volume + np.log(self.shares)))

    def _densities(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Each part's share times its density at x (n, d), and 1 + its squared distance over nu, (n, k) each."""
        d = x.shape[1]
        white = (x @ self._whitening + self._white_origin).reshape(len(x), len(self.shares), d)
        growth = 1.0 + np.einsum("nki,nki->nk", white, white) / DEGREES_OF_FREEDOM
        return self._heights * _raise_root(1.0 / growth, int(DEGREES_OF_FREEDOM) + d), growth

    def density(self, x: FloatArray) -> FloatArray:
        """Density at x (n, d): above zero, the wide part has heavy tails."""
        return np.asarray(self._densities(x)[0].sum(axis=1))

    def log_density(self, x: FloatArray) -> FloatArray:
        """Its logarithm."""
        return np.asarray(np.log(self.density(x)))

    def draw(self, number: int, seed: int) -> FloatArray:
        """Draws (number, d) on points that fill space."""
        rng = np.random.default_rng(seed)
        u = fill_cube(self.means.shape[1] + 1, number, rng)
        chi_square = np.asarray(rng.chisquare(DEGREES_OF_FREEDOM, number))
        return self.transform(ndtri(u[:, 1:]), chi_square, self._part(u[:, 0]))

    def draw_random(self, number: int, rng: np.random.RandomState) -> FloatArray:
        """Independent draws (number, d)."""
        z = rng.standard_normal((number, self.means.shape[1]))
        chi_square = np.asarray(rng.chisquare(DEGREES_OF_FREEDOM, number))
        return self.transform(z, chi_square, self._part(np.asarray(rng.random_sample(number))))

    def _part(self, u: FloatArray) -> IntArray:
        """The part that a uniform variable falls into."""
        edges = np.cumsum(self.shares)[:-1]
        return np.searchsorted(edges, u).astype(np.int64)


def _raise_root(values: FloatArray, power: int) -> FloatArray:
    """sqrt(values)^power by products, a fifth of the work of a logarithm and an exponential."""
    result = np.sqrt(values) if power % 2 else np.ones_like(values)
    power //= 2
    while power:
        if power % 2:
            result = result * values
        values, power = values * values, power // 2
    return result


def _covary(draws: FloatArray) -> FloatArray:
    """Covariance (d, d) of draws (n, d)."""
    centred = draws - draws.mean(axis=0)
    return np.asarray(centred.T @ centred / max(len(draws) - 1, 1))


def _halve(draws: FloatArray) -> list[FloatArray]:
    """Two equal shares of draws (n, d), cut across their longest axis."""
    centred = draws - draws.mean(axis=0)
    axis = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    order = np.argsort(centred @ axis, kind="stable")
    return [draws[order[: len(order) // 2]], draws[order[len(order) // 2 :]]]


def fill_cube(dimension: int, number: int, rng: np.random.Generator) -> FloatArray:
    """Points strictly inside the unit cube, (number, dimension): one in each of so many equal slices of every axis.

    A Latin hypercube (McKay, Beckman and Conover 1979). Of the laws here it errs as little as Sobol points of
    scipy.stats, whose import takes half a second.
    """
    slices = rng.permuted(np.tile(np.arange(number)[:, None], (1, dimension)), axis=0)
    return np.clip((slices + rng.random((number, dimension))) / number, 1e-12, 1.0 - 1e-12)


#: Draws of each round: more where few have not sufficed.
ROUNDS = (2048, 1024, 1024, 2048, 4096, 8192)
#: Effective draws that a first look at a law needs (marginal likelihood to 6 %), and those of a full estimate (3 %).
BRIEF_DRAWS = 250
FULL_DRAWS = 1000
#: Effective draws that a proposal is fitted to, at least: where weights leave fewer, they are tempered until they do.
FITTED_TO = 20.0
#: Effective draws with which an estimate may end after ``ROUNDS``, and rounds at most until it has them: a narrow ridge
#: (a slip force that is all but used up) is found step by step.
LEAST_DRAWS = 200.0
MOST_ROUNDS = 16
#: Halvings of the interval in which a temper is sought: to 1e-6.
_HALVINGS = 20
#: Draws that still fit a small memory.
MOST_DRAWS = 2**22


@dataclass(frozen=True)
class Evidence:
    """A marginal likelihood and a weighted picture of the posterior.

    Attributes:
        log_z: natural logarithm of the marginal likelihood. standard_error: its Monte Carlo standard error.
        draws: resampled by weight, (draws, dimension).
        effective_draws: 1/sum of squared normalised weights.
    """

    log_z: float
    standard_error: float
    draws: FloatArray
    effective_draws: float

    @property
    def proposal(self) -> Proposal:
        """Fitted to the draws."""
        return Proposal.through(self.draws, self.effective_draws)


def importance(
    log_density: Callable[[FloatArray], FloatArray],
    mode: FloatArray,
    covariance: FloatArray,
    seed: int = 0,
    least_rounds: int = 2,
    wanted: float = FULL_DRAWS,
) -> Evidence:
    """Evidence and weighted draws of a density over standard normal variables.

    Rounds of draws are pooled, each weighed against the mixture of all proposals so far (Cornuet, Marin, Mira and
    Robert 2012, adaptive multiple importance sampling): none is lost, and none can have a large weight where any
    proposal was likely to draw it. While few draws carry the weight, the next proposal is fitted to weights tempered,
    w^beta, which lead from the proposals to the density step by step.

    Args:
        log_density: at points (n, d) -> (n,), ``-inf`` allowed. mode, covariance: where to begin, (d,) and (d, d).
        least_rounds: of adaptation, more where a part of the posterior lies far from the mode: few draws meet it at
            first and enough later. wanted: effective draws at which to stop, at the latest after ``ROUNDS`` where they
            are ``LEAST_DRAWS``.
    """
    proposals, proposal, sizes = [], Proposal.around(mode, covariance), np.empty(0)
    x, log_p = np.empty((0, len(mode))), np.empty(0)
    q = np.empty((0, 0))  # density of each draw under each proposal, (draws, proposals)
    rounds = max(least_rounds, len(ROUNDS))
    for round_ in range(max(rounds, MOST_ROUNDS)):
        proposals.append(proposal)
        new = proposal.draw(ROUNDS[min(round_, len(ROUNDS) - 1)], seed + round_)
        of_old = proposal.density(x)[:, None]
        q = np.vstack([np.hstack([q, of_old]), np.stack([own.density(new) for own in proposals], axis=1)])
        x, log_p, sizes = np.vstack([x, new]), np.append(log_p, log_density(new)), np.append(sizes, len(new))
        log_mixture = np.log(q @ (sizes / len(x)))
        weighed = _weigh(x, log_p - log_mixture, seed)
        enough = wanted if round_ < rounds - 1 else min(wanted, LEAST_DRAWS)
        if round_ >= least_rounds - 1 and weighed.effective_draws > enough:
            break
        proposal = (weighed if weighed.effective_draws >= FITTED_TO else _temper(x, log_p - log_mixture, seed)).proposal
    return weighed


def _temper(x: FloatArray, log_w: FloatArray, seed: int) -> Evidence:
    """Draws by their weights to the largest power that leaves ``FITTED_TO`` effective ones."""
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        power = 0.5 * (low + high)
        w = np.exp(power * (log_w - log_w.max()))
        low, high = (power, high) if w.sum() ** 2 >= FITTED_TO * np.sum(w**2) else (low, power)
    return _weigh(x, low * np.where(np.isfinite(log_w), log_w, -np.inf) if low > 0.0 else log_w, seed)


def _weigh(x: FloatArray, log_w: FloatArray, seed: int) -> Evidence:
    """Draws x (n, d) of log weights (n,), resampled."""
    w = np.exp(log_w - log_w.max())
    return Evidence(
        log_z=float(log_w.max() + np.log(np.mean(w))),
        standard_error=float(np.std(w) / np.mean(w) / np.sqrt(len(w))),
        draws=x[_resample(w, seed)],
        effective_draws=float(w.sum() ** 2 / np.sum(w**2)),
    )


def _resample(w: FloatArray, seed: int) -> IntArray:
    """Indices of draws in proportion to their weights, as many as there are, with equal spacing (systematic)."""
    edges = (np.arange(len(w)) + np.random.default_rng(seed).random()) / len(w)
    return np.minimum(np.searchsorted(np.cumsum(w) / w.sum(), edges), len(w) - 1).astype(np.int64)


def more_draws(
    log_density: Callable[[FloatArray], FloatArray], start: Evidence, wanted: float, seed: int = 0
) -> tuple[FloatArray, float]:
    """Posterior draws (n, dimension) that are worth ``wanted`` independent ones, and their worth.

    From the proposal of ``start``; resampling with equal spacing adds next to nothing to the error.

    Raises:
        AnalysisError: ``MOST_DRAWS`` are worth less.
    """
    proposal, number = start.proposal, int(1.1 * wanted * len(start.draws) / start.effective_draws)
    while number <= MOST_DRAWS:
        x = proposal.draw(number, seed)
        weighed = _weigh(x, log_density(x) - proposal.log_density(x), seed)
        if weighed.effective_draws >= wanted:
            return weighed.draws, weighed.effective_draws
        number = int(1.1 * wanted * number / weighed.effective_draws)
    raise AnalysisError(f"importance draws worth {wanted:g} would need more than {MOST_DRAWS}")
