"""Local estimates of natural frequency and damping ratio over amplitude, with what simulation and explanation say."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from selection.plots.style import ALERT, MUTED, WIDTH, styled, with_unit

_MARKS = "os^Dv<>P*X"


@styled
def gap_local(estimates: pd.DataFrame, curves: pd.DataFrame, length: str) -> Figure:
    """Draw frequency (left) and damping ratio (right) over amplitude.

    Args:
        estimates: ``sweep, amplitude, frequency, frequency_sd, damping, damping_sd``.
        curves: ``model`` (refitted, explained)``, amplitude, frequency, damping``.
        length: unit of the amplitude.
    """
    figure = Figure(figsize=(WIDTH, 2.9))
    axes = figure.subplots(1, 2)
    for ax, quantity, label in zip(axes, ("frequency", "damping"), ("frequency (Hz)", "damping ratio"), strict=True):
        for model, colour in (("refitted", MUTED), ("explained", ALERT)):
            rows = curves[curves["model"] == model]
            ax.plot(rows["amplitude"], rows[quantity], color=colour, label=_NAMES[model])
        for number, (sweep, rows) in enumerate(estimates.groupby("sweep", sort=False)):
            ax.errorbar(
                rows["amplitude"], rows[quantity], rows[f"{quantity}_sd"], fmt=_MARKS[number % len(_MARKS)],
                markersize=3, linewidth=0.8, color="#1f2328", markerfacecolor="white", label=f"sweep {sweep}",
            )  # fmt: skip
        ax.set_xscale("log")
        ax.set_xlabel(with_unit("amplitude", length))
        ax.set_ylabel(label)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5)
    return figure


_NAMES = {"refitted": "simulation, refitted", "explained": "with the explanation"}
