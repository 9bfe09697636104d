"""Texts, blocks and sections in, one self-contained HTML page out.

The template escapes every text; the figures of :func:`damping.plots.to_svg` are the only markup that passes unchanged.
The page loads no files, not even from its own folder, and runs only the script beside this module.

A text may be a jinja2 template in a file beside the module that fills it with numbers. After filling, an empty line
ends a block. A block is a paragraph unless its first line begins with one of

- ``# id: Title``: a section, as far as the next one,
- ``##``: a heading,
- ``*``: a list, an item from each ``*`` to the next,
- ``[lead]``: a highlighted paragraph,
- ``[callout] title`` with a list below: important cautions,
- ``[facts]`` with a list of ``* number | meaning`` below: the key numbers,
- ``[fold] summary``: the blocks up to ``[end]``, folded under a summary,
- ``[row]``: the figures up to ``[end]``, side by side,
- ``[table NAME] caption`` or another word in brackets: the block that the module provides.
"""

import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined, Template

from damping import report as words

#: How to write a value of a column.
Format = Callable[[Any], str]
_WIDTH_POINTS = re.compile(r'<svg[^>]* width="([\d.]+)pt"')
LONG = 28  #: cells of more characters than this may be broken over lines


class Block:
    """A part of a section."""

    @property
    def kind(self) -> str:
        """Name of the block in the template."""
        return type(self).__name__.lower()


@dataclass(frozen=True)
class Heading(Block):
    """A heading within a section."""

    text: str


@dataclass(frozen=True)
class Text(Block):
    """A paragraph."""

    text: str
    lead: bool = False


@dataclass(frozen=True)
class List(Block):
    """A list of sentences, numbered or not."""

    items: Sequence[str]
    numbered: bool = False


@dataclass(frozen=True)
class Callout(Block):
    """An important caution."""

    title: str
    items: Sequence[str]


@dataclass(frozen=True)
class Facts(Block):
    """The key numbers: (number, meaning)."""

    items: Sequence[Sequence[str]]


@dataclass(frozen=True)
class FigureBlock(Block):
    """A figure of ``to_svg``, with its text alternative and escaped texts, and a caption."""

    svg: str
    caption: str = ""  #: given here, or by the directive that places it

    @property
    def share(self) -> float:
        """Width over that of a full figure, at most 1, so that letters have one size in all figures."""
        from damping.plots import TEXT_WIDTH  # noqa: PLC0415 - matplotlib, which pages of words alone do not need

        match = _WIDTH_POINTS.search(self.svg)
        return min(1.0, round(float(match[1]) / (72.0 * TEXT_WIDTH), 3)) if match else 1.0


@dataclass(frozen=True)
class Row(Block):
    """Figures side by side where the window has room."""

    blocks: Sequence[Block]


class Link(NamedTuple):
    """A value of a table, or an item of ``Links``: a text that links to ``href``, a relative address made here."""

    text: str
    href: str


@dataclass(frozen=True)
class Links(Block):
    """Links in one line."""

    items: Sequence[Link]


class Cell(NamedTuple):
    """A formatted cell; ``css``: whether it is a number or a long text; ``href``: its link, if any."""

    text: str
    css: str
    href: str = ""


@dataclass(frozen=True)
class Table(Block):
    """A table."""

    frame: pd.DataFrame
    formats: Mapping[str, Format] = field(default_factory=dict)  #: by column, optional
    headings: Mapping[str, str] = field(default_factory=dict)  #: by column, optional
    caption: str = ""  #: given here, or by the directive that places it
    key: str = ""  #: names its CSV file, where it has one

    @property
    def columns(self) -> list[Cell]:
        """Headings, underscores as spaces unless ``headings`` says otherwise."""
        texts = [self.headings.get(name, name.replace("_", " ")) for name in map(str, self.frame.columns)]
        numeric = map(pd.api.types.is_numeric_dtype, self.frame.dtypes)
        return [Cell(text, "number" if own else "") for text, own in zip(texts, numeric, strict=True)]

    @property
    def rows(self) -> list[list[Cell]]:
        """Formatted cells."""
        formats = [self.formats.get(str(name), words.describe_written) for name in self.frame.columns]
        return [
            [_build_cell(value, form) for value, form in zip(row, formats, strict=True)]
            for row in self.frame.itertuples(index=False, name=None)
        ]


@dataclass(frozen=True)
class Fold(Block):
    """Folded blocks under a summary; nothing needed for the argument."""

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
    """The seed, versions and inputs that the results depend on."""

    seed: int
    versions: Mapping[str, str]
    inputs: Mapping[str, str]


