"""Damped against undamped response curves (section 4.2, Figs 4.3 to 4.9).

At an amplitude A the undamped curve lies at the distance u = F/(M omega_n^2 A) from the backbone eta^2 = 1, the damped
one at sqrt(u^2 - G^2) (Eq 4.2.4). The horizontal difference of the two is delta, their vertical difference at the
damped curve's frequency epsilon. Sides: -1 below resonance, +1 above. For pure damping (no in-phase part). NaN where
the curve has no point of that amplitude: above the resonant one, and below resonance under the static one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.arrays import FloatArray, Floats
from damping.forces import damping_term
from damping.forces.contract import Force
from damping.plots import ALERT, INK, MEASURED, MUTED, build_panel, build_panels, law_style, styled
from damping.predict.steady import phase_lag
from damping_reed1970.chapter_2 import CASES
from damping_reed1970.chapter_4 import PRINTED, build_case


def undamped_distance(A: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """u = F/(M omega_n^2 A), the distance |1 - eta^2| of the undamped curve from the backbone (Eqs 4.2.8, 4.2.9)."""
    return np.asarray(F / (M * omega_n**2 * A))


def damped_distance(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats, side: int = -1) -> FloatArray:
    """|1 - eta^2| of the damped curve at the amplitude A: sqrt(u^2 - G(A, omega)^2), omega that of the curve itself.

    The report takes G at omega_n; the two differ by the relative width of the resonance. NaN above the resonance.
    """
    u = undamped_distance(A, F, M, omega_n)
    distance = np.zeros(np.shape(u))
    with np.errstate(invalid="ignore"):
        for _ in range(50):  # G changes by a small share of itself over the curve: each turn adds digits
            omega = omega_n * np.sqrt(1.0 + side * distance)
            previous, distance = distance, np.sqrt(u**2 - damping_term(force, A, omega, M, omega_n) ** 2)
            if not np.any(np.abs(distance - previous) > 1e-15):
                break
    return np.asarray(distance)


def horizontal_difference(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """Delta = u - |1 - eta^2| of the damped curve below resonance at the amplitude A (Figs 4.3, 4.7)."""
    return undamped_distance(A, F, M, omega_n) - damped_distance(force, A, F, M, omega_n)


def vertical_difference(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """Epsilon: undamped amplitude less A at the frequency where the damped curve has the amplitude A (Figs 4.3, 4.8).

    It grows without bound towards the resonance, where the undamped amplitude is infinite.
    """
    with np.errstate(divide="ignore"):
        return F / (M * omega_n**2 * damped_distance(force, A, F, M, omega_n)) - A


def percent_error_undamped(force: Force, A: Floats, F: Floats, M: Floats, omega_n: Floats) -> FloatArray:
    """100 delta/u, the error of Eq 4.2.9, which neglects damping, at the amplitude A (Fig 4.9).

    For case I, 100 (1 - sqrt(1 - (A/A_m)^2)) but for the frequency in G: 13.4 % at half the resonant amplitude.
    """
    return 100.0 * horizontal_difference(force, A, F, M, omega_n) / undamped_distance(A, F, M, omega_n)


#: Amplitudes of a curve, in units of the resonant one: dense towards resonance, where the curve turns.
RATIOS = 1.0 - np.linspace(0.95, 0.0, 300) ** 1.5
CURVES: dict[str, float] = PRINTED["curves"]  #: what section 4.2 prints of the curves


@dataclass(frozen=True)
class CaseCurve:
    """The response of one case, (points,) over the amplitudes of :class:`AmplitudeFrequency`."""

    name: str
    force: Force
    eta_squared: FloatArray  #: (2, points), below resonance first; NaN under the static amplitude
    phase: FloatArray  #: rad, the same shape
    delta: FloatArray  #: below resonance, horizontal distance from the undamped curve
    epsilon: FloatArray  #: below resonance, vertical distance
    percent: FloatArray  #: error of neglecting damping


@dataclass(frozen=True)
class AmplitudeFrequency:
    """All cases with one resonant amplitude under one modal force."""

    M: float
    omega_n: float
    F: float  #: modal force
    A_m: float  #: resonant amplitude
    curves: tuple[CaseCurve, ...]  #: case I first
    amplitude: FloatArray  #: (points,)
    undamped: FloatArray  #: eta^2 (2, points) of the undamped curve over ``amplitude``
    widths: pd.DataFrame  #: case, width in eta^2 at shares of the resonant amplitude, error of neglecting damping there


def amplitude_frequency(
    M: float, omega_n: float, F: float, A_m: float, alphas: Sequence[float] = ()
) -> AmplitudeFrequency:
    """Curves of the cases I to IV and of V with each alpha, 1/in^2."""
    cases = [(f"case {case}", case, 0.0) for case in ("I", "II", "III", "IV")]
    cases += [(f"case V, α = {alpha:g}", "V", alpha) for alpha in alphas]
    forces = {}
    for name, case, alpha in cases:  # with the resonant amplitude A_m under F (Eq. 4.2.7)
        coefficient = F / float(build_case(case, 1.0, alpha).quadrature(A_m, omega_n))
        forces[name] = build_case(case, coefficient, alpha)
    A = A_m * RATIOS
    curves = tuple(_curve(name, force, A, M, omega_n, F) for name, force in forces.items())
    distance = undamped_distance(A, F, M, omega_n)
    undamped = np.stack([1.0 - distance, 1.0 + distance])
    return AmplitudeFrequency(M, omega_n, F, A_m, curves, A, undamped, _tabulate_widths(forces, M, omega_n, F, A_m))


def _curve(name: str, force: Force, A: FloatArray, M: float, omega_n: float, F: float) -> CaseCurve:
    at_peak = np.isclose(A, A[-1], rtol=1e-3)  # where rounding, or the frequency in G, ends one side just below it
    sides = (damped_distance(force, A, F, M, omega_n, side) for side in (-1, 1))
    below, above = (np.where(at_peak & np.isnan(distance), 0.0, distance) for distance in sides)
    eta_squared = np.stack([np.where(below < 1.0, 1.0 - below, np.nan), 1.0 + above])
    return CaseCurve(
        name=name,
        force=force,
        eta_squared=eta_squared,
        phase=phase_lag(force, A, omega_n * np.sqrt(eta_squared), M, omega_n),
        delta=undamped_distance(A, F, M, omega_n) - below,
        epsilon=vertical_difference(force, A, F, M, omega_n),
        percent=100.0 * (1.0 - below * M * omega_n**2 * A / F),
    )


def _tabulate_widths(forces: dict[str, Force], M: float, omega_n: float, F: float, A_m: float) -> pd.DataFrame:
    rows = []
    for (name, force), share in product(forces.items(), (0.5, 0.9)):
        A = share * A_m
        width = sum(float(damped_distance(force, A, F, M, omega_n, side)) for side in (-1, 1))
        rows.append((name, share, width, float(percent_error_undamped(force, A, F, M, omega_n))))
    names = ["case", "amplitude_over_resonant", "width_eta_squared", "percent_error_undamped"]
    return pd.DataFrame(rows, columns=names)


def section_4_2_points(result: AmplitudeFrequency) -> pd.DataFrame:
    """What section 4.2 prints of case I of sweep C beside ours, with G at the curve's own frequency and at omega_n."""
    M, omega_n, F, A_m, viscous = result.M, result.omega_n, result.F, result.A_m, result.curves[0].force
    A = np.array([CURVES["A"], 0.5 * A_m, F / (M * omega_n**2 * (1.0 - CURVES["eta_squared"]))])
    u, delta = undamped_distance(A, F, M, omega_n), horizontal_difference(viscous, A, F, M, omega_n)
    at_omega_n = u - np.sqrt(u**2 - float(damping_term(viscous, CURVES["A"], omega_n, M, omega_n)) ** 2)
    percent = 100.0 * np.array([delta, at_omega_n]) / u
    rows = [
        ("delta at A = 1.01 in", CURVES["delta"], delta[0], at_omega_n[0], "E4-8"),
        ("distance of the undamped curve at A = 1.01 in", CURVES["distance"], u[0], u[0], "E4-8"),
        ("per cent error at half the resonant amplitude", CURVES["percent_at_half"], *percent[:, 1], ""),
        ("per cent error at eta^2 = 0.992", np.nan, *percent[:, 2], ""),
    ]
    return pd.DataFrame(rows, columns=["quantity", "printed", "computed", "computed_with_G_at_omega_n", "erratum"])


