"""Damping ratio and Q of a resonance against its amplitude; measured sweeps beside those of a law.

A line is solid within the test and dashed beyond it, where the ground is hatched too.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from damping.arrays import FloatArray
from damping.plots.style import (
    AVERAGE,
    BEYOND,
    GRID,
    LINEAR,
    MEASURED,
    MUTED,
    PREDICTIVE,
    WIDTH,
    Drawing,
    describe_short,
    describe_with_unit,
    law_style,
    styled,
)

#: Ends of the band that a load is sized with, in words.
_BOUND = "the low end: a load is sized with it"


@styled
def damping_curve(table: pd.DataFrame, level: float, unit: str = "", tested: pd.DataFrame | None = None) -> Figure:
    """Draw the damping ratio, with Q on the right.

    Args:
        table: rows of a curve, ``amplitude, damping_ratio, damping_ratio_low, damping_ratio_high, tested``; NaN where
            there is none. level: content of the band. tested: of each sweep, ``amplitude, damping_ratio``.
    """
    figure = Drawing(figsize=(WIDTH, 3.4))
    axes = figure.add_subplot()
    draw_damping_curve(axes, table, level, unit, tested)
    figure.legend(handles=_list_curve_marks(level, tested is not None), loc="outside lower center", ncols=2)
    return figure


@styled
def draw_damping_curve(
    axes: Axes, table: pd.DataFrame, level: float, unit: str = "", tested: pd.DataFrame | None = None
) -> None:
    """Draw :func:`damping_curve` on ``axes``, without a legend."""
    rows = table[np.isfinite(table["damping_ratio"])].sort_values("amplitude", kind="stable")
    axes.set_xlabel(describe_with_unit("resonant amplitude", unit))
    axes.set_ylabel("damping ratio (%)")
    if rows.empty:
        axes.text(0.5, 0.5, "no prediction", transform=axes.transAxes, ha="center", color=MUTED)
        return
    A = rows["amplitude"].to_numpy(float)
    ratio, low, high = (
        100.0 * rows[name].to_numpy(float) for name in ("damping_ratio", "damping_ratio_low", "damping_ratio_high")
    )
    inside = rows["tested"].to_numpy(bool)
    edge = float(A[inside].max()) if inside.any() else float(A.min())
    axes.fill_between(A, low, high, facecolor=PREDICTIVE, linewidth=0)
    shade_beyond(axes, edge, float(A.max()))
    within = edge >= A
    beyond = (edge <= A) if inside.any() else np.full(len(A), True)
    axes.plot(A[within], ratio[within], color=AVERAGE, linewidth=2.2)
    axes.plot(A[beyond], ratio[beyond], color=AVERAGE, linewidth=2.2, linestyle=(0, (4, 1.5)))
    axes.plot(A, low, color=LINEAR, linewidth=1.2)
    if tested is not None:
        axes.plot(tested["amplitude"], 100.0 * tested["damping_ratio"], "o", color=MEASURED, mec="white", zorder=5)
    first = A.min() if tested is None else min(float(A.min()), float(tested["amplitude"].min()))
    spare = 0.03 * (A.max() - first) or 0.05 * A.max()
    axes.set_xlim(first - spare, A.max() + spare)
    axes.set_ylim(0.0, 1.12 * max(np.nanmax(high), 0.0 if tested is None else 100.0 * tested["damping_ratio"].max()))
    right = axes.secondary_yaxis("right", functions=(_to_q, _to_q))
    right.set_ylabel("Q")
    right.yaxis.set_major_locator(_QTicks())


class _QTicks(MaxNLocator):
    """Round values of Q where the axis of damping ratios, which runs the other way from infinity, has room."""

    def tick_values(self, vmin: float, vmax: float) -> FloatArray:
        """Round values whose damping ratios lie at least a tenth of the axis apart."""
        least = min(abs(vmin), abs(vmax))
        decade = 10.0 ** np.floor(np.log10(least))
        values = [m * decade * ten for ten in (1.0, 10.0) for m in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0)]
        kept: list[float] = []
        for value in values:
            if value >= least and (not kept or least / kept[-1] - least / value > 0.12):
                kept.append(value)
        return np.array(kept)


def _to_q(percent: FloatArray) -> FloatArray:
    """1/(2 zeta) of a damping ratio in per cent, and back."""
    return 50.0 / np.maximum(np.asarray(percent, dtype=float), 1e-9)


def shade_beyond(axes: Axes, edge: float, end: float) -> None:
    """Hatch the ground from ``edge`` on, beyond which nothing was tested."""
    if end > edge:
        axes.axvspan(edge, end, facecolor=BEYOND, edgecolor=GRID, hatch="///", linewidth=0, zorder=0)


def _list_curve_marks(level: float, tested: bool) -> list[Line2D | Patch]:
    dashed = (0, (4, 1.5))
    marks: list[Line2D | Patch] = [Line2D([], [], color=AVERAGE, linewidth=2.2, label="median, tested amplitudes")]
    marks.append(
        Line2D([], [], color=AVERAGE, linewidth=2.2, linestyle=dashed, label="median, beyond the test (hatched)")
    )
    marks.append(Patch(color=PREDICTIVE, label=f"{100 * level:g} % band"))
    marks.append(Line2D([], [], color=LINEAR, linewidth=1.2, label=_BOUND))
    if tested:
        marks.append(Line2D([], [], marker="o", color=MEASURED, linestyle="", label="measured, a sweep each"))
    return marks


#: Sweeps drawn beside the fit at most, evenly from the lowest level to the highest.
MOST_SWEEPS = 5


@styled
def fitted_sweeps(measured: pd.DataFrame, fitted: pd.DataFrame, law: str, unit: str = "") -> Figure:
    """Draw measured sweeps with the curves of one law through them; resonances alone as force against amplitude.

    Args:
        measured: ``sweep, x, y``. fitted: the same columns, rows of a sweep in order of x. law: its name, for the
            legend. ``x`` is frequency in Hz and ``y`` amplitude in ``unit``.
    """
    figure = Drawing(figsize=(WIDTH, 3.6))
    axes = figure.add_subplot()
    sweeps = list(dict.fromkeys(measured["sweep"]))
    for number, sweep in enumerate(sweeps):
        shade = str(0.15 + 0.5 * number / max(len(sweeps) - 1, 1))
        rows, line = measured[measured["sweep"] == sweep], fitted[fitted["sweep"] == sweep]
        axes.plot(rows["x"], rows["y"], "o", color=shade, markersize=3.2, mec="white", mew=0.3, zorder=3)
        axes.plot(line["x"], line["y"], color=law_style(law).colour, linewidth=1.3)
        top = rows.iloc[int(rows["y"].argmax())]
        axes.annotate(
            describe_short(sweep), (top["x"], top["y"]), (5, 3), textcoords="offset points", fontsize=7.5, color=shade
        )
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylabel(describe_with_unit("amplitude", unit))
    axes.margins(x=0.06, y=0.1)
    marks = [
        Line2D(
            [], [], marker="o", color=MEASURED, linestyle="", label=f"measured, {len(sweeps)} sweeps by their labels"
        ),
        Line2D([], [], color=law_style(law).colour, linewidth=1.3, label=f"fitted: {describe_short(law, 48)}"),
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=2)
    return figure
