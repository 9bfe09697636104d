"""The simulation under test: a mode within its tolerances, several states of it, or a user's own function beside it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from damping.arrays import FloatArray
from damping.effects.contract import Drive, OfDrive, Terms
from damping.effects.course import BETWEEN
from damping.effects.masses import share_of_structure
from damping.forces import Force, force_class, list_parameter_names
from damping.gap.rows import PhasorRows
from damping.gap.simulator import Simulator
from damping.records.base_drive import UNKNOWN_SPREAD
from damping.records.mode import Mode

#: Largest deviation, in tolerances; a larger one is an effect (natural-frequency, viscous-coefficient).
MOST_TOLERANCES = 3.0
_SHARPNESS = 8  #: power with which `within_tolerance` bends from x to the bound: at 1 tolerance by 2e-5
NO_SCATTER = 1e-9  #: scatter or tolerance of zero, safe to divide by
#: Least tolerances of a simulation whose values were taken from the record itself: they are no prior knowledge.
NO_KNOWLEDGE = {"frequency": 0.03, "mass": 0.3, "damping": 0.7}


def within_tolerance(x: FloatArray) -> FloatArray:
    """x/(1 + |x/3|^8)^(1/8): x where it is small, and never beyond +-``MOST_TOLERANCES``."""
    return np.asarray(x / (1.0 + np.abs(x / MOST_TOLERANCES) ** _SHARPNESS) ** (1.0 / _SHARPNESS))


class OfState(NamedTuple):
    """A ``quantity`` (frequency, mass, damping) of one ``state``, from 0; ``apart``: |ln| of its ratio to the first."""

    quantity: str
    state: int
    apart: float


def list_of_states(rows: PhasorRows) -> tuple[OfState, ...]:
    """Quantities of each further state that are uncertain by themselves, besides those that all states share.

    Frequency and mass, where the stiffness differs too, and damping. Mass and damping by no more than the files differ:
    equal values state that nothing has changed.
    """
    values = []
    for state in np.unique(rows.state[rows.state > 0.0]).astype(int):
        ratio, damping, mass = (float(getattr(rows, name)[rows.state == state][0]) for name in ("ratio", "own", "mass"))
        values += [OfState("frequency", state, np.inf), OfState("mass", state, abs(np.log(mass)))] * (ratio != 1.0)
        values.append(OfState("damping", state, abs(np.log(damping))))
    return tuple(value for value in values if value.apart > 0.0)


@dataclass(frozen=True)
class Simulation:
    """A mode as terms of standard normal variables x; ln(value/nominal) = tolerance times `within_tolerance` (x).

    The variables are those of ``names``: ``frequency``, ``mass``, the damping forces of the mode by name (their
    leading coefficient; all with the tolerance of ``viscous``, the one stated for damping), the uncertain quantities
    ``of_states``, the participation of each group of base-``shaken`` states (numbers from 0), unknowns of a ``swept``
    record's rates (fields of `Terms`, see `damping.effects.course.BETWEEN`), and the parameters of a simulator.
    """

    mode: Mode
    of_states: tuple[OfState, ...] = ()
    swept: tuple[str, ...] = ()
    simulator: Simulator | None = None
    shaken: tuple[tuple[int, ...], ...] = ()

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the variables."""
        parameters = () if self.simulator is None else tuple(self.simulator.values)
        states = (f"{value.quantity} of state {value.state + 1}" for value in self.of_states)
        shaken = ("participation of state " + "+".join(str(number + 1) for number in group) for group in self.shaken)
        return ("frequency", "mass", *self.mode.damping, *states, *shaken, *self.swept, *parameters)

    @cached_property
    def tolerance(self) -> FloatArray:
        """Standard uncertainty of each variable, relative except for those of ``swept``."""
        stated = self.mode.tolerance
        frequency, mass, damping = stated.frequency, stated.mass, stated.viscous
        if stated.from_record:
            frequency, mass, damping = map(max, (frequency, mass, damping), NO_KNOWLEDGE.values())
        parameters = [] if self.simulator is None else list(self.simulator.tolerances.values())
        if parameters:  # the simulator's parameters carry all its uncertainty
            frequency, mass, damping = NO_SCATTER, NO_SCATTER, NO_SCATTER
        stated_of = {"frequency": frequency, "mass": mass, "damping": damping}
        states = [min(stated_of[value.quantity], value.apart) for value in self.of_states]
        swept = [BETWEEN.width] * len(self.swept)
        shaken = [UNKNOWN_SPREAD] * len(self.shaken)  # it was estimated from these rows
        return np.array([frequency, mass, *[damping] * len(self.mode.damping), *states, *shaken, *swept, *parameters])

    @cached_property
    def _damping(self) -> list[tuple[Callable[..., Force], str, Mapping[str, float]]]:
        """Damping forces of the mode: class, the parameter that each is proportional to, all parameters."""
        table = self.mode.damping
        return [(force_class(name), list_parameter_names(name)[0], table[name]) for name in table]

    @cached_property
    def _bare(self) -> Terms:
        """The terms of the mode as stated, for which a user's function stands."""
        return Simulation(self.mode).terms(np.zeros((1, 2 + len(self.mode.damping))))

    def terms(self, x: FloatArray) -> Terms:
        """The terms at variables x (batch, k), as arrays (batch, 1)."""
        deviation = (within_tolerance(x) * self.tolerance)[..., np.newaxis]
        factor = np.exp(deviation)
        forces = [
            build(**{**parameters, leading: parameters[leading] * factor[:, 2 + number]})
            for number, (build, leading, parameters) in enumerate(self._damping)
        ]
        first = 2 + len(forces)
        of_states: dict[str, tuple[OfDrive, ...]] = {"frequency": (), "mass": (), "damping": ()}
        for k, value in enumerate(self.of_states):
            of_states[value.quantity] += (partial(_deviate, value.state, deviation[:, first + k]),)
        first += len(self.of_states)
        received = tuple(_received(group, deviation[:, first + k]) for k, group in enumerate(self.shaken))
        first += len(self.shaken)
        rates: dict[str, Any] = {name: BETWEEN.centre + deviation[:, first + k] for k, name in enumerate(self.swept)}
        first += len(self.swept)
        return Terms(
            M=self.mode.mass * factor[:, 1],
            omega_n=self.mode.omega_n * factor[:, 0],
            forces=tuple(forces),
            simulated=len(forces),
            received=received,
            detuned=of_states["frequency"],
            weighed=of_states["mass"],
            stated=of_states["damping"],
            beside=() if self.simulator is None else (self.simulator.beside(deviation[:, first:], self._bare),),
            **rates,
        )


def _deviate(state: int, deviation: FloatArray, drive: Drive) -> FloatArray:
    """A ln deviation (batch, 1) in the rows of one state, none in others."""
    return np.asarray(deviation * (drive.state == state))


def _received(states: tuple[int, ...], deviation: FloatArray) -> OfDrive:
    """ln of the force in base-shaken states over that at the estimated participation p; ln deviation of p (batch, 1).

    The base shakes p m of the structure, and all of an added mass.
    """

    def part(drive: Drive) -> FloatArray:
        share = np.where(np.isin(drive.state, states), share_of_structure(drive), 0.0)
        return np.asarray(np.log1p(share * np.expm1(deviation)))

    return part
