"""Declarations of effects: how they are drawn, how they change the truth, and how a fit may vary them.

Effects that the library of the diagnosis names: of the structure (a force, a joint, a spring, a wrong parameter of the
simulation, a further path from drive to sensor, a structure that changes while it is tested) and of the rig. A kind has
the name of its effect in the library; a word after a colon is one of its forms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from scipy.special import gamma

from damping_validation.generator.balance import TrueRows
from damping_validation.generator.laws import Array, Partner, Side, Structure, TrueJoint, TrueLaw
from damping_validation.generator.plan import Bench, Generator, force_unit, log_uniform

Shape: TypeAlias = tuple[float, ...]
Truth: TypeAlias = tuple[Structure, TrueRows]


@dataclass(frozen=True)
class TrueEffect:
    """An effect by name; its size is dimensionless and positive, its shape (signs, places, widths) drawn once."""

    name: str
    size: float
    shape: Shape


@dataclass(frozen=True)
class AppliedEffect:
    """An effect of a size and shape where it acts; the bench gives the scales: A, xi and the nominal values."""

    structure: Structure
    rows: TrueRows
    size: float
    shape: Shape
    bench: Bench

    @property
    def stiffness(self) -> float:
        """2 xi k: the stiffness that moves the resonance by xi."""
        return 2 * self.bench.xi * self.bench.nominal.mass * self.bench.nominal.omega**2

    @property
    def course(self) -> Array:
        """Place in the course of the test, -1/2 at its first row and 1/2 at its last; rows added later lie beyond."""
        first, last = self.bench.rows.time[0], self.bench.rows.time[-1]
        return np.asarray((self.rows.time - first) / (last - first) - 0.5)

    @property
    def admittance(self) -> Array:
        """Velocity a force of the viscous mode over that at resonance: 2 i xi r/(1 - r^2 + 2 i xi r)."""
        r, xi = self.rows.omega / self.structure.omega, self.bench.xi
        return np.asarray(2j * xi * r / (1 - r**2 + 2j * xi * r))

    def force_unit(self, law: str) -> float:
        """Coefficient with which a force loses at A what the viscous damping loses."""
        return force_unit(law, self.bench.nominal.viscous, self.bench.nominal.omega, self.bench.A)

    def add(self, *parts: TrueLaw | TrueJoint | Side | Partner) -> Changes:
        """The structure's forces, joints, other modes and partners with further ones."""
        names = {TrueLaw: "laws", TrueJoint: "joints", Side: "sides", Partner: "partners"}
        changed: dict[str, Any] = {}
        for part in parts:
            name = names[type(part)]
            changed[name] = (*changed.get(name, getattr(self.structure, name)), part)
        return changed


#: New values of fields by name.
Changes: TypeAlias = Mapping[str, Any]
Change: TypeAlias = Callable[[AppliedEffect], Changes]


@dataclass(frozen=True)
class Kind:
    """An effect: shapes drawn, largest size, and what it changes of the structure and of the rows.

    ``free`` are the entries of a shape that a fit may move.
    """

    draw: Callable[[Generator, Bench], Shape]
    most: float | Callable[[Bench], float]
    structure: Change = lambda effect: {}
    rows: Change = lambda effect: {}
    free: tuple[int, ...] = ()

    def largest(self, bench: Bench) -> float:
        """The largest size on a bench."""
        return self.most(bench) if callable(self.most) else self.most


Entry: TypeAlias = Callable[[Generator, Bench], float]  #: how an entry of a shape is drawn


def drawn(*entries: Entry | float) -> Callable[[Generator, Bench], Shape]:
    """A shape of entries drawn in turn; a number stands for itself."""
    return lambda rng, bench: tuple(entry(rng, bench) if callable(entry) else entry for entry in entries)


def uniform(low: float, high: float) -> Entry:
    """A number between two, anywhere."""
    return lambda rng, bench: rng.uniform(low, high)


def spread(low: float, high: float) -> Entry:
    """A number between two, its logarithm anywhere."""
    return lambda rng, bench: log_uniform(rng, low, high)


def chosen(*values: float, p: tuple[float, ...] | None = None) -> Entry:
    """One of some values, of probability ``p`` where they are not alike."""
    return lambda rng, bench: float(rng.choice(values, p=p))


