"""The design of a regression: columns of terms and response, and their orthogonal decomposition.

Where a table has ``amplitude`` or ``frequency`` but no column ``A`` or ``omega``, those stand for ``amplitude`` and
2 pi ``frequency``. A missing ``energy`` is the energy input per cycle, pi * force * amplitude * sin(phase).

Columns of an energy polynomial are nearly dependent (the nine terms of Eq. 5.3.6 have a scaled condition number of
1e7). One decomposition in doubles loses as many digits as the condition number has. Therefore the inverse of its
triangular factor is applied to the original columns in twice the working precision. The result is orthonormal except
for rounding, and a second decomposition of it loses nothing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, FloatArray, IntArray
from damping.errors import AnalysisError, InputError, describe_nearest
from damping.records.record import Record, energy_per_cycle, find_problems
from damping.records.text import NUMBER
from damping.regression import Term, times_matrix

_ALIASES = {"A": ("amplitude", 1.0), "omega": ("frequency", RAD_S_PER_HZ)}


@dataclass(frozen=True)
class Columns:
    """The data of a regression."""

    numbers: dict[str, FloatArray]  #: the column (n,) of each requested name
    rows: IntArray  #: of the table used, from 0, (n,)
    notes: tuple[str, ...]  #: on derived and omitted values

    def __len__(self) -> int:
        return len(self.rows)


def list_sources(name: str, available: Collection[str]) -> tuple[str, ...]:
    """The columns of the table from which ``name`` is derived; ``name`` itself if it cannot be derived.

    A column whose name has blanks is found with or without them.
    """
    if name in available:
        return (name,)
    for column in available:
        if "".join(column.split()) == "".join(name.split()):
            return (column,)
    if name in _ALIASES and _ALIASES[name][0] in available:
        return (_ALIASES[name][0],)
    if name == "energy" and {"force", "amplitude"} <= set(available):
        return ("force", "amplitude", "sweep" if "sweep" in available and "phase" not in available else "phase")
    return (name,)


def list_required_columns(names: Collection[str], available: Collection[str]) -> tuple[str, ...]:
    """The columns of the table from which ``names`` are derived, each once. InputError for a number that is none."""
    derived = [name for name in (*_ALIASES, "energy") if list_sources(name, available) != (name,)]
    for name in names:
        if name in available or list_sources(name, available) != (name,):
            continue
        if NUMBER.fullmatch(name):
            raise InputError(f"missing column {name}", expected="columns alone: the fit gives each term its factor")
        if (nearest := describe_nearest(name, [*available, *derived], likeness=0.6)) in derived:
            known = f"a column of the table, or {', '.join(derived)}, which follow from it"
            raise InputError(f"missing column {name} (is {nearest!r} meant?)", expected=known)
    return tuple(dict.fromkeys(column for name in names for column in list_sources(name, available)))


def take_columns(table: pd.DataFrame, names: Iterable[str], source: str = "table") -> Columns:
    """The columns of ``names``, of response and factors, each once; ``source`` names the table in messages.

    ``table`` holds what ``list_required_columns`` names, as finite numbers (``sweep`` excepted). Without ``phase``, an
    energy to be derived is known at phase resonance only, where it is pi * force * amplitude: the row of largest
    amplitude of each sweep is used and the others are omitted.

    InputError: an energy to be derived from what no record holds, such as phases in degrees. AnalysisError: no row
    remains.
    """
    values: dict[str, FloatArray] = {}
    notes: list[str] = []
    for name in names:
        sources = list_sources(name, list(table.columns))
        if len(sources) == 1:
            factor = 1.0 if sources[0] == name or name not in _ALIASES else _ALIASES[name][1]
            values[name] = factor * table[sources[0]].to_numpy(dtype=np.float64)
        else:
            _check_energy_sources(table[list(sources)], source)
            values[name] = energy_per_cycle(Record.trusted(table.reset_index(drop=True), source))
            notes.append("energy = pi * force * amplitude" + (" * sin(phase)" if sources[2] == "phase" else ""))
    keep = np.all([np.isfinite(column) for column in values.values()], axis=0)
    if not keep.any():
        raise AnalysisError(f"{source}: no row has a value for every column")
    if not keep.all():
        notes.append(f"no phase: {int(keep.sum())} rows at phase resonance of {len(keep)} are used")
    return Columns({name: column[keep] for name, column in values.items()}, np.flatnonzero(keep), tuple(notes))


def _check_energy_sources(table: pd.DataFrame, source: str) -> None:
    """InputError: the first cell outside the range of its column in a record. Repeated rows are allowed."""
    problems = [problem for problem in find_problems(table) if problem.column is not None]
    if problems:
        first = min(problems, key=lambda problem: problem.row)
        message = f"{first.message} at observation {first.row + 1}, from which energy follows"
        raise InputError(message, file=source, column=first.column, expected=first.expected)


@dataclass(frozen=True)
class Design:
    """Transformed variables phi_k(Q_j) and response E(Q_j)."""

    names: tuple[str, ...]  #: of the terms (k)
    columns: FloatArray  #: one per term, (n, k)
    tails: FloatArray  #: their rounding errors as doubles (0 if unknown), (n, k)
    response: str  #: its name
    observed: FloatArray  #: the response, (n,)

    @property
    def n(self) -> int:
        """Number of observations (the report's m)."""
        return len(self.observed)

    @property
    def k(self) -> int:
        """Number of terms (the report's n)."""
        return len(self.names)

    def take(self, terms: Sequence[int] | IntArray) -> Design:
        """The design with only these terms, in this order."""
        chosen = np.asarray(terms, dtype=np.int64)
        names = tuple(self.names[i] for i in chosen)
        return Design(names, self.columns[:, chosen], self.tails[:, chosen], self.response, self.observed)


#: Sums of squares of numbers from here to its inverse neither vanish nor overflow, with digits to spare.
LEAST_NUMBER = 1e-140


def design_of(columns: Columns, response: str, terms: Sequence[Term]) -> Design:
    """The design of terms on the columns of a table.

    AnalysisError: a term has no finite value somewhere, or numbers too large or small to be squared.
    """
    pairs = [term.values(columns.numbers.__getitem__, len(columns)) for term in terms]
    heads, tails = (np.column_stack(parts) for parts in zip(*pairs, strict=True))
    design = Design(tuple(term.name for term in terms), heads, tails, response, columns.numbers[response])
    for name, values in zip((*design.names, response), (*heads.T, design.observed), strict=True):
        largest = float(np.abs(values).max())
        if not (largest == 0.0 or LEAST_NUMBER <= largest <= 1.0 / LEAST_NUMBER):
            raise AnalysisError(f"numbers of {name} reach {largest:.3g}, too far from 1 to be squared: change the unit")
    return design


def design_of_arrays(
    columns: FloatArray, observed: FloatArray, names: Sequence[str] = (), response: str = "response"
) -> Design:
    """The design of arrays (n, k) and (n,). AnalysisError: shapes that do not fit or a number that is not finite."""
    columns, observed = np.asarray(columns, dtype=np.float64), np.asarray(observed, dtype=np.float64)
    if columns.ndim != 2 or observed.shape != columns.shape[:1] or columns.size == 0:
        raise AnalysisError(f"columns of shape {columns.shape} do not fit a response of shape {observed.shape}")
    if not (np.isfinite(columns).all() and np.isfinite(observed).all()):
        raise AnalysisError("columns and response must be finite")
    names = tuple(names) or tuple(f"column {i + 1}" for i in range(columns.shape[1]))
    return Design(names, columns, np.zeros_like(columns), response, observed)


def tabulate_variables(design: Design) -> pd.DataFrame:
    """The "Sum", "Average value", "Standard Deviation" (with 1/m) and "Sum of Squares" (section 5.2).

    A row for each transformed variable, then one for the response.
    """
    columns = [*design.columns.T, design.observed]
    with np.errstate(over="ignore"):
        numbers = {
            "sum": [values.sum() for values in columns],
            "mean": [values.mean() for values in columns],
            "standard_deviation": [values.std() for values in columns],
            "sum_of_squares": [np.sum(values**2) for values in columns],
        }
    return pd.DataFrame({"name": [*design.names, design.response], **numbers})


def correlations(design: Design) -> FloatArray:
    """Correlation coefficients of all pairs of transformed variables and response (k+1, k+1), the response last.

    NaN in row and column of a variable that does not vary.
    """
    values = np.column_stack([design.columns, design.observed])
    centred = values - values.mean(axis=0)
    largest = np.abs(values).max(axis=0)
    norm = np.linalg.norm(centred, axis=0)
    varies = norm > 8.0 * np.finfo(np.float64).eps * math.sqrt(len(values)) * largest  # else the mean's own rounding
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = np.where(varies, centred / norm, np.nan)
    result = np.clip(unit.T @ unit, -1.0, 1.0)
    result[np.diag_indices_from(result)] = np.where(varies, 1.0, np.nan)
    return np.asarray(result)


#: Exactly dependent columns have a smallest singular value of up to 3 roundings (measured, 5 to 100 000 rows).
LARGEST_CONDITION = 1.0 / (16.0 * float(np.finfo(np.float64).eps))
_TAKES_PART = 1e-6  # share of a column, scaled to unit norm, in the combination that vanishes


@dataclass(frozen=True)
class Basis:
    """columns / scale = orthonormal @ factor."""

    scale: FloatArray  #: powers of two, so scaling rounds nothing, (k,)
    orthonormal: FloatArray  #: (n, k)
    factor: FloatArray  #: upper triangular, (k, k)
    inverse: FloatArray  #: of the factor, (k, k)
    condition_number: float  #: of the columns scaled to unit norm


def decompose(design: Design) -> Basis:
    """The orthonormal basis of a design.

    AnalysisError: a column of zeros, fewer observations than terms, or a scaled condition number above
        ``LARGEST_CONDITION`` (the design is then only rounding error); the columns are named.
    """
    largest = np.abs(design.columns).max(axis=0)
    zero = [name for name, size in zip(design.names, largest, strict=True) if size == 0.0]
    if zero:
        raise AnalysisError(f"rank-deficient: {', '.join(zero)} is zero at every observation")
    if design.n < design.k:
        names = ", ".join(design.names)
        raise AnalysisError(f"rank-deficient: fewer observations ({design.n}) than terms ({design.k}): {names}")
    scale = power_of_two(largest)
    head, tail = design.columns / scale, design.tails / scale
    first = np.asarray(np.linalg.qr(head, mode="r"))
    condition_number = _checked_condition(first, design)
    inverse = np.linalg.inv(first)
    orthonormal, second = np.linalg.qr(times_matrix((head, tail), inverse))
    inverse = inverse @ np.linalg.inv(second)
    return Basis(scale, orthonormal, second @ first, inverse, condition_number)


def solve_nonnegative(factor: FloatArray, along: FloatArray) -> FloatArray:
    """Coefficients >= 0 (k,) that bring ``factor`` (m, k) nearest to ``along`` (m,): Lawson and Hanson's active set.

    AnalysisError: no solution is found.
    """
    from scipy.optimize import nnls  # noqa: PLC0415 - slow to import, and few regressions need it

    try:
        return np.asarray(nnls(factor, along, maxiter=100 * len(along))[0])
    except RuntimeError as error:
        raise AnalysisError(f"no least-squares fit with coefficients >= 0 was found: {error}") from error


def power_of_two(size: FloatArray) -> FloatArray:
    """The power of two next above each size; 1 for a size of 0."""
    return np.asarray(np.ldexp(1.0, np.where(size > 0.0, np.clip(np.frexp(size)[1], -1000, 1000), 0)))


def _checked_condition(factor: FloatArray, design: Design) -> float:
    _, singular, rows = np.linalg.svd(factor / np.linalg.norm(factor, axis=0))
    condition = float(singular[0] / max(singular[-1], np.finfo(np.float64).tiny))
    if condition <= LARGEST_CONDITION:
        return condition
    vanishing = rows[singular * LARGEST_CONDITION < singular[0]]
    share = np.linalg.norm(vanishing, axis=0)
    names = ", ".join(name for name, part in zip(design.names, share, strict=True) if part > _TAKES_PART)
    raise AnalysisError(f"rank-deficient: the columns {names} are dependent to within rounding; leave one out")
