"""The simulation under test: a mode within its tolerances, several states of it, or a user's own function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from inspect import signature
from pathlib import Path
from traceback import extract_tb
from typing import Any, NamedTuple

import numpy as np

from damping.arrays import RAD_S_PER_HZ, ComplexArray, FloatArray
from damping.effects.contract import Drive, OfDrive, Terms
from damping.effects.course import BETWEEN
from damping.effects.masses import share_of_structure
from damping.effects.terms import complex_stiffness
from damping.errors import InputError
from damping.forces import Force, force_class, list_parameter_names
from damping.gap.rows import PhasorRows
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
            beside=() if self.simulator is None else (self.simulator.beside(deviation[:, first:]),),
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


#: A user's own simulation: force (n,), frequency in Hz (n,) and its parameters by name in, amplitude and phase lag out.
Simulate = Callable[..., tuple[FloatArray, FloatArray]]


@dataclass(frozen=True)
class Simulator:
    """A user's own simulation, as the difference of its complex stiffness from that of the mode that stands for it.

    The function is of the first state without added mass; masses and further states change Z as they change the mode's.

    Z = F exp(i phase)/A is smooth in the parameters even where the resonance is not. Z is evaluated at the nominal
    values and, for differences, one tolerance away in each.
    """

    function: Simulate  #: the simulation
    #: ``values``, ``tolerances``: of its parameters by name, tolerances relative
    values: Mapping[str, float]
    tolerances: Mapping[str, float]
    mode: Mode  #: stands for it where an effect needs a mass, a frequency, a damping
    _known: dict[tuple[bytes, bytes], tuple[ComplexArray, ComplexArray]] = field(default_factory=dict, compare=False)

    @staticmethod
    def read(function: Simulate, mode: Mode) -> Simulator:
        """The simulator of a function whose keyword parameters have defaults (value, relative tolerance).

        InputError: another signature, a value that is not finite or varies as a share of 0, a tolerance below 0.
        """
        if not callable(function):
            given = f"the simulator is of type {type(function).__name__}"
            raise InputError(given, expected="a function of force, frequency")
        try:
            every = signature(function).parameters.values()
        except ValueError:  # some functions of Python itself tell none
            raise InputError("the simulator tells no parameters", expected="a function of force, frequency") from None
        parameters = [p for p in every if p.kind is p.KEYWORD_ONLY]
        if [p.name for p in every][:2] == ["frequency", "force"]:
            raise InputError("the simulator takes frequency before force", expected="force, then frequency")
        if len(every) > len(parameters) + 2:
            raise InputError(
                "the simulator takes more than force and frequency by position",
                expected="keyword-only parameters: def simulate(force, frequency, *, mass=(2.0, 0.05))",
            )
        values, tolerances = {}, {}
        for parameter in parameters:
            pair = parameter.default
            if not (isinstance(pair, tuple) and len(pair) == 2 and all(isinstance(v, int | float) for v in pair)):
                what = f"parameter {parameter.name} of the simulator has no such default"
                raise InputError(what, expected="a default (value, tolerance)")
            value, tolerance = map(float, pair)
            if not np.isfinite(value) or (value == 0.0 and tolerance > 0.0):
                what = f"parameter {parameter.name} of the simulator is {value:g}"
                expected = "a finite number" if value else "another number, or tolerance 0: a share of 0 is 0"
                raise InputError(what, expected=expected)
            if not 0.0 <= tolerance < np.inf:
                what = f"the tolerance of parameter {parameter.name} of the simulator is {tolerance:g}"
                raise InputError(what, expected="a relative standard uncertainty, 0 or more")
            values[parameter.name], tolerances[parameter.name] = value, tolerance
        return Simulator(function, values, tolerances, mode)

    def freed(self, name: str, by: float) -> Simulator:
        """The simulator with another tolerance of one parameter; below 0: slopes are to smaller values."""
        return replace(self, tolerances={**self.tolerances, name: by}, _known={})

    def beside(self, deviation: FloatArray) -> OfDrive:
        """Z less that of the mode, at ln deviations (batch, parameters, 1) of the parameters."""

        def part(drive: Drive) -> ComplexArray:
            nominal, by_parameter = self._linear(drive)
            return np.asarray(nominal + np.sum(deviation * by_parameter, axis=1))

        return part

    def _linear(self, drive: Drive) -> tuple[ComplexArray, ComplexArray]:
        """Z less that of the mode, (n,), and dZ/d ln(parameter), (parameters, n)."""
        key = (drive.F.tobytes(), drive.omega.tobytes())
        if key not in self._known:
            A, Z = self._stiffness(drive, {})
            free = {name: by for name, by in self.tolerances.items() if by != 0.0}
            changed = {
                name: self._stiffness(drive, {name: self.values[name] * np.exp(by)})[1] for name, by in free.items()
            }
            steps = [(changed[name] - Z) / free[name] if name in free else np.zeros_like(Z) for name in self.values]
            mode = Simulation(self.mode).terms(np.zeros((1, 2 + len(self.mode.damping))))
            bare = Drive(drive.F, drive.omega)  # the function knows no state: what a state adds stays
            self._known[key] = Z - complex_stiffness(mode, A, bare)[0][0], np.asarray(steps).reshape(-1, len(Z))
        return self._known[key]

    def _stiffness(self, drive: Drive, changed: Mapping[str, float]) -> tuple[FloatArray, ComplexArray]:
        """Amplitude and Z of the simulation with some parameters changed; errors as of `answer`."""
        A, phase = self.answer(drive.F, drive.omega / RAD_S_PER_HZ, changed)
        return A, np.asarray(drive.F * np.exp(1j * phase) / A)

    def answer(
        self, force: FloatArray, frequency: FloatArray, changed: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Amplitude and phase of the simulation with some parameters changed, at forces and frequencies in Hz (n,).

        InputError: the function fails, or does not return an amplitude and a phase for every row.
        """
        expected = "(amplitude, phase), one number each per row"
        moved = "".join(f" with {name} = {value:.6g}" for name, value in changed.items())
        try:  # copies: a function may work in place
            answer = self.function(force.copy(), frequency.copy(), **{**self.values, **changed})
            parts = [_as_array(part) for part in answer] if isinstance(answer, tuple) else []
        except (Exception, SystemExit) as error:
            *_, at = extract_tb(error.__traceback__)
            where = "" if at.filename == __file__ else f" in line {at.lineno} of {Path(at.filename).name}"
            raise InputError(f"the simulator{moved} ends with {error!r}{where}", expected=expected) from error
        if len(parts) != 2:
            count = f" of {len(answer)}" if isinstance(answer, tuple) else ""
            raise InputError(f"the simulator{moved} returns a {type(answer).__name__}{count}", expected=expected)
        for name, part in zip(("amplitude", "phase"), parts, strict=True):
            returned = f"the {name} that the simulator{moved} returns"
            if part.dtype.kind not in "iuf" or part.shape != force.shape:
                given = f"is of type {part.dtype} and shape {part.shape}, for {force.size} rows"
                raise InputError(f"{returned} {given}", expected=expected)
            if len(bad := np.flatnonzero(~(np.isfinite(part) & ((part > 0) | (name == "phase"))))):
                row = f"at force {force[bad[0]]:.4g} and {frequency[bad[0]]:.5g} Hz"
                raise InputError(f"{returned} is {part[bad[0]]:g} {row}", expected=f"{expected}; amplitudes > 0")
        A, phase = (part.astype(np.float64) for part in parts)
        return A, phase


def _as_array(returned: object) -> np.ndarray:
    """What a simulator returns as an array; what a mask hides is NaN, so that it is no answer."""
    masked = np.ma.is_masked(returned)
    return np.ma.filled(np.ma.asarray(returned, np.float64), np.nan) if masked else np.asarray(returned)
