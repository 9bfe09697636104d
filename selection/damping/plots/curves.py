"""Damping ratio and Q over amplitude, measured and fitted sweeps, and resonant amplitude from the test to the loads.

A line is solid within the test and dashed beyond it, where the background is also hatched.
"""

from operator import itemgetter
from textwrap import wrap
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from damping import plots as look
from damping.plots import build_panel, build_panels, describe_with_unit, distinguish, law_style, styled
from damping.records.text import count

_MEDIAN: Any = {"color": look.AVERAGE, "linewidth": 2.2}  #: the median within the test
_MEDIAN_BEYOND: Any = _MEDIAN | {"linestyle": (0, (4, 1.5))}  #: the same beyond it
#: The prediction of linear damping beyond the test.
_LINEAR: Any = {"color": look.LINEAR, "linewidth": 1.4, "linestyle": (0, (7, 2))}


@styled
def damping_curve(
    table: pd.DataFrame, level: float, unit: str = "", tested: pd.DataFrame | None = None, *, axes: Axes | None = None
) -> Figure:
    """Draw the damping ratio, with Q on the right.

    Args:
        table: rows of a curve, ``amplitude, damping_ratio, damping_ratio_low, damping_ratio_high, tested``; NaN where
            there is none.
        level: content of the band.
        tested: of each sweep, ``amplitude, damping_ratio``.
    """
    figure, panel = build_panel(3.7, describe_with_unit("resonant amplitude", unit), "damping ratio (%)", axes=axes)
    _draw_damping_ratio(panel, table, tested)
    marks = [
        *_build_median_marks()[: 2 if not table["tested"].all() else 1],
        Patch(color=look.PREDICTIVE, label=f"{100 * level:g} % predictive band"),
        Line2D([], [], color=look.LINEAR, linewidth=1.2, label="low end: size loads with it"),
        *([] if tested is None or tested.empty else [_build_measured_mark(len(tested))]),
    ]
    _explain(figure, axes, marks)
    return figure


def _draw_damping_ratio(axes: Axes, table: pd.DataFrame, tested: pd.DataFrame | None) -> None:
    rows = table[np.isfinite(table["damping_ratio"])].sort_values("amplitude", kind="stable")
    if rows.empty:
        axes.text(0.5, 0.5, "no prediction", transform=axes.transAxes, ha="center", color=look.MUTED)
        return
    A = rows["amplitude"].to_numpy(float)
    ratio, low, high = (100.0 * rows[f"damping_ratio{end}"].to_numpy(float) for end in ("", "_low", "_high"))
    inside = rows["tested"].to_numpy(bool)
    edge = float(A[inside].max()) if inside.any() else float(A.min())
    axes.fill_between(A, low, high, facecolor=look.PREDICTIVE, linewidth=0)
    shade_beyond(axes, edge, float(A.max()))
    within = edge >= A
    beyond = (edge <= A) if inside.any() else np.full(len(A), True)
    axes.plot(A[within], ratio[within], **_MEDIAN)
    axes.plot(A[beyond], ratio[beyond], **_MEDIAN_BEYOND)
    axes.plot(A, low, color=look.LINEAR, linewidth=1.2)
    if tested is not None:
        axes.plot(tested["amplitude"], 100.0 * tested["damping_ratio"], "o", color=look.MEASURED, mec="white", zorder=5)
    first = A.min() if tested is None else min(float(A.min()), float(tested["amplitude"].min()))
    spare = 0.03 * (A.max() - first) or 0.05 * A.max()
    axes.set_xlim(first - spare, A.max() + spare)
    axes.set_ylim(0.0, 1.12 * max(np.nanmax(high), 0.0 if tested is None else 100.0 * tested["damping_ratio"].max()))
    right = axes.secondary_yaxis("right", functions=(_to_q, _to_q))
    right.set_ylabel("Q")
    right.yaxis.set_major_locator(_QTicks())


class _QTicks(MaxNLocator):
    """Ticks at round values of Q, where the axis of damping ratios (inversely proportional) has room."""

    def tick_values(self, vmin: float, vmax: float) -> list[float]:
        """Round values whose damping ratios lie at least a tenth of the axis apart."""
        least = min(abs(vmin), abs(vmax))
        decade = 10.0 ** np.floor(np.log10(least))
        values = [m * decade * ten for ten in (1.0, 10.0) for m in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 7.0)]
        kept: list[float] = []
        for value in values:
            if value >= least and (not kept or least / kept[-1] - least / value > 0.12):
                kept.append(value)
        return kept


