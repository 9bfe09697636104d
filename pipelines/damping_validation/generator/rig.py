"""Effects of the rig, and effects that no library of the diagnosis names: ``FOREIGN_RIG`` and ``FOREIGN_STRUCTURE``.

Kinds are named as in ``effects``. ``drift`` is of the structure, which changes while it is tested.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damping_validation.generator.effects import (
    AppliedEffect,
    Changes,
    Kind,
    Shape,
    build_mode,
    draw_either_sign,
    draw_no_shape,
    draw_sign,
    limit_friction,
)
from damping_validation.generator.laws import Partner, TrueLaw
from damping_validation.generator.plan import Bench, Generator, log_uniform


def _draw_dropout_shape(rng: Generator, bench: Bench) -> Shape:
    """Relative half-width of the dip, its form (0 Lorentz, 1 Gauss), and its centre off resonance."""
    return (rng.uniform(0.8, 3.0) * bench.xi, float(rng.choice([0.0, 1.0])), rng.uniform(-0.2, 0.2) * bench.xi)


def _draw_notch_shape(rng: Generator, bench: Bench) -> Shape:
    """A narrow Gaussian dip anywhere near resonance."""
    return (rng.uniform(0.3, 0.8) * bench.xi, 1.0, rng.uniform(-3.0, 3.0) * bench.xi)


def _drop_force(e: AppliedEffect) -> Changes:
    """The true force is (1 - size dip) of the recorded one about resonance."""
    x = (e.rows.omega / e.structure.omega - 1 - e.shape[2]) / e.shape[0]
    dip = np.exp(-(x**2) / 2) if e.shape[1] else 1 / (1 + x**2)
    return {"drive": e.rows.drive * (1 - e.size * dip)}


def _draw_level_shape(rng: Generator, bench: Bench) -> Shape:
    """The sweep that is off, by which sign, and whether its readings (0) or its force (1) are."""
    return (float(rng.integers(int(bench.rows.sweep.max()) + 1)), draw_sign(rng), float(rng.integers(2)))


def _offset_level(e: AppliedEffect) -> Changes:
    """Readings or force of one level are off by exp(+-size)."""
    factor = np.where(e.rows.sweep == e.shape[0], np.exp(e.shape[1] * e.size), 1.0)
    part = "drive" if e.shape[2] else "gain"
    return {part: getattr(e.rows, part) * factor}


def _draw_seed_shape(rng: Generator, bench: Bench) -> Shape:
    return (float(rng.integers(1 << 30)),)


def _drift_by_level(e: AppliedEffect) -> Changes:
    """The natural frequency differs from level to level, with a standard deviation of size times xi."""
    level = np.random.default_rng(int(e.shape[0])).normal(size=64)[e.rows.sweep % 64]
    return {"tuning": e.rows.tuning * (1 + e.size * e.bench.xi * level)}


def _move_frequency(e: AppliedEffect) -> Changes:
    """The frequency moves at size times the square of the half-power half-width (rad/s), in the order of the rows."""
    rate = (1.0 if e.rows.up else -1.0) * e.size * (e.bench.xi * e.bench.nominal.omega) ** 2
    return {"rate": e.rows.rate + rate}


RIG_KINDS = {
    "amplitude-scale": Kind(draw_either_sign, 0.8, rows=lambda e: {"gain": e.rows.gain * (1 + e.shape[0] * e.size)}),
    "phase-lag": Kind(draw_either_sign, 1.0, rows=lambda e: {"lag": e.rows.lag + e.shape[0] * e.size}),
    "force-dropout": Kind(_draw_dropout_shape, 0.7, rows=_drop_force, free=(0,)),
    # the amplifier gives way in proportion to the motion: 1 - size |H|/max |H|
    "force-dropout:receptance": Kind(
        draw_no_shape, 0.7, rows=lambda e: {"drive": e.rows.drive * (1 - e.size * np.abs(e.admittance))}
    ),
    "force-dropout:notch": Kind(_draw_notch_shape, 0.7, rows=_drop_force),
    # the coil's own voltage takes from that of the amplifier: |1/(1 + size Y/max Y)| of the force that is recorded
    "force-dropout:back-emf": Kind(
        draw_no_shape, 2.0, rows=lambda e: {"drive": e.rows.drive * (1 / np.abs(1 + e.size * e.admittance))}
    ),
    "level-offset": Kind(_draw_level_shape, 0.6, rows=_offset_level),
    # the sensor clips at A/(1 + size), or shows knee tanh(q/knee), knee = A/size
    "sensor-saturation": Kind(draw_no_shape, 9.0, rows=lambda e: {"clip": e.bench.A / (1 + e.size)}),
    "sensor-saturation:compression": Kind(draw_no_shape, 3.0, rows=lambda e: {"knee": e.bench.A / e.size}),
    # a constant phasor of size A, of any phase, is added to the reading
    "background": Kind(
        lambda rng, bench: (rng.uniform(0.0, 2 * np.pi),),
        0.5,
        rows=lambda e: {"leak": e.rows.leak + e.size * e.bench.A * np.exp(1j * e.shape[0])},
    ),
    # size is the lag at resonance, rad
    "time-delay": Kind(
        draw_either_sign, 1.0, rows=lambda e: {"delay": e.rows.delay + e.shape[0] * e.size / e.bench.nominal.omega}
    ),
    "sweep-rate": Kind(draw_no_shape, 1.5, rows=_move_frequency),
}


def _draw_cycle_shape(rng: Generator, bench: Bench) -> Shape:
    """Cycles in the course of the test, and their phase."""
    return (rng.uniform(1.5, 4.0), rng.uniform(0.0, 2 * np.pi))


def _drift_cyclically(e: AppliedEffect) -> Changes:
    """The natural frequency goes up and down by size times xi, as with day and night."""
    wave = np.sin(2 * np.pi * e.shape[0] * e.course + e.shape[1])
    return {"tuning": e.rows.tuning * (1 + e.size * e.bench.xi * wave)}


def _draw_share(low: float, high: float) -> Callable[[Generator, Bench], Shape]:
    """A shape of one number, uniform: a place over A, or over the speed at A."""
    return lambda rng, bench: (rng.uniform(low, high),)


DRIFT_KINDS = {
    # the natural frequency moves by size times xi in the course of the test, as with temperature
    "drift": Kind(
        draw_either_sign,
        8.0,
        rows=lambda e: {"tuning": e.rows.tuning * (1 + e.shape[0] * e.size * e.bench.xi * e.course)},
    ),
    "drift:levels": Kind(_draw_seed_shape, 3.0, rows=_drift_by_level),
    "drift:cyclic": Kind(_draw_cycle_shape, 3.0, rows=_drift_cyclically),
    # a bolt gives way at a moment of the test: the natural frequency falls by size times xi
    "drift:loosened": Kind(
        _draw_share(-0.3, 0.3),
        4.0,
        rows=lambda e: {"tuning": e.rows.tuning * (1 - e.size * e.bench.xi * (e.course > e.shape[0]))},
    ),
    # the viscous coefficient goes with the course of the test, by up to half of size on either side
    "drift:damping": Kind(
        draw_either_sign, 1.5, rows=lambda e: {"loss": e.rows.loss * (1 + e.shape[0] * e.size * e.course)}
    ),
}


def _draw_line_shape(rng: Generator, bench: Bench) -> Shape:
    """Place and width of the line, relative to resonance, and the seed of its phases."""
    return (rng.uniform(-4.0, 4.0) * bench.xi, rng.uniform(0.4, 1.5) * bench.xi, float(rng.integers(1 << 30)))


def _add_line(e: AppliedEffect) -> Changes:
    """A foreign sine leaks into rows near it as through a rectangular window, with one phase in each sweep."""
    phase = np.random.default_rng(int(e.shape[2])).uniform(0, 2 * np.pi, 64)[e.rows.sweep % 64]
    near = np.sinc((e.rows.omega / e.bench.nominal.omega - 1 - e.shape[0]) / e.shape[1])
    return {"leak": e.rows.leak + e.size * e.bench.A * near * np.exp(1j * phase)}


def _draw_mount_shape(rng: Generator, bench: Bench) -> Shape:
    """Where the sensor's mount resonates, relative to resonance, and its damping ratio over xi."""
    return (draw_sign(rng) * rng.uniform(1.5, 6.0) * bench.xi, rng.uniform(0.5, 2.0))


