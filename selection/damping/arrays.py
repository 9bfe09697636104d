"""Array types for signatures, unit constants, phase wrapping, and conversion of results to plain Python values."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from itertools import chain
from math import pi
from typing import Any, TypeAlias, TypeVar, cast

import numpy as np
import numpy.typing as npt

FloatArray: TypeAlias = npt.NDArray[np.float64]
ComplexArray: TypeAlias = npt.NDArray[np.complex128]
IntArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
#: A number or several, as arguments of the interface take them.
Numbers: TypeAlias = float | Sequence[float] | FloatArray
#: A number, or an array that broadcasts with the other arguments.
Floats: TypeAlias = float | FloatArray
_Rows = TypeVar("_Rows")


#: Acceleration of gravity that the report divides by (section 3.1, "multiplying by 386"), in/s^2.
STANDARD_GRAVITY_REPORT_IN_S2 = 386.0
#: Standard acceleration of gravity, ISO 80000-3, m/s^2.
STANDARD_GRAVITY_M_S2 = 9.80665
INCH_M = 0.0254  #: international inch (1959 agreement), m
#: International avoirdupois pound-force (pound 0.45359237 kg times standard gravity), N.
POUND_FORCE_N = 0.45359237 * STANDARD_GRAVITY_M_S2
#: Cycles per second to radians per second.
RAD_S_PER_HZ = 2.0 * pi


def join_complex(real: Floats, imaginary: Floats) -> ComplexArray:
    """real + i imaginary, without the cost of a complex multiplication."""
    same = np.shape(real) == np.shape(imaginary)
    joined = np.empty(np.shape(real) if same else np.broadcast(real, imaginary).shape, dtype=np.complex128)
    joined.real, joined.imag = real, imaginary
    return joined


def differs(values: Floats, number: float) -> bool:
    """Whether any value differs from ``number``; a float is compared without numpy, which is slow in frequent calls."""
    return values != number if isinstance(values, float) else bool(np.any(values != number))


def of_every(values: Any, every: int) -> Any:
    """Values (batch, n) of models 0, k, 2k ..., k = ``every``; values shared by all models are unchanged."""
    return values[::every] if np.ndim(values) > 1 else values


def join_rows(parts: Sequence[_Rows]) -> _Rows:
    """Results of one kind, with different rows, as one: arrays and tuples are joined, the rest is that of the first.

    Dataclasses, mappings and tuples of dataclasses are joined field by field.
    """
    every: Sequence[Any] = parts
    first = joined = every[0]
    if isinstance(first, np.ndarray):
        joined = np.concatenate(every)
    elif is_dataclass(first):
        each = {field.name: join_rows([getattr(part, field.name) for part in every]) for field in fields(first)}
        # mypy does not see that ``first``, known by `is_dataclass`, is no class but an instance of one
        joined = replace(first, **each)  # type: ignore[type-var]
    elif isinstance(first, Mapping):
        joined = {key: join_rows([part[key] for part in every]) for key in first}
    elif isinstance(first, tuple):
        alike = first and is_dataclass(first[0])
        joined = tuple(map(join_rows, zip(*every, strict=True))) if alike else tuple(chain(*every))
    return cast(_Rows, joined)


def take_rows(whole: _Rows, rows: slice) -> _Rows:
    """Some rows of a batch: of arrays (batch, n) field by field; what all rows share, (n,) or (1, n), is unchanged."""
    part: Any = whole
    if isinstance(part, np.ndarray) and part.ndim > 1 and len(part) > 1:
        part = part[rows]
    elif is_dataclass(part):
        taken = {field.name: take_rows(getattr(part, field.name), rows) for field in fields(part)}
        part = replace(part, **taken)  # type: ignore[type-var]  # as in `join_rows`
    elif isinstance(part, tuple):
        part = tuple(take_rows(each, rows) for each in part)
    return cast(_Rows, part)


def interpolate_logs(at: Numbers, known: Numbers, values: Numbers) -> FloatArray:
    """Values at ``at``, linear between ``known`` points on logarithmic axes, constant beyond them; all are > 0."""
    return np.asarray(np.exp(np.interp(np.log(at), np.log(known), np.log(values))))


def drop_repeats(rows: FloatArray) -> tuple[BoolArray, IntArray]:
    """Which rows (n, ..) differ from the row before, and, for each row, the number of its own among these."""
    new = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))
    return new, np.cumsum(new) - 1


def wrap_lag(phase: FloatArray, least: float = -0.5 * pi) -> FloatArray:
    """The same angle from ``least`` on, by default in [-pi/2, 3 pi/2), where the noisy lag of a mode lies."""
    return phase - 2.0 * pi * np.floor((phase - least) / (2.0 * pi))


def to_python(value: Any) -> Any:
    """The Python value of a numpy scalar or of an array without axes; dates as scalars, anything else unchanged."""
    if not (isinstance(value, np.generic) or (type(value) is np.ndarray and value.ndim == 0)):
        return value
    return np.asarray(value)[()] if value.dtype.kind in "mM" else value.item()  # the item of a date may be a mere count


def read_floats(values: object) -> FloatArray | None:
    """A number, an array or a list of numbers as an array with axes; None if anything is no number or is masked."""
    if np.ma.is_masked(values):
        return None
    try:
        array = np.atleast_1d(np.asarray(values))
    except ValueError:  # lists of unlike lengths
        return None
    numbers = array.dtype.kind in "iuf" or all(map(is_number, array.flat))
    return array.astype(np.float64) if numbers else None


def is_number(value: object) -> bool:
    """Whether a value is a real number: no truth value, text, complex number or date."""
    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def plain(value: Any) -> Any:
    """Nested plain Python data: numpy values converted, NaN and infinities made ``None``, what JSON lacks made text."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value if isinstance(value, str | int | float | None) else str(value)
