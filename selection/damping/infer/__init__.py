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
    for size in range(terms, 0, -1):
        for chosen in combinations(range(terms), size):
            among = list(chosen)
            ridge = DEPENDENT * np.eye(size) * np.diagonal(product, axis1=1, axis2=2)[:, among, None]
            fit = np.linalg.solve(product[:, np.array(among)[:, None], among] + ridge, moment[:, among, None])[..., 0]
            explained = np.where((fit >= 0.0).all(axis=1), (fit * moment[:, among]).sum(axis=1), -np.inf)
            better = explained > most
            if size == terms and better.all():  # with coefficients >= 0 the full set is best
                return np.asarray(fit, dtype=np.float64)
            most = np.where(better, explained, most)
            best[better] = 0.0
            best[np.flatnonzero(better)[:, None], among] = fit[better]
    return best
