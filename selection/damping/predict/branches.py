"""All steady states at each frequency, their stability, and sweeps with jumps (section 4.2).

Stability is that of the averaged slow flow of q = A(t) sin(omega t - phi(t)),

    2 M omega A'     = F sin(phi) - C(A, omega)
    2 M omega A phi' = F cos(phi) - X(A, omega),      X = (K - M omega^2) A + S,

whose Jacobian at a steady state has the trace -(dC/dA + C/A)/(2 M omega) and the determinant
(X dX/dA + C dC/dA)/(A (2 M omega)^2), which is the sign of dF/dA along the response curve.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from damping.arrays import BoolArray, FloatArray, Floats, IntArray
from damping.forces.contract import Force
from damping.predict.steady import SteadyState, balance, bisect, bracketed_newton, phase_lag

#: Amplitudes searched, in units of the static deflection F/K: 16 decades, 60 points in each.
_GRID = np.linspace(-8.0, 8.0, 961) * np.log(10.0)
_FEWEST_STEPS = 2000  #: fewest steps over a whole sweep, so that a branch moves little in each
_BLOCK = 2048  #: frequencies computed together, to limit memory

#: ln(|Z| A) - ln F and its derivative in ln A, at points and rows of frequencies.
Level = Callable[[FloatArray, IntArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class Branches:
    """Every steady state: ``omega`` of shape (n,); the others (n, k), by amplitude, padded with NaN (False)."""

    omega: FloatArray
    amplitude: FloatArray
    phase: FloatArray
    stable: BoolArray


def is_stable(force: Force, A: Floats, omega: Floats, M: Floats, omega_n: Floats) -> BoolArray:
    """Whether the slow flow returns to the steady state of amplitude A (trace <= 0, determinant > 0)."""
    X, slope_X, C, slope = balance(force, A, omega, M, omega_n)
    return np.asarray((C + slope >= 0.0) & (X * slope_X + C * slope > 0.0))


def branches(force: Force, F: float, omega: FloatArray, M: float, omega_n: float) -> Branches:
    """All amplitudes with |Z(A, omega)| A = F at each frequency (Eq 4.2.4), their phases and stability.

    A grid in ln A brackets the roots. Cells are searched for an extremum, so that a close pair near a fold is not
    missed. Frequencies without a steady state (friction holds, no damping at resonance) have no roots.

    Args:
        force: force with scalar parameters.
        F: force amplitude.
        omega: frequencies, rad/s, (n,).
        M, omega_n: mode.
    """
    omega = np.asarray(omega, dtype=float)
    blocks = [_find_roots(force, F, omega, start, M, omega_n) for start in range(0, omega.size, _BLOCK)]
    row, roots = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    table = by_row(row, np.exp(roots), omega.size)
    filled = ~np.isnan(table)
    frequency = np.broadcast_to(omega[:, np.newaxis], table.shape)
    with np.errstate(invalid="ignore"):
        stable = is_stable(force, table, frequency, M, omega_n) & filled
        phase = np.where(filled, phase_lag(force, table, frequency, M, omega_n), np.nan)
    return Branches(omega=omega, amplitude=table, phase=phase, stable=stable)


def sweep(
    force: Force, F: float, omega: FloatArray, M: float, omega_n: float, direction: Literal["up", "down"] = "up"
) -> SteadyState:
    """The steady states that a slow sweep passes, at ``omega`` (increasing, (n,)), with jumps.

    The sweep starts on the stable state of least amplitude and follows the nearest stable state in the plane of
    A exp(-i phi) in steps much finer than ``omega``; at the end of a branch it jumps to another one. NaN where there is
    no stable steady state.
    """
    fine, between = finely(np.asarray(omega, dtype=float))
    return followed(branches(force, F, fine, M, omega_n), between, direction)


def finely(omega: FloatArray) -> tuple[FloatArray, int]:
    """Frequencies refined by steps in which a branch moves little, and the number of steps between two frequencies."""
    between = max(1, int(np.ceil(_FEWEST_STEPS / max(1, omega.size - 1))))
    index = np.arange((omega.size - 1) * between + 1) / between
    return np.interp(index, np.arange(omega.size), omega), between


def followed(states: Branches, between: int, direction: Literal["up", "down"]) -> SteadyState:
    """The states that a slow sweep passes, at every ``between``-th frequency of the branches."""
    size = states.omega.size
    forward = range(size) if direction == "up" else range(size - 1, -1, -1)
    choice = _follow(states, forward)[::between]
    rows = np.arange(0, size, between)
    known = choice >= 0
    amplitude = np.where(known, states.amplitude[rows, choice], np.nan)
    return SteadyState(amplitude=amplitude, phase=np.where(known, states.phase[rows, choice], np.nan))


def _find_roots(
    force: Force, F: float, omega: FloatArray, start: int, M: float, omega_n: float
) -> tuple[IntArray, FloatArray]:
    """Rows and ln A of every root in the block of frequencies that begins at row ``start``."""
    block = omega[start : start + _BLOCK]
    u = np.log(F / (M * omega_n**2)) + _GRID

    def level(points: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        X, slope_X, C, slope = balance(force, np.exp(points), block[rows], M, omega_n)
        squared = np.square(X) + np.square(C)
        return 0.5 * np.log(squared) - np.log(F), (X * slope_X + C * slope) / squared

    row, roots = list_roots(level, u, block.size)
    return start + row, roots


def list_roots(level: Level, u: FloatArray, rows: int) -> tuple[IntArray, FloatArray]:
    """Rows and positions of every root of ``level`` between points of the grid ``u``, sorted by row and position."""
    with np.errstate(all="ignore"):
        value, derivative = level(u, np.arange(rows)[:, np.newaxis])
        row, low, high = _find_brackets(level, u, value, derivative)
        roots = bracketed_newton(lambda points: level(points, row), low, high)
    order = np.lexsort((roots, row))
    return row[order], roots[order]


def _find_brackets(
    level: Level, u: FloatArray, value: FloatArray, derivative: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Rows and ends of all cells, or halves of cells cut at an extremum, over which the value changes sign."""
    above = value >= 0.0
    same = above[:, :-1] == above[:, 1:]
    row, cell = np.nonzero(~same)
    turns = same & (derivative[:, :-1] * derivative[:, 1:] < 0.0) & ((derivative[:, :-1] < 0.0) == above[:, :-1])
    turn_row, turn_cell = np.nonzero(turns)
    extremum = bisect(lambda points: level(points, turn_row)[1], u[turn_cell], u[turn_cell + 1])
    crosses = (level(extremum, turn_row)[0] >= 0.0) != above[turn_row, turn_cell]
    turn_row, turn_cell, extremum = turn_row[crosses], turn_cell[crosses], extremum[crosses]
    rows = np.concatenate([row, turn_row, turn_row])
    low = np.concatenate([u[cell], u[turn_cell], extremum])
    high = np.concatenate([u[cell + 1], extremum, u[turn_cell + 1]])
    return rows, low, high


def by_row(row: IntArray, amplitude: FloatArray, rows: int) -> FloatArray:
    """Amplitudes, sorted by row and size, as a table (rows, most in one row) padded with NaN."""
    counts = np.bincount(row, minlength=rows)
    place = np.arange(row.size) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.full((rows, max(1, int(counts.max(initial=0)))), np.nan)
    table[row, place] = amplitude
    return table


def _follow(states: Branches, forward: range) -> IntArray:
    """Column of the state that the sweep is on at each row, -1 if there is none."""
    phasor, count = states.amplitude * np.exp(-1j * states.phase), states.stable.sum(axis=1)
    choice = np.where(count > 0, np.argmax(states.stable, axis=1), -1)
    for before, i in pairwise(forward):
        if count[i] > 1 and choice[before] >= 0:
            stable = np.flatnonzero(states.stable[i])
            choice[i] = stable[np.argmin(np.abs(phasor[i, stable] - phasor[before, choice[before]]))]
    return choice
