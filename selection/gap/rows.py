"""The measured phasors of a record as arrays: what every prediction is compared with, row by row."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import pi

import numpy as np

from selection.arrays import BoolArray, FloatArray, IntArray
from selection.gap.terms import Drive
from selection.records.mode import Mode
from selection.records.record import Record
from selection.units import RAD_S_PER_HZ

#: Sweeps whose forces at resonance differ by less than this are repeats of one level.
SAME_LEVEL = 0.05


@dataclass(frozen=True)
class Rows:
    """One entry a measured steady state, by sweep and within a sweep by frequency; shapes (n,) unless said.

    Attributes:
        row: row of the record. sweep: number of the sweep, an index of ``sweeps``. level: number of the force level of
            each sweep, (sweeps,), lowest first; repeats of one level share it.
        F: force. omega: rad/s. u: ln of the amplitude. phase: lag, rad (pi/2 where none was measured).
        mass: the row's generalized mass over that of the model.
        sd_amplitude: relative standard uncertainty of the amplitude, that of the force included; sd_phase: rad.
        has_phase: whether the phases were measured. at_resonance: whether every row is the phase resonance of its
            sweep, as in a record whose sweeps are single rows without a phase.
    """

    row: IntArray
    sweep: IntArray
    sweeps: tuple[str, ...]
    level: IntArray
    F: FloatArray
    omega: FloatArray
    u: FloatArray
    phase: FloatArray
    mass: FloatArray
    sd_amplitude: FloatArray
    sd_phase: FloatArray
    has_phase: bool
    at_resonance: bool = False

    def __len__(self) -> int:
        return len(self.F)

    @property
    def A(self) -> FloatArray:
        """Measured amplitude."""
        return np.exp(self.u)

    @property
    def drive(self) -> Drive:
        """Force, frequency and mass factor."""
        return Drive(self.F, self.omega, self.mass, self.at_resonance)

    @property
    def values(self) -> int:
        """Number of residuals: amplitudes, and phases where there are any."""
        return len(self) * (2 if self.has_phase else 1)

    @property
    def levels(self) -> int:
        """Number of different force levels."""
        return len(np.unique(self.level))

    def where(self, keep: BoolArray) -> Rows:
        """The rows marked in ``keep``, sweeps without any row dropped and numbered anew."""
        kept, sweep = np.unique(self.sweep[keep], return_inverse=True)
        by_row = ("row", "F", "omega", "u", "phase", "mass", "sd_amplitude", "sd_phase")
        chosen = {name: getattr(self, name)[keep] for name in by_row}
        return replace(self, sweep=sweep, sweeps=tuple(self.sweeps[k] for k in kept), level=self.level[kept], **chosen)


def read_rows(record: Record, mode: Mode) -> Rows:
    """The rows of a record, noise not yet known (ones): see `selection.gap.noise`."""
    sweeps = record.sweeps
    label = record.table["sweep"].astype(str).to_numpy()
    sweep = np.array([sweeps.index(str(s)) for s in label])
    omega = RAD_S_PER_HZ * record.column("frequency")
    order = np.lexsort((np.arange(len(record)), omega, sweep))
    F, A = record.column("force"), record.column("amplitude")
    at_resonance = not record.has_phase and len(sweeps) == len(record)
    phase = record.column("phase") if record.has_phase else np.full(len(record), 0.5 * pi)
    return Rows(
        row=order,
        sweep=sweep[order],
        sweeps=sweeps,
        level=force_levels(F, A, sweep),
        F=F[order],
        omega=omega[order],
        u=np.log(A[order]),
        phase=phase[order],
        mass=(record.masses(mode.mass) / mode.mass)[order],
        sd_amplitude=np.ones(len(record)),
        sd_phase=np.ones(len(record)),
        has_phase=record.has_phase,
        at_resonance=at_resonance,
    )


def force_levels(F: FloatArray, A: FloatArray, sweep: IntArray) -> IntArray:
    """Level of each sweep, (sweeps,), by the force at its largest amplitude per force, lowest first."""
    forces = []
    for number in range(int(sweep.max()) + 1):
        own = np.flatnonzero(sweep == number)
        forces.append(F[own[np.argmax(A[own] / F[own])]])
    order = np.argsort(forces)
    level, numbers = 0, np.zeros(len(forces), dtype=np.int64)
    for previous, number in pairwise(order):
        level += int(forces[number] > forces[previous] * (1.0 + SAME_LEVEL))
        numbers[number] = level
    return numbers


def wrapped(angle: FloatArray) -> FloatArray:
    """An angle between -pi and pi."""
    return np.asarray(angle - 2.0 * pi * np.round(angle / (2.0 * pi)))
