"""Checks of copies: readings that repeat others to the last digit, sweep by sweep or row by row."""

from collections.abc import Iterator, Sequence

import numpy as np

from damping.arrays import RAD_S_PER_HZ
from damping.records.check_ceiling import count_digits, find_resolution
from damping.records.runs import FEWEST_ROWS, Run, fit_parabola, slide_median
from damping.records.view import Finding, View, label_sweeps


def check_repeats(view: View) -> Finding | None:
    """A sweep that repeats another one, or a multiple of it, to the last digit: noise never repeats itself."""
    copies: list[tuple[Run, Run, float]] = []
    marks = np.array([_mark(run) for run in view.raw])
    by_frequency = np.argsort(marks[:, 1], kind="stable")  # of thousands of runs few have a frequency
    edges = np.searchsorted(marks[by_frequency, 1], marks[:, 1, np.newaxis] + 2.0 * _MARKED[1] * np.array([-1.0, 1.0]))
    for k, (second, (low, high)) in enumerate(zip(view.raw, edges.tolist(), strict=True)):
        near = np.sort(by_frequency[low:high])
        near = near[near < k]
        for i in near[(np.abs(marks[near] - marks[k]) <= _MARKED).all(axis=1)].tolist():
            first = view.raw[i]
            factor = _find_factor(first, second)
            if factor is not None and first.sweep != second.sweep:
                copies.append((first, second, factor))
                break
    if not copies:
        return None
    first, second, factor = copies[0]
    scaled = "" if abs(factor - 1.0) < 1e-9 else f" times {factor:.4g}"
    what = f"sweep {second.sweep} repeats sweep {first.sweep}{scaled} to the last digit, as no measurement does"
    advice = "leave the copy out: its rows would count twice"
    return Finding("repeated-sweep", "caution", what, advice, label_sweeps(copy for _, copy, _ in copies))


COPY = 2e-4  #: proportional rows are a copy if their ratio is constant to this share: six digits, rounded,
NOISE_OF_COPY = 5.0  #: and if the noise of their rows exceeds that by this factor
#: Differences of marks beyond which two runs are no copies: wider than the tolerances of `_find_factor`.
_MARKED = (0.0, 1e-8, 1e-8, 2.0 * COPY)


def _mark(run: Run) -> tuple[float, float, float, float]:
    """Numbers that copies share, so that most pairs of many runs need no comparison of their rows."""
    phase = 0.0 if run.phase is None else float(run.phase[0])
    size = float(run.A[0]) if len(run) >= FEWEST_ROWS else 1.0  # a longer copy may be scaled
    return float(len(run)), float(np.log(run.omega[0])), phase, float(np.log(run.A[-1] / size))


def _find_factor(first: Run, second: Run) -> float | None:
    """The constant factor between the amplitudes of two runs; None if they are not copies."""
    if len(first) != len(second) or not np.allclose(first.omega, second.omega, rtol=1e-9, atol=0.0):
        return None
    if first.phase is not None and (
        second.phase is None or not np.allclose(first.phase, second.phase, rtol=0.0, atol=1e-9)
    ):
        return None
    same = np.allclose(first.A, second.A, rtol=1e-12, atol=0.0)
    if len(first) < FEWEST_ROWS:
        return 1.0 if same and np.allclose(first.F, second.F, rtol=1e-12, atol=0.0) else None
    ratio = np.log(second.A / first.A)
    noisy = min(first.noise, _measure_misfit(first)) > NOISE_OF_COPY * COPY
    scaled = noisy and np.ptp(np.log(second.F / first.F)) <= COPY and np.ptp(ratio) < COPY
    return 1.0 if same else float(np.exp(np.median(ratio))) if scaled else None


def _measure_misfit(run: Run) -> float:
    """Median misfit of |Y|^2 by a parabola in omega^2, which computed rows of a linear mode follow."""
    size = run.F / run.A
    fitted = fit_parabola(run.omega, size)
    return np.inf if fitted is None else fitted.misfit(run.omega, size**2)


#: Fewest successive rows that repeat others, with and without phases: fewer may agree by chance.
FEWEST_COPIED = (4, 6)
#: Least change of amplitude from row to row, in units of its last digit, at which agreement to that digit is no chance.
LEAST_STEP = 5.0


def check_copied_rows(view: View) -> Finding | None:
    """Successive rows of a sweep that hold one reading while the frequency moves, or repeat rows elsewhere."""
    if _holds_one_reading(view):
        what = f"every amplitude is {view.raw[0].A[0]:g} to the last digit, whatever the force or the lag"
        advice = "does the channel hold its last value, or is another column read? check it, and run again"
        return Finding("repeated-sweep", "refuse", what, advice, view.record.sweeps)
    held = [(run, *block) for run in view.raw for block in _find_held_rows(run)]
    if held:
        run, first, last = held[0]
        what = f"the readings of {_name_rows(run, first, last)} are one to the last digit while the frequency moves"
        advice = "does the instrument hold its last value? keep the first of these rows, or run again"
        return Finding("repeated-sweep", "caution", what, advice, label_sweeps(block[0] for block in held))
    pasted = next(_find_pasted_rows(view.raw), None)
    if pasted is None:
        return None
    (run, first, last), (other, start) = pasted
    what = f"{_name_rows(run, first, last)} repeat {_name_rows(other, start, start + last - first)} to the last digit, "
    advice = "one of the two was not measured there: leave it out, or run again"
    return Finding("repeated-sweep", "caution", f"{what}as no measurement does", advice, label_sweeps((other, run)))


