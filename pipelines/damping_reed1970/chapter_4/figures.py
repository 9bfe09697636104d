"""Chapter IV: coefficient against amplitude, response curves, their differences, force against amplitude, levels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots import (
    ALERT,
    AVERAGE,
    INK,
    LINEAR,
    MEASURED,
    MUTED,
    PREDICTIVE,
    WIDTH,
    draw_plain_rows,
    law_style,
    plain_log,
    styled,
)
from damping_reed1970.chapter_4.amplitude_frequency import AmplitudeFrequency, CaseCurve
from damping_reed1970.chapter_4.lines import CoefficientLines, ForceAmplitudeLines

_HELD = {"xi": "damping factor", "coefficient": "coefficient"}
_MODES = {1: "First mode", 2: "Second mode"}
_CASE_FORCES = {
    "case I": "viscous",
    "case II": "displacement",
    "case III": "velocity-squared",
    "case IV": "displacement-velocity",
}
#: Cases I and II, and III and IV, nearly coincide: the first of each pair is drawn broad and pale below the second.
_CASE_LINES = {"case II": (0, (4, 2)), "case IV": (0, (3, 1.5))}
_BROAD = ("case I", "case III")


@styled
def draw_linear_coefficients(modes: Sequence[CoefficientLines]) -> Figure:
    """Draw the linear coefficient against resonant amplitude (Figs. 4.1, 4.2), a panel a mode."""
    figure = Figure(figsize=(WIDTH, 2.9 * len(modes)))
    for axes, lines in zip(np.atleast_1d(figure.subplots(len(modes))), modes, strict=True):
        _draw_coefficient_panel(axes, lines)
    return figure


def _draw_coefficient_panel(axes: Axes, data: CoefficientLines) -> None:
    models = {"I + IV": "viscous + displacement-velocity", "I + V": "viscous + quadratic-displacement"}
    labels = {"I + IV": "C₀₁ + C₁₁ A (cases I + IV)", "I + V": "C₀₁ + C₁₁ A² (cases I + V)"}
    for cases, law in models.items():
        line = data.lines[data.lines["cases"] == cases]
        colour = law_style(law).colour
        axes.fill_between(line["amplitude_in"], line["low"], line["high"], color=colour, alpha=0.13, linewidth=0)
        axes.plot(line["amplitude_in"], line["C_1_lb_s_per_in"], color=colour, label=labels[cases])
    printed = data.lines[data.lines["cases"] == "printed"]
    amplitude, C_1 = printed["amplitude_in"], printed["C_1_lb_s_per_in"]
    axes.plot(amplitude, C_1, color=LINEAR, linestyle=(0, (4, 3)), linewidth=1.1, label="printed (4.1.10)")
    _draw_sweeps(axes, data.points, "amplitude_in", "C_1_lb_s_per_in")
    top = float(data.points["C_1_lb_s_per_in"].max())
    axes.set(xlim=(0.0, float(data.lines["amplitude_in"].max())), ylim=(0.0, 1.6 * top))
    axes.set_title(_MODES[data.mode])
    axes.set(xlabel="resonant amplitude (in)", ylabel="linear coefficient C₁ (lb s/in)")
    axes.legend(loc="upper left", fontsize=7)


def _draw_sweeps(axes: Axes, points: pd.DataFrame, x: str, y: str) -> None:
    axes.plot(points[x], points[y], "o", color=MEASURED, markersize=6, markeredgecolor="white", zorder=4)
    for sweep, a, b in points[["sweep", x, y]].itertuples(index=False):
        axes.annotate(str(sweep), (a, b), (5, -10), textcoords="offset points", fontsize=8)


@styled
def draw_response_explained(result: AmplitudeFrequency, at: float = 0.55) -> Figure:
    """Draw one damped curve, the undamped one and the backbone, with delta and epsilon (Fig. 4.3).

    Args:
        result: its first case is drawn; one of heavy damping shows most.
        at: amplitude over the resonant one at which the differences are marked.
    """
    figure = Figure(figsize=(WIDTH, 3.3))
    axes = figure.add_subplot()
    curve = result.curves[0]
    _draw_undamped(axes, result)
    axes.plot(*_through(curve, curve.amplitude, curve.amplitude), color=INK, label="damped")
    axes.axvline(1.0, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    top = 1.6 * result.A_m
    axes.annotate("backbone", (1.0, 0.97 * top), (4, 0), textcoords="offset points", fontsize=8, va="top")
    A = at * result.A_m
    damped, undamped = (float(np.interp(A, curve.amplitude, x)) for x in (curve.eta_squared[0], result.undamped[0]))
    epsilon = float(np.interp(A, curve.amplitude, curve.epsilon))
    arrow = {"arrowstyle": "<->", "color": ALERT, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.1}
    axes.annotate("", (undamped, A), (damped, A), arrowprops=arrow)
    axes.annotate("δ", (0.5 * (undamped + damped), A), (0, -12), textcoords="offset points", color=ALERT, ha="center")
    axes.annotate("", (damped, A), (damped, A + epsilon), arrowprops=arrow)
    axes.annotate("ε", (damped, A + 0.5 * epsilon), (5, 0), textcoords="offset points", color=ALERT)
    axes.set(xlim=(2.0 * result.undamped[0, -1] - 1.0, 3.0 - 2.0 * result.undamped[0, -1]), ylim=(0.0, top))
    axes.set(xlabel="frequency ratio squared η²", ylabel="amplitude")
    axes.legend(loc="upper left")
    return figure


@styled
def draw_response_curves(result: AmplitudeFrequency, width: float = 0.008) -> Figure:
    """Draw amplitude against frequency ratio squared, cases I to IV and case V (Figs. 4.4, 4.5)."""
    figure = Figure(figsize=(WIDTH, 6.0))
    panels = figure.subplots(2, 1, sharex=True, sharey=True)
    for axes, chosen, title in zip(panels, _split(result), ("Cases I to IV", "Case V"), strict=True):
        _draw_undamped(axes, result)
        for curve in chosen:
            _draw_line(axes, curve.name, *_through(curve, curve.amplitude, curve.amplitude))
        axes.plot(
            [1.0], [result.A_m], "o", color=MEASURED, markersize=6, markeredgecolor="white", label="measured resonance"
        )
        axes.set(xlim=(1.0 - width, 1.0 + width), ylim=(0.0, 1.12 * result.A_m))
        axes.set_xticks([1.0 - 0.75 * width, 1.0, 1.0 + 0.75 * width])
        axes.set_title(title)
        axes.set_ylabel("modal amplitude (in)")
        axes.legend(loc="lower center", fontsize=7)
    panels[1].set_xlabel("frequency ratio squared η²")
    return figure


@styled
def draw_phase_curves(result: AmplitudeFrequency, width: float = 0.008) -> Figure:
    """Draw phase against frequency ratio squared, all cases together (Fig. 4.6)."""
    figure = Figure(figsize=(WIDTH, 3.3))
    axes = figure.add_subplot()
    for curve in result.curves:
        _draw_line(axes, curve.name, *_through(curve, *np.degrees(curve.phase)))
    axes.set(xlim=(1.0 - width, 1.0 + width), ylim=(0.0, 180.0), yticks=[0, 45, 90, 135, 180])
    axes.set_xticks([1.0 - 0.75 * width, 1.0, 1.0 + 0.75 * width])
    axes.set(xlabel="frequency ratio squared η²", ylabel="phase lag (degrees)")
    axes.legend(loc="upper left")
    return figure


@styled
def draw_differences(result: AmplitudeFrequency, printed: tuple[float, float]) -> Figure:
    """Draw delta and epsilon against amplitude (Figs. 4.7, 4.8).

    Args:
        result: the curves. printed: amplitude and delta of case I that the report prints.
    """
    figure = Figure(figsize=(WIDTH, 5.4))
    left, right = figure.subplots(2, 1, sharex=True)
    for curve in result.curves:
        _draw_line(left, curve.name, curve.amplitude, 1e3 * curve.delta)
        _draw_line(right, curve.name, curve.amplitude, curve.epsilon)
    left.plot(result.amplitude, 1e3 * (1.0 - result.undamped[0]), color=MUTED, linewidth=0.8, label="undamped curve")
    left.plot(printed[0], 1e3 * printed[1], "s", color=ALERT, markersize=5, label="printed, case I", zorder=4)
    left.set(xlim=(0.0, 1.03 * result.A_m), ylim=(0.0, 4.0))
    left.set_title("Horizontal difference")
    left.set_ylabel("δ in η² (10⁻³)")
    left.legend(loc="upper left", fontsize=7)
    right.set(xlim=(0.0, 1.03 * result.A_m), ylim=(0.0, 1.0))
    right.set_title("Vertical difference")
    right.set(ylabel="ε (in)", xlabel="modal amplitude (in)")
    return figure


@styled
def draw_undamped_error(result: AmplitudeFrequency, printed: tuple[float, float]) -> Figure:
    """Draw the error of the undamped curve against amplitude over the resonant one (Fig. 4.9).

    Args:
        result: the curves. printed: amplitude ratio and per cent error that the report gives.
    """
    figure = Figure(figsize=(WIDTH, 3.2))
    axes = figure.add_subplot()
    for curve in result.curves:
        _draw_line(axes, curve.name, curve.amplitude / result.A_m, curve.percent)
    axes.plot(*printed, "s", color=ALERT, markersize=5, label="printed, case I: 14 per cent at ½", zorder=4)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 60.0))
    axes.set(xlabel="amplitude / resonant amplitude", ylabel="error of neglecting damping (per cent)")
    axes.legend(loc="upper left")
    return figure


@styled
def draw_force_amplitude(modes: Sequence[ForceAmplitudeLines], example: tuple[float, float, float]) -> Figure:
    """Draw resonant force against amplitude on logarithmic axes (Fig. 4.10), with the extrapolation of section 4.3.

    Args:
        modes: first and second.
        example: force, printed linear and printed power-law amplitude, drawn with the first mode.
    """
    figure = Figure(figsize=(WIDTH, 3.1 * len(modes)))
    for axes, lines in zip(figure.subplots(len(modes)), modes, strict=True):
        _draw_force_panel(axes, lines)
        if lines.mode == 1:
            F, linear, power = example
            axes.plot([linear, power], [F, F], "s", color=ALERT, markersize=5, zorder=4, label="printed at 90 lb")
        axes.legend(loc="lower right", fontsize=7)
    return figure


def _draw_force_panel(axes: Axes, data: ForceAmplitudeLines) -> None:
    lines, force = data.lines, data.lines["force_lb"]
    axes.set(xscale="log", yscale="log")
    axes.fill_betweenx(
        force, lines["low"], lines["high"], color=PREDICTIVE, linewidth=0, label="90 % t interval of the line"
    )
    axes.plot(lines["refitted"], force, color=AVERAGE, label=f"least squares, p = {data.law.p:.3f}")
    axes.plot(
        lines["printed_slope"], force, color=ALERT, linestyle=(0, (4, 2)), label=f"printed p = {data.p_printed:.3f}"
    )
    axes.plot(lines["linear"], force, color=LINEAR, linestyle=(0, (1, 1.2)), label="linear, p = 1")
    _draw_sweeps(axes, data.points, "amplitude_in", "force_lb")
    axes.set_xlim(0.85 * data.points["amplitude_in"].min(), 1.1 * lines["linear"].max())
    axes.set_ylim(force.iloc[0], force.iloc[-1])
    plain_log(axes.xaxis)
    plain_log(axes.yaxis)
    axes.set_title(_MODES[data.mode])
    axes.set(xlabel="resonant amplitude (in)", ylabel="modal force (lb)")


@styled
def draw_level_variation(variations: pd.DataFrame, held: str) -> Figure:
    """Draw by how much each case's coefficient varies from level to level, with every choice of base (Table 4.V).

    Args:
        variations: ``case, alpha, free, base, largest_percent, spread_percent``, as ``level_methods`` gives them.
        held: what is kept from level to level, ``xi`` or ``coefficient``.
    """
    order = variations.drop_duplicates("case").sort_values("spread_percent", na_position="last")
    figure = Figure(figsize=(WIDTH, 1.5 + 0.24 * len(order)))
    axes = figure.add_subplot()
    draw_plain_rows(axes, [_describe_alpha_label(case, alpha, free) for case, alpha, free in
                      order[["case", "alpha", "free"]].itertuples(index=False)])  # fmt: skip
    markers = "osD^vPX"
    for number, (base, rows) in enumerate(variations.groupby("base", sort=False)):
        largest = rows.set_index("case")["largest_percent"].abs()
        axes.plot(largest[order["case"]], range(len(order)), markers[number % len(markers)], markersize=4.5,
                  color=MUTED, alpha=0.9, linestyle="none", label=f"largest, base {base}")  # fmt: skip
    axes.plot(order["spread_percent"], range(len(order)), "|", color=INK, markersize=13, markeredgewidth=2.2,
              label="standard deviation")  # fmt: skip
    axes.set_xscale("log")
    plain_log(axes.xaxis)
    axes.set_xlabel(f"variation of the {_HELD[held]}\nfrom level to level (per cent)")
    figure.legend(loc="outside lower center", ncols=2, fontsize=7.5)
    return figure


def _describe_alpha_label(case: str, alpha: float, free: bool) -> str:
    if not free:
        return case.replace("alpha", "α")
    value = "∞" if np.isinf(alpha) else f"{alpha:.3g}"
    return f"{case.replace('alpha free', 'α')} = {value} (free)"


def _split(result: AmplitudeFrequency) -> tuple[list[CaseCurve], list[CaseCurve]]:
    return (
        [curve for curve in result.curves if curve.name in _CASE_FORCES],
        [curve for curve in result.curves if curve.name not in _CASE_FORCES],
    )


def _draw_line(axes: Axes, case: str, x: FloatArray, y: FloatArray) -> None:
    """Draw a case in its colour and line: case V has those of the sum that it is, larger alphas dashed."""
    line: Any
    if case in _CASE_FORCES:
        colour, line = law_style(_CASE_FORCES[case]).colour, _CASE_LINES.get(case, "-")
    else:
        colour = law_style("viscous + quadratic-displacement").colour
        line = "-" if case.endswith("= 1") else (0, (6, 1.5, 1, 1.5))
    broad = case in _BROAD
    axes.plot(
        x, y, color=colour, linestyle=line, label=case, linewidth=3.2 if broad else 1.4, alpha=0.45 if broad else 1
    )


def _draw_undamped(axes: Axes, result: AmplitudeFrequency) -> None:
    for side, label in zip(result.undamped, ("undamped", None), strict=True):
        distance = np.abs(side - 1.0) * result.amplitude
        A = np.geomspace(result.amplitude[0], 3.0 * result.A_m, 200)
        sign = np.sign(side[0] - 1.0)
        axes.plot(1.0 + sign * distance[0] / A, A, color=MUTED, linewidth=0.9, linestyle=(0, (2, 1.5)), label=label)


def _through(curve: CaseCurve, below: FloatArray, above: FloatArray) -> tuple[FloatArray, FloatArray]:
    """eta^2 and a quantity along the curve, from below resonance through it to above."""
    return np.concatenate([curve.eta_squared[0], curve.eta_squared[1, ::-1]]), np.concatenate([below, above[::-1]])
