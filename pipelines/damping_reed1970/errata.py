"""Every printed number and every erratum in the report: how well each comes out, and why some do not."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import pandas as pd

from damping.report.page import Block, Fold, Heading, Part, Section, Table, Text
from damping.report.results import ChapterResults, Svgs, figure
from damping.report.words import count, joined, number
from damping_reed1970.common import AGREEMENTS, chapter_of, in_symbols
from damping_reed1970.source import KNOWN

SEVERITIES = {"A": "Errata that change results", "B": "Errata that change numbers", "C": "Minor errata"}
#: Kinds as the reader sees them; the scan of the report has misreadings of its own.
KINDS = {
    "derivation error": "of derivation",
    "rounding": "of rounding or reading a plot",
    "misprint": "of print",
    "ocr": "of the scan",
    "ocr_or_misprint": "of print or scan",
    "unsupported claim": "claims without support",
}
#: Numbers shown beside an erratum.
MOST_NUMBERS = 3


def reproduction(results: ChapterResults, svgs: Svgs) -> Part:
    """Every printed number: counts by chapter and agreement, the picture, and all rows."""
    rows = results.tables["reproduction"]
    known = KNOWN["reproduction"]
    close = rows["agreement"].isin(["printed digits", "last digit", "0.5 per cent"])
    told = (rows["erratum"] != "") & ~close
    silent = int((~(close | told) & (rows["reason"] == "")).sum())
    blocks: list[Block] = [
        Text(
            f"{len(rows)} numbers that the report prints as results were recomputed by its own recipes from its own "
            f"tables. {int(close.sum())} agree to the print or within half a per cent; {int(told.sum())} of the others "
            f"carry an erratum, and {int((~close & ~told).sum())} give a reason, mostly the rounding of the numbers "
            f"they were made from. {silent or 'None'} of them {'are' if silent > 1 else 'is'} off without a reason."
        ),
        Table(counts(rows), "Printed numbers by chapter and how well they come out.", key=""),
        *figure(
            svgs,
            "reproduction",
            "Per cent difference between each printed number and its recomputation, by group of ids (count).",
        ),
        Fold(
            f"{known.title}: all {len(rows)} rows",
            [Table(rows[list(known.columns)], known.said, key="reproduction")],
        ),
    ]
    return Part(Section("reproduction", "Every printed number recomputed", blocks))


def errata(results: ChapterResults) -> Part:
    """The errata by severity, each with its proof and the numbers that it changes."""
    table = results.tables["errata"]
    numbers = evidence(results.tables["reproduction"])
    sizes = table["severity"].value_counts()
    said = joined(f"{sizes.get(key, 0)} {words}" for key, words in
                  (("A", "change results"), ("B", "change numbers but no conclusion"), ("C", "are minor")))  # fmt: skip
    kinds = table["kind"].value_counts()
    blocks: list[Block] = [
        Text(
            f"{count(len(table), 'entry').replace('entrys', 'entries')}: {said}. By kind: "
            + joined(f"{n} {KINDS.get(str(kind), str(kind))}" for kind, n in kinds.items())
            + ". Each comes with its proof, which needs nothing but the report's own text and tables, and with the "
            "numbers recomputed here: printed → from the printed tables → after correction."
        )
    ]
    for key, title in SEVERITIES.items():
        rows = table[table["severity"] == key]
        shown = pd.DataFrame([shown_row(row, numbers.get(row["id"], "")) for row in rows.to_dict("records")])
        one = Table(shown, f"{title}, with proofs.", key="errata")
        blocks += [Heading(title), one] if key == "A" else [Fold(f"{title}: {len(rows)}", [one])]
    return Part(Section("errata", "Errata of the report", blocks))


def shown_row(erratum: Mapping[Hashable, Any], numbers: str) -> dict[str, str]:
    """An erratum in two cells: where and what, and why, with the numbers recomputed here."""
    where, printed, right, proof = (
        in_symbols(str(erratum[name])) for name in ("where", "as_printed", "should_be", "proof")
    )
    said = proof[:1].upper() + proof[1:].rstrip(".") + "."
    return {
        "erratum": f"{erratum['id']}, {where}. Printed: {printed}. Right: {right}.",
        "proof": f"{said} Recomputed here: {numbers}." if numbers else said,
    }


def counts(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows of the reproduction by chapter and agreement, with the number that carry an erratum; a last row for all."""
    chapter = rows["id"].map(chapter_of)
    table = pd.crosstab(chapter, rows["agreement"]).reindex(columns=list(AGREEMENTS), fill_value=0)
    table.insert(0, "printed numbers", table.sum(axis=1))
    table["with erratum"] = (rows["erratum"] != "").groupby(chapter).sum()
    table.loc["all"] = table.sum()
    table.index = pd.Index([f"chapter {_ROMAN[n]}" if n in _ROMAN else str(n) for n in table.index])
    return table.rename_axis("chapter").reset_index().rename_axis(columns=None)


_ROMAN = {2: "II", 3: "III", 4: "IV", 5: "V"}


def evidence(rows: pd.DataFrame) -> dict[str, str]:
    """By erratum: the numbers it changes, printed, computed and computed after correction."""
    found: dict[str, list[str]] = {}
    for one in rows[rows["erratum"] != ""].to_dict("records"):
        steps = [
            one["printed"],
            *(number(one[name], 4) for name in ("computed", "computed_after_correction") if pd.notna(one[name])),
        ]
        for identity in str(one["erratum"]).split(", "):
            found.setdefault(identity, []).append(f"{one['id']}: {' → '.join(steps)}")
    return {identity: "; ".join(_some(texts)) for identity, texts in found.items()}


def _some(texts: list[str]) -> Iterable[str]:
    return texts if len(texts) <= MOST_NUMBERS else [*texts[:MOST_NUMBERS], f"and {len(texts) - MOST_NUMBERS} more"]
