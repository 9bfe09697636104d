"""Steady states of a true structure: its motion through one cycle of the drive, and the state that a cycle reproduces.

All rows of a test at once, by the fixed-step Runge-Kutta method of fourth order. The sign of the velocity is smoothed
over +-1.5 steps, symmetrically, which leaves an error of second order in the step, and one of first order in the step
times friction over elastic force; joints are taken to move one way within a step, an error of second order.

Newton's method on the map of a cycle (shooting) spares a long dwell; then the branch that the sweep follows is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from damping_validation.generator import balance
from damping_validation.generator.laws import Array, Complex, Structure

STEPS = 256
_SMOOTHED = 1.5  # steps on either side of a change of sign
_TINY = 1e-300
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class TrueState:
    """Displacements and velocities, shape (coordinates, copies, rows), and the stretches of the joints."""

    q: Array
    v: Array
    z: tuple[Array, ...]

    def chosen(self, chosen: Mask) -> TrueState:
        """The state at the chosen rows alone."""
        return TrueState(self.q[..., chosen], self.v[..., chosen], tuple(z[..., chosen] for z in self.z))

    def put(self, chosen: Mask, part: TrueState) -> TrueState:
        """This state with the chosen rows replaced."""
        new = TrueState(self.q.copy(), self.v.copy(), tuple(z.copy() for z in self.z))
        new.q[..., chosen], new.v[..., chosen] = part.q, part.v
        for target, source in zip(new.z, part.z, strict=True):
            target[..., chosen] = source
        return new


class TrueMotion:
    """The equations of motion of a structure at the rows of a test (arrays made once, used at every step)."""

    def __init__(self, structure: Structure, rows: balance.TrueRows, steps: int = STEPS) -> None:
        self.structure, self.rows, self.steps = structure, rows, steps
        angle = np.arange(2 * steps + 1) * np.pi / steps
        #: The drive over its amplitude at every half step.
        self.wave: list[float] = np.sin(angle).tolist()
        self._mass = structure.mass + rows.added
        self._stiffness = structure.mass * (structure.omega * rows.tuning) ** 2
        self._viscous = structure.viscous * rows.loss
        self._load = structure.share * rows.force * rows.drive
        self._h = 2 * np.pi / steps / rows.omega
        self._smooth = _SMOOTHED * 2 * np.pi / steps * rows.omega
        self._jumps = any(law.form.jumps for law in structure.laws)

    def chosen(self, chosen: Mask) -> TrueMotion:
        """The same at the chosen rows alone."""
        return TrueMotion(self.structure, balance.chosen_rows(self.rows, chosen), self.steps)

    def acceleration(self, q: Array, v: Array, z: tuple[Array, ...], drive: float) -> Array:
        """Second derivatives of the coordinates when the force is at ``drive`` of its amplitude."""
        main, speed, structure = q[0], v[0], self.structure
        force = self._load * drive - self._viscous * speed - self._stiffness * main
        sign = speed
        if self._jumps:
            sign = np.minimum(np.maximum(speed / (self._smooth * np.abs(main) + _TINY), -1.0), 1.0)
        for law in structure.laws:
            force -= law.force(main, speed, sign)
        for joint, stretch in zip(structure.joints, z, strict=True):
            force -= joint.force(stretch, main)
        a = np.empty_like(q)
        for n, partner in enumerate(structure.partners, start=1):
            a[n], push = partner.accelerations(main, speed, q[n], v[n])
            force += structure.mass * push
        a[0] = force / self._mass
        return a

    def moved(self, z: tuple[Array, ...], before: Array, after: Array) -> tuple[Array, ...]:
        """The stretches of the joints after the main coordinate moved."""
        if not z:
            return z
        dq = after - before
        return tuple(joint.move(part, dq) for joint, part in zip(self.structure.joints, z, strict=True))

    def step(self, state: TrueState, drive: Sequence[float]) -> TrueState:
        """The state one step later; ``drive`` at its start, middle and end."""
        q, v, z, h, half, sixth = state.q, state.v, state.z, self._h, self._h / 2, self._h / 6
        k1 = self.acceleration(q, v, z, drive[0])
        q2, v2 = q + half * v, v + half * k1
        k2 = self.acceleration(q2, v2, self.moved(z, q[0], q2[0]), drive[1])
        q3, v3 = q + half * v2, v + half * k2
        k3 = self.acceleration(q3, v3, self.moved(z, q[0], q3[0]), drive[1])
        q4, v4 = q + h * v3, v + h * k3
        k4 = self.acceleration(q4, v4, self.moved(z, q[0], q4[0]), drive[2])
        end = q + sixth * (v + 2 * (v2 + v3) + v4)
        return TrueState(end, v + sixth * (k1 + 2 * (k2 + k3) + k4), self.moved(z, q[0], end[0]))

    def cycle(self, state: TrueState, samples: Array | None = None) -> tuple[TrueState, tuple[Array, ...]]:
        """The state one cycle later, and the stretches half a cycle before.

        ``samples`` (steps, rows) receives the main displacement, of the first copy.
        """
        half = state.z
        for n in range(self.steps):
            if samples is not None:
                samples[n] = state.q[0, 0]
            if 2 * n == self.steps:
                half = state.z
            state = self.step(state, self.wave[2 * n : 2 * n + 3])
        return state, half

    def harmonics(self, state: TrueState) -> tuple[Complex, Complex, Complex, TrueState]:
        """The phasors of ``project`` over one cycle, and the state at its end."""
        samples = np.empty((self.steps, self._h.size))
        end = self.cycle(state, samples)[0]
        return *balance.project(self.structure, self.rows, samples), end


def started(motion: TrueMotion, guess: Complex) -> TrueState:
    """State at the start of a cycle for a guess of the main coordinate's phasor; partners start where it holds them.

    q = A sin(theta - phi) is Im(X exp(i theta)) with X = A exp(-i phi), so q = Im X and v = omega Re X at theta = 0.
    """
    omega = motion.rows.omega
    X = np.array([guess, *(partner.follow(omega) * guess for partner in motion.structure.partners)])[:, None, :]
    return TrueState(X.imag.copy(), omega * X.real, tuple(joint.start(X[0].imag) for joint in motion.structure.joints))


_MOST = 40  # corrections
_CLOSE = 1e-6  # of the amplitude: last correction
_PROBE = 1e-4  # of the amplitude: finite difference
_LEAST = 1e-3  # of the main amplitude: what the amplitude of a partner is at least taken for


def shoot(motion: TrueMotion, state: TrueState) -> tuple[TrueState, Mask]:
    """States (one copy) that a cycle reproduces, from ``state``, and at which rows a stable one was found."""
    if motion.structure.joints:  # one cycle driven by the guess, so that they remember a full loop
        after, half = motion.cycle(state)
        stretches = motion.moved(_list_odd(after.z, half), after.q[0], state.q[0])
        state = TrueState(state.q, state.v, stretches)
    todo = np.ones(motion.rows.omega.size, bool)
    stable = np.zeros(todo.size, bool)
    for _ in range(_MOST):
        with np.errstate(over="ignore", invalid="ignore"):  # a row that runs away is dropped below
            corrected, growth, change = _correct(motion.chosen(todo), state.chosen(todo))
        state = state.put(todo, corrected)
        place = np.flatnonzero(todo)
        close = change < _CLOSE
        stable[place[close & (growth < 1.0)]] = True
        todo[place[close | ~np.isfinite(change)]] = False
        if not todo.any():
            break
    return state, stable


def _list_odd(last: tuple[Array, ...], half: tuple[Array, ...]) -> tuple[Array, ...]:
    """The part of the stretches that changes sign in half a cycle: what is left when a lasting offset has faded."""
    return tuple((end - middle) / 2 for end, middle in zip(last, half, strict=True))


def _correct(motion: TrueMotion, state: TrueState) -> tuple[TrueState, Array, Array]:
    """The state after one correction, the spectral radius of the map of a cycle, and the size of the correction.

    Its derivative is of all displacements and velocities over their amplitudes, from two probes of each coordinate;
    the joints' stretches are carried from the end of the cycle.
    """
    omega, n = motion.rows.omega, state.q.shape[0]
    size = np.hypot(state.q, state.v / omega)[:, 0]
    size = np.maximum(size, _LEAST * size[0]) + _TINY
    q, v = np.repeat(state.q, 2 * n + 1, axis=1), np.repeat(state.v, 2 * n + 1, axis=1)
    for i in range(n):
        q[i, 1 + i] += _PROBE * size[i]
        v[i, 1 + n + i] += _PROBE * size[i] * omega
    z = motion.moved(tuple(np.repeat(part, 2 * n + 1, axis=1) for part in state.z), state.q[0], q[0])
    end, half = motion.cycle(TrueState(q, v, z))
    after = np.concatenate([end.q / size[:, None], end.v / omega / size[:, None]])  # (2 n, copies, rows)
    before = np.concatenate([state.q / size[:, None], state.v / omega / size[:, None]])
    map_ = np.moveaxis((after[:, 1:] - after[:, :1]) / _PROBE, -1, 0)  # (rows, 2 n, 2 n)
    lost = ~np.isfinite(map_).all(axis=(1, 2))
    map_[lost] = 0.0
    miss = np.moveaxis(after[:, :1] - before, -1, 0)
    step = np.moveaxis(np.linalg.solve(np.eye(2 * n) - map_, miss)[..., 0], 0, -1)  # (2 n, rows)
    new_q, new_v = state.q[:, 0] + step[:n] * size, state.v[:, 0] + step[n:] * size * omega
    odd = _list_odd(tuple(part[:, :1] for part in end.z), tuple(part[:, :1] for part in half))
    corrected = TrueState(new_q[:, None], new_v[:, None], motion.moved(odd, end.q[0, :1], new_q[:1]))
    growth = np.abs(np.linalg.eigvals(map_)).max(axis=1)
    change = np.where(lost, np.nan, np.abs(step).max(axis=0))
    return corrected, growth, change


_JUMP = 0.25  # of the larger phasor, from row to row: the sweep may have left its branch too early
_LONGEST = 12  # rows by which a branch is continued
_STEADY = 1e-5  # of the amplitude: change of the record in one more cycle


class NoSteadyStateError(Exception):
    """No stable steady state was found at some row."""


def steady(
    structure: Structure, rows: balance.TrueRows, guesses: Sequence[Complex], steps: int = STEPS
) -> tuple[Complex, ...]:
    """Steady phasors, row by row, before gain, lag and leak: at the sensor, its third harmonic, across the axis.

    ``guesses`` of the main coordinate's phasor are tried in turn where those before gave no stable state.
    NoSteadyStateError: no stable steady state near any guess, or a record that another cycle changes.
    """
    motion = TrueMotion(structure, rows, steps)
    state = steady_state(motion, guesses)
    first, third, across, state = motion.harmonics(state)
    again = motion.harmonics(state)[0]
    if not np.all(np.abs(again - first) < _STEADY * np.abs(first)):
        raise NoSteadyStateError("the record still changes")
    return first, third, across


def steady_state(motion: TrueMotion, guesses: Sequence[Complex]) -> TrueState:
    """State at the start of a steady cycle, on the branch of the sweep. NoSteadyStateError: none near any guess."""
    state, stable = shoot(motion, started(motion, guesses[0]))
    for further in guesses[1:]:
        if stable.all():
            break
        part = motion.chosen(~stable)
        again, there = shoot(part, started(part, further[~stable]))
        state, stable[~stable] = state.put(~stable, again), there
    if not stable.all():
        raise NoSteadyStateError("no stable steady state")
    return _follow(motion, state) if motion.structure.bent else state


def _follow(motion: TrueMotion, state: TrueState) -> TrueState:
    """The states with every branch continued in the direction of its sweep for as long as it is stable."""
    same = np.diff(motion.rows.sweep) == 0
    for _ in range(_LONGEST):
        x = _position(motion, state)
        jump = same & (np.abs(np.diff(x)) > _JUMP * np.maximum(np.abs(x[1:]), np.abs(x[:-1])))
        after, before = np.append(False, jump), np.append(jump, False)
        if not jump.any():
            break
        part = motion.chosen(after)
        tried, stable = shoot(part, state.chosen(before))
        y = _position(part, tried)
        nearer = stable & (np.abs(y - x[before]) < 0.9 * np.abs(x[after] - x[before]))
        if not nearer.any():
            break
        after[np.flatnonzero(after)[~nearer]] = False
        state = state.put(after, tried.chosen(nearer))
    return state


def _position(motion: TrueMotion, state: TrueState) -> Complex:
    """The main coordinate's phasor, read from its displacement and velocity at the start of a cycle."""
    position: Complex = state.v[0, 0] / motion.rows.omega + 1j * state.q[0, 0]
    return position


def guesses(structure: Structure, rows: balance.TrueRows) -> tuple[Complex, Complex]:
    """Where the shooting starts: on the branch that the sweep follows, then on the other one."""
    return balance.guess(structure, rows), balance.guess(structure, rows, other=True)


def true_phasors(structure: Structure, rows: balance.TrueRows) -> tuple[Complex, ...]:
    """As ``steady``; where the frequency moves, of the moving one by averages (no harmonics are known then)."""
    if not rows.swept:
        return steady(structure, rows, guesses(structure, rows))
    first = balance.sensor_phasor(structure, rows, balance.sweep_phasor(structure, rows))
    return first, np.zeros_like(first), np.zeros_like(first)


def true_record(structure: Structure, rows: balance.TrueRows) -> tuple[Array, Array]:
    """Amplitude and lag, without noise. NoSteadyStateError where no stable steady state is found."""
    return balance.recorded(true_phasors(structure, rows)[0], rows)