def _mount_softly(e: AppliedEffect) -> Changes:
    """The sensor sits on a small resonator: the reading is 1 + size Y/max Y of the motion."""
    r, loss = e.rows.omega / (e.bench.nominal.omega * (1 + e.shape[0])), 2j * e.shape[1] * e.bench.xi
    factor = 1 + e.size * loss / (1 - r**2 + loss * r)
    return {"gain": e.rows.gain * np.abs(factor), "lag": e.rows.lag - np.angle(factor)}


def _misread_force(e: AppliedEffect) -> Changes:
    """The force is read too small where it is large: the true one is 1 + size (F/F_max)^2 of it."""
    return {"drive": e.rows.drive * (1 + e.size * (e.rows.force / np.max(e.bench.rows.force)) ** 2)}


FOREIGN_RIG = {
    "interference": Kind(_draw_line_shape, 1.0, rows=_add_line),
    "quantised": Kind(draw_no_shape, 0.3, rows=lambda e: {"quantum": e.size * e.bench.A}),
    "sensor-mount": Kind(_draw_mount_shape, 1.0, rows=_mount_softly),
    # the reading lags by size rad at A, less where it is smaller
    "slew": Kind(draw_no_shape, 1.0, rows=lambda e: {"slew": e.size / e.bench.A}),
    "force-cell": Kind(draw_no_shape, 1.0, rows=_misread_force),
    "gain-drift": Kind(
        draw_either_sign, 1.0, rows=lambda e: {"gain": e.rows.gain * (1 + e.shape[0] * e.size * e.course)}
    ),
    "phase-drift": Kind(draw_either_sign, 1.0, rows=lambda e: {"lag": e.rows.lag + e.shape[0] * e.size * e.course}),
}


