"""Terms of an energy polynomial (report, Eqs. 5.1.2 and 5.2.5): products of powers of columns, never evaluated."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import reduce

import numpy as np

from selection.arrays import FloatArray
from selection.errors import AnalysisError, InputError
from selection.regression.extended import Pair, multiply, whole_power

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_EXACT_POWERS = 64  # whole powers up to here carry a tail; beyond, a plain power

CONSTANT = "1"


@dataclass(frozen=True, order=True)
class Term:
    """A product of powers of columns, such as A^2*omega.

    ``powers`` holds (column, exponent) sorted by column, without zero exponents: terms are equal and ordered by them.
    ``name`` is the term as typed, without spaces. The empty product is the constant 1.
    """

    powers: tuple[tuple[str, float], ...]
    name: str = field(compare=False)

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns it needs."""
        return tuple(column for column, _ in self.powers)

    def values(self, column: Callable[[str], FloatArray], n: int) -> Pair:
        """The transformed variable phi(Q_j) (Eq. 5.2.3): head and tail (n,).

        Args:
            column: gives the values (n,) of a column.
            n: number of observations.

        Raises:
            AnalysisError: the term has no finite value at some observation (0 to a negative power, a negative number
                to a fractional one, overflow).
        """
        with np.errstate(all="ignore"):  # what has no value is named below
            factors = [_power(column(name), exponent) for name, exponent in self.powers]
            head, tail = reduce(multiply, factors) if factors else (np.ones(n), np.zeros(n))
        bad = ~np.isfinite(head)
        if bad.any():
            raise AnalysisError(f"term {self.name} has no finite value at observation {int(np.argmax(bad)) + 1}")
        return head, np.where(np.isfinite(tail), tail, 0.0)


def _power(base: FloatArray, exponent: float) -> Pair:
    if exponent == int(exponent) and 1 <= exponent <= _EXACT_POWERS:
        return whole_power((base, np.zeros_like(base)), int(exponent))
    return base**exponent, np.zeros_like(base)


def parse_terms(text: str) -> tuple[Term, ...]:
    """Terms separated by commas, as ``A^2*omega, A^3*omega^2, 1``.

    Raises:
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
        raise _error(text, start, "nothing" if not factor.strip() else "a power of nothing", "a column name or 1")
    if not caret:
        return column.strip(), 1.0
    at = start + len(column) + 1
    number = exponent.strip()
    value = float(number) if _NUMBER.fullmatch(number) else math.nan
    if not math.isfinite(value):
        found = repr(number) if number else "nothing"
        raise _error(text, at, f"{found} as a power", "a finite real number such as 2, 0.5 or -1")
    return column.strip(), value


def _error(text: str, position: int, found: str, expected: str) -> InputError:
    return InputError(f"terms {text.strip()!r}, character {position + 1}: {found}", expected=expected)


def columns_of(terms: Iterable[Term]) -> tuple[str, ...]:
    """The columns that the terms need, each once, in order of first use."""
    return tuple(dict.fromkeys(column for term in terms for column in term.columns))
