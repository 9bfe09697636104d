"""The page of a fleet: leading laws, overprediction of linear damping, outliers, failures, and all records."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from damping.arrays import FloatArray
from damping.plots import AVERAGE, BESIDE, LINEAR, MUTED, PREDICTIVE, build_panel, draw_plain_rows, styled, to_svg
from damping.plots.fits import draw_law_bars
from damping.ranking.verdict import MISFITS
from damping.report import (
    count,
    format_joined,
    format_percent,
    format_percent_ratio,
    format_share,
    format_signed,
    number,
)
from damping.report.page import Block, Facts, FigureBlock, Footer, Link, Table, render_page, write_sections
from damping_pipelines.fleet.dataset import MULTIPLES, FleetSettings

MOST_TIED = 3  #: laws that lead in as many records are named up to this many
#: Records below which no twentieth of them is left out: their whole range is said.
RECORDS_OF_TEN = 20
MOST_COPIES = 5  #: copies of a record, records with copies, and files that are not read, that are named
MOST_POINTS = 500  #: points of the sorted figure: more cannot be told apart on paper
WIDEST = 12.0  #: width of the line of an interval at most, points: two records have no bars as wide as the page
MOST_LAWS = 14  #: laws drawn by name; the others are one bar


@styled
def leading_laws(counts: pd.Series) -> Figure:
    """Draw the number of records that each law leads; ``counts``: records by law, largest first."""
    shown = counts.head(MOST_LAWS)
    if len(counts) > MOST_LAWS:
        shown = pd.concat([shown, pd.Series({"others": counts.iloc[MOST_LAWS:].sum()})])
    figure, axes = build_panel(0.8 + 0.24 * len(shown), "records led")
    laws = [str(law) for law in shown.index]
    draw_plain_rows(axes, laws)
    draw_law_bars(axes, laws, shown, np.arange(float(len(laws))))
    for row, value in enumerate(shown):
        axes.annotate(f"{value:d}", (float(value), row), (4, 0), **BESIDE)
    axes.set_xlim(0.0, 1.12 * float(shown.max()))
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return figure


@styled
def sorted_overprediction(table: pd.DataFrame) -> Figure:
    """Draw overprediction of linear damping with intervals: ``percent, low, high`` by record, largest first."""
    ordered = table.sort_values("percent", ascending=False, ignore_index=True)
    chosen = np.unique(np.linspace(0, len(ordered) - 1, MOST_POINTS).round().astype(int))
    place, rows = 100.0 * (chosen + 0.5) / len(ordered), ordered.iloc[chosen]
    figure, axes = build_panel(3.1, "records, largest overprediction first (%)", "linear over median (%)")
    if len(ordered) > MOST_POINTS // 5:
        axes.fill_between(place, rows["low"], rows["high"], color=PREDICTIVE, linewidth=0)
        axes.plot(place, rows["percent"], color=AVERAGE)
    else:
        width = min(max(1.0, 150.0 / len(ordered)), WIDEST)
        axes.vlines(place, rows["low"], rows["high"], color=PREDICTIVE, linewidth=width)
        axes.plot(place, rows["percent"], "o", color=AVERAGE, markersize=3.5)
    axes.axhline(0.0, color=LINEAR, linewidth=1.0)
    axes.axvline(50.0, color=MUTED, linewidth=0.6, linestyle=(0, (2, 2)))
    axes.set_xlim(0.0, 100.0)
    return figure


#: Columns of the data set that the page is made of.
COLUMNS = (
    *("name", "key", "status", "reason", "report", "law", "weight", "average_absolute_percent", "held_out_error"),
    *("load_law", "median", "low", "high", "linear_overprediction_percent", "linear_overprediction_low"),
    *("linear_overprediction_high", "effects", "unexplained", "gap_shrinkage", "cautions", "record_sha256"),
    *("units_length", "units_force", "design_force", "frequency", "damping_ratio", "damping_ratio_low", "audit"),
)
MOST_ROWS = 200  #: rows of a table of the page; the data set holds the rest
_CUT = ("outliers", "doubts", "failures", "left")  #: tables that are cut there
MOST_LISTED = 1000  #: records of a list of the page
#: Robust standard deviations from the median of the fleet from which on a record is an outlier.
OUTLYING = 3.5
#: Different records below which none is an outlier: among normal values chance makes one in 29 % of the fleets of 3, in
#: 13 % of those of 10 and in 8 % of those of 50 (20000 draws of each).
FEWEST_COMPARED = 10
_OVER = "linear_overprediction_percent"


def describe_fleet_page(table: pd.DataFrame, settings: FleetSettings) -> str:
    """The page as HTML of ``COLUMNS`` by record; equal arguments give equal text. ``settings``: of the run."""
    good, asked = table[table["status"] != "failed"], describe_force(table, settings.forces)
    over = table[[_OVER, "linear_overprediction_low", "linear_overprediction_high"]].astype(float)
    over = over.set_axis(["percent", "low", "high"], axis=1).loc[np.isfinite(over.to_numpy()).all(axis=1)]
    predicted = good[_OVER].to_numpy(float)
    predicted = predicted[np.isfinite(predicted)]
    records = _tabulate_records(table)
    parts = {"facts": collect_facts(table, good, predicted), "records": records}
    parts |= _build_laws(table.dropna(subset=["law"])) | _build_lists(table)
    quartiles = ""
    if len(over):
        levels = np.quantile(over["percent"], [0.25, 0.5, 0.75])
        quartiles = f"Quartiles {format_joined(format_signed(q) for q in levels)}."
        title = "Sorted overprediction of linear damping"
        svg = to_svg(sorted_overprediction(over), "overprediction", title, quartiles)
        parts["overprediction"] = FigureBlock(svg)
    values = {
        "asked": asked,
        "before": [*list_drives(table, settings.forces), *list_copies(table)],
        "method": settings.method,
        "level": f"{100 * settings.level:g}",
        "refused": len(good) - len(predicted),
        "quartiles": quartiles,
        "outlying": OUTLYING,
        "fewest": FEWEST_COMPARED,
        "parts": defaultdict(bool, dict.fromkeys(parts, True)),
        "sizes": {name: len(part.frame) for name, part in parts.items() if isinstance(part, Table)},
        "more": lambda size: f"; the first {MOST_ROWS} here, all in the data set" if size > MOST_ROWS else "",
        "listed": len(records.frame),
        "all": len(table),
    }
    shown = {
        name: replace(part, frame=part.frame.head(MOST_ROWS)) if isinstance(part, Table) and name in _CUT else part
        for name, part in parts.items()
    }
    sections = write_sections(Path(__file__).with_suffix(".txt"), values, shown)
    return render_page(
        f"Fleet of {count(len(table), 'record')}", sections, Footer(settings.seed, settings.versions, {})
    )


def tabulate_outliers(table: pd.DataFrame) -> pd.DataFrame:
    """Records that deviate from the fleet, with the reason: ``name, report, why``.

    A value is an outlier if it deviates by ``OUTLYING`` times 1.4826 of the median absolute deviation (the standard
    deviation of a normal distribution); the error of the fit only upwards. Copies of a record count once; fewer than
    ``FEWEST_COMPARED`` are not compared.
    """
    checks = (("overprediction", _OVER, True), ("error of the fit", "average_absolute_percent", False))
    reasons: dict[int, list[str]] = {}
    for what, column, both in checks:
        values = table[column].to_numpy(float)
        known = table[np.isfinite(values)].drop_duplicates("record_sha256")[column].to_numpy(float)
        if len(known) < FEWEST_COMPARED:
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


def describe_force(table: pd.DataFrame, forces: Sequence[float]) -> str:
    """The force of the loads, of ``forces`` that were asked for: in its unit where all records have one."""
    if not forces:
        return f"{max(MULTIPLES):g} times the largest tested force"
    units = table["units_force"].dropna().unique()
    unit = f" {units[0]}" if len(units) == 1 and units[0] else ""
    return f"the largest design force, {max(forces):g}{unit}"


def list_drives(table: pd.DataFrame, forces: Sequence[float]) -> list[str]:
    """A sentence where the design forces, numbers alone, are forces of several units or accelerations of a base."""
    units = _count(table["units_force"].dropna().replace("", "no unit named"))
    if not forces or len(units) < 2:
        return []
    drives = format_joined(f"{unit} ({count(n, 'record')})" for unit, n in units.items())
    return [f"a design force is taken in the unit of each record: {drives}"]


def list_copies(table: pd.DataFrame) -> list[str]:
    """Records with byte-for-byte equal files, one sentence per group; ``table``: ``name, status, record_sha256``."""
    read = table[table["status"] != "failed"]
    alike = [list(names) for _, names in read.groupby("record_sha256", sort=False)["name"] if len(names) > 1]
    sentences = [
        f"{format_joined(shorten(names))} are byte-for-byte copies of one record, which counts "
        f"{len(names)} times in every share"
        for names in alike
    ]
    return shorten(sentences, "records with copies")


def shorten(items: list[str], of: str = "") -> list[str]:
    """The first ``MOST_COPIES``, and the number of others."""
    more = len(items) - MOST_COPIES
    return items if more <= 0 else [*items[:MOST_COPIES], f"{more} more {of}".rstrip()]


def _list_links(table: pd.DataFrame) -> list[Link]:
    return [Link(name, report) for name, report in zip(table["name"], table["report"], strict=True)]


def collect_facts(table: pd.DataFrame, good: pd.DataFrame, over: FloatArray) -> Facts:
    """The key numbers: records, the laws that lead most of them, and the overprediction of linear damping."""
    facts = [(str(len(good)), f"of {len(table)} records analysed")]
    ratios = good["damping_ratio"].dropna().to_numpy(float)
    if len(ratios):
        low, high, place = _range(ratios, len(good))
        facts.append(
            (f"{number(100 * low)} to {number(100 * high)} %", f"of critical damping at the design load, {place}")
        )
    leading = _count(good["law"])
    first = leading[leading == leading.max()]
    if len(first):
        names = format_joined(first.index) if len(first) <= MOST_TIED else f"{len(first)} laws"
        facts.append(
            (names, f"leads in {first.iloc[0]} of them" if len(first) == 1 else f"lead in {first.iloc[0]} each")
        )
    if len(over):
        low, high, place = _range(over, len(good))
        facts.append((format_signed(np.median(over)), "linear over median amplitude, median record"))
        facts.append((f"{format_signed(low)} to {format_signed(high)}", f"linear over median amplitude, {place}"))
    return Facts(facts)


def _range(values: FloatArray, records: int) -> tuple[float, float, str]:
    """The low and high end of nine values of ten, or of all if they are few, and in words which records these are.

    ``records``: how many there are, those without a value too.
    """
    few, every = len(values) < RECORDS_OF_TEN, len(values) == records
    low, high = np.quantile(values, [0.0, 1.0] if few else [0.05, 0.95])
    place = "in nine records of ten" if not few else "in all of them" if every else "where there is a prediction"
    return float(low), float(high), place


def _count(values: pd.Series) -> pd.Series:
    """Rows by value, the most frequent first, equal counts in alphabetical order."""
    return values.value_counts().sort_index().sort_values(ascending=False, kind="stable")


def _build_laws(led: pd.DataFrame) -> dict[str, Block]:
    """Figure and table of the leading laws; none if no record could be ranked."""
    if led.empty:
        return {}
    counts = _count(led["law"])
    leaders = format_joined(f"{law} {value}" for law, value in counts.head(3).items())
    svg = to_svg(leading_laws(counts), "leading-laws", "Records by leading law", f"Bars; most often: {leaders}.")
    frame = pd.DataFrame(
        {
            "law": counts.index,
            "records": counts.to_numpy(),
            "share": counts.to_numpy() / len(led),
            "mean weight there": led.groupby("law")["weight"].mean().loc[counts.index].to_numpy(),
        }
    )
    formats = {"share": format_share, "mean weight there": format_share}
    return {"leading": FigureBlock(svg), "laws": Table(frame, formats)}


def _build_lists(table: pd.DataFrame) -> dict[str, Block]:
    """Tables of outliers, failures, and explanations of gaps with their residuals, as far as there are any."""
    outliers, failures = tabulate_outliers(table), table[table["status"] != "done"]
    why = _describe_doubts(table)
    doubts = table[(why != "").to_numpy()]
    diagnosed = table[table["effects"].notna()]
    named = diagnosed["effects"].map(lambda effects: " + ".join(effects) or "no effect")
    counts, left = _count(named), diagnosed[diagnosed["unexplained"].astype(bool)]
    frames = {
        "outliers": {"record": _list_links(outliers), "law": outliers["law"], "why": outliers["why"]},
        "doubts": {"record": _list_links(doubts), "why": why[why != ""].to_numpy()},
        "failures": {"record": _list_links(failures), "status": failures["status"], "reason": failures["reason"]},
        "gaps": {"explanation": counts.index, "records": counts.to_numpy()},
        "left": {"record": _list_links(left), "explanation": named.loc[left.index]},
    }
    tables = {name: pd.DataFrame(columns) for name, columns in frames.items()}
    return {name: Table(frame) for name, frame in tables.items() if len(frame)}


def _describe_doubts(table: pd.DataFrame) -> pd.Series:
    """Why the numbers of each record are in doubt: its leading law does not fit, or its audit has findings."""
    said = [
        [text for text in (() if texts is None else texts) if any(misfit in text for misfit in MISFITS)]
        for texts in table["cautions"]
    ]
    audits = table["audit"].fillna("")
    return pd.Series(["; ".join(filter(None, [*misfit, audit])) for misfit, audit in zip(said, audits, strict=True)])


def _tabulate_records(table: pd.DataFrame) -> Table:
    ordered = table.sort_values(_OVER, ascending=False, kind="stable", na_position="last").head(MOST_LISTED)
    known = ordered["median"].notna()
    names = ("weight", "damping_ratio", "damping_ratio_low", "frequency", "median", "low", "high")
    numbers = {name: ordered[name].astype(float) for name in names}
    numbers["unit"] = ordered["units_length"].fillna("").where(known, "")
    force = ordered["design_force"].map("{:.4g}".format) + " " + ordered["units_force"].fillna("")
    columns = {"record": _list_links(ordered), "status": ordered["status"], "law": ordered["law"], **numbers}
    columns |= {"linear over": ordered[_OVER].astype(float), "at force": force.where(known, "")}
    ratio = format_percent_ratio
    formats = {"weight": format_share, "linear over": format_signed, "damping_ratio": ratio, "damping_ratio_low": ratio}
    return Table(pd.DataFrame(columns), formats, {"damping_ratio_low": "low end", "frequency": "frequency (Hz)"})
