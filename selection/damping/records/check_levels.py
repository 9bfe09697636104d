"""Check of levels against each other: amplitudes that fall with force, and masses that differ."""

from dataclasses import dataclass
from itertools import combinations
from math import log

import numpy as np
import pandas as pd

from damping.arrays import BoolArray, FloatArray
from damping.records.implied import Leg
from damping.records.view import Finding, NamedFinding, View, name_sweeps, take_median

FORCE_STEP = 1.1  #: levels are compared if their forces differ by this factor
FALLEN = 0.87  #: a resonant amplitude falls if it is below this share of that at a lower force
FALLING = 0.3  #: share of falling pairs of levels needed if no mass shows which level is wrong
#: Share of the amplitude at a lower force below which a single pair of levels is doubted. If amplitudes did not grow
#: with force at all and scattered by 5 %, one pair in 40 000 would be as far apart.
DEEP_FALL = 0.75
#: An amplitude of one level off by this factor hides any law; the diagnosis names smaller errors.
HOPELESS = 2.0
#: Largest phase offset, rad, against other levels at which an odd mass may come from a gain, which turns no phase.
#: Pairs of rows of a bent resonance, on the branch that jumps, turn the mass that they imply and make it smaller.
TURNED = 0.1
FAR_MASS = 1.27  #: factor from which a mass is far from the others or the mode file's
#: Without phases, or in few rows, the mass comes from a parabola or a line, which a bent resonance does not follow.
FAR_MASS_WITHOUT_PHASE = 1.8


@dataclass(frozen=True)
class OddMass:
    """A ``sweep``, tested at ``force``, that implies the ``mass``, which is ``factor`` times that of other levels."""

    sweep: str
    force: float
    mass: float
    factor: float
    sure: bool  #: the mode file or most levels show that this level is wrong
    beside: bool = False  #: no other level has its added mass

    def __str__(self) -> str:
        large, small = ("small", "large") if self.factor > 1.0 else ("large", "small")
        by = f"{max(self.factor, 1.0 / self.factor):.3g} times too"
        text = f"sweep {self.sweep} implies a mass of {self.mass:.4g}, {self.mass / self.factor:.4g} at other levels"
        text += f": its readings are {by} {large}, or its force is {by} {small}"
        return text + ("" if self.sure else ", or those of the other levels are wrong")


def check_levels(view: View) -> Finding | None:
    """A resonant amplitude that falls with force, a decay whose damping grows as it dies, a level of another mass.

    A single mode shows none of these. Whatever its spring and damping, a mode has one mass: a level that implies
    another has a wrong force or wrong readings. If there is one, a single pair of falling levels is not scatter, and if
    the other levels do not fall, a diagnosis names it.
    """
    table, odd, pair, certain = _compare_levels(view)
    if pair is None and not odd:
        return None
    reports = [] if pair is None else [_report_fall(view, table, *pair)]
    reports += [_report_odd_masses(odd)] if odd else []
    what, advice = "; ".join(what for what, _ in reports), reports[-1][1]
    sweeps = tuple(level.sweep for level in odd) or tuple(table["sweep"].iloc[sorted(pair or ())])
    hopeless = certain or max((abs(log(level.factor)) for level in odd), default=0.0) > log(HOPELESS)
    without_odd = table[~table["sweep"].isin({level.sweep for level in odd})]
    named = pair is None or (len(odd) == 1 and _find_fall(without_odd, set())[0] is None)
    check = "level-offset" if pair is None else "amplitude-falls"
    kind = NamedFinding if named else Finding
    return kind(check, "refuse" if hopeless else "caution", what, advice, sweeps)


def falls_with_force(view: View) -> bool:
    """Whether enough levels fall to refuse the record: no unit, which is that of every level, makes them fall.

    A single level with an odd mass may fall beside a wrong unit.
    """
    _, odd, _, certain = _compare_levels(view)
    return not view.record.is_decay and len(odd) != 1 and certain


def _compare_levels(view: View) -> tuple[pd.DataFrame, list[OddMass], tuple[int, int] | None, bool]:
    """What sweeps that show their resonance imply, by force; odd masses among it; what `_find_fall` says of it."""
    beside = {leg.run.sweep for leg in view.legs if not leg.resonant}
    table = view.implied[~view.implied["sweep"].isin(beside)].sort_values("force", kind="stable")
    odd = find_odd_masses(view, table)
    return table, odd, *_find_fall(table, {level.sweep for level in odd})


def _find_fall(table: pd.DataFrame, odd: set[str]) -> tuple[tuple[int, int] | None, bool]:
    """Positions of the two levels, lower force first, between which the amplitude falls most, and whether enough fall.

    One pair is enough if one of its levels is ``odd``. None if too few fall and no fall is as deep as ``DEEP_FALL``.
    """
    F, A = table["force"].to_numpy(), table["amplitude"].to_numpy()
    is_odd = table["sweep"].isin(odd).to_numpy()
    pairs, falling, explained, deepest = 0, 0, False, (FALLEN, -1, -1)
    for i in range(len(F)):  # by rows, since the pairs of many levels are more than memory holds
        above = np.flatnonzero(FORCE_STEP * F[i] < F)
        lower = above[A[above] < FALLEN * A[i]]
        pairs, falling = pairs + len(above), falling + len(lower)
        if len(lower):
            explained |= bool(is_odd[i] or is_odd[lower].any())
            j = int(lower[np.argmin(A[lower])])
            deepest = min(deepest, (float(A[j] / A[i]), i, j))
    certain = bool(falling) and (explained or falling >= FALLING * pairs)
    return (deepest[1:] if certain or deepest[0] < DEEP_FALL else None), certain


