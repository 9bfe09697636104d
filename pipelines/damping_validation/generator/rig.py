"""Effects of the rig, and effects outside the library of the diagnosis: ``FOREIGN_RIG`` and ``FOREIGN_STRUCTURE``.

Kinds are named as in ``effects``. ``drift`` is of the structure, which changes while it is tested.
"""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from damping_validation.generator.effects import (
    EITHER_SIGN,
    NO_SHAPE,
    AppliedEffect,
    Change,
    Changes,
    Kind,
    Shape,
    build_mode,
    chosen,
    drawn,
    limit_friction,
    of_xi,
    sign,
    signed,
    spread,
    uniform,
)
from damping_validation.generator.laws import Array, Complex, Partner, TrueLaw
from damping_validation.generator.plan import Bench, Generator

#: By which a column of the rows is multiplied, or what is added to it.
Amount: TypeAlias = Callable[[AppliedEffect], float | Array | Complex]


def _scale(column: str, by: Amount) -> Change:
    """A column of the rows times a factor."""
    return lambda e: {column: getattr(e.rows, column) * by(e)}


def _shift(column: str, by: Amount) -> Change:
    """A column of the rows and something more."""
    return lambda e: {column: getattr(e.rows, column) + by(e)}


def _draw_seed(rng: Generator, bench: Bench) -> float:
    return float(rng.integers(1 << 30))


def _drop_force(e: AppliedEffect) -> Changes:
    """The true force is (1 - size dip) of the recorded one about resonance."""
    x = (e.rows.omega / e.structure.omega - 1 - e.shape[2]) / e.shape[0]
    dip = np.exp(-(x**2) / 2) if e.shape[1] else 1 / (1 + x**2)
    return {"drive": e.rows.drive * (1 - e.size * dip)}


def _draw_level_shape(rng: Generator, bench: Bench) -> Shape:
    """The sweep that is off, by which sign, and whether its readings (0) or its force (1) are."""
    return (float(rng.integers(int(bench.rows.sweep.max()) + 1)), sign(rng, bench), float(rng.integers(2)))


def _offset_level(e: AppliedEffect) -> Changes:
    """Readings or force of one level are off by exp(+-size)."""
    factor = np.where(e.rows.sweep == e.shape[0], np.exp(e.shape[1] * e.size), 1.0)
    part = "drive" if e.shape[2] else "gain"
    return {part: getattr(e.rows, part) * factor}


RIG_KINDS = {
    "amplitude-scale": Kind(EITHER_SIGN, 0.8, rows=_scale("gain", lambda e: 1 + e.shape[0] * e.size)),
    "phase-lag": Kind(EITHER_SIGN, 1.0, rows=_shift("lag", lambda e: e.shape[0] * e.size)),
    # shape: relative half-width of the dip, its form (0 Lorentz, 1 Gauss), and its centre off resonance
    "force-dropout": Kind(
        drawn(of_xi(uniform(0.8, 3.0)), chosen(0.0, 1.0), of_xi(uniform(-0.2, 0.2))), 0.7, rows=_drop_force, free=(0,)
    ),
    # the amplifier gives way in proportion to the motion: 1 - size |H|/max |H|
    "force-dropout:receptance": Kind(NO_SHAPE, 0.7, rows=_scale("drive", lambda e: 1 - e.size * np.abs(e.admittance))),
    # a narrow Gaussian dip anywhere near resonance
    "force-dropout:notch": Kind(drawn(of_xi(uniform(0.3, 0.8)), 1.0, of_xi(uniform(-3.0, 3.0))), 0.7, rows=_drop_force),
    # the coil's own voltage takes from that of the amplifier: |1/(1 + size Y/max Y)| of the force that is recorded
    "force-dropout:back-emf": Kind(
        NO_SHAPE, 2.0, rows=_scale("drive", lambda e: 1 / np.abs(1 + e.size * e.admittance))
    ),
    "level-offset": Kind(_draw_level_shape, 0.6, rows=_offset_level),
    # the sensor clips at A/(1 + size), or shows knee tanh(q/knee), knee = A/size
    "sensor-saturation": Kind(NO_SHAPE, 9.0, rows=lambda e: {"clip": e.bench.A / (1 + e.size)}),
    "sensor-saturation:compression": Kind(NO_SHAPE, 3.0, rows=lambda e: {"knee": e.bench.A / e.size}),
    # a constant phasor of size A, of any phase, is added to the reading
    "background": Kind(
        drawn(uniform(0.0, 2 * np.pi)), 0.5, rows=_shift("leak", lambda e: e.size * e.bench.A * np.exp(1j * e.shape[0]))
    ),
    # size is the lag at resonance, rad
    "time-delay": Kind(EITHER_SIGN, 1.0, rows=_shift("delay", lambda e: e.shape[0] * e.size / e.bench.nominal.omega)),
    # the frequency moves at size times the square of the half-power half-width (rad/s), in the order of the rows
    "sweep-rate": Kind(
        NO_SHAPE,
        1.5,
        rows=_shift(
            "rate", lambda e: (1.0 if e.rows.up else -1.0) * e.size * (e.bench.xi * e.bench.nominal.omega) ** 2
        ),
    ),
}


