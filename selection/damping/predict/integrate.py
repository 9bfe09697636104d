"""Steady states by integration in time: a reference for the first-harmonic averages that shares no code with them.

M q'' + K q + g(q, q') = F sin(omega t) is solved piece by piece between turning points, where the velocity has one
sign: dry friction is constant there and a slip joint a function of the distance travelled, so each piece is a smooth
(with joints: continuous) equation. At a turning point the mass goes on, turns back, or sticks until the drive overcomes
friction. Nothing is regularised. Only `Force.g` and the joints of a force are used, not the averages under test.

A periodic motion is found by shooting (Newton's method on the map of one period, the physical state at the end minus
that at the start) and accepted if its multipliers are inside the unit circle. If shooting fails, the motion is left to
settle. In both cases the steady state is verified: the first harmonics of successive windows of several periods agree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.forces.contract import Force

_MOST_PIECES = 2000  #: most pieces in one period; with more the motion does not advance
#: Relative tolerance of the integrator, small because of the kinks of |q| in a piece; the absolute tolerance is this
#: times the scale of the motion.
_RTOL = 1e-11
#: Periods of free settling before each shooting attempt from rest: more after each failure.
_FREE_FROM_REST = (8, 24, 72)
_FREE = (2, 24, 72)  #: the same from the motion at a neighbouring frequency, which is already close
_MOST_SHOTS = 15  #: most Newton steps of a shooting attempt; it converges in four or five, or not at all
_HIT = 1e-8  #: change over one period, relative to the amplitude, at which shooting has converged
_WINDOW = 5  #: periods of one window of a settling motion; of one that shooting found a single period
_AGREEMENT = 1e-6  #: relative agreement of successive windows, extrapolated to all later ones
#: Most windows for settling: 3000 periods, after which damping of 0.1 % leaves e^-18 of the transient.
_MOST_WINDOWS = 600


@dataclass(frozen=True)
class Oscillator:
    """Mass, stiffness (all joints stuck), force g and drive F sin(omega t)."""

    force: Force
    F: float
    omega: float
    M: float
    omega_n: float

    @property
    def K(self) -> float:
        """Stiffness M omega_n^2."""
        return self.M * self.omega_n**2

    @property
    def period(self) -> float:
        """2 pi/omega."""
        return 2.0 * math.pi / self.omega

    def resistance(self, q: float, speed: float, sign: float) -> float:
        """K q + g: resistance of spring and force, without joints."""
        return self.K * q + float(self.force.g(q, speed, sign))


@dataclass(frozen=True)
class State:
    """Displacement, velocity and joints at one time."""

    t: float  #: time
    q: float  #: displacement
    v: float  #: velocity
    stretches: tuple[float, ...]  #: of the joints
    sums: FloatArray  #: time integrals of q sin(omega t) and q cos(omega t) since the last restart

    @property
    def restarted(self) -> State:
        """The same state with the integrals set to zero."""
        return replace(self, sums=np.zeros(2))


def advance(oscillator: Oscillator, state: State, periods: int) -> State:
    """The state ``periods`` drive periods later.

    AnalysisError: the motion does not advance (turning points crowd together), or grows without bound.
    """
    end = state.t + periods * oscillator.period
    for _ in range(_MOST_PIECES * periods):
        if state.t >= end - 1e-12 * oscillator.period:
            return replace(state, t=end)
        sign, start = _direction(oscillator, state)
        if start > state.t:
            state = _stick(oscillator, state, min(start, end))
            if state.t >= end:
                continue
        state = _move(oscillator, state, sign, end)
    raise AnalysisError("time integration does not advance: the mass turns ever more often")


def _direction(oscillator: Oscillator, state: State) -> tuple[float, float]:
    """Direction of the next piece and its start time: now, or after sticking (infinity: never)."""
    if state.v != 0.0:
        return math.copysign(1.0, state.v), state.t
    joints = float(sum(j.stiffness * s for j, s in zip(oscillator.force.joints, state.stretches, strict=True)))
    # drive force needed to move from rest at the present position
    forward, backward = (oscillator.resistance(state.q, 0.0, sign) + joints for sign in (1.0, -1.0))
    drive = oscillator.F * math.sin(oscillator.omega * state.t)
    if drive > forward:
        return 1.0, state.t
    if drive < backward:
        return -1.0, state.t
    rises = _next_time(oscillator, state.t, forward, rising=True)
    falls = _next_time(oscillator, state.t, backward, rising=False)
    return (1.0, rises) if rises <= falls else (-1.0, falls)


def _next_time(oscillator: Oscillator, now: float, level: float, *, rising: bool) -> float:
    """Time, not before now, when F sin(omega t) next passes ``level`` upwards or downwards; infinity: never."""
    if abs(level) >= oscillator.F:
        return math.inf
    angle = math.asin(level / oscillator.F)
    phase = angle if rising else math.pi - angle
    turns = math.ceil((oscillator.omega * now - phase) / (2.0 * math.pi) - 1e-12)
    return max(now, (phase + 2.0 * math.pi * turns) / oscillator.omega)


def _stick(oscillator: Oscillator, state: State, until: float) -> State:
    """Stick at the present position."""
    w, q, a, b = oscillator.omega, state.q, state.t, until
    sine, cosine = (math.cos(w * a) - math.cos(w * b)) / w, (math.sin(w * b) - math.sin(w * a)) / w
    return replace(state, t=until, sums=state.sums + q * np.array([sine, cosine]))


def _move(oscillator: Oscillator, state: State, sign: float, end: float) -> State:
    """One piece in the direction ``sign``, to the next turning point or the end."""
    F, w, M, start = oscillator.F, oscillator.omega, oscillator.M, state.q
    joints = list(zip(oscillator.force.joints, state.stretches, strict=True))

    def motion(t: float, y: FloatArray) -> list[float]:
        q, v = float(y[0]), float(y[1])
        sine = math.sin(w * t)
        force = oscillator.resistance(q, max(sign * v, 0.0), sign)
        for joint, stretch in joints:
            force += float(joint.stiffness) * joint.stretch(stretch, q - start)
        return [v, (F * sine - force) / M, q * sine, q * math.cos(w * t)]

    def turning(t: float, y: FloatArray) -> float:
        return float(y[1])

    turning.terminal, turning.direction = True, -sign  # type: ignore[attr-defined]  # how solve_ivp takes events
    scale = max(abs(state.q), abs(state.v) / w, F / oscillator.K)
    size = _RTOL * np.array([scale, scale * w, scale * oscillator.period, scale * oscillator.period])
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import, and few commands integrate in time

    begin, most = np.array([state.q, state.v, *state.sums]), oscillator.period / 12.0
    solution = solve_ivp(
        motion, (state.t, end), begin, method="DOP853", events=turning, rtol=_RTOL, atol=size, max_step=most
    )
    if not solution.success or not np.all(np.isfinite(solution.y[:, -1])):
        raise AnalysisError(f"time integration fails: {solution.message}")
    q, v = float(solution.y[0, -1]), float(solution.y[1, -1])
    stretches = tuple(joint.stretch(stretch, q - start) for joint, stretch in joints)
    v = 0.0 if solution.status == 1 else v  # it turned
    return State(float(solution.t[-1]), q, v, stretches, np.asarray(solution.y[2:, -1]))


@dataclass(frozen=True)
class TimeState:
    """A steady state of the motion in time."""

    amplitude: float  #: of the first harmonic A sin(omega t - phase) over a window
    phase: float  #: its lag, rad
    state: State  #: displacement, velocity and joints at the end, at a zero of the drive, to continue from


def steady_state_in_time(
    force: Force, F: float, omega: float, M: float, omega_n: float, *, start: State | None = None
) -> TimeState:
    """The stable steady state reached from ``start`` (default: rest) under F sin(omega t).

    Args:
        force: force with scalar parameters.
        F: force amplitude.
        omega: drive, rad/s.
        M, omega_n: mode.
        start: state of an earlier result, such as that of the neighbouring frequency in a sweep.

    AnalysisError: no steady state is reached, or a part of the force has no law in time.
    """
    oscillator = Oscillator(force, float(F), float(omega), float(M), float(omega_n))
    at_rest = State(t=0.0, q=0.0, v=0.0, stretches=(0.0,) * len(force.joints), sums=np.zeros(2))
    state = at_rest if start is None else replace(start, t=0.0).restarted
    for periods in _FREE_FROM_REST if start is None else _FREE:
        state = advance(oscillator, state, periods)
        hit = _shoot(oscillator, state)
        if hit is not None:
            return _settle(oscillator, *hit)
    return _settle(oscillator, state, None)


def sweep_in_time(
    force: Force, F: float, omega: FloatArray, M: float, omega_n: float, direction: Literal["up", "down"] = "up"
) -> Iterator[TimeState]:
    """Steady states at frequencies (n,) in the order swept, each started from the previous one; arguments as above."""
    start: State | None = None
    for frequency in np.sort(omega) if direction == "up" else np.sort(omega)[::-1]:
        reached = steady_state_in_time(force, F, float(frequency), M, omega_n, start=start)
        start = reached.state
        yield reached


def _moved(oscillator: Oscillator, state: State, dq: float, dv: float) -> State:
    """A neighbouring state: joints move with the displacement."""
    joints = zip(oscillator.force.joints, state.stretches, strict=True)
    return replace(state, q=state.q + dq, v=state.v + dv, stretches=tuple(j.stretch(s, dq) for j, s in joints))


def _shoot(oscillator: Oscillator, state: State) -> tuple[State, float] | None:
    """A stable periodic state near ``state`` and its largest multiplier; None if Newton's method finds none."""
    w = oscillator.omega
    jacobian, last = None, np.inf
    for _ in range(_MOST_SHOTS):
        size = max(float(np.hypot(state.q, state.v / w)), 1e-12 * oscillator.F / oscillator.K)
        after = advance(oscillator, state, 1)
        miss = np.array([after.q - state.q, (after.v - state.v) / w])
        distance = float(np.hypot(*miss))
        if jacobian is None or distance > 0.1 * last:  # else the last Jacobian is good enough
            jacobian = _jacobian(oscillator, state, after, 1e-5 * size)
        if distance < _HIT * size:
            radius = float(np.max(np.abs(np.linalg.eigvals(jacobian))))
            return (after, radius) if radius < 1.0 else None
        last = distance
        change = np.linalg.lstsq(np.eye(2) - jacobian, miss, rcond=1e-10)[0]
        change *= min(1.0, 2.0 * size / max(float(np.hypot(*change)), 1e-300))
        dq, dv = state.q - after.q + change[0], state.v - after.v + change[1] * w
        state = _moved(oscillator, after, float(dq), float(dv))
    return None


