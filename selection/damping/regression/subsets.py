"""Subsets of the terms as models with their statistics: the best of all 2^k - 1, or every one.

The best are found by leaps and bounds (``leaps``). The design is decomposed once: columns = Q R. A subset's columns
then are columns of the small R, which are decomposed for all subsets of a size together. Index bits say which terms are
in: subset 5 has terms 0 and 2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import stdtr

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.errors import AnalysisError
from damping.regression.design import Basis, Design, decompose
from damping.regression.fit import NAMES, Criteria, check_criterion, criteria, leave_one_out
from damping.regression.leaps import Proof, search
from damping.regression.shortlist import rounding_of

#: Of so many terms and no more every subset is fitted (2^22 models take some minutes).
MOST_TERMS = 22
_TOGETHER = 2e6  # numbers of the directions of models that are fitted together: some megabytes

_PER_MODEL = ("members", "coefficients", "unit_errors", "sse", "press")


@dataclass(frozen=True)
class Subsets:
    """Models m of one response, each a subset of the terms.

    ``members`` (m, k) which terms; ``coefficients`` (m, k), 0 for terms left out; ``unit_errors`` (m, k) standard
    errors of the coefficients for deviations of variance 1; ``sse`` and ``press`` (m,) sums of squared deviations and
    leave-one-out errors; ``observed`` (n,); ``names`` (k); ``proof`` that none is better than the first.
    """

    names: tuple[str, ...]
    observed: FloatArray
    members: BoolArray
    coefficients: FloatArray
    unit_errors: FloatArray
    sse: FloatArray
    press: FloatArray
    proof: Proof | None = None

    def __len__(self) -> int:
        return len(self.sse)

    @property
    def sizes(self) -> IntArray:
        """Numbers of terms (m,)."""
        return np.asarray(self.members.sum(axis=1))

    @cached_property
    def standard_errors(self) -> FloatArray:
        """Standard errors of the regressions, sqrt(SSE/(n - k)) (m,); NaN without degrees of freedom."""
        freedom = len(self.observed) - self.sizes
        return np.sqrt(self.sse / np.where(freedom > 0, freedom, np.nan))

    @cached_property
    def std_errors(self) -> FloatArray:
        """Standard errors of the coefficients (m, k)."""
        return self.unit_errors * self.standard_errors[:, None]

    @cached_property
    def t_ratios(self) -> FloatArray:
        """T-ratios (m, k), NaN for terms left out."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.coefficients / self.std_errors

    @cached_property
    def p_values(self) -> FloatArray:
        """Two-sided p-values of the T-ratios (m, k)."""
        freedom = np.maximum(len(self.observed) - self.sizes, 1)
        return np.asarray(2.0 * stdtr(freedom[:, None], -np.abs(self.t_ratios)))

    @cached_property
    def criteria(self) -> Criteria:
        """AIC, AICc, BIC, adjusted R^2, leave-one-out error (m,)."""
        return criteria(self.sse, self.press, self.sizes, self.observed)

    def scores(self, criterion: str) -> FloatArray:
        """The named criterion as scores (m,), lower is better; NaN where a model has none."""
        return np.asarray(self.criteria.score(criterion))

    @property
    def rms_errors(self) -> FloatArray:
        """sqrt(SSE/n) (m,)."""
        return np.sqrt(self.sse / len(self.observed))

    @property
    def r_squared(self) -> FloatArray:
        """1 - SSE/sum y^2, about zero (m,)."""
        return 1.0 - self.sse / (self.observed @ self.observed)

    def take(self, models: IntArray | BoolArray) -> Subsets:
        """Some of the models, in the order given."""
        chosen: dict[str, Any] = {name: getattr(self, name)[models] for name in _PER_MODEL}
        return replace(self, **chosen)

    def label(self, model: int) -> tuple[str, ...]:
        """Names of the terms of one model."""
        return tuple(name for name, member in zip(self.names, self.members[model], strict=True) if member)


def all_subsets(design: Design, basis: Basis | None = None) -> Subsets:
    """All 2^k - 1 subsets with their statistics, in the order of their index bits.

    Raises:
        AnalysisError: the design is numerically rank-deficient, or has more than ``MOST_TERMS`` terms.
    """
    basis = decompose(design) if basis is None else basis
    if design.k > MOST_TERMS:
        raise AnalysisError(f"2^{design.k} - 1 subsets are too many; give at most {MOST_TERMS} terms")
    members = (np.arange(1, 2**design.k)[:, None] >> np.arange(design.k)) & 1
    return _fit_subsets(members.astype(np.bool_), design, basis)


