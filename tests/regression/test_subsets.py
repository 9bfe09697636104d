"""All subsets at once: equal to fitting them one by one, nested as they must be, and the best of them found."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
import statsmodels.api as sm
from hypothesis import given, settings
from hypothesis import strategies as st

from damping.errors import AnalysisError, InputError
from damping.regression import subsets as subsets_module
from damping.regression.criteria import NAMES
from damping.regression.design import Design, design_of_arrays
from damping.regression.fit import fit
from damping.regression.subsets import all_subsets, best_subsets

Build = Callable[..., Design]
SEEDS = st.integers(0, 2**32 - 1)
few = settings(max_examples=30, deadline=None)  # a busy machine is no failure


def test_all_511_equal_a_loop_of_statsmodels(nine_term_design: Design) -> None:
    """Every subset of Eq. 5.3.6 on Table 5.III; the design's condition number is 1.1e7.

    statsmodels gets columns scaled to unit norm and solves by QR, so its coefficients are right to about the condition
    number times 2e-16, 1e-9 of the largest, and its SSE to that number times 1e-16: beside rational arithmetic it errs
    by up to 7e-11 at 7.5e5, another way on another processor, and ours by 5e-11. Its standard errors invert R'R, right
    to the square of the condition number times 2e-16: they are compared where that leaves digits, and by ``fit`` below
    everywhere.
    """
    design, n = nine_term_design, nine_term_design.n
    scale = np.linalg.norm(design.columns, axis=0)
    models = all_subsets(design)
    assert len(models) == 511
    assert len({bytes(members) for members in models.members}) == 511
    for i, members in enumerate(models.members):
        columns = design.columns[:, members] / scale[members]
        other = sm.OLS(design.observed, columns).fit(method="qr")
        condition = np.linalg.cond(columns)
        found = models.coefficients[i, members] * scale[members]
        largest = np.abs(other.params).max()
        np.testing.assert_allclose(found, other.params, rtol=0, atol=(1e-14 + 1e-15 * condition) * largest)
        np.testing.assert_allclose(models.sse[i], other.ssr, rtol=1e-10 + 1e-16 * condition)
        # statsmodels does not count the variance as a parameter
        np.testing.assert_allclose(models.criteria.aic[i], other.aic + 2, rtol=0, atol=1e-8)
        np.testing.assert_allclose(models.criteria.bic[i], other.bic + np.log(n), rtol=0, atol=1e-8)
        np.testing.assert_allclose(models.criteria.adjusted_r_squared[i], other.rsquared_adj, rtol=0, atol=1e-10)
        press = np.linalg.norm(other.get_influence().resid_press) / np.sqrt(n)
        # hat values by statsmodels' pseudo-inverse: the condition number once more
        np.testing.assert_allclose(models.criteria.leave_one_out_error[i], press, rtol=max(1e-14 * condition, 1e-10))
        if condition < 1e4:
            np.testing.assert_allclose(models.t_ratios[i, members], other.tvalues, rtol=1e-15 * condition**2 + 1e-10)


def test_all_511_equal_single_fits(nine_term_design: Design) -> None:
    """``fit`` holds certified digits at any condition number; the subsets' double Gram-Schmidt is right to 2e-16 times
    the condition number, 1.1e7 at most."""
    models = all_subsets(nine_term_design)
    for i in range(0, 511, 5):
        members = np.flatnonzero(models.members[i])
        one = fit(nine_term_design.take(members))
        np.testing.assert_allclose(models.coefficients[i, members], one.coefficients, rtol=1e-8)
        np.testing.assert_allclose(models.std_errors[i, members], one.std_errors, rtol=1e-9)
        np.testing.assert_allclose(models.sse[i], one.sse, rtol=1e-9)
        np.testing.assert_allclose(models.rms_errors[i], one.rms_error, rtol=1e-9)
        for criterion in NAMES:
            np.testing.assert_allclose(models.scores(criterion)[i], one.criteria.score(criterion), rtol=1e-9)
    left_out = ~models.members
    assert (models.coefficients[left_out] == 0).all()


def test_the_full_model_of_nine_terms_in_rational_arithmetic(nine_term_design: Design) -> None:
    """The worst conditioned of all: normal equations in rational arithmetic of the columns, heads and tails."""
    design = nine_term_design
    exact = [
        [Fraction(float(h)) + Fraction(float(t)) for h, t in zip(head, tail, strict=True)]
        for head, tail in zip(design.columns, design.tails, strict=True)
    ]
    y = [Fraction(float(value)) for value in design.observed]
    k = design.k
    rows = [
        [sum(row[i] * row[j] for row in exact) for j in range(k)]
        + [sum(r[i] * v for r, v in zip(exact, y, strict=True))]
        for i in range(k)
    ]
    for i in range(k):
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for j in range(k):
            if j != i:
                rows[j] = [b - rows[j][i] * a for a, b in zip(rows[i], rows[j], strict=True)]
    expected = [float(row[k]) for row in rows]
    # one fit: corrected, so only the response's rounding counts; all subsets: 2e-16 times 1.1e7
    np.testing.assert_allclose(fit(design).coefficients, expected, rtol=1e-11)
    np.testing.assert_allclose(all_subsets(design).coefficients[-1], expected, rtol=1e-8)


@few
@given(SEEDS, st.integers(1, 6), st.integers(0, 6))
def test_rss_never_rises_with_size(seed: int, k: int, more: int) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(k + more, k)), rng.normal(size=k + more))
    models = all_subsets(design)
    sse = {bytes(members): value for members, value in zip(models.members, models.sse, strict=True)}
    for members, value in zip(models.members, models.sse, strict=True):
        for j in np.flatnonzero(~members):
            larger = members.copy()
            larger[j] = True
            # rounding of the smaller one's SSE
            assert sse[bytes(larger)] <= value * (1 + 1e-12) + 1e-24


@few
@given(SEEDS, st.sampled_from(sorted(NAMES)), st.booleans())
def test_best_is_the_best_of_all(seed: int, criterion: str, nonnegative: bool) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(12, 5)), rng.normal(size=12) + 1.0)
    models = all_subsets(design)
    keep = np.isfinite(models.scores(criterion))
    if nonnegative:
        keep &= (models.coefficients >= 0).all(axis=1)
    if not keep.any():
        with pytest.raises(AnalysisError, match="no subset"):
            best_subsets(design, criterion, nonnegative=nonnegative)
        return
    best = best_subsets(design, criterion, nonnegative=nonnegative, number=3)
    qualified = models.take(keep)
    expected = np.sort(qualified.scores(criterion))[0]
    scores = best.scores(criterion)
    # one is recomputed from the leverages of its own decomposition
    np.testing.assert_allclose(scores[0], expected, rtol=1e-9)
    assert (np.diff(scores) >= 0).all()
    assert len(best) <= 3
    one = fit(design.take(np.flatnonzero(best.members[0])))
    np.testing.assert_allclose(best.criteria.leave_one_out_error[0], one.criteria.leave_one_out_error, rtol=1e-9)


@pytest.mark.parametrize(("block", "size"), [(1, 2e6), (2, 2e6), (9, 30.0)])
def test_blocks_change_nothing(random_design: Build, monkeypatch: pytest.MonkeyPatch, block: int, size: float) -> None:
    design = random_design(5, n=20, k=6)
    whole = all_subsets(design)
    monkeypatch.setattr(subsets_module, "_BLOCK", block)
    monkeypatch.setattr(subsets_module, "_BLOCK_SIZE", size)
    parts = all_subsets(design)
    by_members = {bytes(members): i for i, members in enumerate(parts.members)}
    order = [by_members[bytes(members)] for members in whole.members]
    # the order of additions in a product may differ with its shape
    np.testing.assert_allclose(parts.coefficients[order], whole.coefficients, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(parts.press[order], whole.press, rtol=1e-12)


@pytest.mark.parametrize("criterion", ["bic", "aic", "aicc", "loo", "adjusted-r2"])
def test_the_true_terms_are_found(criterion: str) -> None:
    rng = np.random.default_rng(8)
    columns = rng.normal(size=(200, 12))
    design = design_of_arrays(columns, columns[:, [1, 4, 7]] @ [3.0, -2.0, 1.0] + 0.1 * rng.normal(size=200))
    found = best_subsets(design, criterion, number=1)
    chosen = set(found.label(0))
    assert {"column 2", "column 5", "column 8"} <= chosen
    if criterion == "bic":  # consistent; the others keep a useless term now and then
        assert len(chosen) == 3


def test_exact_fits_differ_in_size_alone() -> None:
    """Below the rounding of the response there is nothing to choose by but the number of terms."""
    x = np.arange(1.0, 13.0)
    design = design_of_arrays(np.column_stack([x, x**2, np.sqrt(x), np.ones(12)]), 3.0 * x**2)
    for criterion in ("bic", "aic", "aicc"):
        assert best_subsets(design, criterion).label(0) == ("column 2",)


def test_subsets_that_cannot_be_searched_are_refused(random_design: Build) -> None:
    with pytest.raises(AnalysisError, match="at most 22 terms"):
        all_subsets(random_design(1, n=30, k=23))
    with pytest.raises(InputError, match="bic, aic, aicc, adjusted-r2, loo"):
        best_subsets(random_design(1), "press")
    with pytest.raises(AnalysisError, match="no subset"):
        best_subsets(design_of_arrays(np.ones((1, 1)), np.ones(1)))
    with pytest.raises(AnalysisError, match="every coefficient > 0"):
        best_subsets(
            design_of_arrays(np.arange(1.0, 5.0)[:, None], -np.arange(1.0, 5.0) - [0, 0, 0.1, 0]), nonnegative=True
        )
