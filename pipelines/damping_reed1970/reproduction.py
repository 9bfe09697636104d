"""Every printed result beside its recomputation: how far apart, which differences are known errata, and the page."""

import re
from collections.abc import Hashable, Mapping
from decimal import Decimal
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots import ALERT, AVERAGE, MUTED, build_panel, draw_plain_rows, styled
from damping.report import number
from damping.report.page import Block, Section, Table, join_lines, write_blocks
from damping_reed1970 import (
    CLOSE,
    KNOWN,
    LABELS,
    ReportPart,
    chapter_2,
    chapter_3,
    chapter_4,
    chapter_5,
    chapter_of,
    describe_in_symbols,
    draw_block,
    load_text,
)

Agreement = Literal["printed digits", "last digit", "0.5 per cent", "2 per cent", "no"]


def agreement(printed: str, computed: float) -> Agreement:
    """The first that holds: within half a unit or one unit of the last printed digit, 0.5 or 2 per cent, none."""
    value, unit = float(printed), 10.0 ** int(Decimal(printed).as_tuple().exponent)
    difference, rounding = abs(computed - value), 1e-9 * unit
    bands: dict[Agreement, float] = {
        "printed digits": 0.5 * unit + rounding,
        "last digit": unit + rounding,
        "0.5 per cent": 0.005 * abs(value),
        "2 per cent": 0.02 * abs(value),
    }
    return next((name for name, width in bands.items() if difference <= width), "no")


def reproduce() -> pd.DataFrame:
    """Every result of ``printed_results.csv``, in its order, beside its recomputation.

    ``printed``: text as printed. ``computed``: from the printed inputs (or the inputs that ``recipe`` names).
    ``computed_after_correction``: with the cells of ``corrections.csv`` corrected, chapter V with the inputs that its
    own computation used; NaN where that changes nothing. ``erratum``: id in ``errata.csv``, or empty. ``reason``: why a
    result without an erratum agrees to no better than 2 per cent, else empty. ``agreement``: of ``computed``.
    """
    computed = {**chapter_2.table_2_ii(), **chapter_3.computed(), **chapter_4.computed(), **chapter_5.computed()}
    corrected = {**chapter_3.after_correction(), **chapter_4.after_correction(), **chapter_5.after_correction()}
    changed = {key: value for key, value in corrected.items() if value != computed.get(key)}
    table = load_text("printed_results")
    values, after = table["id"].map(computed), table["id"].map(changed)
    agreements = [
        agreement(printed, value) if np.isfinite(value) else None
        for printed, value in zip(table["printed"], values, strict=True)
    ]
    table = table.assign(
        computed=values, computed_after_correction=after, agreement=pd.Series(agreements, index=table.index)
    )
    columns = ["id", "where", "printed", "computed", "computed_after_correction", "erratum", "recipe", "reason"]
    return table[[*columns, "agreement"]]


def reproduction_part(rows: pd.DataFrame) -> ReportPart:
    """Every printed number: counts by chapter and agreement, the picture, and all rows."""
    known, close = KNOWN["reproduction"], rows["agreement"].isin(CLOSE)
    explained = (rows["erratum"] != "") & ~close
    drawn = tabulate_percent_differences(rows)
    far = drawn["percent"].abs() > 1.0
    values = {
        "numbers": len(rows),
        "close": int(close.sum()),
        "explained": int(explained.sum()),
        "reasons": int((~close & ~explained).sum()),
        "silent": int((~(close | explained) & (rows["reason"] == "")).sum()),
        "drawn": len(drawn),
        "groups": drawn["group"].nunique(),
        "near": int((~far).sum()),
        "known": int((far & drawn["erratum"].astype(str).ne("")).sum()),
    }

    def take(kind: str, name: str, rest: str) -> list[Block]:
        if kind == "figure":
            title, description, caption = rest.split("\n", 2)
            return [draw_block(name, title, description, lambda: draw_reproduction(rows), join_lines(caption))]
        if kind == "counts":
            return [Table(count_agreements(rows), caption=rest)]
        return [Table(rows[known["columns"]], caption=known["text"], key="reproduction")]

    blocks = write_blocks(Path(__file__).with_suffix(".txt"), values | {"title": known["title"]}, take)
    return ReportPart(Section("reproduction", "Every printed number recomputed", blocks))


