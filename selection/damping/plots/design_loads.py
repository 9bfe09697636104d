"""Resonant amplitude against force, from the tested range to the design loads: what the design review looks at."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from damping.plots.damping_curve import shade_beyond
from damping.plots.style import (
    AVERAGE,
    INK,
    LINEAR,
    MEASURED,
    MUTED,
    PREDICTIVE,
    WIDTH,
    Drawing,
    describe_with_unit,
    distinguish,
    styled,
)

_LONG_DASH = (0, (7, 2))
#: Sweeps that are named beside their points; more hide the points.
MOST_NAMED = 6


@styled
def design_loads(
    band: pd.DataFrame,
    tested: pd.DataFrame,
    design: pd.DataFrame,
    level: float,
    force_unit: str = "",
    length_unit: str = "",
    limit: float = np.inf,
) -> Figure:
    """Draw the median with its band, the linear prediction and the tested points.

    Args:
        band: over a grid of forces, ``force, median, low, high, linear``; NaN where no prediction is given.
        tested: ``sweep, force, amplitude``. design: at the design forces, ``force, median, low, high, linear``.
        level: content of the band. limit: force beyond which no prediction is given.
    """
    figure = Drawing(figsize=(WIDTH, 3.9))
    axes = figure.add_subplot()
    draw_design_loads(axes, band, tested, design, level, force_unit, length_unit, limit)
    figure.legend(handles=_list_marks(level, len(tested)), loc="outside lower left", ncols=2, columnspacing=1.2)
    return figure


@styled
def draw_design_loads(
    axes: Axes,
    band: pd.DataFrame,
    tested: pd.DataFrame,
    design: pd.DataFrame,
    level: float,
    force_unit: str = "",
    length_unit: str = "",
    limit: float = np.inf,
) -> None:
    """Draw :func:`design_loads` on ``axes``, without a legend."""
    force = band["force"].to_numpy(float)
    edge = float(tested["force"].max())
    shade_beyond(axes, edge, float(force[-1]))
    axes.fill_between(force, band["low"], band["high"], facecolor=PREDICTIVE, linewidth=0)
    axes.plot(force, band["linear"], color=LINEAR, linewidth=1.4, linestyle=_LONG_DASH)
    inside = force <= edge
    axes.plot(force[inside], band["median"][inside], color=AVERAGE, linewidth=2.2)
    axes.plot(force[~inside], band["median"][~inside], color=AVERAGE, linewidth=2.2, linestyle=(0, (4, 1.5)))
    axes.plot(tested["force"], tested["amplitude"], "o", color=MEASURED, markersize=5, mec="white", mew=0.6, zorder=5)
    if len(tested) <= MOST_NAMED:
        for label, f, amplitude in zip(distinguish(tested["sweep"]), tested["force"], tested["amplitude"], strict=True):
            axes.annotate(label, (f, amplitude), (5, -9), textcoords="offset points", color=MEASURED, fontsize=7.5)
    axes.vlines(design["force"], design["low"], design["high"], color=AVERAGE, linewidth=1.2, zorder=4)
    axes.plot(design["force"], design["median"], "D", color="white", markeredgecolor=AVERAGE, markersize=5, zorder=6)
    axes.set_xlim(force[0], force[-1])
    axes.set_ylim(0.0, _find_top(band, tested, design))
    if limit < force[-1]:
        axes.axvline(limit, color=MUTED, linewidth=0.8)
        axes.text(limit, 0.02, " no prediction", transform=axes.get_xaxis_transform(), color=MUTED, fontsize=8)
    axes.set_xlabel(describe_with_unit("force at resonance", force_unit))
    axes.set_ylabel(describe_with_unit("resonant amplitude", length_unit))


def _find_top(band: pd.DataFrame, tested: pd.DataFrame, design: pd.DataFrame) -> float:
    """Upper limit of the amplitude axis: the linear line stays in sight, a band that runs away sets no scale."""
    values = [band["linear"].max(), tested["amplitude"].max(), 1.2 * design["median"].max()]
    likely = np.nanmin([band["high"].max(), 1.6 * np.nanmax(values)])
    return float(1.12 * np.nanmax([*values, likely]))


def _list_marks(level: float, sweeps: int) -> list[Artist]:
    dashed = (0, (4, 1.5))
    return [
        Line2D([], [], marker="o", color=MEASURED, linestyle="", label=f"measured (n = {sweeps})"),
        Line2D([], [], color=AVERAGE, linewidth=2.2, label="median, tested"),
        Line2D([], [], color=AVERAGE, linewidth=2.2, ls=dashed, label="median, beyond (hatched)"),
        Patch(fc=PREDICTIVE, linewidth=0, label=f"{100 * level:g} % band, next test"),
        Line2D([], [], color=LINEAR, linewidth=1.4, ls=_LONG_DASH, label="linear, from the top level"),
        Line2D([], [], marker="D", color="white", markeredgecolor=INK, linestyle="", label="design force"),
    ]
