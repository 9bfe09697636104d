"""States of one structure as driven by forces in one unit of mass; refusal of copies and other units; unused channels.

States of one stiffness are the same structure with known masses added. Those that a base shakes share one participation
p, a free parameter beside the generalized mass m; a state of another stiffness has its own. If a base shakes the first
state, all masses and forces are divided by its p m: forces are then accelerations, and coefficients those of a ranking.
Otherwise masses are in the unit of its force.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.gap.problem import State
from damping.gap.rows import FURTHER_CHANNELS, is_same_structure
from damping.gap.simulation import NO_KNOWLEDGE
from damping.predict import count_in, in_unit
from damping.records.base_drive import Participation, drive_by, find_participation, has_masses
from damping.records.mode import Mode
from damping.records.record import Record


@dataclass(frozen=True)
class Driven:
    """States under force excitation."""

    states: tuple[State, ...]  #: each record with its mode, in one ``unit`` of mass (that of the files: 1)
    #: mass of the structure without added masses on which the base acceleration acts, for each row of each record; 0
    #: where a force drives
    shaken: tuple[FloatArray, ...]
    unit: float = 1.0
    #: numbers of the states that share a participation which is a free parameter
    groups: tuple[tuple[int, ...], ...] = ()
    notes: tuple[str, ...] = ()  #: participations used, in words


def drive_by_forces(states: Sequence[State], *, simulated: bool = False) -> Driven:
    """The states converted to force excitation.

    ``simulated``: whether the simulation is a user's function of force and frequency alone.

    AnalysisError: a simulator beside several states or added masses, one of them on a base.
    """
    shaken = [number for number, (_, mode) in enumerate(states) if mode.drive == "base"]
    if not shaken:
        return Driven(tuple(states), tuple(np.zeros(len(record)) for record, _ in states))
    record, mode = states[0]
    if len(states) == 1 and not has_masses(record):  # only p/mass is identified: the slope of a/q
        known = find_participation([(record, mode.mass, 0.0)])
        counted, stated = count_in(mode, known), mode.tolerance
        # mass and damping become uncertain by p, which unknown explains any damping; frequency keeps its tolerance
        viscous, mass = float(np.hypot(stated.viscous, known.spread)), max(stated.mass, NO_KNOWLEDGE["mass"])
        counted = replace(counted, tolerance=replace(stated, viscous=viscous, mass=max(mass, known.spread)))
        unit = known.value * mode.mass
        return Driven(((record, counted),), (np.ones(len(record)),), unit, notes=(f"base drive: {known}",))
    if simulated:
        what = "a simulator is a function of force and frequency, without the added masses that a base shakes too"
        raise AnalysisError(f'{record.source}: {what}: give it one state without added mass, or drive = "force"')
    same = [is_same_structure(other, mode) for _, other in states]
    groups = [tuple(k for k in shaken if same[k]), *((k,) for k in shaken if not same[k])]
    groups = [group for group in groups if group]
    estimates = [_find_shared(states, group, same) for group in groups]
    shared = next((known for known in estimates if known.known), Participation())
    used = {k: known if known.known else shared for group, known in zip(groups, estimates, strict=True) for k in group}
    unit = used[0].value * mode.mass if 0 in used else 1.0
    pairs = [_convert_state(state, mode, used.get(k), unit, same=same[k]) for k, state in enumerate(states)]
    notes = [f"base drive{_name(group, states)}: {known}" for group, known in zip(groups, estimates, strict=True)]
    return Driven(tuple(pair for pair, _ in pairs), tuple(mass for _, mass in pairs), unit, tuple(groups), tuple(notes))


def as_given(mode: Mode, unit: float, groups: Sequence[Sequence[int]]) -> Mode:
    """A mode of the first state in the unit of the files, where there are added masses or further states.

    A single base-driven state without them is unchanged: it is complete with the acceleration as force.
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


def _convert_state(
    state: State, first: Mode, participation: Participation | None, unit: float, *, same: bool
) -> tuple[State, FloatArray]:
    """A state under force excitation in a unit of mass, and the base-shaken mass of its structure in that unit."""
    record, mode = state
    counted = in_unit(mode, unit) if unit != 1.0 or mode.drive == "base" else mode
    if participation is None:
        return (drive_by(record, np.ones(len(record)), unit), counted), np.zeros(len(record))
    bare = (first if same else mode).mass
    excited = participation.value * bare * record.masses(mode.mass) / mode.mass
    added = record.added_masses + (mode.mass - bare)
    return (drive_by(record, excited + added, unit), counted), excited / unit


