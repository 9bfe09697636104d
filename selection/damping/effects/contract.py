"""What an effect is: a change of the terms of a prediction by one strength and a few shape parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from math import exp, log
from typing import Any, Literal, NamedTuple

import numpy as np

from damping.arrays import BoolArray, FloatArray, Floats, differs
from damping.forces.contract import Force
from damping.forces.shapes import Shape, completed


class Plane(NamedTuple):
    """A second principal plane: ``weight`` t = tan^2(theta), ``ratio`` of its frequency and ``damping`` to the first's.

    ``in_both``: all forces act in it too, on its own motion; else the simulation's viscous damping only (3.1.28).
    """

    weight: Floats
    ratio: Floats
    in_both: bool
    damping: Floats = 1.0


class Drive(NamedTuple):
    """What the rig does at each row, (n,) each: force, frequency in rad/s, and the factor of each row on M.

    ``resonant``: rows at phase resonance, wherever that is: the force balances the damping alone. ``time``: when the
    row was taken, -1/2 to 1/2 over the record; ``sweep``: number of its sweep, from 1. ``up``: 1 where the frequency
    rises from row to row in the order taken, else -1. ``rate``: known d omega/dt, rad/s^2. ``added``: known mass beside
    M; the stiffness stays. ``state``: of the structure, from 0; ``ratio``, ``own``: its frequency, and its simulated
    damping, over those of the first. ``shaken``: mass of the structure, without what is added, that a base's
    acceleration acts on; 0 where a force drives.
    """

    F: FloatArray
    omega: FloatArray
    mass: Floats = 1.0
    resonant: bool | BoolArray = False
    time: Floats = 0.0
    sweep: Floats = 1.0
    up: Floats = 1.0
    rate: Floats = 0.0
    added: Floats = 0.0
    state: Floats = 0.0
    ratio: Floats = 1.0
    own: Floats = 1.0
    shaken: Floats = 0.0


#: A change of a row's prediction that follows from what the rig does there.
OfDrive = Callable[[Drive], Any]


def add_parts(parts: tuple[OfDrive, ...], drive: Drive) -> Any:
    """The sum of such changes; 0 of none."""
    return sum((part(drive) for part in parts), start=0.0)


#: The parameters of a model file from strength and shapes, numbers or arrays.
Report = Callable[..., dict[str, Floats]]
#: What something makes of amplitudes: ln in, ln and its slope out.
Instrument = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


class Reading(NamedTuple):
    """What an instrument reads of amplitudes; ``unread`` is the inverse, kept finite.

    ``third``: amplitude of sin 3 theta in what it makes of A sin theta, from ln A.
    """

    read: Instrument
    unread: Instrument
    third: Callable[[FloatArray], FloatArray]


class Terms(NamedTuple):
    """The parts of a prediction; numbers, or arrays that broadcast with the rows (batch, n).

    Attributes:
        M: mass. omega_n: rad/s. forces: damping and restoring forces beside the linear spring; the first
            ``simulated`` of them are those of the simulation. plane: the second principal plane, or None.
        compliance: the parts of R, displacement per force. gain: ln of the reading's factor. lag: rad, added to the
            phase. received: ln of the part of the recorded force that arrives. detuned, weighed, damped, stated: ln of
            the factor on omega_n, M, all damping, and the simulation's. offset: ln of the factor of the reading,
            complex. readings: instruments that are not linear. beside: the parts added to Z. moving: d omega/dt beside
            the known one, rad/s^2. law: power of omega/omega_n with which the known one goes. ringing: how what rings
            is read, see `damping.effects.moving.hurried`. begun: how a moving frequency began, 0 long before the first
            row of each sweep, 1 there, where it was held.
    """

    M: Floats
    omega_n: Floats
    forces: tuple[Force, ...] = ()
    simulated: int = 0
    plane: Plane | None = None
    compliance: tuple[OfDrive, ...] = ()
    gain: Floats = 0.0
    lag: Floats = 0.0
    received: tuple[OfDrive, ...] = ()
    detuned: tuple[OfDrive, ...] = ()
    weighed: tuple[OfDrive, ...] = ()
    damped: tuple[OfDrive, ...] = ()
    stated: tuple[OfDrive, ...] = ()
    offset: tuple[OfDrive, ...] = ()
    readings: tuple[Reading, ...] = ()
    beside: tuple[OfDrive, ...] = ()
    moving: tuple[OfDrive, ...] = ()
    law: Floats = 0.0
    ringing: Floats = 0.0
    begun: Floats = 0.0

    def plus(self, **parts: Any) -> Terms:
        """The same with one more part of each field named: a force, what follows from the drive, or an instrument."""
        longer: dict[str, Any] = {name: (*getattr(self, name), part) for name, part in parts.items()}
        return self._replace(**longer)

    def tuned(self, drive: Drive) -> Terms:
        """The terms with omega_n and M as they are at each row: of its state, and drifting."""
        if not self.detuned and not self.weighed and not differs(drive.ratio, 1.0):
            return self
        omega_n = self.omega_n * drive.ratio * np.exp(add_parts(self.detuned, drive))
        return self._replace(omega_n=omega_n, M=self.M * np.exp(add_parts(self.weighed, drive)), detuned=(), weighed=())

    @property
    def viscous(self) -> tuple[Force, ...]:
        """The simulation's viscous damping; all its damping where none is viscous."""
        own = self.forces[: self.simulated]
        return tuple(force for force in own if force.viscous) or own

    @property
    def linear(self) -> bool:
        """Whether Z does not depend on amplitude."""
        return all(force.linear for force in self.forces)


