"""Twice the working precision, from error-free sums and products of doubles (Dekker 1971; Ogita, Rump, Oishi 2005).

A number is a pair (head, tail), its value head + tail, |tail| at most half a unit in the last place of head. Powers of
a column and the products that would cancel in an ill-conditioned fit are formed so; everything else is plain doubles.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from selection.arrays import FloatArray

#: Head and tail of the same shape.
Pair: TypeAlias = tuple[FloatArray, FloatArray]

_SPLITTER = 134217729.0  # 2**27 + 1 cuts a double's 53 bits into two halves whose products are exact


def exact_sum(a: FloatArray, b: FloatArray) -> Pair:
    """a + b without error (any shapes that broadcast): the rounded sum and what rounding lost."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def exact_product(a: FloatArray, b: FloatArray) -> Pair:
    """a b without error (any shapes that broadcast, |a| and |b| below 1e292): the rounded product and its loss."""
    product = a * b
    a_high, a_low = _halves(a)
    b_high, b_low = _halves(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _halves(a: FloatArray) -> Pair:
    shifted = _SPLITTER * a
    high = shifted - (shifted - a)
    return high, a - high


def multiply(x: Pair, y: Pair) -> Pair:
    """Product of two pairs, to about 2**-104 of its size."""
    product, loss = exact_product(x[0], y[0])
    return exact_sum(product, loss + x[0] * y[1] + x[1] * y[0])


def whole_power(x: Pair, exponent: int) -> Pair:
    """x to a whole power >= 1, by squaring."""
    result, square = None, x
    while exponent:
        if exponent & 1:
            result = square if result is None else multiply(result, square)
        exponent >>= 1
        if exponent:
            square = multiply(square, square)
    assert result is not None
    return result


def times_matrix(columns: Pair, matrix: FloatArray) -> FloatArray:
    """(head + tail) @ matrix, products and sums in twice the working precision, the result rounded once.

    Args:
        columns: head and tail, (n, k).
        matrix: (k, m).
    """
    head, tail = columns
    total = np.zeros((len(head), matrix.shape[1]))
    loss = tail @ matrix
    for i, row in enumerate(matrix):
        product, product_loss = exact_product(head[:, i, None], row)
        total, sum_loss = exact_sum(total, product)
        loss += product_loss + sum_loss
    return np.asarray(total + loss)


def deviations(columns: Pair, coefficients: FloatArray, observed: FloatArray) -> FloatArray:
    """observed - (head + tail) @ coefficients (n,), rounded once: right to the last digit although the parts cancel."""
    head, tail = columns
    with_observed = np.column_stack([observed, head]), np.column_stack([np.zeros_like(observed), tail])
    return times_matrix(with_observed, np.concatenate([[1.0], -coefficients])[:, None])[:, 0]
