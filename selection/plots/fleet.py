"""A fleet of records: which laws lead, and by how much linear damping overpredicts, record by record."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from selection.plots.style import AVERAGE, LINEAR, MUTED, PREDICTIVE, WIDTH, law_style, plain_rows, styled

#: Points of the sorted figure: more cannot be told apart on paper.
MOST_POINTS = 500
#: Laws drawn by name; the others are one bar.
MOST_LAWS = 14


@styled
def leading_laws(counts: pd.Series) -> Figure:
    """Bars of how many records each law leads.

    Args:
        counts: records by law, largest first.
    """
    shown = counts.head(MOST_LAWS)
    if len(counts) > MOST_LAWS:
        shown = pd.concat([shown, pd.Series({"others": counts.iloc[MOST_LAWS:].sum()})])
    figure = Figure(figsize=(WIDTH, 0.8 + 0.24 * len(shown)))
    axes = figure.add_subplot()
    laws = [str(law) for law in shown.index]
    plain_rows(axes, laws)
    colours, hatches = [law_style(law).colour for law in laws], ["///" if "viscous + " in law else "" for law in laws]
    axes.barh(range(len(laws)), shown.to_numpy(float), color=colours, hatch=hatches, edgecolor="white", linewidth=0.0)
    for row, value in enumerate(shown):
        axes.annotate(f"{value:d}", (float(value), row), (4, 0), textcoords="offset points", va="center", fontsize=7.5)
    axes.set_xlim(0.0, 1.12 * float(shown.max()))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("records led (hatched: with a viscous part)")
    return figure


@styled
def sorted_overprediction(table: pd.DataFrame) -> Figure:
    """Overprediction of linear damping, largest first, with the interval of each record.

    Args:
        table: ``percent, low, high``, a row a record, all finite.
    """
    ordered = table.sort_values("percent", ascending=False, ignore_index=True)
    chosen = np.unique(np.linspace(0, len(ordered) - 1, MOST_POINTS).round().astype(int))
    place, rows = 100.0 * (chosen + 0.5) / len(ordered), ordered.iloc[chosen]
    figure = Figure(figsize=(WIDTH, 3.1))
    axes = figure.add_subplot()
    if len(ordered) > MOST_POINTS // 5:
        axes.fill_between(place, rows["low"], rows["high"], color=PREDICTIVE, linewidth=0)
        axes.plot(place, rows["percent"], color=AVERAGE)
    else:
        axes.vlines(place, rows["low"], rows["high"], color=PREDICTIVE, linewidth=max(1.0, 150.0 / len(ordered)))
        axes.plot(place, rows["percent"], "o", color=AVERAGE, markersize=3.5)
    axes.axhline(0.0, color=LINEAR, linewidth=1.0)
    axes.axvline(50.0, color=MUTED, linewidth=0.6, linestyle=(0, (2, 2)))
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("records, largest overprediction first (%)")
    axes.set_ylabel("linear over median (%)")
    return figure
