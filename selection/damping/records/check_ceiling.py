"""Readings at their limit: a sensor, an amplifier or a range that clips them, so that amplitudes are too small.

Of a record it shows by its phases or by a flat top. Of a signal in time: that spends little time near its largest
value. Of a sine resolved to steps, the last step holds some 2.4 times the samples of the one before it, whatever the
resolution, since the time above 1 - e goes as sqrt(e). One that is clipped comes back to its largest value again and
again and holds it, so that there it has many times the samples of the value before. A value that is held once, as
before a release, is no limit. Not seen: a gain that falls off before a limit, one that noise comes after, and in fewer
than some 1000 steps a decay, whose later peaks pass the value before.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import log

import numpy as np

from damping.arrays import FloatArray
from damping.records.implied import Implied
from damping.records.runs import Run, fit_parabola
from damping.records.view import Finding, Leg, View, label_sweeps, name_sweeps

TOP = 0.9  #: readings from this share of the largest of a sweep on are near a ceiling, if there is one,
WINGS = 0.6  #: and those up to this share are not: what clips them lies below the half of the largest response
FEWEST_PAIRS = 2  #: pairs of rows near the ceiling that are no chance, and ...
FEWEST_BESIDE = 3  #: ... in the wings, for their median
KNOWN = 0.15  #: a pair of rows is used whose noise lets its mass be known to this, relative
LEAST_NOISE = 0.003  #: relative noise of a row at least: phases are read to this, rad, where amplitudes are smoother
#: The mass near the ceiling over that in the wings is of clipped readings from this factor on, ...
CLIPPED = 1.1
ERRORS = 4.5  #: ... this many standard errors, ...
#: ... and where sweeps whose largest reading is below this share of the ceiling ...
FAR_BELOW = 0.75
#: ... have less than this share of it (ln): what falls with the force or stands beside the mode, levels have alike.
OF_LOWER = 0.35


@dataclass(frozen=True)
class Excess:
    """Mass near the top of a run over that in its wings, and its standard error, relative."""

    run: Run
    factor: float
    error: float

    @property
    def top(self) -> float:
        """Largest reading of the run."""
        return float(self.run.A.max())


def check_ceiling(view: View) -> Finding | None:
    """Readings that are clipped or compressed near their largest.

    With phases: two rows of like amplitude on either side of resonance imply the mass, whatever the damping and the
    spring; readings too small by a factor imply one too large by it. Without: a top flatter than the mass allows.
    """
    measured = [found for leg in view.legs if (found := _measure_excess(leg)) is not None]
    clipped = [one for one in measured if one.factor > CLIPPED and one.factor - 1.0 > ERRORS * one.error]
    if clipped:
        highest = max(clipped, key=lambda one: one.top)
        lower = [one for one in measured if one.top < FAR_BELOW * highest.top]
        only = all(log(one.factor) < OF_LOWER * log(highest.factor) for one in lower)
        if only and highest.top == max(one.top for one in measured):
            return _tell([one for one in clipped if one.top >= FAR_BELOW * highest.top], highest, alone=not lower)
    flat = [run for run in view.runs if _is_flat(run)]
    return _tell_flat(flat) if flat else None


def _tell(clipped: list[Excess], highest: Excess, alone: bool) -> Finding:
    sweeps = label_sweeps(one.run for one in clipped)
    what = (
        f"the largest readings of {name_sweeps(sweeps)}, from {TOP * highest.top:.3g} on, imply {highest.factor:.3g} "
    )
    what += f"times the mass that its smaller ones {'do' if alone else 'and lower levels do'}: they are too small"
    advice = "does the sensor, its amplifier or its range clip them? or does the force fall at resonance, unrecorded"
    advice += ", or a mode stands beside" if alone else ""
    return Finding("sensor-saturation", "caution", what, advice, sweeps)


def _measure_excess(leg: Leg) -> Excess | None:
    """The excess of a run; None without phases or where pairs of rows near its top or in its wings are too few."""
    if leg.turn is None or leg.lag is None or not leg.turn.both_sides:
        return None
    A, mass, error = _pair_masses(leg.run, leg.turn)
    top, wings = (A > TOP) & (error < KNOWN), (A < WINGS) & (error < KNOWN)
    if top.sum() < FEWEST_PAIRS or wings.sum() < FEWEST_BESIDE:
        return None
    factor = float(np.mean(mass[top]) / np.median(mass[wings]))
    return Excess(leg.run, factor, float(np.sqrt(np.sum(error[top] ** 2)) / top.sum()))


def _pair_masses(run: Run, turn: Implied) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass of every row and what lies at its amplitude on the other side of resonance, (n,).

    First the amplitude over the largest, last the relative error of the mass. Y is interpolated in ln A between rows of
    the other side, so that a spring bends nothing.
    """
    Y, x, top = run.stiffness * np.exp(-1j * turn.offset), np.log(run.A), run.omega[np.argmax(run.compliance)]
    sides = np.flatnonzero(run.omega < top), np.flatnonzero(run.omega > top)
    found = []
    for own, other in (sides, sides[::-1]):
        other = other[np.argsort(x[other], kind="stable")]
        if len(other) < FEWEST_PAIRS:
            continue
        own = own[(x[own] >= x[other[0]]) & (x[own] <= x[other[-1]])]
        rise = Y.real[own] - np.interp(x[own], x[other], Y.real[other])
        apart = np.interp(x[own], x[other], run.omega[other] ** 2) - run.omega[own] ** 2
        error = 2.0**0.5 * max(run.noise, LEAST_NOISE) * np.abs(Y[own]) / np.maximum(np.abs(rise), 1e-300)
        found.append((np.exp(x[own] - x.max()), rise / apart, error))
    A, mass, error = (np.concatenate(parts) for parts in zip(*found, strict=True)) if found else np.empty((3, 0))
    return A, mass, error


