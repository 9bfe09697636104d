"""What the scorer leaves: the table of goals and measured values, the confusion matrix, and a drawing of each."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing

from damping.plots.style import ALERT, INK, MUTED, WIDTH, draw_plain_rows, styled, to_svg
from damping_validation.blind_page import describe_blind_page
from damping_validation.scorer import DETECTABLE, Figure, Goal
from damping_validation.verdicts import Verdict

# Answers that name no single class, as the confusion matrix heads them.
NONE = "none"
SEVERAL = "several"
BOTH = "both of the pair"
OPEN = "unexplained"
FAILED = "no answer"
_OTHER_ANSWERS = (NONE, BOTH, SEVERAL, OPEN, FAILED)


#: Files that :func:`render_scores` makes.
SCORES = (
    "table.csv",
    "table.md",
    "confusion.csv",
    "table.svg",
    "table.png",
    "confusion.svg",
    "confusion.png",
    "report.html",
)


def render_scores(figures: Sequence[Figure], cases: Sequence[Verdict], seed: int) -> dict[str, bytes]:
    """Contents of ``SCORES`` by name: tables, both drawings as SVG and PNG, the report."""
    matrix, table = tabulate_confusion(cases), _tabulate_frame(figures)
    files = {
        "table.csv": table.to_csv(index=False, lineterminator="\n").encode(),
        "table.md": to_markdown(figures).encode(),
        "confusion.csv": matrix.to_csv(lineterminator="\n").encode(),
    }
    drawn = {
        "table": (draw_table(figures), "Goals and measured values with 95 % intervals"),
        "confusion": (draw_confusion(matrix), "True effect (rows) against answer (columns), cases"),
    }
    svgs = {}
    for name, (drawing, title) in drawn.items():
        svgs[name] = (to_svg(drawing, f"blind-{name}", title, title), title)
        files |= {f"{name}.svg": svgs[name][0].encode(), f"{name}.png": _to_png(drawing)}
    return files | {"report.html": describe_blind_page(table, matrix, svgs, seed, len(cases)).encode()}


def _to_png(drawing: Drawing) -> bytes:
    buffer = io.BytesIO()
    drawing.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


def tabulate_confusion(cases: Sequence[Verdict]) -> pd.DataFrame:
    """Cases by true kind (rows; all nulls, others with a gap of at least one sigma) and answer (columns)."""
    some = [case for case in cases if case.family == "null" or case.gap >= DETECTABLE]
    families = {"null": 0, "single": 1, "pair": 2, "outside": 3}
    answers = [_answer(case) for case in some]
    kinds = [kind for _, kind in sorted({(families[case.family], case.kind) for case in some})]
    singles = sorted({case.kind for case in some if case.family == "single"})
    named = sorted(set(answers) - {*singles, *_OTHER_ANSWERS})
    counts = pd.crosstab(pd.Series([case.kind for case in some]), pd.Series(answers))
    columns = [NONE, *singles, *named, *_OTHER_ANSWERS[1:]]
    return counts.reindex(index=kinds, columns=columns, fill_value=0).rename_axis(index="truth", columns=None)


def _answer(case: Verdict) -> str:
    """The column of a case."""
    if case.said is None:
        return FAILED
    if case.unexplained:
        return OPEN
    if len(case.said) > 1:
        return BOTH if case.right else SEVERAL
    return next(iter(case.said), NONE)


def _tabulate_frame(figures: Sequence[Figure]) -> pd.DataFrame:
    rows = [
        {
            "figure": figure.name,
            "goal": describe_goal_text(figure.goal, figure.share),
            "measured": figure.measured,
            "low": figure.low,
            "high": figure.high,
            "cases": figure.cases,
            "met": {True: "yes", False: "no", None: ""}[figure.met],
            "share": figure.share,
        }
        for figure in figures
    ]
    return pd.DataFrame(rows)


def describe_goal_text(goal: Goal, share: bool) -> str:
    """The goal in words: <= 1 %, >= 97 %, 94-98 %; empty without one."""
    scale, unit = (100.0, " %") if share else (1.0, "")
    low, high = (None if bound is None else f"{scale * bound:g}" for bound in (goal.low, goal.high))
    if low is not None and high is not None:
        return f"{low}-{high}{unit}"
    return f">= {low}{unit}" if low is not None else f"<= {high}{unit}" if high is not None else ""


def to_markdown(figures: Sequence[Figure]) -> str:
    """The table for a web page: goal beside measured value with its interval, number of cases."""
    lines = ["| figure | goal | measured (95 % interval) | cases | met |", "|---|---|---|---|---|"]
    for figure in figures:
        met = {True: "yes", False: "**no**", None: ""}[figure.met]
        goal = describe_goal_text(figure.goal, figure.share).replace(">=", "≥").replace("<=", "≤")
        name = figure.name.replace(">=", "≥").replace("<=", "≤")
        lines.append(f"| {name} | {goal} | {_describe_measured_text(figure)} | {figure.cases} | {met} |")
    return "\n".join(lines) + "\n"


def _describe_measured_text(figure: Figure) -> str:
    if figure.measured is None:
        return "-"
    scale, unit = (100.0, " %") if figure.share else (1.0, "")
    digits = 1 if figure.share else 2
    text = f"{scale * figure.measured:.{digits}f}{unit}"
    if figure.low is None or figure.high is None:
        return text
    return f"{text} ({scale * figure.low:.{digits}f}-{scale * figure.high:.{digits}f})"


@styled
def draw_table(figures: Sequence[Figure]) -> Drawing:
    """Measured shares with their intervals as points, goals as bands, one line a figure."""
    shown = [figure for figure in figures if figure.share]
    drawing = Drawing(figsize=(WIDTH * 1.25, 0.8 + 0.24 * len(shown)))
    axes = drawing.subplots()
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
    axes.set_xlim(-1, 101)
    axes.set_xlabel("per cent, with 95 % interval; green: goal; in parentheses: cases")
    return drawing


@styled
def draw_confusion(matrix: pd.DataFrame) -> Drawing:
    """Counts on a grid, shaded by their share of the row."""
    counts = matrix.to_numpy(float)
    share = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1.0)
    drawing = Drawing(figsize=(WIDTH * 1.35, 1.9 + 0.22 * len(matrix)))
    axes = drawing.subplots()
    edges = [np.arange(size + 1) - 0.5 for size in share.T.shape]  # cells as shapes: a picture would blur when scaled
    axes.pcolormesh(*edges, share, cmap="Blues", vmin=0.0, vmax=1.0, edgecolors="white", linewidth=0.4)
    axes.invert_yaxis()
    axes.grid(visible=False)
    axes.set_xticks(range(matrix.shape[1]), [str(name) for name in matrix.columns], rotation=60, ha="right")
    axes.set_yticks(range(matrix.shape[0]), [str(name) for name in matrix.index])
    for row, column in np.argwhere(counts > 0):
        colour = "white" if share[row, column] > 0.55 else INK
        axes.text(column, row, f"{counts[row, column]:.0f}", ha="center", va="center", color=colour, fontsize=7)
    axes.set_xlabel("answer")
    axes.set_ylabel("truth")
    return drawing
