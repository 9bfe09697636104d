"""The regression program. This module: terms of an energy polynomial, with powers in twice the working precision.

A term (report, Eqs. 5.1.2 and 5.2.5) is a product of powers of columns, never evaluated as code. A number in twice the
working precision is a pair (head, tail) of value head + tail, |tail| at most half a unit in the last place of head
(Dekker 1971; Ogita, Rump, Oishi 2005). Powers of a column, and products that would cancel in an ill-conditioned fit,
use such pairs; everything else uses plain doubles.
"""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import reduce
from typing import TypeAlias

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.records.text import NUMBER

Pair: TypeAlias = tuple[FloatArray, FloatArray]  #: head and tail of the same shape

_SPLITTER = 134217729.0  # 2**27 + 1 cuts a double's 53 bits into two halves whose products are exact


def exact_sum(a: FloatArray, b: FloatArray) -> Pair:
    """a + b without error (any shapes that broadcast): the rounded sum and its rounding error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


def exact_product(a: FloatArray, b: FloatArray) -> Pair:
    """a b without error (any shapes that broadcast, |a| and |b| below 1e292): the rounded product and its error."""
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
    """(head + tail) @ matrix, (n, k) and (k, m), products and sums in twice the working precision, rounded once."""
    head, tail = columns
    total = np.zeros((len(head), matrix.shape[1]))
    loss = tail @ matrix
    for i, row in enumerate(matrix):
        product, product_loss = exact_product(head[:, i, None], row)
        total, sum_loss = exact_sum(total, product)
        loss += product_loss + sum_loss
    return np.asarray(total + loss)


def deviations(columns: Pair, coefficients: FloatArray, observed: FloatArray) -> FloatArray:
    """observed - (head + tail) @ coefficients (n,), rounded once: exact to the last digit although the parts cancel."""
    head, tail = columns
    with_observed = np.column_stack([observed, head]), np.column_stack([np.zeros_like(observed), tail])
    return times_matrix(with_observed, np.concatenate([[1.0], -coefficients])[:, None])[:, 0]


_EXACT_POWERS = 64  # whole powers up to here carry a tail; beyond, a plain power

CONSTANT = "1"


@dataclass(frozen=True, order=True)
class Term:
    """A product of powers of columns, such as A^2*omega; the empty product is the constant 1.

    Terms are equal and ordered by their powers.
    """

    powers: tuple[tuple[str, float], ...]  #: (column, exponent) sorted by column, without zero exponents
    name: str = field(compare=False)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of the term."""
        return tuple(column for column, _ in self.powers)

    def values(self, column: Callable[[str], FloatArray], n: int) -> Pair:
        """The transformed variable phi(Q_j) (Eq. 5.2.3): head and tail (n,).

        ``column`` gives the values (n,) of a column.

        AnalysisError: the term has no finite value at some observation (0 to a negative power, a negative number
            to a fractional one, overflow).
        """
        with np.errstate(all="ignore"):  # what has no value is named below
            factors = [_power(column(name), exponent) for name, exponent in self.powers]
            head, tail = reduce(multiply, factors) if factors else (np.ones(n), np.zeros(n))
        bad = ~np.isfinite(head)
        if bad.any():
            at = int(np.argmax(bad))
            there = ", ".join(f"{name} = {column(name)[at]:g}" for name in self.columns)
            raise AnalysisError(f"term {self.name} has no finite value at observation {at + 1} ({there})")
        return head, np.where(np.isfinite(tail), tail, 0.0)


def _power(base: FloatArray, exponent: float) -> Pair:
    if exponent == int(exponent) and 1 <= exponent <= _EXACT_POWERS:
        return whole_power((base, np.zeros_like(base)), int(exponent))
    return base**exponent, np.zeros_like(base)


def parse_terms(text: str) -> tuple[Term, ...]:
    """Terms separated by commas, as ``A^2*omega, A^3*omega^2, 1``.

    InputError: with the position (1 is the first character) and what was expected there.
    """
    terms, start = [], 0
    for part in text.split(","):
        terms.append(_parse(part, start, text))
        start += len(part) + 1
    return tuple(terms)


def parse_term(text: str) -> Term:
    """One term. Raises InputError with position and what was expected."""
    if "," in text:
        raise _error(text, text.index(","), "a comma in a term", "one term")
    return _parse(text, 0, text)


def _parse(part: str, start: int, text: str) -> Term:
    """The term in ``part``, which begins at ``start`` of ``text``."""
    powers: dict[str, float] = {}
    position = start
    for factor in part.split("*"):
        column, exponent = _factor(factor, position, text)
        if column != CONSTANT:
            powers[column] = powers.get(column, 0.0) + exponent
        position += len(factor) + 1
    kept = tuple(sorted((column, exponent) for column, exponent in powers.items() if exponent != 0.0))
    return Term(kept, "".join(part.split()))


def _factor(factor: str, start: int, text: str) -> tuple[str, float]:
    """Column and exponent of one factor, which begins at ``start`` of ``text``."""
    column, caret, exponent = factor.partition("^")
    if not column.strip():
        expected = "a column name or 1" + (", or ^ for a power" if text[start - 1 : start + 1] == "**" else "")
        raise _error(text, start, "nothing" if not factor.strip() else "a power of nothing", expected)
    if not caret:
        return column.strip(), 1.0
    at = start + len(column) + 1
    number = exponent.strip()
    value = float(number) if NUMBER.fullmatch(number) else math.nan
    if not math.isfinite(value):
        given = repr(number) if number else "nothing"
        raise _error(text, at, f"{given} as a power", "a finite real number such as 2, 0.5 or -1")
    return column.strip(), value


def _error(text: str, position: int, problem: str, expected: str) -> InputError:
    return InputError(f"terms {text.strip()!r}, character {position + 1}: {problem}", expected=expected)


def list_columns_for(response: str, terms: Iterable[Term]) -> tuple[str, ...]:
    """The response, then the columns of ``terms``, each once. InputError: a response without a name."""
    if not (wanted := response.strip()):
        raise InputError("the name of the response is empty", expected="a column of the table")
    return tuple(dict.fromkeys([wanted, *list_columns_of(terms)]))


def list_columns_of(terms: Iterable[Term]) -> tuple[str, ...]:
    """The columns that the terms need, each once, in order of first use."""
    return tuple(dict.fromkeys(column for term in terms for column in term.columns))
