"""The measured phasors of a record as arrays, with which every prediction is compared row by row.

Noise that is not stated is estimated in `damping.gap.unknowns`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from math import pi

import numpy as np

from damping.arrays import RAD_S_PER_HZ, BoolArray, ComplexArray, FloatArray, IntArray
from damping.effects.contract import Drive
from damping.effects.masses import share_of_structure
from damping.errors import AnalysisError
from damping.records.mode import Mode
from damping.records.order import find_direction, list_rates, order_taken
from damping.records.record import Record
from damping.records.resonance import number_levels, tabulate_resonances

#: Standard uncertainty of what was not measured: no information, and residuals stay finite.
UNSEEN = 1e9
#: Column suffixes of further phasors: third harmonic, cross-axis motion.
FURTHER_CHANNELS = ("3", "y")
#: Relative difference of M omega_n^2 below which states have one stiffness and differ by a known mass.
SAME_STIFFNESS = 1e-3


@dataclass(frozen=True)
class Rows:
    """One entry for each measured steady state, by sweep and within a sweep by frequency; shapes (n,) unless stated.

    Attributes:
        row: row of the record. sweep: number of the sweep, an index of ``sweeps``. level: number of the force level of
            each sweep, (sweeps,), lowest first; repeats of one level share it. u: ln of the amplitude. phase: lag, rad
            (pi/2 where none was measured).
        F, omega, mass, resonant, time, label, up, rate, added, state, ratio, own, shaken: see `Drive` (``label`` is its
            ``sweep``: the number in the whole record, from 1). A row is ``resonant`` if it is its whole sweep and the
            record has no phases.
        sd_amplitude: relative standard uncertainty of the amplitude, that of the force included; sd_phase: rad,
            ``UNSEEN`` where no phase was measured.
        third, cross: phasors of the third harmonic, and of the motion across the measured axis, relative to the phase
            of the force; sd_third, sd_cross: their noise, ``UNSEEN`` where not measured.
        has_phase: whether phases are compared. channels: further phasors compared, of ``third`` and ``cross``.
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
    resonant: BoolArray
    time: FloatArray
    label: FloatArray
    up: FloatArray
    rate: FloatArray
    added: FloatArray
    state: FloatArray
    ratio: FloatArray
    own: FloatArray
    shaken: FloatArray
    sd_amplitude: FloatArray
    sd_phase: FloatArray
    third: ComplexArray
    cross: ComplexArray
    sd_third: FloatArray
    sd_cross: FloatArray
    has_phase: bool
    channels: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.F)

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

    @cached_property
    def runs(self) -> list[IntArray]:
        """Indices of the rows of each sweep."""
        return [np.flatnonzero(self.sweep == number) for number in range(len(self.sweeps))]

    @property
    def at_resonance(self) -> bool:
        """Whether every row is at phase resonance."""
        return bool(self.resonant.all())

    @property
    def of_peaks(self) -> bool:
        """Whether every sweep is one row at phase resonance: an error of a row is then one of its sweep."""
        return self.at_resonance and len(self) == len(self.sweeps)

    @property
    def seen(self) -> BoolArray:
        """Whether each residual (values,) was measured."""
        parts = [self.sd_amplitude]
        parts += [self.sd_phase] if self.has_phase else []
        parts += [getattr(self, f"sd_{channel}") for channel in self.channels for _ in range(2)]
        return np.concatenate(parts) < UNSEEN

    @cached_property
    def sweep_of_values(self) -> IntArray:
        """Number of the sweep of each residual: amplitudes, then phases and phasors of other channels, if any."""
        return np.tile(self.sweep, 1 + self.has_phase + 2 * len(self.channels))

    def places(self, channel: str) -> slice:
        """Slice of a further phasor among the residuals, real parts first."""
        first = len(self) * (1 + self.has_phase + 2 * self.channels.index(channel))
        return slice(first, first + 2 * len(self))

    @property
    def levels(self) -> int:
        """Number of different force levels."""
        return len(np.unique(self.level))

    def where(self, keep: BoolArray) -> Rows:
        """The rows marked in ``keep``; sweeps without rows are dropped and the others renumbered."""
        kept, sweep = np.unique(self.sweep[keep], return_inverse=True)
        rows = self.taken(np.flatnonzero(keep))
        return replace(rows, sweep=sweep, sweeps=tuple(self.sweeps[k] for k in kept), level=self.level[kept])

    def taken(self, index: IntArray, **changed: FloatArray) -> Rows:
        """Rows at indices (k,), which may repeat, with some fields ``changed``."""
        chosen = {name: getattr(self, name)[index] for name in (*BY_ROW, "sweep")}
        return replace(self, **(chosen | changed))


#: Fields of `Rows` with one entry for each row, except ``sweep``.
BY_ROW = tuple(
    field.name for field in fields(Rows) if field.name not in ("sweep", "sweeps", "level", "has_phase", "channels")
)


