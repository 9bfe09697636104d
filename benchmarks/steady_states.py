"""A million steady states of viscous + case IV damping on one core, against integrating each in time.

Run ``python -m benchmarks steady_states``. The peers integrate from rest through a number of periods that leaves
exp(-13.8) = 1e-6 of the transient, at the linear decay rate of the state's own equivalent viscous damping:
`scipy.integrate.solve_ivp` (DOP853, rtol 1e-8), and diffrax (Dopri8, the same tolerances), compiled by JAX before.
Their steady states must be the same within what one harmonic can tell.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks._rows import Row, Time, timed
from damping.forces import DisplacementVelocity, Sum, Viscous
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
RTOL = 1e-8
ATOL = 1e-10


def averaged(F: np.ndarray, omega: np.ndarray) -> tuple[SteadyState, Time]:
    """Steady states and the time they took, best of three."""
    force = Sum((Viscous(VISCOUS), DisplacementVelocity(CASE_IV)))
    found: list[SteadyState] = []
    times = [timed(lambda: found.append(steady_state(force, F, omega, M, OMEGA_N))) for _ in range(3)]
    return found[-1], min(times, key=lambda time: time.processor)


def amplitude_of(motion: np.ndarray, omega: float, times: np.ndarray) -> float:
    """Amplitude of the first harmonic of a period."""
    return float(abs(np.mean(motion[:-1] * np.exp(-1j * omega * times[:-1]))) * 2)


def last_period(omega: float, periods: int) -> np.ndarray:
    """65 instants of the last of ``periods`` periods."""
    period = 2 * pi / omega
    return np.linspace((periods - 1) * period, periods * period, 65)


def integrated(F: float, omega: float, periods: int) -> float:
    """Amplitude of the first harmonic after ``periods`` from rest."""

    def motion(t: float, y: np.ndarray) -> list[float]:
        q, v = y
        damping = (VISCOUS + CASE_IV * abs(q)) * v
        return [v, (F * np.sin(omega * t) - damping) / M - OMEGA_N**2 * q]

    last = last_period(omega, periods)
    found = solve_ivp(motion, (0.0, last[-1]), [0.0, 0.0], method="DOP853", rtol=RTOL, atol=ATOL, t_eval=last)
    return amplitude_of(found.y[0], omega, last)


def compile_integrator() -> Callable[[float, float, int], float]:
    """The same by diffrax, compiled for one state at a time."""
    import diffrax  # noqa: PLC0415 - a peer, which only this needs
    import jax  # noqa: PLC0415 - as above
    import jax.numpy as jnp  # noqa: PLC0415 - as above

    jax.config.update("jax_enable_x64", True)

    def motion(t: Any, y: Any, rig: Any) -> Any:
        F, omega = rig
        damping = (VISCOUS + CASE_IV * jnp.abs(y[0])) * y[1]
        return jnp.array([y[1], (F * jnp.sin(omega * t) - damping) / M - OMEGA_N**2 * y[0]])

    def solve(F: Any, omega: Any, last: Any) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(motion), diffrax.Dopri8(), 0.0, last[-1], 0.01, jnp.zeros(2), (F, omega),
            saveat=diffrax.SaveAt(ts=last), stepsize_controller=diffrax.PIDController(rtol=RTOL, atol=ATOL),
            max_steps=10_000_000,
        ).ys  # fmt: skip

    compiled = jax.jit(solve)

    def integrate(F: float, omega: float, periods: int) -> float:
        last = last_period(omega, periods)
        return amplitude_of(np.asarray(compiled(F, omega, jnp.asarray(last)))[:, 0], omega, last)

    integrate(1.0, OMEGA_N, 1)
    return integrate


def measure() -> list[Row]:
    """Time of one state of each, and their agreement."""
    rng = np.random.default_rng(1970)
    F = rng.uniform(5.0, 100.0, STATES)
    omega = OMEGA_N * rng.uniform(0.99, 1.01, STATES)
    states, used = averaged(F, omega)
    missing = int(np.count_nonzero(np.isnan(states.amplitude)))
    chosen = [(float(F[i]), float(omega[i]), count_periods(states.amplitude[i], omega[i])) for i in range(PEERS)]
    rows = []
    for peer, integrate in (("solve_ivp", integrated), ("diffrax, compiled before", compile_integrator())):
        amplitudes: list[float] = []
        times = [timed(lambda state=state, by=integrate, to=amplitudes: to.append(by(*state))) for state in chosen]  # type: ignore[misc]  # bound now
        worst = float(np.max(np.abs(np.array(amplitudes) / states.amplitude[:PEERS] - 1.0)))
        mean = Time(*(float(np.mean([getattr(t, part) for t in times])) for part in ("processor", "wall")))
        remark = f"{missing} not found; amplitudes differ by {worst:.0e} at most"
        rows.append(
            Row(
                "a million steady states, per state", used.times(1 / STATES), f"{peer}, to the same accuracy", mean,
                at_least=GOAL if integrate is integrated else None, right=missing == 0 and worst < SAME, remark=remark,
            )
        )  # fmt: skip
    return rows


def count_periods(A: float, omega: float) -> int:
    """Periods after which the transient has faded."""
    damping = Sum((Viscous(VISCOUS), DisplacementVelocity(CASE_IV)))
    c = float(damping.quadrature(A, omega)) / (A * omega)  # the viscous coefficient of equal energy (Eq 4.3.1)
    return int(np.ceil(13.8 * 2 * M / c * omega / (2 * pi)))
