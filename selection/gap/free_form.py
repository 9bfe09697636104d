"""What is missing, in free form: the change of natural frequency and damping with amplitude that a fit still lacks.

Both are quadratic splines of ln A added to a fit to first order; with M and g of their columns (see
`selection.gap.directed`) the coefficients are a = -M^-1 g, with covariance M^-1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from selection.arrays import FloatArray
from selection.gap.directed import SPLINES, basis, information, motion, stiffness_and_damping
from selection.gap.fit import Fit

#: Splines that the record determines to less than this share of the best determined one are left out.
_SEEN = 1e-4


@dataclass(frozen=True)
class FreeForm:
    """Curves over amplitude A, (n,): relative change of the natural frequency, change of the damping ratio; and sds."""

    A: FloatArray
    frequency: FloatArray
    frequency_sd: FloatArray
    damping: FloatArray
    damping_sd: FloatArray


def free_form(one: Fit, points: int = 80) -> FreeForm:
    """The curves of free form that a fit lacks, at ``points`` amplitudes of the record."""
    D = stiffness_and_damping(one)
    M, g = information(one, D)
    values, vectors = np.linalg.eigh(M)
    seen = values > _SEEN * values.max()
    covariance = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T
    a = -covariance @ g
    u = motion(one)
    at = np.linspace(u.min(), u.max(), points)
    B = basis(u, SPLINES, at)
    half = len(B)
    parts = [
        (a[own] @ B, np.sqrt(np.sum(B * (covariance[own, own] @ B), axis=0)))
        for own in (slice(half), slice(half, None))
    ]
    return FreeForm(np.exp(at), *parts[0], *parts[1])
