"""The figure of design loads with a slider: the force moves, and the band with it, from predictions made beforehand.

The answer first: which law, how sure, and the amplitude at the design load against the linear prediction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from damping.extrapolation.prediction import Loads
from damping.report.page import Block, Facts, FigureBlock, Heading, Section, Text
from damping.report.results import RecordResult, StudyResult, Svgs, describe_file_stem, weighted
from damping.report.tables import tabulate_loads
from damping.report.words import (
    NOTHING,
    count,
    format_between,
    format_force_text,
    format_joined,
    format_percent,
    format_quantity,
    format_share,
    format_signed,
    number,
)

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


def build_bands_figure(result: RecordResult, svgs: Svgs, caption: str) -> list[Block]:
    """The figure of a record's design loads with its slider; nothing where there is no such figure."""
    stem = describe_file_stem(result, "design_loads")
    if stem not in svgs or result.bands is None or result.design is None:
        return []
    table = pd.concat([tabulate_loads(result.bands), tabulate_loads(result.design)], ignore_index=True)
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


def _texts(table: pd.DataFrame, force_unit: str, length_unit: str) -> dict[str, list[str]]:
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


def _numbers(column: pd.Series) -> list[float | None]:
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in column]


#: Laws whose medians differ by less than this many per cent at the largest design force predict the same.
SAME = 1.0


def answer(study: StudyResult, svgs: Svgs) -> Section:
    """The section: one sentence for all records, then each record with its numbers."""
    blocks: list[Block] = [Text(sentence, lead=True) for sentence in _list_lead(study)]
    drawn = False
    for result in study.records:
        blocks += [Heading(result.title), Facts(_list_facts(result))]
        blocks += (
            [Text(" ".join(_list_law(result))), Text(" ".join(_list_loads(result)))]
            if result.design
            else [Text(" ".join(_list_law(result)))]
        )
        if not drawn:
            shown = build_bands_figure(result, svgs, describe_bands_caption(result))
            blocks, drawn = blocks + shown, bool(shown)
    return Section("answer", "The answer first", blocks)


def describe_bands_caption(result: RecordResult) -> str:
    """Caption of the main figure."""
    level = f"{100 * result.bands.level:g} %" if result.bands else ""
    return (
        f"{result.title}. Resonant amplitude against modal force. The {level} credible band holds the law's own "
        f"amplitude, the {level} predictive band what the next test would read; both are averaged over the models by "
        "weight and say nothing about a source of damping that no candidate has. Beyond the tested forces "
        "everything is extrapolated."
    )


def largest(loads: Loads | None) -> int | None:
    """Index of the largest design force that has a prediction."""
    if loads is None or not np.isfinite(loads.average.median).any():
        return None
    return int(np.nanargmax(np.where(np.isfinite(loads.average.median), loads.force, np.nan)))


def _list_lead(study: StudyResult) -> list[str]:
    """How far the linear prediction is off at the largest design forces."""
    said = []
    for result in study.records:
        i = largest(result.design)
        if i is None or result.design is None:
            continue
        over, unit = result.design.overprediction, result.mode.units.force
        low, high = result.design.overprediction_low[i], result.design.overprediction_high[i]
        side = "above" if over[i] > 0.0 else "below"
        span = sorted((abs(low), abs(high))) if low * high > 0.0 else [low, high]
        said.append(
            f"{format_percent(abs(over[i]))} per cent {side} the expected amplitude in "
            f"{_describe_in_sentence(result.title)} at "
            f"{format_force_text(result.design.force[i], unit)} ({format_percent(span[0])} to "
            f"{format_percent(span[1])})"
        )
    return (
        ["Extrapolated to the design load, linear viscous damping predicts " + format_joined(said) + "."]
        if said
        else []
    )


def _describe_in_sentence(title: str) -> str:
    return title.replace(", ", " ")


def _list_facts(result: RecordResult) -> list[tuple[str, str]]:
    best = weighted(result)[0]
    facts = [(best.name, f"leading law, weight {format_share(best.weight)} of 1")]
    i, design, units = largest(result.design), result.design, result.mode.units
    if i is None or design is None:
        viscous = _viscous_weight(result)
        facts.append((f"{format_percent(best.average_absolute_percent)} %", "error of its resonant amplitude, fitted"))
        facts += [(format_share(viscous), "weight of constant viscous damping alone")] if viscous is not None else []
        return facts
    force, content = format_force_text(design.force[i], units.force), f"{100 * design.level:g} %"
    band, over = design.average, design.overprediction
    low, high = design.overprediction_low[i], design.overprediction_high[i]
    return [
        *facts,
        (
            format_quantity(band.median[i], units.length),
            f"expected at {force}; {content} predictive: {format_between(band.low[i], band.high[i], units.length)}",
        ),
        (format_quantity(design.linear[i], units.length), f"linear prediction at {force}"),
        (format_signed(over[i]), f"linear against expected; {content}: {format_signed(low)} to {format_signed(high)}"),
    ]


def _list_law(result: RecordResult) -> list[str]:
    """Which law, and how sure."""
    return [*_list_leading(result), *_list_against_viscous(result), *_list_exponent(result)]