#: Cases I and II, and III and IV, nearly coincide: the first of each pair is drawn broad and pale below the second.
_CASE_LINES = {"case II": (0, (4, 2)), "case IV": (0, (3, 1.5))}
_BROAD = ("case I", "case III")
_HALF_WIDTH = 0.008  #: half the width in eta^2 that the curves are drawn over
#: Amplitude over the resonant one at which delta and epsilon are marked.
_MARKED = 0.55
_PRINTED: Any = {"color": ALERT, "markersize": 5, "zorder": 4}


@styled
def draw_response_explained(result: AmplitudeFrequency) -> Figure:
    """Draw the first case damped and undamped with the backbone, delta and epsilon (Fig. 4.3); A_m is 1."""
    figure, axes = build_panel(3.3, "frequency ratio squared η²", "amplitude / resonant amplitude")
    curve, top = result.curves[0], 1.6 * result.A_m
    _draw_undamped(axes, result)
    axes.plot(*_join_sides(curve, result.amplitude, result.amplitude), color=INK, label="damped")
    axes.axvline(1.0, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    axes.annotate("backbone", (1.0, 0.97 * top), (4, 0), textcoords="offset points", fontsize=8, va="top")
    A = _MARKED * result.A_m
    across = (curve.eta_squared[0], result.undamped[0], curve.epsilon)
    damped, undamped, epsilon = (float(np.interp(A, result.amplitude, values)) for values in across)
    arrow = {"arrowstyle": "<->", "color": ALERT, "shrinkA": 0, "shrinkB": 0, "linewidth": 1.1}
    axes.annotate("", (undamped, A), (damped, A), arrowprops=arrow)
    axes.annotate("δ", (0.5 * (undamped + damped), A), (0, -12), textcoords="offset points", color=ALERT, ha="center")
    axes.annotate("", (damped, A), (damped, A + epsilon), arrowprops=arrow)
    axes.annotate("ε", (damped, A + 0.5 * epsilon), (5, 0), textcoords="offset points", color=ALERT)
    axes.set(xlim=(2.0 * result.undamped[0, -1] - 1.0, 3.0 - 2.0 * result.undamped[0, -1]), ylim=(0.0, top))
    axes.legend(loc="upper left")
    return figure


@styled
def draw_response_curves(result: AmplitudeFrequency) -> Figure:
    """Draw amplitude against frequency ratio squared, cases I to IV and case V (Figs. 4.4, 4.5)."""
    figure, panels = build_panels(6.0, 2, sharex=True, sharey=True)
    resonance: dict[str, Any] = {"color": MEASURED, "markeredgecolor": "white", "label": "measured resonance"}
    for axes, fifth, title in zip(panels, (False, True), ("Cases I to IV", "Case V"), strict=True):
        _draw_undamped(axes, result)
        for curve in result.curves:
            if curve.name.startswith("case V,") == fifth:
                _draw_line(axes, curve.name, *_join_sides(curve, result.amplitude, result.amplitude))
        axes.plot([1.0], [result.A_m], "o", markersize=6, **resonance)
        axes.set(ylim=(0.0, 1.12 * result.A_m), title=title, ylabel="modal amplitude (in)")
        axes.legend(loc="lower center", fontsize=7)
        _limit_frequency(axes)
    panels[1].set_xlabel("frequency ratio squared η²")
    return figure


@styled
def draw_phase_curves(result: AmplitudeFrequency) -> Figure:
    """Draw phase against frequency ratio squared, all cases together (Fig. 4.6)."""
    figure, axes = build_panel(3.3, "frequency ratio squared η²", "phase lag (degrees)")
    for curve in result.curves:
        _draw_line(axes, curve.name, *_join_sides(curve, *np.degrees(curve.phase)))
    axes.set(ylim=(0.0, 180.0), yticks=[0, 45, 90, 135, 180])
    _limit_frequency(axes)
    axes.legend(loc="upper left")
    return figure


@styled
def draw_differences(result: AmplitudeFrequency) -> Figure:
    """Draw delta and epsilon against amplitude, with the printed delta of case I (Figs. 4.7, 4.8)."""
    figure, (upper, lower) = build_panels(5.4, 2, sharex=True)
    for curve in result.curves:
        _draw_line(upper, curve.name, result.amplitude, 1e3 * curve.delta)
        _draw_line(lower, curve.name, result.amplitude, curve.epsilon)
    upper.plot(result.amplitude, 1e3 * (1.0 - result.undamped[0]), color=MUTED, linewidth=0.8, label="undamped curve")
    upper.plot(CURVES["A"], 1e3 * CURVES["delta"], "s", **_PRINTED, label="printed, case I")
    upper.set(ylim=(0.0, 4.0), title="Horizontal difference", ylabel="δ in η² (10⁻³)")
    upper.legend(loc="upper left", fontsize=7)
    lower.set(xlim=(0.0, 1.03 * result.A_m), ylim=(0.0, 1.0), title="Vertical difference")
    lower.set(ylabel="ε (in)", xlabel="modal amplitude (in)")
    return figure


@styled
def draw_undamped_error(result: AmplitudeFrequency) -> Figure:
    """Draw the error of the undamped curve against amplitude over the resonant one (Fig. 4.9)."""
    figure, axes = build_panel(3.2, "amplitude / resonant amplitude", "error of neglecting damping (per cent)")
    for curve in result.curves:
        _draw_line(axes, curve.name, result.amplitude / result.A_m, curve.percent)
    axes.plot(0.5, CURVES["percent_at_half"], "s", **_PRINTED, label="printed, case I: 14 per cent at ½")
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 60.0))
    axes.legend(loc="upper left")
    return figure


