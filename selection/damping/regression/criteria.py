"""Selection criteria, and the problem and shortlist of a search for the best subsets.

With e the deviations, SSE = sum e^2, n observations and k coefficients, and K = k + 1 parameters (the coefficients and
the variance of the deviations), for independent normal deviations of one variance

    -2 ln L = n ln(SSE/n) + n ln(2 pi) + n
    AIC  = -2 ln L + 2 K                              (Akaike 1974)
    AICc = AIC + 2 K (K + 1)/(n - K - 1)              (Hurvich and Tsai 1989); none unless n > K + 1
    BIC  = -2 ln L + K ln n                           (Schwarz 1978)
    adjusted R^2 = 1 - (SSE/(n - k)) / (sum y^2/n)    about zero, so models with and without a constant compare
    leave-one-out error = sqrt(mean (e/(1 - h))^2)    h the leverages (Allen 1974)

Programs that leave the variance out of K give an AIC smaller by 2 and a BIC smaller by ln n. A criterion that does not
exist is NaN. SSE below the rounding of the response counts as that rounding: exact fits differ in k alone.

A criterion depends only on the size of a model and on its sum of squares, of deviations or of leave-one-out errors. A
score to beat is therefore a limit on the sum of squares for each size.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from damping.arrays import BoolArray, FloatArray, Floats, IntArray
from damping.errors import check_choice
from damping.regression.design import Basis, Design

#: Share of the response below which deviations say nothing; times the condition number, what the root of a sum of
#: squares may be wrong by.
_ROUNDING = 16.0 * float(np.finfo(np.float64).eps)
#: Names on the command line, with the name in print.
NAMES = {"bic": "BIC", "aic": "AIC", "aicc": "AICc", "adjusted-r2": "adjusted R^2", "loo": "leave-one-out error"}


@dataclass(frozen=True)
class Criteria:
    """All criteria of a model (or of models: arrays that broadcast)."""

    aic: Floats
    aicc: Floats
    bic: Floats
    adjusted_r_squared: Floats
    leave_one_out_error: Floats

    def score(self, criterion: str) -> Floats:
        """The named criterion, as a score: lower is better (adjusted R^2 with its sign changed)."""
        check_criterion(criterion)
        scores = {"bic": self.bic, "aic": self.aic, "aicc": self.aicc, "loo": self.leave_one_out_error}
        return -self.adjusted_r_squared if criterion == "adjusted-r2" else scores[criterion]


def criteria(sse: Floats, press: Floats, k: int | IntArray, observed: FloatArray) -> Criteria:
    """The criteria of models of ``k`` coefficients fitted to one response ``observed`` (n,).

    ``sse``: sums of squared deviations. ``press``: of squared leave-one-out errors (``leave_one_out`` gives them).
    """
    n = len(observed)
    K: npt.NDArray[np.float64] = np.asarray(k, dtype=np.float64) + 1.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        total = observed @ observed
        rounding = total * _ROUNDING**2
        deviance = n * np.log(np.maximum(sse, rounding) / n) + n * (np.log(2.0 * np.pi) + 1.0)
        aic, bic = deviance + 2.0 * K, deviance + K * np.log(n)
        aicc = aic + 2.0 * K * (K + 1.0) / np.where(n > K + 1.0, n - K - 1.0, np.nan)
        freedom = np.where(n > K - 1.0, n - K + 1.0, np.nan)
        adjusted = 1.0 - np.maximum(sse, rounding) / freedom * np.divide(n, total)
    exists = np.isfinite(freedom)
    loo = np.sqrt(np.maximum(press, rounding) / n)
    return Criteria(*(np.where(exists, value, np.nan)[()] for value in (aic, aicc, bic, adjusted, loo)))


def leave_one_out(deviations: FloatArray, leverages: FloatArray) -> Floats:
    """Sum of squared leave-one-out errors (e/(1 - h))^2 over the last axis; NaN where an h is 1 (an observation alone
    determines a coefficient and cannot be left out)."""
    left = np.subtract(1.0, leverages)
    alone = np.min(left, axis=-1, initial=1.0) <= 1e-10
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.divide(deviations, left, out=left)
        return np.where(alone, np.nan, np.einsum("...n,...n->...", errors, errors))[()]


def check_criterion(criterion: str) -> None:
    """Raise InputError for a name that is not one of ``NAMES``."""
    check_choice(criterion, NAMES, f"no criterion {criterion!r}")


#: Leverages count up to here in the bound of the leave-one-out error, so that rounding is magnified 100 times at most.
LARGEST_LEVERAGE = 0.99


@dataclass(frozen=True)
class SubsetProblem:
    """The problem of a subset search, for a response of length 1."""

    criterion: str
    nonnegative: bool
    observed: FloatArray
    factor: FloatArray  #: R, (k, k)
    duals: FloatArray  #: R^-1, (k, k)
    orthonormal: FloatArray  #: (n, k)
    along: FloatArray  #: the response along the basis, (k,)
    beyond: FloatArray  #: the response across it, (n,)
    rounding: float  #: of the root of a sum of squares

    @property
    def k(self) -> int:
        """Number of terms."""
        return len(self.along)

    @property
    def leaves_out(self) -> bool:
        """Whether the criterion is the leave-one-out error."""
        return self.criterion == "loo"

    @property
    def cost(self) -> int:
        """Approximate number of multiplications for a node."""
        return self.k**2 + (len(self.observed) * self.k if self.leaves_out else 0)

    def sse(self, rest: FloatArray) -> FloatArray:
        """Sums of squared deviations (m,) of fits with residuals ``rest`` (m, k) along the basis."""
        return np.asarray(np.einsum("mk,mk->m", rest, rest) + self.beyond @ self.beyond)

    def deviations(self, rest: FloatArray) -> FloatArray:
        """Deviations (m, n) of these fits."""
        return np.asarray(self.beyond + rest @ self.orthonormal.T)

    def scores(self, values: FloatArray, sizes: IntArray) -> FloatArray:
        """Scores of models from their sums of squares: of deviations, or of leave-one-out errors."""
        return np.asarray(criteria(values, values, sizes, self.observed).score(self.criterion))

    def values(self, score: float, sizes: IntArray) -> FloatArray:
        """The sums of squares at which models of these sizes have the score: the inverse of ``scores``, rounded up."""
        score += _ROUNDING * abs(score)
        at_one = self.scores(np.ones(len(sizes)), sizes)
        if self.leaves_out:
            return np.where(np.isfinite(at_one), (score / at_one) ** 2, -np.inf)
        if self.criterion == "adjusted-r2":
            return np.nan_to_num((score + 1.0) / (at_one + 1.0), nan=-np.inf)
        return np.nan_to_num(np.exp((score - at_one) / len(self.observed)), nan=-np.inf)


@dataclass
class Shortlist:
    """The best of the subsets that were tried."""

    problem: SubsetProblem
    number: int
    ceiling: FloatArray
    members: BoolArray = field(init=False)  #: (m, k)
    values: FloatArray = field(init=False)  #: their sums of squares, (m,)
    #: largest sum of squares with which a subset of each size can still enter, (k + 1,)
    limits: FloatArray = field(init=False)
    reach: FloatArray = field(init=False)  #: that of any subset of that size or larger, (k + 1,)

    def __post_init__(self) -> None:
        self.members, self.values = np.zeros((0, self.problem.k), dtype=np.bool_), np.zeros(0)
        self._limit()

    def enter(self, members: BoolArray, values: FloatArray) -> None:
        """Add subsets that are not listed yet, and drop those that no longer qualify."""
        sizes = members.sum(axis=1)
        good = (sizes > 0) & (values <= self.limits[sizes])
        good[good] = np.isfinite(self.problem.scores(values[good], sizes[good]))
        if not good.any():
            return
        self.members = np.concatenate([self.members, members[good]])
        self.values = np.concatenate([self.values, values[good]])
        self._limit()
        kept = self.values <= self.limits[self.members.sum(axis=1)]
        self.members, self.values = self.members[kept], self.values[kept]

    def _limit(self) -> None:
        k = self.problem.k
        all_sizes, sizes = np.arange(k + 1), self.members.sum(axis=1)
        scores = self.problem.scores(self.values, sizes)
        order = np.argsort(scores, kind="stable")
        limits = np.where(np.isfinite(self.problem.scores(np.ones(k + 1), all_sizes)), np.inf, -np.inf)
        if len(order) >= self.number:
            limits = np.minimum(limits, self.problem.values(float(scores[order[self.number - 1]]), all_sizes))
        possible = limits > -np.inf
        limits[possible] = (np.sqrt(np.maximum(limits[possible], 0.0)) + self.problem.rounding) ** 2
        self.limits = np.minimum(limits, self.ceiling)
        self.reach = np.maximum.accumulate(self.limits[::-1])[::-1]


def rounding_of(basis: Basis, criterion: str) -> float:
    """Rounding error of the root of a sum of squares, over the length of the response."""
    return _ROUNDING * basis.condition_number / (1.0 - LARGEST_LEVERAGE if criterion == "loo" else 1.0)


def state_problem(design: Design, basis: Basis, criterion: str, nonnegative: bool) -> SubsetProblem:
    """The problem of a design: response and columns scaled to length 1."""
    observed = design.observed / (np.linalg.norm(design.observed) or 1.0)
    along = observed @ basis.orthonormal
    length = np.linalg.norm(basis.factor, axis=0)
    return SubsetProblem(
        criterion=criterion,
        nonnegative=nonnegative,
        observed=observed,
        factor=basis.factor / length,
        duals=basis.inverse * length[:, None],
        orthonormal=basis.orthonormal,
        along=along,
        beyond=observed - basis.orthonormal @ along,
        rounding=rounding_of(basis, criterion),
    )
