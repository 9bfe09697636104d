"""What a test is drawn from: the structure, its simulation and tolerances, the levels and frequencies tested."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pipelines.generator.laws import Array, Law
from pipelines.generator.structure import Rows, Structure, plain_rows

#: Damping forces that a simulation may hold beside viscous damping, and the kind of law each is.
BASE_LAWS = {
    "velocity-squared": "velocity-squared",
    "displacement": "displacement",
    "displacement-velocity": "displacement-velocity",
    "quadratic-displacement": "quadratic-displacement",
    "coulomb": "coulomb",
}

Generator = np.random.Generator


@dataclass(frozen=True)
class Bench:
    """Simulation (nominal), tolerances, true deviations in units of tolerance, test plan, sweep-to-sweep scatter.

    ``A`` is the resonant amplitude at the highest force if all damping were viscous; ``xi`` the nominal damping ratio.
    """

    nominal: Structure
    tolerance: tuple[float, float, float]  # of frequency, mass, viscous
    deviation: tuple[float, float, float]
    base: tuple[tuple[str, float], ...]  # simulated damping beside viscous: force name, coefficient
    rows: Rows
    scatter: tuple[float, float]  # standard uncertainty of gain and frequency from sweep to sweep, 0 without
    scatter_declared: bool
    A: float
    xi: float

    def truth(self, deviation: tuple[float, float, float] | None = None) -> Structure:
        """The structure with its true (or the given) deviations from the simulation."""
        return deviated(self.nominal, self.tolerance, self.deviation if deviation is None else deviation)


def deviated(
    nominal: Structure, tolerance: tuple[float, float, float], deviation: tuple[float, float, float]
) -> Structure:
    """The structure whose frequency, mass and viscous coefficient are off by so many tolerances."""
    f, m, c = (1 + t * d for t, d in zip(tolerance, deviation, strict=True))
    return replace(nominal, omega=nominal.omega * f, mass=nominal.mass * m, viscous=nominal.viscous * c)


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_bench(rng: Generator, field: bool, scatter: bool | None = None, levels_at_least: int = 1) -> Bench:
    """Draw structure, simulation and test plan; ``scatter`` decides whether sweeps scatter (None: by chance)."""
    hertz, mass = log_uniform(rng, 1.0, 15.0), log_uniform(rng, 4.0, 150.0)
    xi, A = log_uniform(rng, 0.002, 0.015), log_uniform(rng, 0.003, 0.6)
    omega = 2 * np.pi * hertz
    viscous = 2 * xi * mass * omega
    base = _base_laws(rng, viscous, omega, A)
    laws = tuple(Law(BASE_LAWS[name], coefficient) for name, coefficient in base)
    tolerance = (xi * rng.uniform(0.04, 0.2), float(rng.choice([0.01, 0.02])), float(rng.choice([0.03, 0.05, 0.08])))
    deviation = tuple(float(np.clip(rng.normal(), -2.5, 2.5)) for _ in range(3))
    rows = _plan(rng, field, viscous * omega * A, omega, xi, levels_at_least)
    if scatter is None:
        scatter = bool(rng.random() < (0.6 if field else 0.2))
    spread = (log_uniform(rng, 0.006, 0.016), min(xi * rng.uniform(0.03, 0.12), 1e-3)) if scatter else (0.0, 0.0)
    rows = _scattered(rng, rows, spread)
    nominal = Structure(mass, omega, viscous, laws)
    return Bench(
        nominal, tolerance, (deviation[0], deviation[1], deviation[2]), base, rows, spread,
        bool(rng.random() < 0.75) if scatter else bool(rng.random() < 0.1), A, xi,
    )  # fmt: skip


def _base_laws(rng: Generator, viscous: float, omega: float, A: float) -> tuple[tuple[str, float], ...]:
    """No further simulated damping mostly, else one force whose loss at A is a share of the viscous one."""
    if rng.random() < 0.75:
        return ()
    name = str(rng.choice(sorted(BASE_LAWS)))
    share = rng.uniform(0.02, 0.08) if name == "coulomb" else rng.uniform(0.2, 0.8)
    return ((name, share * force_unit(BASE_LAWS[name], viscous, omega, A)),)


def force_unit(kind: str, viscous: float, omega: float, A: float) -> float:
    """The coefficient with which a force loses at amplitude A the energy pi viscous A^2 omega of viscous damping."""
    loss = {
        "displacement": 2 * A**2,
        "velocity-squared": 8 / 3 * A**3 * omega**2,
        "displacement-velocity": 4 / 3 * A**3 * omega,
        "quadratic-displacement": np.pi / 4 * A**4 * omega,
        "coulomb": 4 * A,
    }[kind]
    return float(np.pi * viscous * A**2 * omega / loss)


def _plan(rng: Generator, field: bool, top: float, omega: float, xi: float, at_least: int) -> Rows:
    """Levels, frequencies, direction; in the field uneven, with repeats and measured forces that wander."""
    levels = int(
        rng.choice([1, 2, 3, 4, 5, 6], p=[0.04, 0.12, 0.28, 0.26, 0.2, 0.1] if field else [0, 0, 0.4, 0.3, 0.2, 0.1])
    )
    levels = max(levels, at_least)
    ratio = log_uniform(rng, 2.0, 8.0)
    forces = top * ratio ** -np.sort(rng.permutation(np.linspace(0, 1, levels)) if levels > 1 else np.zeros(1))[::-1]
    points = int(np.clip(rng.normal(130, 35), 50, 220) / levels)
    points = int(np.clip(points, 14, 44))
    half, centre = xi * rng.uniform(5.0, 9.0), xi * rng.uniform(-1.0, 1.0)
    dense = rng.uniform(0.5, 2.5)
    up = bool(rng.random() < 0.7)
    sweeps, frequencies, loads = [], [], []
    for number, force in enumerate(forces):
        place = np.linspace(-1, 1, points) + (rng.uniform(-0.35, 0.35, points) * 2 / points if field else 0.0)
        offset = np.sinh(dense * place) / np.sinh(dense) * half + centre
        if field and rng.random() < 0.4:
            offset = np.append(offset, rng.choice(offset, size=max(2, points // 8)))
        offset = np.sort(offset) if up else np.sort(offset)[::-1]
        sweeps.append(np.full(offset.size, number))
        frequencies.append(omega * (1 + offset))
        loads.append(
            force * (1 + (0.03 * rng.normal(size=offset.size) if field and rng.random() < 0.3 else 0.0) + 0 * offset)
        )
    return plain_rows(np.concatenate(sweeps), np.concatenate(loads), np.concatenate(frequencies), up)


def _scattered(rng: Generator, rows: Rows, spread: tuple[float, float]) -> Rows:
    """Gain and natural frequency of each sweep drawn about their means."""
    count = int(rows.sweep.max()) + 1
    gain, tune = (1 + sd * rng.normal(size=count) for sd in spread)
    return replace(rows, gain=rows.gain * gain[rows.sweep], tuning=rows.tuning * tune[rows.sweep])


def sweep_array(values: npt.NDArray[np.float64], rows: Rows) -> Array:
    """One value a sweep, spread over its rows."""
    return values[rows.sweep]
