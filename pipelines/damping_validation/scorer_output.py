"""What the scorer leaves: goals beside measured values, kind by kind, what was answered to what, drawings, the page.

The figures of the last blind run of the gap diagnosis are shipped: what may be expected of its answers.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure as Drawing

from damping.plots import ALERT, INK, MUTED, TEXT_WIDTH, draw_plain_rows, styled, to_svg
from damping.report.page import FigureBlock, Footer, Section, Table, Text, render_page
from damping_pipelines.exhibits import shipped_folder
from damping_validation.scorer import Figure, Goal
from damping_validation.verdicts import DETECTABLE, Verdict

# Answers that name no single class, as the confusion matrix heads them.
NONE = "none"
SEVERAL = "several"
BOTH = "both of the pair"
OPEN = "flagged"
FAILED = "no answer"
#: Families in the order in which tables list them.
FAMILIES = {"null": 0, "single": 1, "pair": 2, "outside": 3}
_OTHER_ANSWERS = (NONE, BOTH, SEVERAL, OPEN, FAILED)


#: Files that :func:`render_scores` makes.
SCORES = (
    "table.csv",
    "table.md",
    "kinds.csv",
    "confusion.csv",
    "table.svg",
    "table.png",
    "confusion.svg",
    "confusion.png",
    "report.html",
)


def render_scores(figures: Sequence[Figure], cases: Sequence[Verdict], seed: int) -> dict[str, bytes]:
    """Contents of ``SCORES`` by name: tables, both drawings as SVG and PNG, the report."""
    matrix, table, kinds = tabulate_confusion(cases), _tabulate_frame(figures), tabulate_kinds(cases)
    sentence = describe_verdict(figures, cases)
    files = {
        "table.csv": table.to_csv(index=False, lineterminator="\n").encode(),
        "table.md": f"{sentence}\n\n{to_markdown(figures)}\n{_list_kinds(kinds)}".encode(),
        "kinds.csv": kinds.to_csv(index=False, lineterminator="\n").encode(),
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
    page = describe_blind_page([Text(sentence, lead=True), Text(_WHAT)], table, kinds, matrix, svgs, seed, len(cases))
    return files | {"report.html": page.encode()}


def describe_verdict(figures: Sequence[Figure], cases: Sequence[Verdict]) -> str:
    """The run in one sentence."""
    value = {figure.name: figure.measured for figure in figures}
    kinds, outside = ({case.kind for case in cases if case.family in some} for some in (FAMILIES, ("outside",)))
    shares = [
        (words, value[name])
        for name, words in (
            ("good: right or honestly short", "right or honestly short in {}"),
            ("right by effects alone, gap >= 1 sigma", "right by name alone in {} of those that have a name"),
            ("confidently wrong", "confidently wrong in {}"),
            ("null cases wrongly accused", "wrong about nothing in {} of those with nothing to find"),
        )
        if value[name] is not None
    ]
    said = ", ".join(words.format(f"{100 * share:.1f} %") for words, share in shares if share is not None)
    return f"Of {len(cases)} generated cases of {len(kinds)} kinds, {len(outside)} of them in no library: {said}."


def tabulate_kinds(cases: Sequence[Verdict]) -> pd.DataFrame:
    """One row per kind: cases, and how many answers were good, right, flagged, confidently wrong, unfair."""
    order = {kind: (FAMILIES[case.family], kind) for case in cases for kind in [case.kind]}
    rows = []
    for kind in sorted(order, key=order.__getitem__):
        some = [case for case in cases if case.kind == kind]
        counts = {
            "good": [case.good for case in some],
            "right": [case.right for case in some],
            "flagged": [case.flagged for case in some],
            "confidently_wrong": [case.confidently_wrong for case in some],
            "put_on_structure": [case.wrongs_structure for case in some],
        }
        family = {"null": "nothing", "single": "in the library", "pair": "a pair", "outside": "in no library"}
        rows.append({"kind": kind, "cause": family[some[0].family], "cases": len(some)}
                    | {name: sum(hits) for name, hits in counts.items()})  # fmt: skip
    return pd.DataFrame(rows)


def _list_kinds(kinds: pd.DataFrame) -> str:
    """The table of kinds for a web page."""
    head = [str(name).replace("_", " ") for name in kinds.columns]
    lines = [f"| {' | '.join(head)} |", f"|{'---|' * len(head)}"]
    lines += [f"| {' | '.join(map(str, row))} |" for row in kinds.itertuples(index=False, name=None)]
    return "\n".join(lines) + "\n"


def _to_png(drawing: Drawing) -> bytes:
    buffer = io.BytesIO()
    drawing.savefig(buffer, format="png", dpi=150)
    return buffer.getvalue()


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


def _answer(case: Verdict) -> str:
    """The column of a case."""
    if case.said is None:
        return FAILED
    if case.flagged:
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
        lines.append(f"| {name} | {goal} | {_describe_figure(figure)} | {figure.cases} | {met} |")
    return "\n".join(lines) + "\n"


@styled
def draw_table(figures: Sequence[Figure]) -> Drawing:
    """Measured shares with their intervals as points, goals as bands, one line a figure."""
    shown = [figure for figure in figures if figure.share]
    drawing = Drawing(figsize=(TEXT_WIDTH * 1.25, 0.8 + 0.24 * len(shown)))
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
    drawing = Drawing(figsize=(TEXT_WIDTH * 1.35, 1.9 + 0.22 * len(matrix)))
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


_WHAT = (
    "Cases were generated by integration in time, by code that the diagnosis does not share; their labels were sealed "
    "before the first diagnosis, which saw the case files alone. Gap size is the root mean square, in units of the "
    "noise, of what the effect leaves in the noise-free record after the simulation was refitted. Intervals are 95 per "
    "cent: exact binomial ones of shares, bootstrap ones of means and percentiles."
)


def describe_blind_page(
    said: Sequence[Text],
    table: pd.DataFrame,
    kinds: pd.DataFrame,
    confusion: pd.DataFrame,
    drawings: Mapping[str, tuple[str, str]],
    seed: int,
    cases: int,
) -> str:
    """The page as HTML; ``drawings``: SVG and caption by name, ``table`` and ``confusion``."""
    figures = {name: FigureBlock(svg, caption) for name, (svg, caption) in drawings.items()}
    counts = confusion.reset_index(names="truth")
    sections = [
        Section(
            "table",
            "Goals and measured values",
            [*said, Table(tabulate_blind_rows(table), "All figures"), figures["table"]],
        ),
        Section("kinds", "Kind by kind", [Table(kinds, "Cases and answers by kind", key="kinds")]),
        Section(
            "confusion", "What was answered to what", [figures["confusion"], Table(counts, "Cases by truth and answer")]
        ),
    ]
    return render_page(f"Blind check of the gap diagnosis: {cases} cases", sections, Footer(seed, {}, {}))


def tabulate_blind_rows(table: pd.DataFrame) -> pd.DataFrame:
    """What a reader sees of the table ``figure, goal, measured, low, high, cases, met``: shares in per cent."""
    return pd.DataFrame(
        {
            "figure": table["figure"],
            "goal": table["goal"].fillna(""),
            "measured": [
                _describe_measured(*row)
                for row in zip(*(table[name] for name in ("measured", "low", "high", "share")), strict=True)
            ],
            "cases": table["cases"],
            "met": table["met"].fillna(""),
        }
    )


def _describe_figure(figure: Figure) -> str:
    value, low, high = (np.nan if bound is None else bound for bound in (figure.measured, figure.low, figure.high))
    return _describe_measured(value, low, high, figure.share)


def _describe_measured(value: float, low: float, high: float, share: bool) -> str:
    """A value with its interval; NaN where there is none."""
    if np.isnan(value):
        return "-"
    scale, unit, digits = (100.0, " %", 1) if share else (1.0, "", 2)
    texts = [f"{scale * bound:.{digits}f}" for bound in (value, low, high)]
    return f"{texts[0]}{unit}" + ("" if np.isnan(low) else f" ({texts[1]} to {texts[2]})")


COLUMNS = ("figure", "goal", "measured", "low", "high", "cases", "met", "share")


def load_blind_table() -> pd.DataFrame:
    """The table that ``damping blind`` wrote: figure, goal, measured value with its 95 % interval, cases, met or not.

    ``share``: whether the values are shares of 1.
    """
    table = pd.read_csv(shipped_folder(Path(__file__).parent, "blind") / "table.csv", keep_default_na=True)
    return table.loc[:, list(COLUMNS)].assign(goal=table["goal"].fillna(""), met=table["met"].fillna(""))
