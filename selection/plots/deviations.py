"""Deviations of a fit against a variable: the plots of the regression program (report, section 5.2)."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from selection.arrays import FloatArray
from selection.plots.style import MEASURED, MUTED, WIDTH, styled


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
    figure = Figure(figsize=(WIDTH, 4.6))
    above, below = figure.subplots(2, 1, sharex=True)
    known = ~np.isnan(percent)
    above.plot(x, deviation, "o", color=MEASURED)
    below.plot(x[known], percent[known], "o", color=MEASURED)
    for axes, label in ((above, f"deviation of {response}"), (below, "deviation, per cent")):
        axes.axhline(0.0, color=MUTED, linewidth=0.8)
        axes.set_ylabel(label, parse_math=False)
    below.set_xlabel(x_label, parse_math=False)
    above.set_title("observed - fitted")
    return figure
