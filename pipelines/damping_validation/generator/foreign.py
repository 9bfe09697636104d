"""Effects that no library of the diagnosis names: of the structure, and (``FOREIGN_RIG``) of the rig."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from damping_validation.generator.forces import (
    Kind,
    Shape,
    Truth,
    apply_second_mode,
    draw_no_shape,
    either_sign,
    limit_friction,
    sign,
    stiffness_unit,
    with_laws,
)
from damping_validation.generator.laws import Partner, TrueLaw
from damping_validation.generator.plan import Bench, Generator, force_unit, log_uniform
from damping_validation.generator.rig import course

Most: TypeAlias = Callable[[Bench], float]


def _draw_share(low: float, high: float) -> Callable[[Generator, Bench], Shape]:
    """A shape of one number, uniform: a place over A, or over the speed at A."""
    return lambda rng, bench: (rng.uniform(low, high),)


def _elastic(law: str, low: float, high: float, most: float = 20.0) -> Kind:
    """A spring that acts beyond a place; size 1 has the stiffness 2 xi k."""

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        return with_laws(truth, TrueLaw(law, size * stiffness_unit(bench), shape[0] * bench.A))

    return Kind(_draw_share(low, high), apply, lambda bench: most)


def _quasi_friction(law: str, low: float, high: float, speed: bool, most: Most = limit_friction) -> Kind:
    """A force like friction with a place over A, or a ``speed`` over that at A; size 1 is friction that loses as c."""

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        unit = force_unit("coulomb", bench.nominal.viscous, bench.nominal.omega, bench.A)
        return with_laws(truth, TrueLaw(law, size * unit, shape[0] * bench.A * (bench.nominal.omega if speed else 1)))

    return Kind(_draw_share(low, high), apply, most)


def _lossy(law: str, unit: Callable[[float, float], float], parameter: Callable[[float, float], float]) -> Kind:
    """A damping force; ``unit`` is what loses at A as c = 1, ``parameter`` its place at shape 1, both of (A, omega)."""

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        A, omega = bench.A, bench.nominal.omega
        coefficient = size * bench.nominal.viscous * unit(A, omega)
        return with_laws(truth, TrueLaw(law, coefficient, shape[0] * parameter(A, omega)))

    return Kind(_draw_share(1.0, 2.0), apply, lambda bench: 5.0)


def _partner(kind: str, place: tuple[float, float], zeta: tuple[float, float], cubic: float = 0.0) -> Kind:
    """A coupled coordinate: ranges of frequency off resonance over xi, and of damping ratio over xi.

    Size 1 couples as strongly as the partner's own resonance and damping let it matter: a mass ratio of 4 xi^2, a
    coupling of xi. ``cubic`` bends its spring at the amplitude that it would reach.
    """

    def shape(rng: Generator, bench: Bench) -> Shape:
        return (sign(rng) * rng.uniform(*place) * bench.xi, log_uniform(rng, *zeta) * bench.xi)

    def apply(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
        structure, rows = truth
        strength = size * (4 * bench.xi**2 if kind == "absorber" else bench.xi)
        reached = bench.A / (2 * shape[1])
        partner = Partner(kind, bench.nominal.omega * (1 + shape[0]), shape[1], strength, cubic * shape[1] / reached**2)
        return replace(structure, partners=(*structure.partners, partner)), rows

    return Kind(shape, apply, lambda bench: 10.0)


def _draw_fluid_shape(rng: Generator, bench: Bench) -> Shape:
    """Frequency of the lag over the natural one, and its damping ratio."""
    return (log_uniform(rng, 0.5, 3.0), rng.uniform(1.0, 3.0))


def _apply_fluid(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Size 1 carries 2 xi k where the fluid does not follow."""
    structure, rows = truth
    partner = Partner("memory", bench.nominal.omega * shape[0], shape[1], size * 2 * bench.xi / shape[0] ** 2)
    return replace(structure, partners=(*structure.partners, partner)), rows


