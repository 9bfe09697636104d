"""A record: steady states measured (or computed) in one or more sweeps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from selection.arrays import FloatArray
from selection.errors import InputError


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
