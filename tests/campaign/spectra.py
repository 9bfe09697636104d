"""Files of spectra: groups of HDF5 and data sets 58 of universal files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.files import write_hdf5


def write_spectra(path: Path, f: np.ndarray, runs: Mapping[str, Mapping[str, Any]]) -> Path:
    """A group for each run, with its frequencies; a number stands for a spectrum that has it in every row."""

    def spread(values: Any) -> Any:
        if isinstance(values, tuple):
            return spread(values[0]), values[1]
        return np.full(len(f), values, complex) if np.isscalar(values) else values

    filled = {run: {name: spread(values) for name, values in columns.items()} for run, columns in runs.items()}
    return write_hdf5(path, {run: {"frequency": f} | columns for run, columns in filled.items()})


def write_shaken(path: Path, f: np.ndarray, readings: Mapping[float, np.ndarray]) -> Path:
    """Runs on a shaker: what sensors read in g, (sensors, n), by level."""
    runs = {f"run_{level}g": {"control": level, "accelerations": (read, "g")} for level, read in readings.items()}
    return write_spectra(path, f, runs)


def write_force_runs(
    path: Path, f: np.ndarray, levels: Sequence[float], move: Callable[[float], np.ndarray], seed: int
) -> Path:
    """A run at each force of ``levels``, N; ``move``: accelerations (sensors, n) at f under it; 0.3 % of noise."""
    rng, runs = np.random.default_rng(seed), {}
    for force in levels:
        noisy = [row * (1.0 + 0.003 * (rng.normal(size=len(f)) + 1j * rng.normal(size=len(f)))) for row in move(force)]
        runs[f"run_{force}N"] = {"force": (force, "N")} | {
            name: (row, "m/s^2") for name, row in zip("abc", noisy, strict=False)
        }
    return write_spectra(path, f, runs)


def data_set(
    title: str,
    x: np.ndarray,
    values: np.ndarray,
    *further: str,
    function: int = 12,
    node: int = 1,
    entity: str = "NONE",
    abscissa: tuple[int, str] = (18, "Hz"),
    ordinate: tuple[int, str] = (12, "g"),
    per: tuple[int, str] = (0, "NONE"),
) -> str:
    """A data set 58 of text, double precision, uneven spacing (the format's description, I-DEAS).

    Args:
        further: ID lines after the title. abscissa, ordinate, per: specific data type and unit.
    """
    lines = ["    -1", "    58", title, *further, *["NONE"] * (4 - len(further))]
    lines.append(f"{function:5d}{0:10d}{0:5d}{0:10d} {entity:>10s}{node:10d}{3:4d} {entity:>10s}{1:10d}{3:4d}")
    kind = 6 if np.iscomplexobj(values) else 4
    lines.append(f"{kind:10d}{len(values):10d}{0:10d}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}")
    for code, unit in (abscissa, ordinate, per, (0, "NONE")):
        lines.append(f"{code:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}")
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    lines += [f"{at:13.5e}" + "".join(f"{part:20.11e}" for part in row) for at, *row in zip(x, *parts, strict=True)]
    return "\n".join([*lines, "    -1", ""])
