"""Chapter III of the source report: its figures redrawn from our computation, and what conditioning removes."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.arrays import FloatArray
from selection.plots.over_frequency import (
    DASH,
    DOT,
    OMEGA,
    PITCH,
    YAW,
    Curve,
    band,
    computed,
    from_zero,
    printed,
    single,
)
from selection.plots.style import ALERT, AVERAGE, INK, MUTED, WIDTH, styled

_STEPS = {"mode factor": (MUTED, DOT), "rigid body": (YAW, DASH), "adjacent modes": (AVERAGE, "-")}


@styled
def tail_displacement(omega: FloatArray, X: FloatArray, over: FloatArray, curve: Curve) -> Figure:
    """Draw tail displacement against frequency (Fig. 3.2): printed points, joined, and the planar fit with its band.

    Args:
        omega, X: the points, rad/s and in. over, curve: frequencies of the fit, and its displacement.
    """
    figure, axes = single("tail displacement (in)")
    band(axes, over, curve, "planar oscillator fitted to the tail, 90 % band")
    axes.plot(omega, X, color=MUTED, linestyle=DASH, linewidth=0.9, label="printed points joined")
    printed(axes, omega, X, "printed (Table 3.III)")
    from_zero(axes)
    return figure


@styled
def tail_phase_sine(omega: FloatArray, phase: FloatArray, over: FloatArray, curve: Curve) -> Figure:
    """Draw the sine of the tail's phase angle against frequency (Fig. 3.3); ``phase`` and ``curve`` in rad."""
    figure, axes = single("sine of tail phase angle")
    median, low, high = curve
    # between the ends of the band the sine has a maximum where the phase passes pi/2
    ends = np.sin(low), np.sin(high)
    top = np.where((low < 0.5 * np.pi) & (high > 0.5 * np.pi), 1.0, np.maximum(*ends))
    band(axes, over, (np.sin(median), np.minimum(*ends), top), "planar oscillator fitted to the tail, 90 % band")
    printed(axes, omega, np.sin(phase), "printed (Table 3.III, point 1 corrected)")
    from_zero(axes)
    return figure


@styled
def phase_angles(measured: pd.DataFrame, over: FloatArray, curve: Curve) -> Figure:
    """Draw phase angles of tail and second mode (Fig. 3.5).

    Args:
        measured: ``omega, tail_phase, phi_2_printed, phi_2`` (rad). over, curve: the planar fit to the mode.
    """
    figure, axes = single("phase angle (rad)")
    band(axes, over, curve, "planar oscillator fitted to the mode, 90 % band")
    axes.plot(measured["omega"], measured["tail_phase"], "s", color=MUTED, markersize=3.5, label="tail, printed")
    printed(axes, measured["omega"], measured["phi_2_printed"], "second mode, printed")
    computed(axes, measured["omega"], measured["phi_2"], "second mode, computed")
    axes.set_yticks([0.0, 0.25 * np.pi, 0.5 * np.pi, 0.75 * np.pi, np.pi], ["0", "π/4", "π/2", "3π/4", "π"])
    axes.set_ylim(0.0, np.pi)
    axes.legend(loc="upper left")
    return figure


@styled
def modal_amplitude(measured: pd.DataFrame, over: FloatArray, curve: Curve) -> Figure:
    """Draw modal amplitude against frequency (Fig. 3.6): ``omega, A_2_printed, A_2`` and the planar fit."""
    figure, axes = single("modal amplitude (in)")
    band(axes, over, curve, "planar oscillator fitted, 90 % band")
    printed(axes, measured["omega"], measured["A_2_printed"], "printed (Table 3.III)")
    computed(axes, measured["omega"], measured["A_2"], "computed (Eqs. 3.1.20-3.1.23)")
    from_zero(axes)
    return figure


@styled
def input_energy(measured: pd.DataFrame, corrected: pd.DataFrame, curves: pd.DataFrame) -> Figure:
    """Draw energy input per cycle against frequency (Fig. 3.9).

    Args:
        measured: ``omega, energy_printed, energy``. corrected: ``omega, energy`` of the rows marked +.
        curves: ``omega, energy, energy_report``: what one damping factor for all points loses.
    """
    figure, axes = single("energy per cycle (in-lb)")
    _one_damping(axes, curves, "energy")
    printed(axes, measured["omega"], measured["energy_printed"], "printed (Table 3.IV)")
    computed(axes, measured["omega"], measured["energy"], "computed, π X F sin φ (Eq. 3.2.9)")
    axes.plot(corrected["omega"], corrected["energy"], "+", color=ALERT, markersize=8, label="rows 6+, 9+")
    from_zero(axes)
    return figure


