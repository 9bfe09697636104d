"""The gamma-function factors of section 4.3."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from scipy.special import gammaln

from selection.arrays import Floats


def gamma_ratio(x: Floats, y: Floats) -> Floats:
    """Gamma(x)/Gamma(y) for positive arguments, without overflow."""
    return np.exp(gammaln(x) - gammaln(y))


def velocity_power_energy(p: Floats) -> Floats:
    """2 sqrt(pi) Gamma((p+2)/2)/Gamma((p+3)/2): the energy of Eq 4.3.6 over alpha A^(p+1) omega^p."""
    return 2.0 * sqrt(pi) * gamma_ratio((p + 2.0) / 2.0, (p + 3.0) / 2.0)


def displacement_velocity_power_energy(p: Floats) -> Floats:
    """2 Gamma((p+2)/2)/Gamma((p+4)/2) = 4/(p+2): the energy of Eq 4.3.7 over alpha A^(p+2) omega^p."""
    return 2.0 * gamma_ratio((p + 2.0) / 2.0, (p + 4.0) / 2.0)


def beta(p: Floats) -> Floats:
    """(sqrt(pi)/2) Gamma((p+3)/2)/Gamma((p+2)/2), Eq 4.3.8: at resonance alpha = beta F/(omega A)^p (4.3.9)."""
    return 0.5 * sqrt(pi) * gamma_ratio((p + 3.0) / 2.0, (p + 2.0) / 2.0)


def B(p: Floats) -> Floats:
    """(pi/2) Gamma((p+4)/2)/Gamma((p+2)/2), Eq 4.3.18: at resonance alpha = B F/(omega^p A^(p+1)) (4.3.19)."""
    return 0.5 * pi * gamma_ratio((p + 4.0) / 2.0, (p + 2.0) / 2.0)