@dataclass(frozen=True)
class Scales:
    """What the problem itself says about sizes: the source of every prior.

    Attributes:
        A_low, A_high: 10 % point and largest of the measured amplitudes.
        omega_n, M: of the simulation. viscous: its viscous coefficient, 0 where it has none.
        bandwidth: damping ratio of the simulation at A_high: half the half-power width over omega_n.
        reach: largest |omega/omega_n - 1| measured. sweeps, states: of the record.
        frequency, damping: the simulation's tolerances. simulated: parameters of its damping forces, by name.
    """

    A_low: float
    A_high: float
    omega_n: float
    M: float
    viscous: float
    bandwidth: float
    reach: float
    frequency: float
    damping: float
    sweeps: int = 1
    states: int = 1
    simulated: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def stiffness(self) -> float:
        """K = M omega_n^2."""
        return self.M * self.omega_n**2

    @property
    def loss(self) -> float:
        """C/A of the simulation at the largest amplitude: the stiffness that its damping is worth there."""
        return 2.0 * self.bandwidth * self.stiffness


@dataclass(frozen=True)
class FormVariable:
    """A shape parameter of a form: ln(value) ~ N(ln(centre), width^2), or value ~ N(centre, width^2) if ``linear``.

    ``starts`` are in units of width.
    """

    centre: float
    width: float
    starts: tuple[float, ...] = (-1.0, 0.0, 1.0)
    linear: bool = False

    def value(self, x: Floats) -> Floats:
        """The value at the standard normal variable x."""
        step = self.width * np.asarray(x)
        return self.centre + step if self.linear else self.centre * np.exp(step)

    @staticmethod
    def between(low: float, high: float, starts: tuple[float, ...] = (-1.0, 0.0, 1.0)) -> FormVariable:
        """A variable whose central 95 % lie between ``low`` and ``high``."""
        return FormVariable(exp(0.5 * (log(low) + log(high))), max(0.25 * log(high / low), 0.05), starts)


