"""Chapter III: conditioning of the test of Configuration I, its mode in two planes, damping factors with all roots.

``measured``, ``corrected``, ``curves`` and ``effect`` are tables of ``Chapter3``, which says what their columns hold.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from damping.arrays import FloatArray, Floats
from damping.plots import ALERT, AVERAGE, CREDIBLE, INK, LINEAR, MEASURED, MUTED, build_panel, build_panels, styled
from damping.plots.fits import corner
from damping.signals import plane_motion
from damping_reed1970 import LABELS
from damping_reed1970.chapter_3 import LARGEST_XI, MOST, PLANES, REPORT, pitch_response
from damping_reed1970.chapter_3.planar_fit import Fits, phasors
from damping_reed1970.chapter_3.planar_posterior import Curve, PlanarBand

OMEGA = "frequency ω (rad/s)"
PITCH = "#0072b2"
YAW = "#d55e00"
DASH = (0, (5, 2))
DOT = (0, (1.2, 1.6))


def draw_band(axes: Axes, omega: FloatArray, curve: Curve, label: str) -> None:
    """A curve with its band."""
    median, low, high = curve
    axes.fill_between(omega, low, high, color=CREDIBLE, linewidth=0, label=label)
    axes.plot(omega, median, color=AVERAGE, linewidth=1.3)


def draw_printed(axes: Axes, omega: FloatArray | pd.Series, y: FloatArray | pd.Series, label: str) -> None:
    """Printed points: open circles."""
    axes.plot(omega, y, "o", color="none", markeredgecolor=MEASURED, markersize=5.5, zorder=4, label=label)


def draw_compared(axes: Axes, measured: pd.DataFrame, name: str, printed: str, computed: str) -> None:
    """Printed points of a quantity, and computed ones: dots that fit into their circles."""
    draw_printed(axes, measured["omega"], measured[f"{name}_printed"], printed)
    axes.plot(measured["omega"], measured[name], ".", color=LINEAR, markersize=4.5, zorder=5, label=computed)


def draw_from_zero(axes: Axes) -> None:
    """Axis from zero, with room above for the legend."""
    axes.set_ylim(0.0, 1.45 * axes.dataLim.ymax)
    axes.legend(loc="upper left", fontsize=7.5)


_STEPS = {"mode factor": (MUTED, DOT), "rigid body": (YAW, DASH), "adjacent modes": (AVERAGE, "-")}


@styled
def draw_tail_displacement(measured: pd.DataFrame, tail: PlanarBand) -> Figure:
    """Draw tail displacement against frequency (Fig. 3.2): printed points, joined, and the planar fit with its band."""
    figure, axes = build_panel(3.3, OMEGA, "tail displacement (in)")
    median, low, high = (PLANES.phi * amplitude for amplitude in tail.amplitude)
    draw_band(axes, tail.omega, (median, low, high), "planar oscillator fitted to the tail, 90 % credible band")
    omega, points = measured["omega"], measured["tail"]
    axes.plot(omega, points, color=MUTED, linestyle=DASH, linewidth=0.9, label="printed points joined")
    draw_printed(axes, omega, points, "printed (Table 3.III)")
    draw_from_zero(axes)
    return figure


@styled
def draw_tail_phase_sine(measured: pd.DataFrame, tail: PlanarBand) -> Figure:
    """Draw the sine of the tail's phase angle against frequency (Fig. 3.3)."""
    figure, axes = build_panel(3.3, OMEGA, "sine of tail phase angle")
    median, low, high = tail.phase
    # between the ends of the band the sine has a maximum where the phase passes pi/2
    ends = np.sin(low), np.sin(high)
    top = np.where((low < 0.5 * np.pi) & (high > 0.5 * np.pi), 1.0, np.maximum(*ends))
    sines = np.sin(median), np.minimum(*ends), top
    draw_band(axes, tail.omega, sines, "planar oscillator fitted to the tail, 90 % credible band")
    draw_printed(axes, measured["omega"], np.sin(measured["tail_phase"]), "printed (Table 3.III, point 1 corrected)")
    draw_from_zero(axes)
    return figure


