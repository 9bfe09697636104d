"""Columns of a table as arrays, and results by point."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pandas as pd

from selection.arrays import FloatArray


def columns(table: pd.DataFrame, *names: str) -> tuple[FloatArray, ...]:
    """The named columns as arrays of floats."""
    return tuple(table[name].to_numpy(dtype=float) for name in names)


def by_point(name: str, values: npt.ArrayLike) -> dict[str, float]:
    """``{name[1]: first value, name[2]: second, ...}``."""
    return {f"{name}[{k}]": float(value) for k, value in enumerate(np.asarray(values), start=1)}
