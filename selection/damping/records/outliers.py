"""Outliers: rows off their neighbours or out of order, and levels of one row off the trend of the others.

Each rule judges the runs as recorded, whatever the others find; an outlier is what any of them finds:
1. `_stands_alone`: an amplitude a factor above, or below, both its neighbours;
2. `_list_off_line`: with phases also a smaller step, of amplitude or phase alone, where the rows beside it move evenly;
3. `find_misplaced_rows`: a frequency that alone breaks the order of its sweep, of a response that does not;
4. `find_odd_level`: of sweeps of one row, which 1 to 3 leave out, an odd amplitude, or if there is none a frequency.
None is found where it may be a resonance, a jump, another branch (many rows by 1, or by 2), or friction at low force.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray, IntArray
from damping.forces import damping_ratio
from damping.records.record import Record
from damping.records.rows import order_taken
from damping.records.runs import FEWEST_ROWS, NO_PARABOLA, Run, fit_parabola
from damping.records.text import per_cent

ISOLATED = 3.0  #: an amplitude is an outlier if it differs from its neighbours by more than this factor
MOST_OUTLIERS = 0.05  #: largest share of outliers in a run: more such rows are another branch of the response
#: A row within this factor, in Y, of one of the three rows before or after it is on the same branch: no outlier.
SAME_BRANCH = 1.5


def find_isolated_rows(run: Run) -> list[int]:
    """Positions in the run of rows off their neighbours: by `_stands_alone`, and with phases by `_list_off_line`."""
    n = len(run)
    if n < 2 * FEWEST_ROWS:
        return []
    by_rule = [k for k in range(n) if _stands_alone(run, k)], _list_off_line(run)
    return [k for places in by_rule if len(places) <= max(1.0, MOST_OUTLIERS * n) for k in places]


#: Least deviation of a row with phase from the line through its neighbours: ln amplitude, and phase, rad;
OFF_LINE = ((0.25,), (0.5,))
OFF_LINE_NOISE = 12.0  #: and least deviation over the median deviation
BESIDE_OFF_LINE = 0.3  #: largest deviation of its other part, and of neighbouring rows, over that of an isolated row


def _list_off_line(run: Run) -> list[int]:
    """Positions in the run of isolated amplitudes or phases off the straight line through the neighbouring phasors Y.

    Along a resonance Y moves evenly, however few rows it has. At the end of a branch both rows at the jump are off; at
    a bend amplitude and phase are off together. If the recorded force departs from that of the neighbours by a factor,
    A/F may depart by as much: damping that grows as a power p of amplitude makes it F^(1/p - 1).
    """
    if run.phase is None or np.any(np.diff(run.omega) <= 0.0):
        return []

    def miss(kept: IntArray) -> ComplexArray:
        x, Y = run.omega[kept], run.stiffness[kept]
        share = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
        return np.log((Y[:-2] + share * (Y[2:] - Y[:-2])) / Y[1:-1])

    rows, all_off = np.arange(len(run)), miss(np.arange(len(run)))
    step = np.abs(0.5 * np.log(run.F[:-2] * run.F[2:]) - np.log(run.F[1:-1]))
    of_amplitude = np.maximum(np.abs(all_off.real) - step, 0.0)
    off, size = np.array([of_amplitude, np.abs(all_off.imag)]), np.abs(run.stiffness)
    steep = np.maximum(0.5 * (size[:-2] + size[2:]) / (size[1:-1] * np.exp(all_off.real)), 1.0)  # noise of larger Y
    least = np.maximum(OFF_LINE, OFF_LINE_NOISE * steep * np.median(off, axis=1, keepdims=True))
    far = (off > least) & (off[::-1] < BESIDE_OFF_LINE * off)
    places = (1 + np.flatnonzero(far.any(axis=0))).tolist()
    beside = {k: miss(np.delete(rows, k))[max(k - 3, 0) : k + 1] for k in places}
    return [k for k, missed in beside.items() if np.abs(missed).max() < BESIDE_OFF_LINE * off[:, k - 1].max()]


#: Largest difference of a low row's neighbours, ln A/F, over its fall below them: at a jump they differ by as much.
UNEVEN = 0.3


def _stands_alone(run: Run, k: int) -> bool:
    """Whether an amplitude is far from both neighbouring rows, off their branch, and no resonance, however high."""
    n, g = len(run), run.compliance
    beside = [m for m in (k - 1, k + 1) if 0 <= m < n]
    above, below = g[k] - max(g[beside]), min(g[beside]) - g[k]
    if max(above, below) < log(ISOLATED) or (below > 0.0 and np.ptp(g[beside]) > UNEVEN * below):
        return False
    near = np.array([m for m in range(max(0, k - 3), min(n, k + 4)) if m != k])
    if np.abs(np.log(run.stiffness[near] / run.stiffness[k])).min() < log(SAME_BRANCH):
        return False
    return above < 0.0 or not _may_resonate(run, k)


MOST_COARSE = 40  #: a sweep with more rows shows its resonance in more than one row


def _may_resonate(run: Run, k: int) -> bool:
    """Whether row ``k``, above its neighbours, may be the resonance: by its phase, else as the others rise to it."""
    rest = np.delete(np.arange(len(run)), k)
    if run.phase is not None:  # neighbours have similar damping, |Y| sin(phase); a reading too large makes it smaller
        damping = np.abs(run.stiffness.imag)
        near = rest[np.argsort(np.abs(rest - k), kind="stable")[:6]]
        return bool(damping[k] > np.median(damping[near]) / ISOLATED)
    if abs(int(np.argmax(run.compliance[rest])) - k) > 1 or len(rest) >= MOST_COARSE:
        return False
    size = run.F / run.A
    near = rest[np.argsort(size[rest], kind="stable")[:6]]
    fitted = fit_parabola(run.omega[near], size[near])
    if fitted is None:
        return True
    follows = fitted.misfit(run.omega[near], size[near] ** 2) < NO_PARABOLA + 2.0 * run.noise
    return not (follows and size[k] ** 2 * ISOLATED**2 < fitted.least)


FEWEST_IN_ORDER = 8  #: fewest rows of a sweep that have an order
#: Least departure, ln |Y|, of the reading of a misplaced row from the other rows at its stated frequency,
OUT_OF_PLACE = 0.25
OVER_ITS_PLACE = 5.0  #: and over its departure from its neighbours in the order taken
OF_JUMP = 0.5  #: share of that departure in a single step from row to row from which on the sweep jumps
#: Rows tried in a sweep: one mistyped frequency breaks the order at two places, three rows each, with some to spare.
_MOST_TRIED = 9


def find_misplaced_rows(record: Record) -> dict[int, str]:
    """Positions of rows with a mistyped frequency, and their sweeps; at most one row in a sweep.

    Without that row the frequencies of the sweep rise or fall throughout. Its Y = F exp(i phase)/A lies between those
    of the rows before and after it, and far from those of the rows at its stated frequency, so that it is no point that
    was taken again; nor one that was taken again after a jump, on the branch of the rows before and after it.
    """
    found, time = dict[int, str](), order_taken(record)
    for sweep, rows in record.frame.groupby("sweep", sort=False).indices.items():
        taken = np.asarray(rows)[np.argsort(time[rows], kind="stable")]
        f = record.column("frequency")[taken]
        if len(taken) >= FEWEST_IN_ORDER and not _is_monotone(f):
            phase = record.column("phase")[taken] if record.has_phase else np.zeros(len(taken))
            Y = record.column("force")[taken] / record.column("amplitude")[taken] * np.exp(1j * phase)
            breaks = np.flatnonzero(np.diff(np.sign(np.diff(f))))
            near = np.unique((breaks[:, np.newaxis] + np.arange(3)).clip(1, len(f) - 2))[:_MOST_TRIED]
            found |= {int(taken[k]): str(sweep) for k in near if _is_misplaced(f, Y, int(k))}
    return found


def _is_monotone(f: FloatArray) -> bool:
    step = np.diff(f)
    return bool(np.all(step >= 0.0) or np.all(step <= 0.0))


def _is_misplaced(f: FloatArray, Y: ComplexArray, k: int) -> bool:
    """Whether row ``k`` of a sweep (f, Y in the order taken) belongs to its place and not to its frequency."""
    if not _is_monotone(np.delete(f, k)):
        return False
    order: IntArray = np.argsort(np.delete(f, k), kind="stable")
    g, there = np.delete(f, k)[order], np.delete(Y, k)[order]
    stated = np.interp(f[k], g, there.real) + 1j * np.interp(f[k], g, there.imag)
    off, off_place = (abs(np.log(Y[k] / value)) for value in (stated, 0.5 * (Y[k - 1] + Y[k + 1])))
    jumps, step = np.abs(np.log(there[1:] / there[:-1])).max() > OF_JUMP * off, f[k + 1] - f[k - 1]
    if jumps and step != 0.0:  # the line through its neighbours at its stated frequency: the branch after the jump
        onward = Y[k - 1] + (Y[k + 1] - Y[k - 1]) * (f[k] - f[k - 1]) / step
        off = min(off, abs(np.log(Y[k] / onward)))
    return bool(off > max(OUT_OF_PLACE, OVER_ITS_PLACE * off_place))


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