@styled
def draw_phase_angles(measured: pd.DataFrame, mode: PlanarBand) -> Figure:
    """Draw phase angles of tail and second mode (Fig. 3.5)."""
    figure, axes = build_panel(3.3, OMEGA, "phase angle (rad)")
    draw_band(axes, mode.omega, mode.phase, "planar oscillator fitted to the mode, 90 % credible band")
    axes.plot(measured["omega"], measured["tail_phase"], "s", color=MUTED, markersize=3.5, label="tail, printed")
    draw_compared(axes, measured, "phi_2", "second mode, printed", "second mode, computed")
    axes.set_yticks([0.0, 0.25 * np.pi, 0.5 * np.pi, 0.75 * np.pi, np.pi], ["0", "π/4", "π/2", "3π/4", "π"])
    axes.set_ylim(0.0, np.pi)
    axes.legend(loc="upper left")
    return figure


@styled
def draw_modal_amplitude(measured: pd.DataFrame, mode: PlanarBand) -> Figure:
    """Draw modal amplitude against frequency (Fig. 3.6) with the planar fit."""
    figure, axes = build_panel(3.3, OMEGA, "modal amplitude (in)")
    draw_band(axes, mode.omega, mode.amplitude, "planar oscillator fitted, 90 % credible band")
    draw_compared(axes, measured, "A_2", "printed (Table 3.III)", "computed (Eqs. 3.1.20-3.1.23)")
    draw_from_zero(axes)
    return figure


@styled
def draw_input_energy(measured: pd.DataFrame, corrected: pd.DataFrame, curves: pd.DataFrame) -> Figure:
    """Draw energy input per cycle against frequency (Fig. 3.9) with what one damping factor for all points loses."""
    figure, axes = build_panel(3.3, OMEGA, "energy per cycle (in-lb)")
    _draw_one_damping(axes, curves, "energy")
    draw_compared(axes, measured, "energy", "printed (Table 3.IV)", "computed, π X F sin φ (Eq. 3.2.9)")
    axes.plot(corrected["omega"], corrected["energy"], "+", color=ALERT, markersize=8, label="rows 6+, 9+")
    draw_from_zero(axes)
    return figure


@styled
def draw_principal_amplitudes(measured: pd.DataFrame, corrected: pd.DataFrame, curves: pd.DataFrame) -> Figure:
    """Draw principal pitch and yaw amplitudes against frequency (Fig. 3.10), one panel for each plane."""
    figure, panels = build_panels(5.6, 2, sharex=True, sharey=True)
    for axes, plane in zip(panels, ("pitch", "yaw"), strict=True):
        _draw_one_damping(axes, curves, plane)
        draw_compared(axes, measured, plane, "printed (Table 3.IV)", "computed at the nearest root of Eq. 3.2.15")
        axes.plot(corrected["omega"], corrected[plane], "+", color=ALERT, markersize=8, label="rows 6+, 9+")
        axes.set_title(f"Principal {plane} plane")
        axes.set(ylabel="modal amplitude (in)", ylim=(0.0, None))
    panels[1].set_xlabel(OMEGA)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=1)
    return figure


