"""The best fit of a law with coefficients >= 0.

For given shapes a law is linear in its coefficients, C(A, omega) = sum_j c_j u_j(A, omega), and the distance of a row
from it (:func:`damping.infer.likelihood.residuals`) is

    n_i = (D_i - C_i)/sqrt(g_i^2 + R_i^2),      g = dC/d ln A.

The sum of n_i^2 over the variance of each row is minimised over c >= 0 by iteratively reweighted least squares
(:func:`damping.infer.solve_nonnegative_batch`). Shapes are searched over the range of their prior, many at once.
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

REWEIGHTINGS = 12  #: passes of reweighting, which converges quadratically: a dozen reach rounding
NOTHING = 1e-12  #: share of the force below which a coefficient is taken as rounding
STEADY = 1e-12  #: relative change of the sum of squares at which reweighting stops in the final fit
SEARCHED = 1e-7  #: the same while shapes are searched: a tenth of what ``SEARCHED_BITS`` can tell
#: Binary digits of the squares compared in that search. Of equal points that of largest prior is taken, so that the
#: result does not depend on the order of the rows.
SEARCHED_BITS = 20
#: Squares taken as rounding: of a row that is 1e-8 off. Many shapes leave no more where a law can fit every point.
EXACT = 1e-12
SHAPE_GRID = (np.arange(24) + 0.5) / 24.0  #: prior quantiles at which a shape is tried first: 24 of equal probability
EXTREME = (0.001, 0.999)  #: prior quantiles between which it is then refined
SHAPE_STEP = 2e-3  #: width at which that ends, in standard normal variables: squares are then known to a millionth
REFINED_POINTS = 9  #: points of each axis in a refinement, from one neighbour of the best point to the other
MOST_SOLVED = 30_000  #: most rows times shape points solved at once: arrays stay within a megabyte


@dataclass(frozen=True)
class BestFit:
    """A law at its best coefficients >= 0."""

    coordinates: Coordinates  #: the law on its record
    coefficients: FloatArray  #: (components,)
    shapes: tuple[dict[str, float], ...]  #: of each component by name
    point: FloatArray  #: the shapes as standard normal variables (shapes,)
    n: FloatArray  #: residual of each row, relative amplitude or rad (rows,)
    squares: float  #: sum of n^2 over the variance of the rows

    @property
    def law(self) -> Law:
        """The law that was fitted."""
        return self.coordinates.law

    @property
    def force(self) -> Sum:
        """The fitted damping force."""
        return build_force(self.law, self.coefficients, self.shapes)

    @property
    def parameters(self) -> int:
        """Number of fitted parameters that are not at their bound."""
        present = self.coefficients > 0.0
        return int(present.sum()) + sum(len(s) for s, there in zip(self.shapes, present, strict=True) if there)


def build_force(law: Law, coefficients: FloatArray, shapes: Sequence[Mapping[str, Floats]]) -> Sum:
    """The force of a law in the units of the record: ``coefficients`` (parts, ...) and ``shapes`` by name, (...)."""
    parts = zip(law.parts, coefficients, shapes, strict=True)
    return Sum(tuple(part.build(c, **values) for part, c, values in parts))


def fit_law(law: Law, data: Observations) -> BestFit:
    """The best fit of a law (:func:`fit_laws`).

    AnalysisError: a part of the law is never met at the tested amplitudes.
    """
    fit = fit_laws([law], data)[0]
    if isinstance(fit, AnalysisError):
        raise fit
    return fit


def fit_laws(laws: Sequence[Law], *records: Observations) -> list[BestFit | AnalysisError]:
    """The best fit of each law to each record, or the error that a part is never met at the tested amplitudes.

    In order of records, then of laws. Problems with equal numbers of terms, shapes and rows are searched together. They
    are dimensionless, so that units cannot change a fit. Fits of a single record are cached.
    """
    bare = [record.scaled(FITTED_BITS) for record in records]
    fits = [_remember_fits(bare[0].content)] if len(bare) == 1 else [dict[_Key, Searched | None]() for _ in bare]
    groups: dict[tuple[int, int, int], list[tuple[int, Coordinates]]] = {}
    for i, scaled in enumerate(bare):
        for law in laws:
            if (law, law.parts) not in fits[i]:
                sizes = len(law.parts), len(law.free_shapes), len(scaled.A)
                groups.setdefault(sizes, []).append((i, Coordinates.of(law, scaled)))
    for members in groups.values():
        searched = _search_shapes([(pure, bare[i]) for i, pure in members])
        for (i, pure), fit in zip(members, searched, strict=True):
            fits[i][pure.law, pure.law.parts] = fit
    return [
        _restore_units(Coordinates.of(law, scaled), known[law, law.parts], record)
        for record, scaled, known in zip(records, bare, fits, strict=True)
        for law in laws
    ]


#: A law with its forces: a force registered later may reuse a name.
_Key: TypeAlias = tuple[Law, tuple[Component, ...]]


@lru_cache(maxsize=4)
def _remember_fits(record: tuple[object, ...]) -> dict[_Key, Searched | None]:
    """Cache of the fits of a dimensionless record, empty at first: rankings and load predictions need the same fits."""
    return {}


Problem = tuple[Coordinates, Observations]  #: a law and a record, both dimensionless
#: Shapes of a best fit as standard normal variables (shapes,), its coefficients (parts,), and the sum of squares.
Searched = tuple[FloatArray, FloatArray, float]


def _restore_units(pure: Coordinates, searched: Searched | None, data: Observations) -> BestFit | AnalysisError:
    """A dimensionless fit in the units of the record."""
    if searched is None:
        return AnalysisError(f"{pure.law.name}: a part of it does not act at the tested amplitudes")
    point, solved, squares = searched
    coordinates = Coordinates.of(pure.law, data)
    x = coordinates.place(point)
    per_force = np.array(coordinates.coefficients(x)) / data.reference[2]
    pure_force = solved / np.array(pure.coefficients(x))
    coefficients = pure_force * per_force * data.reference[2]
    shapes = tuple({name: float(value) for name, value in part.items()} for part in coordinates.shapes(x))
    n = np.asarray(residuals(build_force(pure.law, coefficients, shapes), data)[0])
    return BestFit(coordinates, coefficients, shapes, point, n, squares if np.isfinite(n).all() else np.inf)


def _search_shapes(problems: Sequence[Problem]) -> list[Searched | None]:
    """Least-squares shapes of laws with equal numbers of terms, shapes and rows; None for a part that is never met.

    The search starts on a grid over the prior. Each further grid spans the neighbours of the best point.
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
            equal = np.flatnonzero(rounded == rounded.min())
            k = int(equal[np.argmin(np.sum(points[i][equal] ** 2, axis=1))])
            if before is None or rounded[k] < least[i]:
                best[i] = before = points[i][k], solved[k], float(squares[k])
                least[i] = float(rounded[k])
            # the neighbours of the best point on each axis
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
    """Coefficients >= 0 (points, parts) and sums of squares (points,) of each law at its points (points, shapes)."""
    most = max(1, MOST_SOLVED // (len(problems[0][1].A) * max(len(x) for x in points.values())))
    solved: dict[int, tuple[FloatArray, FloatArray]] = {}
    for first in range(0, len(points), most):
        batch = list(points)[first : first + most]
        units = [_tabulate_units(points[i], *problems[i]) for i in batch]
        columns, slopes = (np.concatenate(arrays) for arrays in zip(*units, strict=True))
        number = [len(points[i]) for i in batch]
        records = [problems[i][1] for i in batch]
        of_each = [(data.D, data.R**2, data.variance, data.sd_amplitude**2) for data in records]
        rows = _Batch(*(np.repeat(field, number, axis=0) for field in zip(*of_each, strict=True)))
        carried, squares = _solve(columns, slopes, rows, steady)
        for i, size, end in zip(batch, number, np.cumsum(number), strict=True):
            solved[i] = carried[end - size : end], squares[end - size : end]
    return solved


class _Batch(NamedTuple):
    """Rows of k problems: D, R^2, and the stated variance of D - C, constant and per g^2; (k, rows) each."""

    D: FloatArray
    across: FloatArray
    known: FloatArray
    of_growth: FloatArray

    def take(self, problems: IntArray) -> _Batch:
        """The rows of some problems."""
        return _Batch(*(field[problems] for field in self))

    def find_variance(self, g: FloatArray) -> FloatArray:
        """Variance of D - C: circular scatter of the phasor, and the stated uncertainties."""
        spread = np.maximum(g**2 + self.across, 1e-12 * self.D**2)
        return np.asarray(SCATTER_MEDIAN**2 * spread + g**2 * self.of_growth + self.known)


def _solve(columns: FloatArray, slopes: FloatArray, rows: _Batch, steady: float) -> tuple[FloatArray, FloatArray]:
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
        X, data, weight = columns[moving], rows.take(moving), 1.0 / np.sqrt(variance)
        fit = solve_nonnegative_batch(X * weight[:, :, None], data.D * weight)
        fit[fit < NOTHING * fit.max(axis=1, keepdims=True)] = 0.0
        variance = data.find_variance(np.einsum("kij,kj->ki", slopes[moving], fit))
        misfit = data.D - np.einsum("kij,kj->ki", X, fit)
        previous, now = squares[moving], np.sum(misfit**2 / variance, axis=1)
        carried[moving], squares[moving] = fit, now
        # each problem stops separately, so that its fit does not depend on the others solved with it
        still = (np.abs(now - previous) > steady * now) & np.isfinite(now)
        moving, variance = moving[still], variance[still]
        if not moving.size:
            break
    squares = np.where(np.isfinite(squares), squares, np.inf)
    return carried / scale, np.where(met.all(axis=1), squares, np.nan)


def _tabulate_units(points: FloatArray, coordinates: Coordinates, data: Observations) -> tuple[FloatArray, FloatArray]:
    """C and dC/d ln A of each part with unit coefficient, (points, rows, parts); C twice where amplitude is input."""
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