@dataclass(frozen=True)
class Form:
    """One way an effect may look; an effect has one or several, equally probable.

    Attributes:
        effect: its name. report: see `Report`. origin: what `damping.effects.list_forms` makes it of.
        change: (terms, strength, shapes...) -> terms; the strength is positive; values are arrays (batch, 1).
        natural: a strength of the order of one, in the units of the problem: where difference quotients are taken.
        shapes: shape parameters. largest: strength beyond which the effect makes no sense.
        replaces: variable of the simulation that the effect takes the place of, if any.
        sizes: strengths from which fits are started too where the gap is large.
        mirror: name that it shares with the form whose small strengths change the terms the other way, if any.
        twin: another form that differs from this one only where stiffness or damping depends on amplitude, if any.
        whole: whether it takes the place of something that is simulated: no small strength leaves the simulation.
    """

    effect: str
    change: Callable[..., Terms]
    report: Report
    natural: float = 1.0
    shapes: tuple[FormVariable, ...] = ()
    largest: float = np.inf
    replaces: str = ""
    sizes: tuple[float, ...] = ()
    mirror: str = ""
    twin: Form | None = None
    whole: bool = False
    origin: tuple[Any, ...] = field(default=(), compare=False, repr=False)


Kind = Literal["parameter", "force", "structure", "instrument"]
#: What an effect cannot be told without: measured phases; rows beside resonance; measured third harmonics; two masses;
#: either of the last two.
Need = Literal["", "phase", "sweep", "third", "masses", "beyond"]


@dataclass(frozen=True)
class Effect:
    """One entry of the catalogue.

    Attributes:
        name: as in files. kind: what it changes. sentence: what it says of structure or test, for the report.
        forms: its forms for a problem, or none.
        simulate: the terms with the effect as a model file's table gives it, with the defaults of its shapes.
        shapes: the parameters of its table in a model file.
        force: the force that such a table adds, where it adds one: it can then be integrated in time too.
        damping: name of the damping force that a corrected model has in its place; empty where it is none.
        corrects: ``frequency``, or the damping force, whose simulated value its ``relative`` changes; empty for others.
        need: what it cannot be told without. denies: effects that are not tried beside it. prior: how much more
            often than others it is the cause. passing: whether it is of one test, and no further test has it.
    """

    name: str
    kind: Kind
    sentence: str
    forms: Callable[[Scales], tuple[Form, ...]]
    simulate: Callable[[Terms, Mapping[str, Any]], Terms]
    shapes: tuple[Shape, ...] = ()
    force: Callable[[Mapping[str, Any]], Force] | None = None
    damping: str = ""
    corrects: str = ""
    need: Need = ""
    denies: frozenset[str] = frozenset()
    prior: float = 1.0
    passing: bool = False

    def changed_by(self, report: Report) -> Callable[..., Terms]:
        """The change of terms by strength and shapes of which ``report`` makes a table as in a model file."""
        defaults = {shape.name: shape.default for shape in self.shapes if shape.default is not None}
        return lambda terms, *values: self.simulate(terms, defaults | report(*values))

    def form(self, report: Report, natural: float, **rest: Any) -> Form:
        """The form of such a change; ``rest``: of a `Form`."""
        return Form(self.name, self.changed_by(report), report, natural, **rest)

    def either_sign(
        self, report: Report, mirror: str | None = None, change: Callable[..., Terms] | None = None, **rest: Any
    ) -> tuple[Form, Form]:
        """The two forms of a strength that has a sign: ``report`` takes it so, and ``change`` where it is not its own.

        ``mirror``: key of the two among the effect's forms, by default its name; empty where neither mirrors the
        other. ``rest``: of a `Form`.
        """
        options: dict[str, Any] = {"natural": 0.1, "mirror": self.name if mirror is None else mirror} | rest
        own = change or self.changed_by(report)

        def side(sign: float) -> Form:
            return Form(
                self.name,
                lambda terms, strength, *shapes: own(terms, sign * strength, *shapes),
                lambda strength, *shapes: report(sign * strength, *shapes),
                **options,
            )

        return side(1.0), side(-1.0)

    def complete(self, table: Mapping[str, float]) -> dict[str, float]:
        """The table of a model file with defaults where it names none; InputError: an unknown or missing key."""
        return completed(self.shapes, table, f"[effects.{self.name}]")
