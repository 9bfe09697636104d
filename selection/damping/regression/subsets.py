"""Subsets of the terms as models with their statistics: the best of all 2^k - 1, or every one.

The search for the best is by leaps and bounds (``leaps``). If every subset is requested, all are fitted at once. The
design is decomposed once: columns = Q R. The columns of a subset are then columns of the small R, and subset S + {j} is
subset S with one more direction: the part of column j of R across the directions of S (Gram-Schmidt, twice). For terms
j = 0, 1, ... the first 2^j subsets give the next 2^j in a few array operations, with coefficients, standard errors,
deviations and leverages. Index bits say which terms are in: subset 5 has terms 0 and 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.errors import AnalysisError
from damping.regression.criteria import NAMES, Criteria, check_criterion, criteria, leave_one_out, rounding_of
from damping.regression.design import Basis, Design, decompose
from damping.regression.leaps import Proof, search

#: Most terms of which every subset is fitted (2^22 models take a minute).
MOST_TERMS = 22
_BLOCK = 9  # a block of 2^9 subsets fits a processor's cache
_BLOCK_SIZE = 2e6  # leverages of a block, at most

_PER_MODEL = ("members", "coefficients", "unit_errors", "sse", "press")


@dataclass(frozen=True)
class Subsets:
    """Models m of one response, each a subset of the terms."""

    names: tuple[str, ...]  #: of the terms (k)
    observed: FloatArray  #: (n,)
    members: BoolArray  #: which terms (m, k)
    coefficients: FloatArray  #: 0 for terms left out (m, k)
    unit_errors: FloatArray  #: standard errors of the coefficients for deviations of variance 1 (m, k)
    sse: FloatArray  #: sums of squared deviations (m,)
    press: FloatArray  #: sums of squared leave-one-out errors (m,)
    proof: Proof | None = None  #: that none is better than the first

    def __len__(self) -> int:
        return len(self.sse)

    @property
    def sizes(self) -> IntArray:
        """Numbers of terms (m,)."""
        return np.asarray(self.members.sum(axis=1))

    @cached_property
    def std_errors(self) -> FloatArray:
        """Standard errors of the coefficients (m, k); NaN without degrees of freedom."""
        freedom = len(self.observed) - self.sizes
        return self.unit_errors * np.sqrt(self.sse / np.where(freedom > 0, freedom, np.nan))[:, None]

    @cached_property
    def t_ratios(self) -> FloatArray:
        """T-ratios (m, k), NaN for terms left out."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.coefficients / self.std_errors

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

    def take(self, models: IntArray | BoolArray) -> Subsets:
        """Some of the models, in the order given."""
        chosen: dict[str, Any] = {name: getattr(self, name)[models] for name in _PER_MODEL}
        return replace(self, **chosen)

    def label(self, model: int) -> tuple[str, ...]:
        """Names of the terms of one model."""
        return tuple(name for name, member in zip(self.names, self.members[model], strict=True) if member)


def all_subsets(design: Design) -> Subsets:
    """All 2^k - 1 subsets with their statistics, some hundreds at a time.

    AnalysisError: the design is numerically rank-deficient, or has more than ``MOST_TERMS`` terms.
    """
    basis = decompose(design)
    if design.k > MOST_TERMS:
        raise AnalysisError(f"2^{design.k} - 1 subsets are too many; give at most {MOST_TERMS} terms")
    doublings = max(min(_BLOCK, int(np.log2(_BLOCK_SIZE / design.n))), 1)
    k = design.k
    square, row, rest = np.zeros((1, k, k)), np.zeros((1, k)), (design.observed @ basis.orthonormal)[None]
    empty_set = square, square, row, row, rest, np.zeros((1, design.n)), row
    blocks = enumerate(_blocks(empty_set, basis, range(k), doublings))
    parts = [_finished(block, design, basis, drop=int(i == 0)) for i, block in blocks]
    whole: dict[str, Any] = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _PER_MODEL}
    return replace(parts[0], **whole)


def best_subsets(design: Design, criterion: str = "bic", *, nonnegative: bool = False, number: int = 10) -> Subsets:
    """The best subsets of all, best first, with the ``proof`` that none is better.

    At most ``number`` of them, without models that have no value of the criterion (a name of ``criteria.NAMES``).
    ``nonnegative``: only those with every coefficient > 0. Least squares under a_k >= 0 ends at such a model: the terms
    that it does not hold at 0, fitted freely. InputError: an unknown criterion. AnalysisError: a rank-deficient design,
    a search that takes too long (the limit is named), or no model that qualifies.
    """
    check_criterion(criterion)
    basis = decompose(design)
    members, nodes = search(design, basis, criterion, nonnegative=nonnegative, number=number)
    subsets = rank_subsets(_fitted(members, design, basis), criterion, nonnegative=nonnegative)
    # the score of the first, less what rounding may take off it
    off = rounding_of(basis, criterion) * np.linalg.norm(design.observed)
    sse, press = (float(np.maximum(np.sqrt(v[0]) - off, 0.0) ** 2) for v in (subsets.sse, subsets.press))
    bound = float(criteria(sse, press, int(subsets.sizes[0]), design.observed).score(criterion))
    return replace(subsets.take(np.arange(len(subsets))[:number]), proof=Proof(2**design.k - 1, nodes, bound))


