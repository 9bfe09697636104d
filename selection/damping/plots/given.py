"""Drawing on the caller's axes: names and bars that fit into them, and colours that show on their background."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from colorsys import hls_to_rgb, rgb_to_hls
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb, to_rgba

from damping.arrays import FloatArray
from damping.errors import InputError, check_kind
from damping.records.text import describe_shortened

#: Height of a row, a bar below its name, and mean width of a letter of the name, points.
_ROW = 24.0
_LETTER = 4.7
_SIZE = 8.0  #: size of the names, points
_MOST = 10  #: rows at most: those that follow have no probability that a bar would show
#: A bar's middle below the middle of its row, and its height, in rows.
_BELOW = 0.22
_THICK = 0.36
#: Relative luminance of a ground on which black and white stand out alike (WCAG 2.1: (L + .05)^2 = .05 * 1.05).
_DARK = 0.179
_LUMINOUS = (0.2126, 0.7152, 0.0722)  #: share of red, green and blue in luminance
#: Colours that artists have.
_COLOURS = ("color", "facecolor", "edgecolor", "markerfacecolor", "markeredgecolor")


def count_rows(axes: Axes, rows: int) -> int:
    """Number of ``rows`` for which the axes have room."""
    return int(np.clip(_measure(axes)[1] // _ROW, 1, min(rows, _MOST)))


def name_rows(axes: Axes, names: Sequence[str]) -> tuple[FloatArray, float]:
    """Write the names of rows inside the axes, first on top, and return the places and the height of their bars.

    Outside there may be other axes. A name longer than the axes are wide is cut.
    """
    letters = int(_measure(axes)[0] / _LETTER)
    rows = np.arange(float(len(names)))
    axes.set_yticks(rows, [describe_shortened(name, letters, "…") for name in names])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0, pad=-4.0, labelsize=_SIZE)
    for label in axes.get_yticklabels():
        label.set(horizontalalignment="left", verticalalignment="bottom")
    axes.grid(visible=False, axis="y")
    return rows + _BELOW, _THICK


def _measure(axes: Axes) -> tuple[float, float]:
    """Width and height, points."""
    box = axes.get_window_extent()
    return 72.0 * box.width / axes.figure.dpi, 72.0 * box.height / axes.figure.dpi


def check_axes(axes: Axes | None) -> None:
    """Raise InputError if axes that are given are no matplotlib axes, or polar, in three dimensions, or of a map."""
    if axes is None:
        return
    check_kind(axes, Axes, "ax")
    if axes.name != "rectilinear":
        raise InputError(f"ax has {axes.name} coordinates", expected="Axes with a plain x and y")


@contextmanager
def drawn_on(axes: Axes, style: Mapping[Any, Any], palette: Collection[str]) -> Iterator[None]:
    """Context for drawing on ``axes``: the common ``style``, with texts and frames in the colours of the axes.

    On a dark background the lightness L of each colour of the ``palette``, which is made for a light one, becomes
    1 - L: lines are light, the area beyond the test is dark, and hues stay.

    InputError: as `check_axes`.
    """
    check_axes(axes)
    before = set(axes.get_children())
    with rc_context({key: value for key, value in style.items() if "color" not in key and key != "legend.frameon"}):
        yield
    if _is_dark(axes):
        turned = {to_rgb(colour): _turn(to_rgb(colour)) for colour in palette}
        drawn = [artist for artist in axes.get_children() if artist not in {*before, *axes.child_axes}]
        for part in (part for artist in drawn for part in artist.findobj()):
            for what in _COLOURS:
                if hasattr(part, f"set_{what}") and hasattr(part, f"get_{what}"):
                    _recolour(part, what, turned)


def _is_dark(axes: Axes) -> bool:
    ground = axes.get_facecolor() if to_rgba(axes.get_facecolor())[3] else axes.figure.get_facecolor()
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(ground)]
    return bool(np.dot(linear, _LUMINOUS) < _DARK)


def _turn(colour: tuple[float, float, float]) -> tuple[float, float, float]:
    hue, lightness, saturation = rgb_to_hls(*colour)
    return hls_to_rgb(hue, 1.0 - lightness, saturation)


def _recolour(part: Artist, what: str, turned: dict[Any, Any]) -> None:
    """One colour of an artist, or of each of a collection."""
    now = getattr(part, f"get_{what}")()
    each = [to_rgba(colour) for colour in (now if np.ndim(now) == 2 else [now])]
    after = [(*turned.get(colour[:3], colour[:3]), colour[3]) for colour in each]
    if after != each:
        getattr(part, f"set_{what}")(after if np.ndim(now) == 2 else after[0])
