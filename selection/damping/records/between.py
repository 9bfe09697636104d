"""Resonance between the rows of a coarse sweep without phases.

Rows beside a resonance read |Y|^2 = (F/A)^2 = M^2 (omega_r^2 - omega^2)^2 + (C/A)^2. Where C grows as the power p of
amplitude, (C/A)^2 = (C/A)_r^2 (A/A_r)^(2 (p - 1)), and without the change of that term |Y|^2 is a parabola in omega^2
whose least value is (F/A)_r^2.
"""

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.records.runs import NO_PARABOLA, fit_parabola

#: A sweep is coarse if A/F falls by this factor from its largest value to a neighbouring row: between closer rows the
#: resonance is at most 0.7 % higher (an eighth of the rise of |Y|^2 from row to row, halved).
COARSE = 1.05
NEAR = 0.5  #: rows of at least this share of the largest A/F are fitted, and both neighbours of that row
POWERS = (0.0, 3.0)  #: powers p of amplitude: from friction to cubic damping
#: Relative error of A_r over ln of its rise above the largest reading: the power is only the mean of the levels, and
#: the resonance may be bent. Of 448 coarse sweeps of 16 laws, from which it was chosen, 15 % then err by more than 1.64
#: standard deviations (normal: 10 %), mostly joints; the mean error is 0, that of the largest readings -5 %.
ERROR_OF_RISE = 0.25
TELLING = 1.1  #: ratio of forces from which resonances show that power
_TURNS = 12  #: iterations for A_r, each of which leaves about half of the error
POWER_TURNS = 4  #: iterations for the power, which resonances of all sweeps show and by which they change


def find_between(
    force: FloatArray, frequency: FloatArray, amplitude: FloatArray, power: float = 1.0
) -> tuple[float, float, float] | None:
    """Force, frequency and amplitude of the resonance between the rows (n,) of a sweep, in any order.

    None if the largest amplitude is not between rows, if the sweep is not coarse, or if its rows are no such parabola.
    """
    order = np.argsort(frequency, kind="stable")
    F, f, A = force[order], frequency[order], amplitude[order]
    size, k = F / A, int(np.argmax(A))
    if k in (0, len(A) - 1) or size[k] > size.min() or max(size[k - 1], size[k + 1]) < COARSE * size[k]:
        return None
    near = size * NEAR <= size[k]
    near[k - 1 : k + 2] = True
    at, squared, least = RAD_S_PER_HZ * f[near], size[near] ** 2, size[k] ** 2
    driven, fitted = F[k], None
    for _ in range(_TURNS):
        straight = squared + least * (1.0 - (A[near] * np.sqrt(least) / driven) ** (2.0 * (power - 1.0)))
        if not straight.min() > 0.0 or (fitted := fit_parabola(at, np.sqrt(straight))) is None:
            return None
        resonance, least = fitted.resonance / RAD_S_PER_HZ, fitted.least
        if not (least > 0.0 and f[k - 1] < resonance < f[k + 1]):
            return None
        driven = float(np.interp(resonance, f, F))
    if fitted is None or np.median(np.abs(fitted.at(at) / straight - 1.0)) > NO_PARABOLA:
        return None
    return driven, resonance, driven / float(np.sqrt(least))


def estimate_power(force: FloatArray, amplitude: FloatArray) -> float:
    """Power of A that force grows with, by a line through resonances (n,), within ``POWERS``; 1 of one level."""
    x = np.log(force)
    per_force = float(np.polyfit(x, np.log(amplitude), 1)[0]) if np.ptp(x) > np.log(TELLING) else 1.0
    return float(np.clip(1.0 / per_force, *POWERS)) if per_force > 0.0 else POWERS[1]
