"""The best fit of a law with coefficients >= 0.

For given shapes a law is linear in its coefficients, C(A, omega) = sum_j c_j u_j(A, omega), and the distance of a row
from it (:func:`damping.infer.likelihood.residuals`) is

    n_i = (D_i - C_i)/sqrt(g_i^2 + R_i^2),      g = dC/d ln A.

Its sum of squares over the variance of each row is minimised over c >= 0 by least squares on every set of terms (of
those whose coefficients are >= 0 the best), or by Lawson and Hanson's method (1974) where there are many terms; the
weights are taken again from the fit until they stay. Shapes are searched over their prior's range, many at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy.special import ndtri

from damping.arrays import FloatArray, Floats, IntArray
from damping.errors import AnalysisError
from damping.forces import Component
from damping.forces.contract import Sum
from damping.infer import solve_nonnegative_batch
from damping.infer.law import SCATTER_MEDIAN, Coordinates, Law
from damping.infer.likelihood import residuals
from damping.infer.observations import FITTED_BITS, Observations, round_bits

#: Passes of reweighting: weights follow the fit quadratically, so that a dozen reach rounding.
REWEIGHTINGS = 12
#: Share of the force below which a coefficient is rounding.
NOTHING = 1e-12
#: Relative change of the sum of squares at which reweighting stops, at the end and while shapes are searched.
STEADY = 1e-12
SEARCHED = 1e-7
#: Binary digits of the squares by which points are compared in that search: of equal ones the most probable before the
#: test, whichever way the rows stand.
SEARCHED_BITS = 20
#: Squares that are rounding: of a row that is 1e-8 off. Many shapes of a law leave no more where it can pass through
#: every point.
EXACT = 1e-12
#: Prior probabilities at which a shape parameter is tried before it is refined: its range in 24 equal parts.
SHAPE_GRID = (np.arange(24) + 0.5) / 24.0
#: Prior probabilities between which a shape is refined; width at which its search ends, standard
#: normal variables: squares are then known to a millionth.
EXTREME = (0.001, 0.999)
SHAPE_STEP = 2e-3
#: Points of each axis that a refinement tries at once, from one neighbour of the best to the other.
REFINED_POINTS = 9
#: Rows times points of shapes that are solved at once: their arrays stay within tens of megabytes.
MOST = 250_000


@dataclass(frozen=True)
class BestFit:
    """A law at its best coefficients >= 0.

    Attributes:
        coordinates: the law on its record. coefficients: (components,). shapes: of each component by name, ``point``
        the same as standard normal variables (shapes,).
        n: residual of each row, relative amplitude or rad (rows,). squares: sum of n^2 over the variance of the rows.
        parameters: coefficients above 0 and shapes.
    """

    coordinates: Coordinates
    coefficients: FloatArray
    shapes: tuple[dict[str, float], ...]
    point: FloatArray
    n: FloatArray
    squares: float

    @property
    def law(self) -> Law:
        """The law that was fitted."""
        return self.coordinates.law

    @property
    def force(self) -> Sum:
        """Its damping force."""
        return build_force(self.law, self.coefficients, self.shapes)

    @property
    def variables(self) -> FloatArray:
        """The standard normal variables x (dimension,) of this fit: where a search for the posterior's mode begins."""
        return self.coordinates.find_variables(self.coefficients, self.point, float(np.sqrt(np.mean(self.n**2))))

    @property
    def parameters(self) -> int:
        """Numbers that were fitted and are not at their bound."""
        present = self.coefficients > 0.0
        return int(present.sum()) + sum(len(s) for s, there in zip(self.shapes, present, strict=True) if there)


def build_force(law: Law, coefficients: FloatArray, shapes: Sequence[Mapping[str, Floats]]) -> Sum:
    """The force of a law in the units of the record: ``coefficients`` (parts, ...) and ``shapes`` by name, (...)."""
    parts = zip(law.parts, coefficients, shapes, strict=True)
    return Sum(tuple(part.build(c, **values) for part, c, values in parts))


def fit_law(law: Law, data: Observations) -> BestFit:
    """The best fit of a law (:func:`fit_laws`).

    Raises:
        AnalysisError: a part of the law is never met at the tested amplitudes.
    """
    fit = fit_laws([law], data)[0]
    if isinstance(fit, AnalysisError):
        raise fit
    return fit


