"""Terms: what is accepted, what it means, and where an error is said to be."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.errors import AnalysisError, InputError
from damping.regression import (
    Term,
    deviations,
    list_columns_of,
    multiply,
    parse_term,
    parse_terms,
    times_matrix,
    whole_power,
)

few = settings(max_examples=30, deadline=None)  # a busy machine is no failure


@pytest.mark.parametrize(
    ("text", "powers", "name"),
    [
        ("A^2*omega", (("A", 2.0), ("omega", 1.0)), "A^2*omega"),
        (" A ^ 2 * omega ", (("A", 2.0), ("omega", 1.0)), "A^2*omega"),
        ("omega*A^2", (("A", 2.0), ("omega", 1.0)), "omega*A^2"),
        ("A*A", (("A", 2.0),), "A*A"),
        ("A^-1.5", (("A", -1.5),), "A^-1.5"),
        ("A^+.5e1", (("A", 5.0),), "A^+.5e1"),
        ("1", (), "1"),
        ("1*A", (("A", 1.0),), "1*A"),
        ("A^0", (), "A^0"),
        ("tail amplitude (in)^2", (("tail amplitude (in)", 2.0),), "tailamplitude(in)^2"),
        ("x-y/z", (("x-y/z", 1.0),), "x-y/z"),
        ("Ampl._{ä}", (("Ampl._{ä}", 1.0),), "Ampl._{ä}"),
    ],
)
def test_text_is_read_as_products_of_powers(text: str, powers: tuple[tuple[str, float], ...], name: str) -> None:
    term = parse_term(text)
    assert (term.powers, term.name) == (powers, name)


def test_equality_and_order_are_of_the_product() -> None:
    assert parse_term("omega*A^2") == parse_term("A*omega*A")
    assert len({parse_term("A^2"), parse_term("A*A"), parse_term("A")}) == 2
    assert sorted(parse_terms("omega, A^2, A, 1")) == list(parse_terms("1, A, A^2, omega"))
    assert list_columns_of(parse_terms("omega*B, A^2, 1, B")) == ("B", "omega", "A")


@pytest.mark.parametrize(
    ("text", "position", "expected"),
    [
        ("", 1, "a column name or 1"),
        ("A,", 3, "a column name or 1"),
        ("A,,B", 3, "a column name or 1"),
        ("A**2", 3, r"a column name or 1, or \^ for a power"),
        ("*A", 1, "a column name or 1"),
        ("A, ^2", 3, "a column name or 1"),
        ("A^", 3, "a finite real number"),
        ("A*B^x", 5, "a finite real number"),
        ("A^2^3", 3, "a finite real number"),
        ("A^nan", 3, "a finite real number"),
        ("A^inf", 3, "a finite real number"),
        ("A^1e999", 3, "a finite real number"),
        ("A^1_0", 3, "a finite real number"),
        ("A^(1/2)", 3, "a finite real number"),
        ("A^٣", 3, "a finite real number"),
        ("A^--2", 3, "a finite real number"),
    ],
)
def test_errors_say_where_and_what_was_expected(text: str, position: int, expected: str) -> None:
    with pytest.raises(InputError, match=rf"character {position}: .*; expected {expected}"):
        parse_terms(text)


def test_a_comma_in_one_term_is_an_error() -> None:
    with pytest.raises(InputError, match="character 2"):
        parse_term("A,B")


@few
@given(st.text(max_size=30))
def test_any_text_is_terms_or_an_error_of_one_line(text: str) -> None:
    try:
        terms = parse_terms(text)
    except InputError as error:
        said = str(error)
    else:
        said = ""
        assert [term.name for term in terms] == ["".join(part.split()) for part in text.split(",")]
    assert len(said.splitlines()) <= 1


@few
@given(st.integers(1, 40), st.floats(-9, 9))
def test_whole_powers_carry_what_rounding_lost(exponent: int, base: float) -> None:
    """Head + tail against rational arithmetic: 2^-104 a product, at most 2 log2(40) < 12 of them; underflow apart."""
    exact = Fraction(base) ** exponent
    if abs(exact) < 1e-200:
        return
    head, tail = parse_term(f"x^{exponent}").values(lambda _: np.array([base]), 1)
    assert abs(Fraction(float(head[0])) + Fraction(float(tail[0])) - exact) <= 12 * abs(exact) * Fraction(1, 2**100)
    assert head[0] == float(exact)


def test_a_term_has_the_value_of_its_product() -> None:
    A, omega = np.array([0.5, 2.0]), np.array([3.0, 4.0])
    table = {"A": A, "omega": omega}
    head, _ = parse_term("A^2*omega^-0.5").values(table.__getitem__, 2)
    # two roundings of the power and one of the product
    np.testing.assert_allclose(head, A**2 / np.sqrt(omega), rtol=1e-15)
    np.testing.assert_array_equal(parse_term("1").values(table.__getitem__, 2)[0], [1.0, 1.0])


@pytest.mark.parametrize(("term", "value"), [("x^-1", 0.0), ("x^0.5", -1.0), ("x^2", 1e200), ("x*x^-2", 0.0)])
def test_a_term_without_a_value_is_refused(term: str, value: float) -> None:
    with pytest.raises(AnalysisError, match=r"no finite value at observation 2"):
        parse_term(term).values(lambda _: np.array([1.0, value]), 2)


def test_large_numbers_keep_their_value() -> None:
    head, tail = Term((("x", 1.0),), "x").values(lambda _: np.array([1e300]), 1)
    assert (head[0], tail[0]) == (1e300, 0.0)


@few
@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), st.integers(0, 2**32))
def test_products_in_twice_the_precision(observed: list[float], seed: int) -> None:
    """Sums of products that cancel, against rational arithmetic: right to 2^-50 of the result where doubles have
    nothing left."""
    rng = np.random.default_rng(seed)
    x = (rng.normal(size=(3, 2)), np.zeros((3, 2)))
    columns = multiply(whole_power(x, 3), x)
    c = rng.normal(size=2) * 1e6
    y = np.array(observed)
    left = deviations(columns, c, y)
    for i in range(3):
        exact = Fraction(y[i]) - sum(
            (Fraction(float(columns[0][i, j])) + Fraction(float(columns[1][i, j]))) * Fraction(float(c[j]))
            for j in range(2)
        )
        scale = abs(y[i]) + np.abs(columns[0][i] * c).sum()
        # rounded once; the tails' own products are in plain doubles, 2^-53 of 2^-53 of the parts, a few of them
        assert abs(Fraction(float(left[i])) - exact) <= abs(exact) * Fraction(1, 2**52) + Fraction(scale) / 2**100
    np.testing.assert_array_equal(times_matrix(columns, np.eye(2)), columns[0] + columns[1])
