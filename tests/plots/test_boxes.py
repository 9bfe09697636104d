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
    canvas.draw()
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
def test_design_loads(rows):
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
def test_damping_curve(rows, scale):
    A = scale * np.geomspace(1.0, 9.0, 16)
    ratio = 0.004 * (A / scale) ** 0.8
    table = pd.DataFrame({"amplitude": A, "damping_ratio": ratio, "tested": 4.0 * scale > A})
    table = table.assign(damping_ratio_low=0.7 * ratio, damping_ratio_high=2.0 * ratio)
    tested = pd.DataFrame({"amplitude": scale * np.linspace(1.0, 4.0, rows), "damping_ratio": 0.006})
    check(damping_curve(table, 0.9, "in", tested))


@pytest.mark.parametrize(("rows", "number"), [(3, 3), (60, 3), (500, 12)])
def test_sweeps(rows, number):
    table = record(rows, number)
    for law in LAWS[:2]:
        check(fitted_sweeps(table, table, law, "mm"))
    check(sweeps(table.rename(columns={"x": "frequency", "y": "amplitude"})))


@pytest.mark.parametrize("number", [1, 12])
def test_ranking(number):
    weight = np.full(number, 1.0 / number)
    table = pd.DataFrame({"rank": range(1, number + 1), "law": LAWS[:number], "weight": weight, "physical": True})
    check(ranking(table.assign(held_out_error=np.geomspace(0.2, 30.0, number), average_absolute_percent=0.001)))


@pytest.mark.parametrize("number", [1, 12])
def test_predictive_check(number):
    laws = LAWS[:number]
    rows = [
        {"law": law, "sweep": NAME.format(s), "median": 101.0, "low": 95.0, "high": 108.0}
        for law in laws
        for s in range(8)
    ]
    check(predictive_check(pd.DataFrame(rows), 0.9))


@pytest.mark.parametrize("size", [2, 3, 5])
def test_corner(size):
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


def test_labels_keep_what_tells_them_apart():
    assert distinguish([NAME.format(i) for i in (1, 2, 3)]) == ["1", "2", "3"]
    assert distinguish(["sweep A up", "sweep B up"]) == ["A", "B"]
    assert distinguish(["A"]) == ["A"]
    assert distinguish(["A", "A"]) == ["A", "A"]
