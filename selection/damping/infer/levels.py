"""Errors of whole levels integrated out: by their covariance, or, of many levels, by the curves of their discrepancy.

With B = I + S K S for levels of covariance K, Woodbury's formula gives the likelihood of the rows. Straying joins every
level to every other. Of many levels it is a sum of few independent curves (principal components of a smooth process)
and a small rest of each level, so that the cost grows with their number and not with its cube.
"""

from functools import lru_cache

import numpy as np

from damping.arrays import FloatArray
from damping.infer.discrepancy import discrepancy_covariance

#: Largest share of the discrepancy's variance that is left to each level separately: on a hundred levels over a factor
#: of four some fifteen curves are kept, and ln p of laws that matter is right to a few hundredths.
_LEFT = 3e-5


@lru_cache(maxsize=256)  # shared by all laws on a record
def covariance_at(z: tuple[float, ...], origin: float) -> FloatArray:
    """Covariance of ln A of levels at ln F = z (s,) for a discrepancy of 1, from an ``origin``, (s, s)."""
    return discrepancy_covariance(np.array(z), np.array(z), origin)


@lru_cache(maxsize=256)  # as above
def split_covariance(z: tuple[float, ...], origin: float) -> tuple[FloatArray, FloatArray]:
    """Curves U (s, curves) and rests (s,): U U^T + diag(rests) is nearly the covariance of levels at z (s,).

    Its diagonal is exact, and at most ``_LEFT`` of it is in the rests.
    """
    whole = covariance_at(z, origin)
    variance, directions = np.linalg.eigh(whole)
    left = np.cumsum(np.maximum(variance, 0.0))
    shared = left > _LEFT * left[-1]
    U = directions[:, shared] * np.sqrt(variance[shared])
    return U, np.maximum(np.diagonal(whole) - np.sum(U**2, axis=1), 0.0)


def integrate_levels(sums: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """n^T V^-1 n, and ln |B| of rows whose levels have a covariance K, (points,) each, by Woodbury, B = I + S K S.

    ``sums``: as of :func:`damping.infer.likelihood.sum_rows`; S^2 holds those of h^2 over variance. Where they are not
    finite the results are NaN.
    """
    nn, hh, hn = sums[1:].reshape(3, -1, sums.shape[1])
    root = np.sqrt(hh)
    s, points = root.shape
    # Cholesky factor of B by columns, for all points at once; the row below it solves for S^-1 hn
    factor = np.empty((s + 1, s, points))
    np.multiply(root[:, None] * root, covariance.transpose(1, 2, 0), out=factor[:s])
    pivots = np.einsum("jjp->jp", factor[:s])  # a view
    pivots += 1.0
    factor[s] = np.divide(hn, root, out=np.zeros(root.shape), where=root > 0.0)
    within = np.maximum(nn - factor[s] ** 2, 0.0)  # zero for one row per level, up to rounding
    _factorise(factor)
    return np.sum(within + factor[s] ** 2, axis=0), 2.0 * np.sum(np.log(pivots), axis=0)


def integrate_curves(
    sums: FloatArray, level: FloatArray, sigma: FloatArray, U: FloatArray, rests: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """`integrate_levels` with K = diag(d) + sigma^2 U U^T, d = level^2 + sigma^2 ``rests``; by Woodbury a second time.

    ``level``, ``sigma``: of each point; U (s, curves) and rests (s,): of `split_covariance`.
    """
    nn, hh, hn = sums[1:].reshape(3, -1, sums.shape[1])
    s, curves = U.shape
    d = level**2 + np.multiply.outer(rests, sigma**2)
    own = 1.0 + hh * d
    factor = np.empty((curves + 1, curves, len(sigma)))
    products = (U[:, :, None] * U[:, None]).reshape(s, curves**2).T
    factor[:curves] = (products @ (hh / own)).reshape(curves, curves, len(sigma)) * sigma**2
    pivots = np.einsum("jjp->jp", factor[:curves])  # a view
    pivots += 1.0
    factor[curves] = sigma * (U.T @ (hn / own))
    alone = np.sum(np.maximum(nn - hn**2 * d / own, 0.0), axis=0)
    _factorise(factor)
    log_determinant = np.sum(np.log(own), axis=0) + 2.0 * np.sum(np.log(pivots), axis=0)
    return alone - np.sum(factor[curves] ** 2, axis=0), log_determinant


def _factorise(factor: FloatArray) -> None:
    """Cholesky factors L of matrices (k, k, points), by columns in place; a row b below becomes L^-1 b."""
    for j in range(factor.shape[1]):
        if j:
            factor[j:, j] -= np.einsum("rkp,kp->rp", factor[j:, :j], factor[j, :j])
        factor[j:, j] /= np.sqrt(factor[j, j])
