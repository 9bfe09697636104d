"""Files that tests write."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import pandas as pd


def write_csv(path: Path, columns: Mapping[str, Any] | pd.DataFrame, **options: Any) -> Path:
    """A table with these columns."""
    pd.DataFrame(columns).to_csv(path, index=False, **options)
    return path


def write_hdf5(path: Path, contents: Mapping[str, Any]) -> Path:
    """A file of arrays, of (array, unit) with its unit in the attribute ``units``, and of groups of these."""
    with h5py.File(path, "w") as file:
        fill(file, contents)
    return path


def fill(group: h5py.Group, contents: Mapping[str, Any]) -> None:
    """Adds these to a group."""
    for name, values in contents.items():
        if isinstance(values, Mapping):
            fill(group.require_group(name), values)
        elif isinstance(values, tuple):
            group[name] = values[0]
            group[name].attrs["units"] = values[1]
        else:
            group[name] = values
