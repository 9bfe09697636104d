"""Candidate laws with their weights and errors, posteriors as corner plots, predictive checks, deviations of a fit."""

from collections.abc import Collection, Mapping, Sequence
from textwrap import wrap
from typing import Any, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import gaussian_filter

from damping import plots as look
from damping.arrays import FloatArray
from damping.plots import describe_short, draw_plain_rows, law_style, styled
from damping.plots.given import count_rows, name_rows
from damping.records.text import format_share

#: Points from which on they are drawn as one picture: a mark each would make a file many times the data.
MANY = 5_000


@styled
def deviations_figure(
    x: FloatArray, deviation: FloatArray, percent: FloatArray, *, x_label: str, response: str, axes: Axes | None = None
) -> Figure:
    """Deviation (above) and per cent deviation (below) against a variable; on ``axes`` the deviation alone.

    Args:
        x: the variable (n,).
        x_label: its name.
        response: name of the response.
        deviation: observed - fitted (n,), in units of the response.
        percent: 100 deviation/observed (n,), NaN where there is none.
    """
    panels = look.build_panels(4.6, 2, sharex=True)[1] if axes is None else [axes]
    many: dict[str, Any] = {"rasterized": True, "markersize": 1.0, "alpha": 0.5} if len(x) > MANY else {}
    labels = (f"deviation of {response}", "deviation, per cent")
    for panel, values, label in zip(panels, (deviation, percent), labels, strict=False):
        known = ~np.isnan(values)
        panel.plot(x[known], values[known], "o", color=look.MEASURED, **many)
        panel.axhline(0.0, color=look.MUTED, linewidth=0.8)
        panel.set_ylabel(label, parse_math=False)
    panels[-1].set_xlabel(x_label, parse_math=False)
    if axes is None:
        panels[0].set_title("observed - fitted")
    return cast(Figure, panels[0].figure)


MOST_TICKS = 5  #: frequencies along the axis, at most: of resonances alone they have six digits


@styled
def sweeps(table: pd.DataFrame, doubted: Collection[str] = (), *, axes: Axes | None = None) -> Figure:
    """Draw amplitude against frequency for each sweep of a record; sweeps in ``doubted`` with crosses."""
    figure, panel = look.build_panel(4.0, "frequency (Hz)", "amplitude", axes=axes)
    for sweep, rows in table.groupby("sweep", sort=False):
        ordered = rows.sort_values("frequency", kind="stable")
        mark, size = ("x-", 4.0) if str(sweep) in doubted else ("o-", 2.6)
        panel.plot(ordered["frequency"], ordered["amplitude"], mark, markersize=size, linewidth=0.8, label=str(sweep))
    panel.xaxis.set_major_locator(MaxNLocator(nbins=MOST_TICKS - 1))
    handles, labels = panel.get_legend_handles_labels()
    if len(labels) > look.MOST_LABELS // 4:
        handles, labels = [handles[0], handles[-1]], [labels[0], labels[-1]]
    panel.legend(handles, [describe_short(label) for label in labels], title="sweep")
    return figure


MOST_LETTERS = 24  #: letters of a line of a law's name beside its bar: the bars have the rest of the width
#: Errors below this many per cent are drawn at it: a law with as many parameters as points errs by rounding only.
SMALLEST = 0.01


@styled
def ranking(table: pd.DataFrame, *, axes: Axes | None = None) -> Figure:
    """Draw weights as bars beside held-out and fitted errors, best law on top; on ``axes`` the weights alone.

    Args:
        table: ``rank`` (missing where it could not be fitted), ``law, weight, held_out_error,
            average_absolute_percent`` (per cent of resonant amplitude) and ``physical``.
    """
    if axes is not None:
        shown = table.head(count_rows(axes, len(table)))
        _draw_weights(axes, shown, *name_rows(axes, shown["law"].astype(str).tolist()))
        if len(shown) < len(table):
            axes.set_xlabel(f"weight (probability), {len(shown)} of {len(table)} laws")
        return cast(Figure, axes.figure)
    lines = max(len(_wrap_name(law)) for law in table["law"].astype(str))
    figure, (weights, errors) = look.build_panels(0.9 + (0.08 + 0.13 * lines) * len(table), 1, 2, sharey=True)
    draw_plain_rows(weights, ["\n".join(_wrap_name(law)) for law in table["law"].astype(str)])
    _draw_weights(weights, table, np.arange(float(len(table))), 0.8)
    _draw_errors(errors, table)
    figure.legend(loc="outside upper right", ncols=2, handletextpad=0.2, columnspacing=1.2)
    return figure


def _wrap_name(law: str) -> list[str]:
    """The lines of a law's name; the name of a force stays whole."""
    return wrap(law, MOST_LETTERS, break_long_words=False, break_on_hyphens=False)


