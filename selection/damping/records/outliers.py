"""Outliers of a sweep: rows off their neighbours or out of order. Sweeps of one row are left to `odd_levels`.

Each rule judges the runs as recorded, whatever the others find; an outlier is what any of them finds:
1. `_stands_alone`: an amplitude a factor above, or below, both its neighbours;
2. `_list_off_line`: with phases also a smaller step, of amplitude or phase alone, where the rows beside it move evenly;
3. `find_transitions`: a row on neither branch of a jump;
4. `find_misplaced_rows`: a frequency that alone breaks the order of its sweep, of a response that does not.
None is found where it may be a resonance, an antiresonance, or another branch (many rows by one rule).
"""

from math import log

import numpy as np

from damping.arrays import ComplexArray, FloatArray, IntArray
from damping.records.record import Record
from damping.records.resonance import find_transitions
from damping.records.rows import order_taken
from damping.records.runs import FEWEST_ROWS, NO_PARABOLA, Run, fit_parabola

ISOLATED = 3.0  #: an amplitude is an outlier if it differs from its neighbours by more than this factor
MOST_OUTLIERS = 0.05  #: largest share of outliers in a run: more such rows are another branch of the response
#: A row within this factor, in Y, of one of the three rows before or after it is on the same branch: no outlier.
SAME_BRANCH = 1.5


def find_isolated_rows(run: Run) -> list[int]:
    """Positions in the run of rows off their neighbours, by the first three rules; the last two need phases."""
    n = len(run)
    if n < 2 * FEWEST_ROWS:
        return []
    by_rule = [k for k in range(n) if _stands_alone(run, k)], _list_off_line(run), _list_in_transition(run)
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


#: A row in transition is within this factor, in A/F, of the lower of its neighbours; at an antiresonance it is below.
LOWER_BRANCH = 1.5


def _list_in_transition(run: Run) -> list[int]:
    """Positions in the run of rows on the lower branch of a jump whose phase has not settled."""
    if run.phase is None:
        return []
    places = np.flatnonzero(find_transitions(run.F, run.A, run.phase)).tolist()
    g = run.compliance
    return [k for k in places if min(g[k - 1], g[k + 1]) - g[k] < log(LOWER_BRANCH)]


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
