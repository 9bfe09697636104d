"""What was believed before the test against what is believed after it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from selection.arrays import FloatArray
from selection.plots.style import AVERAGE, CREDIBLE, INK, LINEAR, MUTED, WIDTH, law_style, plain_log, plain_rows, styled

_BINS = 60
#: Values below this share of the median are drawn at it.
_FLOOR = 1e-3


@styled
def prior_posterior(prior: Mapping[str, FloatArray], posterior: Mapping[str, FloatArray]) -> Figure:
    """Draw the densities of each parameter of one law.

    Args:
        prior, posterior: label of each parameter, with its unit, and its draws. A positive parameter that spans more
            than a decade is drawn on a logarithmic axis with its density per unit of ln.
    """
    columns = min(3, len(posterior))
    rows = -(-len(posterior) // columns)
    figure = Figure(figsize=(WIDTH, 1.9 * rows + 0.3))
    for number, (label, draws) in enumerate(posterior.items()):
        axes = figure.add_subplot(rows, columns, number + 1)
        _densities(axes, prior[label], draws)
        axes.set_xlabel(label)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper left", ncols=2)
    return figure


def _densities(axes: Axes, prior: FloatArray, posterior: FloatArray) -> None:
    low, high = np.percentile(prior, [1.0, 99.0])
    low, high = min(low, np.percentile(posterior, 0.5)), max(high, np.percentile(posterior, 99.5))
    logarithmic = low > 0.0 and high / low > 10.0
    edges = np.geomspace(low, high, _BINS + 1) if logarithmic else np.linspace(low, high, _BINS + 1)
    widths = np.diff(np.log(edges) if logarithmic else edges)
    if logarithmic:
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        plain_log(axes.xaxis)
    else:
        axes.xaxis.set_major_locator(MaxNLocator(5))
    for draws, style in ((posterior, {"fill": True, "color": CREDIBLE}), (prior, {"color": LINEAR, "linewidth": 1.3})):
        density = np.histogram(draws, edges)[0] / (len(draws) * widths)
        axes.stairs(density, edges, label="prior" if draws is prior else "posterior", **style)  # type: ignore[arg-type]  # mixed keywords
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.set_ylim(bottom=0.0)


@styled
def prior_posterior_summary(table: pd.DataFrame) -> Figure:
    """Draw the intervals of every parameter of every law, each relative to its posterior median.

    Args:
        table: ``law, parameter, prior_low, prior_high, low, median, high``, rows of a law together.
    """
    rows = table[table["median"] > 0.0].reset_index(drop=True)
    figure = Figure(figsize=(WIDTH, 0.9 + 0.165 * len(rows)))
    axes = figure.add_subplot()
    plain_rows(axes, _row_labels(rows))
    scaled = rows[["prior_low", "prior_high", "low", "high"]].div(rows["median"], axis=0)
    axes.set_xscale("log")
    scaled = scaled.clip(lower=_FLOOR)
    axes.hlines(rows.index, scaled["prior_low"], scaled["prior_high"], color=MUTED, alpha=0.35, linewidth=4)
    colours = [law_style(law).colour for law in rows["law"]]
    axes.hlines(rows.index, scaled["low"], scaled["high"], color=colours, linewidth=2.2)
    axes.plot(np.ones(len(rows)), rows.index, "|", color=INK, markersize=6)
    axes.set_xlabel("relative to the posterior median: prior grey, posterior coloured", x=0.4)
    axes.set_xlim(0.8 * scaled["prior_low"].min(), 1.25 * scaled["prior_high"].max())
    plain_log(axes.xaxis)
    starts = np.flatnonzero(rows["law"].ne(rows["law"].shift()))
    axes.hlines(starts[1:] - 0.5, 0.0, 1.0, transform=axes.get_yaxis_transform(), color=MUTED, linewidth=0.4)
    axes.axvline(1.0, color=AVERAGE, linewidth=0.5)
    return figure


def _row_labels(rows: pd.DataFrame) -> list[str]:
    """The law where its first parameter stands, then the parameters."""
    return [
        f"{law}:  {parameter}" if law != before else str(parameter)
        for law, before, parameter in zip(rows["law"], rows["law"].shift(), rows["parameter"], strict=True)
    ]