def _limit_frequency(axes: Axes) -> None:
    axes.set_xlim(1.0 - _HALF_WIDTH, 1.0 + _HALF_WIDTH)
    axes.set_xticks([1.0 - 0.75 * _HALF_WIDTH, 1.0, 1.0 + 0.75 * _HALF_WIDTH])


def _draw_line(axes: Axes, name: str, x: FloatArray, y: FloatArray) -> None:
    """Draw a case in its colour and line: case V has those of the sum that it is, larger alphas dashed."""
    case, fifth = name.removeprefix("case "), name.startswith("case V,")
    law = "viscous + quadratic-displacement" if fifth else CASES[case]
    line: Any = (0, (6, 1.5, 1, 1.5)) if fifth and not name.endswith("= 1") else _CASE_LINES.get(name, "-")
    width, alpha = (3.2, 0.45) if name in _BROAD else (1.4, 1)
    axes.plot(x, y, color=law_style(law).colour, linestyle=line, label=name, linewidth=width, alpha=alpha)


def _draw_undamped(axes: Axes, result: AmplitudeFrequency) -> None:
    A = np.geomspace(result.amplitude[0], 3.0 * result.A_m, 200)
    for side, label in zip(result.undamped, ("undamped", None), strict=True):
        distance = (side[0] - 1.0) * result.amplitude[0]
        axes.plot(1.0 + distance / A, A, color=MUTED, linewidth=0.9, linestyle=(0, (2, 1.5)), label=label)


def _join_sides(curve: CaseCurve, below: FloatArray, above: FloatArray) -> tuple[FloatArray, FloatArray]:
    """eta^2 and a quantity along the curve, from below resonance through it to above."""
    return np.concatenate([curve.eta_squared[0], curve.eta_squared[1, ::-1]]), np.concatenate([below, above[::-1]])
