"""Noise of the measurement, and the columns of the record.

Texts of the two files of a case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from damping_validation.generator.laws import Array
from damping_validation.generator.plan import Bench, Generator, log_uniform
from damping_validation.generator.structure import Complex, TrueRows, recorded

_UNEVEN = 0.35  # standard deviation of the logarithm of a row's standard deviation, in the field
_WILD = (5.0, 15.0)  # standard deviations


@dataclass(frozen=True)
class Noise:
    """True standard deviations a row: ``share`` of the amplitude, ``phase`` in rad. What the record shows of them.

    ``wild`` is the chance that a row is a wild point.
    """

    share: Array
    phase: Array
    shown: bool
    has_phase: bool
    wild: float


def draw_noise(rng: Generator, field: bool, rows: int, needs_phase: bool) -> Noise:
    """Clean: one share and one phase deviation, both given. Field: uneven over rows, wild points, columns missing."""
    share = np.full(rows, log_uniform(rng, 0.007, 0.035))
    phase = np.full(rows, log_uniform(rng, 0.007, 0.03))
    if not field:
        return Noise(share, phase, True, True, 0.0)
    share, phase = (sd * np.exp(rng.normal(0.0, _UNEVEN, rows)) for sd in (share, phase))
    shown, has_phase = bool(rng.random() < 0.5), needs_phase or bool(rng.random() < 0.75)
    return Noise(share, phase, shown, has_phase, rng.uniform(0.01, 0.04) if rng.random() < 0.7 else 0.0)


def measured(rng: Generator, noise: Noise, A: Array, phi: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Amplitude and phase as measured, and which rows are wild in one of them."""
    a, p = rng.normal(size=A.size), rng.normal(size=A.size)
    wild = rng.random(A.size) < noise.wild
    jump = rng.choice([-1.0, 1.0], A.size) * rng.uniform(*_WILD, A.size)
    in_phase = (rng.random(A.size) < 0.5) & noise.has_phase
    a = np.where(wild & ~in_phase, a + jump, a)
    p = np.where(wild & in_phase, p + jump, p)
    return A * np.maximum(1 + noise.share * a, 0.05), phi + noise.phase * p, wild


def columns(rows: TrueRows, noise: Noise, amplitude: Array, phase: Array) -> dict[str, list[str]]:
    """The record's columns as text; a standard deviation is the rig's share of the amplitude it read."""
    table = {
        "sweep": [chr(ord("A") + number) for number in rows.sweep.tolist()],
        "force": [f"{force:.6g}" for force in rows.force],
        "frequency": [f"{omega / (2 * np.pi):.9g}" for omega in rows.omega],
        "amplitude": [f"{a:.6g}" for a in amplitude],
    }
    if noise.has_phase:
        table["phase"] = [f"{p:.5f}" for p in phase]
    if noise.shown:
        table["amplitude_sd"] = [f"{sd:.3g}" for sd in noise.share * amplitude]
    if noise.shown and noise.has_phase:
        table["phase_sd"] = [f"{sd:.3g}" for sd in noise.phase]
    return table


#: Noise of the third harmonic and of the motion across the axis, of the largest amplitude read.
THIRD_FLOOR = 3e-4
ACROSS_FLOOR = 3e-3


def further_columns(
    rng: Generator, columns: tuple[str, ...], rows: TrueRows, third: Complex, across: Complex, largest: float
) -> dict[str, list[str]]:
    """Texts of the further ``columns`` of a bench, of phasors without noise; ``largest`` amplitude of the test."""
    table: dict[str, list[str]] = {}
    plain = replace(rows, leak=0.0 * rows.leak, quantum=0.0)
    for channel, axis, phasor, floor, order in (
        ("third", "3", third, THIRD_FLOOR, 3),
        ("across", "y", across, ACROSS_FLOOR, 1),
    ):
        if channel in columns:
            noise = floor * largest * (rng.normal(size=phasor.size) + 1j * rng.normal(size=phasor.size)) / np.sqrt(2)
            amplitude, phase = recorded(phasor + noise, plain, order)
            table[f"amplitude_{axis}"] = [f"{a:.4g}" for a in amplitude]
            table[f"phase_{axis}"] = [f"{p:.4f}" for p in phase]
    if "added" in columns:
        table["added_mass"] = [f"{mass:.6g}" for mass in rows.added]
    if "rate" in columns:
        table["sweep_rate"] = [f"{rate / (2 * np.pi):.6g}" for rate in rows.rate]
    if "time" in columns:
        table["time"] = [f"{time:.7g}" for time in rows.time]
    return table


def describe_data_text(columns: Mapping[str, list[str]]) -> str:
    """CSV of columns of text."""
    lines = [",".join(columns), *(",".join(row) for row in zip(*columns.values(), strict=True))]
    return "\n".join(lines) + "\n"


def describe_model_text(name: str, bench: Bench) -> str:
    """The simulation as given, its tolerances, and the scatter from sweep to sweep where it is declared."""
    nominal, (frequency, mass, viscous) = bench.nominal, bench.tolerance
    lines = [
        "[mode]",
        f'name = "{name}"',
        f"frequency = {nominal.omega / (2 * np.pi):.9g}   # Hz, undamped natural frequency",
        f"mass = {nominal.mass:.6g}",
        "",
        "[mode.tolerance]   # relative standard uncertainty of what the simulation assumes",
        f"frequency = {frequency:.3g}",
        f"mass = {mass:.3g}",
        f"viscous = {viscous:.3g}",
    ]
    if bench.scatter_declared:
        lines += [
            "",
            "[repeatability]   # relative, from sweep to sweep",
            f"amplitude = {bench.scatter[0]:.3g}",
            f"frequency = {bench.scatter[1]:.3g}",
        ]
    lines += ["", "[damping]", f"viscous = {nominal.viscous:.6g}"]
    lines += [f"{force} = {coefficient:.6g}" for force, coefficient in bench.base]
    return "\n".join(lines) + "\n"
