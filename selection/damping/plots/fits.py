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
from damping.plots.scales import plain_log
from damping.records.text import SUPERSCRIPT, format_share

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
    plain_log(axes.xaxis)
    exact = "\n(at the edge: rounding)" if np.nanmin(columns, initial=1.0) < SMALLEST else ""
    axes.set_xlabel("error of amplitude (%)" + exact)


#: Shares of the draws inside the contours of a pair.
CONTENTS = (0.9, 0.5)
_BINS = 24
#: Parameters from which two long numbers below a panel run into one another.
_CROWDED = 4
#: Letters of a line of a name below all panels together, for an inch: each name has its panel's width, and height
#: beside it.
_LETTERS_ALONG = 13.5
_NAME_SIZE = 7.5  #: size of a name, points, smaller where a word is longer than its panel is wide
_MOST_UNIT_LINES = 2  #: lines of a unit: the rest of a longer one is left out
#: Values are in units of a power of 10^3 unless 90 % of them end between: longer numbers run into one another.
_PLAIN = (0.01, 1e4)
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
    width = look.WIDTH if size <= _CROWDED else look.TEXT_WIDTH
    height = width * min(1.1, 0.4 + 0.2 * size)
    powers = {label: _find_power(draws[label]) for label in labels}
    draws, prior = ({label: own[label] / 10.0 ** powers[label] for label in labels} for own in (draws, prior))
    letters = int(_LETTERS_ALONG * width / size)
    names = {label: _wrap_parameter(label, letters, powers[label]) for label in labels}
    widest = max(len(line) for name in names.values() for line in name.split("\n"))
    named = _NAME_SIZE * min(1.0, letters / widest)
    further = _LINE * max(0, max(name.count("\n") for name in names.values()) - 1)
    figure = Figure(figsize=(width, height), layout="none")  # type: ignore[arg-type]  # the stubs lack "none"
    figure.subplots_adjust(
        left=(0.17 * look.WIDTH + further) / width,
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
            left = names[row] if j == 0 and i > 0 else ""
            _draw_edges(axes[i, j], names[column] if i == size - 1 else "", left, turned, named)
            axes[i, j].set_xlim(*limits[column])
    figure.align_labels()
    beside: Any = {"loc": "upper left", "bbox_to_anchor": (1.15, 1.0), "borderaxespad": 0.0}
    axes[0, 0].legend(**(beside if size > 1 else {}))
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


def _draw_edges(axes: Axes, x_label: str, y_label: str, turned: float, size: float) -> None:
    """Numbers, those below ``turned`` by degrees, and names of a ``size`` in points on the outer axes only."""
    axes.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    axes.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
    below, beside = bool(x_label), bool(y_label)
    axes.tick_params(labelbottom=below, labelleft=beside, left=beside, labelsize=7, color=look.MUTED)
    axes.tick_params(axis="x", labelrotation=turned)
    axes.set_xlabel(x_label, fontsize=size)
    axes.set_ylabel(y_label, fontsize=size)


def _find_power(values: FloatArray) -> int:
    """The power of ten, a multiple of 3, in whose units values are drawn."""
    size = float(np.abs(np.percentile(values, (5.0, 95.0))).max())
    return 0 if size == 0.0 or _PLAIN[0] <= size < _PLAIN[1] else 3 * int(np.floor(np.log10(size) / 3.0))


def _wrap_parameter(label: str, letters: int, power: int) -> str:
    """The name of a parameter in lines, below it its unit with the power of ten."""
    name, _, unit = label.partition(" (")
    ten = f"10{str(power).translate(SUPERSCRIPT)} " if power else ""
    lines = wrap(ten + unit.removesuffix(")"), letters, break_on_hyphens=False)
    if len(lines) > _MOST_UNIT_LINES:
        lines = [*lines[: _MOST_UNIT_LINES - 1], describe_short(lines[_MOST_UNIT_LINES - 1] + "…", letters)]
    beside = [f"({chr(10).join(lines)})"] if lines else []
    return "\n".join([*wrap(name, letters, break_long_words=False), *beside])


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
    panels[0, 0].xaxis.set_major_locator(MaxNLocator(MOST_TICKS - 2))
    figure.supxlabel(f"{100 * level:g} % predictive interval of resonant amplitude (% of the measured)", fontsize=8.5)
    return figure
