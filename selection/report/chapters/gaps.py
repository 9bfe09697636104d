"""Two gaps of the source report on the page: what the diagnosis says of each from its table alone."""

from __future__ import annotations

from math import degrees

import pandas as pd

from selection.gap.corrected import effect_values, refitted_values
from selection.gap.diagnose import Diagnosis
from selection.gap.effects.catalogue import CATALOGUE
from selection.gap.history import Gaps
from selection.plots.style import to_svg
from selection.records.blind_table import load_blind_table
from selection.report import gap_words
from selection.report.blind_page import blind_rows
from selection.report.gap_figures import gap_figures
from selection.report.page import Block, FigureBlock, Heading, List, Section, Table, Text
from selection.report.part import Part
from selection.report.results import ChapterResults
from selection.report.words import number, share

#: Figures shown of each gap, and hypotheses listed.
SHOWN, _MOST = ("overlay", "local", "probabilities"), 8


def gaps(results: ChapterResults) -> Part:
    """The part: Configuration I against one plane, Configuration II against viscous damping."""
    found: Gaps = results.gaps
    blocks: list[Block] = [
        Text(
            "Two gaps between simulation and test whose cause the report found by hand. The diagnosis sees the table "
            "and the simulation, nothing else."
        )
    ]
    figures: dict[str, str] = {}
    tables: dict[str, pd.DataFrame] = {}
    for number_, (one, what) in enumerate(((found.configuration_1, _planes), (found.configuration_2, _damping)), 1):
        blocks += [Heading(one.mode.name), Text(gap_words.verdict(one), lead=True)]
        said = [gap_words.place(one), *gap_words.doubts(one), *gap_words.trends(one), *what(one)]
        blocks.append(List([*said, gap_words.reach(one), gap_words.following(one)]))
        for name, drawn in gap_figures(one).items():
            if name in SHOWN:
                file = f"gap-configuration-{number_}-{name}"
                figures[file] = to_svg(drawn.figure, file, drawn.title, drawn.description)
                blocks.append(FigureBlock(figures[file], f"{drawn.title}. {drawn.description}"))
        key = f"gap_configuration_{number_}"
        tables[key] = hypotheses_table(one)
        caption = "The most probable explanations, with the natural logarithm of their evidence"
        blocks.append(Table(tables[key].head(_MOST), caption, {"probability": share}, key=key))
    blocks += [
        Heading("How far such a diagnosis can be trusted"),
        Text(_TRUST),
        Table(blind_rows(load_blind_table()), _BLIND),
    ]
    return Part(Section("gaps", "Two gaps between simulation and test", blocks), figures, tables)


_TRUST = (
    "The same diagnosis answered 1500 generated cases whose effect was withheld from it (the command damping blind): "
    "goals beside measured values, with 95 per cent intervals. Names of forces whose predictions a record cannot tell "
    "apart count as wrong in the strict figures of the leading class; the line below each counts them as right where "
    "the answer says so."
)
_BLIND = "Blind check of the gap diagnosis"


def hypotheses_table(one: Diagnosis) -> pd.DataFrame:
    """Every hypothesis that was fitted, most probable first: ``explanation, probability, log_evidence``."""
    return pd.DataFrame(
        {
            "explanation": [" + ".join(each.effects) or "no effect" for each in one.hypotheses],
            "probability": [each.probability for each in one.hypotheses],
            "log_evidence": [each.hypothesis.log_evidence for each in one.hypotheses],
        }
    )


def _planes(one: Diagnosis) -> list[str]:
    """The second plane in rad/s, if that is the explanation."""
    values = effect_values(one.leading.best).get("planar-coupling")
    if values is None:
        return []
    first = one.mode.omega_n * (1.0 + refitted_values(one.leading.best)["frequency"])
    return [
        f"The second plane lies at {number(first * values['frequency_ratio'], 4)} rad/s, the first at "
        f"{number(first, 4)}, and the drive {number(degrees(values['angle']), 2)} degrees from the first. (The fit of "
        "section 3.1, which sees the phase of every node too, is in chapter III.)"
    ]


def _damping(one: Diagnosis) -> list[str]:
    """How probable it is that damping forces, and no other effects, are missing."""
    kinds = [{CATALOGUE[name].kind for name in each.effects} for each in one.hypotheses]
    forces = sum(each.probability for each, kind in zip(one.hypotheses, kinds, strict=True) if kind == {"force"})
    return [f"Missing forces that grow with amplitude, whichever they are, have probability {share(forces)} together."]
