"""Steady states of the true structure by integration in time.

One cycle is integrated with the fixed-step Runge-Kutta method of fourth order for all rows at once; the state that a
cycle reproduces is found by Newton's method on that map of a cycle (shooting), so that light damping needs no long
dwell. The record is the projection of the sensor signal on sine and cosine over whole cycles, as a test rig does it.

The sign of the velocity is smoothed over +-1.5 steps, symmetrically, which leaves an error of second order in the step;
doubling dwell and steps (``doubling``) shows what is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.generator.laws import JUMPS, Array
from pipelines.generator.structure import Rows, Structure

STEPS = 256
_MOST_NEWTON = 40
_CLOSE = 1e-7  # of the amplitude: last Newton correction
_PROBE = 1e-4  # of the amplitude: finite difference


class NoSteadyStateError(Exception):
    """No stable steady state was found at some row."""


@dataclass(frozen=True)
class State:
    """Displacements and velocities, shape (coordinates, copies, rows), and the joints' stretches."""

    q: Array
    v: Array
    z: tuple[Array, ...]

    def rows(self, chosen: npt.NDArray[np.bool_]) -> State:
        """The state at the chosen rows alone."""
        return State(self.q[..., chosen], self.v[..., chosen], tuple(z[..., chosen] for z in self.z))


class Motion:
    """The equations of motion of a structure at the rows of a test (arrays made once, used at every step)."""

    def __init__(self, structure: Structure, rows: Rows, steps: int = STEPS) -> None:
        main = structure.omega * rows.tuning
        zeta = structure.viscous / (2 * structure.mass * structure.omega)
        omega = np.array([main, *(np.full(main.size, side.omega) for side in structure.sides)])
        damping = np.array([zeta * 2 * structure.omega, *(2 * side.zeta * side.omega for side in structure.sides)])
        drive = np.array([structure.share, *(side.drive for side in structure.sides)])
        self.structure, self.rows, self.steps = structure, rows, steps
        self.seen = np.array([structure.share, *(side.seen for side in structure.sides)])
        self.stiffness = (omega**2)[:, None, :]
        self.damping = damping[:, None, None]
        self.load = drive[:, None, None] * (rows.force * rows.drive / structure.mass)
        self.h = 2 * np.pi / steps / rows.omega
        self.smooth = 1.5 * 2 * np.pi / steps * rows.omega
        self.jumps = any(law.kind in JUMPS for law in structure.laws)
        self.linear = not (structure.laws or structure.joints)

    def chosen(self, chosen: npt.NDArray[np.bool_]) -> Motion:
        """The same at the chosen rows alone."""
        rows = self.rows
        some = Rows(
            rows.sweep[chosen], rows.force[chosen], rows.omega[chosen], rows.up, rows.drive[chosen],
            rows.tuning[chosen], rows.gain[chosen], rows.lag[chosen], rows.clip,
        )  # fmt: skip
        return Motion(self.structure, some, self.steps)

    def acceleration(self, q: Array, v: Array, z: tuple[Array, ...], sine: float) -> Array:
        """Second derivatives of the coordinates when the force is at ``sine`` of its amplitude."""
        a = self.load * sine - self.damping * v - self.stiffness * q
        if self.linear:
            return a
        main, speed = q[0], v[0]
        sign = speed
        if self.jumps:
            sign = np.clip(speed / (self.smooth * np.abs(main) + 1e-300), -1.0, 1.0)
        extra = np.zeros_like(main)
        for law in self.structure.laws:
            extra += law.force(main, speed, sign)
        for joint, stretch in zip(self.structure.joints, z, strict=True):
            extra += joint.force(stretch, main)
        a[0] -= extra / self.structure.mass
        return a

    def moved(self, z: tuple[Array, ...], dq: Array) -> tuple[Array, ...]:
        """The joints' stretches after the main coordinate moved by ``dq``."""
        return tuple(joint.move(part, dq) for joint, part in zip(self.structure.joints, z, strict=True))

    def cycle(self, state: State, samples: Array | None = None) -> State:
        """The state one cycle later; ``samples`` (steps, rows) receives the sensor's signal of the first copy."""
        q, v, z, h = state.q, state.v, state.z, self.h
        self.half = z
        sines = np.sin(np.arange(2 * self.steps + 1) * np.pi / self.steps)
        for n in range(self.steps):
            if samples is not None:
                samples[n] = self.seen @ q[:, 0, :]
            if 2 * n == self.steps:
                self.half = z
            s0, s1, s2 = sines[2 * n : 2 * n + 3]
            k1 = self.acceleration(q, v, z, s0)
            q2, v2 = q + (h / 2) * v, v + (h / 2) * k1
            k2 = self.acceleration(q2, v2, self.moved(z, q2[0] - q[0]), s1)
            q3, v3 = q + (h / 2) * v2, v + (h / 2) * k2
            k3 = self.acceleration(q3, v3, self.moved(z, q3[0] - q[0]), s1)
            q4, v4 = q + h * v3, v + h * k3
            k4 = self.acceleration(q4, v4, self.moved(z, q4[0] - q[0]), s2)
            end = q + (h / 6) * (v + 2 * (v2 + v3) + v4)
            v = v + (h / 6) * (k1 + 2 * (k2 + k3) + k4)
            z = self.moved(z, end[0] - q[0])
            q = end
        return State(q, v, z)

    def first_harmonic(self, state: State, cycles: int = 1) -> tuple[npt.NDArray[np.complex128], State]:
        """Phasor A exp(-i phi) of the sensor's signal A sin(omega t - phi), projected over ``cycles``, and the end."""
        X = np.zeros(self.h.size, complex)
        angle = 2 * np.pi * np.arange(self.steps) / self.steps
        samples = np.empty((self.steps, self.h.size))
        for _ in range(cycles):
            state = self.cycle(state, samples)
            shown = np.clip(samples, -self.rows.clip, self.rows.clip)
            X += (2 / self.steps / cycles) * ((np.sin(angle) + 1j * np.cos(angle)) @ shown)
        return X, state


