"""Tests of one mode with 1 % damping: integrated in time for any effect, in closed form for viscous damping alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import damping_pipelines  # isort: skip  # first, since it sets one thread for the linear algebra before numpy is loaded
import numpy as np
import pandas as pd
import pytest

from damping.effects import CATALOGUE
from damping.effects.contract import Effect
from damping.gap import outside, size
from damping.gap.diagnose import Diagnosis, diagnose
from damping.records.mode import Mode, Repeatability, Tolerance
from damping.records.record import Record
from damping_validation.generator.balance import TrueRows, plain_rows
from damping_validation.generator.effects import TrueEffect
from damping_validation.generator.laws import Structure
from damping_validation.generator.plan import Bench
from damping_validation.generator.refit import RecordCells, applied
from damping_validation.generator.steady import true_record
from tests.gap.limited import KINDS

assert damping_pipelines.__doc__  # imported for its effect

#: What `no_folds` and `no_rivals` leave out: a diagnosis that tests share has it, whichever of them asks first.
WHOLE = {
    "damping.gap.size.hold_levels_out": size.hold_levels_out,
    "damping.gap.outside.weigh_outside": outside.weigh_outside,
}

OMEGA = 2 * np.pi * 3.0
MASS = 10.0
XI = 0.01
VISCOUS = 2 * XI * MASS * OMEGA
#: Resonant amplitude at the highest force with viscous damping alone.
A_TOP = 0.05
#: Noise: relative of amplitudes, and rad.
NOISE = 0.01
#: Size and shape with which the generator draws each effect: all leave a gap of 2 to 31 sigma.
EFFECTS: dict[str, tuple[float, tuple[float, ...]]] = {
    "viscous-coefficient": (5.0, (1.0,)),
    "displacement": (0.6, ()),
    "velocity-squared": (0.6, ()),
    "displacement-velocity": (0.6, ()),
    "quadratic-displacement": (0.6, ()),
    "coulomb-friction": (0.1, ()),
    "slip": (2.0, (0.3,)),
    "stiffness-hardening": (1.0, (0.0, 0.1)),
    "stiffness-softening": (1.0, (0.0, 0.1)),
    "natural-frequency": (2.0, (-1.0,)),
    "planar-coupling": (0.15, (0.02, 1.0)),
    "residual-modes": (0.1, (1.0, 0.5, 1.8, 0.05, 0.3, 0.7, 0.0)),
    "amplitude-scale": (0.1, (1.0,)),
    "phase-lag": (0.1, (-1.0,)),
    "force-dropout": (0.3, (0.02, 1.0, 0.0)),
    "absorber": (0.3, (0.01, 0.01)),  # of no name in the library
}


@dataclass
class Lab:
    """Simulation, test and measurement; what takes time is done once."""

    omega: float = OMEGA
    mass: float = MASS
    viscous: float = VISCOUS
    A: float = A_TOP
    xi: float = XI
    noise: float = NOISE
    effects: Mapping[str, tuple[float, tuple[float, ...]]] = field(default_factory=lambda: EFFECTS)
    _truths: dict[tuple[Any, ...], RecordCells] = field(default_factory=dict)
    _diagnoses: dict[str, Diagnosis] = field(default_factory=dict)

    def bench(self, levels: int = 3, points: int = 20, half: float = 6.0) -> Bench:
        """Sweeps at forces in equal ratios, 1/4 to 1, over +-``half`` half-power half-widths, dense at resonance."""
        forces = VISCOUS * OMEGA * A_TOP * 4.0 ** (np.linspace(-1.0, 0.0, levels) if levels > 1 else np.zeros(1))
        offset = np.sinh(1.5 * np.linspace(-1.0, 1.0, points)) / np.sinh(1.5) * half * XI
        sweep = np.repeat(np.arange(levels), points)
        rows = plain_rows(sweep, np.repeat(forces, points), np.tile(OMEGA * (1 + offset), levels))
        return Bench(
            Structure(MASS, OMEGA, VISCOUS), (0.001, 0.02, 0.05), (0.0,) * 3, (), rows, (0.0,) * 2, False, A_TOP, XI
        )

    def mode(self, amplitude: float | None = 0.0, frequency: float | None = 0.0, **changes: Any) -> Mode:
        """The simulation, repeatability as given."""
        mode = Mode(
            name="a mode",
            frequency=OMEGA / (2 * np.pi),
            mass=MASS,
            tolerance=Tolerance(0.001, 0.02, 0.05),
            repeatability=Repeatability(amplitude, frequency),
            damping={"viscous": {"coefficient": VISCOUS}},
        )
        return replace(mode, **changes)

    def truth(self, name: str, **plan: Any) -> RecordCells:
        """The noise-free record with one effect (none for ""), integrated in time to the steady state."""
        key = (name, *plan.items())
        if key not in self._truths:
            bench = self.bench(**plan)
            present = (TrueEffect(name, *EFFECTS[name]),) if name else ()
            self._truths[key] = self.cells(*true_record(*applied(present, bench)))
        return self._truths[key]

    def cells(self, amplitude: np.ndarray, phase: np.ndarray) -> RecordCells:
        """Amplitudes and phases with their standard deviations."""
        return RecordCells(amplitude, phase, NOISE * amplitude, np.full(amplitude.size, NOISE))

    def linear(self, rows: TrueRows, **true: float | np.ndarray) -> RecordCells:
        """Viscous damping in closed form; ``omega``, ``viscous`` and ``gain`` as given, numbers or one for each row."""
        Y = MASS * (true.get("omega", OMEGA) ** 2 - rows.omega**2) + 1j * true.get("viscous", VISCOUS) * rows.omega
        return self.cells(true.get("gain", 1.0) * rows.force / np.abs(Y), np.angle(Y))

    def record(self, rows: TrueRows, cells: RecordCells, seed: int | None = None, wild: float = 0.0) -> Record:
        """The record as it would be read from a file; noise of ``seed``, none without; a share of ``wild`` points."""
        amplitude, phase = cells.amplitude, cells.phase
        if seed is not None:
            rng, n = np.random.default_rng(seed), amplitude.size
            jump = np.where(rng.random(n) < wild, rng.choice([-1.0, 1.0], n) * rng.uniform(5.0, 15.0, n), 0.0)
            amplitude = amplitude + cells.amplitude_sd * (rng.normal(size=n) + jump)
            phase = phase + cells.phase_sd * rng.normal(size=n)
        table = {
            "sweep": [chr(ord("A") + number) for number in rows.sweep],
            "force": rows.force,
            "frequency": rows.omega / (2 * np.pi),
            "amplitude": amplitude,
            "phase": phase,
            "amplitude_sd": cells.amplitude_sd,
            "phase_sd": cells.phase_sd,
        }
        return Record(pd.DataFrame(table), "simulated test")

    def measured(self, name: str, seed: int = 6, **plan: Any) -> Record:
        """The record of a test with one effect, with noise."""
        return self.record(self.bench(**plan).rows, self.truth(name, **plan), seed)

    def diagnosed(self, name: str) -> Diagnosis:
        """The diagnosis of ``measured(name)`` with the whole library."""
        if name not in self._diagnoses:
            with pytest.MonkeyPatch.context() as patch:
                for place, function in WHOLE.items():
                    patch.setattr(place, function)
                self._diagnoses[name] = diagnose(self.measured(name), self.mode())
        return self._diagnoses[name]


@pytest.fixture(scope="session")
def lab() -> Lab:
    """The laboratory, with all that has been integrated or diagnosed already."""
    return Lab()


@pytest.fixture
def no_folds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Diagnoses that hold no level out, which takes a fifth of their time: where nobody looks at it."""
    monkeypatch.setattr("damping.gap.size.hold_levels_out", lambda *_: None)


@pytest.fixture(params=["few", pytest.param("all", marks=[pytest.mark.slow, pytest.mark.whole])])
def among(request: pytest.FixtureRequest) -> Callable[..., dict[str, Effect]]:
    """``among(*names)``: effects of every kind and those named, from which a cause is told; ``make slow``: from all.

    To be named are the effects that the test is about and those that were, or could be, blamed in their place.
    """

    def choose(*names: str) -> dict[str, Effect]:
        wanted = {*KINDS, *names} if request.param == "few" else set(CATALOGUE)
        assert wanted <= set(CATALOGUE)
        return {name: effect for name, effect in CATALOGUE.items() if name in wanted}

    return choose
