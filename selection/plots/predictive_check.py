"""Would the law have predicted the tests it was fitted to?"""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from selection.plots.style import MEASURED, WIDTH, law_style, plain_rows, short, styled

#: Panels beside one another.
_COLUMNS = 4


@styled
def predictive_check(table: pd.DataFrame, level: float) -> Figure:
    """Draw predictive intervals of resonant amplitude, in per cent of the measured: a panel a sweep, a row a law.

    Args:
        table: ``law, sweep, median, low, high``; 100 is the measured amplitude. level: content of the intervals.
    """
    laws = [str(law) for law in table["law"].unique()]
    sweeps = list(table["sweep"].unique())
    columns = min(_COLUMNS, len(sweeps))
    rows = -(-len(sweeps) // columns)
    figure = Figure(figsize=(WIDTH, 0.5 + rows * (0.5 + 0.19 * len(laws))))
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in panels[len(sweeps) :]:
        axes.remove()
    for axes, sweep in zip(panels, sweeps, strict=False):
        of_sweep = table[table["sweep"] == sweep]
        plain_rows(axes, laws)
        axes.axvline(100.0, color=MEASURED, linewidth=1.2)
        for law, median, low, high in of_sweep[["law", "median", "low", "high"]].itertuples(index=False):
            row, colour = laws.index(str(law)), law_style(str(law)).colour
            axes.plot([low, high], [row, row], color=colour, linewidth=2.0)
            axes.plot(median, row, "o", color=colour, markersize=4.5, markeredgecolor="white")
        axes.set_title(f"sweep {short(sweep)}")
    figure.supxlabel(f"{100 * level:g} % predictive interval of resonant amplitude (% of the measured)", fontsize=8.5)
    return figure