@styled
def principal_amplitudes(measured: pd.DataFrame, corrected: pd.DataFrame, curves: pd.DataFrame) -> Figure:
    """Draw principal pitch and yaw amplitudes against frequency (Fig. 3.10), a panel a plane.

    Args:
        measured: ``omega, pitch_printed, yaw_printed, pitch, yaw``; NaN where Eq. 3.2.15 has no root.
        corrected: ``omega, pitch, yaw`` of the rows marked +.
        curves: ``omega, pitch, yaw, pitch_report, yaw_report``: with one damping factor for all points.
    """
    figure = Figure(figsize=(WIDTH, 3.6))
    panels = figure.subplots(1, 2, sharey=True)
    for axes, plane in zip(panels, ("pitch", "yaw"), strict=True):
        _one_damping(axes, curves, plane)
        printed(axes, measured["omega"], measured[f"{plane}_printed"], "printed (Table 3.IV)")
        computed(axes, measured["omega"], measured[plane], "computed at the nearest root of Eq. 3.2.15")
        axes.plot(corrected["omega"], corrected[plane], "+", color=ALERT, markersize=8, label="rows 6+, 9+")
        axes.set_title(f"Principal {plane} plane")
        axes.set_xlabel(OMEGA)
        axes.set_ylim(bottom=0.0)
    panels[0].set_ylabel("modal amplitude (in)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


@styled
def conditioning_effect(effect: pd.DataFrame, removed: pd.DataFrame) -> Figure:
    """Draw what each step of the conditioning removed.

    Args:
        effect: ``step, omega, amplitude, phase`` after each step, rows of a step together.
        removed: ``omega`` and one column a part: motion in phase with the force that was removed (in).
    """
    figure = Figure(figsize=(WIDTH, 5.2))
    (left, right), (amplitude, phase) = figure.subplots(2, 2, sharex=True)
    first = effect[effect["step"] == effect["step"].iloc[0]]
    for step, rows in effect.groupby("step", sort=False):
        colour, line = _STEPS.get(str(step), (INK, "-"))
        style = {"color": colour, "linestyle": line, "marker": "o", "markersize": 3.0, "label": f"after {step}"}
        left.plot(rows["omega"], rows["amplitude"], **style)
        change = 100.0 * (rows["amplitude"].to_numpy() / first["amplitude"].to_numpy() - 1.0)
        amplitude.plot(rows["omega"], change, **style)
        phase.plot(rows["omega"], rows["phase"].to_numpy() - first["phase"].to_numpy(), **style)
    _parts(right, removed)
    for axes, title in zip(
        (left, right, amplitude, phase),
        ("Amplitude (in)", "Removed, in phase with the force (in)", "Change of amplitude (%)", "Change of phase (rad)"),
        strict=True,
    ):
        axes.set_title(title, fontsize=8.5)
    for axes in (amplitude, phase):
        axes.set_xlabel(OMEGA)
    left.set_ylim(bottom=0.0)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _parts(axes: Axes, removed: pd.DataFrame) -> None:
    """One line a part, labelled at its right end; the total beside."""
    parts = removed.drop(columns=["point", "omega"], errors="ignore")
    colours = (YAW, PITCH, "#009e73", "#aa4499", "#999933")
    for number, name in enumerate(parts):
        axes.plot(removed["omega"], parts[name], color=colours[number % len(colours)], label=str(name))
    axes.plot(removed["omega"], parts.sum(axis=1), color=INK, linewidth=1.8, label="total")
    axes.axhline(0.0, color=MUTED, linewidth=0.7)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.3 * (high - low))
    axes.legend(loc="upper right", ncols=3, fontsize=7)


def _one_damping(axes: Axes, curves: pd.DataFrame, name: str) -> None:
    """Curves with one damping factor for all points: the fitted planes, and the report's."""
    axes.plot(curves["omega"], curves[name], color=AVERAGE, label="planes and ξ fitted")
    report = curves[f"{name}_report"]
    axes.plot(curves["omega"], report, color=MUTED, linestyle=DASH, linewidth=1.1, label="report's planes, ξ = .005")
