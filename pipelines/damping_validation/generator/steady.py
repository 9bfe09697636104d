"""Newton's method on the map of a cycle: the state that a cycle reproduces, without a long dwell.

Steady states of a test: shooting from a guess, the branch the sweep follows, and the proof that they are steady.

The noise-free record of a true structure and rig, integrated in time to the steady state.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from damping_validation.generator.motion import STEPS, TrueMotion, TrueState, started
from damping_validation.generator.refit import guess
from damping_validation.generator.structure import Array, Complex, Structure, TrueRows, recorded

_MOST = 40  # corrections
_CLOSE = 1e-6  # of the amplitude: last correction
_PROBE = 1e-4  # of the amplitude: finite difference


def shoot(motion: TrueMotion, state: TrueState) -> tuple[TrueState, npt.NDArray[np.bool_]]:
    """States (one copy) that a cycle reproduces, from ``state``, and at which rows a stable one was found."""
    state = _remembering(motion, state)
    todo = np.ones(motion.rows.omega.size, bool)
    found = np.zeros(todo.size, bool)
    for _ in range(_MOST):
        with np.errstate(over="ignore", invalid="ignore"):  # a row that runs away is dropped below
            corrected, growth, change = _corrected(motion.chosen(todo), state.chosen(todo))
        state = state.put(todo, corrected)
        place = np.flatnonzero(todo)
        close = change < _CLOSE
        found[place[close & (growth < 1.0)]] = True
        todo[place[close | ~np.isfinite(change)]] = False
        if not todo.any():
            break
    return state, found


def _list_odd(last: tuple[Array, ...], half: tuple[Array, ...]) -> tuple[Array, ...]:
    """The part of the stretches that changes sign in half a cycle: what is left when a lasting offset has faded."""
    return tuple((end - middle) / 2 for end, middle in zip(last, half, strict=True))


def _remembering(motion: TrueMotion, state: TrueState) -> TrueState:
    """One cycle driven by the guess, so that the joints remember a full loop; displacement and velocity stay."""
    if not motion.structure.joints:
        return state
    after, half = motion.cycle(state)
    return TrueState(state.q, state.v, motion.moved(_list_odd(after.z, half), (state.q - after.q)[0]))


def _corrected(motion: TrueMotion, state: TrueState) -> tuple[TrueState, Array, Array]:
    """The state after one correction, the spectral radius of the map of a cycle, and the size of the correction.

    The coordinates do not act on each other, so each has its own 2 x 2 derivative, from two probes at once. The joints'
    stretches are carried from the end of the cycle.
    """
    omega = motion.rows.omega
    size = np.hypot(state.q, state.v / omega)[:, 0] + 1e-300
    probe = _PROBE * size
    q, v = np.repeat(state.q, 3, axis=1), np.repeat(state.v, 3, axis=1)
    q[:, 1] += probe
    v[:, 2] += probe * omega
    z = motion.moved(tuple(np.repeat(part, 3, axis=1) for part in state.z), q[0] - state.q[0])
    end, half = motion.cycle(TrueState(q, v, z))
    a, b = ((end.q[:, n] - end.q[:, 0]) / probe for n in (1, 2))
    c, d = ((end.v[:, n] - end.v[:, 0]) / (probe * omega) for n in (1, 2))
    miss_q, miss_v = end.q[:, 0] - q[:, 0], (end.v[:, 0] - v[:, 0]) / omega
    determinant = (1 - a) * (1 - d) - b * c
    step_q = ((1 - d) * miss_q + b * miss_v) / determinant
    step_v = (c * miss_q + (1 - a) * miss_v) / determinant
    new_q, new_v = state.q[:, 0] + step_q, state.v[:, 0] + step_v * omega
    odd = _list_odd(tuple(part[:, :1] for part in end.z), tuple(part[:, :1] for part in half))
    corrected = TrueState(new_q[:, None], new_v[:, None], motion.moved(odd, (new_q - end.q[:, 0])[:1]))
    return corrected, _spectral_radius(a, b, c, d), np.hypot(step_q[0], step_v[0]) / size[0]


def _spectral_radius(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Largest modulus of the eigenvalues of the matrices ((a, b), (c, d)), over the coordinates."""
    half = ((a + d) / 2).astype(complex)
    root = np.sqrt(half**2 - (a * d - b * c))
    radius: Array = np.maximum(np.abs(half + root), np.abs(half - root)).max(axis=0)
    return radius


