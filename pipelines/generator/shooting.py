"""Newton's method on the map of a cycle: the state that a cycle reproduces, without a long dwell."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pipelines.generator.laws import Array
from pipelines.generator.motion import Motion, State

_MOST = 40  # corrections
_CLOSE = 1e-6  # of the amplitude: last correction
_PROBE = 1e-4  # of the amplitude: finite difference


def shoot(motion: Motion, state: State) -> tuple[State, npt.NDArray[np.bool_]]:
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


def _odd(last: tuple[Array, ...], half: tuple[Array, ...]) -> tuple[Array, ...]:
    """The part of the stretches that changes sign in half a cycle: what is left when a lasting offset has faded."""
    return tuple((end - middle) / 2 for end, middle in zip(last, half, strict=True))


def _remembering(motion: Motion, state: State) -> State:
    """One cycle driven by the guess, so that the joints remember a full loop; displacement and velocity stay."""
    if not motion.structure.joints:
        return state
    after, half = motion.cycle(state)
    return State(state.q, state.v, motion.moved(_odd(after.z, half), (state.q - after.q)[0]))


def _corrected(motion: Motion, state: State) -> tuple[State, Array, Array]:
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
    end, half = motion.cycle(State(q, v, z))
    a, b = ((end.q[:, n] - end.q[:, 0]) / probe for n in (1, 2))
    c, d = ((end.v[:, n] - end.v[:, 0]) / (probe * omega) for n in (1, 2))
    miss_q, miss_v = end.q[:, 0] - q[:, 0], (end.v[:, 0] - v[:, 0]) / omega
    determinant = (1 - a) * (1 - d) - b * c
    step_q = ((1 - d) * miss_q + b * miss_v) / determinant
    step_v = (c * miss_q + (1 - a) * miss_v) / determinant
    new_q, new_v = state.q[:, 0] + step_q, state.v[:, 0] + step_v * omega
    odd = _odd(tuple(part[:, :1] for part in end.z), tuple(part[:, :1] for part in half))
    corrected = State(new_q[:, None], new_v[:, None], motion.moved(odd, (new_q - end.q[:, 0])[:1]))
    return corrected, _spectral_radius(a, b, c, d), np.hypot(step_q[0], step_v[0]) / size[0]


def _spectral_radius(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Largest modulus of the eigenvalues of the matrices ((a, b), (c, d)), over the coordinates."""
    half = ((a + d) / 2).astype(complex)
    root = np.sqrt(half**2 - (a * d - b * c))
    radius: Array = np.maximum(np.abs(half + root), np.abs(half - root)).max(axis=0)
    return radius
