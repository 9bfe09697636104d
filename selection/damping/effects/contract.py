"""What an effect is: a change of the terms of a prediction by one strength and a few shape parameters."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import exp, log
from typing import Literal

import numpy as np

from damping.arrays import Floats
from damping.effects.terms import Terms
from damping.forces.contract import Force
from damping.forces.shapes import Shape, completed


@dataclass(frozen=True)
class Scales:
    """What the problem itself says about sizes: the source of every prior.

    Attributes:
        A_low, A_high: 10 % point and largest of the measured amplitudes.
        omega_n, M: of the simulation. viscous: its viscous coefficient, 0 where it has none.
        bandwidth: damping ratio of the simulation at A_high: half the half-power width over omega_n.
        reach: largest |omega/omega_n - 1| measured.
        frequency, damping: the simulation's tolerances. sweeps: of the record.
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
        if self.linear:
            return self.centre + self.width * np.asarray(x)
        return self.centre * np.exp(self.width * np.asarray(x))

    @staticmethod
    def between(low: float, high: float, starts: tuple[float, ...] = (-1.0, 0.0, 1.0)) -> FormVariable:
        """A variable whose central 95 % lie between ``low`` and ``high``."""
        return FormVariable(exp(0.5 * (log(low) + log(high))), max(0.25 * log(high / low), 0.05), starts)


@dataclass(frozen=True)
class Form:
    """One way an effect may look; an effect has one or several, equally probable.

    Attributes:
        effect: name of the effect.
        change: (terms, strength, shapes...) -> terms; the strength is positive; values are arrays (batch, 1).
        report: the parameters of a model file from strength and shapes (numbers or arrays).
        natural: a strength of the order of one, in the units of the problem: where difference quotients are taken.
        shapes: shape parameters. largest: strength beyond which the effect makes no sense.
        label: which form it is, for people; empty where there is only one.
        replaces: variable of the simulation that the effect takes the place of, if any.
        sizes: strengths from which fits are started too where the gap is large.
        twin: another form that differs from this one only where stiffness or damping depends on amplitude, if any.
    """

    effect: str
    change: Callable[..., Terms]
    report: Callable[..., dict[str, Floats]]
    natural: float = 1.0
    shapes: tuple[FormVariable, ...] = ()
    largest: float = np.inf
    label: str = ""
    replaces: str = ""
    sizes: tuple[float, ...] = ()
    twin: Form | None = None


Kind = Literal["parameter", "force", "structure", "instrument"]
#: What an effect cannot be told without: measured phases; rows beside resonance.
Need = Literal["", "phase", "sweep"]


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
            often than others it is the cause.
    """

    name: str
    kind: Kind
    sentence: str
    forms: Callable[[Scales], tuple[Form, ...]]
    simulate: Callable[[Terms, Mapping[str, float]], Terms]
    shapes: tuple[Shape, ...] = ()
    force: Callable[[Mapping[str, float]], Force] | None = None
    damping: str = ""
    corrects: str = ""
    need: Need = ""
    denies: frozenset[str] = frozenset()
    prior: float = 1.0

    def complete(self, table: Mapping[str, float]) -> dict[str, float]:
        """The table of a model file with the defaults of what it does not name.

        Raises:
            InputError: a key that is unknown (the nearest known one is named) or missing.
        """
        return completed(self.shapes, table, f"[effects.{self.name}]")
