"""Backward, forward, stepwise and constrained selection: every step is the one that its rule says."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from damping.errors import AnalysisError, InputError
from damping.regression.criteria import NAMES
from damping.regression.design import Design, design_of_arrays
from damping.regression.fit import fit
from damping.regression.selecting import DIRECTIONS, METHODS, Choice, Selection, fit_nonnegative, select, stepwise
from damping.regression.subsets import all_subsets, best_subsets

Build = Callable[..., Design]
SEEDS = st.integers(0, 2**32 - 1)
few = settings(max_examples=30, deadline=None)  # a busy machine is no failure


def t_ratios(design: Design, terms: list[int]) -> np.ndarray:
    """|T| of the terms in their fit, from the normal equations (condition numbers here are small)."""
    X, y = design.columns[:, terms], design.observed
    inverse = np.linalg.inv(X.T @ X)
    b = inverse @ X.T @ y
    s2 = ((y - X @ b) ** 2).sum() / (design.n - len(terms))
    return np.abs(b) / np.sqrt(np.diag(inverse) * s2)


def replay(design: Design, found: Selection) -> list[int]:
    """The terms after all steps, from all or the first."""
    terms = {design.names.index(name) for name in found.steps[0].fit.names}
    assert found.steps[0].action == ("add" if len(terms) == 1 < design.k else "start")
    for step in found.steps[1:]:
        terms ^= {design.names.index(step.term)}
        assert set(step.fit.names) == {design.names[i] for i in terms}
        assert (step.action == "add") == (design.names.index(step.term) in terms)
    return sorted(terms)


@few
@given(SEEDS, st.floats(0.5, 4.0))
def test_backward_drops_the_least_t_ratio_until_none_is_below(seed: int, t_stop: float) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(15, 5)), rng.normal(size=15))
    terms = list(range(5))
    while len(terms) > 1 and t_ratios(design, terms).min() < t_stop:
        terms.pop(int(np.argmin(t_ratios(design, terms))))
    found = stepwise(design, "backward", t_stop=t_stop)
    assert list(found.chosen) == terms == replay(design, found)
    assert len(found.steps) == 1 + 5 - len(terms)


def test_backward_takes_nothing_in_again() -> None:
    """Correlated columns by which a dropped term would be worth its place once others are gone (one seed in 500)."""
    rng = np.random.default_rng(962)
    columns = rng.normal(size=(12, 4)) @ rng.normal(size=(4, 5)) + 0.3 * rng.normal(size=(12, 5))
    design = design_of_arrays(columns, rng.normal(size=12) + 0.3 * columns @ rng.normal(size=5))
    found = stepwise(design, "backward", t_stop=2.0)
    assert list(found.chosen) == [1]
    assert t_ratios(design, [1, 4])[1] > 2.5
    assert {step.action for step in found.steps} == {"start", "drop"}


@few
@given(SEEDS, st.floats(0.5, 4.0))
def test_forward_adds_the_largest_t_ratio_until_none_is_enough(seed: int, t_stop: float) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(15, 5)), rng.normal(size=15))
    terms = [int(np.argmax([t_ratios(design, [j])[0] for j in range(5)]))]
    while len(terms) < 5:
        others = [j for j in range(5) if j not in terms]
        entering = [t_ratios(design, [*terms, j])[-1] for j in others]
        if max(entering) < t_stop:
            break
        terms.append(others[int(np.argmax(entering))])
    found = stepwise(design, "forward", t_stop=t_stop)
    assert list(found.chosen) == sorted(terms) == replay(design, found)


@few
@given(SEEDS, st.sampled_from(DIRECTIONS), st.sampled_from(sorted(NAMES)), st.booleans())
def test_a_criterion_improves_at_every_step(seed: int, direction: str, criterion: str, nonnegative: bool) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(14, 5)), rng.normal(size=14) + 0.5)
    found = stepwise(design, direction, criterion=criterion, fitter=fit_nonnegative if nonnegative else fit)
    assert list(found.chosen) == replay(design, found)
    scores = [step.score for step in found.steps]
    for before, after, step in zip(scores, scores[1:], found.steps[1:], strict=False):
        # dropping a term that is held at 0 changes nothing, but for rounding
        assert after < before or (np.isnan(step.t_ratio) and after == pytest.approx(before, rel=1e-12))
    if nonnegative and len(found.chosen) > 1:
        assert (found.fit.coefficients > 0).all()


@few
@given(SEEDS, st.sampled_from([None, 1.5, 2.5]))
def test_stepwise_ends_where_no_step_is_left(seed: int, t_stop: float | None) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.normal(size=(20, 5))
    columns[:, 4] = columns[:, 0] + columns[:, 1] + 0.1 * rng.normal(size=20)  # enters first, then may leave
    design = design_of_arrays(columns, columns[:, 0] + columns[:, 1] + 0.1 * rng.normal(size=20))
    found = stepwise(design, "stepwise", t_stop=t_stop)
    assert list(found.chosen) == replay(design, found)
    if t_stop is not None:
        chosen = list(found.chosen)
        assert len(chosen) == 1 or t_ratios(design, chosen).min() >= t_stop
        assert all(t_ratios(design, [*chosen, j])[-1] < t_stop for j in range(5) if j not in chosen)


def test_stepwise_drops_what_later_terms_make_superfluous() -> None:
    rng = np.random.default_rng(3)
    columns = rng.normal(size=(40, 3))
    columns[:, 2] = columns[:, 0] + columns[:, 1] + 0.8 * rng.normal(size=40)
    design = design_of_arrays(columns, columns[:, 0] + columns[:, 1] + 0.05 * rng.normal(size=40), ["a", "b", "mix"])
    found = stepwise(design, "stepwise")
    assert found.fit.names == ("a", "b")
    assert [(step.action, step.term) for step in found.steps][-1] == ("drop", "mix")


@few
@given(SEEDS, st.integers(1, 6))
def test_nonnegative_fits_satisfy_kuhn_and_tucker(seed: int, k: int) -> None:
    rng = np.random.default_rng(seed)
    design = design_of_arrays(rng.normal(size=(k + 6, k)), rng.normal(size=k + 6))
    found = fit_nonnegative(design)
    gradient = design.columns.T @ found.deviations  # of -SSE/2
    size = np.linalg.norm(design.columns, axis=0) * np.linalg.norm(design.observed)
    assert (found.coefficients >= 0).all()
    assert (gradient <= 1e-12 * size).all()  # no decrease by raising a coefficient, to rounding
    assert (np.abs(gradient[found.coefficients > 0]) <= 1e-12 * size[found.coefficients > 0]).all()
    np.testing.assert_array_equal(found.active, found.coefficients > 0)
    assert found.k == found.active.sum()
    # another algorithm (bounded-variable least squares) finds the same
    other = lsq_linear(design.columns, design.observed, (0, np.inf), method="bvls", tol=1e-14)
    np.testing.assert_allclose(found.sse, 2 * other.cost, rtol=1e-9)


def test_nonnegative_is_free_where_the_free_fit_is(random_design: Build) -> None:
    design = random_design(6, n=30, k=4)
    design = design_of_arrays(design.columns, design.columns @ [1.0, 2.0, 3.0, 4.0] + 0.1 * design.observed)
    free, held = fit(design), fit_nonnegative(design)
    np.testing.assert_array_equal(held.coefficients, free.coefficients)
    np.testing.assert_array_equal(held.covariance, free.covariance)


def test_terms_held_at_zero_have_no_statistics_and_cost_no_parameter(nine_term_design: Design) -> None:
    found = fit_nonnegative(nine_term_design)
    free = fit(nine_term_design.take(np.flatnonzero(found.active)))
    assert np.isnan(found.std_errors[~found.active]).all()
    assert np.isnan(found.covariance[~found.active]).all()
    np.testing.assert_array_equal(found.t_ratios[found.active], free.t_ratios)
    assert found.criteria == free.criteria
    assert found.condition_number > 1e6


def test_a_response_that_no_term_can_follow() -> None:
    found = fit_nonnegative(design_of_arrays(np.arange(1.0, 5.0)[:, None], -np.ones(4)))
    assert (found.coefficients[0], found.k, found.sse) == (0.0, 0, 4.0)


@few
@given(SEEDS, st.sampled_from(["bic", "aic", "loo"]))
def test_best_nonnegative_subset_is_the_best_of_constrained_fits(seed: int, criterion: str) -> None:
    """Among subsets with every free coefficient > 0 lies the best constrained fit of every subset."""
    rng = np.random.default_rng(seed)
    design = design_of_arrays(np.abs(rng.normal(size=(12, 4))), np.abs(rng.normal(size=12)))
    scores = []
    for members in all_subsets(design).members:
        constrained = fit_nonnegative(design.take(np.flatnonzero(members)))
        if constrained.k:
            scores.append(float(constrained.criteria.score(criterion)))
    best = best_subsets(design, criterion, nonnegative=True)
    np.testing.assert_allclose(best.scores(criterion)[0], min(scores), rtol=1e-9)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("nonnegative", [False, True])
def test_every_method_finds_clear_terms(method: str, nonnegative: bool) -> None:
    rng = np.random.default_rng(11)
    columns = rng.normal(size=(60, 6))
    design = design_of_arrays(columns, columns[:, [0, 3]] @ [2.0, 1.0] + 0.01 * rng.normal(size=60))
    found = select(design, Choice(method, "bic", nonnegative))
    assert {"column 1", "column 4"} <= set(found.fit.names)
    assert found.fit.names == design.take(found.chosen).names
    if method != "none":
        assert len(found.chosen) <= 3  # BIC lets a useless term in now and then
        dropped_or_added = [step.term for step in found.steps if step.action != "start"]
        assert dropped_or_added


@pytest.mark.parametrize(
    ("choice", "said"),
    [
        ({"method": "all"}, "one of none, backward, forward, stepwise, best"),
        ({"criterion": "BIC"}, "one of bic, aic, aicc, adjusted-r2, loo"),
        ({"nonnegative": "no"}, "True or False"),
        ({"method": "best", "t_stop": 2.0}, "one of backward, forward, stepwise"),
        ({"method": "backward", "t_stop": -1.0}, "a finite number >= 0"),
        ({"method": "forward", "t_stop": float("inf")}, "a finite number >= 0"),
    ],
)
def test_choices_that_are_not_allowed(choice: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        Choice(**choice)  # type: ignore[arg-type]  # wrong on purpose


def test_selections_that_cannot_be_made_are_refused(random_design: Build) -> None:
    with pytest.raises(InputError, match="one of backward, forward, stepwise"):
        stepwise(random_design(1), "sideways")
    with pytest.raises(AnalysisError, match="more observations than terms"):
        stepwise(random_design(1, n=4, k=4), "backward")
    with pytest.raises(AnalysisError, match="rank-deficient"):
        stepwise(design_of_arrays(np.ones((4, 2)), np.arange(4.0)), "forward")
    with pytest.raises(AnalysisError, match="rank-deficient"):
        fit_nonnegative(design_of_arrays(np.ones((4, 2)), np.arange(4.0)))


def test_the_last_term_stays(random_design: Build) -> None:
    found = stepwise(random_design(1), "backward", t_stop=1e9)
    assert len(found.chosen) == 1