def count_agreements(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of the reproduction by chapter and agreement, with the number that carry an erratum; a last row for all."""
    chapter, roman = rows["id"].map(chapter_of), LABELS["roman"]
    table = pd.crosstab(chapter, rows["agreement"]).reindex(columns=list(LABELS["agreements"]), fill_value=0)
    table.insert(0, "printed numbers", table.sum(axis=1))
    table["with erratum"] = (rows["erratum"] != "").groupby(chapter).sum()
    table.loc["all"] = table.sum()
    table.index = pd.Index([f"chapter {roman[str(n)]}" if str(n) in roman else str(n) for n in table.index])
    return table.rename_axis("chapter").reset_index().rename_axis(columns=None)


#: Differences below this many per cent are drawn on a linear scale.
_LINEAR = 1.0


@styled
def draw_reproduction(table: pd.DataFrame) -> Figure:
    """Draw 100 (computed/printed - 1) of the reproduction by group of ids (:func:`tabulate_percent_differences`)."""
    rows = tabulate_percent_differences(table)
    groups = list(rows["group"].unique())
    figure, axes = build_panel(1.1 + 0.2 * len(groups))
    counts = rows["group"].value_counts()
    draw_plain_rows(axes, [f"{group} ({counts[group]})" for group in groups])
    axes.axvline(0.0, color=MUTED, linewidth=0.8)
    level = rows["group"].map(groups.index).to_numpy(float) + _spread(rows)
    known = rows["erratum"].astype(str).ne("").to_numpy()
    marks = ((~known, AVERAGE, "o", "no erratum"), (known, ALERT, "X", "erratum known"))
    for chosen, colour, marker, label in marks:
        axes.plot(rows["percent"][chosen], level[chosen], marker, color=colour, markersize=4, alpha=0.75, label=label)
    corrected: dict[str, Any] = {"color": "white", "markeredgecolor": ALERT, "label": "after correction"}
    axes.plot(rows["percent_corrected"], level, "D", markersize=3.5, **corrected)
    axes.set_xscale("symlog", linthresh=_LINEAR)
    axes.xaxis.set_major_formatter(lambda value, position: f"{value:g}")
    axes.set_xlabel("computed against printed (%),\nlinear within ±1 %, logarithmic beyond")
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def tabulate_percent_differences(table: pd.DataFrame) -> pd.DataFrame:
    """Rows whose printed value is a number but zero, with ``group``, ``percent`` = 100 (computed/printed - 1) and
    ``percent_corrected``."""
    printed = pd.to_numeric(table["printed"], errors="coerce")
    rows = table.assign(
        group=table["id"].map(describe_group_of),
        percent=100.0 * (pd.to_numeric(table["computed"], errors="coerce") / printed - 1.0),
        percent_corrected=100.0 * (pd.to_numeric(table["computed_after_correction"], errors="coerce") / printed - 1.0),
    )
    return pd.DataFrame(rows[np.isfinite(rows["percent"]) & (printed != 0.0)].reset_index(drop=True))


def describe_group_of(identity: str) -> str:
    """Group of an id: ``tab2II`` of ``tab2II.energy_factor[I]``."""
    return re.split(r"[.\[]", identity, maxsplit=1)[0]


def _spread(rows: pd.DataFrame) -> FloatArray:
    """Small vertical steps, so that rows of one group do not hide one another."""
    number = rows.groupby("group").cumcount().to_numpy(float)
    return np.asarray(0.28 * np.sin(2.399963 * number))  # the golden angle: neighbours land apart


MOST_NUMBERS = 3  #: numbers shown beside an erratum


def errata_part(table: pd.DataFrame, reproduction: pd.DataFrame) -> ReportPart:
    """The errata by severity, each with its proof and the numbers that it changes."""
    numbers, kinds = evidence(reproduction), table["kind"].value_counts()
    values = {
        "entries": len(table),
        "sizes": table["severity"].value_counts().to_dict(),
        "kinds": [f"{n} {LABELS['kinds'].get(str(kind), kind)}" for kind, n in kinds.items()],
        "severities": LABELS["severities"],
    }

    def take(kind: str, name: str, caption: str) -> list[Block]:
        rows = table[table["severity"] == name].to_dict("records")
        shown = pd.DataFrame([describe_erratum(row, numbers.get(row["id"], "")) for row in rows])
        return [Table(shown, caption=caption, key="errata")]

    return ReportPart(
        Section("errata", "Errata of the report", write_blocks(Path(__file__).with_name("errata.txt"), values, take))
    )


def describe_erratum(erratum: Mapping[Hashable, Any], numbers: str) -> dict[str, str]:
    """An erratum in two cells: where and what, and why, with the numbers recomputed here."""
    where, printed, right, proof = (
        describe_in_symbols(str(erratum[name])) for name in ("where", "as_printed", "should_be", "proof")
    )
    reason = proof[:1].upper() + proof[1:].rstrip(".") + "."
    return {
        "erratum": f"{erratum['id']}, {where}. Printed: {printed}. Right: {right}.",
        "proof": f"{reason} Recomputed here: {numbers}." if numbers else reason,
    }


def evidence(rows: pd.DataFrame) -> dict[str, str]:
    """By erratum: the numbers it changes, printed, computed and computed after correction."""
    changes: dict[str, list[str]] = {}
    for row in rows[rows["erratum"] != ""].to_dict("records"):
        computed = [row[name] for name in ("computed", "computed_after_correction") if pd.notna(row[name])]
        steps = [row["printed"], *(number(value, 4) for value in computed)]
        for identity in str(row["erratum"]).split(", "):
            changes.setdefault(identity, []).append(f"{row['id']}: {' → '.join(steps)}")
    for texts in changes.values():
        if len(texts) > MOST_NUMBERS:
            texts[MOST_NUMBERS:] = [f"and {len(texts) - MOST_NUMBERS} more"]
    return {identity: "; ".join(texts) for identity, texts in changes.items()}
