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


@dataclass(frozen=True)
class Scales:
    """Characteristic sizes of the problem, from which every prior is set."""

    A_low: float  #: 10 % quantile of the measured amplitudes
    A_high: float  #: largest of them
    omega_n: float  #: of the simulation, rad/s
    M: float  #: its mass
    viscous: float  #: its viscous coefficient, 0 where it has none
    bandwidth: float  #: its damping ratio at ``A_high``: half the half-power width over ``omega_n``
    reach: float  #: largest |omega/omega_n - 1| measured
    frequency: float  #: tolerance of the simulation's frequency
    damping: float  #: that of its damping
    sweeps: int = 1  #: of the record
    states: int = 1  #: of the record
    simulated: Mapping[str, Mapping[str, float]] = field(default_factory=dict)  #: parameters of its forces, by name
    rate: float = 0.0  #: largest known |d omega/dt|, rad/s^2; 0 where none is known

    @property
    def stiffness(self) -> float:
        """K = M omega_n^2."""
        return self.M * self.omega_n**2

    @property
    def loss(self) -> float:
        """C/A of the simulation at the largest amplitude: its damping as a loss stiffness."""
        return 2.0 * self.bandwidth * self.stiffness


class Plane(NamedTuple):
    """A second principal plane: ``weight`` t = tan^2(theta), ``ratio`` of its frequency and ``damping`` to the first's.

    ``in_both``: all forces act in this plane too, on its motion; else the simulation's viscous damping only (3.1.28).
    """

    weight: Floats
    ratio: Floats
    in_both: bool
    damping: Floats = 1.0


class Drive(NamedTuple):
    """Excitation and state of the structure at each row, (n,) each.

    ``F``: force. ``omega``: rad/s. ``mass``: factor on M. ``resonant``: row at phase resonance, where the force
    balances the damping alone. ``time``: of the row, -1/2 to 1/2 over the record. ``sweep``: its number, from 1.
    ``up``: 1 where the frequency rises from row to row in the order measured, else -1. ``rate``: known d omega/dt,
    rad/s^2. ``added``: known mass added to M at the same stiffness. ``state``: number, from 0. ``ratio``, ``own``:
    frequency and simulated damping of the state over those of the first. ``shaken``: mass of the structure, without
    ``added``, on which a base acceleration acts; 0 where a force drives.
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


OfDrive = Callable[[Drive], Any]  #: a change of a row's prediction as a function of its `Drive`


def add_parts(parts: tuple[OfDrive, ...], drive: Drive) -> Any:
    """The sum of the changes; 0 for none."""
    return sum((part(drive) for part in parts), start=0.0)


#: The parameters of a model file from strength and shapes, numbers or arrays.
Report = Callable[..., dict[str, Floats]]
#: Static characteristic: ln amplitude in; ln of a reading, or of the share of a force, and its slope out.
Instrument = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


class Reading(NamedTuple):
    """Readings of a nonlinear instrument; ``unread`` is the inverse of ``read``, kept finite.

    ``third``: amplitude of sin 3 theta in its reading of A sin theta, from ln A.
    """

    read: Instrument
    unread: Instrument
    third: Callable[[FloatArray], FloatArray]


class Terms(NamedTuple):
    """The parts of a prediction; numbers, or arrays that broadcast with the rows (batch, n).

    Attributes:
        M: mass. omega_n: rad/s. forces: damping and restoring forces beside the linear spring; the first ``simulated``
            of them are those of the simulation. plane: the second principal plane, or None. compliance: the parts of R,
            displacement per force. gain: ln of the reading's factor. lag: rad, added to the phase. received: ln of
            actual over recorded force. limited: the same by ln A, with its slope. detuned, weighed, damped, stated: ln
            of the factors on omega_n, M, all damping, and the simulated damping. offset: ln of the complex factor of
            the reading. readings: nonlinear instruments. beside: the parts added to Z. moving: d omega/dt beyond the
            known rate, rad/s^2. Of a moving frequency are law: power of omega/omega_n in the known rate; ringing:
            reading, see `damping.effects.moving.swept_receptance`; begun: start, 0 long before the first row of each
            sweep, 1 at it from a dwell; held: force between rows, 0 changing evenly, 1 that of the row reached;
            averaging: of a detector, its time constant, s, and whether it averages amplitudes alone.
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
    limited: tuple[Instrument, ...] = ()
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
    held: Floats = 0.0
    averaging: tuple[Floats, bool] | None = None

    def plus(self, **parts: Any) -> Terms:
        """The terms with one more part in each field named: a force, a change by the drive, or an instrument."""
        extended: dict[str, Any] = {name: (*getattr(self, name), part) for name, part in parts.items()}
        return self._replace(**extended)

    def tuned(self, drive: Drive) -> Terms:
        """The terms with omega_n and M of each row: those of its state, with drift."""
        if not self.detuned and not self.weighed and not differs(drive.ratio, 1.0):
            return self
        omega_n = self.omega_n * drive.ratio * np.exp(add_parts(self.detuned, drive))
        return self._replace(omega_n=omega_n, M=self.M * np.exp(add_parts(self.weighed, drive)), detuned=(), weighed=())

    @property
    def viscous(self) -> tuple[Force, ...]:
        """The simulation's viscous damping; all its damping where none is viscous."""
        simulated = self.forces[: self.simulated]
        return tuple(force for force in simulated if force.viscous) or simulated

    @property
    def linear(self) -> bool:
        """Whether Z does not depend on amplitude."""
        return all(force.linear for force in self.forces)


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
        """A variable with 95 % prior probability between ``low`` and ``high``."""
        return FormVariable(exp(0.5 * (log(low) + log(high))), max(0.25 * log(high / low), 0.05), starts)


