"""Steady-state sweeps of a model at given force levels: the record that a test of the model would give."""

import math
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Literal

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, FloatArray, IntArray, wrap_lag
from damping.effects import CATALOGUE, find_effect, with_effects
from damping.effects.contract import Drive, Terms
from damping.effects.terms import Prediction, predict
from damping.errors import AnalysisError, InputError
from damping.forces import Force, Sum, from_damping
from damping.gap.simulation import Simulation
from damping.predict.branches import Branches, by_row, finely, followed, list_roots, sweep
from damping.predict.integrate import sweep_in_time
from damping.predict.steady import SteadyState
from damping.progress import Progress, silent
from damping.records.keys import LARGEST, SMALLEST
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import find_resonance

Direction = Literal["up", "down"]
Method = Literal["ritz", "time"]

#: Most rows of a computed record: they take minutes, and are far more than any analysis uses.
MOST_POINTS = 100_000
_COLUMNS = ["sweep", "force", "frequency", "amplitude", "phase"]
#: Most frequencies of a sweep that is read as a test would be: some tens between its half-power points.
_READ = 400
#: Amplitudes searched: 8 decades about the static deflection, 50 points in each.
_GRID = np.linspace(-3.0, 5.0, 401) * np.log(10.0)


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
    (first-harmonic averages) or ``time`` (integration in time to the steady state). For a base-driven model ``forces``
    are accelerations a, which act as M a: a participation of 1.

    InputError: an invalid argument, before any work.
    AnalysisError: an effect that ``method`` cannot simulate, or no steady state somewhere in a sweep.
    """
    _check(forces, frequencies, direction, method)
    order = frequencies if direction == "up" else frequencies[::-1]
    excited = mode.mass if mode.drive == "base" else 1.0
    tables = []
    with progress(f"{method} sweeps {direction}", len(forces) * frequencies.size) as advance:
        for number, level in enumerate(forces):
            rows: list[tuple[float, float]] = []
            if method == "ritz":
                readings = _averaged(level * excited, frequencies, mode, direction)
            else:
                hertz, force = RAD_S_PER_HZ * frequencies, simulated_force(mode)
                steady = sweep_in_time(force, level * excited, hertz, mode.mass, mode.omega_n, direction)
                readings = ((state.amplitude, state.phase) for state in steady)
            for part in np.array_split(order, 4):
                rows += list(islice(readings, part.size))
                advance(f"force {level:g}", part.size)
            tables.append(_tabulate_table(_label(number), level, order, rows))
    return Record.trusted(pd.concat(tables, ignore_index=True), f"sweeps of {mode.name}")


def _check(forces: Sequence[float], frequencies: FloatArray, direction: str, method: str) -> None:
    """InputError for the first invalid argument."""
    magnitude = f"of a magnitude of {SMALLEST:g} to {LARGEST:g}"
    bad = next((F for F in forces if not (isinstance(F, int | float) and SMALLEST <= F <= LARGEST)), None)
    if not forces or bad is not None:
        raise InputError(f"force {bad}" if forces else "no force", expected=f"positive numbers, {magnitude}")
    if frequencies.size * len(forces) > MOST_POINTS:
        expected = f"{MOST_POINTS} rows (points times forces) at most"
        raise InputError(f"{frequencies.size * len(forces)} rows", expected=expected)
    if len(set(forces)) < len(forces):
        raise InputError("the same force twice", expected="different force levels")
    if not (frequencies.ndim == 1 and frequencies.size >= 2 and np.isfinite(frequencies).all()):
        raise InputError("frequencies are not a list of several numbers", expected="two frequencies in Hz or more")
    if not (frequencies[0] >= SMALLEST and frequencies[-1] <= LARGEST and np.all(np.diff(frequencies) > 0.0)):
        raise InputError("frequencies out of range", expected=f"0 < LO < HI in Hz, rising, {magnitude}")
    for name, value, known in (("direction", direction, ("up", "down")), ("method", method, ("ritz", "time"))):
        if not (isinstance(value, str) and value in known):
            raise InputError(f"{name} {value!r} is unknown", expected=" or ".join(known))


def simulated_force(mode: Mode) -> Force:
    """The forces of a model for integration in time: its damping, and those that its effects add.

    AnalysisError: an effect that is no force, and so cannot be integrated.
    """
    added: list[Force] = []
    for name, table in mode.effects.items():
        effect = find_effect(name)
        if effect.force is None:
            known = ", ".join(other.name for other in CATALOGUE.values() if other.force)
            raise AnalysisError(
                f"{mode.source or mode.name}: method time cannot simulate [effects.{name}]: it supports only effects "
                f"that add a force ({known}); method ritz supports all"
            )
        added.append(effect.force(effect.complete(table)))
    return Sum((*from_damping(mode.damping).forces, *added))


def _averaged(F: float, hertz: FloatArray, mode: Mode, direction: Direction) -> Iterator[tuple[float, float]]:
    """Amplitude and phase readings in the order swept, by first-harmonic averages, with the effects of the model."""
    omega, step = RAD_S_PER_HZ * hertz, 1 if direction == "up" else -1
    if mode.effects:
        response = swept(mode, F, omega, direction)
    else:
        response = sweep(from_damping(mode.damping), F, omega, mode.mass, mode.omega_n, direction)
    phase = response.phase
    if np.any(np.abs(phase) > 2.0 * math.pi):  # of a delay; a record holds one turn, as a phase meter reads
        phase = wrap_lag(phase)
    yield from zip(response.amplitude[::step].tolist(), phase[::step].tolist(), strict=True)


def _tabulate_table(label: str, level: float, hertz: FloatArray, rows: list[tuple[float, float]]) -> pd.DataFrame:
    for f, (amplitude, _) in zip(hertz, rows, strict=True):
        if not (math.isfinite(amplitude) and amplitude > 0.0):
            raise AnalysisError(
                f"no steady motion at force {level:g} and {f:g} Hz: friction holds the mass, or no force "
                "in [damping] limits its motion"
            )
    columns = [[label] * len(rows), [level] * len(rows), hertz, *zip(*rows, strict=True)]
    return pd.DataFrame(dict(zip(_COLUMNS, columns, strict=True))).astype({"sweep": object})  # as a record has it


def _label(number: int) -> str:
    """A, B, ..., Z, AA, AB, ..."""
    label = ""
    while number >= 0:
        label = chr(ord("A") + number % 26) + label
        number = number // 26 - 1
    return label


def swept(mode: Mode, F: float, omega: FloatArray, direction: Literal["up", "down"] = "up") -> SteadyState:
    """The readings of a slow sweep of a mode with its effects at ``omega`` (increasing, rad/s, (n,)), jumps included.

    F is the recorded force. NaN where there is no stable steady state.

    InputError: an unknown effect, or an invalid table of one.
    """
    fine, between = finely(np.asarray(omega, dtype=float))
    return followed(states(_simulate_terms(mode), F, fine), between, direction)


def read_resonance(mode: Mode, F: float, omega: FloatArray, has_phase: bool) -> float:
    """Resonant amplitude of a slow sweep by :func:`damping.records.resonance.find_resonance`; NaN without stable state.

    The sweep is read at ``omega`` (increasing, rad/s, (n,)), thinned, on the largest stable state at each frequency.
    """
    thin = np.unique(np.linspace(0, omega.size - 1, _READ).astype(np.int64))
    branches = states(_simulate_terms(mode), F, omega[thin])
    largest = np.argmax(np.where(branches.stable, branches.amplitude, -np.inf), axis=1)
    rows = np.flatnonzero(branches.stable.any(axis=1))
    columns = {"force": np.full(len(rows), F), "frequency": branches.omega[rows] / RAD_S_PER_HZ}
    columns |= {name: getattr(branches, name)[rows, largest[rows]] for name in ("amplitude", "phase")[: 1 + has_phase]}
    return find_resonance("", pd.DataFrame(columns)).amplitude if len(rows) else np.nan


def _simulate_terms(mode: Mode) -> Terms:
    """The terms of a mode with its effects."""
    simulation = Simulation(mode)
    return with_effects(simulation.terms(np.zeros((1, len(simulation.names)))), mode.effects)


def states(terms: Terms, F: float, omega: FloatArray) -> Branches:
    """All roots of u = Re P(u), u = ln A, at each frequency; stable where d(u - Re P)/du > 0."""
    u = np.log(F / (float(np.ravel(terms.M)[0]) * float(np.ravel(terms.omega_n)[0]) ** 2)) + _GRID

    def predicted(points: FloatArray, rows: IntArray) -> Prediction:
        at = np.broadcast_to(omega[rows], np.broadcast_shapes(points.shape, rows.shape))
        return predict(terms, np.broadcast_to(points, at.shape), Drive(np.full(at.shape, F), at))

    def level(points: FloatArray, rows: IntArray) -> tuple[FloatArray, FloatArray]:
        shape = np.broadcast_shapes(points.shape, rows.shape)
        prediction = predicted(points, rows)
        return (points - prediction.u).reshape(shape), (1.0 - prediction.by_u.real).reshape(shape)

    row, roots = list_roots(level, u, omega.size)
    phase, slope = -predicted(roots, row).turned.ravel(), level(roots, row)[1]
    tables = [by_row(row, values, omega.size) for values in (np.exp(roots), phase, slope)]
    return Branches(omega, tables[0], tables[1], np.nan_to_num(tables[2], nan=-1.0) > 0.0)
