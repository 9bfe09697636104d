"""The figures of the last blind run of the gap diagnosis, as shipped: what may be expected of its answers."""

from __future__ import annotations

import pandas as pd

from selection.records.report_tables import data_folder

COLUMNS = ("figure", "goal", "measured", "low", "high", "cases", "met", "share")


def load_blind_table() -> pd.DataFrame:
    """The table that ``damping blind`` wrote: figure, goal, measured value with its 95 % interval, cases, met or not.

    ``share``: whether the values are shares of 1.
    """
    table = pd.read_csv(data_folder() / "blind" / "table.csv", keep_default_na=True)
    return table.loc[:, list(COLUMNS)].assign(goal=table["goal"].fillna(""), met=table["met"].fillna(""))
