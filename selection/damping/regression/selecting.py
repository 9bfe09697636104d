"""Least squares with every coefficient >= 0: damping takes energy out, so a negative coefficient is no damping.

Which terms stay: none taken out, step by step, or the best of all subsets; free or with every coefficient >= 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damping.arrays import FloatArray, IntArray
from damping.errors import AnalysisError, InputError
from damping.regression.decomposition import Basis, decompose
from damping.regression.design import Design
from damping.regression.fit import NAMES, Fit, check_criterion, fit
from damping.regression.stepwise import DIRECTIONS, Step, stepwise
from damping.regression.subsets import Subsets, all_subsets, best_subsets, rank_subsets


def fit_nonnegative(design: Design, basis: Basis | None = None) -> Fit:
    """Least-squares fit of a design under a_k >= 0 (Lawson and Hanson's active set).

    The solution is the free fit of the terms that the constraint does not hold at 0; statistics are of that fit, so
    they take the set of those terms as given. Terms held at 0 have coefficient 0, no statistics and do not count as
    parameters. ``condition_number`` is of all columns.

    Raises:
        AnalysisError: the design is numerically rank-deficient (the columns are named), or no solution is found.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and few regressions need it

    basis = decompose(design) if basis is None else basis
    size = np.abs(design.observed).max() or 1.0
    try:
        solution, _ = nnls(basis.factor, basis.orthonormal.T @ (design.observed / size), maxiter=100 * design.k)
    except RuntimeError as error:
        raise AnalysisError(f"no least-squares fit with coefficients >= 0 was found: {error}") from error
    free = np.flatnonzero(solution > 0.0)
    while len(free):
        found = fit(design.take(free))
        if (found.coefficients > 0.0).all():
            return _with_zeros(found, free, design, basis)
        free = free[found.coefficients > 0.0]  # a coefficient that is 0 but for rounding
    return _all_zero(design, basis)


def _with_zeros(found: Fit, free: IntArray, design: Design, basis: Basis) -> Fit:
    """The fit of the free terms, with the others put in at 0."""
    k = design.k
    covariance = np.full((k, k), np.nan)
    covariance[np.ix_(free, free)] = found.covariance
    active = np.zeros(k, dtype=np.bool_)
    active[free] = True
    return replace(
        found,
        names=design.names,
        coefficients=_put(found.coefficients, free, np.zeros(k)),
        std_errors=_put(found.std_errors, free, np.full(k, np.nan)),
        t_ratios=_put(found.t_ratios, free, np.full(k, np.nan)),
        p_values=_put(found.p_values, free, np.full(k, np.nan)),
        covariance=covariance,
        active=active,
        condition_number=basis.condition_number,
    )


def _put(values: FloatArray, at: IntArray, into: FloatArray) -> FloatArray:
    into[at] = values
    return into


def _all_zero(design: Design, basis: Basis) -> Fit:
    """The fit in which the constraint holds every coefficient at 0."""
    nothing = np.full(design.k, np.nan)
    return Fit(
        names=design.names,
        coefficients=np.zeros(design.k),
        std_errors=nothing,
        t_ratios=nothing,
        p_values=nothing,
        covariance=np.full((design.k, design.k), np.nan),
        active=np.zeros(design.k, dtype=np.bool_),
        observed=design.observed,
        deviations=design.observed.copy(),
        leverages=np.zeros(design.n),
        condition_number=basis.condition_number,
    )


#: Of so many terms every subset is listed, best first; of more the best ones.
_MOST_TERMS_LISTED = 9
_BEST_LISTED = 20
METHODS = ("none", *DIRECTIONS, "best")


@dataclass(frozen=True)
class Choice:
    """How terms are selected: ``method`` of ``METHODS``, ``criterion`` of ``criteria.NAMES``, coefficients >= 0 or
    free, and the T-ratio at which steps stop (None: the criterion stops them).

    Raises InputError for a value that is not allowed.
    """

    method: str = "none"
    criterion: str = "bic"
    nonnegative: bool = False
    t_stop: float | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"no selection {self.method!r}", expected=f"one of {', '.join(METHODS)}")
        check_criterion(self.criterion)
        if self.t_stop is None:
            return
        if self.method not in DIRECTIONS:
            raise InputError(
                f"a T-ratio to stop at does not go with selection {self.method!r}",
                expected=f"one of {', '.join(DIRECTIONS)}",
            )
        if not (np.isfinite(self.t_stop) and self.t_stop >= 0.0):
            raise InputError(f"a T-ratio of {self.t_stop} to stop at", expected="a finite number >= 0")


@dataclass(frozen=True)
class Selected:
    """The selected terms (``design``), their ``fit``, the ``steps`` to them, and for ``best`` the best ``models``."""

    design: Design
    fit: Fit
    steps: tuple[Step, ...]
    models: Subsets | None


def select(design: Design, choice: Choice) -> Selected:
    """Select among the terms of a design.

    Raises:
        AnalysisError: a numerically rank-deficient design (the columns are named), or no model qualifies.
    """
    fitter = fit_nonnegative if choice.nonnegative else fit
    if choice.method == "none":
        return Selected(design, fitter(design), (), None)
    if choice.method == "best":
        return _best(design, choice)
    found = stepwise(design, choice.method, criterion=choice.criterion, t_stop=choice.t_stop, fitter=fitter)
    return Selected(design.take(found.chosen), found.fit, found.steps, None)


def _best(design: Design, choice: Choice) -> Selected:
    """The best subset; its steps drop the other terms one after the other, so that they can be followed."""
    if design.k <= _MOST_TERMS_LISTED:
        models = rank_subsets(all_subsets(design), choice.criterion, nonnegative=choice.nonnegative)
    else:
        models = best_subsets(design, choice.criterion, nonnegative=choice.nonnegative, number=_BEST_LISTED)
    kept = [int(i) for i in np.flatnonzero(models.members[0])]
    chosen = design.take(kept)
    reason = f"not in the subset with the best {NAMES[choice.criterion]} of all {2**design.k - 1}"
    found, score = fit(chosen), float(models.scores(choice.criterion)[0])
    dropped = [name for i, name in enumerate(design.names) if i not in kept]
    return Selected(chosen, found, tuple(Step("drop", name, reason, np.nan, score, found) for name in dropped), models)
