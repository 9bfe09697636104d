"""Among sweeps of one row, the level off the trend of the others: an odd amplitude, or if there is none a frequency.

None is found where a joint may stick, slip or open: beyond the other levels only a factor of ``ISOLATED`` is odd.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.forces import damping_ratio
from damping.records.outliers import ISOLATED
from damping.records.runs import Run
from damping.records.text import per_cent

#: An amplitude between others is odd if it differs from their trend by a tenth. Of 7000 sets of 5 to 8 peaks of 15
#: structures, in and out of the library, with noise of .3 to 4 %, one in 200 has an odd level. Of sets with noise below
#: 2 % and one level 15 % too high or too low, 65 % do, and in all but one of 300 of these it is that level.
ODD = 1.1
#: A level whose force lies farther than this factor (ln) beyond the others cannot be judged by them.
FAR_LEVEL = log(3.0)
FEWEST_LEVELS = 4  #: fewest levels whose amplitudes define a line
FEWEST_COURSE = 5  #: fewest levels whose trend shows one off by ``ODD``
FEWEST_CURVED = 7  #: fewest levels whose trend may be a parabola
SPREAD = 0.05  #: least range of ln force or ln amplitude of levels that have a trend: of repeats it is their scatter
OF_OTHERS = 0.2  #: largest misfit of the other levels to their trend, over that of the odd level
#: One of two suspected levels is the odd one if the rest fits its trend this many times better without it than without
#: the other.
TELLING = 3.0
#: Least ln of a frequency beyond those of the neighbouring levels that is not scatter (six times .1 %).
OFF_FREQUENCY = 0.006
OFF_BANDWIDTH = 0.5  #: the same in damping ratios: a peak is read to a quarter of its bandwidth
#: The same for three levels, where only two others agree: a joint and a spring together bend a resonance that far.
OFF_OF_THREE = 0.05


@dataclass(frozen=True)
class OddLevel:
    """The ``quantity`` (amplitude or frequency) that is off, the suspected runs of one row (a single one if the others
    decide), and the deviation ``off`` (ln)."""

    quantity: str
    runs: tuple[Run, ...]
    off: float

    def __str__(self) -> str:
        frequency, way, size = self.quantity == "frequency", "high" if self.off > 0.0 else "low", abs(self.off)
        suspects = [
            f"{self.quantity} {run.omega[0] / RAD_S_PER_HZ if frequency else run.A[0]:g} "
            f"at row {run.rows[0] + 1} (force {run.F[0]:g}, sweep {run.sweep})"
            for run in self.runs
        ]
        course = f"is {np.exp(size):.3g} times too {way} for its force beside the other levels"
        if frequency:
            course = f"jumps there and returns, {per_cent(100.0 * np.expm1(size))} % too {way}"
        which = "" if len(suspects) == 1 else "; the levels do not show which of them is wrong"
        return f"{' or '.join(suspects)}: the {self.quantity} {course}{which}"


def find_odd_level(runs: Sequence[Run], mass: float, *, one_mass: bool) -> OddLevel | None:
    """The level whose amplitude does not fit its force, else whose frequency jumps and returns; None if there is none.

    ``mass`` of the mode (NaN: unknown) gives the width of the resonances. Frequencies are compared only if all rows
    have ``one_mass``; otherwise amplitudes are compared coarsely.
    """
    single = [run for run in runs if len(run) == 1]
    F, A, omega = (np.array([getattr(run, name)[0] for run in single]) for name in ("F", "A", "omega"))
    compared = {
        "amplitude": _compare_amplitudes(np.log(F), np.log(A), one_mass=one_mass),
        "frequency": _compare_frequencies(A, omega, damping_ratio(F, A, mass * omega**2)) if one_mass else {},
    }
    for quantity, misses in compared.items():
        share = {k: others / abs(off) for k, (off, others) in misses.items() if others < OF_OTHERS * abs(off)}
        if share:
            best = min(share, key=lambda k: share[k])
            runs = tuple(single[k] for k in share if share[k] <= TELLING * share[best])
            return OddLevel(quantity, runs, misses[best][0])
    return None


#: By position of each suspected level: its deviation from the trend of the others, and their largest deviation from it.
_Misses = dict[int, tuple[float, float]]


def _compare_amplitudes(x: FloatArray, y: FloatArray, *, one_mass: bool) -> _Misses:
    """Levels whose ln amplitude ``y`` is off the trend of the others against ln force ``x``, (n,).

    The trend is a line or, with more levels, a parabola. Beyond the other levels, or with several masses, only a
    deviation by the factor ``ISOLATED`` counts.
    """
    misses: _Misses = {}
    for k in _list_suspects(x, y) if len(x) >= FEWEST_LEVELS else ():
        others = np.arange(len(x)) != k
        low, high = x[others].min(), x[others].max()
        if not low - FAR_LEVEL < x[k] < high + FAR_LEVEL:
            continue  # friction sticks and joints open there: the trend of the others does not hold
        between = low < x[k] < high
        least = log(ODD if one_mass and between and len(x) >= FEWEST_COURSE else ISOLATED)
        degrees = (int(high - low > SPREAD), *((2,) if between and len(x) >= FEWEST_CURVED else ()))
        courses = (y - np.polyval(np.polyfit(x[others], y[others], degree), x) for degree in degrees)
        residual = min(courses, key=lambda r: np.abs(r[others]).max() / max(abs(r[k]), 1e-300))
        if abs(residual[k]) > least:
            misses[k] = float(residual[k]), float(np.abs(residual[others]).max())
    return misses


#: Share of a limit by which a level may miss it and still be a suspect: far more than the rounding of its deviation.
_ROUNDED = 1e-3
_ALONE = 1.0 - 1e-6  #: leverage from which the other levels hardly define the trend at a level


def _list_suspects(x: FloatArray, y: FloatArray) -> list[int]:
    """Positions of the levels that may be odd; no other is, and of thousands few are left to be fitted one by one.

    In a least-squares fit with the leverages h_ij, the fit without level k misses it by d = e_k/(1 - h_kk) and leaves
    e_i + h_ik d at level i (Cook & Weisberg, Residuals and Influence in Regression, 1982, 2.2). An odd level is off by
    ``ODD`` and by 1/`OF_OTHERS` times what is left at the level that is farthest off in the fit of all.
    """
    suspects = np.zeros(len(x), dtype=np.bool_)
    for degree in (0, 1, 2):
        U, size, _ = np.linalg.svd(np.vander(x - x.mean(), degree + 1) if degree else np.ones((len(x), 1)), False)
        U = U[:, size > len(x) * np.finfo(float).eps * size[0]]
        e, h = y - U @ (U.T @ y), np.sum(U**2, axis=1)
        off = np.divide(e, 1.0 - h, out=np.full_like(e, np.inf), where=h < _ALONE)
        worst = np.argsort(np.abs(e))[-2:]
        other = np.where(np.arange(len(x)) == worst[1], worst[0], worst[1])
        with np.errstate(invalid="ignore"):  # of a level alone, a suspect
            left = np.abs(e[other] + np.sum(U * U[other], axis=1) * off)
        odd = (np.abs(off) > (1.0 - _ROUNDED) * log(ODD)) & (left < (1.0 + _ROUNDED) * OF_OTHERS * np.abs(off))
        suspects |= odd | (h >= _ALONE)
    return np.flatnonzero(suspects).tolist()


def _compare_frequencies(A: FloatArray, omega: FloatArray, ratio: FloatArray) -> _Misses:
    """Levels whose frequency lies beyond those of the levels of next smaller and next larger amplitude.

    Joints and springs move a resonance steadily with amplitude. The lowest and the highest level are not judged: a
    joint may stick at the lowest alone, or slip or open at the highest alone. ``ratio``: damping ratios; all (n,).
    """
    if len(A) < FEWEST_LEVELS - 1:
        return {}
    order = np.argsort(A, kind="stable")
    x, y = np.log(A[order]), np.log(omega[order])
    scatter = OFF_FREQUENCY if len(x) >= FEWEST_LEVELS else OFF_OF_THREE
    least = max(scatter, float(np.nan_to_num(OFF_BANDWIDTH * np.median(ratio))))
    misses: _Misses = {}
    for k in range(1, len(x) - 1):
        beside, others = y[[k - 1, k + 1]], np.arange(len(x)) != k
        off = float(max(y[k] - beside.max(), 0.0) or min(y[k] - beside.min(), 0.0))
        if abs(off) > least:
            line = np.polyfit(x[others], y[others], 1 if len(x) >= FEWEST_LEVELS and np.ptp(x[others]) > SPREAD else 0)
            misses[int(order[k])] = off, float(np.abs(y - np.polyval(line, x))[others].max())
    return misses
