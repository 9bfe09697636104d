"""Design loads on the page: a table by parts, what to test next, and the figure with its slider.

The force moves, and the band with it, from predictions made beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import PARTS, Loads
from damping.report import (
    NOTHING,
    choose_length,
    format_between,
    format_force_text,
    format_gravity,
    format_joined,
    format_length,
    format_length_band,
    format_percent,
    format_quantity,
    format_signed,
    number,
)
from damping.report.page import Block, FigureBlock, Format, Heading, Row, Table, Text
from damping.report.results import RecordResult, StudyResult, Svgs, describe_file_stem, name_record
from damping.report.tables import tabulate_loads


def format_percent_ratio(ratio: float) -> str:
    """A damping ratio in per cent: ``0.287 %``."""
    return f"{number(100.0 * ratio)} %" if np.isfinite(ratio) else NOTHING


def build_loads(study: StudyResult, svgs: Svgs) -> list[Block]:
    """The screen of the prediction by parts and of what to test next; nothing where no design load is asked for."""
    asked = [result for result in study.records if result.design is not None]
    if not asked:
        return []
    blocks: list[Block] = [
        Text("Amplitude at resonance under each design force; linear scales the largest tested level in proportion.")
    ]
    for result in asked:
        assert result.design is not None  # chosen so above
        heading = [Heading(result.title)] if len(study.records) > 1 else []
        tables = _tabulate_design(result, result.design), _tabulate_parts(result, result.design)
        blocks += [*heading, *_describe_refusals(result.design), *tables]
        further = result.next_level
        if further is not None:
            unit = result.mode.units.force
            blocks.append(
                Text(
                    f"To test next: one more level at {format_quantity(further.force, unit)}. It would shrink the band "
                    f"at {format_force_text(further.design, unit)} from a factor of {further.width:.2f} between its "
                    f"ends to {further.expected:.2f}."
                )
            )
    drawn = [
        block for number, result in enumerate(asked) for block in build_loads_figure(result, study, svgs, number == 0)
    ]
    return [*blocks, Row(drawn)] if drawn else blocks


def _describe_refusals(design: Loads) -> list[Block]:
    """Why no prediction is given, where none is."""
    if np.isfinite(design.average.median).any():
        return []
    why = format_joined(dict.fromkeys(caution[0] for caution in design.cautions if caution))
    return [Text(f"No amplitude is predicted: {why}.")]


def _tabulate_design(result: RecordResult, design: Loads) -> Table:
    units, curve = result.mode.units, result.design_curve
    table = pd.DataFrame(
        {
            "force": [format_force_text(force, units.force) for force in design.force],
            "times tested": design.ratio,
            "median": [format_length(value, units.length) for value in design.average.median],
            "band": [
                format_length_band(a, b, units.length)
                for a, b in zip(design.average.low, design.average.high, strict=True)
            ],
            "linear": [
                f"{format_length(value, units.length)} ({format_signed(over)})"
                for value, over in zip(design.linear, design.overprediction, strict=True)
            ],
        }
    )
    if curve is not None:
        ratio = curve.damping_ratio
        table["damping ratio"] = [format_percent_ratio(value) for value in ratio.median]
        table["low end"] = [format_percent_ratio(value) for value in ratio.low]
        f = curve.frequency.median
        table["frequency"] = [format_quantity(value, "Hz", 4) for value in f]
        gravities = [format_gravity(a, b, units.length) for a, b in zip(design.average.median, f, strict=True)]
        if any(text != NOTHING for text in gravities):
            table.insert(3, "peak acceleration", gravities)
    headings = {"band": f"{100 * design.level:g} % band"}
    caption = "Amplitude and damping at the design forces; the low end of the damping ratio is the one to size with."
    key = describe_file_stem(result, "design_loads")
    return Table(table, caption, {"times tested": number}, headings, key=key)


def _tabulate_parts(result: RecordResult, design: Loads) -> Table:
    """What the band is made of."""
    force = [format_force_text(force, result.mode.units.force) for force in design.force]
    table = pd.DataFrame({"force": force, **{part: design.parts[part] for part in PARTS}})
    headings = {"between_model": "which law, %", "parameters": "its coefficients, %", "measurement_noise": "noise, %"}
    headings |= {"discrepancy": "the law changing beyond the test, %"}
    formats: dict[str, Format] = dict.fromkeys(PARTS, format_percent)
    caption = "What the band is made of: standard deviations in per cent of amplitude, whose squares add."
    return Table(table, caption, formats, headings)


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

    name: str
    data: dict[str, Any]
    start: int
    jumps: tuple[tuple[int, str], ...]
    shown: tuple[Shown, ...]

    @property
    def last(self) -> int:
        """The last position of the slider."""
        return len(self.data["force"]) - 1


def build_loads_figure(result: RecordResult, study: StudyResult, svgs: Svgs, slider: bool) -> list[Block]:
    """The figure of a record's design loads, with its slider where asked; nothing where there is no such figure."""
    stem = describe_file_stem(result, "design_loads")
    if stem not in svgs or result.bands is None or result.design is None:
        return []
    caption = (
        f"{name_record(result, study, '.')}Resonant amplitude against force, n = {len(result.data.A)} points: the "
        f"{100 * result.bands.level:g} % band holds what the next test would read."
    )
    if not slider:
        return [FigureBlock(svgs[stem], caption)]
    table = pd.concat([tabulate_loads(result.bands), tabulate_loads(result.design)], ignore_index=True)
    # a design force keeps the numbers of the table of design loads, whatever the grid says there
    table = table.drop_duplicates("force", keep="last").sort_values("force", ignore_index=True)
    factor, length = choose_length(result.mode.units.length, table["median"].max())
    table[list(_DRAWN[1:])] *= factor
    force, unit = table["force"].to_numpy(float), result.mode.units.force
    positions = [int(np.flatnonzero(force == f)[0]) for f in result.design.force]
    texts = _write_texts(table, unit, length)
    start = max(positions)
    level = f"{100 * result.bands.level:g} %"
    shown = tuple(Shown(name, what.format(level=level), texts[name][start]) for name, what in _WHAT.items())
    return [
        Explorer(
            svgs[stem],
            caption,
            name=stem,
            data={**{name: _round_numbers(table[name]) for name in _DRAWN}, "texts": texts},
            start=start,
            jumps=tuple((i, format_force_text(force[i], unit)) for i in sorted(set(positions))),
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


def _write_texts(table: pd.DataFrame, force_unit: str, length_unit: str) -> dict[str, list[str]]:
    """What the page says at each force, written as in the tables."""
    rows = table.to_dict("records")
    return {
        "force": [format_quantity(row["force"], force_unit, 4) for row in rows],
        "ratio": [number(row["extrapolation_ratio"]) for row in rows],
        "median": [_describe_given(row, format_quantity(row["median"], length_unit)) for row in rows],
        "predictive": [_describe_given(row, format_between(row["low"], row["high"], length_unit)) for row in rows],
        "credible": [
            _describe_given(row, format_between(row["credible_low"], row["credible_high"], length_unit)) for row in rows
        ],
        "linear": [format_quantity(row["linear"], length_unit) for row in rows],
        "over": [
            _describe_given(
                row,
                f"{format_signed(row['overprediction'])} "
                f"({format_signed(row['overprediction_low'])} to {format_signed(row['overprediction_high'])})",
            )
            for row in rows
        ],
    }


def _describe_given(row: dict[Any, Any], text: str) -> str:
    return text if np.isfinite(row["median"]) else NOTHING


def _round_numbers(column: pd.Series) -> list[float | None]:
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in column]
