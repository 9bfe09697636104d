"""Figures on any record: nothing is cut at the edge of the figure, and no label lies on another.

Boxes are those of matplotlib's own renderer, in pixels.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pandas as pd
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from damping.plots import distinguish
from damping.plots.curves import damping_curve, design_loads, fitted_sweeps
from damping.plots.fits import corner, predictive_check, ranking, sweeps
from damping.plots.gap import gap_local, gap_map, gap_overlay
from damping.plots.scales import plain_log

#: Pixels that boxes may share: a glyph is a little smaller than its box.
TOUCHING = 2.0
NAME = "Panel assembly of the qualification unit, serial 0042, run {}"  # about 60 characters
assert len(NAME) >= 58
LAWS = [
    "displacement-velocity + quadratic-displacement + coulomb + slip",
    *("viscous", "velocity-squared", "viscous + velocity-squared", "velocity-power", "displacement"),
    *("viscous + slip", "coulomb + slip", "quadratic-displacement", "displacement + slip"),
    *("viscous + quadratic-displacement + coulomb", "displacement-velocity-power"),
]


def boxes(figure: Figure) -> tuple[Bbox, list[tuple[str, Bbox]]]:
    """The figure's box, and each visible text that is not empty with its own."""
    canvas = FigureCanvasAgg(figure)
    figure.draw_without_rendering()
    renderer = canvas.get_renderer()
    every = [*figure.axes, *(child for axes in figure.axes for child in axes.child_axes)]
    outside = set()
    for axes in every:
        area = axes.get_window_extent(renderer)
        for labels, low, high, way in (
            (axes.get_xticklabels(which="both"), area.x0, area.x1, 0),
            (axes.get_yticklabels(which="both"), area.y0, area.y1, 1),
        ):
            for label in labels:  # matplotlib keeps labels of ticks beyond the axis and does not draw them
                middle = label.get_window_extent(renderer).get_points().mean(axis=0)[way]
                if not low - 1.0 <= middle <= high + 1.0:
                    outside.add(label)
    texts = dict.fromkeys(figure.findobj(Text))
    drawn = [text for text in texts if text.get_visible() and text not in outside and text.get_text().strip()]
    return figure.bbox, [(text.get_text(), text.get_window_extent(renderer)) for text in drawn]


def check(figure: Figure) -> None:
    whole, texts = boxes(figure)
    assert texts
    for said, box in texts:
        assert box.x0 >= whole.x0 - TOUCHING, f"{said!r} is cut on the left"
        assert box.x1 <= whole.x1 + TOUCHING, f"{said!r} is cut on the right"
        assert box.y0 >= whole.y0 - TOUCHING, f"{said!r} is cut below"
        assert box.y1 <= whole.y1 + TOUCHING, f"{said!r} is cut above"
    for (one, a), (other, b) in combinations(texts, 2):
        wide, high = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert wide <= TOUCHING or high <= TOUCHING, f"{one!r} lies on {other!r}"


def levels(rows: int) -> np.ndarray:
    return np.geomspace(1.0, 40.0, rows)


