"""The screens of the page of a study: the answer, damping, measured beside fitted, which law, and the design load.

Their sentences are in ``screens.txt``; this module fills it with numbers and tables. The details are folded below
(:mod:`damping.report.study`).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from damping import report as words
from damping.arrays import RAD_S_PER_HZ
from damping.extrapolation.cautions import REFUSAL
from damping.extrapolation.curve import Curve
from damping.extrapolation.prediction import Loads
from damping.ranking import Candidate
from damping.records.mode import Units
from damping.report import tables
from damping.report.figures import build_loads_explorer, describe_misfit
from damping.report.forms import PART_NAMES
from damping.report.page import Block, FigureBlock, Format, Section, Table, write_sections
from damping.report.results import (
    RecordResult,
    StudyResult,
    Svgs,
    collect_holders,
    find_largest,
    keep_gravest,
    list_design_cautions,
    list_refused,
)

LEAST_SHOWN = 0.02  #: laws with less weight are folded away
MOST_SHOWN = 6  #: laws of a record shown at most


def build_screens(study: StudyResult, svgs: Svgs) -> list[Section]:
    """The screens for which there are results; ``svgs``: figures by file."""
    records = [_describe_record(result, svgs) for result in study.records]
    asked = [result for result in study.records if result.design is not None]
    parts: dict[str, Block] = {name: FigureBlock(svg) for name, svg in svgs.items()}
    parts["answers"] = _tabulate_answers(study)
    for result in study.records:
        parts[f"{result.name}-laws"] = _tabulate_laws(result)
        if result.design is not None:
            parts |= _tabulate_loads(result, result.design)
    if asked:  # the figure of the first has a slider
        parts |= build_loads_explorer(asked[0], svgs)
    values = {
        "records": records,
        "several": len(records) > 1,
        "level": f"{100 * study.level:g}",
        "lead": next((record for record in records if record["load"]), records[0]),
        "asked": [record for record in records if record["design"]],
        "gravest": collect_holders((result.title, _list_gravest(result)) for result in study.records),
    }
    sections = write_sections(Path(__file__).with_name("screens.txt"), values, parts)
    return [section for section in sections if section.blocks]


def _count_levels(result: RecordResult) -> int:
    return int(result.data.levels.max()) + 1


def _describe_record(result: RecordResult, svgs: Svgs) -> dict[str, Any]:
    """Values of the sentences on a record, by name."""
    i, design, ranking = find_largest(result.design), result.design, result.ranking
    rest = len(ranking.candidates) - len(_list_shown_laws(result))
    return {
        **vars(result),
        "levels": _count_levels(result),
        "ratio": design.ratio[i] if design is not None and i is not None else 0.0,
        "sharing": len(ranking.weighted(LEAST_SHOWN)),
        "best": ranking.weighted()[0],
        "load": describe_load(design, result.design_curve, result.mode.units, result.design_levels),
        "top": _describe_top(result),
        "drawn": result.stem("damping_curve") in svgs,
        "measured": "sweeps" if result.data.has_repeats else "resonances",
        "misfit": describe_misfit(result),
        "verdict": ranking.fit.sentence or "The leading law fits to the noise",
        "further": f"{words.count(rest, 'further law')} in the folded table." if rest > 0 else "",
        "refusals": dict.fromkeys(
            caution.removeprefix(REFUSAL) for own in design.cautions for caution in own if caution.startswith(REFUSAL)
        )
        if design
        else (),
    }


def describe_load(
    design: Loads | None, curve: Curve | None, units: Units, levels: Sequence[str] = ()
) -> dict[str, str]:
    """The prediction at the largest design force that has one, in words; empty where none has.

    ``curve``: damping there. ``levels``: the level that each design force represents, if any.
    """
    i = find_largest(design)
    if i is None or design is None:
        return {}
    force, drive = words.format_force_text(design.force[i], units.force), units.drive.replace("force", "modal force")
    return {
        "force": f"{levels[i]} (a {drive} of {force})" if levels else force,
        "median": words.format_length(design.average.median[i], units.length),
        "band": words.format_length_band(design.average.low[i], design.average.high[i], units.length),
        "level": f"{100 * design.level:g}",
        "linear": words.format_length(design.linear[i], units.length),
        "over": words.format_signed(design.overprediction[i]),
        "ratio": words.format_percent_ratio(curve.damping_ratio.median[i]) if curve else "",
        "low": words.format_percent_ratio(curve.damping_ratio.low[i]) if curve else "",
    }


def _describe_top(result: RecordResult) -> dict[str, str]:
    """Damping at the largest tested amplitude that has a ratio, in words; empty where none has."""
    curve = result.curve
    if curve is None or not (curve.tested & np.isfinite(curve.damping_ratio.median)).any():
        return {}
    rows = np.flatnonzero(curve.tested & np.isfinite(curve.damping_ratio.median))
    row, ratio = int(rows[np.argmax(curve.amplitude.median[rows])]), curve.damping_ratio
    return {
        "ratio": words.format_percent_ratio(ratio.median[row]),
        "band": words.format_between(100.0 * ratio.low[row], 100.0 * ratio.high[row], "%"),
        "level": f"{100 * curve.level:g}",
        "amplitude": words.format_length(curve.amplitude.median[row], result.mode.units.length),
        "frequency": f"{words.number(curve.frequency.median[row], 4)} Hz",
        "q": words.number(0.5 / ratio.median[row]),
    }


def _tabulate_answers(study: StudyResult) -> Table:
    """One row for each record: largest tested force, damping there, law, amplitude at the largest design force."""
    rows = []
    for result in study.records:
        best, top, data, units = result.ranking.weighted()[0], _describe_top(result), result.data, result.mode.units
        load = describe_load(result.design, result.design_curve, units, result.design_levels)
        tested = words.format_quantity(data.tested_force.max(), units.force)
        frequency = words.number(data.tested_omega[data.top] / RAD_S_PER_HZ, 4)
        none = "none asked" if result.design is None else "none predicted"
        law = f"{best.name} {words.format_share(best.weight)}" if _count_levels(result) > 1 else "open"
        rows.append(
            {
                "record": result.title,
                "tested to": f"{tested}, {frequency} Hz",
                "damping ratio there": f"{top['ratio']} ({top['band']})" if top else words.NOTHING,
                "law and weight": law,
                "at the design load": f"{load['median']} ({load['band']}) at {load['force']}" if load else none,
            }
        )
    return Table(pd.DataFrame(rows))


def _list_gravest(result: RecordResult) -> list[str]:
    """The gravest cautions of a record."""
    first = (*list_refused(result), *result.against, *filter(None, [result.ranking.fit.sentence]))
    return keep_gravest([*first, *map(str, result.findings), *list_design_cautions(result), *result.remarks])


def _list_shown_laws(result: RecordResult) -> list[Candidate]:
    """The laws in the table of a screen: those with weight, and the viscous ones."""
    weighted = result.ranking.weighted()
    shown = [law for law in weighted if law.weight >= LEAST_SHOWN][:MOST_SHOWN] or list(weighted[:1])
    viscous = [c for c in result.ranking.candidates if c.law.is_viscous and c.rank is not None and c not in shown]
    return shown + viscous


def _tabulate_laws(result: RecordResult) -> Table:
    table = pd.DataFrame(
        {
            "law": law.name,
            "weight": words.format_share(law.weight),
            "coefficients": tables.describe_coefficients(law, result.mode.units),
            "error at resonance": f"{words.format_percent(law.average_absolute_percent)} %",
            "level held out": f"{words.format_percent(law.held_out_error)} %".replace(
                f"{words.NOTHING} %", words.NOTHING
            ),
            "predicts the same": words.NOTHING
            if not law.equivalents
            else law.equivalents[0] + (f" and {len(law.equivalents) - 1} more" if len(law.equivalents) > 1 else ""),
        }
        for law in _list_shown_laws(result)
    )
    return Table(table, key=result.stem("ranking"))


def _tabulate_loads(result: RecordResult, design: Loads) -> dict[str, Table]:
    """Amplitude and damping at the design forces, and the parts of their band."""
    headings, key = {"band": f"{100 * design.level:g} % predictive band"}, result.stem("design_loads")
    of_parts = {part: f"{name}, %" for part, name in PART_NAMES.items()}
    formats: dict[str, Format] = dict.fromkeys(PART_NAMES, words.format_percent)
    predicted = tables.tabulate_design(design, result.design_curve, result.mode.units)
    spread = pd.DataFrame({"force": predicted["force"], **{part: design.parts[part] for part in PART_NAMES}})
    return {
        f"{result.name}-design": Table(predicted, {"times tested": words.number}, headings, key=key),
        f"{result.name}-parts": Table(spread, formats, of_parts),
    }
