"""One regression with its statistics (report, section 5.2), and the power law of section 4.3: arrays in, a result out.

The fit minimises sum_j (sum_k a_k phi_k(Q_j) - E(Q_j))^2 (Eq. 5.2.4). The columns are replaced by an orthonormal basis,
statsmodels fits the residuals of a first solution, and the coefficients and their statistics are linear combinations of
those of that fit: ill-conditioned columns cost no digits.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from scipy.special import stdtr, stdtrit

from damping.arrays import BoolArray, FloatArray
from damping.errors import AnalysisError
from damping.forces.powers import B, beta
from damping.regression import deviations
from damping.regression.criteria import Criteria, criteria, leave_one_out
from damping.regression.design import Basis, Design, decompose, power_of_two


@dataclass(frozen=True)
class Fit:
    """A fitted model. Statistics are NaN without degrees of freedom."""

    names: tuple[str, ...]  #: of the terms (k)
    coefficients: FloatArray  #: (k,)
    std_errors: FloatArray  #: (k,)
    t_ratios: FloatArray  #: (k,)
    p_values: FloatArray  #: two-sided, Student's t, (k,)
    covariance: FloatArray  #: of the coefficients, (k, k)
    active: BoolArray  #: False for terms that a constraint holds at 0 (they have no statistics), (k,)
    observed: FloatArray  #: (n,)
    deviations: FloatArray  #: observed - fitted (n,)
    leverages: FloatArray  #: (n,)
    condition_number: float  #: of all columns scaled to unit norm

    @property
    def n(self) -> int:
        """Number of observations."""
        return len(self.observed)

    @property
    def k(self) -> int:
        """Number of free coefficients."""
        return int(self.active.sum())

    @property
    def fitted(self) -> FloatArray:
        """Fitted response (n,)."""
        return self.observed - self.deviations

    @property
    def percent(self) -> FloatArray:
        """Per cent deviation (n,), 100 deviation/observed; NaN where observed is 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.observed == 0.0, np.nan, 100.0 * self.deviations / self.observed)

    @property
    def average_absolute_deviation(self) -> float:
        """Mean of |deviation|."""
        return float(np.abs(self.deviations).mean())

    @property
    def average_absolute_percent(self) -> float:
        """Mean of |percent| over observations other than 0; NaN if there are none."""
        return _over(np.mean, self.percent)

    @property
    def largest_absolute_deviation(self) -> float:
        """Largest |deviation|."""
        return float(np.abs(self.deviations).max())

    @property
    def largest_absolute_percent(self) -> float:
        """Largest |percent| over observations other than 0; NaN if there are none."""
        return _over(np.max, self.percent)

    @property
    def sse(self) -> float:
        """Sum of squared deviations."""
        with np.errstate(over="ignore"):
            return float(self.deviations @ self.deviations)

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
        """1 - SSE/sum y^2, about zero, for a model without a constant. NaN if the response is zero."""
        return _explained(self.deviations, self.observed)

    @property
    def r_squared_centred(self) -> float:
        """1 - SSE/sum (y - mean)^2, about the mean, for a model with a constant (negative if the model is
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


def fit(design: Design) -> Fit:
    """Least-squares fit of a design. AnalysisError: it is numerically rank-deficient; the columns are named."""
    basis = decompose(design)
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
    """Coefficients (k,) of the residuals, their covariance (k, k) and the deviations (n,), on scaled columns."""
    from statsmodels.regression.linear_model import OLS  # noqa: PLC0415 - takes a second, only a fit needs it

    n, k = basis.orthonormal.shape
    result = OLS(left, basis.orthonormal).fit(method="qr")
    correction = basis.inverse @ np.asarray(result.params)
    if n == k:
        return correction, np.full((k, k), np.nan), np.asarray(result.resid)
    return correction, np.asarray(result.cov_params(r_matrix=basis.inverse)), np.asarray(result.resid)


def _over(statistic: Callable[[FloatArray], np.floating], percent: FloatArray) -> float:
    known = np.abs(percent[~np.isnan(percent)])
    return float(statistic(known)) if len(known) else np.nan


def _explained(deviations: FloatArray, about: FloatArray) -> float:
    size = np.linalg.norm(about)
    return float(1.0 - (np.linalg.norm(deviations) / size) ** 2) if size > 0.0 else np.nan


def one_term_fits(design: Design) -> list[Fit]:
    """The fit of each term alone, most significant first.

    The order by |T| is that by R^2 about zero: T^2 = (n - 1) R^2/(1 - R^2). AnalysisError if a
    column is zero at every observation.
    """
    return sorted([fit(design.take([i])) for i in range(design.k)], key=lambda single: single.sse)


def tabulate_terms(fit: Fit) -> pd.DataFrame:
    """One row for each term: ``name, coefficient, std_error, t_ratio, p_value``."""
    numbers = {"coefficient": fit.coefficients, "std_error": fit.std_errors, "t_ratio": fit.t_ratios}
    return pd.DataFrame({"name": fit.names, **numbers, "p_value": fit.p_values})


def tabulate_one_term_fits(design: Design) -> pd.DataFrame:
    """The fit of each term alone, most significant first."""
    rows = [(f.names[0], f.coefficients[0], f.t_ratios[0], f.rms_error, f.r_squared) for f in one_term_fits(design)]
    return pd.DataFrame(rows, columns=["name", "coefficient", "t_ratio", "rms_error", "r_squared"])


Form = Literal["velocity-power", "displacement-velocity-power"]


@dataclass(frozen=True)
class PowerLaw:
    """Power-law damping from resonances at several force levels (section 4.3): ln F_e = ln k + s ln A_m.

    The slope is the exponent: s = p for the force alpha |q'|^p sgn q' (4.3.3) and s = p + 1 for alpha |q| |q'|^p sgn q'
    (4.3.4). The coefficient of each level is alpha = beta F/(omega A)^p (4.3.9) or alpha = B F/(omega^p A^(p+1))
    (4.3.19). Intervals and standard errors of p are NaN without degrees of freedom.
    """

    form: Form  #: force name
    p: float  #: exponent of velocity
    std_error: float
    degrees_of_freedom: int  #: levels - 2
    level: float  #: content of the t interval
    p_low: float  #: low end of it
    p_high: float  #: high end
    factor: float  #: beta(p) or B(p)
    alphas: FloatArray  #: coefficient of each level (levels,)
    alpha: float  #: their mean
    std_error_alpha: float  #: standard deviation over the levels over sqrt(levels)
    log_k: float  #: of the line
    slope: float  #: of the line
    covariance: FloatArray  #: of these two, (2, 2)
    r_squared_centred: float  #: of ln F about its mean

    def amplitude(self, force: FloatArray | float) -> FloatArray:
        """Resonant amplitude (F/k)^(1/s) of the fitted line (4.3.25 with its root mended, erratum E4325)."""
        return np.exp((np.log(force) - self.log_k) / self.slope)

    def amplitude_interval(self, force: float) -> tuple[float, float]:
        """t interval of the line's amplitude at a force: d ln A = -(d ln k + ln A d s)/s, linearised."""
        log_a = float(np.log(self.amplitude(force)))
        gradient = np.array([1.0, log_a]) / self.slope
        error = float(np.sqrt(gradient @ self.covariance @ gradient))
        return float(np.exp(log_a - self.quantile * error)), float(np.exp(log_a + self.quantile * error))

    @property
    def quantile(self) -> float:
        """Student t quantile of the interval."""
        return float(stdtrit(self.degrees_of_freedom, 0.5 + 0.5 * self.level))


