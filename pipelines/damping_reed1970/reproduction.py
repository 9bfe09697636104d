"""Every printed result beside its recomputation: how far apart, which differences are known errata, and the page."""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Any, Literal

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from damping.arrays import FloatArray
from damping.plots.style import ALERT, AVERAGE, MUTED, WIDTH, draw_plain_rows, styled
from damping.report.figures import Drawn
from damping.report.page import Block, Fold, Section, Table, Text
from damping_reed1970 import chapter_2, chapter_3, chapter_4, chapter_5
from damping_reed1970.common import AGREEMENTS, CLOSE, KNOWN, ReportPart, chapter_of, draw_block
from damping_reed1970.tables import load_printed_results

Agreement = Literal["printed digits", "last digit", "0.5 per cent", "2 per cent", "no"]


@dataclass(frozen=True)
class Reproduction:
    """One printed result of the report.

    ``printed``: text as printed. ``computed``: from the printed inputs (or the inputs that ``recipe`` names).
    ``computed_after_correction``: with the cells of ``corrections.csv`` corrected, chapter V with the inputs that its
    own computation used; ``None`` where that changes nothing. ``erratum``: id in ``errata.csv``, or empty.
    ``reason``: why a result without an erratum agrees to no better than 2 per cent, else empty.
    """

    id: str
    where: str
    printed: str
    computed: float | None
    computed_after_correction: float | None
    erratum: str
    recipe: str
    reason: str

    @property
    def agreement(self) -> Agreement | None:
        """How well the printed inputs give the printed value; ``None`` if nothing was computed."""
        return None if self.computed is None else agreement(self.printed, self.computed)


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


def reproduce() -> list[Reproduction]:
    """Every result of ``printed_results.csv``, in its order."""
    computed = {**chapter_2.table_2_ii(), **chapter_3.computed(), **chapter_4.computed(), **chapter_5.computed()}
    corrected = {**chapter_3.after_correction(), **chapter_4.after_correction(), **chapter_5.after_correction()}
    changed = {key: value for key, value in corrected.items() if value != computed.get(key)}
    return [
        Reproduction(
            id=row["id"],
            where=row["where"],
            printed=row["printed"],
            computed=computed.get(row["id"]),
            computed_after_correction=changed.get(row["id"]),
            erratum=row["erratum"],
            recipe=row["recipe"],
            reason=row["reason"],
        )
        for row in load_printed_results().to_dict("records")
    ]


def reproduction_part(rows: pd.DataFrame) -> ReportPart:
    """Every printed number: counts by chapter and agreement, the picture, and all rows."""
    known = KNOWN["reproduction"]
    close = rows["agreement"].isin(CLOSE)
    told = (rows["erratum"] != "") & ~close
    silent = int((~(close | told) & (rows["reason"] == "")).sum())
    blocks: list[Block] = [
        Text(
            f"{len(rows)} numbers that the report prints as results were recomputed by its own recipes from its own "
            f"tables. {int(close.sum())} agree to the print or within half a per cent; {int(told.sum())} of the others "
            f"carry an erratum, and {int((~close & ~told).sum())} give a reason, mostly the rounding of the numbers "
            f"they were made from. {silent or 'None'} of them {'are' if silent > 1 else 'is'} off without a reason."
        ),
        Table(count_agreements(rows), "Printed numbers by chapter and how well they come out.", key=""),
        draw_block(
            "reproduction",
            Drawn(draw_reproduction(rows), "Printed results recomputed", _describe(rows)),
            "Per cent difference between each printed number and its recomputation, by group of ids (count).",
        ),
        Fold(
            f"{known.title}: all {len(rows)} rows",
            [Table(rows[list(known.columns)], known.said, key="reproduction")],
        ),
    ]
    return ReportPart(Section("reproduction", "Every printed number recomputed", blocks))


