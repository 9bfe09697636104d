"""Clipped readings: a sensor, an amplifier or a range at its limit, so that amplitudes are too small.

In a record clipping shows by the phases or by a flat top. A signal in time spends little time near its largest value:
of a quantised sine the last step holds some 2.4 times the samples of the step before, whatever the resolution, since
the time above 1 - e goes as sqrt(e). A clipped signal returns to its largest value again and again and holds it, so
that it has many times the samples of the value before. A value held once, as before a release, is no limit. Not found:
a gain that falls off before the limit, clipping before noise is added, and, with fewer than some 1000 steps, clipping
of a decay, whose later peaks pass the value before.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from math import isclose, log

import numpy as np

from damping.arrays import FloatArray
from damping.records.implied import Implied, Leg
from damping.records.runs import Run, fit_parabola
from damping.records.view import Finding, View, label_sweeps, name_sweeps

TOP = 0.9  #: readings above this share of the largest of a sweep are near a possible ceiling
WINGS = 0.6  #: readings below this share are in the wings, and are not clipped
FEWEST_PAIRS = 2  #: fewest pairs of rows near the ceiling, to exclude chance
FEWEST_BESIDE = 3  #: fewest pairs in the wings, for their median
KNOWN = 0.15  #: largest relative error of the mass of a pair of rows that is used
LEAST_NOISE = 0.003  #: least relative noise of a row: phases are read to this, rad, even if amplitudes are smoother
CLIPPED = 1.1  #: readings are clipped if the mass near the ceiling exceeds that in the wings by this factor,
ERRORS = 4.5  #: and by this many standard errors,
#: and if sweeps whose largest reading is below this share of the ceiling
FAR_BELOW = 0.75
#: have less than this share of the excess (ln): a falling force or a neighbouring mode affects all levels equally.
OF_LOWER = 0.35


TOGETHER = 1_000_000  #: samples of a signal that are looked at together, so that it needs no memory of its size


@dataclass(frozen=True)
class Excess:
    """Mass near the top of a run over that in its wings, and its relative standard error."""

    run: Run
    factor: float
    error: float

    @property
    def top(self) -> float:
        """Largest reading of the run."""
        return float(self.run.A.max())


def check_ceiling(view: View) -> Finding | None:
    """Readings that are clipped or compressed near the largest.

    With phases: two rows of equal amplitude on either side of resonance imply the mass, whatever the damping and the
    spring; readings too small by a factor imply a mass too large by it. Without: the top is flatter than the mass
    allows.
    """
    measured = [excess for leg in view.legs if (excess := _measure_excess(leg)) is not None]
    clipped = [excess for excess in measured if excess.factor > CLIPPED and excess.factor - 1.0 > ERRORS * excess.error]
    if clipped:
        highest = max(clipped, key=lambda excess: excess.top)
        lower = [excess for excess in measured if excess.top < FAR_BELOW * highest.top]
        only = all(log(excess.factor) < OF_LOWER * log(highest.factor) for excess in lower)
        if only and highest.top == max(excess.top for excess in measured):
            near_top = [excess for excess in clipped if excess.top >= FAR_BELOW * highest.top]
            return _report_excess(near_top, highest, alone=not lower)
    flat = [run for run in view.runs if _is_flat(run)]
    return _report_flat_tops(flat) if flat else None


def _report_excess(clipped: list[Excess], highest: Excess, alone: bool) -> Finding:
    sweeps = label_sweeps(excess.run for excess in clipped)
    what = f"the largest readings of {name_sweeps(sweeps)}, from {TOP * highest.top:.3g} on, "
    what += f"imply {highest.factor:.3g} times the mass that its smaller ones "
    what += f"{'do' if alone else 'and lower levels do'}: they are too small"
    advice = "does the sensor, its amplifier or its range clip them? or does the force fall at resonance, unrecorded"
    advice += ", or a mode stands beside" if alone else ""
    return Finding("sensor-saturation", "caution", what, advice, sweeps)


def _measure_excess(leg: Leg) -> Excess | None:
    """The excess of a run; None without phases, or with too few pairs of rows near its top or in its wings."""
    if leg.turn is None or leg.lag is None or not leg.turn.both_sides:
        return None
    A, mass, error = _pair_masses(leg.run, leg.turn)
    top, wings = (A > TOP) & (error < KNOWN), (A < WINGS) & (error < KNOWN)
    if top.sum() < FEWEST_PAIRS or wings.sum() < FEWEST_BESIDE:
        return None
    factor = float(np.mean(mass[top]) / np.median(mass[wings]))
    return Excess(leg.run, factor, float(np.sqrt(np.sum(error[top] ** 2)) / top.sum()))


def _pair_masses(run: Run, turn: Implied) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Amplitude over the largest, mass, and relative error of the mass, (n,), of pairs across resonance.

    A pair is a row and the point of equal amplitude on the other side. There Y is interpolated in ln A between rows, so
    that a nonlinear spring has no effect.
    """
    Y, x, top = run.stiffness * np.exp(-1j * turn.offset), np.log(run.A), run.omega[np.argmax(run.compliance)]
    sides = np.flatnonzero(run.omega < top), np.flatnonzero(run.omega > top)
    pairs = []
    for rows, other in (sides, sides[::-1]):
        other = other[np.argsort(x[other], kind="stable")]
        if len(other) < FEWEST_PAIRS:
            continue
        rows = rows[(x[rows] >= x[other[0]]) & (x[rows] <= x[other[-1]])]
        rise = Y.real[rows] - np.interp(x[rows], x[other], Y.real[other])
        apart = np.interp(x[rows], x[other], run.omega[other] ** 2) - run.omega[rows] ** 2
        error = 2.0**0.5 * max(run.noise, LEAST_NOISE) * np.abs(Y[rows]) / np.maximum(np.abs(rise), 1e-300)
        pairs.append((np.exp(x[rows] - x.max()), rise / apart, error))
    A, mass, error = (np.concatenate(parts) for parts in zip(*pairs, strict=True)) if pairs else np.empty((3, 0))
    return A, mass, error


