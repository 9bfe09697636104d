"""Every plotting function: what is drawn equals the table it was given, hostile labels and odd sizes do no harm."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from damping.plots import build_panels, to_svg
from damping.plots.curves import damping_curve, design_loads, fitted_sweeps, mode_over_level
from damping.plots.fits import corner, predictive_check, ranking, sweeps
from damping.plots.gap import MODELS, gap_map, gap_overlay
from damping.report import forms
from damping_pipelines.fleet.page import leading_laws
from damping_reed1970.reproduction import describe_group_of, draw_reproduction, tabulate_percent_differences
from damping_validation.bands import draw_left_out, draw_parts
from damping_validation.calibrate import draw_coverage

HOSTILE = "<b>$x</b>&\"'"
LAWS = ("viscous", "viscous + velocity-squared", "coulomb + A^4")
FORCE = np.linspace(5.0, 90.0, 20)


def _loads() -> Figure:
    band = pd.DataFrame({"force": FORCE, "median": FORCE**0.6, "linear": FORCE / 7.0})
    for name, factor in (("low", 0.9), ("high", 1.1), ("credible_low", 0.95), ("credible_high", 1.05)):
        band[name] = factor * band["median"]
    tested = pd.DataFrame({"sweep": ["A", HOSTILE], "force": [20.0, 30.0], "amplitude": [6.0, 7.7]})
    design = band.iloc[[10, 19]].assign(linear_overprediction_percent=[10.0, 60.0]).reset_index(drop=True)
    return design_loads(band, tested, design, 0.9, "lb", HOSTILE)


CURVE = pd.DataFrame(
    {
        "amplitude": [1.0, 2.0, 3.0, 4.0],
        "damping_ratio": [0.01, 0.012, 0.014, np.nan],
        "damping_ratio_low": [0.009, 0.011, 0.012, np.nan],
        "damping_ratio_high": [0.011, 0.013, 0.02, np.nan],
        "tested": [True, True, False, False],
    }
)


def _curve() -> Figure:
    return damping_curve(CURVE, 0.9, HOSTILE, pd.DataFrame({"amplitude": [1.1], "damping_ratio": [0.0101]}))


def _fitted() -> Figure:
    measured = pd.DataFrame({"sweep": ["A", HOSTILE, HOSTILE], "x": [1.0, 1.1, 1.2], "y": [1.0, 3.0, 2.0]})
    return fitted_sweeps(measured, measured, HOSTILE, HOSTILE)


def _sweeps() -> Figure:
    columns = {"sweep": ["A", "A", HOSTILE], "frequency": [1.0, 1.1, 1.0], "amplitude": [1.0, 2.0, 3.0]}
    return sweeps(pd.DataFrame(columns))


def _level() -> Figure:
    columns = {"level": [1.0, 2.0], "tested": [True, False], "frequency": [9.0, 8.9], "median": [0.01, 0.02]}
    return mode_over_level(pd.DataFrame({**columns, "low": [0.01, 0.01], "high": [0.02, 0.03]}), HOSTILE)


def _ranking() -> Figure:
    return ranking(RANKING)


RANKING = pd.DataFrame(
    {
        "rank": pd.array([1, 2, None], dtype="Int64"),
        "law": ["velocity-squared", HOSTILE, "coulomb"],
        "weight": [0.75, 0.25, 0.0],
        "held_out_error": [2.0, np.nan, np.nan],
        "average_absolute_percent": [1.0, 3.0, np.nan],
        "physical": [True, True, False],
    }
)


def _draws(seed: int) -> dict[str, np.ndarray]:
    random = np.random.default_rng(seed)
    return {"viscous (lb)": np.exp(random.standard_normal(800)), HOSTILE: random.standard_normal(800)}


def _corner() -> Figure:
    return corner(_draws(0), _draws(1))


def _predictive_check() -> Figure:
    rows = [(law, sweep, 101.0, 95.0, 108.0) for law in LAWS for sweep in ("A", "B", HOSTILE, "D", "E")]
    return predictive_check(pd.DataFrame(rows, columns=["law", "sweep", "median", "low", "high"]), 0.9)


REPRODUCTION = pd.DataFrame(
    {
        "id": ["tab2II.energy_factor[I]", "eq4313[1]", "eq4313[2]", "sec43"],
        "printed": ["3.1416", "2.0", "0", HOSTILE],
        "computed": [3.1416, 3.0, 1.0, 1.0],
        "computed_after_correction": [np.nan, 2.5, np.nan, np.nan],
        "erratum": ["", "E43-1", "", ""],
    }
)


def _reproduction() -> Figure:
    return draw_reproduction(REPRODUCTION)


ALL: tuple[Callable[[], Figure], ...] = (
    *(_loads, _curve, _fitted, _level, _ranking, _sweeps, _corner, _predictive_check, _reproduction),
)


@pytest.mark.parametrize("draw", ALL, ids=lambda draw: draw.__name__.strip("_"))
@pytest.mark.filterwarnings("error")
def test_figure_is_deterministic_and_escapes_labels(draw: Callable[[], Figure]) -> None:
    """Drawn twice the SVG is the same, parses, and holds no element that a label brought in."""
    svg = to_svg(draw(), "figure", "t", "d")
    assert svg == to_svg(draw(), "figure", "t", "d")
    root = ElementTree.fromstring(svg)
    assert not [element for element in root.iter() if element.tag.endswith(("}b", "}script"))]


def test_design_loads_draws_two_lines_and_one_band() -> None:
    axes = _loads().axes[0]
    drawn = [np.asarray(line.get_ydata()) for line in axes.lines if len(line.get_xdata()) > 3]
    tested, beyond = FORCE <= 30.0, FORCE > 30.0
    # the median in two parts, tested and beyond, and the linear prediction
    assert len(drawn) == 3
    for wanted in (FORCE**0.6 * np.where(tested, 1, np.nan), FORCE / 7.0, FORCE**0.6 * np.where(beyond, 1, np.nan)):
        known = wanted[np.isfinite(wanted)]
        assert any(len(one) == len(known) and np.array_equal(one, known) for one in drawn)
    said = [text.get_text() for text in _loads().legends[0].get_texts()]
    assert any("90 % predictive band" in text for text in said)
    assert any("n = 2" in text for text in said)


def test_design_loads_says_where_it_stops() -> None:
    band = pd.DataFrame({"force": FORCE, "linear": FORCE / 7.0})
    for name in ("median", "low", "high"):
        band[name] = np.where(FORCE <= 60.0, FORCE**0.6, np.nan)
    tested = pd.DataFrame({"sweep": ["A"], "force": [20.0], "amplitude": [6.0]})
    axes = design_loads(band, tested, band.iloc[[10, 19]], 0.9, limit=60.0).axes[0]
    assert "no prediction" in [text.get_text().strip() for text in axes.texts]


def test_curve_is_solid_where_tested_and_has_q_beside() -> None:
    figure = _curve()
    axes = figure.axes[0]
    solid, dashed = (line for line in axes.lines if line.get_linewidth() > 2.0)
    # exact: per cent of what the table holds
    np.testing.assert_array_equal(solid.get_ydata(), 100.0 * CURVE["damping_ratio"][:2])
    np.testing.assert_array_equal(dashed.get_ydata(), 100.0 * CURVE["damping_ratio"][1:3])
    figure.draw_without_rendering()
    # the top of the axis of Q is 1/(2 zeta) of the top of that of zeta, in per cent
    np.testing.assert_allclose(min(axes.child_axes[0].get_ylim()), 50.0 / axes.get_ylim()[1], rtol=1e-6)


def test_design_loads_without_any_prediction() -> None:
    nothing = np.full(len(FORCE), np.nan)
    band = pd.DataFrame({"force": FORCE, "linear": FORCE / 7.0, **dict.fromkeys(("median", "low", "high"), nothing)})
    tested = pd.DataFrame({"sweep": ["A"], "force": [20.0], "amplitude": [6.0]})
    design = band.iloc[[19]].assign(linear_overprediction_percent=np.nan)
    assert to_svg(design_loads(band, tested, design, 0.9), "figure", "t", "d")


def test_ranking_bars_are_the_weights() -> None:
    bars = _ranking().axes[0].patches
    # exact: a bar's width is the weight itself
    np.testing.assert_array_equal([bar.get_width() for bar in bars], RANKING["weight"])
    said = [text.get_text() for text in _ranking().axes[0].texts]
    assert said == ["0.75", "0.25", "not fitted"]


def test_ranking_draws_an_exact_fit_at_the_edge() -> None:
    figure = ranking(RANKING.assign(average_absolute_percent=[1e-12, 1.0, np.nan]))
    fitted = figure.axes[1].lines[0].get_xdata()
    np.testing.assert_array_equal(fitted, [0.01, 1.0, np.nan])
    assert "edge" in figure.axes[1].get_xlabel()


def test_reproduction_compares_what_can_be_compared() -> None:
    rows = tabulate_percent_differences(REPRODUCTION)
    assert list(rows["id"]) == ["tab2II.energy_factor[I]", "eq4313[1]"]
    # 3/2 - 1 and 2.5/2 - 1 in per cent; exact in binary
    np.testing.assert_array_equal(rows["percent"], [0.0, 50.0])
    np.testing.assert_array_equal(rows["percent_corrected"], [np.nan, 25.0])
    assert describe_group_of("tab2II.energy_factor[I]") == "tab2II"


def test_corner_contours_hold_the_stated_shares() -> None:
    """The 90 and 50 per cent contours of a normal pair are ellipses that hold these shares of new draws."""
    random = np.random.default_rng(2)
    x, y = random.standard_normal((2, 40_000))
    figure = corner({"x": x, "y": y}, {"x": x, "y": y})
    pair = next(axes for axes in figure.axes if axes.collections and len(axes.collections) > 1)
    lines = pair.collections[-1]
    for path, share in zip(lines.get_paths(), (0.9, 0.5), strict=True):
        inside = path.contains_points(np.column_stack([x, y])).mean()
        # smoothing by 1.3 bins of 0.22 sd scales radii by sqrt(1 + 0.29^2) = 1.04, which adds 0.04 r^2 exp(-r^2/2) to
        # the share: 0.02 and 0.03; the ranges drawn leave out 0.0075 of the draws on either axis
        assert abs(inside - share) < 0.04


def test_coverage_of_a_structure_without_a_prediction_is_not_drawn() -> None:
    counts = {"given": [0, 2] * 3, "held": [0, 2] * 3, "above": [0, 0] * 3}
    table = pd.DataFrame({"truth": ["refused", "given"] * 3, "ratio": np.repeat([1.5, 2.0, 4.0], 2), **counts})
    for axes, share in zip(draw_coverage(table).axes, (1.0, 0.0), strict=True):
        marks = [np.asarray(line.get_xdata()) for line in axes.lines if str(line.get_label()).endswith("times")]
        assert [mark.tolist() for mark in marks] == [[share]] * 3


def test_the_legend_of_coverage_lies_on_no_interval_and_names_the_dashed_line() -> None:
    counts = {"given": [2, 2] * 3, "held": [0, 2] * 3, "above": [0, 0] * 3}
    table = pd.DataFrame({"truth": ["a", "b"] * 3, "ratio": np.repeat([1.5, 2.0, 4.0], 2), **counts})
    figure = draw_coverage(table)
    FigureCanvasAgg(figure).draw()
    (legend,) = figure.legends
    assert not any(legend.get_window_extent().overlaps(axes.get_window_extent()) for axes in figure.axes)
    assert legend.get_texts()[0].get_text() == "share of an exact band"


@pytest.mark.parametrize("refused", [(True,), (False, True), (False,), ()])
def test_legends_of_bands_lie_beside_the_curves_and_name_every_mark(refused) -> None:
    count = len(refused)
    left_out = pd.DataFrame(
        {"sweep": ["4 N"] * count, "levels": 2, "ratio": 2.0, "measured": 1.0, "linear_over_percent": 25.0}
        | dict.fromkeys(("low", "median", "high"), 1.0)
        | {"refused": np.array(refused, dtype=bool)}
    )
    ratio = np.geomspace(0.2, 4.4, 20)
    columns = (
        "force",
        "extrapolation_ratio",
        *(f"{ends}{end}" for ends in ("", "credible_") for end in ("low", "high")),
    )
    bands = pd.DataFrame(dict.fromkeys((*columns, "median", "linear"), ratio))
    bands = bands.assign(**{forms.PART + name: ratio for name in forms.PART_NAMES})
    figure, axes = build_panels(4.2, 1, 3, 10.0)
    draw_left_out(axes[1], left_out)
    draw_parts(axes[2], bands)
    FigureCanvasAgg(figure).draw()
    legends = [panel.get_legend() for panel in axes[1:]]
    for legend, panel in zip(legends, axes[1:], strict=True):
        assert legend is None or not legend.get_window_extent().overlaps(panel.get_window_extent())
    said = [text.get_text() for text in legends[0].get_texts()] if legends[0] else []
    predicted = ["90 % predictive", "median"] * (False in refused)
    assert said == (predicted + ["linear"] + ["refused"] * (True in refused)) * bool(count)


@pytest.mark.parametrize("outliers", [(), (4,), (1, 4)])
def test_crosses_of_rows_set_aside_have_their_legend(outliers):
    """Only where there are any, and from whichever sweep."""
    columns = {"sweep": list("AAABBB"), "frequency": [1.0, 2.0, 3.0] * 2}
    rows = pd.DataFrame(columns | {"amplitude": 1.0, "phase": 1.0})
    measured = rows.assign(outlier=rows.index.isin(outliers))
    figure = gap_overlay(measured, pd.concat([rows.assign(model=model) for model in MODELS]), "mm")
    (legend,) = figure.legends
    said = [text.get_text() for text in legend.get_texts()]
    assert said == [name for *_, name in MODELS.values()] + ["measured"] + ["row set aside: outlier"] * bool(outliers)
    crosses = sum(len(line.get_xdata()) for ax in figure.axes for line in ax.lines if line.get_marker() == "x")
    assert crosses == 2 * len(outliers)  # in amplitude and in phase


def test_frequencies_of_resonances_alone_do_not_overlap():
    """Five peaks within 0.02 Hz: at most one number for each fifth of the axis."""
    table = pd.DataFrame(
        {"sweep": list("ABCDE"), "frequency": [24.99, 25.0, 25.01, 25.0, 24.995], "amplitude": range(1, 6)}
    )
    figure = Figure(figsize=(3.4, 2.8))
    FigureCanvasAgg(figure)
    sweeps(table, axes=figure.add_subplot())
    figure.canvas.draw()
    assert stand_apart(figure.axes[0])


def stand_apart(axes: Axes) -> bool:
    """Whether the numbers below the axes, as they were drawn, do not touch."""
    low, high = axes.get_xlim()
    shown = [label for label in axes.get_xticklabels() if low <= label.get_position()[0] <= high and label.get_text()]
    boxes = sorted((box.x0, box.x1) for box in (label.get_window_extent() for label in shown))
    return len(boxes) > 1 and all(left[1] < right[0] for left, right in pairwise(boxes))


@pytest.mark.parametrize("quantities", [("amplitude",), ("amplitude", "phase"), ("amplitude", "phase", "third")])
def test_frequencies_of_a_map_do_not_run_together(quantities):
    rows = [("level 0.05 g", f, name, 3.0) for name in quantities for f in np.linspace(30.4, 31.35, 29)]
    figure = gap_map(pd.DataFrame(rows, columns=["sweep", "frequency", "quantity", "value"]), "in units of noise")
    FigureCanvasAgg(figure)
    figure.canvas.draw()
    assert all(stand_apart(axes) for axes in figure.axes[: len(quantities)])


def test_the_label_of_leading_laws_is_whole():
    figure = leading_laws(pd.Series({"viscous + velocity-squared + displacement-velocity": 1, "viscous": 1}))
    FigureCanvasAgg(figure)
    figure.canvas.draw()
    label, whole = figure.axes[0].xaxis.label.get_window_extent(), figure.bbox
    assert whole.x0 <= label.x0 < label.x1 <= whole.x1


def test_the_legend_of_levels_lies_on_no_band():
    figure = _level()
    FigureCanvasAgg(figure)
    figure.canvas.draw()
    (legend,) = figure.legends
    assert not any(legend.get_window_extent().overlaps(axes.get_window_extent()) for axes in figure.axes)
    said = [text.get_text() for text in legend.get_texts()]
    assert said == ["90 % predictive band, above", "half-power bandwidth, below", "tested", "design"]
