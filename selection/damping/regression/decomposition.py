"""Orthogonal decomposition of a design: scaled, decomposed twice, with its condition number; empty designs are refused.

Columns of an energy polynomial are nearly dependent (the nine terms of Eq. 5.3.6 have a scaled condition number of
1e7). One decomposition in doubles loses as many digits as the condition number has. So the inverse of its triangular
factor is applied to the columns as they are, in twice the working precision; what comes out is orthonormal but for
rounding, and decomposing that once more loses nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.regression.design import Design
from damping.regression.terms import times_matrix

#: Exactly dependent columns have a smallest singular value of up to 3 roundings (measured, 5 to 100 000 rows).
LARGEST_CONDITION = 1.0 / (16.0 * float(np.finfo(np.float64).eps))
_TAKES_PART = 1e-6  # share of a column, scaled to unit norm, in the combination that vanishes


@dataclass(frozen=True)
class Basis:
    """columns / scale = orthonormal @ factor.

    ``scale`` (k,) are powers of two, so scaling rounds nothing; ``orthonormal`` (n, k); ``factor`` (k, k) upper
    triangular and ``inverse`` its inverse; ``condition_number`` is that of the columns scaled to unit norm.
    """

    scale: FloatArray
    orthonormal: FloatArray
    factor: FloatArray
    inverse: FloatArray
    condition_number: float


def decompose(design: Design) -> Basis:
    """The orthonormal basis of a design.

    Raises:
        AnalysisError: a column of zeros, fewer observations than terms, or a scaled condition number above
            ``LARGEST_CONDITION`` (nothing is left of the design but rounding); the columns are named.
    """
    scale = power_of_two(np.abs(design.columns).max(axis=0))
    _check_shape(design)
    head, tail = design.columns / scale, design.tails / scale
    first = np.asarray(np.linalg.qr(head, mode="r"))
    condition_number = _checked_condition(first, design)
    inverse = np.linalg.inv(first)
    orthonormal, second = np.linalg.qr(times_matrix((head, tail), inverse))
    inverse = inverse @ np.linalg.inv(second)
    return Basis(scale, orthonormal, second @ first, inverse, condition_number)


def power_of_two(size: FloatArray) -> FloatArray:
    """The power of two next above each size; 1 for a size of 0."""
    return np.asarray(np.ldexp(1.0, np.where(size > 0.0, np.clip(np.frexp(size)[1], -1000, 1000), 0)))


def _check_shape(design: Design) -> None:
    zero = [name for name, column in zip(design.names, design.columns.T, strict=True) if not column.any()]
    if zero:
        raise AnalysisError(f"rank-deficient: {', '.join(zero)} is zero at every observation")
    if design.n < design.k:
        names = ", ".join(design.names)
        raise AnalysisError(f"rank-deficient: fewer observations ({design.n}) than terms ({design.k}): {names}")


def _checked_condition(factor: FloatArray, design: Design) -> float:
    _, singular, rows = np.linalg.svd(factor / np.linalg.norm(factor, axis=0))
    condition = float(singular[0] / max(singular[-1], np.finfo(np.float64).tiny))
    if condition <= LARGEST_CONDITION:
        return condition
    vanishing = rows[singular * LARGEST_CONDITION < singular[0]]
    share = np.linalg.norm(vanishing, axis=0)
    names = ", ".join(name for name, part in zip(design.names, share, strict=True) if part > _TAKES_PART)
    raise AnalysisError(f"rank-deficient: the columns {names} are dependent to within rounding; leave one out")
