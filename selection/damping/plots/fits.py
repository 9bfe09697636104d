"""Measured damping with the curves of the best laws, and what they leave over, point by point.

Energy loss per cycle as a surface over amplitude and frequency, with the points it was fitted to (Fig. 5.1).

Deviations of a fit against a variable: the plots of the regression program (report, section 5.2).

Per cent deviations of every point, the column that the report's tables end with.

Every candidate law with its weight and its errors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

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
            upper.annotate(describe_short(label), (x, y), (6, -9), textcoords="offset points", fontsize=7.5)
    upper.set_ylabel(y_label)
    upper.margins(y=0.08)
    _draw_deviations(lower, deviations)
    lower.set_xlabel(x_label)
    lower.set_ylabel(deviation_label)
    legend = figure.legend(loc="outside lower center", ncols=2, title="law, and its weight")
    legend.set_alignment("left")
    figure.align_ylabels()
    return figure


def _draw_deviations(axes: Axes, deviations: pd.DataFrame) -> None:
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


@styled
def energy_surface(
    amplitude: FloatArray,
    frequency: FloatArray,
    energy: FloatArray,
    points: pd.DataFrame,
    amplitude_label: str,
    frequency_label: str,
    energy_label: str,
) -> Figure:
    """Draw filled contours of a law's energy with the measured points in the same colours.

    Args:
        amplitude: grid (a,). frequency: grid (f,). energy: of the law, (a, f).
        points: ``amplitude, frequency, energy``, as measured: a point that stands out differs from the law.
    """
    figure = Figure(figsize=(WIDTH, 3.9))
    axes = figure.add_subplot()
    top = float(max(energy.max(), points["energy"].max()))
    levels = np.asarray(MaxNLocator(12).tick_values(0.0, top))
    surface = axes.contourf(frequency, amplitude, energy, levels, cmap="cividis")
    axes.contour(frequency, amplitude, energy, levels, colors="white", linewidths=0.4)
    axes.scatter(
        points["frequency"],
        points["amplitude"],
        c=points["energy"],
        cmap="cividis",
        vmin=levels[0],
        vmax=levels[-1],
        s=46,
        edgecolors="white",
        linewidths=1.3,
        zorder=4,
    )
    labelled = points.head(MOST_LABELS)[["frequency", "amplitude", "energy"]]
    for frequency_, amplitude_, energy_ in labelled.itertuples(index=False):
        place = (frequency_, amplitude_), (7, -3)
        colour = "white" if energy_ < 0.55 * levels[-1] else INK
        axes.annotate(f"{energy_:.3g}", *place, textcoords="offset points", fontsize=7, color=colour)
    bar = figure.colorbar(surface, ax=axes, label=energy_label)
    bar.outline.set_visible(False)
    axes.set_xlabel(frequency_label)
    axes.set_ylabel(amplitude_label)
    axes.grid(visible=False)
    axes.tick_params(color=INK)
    return figure


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
    axes.legend(title="sweep")


@styled
def sweeps(table: pd.DataFrame) -> Figure:
    """Draw amplitude against frequency, each sweep of a record apart."""
    figure = Drawing(figsize=(WIDTH, 4.0))
    draw_sweeps(figure.add_subplot(), table)
    return figure


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
    panels[-1].set_xticks(range(0, len(points), every), [describe_short(point, 8) for point in points[::every]])
    panels[-1].set_xlabel("point")
    figure.supylabel("deviation (% of the measured)", fontsize=8.5)
    return figure


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
    draw_plain_rows(axes, laws)
    colours = [law_style(law).colour for law in laws]
    hatches = ["///" if "viscous + " in law else "" for law in laws]
    axes.barh(range(len(laws)), table["weight"], color=colours, hatch=hatches, edgecolor="white", linewidth=0.0)
    for row, (weight, rank, physical) in enumerate(table[["weight", "rank", "physical"]].itertuples(index=False)):
        said = "not fitted" if pd.isna(rank) else "coefficient < 0" if not physical else weight_text(weight)
        axes.annotate(said, (weight, row), (4, 0), textcoords="offset points", va="center", fontsize=7.5, color=INK)
    axes.set_xlim(0.0, max(0.05, 1.3 * table["weight"].max()))
    axes.set_xlabel("weight (posterior probability)")


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
    exact = " (a law through every point: at the edge)" if np.nanmin(columns, initial=1.0) < SMALLEST else ""
    axes.set_xlabel("error of resonant amplitude (%)" + exact.replace(" (", "\n("))


def _describe_weight(weight: float) -> str:
    return f"{weight:.3f}" if weight >= 0.0005 else "< 0.0005" if weight > 0.0 else "0"
