"""Resonant amplitude of every sweep over force, with the simulation before and after the explanation."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from selection.plots.gap_overlay import LINES, NAMES
from selection.plots.style import MEASURED, WIDTH, styled, with_unit


@styled
def gap_resonances(measured: pd.DataFrame, predicted: pd.DataFrame, force: str, length: str) -> Figure:
    """Draw amplitude at phase resonance over force.

    Args:
        measured: ``sweep, force, amplitude, sd`` (relative). predicted: ``model, force, amplitude``; models are
            nominal, refitted, explained. force, length: units.
    """
    figure = Figure(figsize=(WIDTH, 3.0))
    ax = figure.subplots()
    for model, (colour, line) in LINES.items():
        rows = predicted[predicted["model"] == model].sort_values("force")
        ax.plot(rows["force"], rows["amplitude"], color=colour, linestyle=line, label=NAMES[model])
    bars = measured["sd"] * measured["amplitude"]
    ax.errorbar(
        measured["force"], measured["amplitude"], bars, fmt="o", color=MEASURED, markersize=3.5, label="measured"
    )
    ax.set_xlabel(with_unit("force", force))
    ax.set_ylabel(with_unit("resonant amplitude", length))
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure
