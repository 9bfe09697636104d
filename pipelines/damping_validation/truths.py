"""Random structures whose damping is known, in and out of the library, tested at a few levels with noise.

Amplitudes come from independent code: the force is integrated over a closed cycle by quadrature, or stepped through it
if it has a memory, and C(A) = F is solved on a table of ln A. No force of the library is imported. The same cycle gives
the part S of a joint in phase with displacement, which shifts the resonance: omega^2 = K/M + S/(M A). A force is given
by S + iC at ``OMEGA``, and by the power of frequency with which C grows: its frequency is that of the resonance,
omega(A).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from damping.arrays import ComplexArray, FloatArray
from damping.infer.law import Law
from damping.infer.observations import Observations

OMEGA = 10.0  #: frequency of every simulated resonance, rad/s; of one that moves, at A = 1
#: Damping ratio at A = 1 of structures whose resonance moves, least and most: of large structures to 5 %.
RATIOS_OF_DAMPING = (0.002, 0.05)
#: Largest share of the stiffness that a joint carries: when all of it slips the resonance has fallen by 5 %, as of
#: bolted structures (Kerschen et al. 2006).
MOST_IN_JOINTS = 0.1
#: Share of structures with a geometric spring beside their damping, and how far it moves the resonance from A = 0 to 1
#: either way, least and most, relative.
WITH_SPRING = 1.0 / 3.0
SPRINGS = (3e-5, 3e-3)
#: Largest change of stiffness by such a spring, relative; far beyond the test it grows no more: one that softens for
#: ever leaves viscous damping nothing to balance the drive with.
MOST_BENT = 0.1
#: ln A of the tables; the middle of every test lies near A = 1, and slip can reach far at four times the largest force.
_TABLE = np.linspace(-5.0, 9.0, 281)
_A = np.exp(_TABLE)[:, None]
#: Midpoints of a cycle; C by them is right to 1e-4 for a force that jumps.
_CYCLE = 2.0 * np.pi * (np.arange(2000) + 0.5) / 2000


Parts = dict[float, ComplexArray]  #: S + iC at the table of ln A, for each power of frequency that C grows with


@dataclass(frozen=True)
class Truth:
    """A structure drawn at random."""

    name: str
    log_C: FloatArray  #: at the table's ln A
    log_omega: FloatArray  #: at the table's ln A
    mass: float  #: generalized
    law: Law | None  #: its own in the library, if it has one

    def amplitude(self, force: FloatArray) -> FloatArray:
        """Resonant amplitude at each force: the first A at which C rises through it; infinite where none does."""
        grown = np.maximum.accumulate(self.log_C)  # the first rise; a tiny slope makes it invertible
        grown = grown + 1e-9 * np.arange(len(grown))
        return np.asarray(np.exp(np.interp(np.log(force), grown, _TABLE, right=np.inf)))

    def omega(self, amplitude: FloatArray) -> FloatArray:
        """Frequency of the resonance at each amplitude, rad/s."""
        return np.asarray(np.exp(np.interp(np.log(amplitude), _TABLE, self.log_omega)))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _over_a_cycle(force: Callable[[FloatArray, FloatArray], FloatArray]) -> ComplexArray:
    """iC at the table of a damping force f(q, q'), i/pi times its integral with cos over a cycle."""
    q, velocity = _A * np.sin(_CYCLE), _A * OMEGA * np.cos(_CYCLE)
    return np.asarray(2j * np.mean(force(q, velocity) * np.cos(_CYCLE), axis=1))


def _iwan(chi: float, spike: float) -> ComplexArray:
    """S + iC of sliders that slip at x with density x^chi up to 1, and a share ``spike`` that all slip there.

    Segalman 2005: each slider's loop is traced on its way down from A, f = max(x - (A - q), -x).
    """
    x = (np.arange(60) + 0.5) / 60.0
    weight = x**chi / np.sum(x ** (chi + 1.0))
    x, weight = np.append(x, 1.0), np.append((1.0 - spike) * weight, spike)
    angle = np.pi * (np.arange(400) + 0.5) / 400.0
    force = np.zeros((len(_A), len(angle)))
    for limit, strength in zip(x, weight, strict=True):
        down = np.minimum(limit, _A) - _A * (1.0 - np.cos(angle))
        force += strength * np.maximum(down, -limit)
    # what is stuck does no work, to the last digit
    work = np.where(_A[:, 0] <= x[0], 0.0, 2.0 * np.mean(-force * np.sin(angle), axis=1))
    return np.asarray(2.0 * np.mean(force * np.cos(angle), axis=1) + 1j * np.maximum(work, 0.0))


_SUBSTEPS = 4  #: steps of the slider within one step of the motion


def _bouc_wen(n: float) -> ComplexArray:
    """S + iC of dz = (1 - |z|^n (1 + sign(z dq))/2) dq, stepped through three cycles."""
    q = np.sin(np.linspace(0.0, 6.0 * np.pi, 2401)) * _A
    z, energy, in_phase = np.zeros(len(_A)), np.zeros(len(_A)), np.zeros(len(_A))
    for i in range(1, q.shape[1]):
        step = q[:, i] - q[:, i - 1]
        for _ in range(_SUBSTEPS):
            rate = 1.0 - np.abs(z) ** n * 0.5 * (1.0 + np.sign(z * step))
            new = np.clip(z + rate * step / _SUBSTEPS, -1.0, 1.0)
            if i > 1600:
                energy += 0.5 * (z + new) * step / _SUBSTEPS
            z = new
        in_phase += (i > 1600) * z * q[:, i] / _A[:, 0]
    return 2.0 * in_phase / 800.0 + 1j * np.maximum(energy, 1e-12) / (np.pi * _A[:, 0])


@lru_cache(maxsize=8)  # most truths hold one of four exponents
def _velocity_power(exponent: float) -> Parts:
    return {exponent: _over_a_cycle(lambda q, v: np.sign(v) * np.abs(v) ** exponent)}


def _slip(limit: float) -> Parts:
    """S + iC of an elastic joint that slips: the loop of one slider, stuck over the angle psi (Caughey 1960)."""
    A = _A[:, 0]
    energy = 4.0 * limit * np.maximum(A - limit, 0.0)
    psi = np.arccos(1.0 - 2.0 * np.minimum(limit / A, 1.0))
    return {0.0: A * (psi - 0.5 * np.sin(2.0 * psi)) / np.pi + 1j * energy / (np.pi * A)}


@cache
def _joint_with_memory(name: str, number: int) -> ComplexArray:
    """S + iC of an Iwan or a Bouc-Wen joint of random shape with a limit of 1; the shapes spread over their ranges."""
    shape = np.random.default_rng([number, len(name)])
    if name == "iwan":
        return _iwan(shape.uniform(-0.8, 0.2), shape.uniform(0.0, 0.25))
    return _bouc_wen(shape.uniform(1.0, 3.0))


def _with_memory(name: str, rng: np.random.Generator) -> Parts:
    """S + iC of a joint with a memory of one of six shapes, its limit of 1 moved by a shift of ln A."""
    joint = _joint_with_memory(name, int(rng.integers(6)))
    moved = _TABLE - np.log(log_uniform(rng, 0.6, 6.0))
    C = np.exp(np.interp(moved, _TABLE, np.log(np.maximum(joint.imag, 1e-300))))
    return {0.0: np.exp(moved) * np.interp(moved, _TABLE, joint.real / _A[:, 0]) + 1j * C}


def _with_ratio(ratio: FloatArray) -> Parts:
    """Of a damping ratio (table, 1) in proportion to which the loss is."""
    return {0.0: np.asarray(1j * (ratio * _A)[:, 0], dtype=complex)}


def _mixed(rng: np.random.Generator, *parts: Parts, least: float = 0.2) -> Parts:
    """Parts that carry random shares of at least ``least`` at A = 1."""
    shares = least + (1.0 - least * len(parts)) * rng.dirichlet(np.ones(len(parts)))
    return _add(*(_scaled(part, s) for s, part in zip(shares, parts, strict=True)))


def _add(*parts: Parts) -> Parts:
    powers = {power for part in parts for power in part}
    return {power: np.asarray(sum(part[power] for part in parts if power in part)) for power in sorted(powers)}


def _scaled(parts: Parts, C: float = 1.0) -> Parts:
    """The same with ``C`` at A = 1."""
    at_one = sum(part.imag[np.argmin(np.abs(_TABLE))] for part in parts.values())
    return {power: np.asarray(part * (C / at_one)) for power, part in parts.items()}


def _with_friction(rng: np.random.Generator, *parts: Parts) -> Parts:
    """The same beside friction that carries up to 0.4 at A = 1: every level has a resonance."""
    rest, share = _mixed(rng, *parts), rng.uniform(0.1, 0.4)
    return _add(_scaled(_velocity_power(0.0), share), _scaled(rest, 1.0 - share))


#: Truths by name: how S + iC is drawn. Ratios of damping tend to a plateau, fall from one to another, grow ever slower.
TRUTHS: dict[str, Callable[[np.random.Generator], Parts]] = {
    "viscous": lambda rng: _velocity_power(1.0),
    "viscous + velocity-squared": lambda rng: _mixed(rng, _velocity_power(1.0), _velocity_power(2.0)),
    "viscous + quadratic-displacement": lambda rng: _mixed(
        rng, _velocity_power(1.0), {1.0: _over_a_cycle(lambda q, v: q**2 * v)}
    ),
    "viscous + coulomb": lambda rng: _with_friction(rng, _velocity_power(1.0)),
    "velocity-power": lambda rng: _velocity_power(rng.uniform(0.6, 2.2)),
    "viscous + slip": lambda rng: _mixed(rng, _velocity_power(1.0), _slip(log_uniform(rng, 0.2, 0.9))),
    "Iwan joint": lambda rng: _mixed(rng, _velocity_power(1.0), _with_memory("iwan", rng), least=0.3),
    "Bouc-Wen": lambda rng: _mixed(rng, _velocity_power(1.0), _with_memory("bouc-wen", rng), least=0.3),
    "saturating": lambda rng: _with_ratio(1.0 + 1.0 / (log_uniform(rng, 0.3, 3.0) / _A + 1.0) * rng.uniform(0.5, 5.0)),
    "falling": lambda rng: _with_ratio(1.0 + 1.0 / (1.0 + _A / log_uniform(rng, 0.3, 3.0)) * rng.uniform(0.3, 2.0)),
    "growing": lambda rng: _with_ratio(1.0 + rng.uniform(0.3, 3.0) * _A ** rng.uniform(0.2, 0.8)),
    "two joints": lambda rng: _mixed(
        rng, _velocity_power(1.0), _mixed(rng, _slip(log_uniform(rng, 0.1, 0.3)), _slip(log_uniform(rng, 0.3, 0.8)))
    ),
    "friction, viscous and drag": lambda rng: _with_friction(rng, _velocity_power(1.0), _velocity_power(2.0)),
    "drag and slip": lambda rng: _mixed(rng, _velocity_power(2.0), _slip(log_uniform(rng, 0.2, 0.9))),
    "hardening": lambda rng: _mixed(
        rng, _velocity_power(1.0), {1.0: _over_a_cycle(lambda q, v: v * np.abs(q))}, _velocity_power(3.0), least=0.1
    ),
}
IN_LIBRARY = tuple(TRUTHS)[:6]  #: those of which a law of the library, by the same name, holds: the first six


def draw_truth(name: str, rng: np.random.Generator) -> Truth:
    """A structure of a kind, its C scaled to 1 at A = 1."""
    parts = TRUTHS[name](rng)
    force = sum(parts.values(), start=np.zeros(len(_TABLE), dtype=complex))
    at_one = np.interp(0.0, _TABLE, np.log(np.maximum(force.imag, 1e-300)))
    # what moves the resonance has draws of its own: shares of the parts do not depend on it
    log_omega, mass = _draw_resonance(force.real / _A[:, 0] * np.exp(-at_one), rng.spawn(1)[0])
    C = sum(part.imag * np.exp(power * (log_omega - np.log(OMEGA))) for power, part in parts.items())
    log_C = np.log(np.maximum(C, 1e-300)) - at_one
    return Truth(name, log_C, log_omega, mass, Law.named(name) if name in IN_LIBRARY else None)


def _draw_resonance(stiffness: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, float]:
    """ln omega at the table, and the mass, of a structure whose joints have a ``stiffness`` S/A."""
    ratio = log_uniform(rng, *RATIOS_OF_DAMPING)
    if stiffness[0] > 0.0:
        ratio = min(ratio, 0.5 * MOST_IN_JOINTS / stiffness[0])
    spring = (rng.random() < WITH_SPRING) * rng.choice([-1.0, 1.0]) * log_uniform(rng, *SPRINGS)
    of_spring = MOST_BENT * np.tanh(2.0 * spring * (_A[:, 0] ** 2 - 1.0) / MOST_BENT)
    bent = 2.0 * ratio * (stiffness - np.interp(0.0, _TABLE, stiffness)) + of_spring
    return np.log(OMEGA) + 0.5 * np.log(np.maximum(1.0 + bent, 0.1)), float(0.5 / (ratio * OMEGA**2))


def peaks(force: FloatArray, amplitude: FloatArray) -> Observations:
    """One row per level, at phase resonance; both arguments (levels,)."""
    n = len(force)
    zero = np.zeros(n)
    omega = np.full(n, OMEGA)
    return Observations(
        A=amplitude,
        omega=omega,
        D=force,
        R=zero,
        sweep=np.arange(n),
        sd_amplitude=zero,
        sd_force=zero,
        sd_phase=zero,
        sweeps=tuple(f"level {i + 1}" for i in range(n)),
        tested_force=force,
        tested_amplitude=amplitude,
        tested_omega=omega,
    )


#: Rows of a simulated sweep, between the half-power points.
_PHASES = np.linspace(0.25 * np.pi, 0.75 * np.pi, 9)


def sweeps(
    amplitude: Callable[[FloatArray], FloatArray], force: FloatArray, level: float, row: float, rng: np.random.Generator
) -> Observations:
    """Sweeps of nine rows of a structure whose resonant ``amplitude`` at each force is known.

    ``level`` and ``row`` are the standard deviations of ln A from level to level and from row to row, ``row`` also that
    of the phases, rad.
    """
    n, rows = len(force), len(_PHASES)
    phase, sweep = np.tile(_PHASES, n), np.repeat(np.arange(n), rows)
    levels, scatter = level * rng.standard_normal(n), row * rng.standard_normal(n * rows)
    exact = amplitude(force[sweep] * np.sin(phase))
    read = phase + row * rng.standard_normal(n * rows)
    tested = peaks(force, amplitude(force) * np.exp(levels))
    return replace(
        peaks(force[sweep], exact * np.exp(levels[sweep] + scatter)),
        D=force[sweep] * np.sin(read),
        R=np.abs(force[sweep] * np.cos(read)),
        sweep=sweep,
        sweeps=tested.sweeps,
        tested_force=tested.tested_force,
        tested_amplitude=tested.tested_amplitude,
        tested_omega=tested.tested_omega,
    )
