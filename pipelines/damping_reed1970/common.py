"""What every chapter needs: its figures and tables by name, and how well its printed numbers come out.

Proofs of errata as the reader sees them: the plain letters of the data in the symbols of the report.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from damping.plots.style import to_svg
from damping.report.page import Block, FigureBlock, Fold, Part, Section, Table
from damping.report.words import count, joined
from damping_reed1970.figures import ChapterFigure

#: Figures of the chapters by name, not yet drawn.
Figures = Mapping[str, ChapterFigure]
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


@dataclass(frozen=True)
class ChapterFigureBlock(FigureBlock):
    """A figure of a chapter; ``file`` names its SVG file, without the ending."""

    file: str = ""


def figure(figures: Figures, name: str, chapter: int) -> ChapterFigureBlock:
    """Draw a figure; its caption starts with its number in the source report, where it has one."""
    one = figures[name]
    file = f"chapter-{chapter}-{one.name}"
    numbers = one.counterpart.split(", ")
    head = one.title
    if one.counterpart:
        what = "counterpart" if one.counterpart in NOT_PRINTED else "redrawn"
        head = f"Fig{'s' * (len(numbers) > 1)}. {joined(numbers)} {what}: {_lowered(one.title)}"
    svg = to_svg(one.draw(), file, one.title, one.description)
    return ChapterFigureBlock(svg, f"{head}. {one.description}", file)


def part(chapter: int, title: str, blocks: Sequence[Block], tables: Mapping[str, pd.DataFrame]) -> Part:
    """The section of a chapter with the figures in its blocks and its tables under the names of their files."""
    section = Section(f"chapter-{chapter}", title, blocks)
    return Part(section, dict(_figures_in(blocks)), {file_of(chapter, name): frame for name, frame in tables.items()})


def table(
    chapter: int, name: str, frame: pd.DataFrame, caption: str, headings: Mapping[str, str] | None = None
) -> Table:
    """A table whose whole is in the chapter's CSV file of that name; ``frame`` may be a part of it.

    Columns whose names have letters beyond ASCII are named in the reader's own symbols already.
    """
    own = {column: column for column in map(str, frame.columns) if not column.isascii()}
    return Table(frame, caption, headings=own | dict(headings or {}), key=file_of(chapter, name))


def row(frame: pd.DataFrame, **where: object) -> pd.Series[Any]:
    """The one row of a table in which the columns named have these values."""
    chosen = np.logical_and.reduce([(frame[name] == value).to_numpy() for name, value in where.items()])
    assert chosen.sum() == 1, f"{chosen.sum()} rows with {where}"
    return frame.iloc[int(chosen.argmax())]


def folded(summary: str, *blocks: Block) -> Fold:
    """Blocks behind a line."""
    return Fold(summary, blocks)


def file_of(chapter: int, name: str) -> str:
    """Name of the file of a chapter's table, without its ending."""
    return f"chapter_{chapter}_{name}"


def of_chapter(reproduction: pd.DataFrame, chapter: int) -> pd.DataFrame:
    """Rows of the reproduction whose id is of a chapter: the first digit of ``tab4II`` or ``eq4110`` says which."""
    return reproduction[reproduction["id"].map(chapter_of) == chapter]


def chapter_of(identity: str) -> int:
    """Chapter of an id."""
    found = re.search(r"\d", identity)
    assert found, f"{identity} names no chapter"
    return int(found[0])


def agreement_text(reproduction: pd.DataFrame) -> str:
    """How many printed numbers come out how well, and how many of the rest carry an erratum or a reason."""
    counts = reproduction["agreement"].value_counts()
    said = joined(f"{counts[name]} {words}" for name, words in AGREEMENTS.items() if counts.get(name, 0))
    known = reproduction.loc[reproduction["erratum"] != "", "erratum"]
    text = f"Of the {len(reproduction)} numbers printed in this chapter as results, {said}."
    if known.empty:
        return text
    return f"{text} {count(known.nunique(), 'erratum').replace('erratums', 'errata')} explain {len(known)} of them."


def _figures_in(blocks: Iterable[Block]) -> Iterable[tuple[str, str]]:
    for block in blocks:
        if isinstance(block, ChapterFigureBlock):
            yield block.file, block.svg
        elif isinstance(block, Fold):
            yield from _figures_in(block.blocks)


def _lowered(title: str) -> str:
    return title[:1].lower() + title[1:]


_SUPERSCRIPT = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
#: What stands in the data, as a pattern, and what the report writes.
SYMBOLS = {
    r"->": "→",
    r"\+-": "±",
    r"(?<=[\w)\]])( ?)\*( ?)(?=[\w(.])": r"\1·\2",
    r"\b(?:Gamma)\b": "Γ",
    r"(?<![A-Za-z])pi(?![A-Za-z])": "π",
    r"(?<![A-Za-z])xi(?![A-Za-z])": "ξ",
    r"(?<![A-Za-z])phi(?![A-Za-z])": "φ",
    r"(?<![A-Za-z])eta(?![A-Za-z])": "η",
    r"(?<![A-Za-z])omega(?![A-Za-z])": "ω",
    r"(?<![A-Za-z])(?:w)(?![A-Za-z])": "ω",
    r"\bwt\b": "ωt",
    r"(?<![A-Za-z])psi(?![A-Za-z])": "ψ",
    r"(?<![A-Za-z])int(?=[ _])": "∫",
    r"\bLambda(?=_)": "Λ",
    r"\balpha\b": "α",
    r"\bbeta\b": "β",
    r"\bdelta\b": "δ",
    r"\bdW\b": "ΔW",
    r"\bQd\b": "Q̇",
    r"(?<=\d)pi": "π",
    r"\bOLS\b": "least squares",
    r"\bdof\b": "degree of freedom",
    r"\bs\.e\.": "standard error",
    r"\bsqrt\b": "√",
}


def in_symbols(text: str) -> str:
    """``2*pi*xi_1*w_n`` as 2·π·ξ_1·ω_n."""
    text = re.sub(r"\^(\d)(?![\d.])", lambda found: found[1].translate(_SUPERSCRIPT), text)
    for pattern, symbol in SYMBOLS.items():
        text = re.sub(pattern, symbol, text)
    return text
