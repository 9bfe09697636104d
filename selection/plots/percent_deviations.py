"""Per cent deviations of every point, the column that the report's tables end with."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from selection.plots.style import MOST_LABELS, MUTED, WIDTH, law_style, short, styled


@styled
def percent_deviations(table: pd.DataFrame) -> Figure:
    """Draw 100 (measured - fitted)/measured of every point, a panel for each fit.

    Args:
        table: ``law`` (or another name of the fit), ``point`` (label) and ``percent``, rows of a fit together.
    """
    fits = list(table["law"].unique())
    figure = Figure(figsize=(WIDTH, 0.5 + 1.15 * len(fits)))
    panels = figure.subplots(len(fits), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    points = list(table["point"].astype(str).unique())
    for axes, fit in zip(panels, fits, strict=True):
        rows = table[table["law"] == fit]
        x = [points.index(str(point)) for point in rows["point"]]
        colour = law_style(str(fit)).colour
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        axes.bar(x, rows["percent"], width=0.62, color=colour)
        mean = float(np.abs(rows["percent"]).mean())
        axes.set_title(f"{fit}: mean |deviation| {mean:.1f} %", fontsize=8.5)
        axes.grid(visible=False, axis="x")
    every = -(-len(points) // MOST_LABELS)
    panels[-1].set_xticks(range(0, len(points), every), [short(point, 8) for point in points[::every]])
    panels[-1].set_xlabel("point")
    figure.supylabel("deviation (% of the measured)", fontsize=8.5)
    return figure
