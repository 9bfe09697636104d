"""The measured phasors of a record as arrays: what every prediction is compared with, row by row.

Noise of every row: as stated, else from how roughly the residuals of a reference run along each sweep.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from damping.arrays import RAD_S_PER_HZ, BoolArray, FloatArray, IntArray
from damping.effects.terms import Drive
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.resonance import number_levels, tabulate_resonances


@dataclass(frozen=True)
class Rows:
    """One entry a measured steady state, by sweep and within a sweep by frequency; shapes (n,) unless said.

    Attributes:
        row: row of the record. sweep: number of the sweep, an index of ``sweeps``. level: number of the force level of
            each sweep, (sweeps,), lowest first; repeats of one level share it.
        F: force. omega: rad/s. u: ln of the amplitude. phase: lag, rad (pi/2 where none was measured).
        mass: the row's generalized mass over that of the model. time: when it was taken, -1/2 to 1/2 over the record.
        label: number of the sweep in the whole record, from 1. up: 1 where the frequency rises in the order taken, -1
        where it falls. rate: known d omega/dt, rad/s^2. added: known mass beside that of the model.
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
    time: FloatArray
    label: FloatArray
    up: FloatArray
    rate: FloatArray
    added: FloatArray
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
        """What the rig does at each row."""
        return Drive(
            self.F,
            self.omega,
            self.mass,
            self.at_resonance,
            self.time,
            self.label,
            self.up,
            self.rate,
            self.added,
        )

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
        chosen = {name: getattr(self, name)[keep] for name in BY_ROW}
        return replace(self, sweep=sweep, sweeps=tuple(self.sweeps[k] for k in kept), level=self.level[kept], **chosen)


#: Fields of `Rows` with one entry a row, but for its sweep.
BY_ROW = tuple("row F omega u phase mass time label up rate added sd_amplitude sd_phase".split())


def read_rows(record: Record, mode: Mode) -> Rows:
    """The rows of a record, noise not yet known (ones): see `damping.gap.rows`."""
    sweeps = record.sweeps
    label = record.table["sweep"].astype(str).to_numpy()
    sweep = np.array([sweeps.index(str(s)) for s in label])
    omega = RAD_S_PER_HZ * record.column("frequency")
    order = np.lexsort((np.arange(len(record)), omega, sweep))
    F, A = record.column("force"), record.column("amplitude")
    at_resonance = not record.has_phase and len(sweeps) == len(record)
    phase = record.column("phase") if record.has_phase else np.full(len(record), 0.5 * pi)
    time = _order_taken(record)
    up = np.ones(len(record))
    for number in range(len(sweeps)):
        own = sweep == number
        up[own] = np.sign(np.sum((time[own] - time[own].mean()) * (omega[own] - omega[own].mean()))) or 1.0

    def optional(name: str) -> FloatArray:
        return np.nan_to_num(record.column(name)) if name in record.table.columns else np.zeros(len(record))

    return Rows(
        row=order,
        sweep=sweep[order],
        sweeps=sweeps,
        level=number_levels(tabulate_resonances(record)["force"].to_numpy()),
        F=F[order],
        omega=omega[order],
        u=np.log(A[order]),
        phase=phase[order],
        mass=(record.masses(mode.mass) / mode.mass)[order],
        time=time[order],
        label=1.0 + sweep[order],
        up=up[order],
        rate=RAD_S_PER_HZ * optional("sweep_rate")[order],
        added=optional("added_mass")[order],
        sd_amplitude=np.ones(len(record)),
        sd_phase=np.ones(len(record)),
        has_phase=record.has_phase,
        at_resonance=at_resonance,
    )


def _order_taken(record: Record) -> FloatArray:
    """When each row was taken, -1/2 to 1/2 over the record; by the order of the rows where no time is given."""
    time = np.arange(len(record), dtype=float)
    if "time" in record.table.columns and np.isfinite(record.column("time")).all():
        time = record.column("time")
    span = float(np.ptp(time))
    return np.asarray((time - time.min()) / span - 0.5) if span > 0.0 else np.zeros(len(record))


def wrapped(angle: FloatArray) -> FloatArray:
    """An angle between -pi and pi."""
    return np.asarray(angle - 2.0 * pi * np.round(angle / (2.0 * pi)))


