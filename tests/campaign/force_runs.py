"""Files of force-driven runs: spectra of the force and of accelerations, with noise."""

from collections.abc import Callable, Sequence
from pathlib import Path

import h5py
import numpy as np


def write_force_runs(
    path: Path, f: np.ndarray, levels: Sequence[float], move: Callable[[float], np.ndarray], seed: int
) -> Path:
    """A run at each force of ``levels``, N; ``move``: accelerations (sensors, n) at f under it; 0.3 % of noise."""
    rng = np.random.default_rng(seed)
    with h5py.File(path, "w") as file:
        for force in levels:
            run = file.create_group(f"run_{force}N")
            run["frequency"], run["force"] = f, np.full(len(f), force, complex)
            run["force"].attrs["units"] = "N"
            for name, row in zip("abc", move(force), strict=False):
                run[name] = row * (1.0 + 0.003 * (rng.normal(size=len(f)) + 1j * rng.normal(size=len(f))))
                run[name].attrs["units"] = "m/s^2"
    return path
