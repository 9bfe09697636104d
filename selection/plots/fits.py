"""Measured damping with the curves of the best laws, and what they leave over, point by point."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.plots.style import MEASURED, MOST_LABELS, MUTED, WIDTH, law_style, short, styled, weight_text

#: More stems than this are a thicket: dots alone then.
_MOST_STEMS = 40


@styled
def fits(
    measured: pd.DataFrame,
    fitted: pd.DataFrame,
    deviations: pd.DataFrame,
    x_label: str,
    y_label: str,
    deviation_label: str = "deviation (%)",
) -> Figure:
    """Draw measured values with fitted curves, above the deviations in per cent of the measured.

    Args:
        measured: ``x, y`` and ``label`` (text beside a point, may be empty).
        fitted: ``law, weight, x, y``, rows of a law together and in order of x.
        deviations: ``law, x, percent`` with percent = 100 (measured - fitted)/measured.
    """
    figure = Figure(figsize=(WIDTH, 4.9))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(2.2, 1.0))
    for law, rows in fitted.groupby("law", sort=False):
        colour, line = law_style(str(law))
        upper.plot(
            rows["x"], rows["y"], color=colour, linestyle=line, label=f"{law}  {weight_text(rows['weight'].iloc[0])}"
        )
    upper.plot(measured["x"], measured["y"], "o", color=MEASURED, markeredgecolor="white", markersize=6, zorder=5)
    if len(measured) <= MOST_LABELS:
        for x, y, label in measured[["x", "y", "label"]].itertuples(index=False):
            upper.annotate(short(label), (x, y), (6, -9), textcoords="offset points", fontsize=7.5)
    upper.set_ylabel(y_label)
    upper.margins(y=0.08)
    _deviations(lower, deviations)
    lower.set_xlabel(x_label)
    lower.set_ylabel(deviation_label)
    legend = figure.legend(loc="outside lower center", ncols=2, title="law, and its weight")
    legend.set_alignment("left")
    figure.align_ylabels()
    return figure


def _deviations(axes: Axes, deviations: pd.DataFrame) -> None:
    """Deviations of every law beside one another at each point, so that none hides another."""
    laws = list(deviations["law"].unique())
    x = np.unique(deviations["x"].to_numpy(float))
    nearest = float(np.diff(x).min()) if len(x) > 1 else 1.0
    step = min(0.012 * float(np.ptp(x)), 0.5 * nearest / len(laws))
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    for number, law in enumerate(laws):
        rows = deviations[deviations["law"] == law]
        places = rows["x"] + (number - 0.5 * (len(laws) - 1)) * step
        colour = law_style(str(law)).colour
        if len(rows) * len(laws) <= _MOST_STEMS:
            axes.vlines(places, 0.0, rows["percent"], color=colour, linewidth=1.0)
        filled = "none" if "+" in law else colour
        axes.plot(places, rows["percent"], "o", color=colour, markerfacecolor=filled, markersize=3.5)
    reach = max(1.0, 1.15 * float(deviations["percent"].abs().max()))
    axes.set_ylim(-reach, reach)
