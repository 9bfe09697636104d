"""Drawings on axes of the caller's own: nothing on a neighbour, and everything seen on his ground."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from matplotlib import rc_context, style
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from damping.plots import to_svg
from damping.plots.curves import damping_curve, design_loads
from damping.plots.fits import deviations_figure, ranking, sweeps
from damping.plots.gap import gap_probabilities

LAWS = [f"viscous + velocity-squared + displacement-velocity {number}" for number in range(39)]
EFFECTS = [f"planar-coupling + quadratic-displacement + sensor-saturation {number}" for number in range(8)]
WEIGHT = 0.5 ** np.arange(1.0, 40.0)
GRID = np.linspace(1.0, 4.0, 9)


def draw_ranking(axes: Axes | None) -> Figure:
    table = pd.DataFrame({"rank": range(1, 40), "law": LAWS, "weight": WEIGHT, "physical": True})
    return ranking(table.assign(held_out_error=2.0, average_absolute_percent=1.0), axes=axes)


def draw_probabilities(axes: Axes | None) -> Figure:
    table = pd.DataFrame({"explanation": EFFECTS, "probability": WEIGHT[:8]})
    return gap_probabilities(table.assign(listed=table["probability"] > 0.05), axes=axes)


def draw_curve(axes: Axes | None) -> Figure:
    table = pd.DataFrame({"amplitude": GRID, "damping_ratio": 0.01 * GRID, "tested": GRID < 2.0})
    table = table.assign(damping_ratio_low=0.009 * GRID, damping_ratio_high=0.012 * GRID)
    return damping_curve(table, 0.9, tested=table[table["tested"]], axes=axes)


def draw_loads(axes: Axes | None) -> Figure:
    band = pd.DataFrame({"force": GRID, "median": GRID, "low": 0.8 * GRID, "high": 1.2 * GRID, "linear": 1.4 * GRID})
    tested = pd.DataFrame({"sweep": ["A", "B"], "force": [1.0, 2.0], "amplitude": [1.0, 2.0]})
    return design_loads(band, tested, band.iloc[[5]], 0.9, limit=3.5, axes=axes)


def draw_sweeps(axes: Axes | None) -> Figure:
    return sweeps(pd.DataFrame({"sweep": ["A", "B"] * 3, "frequency": range(6), "amplitude": range(6)}), axes=axes)


def draw_deviations(axes: Axes | None) -> Figure:
    return deviations_figure(GRID, GRID - 2.0, GRID, x_label="x", response="y", axes=axes)


DRAWINGS = [draw_ranking, draw_probabilities, draw_curve, draw_loads, draw_deviations]


@pytest.mark.parametrize("size", [(18.0, 5.0), (9.0, 2.6)])
@pytest.mark.parametrize(("draw", "names"), [(draw_ranking, LAWS), (draw_probabilities, EFFECTS)])
def test_names_of_rows_lie_within_their_axes_and_on_no_other(draw, names, size):
    """In figures without a layout, as pyplot's are."""
    figure = Figure(figsize=size)
    FigureCanvasAgg(figure)
    axes = figure.subplots(1, 3)[1]
    draw(axes)
    figure.canvas.draw()
    labels = axes.get_yticklabels()
    shown = [label.get_text() for label in labels]
    assert 1 <= len(shown) <= 10
    assert all(name.startswith(own.rstrip("…")) for own, name in zip(shown, names, strict=False))
    area = axes.get_window_extent()
    boxes = [label.get_window_extent() for label in labels]
    for box in boxes:
        assert area.x0 <= box.x0 < box.x1 <= area.x1
        assert area.y0 <= box.y0 < box.y1 <= area.y1
    for one, other in combinations([*boxes, *(patch.get_window_extent() for patch in axes.patches)], 2):
        assert min(one.x1, other.x1) <= max(one.x0, other.x0) or min(one.y1, other.y1) <= max(one.y0, other.y0)


def test_laws_that_are_left_out_are_counted():
    axes = Figure().add_subplot()
    draw_ranking(axes)
    assert axes.get_xlabel() == "weight (probability), 10 of 39 laws"
    assert [label.get_text() for label in axes.get_yticklabels()] == LAWS[:10]


def contrast(one: object, other: object) -> float:
    """Of two colours, 1 to 21 (WCAG 2.1)."""
    linear = np.array([to_rgb(one), to_rgb(other)])
    linear = np.where(linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4)
    dark, light = np.sort(linear @ [0.2126, 0.7152, 0.0722])
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("look", ["default", "dark_background", {"axes.facecolor": "#002b36", "text.color": "#eee8d5"}])
@pytest.mark.parametrize("draw", DRAWINGS)
def test_what_is_drawn_shows_on_the_ground_of_the_axes(draw, look):
    """Texts at 4.5 to 1 and lines at 3 to 1; a text whose colour is the caller's is as he wants it."""
    with style.context("default"), style.context(look):
        axes = Figure().add_subplot()
        draw(axes)
        ground = axes.get_facecolor()
        legend = axes.get_legend()
        texts = [text for text in [*axes.texts, *(legend.get_texts() if legend else [])] if text.get_text()]
        lines = [*axes.lines, *(legend.findobj(Line2D) if legend else [])]
        for text in texts:
            assert contrast(text.get_color(), ground) >= 4.5, text
        for line in lines:
            seen = [line.get_color()] if line.get_linestyle() != "None" else []
            seen += [line.get_markerfacecolor(), line.get_markeredgecolor()] if line.get_marker() != "None" else []
            assert not seen or max(contrast(colour, ground) for colour in seen) >= 3.0, line


@pytest.mark.parametrize("draw", [*DRAWINGS, draw_sweeps])
def test_figures_of_their_own_are_the_same_whatever_matplotlib_is_set_to(draw):
    drawn = []
    for look in ("default", "dark_background", "Solarize_Light2", "seaborn-v0_8-darkgrid"):
        with style.context("default"), style.context(look):
            drawn.append(to_svg(draw(None), "own", "title", "description"))
    assert len(set(drawn)) == 1


def test_texts_have_the_colour_of_the_caller():
    with rc_context({"text.color": "#aa2200", "ytick.color": "#00aa22", "ytick.labelcolor": "#0022aa"}):
        axes = Figure().add_subplot()
        draw_curve(axes)
        axes.figure.draw_without_rendering()
        assert {text.get_color() for text in axes.get_legend().get_texts()} == {"#aa2200"}
        (right,) = axes.child_axes
        assert {label.get_color() for label in right.get_yticklabels()} == {"#0022aa"}


def test_what_the_caller_drew_stays_as_it_is():
    with style.context("dark_background"):
        axes = Figure().add_subplot()
        (line,) = axes.plot([1.0, 2.0], [1.0, 2.0], color="#1f2328")
        draw_loads(axes)
        assert line.get_color() == "#1f2328"
