"""Motion of M q'' + K q + g(q, q') = F sin(omega t) in time, piece by piece between turning points.

Between two turning points the velocity has one sign: dry friction is a constant and a slip joint a function of the
distance travelled, so each piece is a smooth (joints: continuous) equation for `scipy.integrate.solve_ivp`. At a
turning point the mass goes on, turns back, or sticks until the drive overcomes friction. Nothing is regularised.

Of a force only its law in time, `Force.g`, and its joints are used, none of the averages that this checks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError
from damping.forces.contract import Force, Joint

#: Pieces in one period beyond which the motion is not advancing.
_MOST_PIECES = 2000
#: Relative tolerance of the integrator, small because of the kinks of |q| in a piece; the absolute one is this times
#: the scale of the motion.
_RTOL = 1e-11


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

    @cached_property
    def joints(self) -> tuple[Joint, ...]:
        """The joints of the force, which remember where they stick."""
        return self.force.joints

    def resistance(self, q: float, speed: float, sign: float) -> float:
        """K q + g: what spring and force hold against the motion, joints left out."""
        return self.K * q + float(self.force.g(q, speed, sign))


@dataclass(frozen=True)
class State:
    """Displacement, velocity and the joints' stretches at the time t; ``sums`` are time integrals since a start.

    ``sums`` holds int q sin(omega t), int q cos(omega t), int q and int q^2 dt.
    """

    t: float
    q: float
    v: float
    stretches: tuple[float, ...]
    sums: FloatArray

    @property
    def restarted(self) -> State:
        """The same state with the integrals set to zero."""
        return replace(self, sums=np.zeros(4))


def at_rest(oscillator: Oscillator) -> State:
    """Rest in the undeformed position at the time 0."""
    return State(t=0.0, q=0.0, v=0.0, stretches=(0.0,) * len(oscillator.joints), sums=np.zeros(4))


def advance(oscillator: Oscillator, state: State, periods: int) -> State:
    """The state ``periods`` drive periods later.

    Raises:
        AnalysisError: the motion does not advance (turning points crowd together), or grows without bound.
    """
    end = state.t + periods * oscillator.period
    for _ in range(_MOST_PIECES * periods):
        if state.t >= end - 1e-12 * oscillator.period:
            return replace(state, t=end)
        sign, start = _direction(oscillator, state)
        if sign == 0.0 or start > state.t:
            state = _stick(oscillator, state, min(start, end))
            if state.t >= end:
                continue
        state = _move(oscillator, state, sign, end)
    raise AnalysisError("time integration does not advance: the mass turns ever more often")


def _pull(oscillator: Oscillator, state: State, sign: float) -> float:
    """Drive force needed to move in the direction ``sign`` from rest at the present position."""
    joints = sum(j.stiffness * s for j, s in zip(oscillator.joints, state.stretches, strict=True))
    return oscillator.resistance(state.q, 0.0, sign) + float(joints)


def _direction(oscillator: Oscillator, state: State) -> tuple[float, float]:
    """Direction of the coming piece and the time it starts: now, or after sticking (direction 0: never)."""
    if state.v != 0.0:
        return math.copysign(1.0, state.v), state.t
    forward, backward = _pull(oscillator, state, 1.0), _pull(oscillator, state, -1.0)
    drive = oscillator.F * math.sin(oscillator.omega * state.t)
    if drive > forward:
        return 1.0, state.t
    if drive < backward:
        return -1.0, state.t
    rises = _next_time(oscillator, state.t, forward, rising=True)
    falls = _next_time(oscillator, state.t, backward, rising=False)
    if math.isinf(rises) and math.isinf(falls):
        return 0.0, math.inf
    return (1.0, rises) if rises <= falls else (-1.0, falls)


def _next_time(oscillator: Oscillator, now: float, level: float, *, rising: bool) -> float:
    """When F sin(omega t) next passes ``level`` upwards or downwards, at the earliest now; infinity: never."""
    if abs(level) >= oscillator.F:
        return math.inf
    angle = math.asin(level / oscillator.F)
    phase = angle if rising else math.pi - angle
    turns = math.ceil((oscillator.omega * now - phase) / (2.0 * math.pi) - 1e-12)
    return max(now, (phase + 2.0 * math.pi * turns) / oscillator.omega)


def _stick(oscillator: Oscillator, state: State, until: float) -> State:
    """Rest at the present position."""
    w, q, a, b = oscillator.omega, state.q, state.t, until
    sine, cosine = (math.cos(w * a) - math.cos(w * b)) / w, (math.sin(w * b) - math.sin(w * a)) / w
    held = np.array([q * sine, q * cosine, q * (b - a), q * q * (b - a)])
    return replace(state, t=until, sums=state.sums + held)


def _move(oscillator: Oscillator, state: State, sign: float, end: float) -> State:
    """One piece in the direction ``sign``, to the next turning point or the end."""
    F, w, M, start = oscillator.F, oscillator.omega, oscillator.M, state.q
    joints = list(zip(oscillator.joints, state.stretches, strict=True))

    def motion(t: float, y: FloatArray) -> list[float]:
        q, v = float(y[0]), float(y[1])
        sine = math.sin(w * t)
        force = oscillator.resistance(q, max(sign * v, 0.0), sign)
        for joint, stretch in joints:
            force += float(joint.stiffness) * joint.stretch(stretch, q - start)
        return [v, (F * sine - force) / M, q * sine, q * math.cos(w * t), q, q * q]

    def turning(t: float, y: FloatArray) -> float:
        return float(y[1])

    turning.terminal, turning.direction = True, -sign  # type: ignore[attr-defined]  # how solve_ivp takes events
    scale = max(abs(state.q), abs(state.v) / w, F / oscillator.K)
    size = _RTOL * np.array([scale, scale * w, *(scale * oscillator.period * np.array([1.0, 1.0, 1.0, scale]))])
    from scipy.integrate import solve_ivp  # noqa: PLC0415 - slow to import, and few commands integrate in time

    solution = solve_ivp(
        motion,
        (state.t, end),
        np.array([state.q, state.v, *state.sums]),
        method="DOP853",
        events=turning,
        rtol=_RTOL,
        atol=size,
        max_step=oscillator.period / 12.0,
    )
    if not solution.success or not np.all(np.isfinite(solution.y[:, -1])):
        raise AnalysisError(f"time integration fails: {solution.message}")
    q, v = float(solution.y[0, -1]), float(solution.y[1, -1])
    stretches = tuple(joint.stretch(stretch, q - start) for joint, stretch in joints)
    turned = solution.status == 1
    return State(float(solution.t[-1]), q, 0.0 if turned else v, stretches, np.asarray(solution.y[2:, -1]))