def _elastic(law: str, low: float, high: float) -> Kind:
    """A spring that acts beyond a place; size 1 has the stiffness 2 xi k."""
    return Kind(
        _draw_share(low, high), 20.0, lambda e: e.add(TrueLaw(law, e.size * e.stiffness, e.shape[0] * e.bench.A))
    )


def _quasi_friction(
    law: str, low: float, high: float, speed: bool, most: float | Callable[[Bench], float] = limit_friction
) -> Kind:
    """A force like friction with a place over A, or a ``speed`` over that at A; size 1 is friction that loses as c."""

    def change(e: AppliedEffect) -> Changes:
        place = e.shape[0] * e.bench.A * (e.bench.nominal.omega if speed else 1)
        return e.add(TrueLaw(law, e.size * e.force_unit("coulomb"), place))

    return Kind(_draw_share(low, high), most, change)


def _lossy(law: str, unit: Callable[[float, float], float], parameter: Callable[[float, float], float]) -> Kind:
    """A damping force; ``unit`` is what loses at A as c = 1, ``parameter`` its place at shape 1, both of (A, omega)."""

    def change(e: AppliedEffect) -> Changes:
        A, omega = e.bench.A, e.bench.nominal.omega
        return e.add(TrueLaw(law, e.size * e.bench.nominal.viscous * unit(A, omega), e.shape[0] * parameter(A, omega)))

    return Kind(_draw_share(1.0, 2.0), 5.0, change)


def _partner(kind: str, place: tuple[float, float], zeta: tuple[float, float], cubic: float = 0.0) -> Kind:
    """A coupled coordinate: ranges of frequency off resonance over xi, and of damping ratio over xi.

    Size 1 couples as strongly as the partner's own resonance and damping let it matter: a mass ratio of 4 xi^2, a
    coupling of xi. ``cubic`` bends its spring at the amplitude that it would reach.
    """

    def shape(rng: Generator, bench: Bench) -> Shape:
        return (draw_sign(rng) * rng.uniform(*place) * bench.xi, log_uniform(rng, *zeta) * bench.xi)

    def change(e: AppliedEffect) -> Changes:
        strength = e.size * (4 * e.bench.xi**2 if kind == "absorber" else e.bench.xi)
        reached = e.bench.A / (2 * e.shape[1])
        omega, bent = e.bench.nominal.omega * (1 + e.shape[0]), cubic * e.shape[1] / reached**2
        return e.add(Partner(kind, omega, e.shape[1], strength, bent))

    return Kind(shape, 10.0, change)


def _draw_fluid_shape(rng: Generator, bench: Bench) -> Shape:
    """Frequency of the lag over the natural one, and its damping ratio."""
    return (log_uniform(rng, 0.5, 3.0), rng.uniform(1.0, 3.0))


def _add_fluid(e: AppliedEffect) -> Changes:
    """Size 1 carries 2 xi k where the fluid does not follow."""
    strength = e.size * 2 * e.bench.xi / e.shape[0] ** 2
    return e.add(Partner("memory", e.bench.nominal.omega * e.shape[0], e.shape[1], strength))


def _heat_spring(e: AppliedEffect) -> Changes:
    """Size 1 moves the resonance at A by xi: the mean of q^2 is A^2/2."""
    strength = e.shape[0] * e.size * 4 * e.bench.xi * (e.bench.nominal.omega / e.bench.A) ** 2
    return e.add(Partner("heated-spring", 0.03 * e.bench.nominal.omega, 1.0, strength))


def _draw_neighbours_shape(rng: Generator, bench: Bench) -> Shape:
    """Two modes on either side: places and signs."""
    return (-bench.xi * rng.uniform(1.5, 5.0), draw_sign(rng), bench.xi * rng.uniform(1.5, 5.0), draw_sign(rng))


FOREIGN_STRUCTURE = {
    "clearance": _elastic("clearance", 0.15, 0.6),
    "stop": _elastic("stop", 0.3, 0.8),
    "slap": _elastic("slap", 0.1, 0.6),
    "rub": _quasi_friction("rub", 0.2, 0.7, speed=False, most=3.0),
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
    "fluid-memory": Kind(_draw_fluid_shape, 5.0, _add_fluid),
    "heated-spring": Kind(draw_either_sign, 4.0, _heat_spring),
    "two-neighbours": Kind(
        _draw_neighbours_shape,
        0.6,
        lambda e: e.add(build_mode(e, e.shape[0], 1.0, e.shape[1]), build_mode(e, e.shape[2], 1.0, e.shape[3])),
    ),
}
FOREIGN_KINDS = {**FOREIGN_STRUCTURE, **FOREIGN_RIG}
