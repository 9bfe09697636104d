"""Noise of the measurement and the columns that admit it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipelines.generator.bench import Generator, log_uniform
from pipelines.generator.laws import Array
from pipelines.generator.structure import Rows


@dataclass(frozen=True)
class Noise:
    """True standard deviations a row (``share``: of the amplitude); what the record shows of them; share of wild points."""

    share: Array
    amplitude: Array
    phase: Array
    shown: bool
    has_phase: bool
    wild: float


def draw_noise(rng: Generator, field: bool, A: Array, needs_phase: bool) -> Noise:
    """Clean: one share of the amplitude and one phase sd, both given. Field: uneven from row to row, wild, partly hidden."""
    relative, lag = log_uniform(rng, 0.007, 0.035), log_uniform(rng, 0.007, 0.03)
    share, phase = np.full(A.size, relative), np.full(A.size, lag)
    if field:
        share = share * np.exp(rng.normal(0.0, 0.35, A.size))
        phase = phase * np.exp(rng.normal(0.0, 0.35, A.size))
    shown = not field or rng.random() < 0.5
    has_phase = needs_phase or not field or rng.random() < 0.75
    wild = rng.uniform(0.01, 0.04) if field and rng.random() < 0.7 else 0.0
    return Noise(share, share * A, phase, bool(shown), bool(has_phase), float(wild))


def measured(rng: Generator, noise: Noise, A: Array, phi: Array) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Amplitude and phase as measured, and which rows are wild (off by 5 to 15 standard deviations in one of them)."""
    a, p = rng.normal(size=A.size), rng.normal(size=A.size)
    wild = rng.random(A.size) < noise.wild
    jump = rng.choice([-1.0, 1.0], A.size) * rng.uniform(5.0, 15.0, A.size)
    in_phase = (rng.random(A.size) < 0.5) & noise.has_phase
    a = np.where(wild & ~in_phase, a + jump, a)
    p = np.where(wild & in_phase, p + jump, p)
    amplitude = np.maximum(A + noise.amplitude * a, 0.05 * A)
    return amplitude, phi + noise.phase * p, wild


def columns(rows: Rows, noise: Noise, amplitude: Array, phase: Array) -> dict[str, list[str]]:
    """The record's columns as text; standard deviations are those of the rig for the amplitude it read."""
    table = {
        "sweep": [chr(ord("A") + int(number)) for number in rows.sweep],
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
