"""Plotting functions: tables and arrays in, a matplotlib Figure out. This module: the common style, and SVG output.

A law has the same colour and line in every figure. A single force is solid; viscous with another force has the colour
of that force, dashed; any other sum (a selected polynomial) is dash-dotted or dotted in a colour derived from its name.
The colours are from the Okabe-Ito and Tol sets, which people with the common colour deficiencies can distinguish; line
styles, labels and positions repeat the information.
"""

import io
import json
import re
import warnings
from collections.abc import Callable, Iterable
from functools import partial, wraps
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar, cast
from xml.etree import ElementTree
from zlib import crc32

from matplotlib import rc_context, rc_params_from_file, rcParamsDefault
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from damping.forces import CATALOGUE, Viscous
from damping.plots.given import drawn_on
from damping.records.text import describe_shortened


def describe_scales(figure: Figure) -> str:
    """The axes of a figure that has been drawn, as JSON; empty if no values can be read from it.

    A list of ``{"box": [left, top, width, height], "x": scale, "y": scale}``, the box in points from the upper left
    corner as in SVG; a scale is ``{"name", "low", "high", "log"}`` from left to right or from bottom to top, or null
    where an axis has no name (rows of labels, densities).
    """
    described = [_describe_axes(axes, figure) for axes in figure.axes if axes.get_visible() and axes.axison]
    readable = [axes for axes in described if axes["x"] or axes["y"]]
    return json.dumps(readable, ensure_ascii=False, separators=(",", ":")) if readable else ""


def _describe_axes(axes: Axes, figure: Figure) -> dict[str, Any]:
    width, height = (72.0 * inches for inches in figure.get_size_inches())
    place = axes.get_position()
    box = (place.x0 * width, (1.0 - place.y1) * height, place.width * width, place.height * height)
    named = axes.get_label() != "<colorbar>"
    scales = {which: _describe_scale(axes, figure, which) if named else None for which in "xy"}
    return {"box": [round(edge, 2) for edge in box], **scales}


def _describe_scale(axes: Axes, figure: Figure, which: str) -> dict[str, Any] | None:
    """The scale of an axis; None without a name: its own, that of a panel that shares it, or that of the figure."""
    panels = (axes, *getattr(axes, f"get_shared_{which}_axes")().get_siblings(axes))
    axis, limits, kind = (getattr(axes, f"get_{which}{what}")() for what in ("axis", "lim", "scale"))
    labels = [getattr(panel, f"{which}axis").get_label_text() for panel in panels]
    if isinstance(axis.get_major_formatter(), ScalarFormatter):
        labels.append(figure.get_supxlabel() if which == "x" else figure.get_supylabel())
    name = next((" ".join(label.split()) for label in labels if label), "")
    if not name or kind not in ("linear", "log"):
        return None
    low, high = (float(f"{limit:.7g}") for limit in limits)
    return {"name": name, "low": low, "high": high, "log": kind == "log"}


TEXT_WIDTH = 6.7  #: width of the text of an A4 page, inches (17 cm)
#: Width of a figure, inches: read on a telephone without scrolling, and two stand side by side elsewhere.
WIDTH = 4.8
MOST_LABELS = 40  #: labels beside points: more hide the points
#: Texts and axes.
INK = "#1f2328"
#: Texts of less weight: 5.9 to 1 against white, above the 4.5 that small text needs (WCAG 2.1).
MUTED = "#5c6670"
BESIDE: Any = {"textcoords": "offset points", "va": "center", "fontsize": 7.5}  #: a label beside a bar
PAGE_DPI = 130  #: dots per inch of a figure on a page in Markdown
#: Lines of the grid.
GRIDLINE = "#e3e6e9"
#: Measured values.
MEASURED = "#1f2328"
#: The average over models.
AVERAGE = "#0b2545"
#: What linear damping says.
LINEAR = "#a3123a"
#: Ground of what lies beyond the test.
BEYOND_TEST = "#f6f1e6"
#: What needs attention.
ALERT = "#c8500a"
#: Credible band of the average, inner of the two.
CREDIBLE = "#93b3d1"
#: Predictive band, outer of the two.
PREDICTIVE = "#cddcea"

