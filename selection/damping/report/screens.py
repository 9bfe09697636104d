"""The first screens of the page of a study: the answer, damping, measured beside fitted, which law.

The design load and what a screen rests on follow in :mod:`damping.report.study`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ
from damping.ranking import Candidate
from damping.records.resonance import number_levels
from damping.report import (
    NOTHING,
    count,
    format_between,
    format_force_text,
    format_length,
    format_length_band,
    format_parameter_unit,
    format_percent,
    format_percent_ratio,
    format_quantity,
    format_share,
    format_signed,
    number,
)
from damping.report.page import Block, Callout, Facts, Heading, List, Row, Section, Table, Text
from damping.report.results import (
    RecordResult,
    StudyResult,
    Svgs,
    build_figure,
    describe_file_stem,
    find_largest,
    name_record,
    weighted,
)

#: Laws with less weight are folded away.
LEAST_SHOWN = 0.02
#: Laws of a record shown at most.
MOST_SHOWN = 6
#: Cautions of a record above the fold at most, the gravest first.
MOST_CAUTIONS = 3


def build_screens(study: StudyResult, svgs: Svgs) -> list[Section]:
    """The screens; those that the results cannot fill have no blocks."""
    return [
        Section("answer", "The answer", _build_answer(study)),
        Section("damping", "Damping against amplitude", _build_curves(study, svgs)),
        Section("sweeps", "Measured beside fitted", _build_fits(study, svgs)),
        Section("laws", "Which law", _build_laws(study)),
    ]


def find_lead(study: StudyResult) -> RecordResult:
    """The record that the page opens with: the first with a predicted design load, else the first."""
    return next((r for r in study.records if find_largest(r.design) is not None), study.records[0])


def count_levels(result: RecordResult) -> int:
    """Force levels of a record."""
    return int(number_levels(result.data.tested_force).max()) + 1


def _build_answer(study: StudyResult) -> list[Block]:
    lead = find_lead(study)
    others = [result for result in study.records if result is not lead]
    blocks: list[Block] = [
        Text(_describe_lead(lead), lead=True),
        Facts(_collect_facts(lead)),
        Text(_describe_conditions(lead, study)),
        Callout("Before this is used", _collect_gravest(study)),
    ]
    if others:
        blocks += [_tabulate_answers(study), List([_describe_conditions(result, study) for result in others])]
    return blocks


def _describe_load(result: RecordResult) -> dict[str, str]:
    """The prediction at the largest design force that has one, in words; empty where none has."""
    i, design, units = find_largest(result.design), result.design, result.mode.units
    if i is None or design is None:
        return {}
    return {
        "force": format_force_text(design.force[i], units.force),
        "median": format_length(design.average.median[i], units.length),
        "band": format_length_band(design.average.low[i], design.average.high[i], units.length),
        "linear": format_length(design.linear[i], units.length),
        "over": format_signed(design.overprediction[i]),
    }


def _describe_top(result: RecordResult) -> dict[str, str]:
    """Damping at the largest tested amplitude that has a ratio, in words; empty where none has."""
    curve = result.curve
    if curve is None or not (curve.tested & np.isfinite(curve.damping_ratio.median)).any():
        return {}
    rows = np.flatnonzero(curve.tested & np.isfinite(curve.damping_ratio.median))
    row, ratio = int(rows[np.argmax(curve.amplitude.median[rows])]), curve.damping_ratio
    return {
        "ratio": format_percent_ratio(ratio.median[row]),
        "band": format_between(100.0 * ratio.low[row], 100.0 * ratio.high[row], "%"),
        "amplitude": format_length(curve.amplitude.median[row], result.mode.units.length),
        "frequency": f"{number(curve.frequency.median[row], 4)} Hz",
        "q": number(0.5 / ratio.median[row]),
    }


def _describe_lead(result: RecordResult) -> str:
    """The one answer, with its band and what it is conditional on."""
    load, top, curve, design = _describe_load(result), _describe_top(result), result.design_curve, result.design
    if not load or design is None:
        tested = "{ratio} of critical damping ({band}) at {amplitude}, {frequency}, the top of the test"
        return f"{result.title}: {tested.format(**top) if top else 'no damping ratio could be told'}."
    expected = "at {force} expect {median} ({band}, ".format(**load)
    sentence = f"{result.title}: {expected}{100 * design.level:g} % band)"
    i = find_largest(design)
    if curve is None or i is None:
        return sentence + "."
    median, low = (format_percent_ratio(end[i]) for end in (curve.damping_ratio.median, curve.damping_ratio.low))
    return f"{sentence}, with {median} of critical damping; size loads with {low}, the low end of its band."


def _collect_facts(result: RecordResult) -> list[tuple[str, str]]:
    best, load, top = weighted(result)[0], _describe_load(result), _describe_top(result)
    facts = []
    if load:
        facts.append((load["median"], f"amplitude at {load['force']}, median"))
        facts.append((load["over"], f"linear scaling against that ({load['linear']})"))
    if top:
        facts.append((top["ratio"], f"of critical at the top of the test ({top['band']}); Q {top['q']}"))
    return [*facts, (best.name, f"leading law, weight {format_share(best.weight)} of 1")]


def _tabulate_answers(study: StudyResult) -> Table:
    """A row a record: what was tested, damping there, the law, the amplitude at the largest design force."""
    rows = []
    for result in study.records:
        best, load, top, data = weighted(result)[0], _describe_load(result), _describe_top(result), result.data
        tested = format_quantity(data.tested_force.max(), result.mode.units.force)
        rows.append(
            {
                "record": result.title,
                "tested to": f"{tested}, {number(data.tested_omega[data.top] / RAD_S_PER_HZ, 4)} Hz",
                "damping ratio there": f"{top['ratio']} ({top['band']})" if top else NOTHING,
                "law and weight": f"{best.name} {format_share(best.weight)}" if count_levels(result) > 1 else "open",
                "at the design load": f"{load['median']} ({load['band']}) at {load['force']}" if load else "none asked",
            }
        )
    return Table(pd.DataFrame(rows), "Every record of the study; bands in parentheses.")


def _describe_conditions(result: RecordResult, study: StudyResult) -> str:
    """Points, levels, how far beyond the test, and what else the answer rests on."""
    data, levels = result.data, count_levels(result)
    sentence = f"{name_record(result, study, ':')}{count(len(data.A), 'point')} at {count(levels, 'force level')}"
    i, design = find_largest(result.design), result.design
    if i is not None and design is not None and design.ratio[i] > 1.0:
        sentence += f"; the design load is {number(design.ratio[i])} times the largest tested force"
    if levels == 1:
        fitting = sum(1 for c in result.ranking.candidates if c.weight > LEAST_SHOWN)
        sentence += (
            f"; one sweep does not determine the law ({fitting} laws fit it), and nothing here says how damping "
            "changes with level"
        )
    return sentence + (f". {result.note}" if result.note else ".")


def _collect_gravest(study: StudyResult) -> list[str]:
    """The gravest cautions, each once with the records it holds for, and what no band holds."""
    holders: dict[str, list[str]] = {}
    for result in study.records:
        cautions = [str(finding) for finding in result.findings]
        if result.ranking.fit.sentence:
            cautions.append(result.ranking.fit.sentence)
        i = find_largest(result.design)
        if result.design is not None:
            cautions += result.design.cautions[-1 if i is None else i]
        for caution in list(dict.fromkeys(cautions))[:MOST_CAUTIONS]:
            if not caution.startswith("beyond the test"):  # the conditions say it
                holders.setdefault(caution, []).append(result.title)
    several = len(study.records) > 1
    named = [
        text[:1].upper() + text[1:] + (f" ({'; '.join(titles)})." if several else ".")
        for text, titles in holders.items()
    ]
    standing = (
        "Every number is conditional on the sources of damping staying the same, in the same proportion: a joint that "
        "begins to slip, or a crack, is in no band."
    )
    return [*named, standing]


def _build_curves(study: StudyResult, svgs: Svgs) -> list[Block]:
    drawn: list[Block] = []
    for result in study.records:
        drawn += build_figure(
            svgs,
            describe_file_stem(result, "damping_curve"),
            name_record(result, study, ".")
            + f"Damping ratio and Q against resonant amplitude, n = {len(result.data.A)} points.",
        )
    if not drawn:
        return []
    reading = (
        "One damping ratio holds at one amplitude. Solid: tested; dashed on hatched ground: beyond the test. The red "
        "line is the low end of the band, the one to size a load with."
    )
    return [Text(reading), Row(drawn)]


def _build_fits(study: StudyResult, svgs: Svgs) -> list[Block]:
    drawn: list[Block] = []
    for result in study.records:
        best = weighted(result)[0]
        measured = "sweeps" if result.data.has_repeats else "resonances"
        caption = f"{name_record(result, study, '.')}Measured {measured} and {best.name}, which misses the resonant "
        caption += f"amplitudes by {format_percent(best.average_absolute_percent)} % on average."
        drawn += build_figure(svgs, describe_file_stem(result, "fitted"), caption)
    return [Row(drawn)] if drawn else []


def _build_laws(study: StudyResult) -> list[Block]:
    blocks: list[Block] = [
        Text(
            "A weight is the probability of a law among those tried, given the test; weights of a record add to 1. "
            "Laws that predict the same on a record share one line. A coefficient is a posterior median."
        )
    ]
    for result in study.records:
        levels = count_levels(result)
        if len(study.records) > 1:
            blocks.append(Heading(result.title))
        if levels == 1:
            blocks.append(
                Text(
                    "One sweep does not determine the law: amplitude and frequency change together along it. "
                    "The weights below order what was tried and decide nothing."
                )
            )
        blocks.append(_tabulate_laws(result))
    return blocks


def _tabulate_laws(result: RecordResult) -> Table:
    shown = [law for law in weighted(result) if law.weight >= LEAST_SHOWN][:MOST_SHOWN] or weighted(result)[:1]
    viscous = [c for c in result.ranking.candidates if c.law.is_viscous and c.rank is not None and c not in shown]
    rows = [
        {
            "law": law.name,
            "weight": format_share(law.weight),
            "coefficients": _describe_coefficients(result, law),
            "error of amplitude": f"{format_percent(law.average_absolute_percent)} %",
            "level held out": f"{format_percent(law.held_out_error)} %".replace(f"{NOTHING} %", NOTHING),
            "predicts the same": _describe_equivalents(law.equivalents),
        }
        for law in (*shown, *viscous)
    ]
    rest = len(result.ranking.candidates) - len(rows)
    caption = f"{result.ranking.fit.sentence or 'The leading law fits to the noise'}. "
    caption += f"{count(rest, 'further law')} in the folded table." if rest > 0 else ""
    return Table(pd.DataFrame(rows), caption, key=describe_file_stem(result, "ranking"))


def _describe_coefficients(result: RecordResult, law: Candidate) -> str:
    units = result.mode.units
    named = [(f"{c.force} {c.shape}".strip(), c.value) for c in law.coefficients]
    return "; ".join(f"{name} {format_quantity(value, format_parameter_unit(name, units))}" for name, value in named)


def _describe_equivalents(names: Sequence[str]) -> str:
    more = f" and {len(names) - 1} more" if len(names) > 1 else ""
    return names[0] + more if names else NOTHING
