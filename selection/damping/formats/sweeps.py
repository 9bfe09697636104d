"""Sweeps of a table: split by labels, or by where the frequency restarts, turns or is in no order; and joined again.

A table without labels of one row for each force level, its resonance, has a sweep in every row.
Rows taken again, closer together, about a resonance join the sweep of their level that they agree with.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import accumulate
from math import inf, isfinite, log

import numpy as np

from damping.arrays import BoolArray, FloatArray, IntArray
from damping.formats.series import Samples, Series, Summary
from damping.records.mixed_levels import GROWS, GROWS_AS_FORCE, LEVEL, PEAKS_IN_PHASE
from damping.records.resonance import number_levels

#: A new sweep begins where the frequency goes back by more than this share of the range that its sweep has covered.
_RESTART = 0.5
#: Fewest rows of a sweep: before a new one may begin, and of a refined one and its refinement.
_FEWEST_ROWS = 4
#: Share of rows at which the frequency turns, from which they are in no order: two thirds turn in a random one.
_DISORDER = 0.5
#: Fewest rows, each a resonance, that show how the response grows with force; of two, one may be any row of a sweep.
_FEWEST_RESONANCES = 3
#: Range of the frequencies of resonances over that of their forces, both in the logarithm; of a force that grows with
#: the frequency squared, as that of an unbalance, it is a half.
_STAYS = 0.1
#: Fewest steps from row to row on which that is judged: in fewer, chance alone turns as many.
_FEWEST_IN_DISORDER = 12


def list_sweeps(whole: Series, labels: Sequence[str] | None, summary: Summary) -> list[Series]:
    """The sweeps of a table by the label of each row, else split by `_cuts`."""
    if labels is not None:  # the label of merged cells is in the first of them
        labels = list(accumulate(labels, _keep_above))
    elif not whole.is_time:
        cuts, rows = _cuts(whole.abscissa, whole.force), range(len(whole.abscissa))
        if _are_resonances(whole):
            summary.note(f"{len(rows)} rows, each of another force and about one frequency, are a sweep each")
            labels = [f"{whole.label} {row + 1}" for row in rows]
        elif (levels := _find_levels_in_disorder(whole)) is not None:
            summary.note(f"rows in no order of frequency are sorted into {int(levels.max()) + 1} sweeps by their force")
            labels = [f"{whole.label} {level + 1}" for level in levels]
        elif cuts:
            summary.note(f"{len(cuts) + 1} sweeps one below the other are separated by frequency and force")
            labels = [f"{whole.label} {int(np.searchsorted(cuts, row, side='right')) + 1}" for row in rows]
            whole = replace(whole, is_part=True)
    if labels is None:
        return [whole]
    by_label: dict[str, list[int]] = {}
    for row, label in enumerate(labels):
        by_label.setdefault(label, []).append(row)
    return [_take_rows(whole, label or whole.label, rows) for label, rows in by_label.items()]


#: Factor between the sweep rate that a table states and that of its frequencies and times, from which it is reported.
_RATE_APART = 1.5


def direct_rate(row: Series, summary: Summary) -> Series:
    """The series with a sweep rate below 0 where the frequency falls in the order taken, if all are stated as speeds.

    A caution is noted if frequencies and times move at another rate.
    """
    rate = row.extra.get("sweep_rate")
    if rate is None or len(rate) < 2:
        return row
    order = np.argsort(row.extra.get("time", np.zeros(len(rate))), kind="stable")
    f, way = row.abscissa[order], np.empty(len(rate))
    turns = np.nan_to_num(np.sign(np.gradient(f)))
    way[order] = np.where(turns == 0.0, np.sign(f[-1] - f[0]), turns)
    speeds = np.abs(rate[order])
    if "time" in row.extra:
        with np.errstate(all="ignore"):  # rows of one time
            shown = float(np.nanmedian(np.abs(np.diff(f) / np.diff(row.extra["time"][order]))))
        stated = float(np.nanmedian(speeds))
        if stated > 0.0 and not 1.0 / _RATE_APART < shown / stated < _RATE_APART:
            said = f"the sweep rate is {stated:.3g} Hz/s, by its frequencies and times {shown:.3g} Hz/s"
            summary.note(f"caution: {row.label!r}: {said}: is its unit right?")
    if np.any(rate < 0.0) or not np.any((rate > 0.0) & (way < 0.0)):
        return row
    summary.note("sweep rates are speeds: below 0 where the frequency falls")
    return replace(row, extra={**row.extra, "sweep_rate": np.where(rate > 0.0, rate * way, rate)})


def _keep_above(above: str, label: str) -> str:
    return label or above


def _find_levels_in_disorder(whole: Series) -> IntArray | None:
    """Force level of each row (n,) where the frequency turns or stays from row to row more than it goes on; else None.

    It stays where every level is taken before the next frequency.
    """
    way, size = np.sign(np.diff(whole.abscissa)), np.abs(np.zeros(1) if whole.force is None else whole.force)
    if len(way) < _FEWEST_IN_DISORDER or np.mean(way[1:] * way[:-1] <= 0.0) < _DISORDER or not np.isfinite(size).all():
        return None
    levels = number_levels(size * np.ones(len(whole.abscissa)))
    return levels if levels.max() > 0 and (levels.max() + 1) * _FEWEST_ROWS <= len(levels) else None


def _are_resonances(whole: Series) -> bool:
    """Whether every row is the resonance of another force level: all forces differ, the response grows with them, and
    the frequency hardly moves; if it moves one way, as in a sweep, the response grows as in none. Phases, where known,
    are nearly equal.
    """
    f, n = whole.abscissa, len(whole.abscissa)
    if whole.force is None or n < _FEWEST_RESONANCES or len(whole.force) != n:
        return False
    order = np.argsort(np.abs(whole.force), kind="stable")
    force, response = np.abs(whole.force)[order], np.abs(whole.response)[order]
    if not (np.isfinite(f * force * response).all() and min(f.min(), force[0], response.min()) > 0.0):
        return False
    apart, grown, way = np.diff(np.log(force)), np.diff(np.log(response)), np.sign(np.diff(f))
    if not np.all((apart > log(LEVEL)) & (grown > GROWS * apart)):
        return False
    if log(f.max() / f.min()) > _STAYS * apart.sum():
        return False
    if way.any() and np.ptp(way) < 2.0 and grown.sum() < GROWS_AS_FORCE * apart.sum():
        return False
    turned = np.angle(whole.response / whole.force / (whole.response[0] / whole.force[0]))
    return not whole.has_phase or bool(np.ptp(turned) < PEAKS_IN_PHASE)


def _restarts(passed: FloatArray, onward: FloatArray) -> bool:
    """Whether frequencies that go back from the last one ``passed``, the first ``onward``, are of another sweep.

    Before they turn again they move far, at once or down a sweep; or those to the next turn refine what was passed.
    """
    if abs(onward[_find_turn(onward)] - onward[0]) > _RESTART * np.ptp(passed):
        return True
    run = onward[1 : 2 + _find_turn(onward[1:])]
    return len(run) >= _FEWEST_ROWS and _find_shared(np.sort(passed), np.sort(run)) is not None


def _find_turn(f: FloatArray) -> int:
    """Index at which frequencies (n,) turn first, else of the last."""
    way = np.sign(np.diff(f))
    turns = np.flatnonzero(way * way[:1] < 0.0)
    return int(turns[0]) if len(turns) else len(f) - 1


def _take_rows(whole: Series, label: str, rows: list[int]) -> Series:
    force = None if whole.force is None else whole.force[rows]
    extra = {key: column[rows] for key, column in whole.extra.items()}
    x, response = whole.abscissa[rows], whole.response[rows]
    return replace(whole, label=label, abscissa=x, response=response, force=force, extra=extra)


def _cuts(frequency: FloatArray, force: Samples | None) -> list[int]:
    """Rows at which a new sweep begins: the frequency goes back by half its range or to rows that refine the sweep, or
    turns where the force changes.

    Within a sweep a nearly constant force may change in its last digit while the frequency goes on, or at a row taken
    again.
    """
    starts: set[int] = set()
    rows = np.flatnonzero(np.isfinite(frequency) & (frequency > 0.0))
    first = 0  # index in ``rows`` of the current sweep's first row
    for k in range(1, len(rows)):
        passed = frequency[rows[first:k]]
        step = frequency[rows[k]] - passed[-1]
        back = step * (passed[-1] - passed[0]) < 0.0
        if back and len(passed) >= _FEWEST_ROWS and _restarts(passed, frequency[rows[k - 1 :]]):
            turns_in_steps = abs(step) <= _RESTART * np.ptp(passed)
            first = k - 1 if turns_in_steps and passed[-1] == passed[-2] else k  # the end of both sweeps
            starts.add(int(rows[first]))
    if force is not None:
        size = np.abs(force)
        changes = np.flatnonzero(size[1:] != size[:-1]) + 1
        way = np.sign(np.diff(frequency))
        onward = {k + 1 for k in range(1, len(way)) if way[k] == way[k - 1] != 0.0}
        if len(changes) < len(size) / _FEWEST_ROWS:  # a constant force, not one measured in every row
            again = {k for k in changes.tolist() if way[k - 1] == 0.0 and number_levels(size[k - 1 : k + 1]).max() == 0}
            starts |= set(changes.tolist()) - onward - again
    return sorted(starts)


#: Largest root mean square departure, as a share, at which forces and motions of two sweeps agree. Of 4000 random pairs
#: with 0 to 2 % of noise, none joined whose resonance had moved by a tenth of a half-power half-width (by amplitudes
#: alone: by half of one), and nine in ten did where it had not.
_AGREES = 0.05
#: Largest step from row to row over that of the sweep that is refined, and largest range over that sweep's.
_FINER = 0.5
#: Fewest rows of the coarse sweep within the range of the fine one.
_FEWEST_SHARED = 2
_GAP = 3.0  # steps beyond which rows are of two resonances


@dataclass(frozen=True)
class _SweepMotion:
    """Rows of a sweep: frequencies (n,) Hz, force amplitudes (n,), and motions over the force (sensors, n)."""

    f: FloatArray
    force: FloatArray
    H: Samples

    def sorted(self) -> "_SweepMotion":
        """The rows at which all is known, by rising frequency."""
        known = np.isfinite(self.f) & np.isfinite(self.force) & np.isfinite(self.H).all(axis=0)
        order = np.flatnonzero(known)[np.argsort(self.f[known], kind="stable")]
        return _SweepMotion(self.f[order], self.force[order], self.H[:, order])


def _measure_apart(coarse: _SweepMotion, fine: _SweepMotion) -> float:
    """Root mean square difference of the forces, as a share, of a sweep and its refinement; infinite if it is none."""
    shared = _find_shared(coarse.f, fine.f)
    if shared is None:
        return inf
    f, apart = coarse.f[shared], []
    same = np.isin(fine.f, f)
    for first, second in ((coarse.force, fine.force), *zip(coarse.H, fine.H, strict=True)):
        here = np.interp(f, fine.f, second)
        size = np.linalg.norm(first[shared])
        apart.append(float(np.linalg.norm(here - first[shared]) / size) if size > 0.0 else float(np.any(second)))
    is_copy = same.any() and max(apart) == 0.0  # rows identical in every column are no data
    return apart[0] if max(apart) <= _AGREES and not is_copy else inf


def _find_shared(coarse: FloatArray, fine: FloatArray) -> BoolArray | None:
    """Which frequencies (n,) of a sweep lie among those of its refinement; None if it is none. Both rise."""
    if min(len(coarse), len(fine)) < _FEWEST_ROWS or not coarse[0] <= fine[0] <= fine[-1] <= coarse[-1]:
        return None
    steps, own = np.diff(fine), np.gradient(coarse)
    step = float(np.median(steps))
    after = np.clip(np.searchsorted(fine, coarse), 1, len(steps))
    shared: BoolArray = (coarse >= fine[0]) & (coarse <= fine[-1]) & (steps[after - 1] <= _GAP * step)
    covered = float(np.sum(steps[steps <= _GAP * step]))
    if np.count_nonzero(shared) < _FEWEST_SHARED or covered > _FINER * np.ptp(coarse):
        return None
    return shared if step <= _FINER * np.median(own[shared]) else None


def join_refined(readings: Sequence[Sequence[Series]], summary: Summary) -> list[list[Series]]:
    """The sweeps of each reading with rows that refine an earlier sweep in it, if only frequencies told these apart.

    All readings have the sweeps and the forces of the first. Rows that refine a sweep are closer, within its range, and
    agree with it in force and in every reading; of several they join the one whose force is nearest.
    """
    sweeps = readings[0]
    forces = {k: row.force for k, row in enumerate(sweeps) if row.is_part and row.force is not None}
    with np.errstate(all="ignore"):  # rows without a force are left out
        motions = {
            k: _SweepMotion(sweeps[k].abscissa, np.abs(F), np.array([of[k].response / F for of in readings])).sorted()
            for k, F in forces.items()
        }
    joined = {k: [k] for k in range(len(sweeps))}
    for k, fine in motions.items():
        before = (j for j in motions if j < k and j in joined and _is_later(sweeps[j], sweeps[k]))
        apart = {j: _measure_apart(motions[j], fine) for j in before}
        first = min(apart, key=lambda j: apart[j], default=k)
        if isfinite(apart.get(first, inf)):
            joined[first] += joined.pop(k)
            summary.note(f"rows of {sweeps[k].label!r} refine {sweeps[first].label!r} and join it")
    return [[reduce(_join, [of[k] for k in numbers]) for numbers in joined.values()] for of in readings]


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
