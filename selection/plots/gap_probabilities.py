"""Probabilities of the explanations as bars."""

from __future__ import annotations

import pandas as pd
from matplotlib.figure import Figure

from selection.plots.style import ALERT, INK, MUTED, WIDTH, plain_rows, styled, weight_text


@styled
def gap_probabilities(table: pd.DataFrame) -> Figure:
    """Draw one bar an explanation, most probable on top.

    Args:
        table: ``explanation, probability, listed`` (among those that together reach 0.95).
    """
    figure = Figure(figsize=(WIDTH, 0.7 + 0.24 * len(table)))
    ax = figure.subplots()
    plain_rows(ax, table["explanation"].tolist())
    colours = [ALERT if listed else MUTED for listed in table["listed"]]
    ax.barh(range(len(table)), table["probability"], color=colours, height=0.6)
    for row, probability in enumerate(table["probability"]):
        ax.annotate(
            weight_text(float(probability)), (probability, row), (4, 0), textcoords="offset points",
            va="center", fontsize=7.5, color=INK,
        )  # fmt: skip
    ax.set_xlim(0.0, 1.12)
    ax.set_xlabel("probability")
    return figure
