"""Output of the scorer: goals beside measured values, results by kind, confusion matrix, figures, the page."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing

from damping.plots import ALERT, INK, MUTED, TEXT_WIDTH, build_panels, draw_plain_rows, styled, to_png, to_svg
from damping.records.record import record_to_csv
from damping.report import format_joined
from damping.report.page import Block, FigureBlock, Footer, Table, render_page, write_sections
from damping_pipelines import shipped_folder
from damping_validation.scorer import DETECTABLE, Figure, Goal, Verdict

# Answers that name no single class, as the confusion matrix heads them.
NONE = "none"
SEVERAL = "several"
BOTH = "both of the pair"
OPEN = "flagged"
FAILED = "no answer"
FAMILIES = {"null": 0, "single": 1, "pair": 2, "outside": 3}  #: families in the order in which tables list them
#: Where the cause is, of a case of each family.
CAUSES = {"null": "nothing", "single": "in the library", "pair": "a pair", "outside": "in no library"}
_OTHER_ANSWERS = (NONE, BOTH, SEVERAL, OPEN, FAILED)
#: Files that :func:`render_scores` makes.
SCORES = (
    *("table.csv", "table.md", "kinds.csv", "confusion.csv", "table.svg", "table.png", "confusion.svg"),
    *("confusion.png", "report.html"),
)


def render_scores(figures: Sequence[Figure], cases: Sequence[Verdict], seed: int) -> dict[str, bytes]:
    """Contents of ``SCORES`` by name: tables, both drawings as SVG and PNG, the report."""
    matrix, table, kinds = tabulate_confusion(cases), tabulate_figures(figures), tabulate_kinds(cases)
    counts = matrix.reset_index(names="truth")
    sentence = describe_verdict(figures, cases)
    kinds_text = write_markdown(kinds.rename(columns=lambda name: name.replace("_", " ")))
    files = {
        "table.csv": record_to_csv(table).encode(),
        "table.md": f"{sentence}\n\n{to_markdown(figures)}\n{kinds_text}".encode(),
        "kinds.csv": record_to_csv(kinds).encode(),
        "confusion.csv": record_to_csv(counts).encode(),
    }
    drawn = {
        "table": (draw_table(figures), "Goals and measured values with 95 % intervals"),
        "confusion": (draw_confusion(matrix), "True effect (rows) against answer (columns), cases"),
    }
    parts: dict[str, Block] = {
        "rows": Table(tabulate_blind_rows(table)),
        "kinds": Table(kinds, key="kinds"),
        "counts": Table(list_answers(matrix), key="confusion"),
    }
    for name, (drawing, title) in drawn.items():
        svg = to_svg(drawing, f"blind-{name}", title, title)
        parts[f"{name} drawn"] = FigureBlock(svg, title)
        files |= {f"{name}.svg": svg.encode(), f"{name}.png": to_png(drawing, dpi=150)}
    sections = write_sections(Path(__file__).with_suffix(".txt"), {"sentence": sentence}, parts)
    title = f"Blind check of the gap diagnosis: {len(cases)} cases"
    return files | {"report.html": render_page(title, sections, Footer(seed, {}, {})).encode()}


def describe_verdict(figures: Sequence[Figure], cases: Sequence[Verdict]) -> str:
    """The run in one sentence."""
    value = {figure.name: figure.measured for figure in figures if figure.measured is not None}
    kinds, outside = ({case.kind for case in cases if case.family in some} for some in (FAMILIES, ("outside",)))
    shares = {
        "good: right or honestly short": "right or honestly short in {:.1f} %",
        "right by effects alone, gap >= 1 sigma": "right by name alone in {:.1f} % of those that have a name",
        "confidently wrong": "confidently wrong in {:.1f} %",
        "null cases wrongly accused": "wrong about nothing in {:.1f} % of those with nothing to find",
    }
    measured = ", ".join(words.format(100 * value[name]) for name, words in shares.items() if name in value)
    return f"Of {len(cases)} generated cases of {len(kinds)} kinds, {len(outside)} of them in no library: {measured}."


def tabulate_kinds(cases: Sequence[Verdict]) -> pd.DataFrame:
    """One row per kind: cases, and how many answers were good, right, flagged, confidently wrong, unfair."""
    counted = ("good", "right", "flagged", "confidently_wrong")
    rows = [
        {"family": FAMILIES[case.family], "kind": case.kind, "cause": CAUSES[case.family], "cases": 1}
        | {name: getattr(case, name) for name in counted}
        | {"put_on_structure": case.wrongs_structure}
        for case in cases
    ]
    return pd.DataFrame(rows).groupby(["family", "kind", "cause"]).sum().reset_index().drop(columns="family")


def write_markdown(table: pd.DataFrame) -> str:
    """A table for a web page."""
    rows: list[Iterable[Any]] = [table.columns, *table.itertuples(index=False, name=None)]
    head, *lines = (f"| {' | '.join(map(str, cells))} |" for cells in rows)
    return "\n".join([head, f"|{'---|' * len(table.columns)}", *lines]) + "\n"


def tabulate_confusion(cases: Sequence[Verdict]) -> pd.DataFrame:
    """Cases by true kind (rows; all nulls, others with a gap of at least one sigma) and answer (columns)."""
    some = [case for case in cases if case.family == "null" or case.gap >= DETECTABLE]
    answers = [_answer(case) for case in some]
    kinds = [kind for _, kind in sorted({(FAMILIES[case.family], case.kind) for case in some})]
    singles = sorted({case.kind for case in some if case.family == "single"})
    named = sorted(set(answers) - {*singles, *_OTHER_ANSWERS})
    counts = pd.crosstab(pd.Series([case.kind for case in some]), pd.Series(answers))
    columns = [NONE, *singles, *named, *_OTHER_ANSWERS[1:]]
    return counts.reindex(index=kinds, columns=columns, fill_value=0).rename_axis(index="truth", columns=None)


def list_answers(matrix: pd.DataFrame) -> pd.DataFrame:
    """The answers to each truth with their numbers, most frequent first (a table of all counts holds zeros)."""
    given = [row[row > 0].sort_values(ascending=False, kind="stable") for _, row in matrix.iterrows()]
    answers = [format_joined(f"{n} {name}" for name, n in row.items()) for row in given]
    return pd.DataFrame({"truth": matrix.index, "answers": answers})


def _answer(case: Verdict) -> str:
    """The column of a case."""
    if case.leading is None:
        return FAILED
    if case.flagged:
        return OPEN
    if len(case.leading) > 1:
        return BOTH if case.right else SEVERAL
    return next(iter(case.leading), NONE)


#: Columns of the table of figures.
COLUMNS = ("figure", "goal", "measured", "low", "high", "cases", "met", "share")


def tabulate_figures(figures: Sequence[Figure]) -> pd.DataFrame:
    """One row per figure; ``share``: whether the values are shares of 1."""
    met = {True: "yes", False: "no", None: ""}
    rows = [
        (f.name, describe_goal_text(f.goal, f.share), f.measured, f.low, f.high, f.cases, met[f.met], f.share)
        for f in figures
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS))


def describe_goal_text(goal: Goal, share: bool) -> str:
    """The goal in words: <= 1 %, >= 97 %, 94-98 %; empty without one."""
    scale, unit = (100.0, " %") if share else (1.0, "")
    low, high = (None if bound is None else f"{scale * bound:g}" for bound in (goal.low, goal.high))
    if low is not None and high is not None:
        return f"{low}-{high}{unit}"
    return f">= {low}{unit}" if low is not None else f"<= {high}{unit}" if high is not None else ""


def to_markdown(figures: Sequence[Figure]) -> str:
    """The table for a web page: goal beside measured value with its interval, number of cases."""
    rows = tabulate_blind_rows(tabulate_figures(figures))
    rows["met"] = rows["met"].replace("no", "**no**")
    text = write_markdown(rows.rename(columns={"measured": "measured (95 % interval)"}))
    return text.replace(">=", "≥").replace("<=", "≤")


@styled
def draw_table(figures: Sequence[Figure]) -> Drawing:
    """Measured shares with their intervals as points, goals as bands, one line for each figure."""
    shown = [figure for figure in figures if figure.share]
    drawing, axes = build_panels(0.8 + 0.24 * len(shown), 1, width=1.25 * TEXT_WIDTH)
    draw_plain_rows(axes, [f"{figure.name} ({figure.cases})" for figure in shown])
    for row, figure in enumerate(shown):
        goal = figure.goal
        if goal.low is not None or goal.high is not None:
            low, high = 100 * (goal.low or 0.0), 100 * (1.0 if goal.high is None else goal.high)
            axes.barh(row, max(high - low, 0.3), left=low, height=0.7, color="#dce9dc", zorder=0)
        if figure.measured is None:
            continue
        colour = ALERT if figure.met is False else INK if figure.met else MUTED
        if figure.low is not None and figure.high is not None:
            axes.plot([100 * figure.low, 100 * figure.high], [row, row], color=colour, linewidth=1.2)
        axes.plot(100 * figure.measured, row, "o", color=colour, markersize=4)
    axes.set(xlim=(-1, 101), xlabel="per cent, with 95 % interval; green: goal, orange: missed; in parentheses: cases")
    return drawing


@styled
def draw_confusion(matrix: pd.DataFrame) -> Drawing:
    """Counts on a grid, shaded by their share of the row; answers that no case got are left out."""
    matrix = matrix.loc[:, matrix.any()]
    counts = matrix.to_numpy(float)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    drawing, axes = build_panels(1.9 + 0.22 * len(matrix), 1, width=1.35 * TEXT_WIDTH)
    edges = [np.arange(size + 1) - 0.5 for size in share.T.shape]  # cells as shapes: a picture would blur when scaled
    axes.pcolormesh(*edges, share, cmap="Blues", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=0.4)
    axes.invert_yaxis()
    axes.grid(visible=False)
    axes.set_xticks(range(matrix.shape[1]), [str(name) for name in matrix.columns], rotation=60, ha="right")
    axes.set_yticks(range(matrix.shape[0]), [str(name) for name in matrix.index])
    for row, column in np.argwhere(counts > 0):
        colour = "white" if share[row, column] > 0.55 else INK
        axes.text(column, row, f"{counts[row, column]:.0f}", ha="center", va="center", color=colour, fontsize=7)
    axes.set(xlabel="answer", ylabel="truth")
    return drawing


def tabulate_blind_rows(table: pd.DataFrame) -> pd.DataFrame:
    """The table ``figure, goal, measured, low, high, cases, met`` as text, with shares in per cent."""
    rows = table[["measured", "low", "high", "share"]].itertuples(index=False, name=None)
    shown = table[["figure", "goal", "measured", "cases", "met"]].fillna({"goal": "", "met": ""})
    return shown.assign(measured=[_describe_measured(*row) for row in rows])


def _describe_measured(value: float, low: float, high: float, share: bool) -> str:
    """A value with its interval; NaN where there is none."""
    if np.isnan(value):
        return "-"
    scale, unit, digits = (100.0, " %", 1) if share else (1.0, "", 2)
    texts = [f"{scale * bound:.{digits}f}" for bound in (value, low, high)]
    return f"{texts[0]}{unit}" + ("" if np.isnan(low) else f" ({texts[1]} to {texts[2]})")


def load_blind_table() -> pd.DataFrame:
    """The table of the last blind run, shipped as the expected quality of the diagnosis (:func:`tabulate_figures`)."""
    table = pd.read_csv(shipped_folder(Path(__file__).parent, "blind") / "table.csv", keep_default_na=True)
    return table.loc[:, list(COLUMNS)].assign(goal=table["goal"].fillna(""), met=table["met"].fillna(""))