def _draw_weights(axes: Axes, table: pd.DataFrame, at: FloatArray, height: float) -> None:
    """Draw bars of a height at rows ``at``, which are already named."""
    draw_law_bars(axes, table["law"].astype(str).tolist(), table["weight"], at, height)
    for row, (weight, rank, physical) in zip(at, table[["weight", "rank", "physical"]].to_numpy(), strict=True):
        label = "not fitted" if pd.isna(rank) else "coefficient < 0" if not physical else format_share(weight)
        axes.annotate(label, (weight, row), (4, 0), **look.BESIDE)
    axes.set_xlim(0.0, max(0.05, 1.3 * table["weight"].max()))
    axes.set_xlabel("weight (probability)")


def draw_law_bars(axes: Axes, laws: Sequence[str], lengths: pd.Series, at: FloatArray, height: float = 0.8) -> None:
    """Draw a bar for each law in its colour, hatched where viscous damping stands beside another force."""
    colours = [law_style(law).colour for law in laws]
    hatches = ["///" if "viscous + " in law else "" for law in laws]
    axes.barh(at, lengths, height, color=colours, hatch=hatches, edgecolor="white", linewidth=0.0)


def _draw_errors(axes: Axes, table: pd.DataFrame) -> None:
    """Errors on a logarithmic axis: candidates differ by decades."""
    rows = np.arange(len(table))
    columns = table[["average_absolute_percent", "held_out_error"]].to_numpy(float)
    fitted, held_out = np.maximum(columns, SMALLEST).T
    axes.set_xscale("log")
    axes.hlines(rows, fitted, held_out, color=look.MUTED, linewidth=0.7)
    axes.plot(fitted, rows, "o", color="white", markeredgecolor=look.INK, markersize=5, label="fitted, mean absolute")
    if np.isfinite(held_out).any():
        axes.plot(held_out, rows, "o", color=look.INK, markersize=5, label="level held out, root mean square")
    axes.tick_params(axis="y", labelleft=False)
    look.plain_log(axes.xaxis)
    exact = "\n(at the edge: rounding)" if np.nanmin(columns, initial=1.0) < SMALLEST else ""
    axes.set_xlabel("error of amplitude (%)" + exact)


#: Shares of the draws inside the contours of a pair.
CONTENTS = (0.9, 0.5)
_BINS = 24
#: Parameters from which two long numbers below a panel run into one another.
_CROWDED = 4
#: Letters of a line of a name below all panels together: each name has its panel's width, and height beside it.
_LETTERS_ALONG = 70
#: Room for numbers and a name of two lines below the lowest panels, and for each further line there and beside, inches.
_BELOW = 0.8
_LINE = 0.13
_ABOVE = 0.38  #: room for a title of two lines above the highest, inches


