"""Files that tests write, and what reading one comes to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import h5py
import pandas as pd

from damping.errors import InputError


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


def outcome(read: Callable[[Path], Any], path: Path) -> tuple[Any, InputError | None]:
    """What reading gives and the InputError it raised, one of them None; any other exception is a failure."""
    try:
        return read(path), None
    except InputError as error:
        return None, error