def _to_q(percent: Any) -> Any:
    """1/(2 zeta) of a damping ratio in per cent, and back."""
    return 50.0 / np.maximum(np.asarray(percent, dtype=float), 1e-9)


def shade_beyond(axes: Axes, edge: float, end: float) -> None:
    """Hatch the background from ``edge`` to ``end``, beyond the test."""
    if end > edge:
        axes.axvspan(edge, end, facecolor=look.BEYOND_TEST, edgecolor=look.GRIDLINE, hatch="///", linewidth=0, zorder=0)


def _explain(figure: Figure, axes: Axes | None, marks: list[Artist]) -> None:
    """Draw the legend: below the panel of its own figure, or within ``axes``."""
    if axes is None:
        figure.legend(handles=marks, loc="outside lower left", ncols=2, columnspacing=1.2)
    else:
        axes.legend(handles=marks, loc="best", fontsize=7.0)


def _build_median_marks() -> list[Artist]:
    within = Line2D([], [], **_MEDIAN, label="median, tested")
    return [within, Line2D([], [], **_MEDIAN_BEYOND, label="median, beyond (hatched)")]


def _build_measured_mark(n: int) -> Artist:
    return Line2D([], [], marker="o", color=look.MEASURED, linestyle="", label=f"measured resonances (n = {n})")


MOST_NAMED = 6  #: sweeps named beside their curves; more hide them
LETTER_WIDTH = 0.014  #: width of a letter of a name beside a point, as a share of the axes
NAME_HEIGHT = 0.05  #: height of such a name, as a share of the axes


@styled
def fitted_sweeps(
    measured: pd.DataFrame, fitted: pd.DataFrame, law: str, unit: str = "", *, force_unit: str | None = None
) -> Figure:
    """Draw measured sweeps with the curves of one law through them, or resonances with its curve over force.

    Args:
        measured: ``sweep, x, y``.
        fitted: the same columns, rows of a sweep in order of x.
        law: its name, for the legend.
        unit: of the amplitude y.
        force_unit: of x where that is force; None where it is frequency in Hz.
    """
    x_label = "frequency (Hz)" if force_unit is None else describe_with_unit("force at resonance", force_unit)
    y_label = describe_with_unit("amplitude" if force_unit is None else "resonant amplitude", unit)
    figure, axes = build_panel(3.7, x_label, y_label)
    axes.margins(x=0.1, y=0.1)
    for _, line in fitted.groupby("sweep", sort=False):
        axes.plot(line["x"], line["y"], color=law_style(law).colour, linewidth=1.3)
    axes.plot(measured["x"], measured["y"], "o", color=look.MEASURED, markersize=3.6, mec="white", mew=0.3, zorder=3)
    sweeps = measured.groupby("sweep", sort=False)
    if sweeps.ngroups <= MOST_NAMED:
        _name_points(axes, measured.loc[sweeps["y"].idxmax(), ["sweep", "x", "y"]], (5, 2))
    measured_label = f"measured ({count(sweeps.ngroups, 'sweep')}, n = {len(measured)})"
    marks = [
        Line2D([], [], marker="o", color=look.MEASURED, linestyle="", label=measured_label),
        Line2D([], [], color=law_style(law).colour, linewidth=1.3, label="\n".join(wrap(f"fitted: {law}", 54))),
    ]
    figure.legend(handles=marks, loc="outside lower left", ncols=1)
    return figure


@styled
def mode_over_level(table: pd.DataFrame, label: str) -> Figure:
    """Two panels over the level: damping ratio with its band, and frequency on the scale of its half-power bandwidth.

    Args:
        table: one row for each level, rising: ``level, tested, frequency, median, low, high`` of the damping ratio.
        label: of the level, with its unit.
    """
    figure, (upper, lower) = build_panels(4.4, 2, sharex=True)
    level = table["level"].to_numpy(dtype=float)
    tested = table["tested"].to_numpy(dtype=bool)
    upper.fill_between(
        level, 100.0 * table["low"], 100.0 * table["high"], color=look.PREDICTIVE, label="90 % predictive band"
    )
    frequency, ratio = (table[name].to_numpy(dtype=float) for name in ("frequency", "median"))
    inner, outer = frequency * (1.0 - ratio), frequency * (1.0 + ratio)
    lower.fill_between(level, inner, outer, color=look.PREDICTIVE, label="half-power bandwidth")
    upper.plot(level, 100.0 * ratio, color=look.AVERAGE)
    for axes, values in ((upper, 100.0 * ratio), (lower, frequency)):
        axes.plot(level[tested], values[tested], "o", color=look.MEASURED, label="tested")
        axes.plot(level[~tested], values[~tested], "o", mfc="white", color=look.MEASURED, label="design")
    lower.set_xlabel(label)
    upper.set_ylabel("damping ratio (%)")
    lower.set_ylabel("frequency (Hz)")
    bands, marks = (axes.get_legend_handles_labels() for axes in (upper, lower))
    handles, labels = bands[0][:1] + marks[0], [f"{bands[1][0]}, above", f"{marks[1][0]}, below", *marks[1][1:]]
    figure.legend(handles, labels, loc="outside lower left", ncols=2)  # not on a band of its own colour
    return figure


