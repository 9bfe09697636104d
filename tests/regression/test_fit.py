"""One fit: against statsmodels where that is well conditioned, its definitions, and what must not change it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.errors import AnalysisError
from damping.regression.design import Design, correlations, decompose, design_of_arrays, tabulate_variables
from damping.regression.fit import fit, one_term_fits
from damping.regression.program import break_down, sum_up

Build = Callable[..., Design]
SEEDS = st.integers(0, 2**32 - 1)
few = settings(max_examples=30, deadline=None)  # a busy machine is no failure


@pytest.mark.parametrize("constant", [False, True])
def test_all_statistics_against_statsmodels(random_design: Build, constant: bool) -> None:
    design = random_design(1, n=25, k=4)
    if constant:
        columns = np.column_stack([np.ones(25), design.columns])
        design = design_of_arrays(columns, design.observed + 3.0, ["1", *design.names])
    found, other = fit(design), sm.OLS(design.observed, design.columns).fit()
    pairs = [
        (found.coefficients, other.params),
        (found.std_errors, other.bse),
        (found.t_ratios, other.tvalues),
        (found.p_values, other.pvalues),
        (found.covariance, other.cov_params()),
        (found.deviations, other.resid),
        (found.sse, other.ssr),
        (found.standard_error, np.sqrt(other.scale)),
        (found.leverages, other.get_influence().hat_matrix_diag),
        (found.r_squared_centred if constant else found.r_squared, other.rsquared),
        # statsmodels does not count the variance as a parameter
        (found.criteria.aic, other.aic + 2),
        (found.criteria.bic, other.bic + np.log(25)),
    ]
    for ours, theirs in pairs:
        # condition number below 10: both are right to some 1e-14, p-values to some digits fewer
        np.testing.assert_allclose(ours, theirs, rtol=1e-10, atol=1e-13)
    k = design.k
    K = k + 1
    assert found.criteria.aicc == pytest.approx(other.aic + 2 + 2 * K * (K + 1) / (25 - K - 1), rel=1e-12)
    if not constant:
        assert found.criteria.adjusted_r_squared == pytest.approx(other.rsquared_adj, rel=1e-12)


def test_every_figure_of_the_summary_follows_its_definition(random_design: Build) -> None:
    """Every figure of the summary from its definition, with numpy alone."""
    design = random_design(2, n=12, k=3)
    observed = np.round(design.observed, 1)
    observed[4] = 0.0  # left out of percents
    found = fit(design_of_arrays(design.columns, observed))
    fitted = design.columns @ np.linalg.lstsq(design.columns, observed, rcond=None)[0]
    error = observed - fitted
    percent = 100 * error[observed != 0] / observed[observed != 0]
    assert np.isnan(found.percent[4])
    pairs = [
        (found.rms_error, np.sqrt((error**2).sum() / 12)),
        (found.standard_error, np.sqrt((error**2).sum() / 9)),
        (found.r_squared, 1 - (error**2).sum() / (observed**2).sum()),
        (found.r_squared_centred, 1 - (error**2).sum() / ((observed - observed.mean()) ** 2).sum()),
        (found.correlation, np.corrcoef(fitted, observed)[0, 1]),
        (found.average_absolute_deviation, np.abs(error).mean()),
        (found.largest_absolute_deviation, np.abs(error).max()),
        (found.average_absolute_percent, np.abs(percent).mean()),
        (found.largest_absolute_percent, np.abs(percent).max()),
    ]
    for ours, defined in pairs:
        assert ours == pytest.approx(defined, rel=1e-10)
    expected = [fitted.sum(), observed.sum(), -error.sum(), fitted @ fitted, observed @ observed, error @ error]
    np.testing.assert_allclose(list(sum_up(found).values()), expected, rtol=1e-10, atol=1e-12)
    bands = break_down(found)
    edges = [0, 1, 2, 5, 10, 20, 50, 100, 1e9]
    assert bands["number"].tolist() == np.histogram(np.abs(percent), edges)[0].tolist()
    assert bands["percent"].sum() == pytest.approx(100 * 11 / 12, rel=1e-12)


def test_variables_and_correlations(random_design: Build) -> None:
    design = random_design(3, n=15, k=3)
    design = design_of_arrays(np.column_stack([design.columns, np.full(15, 0.1)]), design.observed)
    all_columns = np.column_stack([design.columns, design.observed])
    for numbers, column in zip(tabulate_variables(design).drop(columns="name").to_numpy(), all_columns.T, strict=True):
        m = len(column)
        expected = [sum(column), sum(column) / m, np.sqrt(((column - column.mean()) ** 2).sum() / m), sum(column**2)]
        np.testing.assert_allclose(numbers, expected, rtol=1e-12, atol=1e-14)
    matrix = correlations(design)
    varies = [0, 1, 2, 4]
    found = matrix[np.ix_(varies, varies)]
    np.testing.assert_allclose(found, np.corrcoef(all_columns[:, varies].T), rtol=1e-12, atol=1e-14)
    assert np.isnan(matrix[3]).all()  # a constant correlates with nothing
    assert np.isnan(matrix[:, 3]).all()


def test_one_term_fits_in_order(random_design: Build) -> None:
    design = random_design(4, n=15, k=5)
    fits = one_term_fits(design)
    ratios = [abs(float(one.t_ratios[0])) for one in fits]
    assert ratios == sorted(ratios, reverse=True)
    for one in fits:
        x = design.columns[:, design.names.index(one.names[0])]
        assert one.coefficients[0] == pytest.approx(x @ design.observed / (x @ x), rel=1e-13)


@few
@given(SEEDS, st.lists(st.floats(-12, 12), min_size=3, max_size=3), st.floats(-12, 12))
def test_units_rescale_coefficients_and_nothing_else(seed: int, units: list[float], unit: float) -> None:
    rng = np.random.default_rng(seed)
    columns, observed = rng.normal(size=(9, 3)), rng.normal(size=9)
    factors, factor = 10.0 ** np.array(units), 10.0**unit
    one = fit(design_of_arrays(columns, observed))
    two = fit(design_of_arrays(columns * factors, observed * factor))
    # factors are no powers of two: each column is rounded anew, which the condition number magnifies; small T-ratios
    # are differences
    tolerance = 1e-14 * one.condition_number
    scale = np.abs(one.t_ratios).max()
    np.testing.assert_allclose(two.t_ratios, one.t_ratios, rtol=tolerance, atol=tolerance * max(scale, 1.0))
    np.testing.assert_allclose(two.std_errors * factors / factor, one.std_errors, rtol=tolerance)
    # the root of a leverage is the length of a row of an orthonormal basis: it errs in parts of 1, not of its own
    np.testing.assert_allclose(np.sqrt(two.leverages), np.sqrt(one.leverages), atol=tolerance, rtol=0)
    np.testing.assert_allclose(two.condition_number, one.condition_number, rtol=tolerance)
    expected = [one.r_squared, one.correlation]
    np.testing.assert_allclose([two.r_squared, two.correlation], expected, atol=tolerance, rtol=0)
    ours, theirs = two.criteria, one.criteria
    np.testing.assert_allclose(ours.adjusted_r_squared, theirs.adjusted_r_squared, atol=10 * tolerance, rtol=0)
    np.testing.assert_allclose(ours.bic - theirs.bic, 18 * np.log(factor), atol=100 * tolerance, rtol=1e-12)


@few
@given(SEEDS, st.permutations(range(4)))
def test_order_of_terms_is_irrelevant(seed: int, order: list[int]) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(10, 4)), rng.normal(size=10))
    one, two = fit(design), fit(design.take(order))
    assert two.names == tuple(one.names[i] for i in order)
    # another order rounds differently in the basis alone, and that is corrected; small ones are differences
    scale = np.abs(one.coefficients).max()
    np.testing.assert_allclose(two.coefficients, one.coefficients[order], rtol=1e-11, atol=1e-13 * scale)
    np.testing.assert_allclose(two.std_errors, one.std_errors[order], rtol=1e-11)
    np.testing.assert_allclose(two.deviations, one.deviations, atol=1e-12 * np.abs(design.observed).max(), rtol=0)


@few
@given(SEEDS, st.integers(0, 3), st.floats(-1e9, 1e9).filter(lambda c: abs(c) > 1e-9), st.integers(8, 60))
def test_a_copied_column_is_refused_and_named(seed: int, which: int, factor: float, n: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(n, 4))
    design = design_of_arrays(
        np.column_stack([columns, factor * columns[:, which]]), rng.normal(size=n), ["a", "b", "c", "d", "copy"]
    )
    with pytest.raises(AnalysisError, match="rank-deficient") as error:
        fit(design)
    assert f"the columns {'abcd'[which]}, copy are" in str(error.value)


@few
@given(SEEDS, st.integers(6, 60))
def test_a_sum_of_columns_is_refused_and_all_named(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, c = rng.uniform(1.0, 2.0, size=(3, n))
    design = design_of_arrays(np.column_stack([a, b, c, a + b]), c, ["a", "b", "c", "sum"])
    with pytest.raises(AnalysisError, match="the columns a, b, sum are"):
        decompose(design)


def test_what_is_nearly_but_not_numerically_empty_is_fitted() -> None:
    """A column that differs from another in its twelfth digit only."""
    x = np.arange(1.0, 11.0)
    design = design_of_arrays(np.column_stack([x, x + 1e-11 * x**2]), x)
    # the second column's last digits carry 16 - 12 + 1 digits of x^2: that much is certain of the coefficients
    np.testing.assert_allclose(fit(design).fitted, x, rtol=1e-12)


@pytest.mark.parametrize(
    ("columns", "names"),
    [
        ([[1.0, 0.0], [2.0, 0.0], [3.0, 0.0]], "column 2 is zero"),
        ([[1.0, 2.0]], r"fewer observations \(1\) than terms \(2\): column 1, column 2"),
    ],
)
def test_empty_designs_are_refused(columns: list[list[float]], names: str) -> None:
    with pytest.raises(AnalysisError, match=f"rank-deficient: {names}"):
        fit(design_of_arrays(np.array(columns), np.ones(len(columns))))


@pytest.mark.parametrize("columns", [np.ones((3, 2, 2)), np.ones((4, 2)), np.ones((3, 0)), np.full((3, 1), np.inf)])
def test_arrays_that_do_not_fit_are_refused(columns: np.ndarray) -> None:
    with pytest.raises(AnalysisError):
        design_of_arrays(columns, np.ones(3))


def test_as_many_terms_as_observations() -> None:
    """An exact fit: no errors can be had, and none are given."""
    found = fit(design_of_arrays(np.array([[1.0, 2.0], [3.0, 5.0]]), np.array([1.0, 2.0])))
    np.testing.assert_allclose(found.coefficients, [-1.0, 1.0], rtol=1e-14)  # by hand; exact but for rounding
    assert np.isnan([*found.std_errors, *found.t_ratios, *found.p_values, found.standard_error]).all()
    assert np.isnan([found.criteria.bic, found.criteria.leave_one_out_error]).all()


def test_statistics_that_do_not_exist() -> None:
    zero = fit(design_of_arrays(np.arange(1.0, 5.0)[:, None], np.zeros(4)))
    assert zero.coefficients[0] == 0.0
    assert np.isnan([zero.r_squared, zero.r_squared_centred, zero.correlation]).all()
    assert np.isnan(zero.average_absolute_percent)
    level = fit(design_of_arrays(np.ones((4, 1)), np.full(4, 7.0)))
    assert level.r_squared == pytest.approx(1.0, rel=1e-15)
    assert np.isnan([level.r_squared_centred, level.correlation]).all()


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_the_size_of_numbers_does_not_matter(size: float) -> None:
    columns, observed = np.array([[1.0, 1.0], [2.0, 1.0], [4.0, 1.0]]), np.array([1.0, 2.0, 2.0])
    one, two = fit(design_of_arrays(columns, observed)), fit(design_of_arrays(columns * size, observed * size))
    # the columns' own rounding near the ends of the exponent range
    np.testing.assert_allclose(two.coefficients, one.coefficients, rtol=1e-13)
    np.testing.assert_allclose(two.t_ratios, one.t_ratios, rtol=1e-13)


@few
@given(SEEDS, st.integers(2, 5))
def test_closed_form_leave_one_out_is_refitting(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    n = k + 4
    design = design_of_arrays(rng.normal(size=(n, k)), rng.normal(size=n))
    errors = []
    for i in range(n):
        rest = np.arange(n) != i
        coefficients = fit(design_of_arrays(design.columns[rest], design.observed[rest])).coefficients
        errors.append(design.observed[i] - design.columns[i] @ coefficients)
    closed = fit(design).criteria.leave_one_out_error
    # rounding of e and 1 - h, magnified where a leverage is near 1
    worst = 1 / (1 - fit(design).leverages.max())
    assert closed == pytest.approx(
        np.sqrt(np.mean(np.square(errors))), rel=1e-13 * worst * fit(design).condition_number
    )


def test_an_observation_that_cannot_be_left_out() -> None:
    columns = np.array([[1.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    found = fit(design_of_arrays(columns, np.array([1.0, 2.0, 3.0, 4.0])))
    assert np.isnan(found.criteria.leave_one_out_error)
    assert np.isfinite(found.criteria.bic)
