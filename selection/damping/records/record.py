"""A record: steady states measured (or computed) in one or more sweeps.

Tables as CSV text: shortest decimal numbers that read back to the last digit, and text no spreadsheet executes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.records.text import guarded


@dataclass(frozen=True)
class Record:
    """One row a steady state.

    ``table`` has the columns ``sweep`` (text), ``force``, ``frequency`` (Hz), ``amplitude`` and where given ``phase``
    (rad, lag of displacement behind force), ``energy`` (per cycle), ``mass``, ``amplitude_sd``, ``phase_sd``,
    ``force_sd`` (floats), then any others as they were; rows in file order, index 0..n-1. ``source`` says where it is
    from, for messages.
    """

    table: pd.DataFrame
    source: str

    def __len__(self) -> int:
        return len(self.table)

    @property
    def sweeps(self) -> tuple[str, ...]:
        """Labels of the sweeps in order of appearance."""
        return tuple(str(label) for label in self.table["sweep"].drop_duplicates())

    @property
    def has_phase(self) -> bool:
        """Whether phases were recorded."""
        return "phase" in self.table.columns

    @property
    def is_decay(self) -> bool:
        """Whether rows were taken from free decays: so labelled, or one-row sweeps whose amplitude falls with time."""
        if "decay" in self.table.columns:
            return True
        if "time" not in self.table.columns or len(self.sweeps) != len(self) or len(self) < 2:
            return False
        order = np.argsort(self.column("time"), kind="stable")
        return bool(np.all(np.diff(self.column("amplitude")[order]) < 0.0))

    def column(self, name: str) -> FloatArray:
        """A numeric column as a new array (n,)."""
        return self.table[name].to_numpy(dtype=np.float64, copy=True)

    def masses(self, mode_mass: float) -> FloatArray:
        """Generalized mass of each row (n,): the row's own where it has one, else ``mode_mass``."""
        if "mass" not in self.table.columns:
            return np.full(len(self.table), float(mode_mass))
        own = self.column("mass")
        return np.where(np.isnan(own), float(mode_mass), own)

    def of(self, sweep: str) -> Record:
        """The rows of one sweep. InputError if the record has no such sweep."""
        if sweep not in self.sweeps:
            raise InputError(f"no sweep {sweep!r}", file=self.source, expected=f"one of {', '.join(self.sweeps)}")
        return self._rows(self.table["sweep"] == sweep)

    def without(self, sweeps: Iterable[str]) -> Record:
        """The rows of all other sweeps (none may be left)."""
        return self._rows(~self.table["sweep"].isin(list(sweeps)))

    def _rows(self, chosen: pd.Series) -> Record:
        return Record(self.table[chosen].reset_index(drop=True), self.source)


_BLOCK = 20_000  # rows that are written together
_QUOTED = re.compile(r'[,"\r\n]')  # the csv module leaves a lone carriage return bare


def record_to_csv(record: Record | pd.DataFrame) -> str:
    """A record or any table as CSV: UTF-8 text, commas, LF line ends, no index; NaN and None are empty cells.

    Floats are written as the shortest decimals that read back to the same number, integers without a point. A text
    cell or column name that begins with ``=``, ``+``, ``-``, ``@``, tab or carriage return, which a spreadsheet may
    execute, gets a leading apostrophe unless it is a plain number; ``read_table`` and ``read_record`` take it off.
    """
    table = record.table if isinstance(record, Record) else record
    parts = [",".join(_cell(str(name)) for name in table.columns) + "\n"]
    for start in range(0, len(table), _BLOCK):
        block = table.iloc[start : start + _BLOCK]
        columns = [[_cell(value) for value in block.iloc[:, i].tolist()] for i in range(block.shape[1])]
        parts.append("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)))
    return "".join(parts)


def _cell(value: object) -> str:
    if isinstance(value, str):
        return _quoted(guarded(value))
    if value is None or value is pd.NA or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, float | np.floating):
        return repr(float(value))
    return _quoted(str(value))


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text
