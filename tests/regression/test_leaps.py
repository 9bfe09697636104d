"""Leaps and bounds against every subset fitted: the same lists by every criterion, free and with signs, with ties."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from damping.errors import AnalysisError
from damping.regression.criteria import NAMES
from damping.regression.design import Design, design_of_arrays
from damping.regression.subsets import Subsets, all_subsets, best_subsets, rank_subsets

STRD = Path(__file__).parents[1] / "reference" / "strd"
SEEDS = st.integers(0, 2**32 - 1)
KINDS = ("independent", "one factor", "neighbours", "powers", "whole numbers")
few = settings(max_examples=25, deadline=None)  # a busy machine is no failure


def make(kind: str, seed: int, n: int, k: int) -> Design:
    """A response of about half of the terms with noise. Whole numbers make exact ties."""
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(n, k))
    if kind == "one factor":
        columns = 0.3 * columns + rng.normal(size=(n, 1))
    elif kind == "neighbours":
        for j in range(1, k):
            columns[:, j] = 0.9 * columns[:, j - 1] + 0.4 * columns[:, j]
    elif kind == "powers":
        columns = np.linspace(0.5, 2.0, n)[:, None] ** np.arange(1, k + 1)
    elif kind == "whole numbers":
        columns = np.round(2.0 * columns)
    true = rng.normal(size=k) * (rng.random(k) < 0.5)
    observed = columns @ true + rng.normal(size=n)
    return design_of_arrays(columns, np.round(observed) if kind == "whole numbers" else observed)


def listed(models: Subsets, criterion: str, nonnegative: bool, number: int) -> Subsets:
    """The list by looking at every subset."""
    ranked = rank_subsets(models, criterion, nonnegative=nonnegative)
    return ranked.take(np.arange(len(ranked))[:number])


def assert_same(design: Design, whole: Subsets, criterion: str, nonnegative: bool, number: int) -> None:
    """Scores of both lists agree; so do the subsets wherever no other one scores the same."""
    try:
        expected = listed(whole, criterion, nonnegative, number)
    except AnalysisError:
        with pytest.raises(AnalysisError, match="no subset"):
            best_subsets(design, criterion, nonnegative=nonnegative)
        return
    found = best_subsets(design, criterion, nonnegative=nonnegative, number=number)
    scores = found.scores(criterion)
    # rounding times condition numbers of up to 1e6 here; adjusted R^2 and ln SSE are of order 1
    np.testing.assert_allclose(scores, expected.scores(criterion), rtol=1e-8, atol=1e-8)
    apart = np.diff(scores) > 1e-7 * np.maximum(np.abs(scores[1:]), 1.0)
    alone = np.concatenate([[True], apart]) & np.concatenate([apart, [False]])  # the last may tie with one not listed
    np.testing.assert_array_equal(found.members[alone], expected.members[alone])
    assert found.proof is not None
    assert found.proof.subsets == 2**design.k - 1
    assert found.proof.bound <= np.nanmin(listed(whole, criterion, nonnegative, 1).scores(criterion))


@few
@given(SEEDS, st.sampled_from(KINDS), st.integers(1, 8), st.sampled_from([0, 1, 2, 3, 8, 40]), st.booleans())
def test_the_same_lists_as_by_every_subset(seed: int, kind: str, k: int, more: int, nonnegative: bool) -> None:
    try:
        design = make(kind, seed, k + more, k)
        whole = all_subsets(design)
    except AnalysisError:  # whole numbers may be dependent
        return
    if nonnegative and np.any(np.abs(whole.coefficients[whole.members]) < 1e-12):
        return  # a coefficient of exactly 0, which whole numbers can have: its sign is that of rounding
    for criterion in NAMES:
        for number in (1, 4, 7):
            assert_same(design, whole, criterion, nonnegative, number)


@pytest.mark.parametrize("criterion", NAMES)
@pytest.mark.parametrize("nonnegative", [False, True])
@pytest.mark.parametrize("kind", ["one factor", "neighbours", "whole numbers"])
def test_the_lists_of_twelve_terms_are_those_of_every_subset(kind: str, nonnegative: bool, criterion: str) -> None:
    design = make(kind, 12, 50, 12)
    assert_same(design, all_subsets(design), criterion, nonnegative, number=20)


@pytest.mark.parametrize("criterion", NAMES)
@pytest.mark.parametrize("nonnegative", [False, True])
def test_the_lists_of_longley_s_data_are_those_of_every_subset(nonnegative: bool, criterion: str) -> None:
    """Certified data, nearly dependent: a scaled condition number of 4e4 with the constant."""
    table = pd.read_csv(STRD / "longley.csv")
    observed = table.pop("y").to_numpy(dtype=np.float64)
    design = design_of_arrays(np.column_stack([np.ones(len(table)), table]), observed)
    assert_same(design, all_subsets(design), criterion, nonnegative, number=10)


@pytest.mark.parametrize("criterion", NAMES)
@pytest.mark.parametrize("nonnegative", [False, True])
def test_the_nine_terms_of_the_report(nine_term_design: Design, nonnegative: bool, criterion: str) -> None:
    """Condition number 1.1e7."""
    assert_same(nine_term_design, all_subsets(nine_term_design), criterion, nonnegative, number=10)


def test_copies_of_the_best_term_tie() -> None:
    """Two columns that mirror each other about the response deviate equally: both are listed, the first one first."""
    rng = np.random.default_rng(4)
    along, across = np.linalg.qr(rng.normal(size=(40, 6)))[0].T[:2]
    mirrored = np.column_stack([along + across, along - across, rng.normal(size=(40, 8))])
    found = best_subsets(design_of_arrays(mirrored, along), number=2**10 - 1)
    ones = found.take(found.sizes == 1)
    assert {ones.label(0), ones.label(1)} == {("column 1",), ("column 2",)}
    np.testing.assert_allclose(ones.sse[0], ones.sse[1], rtol=1e-12)  # rounding of sums of 40 squares


@pytest.mark.parametrize("kind", ["one factor", "neighbours"])
def test_no_swap_betters_the_best_of_many(kind: str) -> None:
    """2^32 subsets, too many to look at: no subset that differs by one term, or by two, is better (plain lstsq)."""
    design = make(kind, 7, 80, 32)
    found = best_subsets(design, "bic", number=1)
    best, score = found.members[0], float(found.scores("bic")[0])
    flips = np.eye(32, dtype=np.bool_)
    others = [best ^ a ^ b for i, a in enumerate(flips) for b in [np.zeros(32, dtype=np.bool_), *flips[:i]]]
    for members in others:
        columns = design.columns[:, members]
        left = design.observed - columns @ np.linalg.lstsq(columns, design.observed)[0]
        bic = 80 * np.log(left @ left / 80) + 80 * (np.log(2 * np.pi) + 1) + (members.sum() + 1) * np.log(80)
        assert bic > score - 1e-8  # rounding of n ln SSE


def test_no_subset_with_signs_betters_least_squares_with_signs() -> None:
    """Non-negative least squares on all of 25 terms deviates least; being a subset with signs itself, it bounds the
    best AIC from above."""
    design = make("independent", 3, 100, 25)
    solution, norm = nnls(design.columns, design.observed)
    found = best_subsets(design, "aic", nonnegative=True, number=1)
    whole = replace(found, sse=np.array([norm**2]), members=solution[None] > 0.0, proof=None)
    assert found.scores("aic")[0] <= whole.scores("aic")[0] + 1e-8  # rounding of n ln SSE
    assert found.sse[0] >= norm**2 * (1.0 - 1e-12)  # rounding of a sum of 100 squares
    assert (found.coefficients[0, found.members[0]] > 0.0).all()


def test_a_search_too_long_says_so(monkeypatch: pytest.MonkeyPatch, random_design: Callable[..., Design]) -> None:
    monkeypatch.setattr("damping.regression.leaps.MOST_WORK", 5.0 * 12**2)
    with pytest.raises(AnalysisError, match=r"2\^12 - 1 subsets is not proved after 5 fits"):
        best_subsets(random_design(1, n=30, k=12, noise=20.0), "aic")