#: Colours of the forces of the catalogue, in its order; of what comes after, as of any other law.
_COLOURS = (
    *("#5c6670", "#e69f00", "#d55e00", "#0060a8", "#009e73"),
    *("#d45fb0", "#332288", "#999933", "#56b4e9", "#661100"),
)
_FORCE_COLOURS = dict(zip(CATALOGUE, _COLOURS, strict=False))
_OTHER_COLOURS = ("#882255", "#245c36", "#6b4fbb", "#8c6d1f", "#cc6677", "#3d5a80", "#c774b8", "#7a3e12", "#44aa99")
_PALETTE = (INK, MUTED, AVERAGE, LINEAR, BEYOND_TEST, ALERT, CREDIBLE, PREDICTIVE, *_COLOURS, *_OTHER_COLOURS, GRIDLINE)
_OTHER_LINES = ("-.", (0, (1, 1.2)), (0, (6, 1.5, 1, 1.5, 1, 1.5)))

#: The look of what is drawn, its colours those above.
_STYLE: Any = rc_params_from_file(Path(__file__).parent / "figures.mplstyle", use_default_template=False)
#: The look of a figure of its own: what the style leaves open of these is as matplotlib comes.
_GROUPS = re.compile(r"(axes|errorbar|figure|font|grid|hatch|legend|lines|patch|path|scatter|svg|text|[xy]tick)\.")
_WHOLE_STYLE: Any = {key: own for key, own in rcParamsDefault.items() if _GROUPS.match(key)} | _STYLE

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")


class LawStyle(NamedTuple):
    """Colour and matplotlib line style of a law."""

    colour: str
    line: Any


class Drawn(NamedTuple):
    """A figure with its text alternative."""

    figure: Figure
    title: str
    description: str

    @property
    def caption(self) -> str:
        """Title and description."""
        return f"{self.title}. {self.description}"

    def to_svg(self, name: str) -> str:
        """The figure as an SVG element (:func:`to_svg`)."""
        return to_svg(self.figure, name, self.title, self.description)


class Drawing(Figure):
    """A figure that a notebook shows directly, without pyplot."""

    def _repr_png_(self) -> bytes:
        return to_png(self, dpi=110)


def build_panel(height: float, x_label: str = "", y_label: str = "", axes: Axes | None = None) -> tuple[Figure, Axes]:
    """A figure of ``height`` inches with one panel; ``axes`` and what they are on where they are given."""
    panel = Drawing(figsize=(WIDTH, height)).add_subplot() if axes is None else axes
    panel.set(**{name: text for name, text in (("xlabel", x_label), ("ylabel", y_label)) if text})
    return cast(Figure, panel.figure), panel


def build_panels(height: float, rows: int, columns: int = 1, width: float = WIDTH, **shared: Any) -> tuple[Figure, Any]:
    """A figure of ``height`` by ``width`` inches with panels; ``shared`` as ``Figure.subplots`` has it."""
    figure = Drawing(figsize=(width, height))
    return figure, figure.subplots(rows, columns, **shared)


