"""Energy loss per cycle as a surface over amplitude and frequency, with the points it was fitted to (Fig. 5.1)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from selection.arrays import FloatArray
from selection.plots.style import INK, MOST_LABELS, WIDTH, styled


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
