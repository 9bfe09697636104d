"""The chapters of the source report on the page: results in, one section a chapter with its figures and tables out."""

from __future__ import annotations

from selection.plots.chapter_3_figures import chapter_3_figures
from selection.plots.chapter_figures import ChapterFigure, chapter_figures
from selection.report.chapters.chapter_2 import chapter_2
from selection.report.chapters.chapter_3 import chapter_3
from selection.report.chapters.chapter_4 import chapter_4
from selection.report.chapters.chapter_5 import chapter_5
from selection.report.chapters.chapter_6 import chapter_6
from selection.report.chapters.errata import errata, reproduction
from selection.report.chapters.gaps import gaps
from selection.report.part import Part
from selection.report.results import ChapterResults
from selection.report.sections.common import Svgs


def chapter_parts(results: ChapterResults, svgs: Svgs) -> list[Part]:
    """Chapters II to VI, two gaps between simulation and test, every printed number, and the errata.

    Args:
        svgs: figures of the study that are drawn already, by name.
    """
    drawn = [
        *chapter_figures(results.studies, results.tables["section_6_1_errors"]),
        *(ChapterFigure(*row) for row in chapter_3_figures(results.chapter_3)),
    ]
    figures = {one.name: one for one in drawn}
    chapters = (chapter_2, chapter_3, chapter_4, chapter_5, chapter_6)
    told = [chapter(results, figures) for chapter in chapters]
    return [*told, gaps(results), reproduction(results, svgs), errata(results)]
