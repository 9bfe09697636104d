"""The plan of a test: force levels, frequencies, direction; in the field uneven, with repeats and wandering forces.

A test is drawn from the structure, its simulation and tolerances, and the plan of the test. Then follow the noise of
the measurement, the columns of the record, and the texts of the two files of a case.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from damping_validation.generator.balance import TrueRows, change_columns, chosen_rows, plain_rows, recorded
from damping_validation.generator.laws import Array, Complex, Structure, TrueLaw

Generator: TypeAlias = np.random.Generator

_LEVELS = (1, 2, 3, 4, 5, 6)
#: Probability of each number of levels in ``_LEVELS``, in the laboratory.
_CLEAN = (0.0, 0.0, 0.4, 0.3, 0.2, 0.1)
_FIELD = (0.04, 0.12, 0.28, 0.26, 0.2, 0.1)  #: the same in the field


def log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def draw_rows(rng: Generator, field: bool, top: float, omega: float, xi: float, at_least: int) -> TrueRows:
    """Rows at up to six levels, ``top`` the highest, over 5 to 9 half-power half-widths on either side of omega."""
    forces = _forces(rng, field, top, at_least)
    points = int(np.clip(np.clip(rng.normal(130, 35), 50, 220) / forces.size, 14, 44))
    half, centre = xi * rng.uniform(5.0, 9.0), xi * rng.uniform(-1.0, 1.0)
    dense, up = rng.uniform(0.5, 2.5), bool(rng.random() < 0.7)
    repeats, wander = field and rng.random() < 0.3, 0.03 * (field and rng.random() < 0.3)
    sweeps, frequencies, loads = [], [], []
    for number, force in enumerate(forces):
        uneven = rng.uniform(-0.35, 0.35, points) * 2 / points if field else 0.0
        offset = np.sinh(dense * (np.linspace(-1, 1, points) + uneven)) / np.sinh(dense) * half + centre
        if repeats:
            offset = np.append(offset, rng.choice(offset, size=max(2, points // 8)))
        offset = np.sort(offset) if up else np.sort(offset)[::-1]
        sweeps.append(np.full(offset.size, number))
        frequencies.append(omega * (1 + offset))
        loads.append(force * (1 + wander * rng.uniform(-1, 1, offset.size)))
    return plain_rows(np.concatenate(sweeps), np.concatenate(loads), np.concatenate(frequencies), up)


def _forces(rng: Generator, field: bool, top: float, at_least: int) -> Array:
    """Levels in about equal ratios, rising but for some tests in the field."""
    count = max(int(rng.choice(_LEVELS, p=_FIELD if field else _CLEAN)), at_least)
    ratio = log_uniform(rng, 2.0, 8.0)
    place = np.linspace(-1, 0, count) if count > 1 else np.zeros(1)
    place[1:-1] += rng.uniform(-0.2, 0.2, max(count - 2, 0)) / count
    forces: Array = top * ratio**place
    return rng.permutation(forces) if field and rng.random() < 0.2 else forces


#: Damping forces that a simulation may hold beside viscous damping (a force's name is that of its law).
BASE_LAWS = ("coulomb", "displacement", "displacement-velocity", "quadratic-displacement", "velocity-squared")

#: Further channels and facts of a record, and how often it has them: third harmonic, motion across the measured axis,
#: a second state with added mass, the rate of the sweep, the time of each row.
FURTHER = {"third": 0.2, "across": 0.15, "added": 0.15, "rate": 0.15, "time": 0.4}
#: Mass added for the second state, of the modal mass.
ADDED = 0.2

Deviation = tuple[float, float, float]


@dataclass(frozen=True)
class Bench:
    """Simulation (nominal), tolerances, true deviations in units of tolerance, rows of the test, scatter of its sweeps.

    Tolerances and deviations are those of frequency, mass and viscous coefficient. ``base`` is the simulated damping
    beside viscous, force name and coefficient. ``scatter`` is the standard uncertainty of gain and frequency from sweep
    to sweep, 0 without. ``A`` is the resonant amplitude at the highest force if all damping were viscous, ``xi`` the
    nominal damping ratio. ``columns`` are what the record holds beside force, frequency, amplitude and phase, of
    ``FURTHER``.
    """

    nominal: Structure
    tolerance: Deviation
    deviation: Deviation
    base: tuple[tuple[str, float], ...]
    rows: TrueRows
    scatter: tuple[float, float]
    scatter_declared: bool
    A: float
    xi: float
    columns: tuple[str, ...] = ()

    def truth(self) -> Structure:
        """The structure with its true deviations from the simulation."""
        f, m, c = (1 + t * d for t, d in zip(self.tolerance, self.deviation, strict=True))
        nominal = self.nominal
        return replace(nominal, omega=nominal.omega * f, mass=nominal.mass * m, viscous=nominal.viscous * c)


def draw_bench(rng: Generator, field: bool, scatter: bool | None = None, levels: int = 1) -> Bench:
    """Draw structure, simulation and test of ``levels`` levels or more; ``scatter`` or not, by chance when None."""
    hertz, mass = log_uniform(rng, 1.0, 15.0), log_uniform(rng, 4.0, 150.0)
    xi, A = log_uniform(rng, 0.002, 0.015), log_uniform(rng, 0.003, 0.6)
    omega = 2 * np.pi * hertz
    viscous = 2 * xi * mass * omega
    tolerance = (xi * rng.uniform(0.04, 0.2), float(rng.choice([0.01, 0.02])), float(rng.choice([0.03, 0.05, 0.08])))
    f, m, c = np.clip(rng.normal(size=3), -2.5, 2.5).tolist()
    rows = draw_rows(rng, field, viscous * omega * A, omega, xi, levels)
    if scatter is None:
        scatter = bool(rng.random() < (0.6 if field else 0.2))
    spread = (log_uniform(rng, 0.006, 0.016), min(xi * rng.uniform(0.03, 0.12), 1e-3)) if scatter else (0.0, 0.0)
    declared = scatter and bool(rng.random() < 0.75)
    base = _base_laws(rng, viscous, omega, A, float(np.min(rows.force)))
    columns = tuple(name for name, chance in FURTHER.items() if rng.random() < chance)
    if "added" in columns:
        loaded = _load(rows, ADDED * mass, mass)
        rows = change_columns(rows, lambda name, column: np.concatenate([column, getattr(loaded, name)]))
    laws = tuple(TrueLaw(name, coefficient) for name, coefficient in base)
    nominal = Structure(mass, omega, viscous, laws)
    rows = scatter_rows(rng, rows, spread)
    return Bench(nominal, tolerance, (f, m, c), base, rows, spread, declared, A, xi, columns)


def _load(rows: TrueRows, added: float, mass: float) -> TrueRows:
    """The sweep of the highest force once more, after all others, with mass added and its frequencies as much lower."""
    top = chosen_rows(rows, rows.sweep == rows.sweep[np.argmax(rows.force)])
    omega = top.omega / np.sqrt(1 + added / mass)
    heavier = plain_rows(np.full(omega.size, rows.sweep.max() + 1), top.force, omega, rows.up)
    return replace(heavier, added=np.full(omega.size, added), time=rows.time[-1] + heavier.time)


def move_frequency(bench: Bench, share: float) -> Bench:
    """The bench with a frequency that moves, at ``share`` of the half-power half-width squared, and says so."""
    rows = bench.rows
    rate = (1.0 if rows.up else -1.0) * share * (bench.xi * bench.nominal.omega) ** 2
    steps = np.abs(np.diff(rows.omega, prepend=rows.omega[:1])) / abs(rate)
    moving = replace(rows, rate=np.full(rows.omega.size, rate), time=np.cumsum(steps))
    added = tuple(name for name in bench.columns if name == "added")  # or its sweep would be a resonance that jumps
    return replace(bench, rows=moving, columns=(*added, "rate", "time"))


def _base_laws(rng: Generator, viscous: float, omega: float, A: float, force: float) -> tuple[tuple[str, float], ...]:
    """Mostly none, else one force whose loss at A is a share of the viscous one (friction: a share of the force)."""
    name, share, some = str(rng.choice(BASE_LAWS)), rng.uniform(0.2, 0.8), rng.random() < 0.25
    if not some:
        return ()
    unit = force / 4 if name == "coulomb" else force_unit(name, viscous, omega, A)
    return ((name, float(share * unit)),)


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


def scatter_rows(rng: Generator, rows: TrueRows, spread: tuple[float, float]) -> TrueRows:
    """Gain and natural frequency of each sweep drawn about their means."""
    count = int(rows.sweep.max()) + 1
    gain, tune = (1 + sd * rng.normal(size=count) for sd in spread)
    return replace(rows, gain=rows.gain * gain[rows.sweep], tuning=rows.tuning * tune[rows.sweep])


_UNEVEN = 0.35  # standard deviation of the logarithm of a row's standard deviation, in the field
_WILD = (5.0, 15.0)  # standard deviations


@dataclass(frozen=True)
class Noise:
    """True standard deviations of each row, ``share`` of the amplitude, ``phase`` in rad; what the record shows.

    ``wild`` is the chance that a row is a wild point.
    """

    share: Array
    phase: Array
    shown: bool
    has_phase: bool
    wild: float


def draw_noise(rng: Generator, field: bool, rows: int, needs_phase: bool) -> Noise:
    """Clean: one share and one phase deviation, both given. Field: uneven over rows, wild points, columns missing."""
    share, phase = (np.full(rows, log_uniform(rng, 0.007, most)) for most in (0.035, 0.03))
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
    template = Path(__file__).with_name("model.txt").read_text("utf-8")
    if not bench.scatter_declared:
        template = re.sub(r"\[repeatability\].*?\n\n", "", template, flags=re.DOTALL)
    lines = [f"{force} = {coefficient:.6g}\n" for force, coefficient in bench.base]
    return template.format(name=name, bench=bench, hertz=bench.nominal.omega / (2 * np.pi)) + "".join(lines)
