"""Calibration: coverage of bands, ranks of true parameters.

Design-load bands of one real structure: bands beyond the test, higher levels left out and predicted, the parts.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator
from scipy.stats import binomtest

from damping.arrays import FloatArray
from damping.plots import (
    ALERT,
    AVERAGE,
    BEYOND,
    CREDIBLE,
    INK,
    LINEAR,
    MEASURED,
    MUTED,
    PREDICTIVE,
    TEXT_WIDTH,
    plain_log,
    styled,
)


@styled
def coverage(table: pd.DataFrame, level: float) -> Figure:
    """Share of next tests inside the band and above it, one row per structure, one mark per ratio, with 95 % intervals.

    Args:
        table: ``truth, ratio, given, held, above`` (counts). level: content of the bands.
    """
    names = list(dict.fromkeys(table["truth"]))[::-1]
    figure = Figure(figsize=(TEXT_WIDTH, 0.28 * len(names) + 1.0))
    left, right = figure.subplots(1, 2, sharey=True)
    for ax, column, goal in ((left, "held", level), (right, "above", 0.5 * (1.0 - level))):
        ax.axvline(goal, color=ALERT, linewidth=1.0, linestyle="--")
        for shift, ratio in zip((-0.22, 0.0, 0.22), sorted(set(table["ratio"].to_numpy(float))), strict=True):
            rows = table[table["ratio"] == ratio]
            place = np.array([names.index(name) for name in rows["truth"]]) + shift
            shares = [binomtest(int(k), int(n)) for k, n in zip(rows[column], rows["given"], strict=True)]
            limits = [result.proportion_ci(0.95, "wilson") for result in shares]
            ax.hlines(place, [limit.low for limit in limits], [limit.high for limit in limits], color=CREDIBLE)
            ax.plot([result.statistic for result in shares], place, "o", markersize=2 + ratio / 2, color=AVERAGE,
                    label=f"{ratio:g} times")  # fmt: skip
        ax.set_xlim(-0.02, 1.02)
    left.set_yticks(np.arange(len(names)), names)
    left.set_xlabel(f"share inside the {100 * level:g} % band")
    right.set_xlabel("share above it")
    right.legend()
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
    figure = Figure(figsize=(TEXT_WIDTH, 1.2 * rows))
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
    figure = Figure(figsize=(TEXT_WIDTH, 1.1 * rows))
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


_PARTS = {
    "measurement_noise": ("measurement noise", "#999933"),
    "parameters": ("parameters", "#56b4e9"),
    "between_model": ("between models", "#d55e00"),
    "discrepancy": ("discrepancy", "#0b2545"),
}


@styled
def real_bands(bands: pd.DataFrame, tested: pd.DataFrame, left_out: pd.DataFrame, force: str, amplitude: str) -> Figure:
    """Three panels side by side.

    Args:
        bands: over a grid of forces, ``force, ratio, median, low, high, credible_low, credible_high, linear`` and the
            standard deviations of the parts in per cent.
        tested: ``sweep, force, amplitude``. left_out: of ``leave_higher_levels_out``. force, amplitude: axis labels.
    """
    figure = Figure(figsize=(1.35 * TEXT_WIDTH, 3.1))
    axes = figure.subplots(1, 3, width_ratios=[5, 3.4, 3.4])
    _draw_bands(axes[0], bands, tested)
    axes[0].set_xlabel(force)
    axes[0].set_ylabel(amplitude)
    _draw_left_out(axes[1], left_out)
    _draw_parts(axes[2], bands)
    return figure


def _draw_bands(ax: Axes, bands: pd.DataFrame, tested: pd.DataFrame) -> None:
    """Resonant amplitude against force, both logarithmic."""
    ax.axvspan(tested["force"].max(), bands["force"].max(), color=BEYOND, linewidth=0, zorder=0)
    ax.fill_between(bands["force"], bands["low"], bands["high"], color=PREDICTIVE, linewidth=0, label="90 % predictive")
    ax.fill_between(
        bands["force"],
        bands["credible_low"],
        bands["credible_high"],
        color=CREDIBLE,
        linewidth=0,
        label="90 % credible",
    )
    ax.plot(bands["force"], bands["median"], color=AVERAGE, label="median")
    ax.plot(bands["force"], bands["linear"], color=LINEAR, linestyle=(0, (7, 2)), label="linear")
    ax.plot(tested["force"], tested["amplitude"], "o", color=MEASURED, markeredgecolor="white", label="tested")
    ax.set_xscale("log")
    ax.set_yscale("log")
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(lambda value, position: f"{value:g}")
        axis.set_minor_locator(NullLocator())
    ax.set_xlim(bands["force"].min(), bands["force"].max())
    ax.set_title("beyond the test")
    ax.legend()


def _draw_left_out(ax: Axes, left_out: pd.DataFrame) -> None:
    """Bands relative to what was measured at levels left out; a cross where the prediction was refused."""
    place = np.arange(len(left_out))
    low, median, high = (left_out[name] / left_out["measured"] for name in ("low", "median", "high"))
    ax.vlines(place, low, high, color=CREDIBLE, linewidth=5)
    ax.plot(place, median, "o", color=AVERAGE, markersize=4)
    linear = 1.0 + left_out["linear_over_percent"] / 100.0
    ax.plot(place, linear, "_", color=LINEAR, markersize=9, markeredgewidth=1.8)
    refused = left_out["refused"].to_numpy(bool)
    ax.plot(place[refused], np.ones(refused.sum()), "x", color=ALERT)
    ax.axhline(1.0, color=MEASURED, linewidth=0.8)
    labels = [f"{r.sweep}\nfrom {r.levels}\n× {r.ratio:.1f}" for r in left_out.itertuples()]
    ax.set_xticks(place, labels, fontsize=6.5)
    ax.set_xlim(-0.6, len(left_out) - 0.4)
    ax.grid(visible=False, axis="x")
    ax.set_ylabel("predicted over measured")
    ax.set_title("higher levels left out")


def _draw_parts(ax: Axes, bands: pd.DataFrame) -> None:
    """Standard deviation of each part against the extrapolation ratio."""
    for name, (label, colour) in _PARTS.items():
        ax.plot(bands["ratio"], bands[name], color=colour, label=label)
    ax.plot(
        bands["ratio"],
        np.sqrt((bands[list(_PARTS)] ** 2).sum(axis=1, min_count=1)),
        color=MEASURED,
        lw=1.0,
        ls=":",
        label="whole",
    )
    ax.set_xscale("log")
    plain_log(ax.xaxis)
    ax.set_xlabel("force over largest tested")
    ax.set_ylabel("standard deviation, % of amplitude")
    ax.set_title("four parts")
    ax.legend()