def _drift(course: Amount) -> Change:
    """The natural frequency moves by size times xi along a course."""
    return _scale("tuning", lambda e: 1 + e.size * e.bench.xi * course(e))


DRIFT_KINDS = {
    # in the course of the test, as with temperature
    "drift": Kind(EITHER_SIGN, 8.0, rows=_scale("tuning", lambda e: 1 + e.shape[0] * e.size * e.bench.xi * e.course)),
    # from level to level, with a standard deviation of one
    "drift:levels": Kind(
        drawn(_draw_seed),
        3.0,
        rows=_drift(lambda e: np.random.default_rng(int(e.shape[0])).normal(size=64)[e.rows.sweep % 64]),
    ),
    # up and down, as with day and night; shape: cycles in the course of the test, and their phase
    "drift:cyclic": Kind(
        drawn(uniform(1.5, 4.0), uniform(0.0, 2 * np.pi)),
        3.0,
        rows=_drift(lambda e: np.sin(2 * np.pi * e.shape[0] * e.course + e.shape[1])),
    ),
    # a bolt gives way at a moment of the test: the natural frequency falls
    "drift:loosened": Kind(
        drawn(uniform(-0.3, 0.3)),
        4.0,
        rows=_scale("tuning", lambda e: 1 - e.size * e.bench.xi * (e.course > e.shape[0])),
    ),
    # the viscous coefficient goes with the course of the test, by up to half of size on either side
    "drift:damping": Kind(EITHER_SIGN, 1.5, rows=_scale("loss", lambda e: 1 + e.shape[0] * e.size * e.course)),
}


def _add_line(e: AppliedEffect) -> Changes:
    """A foreign sine leaks into rows near it as through a rectangular window, with one phase in each sweep."""
    phase = np.random.default_rng(int(e.shape[2])).uniform(0, 2 * np.pi, 64)[e.rows.sweep % 64]
    near = np.sinc((e.rows.omega / e.bench.nominal.omega - 1 - e.shape[0]) / e.shape[1])
    return {"leak": e.rows.leak + e.size * e.bench.A * near * np.exp(1j * phase)}


def _mount_softly(e: AppliedEffect) -> Changes:
    """The sensor sits on a small resonator: the reading is 1 + size Y/max Y of the motion."""
    r, loss = e.rows.omega / (e.bench.nominal.omega * (1 + e.shape[0])), 2j * e.shape[1] * e.bench.xi
    factor = 1 + e.size * loss / (1 - r**2 + loss * r)
    return {"gain": e.rows.gain * np.abs(factor), "lag": e.rows.lag - np.angle(factor)}