#: Amplitudes of any mode differ where the lag turns by this, rad (from resonance on, by 30 %),
TURNED = 0.25 * np.pi
#: or where the force of single rows differs by this factor, unless readings of one digit hide it.
FORCED = 2.0
STEADY = 1.12  #: largest ratio of forces within a sweep whose response is not held by a controller


def _holds_one_reading(view: View) -> bool:
    """Whether all amplitudes are one number, though the lags or the forces of single rows must have changed them."""
    A, F = view.record.column("amplitude"), view.record.column("force")
    if len(A) < FEWEST_ROWS or np.ptp(A) > 0.0:
        return False
    swept = [run for run in view.raw if len(run) > 1]
    if not swept:
        return bool(F.max() > FORCED * F.min()) and count_digits(A[:1]) > 1
    return all(
        run.phase is not None and np.ptp(run.phase) > TURNED and run.F.max() < STEADY * run.F.min() for run in swept
    )


def _name_rows(run: Run, first: int, last: int) -> str:
    low, high = run.omega[[first, last]] / RAD_S_PER_HZ
    return f"{last - first + 1} rows of sweep {run.sweep} ({low:.5g} to {high:.5g} Hz)"


def _find_held_rows(run: Run) -> Iterator[tuple[int, int]]:
    """First and last positions of rows of one reading, if the reading jumps beside them by more than their number times
    ``LEAST_STEP``.

    Without phases the largest reading of a run is left to the check of the ceiling.
    """
    if len(run) < FEWEST_ROWS:
        return
    same = (np.diff(run.A) == 0.0) & (np.diff(run.omega) > 0.0)
    same &= True if run.phase is None else np.diff(run.phase) == 0.0
    least = LEAST_STEP * find_resolution(run.A)
    ends = np.flatnonzero(np.diff(same.astype(int), prepend=0, append=0)).reshape(-1, 2)
    for first, last in ends.tolist():
        beside = run.A[[k for k in (first - 1, last + 1) if 0 <= k < len(run)]]
        jump, rows = float(np.abs(beside - run.A[first]).max(initial=0.0)), last - first + 1
        top = run.phase is None and run.A[first] == run.A.max()
        if rows >= FEWEST_COPIED[run.phase is None] and jump > rows * least and not top:
            yield first, last


def _find_pasted_rows(runs: Sequence[Run]) -> Iterator[tuple[tuple[Run, int, int], tuple[Run, int]]]:
    """Run, first and last position of rows that repeat earlier ones, at another frequency or force, and those."""
    seen: dict[bytes, list[tuple[Run, int]]] = {}
    for run in runs:
        readings = np.column_stack([run.A] if run.phase is None else [run.A, run.phase])
        size, least = FEWEST_COPIED[run.phase is None], LEAST_STEP * find_resolution(run.A)
        moves = slide_median(np.abs(np.diff(run.A)), size - 1) >= least if len(run) >= size else np.empty(0)
        for k in np.flatnonzero(moves).tolist():
            earlier = seen.setdefault(readings[k : k + size].tobytes(), [])
            for other, start in earlier:
                copied = other is run or _find_factor(other, run) is None  # else a copy of the whole sweep
                if copied and _expect_change(run, k, other, start, size) >= least:
                    last = k + size - 1
                    while _is_one_reading(run, last + 1, other, start + last + 1 - k):
                        last += 1
                    yield (run, k, last), (other, start)
            earlier.append((run, k))


def _expect_change(run: Run, k: int, other: Run, start: int, size: int) -> float:
    """Change of amplitude, to first order, by which rows differ from others of another frequency or force.

    It is less than the last digit where a level is run again, by a test or in a computation.
    """
    here, there = slice(k, k + size), slice(start, start + size)
    slope = np.median(np.abs(np.diff(run.A[here]))) / max(np.median(np.diff(run.omega[here])), 1e-300)
    by_force = run.A[here] * np.abs(np.log(run.F[here] / other.F[there]))
    return float(np.median(slope * np.abs(run.omega[here] - other.omega[there]) + by_force))


def _is_one_reading(run: Run, k: int, other: Run, m: int) -> bool:
    if k >= len(run) or m >= len(other) or run.A[k] != other.A[m]:
        return False
    return run.phase is None or (other.phase is not None and bool(run.phase[k] == other.phase[m]))
