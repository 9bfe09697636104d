"""Every plotting function: what is drawn equals the table it was given, hostile labels and odd sizes do no harm."""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from damping.plots.design_loads import ForceAmplitude, design_loads, force_amplitude
from damping.plots.fits import energy_surface, fits, percent_deviations, ranking
from damping.plots.posteriors import convergence, corner, predictive_check, prior_posterior, prior_posterior_summary
from damping.plots.style import to_svg
from damping_reed1970.reproduction import describe_group_of, draw_reproduction, tabulate_percent_differences

HOSTILE = "<b>$x</b>&\"'"
LAWS = ("viscous", "viscous + velocity-squared", "coulomb + A^4")
FORCE = np.linspace(5.0, 90.0, 20)


def _loads() -> Figure:
    band = pd.DataFrame({"force": FORCE, "median": FORCE**0.6, "linear": FORCE / 7.0})
    for name, factor in (("low", 0.9), ("high", 1.1), ("credible_low", 0.95), ("credible_high", 1.05)):
        band[name] = factor * band["median"]
    models = pd.concat(
        [
            pd.DataFrame({"law": law, "weight": 0.3, "force": FORCE, "median": band["median"]})
            for law in (*LAWS, HOSTILE)
        ]
    )
    tested = pd.DataFrame({"sweep": ["A", HOSTILE], "force": [20.0, 30.0], "amplitude": [6.0, 7.7]})
    design = band.iloc[[10, 19]].assign(linear_overprediction_percent=[10.0, 60.0]).reset_index(drop=True)
    return design_loads(band, models, tested, design, 0.9, "lb", HOSTILE)


def _force_amplitude() -> Figure:
    points = pd.DataFrame({"sweep": ["A", HOSTILE], "force": [19.0, 29.0], "amplitude": [1.2, 1.6]})
    line = pd.DataFrame({"amplitude": [1.1, 1.7], "force": [17.0, 31.0], "low": [15.0, 28.0], "high": [19.0, 34.0]})
    return force_amplitude(
        [ForceAmplitude(title, points, line, "p = 1.65", "lb", "in") for title in ("one", HOSTILE, "c")]
    )


def _fits() -> Figure:
    x = np.array([1.0, 2.0, 3.0])
    measured = pd.DataFrame({"x": x, "y": x**2, "label": ["A", HOSTILE, ""]})
    fitted = pd.concat([pd.DataFrame({"law": law, "weight": 0.5, "x": x, "y": x}) for law in LAWS])
    deviations = pd.concat([pd.DataFrame({"law": law, "x": x, "percent": [1.0, -2.0, 3.0]}) for law in LAWS])
    return fits(measured, fitted, deviations, HOSTILE, "y")


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


def _prior_posterior() -> Figure:
    return prior_posterior(_draws(0), _draws(1))


def _priors() -> Figure:
    table = pd.DataFrame(
        {"law": [LAWS[0], LAWS[0], HOSTILE], "parameter": ["a", HOSTILE, "a"], "median": [1.0, 2.0, 3.0]}
    )
    columns = {"prior_low": 0.1, "prior_high": 10.0, "low": 0.8, "high": 1.3}
    return prior_posterior_summary(table.assign(**{name: factor * table["median"] for name, factor in columns.items()}))


def _predictive_check() -> Figure:
    rows = [(law, sweep, 101.0, 95.0, 108.0) for law in LAWS for sweep in ("A", "B", HOSTILE, "D", "E")]
    return predictive_check(pd.DataFrame(rows, columns=["law", "sweep", "median", "low", "high"]), 0.9)


def _percent() -> Figure:
    return percent_deviations(DEVIATIONS)


DEVIATIONS = pd.DataFrame(
    {
        "law": ["viscous"] * 3 + [HOSTILE] * 2,
        "point": ["1", "2", HOSTILE, "1", "2"],
        "percent": [5.0, -3.0, 1.0, 2.0, -9.0],
    }
)

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


def _energy_surface() -> Figure:
    amplitude, frequency = np.linspace(0.1, 1.0, 12), np.linspace(1.7, 1.9, 10)
    energy = np.outer(amplitude**2, frequency)
    points = pd.DataFrame({"amplitude": [0.3, 0.8], "frequency": [1.75, 1.85], "energy": [0.2, 1.1]})
    return energy_surface(amplitude, frequency, energy, points, "A (in)", "f (Hz)", HOSTILE)


