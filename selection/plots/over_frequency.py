"""Parts of the figures of chapter III: axes over frequency, bands, printed and computed points."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.arrays import FloatArray
from selection.plots.style import AVERAGE, CREDIBLE, LINEAR, MEASURED, WIDTH

OMEGA = "frequency ω (rad/s)"
PITCH, YAW = "#0072b2", "#d55e00"
DASH, DOT = (0, (5, 2)), (0, (1.2, 1.6))
#: Median, low and high end of a curve over frequency.
Curve = tuple[FloatArray, FloatArray, FloatArray]


def single(y_label: str) -> tuple[Figure, Axes]:
    """A figure of one panel over frequency."""
    figure = Figure(figsize=(0.72 * WIDTH, 3.3))
    axes = figure.add_subplot()
    axes.set_xlabel(OMEGA)
    axes.set_ylabel(y_label)
    return figure, axes


def band(axes: Axes, omega: FloatArray, curve: Curve, label: str) -> None:
    """A curve with its band."""
    median, low, high = curve
    axes.fill_between(omega, low, high, color=CREDIBLE, linewidth=0, label=label)
    axes.plot(omega, median, color=AVERAGE, linewidth=1.3)


def printed(axes: Axes, omega: FloatArray | pd.Series, y: FloatArray | pd.Series, label: str) -> None:
    """Printed points: open circles."""
    axes.plot(omega, y, "o", color="none", markeredgecolor=MEASURED, markersize=5.5, zorder=4, label=label)


def computed(axes: Axes, omega: FloatArray | pd.Series, y: FloatArray | pd.Series, label: str) -> None:
    """Computed points: dots that fit into the circles."""
    axes.plot(omega, y, ".", color=LINEAR, markersize=4.5, zorder=5, label=label)


def from_zero(axes: Axes) -> None:
    """Axis from zero, with room above for the legend."""
    axes.set_ylim(0.0, 1.45 * axes.dataLim.ymax)
    axes.legend(loc="upper left", fontsize=7.5)
