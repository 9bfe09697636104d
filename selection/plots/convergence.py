"""Have the chains said enough? R-hat, effective size and length of every quantity of every law."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.plots.style import ALERT, AVERAGE, MUTED, WIDTH, plain_log, plain_rows, styled


@styled
def convergence(table: pd.DataFrame, r_hat: float, effective_size: float, lengths: float) -> Figure:
    """Draw a dot for each quantity, a row for each law, and the limit to be met; what fails it is an orange cross.

    Args:
        table: ``law, quantity, r_hat, effective_size, lengths``.
        r_hat, effective_size, lengths: the limits (at most, at least, at least).
    """
    laws = list(table["law"].unique())
    figure = Figure(figsize=(WIDTH, 0.9 + 0.2 * len(laws)))
    panels = figure.subplots(1, 3, sharey=True)
    limits = (
        ("r_hat", r_hat, "R-hat"),
        ("effective_size", effective_size, "effective size"),
        ("lengths", lengths, "length / τ"),
    )
    for axes, (column, limit, title) in zip(panels, limits, strict=True):
        plain_rows(axes, [str(law) for law in laws])
        failed = table[column] > limit if column == "r_hat" else table[column] < limit
        _dots(axes, table[column], table["law"].map(laws.index), failed | table[column].isna())
        axes.axvline(limit, color=ALERT, linewidth=1.0, linestyle=(0, (3, 2)))
        if column != "r_hat":
            axes.set_xscale("log")
            axes.set_xlim(0.7 * min(limit, table[column].min()), 1.4 * max(limit, table[column].max()))
            plain_log(axes.xaxis)
        else:
            axes.set_xlim(0.999, max(1.013, 1.002 * float(table[column].max())))
        axes.set_xlabel(f"{title} {'≤' if column == 'r_hat' else '≥'} {limit:g}")
    return figure


def _dots(axes: Axes, values: pd.Series, rows: pd.Series, failed: pd.Series) -> None:
    for row, of_law in values.groupby(rows):
        axes.hlines(row, of_law.min(), of_law.max(), color=MUTED, linewidth=0.8)
    axes.plot(values[~failed], rows[~failed], "o", color=AVERAGE, markersize=4, alpha=0.6)
    axes.plot(values[failed], rows[failed], "X", color=ALERT, markersize=6)
