"""States of one structure, no two of them one: as driven by forces, whatever drove them, in one unit of mass.

States of one stiffness are the same structure with known masses added. One participation, a free parameter beside the
generalized mass, is that of all of them that a base shakes; a state of another stiffness has its own. Where a base
shakes the first state, all masses and forces are counted over its p m, so that forces are accelerations and
coefficients those of a ranking; else in the unit of its force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.gap.problem import State
from damping.gap.rows import is_same_structure
from damping.gap.simulation import NO_KNOWLEDGE
from damping.predict import count_in, in_unit
from damping.records.base_drive import Participation, drive_by, find_participation, has_masses
from damping.records.mode import Mode
from damping.records.record import Record


@dataclass(frozen=True)
class Driven:
    """States under forces.

    Attributes:
        states: each record with its mode, counted in one ``unit`` of mass (that of the files: 1).
        shaken: mass of the structure, without what is added, that the base's acceleration acts on, in each row of each
            record; 0 where a force drives.
        groups: numbers of the states that share a participation which is a free parameter.
        notes: what was done.
    """

    states: tuple[State, ...]
    shaken: tuple[FloatArray, ...]
    unit: float = 1.0
    groups: tuple[tuple[int, ...], ...] = ()
    notes: tuple[str, ...] = ()


def drive_by_forces(states: Sequence[State], *, simulated: bool = False) -> Driven:
    """The states as driven by forces.

    ``simulated``: whether a user's own function is the simulation, which knows of force and frequency alone.

    Raises:
        AnalysisError: a simulator beside several states or added masses, one of them on a base.
    """
    shaken = [number for number, (_, mode) in enumerate(states) if mode.drive == "base"]
    if not shaken:
        return Driven(tuple(states), tuple(np.zeros(len(record)) for record, _ in states))
    record, mode = states[0]
    if len(states) == 1 and not has_masses(record):  # p and the mass are one: the slope of a/q
        known = find_participation([(record, mode.mass, 0.0)])
        counted, stated = count_in(mode, known), mode.tolerance
        if known.known:  # of the mass alone: what is known of frequency and damping ratio stays knowledge
            viscous, mass = float(np.hypot(stated.viscous, known.spread)), max(stated.mass, NO_KNOWLEDGE["mass"])
            counted = replace(counted, tolerance=replace(stated, viscous=viscous, mass=mass))
        unit = known.value * mode.mass
        return Driven(((record, counted),), (np.ones(len(record)),), unit, notes=(f"base drive: {known}",))
    if simulated:
        what = "a simulator is a function of force and frequency, and knows nothing of masses that a base shakes too"
        raise AnalysisError(f'{record.source}: {what}: give it one state without added mass, or drive = "force"')
    same = [is_same_structure(own, mode) for _, own in states]
    groups = [tuple(k for k in shaken if same[k]), *((k,) for k in shaken if not same[k])]
    groups = [group for group in groups if group]
    found = [_find_shared(states, group, same) for group in groups]
    shared = next((known for known in found if known.known), Participation())
    used = {k: known if known.known else shared for group, known in zip(groups, found, strict=True) for k in group}
    unit = used[0].value * mode.mass if 0 in used else 1.0
    pairs = [_count(state, mode, used.get(k), unit, same=same[k]) for k, state in enumerate(states)]
    notes = [f"base drive{_name(group, states)}: {known}" for group, known in zip(groups, found, strict=True)]
    return Driven(tuple(pair for pair, _ in pairs), tuple(mass for _, mass in pairs), unit, tuple(groups), tuple(notes))


def as_given(mode: Mode, unit: float, groups: Sequence[Sequence[int]]) -> Mode:
    """A mode of the first state in the unit of the files, beside added masses or further states.

    That of one base-driven state without them stays as it is: under the acceleration as force it is complete.
    """
    return replace(in_unit(mode, 1.0 / unit), drive="base") if groups and 0 in groups[0] else mode


def _find_shared(states: Sequence[State], group: Sequence[int], same: Sequence[bool]) -> Participation:
    """The participation of the states of a group."""
    base = states[0][1].mass
    asked = [
        (record, base, mode.mass - base) if same[k] else (record, mode.mass, 0.0)
        for k, (record, mode) in ((k, states[k]) for k in group)
    ]
    return find_participation(asked)


def _count(
    state: State, first: Mode, participation: Participation | None, unit: float, *, same: bool
) -> tuple[State, FloatArray]:
    """A state under forces in a unit of mass, and the mass of its structure that a base shakes, in that unit."""
    record, mode = state
    counted = in_unit(mode, unit) if unit != 1.0 or mode.drive == "base" else mode
    if participation is None:
        return (drive_by(record, np.ones(len(record)), unit), counted), np.zeros(len(record))
    whole = (first if same else mode).mass
    excited = participation.value * whole * record.masses(mode.mass) / mode.mass
    added = record.added_masses + (mode.mass - whole)
    return (drive_by(record, excited + added, unit), counted), excited / unit


def _name(group: Sequence[int], states: Sequence[State]) -> str:
    """Which states are meant, where there are several."""
    if len(states) == 1:
        return ""
    return f" of state{'s' * (len(group) > 1)} {' and '.join(str(number + 1) for number in group)}"


#: Columns of a row that two measurements do not share to the last digit, and the share of rows that do where one is a
#: copy: rounded peaks may agree once.
_MEASURED = ("force", "frequency", "amplitude", "phase")
_COPIED = 0.5


def refuse_copies(states: Sequence[State]) -> None:
    """InputError for states all rows of which are those of another, identical in every column."""
    for (j, (one, _)), (k, (two, _)) in combinations(enumerate(states, 1), 2):
        columns = one.frame.columns.tolist()
        if columns == two.frame.columns.tolist() and _share_rows(one, two, columns) == min(len(one), len(two)):
            message = f"the rows of states {j} and {k} are identical in every column"
            raise InputError(message, file=two.source or None, expected="each measured state once")


def list_repeated(states: Sequence[State]) -> list[str]:
    """States that share rows to the last digit, which no measurement does."""
    cautions = []
    for (j, (one, _)), (k, (two, _)) in combinations(enumerate(states, 1), 2):
        columns = [name for name in _MEASURED if name in one.frame and name in two.frame]
        shared, fewer = _share_rows(one, two, columns), min(len(one), len(two))
        if shared >= _COPIED * fewer:
            which = "the rows" if shared == fewer else f"{shared} rows"
            cautions.append(
                f"{which} of states {j} and {k} are identical, as those of two measurements never are: they count twice"
            )
    return cautions


def _share_rows(one: Record, two: Record, columns: list[str]) -> int:
    """How many rows two records share to the last digit of ``columns``."""
    tables = (record.frame[columns].astype(str) for record in (one, two))  # an empty cell equals an empty cell
    first, second = (set(table.itertuples(index=False, name=None)) for table in tables)
    return len(first & second)