@styled
def draw_conditioning_effect(effect: pd.DataFrame, removed: pd.DataFrame) -> Figure:
    """Draw what each step of the conditioning removed: motion in phase with the force."""
    figure, (total, removals, amplitude, phase) = build_panels(7.6, 4, sharex=True)
    first = effect[effect["step"] == effect["step"].iloc[0]]
    for step, rows in effect.groupby("step", sort=False):
        colour, line = _STEPS.get(str(step), (INK, "-"))
        style = {"color": colour, "linestyle": line, "marker": "o", "markersize": 3.0, "label": f"after {step}"}
        total.plot(rows["omega"], rows["amplitude"], **style)
        change = 100.0 * (rows["amplitude"].to_numpy() / first["amplitude"].to_numpy() - 1.0)
        amplitude.plot(rows["omega"], change, **style)
        phase.plot(rows["omega"], rows["phase"].to_numpy() - first["phase"].to_numpy(), **style)
    _draw_parts(removals, removed)
    titles = (
        "Amplitude (in)",
        "Removed, in phase with the force (in)",
        "Change of amplitude (%)",
        "Change of phase (rad)",
    )
    for axes, title in zip((total, removals, amplitude, phase), titles, strict=True):
        axes.set_title(title, fontsize=8.5)
    phase.set_xlabel(OMEGA)
    total.set_ylim(bottom=0.0)
    figure.legend(*total.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _draw_parts(axes: Axes, removed: pd.DataFrame) -> None:
    """One line for each part, labelled at its right end; the total beside."""
    parts = removed.drop(columns=["point", "omega"], errors="ignore")
    colours = (YAW, PITCH, "#009e73", "#aa4499", "#999933")
    for number, name in enumerate(parts):
        axes.plot(removed["omega"], parts[name], color=colours[number % len(colours)], label=str(name))
    axes.plot(removed["omega"], parts.sum(axis=1), color=INK, linewidth=1.8, label="total")
    axes.axhline(0.0, color=MUTED, linewidth=0.7)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.3 * (high - low))
    axes.legend(loc="upper right", ncols=3, fontsize=7)


def _draw_one_damping(axes: Axes, curves: pd.DataFrame, name: str) -> None:
    """Curves with one damping factor for all points: the fitted planes, and the report's."""
    axes.plot(curves["omega"], curves[name], color=AVERAGE, label="planes and ξ fitted")
    report = curves[f"{name}_report"]
    axes.plot(curves["omega"], report, color=MUTED, linestyle=DASH, linewidth=1.1, label="report's planes, ξ = .005")


@styled
def draw_planar_overlay(measured: pd.DataFrame, mode: PlanarBand, curves: pd.DataFrame) -> Figure:
    """Draw measured amplitude and phase with the planar oscillator: all free, two held, and with a lag and motion in
    phase with the force fitted too."""
    figure, (upper, lower) = build_panels(4.9, 2, sharex=True, height_ratios=(1.6, 1.0))
    for axes, name, points, curve in (
        (upper, "amplitude", "A_2_printed", mode.amplitude),
        (lower, "phase", "phi_2_printed", mode.phase),
    ):
        draw_band(axes, mode.omega, curve, "all parameters free: median and 90 % credible band")
        for suffix, colour, line, label in (
            ("held", LINEAR, DASH, "θ = 28°, M = 21 held"),
            ("more", PITCH, DOT, "with motion in phase and a common lag"),
        ):
            axes.plot(curves["omega"], curves[f"{name}_{suffix}"], color=colour, linestyle=line, label=label)
        draw_printed(axes, measured["omega"], measured[points], "measured (Table 3.III)")
    upper.set_ylabel("modal amplitude (in)")
    draw_from_zero(upper)
    lower.set(xlabel=OMEGA, ylabel="phase lag (rad)")
    lower.set_yticks([0.0, 0.5 * np.pi, np.pi], ["0", "π/2", "π"])
    figure.align_ylabels()
    return figure


