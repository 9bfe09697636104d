"""Base excitation as a force: the participation that the rows imply, and added masses, which the base drives too.

A base acceleration a drives the relative motion q by the modal force p m a, with participation p. A mass m_a added
where q is measured moves with the base and with q: (m + m_a) q'' + C + K q = (p m + m_a) a. The slope of a/q against
frequency squared is (m + m_a)/(p m + m_a), with or without an added mass.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from damping.arrays import FloatArray
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import View

#: Least relative standard uncertainty of a participation: masses of single sweeps are no more accurate.
LEAST_SPREAD = 0.005
UNKNOWN_SPREAD = 0.5  #: relative standard uncertainty of a participation that the rows do not show
_WITH_FORCE = ("force", "force_sd", "energy")  #: columns proportional to the force
_MASSES = ("mass", "added_mass")  #: columns that are masses


@dataclass(frozen=True)
class Participation:
    """A participation with its relative standard uncertainty; ``known``: whether the rows show it."""

    value: float = 1.0
    spread: float = UNKNOWN_SPREAD
    known: bool = False

    def __str__(self) -> str:
        if not self.known:
            return "the rows do not determine the participation; damping ratios assume a participation of 1"
        return f"the rows imply a participation of {self.value:.4g} ± {100.0 * self.spread:.2g} %"


def find_participation(states: Iterable[tuple[Record, float, float]]) -> Participation:
    """The participation of a structure from all its records.

    ``states``: each record with the generalized mass of the structure, and the mass added in every row besides the
    column ``added_mass``. Sweeps with an added mass are used only if there are no others.
    """
    bare: list[float] = []
    heavier: list[float] = []
    for record, mass, everywhere in states:
        masses, added = record.masses(mass), record.added_masses + everywhere
        as_measured = Record.trusted(record.frame.drop(columns="added_mass", errors="ignore"), record.source)
        view = View(as_measured, None)
        of_line = {leg.run.sweep for leg in view.legs if leg.lag is not None and not leg.paired}  # bent by a spring
        implied = view.implied[~view.implied["sweep"].isin(of_line)]
        label = record.frame["sweep"].to_numpy()
        for sweep, slope in zip(implied["sweep"], implied["mass"], strict=True):
            M, m_a = masses[label == sweep], added[label == sweep]
            if not (np.isfinite(slope) and slope > 0.0) or np.ptp(M) > 0.0 or np.ptp(m_a) > 0.0:
                continue
            excited = (M[0] + m_a[0]) / slope - m_a[0]
            if excited > 0.0:
                (heavier if m_a[0] else bare).append(float(M[0] / excited))
    known = np.array(bare or heavier)
    if not len(known):
        return Participation()
    # normal values: the quartiles are 1.35 standard deviations apart, the error of a median is 1.25 that of a mean
    quartiles = np.subtract(*np.quantile(np.log(known), [0.75, 0.25]))
    spread = float(np.hypot(LEAST_SPREAD, 1.25 * quartiles / 1.35 / np.sqrt(len(known))))
    return Participation(1.0 / float(np.median(known)), spread, known=True)


def has_masses(record: Record) -> bool:
    """Whether some rows of a record state a mass or an added mass."""
    return any(name in record.frame.columns and bool(record.column(name, 0.0).any()) for name in _MASSES)


def drive_by(record: Record, excited: FloatArray, unit: float) -> Record:
    """Convert base accelerations to forces on the masses ``excited`` (n,), in units in which the mass ``unit`` is 1.

    With ``excited`` of ones a force is only converted to the new unit of mass.
    """
    columns = record.frame.columns
    changed = {name: record.frame[name] * (excited / unit) for name in _WITH_FORCE if name in columns}
    changed |= {name: record.frame[name] / unit for name in _MASSES if name in columns}
    if np.all(excited == unit) and not has_masses(record):
        return record
    return Record.trusted(record.frame.assign(**changed), record.source)


def shake(record: Record, mode: Mode, participation: Participation) -> Record:
    """A base-driven record as a force-driven one in units of p m: F = a (m_row/m + m_a/(p m)), masses over p m."""
    unit = participation.value * mode.mass
    return drive_by(record, participation.value * record.masses(mode.mass) + record.added_masses, unit)
