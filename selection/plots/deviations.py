"""Deviations of a fit against a variable: the plots of the regression program (report, section 5.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from selection.arrays import FloatArray
from selection.plots.style import MEASURED, MUTED, WIDTH, styled

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
    figure = Figure(figsize=(WIDTH, 4.6))
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
