"""The page: escaping, self-containment, structure, and that it says what the results say."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections import Counter
from dataclasses import replace
from hashlib import sha256
from itertools import pairwise
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

from damping.plots import to_svg
from damping.records.view import Finding
from damping.report import describe_written, format_force_text, format_share, format_signed, number
from damping.report.figures import record_figures
from damping.report.page import (
    Fold,
    Footer,
    Heading,
    List,
    Section,
    Table,
    Text,
    fill_text,
    render_page,
    write_sections,
)
from damping.report.results import Exhibit, StudyResult
from damping.report.study import Rendered, render
from tests.html import Reader


@pytest.fixture(scope="module")
def reader(rendered: Rendered) -> Reader:
    return Reader(rendered.html)


def test_every_element_is_closed_and_ids_are_unique(reader: Reader) -> None:
    assert not reader.open
    ids = [attributes["id"] for _, attributes in reader.elements if "id" in attributes]
    assert [key for key, n in Counter(ids).items() if n > 1] == []


def test_page_loads_nothing(rendered: Rendered, reader: Reader) -> None:
    bare = re.sub(r'xmlns(:\w+)?="[^"]*"', "", rendered.html)
    assert not re.search(r"(https?:)?//\w", bare)
    assert not re.search(r"@import|url\((?!#)", bare)
    for tag, attributes in reader.elements:
        assert tag not in {"link", "img", "iframe", "object", "embed", "base"}
        assert "src" not in attributes
        for name in ("href", "xlink:href"):
            assert (attributes.get(name) or "#").startswith("#")
    policy = [a["content"] for _, a in reader.elements if a.get("http-equiv") == "Content-Security-Policy"]
    digest = b64encode(sha256(programs(rendered.html)[0].encode()).digest()).decode()
    assert policy == [f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"]


def programs(html: str) -> list[str]:
    """The scripts that a browser would run."""
    return re.findall(r"<script>(.*?)</script>", html, re.DOTALL)


def test_the_page_runs_one_script_the_same_on_every_page(rendered: Rendered, reader: Reader) -> None:
    kinds = Counter(attributes.get("type") for tag, attributes in reader.elements if tag == "script")
    # one program; and for the one record with design forces the numbers behind its slider
    assert kinds == {None: 1, "application/json": 1}
    assert programs(rendered.html) == programs(render_page("t", [Section("s", "S", [])], Footer(1, {}, {})))


def test_the_slider_holds_the_tables_of_design_loads(study: StudyResult, rendered: Rendered) -> None:
    data = json.loads(re.findall(r'<script type="application/json">(.*?)</script>', rendered.html, re.DOTALL)[0])
    bands, design = study.records[0].bands, study.records[0].design
    assert bands is not None
    assert design is not None
    forces = sorted({*bands.force, *design.force})
    np.testing.assert_allclose(data["force"], forces, rtol=5e-5, atol=0.0)  # five digits are kept
    for name in ("low", "median", "high"):
        for force, wanted in zip(design.force, getattr(design.average, name), strict=True):
            np.testing.assert_allclose(data[name][forces.index(force)], wanted, rtol=5e-5, atol=0.0)
    at = forces.index(design.force[1])
    assert data["texts"]["over"][at].startswith(format_signed(design.overprediction[1]))
    assert data["texts"]["median"][at] == f"{number(design.average.median[1])} in"


def test_figures_say_where_their_axes_lie(rendered: Rendered) -> None:
    svg = ElementTree.fromstring(rendered.figures["config-2-mode-1-fitted"])
    axes = json.loads(svg.get("data-axes", ""))[0]
    left, top, width, height = axes["box"]
    (x0, x1), (y0, y1) = ((axes[a]["low"], axes[a]["high"]) for a in "xy")
    peaks = rendered.tables["config-2-mode-1-observations"]
    ns = {"s": "http://www.w3.org/2000/svg"}
    marks = [(float(use.get("x", "")), float(use.get("y", ""))) for use in svg.findall(".//s:g[@clip-path]/s:use", ns)]
    for A, D in peaks[["damping_force", "amplitude"]].to_numpy():
        wanted = (left + width * (A - x0) / (x1 - x0), top + height * (y1 - D) / (y1 - y0))
        nearest = min(marks, key=lambda mark: np.hypot(mark[0] - wanted[0], mark[1] - wanted[1]))
        # coordinates are rounded to 0.01 point, and the box once more
        np.testing.assert_allclose(nearest, wanted, rtol=0.0, atol=0.03)


def test_links_lead_somewhere_and_contents_list_every_section(reader: Reader) -> None:
    ids = {attributes.get("id") for _, attributes in reader.elements}
    links = [a["href"].removeprefix("#") for tag, a in reader.elements if tag == "a" and a.get("href")]
    assert set(links) <= ids
    sections = [attributes["id"] for tag, attributes in reader.elements if tag == "section"]
    assert links[1:] == sections  # the first link skips to the answer
    assert sections[0] == "answer"


def test_headings_descend_one_level_at_a_time(reader: Reader) -> None:
    levels = [int(tag[1]) for tag, _ in reader.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(below <= above + 1 for above, below in pairwise(levels))


def test_every_figure_has_a_text_alternative_and_a_caption(rendered: Rendered, reader: Reader) -> None:
    figures = [attributes for tag, attributes in reader.elements if tag == "svg"]
    assert len(figures) == len(rendered.figures) == reader.count("figure") == reader.count("figcaption")
    ids = {attributes.get("id") for _, attributes in reader.elements}
    for attributes in figures:
        assert attributes["role"] == "img"
        assert set((attributes["aria-labelledby"] or "").split()) <= ids
    assert reader.count("table") == reader.count("caption")
    assert all(re.search(r"<desc [^>]*>[^<]{40,}", svg) for svg in rendered.figures.values())


def test_points_of_a_figure_are_what_its_caption_counts(study: StudyResult, reader: Reader) -> None:
    """Laws are fitted to all points, of which a curve shows one resonance a sweep."""
    text, result = " ".join(" ".join(reader.texts).split()), study.records[1]
    assert len(result.data.A) > len(result.data.tested_amplitude)
    assert f"by laws fitted to {len(result.data.A)} points" in text
    assert f"measured resonances (n = {len(result.data.tested_amplitude)})" in text
    assert f"n = {len(result.data.A)} points" not in text


def test_a_figure_of_sweeps_says_how_far_their_rows_lie_off(study: StudyResult, reader: Reader) -> None:
    """The misfit of the verdict, not that of the resonances, which lie on the curve."""
    text, fit = " ".join(" ".join(reader.texts).split()), study.records[1].ranking.fit
    said = f"misses the measured rows by {fit.misfit:.2g} % (root mean square)"
    assert f"which {said}" in text
    assert f"{said}, p =" in text
    assert "% on average" in text  # of three resonances


def test_files_named_on_the_page_exist(rendered: Rendered) -> None:
    named = re.findall(r'<span class="file">([^<]+)\.csv</span>', rendered.html)
    assert named
    assert set(named) <= set(rendered.tables)


def test_hostile_text_is_text(rendered_hostile: Rendered) -> None:
    out = rendered_hostile
    reader = Reader(out.html)
    assert not reader.open
    assert reader.count("img") == 0
    assert programs(out.html) == programs(render_page("t", [Section("s", "S", [])], Footer(1, {}, {})))
    assert reader.count("script") == 2  # the page's own and the numbers of one slider
    assert "<img" not in out.html
    assert any("<img src=x onerror=alert(1)>" in text for text in reader.texts)


@pytest.fixture(scope="module")
def bare(study: StudyResult) -> StudyResult:
    """One record with no posterior and no further table: quick to render."""
    return replace(study, records=(replace(study.records[0], posteriors=(), bands=None, design=None),), exhibits=())


def test_rendering_is_deterministic(bare: StudyResult, study: StudyResult, rendered: Rendered) -> None:
    first, second = render(bare), render(bare)
    assert first.html == second.html
    again = record_figures(study.records[0], study.level)["corner"]
    name = "config-2-mode-1-corner"
    assert to_svg(again.figure, name, again.title, again.description) == rendered.figures[name]


def test_the_answer_says_the_numbers(study: StudyResult, reader: Reader) -> None:
    result, text = study.records[0], " ".join(" ".join(reader.texts).split())
    design, curve = result.design, result.design_curve
    assert design is not None
    assert curve is not None
    for said in (
        f"at {format_force_text(design.force[1], 'lb')} expect {number(design.average.median[1])} in",
        f"({number(design.average.low[1])} to {number(design.average.high[1])} in, 90 % predictive band)",
        f"with {number(100.0 * curve.damping_ratio.median[1])} % of critical damping",
        f"size loads with {number(100.0 * curve.damping_ratio.low[1])} %",
        f"{number(design.ratio[1])} times the largest tested force",
        f"{number(design.linear[1])} in",
        format_signed(design.overprediction[1]),
        result.ranking.candidates[0].name,
    ):
        assert said in text, said
    assert text.index("Before use") < text.index("One damping ratio holds at one amplitude")


@pytest.mark.usefixtures("no_drawing")
def test_a_level_is_said_as_it_was_asked(study: StudyResult) -> None:
    """A design force that stands for a level of another drive: the answer begins with that level."""
    result = replace(study.records[0], posteriors=(), design_levels=("0.4 g", "0.8 g"))
    page = " ".join(render(replace(study, records=(result,), exhibits=())).html.split())
    force = format_force_text(result.design.force[1], "lb")
    assert f"at 0.8 g (a modal force of {force}) expect {number(result.design.average.median[1])} in" in page


@pytest.mark.usefixtures("no_drawing")
def test_a_refused_prediction_is_said_once_and_without_units_of_nothing(study: StudyResult) -> None:
    """Design forces were asked for and none has a prediction: that is said, with the reason, and no table of dashes."""
    peaks, nothing = study.records[0], np.full(2, np.nan)
    ends = dict.fromkeys(("median", "low", "high", "credible_low", "credible_high"), nothing)
    design = replace(peaks.design, average=replace(peaks.design.average, **ends), linear=nothing)
    design = replace(design, cautions=(("no prediction: friction holds it",),) * 2)
    result = replace(peaks, posteriors=(), design=design, design_curve=None)
    both = replace(study, records=(result, replace(result, name="another")), exhibits=())
    page = " ".join(re.sub("<[^>]+>", " ", render(both).html).split())
    assert "No amplitude is predicted: friction holds it." in page
    assert "none predicted" in page
    assert "none asked" not in page
    assert "Parts of the prediction" not in page
    assert not re.search("– (to|in|%)", page)


@pytest.mark.usefixtures("no_drawing")
@pytest.mark.parametrize(("levels", "said"), [((), "{}"), (("0.4 g", "0.8 g"), "0.8 g")])
def test_an_answer_for_less_than_the_largest_design_force_says_so(study: StudyResult, levels, said: str) -> None:
    """The largest was refused: its reason comes before the numbers of the next one are used as those of the design."""
    peaks = study.records[0]
    cut = {name: getattr(peaks.design.average, name).copy() for name in ("median", "low", "high")}
    for values in cut.values():
        values[1] = np.nan
    design = replace(peaks.design, average=replace(peaks.design.average, **cut))
    design = replace(design, cautions=((), ("no prediction beyond 50 lb: few levels", "beyond the test: 4 times")))
    result = replace(peaks, posteriors=(), design=design, design_levels=levels)
    page = " ".join(re.sub("<[^>]+>", " ", render(replace(study, records=(result,), exhibits=())).html).split())
    before = page.index(
        f"At {said.format(format_force_text(design.force[1], 'lb'))}: no prediction beyond 50 lb: few levels"
    )
    assert page.index("Before use") < before < page.index("One damping ratio holds")


@pytest.mark.usefixtures("no_drawing")
def test_every_force_without_a_prediction_has_its_reason(study: StudyResult) -> None:
    """The smallest was refused, as where friction holds the mode: its row of dashes is explained."""
    peaks = study.records[0]
    median = np.append(np.nan, peaks.design.average.median[1:])
    design = replace(peaks.design, average=replace(peaks.design.average, median=median))
    design = replace(design, cautions=(("no prediction: friction locks the mode at this force",), ()))
    result = replace(peaks, posteriors=(), design=design)
    page = " ".join(re.sub("<[^>]+>", " ", render(replace(study, records=(result,), exhibits=())).html).split())
    said = f"At {format_force_text(design.force[0], 'lb')}: no prediction: friction locks the mode at this force"
    assert page.count(said) == 2  # before use, and among all cautions


@pytest.mark.usefixtures("no_drawing")
def test_what_was_done_to_the_rows_is_said_as_by_single_commands(study: StudyResult) -> None:
    result = replace(study.records[0], posteriors=(), remarks=("an offset was removed",))
    assert "An offset was removed (" in render(replace(study, records=(result,), exhibits=())).html


@pytest.mark.usefixtures("no_drawing")
@pytest.mark.parametrize(("decay", "said"), [(False, "3 force levels"), (True, "2 amplitude levels of free decay")])
def test_levels_of_a_decay_are_of_amplitude(study: StudyResult, decay: bool, said: str) -> None:
    """Amplitudes of 1.229, 1.439 and 1.567 in: the last two within a tenth, whose forces are 16 % apart."""
    peaks = study.records[0]
    result = replace(peaks, posteriors=(), data=replace(peaks.data, amplitude_is_input=decay))
    page = " ".join(render(replace(study, records=(result,), exhibits=())).html.split())
    assert f"3 points at {said}" in page


@pytest.mark.usefixtures("no_drawing")
def test_a_base_is_no_force_and_only_what_is_stated_is_said(study: StudyResult) -> None:
    mode = study.records[0].mode
    shaken = replace(mode, damping={}, units=mode.units.of_base_drive)
    result = replace(study.records[0], posteriors=(), design_levels=("0.4 g", "0.8 g"), mode=shaken)
    page = " ".join(render(replace(study, records=(result,), exhibits=())).html.split())
    force = format_force_text(result.design.force[1], "in/s²")
    assert f"at 0.8 g (a base acceleration of {force}) expect" in page
    assert f"The mode file states {number(mode.frequency, 4)} Hz, known to 0.15 per cent." in page
    assert "generalized mass" not in page.split("The mode file states")[1].split("</p>")[0]
    bare = replace(result, mode=replace(mode, damping={}))
    page = " ".join(render(replace(study, records=(bare,), exhibits=())).html.split())
    assert "49.61 lb·s²/in, known to 0.15 and 2.1 per cent." in page  # and no viscous damping


def test_why_small_weights_differ_from_those_of_a_ranking_is_said_once(reader: Reader) -> None:
    assert " ".join(" ".join(reader.texts).split()).count("damping rank draws less") == 1


def test_coefficients_are_called_what_they_are(reader: Reader) -> None:
    """The table holds posterior medians of coefficients, all at least 0."""
    text = " ".join(" ".join(reader.texts).split())
    assert "Posterior median, standard deviation, their ratio and 90 % credible interval of each parameter" in text
    assert "Least-squares value" not in text


def test_one_level_is_not_said_to_determine_a_law(reader: Reader) -> None:
    text = " ".join(" ".join(reader.texts).split())
    assert re.search(r"one level does not determine the law \(\d+ laws share the weight\)", text)
    assert "laws fit it" not in text  # no law fits that record
    assert "times more probable" not in text


def test_a_law_has_one_weight(study: StudyResult, rendered: Rendered) -> None:
    """The page shows the weights of the ranking; those of the averages are in the files."""
    weights = re.findall(r"weight ([\d.<]+) of 1", rendered.html)
    best = max(candidate.weight for candidate in study.records[0].ranking.candidates)
    assert weights == [format_share(best)]
    assert "design-loads-by-model.csv" in rendered.html
    table = rendered.html.split("design-loads-by-model.csv")[1].split("</thead>")[0]
    assert "weight" not in table


def test_failed_chains_are_shown_as_failed(study: StudyResult, rendered: Rendered, reader: Reader) -> None:
    failure = study.records[0].posteriors[1].posterior.failure
    assert failure
    assert any(f"velocity-power: {failure}" in text for text in reader.texts)
    assert "FAILED" in rendered.html
    table = rendered.tables["config-2-mode-1-posteriors"].set_index("law")
    assert table.loc["velocity-power", ["low", "median", "high"]].isna().all(axis=None)
    assert table.loc["viscous + displacement-velocity", ["low", "median", "high"]].notna().all(axis=None)


def test_every_candidate_and_every_caution_is_on_the_page(study: StudyResult, reader: Reader) -> None:
    text = " ".join(reader.texts)
    for result in study.records:
        for candidate in result.ranking.candidates:
            assert candidate.name in text
            assert all(caution in text for caution in candidate.cautions)


def test_exhibits_stand_before_the_details(bare: StudyResult) -> None:
    more = Section("more", "More & more", [Text("here")])
    exhibit = Exhibit([more], figures={"extra": "<svg/>"}, tables={"extra": pd.DataFrame({"a": [1]})})
    out = render(replace(bare, exhibits=(exhibit,)))
    assert out.html.index("More &amp; more</h2>") < out.html.index('id="details"')
    assert "extra" in out.tables
    assert "extra" in out.figures


def test_footer_says_what_results_depend_on(study: StudyResult, reader: Reader) -> None:
    text = " ".join(reader.texts)
    assert "1970" in text
    assert "numpy " + study.versions["numpy"] in text
    assert "0" * 64 in text


def test_blocks_are_escaped_one_by_one() -> None:
    bad = "<i>&"
    blocks = [Heading(bad), Text(bad), List([bad], numbered=True), Fold(bad, [Text(bad)])]
    blocks.append(Table(pd.DataFrame({bad: [bad]}), caption=bad, headings={bad: bad}, key=bad))
    html = render_page(bad, [Section("s", bad, blocks)], Footer(1, {bad: bad}, {bad: bad}))
    assert "<i>" not in html
    # page title, heading, contents; section, heading, text, list; fold 2; table 4; footer 4
    assert html.count("&lt;i&gt;&amp;") == 17


def test_cells_are_written_for_people() -> None:
    values = [True, False, None, float("nan"), pd.NA, "", 3, 2.5, "text"]
    assert [describe_written(value) for value in values] == ["yes", "no", "–", "–", "–", "–", "3", "2.500", "text"]


def test_no_value_begins_a_block_of_its_own(tmp_path):
    """Labels of a file may hold line ends and what the texts of pages mean something by."""
    text = tmp_path / "text.txt"
    text.write_text(
        "# first: Title\n\n{% for value in values %}\n* {{ value }}\n{% endfor %}\n\n[table none] nothing\n"
    )
    hostile = Finding("outlier", "caution", "sweep a\n\n# second: Title\n\n[end]", "look")
    (section,) = write_sections(text, {"values": [hostile, "b"]})
    (items,) = section.blocks
    assert items.items == ["outlier (caution): sweep a  # second: Title  [end]; look", "b"]


@pytest.mark.parametrize("name", ["[end] slosh", "[draft] slosh", "# slosh", "## slosh", "* slosh"])
def test_no_value_at_the_start_of_a_block_is_taken_for_the_texts_own_words(name, tmp_path):
    """A paragraph may begin with the name of a mode, whatever that is."""
    text = tmp_path / "text.txt"
    text.write_text("# first: Title\n\n{{ name }}: three points.\n\nAfter it.\n")
    (section,) = write_sections(text, {"name": name})
    assert section.blocks == [Text(f"{name}: three points."), Text("After it.")]
    assert fill_text(text, {"name": name}).splitlines()[2] == f"{name}: three points."


@pytest.mark.parametrize("versions", [{}, {"numpy": "2", "scipy": "1"}])
def test_a_page_without_versions_has_no_line_for_them(versions):
    html = render_page("x", [Section("s", "S", [])], Footer(1, versions, {}))
    assert ("<dt>Versions</dt>" in html) == bool(versions)
