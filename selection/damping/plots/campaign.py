"""Frequency and damping ratio of a mode against the level of its drive, tested and beyond."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.plots.style import AVERAGE, MEASURED, PREDICTIVE, WIDTH, styled


@styled
def mode_over_level(table: pd.DataFrame, unit: str) -> Figure:
    """Two panels over the level: damping ratio with its band, and frequency.

    Args:
        table: a row a level, rising: ``level, tested, frequency, median, low, high`` of the damping ratio.
        unit: of the level.
    """
    figure = Figure(figsize=(WIDTH, 2.6))
    left, right = figure.subplots(1, 2)
    level = table["level"].to_numpy(dtype=float)
    tested = table["tested"].to_numpy(dtype=bool)
    left.fill_between(level, 100.0 * table["low"], 100.0 * table["high"], color=PREDICTIVE, label="90 % band")
    for axes, name, factor in ((left, "median", 100.0), (right, "frequency", 1.0)):
        values = factor * table[name].to_numpy(dtype=float)
        axes.plot(level, values, color=AVERAGE)
        axes.plot(level[tested], values[tested], "o", color=MEASURED, label="tested")
        axes.plot(level[~tested], values[~tested], "o", mfc="white", color=MEASURED, label="design")
        axes.set_xlabel(f"level, {unit}")
    left.set_ylabel("damping ratio, %")
    right.set_ylabel("frequency, Hz")
    left.legend(loc="best")
    span = np.ptp(table["frequency"]) or 1e-3 * float(table["frequency"].iloc[0])
    right.set_ylim(table["frequency"].min() - span, table["frequency"].max() + span)
    return figure
