"""Studies side by side: weights of laws, predictions at design forces, posteriors of parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from selection.plots.style import GRID, INK, LINEAR, WIDTH, plain_rows, short, styled, with_unit

#: Colours and markers of studies, in order; there are not more of either.
COLOURS = ("#0060a8", "#d55e00", "#009e73", "#882255", "#8c6d1f", "#5c6670", "#332288", "#d45fb0")
MARKERS = "osD^vP*X"
#: Studies that can be told apart in a figure.
MOST_STUDIES = len(COLOURS)
_LETTERS = 30


@styled
def weights(table: pd.DataFrame, studies: Sequence[str]) -> Figure:
    """Draw the weight of each law in each study.

    Args:
        table: ``law, study, weight``; the first law on top. studies: their names, in order.
    """
    laws = list(dict.fromkeys(table["law"]))
    figure = Figure(figsize=(0.85 * WIDTH, 0.9 + 0.24 * len(laws)))
    axes = figure.subplots()
    plain_rows(axes, [short(law, 60) for law in laws])
    for place, name in enumerate(studies):
        mine = table[table["study"] == name]
        rows = [laws.index(law) for law in mine["law"]]
        _points(axes, mine["weight"].to_numpy(float), np.array(rows) + _aside(place, len(studies)), place, name)
    axes.set_xlim(left=-0.02)
    axes.set_xlabel("weight (posterior probability)")
    _lines(axes, len(laws))
    figure.legend(loc="outside upper right", ncols=min(4, len(studies)))
    return figure


@styled
def predictions(table: pd.DataFrame, studies: Sequence[str], force_unit: str, length_unit: str) -> Figure:
    """Draw the predicted amplitude of each study at each design force with its interval, and what is linear.

    Args:
        table: ``force, study, median, low, high, linear``.
    """
    forces = sorted(set(table["force"]))
    figure = Figure(figsize=(0.85 * WIDTH, 3.6))
    axes = figure.subplots()
    for place, name in enumerate(studies):
        mine = table[table["study"] == name]
        x = np.array([forces.index(force) for force in mine["force"]]) + _aside(place, len(studies))
        median, low, high = (mine[column].to_numpy(float) for column in ("median", "low", "high"))
        axes.vlines(x, low, high, color=COLOURS[place], linewidth=2.2)
        axes.plot(x, median, MARKERS[place], color=COLOURS[place], markeredgecolor="white", label=short(name, _LETTERS))
        axes.plot(x, mine["linear"].to_numpy(float), "_", color=LINEAR, markersize=9, markeredgewidth=1.6)
    axes.plot([], [], "_", color=LINEAR, markersize=9, markeredgewidth=1.6, label="linear damping")
    axes.set_xticks(range(len(forces)), [f"{force:g}" for force in forces])
    axes.set_xlim(-0.6, len(forces) - 0.4)
    axes.set_xlabel(with_unit("design force", force_unit))
    axes.set_ylabel(with_unit("resonant amplitude", length_unit))
    figure.legend(loc="outside upper right", ncols=min(4, len(studies) + 1))
    return figure


@styled
def posteriors(table: pd.DataFrame, studies: Sequence[str]) -> Figure:
    """Draw the posterior interval of each parameter in each study, relative to its median over the studies.

    Args:
        table: ``law, parameter, study, low, median, high``, medians other than 0.
    """
    keys = list(dict.fromkeys(zip(table["law"], table["parameter"], strict=True)))
    middle = table.groupby(["law", "parameter"], sort=False)["median"].median()
    figure = Figure(figsize=(WIDTH, 0.9 + (0.16 + 0.09 * len(studies)) * len(keys)))
    axes = figure.subplots()
    plain_rows(axes, [short(law if law == name else f"{law}: {name}", 60) for law, name in keys])
    for place, name in enumerate(studies):
        mine = table[table["study"] == name]
        pairs = list(zip(mine["law"], mine["parameter"], strict=True))
        scale = np.array([middle[pair] for pair in pairs], dtype=float)
        low, median, high = (mine[column].to_numpy(float) / scale for column in ("low", "median", "high"))
        y = np.array([keys.index(pair) for pair in pairs]) + _aside(place, len(studies))
        axes.hlines(y, low, high, color=COLOURS[place], linewidth=1.8)
        _points(axes, median, y, place, name)
    axes.axvline(1.0, color=INK, linewidth=0.7)
    axes.set_xlabel("posterior, relative to the middle of the medians")
    _lines(axes, len(keys))
    figure.legend(loc="outside upper right", ncols=min(4, len(studies)))
    return figure


def _points(axes: Axes, x: np.ndarray, y: np.ndarray, place: int, name: str) -> None:
    axes.plot(x, y, MARKERS[place], color=COLOURS[place], markeredgecolor="white", label=short(name, _LETTERS))


def _aside(place: int, studies: int) -> float:
    """How far a study is moved from the middle of a row, so that none hides another."""
    return 0.6 * ((place + 0.5) / studies - 0.5)


def _lines(axes: Axes, rows: int) -> None:
    """Faint lines between the rows."""
    for row in range(1, rows):
        axes.axhline(row - 0.5, color=GRID, linewidth=0.6)