@styled
def corner(draws: Mapping[str, FloatArray], prior: Mapping[str, FloatArray]) -> Figure:
    """Draw a posterior.

    Args:
        draws: label of each parameter, with its unit, and its draws (draws,).
        prior: draws of the prior under the same labels; its density is overlaid on the histograms.
    """
    labels = list(draws)
    size = len(labels)
    height = look.WIDTH * min(1.1, 0.4 + 0.2 * size)
    names = {label: _wrap_parameter(label, _LETTERS_ALONG // size) for label in labels}
    further = _LINE * max(0, max(name.count("\n") for name in names.values()) - 1)
    figure = Figure(figsize=(look.WIDTH, height), layout="none")  # type: ignore[arg-type]  # the stubs lack "none"
    figure.subplots_adjust(
        left=0.17 + further / look.WIDTH,
        right=0.94,
        bottom=(_BELOW + further) / height,
        top=1.0 - _ABOVE / height,
        wspace=0.12,
        hspace=0.2 + 0.06 * size,
    )
    axes = figure.subplots(size, size, squeeze=False)
    turned = 90.0 if size >= _CROWDED else 0.0
    limits = {label: np.percentile(draws[label], [0.25, 99.5]) for label in labels}
    for i, row in enumerate(labels):
        for j, column in enumerate(labels):
            if j > i:
                axes[i, j].remove()
                continue
            if i == j:
                _draw_alone(axes[i, i], draws[row], prior[row], limits[row])
            else:
                _pair(axes[i, j], draws[column], draws[row], (limits[column], limits[row]))
            beside = names[row] if j == 0 and i > 0 else ""
            _draw_edges(axes[i, j], names[column] if i == size - 1 else "", beside, turned)
            axes[i, j].set_xlim(*limits[column])
    figure.align_labels()
    axes[0, 0].legend(loc="upper left", bbox_to_anchor=(1.15, 1.0), borderaxespad=0.0)
    return figure


def _draw_alone(axes: Axes, values: FloatArray, prior: FloatArray, limits: FloatArray) -> None:
    """Histogram with the prior density over it; both integrate to 1 over all values, also those outside."""
    edges = np.linspace(limits[0], limits[1], _BINS + 1)
    heights = _density(values, edges)
    axes.stairs(heights, edges, fill=True, color=look.CREDIBLE, label="posterior")
    axes.stairs(_density(prior, edges), edges, color=look.LINEAR, linewidth=1.3, baseline=None, label="prior")
    low, median, high = np.percentile(values, [5.0, 50.0, 95.0])
    axes.vlines([low, high], 0.0, heights.max(), color=look.INK, linewidth=0.8, linestyle=(0, (3, 2)))
    axes.set_title(f"{median:.3g}\n({low:.3g} to {high:.3g})", fontsize=7, fontweight="normal", loc="center", pad=3)
    axes.set_ylim(0.0, 1.08 * heights.max())
    axes.grid(visible=False)


def _density(values: FloatArray, edges: FloatArray) -> FloatArray:
    return np.asarray(np.histogram(values, edges)[0] / (len(values) * np.diff(edges)))


def _pair(axes: Axes, x: FloatArray, y: FloatArray, limits: tuple[FloatArray, FloatArray]) -> None:
    """Filled contours that contain the shares ``CONTENTS`` of the draws, from a smoothed histogram."""
    counts, x_edges, y_edges = np.histogram2d(x, y, bins=_BINS, range=limits)
    smooth = gaussian_filter(counts, 1.3, mode="nearest")
    ordered = np.sort(smooth.ravel())[::-1]
    share = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(share, content)]) for content in CONTENTS]
    centres = [0.5 * (edges[1:] + edges[:-1]) for edges in (x_edges, y_edges)]
    if levels[0] < levels[1] < ordered[0]:
        axes.contourf(*centres, smooth.T, [*levels, ordered[0]], colors=[look.PREDICTIVE, look.CREDIBLE])
        axes.contour(*centres, smooth.T, levels, colors=[look.AVERAGE], linewidths=0.7)
    axes.set_ylim(*limits[1])


def _draw_edges(axes: Axes, x_label: str, y_label: str, turned: float) -> None:
    """Numbers, those below ``turned`` by degrees, and names on the outer axes only."""
    axes.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    axes.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
    below, beside = bool(x_label), bool(y_label)
    axes.tick_params(labelbottom=below, labelleft=beside, left=beside, labelsize=7, color=look.MUTED)
    axes.tick_params(axis="x", labelrotation=turned)
    axes.set_xlabel(x_label, fontsize=7.5)
    axes.set_ylabel(y_label, fontsize=7.5)


def _wrap_parameter(label: str, letters: int) -> str:
    """The name of a parameter in lines, its unit in the last."""
    name, *unit = label.split(" (", 1)
    return "\n".join([*wrap(name, letters), *(f"({own}" for own in unit)])


_LETTERS_BESIDE = 22  #: letters of a law's name beside a row of a panel
_COLUMNS = 3  #: panels beside one another


@styled
def predictive_check(table: pd.DataFrame, level: float) -> Figure:
    """Draw predictive intervals of resonant amplitude (per cent of the measured): one panel per sweep, one row per law.

    Args:
        table: ``law, sweep, median, low, high``; 100 is the measured amplitude.
        level: content of the intervals.
    """
    laws = [str(law) for law in table["law"].unique()]
    sweeps = list(table["sweep"].unique())
    columns = min(_COLUMNS, len(sweeps))
    rows = -(-len(sweeps) // columns)
    height = 0.5 + rows * (0.5 + 0.19 * len(laws))
    figure, panels = look.build_panels(height, rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(sweeps) :]:
        axes.remove()
    for axes, sweep, label in zip(panels.flat, sweeps, look.distinguish(sweeps, 8), strict=False):
        of_sweep = table[table["sweep"] == sweep]
        draw_plain_rows(axes, [describe_short(law, _LETTERS_BESIDE) for law in laws])
        axes.axvline(100.0, color=look.MEASURED, linewidth=1.2)
        for law, median, low, high in of_sweep[["law", "median", "low", "high"]].itertuples(index=False):
            row, colour = laws.index(str(law)), law_style(str(law)).colour
            axes.plot([low, high], [row, row], color=colour, linewidth=2.0)
            axes.plot(median, row, "o", color=colour, markersize=4.5, markeredgecolor="white")
        axes.set_title(f"sweep {label}")
    figure.supxlabel(f"{100 * level:g} % predictive interval of resonant amplitude (% of the measured)", fontsize=8.5)
    return figure
