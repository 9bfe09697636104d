"""A base that shakes, as a force: the participation that the rows imply, and added masses, which the base shakes too.

A base of acceleration a drives the motion q relative to it by the modal force p m a, p the participation. A mass that
is added where q is measured moves with the base and with q: (m + m_a) q'' + C + K q = (p m + m_a) a. The slope of a/q
against frequency squared is (m + m_a)/(p m + m_a), whether or not a mass is added.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import View

#: Least relative standard uncertainty of a participation: masses of single sweeps hold no better than that.
LEAST_SPREAD = 0.005
#: Relative standard uncertainty of a participation of which the rows say nothing.
UNKNOWN_SPREAD = 0.5
#: Columns that are a force times something, and change with it.
_WITH_FORCE = ("force", "force_sd", "energy")
#: Columns that are masses.
_MASSES = ("mass", "added_mass")


@dataclass(frozen=True)
class Participation:
    """A participation with its relative standard uncertainty; ``known``: whether the rows show it at all."""

    value: float = 1.0
    spread: float = UNKNOWN_SPREAD
    known: bool = False

    def __str__(self) -> str:
        if not self.known:
            return "the rows do not determine the participation; damping ratios assume a participation of 1"
        return f"the rows imply a participation of {self.value:.4g} +- {100.0 * self.spread:.2g} %"


def find_participation(states: Iterable[tuple[Record, float, float]]) -> Participation:
    """The participation of a structure from all that was measured of it, sweeps without an added mass first.

    ``states``: each record with the generalized mass of the structure, and the mass that is added to it in every row
    beside the record's own ``added_mass``. Sweeps with an added mass are asked where there are no others.
    """
    bare: list[float] = []
    heavier: list[float] = []
    for record, mass, everywhere in states:
        own, added = record.masses(mass), record.added_masses + everywhere
        as_measured = Record.trusted(record.frame.drop(columns="added_mass", errors="ignore"), record.source)
        implied = View(as_measured, None).implied
        label = record.frame["sweep"].to_numpy()
        for sweep, slope in zip(implied["sweep"], implied["mass"], strict=True):
            M, m_a = own[label == sweep], added[label == sweep]
            if not (np.isfinite(slope) and slope > 0.0) or np.ptp(M) > 0.0 or np.ptp(m_a) > 0.0:
                continue
            excited = (M[0] + m_a[0]) / slope - m_a[0]
            if excited > 0.0:
                (heavier if m_a[0] else bare).append(float(M[0] / excited))
    known = np.array(bare or heavier)
    if not len(known):
        return Participation()
    # half of the quartiles' distance is 0.67 standard deviations of normal numbers, and a median is 1.25 of a mean
    quartiles = np.subtract(*np.quantile(np.log(known), [0.75, 0.25]))
    spread = float(np.hypot(LEAST_SPREAD, 1.25 * quartiles / 1.35 / np.sqrt(len(known))))
    return Participation(1.0 / float(np.median(known)), spread, known=True)


def has_masses(record: Record) -> bool:
    """Whether some rows of a record have a mass of their own, or an added one."""
    return any(name in record.frame.columns and bool(record.column(name, 0.0).any()) for name in _MASSES)


def drive_by(record: Record, excited: FloatArray, unit: float) -> Record:
    """A record of a base whose acceleration acts on masses ``excited`` (n,), as one of forces; masses in ``unit``.

    With ``excited`` of ones a force is counted in another unit of mass.
    """
    columns = record.frame.columns
    changed = {name: record.frame[name] * (excited / unit) for name in _WITH_FORCE if name in columns}
    changed |= {name: record.frame[name] / unit for name in _MASSES if name in columns}
    if np.all(excited == unit) and not has_masses(record):
        return record
    return Record.trusted(record.frame.assign(**changed), record.source)


def shake(record: Record, mode: Mode, participation: Participation) -> Record:
    """A base-driven record as one under forces in units of p m: F = a (m_row/m + m_a/(p m)) on masses over p m."""
    unit = participation.value * mode.mass
    return drive_by(record, participation.value * record.masses(mode.mass) + record.added_masses, unit)
