"""A record and a mode as a problem: rows, simulation, the scales of both, what is known of noise and repeatability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from selection.forces.catalogue import from_damping
from selection.gap.effects.form import Scales
from selection.gap.effects.given import check_effects
from selection.gap.fit import Fit
from selection.gap.model import NO_SCATTER, Problem, Scatter
from selection.gap.noise import is_stated, roughness, stated_noise
from selection.gap.rows import Rows, read_rows
from selection.gap.simulation import Simulation
from selection.gap.unknowns import Unknowns, unknowns
from selection.records.mode import Mode
from selection.records.record import Record

#: Standard deviation of the ln of a noise that is no more than a guess.
GUESS_ERROR = 0.2


@dataclass(frozen=True)
class Setting:
    """A problem with what is known about it.

    Attributes:
        scatter: repeatability from sweep to sweep as stated; None where it is to be estimated.
        amplitude_noise, phase_noise: whether the record states them.
        dispersion: by how much the best explanation of the library misses by more than noise.
    """

    problem: Problem
    scatter: Scatter | None
    amplitude_noise: bool
    phase_noise: bool
    dispersion: float = 1.0

    @property
    def unknowns(self) -> Unknowns:
        """What repeatability and noise may be; noise that was estimated from n rows is known to sqrt(2/n)."""
        rows = self.problem.rows
        error = 0.0 if self.noise_known else GUESS_ERROR if rows.at_resonance else float(np.sqrt(2.0 / len(rows)))
        return unknowns(self.scatter, self.problem.scales.bandwidth, error, self.dispersion)

    @property
    def noise_known(self) -> bool:
        """Whether all noise that counts is stated."""
        return self.amplitude_noise and (self.phase_noise or not self.problem.rows.has_phase)

    def with_noise_of(self, reference: Fit) -> Setting:
        """The setting with noise that is not stated taken from the roughness of a fit's residuals."""
        rows, factor = reference.model.problem.rows, reference.model.scatter.factor
        n = len(rows)
        if not self.amplitude_noise:
            rows = replace(rows, sd_amplitude=roughness(rows, reference.r[:n] * rows.sd_amplitude * factor))
        if rows.has_phase and not self.phase_noise:
            rows = replace(rows, sd_phase=roughness(rows, reference.r[n:] * rows.sd_phase * factor))
        return replace(self, problem=replace(self.problem, rows=rows))


def setting(record: Record, mode: Mode) -> Setting:
    """The setting of a record and the mode that simulates it; noise that is not stated is a first guess.

    Raises:
        InputError: the mode has an effect that is not known.
    """
    check_effects(mode)
    rows = stated_noise(read_rows(record, mode), record)
    problem = Problem(rows, Simulation(mode), scales(rows, mode))
    return Setting(problem, _scatter(mode, rows), *is_stated(record))


def scales(rows: Rows, mode: Mode) -> Scales:
    """The scales of a problem."""
    A_high = float(rows.A.max())
    stiffness = mode.mass * mode.omega_n**2
    simulated = float(from_damping(mode.damping).quadrature(A_high, mode.omega_n)) / A_high
    measured = float((rows.F / rows.A).min())  # the dynamic stiffness at resonance is that of the damping
    return Scales(
        A_low=float(np.quantile(rows.A, 0.1)),
        A_high=A_high,
        omega_n=mode.omega_n,
        M=mode.mass,
        viscous=mode.damping.get("viscous", {}).get("coefficient", 0.0),
        bandwidth=0.5 * (simulated or measured) / stiffness,
        reach=float(np.abs(rows.omega / mode.omega_n - 1.0).max()),
        frequency=mode.tolerance.frequency,
        damping=mode.tolerance.viscous,
    )


def _scatter(mode: Mode, rows: Rows) -> Scatter | None:
    """As stated; none with one sweep, where it cannot be seen; else to be estimated."""
    stated = mode.repeatability
    if stated.amplitude is None and stated.frequency is None:
        return Scatter(NO_SCATTER, NO_SCATTER) if len(rows.sweeps) < 2 else None
    return Scatter(stated.amplitude or NO_SCATTER, stated.frequency or NO_SCATTER)
