"""The report of 1970 recomputed: its tables in this module; one folder per chapter, with equations, figures and page.

Every table comes as printed, corrected, and as used by the report's own computation.

Source: R. R. Reed, *Determination of Modal Damping for Launch Vehicles Using Experimental Data*, NASA contract
NAS8-21110. The files and the meaning of every column are described in ``data/saturn-v/README.md``.

Units are lb, in, s.

The page of a chapter is made here too, from ``page.txt`` of its folder (:mod:`damping.report.page`) with the directives

- ``[figure NAME 3.2]``: a figure of the chapter with its number in the report (none: it goes further than the report);
  the rest of the line is its title, the lines after it say what it shows,
- ``[table NAME] caption``: a table of the page,
- ``[known NAME]``: a table of the report as ``known_tables.toml`` has it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import count as count_up
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots import to_svg
from damping.report import count, format_joined
from damping.report.page import Block, FigureBlock, Fold, Section, Table, Text, join_lines, write_blocks
from damping_pipelines import shipped_folder

Version = Literal["printed", "corrected", "used"]
Run = Literal["E3", "E4"]


def data_folder() -> Path:
    """Folder with ``saturn-v``: the packaged copy if there is one, else that of the repository.

    InputError: neither exists (an incomplete installation).
    """
    return shipped_folder(Path(__file__).resolve().parent, "saturn-v").parent


def load_table(name: str, version: Version = "printed", run: Run = "E4") -> pd.DataFrame:
    """One table of the report; columns carry their units in their names.

    Args:
        name: ``"3_I"`` for Table 3.I.
        version: ``"printed"``: every digit as printed. ``"corrected"``: cells that are wrong replaced.
            ``"used"``: what the report's own computation used: where that is known to differ from the print it is
            taken (Table 5.III and 5.IV: the recovered inputs), else the corrected cell, else the printed one.
        run: of Table 5.IV as used, the inputs of the two-term run ``"E3"`` (Eq. 5.3.14) or of the one-term runs
            ``"E4"`` (Eq. 5.3.15 and the viscous one of section 5.3): the report changed one energy between them.
    """
    return _load(name, version, run).copy()


@lru_cache
def _load(name: str, version: Version, run: Run) -> pd.DataFrame:
    table = load_text(f"tables/table_{name}")
    corrections = load_text("corrections")
    own = corrections[corrections["table"] == name] if version != "printed" else corrections[:0]
    for row in own.to_dict("records"):
        used = row["used_by_report"] if version == "used" and row["run"] in ("", run) else ""
        value = used or row["corrected"]
        if value:
            # columns ``a|b`` that hold ``1|A``
            where = zip(row["key_columns"].split("|"), row["key"].split("|"), strict=True)
            matching = np.logical_and.reduce([table[column] == key for column, key in where])
            table.loc[matching, row["column"]] = value
    return _tabulate_numeric(table)


def load_text(name: str) -> pd.DataFrame:
    """A CSV of the Saturn V folder, every cell as the text that is there (empty where nothing is).

    ``corrections``: cells that are wrong or that the report did not use as printed. ``errata``: misprints, misreadings
    and derivation errors, ``id, severity, kind, where, as_printed, should_be, proof``; ``severity`` is A where results
    change, B where numbers change, C for minor ones. ``printed_results``: every printed result that can be recomputed,
    ``id, where, printed, erratum, reason, recipe``.
    """
    return pd.read_csv(data_folder() / "saturn-v" / f"{name}.csv", dtype=str, keep_default_na=False)


def load_force_laws() -> pd.DataFrame:
    """Damping forces summarised in section 6.1, one row per term, with coefficients as printed (lb, in, s)."""
    return _tabulate_numeric(load_text("tables/section_6_1"), text=("equation",))


def _tabulate_numeric(table: pd.DataFrame, text: tuple[str, ...] = ()) -> pd.DataFrame:
    """Turn the columns that hold only numbers and blanks into floats or integers (blank: NaN)."""
    for name in table.columns.difference(list(text)):
        filled = table[name].where(table[name] != "")
        numbers = pd.to_numeric(filled, errors="coerce")
        if filled.notna().any() and numbers.notna().equals(filled.notna()):
            table[name] = numbers
    return table


def columns(table: pd.DataFrame, *names: str) -> tuple[FloatArray, ...]:
    """The named columns as arrays of floats."""
    return tuple(table[name].to_numpy(dtype=float) for name in names)


def by_point(name: str, values: npt.ArrayLike, points: Iterable[object] | None = None) -> dict[str, float]:
    """``{name[1]: first value, name[2]: second, ...}``, or with the ``points`` named."""
    numbers = np.asarray(values, dtype=float).tolist()
    return {f"{name}[{k}]": value for k, value in zip(points or count_up(1), numbers, strict=points is not None)}


NOT_PRINTED = ("5.1",)  #: figures whose data are not printed: there is a counterpart, from other data
#: What tables and figures call what the code knows by name.
LABELS: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("labels.toml").read_text("utf-8"))
#: Agreements of a printed number with its recomputation that count as right.
CLOSE = ("printed digits", "last digit", "0.5 per cent")


@dataclass(frozen=True)
class DrawnBlock(FigureBlock):
    """A figure of its own file, ``file`` without the ending, that can be drawn again."""

    file: str = ""
    draw: Callable[[], Figure] = Figure


def draw_block(file: str, title: str, description: str, draw: Callable[[], Figure], caption: str = "") -> DrawnBlock:
    """Draw a figure with its caption: by default its title and description."""
    return DrawnBlock(to_svg(draw(), file, title, description), caption or f"{title}. {description}", file, draw)


def describe_counterpart(number: str, title: str) -> str:
    """The title of a figure after its ``number`` in the source report, where it has one."""
    if not number:
        return title
    numbers, what = number.split(", "), "counterpart" if number in NOT_PRINTED else "redrawn"
    return f"Fig{'s' * (len(numbers) > 1)}. {format_joined(numbers)} {what}: {title[:1].lower()}{title[1:]}"


@dataclass(frozen=True)
class ReportPart:
    """A section with the tables that belong to it, by file; the figures are in its blocks."""

    section: Section
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)

    @property
    def figures(self) -> dict[str, DrawnBlock]:
        """The figures by file."""
        return {block.file: block for block in _drawn_in(self.section.blocks)}


_SUPERSCRIPT = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
#: What stands in the data, as a pattern, and what the report writes.
SYMBOLS = tomllib.loads(Path(__file__).with_name("symbols.toml").read_text("utf-8"))


def describe_in_symbols(text: str) -> str:
    """``2*pi*xi_1*w_n`` as 2·π·ξ_1·ω_n."""
    text = re.sub(r"\^(\d)(?![\d.])", lambda power: power[1].translate(_SUPERSCRIPT), text)
    for pattern, symbol in SYMBOLS.items():
        text = re.sub(pattern, symbol, text)
    return text


def describe_columns(frame: pd.DataFrame) -> dict[str, str]:
    """Headings in symbols, a unit that ends a name after a comma: ``rms_error_in_lb`` as "rms error, in-lb".

    Names with letters beyond ASCII are in symbols already.
    """
    ends = LABELS["endings"]
    pattern = re.compile(rf"_({'|'.join(ends)})$")
    spelled = {name: pattern.sub(lambda end: f", {ends[end[1]]}", name) for name in map(str, frame.columns)}
    return {n: describe_in_symbols(text.replace("_", " ")) if n.isascii() else n for n, text in spelled.items()}


def chapter_table(chapter: int, name: str, frame: pd.DataFrame, headings: Mapping[str, str] | None = None) -> Table:
    """A table, its caption to come; ``frame`` may be a part of what the chapter's CSV file of that name holds."""
    return Table(frame, headings=describe_columns(frame) | dict(headings or {}), key=f"chapter_{chapter}_{name}")


