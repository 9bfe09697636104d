"""Every erratum of the report with its proof and the numbers that it changes."""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping
from typing import Any

import pandas as pd

from damping.report.page import Block, Fold, Heading, Section, Table, Text
from damping.report.words import count, format_joined, number
from damping_reed1970.common import ReportPart

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


def errata_part(table: pd.DataFrame, reproduction: pd.DataFrame) -> ReportPart:
    """The errata by severity, each with its proof and the numbers that it changes."""
    numbers = evidence(reproduction)
    sizes = table["severity"].value_counts()
    said = format_joined(f"{sizes.get(key, 0)} {words}" for key, words in
                  (("A", "change results"), ("B", "change numbers but no conclusion"), ("C", "are minor")))  # fmt: skip
    kinds = table["kind"].value_counts()
    blocks: list[Block] = [
        Text(
            f"{count(len(table), 'entry').replace('entrys', 'entries')}: {said}. By kind: "
            + format_joined(f"{n} {KINDS.get(str(kind), str(kind))}" for kind, n in kinds.items())
            + ". Each comes with its proof, which needs nothing but the report's own text and tables, and with the "
            "numbers recomputed here: printed → from the printed tables → after correction."
        )
    ]
    for key, title in SEVERITIES.items():
        rows = table[table["severity"] == key]
        shown = pd.DataFrame([shown_row(row, numbers.get(row["id"], "")) for row in rows.to_dict("records")])
        one = Table(shown, f"{title}, with proofs.", key="errata")
        blocks += [Heading(title), one] if key == "A" else [Fold(f"{title}: {len(rows)}", [one])]
    return ReportPart(Section("errata", "Errata of the report", blocks))


def shown_row(erratum: Mapping[Hashable, Any], numbers: str) -> dict[str, str]:
    """An erratum in two cells: where and what, and why, with the numbers recomputed here."""
    where, printed, right, proof = (
        describe_in_symbols(str(erratum[name])) for name in ("where", "as_printed", "should_be", "proof")
    )
    said = proof[:1].upper() + proof[1:].rstrip(".") + "."
    return {
        "erratum": f"{erratum['id']}, {where}. Printed: {printed}. Right: {right}.",
        "proof": f"{said} Recomputed here: {numbers}." if numbers else said,
    }


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


_SUPERSCRIPT = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
#: What stands in the data, as a pattern, and what the report writes.
SYMBOLS = {
    r"->": "→",
    r"\+-": "±",
    r"(?<=[\w)\]])( ?)\*( ?)(?=[\w(.])": r"\1·\2",
    r"\b(?:Gamma)\b": "Γ",
    r"(?<![A-Za-z])pi(?![A-Za-z])": "π",
    r"(?<![A-Za-z])xi(?![A-Za-z])": "ξ",
    r"(?<![A-Za-z])phi(?![A-Za-z])": "φ",
    r"(?<![A-Za-z])eta(?![A-Za-z])": "η",
    r"(?<![A-Za-z])omega(?![A-Za-z])": "ω",
    r"(?<![A-Za-z])(?:w)(?![A-Za-z])": "ω",
    r"\bwt\b": "ωt",
    r"(?<![A-Za-z])psi(?![A-Za-z])": "ψ",
    r"(?<![A-Za-z])int(?=[ _])": "∫",
    r"\bLambda(?=_)": "Λ",
    r"\balpha\b": "α",
    r"\bbeta\b": "β",
    r"\bdelta\b": "δ",
    r"\bdW\b": "ΔW",
    r"\bQd\b": "Q̇",
    r"(?<=\d)pi": "π",
    r"\bOLS\b": "least squares",
    r"\bdof\b": "degree of freedom",
    r"\bs\.e\.": "standard error",
    r"\bsqrt\b": "√",
}


def describe_in_symbols(text: str) -> str:
    """``2*pi*xi_1*w_n`` as 2·π·ξ_1·ω_n."""
    text = re.sub(r"\^(\d)(?![\d.])", lambda found: found[1].translate(_SUPERSCRIPT), text)
    for pattern, symbol in SYMBOLS.items():
        text = re.sub(pattern, symbol, text)
    return text
