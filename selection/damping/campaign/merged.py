"""Shapes that are not those of one mode: of levels that differ, and of modes that show no peak of their own.

The latter are found where the sensors move in more shapes than modes were fitted.

However the stiffness and damping of a mode change with amplitude, all sensors move in its shape:

    H_s = c_s + e_s w^2 + sum_k r_sk p_k,

with any p_k(f). Solved for at every row, these leave the noise, unless there is a further shape. As with the singular
values of the complex mode indicator function (Shih et al., Mech. Syst. Signal Process. 2, 1988), more sensors than
modes are needed: with fewer than one more than a cluster has modes, only the rows next to each mode are looked at.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from damping.arrays import BoolArray, IntArray
from damping.campaign.modal_fit import MOVED, Level, evaluate_sd
from damping.campaign.poles import BAND
from damping.campaign.projection import solve_residues

#: Least squared residual, over that of the scatter from row to row, of a mode that is missing, median over the levels.
#: False alarms: none of 410 random campaigns of modes 10 % and more apart, all found, whose damping and stiffness
#: change with amplitude, leaves as much next to a mode, and none of 80 in its cluster; 125 of 126 pairs 2 to 5 % apart
#: do, and more than `LEAST_SHARE`. Of 40 pairs 2 to 9 % apart 39 are found, and 27 by the rows next to modes alone.
MISSING = 10.0
#: Least root mean square of such residuals, over that of the modes, where the scatter is less: pairs of nearly the same
#: shape leave 2 %; without any noise, the fit's own errors stand out of the scatter.
LEAST_SHARE = 0.01
ALIKE = 0.9  #: least modal assurance criterion between the shapes of two levels
PAYS = 4.0  #: least ratio of the squared residuals before to those after one more mode is fitted
_WIDE = 5.0  # half of the range about a mode, in half-power half-widths
_STARTS = ((-0.2, 0.2), (-0.4, 0.0), (0.0, 0.4))  # of two modes about a merged one, in that range
_FEWEST_ROWS = 12  # about a mode
_PASSES = 3  # between p and the residues


class FurtherShape(NamedTuple):
    """Squared residuals about a mode over those expected from their second differences, 1 for noise.

    0: not known, or less than ``LEAST_SHARE`` of the motion.
    """

    size: float
    at: float  #: frequency of the largest at the level of the median, as if the mode had its first frequency there, Hz


def add_missing(levels: list[Level], fit: Callable[[Sequence[float]], list[Level]]) -> list[Level]:
    """The levels with modes that showed no peak of their own, where they explain the rows; ``fit``: by frequencies, Hz.

    One more is tried where the residual is largest, and on either side of the nearest mode, which may be two.
    """
    frequency, ratio = levels[0].fit.frequency, levels[0].fit.ratio
    worst = max((measure_excess(levels, mode) for mode in range(len(frequency))), key=lambda excess: excess.size)
    if worst.size < MISSING:
        return levels
    mode = int(np.argmin(np.abs(frequency - worst.at)))
    nearest, others = float(frequency[mode]), np.delete(frequency, mode)
    pairs = nearest + _WIDE * float(ratio[mode]) * nearest * np.array(_STARTS)
    trials = [fit([*frequency, worst.at]), *(fit([*others, *pair]) for pair in pairs)]
    left = [_measure_left(trial, levels, mode) for trial in trials]
    best = int(np.argmin(left))
    return add_missing(trials[best], fit) if left[best] * PAYS < _measure_left(levels, levels, mode) else levels


def _measure_left(trial: Sequence[Level], levels: Sequence[Level], mode: int) -> float:
    """Squared residuals of a trial over those of the sensors in the rows about a mode of the ``levels``.

    Infinite unless none of the other modes left its place and the frequencies rise, as they did before.
    """
    left = 0.0
    for level, before in zip(trial, levels, strict=True):
        rows, _ = _choose_rows(before, mode)
        if len(rows) < _FEWEST_ROWS:
            continue
        H, f, frequency = level.H[:, rows], level.f[rows], level.fit.frequency
        own = level.fit.local[int(np.argmin(np.abs(frequency - before.fit.frequency[mode])))]
        residual = H - own @ level.fit.columns(f).T
        left += float(np.mean(np.sum(np.abs(residual) ** 2, axis=1) / np.sum(np.abs(H) ** 2, axis=1)))
        low, high = f.min() * (1.0 - MOVED), f.max() * (1.0 + MOVED)  # a mode beyond the rows shows in them, too
        now, then = (np.count_nonzero((low <= at) & (at <= high)) for at in (frequency, before.fit.frequency))
        rises = np.all(np.diff(frequency) > 0.0) or not np.all(np.diff(before.fit.frequency) > 0.0)
        if now - then != len(frequency) - len(before.fit.frequency) or not rises:
            return np.inf
    return left


def describe_excess(levels: Sequence[Level], mode: int) -> tuple[str, ...]:
    """A caution on a mode about which too much of the rows is left; none if it is not."""
    excess = measure_excess(levels, mode)
    if excess.size < MISSING:
        return ()
    near = f"near {excess.at:.4g} Hz the fit leaves {excess.size:.0f} times the squared scatter"
    cause = "probably two close modes, or one without a peak, for which no band holds; try --modes F1,F2,... in Hz"
    return (f"{near} of the rows, in another shape: {cause}",)


def measure_excess(levels: Sequence[Level], mode: int) -> FurtherShape:
    """The excess about a mode at the level of the (upper) median."""
    measured = [_measure_excess(level, mode) for level in levels]
    k = int(np.argsort([excess.size for excess in measured])[len(measured) // 2])
    moved = levels[k].fit.frequency[mode] / levels[0].fit.frequency[mode]
    return FurtherShape(measured[k].size, measured[k].at / float(moved))


def _choose_rows(level: Level, mode: int) -> tuple[IntArray, IntArray]:
    """Rows about a mode and the modes near them: its cluster, or with too few sensors for that the mode alone."""
    fit, f = level.fit, level.f
    cluster = next(cluster for cluster in fit.clusters if mode in cluster)
    if len(cluster) < len(level.H):
        return fit.rows_about(f, cluster), np.array(cluster)
    half = _WIDE * fit.ratio * fit.frequency
    reach = min(half[mode], BAND * fit.frequency[mode])
    rows = np.flatnonzero(np.abs(f - fit.frequency[mode]) <= reach)
    return rows, np.flatnonzero(np.abs(fit.frequency - fit.frequency[mode]) <= half + half[mode])


def _measure_excess(level: Level, mode: int) -> FurtherShape:
    """The excess about a mode of one level."""
    fit, (rows, modes) = level.fit, _choose_rows(level, mode)
    none = FurtherShape(0.0, float(fit.frequency[mode]))
    if len(rows) < _FEWEST_ROWS or len(modes) >= len(level.H):
        return none
    near, H, columns, coefficients = 2 + modes, level.H[:, rows], fit.columns(level.f[rows]), fit.local[mode]
    sd, others = evaluate_sd(H, fit.noise), columns.copy()
    others[:, near] = 0.0
    weight = 1.0 / np.median(sd, axis=1, keepdims=True)
    for _ in range(_PASSES):
        moved = (H - coefficients @ others.T) * weight
        columns[:, near] = np.linalg.lstsq(coefficients[:, near] * weight, moved, rcond=None)[0].T
        coefficients, residual = solve_residues(columns, H, sd)
    if np.linalg.norm(residual * sd) < LEAST_SHARE * np.linalg.norm(coefficients[:, near] @ columns[:, near].T):
        return none
    rough = float(np.mean(np.abs(np.diff(residual, n=2, axis=1)) ** 2)) / 6.0
    power = np.mean(np.abs(residual) ** 2, axis=0)
    return FurtherShape(float(power.mean()) / max(rough, 1e-300), float(level.f[rows[np.argmax(power)]]))


def describe_shapes(levels: Sequence[Level], k: int, kept: BoolArray) -> list[str]:
    """Cautions on levels at which the shape of mode ``k`` at the ``kept`` sensors is not that of the lowest level."""
    cautions, lowest = [], levels[0].fit.residues[kept, k]
    for level in levels[1:]:
        shape = level.fit.residues[kept, k]
        mac = float((shape @ lowest) ** 2 / ((shape @ shape) * (lowest @ lowest)))
        if mac < ALIKE:
            cautions.append(f"at {level.run.level:g} {level.run.drive_unit} the shape is another (MAC {mac:.2f})")
    return cautions
