"""A study rendered: the page, every table and every figure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import pandas as pd

from selection.plots.style import to_svg
from selection.report.chapters import chapter_parts
from selection.report.figures import Drawn, record_figures
from selection.report.page import Footer, page
from selection.report.part import Part
from selection.report.results import StudyResult
from selection.report.sections import study_sections
from selection.report.sections.common import file_stem
from selection.report.study_figures import study_figures
from selection.report.tables import record_tables


@dataclass(frozen=True)
class Rendered:
    """``html``: the page. ``tables`` and ``figures`` (SVG) by the name of their file, without its ending."""

    html: str
    tables: dict[str, pd.DataFrame]
    figures: dict[str, str]


def render(study: StudyResult, further: Sequence[Part] = ()) -> Rendered:
    """Render a study; equal studies give equal text.

    ``further``: parts to add to the page, before the cautions and after the chapters of the source report.
    """
    figures, tables = _figures(study), _tables(study)
    parts = [*(chapter_parts(study.chapters, figures) if study.chapters else ()), *further]
    sections = study_sections(study, figures, [part.section for part in parts])
    for part in parts:
        figures |= part.figures
        tables |= part.tables
    footer = Footer(seed=study.seed, versions=study.versions, inputs=study.inputs)
    return Rendered(page(study.title, sections, footer), tables, figures)


def _figures(study: StudyResult) -> dict[str, str]:
    drawn: dict[str, Drawn] = {}
    for result in study.records:
        drawn |= {file_stem(result, name): one for name, one in record_figures(result, study.level).items()}
    drawn |= {name.replace("_", "-"): one for name, one in study_figures(study).items()}
    return {name: to_svg(one.figure, name, one.title, one.description) for name, one in drawn.items()}


def _tables(study: StudyResult) -> dict[str, pd.DataFrame]:
    tables: dict[str, pd.DataFrame] = {}
    for result in study.records:
        tables |= {file_stem(result, name): table for name, table in record_tables(result).items()}
    return tables | {name: table for name, table in study.tables.items() if not table.empty}
