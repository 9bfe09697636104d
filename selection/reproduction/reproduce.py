"""All printed results beside their recomputation."""

from __future__ import annotations

from dataclasses import dataclass

from selection.records.report_tables import load_printed_results
from selection.reproduction import chapter_2, chapter_3, chapter_4, chapter_5


@dataclass(frozen=True)
class Reproduction:
    """One printed result of the report.

    ``printed``: text as printed. ``computed``: from the printed inputs (or the inputs that ``recipe`` names).
    ``computed_after_correction``: with the cells of ``corrections.csv`` corrected, chapter V with the inputs that its
    own computation used; ``None`` where that changes nothing. ``erratum``: id in ``errata.csv``, or empty.
    """

    id: str
    where: str
    printed: str
    computed: float | None
    computed_after_correction: float | None
    erratum: str
    recipe: str


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
        )
        for row in load_printed_results().to_dict("records")
    ]
