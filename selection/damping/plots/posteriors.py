"""Corner plot: every parameter of a posterior alone, and every pair.

Would the law have predicted the tests it was fitted to?
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import gaussian_filter

from damping.arrays import FloatArray
from damping.plots.style import (
    AVERAGE,
    CREDIBLE,
    INK,
    LINEAR,
    MEASURED,
    MUTED,
    PREDICTIVE,
    WIDTH,
    describe_short,
    distinguish,
    draw_plain_rows,
    law_style,
    styled,
)

#: Shares of the draws inside the contours of a pair.
CONTENTS = (0.9, 0.5)
_BINS = 24


@styled
def corner(draws: Mapping[str, FloatArray], prior: Mapping[str, FloatArray]) -> Figure:
    """Draw a posterior.

    Args:
        draws: label of each parameter, with its unit, and its draws (draws,).
        prior: draws of the prior under the same labels; its density is overlaid on the histograms.
    """
    labels = list(draws)
    size = len(labels)
    height = WIDTH * min(1.1, 0.4 + 0.2 * size)
    figure = Figure(figsize=(WIDTH, height), layout="none")  # type: ignore[arg-type]  # the stubs lack "none"
    figure.subplots_adjust(left=0.16, right=0.96, bottom=0.12, top=0.92, wspace=0.12, hspace=0.2 + 0.06 * size)
    axes = figure.subplots(size, size, squeeze=False)
    limits = {label: _limits(draws[label]) for label in labels}
    for i, row in enumerate(labels):
        for j, column in enumerate(labels):
            if j > i:
                axes[i, j].remove()
                continue
            if i == j:
                _draw_alone(axes[i, i], draws[row], prior[row], limits[row])
            else:
                _pair(axes[i, j], draws[column], draws[row], (limits[column], limits[row]))
            _draw_edges(axes[i, j], column if i == size - 1 else "", row if j == 0 and i > 0 else "")
            axes[i, j].set_xlim(limits[column])
    figure.align_labels()
    axes[0, 0].legend(loc="upper left", bbox_to_anchor=(1.15, 1.0), borderaxespad=0.0)
    return figure


def _limits(values: FloatArray) -> tuple[float, float]:
    low, high = np.percentile(values, [0.25, 99.5])
    return float(low), float(high)


def _draw_alone(axes: Axes, values: FloatArray, prior: FloatArray, limits: tuple[float, float]) -> None:
    """Histogram with the prior density over it; both integrate to 1 over all values, also those out of sight."""
    edges = np.linspace(*limits, _BINS + 1)
    heights = _density(values, edges)
    axes.stairs(heights, edges, fill=True, color=CREDIBLE, label="posterior")
    axes.stairs(_density(prior, edges), edges, color=LINEAR, linewidth=1.3, baseline=None, label="prior")
    low, median, high = np.percentile(values, [5.0, 50.0, 95.0])
    axes.vlines([low, high], 0.0, heights.max(), color=INK, linewidth=0.8, linestyle=(0, (3, 2)))
    said = f"{median:.3g}\n({low:.3g} to {high:.3g})"
    axes.set_title(said, fontsize=7, fontweight="normal", loc="center", pad=3)
    axes.set_ylim(0.0, 1.08 * heights.max())
    axes.grid(visible=False)


def _density(values: FloatArray, edges: FloatArray) -> FloatArray:
    return np.asarray(np.histogram(values, edges)[0] / (len(values) * np.diff(edges)))


def _pair(axes: Axes, x: FloatArray, y: FloatArray, limits: tuple[tuple[float, float], tuple[float, float]]) -> None:
    """Filled contours that hold the shares ``CONTENTS`` of the draws, from a smoothed histogram."""
    counts, x_edges, y_edges = np.histogram2d(x, y, bins=_BINS, range=limits)
    smooth = gaussian_filter(counts, 1.3, mode="nearest")
    ordered = np.sort(smooth.ravel())[::-1]
    share = np.cumsum(ordered) / ordered.sum()
    levels = [float(ordered[np.searchsorted(share, content)]) for content in CONTENTS]
    centres = [0.5 * (edges[1:] + edges[:-1]) for edges in (x_edges, y_edges)]
    if levels[0] < levels[1] < ordered[0]:
        axes.contourf(*centres, smooth.T, [*levels, ordered[0]], colors=[PREDICTIVE, CREDIBLE])
        axes.contour(*centres, smooth.T, levels, colors=[AVERAGE], linewidths=0.7)
    axes.set_ylim(limits[1])


def _draw_edges(axes: Axes, x_label: str, y_label: str) -> None:
    """Numbers and names on the outer axes only."""
    axes.xaxis.set_major_locator(MaxNLocator(3, prune="both"))
    axes.yaxis.set_major_locator(MaxNLocator(3, prune="both"))
    axes.tick_params(labelbottom=bool(x_label), labelleft=bool(y_label), left=bool(y_label), labelsize=7, color=MUTED)
    axes.set_xlabel(x_label.replace(" (", "\n("), fontsize=7.5)
    axes.set_ylabel(y_label.replace(" (", "\n("), fontsize=7.5)


#: Letters of a law's name beside a row.
_MOST_LETTERS = 22
#: Panels beside one another.
_COLUMNS = 3


@styled
def predictive_check(table: pd.DataFrame, level: float) -> Figure:
    """Draw predictive intervals of resonant amplitude, in per cent of the measured: a panel a sweep, a row a law.

    Args:
        table: ``law, sweep, median, low, high``; 100 is the measured amplitude. level: content of the intervals.
    """
    laws = [str(law) for law in table["law"].unique()]
    sweeps = list(table["sweep"].unique())
    columns = min(_COLUMNS, len(sweeps))
    rows = -(-len(sweeps) // columns)
    figure = Figure(figsize=(WIDTH, 0.5 + rows * (0.5 + 0.19 * len(laws))))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in panels[len(sweeps) :]:
        axes.remove()
    for axes, sweep, label in zip(panels, sweeps, distinguish(sweeps, 8), strict=False):
        of_sweep = table[table["sweep"] == sweep]
        draw_plain_rows(axes, [describe_short(law, _MOST_LETTERS) for law in laws])
        axes.axvline(100.0, color=MEASURED, linewidth=1.2)
        for law, median, low, high in of_sweep[["law", "median", "low", "high"]].itertuples(index=False):
            row, colour = laws.index(str(law)), law_style(str(law)).colour
            axes.plot([low, high], [row, row], color=colour, linewidth=2.0)
            axes.plot(median, row, "o", color=colour, markersize=4.5, markeredgecolor="white")
        axes.set_title(f"sweep {label}")
    figure.supxlabel(f"{100 * level:g} % predictive interval of resonant amplitude (% of the measured)", fontsize=8.5)
    return figure