#: Laws under which two steady states may exist at one frequency.
_ELASTIC = frozenset({"cubic", "quadratic", "odd-square", "quintic", "clearance"})
_JUMP = 0.25  # of the larger phasor, from row to row: the sweep may have left its branch too early
_LONGEST = 12  # rows by which a branch is continued
_STEADY = 1e-5  # of the amplitude: change of the record in one more cycle


class NoSteadyStateError(Exception):
    """No stable steady state was found at some row."""


def steady(structure: Structure, rows: TrueRows, guesses: Sequence[Complex], steps: int = STEPS) -> Complex:
    """Steady phasor of the displacement at the sensor, row by row, before gain, lag and leak (``structure.recorded``).

    ``guesses`` of the main coordinate's phasor are tried in turn where those before gave no stable state.

    Raises:
        NoSteadyStateError: no stable steady state near any guess, or a record that another cycle changes.
    """
    motion = TrueMotion(structure, rows, steps)
    state = steady_state(motion, guesses)
    first, state = motion.first_harmonic(state)
    second, _ = motion.first_harmonic(state)
    if not np.all(np.abs(second - first) < _STEADY * np.abs(first)):
        raise NoSteadyStateError("the record still changes")
    return first


def steady_state(motion: TrueMotion, guesses: Sequence[Complex]) -> TrueState:
    """State at the start of a steady cycle, on the branch that the sweep follows.

    Raises:
        NoSteadyStateError: no stable steady state near any guess.
    """
    state, found = shoot(motion, started(motion, guesses[0]))
    for further in guesses[1:]:
        if found.all():
            break
        part = motion.chosen(~found)
        again, there = shoot(part, started(part, further[~found]))
        state, found[~found] = state.put(~found, again), there
    if not found.all():
        raise NoSteadyStateError("no stable steady state")
    if any(law.kind in _ELASTIC for law in motion.structure.laws):
        state = _followed(motion, state)
    return state


def _followed(motion: TrueMotion, state: TrueState) -> TrueState:
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


def _position(motion: TrueMotion, state: TrueState) -> Complex:
    """The main coordinate's phasor, read from its displacement and velocity at the start of a cycle."""
    position: Complex = state.v[0, 0] / motion.rows.omega + 1j * state.q[0, 0]
    return position


def doubling(structure: Structure, rows: TrueRows, guesses: Sequence[Complex], dwell: int) -> tuple[float, float]:
    """Largest relative change of the record when dwell goes from ``dwell`` to twice that, and when steps double."""
    motion = TrueMotion(structure, rows)
    state = motion.dwelt(steady_state(motion, guesses), dwell)
    once, _ = motion.first_harmonic(state)
    twice, _ = motion.first_harmonic(motion.dwelt(state, dwell))
    fine = TrueMotion(structure, rows, 2 * STEPS)
    finer, _ = fine.first_harmonic(steady_state(fine, [_position(motion, state)]))
    return float(np.max(np.abs(twice - once) / np.abs(once))), float(np.max(np.abs(finer - once) / np.abs(once)))


def guesses(structure: Structure, rows: TrueRows) -> tuple[Complex, Complex]:
    """Where the shooting starts: on the branch that the sweep follows, then on the other one."""
    return guess(structure, rows), guess(structure, rows, other=True)


def true_record(structure: Structure, rows: TrueRows) -> tuple[Array, Array]:
    """Amplitude and lag, without noise. NoSteadyStateError where no stable steady state is found."""
    return recorded(steady(structure, rows, guesses(structure, rows)), rows)
