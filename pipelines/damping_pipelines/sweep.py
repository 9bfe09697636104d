"""Stage of ``damping sweep``: steady-state sweeps of a model at given force levels, written as a record."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Literal, cast

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.effects import CATALOGUE, find_effect
from damping.errors import AnalysisError, InputError
from damping.forces import Force, Sum, from_damping
from damping.gap.steady import swept
from damping.predict.branches import sweep as averaged_sweep
from damping.predict.integrate import sweep_in_time
from damping.predict.steady import SteadyState
from damping.records.mode import Mode, read_mode
from damping.records.record import record_to_csv
from damping_pipelines.store import refuse_inputs, write_text
from damping_pipelines.terminal import progress

Direction = Literal["up", "down"]

_COLUMNS = ["sweep", "force", "frequency", "amplitude", "phase"]


def sweep(model: Path, forces: list[float], frequency: str, out: Path, direction: str, method: str) -> None:
    """Sweep the model through ``frequency`` (``LO:HI:N``, Hz) at each force and write the record ``out``.

    Sweeps are labelled A, B, C, ... in the order of ``forces``; rows are in the order swept. ``method`` is ``ritz``
    (first-harmonic averages) or ``time`` (integration in time to the steady state).

    Raises:
        InputError: a bad option, or a model file that cannot be read.
        AnalysisError: the model has an effect that is not simulated, or no steady state somewhere in a sweep.
    """
    refuse_inputs("--out", out, model)
    levels, hertz = _forces(forces), _frequencies(frequency)
    _choice("--direction", direction, ("up", "down"))
    _choice("--method", method, ("ritz", "time"))
    mode = read_mode(model)
    states = _read if mode.effects and method == "ritz" else _averaged if method == "ritz" else _integrated
    way = cast(Direction, direction)
    order = hertz if way == "up" else hertz[::-1]
    tables = []
    with progress(f"{method} sweeps {direction}", len(levels) * hertz.size) as advance:
        for number, level in enumerate(levels):
            coming, rows = states(level, hertz, mode, way), []
            for part in np.array_split(order, 4):
                rows += list(islice(coming, part.size))
                advance(f"force {level:g}", part.size)
            tables.append(_table(_label(number), level, order, rows))
    write_text(out, record_to_csv(pd.concat(tables, ignore_index=True)))


def simulated_force(mode: Mode) -> Force:
    """The forces of a model that is integrated: its damping, and those that its effects add.

    Raises:
        AnalysisError: an effect that is no force, so that it is not integrated in time.
    """
    added: list[Force] = []
    for name, table in mode.effects.items():
        effect = find_effect(name)
        if effect.force is None:
            known = ", ".join(other.name for other in CATALOGUE.values() if other.force)
            raise AnalysisError(
                f"{mode.source}: --method time cannot simulate [effects.{name}]; of effects it knows those that add a "
                f"force ({known}); --method ritz knows all"
            )
        added.append(effect.force(effect.complete(table)))
    return Sum((*from_damping(mode.damping).forces, *added))


def _averaged(F: float, hertz: FloatArray, mode: Mode, way: Direction) -> Iterator[tuple[float, float]]:
    """Amplitude and phase in the order swept, by averages."""
    found = averaged_sweep(from_damping(mode.damping), F, RAD_S_PER_HZ * hertz, mode.mass, mode.omega_n, way)
    yield from _in_order(found, way)


def _read(F: float, hertz: FloatArray, mode: Mode, way: Direction) -> Iterator[tuple[float, float]]:
    """Amplitude and phase as they are read, in the order swept, by averages and with the effects of the model."""
    yield from _in_order(swept(mode, F, RAD_S_PER_HZ * hertz, way), way)


def _in_order(found: SteadyState, way: Direction) -> Iterator[tuple[float, float]]:
    step = 1 if way == "up" else -1
    yield from zip(found.amplitude[::step].tolist(), found.phase[::step].tolist(), strict=True)


def _integrated(F: float, hertz: FloatArray, mode: Mode, way: Direction) -> Iterator[tuple[float, float]]:
    """Amplitude and phase in the order swept, by integration in time."""
    force = simulated_force(mode)
    for state in sweep_in_time(force, F, RAD_S_PER_HZ * hertz, mode.mass, mode.omega_n, way):
        yield state.amplitude, state.phase


def _table(label: str, level: float, hertz: FloatArray, rows: list[tuple[float, float]]) -> pd.DataFrame:
    for f, (amplitude, _) in zip(hertz, rows, strict=True):
        if not (math.isfinite(amplitude) and amplitude > 0.0):
            raise AnalysisError(
                f"no steady motion at force {level:g} and {f:g} Hz: friction holds the mass or nothing limits it"
            )
    columns = [[label] * len(rows), [level] * len(rows), hertz, *zip(*rows, strict=True)]
    return pd.DataFrame(dict(zip(_COLUMNS, columns, strict=True)))


def _label(number: int) -> str:
    """A, B, ..., Z, AA, AB, ..."""
    label = ""
    while number >= 0:
        label = chr(ord("A") + number % 26) + label
        number = number // 26 - 1
    return label


def _forces(forces: list[float]) -> list[float]:
    bad = next((force for force in forces if not (math.isfinite(force) and force > 0.0)), None)
    if not forces or bad is not None:
        raise InputError(f"--force {bad}" if forces else "no --force", expected="positive numbers")
    if len(set(forces)) < len(forces):
        raise InputError("the same --force twice", expected="different force levels")
    return forces


def _frequencies(text: str) -> FloatArray:
    """LO:HI:N as N equally spaced frequencies from LO to HI, Hz."""
    expected = "LO:HI:N with 0 < LO < HI in Hz and N >= 2 points"
    parts = text.split(":")
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
    except (ValueError, IndexError):
        raise InputError(f"--frequency {text!r} is not understood", expected=expected) from None
    if len(parts) != 3 or not (0.0 < low < high < math.inf and count >= 2):
        raise InputError(f"--frequency {text!r} is out of range", expected=expected)
    return np.linspace(low, high, count)


def _choice(option: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f"{option} {value!r} is unknown", expected=" or ".join(choices))