def _describe(table: pd.DataFrame) -> str:
    """The figure in words."""
    rows = tabulate_percent_differences(table)
    close = int((rows["percent"].abs() <= 1.0).sum())
    known = int(((rows["percent"].abs() > 1.0) & rows["erratum"].astype(str).ne("")).sum())
    return (
        f"{len(rows)} printed numbers in {rows['group'].nunique()} groups against their recomputation: {close} agree "
        f"within 1 per cent, {known} of the others are known errata."
    )


def count_agreements(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of the reproduction by chapter and agreement, with the number that carry an erratum; a last row for all."""
    chapter = rows["id"].map(chapter_of)
    table = pd.crosstab(chapter, rows["agreement"]).reindex(columns=list(AGREEMENTS), fill_value=0)
    table.insert(0, "printed numbers", table.sum(axis=1))
    table["with erratum"] = (rows["erratum"] != "").groupby(chapter).sum()
    table.loc["all"] = table.sum()
    table.index = pd.Index([f"chapter {_ROMAN[n]}" if n in _ROMAN else str(n) for n in table.index])
    return table.rename_axis("chapter").reset_index().rename_axis(columns=None)


_ROMAN = {2: "II", 3: "III", 4: "IV", 5: "V"}


#: Differences below this many per cent are drawn on a linear scale.
_LINEAR = 1.0


@styled
def draw_reproduction(table: pd.DataFrame) -> Figure:
    """Draw 100 (computed/printed - 1) by group of ids.

    Args:
        table: ``id, printed`` (text), ``computed, computed_after_correction`` (numbers or missing), ``erratum``
            (empty where there is none). Rows whose printed value is no number other than zero are not drawn.
    """
    rows = tabulate_percent_differences(table)
    groups = list(rows["group"].unique())
    figure = Figure(figsize=(WIDTH, 1.1 + 0.2 * len(groups)))
    axes = figure.add_subplot()
    counts = rows["group"].value_counts()
    draw_plain_rows(axes, [f"{group} ({counts[group]})" for group in groups])
    axes.axvline(0.0, color=MUTED, linewidth=0.8)
    level = rows["group"].map(groups.index).to_numpy(float) + _spread(rows)
    known = rows["erratum"].astype(str).ne("").to_numpy()
    for chosen, colour, marker, label in (
        (~known, AVERAGE, "o", "no erratum"),
        (known, ALERT, "X", "erratum known"),
    ):
        axes.plot(rows["percent"][chosen], level[chosen], marker, color=colour, markersize=4, alpha=0.75, label=label)
    corrected: dict[str, Any] = {
        "color": "white",
        "markeredgecolor": ALERT,
        "markersize": 3.5,
        "label": "after correction",
    }
    axes.plot(rows["percent_corrected"], level, "D", **corrected)
    axes.set_xscale("symlog", linthresh=_LINEAR)
    axes.xaxis.set_major_formatter(lambda value, position: f"{value:g}")
    axes.set_xlabel("computed against printed (%), linear within ±1 %, logarithmic beyond")
    figure.legend(loc="outside upper left", ncols=3)
    return figure


def tabulate_percent_differences(table: pd.DataFrame) -> pd.DataFrame:
    """Comparable rows with ``group``, ``percent`` and ``percent_corrected`` = 100 (computed/printed - 1)."""
    printed = pd.to_numeric(table["printed"], errors="coerce")
    rows = table.assign(
        group=table["id"].map(describe_group_of),
        percent=100.0 * (pd.to_numeric(table["computed"], errors="coerce") / printed - 1.0),
        percent_corrected=100.0 * (pd.to_numeric(table["computed_after_correction"], errors="coerce") / printed - 1.0),
    )
    return rows[np.isfinite(rows["percent"]) & (printed != 0.0)].reset_index(drop=True)


def describe_group_of(identity: str) -> str:
    """Group of an id: ``tab2II`` of ``tab2II.energy_factor[I]``."""
    return re.split(r"[.\[]", identity, maxsplit=1)[0]


def _spread(rows: pd.DataFrame) -> FloatArray:
    """Small vertical steps, so that rows of one group do not hide one another."""
    number = rows.groupby("group").cumcount().to_numpy(float)
    return 0.28 * np.sin(2.399963 * number)  # the golden angle: neighbours land apart
