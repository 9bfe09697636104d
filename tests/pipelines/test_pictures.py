"""Figures of a study as PNG beside their SVG."""

from __future__ import annotations

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from damping.infer.law import Law
from damping.ranking import rank_laws
from damping.report.results import Exhibit, RecordResult, StudyResult
from damping_pipelines.study import read_inputs
from damping_pipelines.study_files import pictures, render_files
from damping_reed1970 import data_folder


@pytest.fixture(scope="module")
def study() -> StudyResult:
    """Three resonances ranked, nothing sampled."""
    from damping_pipelines.study_files import default_study, read_settings

    settings = read_settings(default_study())
    one = next(
        one for one in read_inputs(settings, data_folder() / "saturn-v") if one.settings.name == "config-2-mode-1"
    )
    prepared = one.prepared
    ranking = rank_laws(prepared.all_rows, 0, [Law(("viscous",)), Law(("velocity-squared",))])
    record = RecordResult(
        "peaks", "Peaks", prepared.given[0], prepared.mode, prepared.all_rows, ranking, (), None, None, ()
    )
    exhibit = Exhibit([], figures={"further": "<svg/>"}, drawings={"further": lambda: Figure(figsize=(1.0, 1.0))})
    return StudyResult("A study", 1, 0.9, (record,), {}, {}, (exhibit,))


def test_every_svg_has_its_png(study):
    svgs = [name for name in render_files(study) if name.endswith(".svg")]
    drawn = pictures(study, svgs)
    assert len(drawn) >= 2
    assert set(drawn) == {str(Path(name).with_suffix(".png")) for name in svgs}
    for content in drawn.values():
        assert content.startswith(b"\x89PNG\r\n\x1a\n")