def best_subsets(
    design: Design,
    criterion: str = "bic",
    *,
    nonnegative: bool = False,
    number: int | None = 10,
    per_size: int | None = None,
    basis: Basis | None = None,
) -> Subsets:
    """The best subsets of all, best first, with the ``proof`` that none is better.

    Args:
        design: terms and response.
        criterion: a name of ``fit.NAMES``; models without a value of it are left out.
        nonnegative: only models with every coefficient > 0. Least squares under a_k >= 0 ends at such a model: the
            terms that it does not hold at 0, fitted freely.
        number: how many in all, at most (None: no limit).
        per_size: how many of each size, at most (None: no limit).
        basis: of the design, where it is at hand.

    Raises:
        InputError: an unknown criterion.
        AnalysisError: a rank-deficient design, a search that takes too long (the limit is named), or no model that
            qualifies.
    """
    check_criterion(criterion)
    basis = decompose(design) if basis is None else basis
    members, nodes = search(design, basis, criterion, nonnegative=nonnegative, number=number, per_size=per_size)
    subsets = rank_subsets(_fit_subsets(members, design, basis), criterion, nonnegative=nonnegative)
    if per_size is not None:
        earlier = np.tril(subsets.sizes[:, None] == subsets.sizes, -1).sum(axis=1)  # better ones of the same size
        subsets = subsets.take(earlier < per_size)
    bound = _lower_bound(subsets, criterion, rounding_of(basis, criterion))
    return replace(subsets.take(np.arange(len(subsets))[:number]), proof=Proof(2**design.k - 1, nodes, bound))


def rank_subsets(models: Subsets, criterion: str, *, nonnegative: bool = False) -> Subsets:
    """The models that have the criterion (and every coefficient > 0), best first; of equal ones the first first.

    Raises:
        AnalysisError: no model qualifies.
    """
    scores = models.scores(criterion)
    keep = np.isfinite(scores)
    if nonnegative:
        keep &= ((models.coefficients > 0.0) == models.members).all(axis=1)
    if not keep.any():
        sought = f"a {NAMES[criterion]}" + (" and every coefficient > 0" if nonnegative else "")
        raise AnalysisError(f"no subset of the terms has {sought}")
    chosen = np.flatnonzero(keep)
    return models.take(chosen[np.argsort(scores[chosen], kind="stable")])


def _lower_bound(models: Subsets, criterion: str, rounding: float) -> float:
    """The score of the first model, less what rounding may take off it."""
    off = rounding * np.linalg.norm(models.observed)
    sse, press = (float(np.maximum(np.sqrt(v[0]) - off, 0.0) ** 2) for v in (models.sse, models.press))
    return float(criteria(sse, press, int(models.sizes[0]), models.observed).score(criterion))


def _fit_subsets(members: BoolArray, design: Design, basis: Basis) -> Subsets:
    """The models (m, k), each decomposed by itself, in the order of their index bits."""
    members = members[np.lexsort(members.T)]
    sizes = members.sum(axis=1)
    coefficients, unit_errors = np.zeros(members.shape), np.zeros(members.shape)
    sse, press = np.empty(len(members)), np.empty(len(members))
    most = max(int(_TOGETHER / (design.n * design.k)), 1)
    for size in np.unique(sizes):
        same = np.flatnonzero(sizes == size)
        for rows in np.array_split(same, -(-len(same) // most)):
            terms = np.nonzero(members[rows])[1].reshape(len(rows), size)
            within, factor = np.linalg.qr(basis.factor[:, terms].transpose(1, 0, 2))
            directions, inverse = basis.orthonormal @ within, np.linalg.inv(factor)
            along = design.observed @ directions
            deviations = design.observed - np.einsum("mns,ms->mn", directions, along)
            coefficients[rows[:, None], terms] = np.einsum("mst,mt->ms", inverse, along) / basis.scale[terms]
            unit_errors[rows[:, None], terms] = np.linalg.norm(inverse, axis=2) / basis.scale[terms]
            sse[rows] = np.einsum("mn,mn->m", deviations, deviations)
            press[rows] = leave_one_out(deviations, np.einsum("mns,mns->mn", directions, directions))
    return Subsets(design.names, design.observed, members, coefficients, unit_errors, sse, press)
