"""Calibration: coverage of bands, widths, selection errors against noise, ranks of true parameters."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import binomtest

from selection.arrays import FloatArray
from selection.plots.style import ALERT, AVERAGE, CREDIBLE, INK, MUTED, PREDICTIVE, WIDTH, law_style, styled


@styled
def coverage(table: pd.DataFrame, level: float) -> Figure:
    """Share of next tests inside the band, by extrapolation ratio, levels, noise and structure, with 95 % intervals.

    Args:
        table: ``structure, levels, noise, ratio, predicted, inside`` (counts). level: content of the bands.
    """
    figure = Figure(figsize=(WIDTH, 4.8))
    groups = {
        "ratio": "force over largest tested",
        "levels": "levels tested",
        "noise": "noise, % of amplitude",
        "structure": "structure",
    }
    grid = figure.add_gridspec(2, 3)
    axes = [figure.add_subplot(place) for place in (grid[0, 0], grid[0, 1], grid[0, 2], grid[1, :])]
    for ax, (column, label) in zip(axes, groups.items(), strict=True):
        counts = table.groupby(column, sort=False)[["inside", "predicted"]].sum()
        _shares(ax, counts, 100.0 if column == "noise" else 1.0)
        ax.axhline(level, color=ALERT, linewidth=1.0, linestyle="--")
        ax.set_xlabel(label)
        ax.set_ylim(min(0.8, axes[0].get_ylim()[0]), 1.01)
    figure.supylabel(f"share of next tests inside the {100 * level:g} % band", fontsize=8.5)
    return figure


def _shares(ax: Axes, counts: pd.DataFrame, scale: float) -> None:
    """Shares with Wilson intervals at equally spaced places."""
    place = np.arange(len(counts))
    found = [binomtest(int(k), int(n)) for k, n in counts.itertuples(index=False)]
    limits = [result.proportion_ci(0.95, "wilson") for result in found]
    ax.vlines(place, [limit.low for limit in limits], [limit.high for limit in limits], color=CREDIBLE, linewidth=4)
    ax.plot(place, [result.statistic for result in found], "o", color=AVERAGE, markersize=4)
    labels = [
        name.replace(" + ", " +\n").replace("-", "-\n") if isinstance(name, str) else f"{scale * name:g}"
        for name in counts.index
    ]
    ax.set_xticks(place, labels)
    ax.set_xlim(-0.6, len(counts) - 0.4)
    ax.grid(visible=False, axis="x")


@styled
def widths(table: pd.DataFrame, goals: dict[float, float]) -> Figure:
    """Median high/low against extrapolation ratio, a line for each number of levels and a panel for each noise.

    Args:
        table: ``levels, noise, ratio, width`` (medians over trials). goals: ratio to largest high/low wanted.
    """
    figure = Figure(figsize=(WIDTH, 2.8))
    noises = sorted(table["noise"].unique())
    axes = np.atleast_1d(figure.subplots(1, len(noises), sharey=True))
    for ax, noise in zip(axes, noises, strict=True):
        for line, (levels, rows) in zip(
            ("-", "--", ":"), table[table["noise"] == noise].groupby("levels"), strict=False
        ):
            median = rows.groupby("ratio")["width"].median()
            ax.plot(
                median.index, median, marker="o", markersize=3, color=AVERAGE, linestyle=line, label=f"{levels} levels"
            )
        ax.plot(list(goals), list(goals.values()), "v", color=ALERT, label="goal: at most")
        ax.set_title(f"noise {100 * noise:g} %")
        ax.set_xlabel("force over tested")
    axes[0].set_ylabel("high/low of the band")
    axes[0].legend()
    return figure


@styled
def selection_errors(table: pd.DataFrame) -> Figure:
    """How often the true law wins and how often a false term enters, against noise, for each structure.

    Args:
        table: ``structure, noise, trials, true_wins, false_term`` (counts).
    """
    figure = Figure(figsize=(WIDTH, 3.4))
    counts = (
        table.groupby(["structure", "noise"], sort=False)[["trials", "true_wins", "false_term"]].sum().reset_index()
    )
    left, right = figure.subplots(1, 2, sharey=True, sharex=True)
    for structure, rows in counts.groupby("structure", sort=False):
        colour, line = law_style(str(structure))
        for ax, column in ((left, "true_wins"), (right, "false_term")):
            ax.plot(
                100.0 * rows["noise"], rows[column] / rows["trials"], marker="o", markersize=3.5,
                color=colour, linestyle=line, label=structure if ax is left else None,
            )  # fmt: skip
    for ax, title in ((left, "the true law wins"), (right, "a false term is in the winner")):
        ax.set_title(title)
        ax.set_xscale("log")
        ax.set_xticks(100.0 * np.sort(counts["noise"].unique()))
        ax.xaxis.set_major_formatter(lambda value, position: f"{value:g}")
        ax.minorticks_off()
        ax.set_xlabel("noise, % of amplitude")
        ax.set_ylim(-0.03, 1.03)
    left.set_ylabel("share of trials")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


@styled
def rank_ecdfs(
    found: dict[str, dict[str, FloatArray]], band: dict[int, tuple[FloatArray, FloatArray]], counts: dict[str, int]
) -> Figure:
    """ECDF of ranks less the uniform one, every parameter of a law in a panel, in the simultaneous band.

    Args:
        found: law to parameter to ECDF at k/(n + 1). band: number of trials to (low, high). counts: law to trials.
    """
    columns = 3
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(WIDTH, 1.2 * rows))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for ax, (law, parameters) in zip(panels, found.items(), strict=False):
        z = np.linspace(0.0, 1.0, len(next(iter(parameters.values()))) + 2)[1:-1]
        low, high = band[counts[law]]
        ax.fill_between(z, low - z, high - z, color=PREDICTIVE, linewidth=0)
        for ecdf in parameters.values():
            ax.plot(z, ecdf - z, color=AVERAGE, linewidth=0.8)
        ax.set_title(law, fontsize=7)
    for ax in panels[len(found) :]:
        ax.set_visible(False)
    figure.supxlabel("rank of the true value among posterior draws, relative", fontsize=8.5)
    figure.supylabel("ECDF less uniform", fontsize=8.5)
    return figure


@styled
def rank_histograms(found: dict[str, FloatArray], bins: int, most: int) -> Figure:
    """Histograms of the ranks of all parameters of a law together, with the 99 % range of a uniform count.

    Args:
        found: law to ranks 0..most of one parameter a trial, (trials,), the amplitude beyond the test.
    """
    from scipy.stats import binom  # noqa: PLC0415 - one use

    columns = 3
    rows = -(-len(found) // columns)
    figure = Figure(figsize=(WIDTH, 1.1 * rows))
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for ax, (law, ranks) in zip(panels, found.items(), strict=False):
        low, high = binom.interval(0.99, len(ranks), 1.0 / bins)
        ax.axhspan(low, high, color=PREDICTIVE, linewidth=0)
        ax.hist(ranks, bins=bins, range=(0, most + 1), color=MUTED, edgecolor="white", linewidth=0.5)
        ax.axhline(len(ranks) / bins, color=INK, linewidth=0.7)
        ax.set_title(law, fontsize=7)
        ax.set_ylim(0)
    for ax in panels[len(found) :]:
        ax.set_visible(False)
    figure.supxlabel("rank of the true amplitude beyond the test among posterior draws", fontsize=8.5)
    return figure
