"""Where the axes of a finished figure lie and what they measure, so that a page can read values off it."""

from __future__ import annotations

import json
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

_POINTS = 72.0
_SCALES = ("linear", "log")


def scales(figure: Figure) -> str:
    """The axes of a figure that has been drawn, as JSON; empty where no value can be read off it.

    A list of ``{"box": [left, top, width, height], "x": scale, "y": scale}``, the box in points from the upper left
    corner as in SVG; a scale is ``{"name", "low", "high", "log"}`` from left to right or from bottom to top, or null
    where an axis has no name (rows of labels, densities).
    """
    found = [_axes(axes, figure) for axes in figure.axes if axes.get_visible() and axes.axison]
    readable = [one for one in found if one["x"] or one["y"]]
    return json.dumps(readable, ensure_ascii=False, separators=(",", ":")) if readable else ""


def _axes(axes: Axes, figure: Figure) -> dict[str, Any]:
    width, height = (_POINTS * inches for inches in figure.get_size_inches())
    place = axes.get_position()
    box = (place.x0 * width, (1.0 - place.y1) * height, place.width * width, place.height * height)
    scale = {which: None if axes.get_label() == "<colorbar>" else _scale(axes, figure, which) for which in "xy"}
    return {"box": [round(edge, 2) for edge in box], **scale}


def _scale(axes: Axes, figure: Figure, which: str) -> dict[str, Any] | None:
    """What an axis measures; None without a name of its own, of a panel that shares it, or of the whole figure."""
    shared = axes.get_shared_x_axes() if which == "x" else axes.get_shared_y_axes()
    axis, limits, kind = (
        (axes.xaxis, axes.get_xlim(), axes.get_xscale())
        if which == "x"
        else (axes.yaxis, axes.get_ylim(), axes.get_yscale())
    )
    labels = [getattr(one, f"{which}axis").get_label_text() for one in (axes, *shared.get_siblings(axes))]
    if isinstance(axis.get_major_formatter(), ScalarFormatter):
        labels.append(figure.get_supxlabel() if which == "x" else figure.get_supylabel())
    name = next((" ".join(label.split()) for label in labels if label), "")
    if not name or kind not in _SCALES:
        return None
    low, high = (float(f"{limit:.7g}") for limit in limits)
    return {"name": name, "low": low, "high": high, "log": kind == "log"}