FLAT = 0.01  #: rows beside the largest whose readings are within this of it are its top
FEWEST_FLAT = 4  #: fewest rows of a top that is flat; three are of a table with few digits
#: |Y|^2 = C^2/A^2 + M^2 (omega_n^2 - omega^2)^2 at the ends of the top is over that at its middle at most twice this
#: power of C(A) times what A has fallen there: rows that have fallen less are of no damping.
STEEPEST = 10.0
STEADY = 0.05  #: a force that varies by more, relative, belongs to a sweep that is controlled by its response
DIGITS = 6  #: a table of as many digits or more is rounded to less than any noise
LAST_DIGIT = 10.0 ** (1 - DIGITS)  #: amplitudes of complex values of that many digits agree to this
SMOOTH = 1.5  #: rows near a top over those four times nearer, from which on it is round: a parabola has 2
AS_LINEAR = 0.1  #: misfit of the wings by a parabola, and what it may fall short of the top: a mode, not a stop


def _is_flat(run: Run) -> bool:
    """Whether readings stand at one ceiling where the parabola of |Y|^2 in omega^2 of the wings says larger ones."""
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
    x = (run.omega / np.mean(run.omega[wings])) ** 2 - 1.0
    share = np.polyval(fitted, x) * (run.A / run.F) ** 2  # |Y|^2 of the wings' mode over that of the row
    fallen = max(float(np.ptp(np.log(run.A[flat]))), _find_resolution(run.A) / float(run.A[top]))
    risen = float(fitted[0] * (0.5 * np.ptp(x[flat])) ** 2 * (run.A[top] / np.mean(run.F[flat])) ** 2)
    linear = np.median(np.abs(share[wings] - 1.0)) < AS_LINEAR and bool(np.all(share[flat] < 1.0 + AS_LINEAR))
    return bool(linear and risen > 2.0 * STEEPEST * fallen)