FOREIGN_RIG = {
    # shape: place and width of the line, relative to resonance, and the seed of its phases
    "interference": Kind(drawn(of_xi(uniform(-4.0, 4.0)), of_xi(uniform(0.4, 1.5)), _draw_seed), 1.0, rows=_add_line),
    "quantised": Kind(NO_SHAPE, 0.3, rows=lambda e: {"quantum": e.size * e.bench.A}),
    # shape: where the sensor's mount resonates, relative to resonance, and its damping ratio over xi
    "sensor-mount": Kind(drawn(signed(of_xi(uniform(1.5, 6.0))), uniform(0.5, 2.0)), 1.0, rows=_mount_softly),
    # the reading lags by size rad at A, less where it is smaller
    "slew": Kind(NO_SHAPE, 1.0, rows=lambda e: {"slew": e.size / e.bench.A}),
    # the force is read too small where it is large: the true one is 1 + size (F/F_max)^2 of it
    "force-cell": Kind(
        NO_SHAPE, 1.0, rows=_scale("drive", lambda e: 1 + e.size * (e.rows.force / np.max(e.bench.rows.force)) ** 2)
    ),
    "gain-drift": Kind(EITHER_SIGN, 1.0, rows=_scale("gain", lambda e: 1 + e.shape[0] * e.size * e.course)),
    "phase-drift": Kind(EITHER_SIGN, 1.0, rows=_shift("lag", lambda e: e.shape[0] * e.size * e.course)),
}


def _elastic(law: str, low: float, high: float) -> Kind:
    """A spring that acts beyond a place; size 1 has the stiffness 2 xi k."""
    return Kind(
        drawn(uniform(low, high)), 20.0, lambda e: e.add(TrueLaw(law, e.size * e.stiffness, e.shape[0] * e.bench.A))
    )


def _quasi_friction(
    law: str, low: float, high: float, speed: bool, most: float | Callable[[Bench], float] = limit_friction
) -> Kind:
    """A force like friction with a place over A, or a ``speed`` over that at A; size 1 is friction that loses as c."""

    def change(e: AppliedEffect) -> Changes:
        place = e.shape[0] * e.bench.A * (e.bench.nominal.omega if speed else 1)
        return e.add(TrueLaw(law, e.size * e.force_unit("coulomb"), place))

    return Kind(drawn(uniform(low, high)), most, change)


def _lossy(law: str, unit: Callable[[float, float], float], parameter: Callable[[float, float], float]) -> Kind:
    """A damping force; ``unit`` is what loses at A as c = 1, ``parameter`` its place at shape 1, both of (A, omega)."""

    def change(e: AppliedEffect) -> Changes:
        A, omega = e.bench.A, e.bench.nominal.omega
        return e.add(TrueLaw(law, e.size * e.bench.nominal.viscous * unit(A, omega), e.shape[0] * parameter(A, omega)))

    return Kind(drawn(uniform(1.0, 2.0)), 5.0, change)


def _partner(kind: str, place: tuple[float, float], zeta: tuple[float, float], cubic: float = 0.0) -> Kind:
    """A coupled coordinate: ranges of frequency off resonance over xi, and of damping ratio over xi.

    Size 1 couples as strongly as the partner's own resonance and damping let it matter: a mass ratio of 4 xi^2, a
    coupling of xi. ``cubic`` bends its spring at the amplitude that it would reach.
    """

    def change(e: AppliedEffect) -> Changes:
        strength = e.size * (4 * e.bench.xi**2 if kind == "absorber" else e.bench.xi)
        reached = e.bench.A / (2 * e.shape[1])
        omega, bent = e.bench.nominal.omega * (1 + e.shape[0]), cubic * e.shape[1] / reached**2
        return e.add(Partner(kind, omega, e.shape[1], strength, bent))

    return Kind(drawn(signed(of_xi(uniform(*place))), of_xi(spread(*zeta))), 10.0, change)


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
    return (-bench.xi * rng.uniform(1.5, 5.0), sign(rng, bench), bench.xi * rng.uniform(1.5, 5.0), sign(rng, bench))


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
    # shape: frequency of the lag over the natural one, and its damping ratio
    "fluid-memory": Kind(drawn(spread(0.5, 3.0), uniform(1.0, 3.0)), 5.0, _add_fluid),
    "heated-spring": Kind(EITHER_SIGN, 4.0, _heat_spring),
    "two-neighbours": Kind(
        _draw_neighbours_shape,
        0.6,
        lambda e: e.add(build_mode(e, e.shape[0], 1.0, e.shape[1]), build_mode(e, e.shape[2], 1.0, e.shape[3])),
    ),
}
FOREIGN_KINDS = {**FOREIGN_STRUCTURE, **FOREIGN_RIG}