def fit_power_law(
    F: FloatArray, A: FloatArray, omega: FloatArray | float, form: Form = "velocity-power", level: float = 0.95
) -> PowerLaw:
    """Fit ``ln F`` on ``ln A``, resonant force and amplitude of each level, (levels,); ``omega`` in rad/s.

    AnalysisError: fewer than two different amplitudes.
    """
    from statsmodels.regression.linear_model import OLS  # noqa: PLC0415 - as above

    if len(np.unique(A)) < 2:
        raise AnalysisError("a power law needs at least two levels of different resonant amplitude")
    line = OLS(np.log(F), np.column_stack([np.ones(len(A)), np.log(A)])).fit(method="qr")
    log_k, slope = (float(v) for v in line.params)
    p = slope if form == "velocity-power" else slope - 1.0
    factor = float(beta(p) if form == "velocity-power" else B(p))
    alphas = factor * F / (omega**p * A**slope)
    freedom = len(F) - 2
    interval = line.conf_int(alpha=1.0 - level)[1] - slope if freedom > 0 else np.full(2, np.nan)
    return PowerLaw(
        form=form,
        p=p,
        std_error=float(line.bse[1]) if freedom > 0 else np.nan,
        degrees_of_freedom=freedom,
        level=level,
        p_low=p + float(interval[0]),
        p_high=p + float(interval[1]),
        factor=factor,
        alphas=np.asarray(alphas),
        alpha=float(np.mean(alphas)),
        std_error_alpha=float(np.std(alphas, ddof=1) / np.sqrt(len(alphas))),
        log_k=log_k,
        slope=slope,
        covariance=np.asarray(line.cov_params()) if freedom > 0 else np.full((2, 2), np.nan),
        r_squared_centred=float(line.rsquared),
    )
