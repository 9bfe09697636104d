"""Figures of the chapters: every one drawn, with its words, its axes and the data it is said to show."""

from __future__ import annotations

from functools import partial

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from damping_reed1970.chapter_2 import page as chapter_2
from damping_reed1970.chapter_4.amplitude_frequency import draw_response_curves
from damping_reed1970.chapter_4.levels import draw_level_variation
from damping_reed1970.chapter_4.page import collect_figures
from damping_reed1970.chapter_5 import page as chapter_5
from damping_reed1970.chapter_5.circularity import draw_circularity
from damping_reed1970.chapter_6 import draw_force_laws
from damping_reed1970.studies import Studies


@pytest.fixture(scope="module")
def found(studies: Studies) -> Studies:
    return studies


@pytest.fixture(scope="module")
def law_errors() -> pd.DataFrame:
    """Errors of two laws in the form of section 6.1."""
    rows = [
        (*law, version, "resonant amplitude", at, error)
        for law in (("I", 2, "5.3.17"), ("II", 1, "4.2.11"))
        for version, error in (("printed", 44.0), ("recomputed", 0.3), ("ours", -0.1))
        for at in "AB"
    ]
    return pd.DataFrame(
        rows, columns=["configuration", "mode", "equation", "version", "quantity", "at", "percent_error"]
    )


@pytest.fixture(scope="module")
def figures(found: Studies, law_errors: pd.DataFrame) -> dict[str, Figure]:
    drawn = chapter_2.collect_figures(found) | collect_figures(found) | chapter_5.collect_figures(found)
    drawn["section-6-1"] = partial(draw_force_laws, law_errors)
    return {name: draw() for name, draw in drawn.items()}


def test_every_figure_is_drawn(figures: dict[str, Figure]) -> None:
    """With its words on the page of its chapter: tests/report/test_chapters.py."""
    assert len(figures) == 19
    for name, figure in figures.items():
        for axes in figure.axes:
            assert axes.lines or axes.patches or axes.collections or axes.images, name


def test_labels_carry_units(figures: dict[str, Figure]) -> None:
    labels = {name: [a.get_xlabel() + a.get_ylabel() for a in figures[name].axes] for name in
              ("linear-coefficient", "response-curves", "force-amplitude", "configuration-1-energy")}  # fmt: skip
    assert all("(in)" in label and "(lb s/in)" in label for label in labels["linear-coefficient"])
    assert "(in)" in labels["response-curves"][0]
    assert all("(in)" in label and "(lb)" in label for label in labels["force-amplitude"])
    assert "(rad/s)" in labels["configuration-1-energy"][1]
    assert "(in-lb)" in labels["configuration-1-energy"][2]


def test_loops_are_closed_and_keep_their_corners(found: Studies) -> None:
    figure = chapter_2.draw_hysteresis_loops(found.loops.loops)
    assert len(figure.axes) == len(found.loops.loops)
    for axes, loop in zip(figure.axes, found.loops.loops.values(), strict=True):
        x, y = (np.asarray(values) for values in axes.lines[0].get_data())
        assert (x[0], y[0]) == pytest.approx((x[-1], y[-1]), abs=1e-12)
        assert (x.max(), y.max()) == pytest.approx((loop.q.max(), loop.force.max()), rel=1e-3)


def test_curves_show_the_measured_resonance(found: Studies) -> None:
    figure = draw_response_curves(found.curves)
    for axes in figure.axes:
        marker = next(line for line in axes.lines if line.get_label() == "measured resonance")
        assert np.asarray(marker.get_data()).ravel().tolist() == [1.0, found.curves.A_m]
        for line in axes.lines:
            if str(line.get_label()).startswith("case"):
                assert np.nanmax(np.asarray(line.get_ydata(), dtype=float)) == pytest.approx(found.curves.A_m)


def test_printed_points_are_drawn(figures: dict[str, Figure]) -> None:
    points = {"response-differences": (1.01, 1.209), "undamped-error": (0.5, 14.0), "force-amplitude": (4.84, 90.0)}
    for name, expected in points.items():
        drawn = [np.column_stack(line.get_data()) for axes in figures[name].axes for line in axes.lines]
        assert any(np.isclose(pairs, expected, rtol=1e-12).all(axis=1).any() for pairs in drawn), name


def test_case_with_an_infinite_alpha_is_labelled(found: Studies) -> None:
    table = found.levels[1, "coefficient"].variations
    axes = draw_level_variation(table, "coefficient").axes[0]
    labels = [label.get_text() for label in axes.get_yticklabels()]
    assert "I + II, α = ∞ (free)" in labels
    assert len(labels) == table["case"].nunique()
    first = table.sort_values("spread_percent")["case"].iloc[0]
    assert labels[0].startswith(first.split(",")[0])  # least spread on top


def test_bars_of_circularity_fill_the_axis(found: Studies) -> None:
    figure = draw_circularity(found.circular.laws)
    for axes in figure.axes:
        widths = pd.Series([patch.get_width() for patch in axes.patches])  # type: ignore[attr-defined]  # bars
        rows = pd.Series([round(patch.get_y() + patch.get_height() / 2.0) for patch in axes.patches])  # type: ignore[attr-defined]  # bars
        np.testing.assert_allclose(widths.groupby(rows).sum(), 1.0, rtol=1e-9, atol=0.0)