def find_ceiling(A: FloatArray, F: FloatArray) -> float | None:
    """The value at which amplitudes A (n,) of a sweep stand while the force F (n,) stays; None where there is none.

    No two measurements agree to the last digit, nor do four. Of a smooth top twice as many rows lie four times as far
    below its largest; a response that is held by its controller has a force that falls.
    """
    top = float(A.max(initial=0.0))
    below = 1.0 - A / top if top > 0.0 else np.zeros(len(A))
    near, beside = below <= LAST_DIGIT, int(np.sum(below <= 4.0 * LAST_DIGIT))
    if near.sum() < FEWEST_FLAT or np.sum(below > FLAT) < FEWEST_BESIDE or beside >= SMOOTH * near.sum():
        return None
    steady = np.ptp(F[near]) <= STEADY * F[near].max()
    return top if steady and _count_digits(A) == DIGITS else None


def _find_resolution(A: FloatArray) -> float:
    """Step of the largest readings: the least difference of any two, or one in the last digit that all of them have."""
    steps = np.diff(np.unique(A))
    least = float(steps.min()) if len(steps) else float(A.max())
    return float(max(least, 10.0 ** (np.floor(np.log10(A.max())) - _count_digits(A) + 1)))


def _count_digits(A: FloatArray) -> int:
    """Digits that all readings have, ``DIGITS`` at most."""
    return next((n for n in range(1, DIGITS) if all(float(f"{a:.{n - 1}e}") == a for a in A.tolist())), DIGITS)


def _tell_flat(flat: list[Run]) -> Finding:
    sweeps = label_sweeps(flat)
    ceiling = max(float(run.A.max()) for run in flat)
    what = f"the top of {name_sweeps(sweeps)} is flat: readings stay at {ceiling:.4g}; adjacent rows imply more"
    advice = "does the sensor, its amplifier or its range clip them?"
    return Finding("sensor-saturation", "caution", what, advice, sweeps)


FEWEST_SAMPLES = 8  #: samples at a limit
FEWEST_VISITS = 3  #: times that a signal comes to a limit
CROWDED = 8.0  #: samples at a limit over those at the value before it: some 2.4 of a sine in steps


class Limits:
    """The largest and smallest values of some channels, noted block by block, and which of them are limits."""

    def __init__(self) -> None:
        #: (samples, visits) by value, of the two last values: of each channel upwards, then of each downwards
        self._ends: list[dict[float, tuple[int, int]]] = []

    def watch(self, blocks: Iterable[FloatArray]) -> Iterator[FloatArray]:
        """The blocks (channels, n) as they come, their ends noted."""
        for block in blocks:
            self.note(block)
            yield block

    def note(self, block: FloatArray) -> None:
        """Note the ends of samples (channels, n)."""
        both = [sign * row for sign in (1.0, -1.0) for row in block]
        self._ends = self._ends or [{} for _ in both]
        for ends, x in zip(self._ends, both, strict=True):
            for value in _list_largest(x):
                at = x == value
                samples, visits = ends.get(value, (0, 0))
                came = int(at[0]) + int(np.count_nonzero(at[1:] & ~at[:-1]))
                ends[value] = (samples + int(np.count_nonzero(at)), visits + came)
            for value in sorted(ends)[:-2]:
                del ends[value]

    @property
    def found(self) -> list[float | None]:
        """The limit of each channel, its size; None of one that has none."""
        limits, half = [_find_limit(ends) for ends in self._ends], len(self._ends) // 2
        either = zip(limits[:half], limits[half:], strict=True)
        return [upper if upper is not None else lower for upper, lower in either]


def _list_largest(x: FloatArray) -> list[float]:
    """The two largest values of x (n,) that differ, or the one that there is."""
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
    """Size of the limit at which x (n,) stands again and again; None where there is none."""
    limits = Limits()
    limits.note(x[np.newaxis])
    return limits.found[0]
