"""Motion of the true structure through one cycle of the drive, for all rows of a test at once.

Fixed-step Runge-Kutta method of fourth order. The sign of the velocity is smoothed over +-1.5 steps, symmetrically,
which leaves an error of second order in the step, and one of first order in the step times friction over elastic force;
joints are taken to move one way within a step, an error of second order.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from damping_validation.generator.structure import JUMPS, Array, Complex, Structure, TrueRows, chosen_rows

STEPS = 256
_SMOOTHED = 1.5  # steps on either side of a change of sign
_TINY = 1e-300


@dataclass(frozen=True)
class TrueState:
    """Displacements and velocities, shape (coordinates, copies, rows), and the stretches of the joints."""

    q: Array
    v: Array
    z: tuple[Array, ...]

    def chosen(self, chosen: npt.NDArray[np.bool_]) -> TrueState:
        """The state at the chosen rows alone."""
        return TrueState(self.q[..., chosen], self.v[..., chosen], tuple(z[..., chosen] for z in self.z))

    def put(self, chosen: npt.NDArray[np.bool_], part: TrueState) -> TrueState:
        """This state with the chosen rows replaced."""
        new = TrueState(self.q.copy(), self.v.copy(), tuple(z.copy() for z in self.z))
        new.q[..., chosen], new.v[..., chosen] = part.q, part.v
        for target, source in zip(new.z, part.z, strict=True):
            target[..., chosen] = source
        return new


class TrueMotion:
    """The equations of motion of a structure at the rows of a test (arrays made once, used at every step)."""

    def __init__(self, structure: Structure, rows: TrueRows, steps: int = STEPS) -> None:
        main, sides = structure.omega * rows.tuning, structure.sides
        omega = np.array([main, *(np.full(main.size, side.omega) for side in sides)])
        damping = np.array([structure.viscous / structure.mass, *(2 * side.zeta * side.omega for side in sides)])
        drive = np.array([structure.share, *(side.drive for side in sides)])
        self.structure, self.rows, self.steps = structure, rows, steps
        self.seen = np.array([structure.share, *(side.seen for side in sides)])
        self.stiffness = (omega**2)[:, None, :]
        self.damping = damping[:, None, None]
        self.load = drive[:, None, None] * (rows.force * rows.drive / structure.mass)
        self._h = 2 * np.pi / steps / rows.omega
        self._smooth = _SMOOTHED * 2 * np.pi / steps * rows.omega
        self._jumps = any(law.kind in JUMPS for law in structure.laws)
        self._linear = not (structure.laws or structure.joints)

    def chosen(self, chosen: npt.NDArray[np.bool_]) -> TrueMotion:
        """The same at the chosen rows alone."""
        return TrueMotion(self.structure, chosen_rows(self.rows, chosen), self.steps)

    def acceleration(self, q: Array, v: Array, z: tuple[Array, ...], sine: float) -> Array:
        """Second derivatives of the coordinates when the force is at ``sine`` of its amplitude."""
        a = self.load * sine - self.damping * v - self.stiffness * q
        if self._linear:
            return a
        main, speed = q[0], v[0]
        sign = speed
        if self._jumps:
            sign = np.minimum(np.maximum(speed / (self._smooth * np.abs(main) + _TINY), -1.0), 1.0)
        for law in self.structure.laws:
            a[0] -= law.force(main, speed, sign) / self.structure.mass
        for joint, stretch in zip(self.structure.joints, z, strict=True):
            a[0] -= joint.force(stretch, main) / self.structure.mass
        return a

    def moved(self, z: tuple[Array, ...], dq: Array) -> tuple[Array, ...]:
        """The stretches of the joints after the main coordinate moved by ``dq``."""
        return tuple(joint.move(part, dq) for joint, part in zip(self.structure.joints, z, strict=True))

    def step(self, state: TrueState, sines: tuple[float, float, float]) -> TrueState:
        """The state one step later; ``sines`` is the drive at its start, middle and end."""
        q, v, z, h = state.q, state.v, state.z, self._h
        k1 = self.acceleration(q, v, z, sines[0])
        q2, v2 = q + (h / 2) * v, v + (h / 2) * k1
        k2 = self.acceleration(q2, v2, self.moved(z, q2[0] - q[0]), sines[1])
        q3, v3 = q + (h / 2) * v2, v + (h / 2) * k2
        k3 = self.acceleration(q3, v3, self.moved(z, q3[0] - q[0]), sines[1])
        q4, v4 = q + h * v3, v + h * k3
        k4 = self.acceleration(q4, v4, self.moved(z, q4[0] - q[0]), sines[2])
        end = q + (h / 6) * (v + 2 * (v2 + v3) + v4)
        return TrueState(end, v + (h / 6) * (k1 + 2 * (k2 + k3) + k4), self.moved(z, end[0] - q[0]))

    def cycle(self, state: TrueState, samples: Array | None = None) -> tuple[TrueState, tuple[Array, ...]]:
        """The state one cycle later, and the stretches half a cycle before.

        ``samples`` (steps, rows) receives the displacement at the sensor, of the first copy.
        """
        sines = np.sin(np.arange(2 * self.steps + 1) * np.pi / self.steps)
        half = state.z
        for n in range(self.steps):
            if samples is not None:
                samples[n] = self.seen @ state.q[:, 0, :]
            if 2 * n == self.steps:
                half = state.z
            state = self.step(state, (sines[2 * n], sines[2 * n + 1], sines[2 * n + 2]))
        return state, half

    def dwelt(self, state: TrueState, cycles: int) -> TrueState:
        """The state ``cycles`` later."""
        for _ in range(cycles):
            state = self.cycle(state)[0]
        return state

    def first_harmonic(self, state: TrueState) -> tuple[Complex, TrueState]:
        """Phasor A exp(-i phi) of the sensor's signal A sin(omega t - phi), projected over one cycle, and its end."""
        angle = 2 * np.pi * np.arange(self.steps) / self.steps
        samples = np.empty((self.steps, self._h.size))
        end = self.cycle(state, samples)[0]
        shown = np.clip(samples, -self.rows.clip, self.rows.clip)
        return (2 / self.steps) * ((np.sin(angle) + 1j * np.cos(angle)) @ shown), end


def started(motion: TrueMotion, guess: Complex) -> TrueState:
    """State at the start of a cycle for a guess of the main coordinate's phasor; other modes start from their own.

    q = A sin(theta - phi) is Im(X exp(i theta)) with X = A exp(-i phi), so q = Im X and v = omega Re X at theta = 0.
    """
    omega = motion.rows.omega
    phasors = [guess]
    for n in range(1, motion.seen.size):
        impedance = motion.stiffness[n, 0] - omega**2 + 1j * motion.damping[n, 0, 0] * omega
        phasors.append(motion.load[n, 0] / impedance)
    X = np.array(phasors)[:, None, :]
    return TrueState(X.imag.copy(), omega * X.real, tuple(joint.start(X[0].imag) for joint in motion.structure.joints))