@dataclass(frozen=True)
class Form:
    """One parametric form of an effect; an effect has one or several, equally probable.

    Attributes:
        effect: its name. report: see `Report`. origin: arguments by which `damping.effects.list_forms` makes it again.
        change: (terms, strength, shapes...) -> terms; the strength is positive; values are arrays (batch, 1).
        natural: characteristic strength in the units of the problem, the scale of difference quotients.
        shapes: shape parameters. largest: strength beyond which the effect makes no sense.
        replaces: variable of the simulation that the effect replaces, if any.
        sizes: further strengths from which fits start where the gap is large.
        mirror: key shared with the form whose small strengths change the terms in the opposite sense, if any.
        twin: another form that differs from this one only where stiffness or damping depends on amplitude, if any.
        whole: whether small strengths say nothing of large ones, as where it replaces a simulated force.
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
#: Data without which an effect cannot be identified: measured phases; rows beside resonance; measured third harmonics;
#: two masses; either of the last two.
Need = Literal["", "phase", "sweep", "third", "masses", "beyond"]


@dataclass(frozen=True)
class Effect:
    """One entry of the catalogue.

    Attributes:
        name: as in files. kind: what it changes. sentence: its statement about structure or test, for the report.
        forms: its forms for a problem, or none.
        simulate: the terms with the effect given by a model file's table, completed by the defaults of its shapes.
        shapes: the parameters of its table in a model file.
        force: the force that the table adds, if any; such an effect can be integrated in time too.
        damping: name of the damping force that stands for it in a corrected model; empty where it is no such force.
        corrects: ``frequency``, or the damping force, whose simulated value its ``relative`` changes; empty for others.
        need: data without which it cannot be identified. denies: effects that are not tried beside it. prior: odds of
            being the cause relative to other effects. passing: whether it is of one test only.
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
        """The change of terms by strength and shapes, which ``report`` turns into a table of a model file."""
        defaults = {shape.name: shape.default for shape in self.shapes if shape.default is not None}
        return lambda terms, *values: self.simulate(terms, defaults | report(*values))

    def form(self, report: Report, natural: float, **rest: Any) -> Form:
        """The form of that change; ``rest``: further fields of `Form`."""
        return Form(self.name, self.changed_by(report), report, natural, **rest)

    def either_sign(
        self, report: Report, mirror: str | None = None, change: Callable[..., Terms] | None = None, **rest: Any
    ) -> tuple[Form, Form]:
        """The two forms of a strength with a sign, which ``report`` takes signed, as does ``change`` where given.

        ``mirror``: key of the two among the effect's forms, by default its name; empty where they do not mirror each
        other. ``rest``: further fields of `Form`.
        """
        options: dict[str, Any] = {"natural": 0.1, "mirror": self.name if mirror is None else mirror} | rest
        signed = change or self.changed_by(report)

        def side(sign: float) -> Form:
            return Form(
                self.name,
                lambda terms, strength, *shapes: signed(terms, sign * strength, *shapes),
                lambda strength, *shapes: report(sign * strength, *shapes),
                **options,
            )

        return side(1.0), side(-1.0)

    def complete(self, table: Mapping[str, float]) -> dict[str, float]:
        """The table of a model file completed by defaults; InputError: an unknown or missing key."""
        return completed(self.shapes, table, f"[effects.{self.name}]")