_STRICT: Any = {"undefined": StrictUndefined, "trim_blocks": True}
#: Templates beside this file, with every expression escaped.
_PAGES = Environment(loader=FileSystemLoader(Path(__file__).parent), autoescape=True, lstrip_blocks=True, **_STRICT)


def render_page(title: str, sections: Sequence[Section], footer: Footer) -> str:
    """The page as HTML. Equal arguments give equal text."""
    script = Path(__file__).with_name("page.js").read_text("utf-8")
    digest = b64encode(sha256(script.encode()).digest()).decode()
    template = _PAGES.get_template("template.html.jinja")
    return template.render(title=title, sections=sections, footer=footer, script=script, script_hash=digest)


def _build_cell(value: Any, form: Format) -> Cell:
    if isinstance(value, Link):
        return _build_cell(value.text, form)._replace(href=value.href)
    text = form(value)
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return Cell(text, "number")
    return Cell(text, "long" if len(text) > LONG else "")


#: Stands before a value that begins with ``[``, ``#`` or ``*`` until blocks are cut: those are words of the text alone.
_VALUE = "\x00"
_DIRECTIVE = re.compile(r"\[(\w+) ?([^\]]*)\] ?(.*)", re.DOTALL)
#: Blocks for a directive: its word, its name, and what follows on its lines.
Take = Callable[[str, str, str], Iterable[Block]]


def write_blocks(text: Path, values: Mapping[str, Any], take: Take = lambda kind, name, rest: []) -> list[Block]:
    """The blocks of a text filled with values; ``take`` gives those of its own directives."""
    return _cut_blocks(_template(text).render(**values), take)


def take_parts(parts: Mapping[str, Block]) -> Take:
    """The blocks of directives that name ``parts``, with captions; a missing part leaves no block."""

    def take(kind: str, name: str, rest: str) -> list[Block]:
        part: Any = parts.get(name)
        return [] if part is None else [replace(part, caption=join_lines(rest)) if rest else part]

    return take


def write_sections(text: Path, values: Mapping[str, Any], parts: Mapping[str, Block] | None = None) -> list[Section]:
    """The sections of a text filled with values; its directives name ``parts`` (:func:`take_parts`)."""
    take, sections = take_parts(parts or {}), []
    for section in re.split(r"^# ", _template(text).render(**values), flags=re.MULTILINE)[1:]:
        head, _, body = section.partition("\n")
        key, _, title = head.partition(": ")
        sections.append(Section(key, join_lines(title), _cut_blocks(body, take)))
    return sections


def fill_text(text: Path, values: Mapping[str, Any]) -> str:
    """A text filled with values, none of which can begin a new line."""
    return _template(text).render(**values).replace(_VALUE, "")


@cache
def _template(text: Path) -> Template:
    environment = Environment(finalize=_join_value, **_STRICT)  # the page escapes what it shows
    return environment.from_string(text.read_text("utf-8"), globals=words.WORDS)


def _cut_blocks(filled: str, take: Take) -> list[Block]:
    parts = (part.strip("\n") for part in re.split(r"\n{2,}", filled.strip("\n")) if part)
    return list(_build_blocks(parts, take))


def _build_blocks(parts: Iterator[str], take: Take) -> Iterator[Block]:
    """Blocks up to the end of the text or of a fold."""
    for part in parts:
        if part.startswith("## "):
            yield Heading(join_lines(part.removeprefix("## ")))
        elif part.startswith("* "):
            yield List(_list_items(part))
        elif directive := _DIRECTIVE.fullmatch(part):
            kind, name, rest = directive.groups()
            match kind:
                case "end":
                    return
                case "fold":
                    yield Fold(join_lines(rest), list(_build_blocks(parts, take)))
                case "lead":
                    yield Text(join_lines(rest), lead=True)
                case "row":
                    figures = list(_build_blocks(parts, take))
                    yield from [Row(figures)] if figures else []
                case "facts" if not name:
                    yield Facts([item.split(" | ", 1) for item in _list_items(rest)])
                case "callout":
                    yield Callout(join_lines(rest.partition("\n* ")[0]), _list_items(rest))
                case _:
                    yield from take(kind, name, rest)
        else:
            yield Text(join_lines(part))


def _list_items(part: str) -> list[str]:
    return [join_lines(item) for item in re.split(r"(?:^|\n)\* ", part)[1:]]


def join_lines(text: str) -> str:
    """A text in one line."""
    return re.sub(r" *\n *", " ", text).replace(_VALUE, "")


def _join_value(value: object) -> str:
    """A value in one line that cannot begin a block."""
    line = join_lines(str(value))
    return _VALUE + line if line.startswith(("[", "#", "*")) else line
