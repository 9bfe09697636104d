"""The measured phasors of a record as arrays, with which every prediction is compared row by row.

Noise that is not stated is estimated in `damping.gap.unknowns`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi
from typing import Any

import numpy as np

from damping.arrays import RAD_S_PER_HZ, BoolArray, ComplexArray, FloatArray, IntArray, join_rows
from damping.effects.contract import Drive
from damping.effects.masses import share_of_structure
from damping.errors import AnalysisError
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import number_levels, tabulate_resonances
from damping.records.rows import SweepRows, find_direction, list_rates, order_taken, read_sweep_rows

UNSEEN = 1e9  #: standard uncertainty of what was not measured: no information, and residuals stay finite
FURTHER_CHANNELS = ("3", "y")  #: column suffixes of further phasors: third harmonic, cross-axis motion
#: Relative difference of M omega_n^2 below which states have one stiffness and differ by a known mass.
SAME_STIFFNESS = 1e-3


@dataclass(frozen=True)
class PhasorRows(SweepRows):
    """The phasor of every row, by sweep and within a sweep by frequency; arrays of shape (rows,) unless stated.

    ``sd_amplitude``, with that of the force, and ``sd_phase``, ``UNSEEN`` where no phase was measured, are the noise
    once `damping.gap.unknowns.stated_noise` has filled what is not stated.
    """

    row: IntArray  #: row of the record
    levels: IntArray  #: number of the force level of each sweep, (sweeps,), lowest first; repeats of one level share it
    F: FloatArray  #: as of a `Drive`, like all below that have no remark
    u: FloatArray  #: ln of the amplitude
    phase: FloatArray  #: lag, rad (pi/2 where none was measured)
    mass: FloatArray
    resonant: BoolArray  #: whether it is its whole sweep and the record has no phases
    time: FloatArray
    label: FloatArray  #: ``sweep`` of a `Drive`: its number in the whole record, from 1
    up: FloatArray
    rate: FloatArray
    added: FloatArray
    state: FloatArray
    ratio: FloatArray
    own: FloatArray
    shaken: FloatArray
    third: ComplexArray  #: phasor of the third harmonic, relative to the phase of the force
    cross: ComplexArray  #: that of the motion across the measured axis
    sd_third: FloatArray  #: its noise, ``UNSEEN`` where not measured
    sd_cross: FloatArray  #: likewise
    has_phase: bool  #: whether phases are compared
    channels: tuple[str, ...] = ()  #: further phasors compared, of ``third`` and ``cross``
    PER_SWEEP = ("levels",)

    @property
    def A(self) -> FloatArray:
        """Measured amplitude."""
        return np.exp(self.u)

    @cached_property
    def drive(self) -> Drive:
        """Excitation and state at each row; a value that all rows share is a number."""
        values = {name: getattr(self, name) for name in ("F", "omega", "time")} | {"sweep": self.label}
        for name in ("mass", "resonant", "up", "rate", "added", "state", "ratio", "own", "shaken"):
            column = getattr(self, name)
            values[name] = column[0].item() if len(column) and np.all(column == column[0]) else column
        return Drive(**values)

    @property
    def bare_force(self) -> FloatArray:
        """Force on the structure alone: a base also shakes added masses."""
        return self.F * share_of_structure(self.drive)

    @property
    def at_resonance(self) -> bool:
        """Whether every row is at phase resonance."""
        return bool(self.resonant.all())

    @property
    def of_peaks(self) -> bool:
        """Whether every sweep is one row, with or without its phase: an error of a row is then one of its sweep."""
        return len(self) == len(self.sweeps)

    @cached_property
    def measured(self) -> BoolArray:
        """Whether each residual (values,) was measured."""
        parts = [self.sd_amplitude]
        parts += [self.sd_phase] if self.has_phase else []
        parts += [getattr(self, f"sd_{channel}") for channel in self.channels for _ in range(2)]
        return np.concatenate(parts) < UNSEEN

    @property
    def values_of_mode(self) -> int:
        """Number of amplitudes and phases, which come first among the residuals; further channels follow."""
        return len(self) * (1 + self.has_phase)

    @cached_property
    def sweep_of_values(self) -> IntArray:
        """Number of the sweep of each residual: amplitudes, then phases and phasors of other channels, if any."""
        return np.tile(self.sweep, 1 + self.has_phase + 2 * len(self.channels))

    @cached_property
    def follows(self) -> BoolArray:
        """Whether each residual and the one before it are of one quantity at neighbours of one sweep, both measured.

        Of amplitudes and phases: residuals of further channels are mostly what is not predicted, and so always smooth.
        """
        sweep, measured = self.sweep_of_values, self.measured
        follows = np.concatenate([[False], (sweep[1:] == sweep[:-1]) & measured[1:] & measured[:-1]])
        follows[:: len(self)] = False
        follows[self.values_of_mode :] = False
        return follows

    def places(self, channel: str) -> slice:
        """Slice of a further phasor among the residuals, real parts first."""
        first = len(self) * (1 + self.has_phase + 2 * self.channels.index(channel))
        return slice(first, first + 2 * len(self))

    @property
    def level_count(self) -> int:
        """Number of different force levels."""
        return len(np.unique(self.levels))


def read_rows(record: Record, mode: Mode) -> PhasorRows:
    """The rows of a record, with the standard uncertainties that it states; sweeps in the order in which they began."""
    measured, n = read_sweep_rows(record), len(record)

    def phasor(channel: str) -> ComplexArray:
        A = record.column(f"amplitude_{channel}", np.nan)
        # an amplitude of exactly 0 was not measured: any analyser has noise
        return np.asarray(np.where(A > 0.0, A, np.nan) * np.exp(-1j * record.column(f"phase_{channel}", np.nan)))

    third, cross = map(phasor, FURTHER_CHANNELS)
    rows = PhasorRows(
        **vars(measured),
        row=np.arange(n),
        levels=number_levels(record.column(record.input)[tabulate_resonances(record)["row"]]),
        F=record.column("force"),
        u=np.log(record.column("amplitude")),
        phase=record.column("phase", 0.5 * pi),
        mass=record.masses(mode.mass) / mode.mass,
        resonant=(np.bincount(measured.sweep)[measured.sweep] == 1) & (not record.has_phase),
        time=order_taken(record),
        label=np.zeros(n),
        up=find_direction(record),
        rate=RAD_S_PER_HZ * list_rates(record, mode.rig.rate),
        added=record.added_masses,
        state=np.zeros(n),
        ratio=np.ones(n),
        own=np.ones(n),
        shaken=np.zeros(n),
        third=np.nan_to_num(third),
        cross=np.nan_to_num(cross),
        sd_third=np.where(np.isfinite(third), 1.0, UNSEEN),
        sd_cross=np.where(np.isfinite(cross), 1.0, UNSEEN),
        has_phase=record.has_phase,
        channels=tuple(name for name, phasor in (("third", third), ("cross", cross)) if np.isfinite(phasor).any()),
    )
    rows = rows.take_rows(np.lexsort((rows.time, rows.omega, rows.sweep)))
    rows = rows.take_sweeps(np.argsort([float(rows.time[run].min()) for run in rows.runs], kind="stable"))
    return replace(rows, label=np.asarray(1.0 + rows.sweep, float))


def is_same_structure(mode: Mode, first: Mode) -> bool:
    """Whether a state has the stiffness of the first, and so differs by a known mass."""
    return abs(mode.mass * mode.omega_n**2 / (first.mass * first.omega_n**2) - 1.0) < SAME_STIFFNESS


def on_base(rows: PhasorRows, shaken: FloatArray) -> PhasorRows:
    """The rows with a base acceleration acting on masses ``shaken`` (n,) and added masses; levels by acceleration."""
    rows = replace(rows, shaken=shaken)
    if not np.any(shaken * rows.added):
        return rows
    return replace(rows, levels=number_levels(np.array([float(np.median(rows.bare_force[run])) for run in rows.runs])))


def join_states(states: Sequence[tuple[PhasorRows, Mode]]) -> PhasorRows:
    """The rows of several states of one structure as one record; ``states`` are rows and the mode that simulates them.

    States of one stiffness differ by a known mass, from which their frequencies follow.

    AnalysisError: states with damping forces that the first one does not simulate.
    """
    (first, base), *_ = states
    if len(states) == 1:
        return first
    parts = [first]
    for number, (further, mode) in enumerate(states[1:], 1):
        if list(mode.damping) != list(base.damping):
            own, first_own = (", ".join(of.damping) or "no damping" for of in (mode, base))
            one, other = (of.source or of.name for of in (mode, base))
            shared = "states share their damping forces: give each model the same ones"
            raise AnalysisError(f"{one}: simulates {own}, but {other} simulates {first_own}; {shared}")
        n = len(further)
        changed: dict[str, Any] = {"state": np.full(n, float(number))}
        if is_same_structure(mode, base):
            changed["added"] = further.added + (mode.mass - base.mass)
        else:
            changed |= {"mass": further.mass * mode.mass / base.mass, "ratio": np.full(n, mode.omega_n / base.omega_n)}
        for name in list(base.damping)[:1]:  # relative to the first state, by the first force
            leading = next(iter(base.damping[name]))
            changed["own"] = np.full(n, mode.damping[name][leading] / base.damping[name][leading])
        parts.append(replace(further, **changed))
    # names of sweeps include the state
    before = np.cumsum([0, *(len(rows.sweeps) for rows in parts)])
    numbered = [
        replace(rows, sweep=rows.sweep + k, label=rows.label + k) for rows, k in zip(parts, before, strict=False)
    ]
    return replace(
        join_rows(numbered),
        sweeps=tuple(f"{k}: {name}" for k, rows in enumerate(parts, 1) for name in rows.sweeps),
        levels=number_levels(np.array([float(np.median(rows.bare_force[run])) for rows in parts for run in rows.runs])),
        has_phase=any(rows.has_phase for rows in parts),
        channels=tuple(name for name in ("third", "cross") if any(name in rows.channels for rows in parts)),
    )
