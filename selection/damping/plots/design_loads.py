"""Resonant amplitude against force, from the tested range to the design loads: what the design review looks at.

Logarithm of force against logarithm of resonant amplitude: the report's Fig. 4.10, with what the line is worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, NullFormatter, ScalarFormatter

from damping.arrays import FloatArray
from damping.plots.style import (
    AVERAGE,
    BEYOND,
    CREDIBLE,
    INK,
    LINEAR,
    MEASURED,
    MUTED,
    PREDICTIVE,
    WIDTH,
    Drawing,
    describe_short,
    describe_three,
    describe_with_unit,
    law_style,
    styled,
)

_LONG_DASH = (0, (7, 2))


@styled
def design_loads(
    band: pd.DataFrame,
    models: pd.DataFrame,
    tested: pd.DataFrame,
    design: pd.DataFrame,
    level: float,
    force_unit: str = "",
    length_unit: str = "",
    limit: float = np.inf,
) -> Figure:
    """Draw the bands, each model's median, the linear prediction and the tested points.

    Args:
        band: over a grid of forces, ``force, median, low, high, credible_low, credible_high, linear``.
        models: ``law, weight, force, median``, rows of a law together, on the same grid.
        tested: ``sweep, force, amplitude``.
        design: at the design forces, ``force, median, low, high, linear,
            linear_overprediction_percent``.
        level: content of both bands. limit: force beyond which no prediction is given.
    """
    figure = Drawing(figsize=(WIDTH, 5.0))
    axes = figure.add_subplot()
    draw_design_loads(axes, band, models, tested, design, level, force_unit, length_unit, limit)
    title = "median of each model, and its weight (models that predict the same lie on one another)"
    legend = figure.legend(handles=_list_medians(models), loc="outside lower center", ncols=2, title=title)
    legend.set_alignment("left")
    return figure


@styled
def draw_design_loads(
    axes: Axes,
    band: pd.DataFrame,
    models: pd.DataFrame,
    tested: pd.DataFrame,
    design: pd.DataFrame,
    level: float,
    force_unit: str = "",
    length_unit: str = "",
    limit: float = np.inf,
) -> None:
    """Draw :func:`design_loads` on ``axes``, without the legend of the models."""
    force = band["force"].to_numpy(float)
    top = _top(band, tested, design)
    _draw_regions(axes, tested["force"].to_numpy(float), force, limit)
    axes.vlines(tested["force"], 0.0, tested["amplitude"], color=MUTED, linewidth=0.7, linestyle=(0, (2, 2)))
    axes.fill_between(force, band["low"], band["high"], facecolor=PREDICTIVE, edgecolor=AVERAGE, linewidth=0.5)
    axes.fill_between(force, band["credible_low"], band["credible_high"], color=CREDIBLE, linewidth=0)
    for law, rows in models.groupby("law", sort=False):
        colour, line = law_style(str(law))
        axes.plot(rows["force"], rows["median"], color=colour, linestyle=line, linewidth=1.0)
    axes.plot(force, band["linear"], color=LINEAR, linewidth=1.6, linestyle=_LONG_DASH)
    axes.plot(force, band["median"], color=AVERAGE, linewidth=2.2)
    _draw_tested(axes, tested)
    _mark_design(axes, design)
    _say_numbers(axes, band, design, level, length_unit)
    axes.set_xlim(force[0], force[-1])
    axes.set_ylim(0.0, top)
    axes.set_xlabel(describe_with_unit("modal force at resonance", force_unit))
    axes.set_ylabel(describe_with_unit("resonant amplitude", length_unit))
    axes.legend(handles=_list_marks(level), loc="upper left", borderaxespad=0.2)


def _top(band: pd.DataFrame, tested: pd.DataFrame, design: pd.DataFrame) -> float:
    """Upper limit of the amplitude axis: the linear line stays in sight, a band that runs away sets no scale."""
    values = [band["linear"].max(), tested["amplitude"].max(), 1.2 * design["median"].max()]
    likely = np.nanmin([band["high"].max(), 1.6 * np.nanmax(values)])
    return float(1.12 * np.nanmax([*values, likely]))


def _draw_regions(axes: Axes, tested: FloatArray, force: FloatArray, limit: float) -> None:
    """Shade what lies beyond the test, hatch what is refused, and say which is which along the bottom."""
    low, high = tested.min(), tested.max()
    axes.axvspan(high, force[-1], color=BEYOND, linewidth=0, zorder=0)
    style: dict[str, Any] = {
        "transform": axes.get_xaxis_transform(),
        "color": MUTED,
        "fontsize": 8,
        "va": "bottom",
        "ha": "center",
    }
    axes.text(0.5 * (low + high), 0.02, "tested", **style, bbox={"facecolor": "white", "linewidth": 0, "pad": 1})
    end = min(limit, force[-1])
    if end > high:
        axes.text(0.5 * (high + end), 0.02, "extrapolated, not tested", **style)
    if limit < force[-1]:
        axes.axvspan(limit, force[-1], facecolor="none", edgecolor=MUTED, alpha=0.35, hatch="//", linewidth=0, zorder=0)
        axes.text(0.5 * (limit + force[-1]), 0.06, "no prediction", **style, backgroundcolor=BEYOND)


def _draw_tested(axes: Axes, tested: pd.DataFrame) -> None:
    """Tested points with their sweeps."""
    axes.plot(
        tested["force"], tested["amplitude"], "o", color=MEASURED, markersize=6, markeredgecolor="white", zorder=5
    )
    for sweep, force, amplitude in tested[["sweep", "force", "amplitude"]].itertuples(index=False):
        axes.annotate(
            describe_short(sweep), (force, amplitude), (6, -10), textcoords="offset points", color=MEASURED, fontsize=8
        )


def _mark_design(axes: Axes, design: pd.DataFrame) -> None:
    """Median with its predictive interval, and the linear prediction, at each design force."""
    axes.vlines(design["force"], design["low"], design["high"], color=AVERAGE, linewidth=1.2, zorder=4)
    for column, colour in (("median", AVERAGE), ("linear", LINEAR)):
        axes.plot(design["force"], design[column], "D", color="white", markeredgecolor=colour, markersize=5.5, zorder=6)


def _say_numbers(axes: Axes, band: pd.DataFrame, design: pd.DataFrame, level: float, unit: str) -> None:
    """The numbers at the largest design force that has a prediction, on the side of it that is free."""
    rows = design[np.isfinite(design["median"])]
    if rows.empty:
        return
    last = rows.iloc[int(rows["force"].argmax())]
    force, span = float(last["force"]), float(np.ptp(band["force"]))
    left = force > band["force"].min() + 0.7 * span
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "right" if left else "left", "fontsize": 8.5}
    space = f" {unit}" if unit else ""
    axes.annotate(
        f"linear {describe_three(last['linear'])}{space}\n{last['linear_overprediction_percent']:+.0f} % over "
        f"the median",
        (force, last["linear"]),
        (-10, 3) if left else (10, -8),
        va="bottom" if left else "top",
        color=LINEAR,
        **style,
    )
    # to the left, under the band where the text begins: a fifth of the axis away
    low = np.interp(force - 0.2 * span, band["force"], band["low"]) if left else last["low"]
    axes.annotate(
        f"{describe_three(last['median'])}{space}\n{100 * level:g} %: {describe_three(last['low'])} to "
        f"{describe_three(last['high'])}",
        (force, low),
        (4, -6) if left else (6, 0),
        va="top",
        color=AVERAGE,
        **style,
    )


def _list_marks(level: float) -> list[Artist]:
    """What the marks mean, for the corner above the linear line."""
    percent = f"{100 * level:g} %"
    return [
        Line2D([], [], marker="o", color=MEASURED, linestyle="", label="tested, by sweep"),
        Line2D([], [], color=AVERAGE, linewidth=2.2, label="median, averaged over the models"),
        Patch(color=CREDIBLE, linewidth=0, label=f"{percent} credible band: the law's own amplitude"),
        Patch(fc=PREDICTIVE, ec=AVERAGE, linewidth=0.5, label=f"{percent} predictive band: the next test"),
        Line2D([], [], color=LINEAR, linewidth=1.6, ls=_LONG_DASH, label="linear: viscous, from the largest level"),
        Line2D([], [], marker="D", color="white", markeredgecolor=INK, linestyle="", label="design force"),
    ]


def _list_medians(models: pd.DataFrame) -> list[Artist]:
    """The models with their weights, for the legend below the axes."""
    laws = models.drop_duplicates("law")
    return [
        Line2D([], [], color=law_style(law).colour, ls=law_style(law).line, linewidth=1.1, label=f"{law}  {w:.2f}")
        for law, w in zip(laws["law"], laws["weight"], strict=True)
    ]


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
        _draw_panel(figure.add_subplot(rows, columns, number + 1), panel)
    return figure


def _draw_panel(axes: Axes, panel: ForceAmplitude) -> None:
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
        axes.annotate(describe_short(sweep), (x, force), (-8, 5), textcoords="offset points", ha="right", fontsize=8)
    low, high = points["force"].min(), points["force"].max()
    axes.set_xlim(amplitude[0], amplitude[-1])
    axes.set_ylim(low * (low / high) ** 0.35, high * (high / low) ** 0.75)
    axes.set_title(fill(panel.title, 38))
    axes.set_xlabel(describe_with_unit("resonant amplitude", panel.length_unit))
    axes.set_ylabel(describe_with_unit("modal force", panel.force_unit))
    _draw_plain_numbers(axes)
    axes.text(0.03, 0.97, panel.note, transform=axes.transAxes, va="top", fontsize=8.5, linespacing=1.35)
    axes.legend(loc="lower right")


def _draw_plain_numbers(axes: Axes) -> None:
    """Round numbers, not powers of ten, on axes that span less than a decade."""
    for axis in (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        ticks = np.asarray(MaxNLocator(5, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
        axis.set_ticks(ticks[(ticks >= low) & (ticks <= high) & (ticks > 0.0)])
        axis.set_major_formatter(ScalarFormatter())
        axis.set_minor_formatter(NullFormatter())
