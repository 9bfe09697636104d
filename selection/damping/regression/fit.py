"""One regression with its statistics and the criteria of selection (report, section 5.2): arrays in, a result out.

The fit minimises sum_j (sum_k a_k phi_k(Q_j) - E(Q_j))^2 (Eq. 5.2.4). The columns are replaced by an orthonormal basis,
statsmodels fits what a first solution left over, and the coefficients and their statistics are linear combinations of
that fit's: the condition of the columns costs no digits.

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
from scipy.special import stdtr

from damping.arrays import BoolArray, FloatArray, Floats, IntArray
from damping.errors import InputError
from damping.regression import deviations
from damping.regression.design import Basis, Design, decompose, power_of_two

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


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    ``names`` (k) of the terms; ``coefficients``, ``std_errors``, ``t_ratios``, ``p_values`` (two-sided, Student's t)
    (k,) and ``covariance`` (k, k) of the coefficients, NaN without degrees of freedom; ``active`` (k,) False for terms
    that a constraint holds at 0 (they have no statistics); ``observed``, ``deviations`` = observed - fitted and
    ``leverages`` (n,); ``condition_number`` of all columns scaled to unit norm.
    """

    names: tuple[str, ...]
    coefficients: FloatArray
    std_errors: FloatArray
    t_ratios: FloatArray
    p_values: FloatArray
    covariance: FloatArray
    active: BoolArray
    observed: FloatArray
    deviations: FloatArray
    leverages: FloatArray
    condition_number: float

    @property
    def n(self) -> int:
        """Number of observations."""
        return len(self.observed)

    @property
    def k(self) -> int:
        """Number of coefficients that were free."""
        return int(self.active.sum())

    @property
    def fitted(self) -> FloatArray:
        """Fitted response (n,)."""
        return self.observed - self.deviations

    @property
    def sse(self) -> float:
        """Sum of squared deviations."""
        return _squares(self.deviations)

    @property
    def rms_error(self) -> float:
        """sqrt(SSE/n)."""
        return float(np.linalg.norm(self.deviations) / np.sqrt(self.n))

    @property
    def standard_error(self) -> float:
        """Standard error of the regression, sqrt(SSE/(n - k)); NaN without degrees of freedom."""
        return float(np.linalg.norm(self.deviations) / np.sqrt(self.n - self.k)) if self.n > self.k else np.nan

    @property
    def r_squared(self) -> float:
        """1 - SSE/sum y^2, about zero: the one for a model without a constant. NaN if the response is zero."""
        return _explained(self.deviations, self.observed)

    @property
    def r_squared_centred(self) -> float:
        """1 - SSE/sum (y - mean)^2, about the mean: the one for a model with a constant (below 0 where the model is
        worse than the mean). NaN if the response does not vary."""
        if np.ptp(self.observed) == 0.0:
            return np.nan
        return _explained(self.deviations, self.observed - self.observed.mean())

    @property
    def correlation(self) -> float:
        """Correlation of fitted against observed; NaN if either does not vary."""
        fitted, observed = self.fitted - self.fitted.mean(), self.observed - self.observed.mean()
        rounding = 8.0 * np.finfo(np.float64).eps * np.linalg.norm(self.observed)
        if min(np.linalg.norm(fitted), np.linalg.norm(observed)) <= rounding:
            return np.nan
        return float(np.clip(fitted @ observed / (np.linalg.norm(fitted) * np.linalg.norm(observed)), -1.0, 1.0))

    @property
    def criteria(self) -> Criteria:
        """AIC, AICc, BIC, adjusted R^2 and leave-one-out error, k counting the free coefficients."""
        return criteria(self.sse, leave_one_out(self.deviations, self.leverages), self.k, self.observed)


def fit(design: Design, basis: Basis | None = None) -> Fit:
    """Least-squares fit of a design.

    Args:
        design: terms and response.
        basis: of the design, where it is at hand.

    Raises:
        AnalysisError: the design is numerically rank-deficient; the columns are named.
    """
    basis = decompose(design) if basis is None else basis
    unit = float(power_of_two(np.abs(design.observed).max(keepdims=True))[0])
    observed = design.observed / unit
    first = basis.inverse @ (basis.orthonormal.T @ observed)
    left = deviations((design.columns / basis.scale, design.tails / basis.scale), first, observed)
    correction, covariance, left = _statistics(left, basis)
    coefficients = (first + correction) / basis.scale * unit
    std_errors = np.sqrt(np.diag(covariance)) / basis.scale * unit
    with np.errstate(all="ignore"):  # no deviations: no errors, and T-ratios that are infinite or NaN
        t_ratios = coefficients / std_errors
        covariance = covariance * np.outer(unit / basis.scale, unit / basis.scale)
    p_values = 2.0 * stdtr(max(design.n - design.k, 1), -np.abs(t_ratios))
    return Fit(
        names=design.names,
        coefficients=coefficients,
        std_errors=std_errors,
        t_ratios=t_ratios,
        p_values=p_values,
        covariance=covariance,
        active=np.ones(design.k, dtype=np.bool_),
        observed=design.observed,
        deviations=left * unit,
        leverages=np.einsum("nk,nk->n", basis.orthonormal, basis.orthonormal),
        condition_number=basis.condition_number,
    )


def _statistics(left: FloatArray, basis: Basis) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Coefficients (k,) of what is left over, their covariance (k, k) and the deviations (n,), on scaled columns."""
    from statsmodels.regression.linear_model import OLS  # noqa: PLC0415 - takes a second, only a fit needs it

    n, k = basis.orthonormal.shape
    result = OLS(left, basis.orthonormal).fit(method="qr")
    correction = basis.inverse @ np.asarray(result.params)
    if n == k:
        return correction, np.full((k, k), np.nan), np.asarray(result.resid)
    return correction, np.asarray(result.cov_params(r_matrix=basis.inverse)), np.asarray(result.resid)


def _squares(values: FloatArray) -> float:
    with np.errstate(over="ignore"):
        return float(values @ values)


def _explained(deviations: FloatArray, about: FloatArray) -> float:
    size = np.linalg.norm(about)
    return float(1.0 - (np.linalg.norm(deviations) / size) ** 2) if size > 0.0 else np.nan


def one_term_fits(design: Design) -> list[Fit]:
    """The fit of each term alone, most significant first.

    The order is that of |T| and of R^2 about zero, which are one: T^2 = (n - 1) R^2/(1 - R^2). AnalysisError if a
    column is zero at every observation.
    """
    fits = [fit(design.take([i])) for i in range(design.k)]
    return sorted(fits, key=lambda single: single.sse)