def styled(draw: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """A plotting function in the common style; on the caller's axes, in their colours."""

    @wraps(draw)
    def drawn(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        axes = cast(Axes | None, kwargs.get("axes"))
        with rc_context(_WHOLE_STYLE) if axes is None else drawn_on(axes, _STYLE, _PALETTE):
            return draw(*args, **kwargs)

    return drawn


def law_style(name: str) -> LawStyle:
    """Colour and line of the law called ``name`` (component names joined by `` + ``), the same in every figure."""
    parts = name.split(" + ")
    others = [part for part in parts if part != Viscous.name] or [Viscous.name]
    if len(others) == 1 and others[0] in _FORCE_COLOURS:
        return LawStyle(_FORCE_COLOURS[others[0]], "-" if len(parts) == 1 else (0, (4.5, 1.6)))
    turn, place = divmod(crc32(name.encode()), len(_OTHER_COLOURS))
    return LawStyle(_OTHER_COLOURS[place], _OTHER_LINES[turn % len(_OTHER_LINES)])


def describe_with_unit(what: str, unit: str) -> str:
    """An axis label: ``what`` with its unit in parentheses, where it has one."""
    return f"{what} ({unit})" if unit else what


def draw_plain_rows(axes: Axes, labels: list[str]) -> None:
    """Label a vertical axis with one row per label, the first on top, and no ticks or horizontal grid."""
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.grid(visible=False, axis="y")


def describe_short(label: object, most: int = 14) -> str:
    """A label beside a point: one line of at most ``most`` characters."""
    return describe_shortened(" ".join(str(label).split()), most, "…")


def distinguish(labels: Iterable[object], most: int = 10) -> list[str]:
    """Labels in a line without the words that all of them begin or end with; at most ``most`` characters each."""
    words = [str(label).split() for label in labels]
    if len(words) > 1:
        while all(len(w) > 1 for w in words) and len({w[0] for w in words}) == 1:
            words = [w[1:] for w in words]
        while all(len(w) > 1 for w in words) and len({w[-1] for w in words}) == 1:
            words = [w[:-1] for w in words]
    return [describe_short(" ".join(w), most) for w in words]


def identifier(name: str) -> str:
    """``name`` as an id in a page and a file stem: letters, digits, underscores and hyphens, starting with a letter."""
    slug = re.sub(r"[^A-Za-z0-9_]+", "-", name).strip("-")
    return slug if slug[:1].isalpha() else f"n-{slug}"


def to_png(figure: Figure, dpi: float = PAGE_DPI) -> bytes:
    """The figure as PNG; equal figures give equal bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return buffer.getvalue()


def to_svg(figure: Figure, name: str, title: str, description: str) -> str:
    """The figure as an SVG element that stands alone or inside a page; equal arguments give equal text.

    Text stays text. ``title`` and ``description`` are its text alternative. Every id starts with ``identifier(name)``,
    so that figures may share a page. ``data-axes`` tells how to read values from it (``describe_scales``).
    """
    prefix = identifier(name)
    buffer = io.BytesIO()
    nothing = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with rc_context({**_WHOLE_STYLE, "svg.hashsalt": prefix}), warnings.catch_warnings():
        # the reader's fonts may have what the bundled one lacks
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        # print_svg lays the figure out and draws it once, where savefig does so twice
        FigureCanvasSVG(figure).print_svg(buffer, metadata=nothing)
    svg = _replace_invalid(buffer.getvalue().decode("utf-8"))
    return _describe_standing_alone(svg, prefix, *map(_replace_invalid, (title, description, describe_scales(figure))))


_NOT_XML = re.compile("[^\\t\\n\\r\\x20-\\ud7ff\\ue000-\\ufffd\\U00010000-\\U0010ffff]")
#: A text without the characters that XML does not allow.
_replace_invalid = partial(_NOT_XML.sub, "\N{REPLACEMENT CHARACTER}")
_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"


def _describe_standing_alone(svg: str, prefix: str, title: str, description: str, axes: str) -> str:
    """Matplotlib's SVG with a text alternative and its scales, only the ids in use, and two decimals."""
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    root = ElementTree.fromstring(svg)
    _shorten(root, prefix)
    for container in root.iter():
        # matplotlib's style sheet and metadata would reach beyond the figure: the same is said on the root
        for child in [c for c in container if c.tag in (f"{{{_SVG}}}style", f"{{{_SVG}}}metadata")]:
            container.remove(child)
    root.attrib |= {"stroke-linejoin": "round", "stroke-linecap": "butt", "role": "img"}
    root.set("aria-labelledby", f"{prefix}-title {prefix}-desc")
    if axes:
        root.set("data-axes", axes)
    for position, (tag, text) in enumerate((("title", title), ("desc", description))):
        element = ElementTree.Element(f"{{{_SVG}}}{tag}", {"id": f"{prefix}-{tag}"})
        element.text = text
        root.insert(position, element)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


_REFERENCE = re.compile(r"url\(#([^)]+)\)")
_LONG_NUMBER = re.compile(r"-?\d+\.\d{3,}")
_NUMBERS = ("d", "x", "y", "width", "height", "transform")


def _shorten(root: ElementTree.Element, prefix: str) -> None:
    """Prefix the ids in use, drop the others, and round coordinates to 0.01 point."""
    href = f"{{{_XLINK}}}href"
    elements = list(root.iter())
    used = {e.get(href, "").removeprefix("#") for e in elements}
    used |= {name for e in elements for value in e.attrib.values() for name in _REFERENCE.findall(value)}
    for element in elements:
        attributes = element.attrib
        if (own := attributes.pop("id", None)) in used:
            attributes["id"] = f"{prefix}-{own}"
        for key, value in list(attributes.items()):
            if key == href and value.startswith("#"):
                attributes[key] = f"#{prefix}-{value.removeprefix('#')}"
            elif "url(#" in value:
                attributes[key] = _REFERENCE.sub(rf"url(#{prefix}-\1)", value)
            elif key in _NUMBERS:
                attributes[key] = _LONG_NUMBER.sub(lambda number: f"{float(number[0]):.2f}", value)
