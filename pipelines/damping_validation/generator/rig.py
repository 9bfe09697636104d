"""Effects of the rig: what instruments, exciter and the course of the test do to a record.

Kinds are named as in ``forces``. ``drift`` is of the structure, which changes while it is tested.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damping_validation.generator.forces import Kind, Shape, Truth, draw_no_shape, either_sign, sign
from damping_validation.generator.laws import Array
from damping_validation.generator.plan import Bench, Generator
from damping_validation.generator.structure import TrueRows


def course(rows: TrueRows, bench: Bench) -> Array:
    """Place in the course of the test, -1/2 at its first row and 1/2 at its last; rows added later lie beyond."""
    first, last = bench.rows.time[0], bench.rows.time[-1]
    return np.asarray((rows.time - first) / (last - first) - 0.5)


def _apply_scale(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, gain=rows.gain * (1 + shape[0] * size))


def _apply_lag(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    structure, rows = truth
    return structure, replace(rows, lag=rows.lag + shape[0] * size)


def _apply_delay(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Size is the lag at resonance, rad."""
    structure, rows = truth
    return structure, replace(rows, delay=rows.delay + shape[0] * size / bench.nominal.omega)


def _draw_dropout_shape(rng: Generator, bench: Bench) -> Shape:
    """Relative half-width of the dip, its form (0 Lorentz, 1 Gauss), and its centre off resonance."""
    return (rng.uniform(0.8, 3.0) * bench.xi, float(rng.choice([0.0, 1.0])), rng.uniform(-0.2, 0.2) * bench.xi)


def _draw_notch_shape(rng: Generator, bench: Bench) -> Shape:
    """A narrow Gaussian dip anywhere near resonance."""
    return (rng.uniform(0.3, 0.8) * bench.xi, 1.0, rng.uniform(-3.0, 3.0) * bench.xi)


def _apply_dropout(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The true force is (1 - size dip) of the recorded one about resonance."""
    structure, rows = truth
    x = (rows.omega / structure.omega - 1 - shape[2]) / shape[0]
    dip = np.exp(-(x**2) / 2) if shape[1] else 1 / (1 + x**2)
    return structure, replace(rows, drive=rows.drive * (1 - size * dip))


def _admittance(structure_omega: float, rows: TrueRows, bench: Bench) -> Array:
    """Velocity a force of the viscous mode over that at resonance: 2 i xi r/(1 - r^2 + 2 i xi r), r = omega/omega_n."""
    r = rows.omega / structure_omega
    return np.asarray(2j * bench.xi * r / (1 - r**2 + 2j * bench.xi * r))


def _apply_receptance(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The amplifier gives way in proportion to the motion: 1 - size |H|/max |H|."""
    structure, rows = truth
    return structure, replace(rows, drive=rows.drive * (1 - size * np.abs(_admittance(structure.omega, rows, bench))))


def _apply_back_emf(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The coil's own voltage takes from that of the amplifier: |1/(1 + size Y/max Y)| of the force that is recorded."""
    structure, rows = truth
    left = 1 / np.abs(1 + size * _admittance(structure.omega, rows, bench))
    return structure, replace(rows, drive=rows.drive * left)


def _apply_clip(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The sensor clips at A/(1 + size)."""
    structure, rows = truth
    return structure, replace(rows, clip=bench.A / (1 + size))


def _apply_compress(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The sensor shows knee tanh(q/knee), knee = A/size."""
    structure, rows = truth
    return structure, replace(rows, knee=bench.A / size)


def _draw_phase_shape(rng: Generator, bench: Bench) -> Shape:
    return (rng.uniform(0.0, 2 * np.pi),)


def _apply_background(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """A constant phasor of size A is added to the reading."""
    structure, rows = truth
    return structure, replace(rows, leak=rows.leak + size * bench.A * np.exp(1j * shape[0]))


def _draw_level_shape(rng: Generator, bench: Bench) -> Shape:
    """The sweep that is off, by which sign, and whether its readings (0) or its force (1) are."""
    return (float(rng.integers(int(bench.rows.sweep.max()) + 1)), sign(rng), float(rng.integers(2)))


def _apply_level_offset(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """Readings or force of one level are off by exp(+-size)."""
    structure, rows = truth
    factor = np.where(rows.sweep == shape[0], np.exp(shape[1] * size), 1.0)
    part = "drive" if shape[2] else "gain"
    return structure, replace(rows, **{part: getattr(rows, part) * factor})


def _apply_drift(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The natural frequency moves by size times xi in the course of the test, as with temperature."""
    structure, rows = truth
    return structure, replace(rows, tuning=rows.tuning * (1 + shape[0] * size * bench.xi * course(rows, bench)))


def _draw_seed_shape(rng: Generator, bench: Bench) -> Shape:
    return (float(rng.integers(1 << 30)),)


def _apply_drift_levels(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The natural frequency differs from level to level, with a standard deviation of size times xi."""
    structure, rows = truth
    level = np.random.default_rng(int(shape[0])).normal(size=64)[rows.sweep % 64]
    return structure, replace(rows, tuning=rows.tuning * (1 + size * bench.xi * level))


def _apply_sweep_rate(truth: Truth, size: float, shape: Shape, bench: Bench) -> Truth:
    """The frequency moves at size times the square of the half-power half-width (rad/s), in the order of the rows."""
    structure, rows = truth
    rate = (1.0 if rows.up else -1.0) * size * (bench.xi * bench.nominal.omega) ** 2
    return structure, replace(rows, rate=rows.rate + rate)


RIG_KINDS = {
    "amplitude-scale": Kind(either_sign, _apply_scale, lambda bench: 0.8),
    "phase-lag": Kind(either_sign, _apply_lag, lambda bench: 1.0),
    "force-dropout": Kind(_draw_dropout_shape, _apply_dropout, lambda bench: 0.7, (0,)),
    "force-dropout:receptance": Kind(draw_no_shape, _apply_receptance, lambda bench: 0.7),
    "force-dropout:notch": Kind(_draw_notch_shape, _apply_dropout, lambda bench: 0.7),
    "force-dropout:back-emf": Kind(draw_no_shape, _apply_back_emf, lambda bench: 2.0),
    "level-offset": Kind(_draw_level_shape, _apply_level_offset, lambda bench: 0.6),
    "sensor-saturation": Kind(draw_no_shape, _apply_clip, lambda bench: 9.0),
    "sensor-saturation:compression": Kind(draw_no_shape, _apply_compress, lambda bench: 3.0),
    "background": Kind(_draw_phase_shape, _apply_background, lambda bench: 0.5),
    "time-delay": Kind(either_sign, _apply_delay, lambda bench: 1.0),
    "sweep-rate": Kind(draw_no_shape, _apply_sweep_rate, lambda bench: 1.5),
}
DRIFT_KINDS = {
    "drift": Kind(either_sign, _apply_drift, lambda bench: 8.0),
    "drift:levels": Kind(_draw_seed_shape, _apply_drift_levels, lambda bench: 3.0),
}