def _name(group: Sequence[int], states: Sequence[State]) -> str:
    """The states of a group in words; empty for a single state."""
    if len(states) == 1:
        return ""
    return f" of state{'s' * (len(group) > 1)} {' and '.join(str(number + 1) for number in group)}"


#: Columns in which two measurements do not agree to the last digit; share of agreeing rows from which one state is a
#: copy, since rounded peaks may agree once.
_MEASURED = ("force", "frequency", "amplitude", "phase")
_COPIED = 0.5
#: Reading across the axis, over that along it, that motion along it alone may leave: cross sensitivity of a sensor.
_CROSS_READING = 0.05


def refuse_states(states: Sequence[State]) -> None:
    """InputError for a state that names other units than the first, or a copy: one whose rows all repeat another's."""
    for (j, (first, _)), (k, (other, _)) in combinations(enumerate(states, 1), 2):
        columns, fewer = first.frame.columns.tolist(), min(len(first), len(other))
        if columns == other.frame.columns.tolist() and _share_rows(first, other, columns) == fewer:
            message = f"the rows of states {j} and {k} are identical in every column"
            raise InputError(message, file=other.source or None, expected="each measured state once")
    units = states[0][1].units
    for number, (_, mode) in enumerate(states[1:], 2):  # masses and coefficients are shared
        for what, unit in vars(mode.units).items():
            named = getattr(units, what)
            if unit and named and unit != named:
                message = f"state {number} has its {what} in {unit}, the first in {named}"
                raise InputError(message, file=mode.source or None, expected="states in the same units")


def list_crossing(states: Sequence[State]) -> list[str]:
    """Cautions about motion across the measured axis where the rig is stated to have one plane."""
    cautions = []
    for k, (record, mode) in enumerate(states):
        share = record.column("amplitude_y", 0.0).max() / record.column("amplitude").max()
        if mode.rig.planes == 1 and share > _CROSS_READING:
            cautions.append(
                f"amplitude_y{_name((k,), states)} reaches {100 * share:.0f} % of the amplitude, while [rig] planes = "
                "1 excludes motion across: no explanation with a second plane was tried"
            )
    return cautions


def list_repeated(states: Sequence[State]) -> list[str]:
    """Cautions about states that share rows to the last digit, which no two measurements do."""
    cautions = []
    for (j, (first, _)), (k, (other, _)) in combinations(enumerate(states, 1), 2):
        columns = [name for name in _MEASURED if name in first.frame and name in other.frame]
        shared, fewer = _share_rows(first, other, columns), min(len(first), len(other))
        if shared >= _COPIED * fewer:
            which = "the rows" if shared == fewer else f"{shared} rows"
            cautions.append(
                f"{which} of states {j} and {k} are identical, unlike those of any two measurements: they count twice"
            )
    return cautions


def list_unread(states: Sequence[State]) -> list[str]:
    """Cautions about further channels of records that are not used: half of a phasor is missing, or it is 0."""
    cautions = []
    for k, (record, _) in enumerate(states):
        for channel in FURTHER_CHANNELS:
            amplitude, phase = f"amplitude_{channel}", f"phase_{channel}"
            read, timed = (np.isfinite(record.column(name, np.nan)) for name in (amplitude, phase))
            for name, fault, unread, why in (
                (amplitude, f"without {phase}", read & ~timed, "a phasor needs both"),
                (phase, f"without {amplitude}", timed & ~read, "a phasor needs both"),
                (amplitude, "0", read & (record.column(amplitude, np.nan) == 0.0), "an analyser never reads exactly 0"),
            ):
                if unread.any():
                    rows = "" if unread.all() else f" in {unread.sum()} of {len(record)} rows"
                    cautions.append(f"{name}{_name((k,), states)} is {fault}{rows} and is not used: {why}")
    return cautions


def _share_rows(one: Record, two: Record, columns: list[str]) -> int:
    """Number of distinct rows that two records share to the last digit of ``columns``."""
    tables = (record.frame[columns].astype(str) for record in (one, two))  # as text, empty cells are equal
    first, second = (set(table.itertuples(index=False, name=None)) for table in tables)
    return len(first & second)
