"""Pages of the chapters from their texts: ``page.txt`` of a chapter's folder, a jinja2 template for its numbers.

After filling, an empty line ends a block. A block is a paragraph unless its first line begins with one of

- ``##``: a heading,
- ``*``: a list, an item from each ``*`` to the next,
- ``[figure NAME]``: a figure of the chapter,
- ``[table NAME] caption``: a table of the page,
- ``[known NAME]``: a table of the report as ``known_table`` shows it,
- ``[fold] summary``: what follows as far as ``[end]``, behind a line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment, StrictUndefined

from damping.report import words
from damping.report.page import Block, Fold, Heading, List, Section, Table, Text
from damping_reed1970.common import (
    ChapterFigure,
    ReportPart,
    build_known_table,
    describe_agreement_text,
    describe_file_of,
    draw_figure,
    tabulate_of_chapter,
)

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
        elif found := _DIRECTIVE.fullmatch(part):
            kind, name, rest = found[1], found[2], _describe_line(found[3])
            if kind == "end":
                return
            if kind == "fold":
                yield Fold(rest, list(_build_blocks(chapter, parts)))
            elif kind == "figure":
                one = next(one for one in chapter.figures if one.name == name)
                yield draw_figure(one, chapter.number)
            elif kind == "known":
                yield from build_known_table(name, chapter.named[name])
            else:
                yield replace(chapter.shown[name], caption=rest)
        else:
            yield Text(_describe_line(part))


def _describe_line(text: str) -> str:
    return re.sub(r" *\n *", " ", text)
