"""The chapters of the source report on the page: results in, one section a chapter with its figures and tables out."""

from __future__ import annotations

from damping.report.page import Part
from damping.report.results import ChapterResults, Svgs
from damping_reed1970.chapter_2.page import chapter_2
from damping_reed1970.chapter_3.page import chapter_3
from damping_reed1970.chapter_3.words import chapter_3_figures
from damping_reed1970.chapter_4.page import chapter_4
from damping_reed1970.chapter_5.page import chapter_5
from damping_reed1970.chapter_6.page import chapter_6
from damping_reed1970.errata import errata, reproduction
from damping_reed1970.figures import ChapterFigure, chapter_figures
from damping_reed1970.source import gaps


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