#: Share of the largest differences that are left out, and the root mean square of the others for a normal variable.
_TRIMMED = 0.15
_OF_NORMAL = 0.7215
#: Constant noise over noise in proportion, at the 10 % point of the amplitudes; price in ln p of having one at all.
SHARES = (0.0, 0.5, 1.0, 2.0, 4.0, 100.0)
_PRICE = 2.0
#: Deviations count as so large at most.
CLIP = 3.0
#: Noise that is assumed before anything is known: of the order of a careful sine test.
FIRST_GUESS = 0.02
#: Smallest noise that is believed, so that computed records do not divide by zero.
LEAST = 1e-6


def stated_noise(rows: Rows, record: Record) -> Rows:
    """The rows with the record's standard uncertainties; ``FIRST_GUESS`` for those that it does not state."""
    A, F = rows.A, rows.F
    relative = _filled(_column(record, "amplitude_sd", rows.row) / A)
    if "force_sd" in record.table.columns:
        relative = np.hypot(relative, _column(record, "force_sd", rows.row) / F)
    return replace(rows, sd_amplitude=relative, sd_phase=_filled(_column(record, "phase_sd", rows.row)))


def is_stated(record: Record) -> tuple[bool, bool]:
    """Whether the noise of amplitudes, and of phases, is stated."""
    names = ("amplitude_sd", "phase_sd")
    amplitude, phase = (name in record.table.columns and bool(np.any(record.column(name) > 0.0)) for name in names)
    return amplitude, phase


def roughness(rows: Rows, residual: FloatArray) -> FloatArray:
    """Noise (n,) of residuals (n,) that are otherwise smooth along each sweep.

    Four neighbours are combined so that any parabola through them cancels (repeated points are neighbours too); with
    fewer than four rows in every sweep, two. The noise is s sqrt(1 + (rho A_low/A)^2), a share of the amplitude beside
    a constant part: rho is the most likely of ``SHARES``, s the root mean square without the largest, since a wild
    point is in four combinations. Rows at phase resonance only say nothing of it: ``FIRST_GUESS``.
    """
    runs = [np.flatnonzero(rows.sweep == number) for number in range(len(rows.sweeps))]
    width = next((w for w in (4, 2) if max(map(len, runs)) >= w), 1)
    if rows.at_resonance or width == 1:
        return np.full(len(rows), FIRST_GUESS)
    weights, places = zip(
        *(_combinations(rows.omega[own], own, width) for own in runs if len(own) >= width), strict=True
    )
    w, at = np.concatenate(weights), np.concatenate(places)
    combined = np.sum(w * residual[at], axis=1)
    found = []
    for rho in SHARES:
        shape = np.sqrt(1.0 + (rho * np.quantile(rows.A, 0.1) / rows.A) ** 2)
        of_shape = np.sqrt(np.sum(w**2 * shape[at] ** 2, axis=1))
        s = max(spread(combined / of_shape), LEAST)
        price = _PRICE if rho else 0.0
        found.append((_log_likelihood(combined / of_shape, s) - float(np.sum(np.log(of_shape))) - price, s * shape))
    return max(found, key=lambda one: one[0])[1]


def spread(values: FloatArray) -> float:
    """Standard deviation of normal values of which some are wild."""
    dropped = int(_TRIMMED * len(values))
    kept = np.sort(values**2)[: len(values) - dropped]
    return float(np.sqrt(kept.mean())) / (_OF_NORMAL if dropped else 1.0)


def _log_likelihood(values: FloatArray, s: float) -> float:
    return -float(len(values) * np.log(s) + 0.5 * np.sum(np.minimum((values / s) ** 2, CLIP**2)))


def _combinations(x: FloatArray, own: IntArray, width: int) -> tuple[FloatArray, IntArray]:
    """Weights of unit norm that annul every polynomial of degree width - 2 over ``width`` neighbours; their rows."""
    places = np.arange(len(x) - width + 1)[:, np.newaxis] + np.arange(width)
    t = x[places]
    t = (t - t.mean(axis=1, keepdims=True)) / max(float(np.ptp(x)), 1e-300)
    vandermonde = np.stack([t**k for k in range(width - 1)], axis=1)
    return np.linalg.svd(vandermonde)[2][:, -1, :], own[places]  # orthogonal to all rows


def _column(record: Record, name: str, row: IntArray) -> FloatArray:
    """A column in the order of the rows, NaN where it is absent or not above zero (none stated)."""
    if name not in record.table.columns:
        return np.full(len(row), np.nan)
    values = record.column(name)[row]
    return np.where(values > 0.0, values, np.nan)


def _filled(values: FloatArray) -> FloatArray:
    """Missing values replaced by the median of the others, or by ``FIRST_GUESS`` where there is none."""
    known = values[np.isfinite(values)]
    return np.where(np.isfinite(values), values, np.median(known) if known.size else FIRST_GUESS)