def fit_laws(laws: Sequence[Law], *records: Observations) -> list[BestFit | AnalysisError]:
    """The best fit of each law to each record, or why there is none: a part is never met at the tested amplitudes.

    All laws to the first record, then to the next. Those with as many terms and shapes on as many rows are searched
    together; without dimension, so that units cannot move a fit. Fits of one record alone are remembered.
    """
    bare = [record.scaled(FITTED_BITS) for record in records]
    found = [_remember_fits(bare[0].content)] if len(bare) == 1 else [dict[_Key, Searched | None]() for _ in bare]
    groups: dict[tuple[int, int, int], list[tuple[int, Coordinates]]] = {}
    for i, scaled in enumerate(bare):
        for law in laws:
            if (law, law.parts) not in found[i]:
                alike = len(law.parts), len(law.free_shapes), len(scaled.A)
                groups.setdefault(alike, []).append((i, Coordinates.of(law, scaled)))
    for members in groups.values():
        searched = _search_shapes([(pure, bare[i]) for i, pure in members])
        for (i, pure), fit in zip(members, searched, strict=True):
            found[i][pure.law, pure.law.parts] = fit
    return [
        _restore_units(Coordinates.of(law, scaled), known[law, law.parts], record)
        for record, scaled, known in zip(records, bare, found, strict=True)
        for law in laws
    ]


#: A law with its forces, which the library may have under the same name later than others.
_Key: TypeAlias = tuple[Law, tuple[Component, ...]]


@lru_cache(maxsize=4)
def _remember_fits(record: tuple[object, ...]) -> dict[_Key, Searched | None]:
    """Fits of a record without dimension, empty at first: a ranking and predictions of loads ask for the same ones."""
    return {}


#: A law and a record, both without dimension.
Problem = tuple[Coordinates, Observations]
#: Shapes of a best fit as standard normal variables (shapes,), its coefficients (parts,), and the squares it leaves.
Searched = tuple[FloatArray, FloatArray, float]


def _restore_units(pure: Coordinates, searched: Searched | None, data: Observations) -> BestFit | AnalysisError:
    """A fit that was sought without dimension."""
    if searched is None:
        return AnalysisError(f"{pure.law.name}: a part of it does not act at the tested amplitudes")
    point, solved, squares = searched
    coordinates = Coordinates.of(pure.law, data)
    x = coordinates.place(point)
    per_force = np.array([float(c) for c in coordinates.coefficients(x)]) / data.reference[2]
    pure_force = solved / np.array([float(c) for c in pure.coefficients(x)])
    coefficients = pure_force * per_force * data.reference[2]
    shapes = tuple({name: float(value) for name, value in part.items()} for part in coordinates.shapes(x))
    n = np.asarray(residuals(build_force(pure.law, coefficients, shapes), data)[0])
    return BestFit(coordinates, coefficients, shapes, point, n, squares if np.isfinite(n).all() else np.inf)


def _search_shapes(problems: Sequence[Problem]) -> list[Searched | None]:
    """The shapes of least squares of laws with as many terms, shapes and rows; None of one with a part never met.

    The best of a grid over the prior; then grids around the best, each a neighbour's distance wide.
    """
    free = len(problems[0][0].law.free_shapes)
    axes = {i: [ndtri(SHAPE_GRID)] * free for i in range(len(problems))}
    best: dict[int, Searched | None] = {}
    least: dict[int, float] = {}
    low, high = ndtri(EXTREME[0]), ndtri(EXTREME[1])
    while axes:
        points = {i: np.array(list(product(*axis)), dtype=float) for i, axis in axes.items()}
        for i, (solved, squares) in _solve_all(points, problems, STEADY if not free else SEARCHED).items():
            if np.isnan(squares).any():
                best[i] = None
                del axes[i]
                continue
            before, rounded = best.get(i), round_bits(np.maximum(squares, EXACT), SEARCHED_BITS)
            alike = np.flatnonzero(rounded == rounded.min())
            k = int(alike[np.argmin(np.sum(points[i][alike] ** 2, axis=1))])
            if before is None or rounded[k] < least[i]:
                best[i] = before = points[i][k], solved[k], float(squares[k])
                least[i] = float(rounded[k])
            # the neighbours of the best on each axis, and how far off the farther is
            spans = [
                (axis[axis < value].max(initial=low), axis[axis > value].min(initial=high))
                for axis, value in zip(axes[i], before[0], strict=True)
            ]
            axes[i] = [np.linspace(start, end, REFINED_POINTS) for start, end in spans]
            if all(end - start < SHAPE_STEP for start, end in spans):
                del axes[i]
    ends = {i: searched[0][None] for i, searched in best.items() if searched is not None}
    if free and ends:
        for i, (solved, squares) in _solve_all(ends, problems, STEADY).items():
            best[i] = ends[i][0], solved[0], float(squares[0])
    return [best[i] for i in range(len(problems))]


