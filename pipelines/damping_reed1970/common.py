"""What every chapter needs: figures and tables by name, how well its printed numbers come out, and its page.

The text of a chapter is ``page.txt`` of its folder, a jinja2 template for its numbers. After filling, an empty line
ends a block. A block is a paragraph unless its first line begins with one of

- ``##``: a heading,
- ``*``: a list, an item from each ``*`` to the next,
- ``[figure NAME]``: a figure of the chapter,
- ``[table NAME] caption``: a table of the page,
- ``[known NAME]``: a table of the report as ``known_tables.toml`` has it,
- ``[fold] summary``: what follows as far as ``[end]``, behind a line.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

from damping.plots.style import to_svg
from damping.report import words
from damping.report.figures import Drawn
from damping.report.page import Block, FigureBlock, Fold, Heading, List, Section, Table, Text
from damping.report.words import count, format_joined


class ChapterFigure(NamedTuple):
    """A figure: ``counterpart`` is its number in the source report (empty: it goes further than the report)."""

    name: str
    counterpart: str
    title: str
    description: str
    draw: Callable[[], Figure]


#: Figures whose data are not printed: there is a counterpart, from other data.
NOT_PRINTED = ("5.1",)
#: Agreement of a printed number with its recomputation, best first, in words.
AGREEMENTS = {
    "printed digits": "come out to the printed digits",
    "last digit": "to one unit of the last digit",
    "0.5 per cent": "within 0.5 per cent",
    "2 per cent": "within 2 per cent",
    "no": "not within 2 per cent",
}
#: Those that count as right.
CLOSE = ("printed digits", "last digit", "0.5 per cent")


@dataclass(frozen=True)
class DrawnBlock(FigureBlock):
    """A figure of its own file, ``file`` without the ending, that can be drawn again."""

    file: str = ""
    draw: Callable[[], Figure] = Figure


def draw_block(file: str, drawn: Drawn, caption: str = "") -> DrawnBlock:
    """A figure with its caption: by default its title and description."""
    svg = to_svg(drawn.figure, file, drawn.title, drawn.description)
    return DrawnBlock(svg, caption or f"{drawn.title}. {drawn.description}", file, lambda: drawn.figure)


def draw_figure(figure: ChapterFigure, chapter: int) -> DrawnBlock:
    """Draw a figure; its caption starts with its number in the source report, where it has one."""
    file = f"chapter-{chapter}-{figure.name}"
    numbers = figure.counterpart.split(", ")
    head = figure.title
    if figure.counterpart:
        what = "counterpart" if figure.counterpart in NOT_PRINTED else "redrawn"
        head = f"Fig{'s' * (len(numbers) > 1)}. {format_joined(numbers)} {what}: {_describe_lowered(figure.title)}"
    svg = to_svg(figure.draw(), file, figure.title, figure.description)
    return DrawnBlock(svg, f"{head}. {figure.description}", file, figure.draw)


@dataclass(frozen=True)
class ReportPart:
    """A section with the tables that belong to it, by file; the figures are in its blocks."""

    section: Section
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, DrawnBlock]:
        """The figures by file."""
        return {block.file: block for block in _drawn_in(self.section.blocks)}


def chapter_table(chapter: int, name: str, frame: pd.DataFrame, headings: Mapping[str, str] | None = None) -> Table:
    """A table, its caption to come; ``frame`` may be a part of what the chapter's CSV file of that name holds.

    Columns whose names have letters beyond ASCII are named in the reader's own symbols already.
    """
    own = {column: column for column in map(str, frame.columns) if not column.isascii()}
    return Table(frame, "", headings=own | dict(headings or {}), key=describe_file_of(chapter, name))


def row(frame: pd.DataFrame, **where: object) -> pd.Series[Any]:
    """The one row of a table in which the columns named have these values."""
    chosen = np.logical_and.reduce([(frame[name] == value).to_numpy() for name, value in where.items()])
    assert chosen.sum() == 1, f"{chosen.sum()} rows with {where}"
    return frame.iloc[int(chosen.argmax())]


def describe_file_of(chapter: int, name: str) -> str:
    """Name of the file of a chapter's table, without its ending."""
    return f"chapter_{chapter}_{name}"


def tabulate_of_chapter(reproduction: pd.DataFrame, chapter: int) -> pd.DataFrame:
    """Rows of the reproduction whose id is of a chapter: the first digit of ``tab4II`` or ``eq4110`` says which."""
    return reproduction[reproduction["id"].map(chapter_of) == chapter]


def chapter_of(identity: str) -> int:
    """Chapter of an id."""
    digit = re.search(r"\d", identity)
    assert digit, f"{identity} names no chapter"
    return int(digit[0])