def _list_leading(result: RecordResult) -> list[str]:
    ranked = weighted(result)
    best, total = ranked[0], len(result.ranking.candidates)
    others = f"all others of {count(total, 'candidate')} together {format_share(1.0 - best.weight)}"
    if best.weight >= 0.95:
        return [f"The tests single out {best.name}: weight {format_share(best.weight)}, {others}."]
    if best.weight >= 0.5:
        second = f" Next is {ranked[1].name} with {format_share(ranked[1].weight)}." if len(ranked) > 1 else ""
        return [
            f"{_describe_capital(best.name)} is the most probable law: weight {format_share(best.weight)}, "
            f"{others}.{second}"
        ]
    cumulative = np.cumsum([candidate.weight for candidate in ranked])
    needed = int(np.searchsorted(cumulative, 0.9) + 1)
    names = format_joined(f"{candidate.name} {format_share(candidate.weight)}" for candidate in ranked[:needed])
    return [
        f"No single law stands out. It takes {needed} of {count(total, 'candidate')} to reach nine tenths of the "
        f"weight: {names}."
    ]


def _describe_capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _viscous_weight(result: RecordResult) -> float | None:
    return next((c.weight for c in result.ranking.candidates if c.law.is_viscous and c.rank is not None), None)


def _list_against_viscous(result: RecordResult) -> list[str]:
    """How much more probable the data are under the leading law than under constant viscous damping."""
    best = weighted(result)[0]
    viscous = next((c for c in result.ranking.candidates if c.law.is_viscous and c.rank is not None), None)
    if viscous is None:
        return []
    if best.law.is_viscous:
        return ["That is constant viscous damping: the tests do not ask for more."]
    odds = float(np.exp(min(0.5 * (viscous.score - best.score), 700.0)))
    times = f"{odds:.0f} times" if odds < 1000.0 else "more than a thousand times"
    if odds < 3.0:
        return ["Constant viscous damping alone explains the data about as well."]
    verdict = "is as good as excluded" if odds > 100.0 else "is unlikely" if odds > 10.0 else "cannot be excluded"
    return [
        f"Constant viscous damping alone {verdict} (weight {format_share(viscous.weight)}): the data are {times} more "
        "probable under the leading law."
    ]


def _list_exponent(result: RecordResult) -> list[str]:
    """What the slope of ln F on ln A says."""
    law = next((law for law in result.power_laws if law.form == "velocity-power"), None)
    if law is None:
        return []
    if not np.isfinite(law.p_low):
        return [
            f"Force grows as the {number(law.p)} power of resonant amplitude, from two points: without an interval."
        ]
    verdict = "which excludes" if law.p_low > 1.0 or law.p_high < 1.0 else "which still holds"
    return [
        f"Force grows as the {number(law.p)} power of resonant amplitude; the {100 * law.level:g} per cent t interval "
        f"from {count(law.degrees_of_freedom, 'degree')} of freedom is {format_between(law.p_low, law.p_high)}, "
        f"{verdict} "
        "the 1 of linear damping."
    ]


def _list_loads(result: RecordResult) -> list[str]:
    """The amplitude at the largest design force against the linear prediction."""
    i, design, units = largest(result.design), result.design, result.mode.units
    if i is None or design is None:
        why = format_joined(dict.fromkeys(said[0] for said in design.cautions if said)) if design else ""
        return [f"No amplitude is predicted at the design forces: {why}."]
    band, force, length = design.average, format_force_text(design.force[i], units.force), units.length
    content, ratio = f"{100 * design.level:g} per cent", design.ratio[i]
    beyond = f", {number(ratio)} times the largest tested force," if ratio > 1.0 else ", within the tested range,"
    over, low, high = (v[i] for v in (design.overprediction, design.overprediction_low, design.overprediction_high))
    side = "too much" if over > 0.0 else "too little"
    outside = "outside" if not band.low[i] <= design.linear[i] <= band.high[i] else "inside"
    return [
        f"At {force}{beyond} the resonant amplitude to expect is {format_quantity(band.median[i], length)}; the "
        f"next test "
        f"would read {format_between(band.low[i], band.high[i], length)} with {content} probability.",
        f"Scaled linearly from the largest tested level it would be {format_quantity(design.linear[i], length)}, "
        f"{format_percent(abs(over))} per cent {side} ({format_signed(low)} to {format_signed(high)}) and "
        f"{outside} the band.",
        _describe_consequence(low, high),
        *_list_alike(design, i),
    ]


def _describe_consequence(low: float, high: float) -> str:
    if low > 0.0:
        return (
            "Sizing for the linear amplitude is conservative by that much, while the sources of damping stay the same."
        )
    if high < 0.0:
        return "Sizing for the linear amplitude is not conservative."
    return "Whether sizing for the linear amplitude is conservative cannot be said from these tests."


def _list_alike(design: Loads, i: int) -> list[str]:
    """Laws that need not be told apart, because they predict the same at the largest design force."""
    lead = max(design.by_model, key=lambda band: band.weight)
    alike = [
        band
        for band in design.by_model
        if band is not lead and abs(100.0 * (band.median[i] / lead.median[i] - 1.0)) < SAME
    ]
    if not alike:
        return []
    names = format_joined(band.name for band in (lead, *alike))
    return [
        f"{_describe_capital(names)} predict the same there within {SAME:g} per cent, so it does not matter "
        f"which of them holds."
    ]