def _solve_all(
    points: dict[int, FloatArray], problems: Sequence[Problem], steady: float
) -> dict[int, tuple[FloatArray, FloatArray]]:
    """Coefficients >= 0 (points, parts) and the squares left (points,) of each law at its points (points, shapes)."""
    most = max(1, MOST // (len(problems[0][1].A) * max(len(x) for x in points.values())))
    solved: dict[int, tuple[FloatArray, FloatArray]] = {}
    for first in range(0, len(points), most):
        some = list(points)[first : first + most]
        units = [_tabulate_units(points[i], *problems[i]) for i in some]
        columns, slopes = (np.concatenate(arrays) for arrays in zip(*units, strict=True))
        number = [len(points[i]) for i in some]
        by_name = zip(*(_Rows.of(problems[i][1]) for i in some), strict=True)
        rows = _Rows(*(np.repeat(own, number, axis=0) for own in by_name))
        carried, squares = _solve(columns, slopes, rows, steady)
        ends = np.cumsum(number)[:-1]
        solved |= dict(zip(some, zip(np.split(carried, ends), np.split(squares, ends), strict=True), strict=True))
    return solved


class _Rows(NamedTuple):
    """D, R^2, and the known variance of D - C, constant and over g^2: (rows,) of a record, (k, rows) of problems."""

    D: FloatArray
    across: FloatArray
    known: FloatArray
    of_growth: FloatArray

    @classmethod
    def of(cls, data: Observations) -> _Rows:
        known = data.R**2 * data.sd_phase**2 + data.D**2 * data.sd_force**2
        return cls(data.D, data.R**2, known, data.sd_amplitude**2)

    def take(self, problems: IntArray) -> _Rows:
        """Those of some problems."""
        return _Rows(*(own[problems] for own in self))

    def find_variance(self, g: FloatArray) -> FloatArray:
        """Variance of D - C: circular scatter of the phasor, and the record's own uncertainties."""
        spread = np.maximum(g**2 + self.across, 1e-12 * self.D**2)
        return np.asarray(SCATTER_MEDIAN**2 * spread + g**2 * self.of_growth + self.known)


def _solve(columns: FloatArray, slopes: FloatArray, rows: _Rows, steady: float) -> tuple[FloatArray, FloatArray]:
    """Coefficients >= 0 (k, parts) on columns C and dC/d ln A (k, rows, parts), and the squares they leave (k,).

    A coefficient that carries less than ``NOTHING`` of the force is 0. Infinite squares: no such coefficients; NaN: a
    column of zeros.
    """
    scale = columns.max(axis=1)
    met = scale > 0.0
    scale = np.where(met, scale, 1.0)
    columns = np.where(met[:, None, :], columns / scale[:, None, :], 1.0)  # so that equations can be solved
    slopes = slopes / scale[:, None, :]
    carried, squares = np.zeros(scale.shape), np.full(len(scale), np.inf)
    moving, variance = np.arange(len(scale)), rows.find_variance(np.abs(rows.D))
    for _ in range(REWEIGHTINGS):
        X, own, weight = columns[moving], rows.take(moving), 1.0 / np.sqrt(variance)
        fit = solve_nonnegative_batch(X * weight[:, :, None], own.D * weight)
        fit[fit < NOTHING * fit.max(axis=1, keepdims=True)] = 0.0
        variance = own.find_variance(np.einsum("kij,kj->ki", slopes[moving], fit))
        left = own.D - np.einsum("kij,kj->ki", X, fit)
        previous, now = squares[moving], np.sum(left**2 / variance, axis=1)
        carried[moving], squares[moving] = fit, now
        # each problem stops for itself, so that its fit does not depend on which others are solved with it
        still = (np.abs(now - previous) > steady * now) & np.isfinite(now)
        moving, variance = moving[still], variance[still]
        if not moving.size:
            break
    squares = np.where(np.isfinite(squares), squares, np.inf)
    return carried / scale, np.where(met.all(axis=1), squares, np.nan)


def _tabulate_units(points: FloatArray, coordinates: Coordinates, data: Observations) -> tuple[FloatArray, FloatArray]:
    """C and dC/d ln A of each part with coefficient 1, each (points, rows, parts); C twice where amplitude is input."""
    shapes = coordinates.shapes(coordinates.place(points))
    units = [
        part.build(1.0, **{name: value[:, None] for name, value in values.items()})
        for part, values in zip(coordinates.law.parts, shapes, strict=True)
    ]
    size = (len(points), len(data.A))
    grown = [unit.grow(data.A, data.omega) for unit in units]
    columns, slopes = (
        np.stack([np.broadcast_to(part, size) for part in of], axis=-1) for of in zip(*grown, strict=True)
    )
    return columns, columns if data.amplitude_is_input else slopes
