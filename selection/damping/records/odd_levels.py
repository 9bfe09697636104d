"""Among levels of one row, peaks alone: the one that is off the course of the others, in amplitude or in frequency."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.records.runs import Run

WILD = 3.0  #: an amplitude is wild where its neighbours say less than a third or more than three times as much
#: An amplitude between others is odd where their course says a tenth less or more. Of 7000 sets of 5 to 8 peaks of 15
#: structures, in and out of the library, with noise of .3 to 4 %, one in 200 has such a one; of those with noise below
#: 2 % and 15 % too much or too little in one level 65 % do, and in all but one of 300 of these it is that level.
ODD = 1.1
#: A level whose force lies farther than this factor (ln) beyond the others cannot be judged by them.
FAR_LEVEL = log(3.0)
FEWEST_LEVELS = 4  #: amplitudes of fewer levels lie on no line that one of them could be off
FEWEST_COURSE = 5  #: levels whose course shows one that is odd ...
FEWEST_CURVED = 7  #: ... and whose course may be a parabola
#: What the other levels miss of their own course, over what the odd one misses of it, at most.
OF_OTHERS = 0.2
#: One of two suspected levels is the odd one where the rest misses its course this many times less without it than
#: without the other.
TELLING = 3.0
#: Least ln of a frequency beyond those of the levels beside it that is no scatter (six times .1 %).
OFF_FREQUENCY = 0.006
#: The same in damping ratios: a peak is read to a quarter of its bandwidth.
OFF_BANDWIDTH = 0.5
#: The same of three levels, of which only two others agree: a joint and a spring together bend a resonance that far.
OFF_OF_THREE = 0.05


@dataclass(frozen=True)
class OddLevel:
    """The ``quantity`` (amplitude or frequency) that is off, the runs of one row that it may be, one where the others
    tell which, and by how much (ln)."""

    quantity: str
    runs: tuple[Run, ...]
    off: float

    def __str__(self) -> str:
        frequency, way, size = self.quantity == "frequency", "high" if self.off > 0.0 else "low", abs(self.off)
        told = [
            f"{self.quantity} {run.omega[0] / RAD_S_PER_HZ if frequency else run.A[0]:g} "
            f"at row {run.rows[0] + 1} (force {run.F[0]:g}, sweep {run.sweep})"
            for run in self.runs
        ]
        course = f"is {np.exp(size):.3g} times too {way} for its force beside the other levels"
        if frequency:
            course = f"jumps there and returns, {100.0 * np.expm1(size):.2g} % too {way}"
        which = "" if len(told) == 1 else "; the levels do not show which of them is wrong"
        return f"{' or '.join(told)}: the {self.quantity} {course}{which}"


def find_odd_level(runs: Sequence[Run], mass: float, *, one_mass: bool) -> OddLevel | None:
    """The level whose amplitude does not go with its force, else whose frequency jumps and returns.

    ``mass`` of the mode (NaN: not known) tells how wide the resonances are; frequencies are compared where all rows are
    of ``one_mass``, and amplitudes closely only there.
    """
    single = [run for run in runs if len(run) == 1]
    F, A, omega = (np.array([getattr(run, name)[0] for run in single]) for name in ("F", "A", "omega"))
    compared = {
        "amplitude": _compare_amplitudes(np.log(F), np.log(A), one_mass=one_mass),
        "frequency": _compare_frequencies(A, omega, F / (2.0 * mass * omega**2 * A)) if one_mass else {},
    }
    for quantity, misses in compared.items():
        share = {k: others / abs(off) for k, (off, others) in misses.items() if others < OF_OTHERS * abs(off)}
        if share:
            best = min(share, key=lambda k: share[k])
            runs = tuple(single[k] for k in share if share[k] <= TELLING * share[best])
            return OddLevel(quantity, runs, misses[best][0])
    return None


#: Of each level that may be off (its place): how far it is off the course of the others, and these off their own.
_Misses = dict[int, tuple[float, float]]


def _compare_amplitudes(x: FloatArray, y: FloatArray, *, one_mass: bool) -> _Misses:
    """Levels whose ln amplitude ``y`` is off the course of the others against ln force ``x``, (n,).

    That is a line or, of more levels, a parabola. Beyond the other levels, or of other masses, it says no more than a
    factor.
    """
    misses: _Misses = {}
    for k in range(len(x) if len(x) >= FEWEST_LEVELS else 0):
        others = np.arange(len(x)) != k
        low, high = x[others].min(), x[others].max()
        if not low - FAR_LEVEL < x[k] < high + FAR_LEVEL:
            continue  # far beyond the other levels friction sticks and joints open: their line says nothing there
        between = low < x[k] < high
        least = log(ODD if one_mass and between and len(x) >= FEWEST_COURSE else WILD)
        degrees = (int(high - low > 0.05), *((2,) if between and len(x) >= FEWEST_CURVED else ()))
        courses = (y - np.polyval(np.polyfit(x[others], y[others], degree), x) for degree in degrees)
        left = min(courses, key=lambda left: np.abs(left[others]).max() / max(abs(left[k]), 1e-300))
        if abs(left[k]) > least:
            misses[k] = float(left[k]), float(np.abs(left[others]).max())
    return misses


def _compare_frequencies(A: FloatArray, omega: FloatArray, ratio: FloatArray) -> _Misses:
    """Levels whose frequency lies beyond those of the levels of next less and next more amplitude.

    Joints and springs move a resonance steadily with amplitude; the lowest and the highest level are not judged, since
    a joint that sticks at the one, slips or opens at the other moves that one alone. ``ratio``:
    damping ratios; all (n,).
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
            line = np.polyfit(x[others], y[others], 1 if len(x) >= FEWEST_LEVELS and np.ptp(x[others]) > 0.05 else 0)
            misses[int(order[k])] = off, float(np.abs(y - np.polyval(line, x))[others].max())
    return misses