def row(frame: pd.DataFrame, **where: object) -> pd.Series[Any]:
    """The one row of a table in which the columns named have these values."""
    chosen = np.logical_and.reduce([(frame[name] == value).to_numpy() for name, value in where.items()])
    assert chosen.sum() == 1, f"{chosen.sum()} rows with {where}"
    return frame.iloc[int(chosen.argmax())]


def chapter_of(identity: str) -> int:
    """Chapter of an id, the first digit of ``tab4II`` or ``eq4110``."""
    digit = re.search(r"\d", identity)
    assert digit, f"{identity} names no chapter"
    return int(digit[0])


def describe_agreement_text(reproduction: pd.DataFrame) -> str:
    """How many printed numbers come out how well, and how many of the rest carry an erratum or a reason."""
    counts = reproduction["agreement"].value_counts()
    counted = format_joined(
        f"{counts[name]} {words}" for name, words in LABELS["agreements"].items() if counts.get(name, 0)
    )
    known = reproduction.loc[reproduction["erratum"] != "", "erratum"]
    text = f"Of the {len(reproduction)} numbers printed in this chapter as results, {counted}."
    if known.empty:
        return text
    return f"{text} {count(known.nunique(), 'erratum').replace('erratums', 'errata')} explain {len(known)} of them."


