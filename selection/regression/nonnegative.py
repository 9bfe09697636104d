"""Least squares with every coefficient >= 0: damping takes energy out, so a negative coefficient is no damping."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import nnls

from selection.arrays import FloatArray, IntArray
from selection.errors import AnalysisError
from selection.regression.basis import Basis, decompose
from selection.regression.design import Design
from selection.regression.fit import Fit, fit


def fit_nonnegative(design: Design, basis: Basis | None = None) -> Fit:
    """Least-squares fit of a design under a_k >= 0 (Lawson and Hanson's active set).

    The solution is the free fit of the terms that the constraint does not hold at 0; statistics are of that fit, so
    they take the set of those terms as given. Terms held at 0 have coefficient 0, no statistics and do not count as
    parameters. ``condition_number`` is of all columns.

    Raises:
        AnalysisError: the design is numerically rank-deficient (the columns are named), or no solution is found.
    """
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
