"""Posteriors of damping laws: observations, laws, likelihood, evidence, chains, diagnostics.

Here least squares with coefficients >= 0, of many problems at once: of few terms every set is tried, and of those whose
coefficients are >= 0 the best is taken; of many Lawson and Hanson's method (1974).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from damping.arrays import FloatArray

#: Seed of everything sampled where none is stated, that of the command line.
SEED = 1970
#: Terms up to which all sets of them are tried.
FEW_TERMS = 3
#: Relative ridge of normal equations, which keeps columns that are multiples of each other apart from an error.
DEPENDENT = 1e-13


def solve_nonnegative_batch(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Least squares with coefficients >= 0 of many problems, (k, terms); NaN where none exist.

    Args:
        columns: (k, rows, terms). target: (k, rows).
    """
    terms = columns.shape[2]
    if terms > FEW_TERMS:
        from scipy.optimize import nnls  # noqa: PLC0415 - a third of a second to import

        return np.array([nnls(X, y)[0] for X, y in zip(columns, target, strict=True)])
    product = columns.transpose(0, 2, 1) @ columns
    moment = (columns.transpose(0, 2, 1) @ target[..., None])[..., 0]
    best, most = np.zeros(moment.shape), np.zeros(len(moment))
    for size in range(terms, 0, -1):
        for chosen in combinations(range(terms), size):
            among = list(chosen)
            ridge = DEPENDENT * np.eye(size) * np.diagonal(product, axis1=1, axis2=2)[:, among, None]
            fit = np.linalg.solve(product[:, among][:, :, among] + ridge, moment[:, among, None])[..., 0]
            explained = np.where((fit >= 0.0).all(axis=1), (fit * moment[:, among]).sum(axis=1), -np.inf)
            better = explained > most
            if size == terms and better.all():  # the best of all, wherever its coefficients are >= 0
                return np.asarray(fit, dtype=np.float64)
            most = np.where(better, explained, most)
            best[better] = 0.0
            best[np.flatnonzero(better)[:, None], among] = fit[better]
    return best
