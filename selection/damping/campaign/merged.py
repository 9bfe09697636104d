"""Shapes that are not those of one mode: of levels that differ, and of close modes that show one peak.

The latter are found where the sensors move in more shapes than modes were fitted.

However the stiffness and damping of a mode change with amplitude, all sensors move in its shape:

    H_s = c_s + e_s w^2 + sum_k r_sk p_k,

with any p_k(f). Solved for at every row, these leave the noise, unless there is a further shape. As with the singular
values of the complex mode indicator function (Shih et al., Mech. Syst. Signal Process. 2, 1988), more sensors than
modes are needed.
"""

from collections.abc import Callable, Sequence

import numpy as np

from damping.arrays import BoolArray
from damping.campaign.modal_fit import Level, evaluate_sd
from damping.campaign.poles import BAND
from damping.campaign.projection import solve_residues

#: Least squared residual, over that of the scatter from row to row, of modes that merged, as a median over the levels.
#: False alarms: none of 410 random campaigns of modes 10 % and more apart, all found, whose damping and stiffness
#: change with amplitude, leaves as much; 125 of 126 pairs 2 to 5 % apart do, and more than `LEAST_SHARE`.
MERGED = 10.0
#: Least root mean square of such residuals, over that of the modes, where the scatter is less: pairs of nearly the same
#: shape leave 2 %; without any noise, the fit's own errors stand out of the scatter.
LEAST_SHARE = 0.01
ALIKE = 0.9  #: least modal assurance criterion between the shapes of two levels
PAYS = 4.0  #: least ratio of the squared residuals before to those after one mode is replaced by two
_WIDE = 5.0  # half of the range about a mode, in half-power half-widths
_STARTS = ((-0.2, 0.2), (-0.4, 0.0), (0.0, 0.4))  # of two modes about the merged one, in that range
_FEWEST_ROWS = 12  # near a mode
_PASSES = 3  # between p and the residues


def split_merged(levels: list[Level], fit: Callable[[Sequence[float]], list[Level]]) -> list[Level]:
    """The levels with modes that merged replaced by two, where that explains the rows; ``fit``: by frequencies, Hz."""
    frequency, ratio = levels[0].fit.frequency, levels[0].fit.ratio
    excess = [measure_excess(levels, mode) for mode in range(len(frequency))]
    worst = int(np.argmax(excess))
    if excess[worst] < MERGED:
        return levels
    at, others = float(frequency[worst]), np.delete(frequency, worst)
    half = _WIDE * float(ratio[worst]) * at
    trials = [fit([*others, *(at + half * np.array(pair))]) for pair in _STARTS]
    left = [_measure_left(trial, at, half, 1 + int(np.count_nonzero(others < at))) for trial in trials]
    best = int(np.argmin(left))
    pays = left[best] * PAYS < _measure_left(levels, at, half)
    return split_merged(trials[best], fit) if pays else levels


def _measure_left(levels: Sequence[Level], at: float, half: float, upper: int = 0) -> float:
    """Squared residuals over those of the sensors about ``at`` (Hz), infinite unless all frequencies rise and ``upper``
    and the mode below it lie there: else a mode moved away or through another.
    """
    left = 0.0
    for level in levels:
        frequency, rows = level.fit.frequency, np.abs(level.f - at) <= half
        mode = int(np.argmin(np.abs(frequency - at)))
        residual = level.H[:, rows] - level.fit.local[mode] @ level.fit.columns(level.f[rows]).T
        left += float(np.mean(np.sum(np.abs(residual) ** 2, axis=1) / np.sum(np.abs(level.H[:, rows]) ** 2, axis=1)))
        there = np.abs(frequency[max(upper - 1, 0) : upper + 1] - at) <= half
        if upper and not (there.all() and np.all(np.diff(frequency) > 0.0)):
            return np.inf
    return left


def describe_excess(levels: Sequence[Level], mode: int) -> tuple[str, ...]:
    """A caution on a mode that leaves too much of the rows; none if it does not."""
    excess = measure_excess(levels, mode)
    if excess < MERGED:
        return ()
    near = f"near {levels[0].fit.frequency[mode]:.4g} Hz the fit leaves {excess:.0f} times the squared scatter"
    cause = "probably two close modes, for which no band holds; try --modes F1,F2,... in Hz"
    return (f"{near} of the rows, in another shape: {cause}",)


def measure_excess(levels: Sequence[Level], mode: int) -> float:
    """Squared residuals near a mode over those expected from the scatter from row to row, median over the levels."""
    return float(np.median([_measure_excess(level, mode) for level in levels]))


def _measure_excess(level: Level, mode: int) -> float:
    """Squared residuals near a mode over those expected from their second differences; 1 for noise.

    0 if it is not known or less than ``LEAST_SHARE`` of the motion.
    """
    fit, f = level.fit, level.f
    half = _WIDE * fit.ratio * fit.frequency
    near = 2 + np.flatnonzero(np.abs(fit.frequency - fit.frequency[mode]) <= half + half[mode])
    rows = np.flatnonzero(np.abs(f - fit.frequency[mode]) <= min(half[mode], BAND * fit.frequency[mode]))
    if len(rows) < _FEWEST_ROWS or len(near) >= len(level.H):
        return 0.0
    H, columns, coefficients = level.H[:, rows], fit.columns(f[rows]), fit.local[mode]
    sd, others = evaluate_sd(H, fit.noise), columns.copy()
    others[:, near] = 0.0
    weight = 1.0 / np.median(sd, axis=1, keepdims=True)
    for _ in range(_PASSES):
        moved = (H - coefficients @ others.T) * weight
        columns[:, near] = np.linalg.lstsq(coefficients[:, near] * weight, moved, rcond=None)[0].T
        coefficients, residual = solve_residues(columns, H, sd)
    if np.linalg.norm(residual * sd) < LEAST_SHARE * np.linalg.norm(coefficients[:, near] @ columns[:, near].T):
        return 0.0
    rough = float(np.mean(np.abs(np.diff(residual, n=2, axis=1)) ** 2)) / 6.0
    return float(np.mean(np.abs(residual) ** 2)) / max(rough, 1e-300)


def describe_shapes(levels: Sequence[Level], k: int, kept: BoolArray) -> list[str]:
    """Cautions on levels at which the shape of mode ``k`` at the ``kept`` sensors is not that of the lowest level."""
    cautions, lowest = [], levels[0].fit.residues[kept, k]
    for level in levels[1:]:
        shape = level.fit.residues[kept, k]
        mac = float((shape @ lowest) ** 2 / ((shape @ shape) * (lowest @ lowest)))
        if mac < ALIKE:
            cautions.append(f"at {level.run.level:g} {level.run.drive_unit} the shape is another (MAC {mac:.2f})")
    return cautions
