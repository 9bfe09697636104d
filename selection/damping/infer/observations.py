"""Damping observations of a record: one balance of applied and damping force for each row.

At a steady state the damping force in phase with velocity balances the applied force in quadrature (Eq. 3.2.9 divided
by pi A):

    D = E / (pi A) = F sin(phi)          to be explained by   C(A, omega) of a damping law,

while ``R = sqrt(F^2 - D^2) = |F cos(phi)|`` balances stiffness and inertia and has no information on damping.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray, IntArray
from damping.errors import AnalysisError
from damping.records.record import Record, energy_per_cycle
from damping.records.resonance import number_levels, tabulate_resonances
from damping.records.rows import SweepRows, read_sweep_rows
from damping.records.runs import ERROR_OF_RISE

MOST_ROWS = 20_000  #: of a record, so that laws are fitted in minutes, not hours
MOST_SWEEPS = 100  #: of a record, for the same reason
#: Binary digits to which observations are rounded for sampling. The rounding errors of other units, a hundred million
#: times smaller, then hardly ever change one; a single change gives entirely different draws.
DRAWN_BITS = 26
FITTED_BITS = 40  #: the same for best fits, which a single change moves by as little
ROUNDING = 1e-14  #: relative difference of two squares taken as rounding


@dataclass(frozen=True)
class Observations(SweepRows):
    """Rows of a record with information on damping; arrays of shape (rows,) unless stated."""

    A: FloatArray  #: amplitude
    D: FloatArray  #: force in quadrature E/(pi A)
    R: FloatArray  #: size of the force in phase with displacement
    tested_force: FloatArray  #: of the phase resonance of each sweep, (sweeps,)
    tested_amplitude: FloatArray  #: there, (sweeps,)
    tested_omega: FloatArray  #: there, rad/s, (sweeps,)
    amplitude_is_input: bool = False  #: amplitudes were given and forces follow from them, as in a free decay
    read_between: bool = False  #: sd_amplitude is the error of reading between rows alone: the record states none
    #: rows of a sweep that count as one independent row in a likelihood, since their errors are alike
    together: float = 1.0
    #: generalized mass that the record gives for each sweep, NaN for those without; None without any
    tested_mass: FloatArray | None = None
    #: known mass added to the structure for each sweep; None where nothing is known
    added_mass: FloatArray | None = None
    PER_SWEEP = ("tested_force", "tested_amplitude", "tested_omega", "tested_mass", "added_mass")

    @cached_property
    def levels(self) -> IntArray:
        """Level of each sweep, from 0, shape (sweeps,): by amplitude where that is the input, else by force."""
        return number_levels(self.tested_amplitude if self.amplitude_is_input else self.tested_force)

    @cached_property
    def rows_per_sweep(self) -> IntArray:
        """Number of rows of each sweep, shape (sweeps,)."""
        return np.bincount(self.sweep, minlength=len(self.sweeps)).astype(np.int64)

    @cached_property
    def has_repeats(self) -> bool:
        """Whether any sweep has several rows, so that row noise and level scatter can be told apart."""
        return bool(np.any(self.rows_per_sweep > 1))

    @cached_property
    def row_of_sweep(self) -> IntArray | slice | None:
        """The row of each sweep where each has exactly one; else None."""
        if len(self.sweeps) != len(self.sweep):
            return None
        order = np.argsort(self.sweep)
        return slice(None) if np.array_equal(order, np.arange(len(order))) else order

    @cached_property
    def membership(self) -> FloatArray:
        """1 where a row is of a sweep, else 0, (rows, sweeps)."""
        return np.eye(len(self.sweeps))[self.sweep]

    @cached_property
    def states_uncertainty(self) -> bool:
        """Whether the record gives a standard uncertainty for any row."""
        return any(bool(sd.any()) for sd in (self.sd_amplitude, self.sd_force, self.sd_phase))

    @cached_property
    def reference(self) -> tuple[float, float, float]:
        """Amplitude, frequency (rad/s) and damping force that set the scale of the priors.

        Geometric means over the sweeps' resonances.
        """
        tested = self.tested_amplitude, self.tested_omega, self.tested_force
        amplitude, omega, force = (float(np.exp(np.mean(np.log(x)))) for x in tested)
        return amplitude, omega, force

    @cached_property
    def variance(self) -> FloatArray:
        """Variance of D by the stated uncertainties of phase and force, (rows,)."""
        return np.asarray(self.R**2 * self.sd_phase**2 + self.D**2 * self.sd_force**2)

    @cached_property
    def content(self) -> tuple[object, ...]:
        """All fields as a cache key, equal for observations that are equal bit by bit."""
        held = (getattr(self, field.name) for field in fields(self))
        return tuple(value.tobytes() if isinstance(value, np.ndarray) else value for value in held)

    @property
    def top(self) -> int:
        """Index of the sweep with the largest tested force."""
        return int(np.argmax(self.tested_force))

    @cached_property
    def sampled(self) -> Observations:
        """Dimensionless observations as they are sampled, the same object for every law."""
        return self.scaled(DRAWN_BITS)

    def scaled(self, bits: int) -> Observations:
        """Dimensionless observations: over the ``reference``, rounded to ``bits`` binary digits."""
        amplitude, omega, force = self.reference
        return replace(
            self,
            A=round_bits(self.A / amplitude, bits),
            omega=round_bits(self.omega / omega, bits),
            D=round_bits(self.D / force, bits),
            R=np.round(self.R / force * 2.0**bits) / 2.0**bits,  # near 0, where few of its digits are known
            sd_amplitude=round_bits(self.sd_amplitude, bits),
            sd_force=round_bits(self.sd_force, bits),
            tested_amplitude=round_bits(self.tested_amplitude / amplitude, bits),
            tested_omega=round_bits(self.tested_omega / omega, bits),
            tested_force=round_bits(self.tested_force / force, bits),
        )


def round_bits(values: FloatArray, bits: int) -> FloatArray:
    """Values rounded to a number of binary digits."""
    mantissa, exponent = np.frexp(values)
    return np.asarray(np.ldexp(np.round(mantissa * 2.0**bits) / 2.0**bits, exponent))


def observe(record: Record) -> Observations:
    """Turn a record into damping observations.

    Sweeps are sorted by tested force and rows by frequency, so that sums and draws do not depend on the order of the
    record. Rows without energy (no phase and not at resonance) are left out. A constant phase offset found by
    :func:`damping.records.resonance.tabulate_resonances` is not removed here: ``D`` is the measured value.

    AnalysisError: no row says anything about damping, or there are too many.
    """
    rows, A, force = read_sweep_rows(record), record.column("amplitude"), record.column("force")
    if len(rows) > MOST_ROWS or len(rows.sweeps) > MOST_SWEEPS:
        fewer = (
            "the rows near resonance, or every second one" if len(rows) > MOST_ROWS else "every second sweep (level)"
        )
        raise AnalysisError(
            f"{record.source}: {len(rows)} rows of {len(rows.sweeps)} sweeps; laws are weighed on {MOST_ROWS} rows"
            f" of {MOST_SWEEPS} sweeps at most: keep {fewer}"
        )
    D = energy_per_cycle(record) / (np.pi * A)
    if not np.isfinite(D).any():
        raise AnalysisError(f"{record.source}: no row gives an energy per cycle, so damping cannot be judged")
    peaks = tabulate_resonances(record)
    observed = Observations(
        **vars(rows),
        A=A,
        D=D,
        R=np.sqrt(np.where(force**2 - D**2 > ROUNDING * force**2, force**2 - D**2, 0.0)),
        tested_force=peaks["force"].to_numpy(float),
        tested_amplitude=peaks["amplitude"].to_numpy(float),
        tested_omega=RAD_S_PER_HZ * peaks["frequency"].to_numpy(float),
        amplitude_is_input=record.is_decay,
        added_mass=record.added_masses[peaks["row"]],
        tested_mass=record.column("mass")[peaks["row"]] if "mass" in record.frame else None,
    )
    order = np.lexsort((force, A, rows.omega))
    order = order[np.isfinite(D[order])]
    observed = observed.take_rows(order)
    if not record.has_phase and "energy" not in record.frame:
        observed = _read_between(observed, (A / force)[peaks["row"]])
    return observed.take_sweeps(np.lexsort((observed.tested_omega, observed.tested_amplitude, observed.tested_force)))


def _read_between(data: Observations, largest: FloatArray) -> Observations:
    """One row for each sweep without phases: its resonance, in a coarse one above the ``largest`` A/F (sweeps,)."""
    rise = np.log(data.tested_amplitude / data.tested_force / largest)
    sd = np.hypot(data.sd_amplitude, ERROR_OF_RISE * np.abs(rise)[data.sweep])
    return at_resonance(replace(data, sd_amplitude=sd, read_between=not data.states_uncertainty))


def at_resonance(data: Observations) -> Observations:
    """One row for each sweep: its phase resonance, with the mean uncertainties of the sweep's rows; by rising force."""
    number = len(data.sweeps)

    def mean(values: FloatArray) -> FloatArray:
        return np.sqrt(np.bincount(data.sweep, values**2, number) / data.rows_per_sweep)

    resonances = replace(
        data,
        A=data.tested_amplitude,
        omega=data.tested_omega,
        D=data.tested_force,
        R=np.zeros(number),
        sweep=np.arange(number),
        sd_amplitude=mean(data.sd_amplitude),
        sd_force=mean(data.sd_force),
        sd_phase=mean(data.sd_phase),
    )
    return resonances.take_sweeps(np.lexsort((data.tested_amplitude, data.tested_force)))