FLAT = 0.01  #: rows beside the largest reading and within this share of it are its top
FEWEST_FLAT = 4  #: fewest rows of a flat top; a table with few digits can have three
#: Largest power of A in C(A). |Y|^2 = C^2/A^2 + M^2 (omega_n^2 - omega^2)^2 rises from the middle of the top to its
#: ends by at most twice this power times the fall of A (relative): no damping explains a smaller fall.
STEEPEST = 10.0
STEADY = 0.05  #: a force that varies by more, relative, belongs to a sweep with controlled response
DIGITS = 6  #: a table of this many digits or more is rounded to less than any noise
ROUNDED = 1e-12  #: relative difference of readings that arithmetic leaves: some 1e-16 for each change of unit
LAST_DIGIT = 10.0 ** (1 - DIGITS)  #: amplitudes of complex values of that many digits agree to this
FEW_DIGITS = (10, 100)  #: first number of two and of three digits: a top of four rows rarely is one in four digits
MOST_READ = (
    2000  #: largest readings that are looked at, so that dense sweeps take no longer: three digits have 900 a decade
)
BY_CHANCE = 1e-6  #: largest chance that arbitrary readings are multiples of some step
SMOOTH = 1.5  #: a top is round if rows within four times a distance below it exceed those within it by this: parabola 2
AS_LINEAR = 0.1  #: largest misfit of the wings by a parabola, and its largest shortfall at the top: a mode, not a stop


def _is_flat(run: Run) -> bool:
    """Whether readings stand at one ceiling where the wings' parabola of |Y|^2 in omega^2 predicts larger readings."""
    top = int(np.argmax(run.A))
    below = np.flatnonzero(np.log(run.A[top] / run.A) > FLAT)
    first, last = int(below[below < top].max(initial=-1)) + 1, int(below[below > top].min(initial=len(run)))
    flat, wings = slice(first, last), WINGS * run.A[top] > run.A
    beside = min(int(wings[:first].sum()), int(wings[last:].sum()))
    if last - first < FEWEST_FLAT or np.ptp(np.log(run.F)) > STEADY:
        return False
    if find_ceiling(run.A, run.F) is not None:
        return True
    if beside < FEWEST_BESIDE:
        return False
    fitted = fit_parabola(run.omega[wings], (run.F / run.A)[wings])
    if fitted is None:
        return False
    share = fitted.at(run.omega) * (run.A / run.F) ** 2  # |Y|^2 of the wings' mode over that of the row
    fallen = max(float(np.ptp(np.log(run.A[flat]))), find_resolution(run.A) / float(run.A[top]))
    risen = float(
        fitted.a * (0.5 * np.ptp(fitted.place(run.omega[flat]))) ** 2 * (run.A[top] / np.mean(run.F[flat])) ** 2
    )
    linear = np.median(np.abs(share[wings] - 1.0)) < AS_LINEAR and bool(np.all(share[flat] < 1.0 + AS_LINEAR))
    return bool(linear and risen > 2.0 * STEEPEST * fallen)


def find_ceiling(written: FloatArray, F: FloatArray, *, per_force: bool = False) -> float | None:
    """The value at which amplitudes of a sweep stand under a steady force F (n,); None if there is none.

    Four measurements do not agree to the last digit by chance. A smooth top has twice as many rows within four times
    the distance below its largest. A response held by its controller has a falling force. ``written``: the amplitudes
    as a table has them (n,), if ``per_force`` over F.
    """
    A = written * F if per_force else written
    top = float(A.max(initial=0.0))
    below = 1.0 - A / top if top > 0.0 else np.zeros(len(A))
    step = max(LAST_DIGIT, find_resolution(A) / top) if top > 0.0 else LAST_DIGIT
    near, beside = below <= step, int(np.sum(below <= 4.0 * step))
    if near.sum() < FEWEST_FLAT or np.sum(below > FLAT) < FEWEST_BESIDE or beside >= SMOOTH * near.sum():
        return None
    steady = np.ptp(F[near]) <= STEADY * F[near].max()
    fine = count_digits(written) == DIGITS and _find_few_digits(written) is None
    return top if steady and fine else None


