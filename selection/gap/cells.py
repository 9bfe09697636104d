"""Where the gap lies: cells of contiguous rows of one sweep, by residual and by footprint of the explanation."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from selection.arrays import BoolArray, FloatArray, IntArray
from selection.gap.fit import Fit
from selection.gap.rows import Rows, wrapped
from selection.gap.size import nominal_residuals, regular_values
from selection.gap.steady import fitted_terms, steady
from selection.units import RAD_S_PER_HZ

#: Cells of a sweep, each of at least so many rows.
MOST_CELLS, FEWEST_ROWS = 8, 4
#: A footprint is where the explanation changes the prediction by more than this, in units of noise.
VISIBLE = 1.0


@dataclass(frozen=True)
class Cell:
    """Contiguous rows of one sweep and one quantity; frequencies in Hz."""

    sweep: str
    frequency_low: float
    frequency_high: float
    quantity: str


@dataclass(frozen=True)
class ResidualCell(Cell):
    """``share`` of the squared residual at nominal parameters; ``z`` = (sum of squares - n)/sqrt(2 n)."""

    share: float
    z: float


@dataclass(frozen=True)
class FootprintCell(Cell):
    """``size``: root mean square change of the prediction, in units of noise."""

    size: float


def residual_cells(leading: Fit) -> tuple[ResidualCell, ...]:
    """All cells by share of the squared residual of the simulation as given, largest first; shares add to 1.

    Wild points do not count.
    """
    rows = leading.model.problem.rows
    regular = regular_values(leading).astype(float)
    squares = by_quantity(rows, nominal_residuals(leading) ** 2 * regular)
    counts = by_quantity(rows, regular)
    total = max(sum(float(values.sum()) for values in squares.values()), 1e-300)
    found = []
    for quantity, values in squares.items():
        for own in _chunks(rows):
            n, sum_of_squares = counts[quantity][own].sum(), values[own].sum()
            z = (sum_of_squares - n) / np.sqrt(2.0 * max(n, 1.0))
            found.append(ResidualCell(*_place(rows, own, quantity), float(sum_of_squares / total), float(z)))
    return tuple(sorted(found, key=lambda cell: -cell.share))


def footprint(leading: Fit) -> dict[str, FloatArray]:
    """Change of the prediction by the explanation, in units of noise, (n,) by quantity; all else the same."""
    rows = leading.model.problem.rows
    with_effects = steady(fitted_terms(leading), rows, rows.u)
    without = steady(fitted_terms(leading, effects=False), rows, with_effects.u)
    changes = {"amplitude": (with_effects.u - without.u) / rows.sd_amplitude}
    if rows.has_phase:
        changes["phase"] = wrapped(with_effects.phase - without.phase) / rows.sd_phase
    return changes


def footprint_cells(leading: Fit) -> tuple[FootprintCell, ...]:
    """Runs of rows that the explanation changes visibly, largest first; none without an explanation."""
    if not leading.model.parts:
        return ()
    rows = leading.model.problem.rows
    found = []
    for quantity, change in footprint(leading).items():
        for own in _runs(rows, np.abs(change) > VISIBLE):
            size = float(np.sqrt(np.mean(change[own] ** 2)))
            found.append(FootprintCell(*_place(rows, own, quantity), size))
    return tuple(sorted(found, key=lambda cell: -cell.size))


def by_quantity(rows: Rows, values: FloatArray) -> dict[str, FloatArray]:
    """Values (m,) split into amplitude and, where there are any, phase."""
    parts = values.reshape(-1, len(rows))
    return dict(zip(("amplitude", "phase"), parts, strict=False))


def _place(rows: Rows, own: IntArray, quantity: str) -> tuple[str, float, float, str]:
    hertz = rows.omega[own] / RAD_S_PER_HZ
    return rows.sweeps[rows.sweep[own[0]]], float(hertz.min()), float(hertz.max()), quantity


def _chunks(rows: Rows) -> Iterator[IntArray]:
    """Rows of each sweep in contiguous parts of about one size."""
    for number in range(len(rows.sweeps)):
        own = np.flatnonzero(rows.sweep == number)
        yield from np.array_split(own, min(MOST_CELLS, max(1, len(own) // FEWEST_ROWS)))


def _runs(rows: Rows, marked: BoolArray) -> Iterator[IntArray]:
    """Longest runs of marked rows within a sweep."""
    for number in range(len(rows.sweeps)):
        own = np.flatnonzero(rows.sweep == number)
        ends = np.flatnonzero(np.diff(marked[own].astype(int))) + 1
        for part in np.split(own, ends):
            if len(part) and marked[part[0]]:
                yield part