def of_xi(entry: Entry) -> Entry:
    """An entry times xi: in half-power half-widths."""
    return lambda rng, bench: entry(rng, bench) * bench.xi


def signed(entry: Entry) -> Entry:
    """An entry with either sign."""
    return lambda rng, bench: sign(rng, bench) * entry(rng, bench)


sign = chosen(-1.0, 1.0)
EITHER_SIGN = drawn(sign)
NO_SHAPE = drawn()


def limit_friction(bench: Bench) -> float:
    """Friction of half the lowest force, so that the mass keeps moving everywhere."""
    held = sum(coefficient for name, coefficient in bench.base if name == "coulomb")
    unit = force_unit("coulomb", bench.nominal.viscous, bench.nominal.omega, bench.A)
    return (0.5 * float(np.min(bench.rows.force)) - held) / unit


_BEYOND = 3.0  # tolerances by which a wrong parameter is off at size 0


def _damping(law: str, most: float | Callable[[Bench], float] = 6.0) -> Kind:
    """A damping force; size 1 loses at A what the viscous damping loses."""
    return Kind(NO_SHAPE, most, lambda e: e.add(TrueLaw(law, e.size * e.force_unit(law))))


def _misstate(name: str, place: int) -> Change:
    """A wrong parameter of the simulation, by its ``place`` among the tolerances."""

    def change(e: AppliedEffect) -> Changes:
        factor = 1 + e.shape[0] * (_BEYOND + e.size) * e.bench.tolerance[place]
        return {name: getattr(e.bench.nominal, name) * factor}

    return change


def _spring(way: float) -> Kind:
    """A spring; size 1 shifts the resonance at A by xi.

    Shape: which (0 cubic, as mostly, 1 q|q|, 2 cubic beside quadratic), and the size of the quadratic one.
    """

    def change(e: AppliedEffect) -> Changes:
        unit, A = way * e.size * e.stiffness, e.bench.A
        if e.shape[0] == 1:
            return e.add(TrueLaw("odd-square", unit * 3 * np.pi / 8 / A))
        if e.shape[0] == 0:
            return e.add(TrueLaw("cubic", unit * 4 / 3 / A**2))
        k = e.bench.nominal.mass * e.bench.nominal.omega**2
        quadratic = e.shape[1] * float(np.sqrt(abs(unit) * k)) / A
        offset = 10 / 9 * quadratic**2 / k  # the cubic spring to which the quadratic one softens
        return e.add(TrueLaw("cubic", unit * 4 / 3 / A**2 + offset), TrueLaw("quadratic", quadratic))

    return Kind(drawn(chosen(0.0, 1.0, 2.0, p=(0.8, 0.1, 0.1)), uniform(0.05, 0.3)), 5.0, change)


def _power_spring(way: float) -> Kind:
    """A spring sign(q) |q|^p; size 1 shifts the resonance at A by xi: its average over A^p is 2 I(p + 1)/pi."""

    def change(e: AppliedEffect) -> Changes:
        p = e.shape[0]
        average = 2 / np.sqrt(np.pi) * gamma(p / 2 + 1) / gamma(p / 2 + 1.5)  # (2/pi) integral of sin^(p+1) over pi
        unit = e.stiffness / average / e.bench.A ** (p - 1)
        return e.add(TrueLaw("power-spring", way * e.size * unit, p))

    return Kind(drawn(chosen(1.5, 2.5, 4.0, 5.0)), 4.0, change)


def _joint(kind: str) -> Change:
    """A joint of one part; size 1 has the stiffness 2 xi k."""
    return lambda e: e.add(TrueJoint(kind, e.size * e.stiffness, (e.shape[0] * e.bench.A,), (1.0,)))


_PARTS = 12


def _add_iwan(e: AppliedEffect) -> Changes:
    """A joint of 12 Jenkins elements in parallel with limits spread evenly (parallel-series Iwan joint)."""
    limits = (np.arange(_PARTS) + 0.5) / _PARTS
    weights = limits ** e.shape[0] / np.sum(limits ** e.shape[0])
    reach = limits * e.shape[1] * e.bench.A
    return e.add(TrueJoint("jenkins", e.size * e.stiffness, tuple(reach.tolist()), tuple(weights.tolist())))


