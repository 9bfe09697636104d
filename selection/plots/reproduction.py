"""Every printed result beside its recomputation: how far apart, and which differences are known errata."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from selection.arrays import FloatArray
from selection.plots.style import ALERT, AVERAGE, MUTED, WIDTH, plain_rows, styled

#: Differences below this many per cent are drawn on a linear scale.
_LINEAR = 1.0


@styled
def reproduction(table: pd.DataFrame) -> Figure:
    """Draw 100 (computed/printed - 1) by group of ids.

    Args:
        table: ``id, printed`` (text), ``computed, computed_after_correction`` (numbers or missing), ``erratum``
            (empty where there is none). Rows whose printed value is no number other than zero are not drawn.
    """
    rows = percent_differences(table)
    groups = list(rows["group"].unique())
    figure = Figure(figsize=(WIDTH, 1.1 + 0.2 * len(groups)))
    axes = figure.add_subplot()
    counts = rows["group"].value_counts()
    plain_rows(axes, [f"{group} ({counts[group]})" for group in groups])
    axes.axvline(0.0, color=MUTED, linewidth=0.8)
    level = rows["group"].map(groups.index).to_numpy(float) + _spread(rows)
    known = rows["erratum"].astype(str).ne("").to_numpy()
    for chosen, colour, marker, label in (
        (~known, AVERAGE, "o", "no erratum"),
        (known, ALERT, "X", "erratum known"),
    ):
        axes.plot(rows["percent"][chosen], level[chosen], marker, color=colour, markersize=4, alpha=0.75, label=label)
    corrected: dict[str, Any] = {
        "color": "white",
        "markeredgecolor": ALERT,
        "markersize": 3.5,
        "label": "after correction",
    }
    axes.plot(rows["percent_corrected"], level, "D", **corrected)
    axes.set_xscale("symlog", linthresh=_LINEAR)
    axes.xaxis.set_major_formatter(lambda value, position: f"{value:g}")
    axes.set_xlabel("computed against printed (%), linear within ±1 %, logarithmic beyond")
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def percent_differences(table: pd.DataFrame) -> pd.DataFrame:
    """Comparable rows with ``group``, ``percent`` and ``percent_corrected`` = 100 (computed/printed - 1)."""
    printed = pd.to_numeric(table["printed"], errors="coerce")
    rows = table.assign(
        group=table["id"].map(group_of),
        percent=100.0 * (pd.to_numeric(table["computed"], errors="coerce") / printed - 1.0),
        percent_corrected=100.0 * (pd.to_numeric(table["computed_after_correction"], errors="coerce") / printed - 1.0),
    )
    return rows[np.isfinite(rows["percent"]) & (printed != 0.0)].reset_index(drop=True)


def group_of(identity: str) -> str:
    """Group of an id: ``tab2II`` of ``tab2II.energy_factor[I]``."""
    return re.split(r"[.\[]", identity, maxsplit=1)[0]


def _spread(rows: pd.DataFrame) -> FloatArray:
    """Small vertical steps, so that rows of one group do not hide one another."""
    number = rows.groupby("group").cumcount().to_numpy(float)
    return 0.28 * np.sin(2.399963 * number)  # the golden angle: neighbours land apart
