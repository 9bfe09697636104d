"""What a test measured, as laws are fitted to it: base drive as a force, swept rows as the steady states of them.

A base that moves with acceleration a drives the motion q relative to it by the modal force p m a, p the participation:
m q'' + C + K q = p m a. Divided by p m that is a mode of mass 1/p under the force a. A record of a and q tells all of
it: the mass 1/p as the slope of a/q against frequency squared, and damping as coefficients over p m. What a response at
a design acceleration needs is free of p; only a damping ratio is not, and takes its uncertainty.
"""

from dataclasses import dataclass, replace

import numpy as np

from damping.forces import shapes_of
from damping.forces.shapes import rescale
from damping.predict.sweep_rate import as_steady
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import View, take_median

#: Least relative standard uncertainty of a participation: masses of single sweeps hold no better than that.
LEAST_SPREAD = 0.005
#: Relative standard uncertainty of a participation of which the rows say nothing.
UNKNOWN_SPREAD = 0.5


@dataclass(frozen=True)
class Measured:
    """Steady states under a modal force, the mode of them (None where none is given) and what was done, in words."""

    record: Record
    mode: Mode | None
    said: tuple[str, ...] = ()


def prepare(record: Record, mode: Mode | None = None) -> Measured:
    """The record as laws are fitted to it, and the mode with it.

    Base drive becomes a force by :func:`as_driven_by_force`; rows whose rate of sweeping is known (a column
    ``sweep_rate``, or ``rate`` of the rig) or shows in their peaks become steady states by
    :func:`damping.predict.sweep_rate.as_steady`. A steady record driven by a force is returned as it is.
    """
    if mode is not None:
        base = mode.drive == "base"
        mode, said = as_driven_by_force(record, mode)
        mode = replace(mode, units=mode.units.of_base_drive) if base else mode
        if mode.rig.rate and "sweep_rate" not in record.table.columns:
            record = Record(record.table.assign(sweep_rate=mode.rig.rate), record.source)
        mass, frequency = mode.mass, mode.frequency
    elif "sweep_rate" not in record.table.columns:
        return Measured(record, None)
    else:  # what the rows imply; NaN where they imply none
        implied, said = View(record, None).implied, []
        mass, frequency = take_median(implied["mass"]), take_median(implied["frequency"])
    if not mass > 0.0:
        return Measured(record, mode, tuple(said))
    steady, swept = as_steady(record, mass, frequency)
    return Measured(steady, mode, (*said, *swept))


def as_driven_by_force(record: Record, mode: Mode) -> tuple[Mode, list[str]]:
    """A base-driven mode as one of mass 1/p under the base's acceleration as force, p from the rows, and what was done.

    The tolerance of its mass is the standard uncertainty of p. A mode that a force drives is returned as it is.
    """
    if mode.drive == "force":
        return mode, []
    masses = View(record, None).implied["mass"].to_numpy(dtype=np.float64)
    known = masses[np.isfinite(masses) & (masses > 0.0)]
    if len(known):
        participation = 1.0 / float(np.median(known))
        # half of the quartiles' distance is 0.67 standard deviations of normal numbers, and a median is 1.25 of a mean
        quartiles = np.subtract(*np.quantile(np.log(known), [0.75, 0.25]))
        spread = float(np.hypot(LEAST_SPREAD, 1.25 * quartiles / 1.35 / np.sqrt(len(known))))
        said = f"base drive: the rows imply a participation of {participation:.4g} +- {100.0 * spread:.2g} %"
    else:
        participation, spread = 1.0, UNKNOWN_SPREAD
        said = "base drive: the rows do not show the participation; damping ratios are those of a participation of 1"
    by = 1.0 / (participation * mode.mass)
    damping = {name: rescale(shapes_of(name), table, name, by) for name, table in mode.damping.items()}
    tolerance = replace(mode.tolerance, mass=spread, from_record=bool(len(known)))
    forced = replace(mode, drive="force", mass=1.0 / participation, damping=damping, tolerance=tolerance)
    return forced, [said]
