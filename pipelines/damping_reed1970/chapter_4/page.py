"""Chapter IV in the report: coefficient against amplitude (4.1), response curves and levels (4.2), power laws (4.3)."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.plots import ALERT, AVERAGE, LINEAR, MEASURED, PREDICTIVE, build_panels, law_style, styled
from damping.plots.scales import plain_log
from damping.report.page import Table
from damping_reed1970 import LABELS, ReportPart, chapter_table, write_chapter
from damping_reed1970.chapter_4 import F_EXAMPLE, PRINTED
from damping_reed1970.chapter_4 import amplitude_frequency as response
from damping_reed1970.chapter_4.levels import draw_level_variation
from damping_reed1970.chapter_4.lines import SweepLines
from damping_reed1970.studies import ReportResults, Studies


def write_chapter_4(results: ReportResults) -> ReportPart:
    """The page: three ways from the resonances of three levels to a force, printed and recomputed."""
    studies, every, named = results.studies, results.studies.tables(4), results.tables
    lines, variations, predictions = named["linear_coefficients"], every["level_variations"], every["level_predictions"]
    bases, pairs = "base " + variations["base"], predictions["base"] + " → " + predictions["sweep"]
    symbols = {"force_coefficient": "its coefficient", "printed_force": "printed"}
    columns = ["mode", "cases", "parameter", "coefficient", "std_error", "low", "high", "printed", "force"]
    corrected = lines[lines["inputs"] == "corrected"][[*columns, "force_coefficient", "printed_force"]]
    parameter = corrected["parameter"].str.replace("C_01", "C₀₁").str.replace("C_11", "C₁₁")
    shown = {
        "lines": Table(corrected.assign(parameter=parameter), headings=symbols, key="linear_coefficients"),
        "spreads": chapter_table(4, "level_variations", tabulate_spreads(variations)),
        "by_base": chapter_table(4, "level_variations", _widen(variations, "largest_percent", bases)),
        "predictions": chapter_table(4, "level_predictions", _widen(predictions, "percent_error", pairs)),
    }
    values = {"studies": studies, "printed": PRINTED, "hertz": studies.curves.omega_n / (2.0 * np.pi)}
    return write_chapter(4, named, values=values, figures=collect_figures(studies), shown=shown, tables=every)


def collect_figures(studies: Studies) -> dict[str, Callable[[], Figure]]:
    """How each figure of the chapter is drawn, by name."""
    curves = studies.curves
    explained = response.amplitude_frequency(M=1.0, omega_n=1.0, F=0.05, A_m=1.0)  # heavy damping shows most
    figures: dict[str, Callable[[], Figure]] = {
        "linear-coefficient": lambda: draw_linear_coefficients(studies.lines),
        "response-explained": lambda: response.draw_response_explained(explained),
        "response-curves": lambda: response.draw_response_curves(curves),
        "phase-curves": lambda: response.draw_phase_curves(curves),
        "response-differences": lambda: response.draw_differences(curves),
        "undamped-error": lambda: response.draw_undamped_error(curves),
        "force-amplitude": lambda: draw_force_amplitude(studies.force_lines),
    }
    for (mode, held), level in studies.levels.items():
        figures[f"level-variation-mode-{mode}-{held}"] = partial(draw_level_variation, level.variations, held)
    return figures


def tabulate_spreads(variations: pd.DataFrame) -> pd.DataFrame:
    """Spread of each case by mode and what is kept, one row per case."""
    once = variations.drop_duplicates(["mode", "kept", "case"])
    wide = once.pivot_table("spread_percent", "case", ["mode", "kept"], aggfunc="first")
    keys = wide.columns.to_frame(index=False)
    wide.columns = "mode " + keys["mode"].astype(str) + ", " + keys["kept"].map(LABELS["kept"]).str.join(" ")
    return _tabulate_named(wide.sort_values(wide.columns[0]).reset_index())


def _widen(table: pd.DataFrame, value: str, columns: pd.Series) -> pd.DataFrame:
    """A value of each case by mode and what is kept, side by side under the names ``columns`` of its rows."""
    wide = table.assign(column=columns).pivot_table(value, ["mode", "kept", "case"], "column", aggfunc="first")
    return _tabulate_named(wide.reset_index().rename_axis(columns=None))


def _tabulate_named(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.assign(case=frame["case"].str.replace("alpha", "α").str.replace("I + ", "I and "))


_MODES = {1: "First mode", 2: "Second mode"}


@styled
def draw_linear_coefficients(modes: Sequence[SweepLines]) -> Figure:
    """Draw the linear coefficient against resonant amplitude (Figs. 4.1, 4.2), one panel for each mode."""
    figure, panels = build_panels(2.9 * len(modes), len(modes))
    for axes, data in zip(panels, modes, strict=True):
        for cases, (law, label) in LABELS["coefficient_lines"].items():
            line, colour = data.lines[data.lines["cases"] == cases], law_style(law).colour
            axes.fill_between(line["amplitude_in"], line["low"], line["high"], color=colour, alpha=0.13, linewidth=0)
            axes.plot(line["amplitude_in"], line["C_1_lb_s_per_in"], color=colour, label=label)
        printed, x, y = data.lines[data.lines["cases"] == "printed"], "amplitude_in", "C_1_lb_s_per_in"
        axes.plot(printed[x], printed[y], color=LINEAR, linestyle=(0, (4, 3)), linewidth=1.1, label="printed (4.1.10)")
        _draw_sweeps(axes, data.points, x, y)
        top = float(data.points["C_1_lb_s_per_in"].max())
        axes.set(xlim=(0.0, float(data.lines["amplitude_in"].max())), ylim=(0.0, 1.6 * top), title=_MODES[data.mode])
        axes.set(xlabel="resonant amplitude (in)", ylabel="linear coefficient C₁ (lb s/in)")
        axes.legend(loc="upper left", fontsize=7)
    return figure


def _draw_sweeps(axes: Axes, points: pd.DataFrame, x: str, y: str) -> None:
    axes.plot(points[x], points[y], "o", color=MEASURED, markersize=6, markeredgecolor="white", zorder=4)
    for sweep, a, b in points[["sweep", x, y]].itertuples(index=False):
        axes.annotate(str(sweep), (a, b), (5, -10), textcoords="offset points", fontsize=8)


@styled
def draw_force_amplitude(modes: Sequence[SweepLines]) -> Figure:
    """Draw resonant force against amplitude on logarithmic axes (Fig. 4.10), with the extrapolation of section 4.3."""
    figure, panels = build_panels(3.1 * len(modes), len(modes))
    for axes, data in zip(panels, modes, strict=True):
        lines, force = data.lines, data.lines["force_lb"]
        axes.set(xscale="log", yscale="log")
        band, (refitted, as_printed) = "90 % t interval of the line", data.exponents
        axes.fill_betweenx(force, lines["low"], lines["high"], color=PREDICTIVE, linewidth=0, label=band)
        for name, colour, line, label in (
            ("refitted", AVERAGE, "-", f"least squares, p = {refitted:.3f}"),
            ("printed_slope", ALERT, (0, (4, 2)), f"printed p = {as_printed:.3f}"),
            ("linear", LINEAR, (0, (1, 1.2)), "linear, p = 1"),
        ):
            axes.plot(lines[name], force, color=colour, linestyle=line, label=label)
        _draw_sweeps(axes, data.points, "amplitude_in", "force_lb")
        axes.set_xlim(0.85 * data.points["amplitude_in"].min(), 1.1 * lines["linear"].max())
        axes.set_ylim(force.iloc[0], force.iloc[-1])
        plain_log(axes.xaxis)
        plain_log(axes.yaxis)
        axes.set(title=_MODES[data.mode], xlabel="resonant amplitude (in)", ylabel="modal force (lb)")
        if data.mode == 1:
            amplitudes = [PRINTED["example"]["linear"], PRINTED["example"]["power"]]
            axes.plot(amplitudes, [F_EXAMPLE] * 2, "s", color=ALERT, markersize=5, zorder=4, label="printed at 90 lb")
        axes.legend(loc="lower right", fontsize=7)
    return figure