def start(motion: Motion, guess: npt.NDArray[np.complex128]) -> State:
    """State at the start of a cycle for a guess of the main coordinate's phasor; other modes start from their own."""
    omega = motion.rows.omega
    q, v = [guess.imag], [omega * guess.real]
    for n in range(1, motion.seen.size):
        Y = motion.load[n, 0] / (motion.stiffness[n, 0] - omega**2 + 1j * motion.damping[n, 0, 0] * omega)
        q.append(Y.imag)
        v.append(omega * Y.real)
    Q, V = np.array(q)[:, None, :], np.array(v)[:, None, :]
    return State(Q, V, tuple(joint.start(Q[0]) for joint in motion.structure.joints))


def shoot(motion: Motion, state: State) -> State:
    """The stable state (one copy) that a cycle reproduces, by Newton's method from ``state``.

    Raises:
        NoSteadyStateError: no convergence, or an unstable state.
    """
    state = _loaded(motion, state)
    todo = np.ones(motion.h.size, bool)
    for _ in range(_MOST_NEWTON):
        part = motion.chosen(todo)
        here = state.rows(todo)
        after, step_q, step_v, growth, change = _newton(part, here)
        q, v = state.q.copy(), state.v.copy()
        q[:, 0, todo] += step_q
        v[:, 0, todo] += step_v
        z = tuple(part_z.copy() for part_z in state.z)
        moved = part.moved(after.z, (q[:, :, todo] - after.q)[0])
        for target, new in zip(z, moved, strict=True):
            target[..., todo] = new
        state = State(q, v, z)
        done = (change < _CLOSE) & (growth < 1.0)
        if np.any((change < _CLOSE) & (growth >= 1.0)) or not np.all(np.isfinite(change)):
            raise NoSteadyStateError("unstable or unbounded")
        todo[np.flatnonzero(todo)[done]] = False
        if not todo.any():
            return state
    raise NoSteadyStateError("no convergence")


def _loaded(motion: Motion, state: State) -> State:
    """One cycle driven by the guess, so that the joints remember a full loop; displacement and velocity stay."""
    if not motion.structure.joints:
        return state
    after = motion.cycle(state)
    odd = tuple((last - half) / 2 for last, half in zip(after.z, motion.half, strict=True))
    return State(state.q, state.v, motion.moved(odd, (state.q - after.q)[0]))


def _newton(motion: Motion, state: State) -> tuple[State, Array, Array, Array, Array]:
    """One cycle of state and two probes: end state, Newton's steps of q and v, spectral radius, relative change.

    The coordinates do not act on each other, so each has its own 2 x 2 derivative of the map of a cycle.
    """
    omega = motion.rows.omega
    size = np.sqrt(state.q**2 + (state.v / omega) ** 2) + 1e-300
    probe = _PROBE * size[:, 0, :]
    q, v = np.repeat(state.q, 3, axis=1), np.repeat(state.v, 3, axis=1)
    q[:, 1, :] += probe
    v[:, 2, :] += probe * omega
    z = tuple(np.repeat(part, 3, axis=1) for part in state.z)
    z = motion.moved(z, q[0] - np.repeat(state.q, 3, axis=1)[0])
    end = motion.cycle(State(q, v, z))
    a = (end.q[:, 1] - end.q[:, 0]) / probe
    b = (end.q[:, 2] - end.q[:, 0]) / probe
    c = (end.v[:, 1] - end.v[:, 0]) / probe / omega
    d = (end.v[:, 2] - end.v[:, 0]) / probe / omega
    rq, rv = end.q[:, 0] - q[:, 0], (end.v[:, 0] - v[:, 0]) / omega
    determinant = (1 - a) * (1 - d) - b * c
    step_q = ((1 - d) * rq + b * rv) / determinant
    step_v = (c * rq + (1 - a) * rv) / determinant
    half, product = (a + d) / 2, a * d - b * c
    growth = np.max(np.abs(half + np.sqrt(half.astype(complex) ** 2 - product)), axis=0)
    growth = np.maximum(growth, np.max(np.abs(half - np.sqrt(half.astype(complex) ** 2 - product)), axis=0))
    change = np.hypot(step_q[0], step_v[0]) / size[0, 0]
    odd = tuple((last[:, :1] - half[:, :1]) / 2 for last, half in zip(end.z, motion.half, strict=True))
    first = State(end.q[:, :1], end.v[:, :1], odd)
    return first, step_q, step_v * omega, growth, change


def steady(
    structure: Structure, rows: Rows, guess: npt.NDArray[np.complex128], steps: int = STEPS, cycles: int = 1
) -> npt.NDArray[np.complex128]:
    """Steady phasor of the displacement at each row, before gain, lag and leak (``structure.recorded``).

    ``guess`` is the main coordinate's phasor to start from, on the branch that is meant; ``cycles`` are projected.

    Raises:
        NoSteadyStateError: no stable steady state near the guess.
    """
    motion = Motion(structure, rows, steps)
    state = shoot(motion, start(motion, guess))
    return motion.first_harmonic(state, cycles)[0]
