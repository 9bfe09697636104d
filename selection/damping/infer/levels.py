"""Errors of whole levels integrated out: by their covariance, or, of many levels, by the curves of their discrepancy.

With B = I + S K S for levels of covariance K, Woodbury's formula gives the likelihood of the rows. Straying joins every
level to every other. Of many levels it is a sum of few independent curves (principal components of a smooth process)
and a small rest of each level, so that the cost grows with their number and not with its cube.
"""

from functools import lru_cache

import numpy as np
from scipy.linalg.lapack import dpotrf

from damping.arrays import FloatArray
from damping.infer.discrepancy import covary_discrepancy

#: Largest share of the discrepancy's variance that is left to each level separately: on a hundred levels over a factor
#: of four some fifteen curves are kept, and ln p of laws that matter is right to a few hundredths.
_LEFT = 3e-5
#: Rows of matrices from which they are factorised one by one (LAPACK), not all at once by columns: at 24 both take the
#: same time, at 100 one by one a fifth. Smaller ones are interleaved in memory: see `find_averages`.
_ONE_BY_ONE = 24


@lru_cache(maxsize=256)  # shared by all laws on a record
def covary_places(z: tuple[float, ...], origin: float) -> FloatArray:
    """Covariance of ln A of levels at ln F = z (s,) for a discrepancy of 1, from an ``origin``, (s, s)."""
    return covary_discrepancy(np.array(z), np.array(z), origin)


@lru_cache(maxsize=256)  # as above
def correlate_drift(u: tuple[float, ...], length: float) -> FloatArray:
    """Correlation of the drift of levels at ln A = u (s,), forgotten over a ``length``, (s, s)."""
    return np.asarray(np.exp(-np.abs(np.subtract.outer(u, u)) / length))


def scale_each(matrix: FloatArray, factors: FloatArray) -> FloatArray:
    """A ``matrix`` (s, s) times each of ``factors`` (points,), (points, s, s)."""
    if len(matrix) >= _ONE_BY_ONE:
        return np.asarray(np.multiply.outer(factors, matrix))
    return np.moveaxis(np.multiply.outer(matrix, factors), -1, 0)


@lru_cache(maxsize=256)  # as above
def split_covariance(z: tuple[float, ...], origin: float) -> tuple[FloatArray, FloatArray]:
    """Curves U (s, curves) and rests (s,): U U^T + diag(rests) is nearly the covariance of levels at z (s,).

    Its diagonal is exact, and at most ``_LEFT`` of it is in the rests.
    """
    whole = covary_places(z, origin)
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
    bordered = _empty_bordered(s, points)  # B, and S^-1 hn below it
    each = np.asarray(root.T, order="C" if s >= _ONE_BY_ONE else "K")
    np.multiply(each[:, :, None] * each[:, None], covariance, out=bordered[:s, :s].transpose(2, 0, 1))
    np.einsum("jjp->jp", bordered[:s, :s])[...] += 1.0
    below = np.divide(hn, root, out=np.zeros(root.shape), where=root > 0.0)
    bordered[s, :s] = below
    within = np.maximum(nn - below**2, 0.0)  # zero for one row per level, up to rounding
    solved, log_determinant = _solve(bordered)
    return np.sum(within + solved**2, axis=0), log_determinant


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
    bordered = _empty_bordered(curves, len(sigma))
    products = (U[:, :, None] * U[:, None]).reshape(s, curves**2).T
    bordered[:curves, :curves] = (products @ (hh / own)).reshape(curves, curves, len(sigma)) * sigma**2
    np.einsum("jjp->jp", bordered[:curves, :curves])[...] += 1.0
    bordered[curves, :curves] = sigma * (U.T @ (hn / own))
    alone = np.sum(np.maximum(nn - hn**2 * d / own, 0.0), axis=0)
    solved, log_determinant = _solve(bordered)
    return alone - np.sum(solved**2, axis=0), np.sum(np.log(own), axis=0) + log_determinant


def _empty_bordered(k: int, points: int) -> FloatArray:
    """Of matrices (k, k) with a row below, whose end is not read, (k + 1, k + 1, points)."""
    if k >= _ONE_BY_ONE:
        return np.empty((points, k + 1, k + 1)).transpose(1, 2, 0)
    return np.empty((k + 1, k + 1, points))


def _solve(bordered: FloatArray) -> tuple[FloatArray, FloatArray]:
    """L^-1 b (k, points) and ln |B| (points,) of matrices B = L L^T >= I, (k, k), with a row b below each.

    NaN where they are not finite. ``bordered``, of `_empty_bordered`, is overwritten.
    """
    k = len(bordered) - 1
    if k >= _ONE_BY_ONE:
        bordered[k, k] = 1.0 + np.sum(bordered[k, :k] ** 2, axis=0)  # so that the row below is part of the factor
        for transposed in bordered.transpose(2, 1, 0):
            _, failed = dpotrf(transposed, overwrite_a=True, clean=False)  # half of a symmetric matrix is read
            if failed:  # not finite, or too far out for its digits
                transposed[...] = np.nan
    else:
        for j in range(k):
            if j:
                bordered[j:, j] -= np.einsum("rkp,kp->rp", bordered[j:, :j], bordered[j, :j])
            bordered[j:, j] /= np.sqrt(bordered[j, j])
    return bordered[k, :k], 2.0 * np.sum(np.log(np.einsum("jjp->jp", bordered)[:k]), axis=0)
