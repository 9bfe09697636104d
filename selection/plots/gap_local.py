"""Local estimates of natural frequency and damping ratio over amplitude, with what simulation and explanation say."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from selection.plots.style import ALERT, MUTED, WIDTH, plain_log, styled, with_unit

#: Amplitudes beyond this ratio are drawn on a logarithmic axis.
_WIDE = 4.0
_MARKS = "os^Dv<>P*X"


@styled
def gap_local(estimates: pd.DataFrame, curves: pd.DataFrame, length: str) -> Figure:
    """Draw frequency (left) and damping ratio (right) over amplitude.

    Args:
        estimates: ``sweep, amplitude, frequency, frequency_sd, damping, damping_sd``.
        curves: ``model`` (refitted, explained, free)``, amplitude, frequency, damping``; ``free`` has limits
            ``frequency_low`` and so on.
        length: unit of the amplitude.
    """
    figure = Figure(figsize=(WIDTH, 2.9))
    axes = figure.subplots(1, 2)
    for ax, quantity, label in zip(axes, ("frequency", "damping"), ("frequency (Hz)", "damping ratio"), strict=True):
        for model, colour in (("refitted", MUTED), ("explained", ALERT)):
            rows = curves[curves["model"] == model]
            ax.plot(rows["amplitude"], rows[quantity], color=colour, label=_NAMES[model])
        free = curves[curves["model"] == "free"]
        if len(free):
            low, high = free[f"{quantity}_low"], free[f"{quantity}_high"]
            ax.fill_between(free["amplitude"], low, high, color=ALERT, alpha=0.15, linewidth=0.0, label=_NAMES["free"])
        for number, (sweep, rows) in enumerate(estimates.groupby("sweep", sort=False)):
            ax.errorbar(
                rows["amplitude"], rows[quantity], rows[f"{quantity}_sd"], fmt=_MARKS[number % len(_MARKS)],
                markersize=3, linewidth=0.8, color="#1f2328", markerfacecolor="white", label=f"sweep {sweep}",
            )  # fmt: skip
        if estimates["amplitude"].max() > _WIDE * estimates["amplitude"].min():
            ax.set_xscale("log")
            plain_log(ax.xaxis)
        ax.set_ylim(*_range(estimates[quantity], curves.loc[curves["model"] != "free", quantity]))
        ax.set_xlabel(with_unit("amplitude", length))
        ax.set_ylabel(label)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)
    return figure


def _range(*values: pd.Series[float]) -> tuple[float, float]:
    """Limits that hold estimates and curves, with a margin; the band of free form may leave them."""
    every = pd.concat(values)
    margin = 0.1 * float(every.max() - every.min()) or 0.1 * float(every.max())
    return float(every.min()) - margin, float(every.max()) + margin


_NAMES = {
    "refitted": "simulation, refitted",
    "explained": "with the explanation",
    "free": "with a curve of free form, 90 % band",
}
