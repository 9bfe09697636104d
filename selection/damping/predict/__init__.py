"""Response of a mode: first-harmonic steady states and their branches, time integration for reference.

This module prepares measured rows for fitting: base excitation becomes a force, and swept rows become steady states.

A base acceleration a drives the relative motion q by the modal force p m a, with participation p: m q'' + C + K q =
p m a. Divided by p m, this is a mode of mass 1/p under the force a, with damping coefficients over p m. A record of a
and q determines it: 1/p is the slope of a/q against frequency squared. The response at a design acceleration does not
depend on p; the damping ratio does, and includes its uncertainty. The base drives added masses too, see
:mod:`damping.records.base_drive`.
"""

from dataclasses import dataclass, replace

import numpy as np

from damping.effects import find_effect
from damping.forces import shapes_of
from damping.forces.shapes import rescale
from damping.predict.sweep_rate import as_steady
from damping.records.base_drive import Participation, find_participation, shake
from damping.records.mode import Mode
from damping.records.record import Record
from damping.records.rows import list_rates
from damping.records.view import View, take_median


@dataclass(frozen=True)
class Measured:
    """Steady states under a modal force."""

    record: Record
    mode: Mode | None  #: None if none is given
    driven: Record  #: the rows under that force as swept, for the diagnosis, in which the sweep rate is a cause itself
    notes: tuple[str, ...] = ()  #: on what was changed


def prepare(record: Record, mode: Mode | None = None) -> Measured:
    """Prepare a record and its mode for fitting.

    A base-driven mode becomes one of mass 1/p under the base acceleration as force, with p from the rows. Rows with a
    known sweep rate (a column ``sweep_rate``, or ``rate`` of the rig), or one that shows in their peaks, become steady
    states by :func:`damping.predict.sweep_rate.as_steady`. A steady record driven by a force is unchanged.
    """
    if mode is not None:
        notes = []
        if mode.drive == "base":
            participation = find_participation([(record, mode.mass, 0.0)])
            record, notes = shake(record, mode, participation), [f"base drive: {participation}"]
            mode = replace(count_in(mode, participation), units=mode.units.of_base_drive)
        driven = record
        if mode.rig.rate and np.isnan(record.column("sweep_rate", np.nan)).any():
            record = Record(record.frame.assign(sweep_rate=list_rates(record, mode.rig.rate)), record.source)
        mass, frequency = mode.mass, mode.frequency
    elif "sweep_rate" not in record.frame.columns:
        return Measured(record, None, record)
    else:  # implied by the rows, NaN if they imply none
        implied, notes, driven = View(record, None).implied, [], record
        mass, frequency = take_median(implied["mass"]), take_median(implied["frequency"])
    if not mass > 0.0:
        return Measured(record, mode, driven, tuple(notes))
    steady, swept = as_steady(record, mass, frequency)
    return Measured(steady, mode, driven, (*notes, *swept))


def count_in(mode: Mode, participation: Participation) -> Mode:
    """A base-driven mode as a force-driven one, divided by p m; the tolerance of its mass is the uncertainty of p."""
    forced = in_unit(mode, participation.value * mode.mass)
    known = replace(mode.tolerance, mass=participation.spread, from_record=participation.known)
    return replace(forced, tolerance=known)


def in_unit(mode: Mode, unit: float) -> Mode:
    """A force-driven mode with mass, damping and effects divided by ``unit``."""
    return replace(rescale_mode(mode, 1.0 / unit), drive="force")


def rescale_mode(mode: Mode, force: float, length: float = 1.0) -> Mode:
    """The numbers of a mode in new units, of which ``force`` make an old unit of force and ``length`` of length."""
    damping = {name: rescale(shapes_of(name), of, name, force, length) for name, of in mode.damping.items()}
    effects = {name: rescale(find_effect(name).shapes, of, name, force, length) for name, of in mode.effects.items()}
    return replace(mode, mass=mode.mass * (force * length**-1.0), damping=damping, effects=effects)
