"""Power-law damping from resonances at several force levels (section 4.3).

``ln F_e = ln k + s ln A_m`` over the levels. The slope is the exponent: s = p for the force alpha |q'|^p sgn q'
(4.3.3) and s = p + 1 for alpha |q| |q'|^p sgn q' (4.3.4). The coefficient of each level is
alpha = beta F/(omega A)^p (4.3.9) or alpha = B F/(omega^p A^(p+1)) (4.3.19).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from statsmodels.regression.linear_model import OLS
from statsmodels.tools.tools import add_constant

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.forces.powers import B, beta

Form = Literal["velocity-power", "displacement-velocity-power"]


@dataclass(frozen=True)
class PowerLaw:
    """A power-law damping force from force levels.

    Attributes:
        form: force name. p: exponent of velocity; std_error of it. degrees_of_freedom: levels - 2.
        p_low, p_high: t interval of ``level``; NaN without degrees of freedom. factor: beta(p) or B(p).
        alphas: coefficient of each level (levels,); alpha: their mean, std_error_alpha: standard deviation over the
            levels over sqrt(levels). log_k, slope: of the line; covariance of (log_k, slope), (2, 2).
        r_squared_centred: of ln F about its mean.
    """

    form: Form
    p: float
    std_error: float
    degrees_of_freedom: int
    level: float
    p_low: float
    p_high: float
    factor: float
    alphas: FloatArray
    alpha: float
    std_error_alpha: float
    log_k: float
    slope: float
    covariance: FloatArray
    r_squared_centred: float

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
        from scipy.stats import t  # noqa: PLC0415 - scipy.stats takes half a second to import

        return float(t.ppf(0.5 + 0.5 * self.level, self.degrees_of_freedom))


def fit_power_law(
    F: FloatArray, A: FloatArray, omega: FloatArray | float, form: Form = "velocity-power", level: float = 0.95
) -> PowerLaw:
    """Fit ``ln F`` on ``ln A``.

    Args:
        F, A: resonant force and amplitude of each level, (levels,). omega: rad/s, one or one for each level.

    Raises:
        AnalysisError: fewer than two different amplitudes.
    """
    if len(np.unique(A)) < 2:
        raise AnalysisError("a power law needs at least two levels of different resonant amplitude")
    line = OLS(np.log(F), add_constant(np.log(A))).fit(method="qr")
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