def _report_fall(view: View, table: pd.DataFrame, i: int, j: int) -> tuple[str, str]:
    """Observation on levels i and j of the table, and advice."""
    F, A = table["force"].to_numpy(), table["amplitude"].to_numpy()
    if view.record.is_decay:
        what = f"the damping force of the decay grows from {F[i]:.4g} at amplitude {A[i]:.4g}"
        advice = "two close modes probably beat: take a sensor that shows only one of them"
        return f"{what} to {F[j]:.4g} at {A[j]:.4g}", f"{advice}, or dwell or sweep"
    what = f"resonant amplitude falls from {A[i]:.4g} at force {F[i]:.4g} to {A[j]:.4g} at force {F[j]:.4g}"
    advice = "check the labels and the force of each level, and whether the structure changed between them"
    return what, advice


def _report_odd_masses(odd: list[OddMass]) -> tuple[str, str]:
    """Observation on levels with odd masses, and advice."""
    if exchanged := _find_exchanged(odd):
        masses = " and ".join(f"{level.mass:.4g}" for level in exchanged)
        sweeps = name_sweeps(level.sweep for level in exchanged)
        other = exchanged[0].mass / exchanged[0].factor
        return f"{sweeps} imply masses of {masses}, {other:.4g} at other levels", "are their forces exchanged?"
    advice = "check the gain of the sensor and the force at that level, or leave it out"
    what = "; ".join(map(str, odd))
    if all(level.beside for level in odd):
        what += "; or, since no other level has that added mass, the force path depends on frequency or the mass is not"
        return f"{what} as stated", "measure the force where it enters the structure, and weigh what was added"
    return what, advice


def find_odd_masses(view: View, table: pd.DataFrame) -> list[OddMass]:
    """Levels of the ``table`` of implied quantities whose mass is far from that of the others, by force.

    The mass of the others is the one that most levels share within the factor; of several, the one nearest to the
    mode's, or without a mode to the median. Masses from a parabola, without phases, are compared if no resonance is
    bent.
    """
    known = {leg.run.sweep for leg in view.legs if _is_known(leg)}
    table = table[table["sweep"].isin(known) & table["mass"].notna()]
    if len(table) < 2:
        return []
    phased = all(leg.lag is not None for leg in view.legs)
    far = log(FAR_MASS if view.paired else FAR_MASS_WITHOUT_PHASE)
    x = compare_masses(view, table)
    stated = bool(np.isfinite(view.stated_mass))
    same = np.abs(x - _find_shared(x, far, 0.0 if stated else float(np.median(x)))) < far
    # a gain changes neither the offset of phases nor, without phases, the frequency, within half the bandwidth
    course = table["phase_offset"] if phased else np.log(table["frequency"])
    least = TURNED if phased else take_median(table["damping_ratio"])
    gain = np.abs(course.to_numpy() - np.median(course[same])) < least
    centre, sure = float(np.median(x[same])), stated or 2 * int(same.sum()) > len(x)
    labels, force, mass = table["sweep"].astype(str).tolist(), table["force"].tolist(), table["mass"].tolist()
    level_added = list_medians(view, view.record.added_masses, table)
    beside = ~np.isin(level_added, level_added[same])
    return [
        OddMass(labels[k], force[k], mass[k], float(np.exp(x[k] - centre)), sure, bool(beside[k]))
        for k in np.flatnonzero(~same & gain).tolist()
    ]


def _is_known(leg: Leg) -> bool:
    """Whether a run's mass may be compared: the resonance is not bent, and its rows lie on a line in Y."""
    mass, straight = leg.mass
    return bool(np.isfinite(mass) and mass > 0.0 and straight and leg.on_line)


def compare_masses(view: View, table: pd.DataFrame) -> FloatArray:
    """ln of the implied mass of each sweep of the table over that of the record, else of the mode, else 1."""
    stated = list_medians(view, view.record.masses(np.nan_to_num(view.stated_mass, nan=1.0)), table)
    return np.asarray(np.log(table["mass"].to_numpy(dtype=np.float64) / stated))


def list_medians(view: View, values: FloatArray, table: pd.DataFrame) -> FloatArray:
    """Median of values (rows,) of the record in each sweep of the table."""
    medians = pd.Series(values).groupby(view.record.frame["sweep"].astype(str)).median()
    return np.asarray(medians.loc[table["sweep"].astype(str)], dtype=np.float64)


def _find_shared(x: FloatArray, far: float, anchor: float) -> float:
    """The value of ``x`` (n,) with most others within ``far``; of several, the one nearest to the ``anchor``."""
    votes = (np.abs(x[:, None] - x) < far).sum(axis=1)
    most: BoolArray = votes == votes.max()
    return float(x[most][np.argmin(np.abs(x[most] - anchor))])


def _find_exchanged(odd: list[OddMass]) -> tuple[OddMass, ...]:
    """Two levels whose forces, each divided by its factor, are those of each other; empty if there are none."""
    for first, second in combinations(odd, 2):
        apart = np.log([first.force / first.factor / second.force, second.force / second.factor / first.force])
        if np.abs(apart).max() < log(FORCE_STEP):
            return first, second
    return ()
