"""Maps over sweep and frequency, one panel a quantity: residuals of the simulation, or footprint of an explanation."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from selection.plots.style import WIDTH, plain_rows, styled

#: Marks of the colour bar, in units of noise.
_TICKS = [-1000, -100, -10, -2, 0, 2, 10, 100, 1000]


@styled
def gap_map(rows: pd.DataFrame, label: str) -> Figure:
    """Draw one coloured mark a row of the record, sweeps one below the other.

    Args:
        rows: ``sweep, frequency (Hz), quantity, value`` with the value in units of noise.
        label: what the colour is.
    """
    quantities = list(rows["quantity"].unique())
    sweeps = list(rows["sweep"].unique())
    figure = Figure(figsize=(WIDTH, 1.5 + 0.24 * len(sweeps)))
    axes = figure.subplots(1, len(quantities), sharey=True, squeeze=False)[0]
    reach = max(3.0, float(np.nanquantile(rows["value"].abs(), 0.99)))
    norm = SymLogNorm(linthresh=2.0, vmin=-reach, vmax=reach)
    drawn = None
    for ax, quantity in zip(axes, quantities, strict=True):
        own = rows[rows["quantity"] == quantity]
        heights = [sweeps.index(sweep) for sweep in own["sweep"]]
        drawn = ax.scatter(own["frequency"], heights, c=own["value"], norm=norm, cmap="RdBu_r", marker="s", s=26)
        ax.set_title(quantity)
        ax.set_xlabel("frequency (Hz)")
        ax.locator_params(axis="x", nbins=5)
        plain_rows(ax, [f"sweep {sweep}" for sweep in sweeps])
    if drawn is not None:
        bar = figure.colorbar(drawn, ax=list(axes), label=label, shrink=0.9, format="%g")
        bar.set_ticks([tick for tick in _TICKS if abs(tick) <= reach])
        bar.outline.set_visible(False)
        if bar.solids is not None:
            bar.solids.set(rasterized=False, edgecolor="face")  # a page shows no pictures inside of drawings
    return figure