def find_resolution(A: FloatArray) -> float:
    """Resolution of the largest readings: the least difference of any two, or one unit of their last digit."""
    steps = np.diff(np.unique(A))
    least = float(steps.min()) if len(steps) else float(A.max())
    if (digits := count_digits(A)) == DIGITS and (step := _find_few_digits(A)) is not None:
        return step
    return float(max(least, 10.0 ** (np.floor(np.log10(A.max())) - digits + 1)))


def count_digits(A: FloatArray) -> int:
    """Digits that represent all readings (n,), at most ``DIGITS``; 1.23 mm times .001 is 0.00123 but for rounding."""
    written = ((n, (float(f"{a:.{n - 1}e}") for a in A.tolist())) for n in range(1, DIGITS))
    return next((n for n, short in written if all(map(partial(isclose, rel_tol=ROUNDED), short, A.tolist()))), DIGITS)


def _find_few_digits(A: FloatArray) -> float | None:
    """Step of the largest readings (n,) if they had two or three digits in a unit of any size; else None.

    Steps are ten times finer in the next lower decade, unlike those of a converter.
    """
    x = np.unique(A / A.max())[-MOST_READ:-1]
    for lowest in FEW_DIGITS:
        steps = np.arange(lowest, 10 * lowest)[:, np.newaxis]  # in the largest reading
        error = LAST_DIGIT * steps
        upper = steps * x > lowest - error
        whole, tenths = (np.abs(m * steps * x - np.round(m * steps * x)) < m * error for m in (1.0, 10.0))
        chance = np.log(steps[:, 0]) + upper.sum(axis=1) * np.log(2.0 * error[:, 0])
        written = np.all(np.where(upper, whole, tenths), axis=1) & np.any(~whole, axis=1)
        if np.any(found := written & (chance < np.log(BY_CHANCE))):
            return float(A.max() / steps[found][0, 0])
    return None


def _report_flat_tops(flat: list[Run]) -> Finding:
    sweeps = label_sweeps(flat)
    ceiling = max(float(run.A.max()) for run in flat)
    what = f"the top of {name_sweeps(sweeps)} is flat: readings stay at {ceiling:.4g}; adjacent rows imply more"
    advice = "does the sensor, its amplifier or its range clip them?"
    return Finding("sensor-saturation", "caution", what, advice, sweeps)


FEWEST_SAMPLES = 8  #: fewest samples at a limit
FEWEST_VISITS = 3  #: fewest times that a signal reaches a limit
CROWDED = 8.0  #: least ratio of samples at a limit to those at the value before it: some 2.4 for a quantised sine


class Limits:
    """The largest and smallest values of several channels, collected block by block, and which of them are limits."""

    def __init__(self) -> None:
        #: (samples, visits) of the two largest values of each channel, then of each channel negated
        self._ends: list[dict[float, tuple[int, int]]] = []
        self._last: list[float] = []  #: last sample of each, so that a value held on into the next block is one visit

    def watch(self, blocks: Iterable[FloatArray]) -> Iterator[FloatArray]:
        """Pass the blocks (channels, n) on and note their extreme values."""
        for block in blocks:
            self.note(block)
            yield block

    def note(self, block: FloatArray) -> None:
        """Note the extreme values of samples (channels, n)."""
        both = [sign * row for sign in (1.0, -1.0) for row in block]
        self._ends = self._ends or [{} for _ in both]
        self._last = self._last or [np.nan] * len(both)
        for ends, last, x in zip(self._ends, self._last, both, strict=True):
            for value in _list_largest(x):
                at = x == value
                samples, visits = ends.get(value, (0, 0))
                came = int(at[0] and last != value) + int(np.count_nonzero(at[1:] & ~at[:-1]))
                ends[value] = (samples + int(np.count_nonzero(at)), visits + came)
            for value in sorted(ends)[:-2]:
                del ends[value]
        if block.shape[1]:
            self._last = [float(x[-1]) for x in both]

    @property
    def found(self) -> list[float | None]:
        """The absolute limit of each channel; None if it has none."""
        limits, half = [_find_limit(ends) for ends in self._ends], len(self._ends) // 2
        either = zip(limits[:half], limits[half:], strict=True)
        return [upper if upper is not None else lower for upper, lower in either]


def _list_largest(x: FloatArray) -> list[float]:
    """The two largest different values of x (n,), or the only one."""
    largest = float(np.max(x, initial=-np.inf))
    below = x[x < largest]
    return [largest, float(np.max(below))] if below.size else [largest] if x.size else []


def _find_limit(ends: dict[float, tuple[int, int]]) -> float | None:
    if len(ends) < 2:
        return None
    before, last = sorted(ends)
    samples, visits = ends[last]
    stands = samples >= FEWEST_SAMPLES and visits >= FEWEST_VISITS and samples > CROWDED * ends[before][0]
    return abs(last) if stands else None


def find_limit(x: FloatArray) -> float | None:
    """Absolute value of the limit at which x (n,) stands again and again; None if there is none."""
    limits = Limits()
    for start in range(0, len(x), TOGETHER):
        limits.note(x[np.newaxis, start : start + TOGETHER])
    return limits.found[0]