def _couple_planes(e: AppliedEffect) -> Changes:
    """Two principal planes, the drive at an angle to the first whose squared sine is the size (report, 3.1.24-35)."""
    structure, sine, cosine = e.structure, float(np.sqrt(e.size)), float(np.sqrt(1 - e.size))
    zeta = e.shape[1] * structure.viscous / (2 * structure.mass * structure.omega)
    side = Side(structure.omega * (1 + e.shape[0]), zeta, sine, sine, across=cosine, loaded=True)
    return {"share": cosine, "across": -sine, **e.add(side)}


def _draw_residual_shape(rng: Generator, bench: Bench) -> Shape:
    """Sign; frequency ratio of a lower mode, a higher mode and a rigid-body motion; their weights (some 0)."""
    places = (rng.uniform(0.35, 0.75), rng.uniform(1.35, 2.6), rng.uniform(0.03, 0.12))
    weights = rng.dirichlet([1.0, 1.5, 0.7]) * rng.choice([0.0, 1.0], size=3, p=[0.3, 0.7])
    if weights.sum() == 0.0:
        weights = np.array([0.0, 1.0, 0.0])
    return (sign(rng, bench), *places, *(weights / weights.sum()).tolist())


def _add_modes(e: AppliedEffect) -> Changes:
    """Other modes with .5 % damping; size 1 adds in phase at resonance as much as the resonance itself is high."""
    sides = []
    for place, weight in zip(e.shape[1:4], e.shape[4:7], strict=True):
        if weight:
            seen = e.shape[0] * e.size * weight * abs(place**2 - 1) / (2 * e.bench.xi) * (1 if place > 1 else -1)
            sides.append(Side(e.bench.nominal.omega * place, 0.005, 1.0, seen))
    return e.add(*sides)


def build_mode(e: AppliedEffect, place: float, damping: float, sign: float) -> Side:
    """A close mode with its own mass: size is the main modal mass over its own, as seen between drive and sensor."""
    return Side(e.bench.nominal.omega * (1 + place), e.bench.xi * damping, 1.0, sign * e.size)


FORCE_KINDS = {
    "viscous-coefficient": Kind(EITHER_SIGN, lambda bench: 0.7 / bench.tolerance[2] - _BEYOND, _misstate("viscous", 2)),
    "displacement": _damping("displacement"),
    "velocity-squared": _damping("velocity-squared"),
    "displacement-velocity": _damping("displacement-velocity"),
    "quadratic-displacement": _damping("quadratic-displacement"),
    "coulomb-friction": _damping("coulomb", limit_friction),
    # shape: the amplitude at which it slips, over A
    "slip": Kind(drawn(spread(0.08, 0.6)), 20.0, _joint("jenkins"), free=(0,)),
    # shape: power by which the parts' weights grow with their limits, and the largest limit over A
    "slip:iwan": Kind(drawn(uniform(-0.6, 0.3), spread(0.3, 1.5)), 20.0, _add_iwan),
    "slip:smooth": Kind(drawn(spread(0.08, 0.6)), 20.0, _joint("bouc-wen")),
    "stiffness-hardening": _spring(1.0),
    "stiffness-hardening:power": _power_spring(1.0),
    "stiffness-softening": _spring(-1.0),
    "stiffness-softening:power": _power_spring(-1.0),
    "natural-frequency": Kind(EITHER_SIGN, lambda bench: 5 * bench.xi / bench.tolerance[0], _misstate("omega", 0)),
}
PATH_KINDS = {
    # shape: relative distance of the second plane's frequency, and its viscous damping over the first's
    "planar-coupling": Kind(drawn(signed(of_xi(spread(0.6, 4.5))), uniform(0.8, 1.25)), 0.5, _couple_planes, free=(0,)),
    # shape: relative distance of its frequency, its damping ratio over the main one's, and the sign of its motion
    "second-mode": Kind(
        drawn(signed(of_xi(spread(1.0, 8.0))), spread(0.5, 2.0), sign),
        1.0,
        lambda e: e.add(build_mode(e, *e.shape)),
        free=(0,),
    ),
    "residual-modes": Kind(_draw_residual_shape, 1.0, _add_modes),
    # all of it rigid-body motion or a fixture far below
    "residual-modes:rigid": Kind(drawn(sign, 0.5, 2.0, uniform(0.02, 0.2), 0.0, 0.0, 1.0), 1.0, _add_modes),
}
