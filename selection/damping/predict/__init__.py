"""Response of a mode: first-harmonic steady states and their branches, time integration for reference.

Here what a test measured, as laws are fitted to it: base drive as a force, swept rows as the steady states of them.

A base that moves with acceleration a drives the motion q relative to it by the modal force p m a, p the participation:
m q'' + C + K q = p m a. Divided by p m that is a mode of mass 1/p under the force a. A record of a and q tells all of
it: the mass 1/p as the slope of a/q against frequency squared, and damping as coefficients over p m. What a response at
a design acceleration needs is free of p; only a damping ratio is not, and takes its uncertainty. Added masses are
shaken with the structure, see :mod:`damping.records.base_drive`.
"""

from dataclasses import dataclass, replace

from damping.effects import find_effect
from damping.forces import shapes_of
from damping.forces.shapes import rescale
from damping.predict.sweep_rate import as_steady
from damping.records.base_drive import Participation, find_participation, shake
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.view import View, take_median


@dataclass(frozen=True)
class Measured:
    """Steady states under a modal force, the mode of them (None where none is given) and what was done, in words.

    ``driven``: the rows under that force as they were swept, which a diagnosis reads: a rate is a cause of its own.
    """

    record: Record
    mode: Mode | None
    driven: Record
    notes: tuple[str, ...] = ()


def prepare(record: Record, mode: Mode | None = None) -> Measured:
    """The record as laws are fitted to it, and the mode with it.

    A mode that its base drives becomes one of mass 1/p under the base's acceleration as force, p from the rows; rows
    whose rate of sweeping is known (a column ``sweep_rate``, or ``rate`` of the rig) or shows in their peaks become
    steady states by :func:`damping.predict.sweep_rate.as_steady`. A steady record driven by a force is returned as it
    is.
    """
    if mode is not None:
        notes = []
        if mode.drive == "base":
            participation = find_participation([(record, mode.mass, 0.0)])
            record, notes = shake(record, mode, participation), [f"base drive: {participation}"]
            mode = replace(count_in(mode, participation), units=mode.units.of_base_drive)
        driven = record
        if mode.rig.rate and "sweep_rate" not in record.frame.columns:
            record = Record(record.frame.assign(sweep_rate=mode.rig.rate), record.source)
        mass, frequency = mode.mass, mode.frequency
    elif "sweep_rate" not in record.frame.columns:
        return Measured(record, None, record)
    else:  # what the rows imply; NaN where they imply none
        implied, notes, driven = View(record, None).implied, [], record
        mass, frequency = take_median(implied["mass"]), take_median(implied["frequency"])
    if not mass > 0.0:
        return Measured(record, mode, driven, tuple(notes))
    steady, swept = as_steady(record, mass, frequency)
    return Measured(steady, mode, driven, (*notes, *swept))


def count_in(mode: Mode, participation: Participation) -> Mode:
    """A base-driven mode as one that a force drives, over p m; the tolerance of its mass is the uncertainty of p."""
    forced = in_unit(mode, participation.value * mode.mass)
    known = replace(mode.tolerance, mass=participation.spread, from_record=participation.known)
    return replace(forced, tolerance=known)


def in_unit(mode: Mode, unit: float) -> Mode:
    """A mode under forces, its mass, its damping and its effects over ``unit``."""
    by = 1.0 / unit
    damping = {name: rescale(shapes_of(name), table, name, by) for name, table in mode.damping.items()}
    effects = {name: rescale(find_effect(name).shapes, table, name, by) for name, table in mode.effects.items()}
    return replace(mode, drive="force", mass=mode.mass * by, damping=damping, effects=effects)