def _drawn_in(blocks: Iterable[Block]) -> Iterable[DrawnBlock]:
    for block in blocks:
        if isinstance(block, DrawnBlock):
            yield block
        elif isinstance(block, Fold):
            yield from _drawn_in(block.blocks)


MOST_ROWS = 24  #: a table with more rows than this is folded away
#: Tables that are known by name: ``title``, ``text``, what it says, and ``columns`` that the page shows (all if none).
KNOWN: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_name("known_tables.toml").read_text("utf-8"))


def build_known_table(name: str, frame: pd.DataFrame) -> list[Block]:
    """A named table with its caption, folded if it is long."""
    title, text = KNOWN[name]["title"], KNOWN[name]["text"]
    shown = frame[[column for column in KNOWN[name].get("columns", frame) if column in frame]]
    table = Table(shown, caption=text, headings=describe_columns(shown), key=name)
    if len(shown) <= MOST_ROWS:
        return [table]
    return [Text(text), Fold(f"{title}: all {len(shown)} rows", [replace(table, caption=title)])]


def write_chapter(
    number: int,
    named: Mapping[str, pd.DataFrame],
    *,
    values: Mapping[str, Any],
    figures: Mapping[str, Callable[[], Figure]],
    tables: Mapping[str, pd.DataFrame],
    shown: Mapping[str, Table],
    headings: Mapping[str, str] | None = None,
) -> ReportPart:
    """The section of a chapter from its text, a template that knows ``agreement``, ``tables`` by name and ``row``.

    Args:
        named: tables of the report beside ours, by name.
        values: what else the template is filled with.
        figures: how each is drawn, by name.
        tables: whole tables, written as CSV and to be shown, by their names within the chapter, with ``headings``.
        shown: further tables of the page by name, or such as stand for whole ones, without captions.
    """
    whole = {name: chapter_table(number, name, frame, headings) for name, frame in tables.items()}
    known = whole | dict(shown)

    def take(kind: str, name: str, rest: str) -> list[Block]:
        if kind == "figure":
            name, _, counterpart = name.partition(" ")
            head, _, description = map(join_lines, rest.partition("\n"))
            caption = f"{describe_counterpart(counterpart, head)}. {description}"
            return [draw_block(f"chapter-{number}-{name}", head, description, figures[name], caption)]
        if kind == "known":
            return build_known_table(name, named[name])
        return [replace(known[name], caption=join_lines(rest))]

    printed = named["reproduction"]
    agreement = describe_agreement_text(printed[printed["id"].map(chapter_of) == number])
    text = Path(__file__).parent / f"chapter_{number}" / "page.txt"
    known_values = {"agreement": agreement, "tables": {**named, **tables}, "row": row, "labels": LABELS}
    blocks = write_blocks(text, {**known_values, **values}, take)
    section = Section(f"chapter-{number}", LABELS["titles"][str(number)], blocks)
    return ReportPart(section, {whole[name].key: frame for name, frame in tables.items()})
