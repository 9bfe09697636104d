"""Criteria of selection, for one model or for arrays of models.

With e the deviations, SSE = sum e^2, n observations and k coefficients, and K = k + 1 parameters (the coefficients and
the variance of the deviations), for independent normal deviations of one variance

    -2 ln L = n ln(SSE/n) + n ln(2 pi) + n
    AIC  = -2 ln L + 2 K                              (Akaike 1974)
    AICc = AIC + 2 K (K + 1)/(n - K - 1)              (Hurvich and Tsai 1989); none unless n > K + 1
    BIC  = -2 ln L + K ln n                           (Schwarz 1978)
    adjusted R^2 = 1 - (SSE/(n - k)) / (sum y^2/n)    about zero, so models with and without a constant compare
    leave-one-out error = sqrt(mean (e/(1 - h))^2)    h the leverages (Allen 1974)

Programs that leave the variance out of K give an AIC smaller by 2 and a BIC smaller by ln n. A criterion that does not
exist is NaN. SSE below the rounding of the response counts as that rounding: exact fits differ in k alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from selection.arrays import FloatArray, Floats, IntArray
from selection.errors import InputError

_ROUNDING = 16.0 * float(np.finfo(np.float64).eps)  # deviations below this share of the response say nothing
#: Names on the command line, with the name in print.
NAMES = {"bic": "BIC", "aic": "AIC", "aicc": "AICc", "adjusted-r2": "adjusted R^2", "loo": "leave-one-out error"}


@dataclass(frozen=True)
class Criteria:
    """All criteria of a model (or of models: arrays that broadcast)."""

    aic: Floats
    aicc: Floats
    bic: Floats
    adjusted_r_squared: Floats
    leave_one_out_error: Floats

    def score(self, criterion: str) -> Floats:
        """The named criterion, as a score: lower is better (adjusted R^2 with its sign changed)."""
        check_criterion(criterion)
        if criterion == "adjusted-r2":
            return -self.adjusted_r_squared
        if criterion == "loo":
            return self.leave_one_out_error
        return {"bic": self.bic, "aic": self.aic, "aicc": self.aicc}[criterion]


def criteria(sse: Floats, press: Floats, k: int | IntArray, observed: FloatArray) -> Criteria:
    """The criteria of models fitted to one response.

    Args:
        sse: sums of squared deviations.
        press: sums of squared leave-one-out errors (``leave_one_out`` gives them).
        k: numbers of coefficients.
        observed: the response (n,).
    """
    n = len(observed)
    K: npt.NDArray[np.float64] = np.asarray(k, dtype=np.float64) + 1.0
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        total = observed @ observed
        rounding = total * _ROUNDING**2
        deviance = n * np.log(np.maximum(sse, rounding) / n) + n * (np.log(2.0 * np.pi) + 1.0)
        aic, bic = deviance + 2.0 * K, deviance + K * np.log(n)
        aicc = aic + 2.0 * K * (K + 1.0) / np.where(n > K + 1.0, n - K - 1.0, np.nan)
        freedom = np.where(n > K - 1.0, n - K + 1.0, np.nan)
        adjusted = 1.0 - np.maximum(sse, rounding) / freedom * np.divide(n, total)
    exists = np.isfinite(freedom)
    loo = np.sqrt(np.maximum(press, rounding) / n)
    return Criteria(*(np.where(exists, value, np.nan)[()] for value in (aic, aicc, bic, adjusted, loo)))


def leave_one_out(deviations: FloatArray, leverages: FloatArray) -> Floats:
    """Sum of squared leave-one-out errors (e/(1 - h))^2 over the last axis; NaN where an h is 1 (an observation alone
    determines a coefficient and cannot be left out)."""
    left = np.subtract(1.0, leverages)
    alone = np.min(left, axis=-1, initial=1.0) <= 1e-10
    with np.errstate(divide="ignore", invalid="ignore"):
        errors = np.divide(deviations, left, out=left)
        return np.where(alone, np.nan, np.einsum("...n,...n->...", errors, errors))[()]


def check_criterion(criterion: str) -> None:
    """Raise InputError for a name that is not one of ``NAMES``."""
    if criterion not in NAMES:
        raise InputError(f"no criterion {criterion!r}", expected=f"one of {', '.join(NAMES)}")