def record(rows: int, levels: int = 3) -> pd.DataFrame:
    """A record of so many rows in sweeps with long names."""
    sweep = [NAME.format(i * levels // rows) for i in range(rows)]
    x = np.linspace(41.0, 43.0, rows)
    return pd.DataFrame({"sweep": sweep, "x": x, "y": 1e-4 * (1.0 + np.arange(rows) % 7)})


@pytest.mark.parametrize("rows", [3, 60, 500])
def test_names_of_design_loads_do_not_overlap(rows):
    force = levels(rows)
    tested = pd.DataFrame({"sweep": [NAME.format(i) for i in range(rows)], "force": force, "amplitude": force**0.7})
    grid = np.geomspace(0.8, 90.0, 40)
    band = pd.DataFrame({"force": grid, "median": grid**0.7, "low": 0.8 * grid**0.7, "high": 1.4 * grid**0.7})
    check(design_loads(band.assign(linear=grid / 3.0), tested, band.iloc[[-1]], 0.9, "lbf", "in", 60.0))


@pytest.mark.parametrize("force", [[0.03, 0.13, 0.14, 0.26, 0.49, 0.5], [19.4, 25.0, 29.0]])
def test_design_loads_far_beyond_the_test(force):
    """Points close beside one another: the names of those that have room, the topmost among them."""
    names, force = ("R5", "F0.2", "R20", "R30", "R40", "F0.5")[-len(force) :], np.array(force)
    tested = pd.DataFrame({"sweep": names, "force": force, "amplitude": force**0.7})
    grid = np.linspace(0.8 * force[0], 16.0 * force[-1], 40)
    band = pd.DataFrame({"force": grid, "median": grid**0.7, "low": 0.8 * grid**0.7, "high": 1.4 * grid**0.7})
    figure = design_loads(band.assign(linear=grid**0.75), tested, band.iloc[[-1]], 0.9, "N", "mm")
    check(figure)
    names = figure.axes[0].texts
    assert "F0.5" in [name.get_text() for name in names]
    assert all(name.get_window_extent().y0 >= figure.axes[0].get_window_extent().y0 - TOUCHING for name in names)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 3e4])
@pytest.mark.parametrize("rows", [1, 3, 500])
def test_a_damping_curve_of_any_size_is_not_cut(rows, scale):
    A = scale * np.geomspace(1.0, 9.0, 16)
    ratio = 0.004 * (A / scale) ** 0.8
    table = pd.DataFrame({"amplitude": A, "damping_ratio": ratio, "tested": 4.0 * scale > A})
    table = table.assign(damping_ratio_low=0.7 * ratio, damping_ratio_high=2.0 * ratio)
    tested = pd.DataFrame({"amplitude": scale * np.linspace(1.0, 4.0, rows), "damping_ratio": 0.006})
    check(damping_curve(table, 0.9, "in", tested))


@pytest.mark.parametrize(("rows", "number"), [(3, 3), (60, 3), (500, 12)])
def test_names_of_sweeps_do_not_overlap(rows, number):
    table = record(rows, number)
    for law in LAWS[:2]:
        check(fitted_sweeps(table, table, law, "mm"))
    check(sweeps(table.rename(columns={"x": "frequency", "y": "amplitude"})))


@pytest.mark.parametrize("number", [1, 12])
def test_names_of_a_ranking_do_not_overlap(number):
    weight = np.full(number, 1.0 / number)
    table = pd.DataFrame({"rank": range(1, number + 1), "law": LAWS[:number], "weight": weight, "physical": True})
    check(ranking(table.assign(held_out_error=np.geomspace(0.2, 30.0, number), average_absolute_percent=0.001)))


@pytest.mark.parametrize("number", [1, 12])
def test_names_of_a_predictive_check_do_not_overlap(number):
    laws = LAWS[:number]
    rows = [
        {"law": law, "sweep": NAME.format(s), "median": 101.0, "low": 95.0, "high": 108.0}
        for law in laws
        for s in range(8)
    ]
    check(predictive_check(pd.DataFrame(rows), 0.9))


@pytest.mark.parametrize("size", [2, 3, 5])
def test_numbers_of_a_corner_plot_do_not_overlap(size):
    """Numbers of several digits, those of neighbouring panels beside one another."""
    draws = np.random.default_rng(0).normal(0.478, 0.0125, (size, 4000))
    values = {f"parameter {name} (rad/s)": own for name, own in zip("abcde", draws, strict=False)}
    check(corner(values, values))


@pytest.mark.parametrize("shapes", [[], ["slip (lbf/in)", "slip limit (in)"]])
def test_corner_of_a_posterior(shapes):
    """The names that a study has, five and seven of them."""
    doubts = ["straying of the local exponent", "scatter of a row", "scatter of a level"]
    labels = ["viscous (lbf·s/in)", "velocity-squared (lbf·s²/in²)", *shapes, *doubts]
    draws = np.random.default_rng(0).normal(0.00478, 0.000125, (len(labels), 4000))
    values = dict(zip(labels, draws, strict=True))
    check(corner(values, values))


