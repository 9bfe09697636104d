"""Every candidate law with its weight and its errors."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.plots.style import INK, MUTED, WIDTH, law_style, plain_log, plain_rows, styled, weight_text

#: Errors below this many per cent are drawn at it: a law with as many parameters as points errs by rounding only.
SMALLEST = 0.01


@styled
def ranking(table: pd.DataFrame) -> Figure:
    """Draw weights as bars beside held-out and fitted errors, best law on top.

    Args:
        table: ``rank`` (missing where it could not be fitted), ``law, weight, held_out_error,
            average_absolute_percent`` (per cent of resonant amplitude) and ``physical``.
    """
    figure = Figure(figsize=(WIDTH, 0.9 + 0.21 * len(table)))
    weights, errors = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.0))
    _weights(weights, table)
    _errors(errors, table)
    figure.legend(loc="outside upper right", ncols=2, handletextpad=0.2, columnspacing=1.2)
    return figure


def _weights(axes: Axes, table: pd.DataFrame) -> None:
    laws = table["law"].astype(str).tolist()
    plain_rows(axes, laws)
    colours = [law_style(law).colour for law in laws]
    hatches = ["///" if "viscous + " in law else "" for law in laws]
    axes.barh(range(len(laws)), table["weight"], color=colours, hatch=hatches, edgecolor="white", linewidth=0.0)
    for row, (weight, rank, physical) in enumerate(table[["weight", "rank", "physical"]].itertuples(index=False)):
        said = "not fitted" if pd.isna(rank) else "coefficient < 0" if not physical else weight_text(weight)
        axes.annotate(said, (weight, row), (4, 0), textcoords="offset points", va="center", fontsize=7.5, color=INK)
    axes.set_xlim(0.0, max(0.05, 1.3 * table["weight"].max()))
    axes.set_xlabel("weight (posterior probability)")


def _errors(axes: Axes, table: pd.DataFrame) -> None:
    """Errors on a logarithmic axis: candidates differ by decades."""
    rows = np.arange(len(table))
    columns = table[["average_absolute_percent", "held_out_error"]].to_numpy(float)
    fitted, held_out = np.maximum(columns, SMALLEST).T
    axes.set_xscale("log")
    axes.hlines(rows, fitted, held_out, color=MUTED, linewidth=0.7)
    axes.plot(fitted, rows, "o", color="white", markeredgecolor=INK, markersize=5, label="fitted, mean absolute")
    if np.isfinite(held_out).any():
        axes.plot(held_out, rows, "o", color=INK, markersize=5, label="level held out, root mean square")
    axes.tick_params(axis="y", labelleft=False)
    plain_log(axes.xaxis)
    exact = " (a law through every point: at the edge)" if np.nanmin(columns, initial=1.0) < SMALLEST else ""
    axes.set_xlabel("error of resonant amplitude (%)" + exact.replace(" (", "\n("))


def _weight(weight: float) -> str:
    return f"{weight:.3f}" if weight >= 0.0005 else "< 0.0005" if weight > 0.0 else "0"
