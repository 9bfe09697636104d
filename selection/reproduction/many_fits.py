"""Least squares of every subset of a few terms on many responses at once, for simulations of selection.

The terms may be the same for all responses (columns of shape (n, k)) or their own (r, n, k). What
`selection.regression.subsets` does for one response is done here for thousands, with no more than selection needs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

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

    Args:
        columns: (n, k), or (r, n, k) where each response has its own. observed: responses (r, n), n > k.
    """
    n, k = columns.shape[-2:]
    subsets = [list(subset) for size in range(1, k + 1) for subset in combinations(range(k), size)]
    scale = np.linalg.norm(columns, axis=-2)
    unit = columns / scale[..., None, :]
    shape = (len(subsets), len(observed), k)
    coefficients, t_ratios, sse = np.zeros(shape), np.zeros(shape), np.empty(shape[:2])
    for m, subset in enumerate(subsets):
        Q, R = np.linalg.qr(unit[..., subset])
        inverse = np.linalg.inv(R)
        z = np.einsum("...ns,rn->rs", Q, observed) if columns.ndim == 2 else np.einsum("rns,rn->rs", Q, observed)
        fitted = z @ Q.T if columns.ndim == 2 else np.einsum("rns,rs->rn", Q, z)
        sse[m] = np.sum((observed - fitted) ** 2, axis=1)
        found = z @ inverse.T if columns.ndim == 2 else np.einsum("rst,rt->rs", inverse, z)
        error = np.linalg.norm(inverse, axis=-1) * np.sqrt(sse[m] / (n - len(subset)))[:, None]
        coefficients[m][:, subset] = found / scale[..., subset]
        t_ratios[m][:, subset] = found / error
    members = np.array([[i in subset for i in range(k)] for subset in subsets])
    return ManyFits(members, coefficients, t_ratios, sse, n)


def fits_in_blocks(columns: FloatArray, observed: FloatArray) -> Iterator[ManyFits]:
    """The same for ``BLOCK`` responses at a time."""
    for start in range(0, len(observed), BLOCK):
        rows = slice(start, start + BLOCK)
        yield subset_fits(columns if columns.ndim == 2 else columns[rows], observed[rows])