UNIT = "% of tank width x (frequency ratio)^2·sloshing periods/% of tank width³"


@pytest.mark.parametrize("size", [1, 4, 8])
def test_corner_of_long_names_and_units_and_of_any_size_of_value(size):
    names = [f"quadratic-displacement ({UNIT})", f"slip ({UNIT})", "velocity-squared (N·s²/m²)", "slip limit (m)"]
    doubts = ["discrepancy of the local exponent", "scatter of a row", "scatter of a level", "viscous (N·s/m)"]
    draws = np.random.default_rng(0).normal(1.0, 0.05, (8, 4000))
    scales = (2.4e-4, 15200.0, 4.6e8, 1.55e-4, 0.009, 0.024, 0.019, 3e-9)
    values = dict(zip([*names, *doubts][:size], draws[:size] * np.array(scales[:size])[:, np.newaxis], strict=True))
    check(corner(values, values))


@pytest.mark.parametrize("number", [1, 6, 36])
def test_gap_figures_of_sweeps_with_long_names(number):
    names = [NAME.format(i) for i in range(number)]
    frequency = np.linspace(41.0, 43.0, 9)
    measured = pd.concat(
        pd.DataFrame({"sweep": name, "frequency": frequency, "amplitude": 0.02, "phase": 1.0, "outlier": False})
        for name in names
    )
    predicted = pd.concat(measured.assign(model=model) for model in ("nominal", "refitted", "explained"))
    if number <= 6:  # 72 panels take long
        check(gap_overlay(measured, predicted, "% of tank width"))
    check(gap_map(measured.assign(quantity="amplitude", value=3.0), "residual (sigma)"))
    A = np.geomspace(0.01, 0.1, number)
    local = pd.DataFrame({"sweep": names, "amplitude": A, "frequency": 42.0, "damping": 0.01 + A})
    curves = pd.concat(local.assign(model=model) for model in ("refitted", "explained"))
    figure = gap_local(local.assign(frequency_sd=0.1, damping_sd=1e-3), curves, "% of tank width")
    check(figure)
    # the panels keep the figure, whatever the number of sweeps
    assert all(axes.get_position().height > 0.2 for axes in figure.axes)


@pytest.mark.parametrize("high", [1.2, 3.0, 12.0, 40.0, 900.0, 1e6])
@pytest.mark.parametrize("low", [0.011, 1.0, 70.0])
def test_a_logarithmic_axis_has_marks_that_show_its_scale(low, high):
    figure = Figure(figsize=(2.0, 2.0))
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_xlim(low, low * high)
    plain_log(axes.xaxis)
    marks = axes.xaxis.get_majorticklocs()
    assert 2 <= np.sum((marks >= low) & (marks <= low * high)) <= 7


def test_a_law_of_long_name_is_named_whole_beside_its_curve():
    table = record(9)
    figure = fitted_sweeps(table, table, LAWS[0], "mm")
    assert LAWS[0] in " ".join(figure.legends[0].get_texts()[1].get_text().split())


def test_names_of_crossing_sweeps_do_not_lie_on_one_another():
    table = pd.DataFrame(
        {"sweep": ["L1", "L2", "L3", "L3"], "x": [20.0, 20.01, 20.0, 21.0], "y": [0.003, 0.0031, 0.06, 0.01]}
    )
    figure = fitted_sweeps(table, table, "viscous", "m")
    check(figure)
    assert {name.get_text() for name in figure.axes[0].texts} == {"L2", "L3"}


def test_labels_keep_what_tells_them_apart():
    assert distinguish([NAME.format(i) for i in (1, 2, 3)]) == ["1", "2", "3"]
    assert distinguish(["sweep A up", "sweep B up"]) == ["A", "B"]
    assert distinguish(["A"]) == ["A"]
    assert distinguish(["A", "A"]) == ["A", "A"]
