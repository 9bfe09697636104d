"""Posteriors of damping laws: observations, laws, likelihood, evidence, chains, diagnostics.

This module has least squares with coefficients >= 0 of many problems at once. With few terms all subsets are tried and
the best with coefficients >= 0 is taken; with many, the method of Lawson and Hanson (1974).
"""

from itertools import combinations

import numpy as np

from damping.arrays import FloatArray

SEED = 1970  #: default seed of all sampling, also on the command line
FEW_TERMS = 3  #: most terms of which all subsets are tried
DEPENDENT = 1e-13  #: relative ridge of the normal equations, so that collinear columns cause no error


def solve_nonnegative_batch(columns: FloatArray, target: FloatArray) -> FloatArray:
    """Coefficients >= 0 of least squares for many problems, (k, terms); NaN where none exist.

    Args:
        columns: (k, rows, terms).
        target: (k, rows).
    """
    terms = columns.shape[2]
    if terms > FEW_TERMS:
        from scipy.optimize import nnls  # noqa: PLC0415 - a third of a second to import

        return np.array([nnls(X, y)[0] for X, y in zip(columns, target, strict=True)])
    product = columns.transpose(0, 2, 1) @ columns
    moment = (columns.transpose(0, 2, 1) @ target[..., None])[..., 0]
    best, most = np.zeros(moment.shape), np.zeros(len(moment))
    every = np.arange(len(moment))
    for size in range(terms, 0, -1):
        subsets = np.array([*combinations(range(terms), size)])
        within, moments = product[:, subsets[:, :, None], subsets[:, None]], moment[:, subsets]
        ridge = DEPENDENT * np.eye(size) * np.diagonal(within, axis1=2, axis2=3)[..., None]
        fits = np.linalg.solve(within + ridge, moments[..., None])[..., 0]
        explained = np.where((fits >= 0.0).all(axis=2), (fits * moments).sum(axis=2), -np.inf)
        first = explained.argmax(axis=1)
        fit, reached = fits[every, first], explained[every, first]
        better = reached > most
        if size == terms and better.all():  # with coefficients >= 0 the full set is best
            return np.asarray(fit, dtype=np.float64)
        most = np.where(better, reached, most)
        best[better] = 0.0
        best[every[better, None], subsets[first[better]]] = fit[better]
    return best
