"""The mode in two planes fitted to the test of Configuration I, and the damping factors with all their roots."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from selection.arrays import FloatArray
from selection.plots.corner import corner
from selection.plots.over_frequency import DASH, DOT, OMEGA, PITCH, YAW, Curve, band, from_zero, printed, single
from selection.plots.style import ALERT, AVERAGE, CREDIBLE, LINEAR, MUTED, WIDTH, styled


@styled
def planar_overlay(
    measured: pd.DataFrame, over: FloatArray, amplitude: Curve, phase: Curve, curves: pd.DataFrame
) -> Figure:
    """Draw measured amplitude and phase with the fitted planar oscillator.

    Args:
        measured: ``omega, A_2_printed, phi_2_printed``. over: frequencies of the band.
        amplitude, phase: median and band of the posterior with all parameters free.
        curves: ``omega, amplitude_held, phase_held`` (the report's angle and mass held), ``amplitude_more, phase_more``
            (motion in phase with the force and a lag fitted too).
    """
    figure = Figure(figsize=(WIDTH, 4.9))
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    for axes, name, points, curve in (
        (upper, "amplitude", "A_2_printed", amplitude),
        (lower, "phase", "phi_2_printed", phase),
    ):
        band(axes, over, curve, "all parameters free: median and 90 % band")
        for suffix, colour, line, label in (
            ("held", LINEAR, DASH, "θ = 28°, M = 21 held"),
            ("more", PITCH, DOT, "with motion in phase and a common lag"),
        ):
            axes.plot(curves["omega"], curves[f"{name}_{suffix}"], color=colour, linestyle=line, label=label)
        printed(axes, measured["omega"], measured[points], "measured (Table 3.III)")
    upper.set_ylabel("modal amplitude (in)")
    from_zero(upper)
    lower.set_ylabel("phase lag (rad)")
    lower.set_yticks([0.0, 0.5 * np.pi, np.pi], ["0", "π/2", "π"])
    lower.set_xlabel(OMEGA)
    figure.align_ylabels()
    return figure


@styled
def planar_posterior(draws: Mapping[str, FloatArray], prior: Mapping[str, FloatArray]) -> Figure:
    """Draw the posterior of omega_p, omega_y, xi, theta (degrees) and M with its prior; keys are those names."""
    shown = {  # name: label, what is taken off, factor; so that three digits say enough
        "omega_p": ("ω_p − 11 (rad/s)", 11.0, 1.0),
        "omega_y": ("ω_y − 11 (rad/s)", 11.0, 1.0),
        "xi": ("ξ (%)", 0.0, 100.0),
        "theta": ("θ (°)", 0.0, 1.0),
        "M": ("M (lb s²/in)", 0.0, 1.0),
    }
    scaled = [
        {label: factor * (values[name] - off) for name, (label, off, factor) in shown.items()}
        for values in (draws, prior)
    ]
    return corner(*scaled)


@styled
def damping_roots(branches: pd.DataFrame, fitted: Sequence[float], largest: float = 0.05) -> Figure:
    """Draw all roots of Eq. 3.2.15 against frequency with the printed xi.

    Args:
        branches: ``point, omega, xi_low, xi_high, xi_printed, xi_of_largest, roots``.
        fitted: low end, median and high end of the planar oscillator's one damping factor. largest: top of the axis.
    """
    figure = Figure(figsize=(WIDTH, 3.9))
    axes = figure.add_subplot()
    low, median, high = fitted
    axes.axhspan(low, high, color=CREDIBLE, linewidth=0, label="planar oscillator, one ξ for all points")
    axes.axhline(median, color=AVERAGE, linewidth=1.0)
    omega = branches["omega"]
    axes.vlines(omega, branches["xi_low"], branches["xi_high"].clip(upper=largest), color=MUTED, linewidth=0.7)
    for name, marker, colour in (("low", "v", PITCH), ("high", "^", YAW)):
        axes.plot(omega, branches[f"xi_{name}"], marker, color=colour, markersize=4.5, label=f"{name} root")
    none = branches[branches["roots"] == 0]
    axes.plot(none["omega"], none["xi_of_largest"], "x", color=ALERT, label="no root: ξ of the largest energy")
    printed(axes, omega, branches["xi_printed"], "printed (Table 3.IV)")
    axes.set_yscale("log")
    axes.set_ylim(1e-4, largest)
    axes.set_yticks([1e-4, 1e-3, 0.005, 1e-2, largest], ["0.0001", "0.001", "0.005", "0.01", f"{largest:g}"])
    axes.minorticks_off()
    axes.set_xlabel(OMEGA)
    axes.set_ylabel("damping factor ξ")
    figure.legend(loc="outside lower center", ncols=3)
    return figure


@styled
def yaw_amplitude(yaw: pd.DataFrame) -> Figure:
    """Draw the yaw amplitude that fits to the pitch motion predict beside the measured one, which no fit has seen.

    Args:
        yaw: ``omega, measured`` and one column a fit, in.
    """
    figure, axes = single("yaw amplitude (in)")
    styles = ((AVERAGE, "-"), (LINEAR, DASH), (PITCH, DOT))
    for (colour, line), name in zip(styles, yaw.columns.drop(["point", "omega", "measured"]), strict=False):
        axes.plot(yaw["omega"], yaw[name], color=colour, linestyle=line, label=f"predicted: {name}")
    printed(axes, yaw["omega"], yaw["measured"], "measured (Table 3.I, over the mode factor)")
    from_zero(axes)
    return figure
