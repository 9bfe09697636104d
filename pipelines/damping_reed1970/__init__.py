"""The report of 1970 recomputed: its tables here; one folder a chapter, with its equations, its figures and its page.

Every table comes as printed, corrected, and as used by the report's own computation.

Source: R. R. Reed, *Determination of Modal Damping for Launch Vehicles Using Experimental Data*, NASA contract
NAS8-21110. The files and the meaning of every column are described in ``data/saturn-v/README.md``.

Units are lb, in, s.
"""

from collections.abc import Iterable
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Literal

import numpy as np
import numpy.typing as npt
import pandas as pd

from damping.arrays import FloatArray
from damping_pipelines import shipped_folder

Version = Literal["printed", "corrected", "used"]
Run = Literal["E3", "E4"]


def data_folder() -> Path:
    """Folder with ``saturn-v``: the packaged copy where there is one, else the repository's.

    InputError: neither exists (an incomplete installation).
    """
    return shipped_folder(Path(__file__).resolve().parent, "saturn-v").parent


def load_table(name: str, version: Version = "printed", run: Run = "E4") -> pd.DataFrame:
    """One table of the report; columns carry their units in their names.

    Args:
        name: ``"3_I"`` for Table 3.I.
        version: ``"printed"``: every digit as printed. ``"corrected"``: cells that are wrong replaced.
            ``"used"``: what the report's own computation used: where that is known to differ from the print it is
            taken (Table 5.III and 5.IV: the recovered inputs), else the corrected cell, else the printed one.
        run: of Table 5.IV as used, the inputs of the two-term run ``"E3"`` (Eq. 5.3.14) or of the one-term runs
            ``"E4"`` (Eq. 5.3.15 and the viscous one of section 5.3): the report changed one energy between them.
    """
    return _load(name, version, run).copy()


@lru_cache
def _load(name: str, version: Version, run: Run) -> pd.DataFrame:
    table = load_text(f"tables/table_{name}")
    corrections = load_text("corrections")
    own = corrections[corrections["table"] == name] if version != "printed" else corrections[:0]
    for row in own.to_dict("records"):
        used = row["used_by_report"] if version == "used" and row["run"] in ("", run) else ""
        value = used or row["corrected"]
        if value:
            # columns ``a|b`` that hold ``1|A``
            where = zip(row["key_columns"].split("|"), row["key"].split("|"), strict=True)
            matching = np.logical_and.reduce([table[column] == key for column, key in where])
            table.loc[matching, row["column"]] = value
    return _tabulate_numeric(table)


def load_text(name: str) -> pd.DataFrame:
    """A CSV of the Saturn V folder, every cell as the text that is there (empty where nothing is).

    ``corrections``: cells that are wrong or that the report did not use as printed. ``errata``: misprints, misreadings
    and derivation errors, ``id, severity, kind, where, as_printed, should_be, proof``; ``severity`` is A where results
    change, B where numbers change, C for minor ones. ``printed_results``: every printed result that can be recomputed,
    ``id, where, printed, erratum, reason, recipe``.
    """
    return pd.read_csv(data_folder() / "saturn-v" / f"{name}.csv", dtype=str, keep_default_na=False)


def load_force_laws() -> pd.DataFrame:
    """Damping forces summarised in section 6.1, one row a term, coefficients as printed (lb, in, s)."""
    return _tabulate_numeric(load_text("tables/section_6_1"), text=("equation",))


def _tabulate_numeric(table: pd.DataFrame, text: tuple[str, ...] = ()) -> pd.DataFrame:
    """Turn the columns that hold only numbers and blanks into floats or integers (blank: NaN)."""
    for name in table.columns.difference(list(text)):
        filled = table[name].where(table[name] != "")
        numbers = pd.to_numeric(filled, errors="coerce")
        if filled.notna().any() and numbers.notna().equals(filled.notna()):
            table[name] = numbers
    return table


def columns(table: pd.DataFrame, *names: str) -> tuple[FloatArray, ...]:
    """The named columns as arrays of floats."""
    return tuple(table[name].to_numpy(dtype=float) for name in names)


def by_point(name: str, values: npt.ArrayLike, points: Iterable[object] | None = None) -> dict[str, float]:
    """``{name[1]: first value, name[2]: second, ...}``, or with the ``points`` named."""
    numbers = np.asarray(values, dtype=float).tolist()
    return {f"{name}[{k}]": value for k, value in zip(points or count(1), numbers, strict=points is not None)}
