"""The figure of design loads with a slider: the force moves, and the band with it, from predictions made beforehand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from selection.report.page import Block, FigureBlock
from selection.report.results import RecordResult
from selection.report.sections.common import Svgs, file_stem
from selection.report.tables import loads_table
from selection.report.words import NOTHING, between, force_text, number, quantity, signed

_DRAWN = ("force", "median", "low", "high", "credible_low", "credible_high", "linear")


@dataclass(frozen=True)
class Shown:
    """A value that follows the slider: ``name`` in ``texts``, what it is, and its text at the start."""

    name: str
    what: str
    text: str


@dataclass(frozen=True)
class Explorer(FigureBlock):
    """A figure of design loads and the predictions behind it.

    Attributes:
        name: an id on the page. data: numbers to draw and ``texts`` to show, lists over forces in ascending order; null
            and a dash where no prediction is given. start: position of the slider. jumps: positions of the design
            forces with their text. shown: what stands beside the slider.
    """

    kind: ClassVar[str] = "explorer"
    name: str
    data: dict[str, Any]
    start: int
    jumps: tuple[tuple[int, str], ...]
    shown: tuple[Shown, ...]

    @property
    def last(self) -> int:
        """The last position of the slider."""
        return len(self.data["force"]) - 1


def bands_figure(result: RecordResult, svgs: Svgs, caption: str) -> list[Block]:
    """The figure of a record's design loads with its slider; nothing where there is no such figure."""
    stem = file_stem(result, "design_loads")
    if stem not in svgs or result.bands is None or result.design is None:
        return []
    table = pd.concat([loads_table(result.bands), loads_table(result.design)], ignore_index=True)
    # a design force keeps the numbers of the table of design loads, whatever the grid says there
    table = table.drop_duplicates("force", keep="last").sort_values("force", ignore_index=True)
    force, unit = table["force"].to_numpy(float), result.mode.units.force
    positions = [int(np.flatnonzero(force == f)[0]) for f in result.design.force]
    texts = _texts(table, unit, result.mode.units.length)
    start = max(positions)
    level = f"{100 * result.bands.level:g} %"
    shown = tuple(Shown(name, what.format(level=level), texts[name][start]) for name, what in _WHAT.items())
    return [
        Explorer(
            svgs[stem],
            caption,
            name=stem,
            data={**{name: _numbers(table[name]) for name in _DRAWN}, "texts": texts},
            start=start,
            jumps=tuple((i, force_text(force[i], unit)) for i in sorted(set(positions))),
            shown=shown,
        )
    ]


_WHAT = {
    "force": "design force",
    "ratio": "times the largest tested force",
    "median": "expected (median)",
    "predictive": "{level} predictive: the next test",
    "credible": "{level} credible: the law's own",
    "linear": "linear prediction",
    "over": "linear over median, and its {level} interval",
}


def _texts(table: pd.DataFrame, force_unit: str, length_unit: str) -> dict[str, list[str]]:
    """What the page says at each force, written as in the tables."""
    rows = table.to_dict("records")
    return {
        "force": [quantity(row["force"], force_unit, 4) for row in rows],
        "ratio": [number(row["extrapolation_ratio"]) for row in rows],
        "median": [_given(row, quantity(row["median"], length_unit)) for row in rows],
        "predictive": [_given(row, between(row["low"], row["high"], length_unit)) for row in rows],
        "credible": [_given(row, between(row["credible_low"], row["credible_high"], length_unit)) for row in rows],
        "linear": [quantity(row["linear"], length_unit) for row in rows],
        "over": [
            _given(
                row,
                f"{signed(row['overprediction'])} "
                f"({signed(row['overprediction_low'])} to {signed(row['overprediction_high'])})",
            )
            for row in rows
        ],
    }


def _given(row: dict[Any, Any], text: str) -> str:
    return text if np.isfinite(row["median"]) else NOTHING


def _numbers(column: pd.Series) -> list[float | None]:
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in column]
