"""Least squares of every subset of a few terms on many responses at once, for simulations of selection.

The terms may be the same for all responses (columns of shape (n, k)) or their own (r, n, k). What
`selection.regression.subsets` does for one response is done here for thousands, with no more than selection needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from selection.arrays import BoolArray, FloatArray, IntArray

#: Responses treated at once, for the sake of memory.
BLOCK = 500


@dataclass(frozen=True)
class ManyFits:
    """Models m of responses r on k terms: ``members`` (m, k), ``coefficients`` and ``t_ratios`` (m, r, k), 0 for terms
    left out, ``sse`` (m, r), and the number ``n`` of observations of each response."""

    members: BoolArray
    coefficients: FloatArray
    t_ratios: FloatArray
    sse: FloatArray
    n: int

    @property
    def bic(self) -> FloatArray:
        """BIC (m, r) less what all models of a response share: n ln SSE + k ln n."""
        return self.n * np.log(self.sse) + np.log(self.n) * self.members.sum(axis=1)[:, None]

    def best(self, nonnegative: bool = False) -> IntArray:
        """Model of least BIC for each response (r,), of those with every coefficient > 0 if ``nonnegative``; -1 where
        there is none."""
        score = self.bic
        if nonnegative:
            physical = ((self.coefficients > 0.0) == self.members[:, None, :]).all(axis=2)
            score = np.where(physical, score, np.inf)
        return np.where(np.isfinite(score).any(axis=0), score.argmin(axis=0), -1)

    def backward(self, t_stop: float = 2.0) -> IntArray:
        """Model that backward elimination ends with for each response (r,): the term of least |T| is dropped while
        that is below ``t_stop``, down to one term."""
        k = self.members.shape[1]
        weights = 2 ** np.arange(k)
        place = np.full(2**k, -1)
        place[self.members @ weights] = np.arange(len(self.members))
        responses = np.arange(self.sse.shape[1])
        code = np.full(responses.size, 2**k - 1)
        for _ in range(k - 1):
            model = place[code]
            size = np.abs(self.t_ratios[model, responses])
            size[~self.members[model]] = np.inf
            least = size.argmin(axis=1)
            drop = (size[responses, least] < t_stop) & (self.members[model].sum(axis=1) > 1)
            code = code - drop * weights[least]
        return place[code]


def subset_fits(columns: FloatArray, observed: FloatArray) -> ManyFits:
    """Fit every subset of the terms to every response.

    The columns are decomposed once, columns = Q R; a subset that gains a term gains the direction of that term's column
    of R across its directions so far (Gram-Schmidt, twice).

    Args:
        columns: (n, k), or (r, n, k) where each response has its own. observed: responses (r, n), n > k.
    """
    n, k = columns.shape[-2:]
    X = columns.reshape(-1, n, k)
    scale = np.linalg.norm(X, axis=1)
    Q, R = np.linalg.qr(X / scale[:, None, :])
    z = np.matmul(observed[:, None, :], Q)[:, 0]
    beyond = np.sum((observed - np.matmul(Q, z[:, :, None])[:, :, 0]) ** 2, axis=1)
    empty = _Subset((), np.zeros((len(X), 0, k)), np.zeros((len(X), 0, 0)), np.zeros((len(z), 0)), z)
    subsets = [empty]
    for j in range(k):
        subsets += [_added(subset, j, R[:, :, j]) for subset in subsets]
    shape = (len(subsets) - 1, len(observed), k)
    coefficients, t_ratios, sse = np.zeros(shape), np.zeros(shape), np.empty(shape[:2])
    for m, subset in enumerate(subsets[1:]):
        sse[m] = beyond + np.sum(subset.left**2, axis=1)
        error = np.linalg.norm(subset.inverse, axis=-1) * np.sqrt(sse[m] / (n - len(subset.terms)))[:, None]
        coefficients[m][:, subset.terms] = subset.coefficients / scale[:, subset.terms]
        t_ratios[m][:, subset.terms] = subset.coefficients / error
    members = np.array([[i in subset.terms for i in range(k)] for subset in subsets[1:]])
    return ManyFits(members, coefficients, t_ratios, sse, n)


@dataclass(frozen=True)
class _Subset:
    """A subset while subsets grow: orthonormal ``directions`` (d, s, k), ``inverse`` (d, s, s) of their triangular
    factor, ``coefficients`` (r, s) on scaled columns, and what is ``left`` (r, k) of the responses; d is r or 1."""

    terms: tuple[int, ...]
    directions: FloatArray
    inverse: FloatArray
    coefficients: FloatArray
    left: FloatArray


def _added(subset: _Subset, j: int, column: FloatArray) -> _Subset:
    """The subset with term j, whose column (d, k) is given."""
    U, s = subset.directions, len(subset.terms)
    along = np.einsum("dsk,dk->ds", U, column)
    across = column - np.einsum("dsk,ds->dk", U, along)
    again = np.einsum("dsk,dk->ds", U, across)
    across = across - np.einsum("dsk,ds->dk", U, again)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    direction = across / length
    last = np.ones((len(column), s + 1))
    last[:, :s] = -np.einsum("dst,dt->ds", subset.inverse, along + again)
    last /= length
    inverse = np.zeros((len(column), s + 1, s + 1))
    inverse[:, :s, :s], inverse[:, :, s] = subset.inverse, last
    amount = np.sum(direction * subset.left, axis=1, keepdims=True)
    coefficients = last * amount
    coefficients[:, :s] += subset.coefficients
    directions = np.concatenate([U, direction[:, None, :]], axis=1)
    return _Subset((*subset.terms, j), directions, inverse, coefficients, subset.left - amount * direction)


def fits_in_blocks(columns: FloatArray, observed: FloatArray) -> Iterator[ManyFits]:
    """The same for ``BLOCK`` responses at a time."""
    for start in range(0, len(observed), BLOCK):
        rows = slice(start, start + BLOCK)
        yield subset_fits(columns if columns.ndim == 2 else columns[rows], observed[rows])
