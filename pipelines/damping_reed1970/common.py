"""What every chapter needs: its figures and tables by name, and how well its printed numbers come out."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.plots.style import to_svg
from damping.report.figures import Drawn
from damping.report.page import Block, FigureBlock, Fold, Section, Table, Text
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


def draw_figure(one: ChapterFigure, chapter: int) -> DrawnBlock:
    """Draw a figure; its caption starts with its number in the source report, where it has one."""
    file = f"chapter-{chapter}-{one.name}"
    numbers = one.counterpart.split(", ")
    head = one.title
    if one.counterpart:
        what = "counterpart" if one.counterpart in NOT_PRINTED else "redrawn"
        head = f"Fig{'s' * (len(numbers) > 1)}. {format_joined(numbers)} {what}: {_describe_lowered(one.title)}"
    svg = to_svg(one.draw(), file, one.title, one.description)
    return DrawnBlock(svg, f"{head}. {one.description}", file, one.draw)


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
    found = re.search(r"\d", identity)
    assert found, f"{identity} names no chapter"
    return int(found[0])


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
    "section_6_1": KnownTable(
        "Damping forces of section 6.1, printed and ours",
        "Each printed coefficient beside its recomputation by the report's own method on corrected tables, and "
        "beside our fit with its 90 per cent credible interval. A law reproduces the tests when its amplitudes are "
        "within 5 per cent.",
        (
            *("configuration", "mode", "equation", "force", "parameter", "unit", "printed", "recomputed", "ours"),
            *("low", "high", "printed_in_interval", "printed_percent_resonance", "recomputed_percent_resonance"),
            *("ours_percent_resonance", "printed_reproduces", "recomputed_reproduces", "ours_reproduces", "erratum"),
        ),
    ),
    "section_6_1_errors": KnownTable(
        "Errors of the laws of section 6.1, point by point",
        "Per cent error of resonant amplitude and of energy per cycle at each tested point, for each version of "
        "each law.",
    ),
    "section_4_3_example": KnownTable(
        "The example of section 4.3: what becomes of 67 per cent",
        "The report extrapolates the first mode of Configuration II to 90 lb. Its numbers beside their "
        "recomputation, with intervals where there are any.",
    ),
    "power_laws": KnownTable(
        "Power laws of section 4.3, printed and recomputed",
        "Exponent and coefficient from the printed and from the corrected tables, beside the printed values.",
        (
            *("mode", "form", "equation", "inputs", "p_printed", "p", "p_std_error", "p_low", "p_high"),
            *("alpha_printed", "alpha_at_printed_p", "alpha", "erratum"),
        ),
    ),
    "linear_coefficients": KnownTable(
        "Linear coefficients against amplitude, section 4.1",
        "The amplitude-dependent linear coefficient and the forces it is converted to, from one degree of freedom.",
        (
            *("mode", "model", "inputs", "parameter", "unit", "coefficient", "std_error", "t_ratio", "low", "high"),
            *("report_method", "printed", "force", "force_coefficient", "printed_force", "erratum"),
        ),
    ),
    "regressions": KnownTable(
        "Regressions of chapter V, printed and recomputed",
        "Every energy polynomial the report fitted, from printed, corrected and recovered inputs. R² is without a "
        "constant.",
        (
            *("fit", "equation", "inputs", "cells_changed", "points", "term", "coefficient", "std_error", "t_ratio"),
            *("printed", "force", "force_coefficient", "printed_force", "r_squared_without_constant"),
            *("average_absolute_percent", "largest_absolute_percent", "erratum"),
        ),
    ),
    "regression_deviations": KnownTable(
        "Per cent deviations of Tables 5.II to 5.IV",
        "The report's own column of per cent deviations beside those of our fits to printed, corrected and "
        "recovered inputs.",
    ),
    "errata": KnownTable(
        "Errata of the report",
        "Misprints, misreadings and derivation errors with their proofs. Severity A changes results, B changes "
        "numbers, C is minor.",
        ("id", "severity", "where", "as_printed", "should_be"),
    ),
    "reproduction": KnownTable(
        "Every printed result recomputed",
        "Printed values beside what their own recipe gives, from the tables as printed and after correction.",
        ("id", "where", "printed", "computed", "computed_after_correction", "agreement", "erratum", "reason"),
    ),
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
