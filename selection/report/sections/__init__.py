"""Results in, sections of the page out; each module is one theme and any may be left out or added to."""

from __future__ import annotations

from collections.abc import Sequence

from selection.report.page import Section
from selection.report.results import StudyResult
from selection.report.sections.answer import answer
from selection.report.sections.cautions import cautions
from selection.report.sections.common import Svgs
from selection.report.sections.loads import loads
from selection.report.sections.method import method
from selection.report.sections.power_laws import power_law_section
from selection.report.sections.record import record_section
from selection.report.sections.source import source
from selection.report.sections.tested import tested


def study_sections(study: StudyResult, svgs: Svgs, further: Sequence[Section] = ()) -> list[Section]:
    """All sections in order, ``further`` ones before the cautions.

    Args:
        svgs: figures by the names that :func:`selection.report.build.render` gives them; missing ones are left out.
    """
    return [
        answer(study, svgs),
        tested(study),
        *loads(study, svgs),
        *power_law_section(study, svgs),
        *(record_section(result, svgs) for result in study.records),
        *source(study, svgs),
        *further,
        cautions(study),
        method(study),
    ]
