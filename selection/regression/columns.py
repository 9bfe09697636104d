"""The columns of a table that terms and response stand for: as they are, by alias, or derived.

Where a table has ``amplitude`` or ``frequency`` but no column ``A`` or ``omega``, those stand for ``amplitude`` and
2 pi ``frequency``. A missing ``energy`` is the energy input per cycle, pi * force * amplitude * sin(phase).
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from selection.arrays import FloatArray, IntArray
from selection.errors import AnalysisError
from selection.records.record import Record
from selection.records.resonance import energy_per_cycle
from selection.units import RAD_S_PER_HZ

_ALIASES = {"A": ("amplitude", 1.0), "omega": ("frequency", RAD_S_PER_HZ)}


@dataclass(frozen=True)
class Columns:
    """The numbers that a regression needs.

    ``numbers`` maps each name asked for to its column (n,); ``rows`` (n,) are the rows of the table used, from 0;
    ``notes`` say what was derived or left out.
    """

    numbers: dict[str, FloatArray]
    rows: IntArray
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.rows)


def sources(name: str, available: Collection[str]) -> tuple[str, ...]:
    """The table's columns that ``name`` is made of; ``name`` itself, missing, where nothing can make it.

    A column whose name has blanks is found with or without them.
    """
    if name in available:
        return (name,)
    for column in available:
        if "".join(column.split()) == "".join(name.split()):
            return (column,)
    if name in _ALIASES and _ALIASES[name][0] in available:
        return (_ALIASES[name][0],)
    if name == "energy" and {"force", "amplitude"} <= set(available):
        return ("force", "amplitude", "sweep" if "sweep" in available and "phase" not in available else "phase")
    return (name,)


def required_columns(names: Iterable[str], available: Collection[str]) -> tuple[str, ...]:
    """The table's columns that all of ``names`` are made of, each once."""
    return tuple(dict.fromkeys(column for name in names for column in sources(name, available)))


def take_columns(table: pd.DataFrame, names: Iterable[str], source: str = "table") -> Columns:
    """The columns that ``names`` stand for.

    Args:
        table: holds what ``required_columns`` names, as finite numbers (``sweep`` excepted).
        names: of response and factors, each once.
        source: of the table, for messages.

    Without ``phase``, an energy that has to be derived is known at phase resonance only, where it is
    pi * force * amplitude: each sweep's row of largest amplitude is used and the others are left out.

    Raises:
        AnalysisError: no row is left.
    """
    values: dict[str, FloatArray] = {}
    notes: list[str] = []
    for name in names:
        found = sources(name, list(table.columns))
        if len(found) == 1:
            factor = 1.0 if found[0] == name or name not in _ALIASES else _ALIASES[name][1]
            values[name] = factor * table[found[0]].to_numpy(dtype=np.float64)
        else:
            values[name] = energy_per_cycle(Record(table.reset_index(drop=True), source))
            notes.append("energy = pi * force * amplitude" + (" * sin(phase)" if found[2] == "phase" else ""))
    keep = np.all([np.isfinite(column) for column in values.values()], axis=0)
    if not keep.any():
        raise AnalysisError(f"{source}: no row has a value for every column")
    if not keep.all():
        notes.append(f"no phase: {int(keep.sum())} rows at phase resonance of {len(keep)} are used")
    return Columns({name: column[keep] for name, column in values.items()}, np.flatnonzero(keep), tuple(notes))
