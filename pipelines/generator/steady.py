"""Steady states of a test: shooting from a guess, the branch the sweep follows, and the proof that they are steady."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipelines.generator.motion import STEPS, Motion, State, started
from pipelines.generator.shooting import shoot
from pipelines.generator.structure import Complex, Rows, Structure

#: Laws under which two steady states may exist at one frequency.
_ELASTIC = frozenset({"cubic", "quadratic", "odd-square", "quintic", "clearance"})
_JUMP = 0.25  # of the larger phasor, from row to row: the sweep may have left its branch too early
_LONGEST = 12  # rows by which a branch is continued
_STEADY = 1e-5  # of the amplitude: change of the record in one more cycle


class NoSteadyStateError(Exception):
    """No stable steady state was found at some row."""


def steady(structure: Structure, rows: Rows, guesses: Sequence[Complex], steps: int = STEPS) -> Complex:
    """Steady phasor of the displacement at the sensor, row by row, before gain, lag and leak (``structure.recorded``).

    ``guesses`` of the main coordinate's phasor are tried in turn where those before gave no stable state.

    Raises:
        NoSteadyStateError: no stable steady state near any guess, or a record that another cycle changes.
    """
    motion = Motion(structure, rows, steps)
    state = steady_state(motion, guesses)
    first, state = motion.first_harmonic(state)
    second, _ = motion.first_harmonic(state)
    if not np.all(np.abs(second - first) < _STEADY * np.abs(first)):
        raise NoSteadyStateError("the record still changes")
    return first


def steady_state(motion: Motion, guesses: Sequence[Complex]) -> State:
    """State at the start of a steady cycle, on the branch that the sweep follows.

    Raises:
        NoSteadyStateError: no stable steady state near any guess.
    """
    state, found = shoot(motion, started(motion, guesses[0]))
    for guess in guesses[1:]:
        if found.all():
            break
        part = motion.chosen(~found)
        again, there = shoot(part, started(part, guess[~found]))
        state, found[~found] = state.put(~found, again), there
    if not found.all():
        raise NoSteadyStateError("no stable steady state")
    if any(law.kind in _ELASTIC for law in motion.structure.laws):
        state = _followed(motion, state)
    return state


def _followed(motion: Motion, state: State) -> State:
    """The states with every branch continued in the direction of its sweep for as long as it is stable."""
    same = np.diff(motion.rows.sweep) == 0
    for _ in range(_LONGEST):
        x = _position(motion, state)
        jump = same & (np.abs(np.diff(x)) > _JUMP * np.maximum(np.abs(x[1:]), np.abs(x[:-1])))
        after, before = np.append(False, jump), np.append(jump, False)
        if not jump.any():
            break
        part = motion.chosen(after)
        tried, found = shoot(part, state.chosen(before))
        y = _position(part, tried)
        nearer = found & (np.abs(y - x[before]) < 0.9 * np.abs(x[after] - x[before]))
        if not nearer.any():
            break
        after[np.flatnonzero(after)[~nearer]] = False
        state = state.put(after, tried.chosen(nearer))
    return state


def _position(motion: Motion, state: State) -> Complex:
    """The main coordinate's phasor, read from its displacement and velocity at the start of a cycle."""
    position: Complex = state.v[0, 0] / motion.rows.omega + 1j * state.q[0, 0]
    return position


def doubling(structure: Structure, rows: Rows, guesses: Sequence[Complex], dwell: int) -> tuple[float, float]:
    """Largest relative change of the record when dwell goes from ``dwell`` to twice that, and when steps double."""
    motion = Motion(structure, rows)
    state = motion.dwelt(steady_state(motion, guesses), dwell)
    once, _ = motion.first_harmonic(state)
    twice, _ = motion.first_harmonic(motion.dwelt(state, dwell))
    fine = Motion(structure, rows, 2 * STEPS)
    finer, _ = fine.first_harmonic(steady_state(fine, [_position(motion, state)]))
    return float(np.max(np.abs(twice - once) / np.abs(once))), float(np.max(np.abs(finer - once) / np.abs(once)))