def describe_agreement_text(reproduction: pd.DataFrame) -> str:
    """How many printed numbers come out how well, and how many of the rest carry an erratum or a reason."""
    counts = reproduction["agreement"].value_counts()
    said = format_joined(f"{counts[name]} {words}" for name, words in AGREEMENTS.items() if counts.get(name, 0))
    known = reproduction.loc[reproduction["erratum"] != "", "erratum"]
    text = f"Of the {len(reproduction)} numbers printed in this chapter as results, {said}."
    if known.empty:
        return text
    return f"{text} {count(known.nunique(), 'erratum').replace('erratums', 'errata')} explain {len(known)} of them."


def _drawn_in(blocks: Iterable[Block]) -> Iterable[DrawnBlock]:
    for block in blocks:
        if isinstance(block, DrawnBlock):
            yield block
        elif isinstance(block, Fold):
            yield from _drawn_in(block.blocks)


def _describe_lowered(title: str) -> str:
    return title[:1].lower() + title[1:]


#: A table with more rows than this is folded away.
MOST_ROWS = 24


@dataclass(frozen=True)
class KnownTable:
    """A table that is known by name: its title, what it says, and the columns that the page shows (all if empty)."""

    title: str
    said: str
    columns: tuple[str, ...] = ()


KNOWN = {
    name: KnownTable(known["title"], known["said"], tuple(known.get("columns", ())))
    for name, known in tomllib.loads((Path(__file__).parent / "known_tables.toml").read_text("utf-8")).items()
}


def build_known_table(name: str, frame: pd.DataFrame) -> list[Block]:
    """A table that is known by name with what it says, folded where it is long."""
    return _build_table(name, frame, KNOWN[name])


def _build_table(name: str, frame: pd.DataFrame, known: KnownTable) -> list[Block]:
    """A table, folded where it is long."""
    shown = frame[[column for column in known.columns if column in frame]] if known.columns else frame
    if len(shown) <= MOST_ROWS:
        return [Table(shown, known.said or known.title, key=name)]
    said = [Text(known.said)] if known.said else []
    return [*said, Fold(f"{known.title}: all {len(shown)} rows", [Table(shown, known.title, key=name)])]


#: Functions of the texts: numbers and lists in words.
_WORDS = {
    "between": words.format_between,
    "count": words.count,
    "counted": words.format_counted,
    "joined": words.format_joined,
    "number": words.number,
    "percent": words.format_percent,
    "points_text": words.format_points_text,
    "signed": words.format_signed,
}
_DIRECTIVE = re.compile(r"\[(figure|table|known|fold|end) ?([^\]]*)\] ?(.*)", re.DOTALL)


@dataclass(frozen=True)
class Chapter:
    """What the text of a chapter refers to.

    Attributes:
        number, title: of the chapter.
        values: what the template is filled with.
        figures: redrawn or further.
        shown: tables of the page by name, without captions.
        tables: whole tables, written as CSV, by their names within the chapter.
        named: tables of the report beside ours, by name.
    """

    number: int
    title: str
    values: Mapping[str, Any]
    figures: Sequence[ChapterFigure]
    shown: Mapping[str, Table]
    tables: Mapping[str, pd.DataFrame]
    named: Mapping[str, pd.DataFrame]


def write_chapter(chapter: Chapter, text: Path) -> ReportPart:
    """The section of a chapter from its text, which may say ``agreement`` and every value of the chapter."""
    environment = Environment(undefined=StrictUndefined, trim_blocks=True)  # the page escapes what it shows
    agreement = describe_agreement_text(tabulate_of_chapter(chapter.named["reproduction"], chapter.number))
    filled = environment.from_string(text.read_text("utf-8")).render(_WORDS, agreement=agreement, **chapter.values)
    parts = iter([part.strip("\n") for part in re.split(r"\n{2,}", filled.strip("\n"))])
    section = Section(f"chapter-{chapter.number}", chapter.title, list(_build_blocks(chapter, parts)))
    return ReportPart(
        section, {describe_file_of(chapter.number, name): frame for name, frame in chapter.tables.items()}
    )


def _build_blocks(chapter: Chapter, parts: Iterator[str]) -> Iterator[Block]:
    """Blocks as far as the end of the text or of a fold."""
    for part in parts:
        if part.startswith("## "):
            yield Heading(_describe_line(part.removeprefix("## ")))
        elif part.startswith("* "):
            yield List([_describe_line(item) for item in re.split(r"(?:^|\n)\* ", part)[1:]])
        elif directive := _DIRECTIVE.fullmatch(part):
            kind, name, rest = directive[1], directive[2], _describe_line(directive[3])
            if kind == "end":
                return
            if kind == "fold":
                yield Fold(rest, list(_build_blocks(chapter, parts)))
            elif kind == "figure":
                figure = next(one for one in chapter.figures if one.name == name)
                yield draw_figure(figure, chapter.number)
            elif kind == "known":
                yield from build_known_table(name, chapter.named[name])
            else:
                yield replace(chapter.shown[name], caption=rest)
        else:
            yield Text(_describe_line(part))


def _describe_line(text: str) -> str:
    return re.sub(r" *\n *", " ", text)
