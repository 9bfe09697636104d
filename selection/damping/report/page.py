"""Texts, blocks and sections in, one self-contained HTML page out.

Every text is escaped by the template; the figures, which :func:`damping.plots.to_svg` makes, are the only
markup that passes as it is. The page loads nothing, not even from its own folder.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template
from markupsafe import Markup

from damping.plots import TEXT_WIDTH
from damping.report import NOTHING, number

#: How to write a value of a column.
Format = Callable[[Any], str]
_WIDTH_POINTS = re.compile(r'<svg[^>]* width="([\d.]+)pt"')
#: Cells of more characters than this may be broken over lines.
LONG = 28


class Block:
    """A part of a section; ``kind`` names its macro in the template."""

    kind: ClassVar[str]


@dataclass(frozen=True)
class Heading(Block):
    """A heading within a section."""

    kind: ClassVar[str] = "heading"
    text: str


@dataclass(frozen=True)
class Text(Block):
    """A paragraph."""

    kind: ClassVar[str] = "text"
    text: str
    lead: bool = False


@dataclass(frozen=True)
class List(Block):
    """Sentences one below the other, with numbers to refer to or without."""

    kind: ClassVar[str] = "list"
    items: Sequence[str]
    numbered: bool = False


@dataclass(frozen=True)
class Callout(Block):
    """Something not to be missed."""

    kind: ClassVar[str] = "callout"
    title: str
    items: Sequence[str]


@dataclass(frozen=True)
class Facts(Block):
    """The few numbers to remember: (number, what it is)."""

    kind: ClassVar[str] = "facts"
    items: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class FigureBlock(Block):
    """A figure by ``to_svg`` (which holds its text alternative) and a caption."""

    kind: ClassVar[str] = "figure"
    svg: str
    caption: str

    @property
    def share(self) -> float:
        """Width over that of a full figure, at most 1: a narrow one stays narrow, its letters as large as others'."""
        match = _WIDTH_POINTS.search(self.svg)
        return min(1.0, round(float(match[1]) / (72.0 * TEXT_WIDTH), 3)) if match else 1.0

    @property
    def markup(self) -> Markup:
        """The SVG as safe markup: our own figures are, texts in them are escaped."""
        return Markup(self.svg)


@dataclass(frozen=True)
class Row(Block):
    """Figures beside one another where the window has room."""

    kind: ClassVar[str] = "row"
    blocks: Sequence[Block]


class Link(NamedTuple):
    """A value of a table, or an item of ``Links``: a text that leads to ``href``, a relative address made by us."""

    text: str
    href: str


@dataclass(frozen=True)
class Links(Block):
    """Links in one line."""

    kind: ClassVar[str] = "links"
    items: Sequence[Link]


class Cell(NamedTuple):
    """A cell as written; ``css`` says whether it is a number or a long text; ``href`` where it leads, if anywhere."""

    text: str
    css: str
    href: str = ""


@dataclass(frozen=True)
class Table(Block):
    """A table: ``formats`` and ``headings`` by column, both optional. ``key``: names its CSV file, where it has one."""

    kind: ClassVar[str] = "table"
    frame: pd.DataFrame
    caption: str
    formats: Mapping[str, Format] = field(default_factory=dict)
    headings: Mapping[str, str] = field(default_factory=dict)
    key: str = ""

    @property
    def columns(self) -> list[Cell]:
        """Headings, underscores as spaces unless ``headings`` says otherwise."""
        frame = self.frame
        texts = [self.headings.get(name, name.replace("_", " ")) for name in map(str, frame.columns)]
        kinds = ["number" if pd.api.types.is_numeric_dtype(frame[name]) else "" for name in frame.columns]
        return [Cell(text, css) for text, css in zip(texts, kinds, strict=True)]

    @property
    def rows(self) -> list[list[Cell]]:
        """Cells as written."""
        formats = [self.formats.get(str(name), describe_written) for name in self.frame.columns]
        return [
            [_build_cell(value, form) for value, form in zip(row, formats, strict=True)]
            for row in self.frame.itertuples(index=False, name=None)
        ]


@dataclass(frozen=True)
class Fold(Block):
    """Blocks behind a line that opens them; nothing needed for the argument."""

    kind: ClassVar[str] = "fold"
    summary: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Section:
    """A section of the page; ``id`` is its anchor."""

    id: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Footer:
    """What the results depend on."""

    seed: int
    versions: Mapping[str, str]
    inputs: Mapping[str, str]


def describe_written(value: Any) -> str:
    """A value for people: numbers to four digits, yes and no, a dash for nothing."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None or value is pd.NA or (isinstance(value, float) and np.isnan(value)) or value == "":
        return NOTHING
    if isinstance(value, int | np.integer):
        return str(value)
    return number(value, 4) if isinstance(value, float | np.floating) else str(value)


def render_page(title: str, sections: Sequence[Section], footer: Footer) -> str:
    """The page as HTML. Equal arguments give equal text.

    Its policy lets the reader's browser run the one script of :func:`_script` and nothing else.
    """
    script = _script()
    digest = b64encode(sha256(script.encode()).digest()).decode()
    return _template().render(
        title=title, sections=sections, footer=footer, script=script, script_hash=Markup(f"sha256-{digest}")
    )


@cache
def _script() -> Markup:
    """The script beside this file: ours, so safe markup."""
    return Markup((Path(__file__).parent / "page.js").read_text("utf-8"))


@cache
def _template() -> Template:
    """The template beside this file, with every expression escaped."""
    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("template.html.jinja")


def _build_cell(value: Any, form: Format) -> Cell:
    if isinstance(value, Link):
        return _build_cell(value.text, form)._replace(href=value.href)
    text = form(value)
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return Cell(text, "number")
    return Cell(text, "long" if len(text) > LONG else "")