@styled
def design_loads(
    band: pd.DataFrame,
    tested: pd.DataFrame,
    design: pd.DataFrame,
    level: float,
    force_unit: str = "",
    length_unit: str = "",
    limit: float = np.inf,
    *,
    axes: Axes | None = None,
) -> Figure:
    """Draw the median with its band, the linear prediction and the tested points.

    Args:
        band: over a grid of forces, ``force, median, low, high, linear``; NaN where no prediction is given.
        tested: ``sweep, force, amplitude``.
        design: at the design forces, ``force, median, low, high, linear``.
        level: content of the band.
        limit: force beyond which no prediction is given.
    """
    x_label = describe_with_unit("force at resonance", force_unit)
    figure, panel = build_panel(3.9, x_label, describe_with_unit("resonant amplitude", length_unit), axes=axes)
    _draw_loads(panel, band, tested, design)
    end = float(band["force"].iloc[-1])
    if limit < end:
        panel.axvline(limit, color=look.MUTED, linewidth=0.8)
        panel.text(limit, 0.02, " no prediction", transform=panel.get_xaxis_transform(), color=look.MUTED, fontsize=8)
    marks = [
        _build_measured_mark(len(tested)),
        *_build_median_marks(),
        Patch(fc=look.PREDICTIVE, linewidth=0, label=f"{100 * level:g} % predictive band"),
        Line2D([], [], **_LINEAR, label="linear, from the top level"),
        Line2D([], [], marker="D", color="white", markeredgecolor=look.INK, linestyle="", label="design force"),
    ]
    _explain(figure, axes, marks)
    return figure


def _draw_loads(axes: Axes, band: pd.DataFrame, tested: pd.DataFrame, design: pd.DataFrame) -> None:
    force = band["force"].to_numpy(float)
    edge = float(tested["force"].max())
    shade_beyond(axes, edge, float(force[-1]))
    axes.fill_between(force, band["low"], band["high"], facecolor=look.PREDICTIVE, linewidth=0)
    axes.plot(force, band["linear"], **_LINEAR)
    inside = force <= edge
    axes.plot(force[inside], band["median"][inside], **_MEDIAN)
    axes.plot(force[~inside], band["median"][~inside], **_MEDIAN_BEYOND)
    axes.plot(tested["force"], tested["amplitude"], "o", color=look.MEASURED, ms=5, mec="white", mew=0.6, zorder=5)
    axes.vlines(design["force"], design["low"], design["high"], color=look.AVERAGE, linewidth=1.2, zorder=4)
    axes.plot(design["force"], design["median"], "D", color="white", mec=look.AVERAGE, markersize=5, zorder=6)
    axes.set_xlim(force[0], force[-1])
    # the linear line stays in sight, a band that runs away sets no scale
    values = [band["linear"].max(), tested["amplitude"].max(), 1.2 * design["median"].max()]
    axes.set_ylim(0.0, 1.12 * np.nanmax([*values, np.nanmin([band["high"].max(), 1.6 * np.nanmax(values)])]))
    if len(tested) <= MOST_NAMED:
        _name_points(axes, tested[["sweep", "force", "amplitude"]], (5, -9))


def _name_points(axes: Axes, points: pd.DataFrame, offset: tuple[int, int]) -> None:
    """Name points ``sweep, x, y`` from the highest down, but for names that would lie on another or on the axis.

    ``offset``: of a name from its point, points.
    """
    axes.autoscale_view()
    named: list[tuple[float, float, float]] = []  # left, right and height of the names before
    rows = zip(distinguish(points["sweep"]), *(points[name] for name in points.columns[1:]), strict=True)
    for label, x, y in sorted(rows, key=itemgetter(2), reverse=True):
        left, height = axes.transLimits.transform((x, y))
        right = left + LETTER_WIDTH * (len(label) + 1)
        free = all(right < a or left > b or height + NAME_HEIGHT < own for a, b, own in named)
        if free and (offset[1] > 0 or height > NAME_HEIGHT):
            axes.annotate(label, (x, y), offset, textcoords="offset points", fontsize=7.5)
            named.append((left, right, height))
