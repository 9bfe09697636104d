"""Measured amplitude and phase of every sweep with the simulation before and after the explanation."""

from __future__ import annotations

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.plots.style import ALERT, AVERAGE, MEASURED, MUTED, WIDTH, styled, with_unit

LINES = {"nominal": (MUTED, (0, (1, 1.2))), "refitted": (MUTED, "-"), "explained": (ALERT, "-")}
NAMES = {
    "nominal": "simulation as given",
    "refitted": "refitted within its tolerance",
    "explained": "with the explanation",
}


@styled
def gap_overlay(measured: pd.DataFrame, predicted: pd.DataFrame, length: str, per_row: int = 3) -> Figure:
    """Draw one pair of panels a sweep: amplitude above phase, over frequency.

    Args:
        measured: ``sweep, frequency (Hz), amplitude, phase (rad, NaN where none), wild`` (left out of the fit).
        predicted: ``sweep, model, frequency, amplitude, phase``; models are nominal, refitted, explained.
        length: unit of the amplitude.
    """
    sweeps = list(measured["sweep"].unique())
    with_phase = bool(measured["phase"].notna().any())
    bands = -(-len(sweeps) // per_row)
    kinds = 2 if with_phase else 1
    ratios = [1.5, 1.0] * bands if with_phase else [1.0] * bands
    figure = Figure(figsize=(WIDTH, (3.1 if with_phase else 2.1) * bands + 0.5))
    axes = figure.subplots(bands * kinds, min(per_row, len(sweeps)), squeeze=False, height_ratios=ratios)
    for ax in axes.flat:
        ax.set_visible(False)
    for number, sweep in enumerate(sweeps):
        band, column = divmod(number, per_row)
        points, curves = measured[measured["sweep"] == sweep], predicted[predicted["sweep"] == sweep]
        upper = axes[band * kinds, column]
        _panel(upper, points, curves, "amplitude")
        upper.set_title(f"sweep {sweep}")
        if column == 0:
            upper.set_ylabel(with_unit("amplitude", length))
        lowest = upper
        if with_phase:
            lowest = axes[band * kinds + 1, column]
            _panel(lowest, points, curves, "phase")
            upper.tick_params(axis="x", labelbottom=False)
            if column == 0:
                lowest.set_ylabel("phase lag (rad)")
        lowest.set_xlabel("frequency (Hz)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _panel(ax: Axes, points: pd.DataFrame, curves: pd.DataFrame, quantity: str) -> None:
    ax.set_visible(True)
    for model, (colour, line) in LINES.items():
        rows = curves[curves["model"] == model]
        ax.plot(rows["frequency"], rows[quantity], color=colour, linestyle=line, label=NAMES[model])
    regular, wild = points[~points["wild"]], points[points["wild"]]
    ax.plot(regular["frequency"], regular[quantity], "o", color=MEASURED, markersize=2.6, label="measured", zorder=3)
    ax.plot(wild["frequency"], wild[quantity], "x", color=AVERAGE, markersize=4, zorder=3)
    ax.tick_params(axis="both", labelsize=7)
    ax.locator_params(axis="x", nbins=4)
