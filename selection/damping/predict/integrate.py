"""Steady states by integration in time: the reference for the first-harmonic averages, with none of their code.

A periodic motion is found by shooting (Newton's method on the map of one period, the physical state at the end less
that at the start) and accepted when its multipliers are inside the unit circle; where shooting finds none, the motion
is left to settle by itself. Either way the steady state is proved on successive windows of several periods: their
first harmonics agree.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.forces.contract import Force
from damping.predict.integration import Oscillator, State, advance, at_rest

#: Periods of free settling before each shot from rest: more where the shots before found nothing.
_FREE_FROM_REST = (8, 24, 72)
#: The same from the motion at a neighbouring frequency, which is nearly right already.
_FREE = (2, 24, 72)
#: Newton steps of a shot; it converges in four or five, or not at all.
_MOST_SHOTS = 15
#: Change over one period, relative to the amplitude, at which a shot has hit.
_HIT = 1e-8
#: Periods of one window in which a motion is watched settling.
_WINDOW = 5
#: Windows left for settling: 3000 periods, at which a damping of 0.1 % has taken e^-18 of the transient.
_MOST_WINDOWS = 600


@dataclass(frozen=True)
class TimeState:
    """A steady state of the motion in time.

    Attributes:
        amplitude, phase: first harmonic A sin(omega t - phase) of the displacement over a window.
        distortion: root of the power of all higher harmonics over that of the first one.
        drift: relative difference of the first harmonics of the last two windows.
        state: displacement, velocity and joints at the end, at a zero of the drive: where to go on from.
    """

    amplitude: float
    phase: float
    distortion: float
    drift: float
    state: State


def steady_state_in_time(
    force: Force, F: float, omega: float, M: float, omega_n: float, *, start: State | None = None, rtol: float = 1e-6
) -> TimeState:
    """The stable steady state reached from ``start`` (default: rest) under F sin(omega t).

    Args:
        force: force with scalar parameters. F: force amplitude. omega: drive, rad/s. M, omega_n: mode.
        start: state of an earlier result, such as that of the neighbouring frequency in a sweep.
        rtol: agreement of successive windows, extrapolated to all that follow.

    Raises:
        AnalysisError: no steady state is reached, or a part of the force has no law in time.
    """
    oscillator = Oscillator(force, float(F), float(omega), float(M), float(omega_n))
    state = at_rest(oscillator) if start is None else replace(start, t=0.0).restarted
    for periods in _FREE_FROM_REST if start is None else _FREE:
        state = advance(oscillator, state, periods)
        hit = _shoot(oscillator, state)
        if hit is not None:
            return _settle(oscillator, *hit, rtol)
    return _settle(oscillator, state, None, rtol)


def sweep_in_time(
    force: Force, F: float, omega: FloatArray, M: float, omega_n: float, direction: Literal["up", "down"] = "up"
) -> Iterator[TimeState]:
    """Steady states at the frequencies ``omega`` in the order swept, each started from the one before it.

    Raises:
        AnalysisError: see `steady_state_in_time`.
    """
    start: State | None = None
    for frequency in np.sort(omega) if direction == "up" else np.sort(omega)[::-1]:
        found = steady_state_in_time(force, F, float(frequency), M, omega_n, start=start)
        start = found.state
        yield found


def _size(oscillator: Oscillator, state: State) -> float:
    return max(float(np.hypot(state.q, state.v / oscillator.omega)), 1e-12 * oscillator.F / oscillator.K)


def _moved(oscillator: Oscillator, state: State, dq: float, dv: float) -> State:
    """A neighbouring state: joints move with the displacement."""
    stretches = tuple(
        joint.stretch(stretch, dq) for joint, stretch in zip(oscillator.joints, state.stretches, strict=True)
    )
    return replace(state, q=state.q + dq, v=state.v + dv, stretches=stretches)


def _shoot(oscillator: Oscillator, state: State) -> tuple[State, float] | None:
    """A stable periodic state near ``state`` and its largest multiplier; None where Newton's method finds none."""
    w = oscillator.omega
    jacobian, last = None, np.inf
    for _ in range(_MOST_SHOTS):
        size = _size(oscillator, state)
        after = advance(oscillator, state, 1)
        miss = np.array([after.q - state.q, (after.v - state.v) / w])
        distance = float(np.hypot(*miss))
        if jacobian is None or distance > 0.1 * last:  # else the old one still serves
            jacobian = _jacobian(oscillator, state, after, 1e-5 * size)
        if distance < _HIT * size:
            radius = float(np.max(np.abs(np.linalg.eigvals(jacobian))))
            return (after, radius) if radius < 1.0 else None
        last = distance
        change = np.linalg.lstsq(np.eye(2) - jacobian, miss, rcond=1e-10)[0]
        change *= min(1.0, 2.0 * size / max(float(np.hypot(*change)), 1e-300))
        correction = (state.q - after.q + change[0], state.v - after.v + change[1] * w)
        state = _moved(oscillator, after, *(float(c) for c in correction))
    return None


def _jacobian(oscillator: Oscillator, state: State, after: State, step: float) -> FloatArray:
    """Derivative of (q, v/omega) after one period by that at its start."""
    w = oscillator.omega
    ends = [advance(oscillator, _moved(oscillator, state, dq, dv), 1) for dq, dv in ((step, 0.0), (0.0, step * w))]
    return np.array([[(end.q - after.q) / step, (end.v - after.v) / (step * w)] for end in ends]).T


def _settle(oscillator: Oscillator, state: State, radius: float | None, rtol: float) -> TimeState:
    """Go on window by window until first harmonics agree, the rest of the approach included.

    The rest is that of a geometric approach whose ratio from window to window is the multiplier's power where shooting
    found one, else the ratio of the last two changes.
    """
    previous, last = None, np.inf
    for _ in range(_MOST_WINDOWS):
        state = advance(oscillator, state.restarted, _WINDOW)
        harmonic = _first_harmonic(oscillator, state)
        if previous is not None:
            change = abs(harmonic - previous) / max(abs(harmonic), 1e-300)
            ratio = radius**_WINDOW if radius is not None else min(change / last, 1.0) if last > 0.0 else 0.0
            if (radius is not None or np.isfinite(last)) and change <= rtol * (1.0 - ratio):
                return _result(oscillator, state, harmonic, change)
            last = change
        previous = harmonic
    raise AnalysisError(
        f"no steady state within {_MOST_WINDOWS * _WINDOW} periods at {oscillator.omega / (2 * np.pi):.6g} Hz"
    )


def _first_harmonic(oscillator: Oscillator, state: State) -> complex:
    """A exp(-i phase) of q = A sin(omega t - phase), from the integrals of a window."""
    return complex(state.sums[0], state.sums[1]) * 2.0 / (_WINDOW * oscillator.period)


def _result(oscillator: Oscillator, state: State, harmonic: complex, drift: float) -> TimeState:
    window = _WINDOW * oscillator.period
    other = max(state.sums[3] / window - (state.sums[2] / window) ** 2 - 0.5 * abs(harmonic) ** 2, 0.0)
    return TimeState(
        amplitude=abs(harmonic),
        phase=float(-np.angle(harmonic)),
        distortion=float(np.sqrt(other / (0.5 * abs(harmonic) ** 2))) if harmonic else 0.0,
        drift=float(drift),
        state=state.restarted,
    )