@styled
def draw_planar_posterior(draws: Mapping[str, FloatArray], prior: Mapping[str, FloatArray]) -> Figure:
    """Draw the posterior of omega_p, omega_y, xi, theta (degrees) and M with its prior; keys are those names."""

    def scale(values: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        shown = LABELS["posterior_axes"].items()
        return {label: factor * (values[name] - off) for name, (label, off, factor) in shown}

    return corner(scale(draws), scale(prior))


@styled
def draw_damping_roots(branches: pd.DataFrame, fitted: Sequence[float]) -> Figure:
    """Draw all roots of Eq. 3.2.15 (:func:`tabulate_branch`) against frequency with the printed xi.

    ``fitted``: low end, median and high end of the planar oscillator's one damping factor.
    """
    largest = LARGEST_XI
    figure, axes = build_panel(3.9, OMEGA, "damping factor ξ")
    low, median, high = fitted
    axes.axhspan(low, high, color=CREDIBLE, linewidth=0, label="planar oscillator, one ξ: 90 % credible")
    axes.axhline(median, color=AVERAGE, linewidth=1.0)
    omega = branches["omega"]
    axes.vlines(omega, branches["xi_low"], branches["xi_high"].clip(upper=largest), color=MUTED, linewidth=0.7)
    for name, marker, colour in (("low", "v", PITCH), ("high", "^", YAW)):
        axes.plot(omega, branches[f"xi_{name}"], marker, color=colour, markersize=4.5, label=f"{name} root")
    none = branches[branches["roots"] == 0]
    axes.plot(none["omega"], none["xi_of_largest"], "x", color=ALERT, label="no root: ξ of the largest energy")
    draw_printed(axes, omega, branches["xi_printed"], "printed (Table 3.IV)")
    axes.set(yscale="log", ylim=(1e-4, largest))
    axes.set_yticks([1e-4, 1e-3, 0.005, 1e-2, largest], ["0.0001", "0.001", "0.005", "0.01", f"{largest:g}"])
    axes.minorticks_off()
    figure.legend(loc="outside lower center", ncols=2)
    return figure


@styled
def draw_yaw_amplitude(yaw: pd.DataFrame) -> Figure:
    """Draw the yaw amplitude that fits to the pitch motion predict beside the measured one, which no fit has seen."""
    figure, axes = build_panel(3.3, OMEGA, "yaw amplitude (in)")
    styles = ((AVERAGE, "-"), (LINEAR, DASH), (PITCH, DOT))
    for (colour, line), name in zip(styles, yaw.columns.drop(["point", "omega", "measured"]), strict=False):
        axes.plot(yaw["omega"], yaw[name], color=colour, linestyle=line, label=f"predicted: {name}")
    draw_printed(axes, yaw["omega"], yaw["measured"], "measured (Table 3.I, over the mode factor)")
    draw_from_zero(axes)
    return figure


#: Mean damping factor of the second mode (section 3.2).
MEAN_XI = 0.005


def tabulate_fitted_curves(fits: Fits) -> pd.DataFrame:
    """Curves over frequency with one xi for all points; the force is interpolated between the points.

    ``pitch, yaw, energy``: amplitudes in the principal planes (Eq. 3.2.12) and energy per cycle of the free fit;
    ``pitch_report, yaw_report, energy_report``: of the report's planes with its mean xi of .005. Along the force,
    ``amplitude_held, phase_held``: of the fit with the report's angle and mass; ``amplitude_more, phase_more``: with
    motion in phase and a lag fitted too.
    """
    data, free = phasors("A2"), fits["A2", "constant", "free"]
    omega = np.linspace(data.omega[0], data.omega[-1], 221)
    F = np.interp(omega, data.omega, data.F)
    curves: dict[str, Floats] = {"omega": omega}
    for suffix, planes, xi in (("", free.planes, free.xi), ("_report", PLANES, MEAN_XI)):
        motion = plane_motion(planes, F / PLANES.phi, omega, xi)
        curves |= {f"pitch{suffix}": motion.A_p, f"yaw{suffix}": motion.A_y, f"energy{suffix}": motion.E_p + motion.E_y}
    for suffix, variant in (("_held", REPORT), ("_more", MOST)):
        response = pitch_response(fits["A2", "constant", variant].model, F, omega)
        curves |= {f"amplitude{suffix}": np.abs(response), f"phase{suffix}": -np.angle(response)}
    return pd.DataFrame(curves)