def rank_subsets(models: Subsets, criterion: str, *, nonnegative: bool) -> Subsets:
    """The models that have the criterion (and every coefficient > 0), best first; equal ones keep their order.

    AnalysisError: no model qualifies.
    """
    scores = models.scores(criterion)
    keep = np.isfinite(scores)
    if nonnegative:
        keep &= ((models.coefficients > 0.0) == models.members).all(axis=1)
    if not keep.any():
        sought = f"a value of {NAMES[criterion]}" + (" and every coefficient > 0" if nonnegative else "")
        raise AnalysisError(f"no subset of the terms has {sought}")
    chosen = np.flatnonzero(keep)
    return models.take(chosen[np.argsort(scores[chosen], kind="stable")])


def _fitted(subsets: BoolArray, design: Design, basis: Basis) -> Subsets:
    """The models (m, k), each decomposed by itself, in the order of ``all_subsets``' index bits."""
    subsets = subsets[np.lexsort(subsets.T)]
    m = len(subsets)
    coefficients, unit_errors = np.zeros((m, design.k)), np.zeros((m, design.k))
    sse, press = np.empty(m), np.empty(m)
    for i, members in enumerate(subsets):
        within, factor = np.linalg.qr(basis.factor[:, members])
        directions, inverse = basis.orthonormal @ within, np.linalg.inv(factor)
        along = design.observed @ directions
        deviations = design.observed - directions @ along
        coefficients[i, members] = inverse @ along / basis.scale[members]
        unit_errors[i, members] = np.linalg.norm(inverse, axis=1) / basis.scale[members]
        sse[i] = deviations @ deviations
        press[i] = leave_one_out(deviations, np.einsum("nk,nk->n", directions, directions))
    return Subsets(design.names, design.observed, subsets, coefficients, unit_errors, sse, press)


#: Subsets m while they grow: ``directions`` (m, slot, k) orthonormal, in the coordinates of the basis, a slot a term
#: and zero for terms left out; ``inverse`` (m, k, slot) of their triangular factors; ``coefficients`` and unit
#: ``variances`` (m, k) on scaled columns; ``rest`` (m, k) of the response across the directions, in the coordinates of
#: the basis; ``leverages`` (m, n); ``members`` (m, k), 1 or 0.
_State: TypeAlias = tuple[FloatArray, ...]


def _blocks(root: _State, basis: Basis, terms: range, doublings: int) -> Iterator[_State]:
    """The subsets that add some of ``terms`` to the one of ``root``, at most 2^doublings at a time."""
    if len(terms) <= doublings:
        yield _grown(root, basis, terms)
        return
    without_and_with = _grown(root, basis, terms[:1])
    for i in (0, 1):
        yield from _blocks(tuple(part[i : i + 1] for part in without_and_with), basis, terms[1:], doublings)


def _grown(root: _State, basis: Basis, terms: range) -> _State:
    """The 2^len(terms) subsets that add some of ``terms`` to the one of ``root``."""
    grown = tuple(np.zeros((2 ** len(terms), *part.shape[1:])) for part in root)
    for whole, part in zip(grown, root, strict=True):
        whole[:1] = part
    for doubling, j in enumerate(terms):
        _add(grown, 2**doubling, j, basis)
    return grown


def _add(state: _State, m: int, j: int, basis: Basis) -> None:
    """Fill subsets m..2m-1: the first m with term j added (whose own terms all come before j)."""
    directions, inverse, coefficients, variances, rest, leverages, members = state
    old, new, upto = slice(0, m), slice(m, 2 * m), slice(0, j + 1)
    along, across = _project(directions[old, :j, :j], basis.factor[:j, j])
    length = np.sqrt(np.einsum("mk,mk->m", across, across) + basis.factor[j, j] ** 2)[:, None]
    direction = np.empty((m, j + 1))
    direction[:, :j], direction[:, j] = across, basis.factor[j, j]
    direction /= length
    last = np.ones((m, j + 1))  # of the inverse, its new column
    last[:, :j] = np.matmul(inverse[old, :j, :j], along[:, :, None])[:, :, 0]
    last[:, :j] *= -1.0
    last /= length
    amount = np.einsum("mk,mk->m", direction, rest[old, upto])[:, None]
    for part in (directions, inverse, coefficients, variances, rest, members):
        part[new] = part[old]
    directions[new, j, upto] = direction
    inverse[new, upto, j] = last
    coefficients[new, upto] += last * amount
    variances[new, upto] += last**2
    rest[new, upto] -= direction * amount
    added = direction @ basis.orthonormal[:, upto].T
    np.add(leverages[old], np.square(added, out=added), out=leverages[new])
    members[new, j] = 1.0


def _project(directions: FloatArray, column: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A column (k,) along orthonormal directions (m, slot, k), and the rest of it across them (m, k).

    Twice, since the remainder of a nearly dependent column still has rounding errors along the directions.
    """
    along = directions @ column
    across = column - np.matmul(along[:, None, :], directions)[:, 0]
    again = np.matmul(directions, across[:, :, None])[:, :, 0]
    return along + again, across - np.matmul(again[:, None, :], directions)[:, 0]


def _finished(state: _State, design: Design, basis: Basis, drop: int) -> Subsets:
    """The models of a state without the first ``drop`` (the empty set), coefficients on columns as they are."""
    _, _, coefficients, variances, rest, leverages, members = (part[drop:] for part in state)
    beyond = design.observed - basis.orthonormal @ (design.observed @ basis.orthonormal)  # no subset reaches it
    return Subsets(
        names=design.names,
        observed=design.observed,
        members=members > 0.0,
        coefficients=coefficients / basis.scale,
        unit_errors=np.sqrt(variances) / basis.scale,
        sse=np.einsum("mk,mk->m", rest, rest) + beyond @ beyond,
        press=np.asarray(leave_one_out(beyond + rest @ basis.orthonormal.T, leverages)),
    )
