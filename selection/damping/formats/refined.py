"""Rows taken again, closer together, about a resonance: they join the sweep of their level that they agree with."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from damping.arrays import FloatArray
from damping.formats.series import Samples, Series, Summary

#: Largest root mean square departure, as a share, at which forces and motions of two sweeps agree. Of 4000 random pairs
#: with 0 to 2 % of noise, none joined whose resonance had moved by a tenth of a half-power half-width (by amplitudes
#: alone: by half of one), and nine in ten did where it had not.
_AGREES = 0.05
#: Largest step from row to row over that of the sweep that is refined, and largest range over that sweep's.
_FINER = 0.5
#: Fewest rows of the coarse sweep within the range of the fine one, and fewest rows of either.
_FEWEST_SHARED = 2
_FEWEST_ROWS = 4
_GAP = 3.0  # steps beyond which rows are of two resonances


@dataclass(frozen=True)
class SweepMotion:
    """Rows of a sweep: frequencies (n,) Hz, force amplitudes (n,), and motions over the force (sensors, n)."""

    f: FloatArray
    force: FloatArray
    H: Samples

    def sorted(self) -> "SweepMotion":
        """The rows at which all is known, by rising frequency."""
        known = np.isfinite(self.f) & np.isfinite(self.force) & np.isfinite(self.H).all(axis=0)
        order = np.flatnonzero(known)[np.argsort(self.f[known], kind="stable")]
        return SweepMotion(self.f[order], self.force[order], self.H[:, order])


def find_refined(sweeps: Sequence[SweepMotion]) -> list[int]:
    """For each sweep, in the order taken, the number of the earlier one whose rows it refines, else its own.

    It is closer in its rows, within that one's range, and agrees with it in force and in every motion.
    """
    numbers, rows = list(range(len(sweeps))), [sweep.sorted() for sweep in sweeps]
    for k, sweep in enumerate(rows):
        apart = {j: _measure_apart(rows[j], sweep) for j in range(k) if numbers[j] == j}
        best = min(apart, key=lambda j: apart[j], default=k)
        numbers[k] = best if isfinite(apart.get(best, inf)) else k
    return numbers


def _measure_apart(coarse: SweepMotion, fine: SweepMotion) -> float:
    """Root mean square difference of the forces, as a share, of a sweep and its refinement; infinite if it is none."""
    if min(len(coarse.f), len(fine.f)) < _FEWEST_ROWS or not coarse.f[0] <= fine.f[0] <= fine.f[-1] <= coarse.f[-1]:
        return inf
    steps, own = np.diff(fine.f), np.gradient(coarse.f)
    step = float(np.median(steps))
    after = np.clip(np.searchsorted(fine.f, coarse.f), 1, len(steps))
    shared = (coarse.f >= fine.f[0]) & (coarse.f <= fine.f[-1]) & (steps[after - 1] <= _GAP * step)
    covered = float(np.sum(steps[steps <= _GAP * step]))
    if np.count_nonzero(shared) < _FEWEST_SHARED or covered > _FINER * np.ptp(coarse.f):
        return inf
    if step > _FINER * np.median(own[shared]):
        return inf
    f, apart = coarse.f[shared], []
    same = np.isin(fine.f, f)
    for first, second in ((coarse.force, fine.force), *zip(coarse.H, fine.H, strict=True)):
        here = np.interp(f, fine.f, second)
        size = np.linalg.norm(first[shared])
        apart.append(float(np.linalg.norm(here - first[shared]) / size) if size > 0.0 else float(np.any(second)))
    is_copy = same.any() and max(apart) == 0.0  # rows identical in every column are no data
    return apart[0] if max(apart) <= _AGREES and not is_copy else inf


def join_refined(series: Sequence[Series], summary: Summary) -> list[Series]:
    """The series with rows that refine an earlier sweep in it, if both were told apart by their frequencies alone."""
    told = [k for k, row in enumerate(series) if row.is_part and row.force is not None]
    with np.errstate(all="ignore"):  # rows without a force are left out
        motions = [
            SweepMotion(row.abscissa, np.abs(row.force), np.atleast_2d(row.response / row.force))
            for row in (series[k] for k in told)
            if row.force is not None
        ]
    joined = dict(enumerate(series))
    for k, number in zip(told, find_refined(motions), strict=True):
        first = told[number]
        if first != k and _is_later(series[first], series[k]):
            joined[first] = _join(joined[first], joined.pop(k))
            summary.note(f"rows of {series[k].label!r} refine {series[first].label!r} and join it")
    return list(joined.values())


def _is_later(first: Series, second: Series) -> bool:
    times = [row.extra.get("time", np.zeros(1)) for row in (first, second)]
    return not np.nanmin(times[1]) < np.nanmax(times[0])


def _join(first: Series, second: Series) -> Series:
    """The rows of two series in the order of the frequency of the first."""
    f = np.concatenate([first.abscissa, second.abscissa])
    order = np.argsort(f if first.abscissa[0] <= first.abscissa[-1] else -f, kind="stable")
    force = None if first.force is None or second.force is None else np.concatenate([first.force, second.force])[order]
    extra = {name: np.concatenate([first.extra[name], second.extra[name]])[order] for name in first.extra}
    response = np.concatenate([first.response, second.response])[order]
    return replace(first, abscissa=f[order], response=response, force=force, extra=extra)
