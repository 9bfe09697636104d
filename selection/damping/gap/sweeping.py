"""Steady-state sweeps of a model at given force levels: the record that a test of it would give."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Literal

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
from damping.progress import Progress, silent
from damping.records.mode import Mode
from damping.records.record import Record

Direction = Literal["up", "down"]
Method = Literal["ritz", "time"]

_COLUMNS = ["sweep", "force", "frequency", "amplitude", "phase"]


def simulate_sweeps(
    mode: Mode,
    forces: Sequence[float],
    frequencies: FloatArray,
    direction: Direction = "up",
    method: Method = "ritz",
    progress: Progress = silent,
) -> Record:
    """Sweep a model through ``frequencies`` (n,), Hz and rising, at each force.

    Sweeps are labelled A, B, C, ... in the order of ``forces``; rows are in the order swept. ``method`` is ``ritz``
    (first-harmonic averages) or ``time`` (integration in time to the steady state).

    Raises:
        InputError: an argument that is not what it should be, before any work.
        AnalysisError: the model has an effect that is not simulated, or no steady state somewhere in a sweep.
    """
    _check(forces, frequencies, direction, method)
    states = _read if mode.effects and method == "ritz" else _averaged if method == "ritz" else _integrated
    order = frequencies if direction == "up" else frequencies[::-1]
    tables = []
    with progress(f"{method} sweeps {direction}", len(forces) * frequencies.size) as advance:
        for number, level in enumerate(forces):
            coming, rows = states(level, frequencies, mode, direction), []
            for part in np.array_split(order, 4):
                rows += list(islice(coming, part.size))
                advance(f"force {level:g}", part.size)
            tables.append(_tabulate_table(_label(number), level, order, rows))
    return Record.trusted(pd.concat(tables, ignore_index=True), f"sweeps of {mode.name}")


def _check(forces: Sequence[float], frequencies: FloatArray, direction: str, method: str) -> None:
    """InputError for the first argument that is not what it should be."""
    bad = next((force for force in forces if not (math.isfinite(force) and force > 0.0)), None)
    if not forces or bad is not None:
        raise InputError(f"force {bad}" if forces else "no force", expected="positive numbers")
    if len(set(forces)) < len(forces):
        raise InputError("the same force twice", expected="different force levels")
    if not (frequencies.ndim == 1 and frequencies.size >= 2 and np.isfinite(frequencies).all()):
        raise InputError("frequencies that are no list", expected="two frequencies in Hz or more")
    if not (frequencies[0] > 0.0 and np.all(np.diff(frequencies) > 0.0)):
        raise InputError("frequencies out of range", expected="0 < LO < HI in Hz, rising")
    for name, value, known in (("direction", direction, ("up", "down")), ("method", method, ("ritz", "time"))):
        if value not in known:
            raise InputError(f"{name} {value!r} is unknown", expected=" or ".join(known))


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
                f"{mode.source}: method time cannot simulate [effects.{name}]; of effects it knows those that add a "
                f"force ({known}); method ritz knows all"
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


def _tabulate_table(label: str, level: float, hertz: FloatArray, rows: list[tuple[float, float]]) -> pd.DataFrame:
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