def read_rows(record: Record, mode: Mode) -> Rows:
    """The rows of a record, with standard uncertainties of 1 until noise is known."""
    sweeps, n = record.sweeps, len(record)
    names = record.frame["sweep"].astype(str).to_numpy()
    sweep = np.array([sweeps.index(str(s)) for s in names])
    omega = RAD_S_PER_HZ * record.column("frequency")
    order = np.lexsort((np.arange(n), omega, sweep))
    time = order_taken(record)

    def optional(name: str, default: float) -> FloatArray:
        return record.column(name, default)[order]

    def phasor(channel: str) -> ComplexArray:
        A = optional(f"amplitude_{channel}", np.nan)
        # an amplitude of exactly 0 was not measured: any analyser has noise
        return np.asarray(np.where(A > 0.0, A, np.nan) * np.exp(-1j * optional(f"phase_{channel}", np.nan)))

    third, cross = map(phasor, FURTHER_CHANNELS)
    return Rows(
        row=order,
        sweep=sweep[order],
        sweeps=sweeps,
        level=number_levels(record.column(record.input)[tabulate_resonances(record)["row"]]),
        F=record.column("force")[order],
        omega=omega[order],
        u=np.log(record.column("amplitude")[order]),
        phase=optional("phase", 0.5 * pi),
        mass=(record.masses(mode.mass) / mode.mass)[order],
        resonant=np.full(n, not record.has_phase and len(sweeps) == n),
        time=time[order],
        label=1.0 + sweep[order],
        up=find_direction(record)[order],
        rate=RAD_S_PER_HZ * list_rates(record, mode.rig.rate)[order],
        added=record.added_masses[order],
        state=np.zeros(n),
        ratio=np.ones(n),
        own=np.ones(n),
        shaken=np.zeros(n),
        sd_amplitude=np.ones(n),
        sd_phase=np.full(n, 1.0 if record.has_phase else UNSEEN),
        third=np.nan_to_num(third),
        cross=np.nan_to_num(cross),
        sd_third=np.where(np.isfinite(third), 1.0, UNSEEN),
        sd_cross=np.where(np.isfinite(cross), 1.0, UNSEEN),
        has_phase=record.has_phase,
        channels=tuple(name for name, phasor in (("third", third), ("cross", cross)) if np.isfinite(phasor).any()),
    )


def is_same_structure(mode: Mode, first: Mode) -> bool:
    """Whether a state has the stiffness of the first, and so differs by a known mass."""
    return abs(mode.mass * mode.omega_n**2 / (first.mass * first.omega_n**2) - 1.0) < SAME_STIFFNESS


def on_base(rows: Rows, shaken: FloatArray) -> Rows:
    """The rows with a base acceleration acting on masses ``shaken`` (n,) and added masses; levels by acceleration."""
    rows = replace(rows, shaken=shaken)
    if not np.any(shaken * rows.added):
        return rows
    return replace(rows, level=number_levels(np.array([float(np.median(rows.bare_force[run])) for run in rows.runs])))


def join_states(states: Sequence[tuple[Rows, Mode]]) -> Rows:
    """The rows of several states of one structure as one record; ``states`` are rows and the mode that simulates them.

    States of one stiffness differ by a known mass, from which their frequencies follow.

    Raises:
        AnalysisError: states with damping forces that the first one does not simulate.
    """
    (first, base), *_ = states
    if len(states) == 1:
        return first
    parts = [first]
    for number, (further, mode) in enumerate(states[1:], 1):
        if list(mode.damping) != list(base.damping):
            own, first_own = (", ".join(of.damping) or "no damping" for of in (mode, base))
            shared = "states share their damping forces: give each model the same ones"
            raise AnalysisError(f"{mode.source}: simulates {own}, but {base.source} simulates {first_own}; {shared}")
        n = len(further)
        changed: dict[str, FloatArray] = {"state": np.full(n, float(number))}
        if is_same_structure(mode, base):
            changed["added"] = further.added + (mode.mass - base.mass)
        else:
            changed |= {"mass": further.mass * mode.mass / base.mass, "ratio": np.full(n, mode.omega_n / base.omega_n)}
        for name in list(base.damping)[:1]:  # relative to the first state, by the first force
            leading = next(iter(base.damping[name]))
            changed["own"] = np.full(n, mode.damping[name][leading] / base.damping[name][leading])
        parts.append(further.taken(np.arange(n), **changed))
    # concatenate; names of sweeps include the state
    before = np.cumsum([0, *(len(rows.sweeps) for rows in parts)])
    numbered = [replace(rows, label=rows.label + k) for rows, k in zip(parts, before, strict=False)]
    names = tuple(f"{k}: {name}" for k, rows in enumerate(parts, 1) for name in rows.sweeps)
    forces = np.array([float(np.median(rows.bare_force[run])) for rows in parts for run in rows.runs])
    return replace(
        parts[0],
        **{name: np.concatenate([getattr(rows, name) for rows in numbered]) for name in BY_ROW},
        sweep=np.concatenate([rows.sweep + k for rows, k in zip(parts, before, strict=False)]),
        sweeps=names,
        level=number_levels(forces),
        has_phase=any(rows.has_phase for rows in parts),
        channels=tuple(name for name in ("third", "cross") if any(name in rows.channels for rows in parts)),
    )


def wrapped(angle: FloatArray) -> FloatArray:
    """An angle between -pi and pi."""
    return np.asarray(angle - 2.0 * pi * np.rint(angle / (2.0 * pi)))
