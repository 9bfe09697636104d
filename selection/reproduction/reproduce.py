"""All printed results beside their recomputation."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from typing import Literal

from selection.records.report_tables import load_printed_results
from selection.reproduction import chapter_2, chapter_3, chapter_4, chapter_5

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