def _apply_heated(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Size 1 moves the resonance at A by xi: the mean of q^2 is A^2/2."""
    structure, rows = truth
    strength = shape[0] * size * 4 * bench.xi * (bench.nominal.omega / bench.A) ** 2
    partner = Partner("heated-spring", 0.03 * bench.nominal.omega, 1.0, strength)
    return replace(structure, partners=(*structure.partners, partner)), rows


def _draw_neighbours_shape(rng: Generator, bench: Bench) -> Shape:
    """Two modes on either side: places and signs."""
    return (-bench.xi * rng.uniform(1.5, 5.0), sign(rng), bench.xi * rng.uniform(1.5, 5.0), sign(rng))


def _apply_neighbours(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    one = apply_second_mode(truth, size, (shape[0], 1.0, shape[1]), bench)
    return apply_second_mode(one, size, (shape[2], 1.0, shape[3]), bench)


def _draw_cycle_shape(rng: Generator, bench: Bench) -> Shape:
    """Cycles in the course of the test, and their phase."""
    return (rng.uniform(1.5, 4.0), rng.uniform(0.0, 2 * np.pi))


def _apply_cyclic_drift(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The natural frequency goes up and down by size times xi, as with day and night."""
    structure, rows = truth
    wave = np.sin(2 * np.pi * shape[0] * course(rows, bench) + shape[1])
    return structure, replace(rows, tuning=rows.tuning * (1 + size * bench.xi * wave))


def _apply_loosened(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A bolt gives way at a moment of the test: the natural frequency falls by size times xi."""
    structure, rows = truth
    after = course(rows, bench) > shape[0]
    return structure, replace(rows, tuning=rows.tuning * (1 - size * bench.xi * after))


def _apply_warming(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The viscous coefficient goes with the course of the test, by up to half of size on either side."""
    structure, rows = truth
    return structure, replace(rows, loss=rows.loss * (1 + shape[0] * size * course(rows, bench)))


def _draw_line_shape(rng: Generator, bench: Bench) -> Shape:
    """Place and width of the line, relative to resonance, and the seed of its phases."""
    return (rng.uniform(-4.0, 4.0) * bench.xi, rng.uniform(0.4, 1.5) * bench.xi, float(rng.integers(1 << 30)))


def _apply_line(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A foreign sine leaks into rows near it as through a rectangular window, at one phase a sweep."""
    structure, rows = truth
    phase = np.random.default_rng(int(shape[2])).uniform(0, 2 * np.pi, 64)[rows.sweep % 64]
    near = np.sinc((rows.omega / bench.nominal.omega - 1 - shape[0]) / shape[1])
    return structure, replace(rows, leak=rows.leak + size * bench.A * near * np.exp(1j * phase))


def _apply_quantised(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, quantum=size * bench.A)


def _draw_mount_shape(rng: Generator, bench: Bench) -> Shape:
    """Where the sensor's mount resonates, relative to resonance, and its damping ratio over xi."""
    return (sign(rng) * rng.uniform(1.5, 6.0) * bench.xi, rng.uniform(0.5, 2.0))


def _apply_mount(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The sensor sits on a small resonator: the reading is 1 + size Y/max Y of the motion."""
    structure, rows = truth
    r, loss = rows.omega / (bench.nominal.omega * (1 + shape[0])), 2j * shape[1] * bench.xi
    factor = 1 + size * loss / (1 - r**2 + loss * r)
    return structure, replace(rows, gain=rows.gain * np.abs(factor), lag=rows.lag - np.angle(factor))


def _apply_slew(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The reading lags by size rad at A, less where it is smaller."""
    structure, rows = truth
    return structure, replace(rows, slew=size / bench.A)


def _apply_force_cell(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The force is read too small where it is large: the true one is 1 + size (F/F_max)^2 of it."""
    structure, rows = truth
    return structure, replace(rows, drive=rows.drive * (1 + size * (rows.force / np.max(bench.rows.force)) ** 2))


def _apply_gain_drift(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, gain=rows.gain * (1 + shape[0] * size * course(rows, bench)))


def _apply_phase_drift(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, lag=rows.lag + shape[0] * size * course(rows, bench))


FOREIGN_STRUCTURE = {
    "clearance": _elastic("clearance", 0.15, 0.6),
    "stop": _elastic("stop", 0.3, 0.8),
    "slap": _elastic("slap", 0.1, 0.6),
    "rub": _quasi_friction("rub", 0.2, 0.7, speed=False, most=lambda bench: 3.0),
    "stribeck": _quasi_friction("stribeck", 0.1, 0.5, speed=True),
    "dithered-friction": _quasi_friction("dithered-friction", 0.1, 0.6, speed=True),
    "velocity-cubed": _lossy("velocity-cubed", lambda A, w: 4 / (3 * (A * w) ** 2), lambda A, w: 0.0),
    "hysteretic-square": _lossy("hysteretic-square", lambda A, w: 3 * np.pi * w / (4 * A), lambda A, w: 0.0),
    "eddy-current": _lossy("eddy-current", lambda A, w: 1.0, lambda A, w: 0.4 * A * w),
    "squeeze-film": _lossy("squeeze-film", lambda A, w: 0.5, lambda A, w: 1.15 * A),
    "absorber": _partner("absorber", (0.0, 4.0), (0.4, 2.0)),
    "sloshing-tank": _partner("absorber", (0.0, 4.0), (0.5, 2.0), cubic=-0.4),
    "gyroscopic": _partner("gyroscopic", (0.0, 4.0), (0.5, 2.0)),
    "electric-circuit": _partner("circuit", (0.0, 4.0), (0.5, 3.0)),
    "fluid-memory": Kind(_draw_fluid_shape, _apply_fluid, lambda bench: 5.0),
    "heated-spring": Kind(either_sign, _apply_heated, lambda bench: 4.0),
    "two-neighbours": Kind(_draw_neighbours_shape, _apply_neighbours, lambda bench: 0.6),
    "cyclic-drift": Kind(_draw_cycle_shape, _apply_cyclic_drift, lambda bench: 3.0),
    "loosened": Kind(_draw_share(-0.3, 0.3), _apply_loosened, lambda bench: 4.0),
    "warming-damper": Kind(either_sign, _apply_warming, lambda bench: 1.5),
}
FOREIGN_RIG = {
    "interference": Kind(_draw_line_shape, _apply_line, lambda bench: 1.0),
    "quantised": Kind(draw_no_shape, _apply_quantised, lambda bench: 0.3),
    "sensor-mount": Kind(_draw_mount_shape, _apply_mount, lambda bench: 1.0),
    "slew": Kind(draw_no_shape, _apply_slew, lambda bench: 1.0),
    "force-cell": Kind(draw_no_shape, _apply_force_cell, lambda bench: 1.0),
    "gain-drift": Kind(either_sign, _apply_gain_drift, lambda bench: 1.0),
    "phase-drift": Kind(either_sign, _apply_phase_drift, lambda bench: 1.0),
}
FOREIGN_KINDS = {**FOREIGN_STRUCTURE, **FOREIGN_RIG}