def _jacobian(oscillator: Oscillator, state: State, after: State, step: float) -> FloatArray:
    """Derivative of (q, v/omega) after one period with respect to that at its start."""
    w = oscillator.omega
    ends = [advance(oscillator, _moved(oscillator, state, dq, dv), 1) for dq, dv in ((step, 0.0), (0.0, step * w))]
    return np.array([[(end.q - after.q) / step, (end.v - after.v) / (step * w)] for end in ends]).T


def _settle(oscillator: Oscillator, state: State, radius: float | None) -> TimeState:
    """Advance window by window until first harmonics agree, including the remaining approach.

    The remainder is that of a geometric series whose ratio from window to window is the power of the multiplier if
    shooting found one, else the ratio of the last two changes.
    """
    previous, last = None, np.inf
    periods = _WINDOW if radius is None else 1
    for _ in range(_MOST_WINDOWS):
        state = advance(oscillator, state.restarted, periods)
        harmonic = complex(state.sums[0], state.sums[1]) * 2.0 / (periods * oscillator.period)  # A exp(-i phase)
        if previous is not None:
            change = abs(harmonic - previous) / max(abs(harmonic), 1e-300)
            ratio = radius if radius is not None else min(change / last, 1.0) if last > 0.0 else 0.0
            if (radius is not None or np.isfinite(last)) and change <= _AGREEMENT * (1.0 - ratio):
                return TimeState(abs(harmonic), float(-np.angle(harmonic)), state.restarted)
            last = change
        previous = harmonic
    raise AnalysisError(
        f"no steady state within {_MOST_WINDOWS * _WINDOW} periods at {oscillator.omega / (2 * np.pi):.6g} Hz: "
        "method ritz needs no settling"
    )
