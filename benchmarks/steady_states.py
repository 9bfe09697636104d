"""A million steady states of viscous + case IV damping on one core, against integrating each in time.

Run ``python -m benchmarks.steady_states``. The peer is `scipy.integrate.solve_ivp` (DOP853, rtol 1e-8) from rest
through a number of periods that leaves exp(-13.8) = 1e-6 of the transient, at the linear decay rate of the state's own
equivalent viscous damping; its steady states must be the same within what one harmonic can tell.
"""

from __future__ import annotations

from math import pi

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks._rows import Row, Time, timed
from damping.forces import DisplacementVelocity, Sum, Viscous, equivalent_viscous
from damping.predict.steady import SteadyState, steady_state

#: First mode of Configuration II, sweep C (Table 4.I), with the damping force of Eq 4.1.14.
M = 50.78
OMEGA_N = 2 * pi * 1.66401
VISCOUS = 0.506
CASE_IV = 1.886
STATES = 1_000_000
PEERS = 3
GOAL = 1e4
#: Largest difference of amplitude between averages and integration: one harmonic, damping of .3 % of critical.
SAME = 1e-4


def averaged(F: np.ndarray, omega: np.ndarray) -> tuple[SteadyState, Time]:
    """Steady states and the time they took, best of three."""
    force = Sum((Viscous(VISCOUS), DisplacementVelocity(CASE_IV)))
    found: list[SteadyState] = []
    times = [timed(lambda: found.append(steady_state(force, F, omega, M, OMEGA_N))) for _ in range(3)]
    return found[-1], min(times, key=lambda time: time.processor)


def integrated(F: float, omega: float, periods: int) -> float:
    """Amplitude of the first harmonic after ``periods`` from rest."""

    def motion(t: float, y: np.ndarray) -> list[float]:
        q, v = y
        damping = (VISCOUS + CASE_IV * abs(q)) * v
        return [v, (F * np.sin(omega * t) - damping) / M - OMEGA_N**2 * q]

    period = 2 * pi / omega
    last = np.linspace((periods - 1) * period, periods * period, 65)
    found = solve_ivp(motion, (0.0, last[-1]), [0.0, 0.0], method="DOP853", rtol=1e-8, atol=1e-10, t_eval=last)
    return float(abs(np.mean(found.y[0, :-1] * np.exp(-1j * omega * last[:-1]))) * 2)


def measure() -> list[Row]:
    """Time of one state of each, and their agreement."""
    rng = np.random.default_rng(1970)
    F = rng.uniform(5.0, 100.0, STATES)
    omega = OMEGA_N * rng.uniform(0.99, 1.01, STATES)
    states, used = averaged(F, omega)
    missing = int(np.count_nonzero(np.isnan(states.amplitude)))
    force = Sum((Viscous(VISCOUS), DisplacementVelocity(CASE_IV)))
    times, amplitudes = [], []
    for i in range(PEERS):
        c = float(equivalent_viscous(force, states.amplitude[i], omega[i]))
        periods = int(np.ceil(13.8 * 2 * M / c * omega[i] / (2 * pi)))
        times.append(timed(lambda i=i, n=periods: amplitudes.append(integrated(float(F[i]), float(omega[i]), n))))  # type: ignore[misc]  # bound now
    worst = float(np.max(np.abs(np.array(amplitudes) / states.amplitude[:PEERS] - 1.0)))
    mean = Time(*(float(np.mean([getattr(t, part) for t in times])) for part in ("processor", "wall")))
    remark = f"{missing} not found; amplitudes differ by {worst:.0e} at most"
    return [
        Row(
            "a million steady states, per state", used.times(1 / STATES), "solve_ivp to the same accuracy", mean,
            at_least=GOAL, right=missing == 0 and worst < SAME, remark=remark,
        )
    ]  # fmt: skip


if __name__ == "__main__":
    for row in measure():
        print(row, row.ratio, row.met)
