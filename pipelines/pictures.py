"""The figures of a study as PNG images, by the names of their SVG files."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import PurePosixPath

from pipelines.export import to_png
from selection.plots.chapter_3_figures import chapter_3_figures
from selection.plots.chapter_figures import ChapterFigure, chapter_figures
from selection.report.figures import record_figures
from selection.report.results import ChapterResults, StudyResult
from selection.report.sections.common import file_stem
from selection.report.study_figures import study_figures


def pictures(study: StudyResult, svgs: Iterable[str]) -> dict[str, bytes]:
    """``NAME.png`` of every figure drawn as ``NAME.svg``, a path in the folder of the study."""
    figures = {name.replace("_", "-"): one.figure for name, one in study_figures(study).items()}
    for result in study.records:
        figures |= {file_stem(result, name): one.figure for name, one in record_figures(result, study.level).items()}
    of_chapters = _of_chapters(study.chapters) if study.chapters else {}
    drawn: dict[str, bytes] = {}
    for svg in svgs:
        path = PurePosixPath(svg)
        figure = figures.get(path.stem) or of_chapters[_CHAPTER.sub("", path.stem)].draw()
        drawn[str(path.with_suffix(".png"))] = to_png(figure)
    return drawn


_CHAPTER = re.compile(r"^chapter-\d-")


def _of_chapters(results: ChapterResults) -> dict[str, ChapterFigure]:
    """Figures of the chapters of the source report by name."""
    of_studies = chapter_figures(results.studies, results.tables["section_6_1_errors"])
    chapter_3 = [ChapterFigure(*row) for row in chapter_3_figures(results.chapter_3)]
    return {one.name: one for one in [*of_studies, *chapter_3]}
