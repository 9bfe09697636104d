"""Every candidate law with its weight and its errors; sweeps of a record.

Deviations of a fit against a variable: the plots of the regression program (report, section 5.2).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots.style import (
    INK,
    MEASURED,
    MOST_LABELS,
    MUTED,
    WIDTH,
    Drawing,
    describe_short,
    draw_plain_rows,
    law_style,
    plain_log,
    styled,
    weight_text,
)

#: Points from which on they are drawn as one picture: a mark each would make a file many times the data.
MANY = 5_000


@styled
def deviations_figure(
    x: FloatArray, deviation: FloatArray, percent: FloatArray, *, x_label: str, response: str
) -> Figure:
    """Deviation (above) and per cent deviation (below) against a variable.

    Args:
        x: the variable (n,).
        deviation: observed - fitted (n,), in units of the response.
        percent: 100 deviation/observed (n,), NaN where there is none.
        x_label: name of the variable.
        response: name of the response.
    """
    figure = Drawing(figsize=(WIDTH, 4.6))
    above, below = figure.subplots(2, 1, sharex=True)
    known = ~np.isnan(percent)
    many: dict[str, Any] = {"rasterized": True, "markersize": 1.0, "alpha": 0.5} if len(x) > MANY else {}
    for axes, shown, value in ((above, x, deviation), (below, x[known], percent[known])):
        axes.plot(shown, value, "o", color=MEASURED, **many)
    for axes, label in ((above, f"deviation of {response}"), (below, "deviation, per cent")):
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        axes.set_ylabel(label, parse_math=False)
    below.set_xlabel(x_label, parse_math=False)
    above.set_title("observed - fitted")
    return figure


@styled
def draw_deviations(axes: Axes, x: FloatArray, deviation: FloatArray, *, x_label: str, response: str) -> None:
    """Draw deviations (n,), observed - fitted, against a variable (n,) on ``axes``."""
    axes.plot(x, deviation, "o", color=MEASURED)
    axes.axhline(0.0, color=MUTED, linewidth=0.8)
    axes.set_xlabel(x_label, parse_math=False)
    axes.set_ylabel(f"deviation of {response}", parse_math=False)


@styled
def draw_sweeps(axes: Axes, table: pd.DataFrame) -> None:
    """Draw amplitude against frequency, each sweep of a record apart, on ``axes``."""
    for sweep, rows in table.groupby("sweep", sort=False):
        ordered = rows.sort_values("frequency", kind="stable")
        axes.plot(ordered["frequency"], ordered["amplitude"], "o-", markersize=2.6, linewidth=0.8, label=str(sweep))
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel("amplitude")
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > MOST_LABELS // 4:
        handles, labels = [handles[0], handles[-1]], [labels[0], labels[-1]]
    axes.legend(handles, [describe_short(label) for label in labels], title="sweep")


@styled
def sweeps(table: pd.DataFrame) -> Figure:
    """Draw amplitude against frequency, each sweep of a record apart."""
    figure = Drawing(figsize=(WIDTH, 4.0))
    draw_sweeps(figure.add_subplot(), table)
    return figure


#: Letters of a law's name beside its bar: the bars have the rest of the width.
MOST_LETTERS = 24
#: Errors below this many per cent are drawn at it: a law with as many parameters as points errs by rounding only.
SMALLEST = 0.01


@styled
def ranking(table: pd.DataFrame) -> Figure:
    """Draw weights as bars beside held-out and fitted errors, best law on top.

    Args:
        table: ``rank`` (missing where it could not be fitted), ``law, weight, held_out_error,
            average_absolute_percent`` (per cent of resonant amplitude) and ``physical``.
    """
    figure = Drawing(figsize=(WIDTH, 0.9 + 0.21 * len(table)))
    weights, errors = figure.subplots(1, 2, sharey=True, width_ratios=(1.0, 1.0))
    draw_weights(weights, table)
    _draw_errors(errors, table)
    figure.legend(loc="outside upper right", ncols=2, handletextpad=0.2, columnspacing=1.2)
    return figure


@styled
def draw_weights(axes: Axes, table: pd.DataFrame) -> None:
    """Draw the weights of :func:`ranking` on ``axes``."""
    laws = table["law"].astype(str).tolist()
    draw_plain_rows(axes, [describe_short(law, MOST_LETTERS) for law in laws])
    colours = [law_style(law).colour for law in laws]
    hatches = ["///" if "viscous + " in law else "" for law in laws]
    axes.barh(range(len(laws)), table["weight"], color=colours, hatch=hatches, edgecolor="white", linewidth=0.0)
    for row, (weight, rank, physical) in enumerate(table[["weight", "rank", "physical"]].itertuples(index=False)):
        said = "not fitted" if pd.isna(rank) else "coefficient < 0" if not physical else weight_text(weight)
        axes.annotate(said, (weight, row), (4, 0), textcoords="offset points", va="center", fontsize=7.5, color=INK)
    axes.set_xlim(0.0, max(0.05, 1.3 * table["weight"].max()))
    axes.set_xlabel("weight (probability)")


def _draw_errors(axes: Axes, table: pd.DataFrame) -> None:
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
    exact = "\n(at the edge: rounding)" if np.nanmin(columns, initial=1.0) < SMALLEST else ""
    axes.set_xlabel("error of amplitude (%)" + exact)