def _convergence() -> Figure:
    return convergence(CONVERGENCE, 1.01, 1000.0, 50.0)


CONVERGENCE = pd.DataFrame(
    {
        "law": ["viscous", "viscous", HOSTILE],
        "quantity": ["viscous", "scatter", "viscous"],
        "r_hat": [1.001, 1.05, np.nan],
        "effective_size": [5000.0, 400.0, 2000.0],
        "lengths": [80.0, 20.0, 60.0],
    }
)

ALL: tuple[Callable[[], Figure], ...] = (
    *(_loads, _force_amplitude, _fits, _ranking, _corner, _prior_posterior, _priors),
    *(_predictive_check, _percent, _reproduction, _energy_surface, _convergence),
)


@pytest.mark.parametrize("draw", ALL, ids=lambda draw: draw.__name__.strip("_"))
@pytest.mark.filterwarnings("error")
def test_figure_is_deterministic_and_escapes_labels(draw: Callable[[], Figure]) -> None:
    """Drawn twice the SVG is the same, parses, and holds no element that a label brought in."""
    svg = to_svg(draw(), "figure", "t", "d")
    assert svg == to_svg(draw(), "figure", "t", "d")
    root = ElementTree.fromstring(svg)
    assert not [element for element in root.iter() if element.tag.endswith(("}b", "}script"))]


def test_design_loads_draws_the_numbers_it_says() -> None:
    figure = _loads()
    texts = [text.get_text() for text in figure.axes[0].texts]
    # FORCE[-1]**0.6 = 90**0.6 = 14.88 and 90/7 = 12.86, to three digits
    assert any("14.9" in text and f"{0.9 * 90**0.6:.1f} to {1.1 * 90**0.6:.1f}" in text for text in texts)
    assert any("12.9" in text and "+60 %" in text for text in texts)
    medians = [line for line in figure.axes[0].lines if np.array_equal(line.get_ydata(), FORCE**0.6)]
    assert len(medians) == 5  # four models and the average
    legends = [figure.axes[0].get_legend(), *figure.legends]
    said = [text.get_text() for legend in legends for text in legend.get_texts()]
    assert any("90 % credible" in text for text in said)
    assert any("90 % predictive" in text for text in said)


def test_design_loads_says_where_it_stops() -> None:
    band = pd.DataFrame({"force": FORCE, "linear": FORCE / 7.0})
    for name in ("median", "low", "high", "credible_low", "credible_high"):
        band[name] = np.where(FORCE <= 60.0, FORCE**0.6, np.nan)
    models = band[["force", "median"]].assign(law="viscous", weight=1.0)
    tested = pd.DataFrame({"sweep": ["A"], "force": [20.0], "amplitude": [6.0]})
    design = band.iloc[[10, 19]].assign(linear_overprediction_percent=[10.0, np.nan])
    axes = design_loads(band, models, tested, design, 0.9, limit=60.0).axes[0]
    assert "no prediction" in [text.get_text() for text in axes.texts]


def test_design_loads_without_any_prediction() -> None:
    nothing = np.full(len(FORCE), np.nan)
    columns = ("median", "low", "high", "credible_low", "credible_high")
    band = pd.DataFrame({"force": FORCE, "linear": FORCE / 7.0, **dict.fromkeys(columns, nothing)})
    models = pd.DataFrame({"law": "viscous", "weight": 1.0, "force": FORCE, "median": nothing})
    tested = pd.DataFrame({"sweep": ["A"], "force": [20.0], "amplitude": [6.0]})
    design = band.iloc[[19]].assign(linear_overprediction_percent=np.nan)
    assert to_svg(design_loads(band, models, tested, design, 0.9), "figure", "t", "d")


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


def test_percent_deviations_bars_are_the_per_cents() -> None:
    for axes, (_, rows) in zip(_percent().axes, DEVIATIONS.groupby("law", sort=False), strict=True):
        np.testing.assert_array_equal([bar.get_height() for bar in axes.patches], rows["percent"])
        assert f"{rows['percent'].abs().mean():.1f} %" in axes.get_title(loc="left")


def test_convergence_marks_what_fails() -> None:
    crosses = [line for axes in _convergence().axes for line in axes.lines if line.get_marker() == "X"]
    # R-hat 1.05 above 1.01 and one that does not exist; size 400 below 1000; length 20 below 50
    assert [len(line.get_xdata()) for line in crosses] == [2, 1, 1]


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
