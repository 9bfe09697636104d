"""A million steady states of viscous + case IV damping on one core, against integrating each in time.

Run ``python benchmarks/steady_states.py``. The peer is `scipy.integrate.solve_ivp` (DOP853, rtol 1e-8) from rest
through a number of periods that leaves exp(-13.8) = 1e-6 of the transient, at the linear decay rate of the state's own
equivalent viscous damping; its steady states must be the same within what one harmonic can tell.
"""

from __future__ import annotations

import sys
from math import pi
from time import process_time

import numpy as np
from scipy.integrate import solve_ivp

from selection.forces import DisplacementVelocity, Sum, Viscous
from selection.forces.derived import equivalent_viscous
from selection.response.ritz import SteadyState, steady_state

#: First mode of Configuration II, sweep C (Table 4.I), with the damping force of Eq 4.1.14.
M, OMEGA_N = 50.78, 2 * pi * 1.66401
VISCOUS, CASE_IV = 0.506, 1.886
STATES, PEERS, GOAL_S = 1_000_000, 4, 2.0
#: Largest difference of amplitude between averages and integration: one harmonic, damping of .3 % of critical.
SAME = 1e-4


def averaged(F: np.ndarray, omega: np.ndarray) -> tuple[SteadyState, float]:
    """Steady states and the processor time they took, best of three."""
    force = Sum((Viscous(VISCOUS), DisplacementVelocity(CASE_IV)))
    times = []
    for _ in range(3):
        start = process_time()
        states = steady_state(force, F, omega, M, OMEGA_N)
        times.append(process_time() - start)
    return states, min(times)


def integrated(F: float, omega: float, periods: int) -> tuple[float, float]:
    """Amplitude of the first harmonic after ``periods`` from rest, and the processor time it took."""

    def motion(t: float, y: np.ndarray) -> list[float]:
        q, v = y
        damping = (VISCOUS + CASE_IV * abs(q)) * v
        return [v, (F * np.sin(omega * t) - damping) / M - OMEGA_N**2 * q]

    period = 2 * pi / omega
    start = process_time()
    last = np.linspace((periods - 1) * period, periods * period, 65)
    found = solve_ivp(motion, (0.0, last[-1]), [0.0, 0.0], method="DOP853", rtol=1e-8, atol=1e-10, t_eval=last)
    used = process_time() - start
    q = found.y[0, :-1]
    return float(abs(np.mean(q * np.exp(-1j * omega * last[:-1]))) * 2), used


def main() -> int:
    """Print both times, their ratio and the agreement; 1 where the goal or the agreement is missed."""
    rng = np.random.default_rng(1970)
    F = rng.uniform(5.0, 100.0, STATES)
    omega = OMEGA_N * rng.uniform(0.99, 1.01, STATES)
    states, used = averaged(F, omega)
    missing = int(np.count_nonzero(np.isnan(states.amplitude)))
    print(f"averages: {STATES:,} steady states in {used:.3f} s of one core (goal {GOAL_S:g} s), {missing} not found")

    force = Sum((Viscous(VISCOUS), DisplacementVelocity(CASE_IV)))
    times, worst = [], 0.0
    for i in range(PEERS):
        c = float(equivalent_viscous(force, states.amplitude[i], omega[i]))
        periods = int(np.ceil(13.8 * 2 * M / c * omega[i] / (2 * pi)))
        amplitude, time = integrated(float(F[i]), float(omega[i]), periods)
        difference = abs(amplitude / states.amplitude[i] - 1)
        print(f"solve_ivp: {periods} periods in {time:.2f} s, amplitude differs by {difference:.1e}")
        times.append(time)
        worst = max(worst, difference)
    mean = float(np.mean(times))
    print(f"per state: {used / STATES * 1e6:.3f} us against {mean:.2f} s, {mean / used * STATES:.2g} times")
    return int(used > GOAL_S or missing > 0 or worst > SAME)


if __name__ == "__main__":
    sys.exit(main())
