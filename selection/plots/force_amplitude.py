"""Logarithm of force against logarithm of resonant amplitude: the report's Fig. 4.10, with what the line is worth."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import NamedTuple

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter, ScalarFormatter

from selection.plots.style import AVERAGE, LINEAR, MEASURED, PREDICTIVE, WIDTH, short, styled, with_unit


class ForceAmplitude(NamedTuple):
    """One panel: ``points`` has ``sweep, force, amplitude``; ``line`` has ``amplitude, force, low, high``."""

    title: str
    points: pd.DataFrame
    line: pd.DataFrame
    note: str
    force_unit: str = ""
    length_unit: str = ""


@styled
def force_amplitude(panels: Sequence[ForceAmplitude]) -> Figure:
    """Draw a panel for each mode, two in a row; a force proportional to amplitude (slope 1) is drawn for comparison."""
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(WIDTH if columns == 2 else 0.7 * WIDTH, 3.4 * rows))
    for number, panel in enumerate(panels):
        _panel(figure.add_subplot(rows, columns, number + 1), panel)
    return figure


def _panel(axes: Axes, panel: ForceAmplitude) -> None:
    line, points = panel.line, panel.points
    amplitude = line["amplitude"].to_numpy(float)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.fill_between(amplitude, line["low"], line["high"], color=PREDICTIVE, lw=0, label="t interval of the line")
    axes.plot(amplitude, line["force"], color=AVERAGE, label="least squares")
    top = points.iloc[int(points["force"].argmax())]
    slope_one = top["force"] * amplitude / top["amplitude"]
    axes.plot(amplitude, slope_one, color=LINEAR, linestyle=(0, (7, 2)), linewidth=1.1, label="slope 1: linear damping")
    axes.plot(points["amplitude"], points["force"], "o", color=MEASURED, markersize=6, markeredgecolor="white")
    for sweep, force, x in points[["sweep", "force", "amplitude"]].itertuples(index=False):
        axes.annotate(short(sweep), (x, force), (-8, 5), textcoords="offset points", ha="right", fontsize=8)
    low, high = points["force"].min(), points["force"].max()
    axes.set_xlim(amplitude[0], amplitude[-1])
    axes.set_ylim(low * (low / high) ** 0.35, high * (high / low) ** 0.75)
    axes.set_title(fill(panel.title, 38))
    axes.set_xlabel(with_unit("resonant amplitude", panel.length_unit))
    axes.set_ylabel(with_unit("modal force", panel.force_unit))
    _plain_numbers(axes)
    axes.text(0.03, 0.97, panel.note, transform=axes.transAxes, va="top", fontsize=8.5, linespacing=1.35)
    axes.legend(loc="lower right")


def _plain_numbers(axes: Axes) -> None:
    """Round numbers, not powers of ten, on axes that span less than a decade."""
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        ticks = np.asarray(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        axis.set_ticks(ticks[(ticks >= low) & (ticks <= high) & (ticks > 0.0)])
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
