"""A fleet of records: which laws lead, and by how much linear damping overpredicts, record by record.

The page of a fleet: which laws lead, by how much linear damping overpredicts, outliers, failures, all records.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from damping.plots import AVERAGE, LINEAR, MUTED, PREDICTIVE, WIDTH, draw_plain_rows, law_style, styled, to_svg
from damping.report import count, format_joined, format_percent, format_share, format_signed, number
from damping.report.page import Block, Facts, FigureBlock, Fold, Footer, Link, Section, Table, Text, render_page

#: Points of the sorted figure: more cannot be told apart on paper.
MOST_POINTS = 500
#: Laws drawn by name; the others are one bar.
MOST_LAWS = 14


@styled
def leading_laws(counts: pd.Series) -> Figure:
    """Bars of how many records each law leads.

    Args:
        counts: records by law, largest first.
    """
    shown = counts.head(MOST_LAWS)
    if len(counts) > MOST_LAWS:
        shown = pd.concat([shown, pd.Series({"others": counts.iloc[MOST_LAWS:].sum()})])
    figure = Figure(figsize=(WIDTH, 0.8 + 0.24 * len(shown)))
    axes = figure.add_subplot()
    laws = [str(law) for law in shown.index]
    draw_plain_rows(axes, laws)
    colours, hatches = [law_style(law).colour for law in laws], ["///" if "viscous + " in law else "" for law in laws]
    axes.barh(range(len(laws)), shown.to_numpy(float), color=colours, hatch=hatches, edgecolor="white", linewidth=0.0)
    for row, value in enumerate(shown):
        axes.annotate(f"{value:d}", (float(value), row), (4, 0), textcoords="offset points", va="center", fontsize=7.5)
    axes.set_xlim(0.0, 1.12 * float(shown.max()))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_xlabel("records led (hatched: with a viscous part)")
    return figure


@styled
def sorted_overprediction(table: pd.DataFrame) -> Figure:
    """Overprediction of linear damping, largest first, with the interval of each record.

    Args:
        table: ``percent, low, high``, a row a record, all finite.
    """
    ordered = table.sort_values("percent", ascending=False, ignore_index=True)
    chosen = np.unique(np.linspace(0, len(ordered) - 1, MOST_POINTS).round().astype(int))
    place, rows = 100.0 * (chosen + 0.5) / len(ordered), ordered.iloc[chosen]
    figure = Figure(figsize=(WIDTH, 3.1))
    axes = figure.add_subplot()
    if len(ordered) > MOST_POINTS // 5:
        axes.fill_between(place, rows["low"], rows["high"], color=PREDICTIVE, linewidth=0)
        axes.plot(place, rows["percent"], color=AVERAGE)
    else:
        axes.vlines(place, rows["low"], rows["high"], color=PREDICTIVE, linewidth=max(1.0, 150.0 / len(ordered)))
        axes.plot(place, rows["percent"], "o", color=AVERAGE, markersize=3.5)
    axes.axhline(0.0, color=LINEAR, linewidth=1.0)
    axes.axvline(50.0, color=MUTED, linewidth=0.6, linestyle=(0, (2, 2)))
    axes.set_xlim(0.0, 100.0)
    axes.set_xlabel("records, largest overprediction first (%)")
    axes.set_ylabel("linear over median (%)")
    return figure


#: Columns of the data set that the page is made of.
COLUMNS = (
    *("name", "key", "status", "reason", "report", "law", "weight", "average_absolute_percent", "held_out_error"),
    *("load_law", "median", "low", "high", "linear_overprediction_percent", "linear_overprediction_low"),
    *("linear_overprediction_high", "effects", "unexplained", "gap_shrinkage", "cautions"),
)
#: Rows of a table of the page; the data set holds the rest.
MOST_ROWS = 200
#: Records of a list of the page.
MOST_LISTED = 1000
#: Robust standard deviations from the median of the fleet from which on a record is an outlier.
OUTLYING = 3.5
_OVER = "linear_overprediction_percent"


def describe_fleet_page(table: pd.DataFrame, method: str, asked: str, seed: int, versions: Mapping[str, str]) -> str:
    """The page as HTML. Equal arguments give equal text.

    Args:
        table: ``COLUMNS``, a row a record. method: how posteriors were had. asked: the force that loads are for.
    """
    sections = [
        Section("answer", "The answer first", _answer(table, method, asked)),
        Section("laws", "Which laws lead", _build_laws(table)),
        Section("loads", "What linear damping would have said", _build_loads(table, asked)),
        Section("outliers", "Outliers", _build_outliers(table)),
        Section("failures", "Failures", _build_failures(table)),
        Section("gaps", "Gaps to the simulations", _build_gaps(table)),
        Section("records", "All records", _build_records(table)),
    ]
    return render_page(f"Fleet of {count(len(table), 'record')}", sections, Footer(seed, versions, {}))


def tabulate_outliers(table: pd.DataFrame) -> pd.DataFrame:
    """Records that stand apart from the fleet, with the reason: ``name, report, why``.

    A value is apart by ``OUTLYING`` times 1.4826 of the median absolute deviation, the standard deviation of a normal
    distribution; the error of the fit only above.
    """
    checks = (("overprediction", _OVER, True), ("error of the fit", "average_absolute_percent", False))
    reasons: dict[int, list[str]] = {}
    for what, column, both in checks:
        values = table[column].to_numpy(float)
        known = values[np.isfinite(values)]
        if not len(known):
            continue
        middle = np.median(known)
        spread = 1.4826 * np.median(np.abs(known - middle))
        if spread == 0.0:
            continue
        z = (values - middle) / spread
        for row in np.flatnonzero((np.abs(z) if both else z) > OUTLYING):
            reason = (
                f"{what} {format_percent(values[row])} %, fleet {format_percent(middle)} % (z = {number(z[row], 2)})"
            )
            reasons.setdefault(int(row), []).append(reason)
    rows = sorted(reasons)
    chosen = table.iloc[rows][["name", "report", "law"]].reset_index(drop=True)
    return chosen.assign(why=["; ".join(reasons[row]) for row in rows])


def _list_links(table: pd.DataFrame) -> list[Link]:
    return [Link(name, report) for name, report in zip(table["name"], table["report"], strict=True)]


def _answer(table: pd.DataFrame, method: str, asked: str) -> list[Block]:
    good = table[table["status"] != "failed"]
    over = good[_OVER].to_numpy(float)
    over = over[np.isfinite(over)]
    facts = [(str(len(good)), f"of {len(table)} records analysed")]
    leading = good["law"].value_counts()
    if len(leading):
        facts.append((str(leading.index[0]), f"leads in {leading.iloc[0]} of them"))
    if len(over):
        low, high = np.quantile(over, [0.05, 0.95])
        facts.append((format_signed(np.median(over)), "linear over median amplitude, median record"))
        facts.append((f"{format_signed(low)} to {format_signed(high)}", "in nine records of ten"))
    refused = len(good) - len(over)
    sentences = [f"Design loads are for {asked}. Posteriors by {method}, in every row."]
    if refused:
        sentences.append(f"No prediction at that force in {count(refused, 'record')}: their pages say why.")
    return [Facts(facts), Text(" ".join(sentences))]


def _build_laws(table: pd.DataFrame) -> list[Block]:
    led = table.dropna(subset=["law"])
    if led.empty:
        return [Text("No record could be ranked.")]
    counts = led["law"].value_counts().sort_index().sort_values(ascending=False, kind="stable")
    weights = led.groupby("law")["weight"].mean()
    leaders = format_joined(f"{law} {value}" for law, value in counts.head(3).items())
    drawn = to_svg(leading_laws(counts), "leading-laws", "Records by leading law", f"Bars; most often: {leaders}.")
    frame = pd.DataFrame(
        {
            "law": counts.index,
            "records": counts.to_numpy(),
            "share": counts.to_numpy() / len(led),
            "mean weight there": weights.loc[counts.index].to_numpy(),
        }
    )
    caption = "Records by the law of largest weight in their ranking"
    return [
        FigureBlock(drawn, f"{caption}."),
        Table(frame, caption, {"share": format_share, "mean weight there": format_share}),
    ]


def _build_loads(table: pd.DataFrame, asked: str) -> list[Block]:
    frame = table[[_OVER, "linear_overprediction_low", "linear_overprediction_high"]].astype(float)
    frame.columns = pd.Index(["percent", "low", "high"])
    frame = frame.loc[np.isfinite(frame.to_numpy()).all(axis=1)]
    if frame.empty:
        return [Text("No record has a prediction at its largest design force.")]
    quartiles = np.quantile(frame["percent"], [0.25, 0.5, 0.75])
    quartile_text = f"Quartiles {format_joined(format_signed(q) for q in quartiles)}."
    drawn = to_svg(
        sorted_overprediction(frame), "overprediction", "Sorted overprediction of linear damping", quartile_text
    )
    caption = (
        f"Linear prediction over the median at {asked}, per cent, sorted, with the predictive interval of each record. "
        f"{quartile_text}"
    )
    return [FigureBlock(drawn, caption)]


def _build_outliers(table: pd.DataFrame) -> list[Block]:
    outliers = tabulate_outliers(table)
    if outliers.empty:
        return [Text("No record stands apart from the others.")]
    frame = pd.DataFrame({"record": _list_links(outliers), "law": outliers["law"], "why": outliers["why"]})
    what = f"{count(len(outliers), 'record')} apart from the fleet by {OUTLYING:g} robust standard deviations"
    return [_build_table(frame, what)]


def _build_failures(table: pd.DataFrame) -> list[Block]:
    failures = table[table["status"] != "done"]
    if failures.empty:
        return [Text("None.")]
    frame = pd.DataFrame({"record": _list_links(failures), "status": failures["status"], "reason": failures["reason"]})
    return [_build_table(frame, f"{count(len(failures), 'record')} of which all or a part could not be done")]


def _build_gaps(table: pd.DataFrame) -> list[Block]:
    diagnosed = table[table["effects"].notna()]
    if diagnosed.empty:
        return [Text("No record has a simulation beside it.")]
    named = diagnosed["effects"].map(lambda effects: " + ".join(effects) or "no effect")
    counts = named.value_counts().sort_index().sort_values(ascending=False, kind="stable")
    frame = pd.DataFrame({"explanation": counts.index, "records": counts.to_numpy()})
    blocks: list[Block] = [Table(frame, "Leading explanation of the gap, by number of records")]
    left = diagnosed[diagnosed["unexplained"].astype(bool)]
    if len(left):
        listed = pd.DataFrame({"record": _list_links(left), "explanation": named.loc[left.index]})
        blocks.append(_build_table(listed, f"{count(len(left), 'record')} with more than noise left"))
    return blocks


def _build_records(table: pd.DataFrame) -> list[Block]:
    ordered = table.sort_values(_OVER, ascending=False, kind="stable", na_position="last").head(MOST_LISTED)
    frame = pd.DataFrame(
        {
            "record": _list_links(ordered),
            "status": ordered["status"],
            "law": ordered["law"],
            "weight": ordered["weight"].astype(float),
            "median": ordered["median"].astype(float),
            "low": ordered["low"].astype(float),
            "high": ordered["high"].astype(float),
            "linear over": ordered[_OVER].astype(float),
        }
    )
    what = f"{len(ordered)} of {len(table)} records, largest overprediction first"
    if len(ordered) < len(table):
        what += "; the column report of the data set names the page of every record"
    return [Fold(what, [Table(frame, what, {"weight": format_share, "linear over": format_signed})])]


def _build_table(frame: pd.DataFrame, caption: str) -> Block:
    if len(frame) > MOST_ROWS:
        caption += f"; the first {MOST_ROWS} here, all in the data set"
    return Table(frame.head(MOST_ROWS), caption)
