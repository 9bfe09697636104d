"""Stage of ``damping sweep``: steady-state sweeps of a model at given force levels, written as a record."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

import damping
from damping.arrays import FloatArray
from damping.errors import InputError
from damping.records.mode import read_mode
from damping.records.record import record_to_csv
from damping_pipelines.store import refuse_inputs, write_text
from damping_pipelines.terminal import progress

#: Rows of a record that is computed: minutes, and far more than any analysis takes.
MOST_ROWS = 100_000


def sweep(model: Path, force: list[float], frequency: str, out: Path, direction: str, method: str) -> None:
    """Sweep the model through ``frequency`` (``LO:HI:N``, Hz) at each force and write the record ``out``.

    Raises:
        InputError: a bad option, or a model file that cannot be read.
        AnalysisError: the model has an effect that is not simulated, or no steady state somewhere in a sweep.
    """
    refuse_inputs("--out", out, model)
    hertz = _frequencies(frequency)
    if len(hertz) * len(force) > MOST_ROWS:
        raise InputError(f"{len(hertz) * len(force)} rows", expected=f"{MOST_ROWS} rows (points times forces) at most")
    swept = damping.sweep(
        read_mode(model), force=force, frequency=hertz, direction=direction, method=method, progress=progress
    )
    write_text(out, record_to_csv(swept.record))


def _frequencies(text: str) -> FloatArray:
    """LO:HI:N as N equally spaced frequencies from LO to HI, Hz."""
    expected = "LO:HI:N with 0 < LO < HI in Hz and N >= 2 points"
    parts = text.split(":")
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        raise InputError(f"--frequency {text!r} is not understood", expected=expected) from None
    if count > MOST_ROWS:
        raise InputError(f"--frequency {text!r}: {count} points", expected=f"{MOST_ROWS} points at most")
    if len(parts) != 3 or not (0.0 < low < high < math.inf and count >= 2):
        raise InputError(f"--frequency {text!r} is out of range", expected=expected)
    return np.linspace(low, high, count)
