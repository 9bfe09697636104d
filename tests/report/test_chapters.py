"""The chapters on the page: every figure and table, sentences that say the tables' numbers, errata with proofs."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from damping.report import number
from damping.report.page import Block, FigureBlock, Fold, List, Table, Text
from damping.report.results import StudyResult
from damping.report.study import Rendered, render
from damping_reed1970 import (
    ReportPart,
    chapter_of,
    describe_agreement_text,
    describe_columns,
    describe_in_symbols,
    load_text,
)
from damping_reed1970.chapter_2.page import AMPLITUDES, tabulate_energies_at, tabulate_lumped_masses
from damping_reed1970.chapter_3.study import Chapter3
from damping_reed1970.chapter_4.page import tabulate_spreads
from damping_reed1970.chapter_5.page import tabulate_regression_rows
from damping_reed1970.exhibit import exhibit, report_parts
from damping_reed1970.reproduction import count_agreements, evidence
from damping_reed1970.studies import Gaps, ReportResults, Studies

FIGURES = {"2.4", "2.5", "3.2", "3.3", "3.5", "3.6", "3.9", "3.10", *(f"4.{n}" for n in range(1, 11)), "5.1"}


@pytest.fixture(scope="module")
def results(
    studies: Studies, chapter_3: Chapter3, tables_of_source: dict[str, pd.DataFrame], gaps: Gaps
) -> ReportResults:
    return ReportResults(studies, chapter_3, tables_of_source, gaps)


@pytest.fixture(scope="module")
def parts(results: ReportResults) -> list[ReportPart]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)  # it takes a while
        return report_parts(results)


@pytest.fixture(scope="module")
def rendered(study: StudyResult, results: ReportResults, parts: list[ReportPart]) -> Rendered:
    """The page with the chapters, which are drawn once."""
    bare = replace(study.records[0], posteriors=(), bands=None, design=None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("damping_reed1970.exhibit.report_parts", lambda results: parts)
        return render(replace(study, records=(bare,), exhibits=(exhibit(results, {}),)))


def inside(blocks: Iterable[Block]) -> Iterable[Block]:
    """Blocks with those behind folds."""
    for block in blocks:
        yield block
        if isinstance(block, Fold):
            yield from inside(block.blocks)


def said(part: ReportPart) -> str:
    """Every sentence of a part."""
    texts = [block.text for block in part.section.blocks if isinstance(block, Text)]
    return " ".join([*texts, *(item for b in part.section.blocks if isinstance(b, List) for item in b.items)])


def find(parts: list[ReportPart], name: str) -> ReportPart:
    return next(part for part in parts if part.section.id == name)


def test_every_figure_of_the_report_is_shown_once(parts: list[ReportPart]) -> None:
    captions = [b.caption for part in parts for b in inside(part.section.blocks) if isinstance(b, FigureBlock)]
    numbered = [re.match(r"Figs?\. ([\d., and]+?) (?:redrawn|counterpart):", caption) for caption in captions]
    shown = [n for found in numbered if found for n in re.findall(r"\d\.\d+", found[1])]
    assert sorted(shown) == sorted(FIGURES)
    files = [name for part in parts for name in part.figures]
    assert len(files) == len(set(files)) == len(captions)
    for figure in (one for part in parts for one in part.figures.values()):
        assert figure.svg.startswith("<svg")
        title, description = re.findall(r"<(?:title|desc) id=[^>]+>([^<]+)</", figure.svg)
        assert html.unescape(title)[1:] in figure.caption or figure.file == "reproduction"
        assert html.unescape(description) in figure.caption or figure.file == "reproduction"


def test_every_part_is_a_page_that_the_report_links(rendered: Rendered, results: ReportResults) -> None:
    names = [*(f"chapter-{n}" for n in range(2, 7)), "gaps", "reproduction", "errata"]
    assert list(rendered.pages) == [f"reproduction/{name}" for name in names]
    linked = re.findall(r'<a href="(reproduction/[^"]+)\.html"', rendered.html)
    assert linked == list(rendered.pages)
    anchors = re.findall(r'<section id="([^"]+)"', rendered.html)
    assert anchors[-2:] == ["source-report", "details"]
    assert not set(anchors) & set(names)
    for name, page in zip(names, rendered.pages.values(), strict=True):
        first, *headings, last = re.findall(r'<section id="([^"]+)"', page)
        assert (first, last) == (name, "others")
        assert headings == [f"{name}-{n}" for n in range(1, len(headings) + 1)]
        assert 'href="../report.html"' in page
        others = re.findall(r'<a href="([a-z0-9-]+)\.html"', page)
        assert others == [other for other in names if other != name]
    named = {name for page in rendered.pages.values() for name in re.findall(r'class="file">([^<]+)\.csv</span>', page)}
    assert named <= set(rendered.tables)
    assert set(results.tables) <= set(rendered.tables)


def test_every_printed_number_and_figure_is_on_a_page(rendered: Rendered, results: ReportResults) -> None:
    """Nothing of the reproduction was lost when it left the report's page."""
    ids = re.findall(r"<td[^>]*>([a-z]+[\dIV]*\S*\.\S+|[a-z]+\d+\S*)</td>", rendered.pages["reproduction/reproduction"])
    assert set(results.tables["reproduction"]["id"]) <= set(ids)
    drawn = sum(page.count("<svg") for page in rendered.pages.values())
    assert drawn == sum(name.startswith(("chapter-", "gap-", "reproduction")) for name in rendered.figures)


def test_no_page_is_large_or_shows_a_long_table_unfolded(rendered: Rendered) -> None:
    for name, page in rendered.pages.items():
        # a page that a browser opens at once
        assert len(page) < 1_500_000, name
        long = [t for t in re.findall(r"<details>.*?</details>|<table>.*?</table>", page, re.DOTALL)
                if t.startswith("<table>") and t.count("<tr>") > 40]  # fmt: skip
        assert long == [], name
    # beside this record's, which is bare here, the report's own page keeps one short section of the reproduction
    text = re.search(r'<section id="source-report".*?</section>', rendered.html, re.DOTALL)
    assert text
    assert len(re.sub(r"<[^>]+>", " ", text[0]).split()) < 120


def test_every_table_of_the_chapters_is_a_file(parts: list[ReportPart], results: ReportResults) -> None:
    files = {name for part in parts for name in part.tables}
    for name in results.studies.tables():
        assert any(file.endswith(f"_{name}") for file in files), name
    assert {f"chapter_3_{name}" for name in results.chapter_3.tables} <= files


def test_sentences_say_the_numbers(parts: list[ReportPart], results: ReportResults) -> None:
    tables = results.tables
    laws = tables["power_laws"].set_index(["mode", "form", "inputs"])
    whole = tables["section_4_3_example"].set_index("quantity").loc["error of linear, over all laws"]
    means = results.chapter_3.tables["branch_means"].set_index("choice")["C_1"]
    false = results.studies.false.selection.set_index(["terms", "method", "noise_percent"])
    share = false.loc[("nine terms (5.3.6)", "backward elimination, |T| >= 2", 3.0), "share_false"]
    summary = tables["section_6_1"].drop_duplicates(["mode", "equation", "configuration"])
    expected = {
        "chapter-2": ["1 at 3.00 A₁"],
        "chapter-3": [
            "two roots at 13 of 15 points", "none at points 10 and 13", "points 1 to 6, 14 and 15",
            f"every low root gives {number(means['every low root'])}",
        ],
        "chapter-4": [
            f"p = {number(laws.loc[(1, 'velocity-power', 'corrected'), 'p'], 4)} for mode 1",
            f"all laws by weight {whole['recomputed']:.0f} per cent",
            "Mode 1, damping factor ξ: of the report's cases V, α = 1",
        ],
        "chapter-5": [f"{100 * share:.0f} per cent of the runs", "6 from the recovered inputs"],
        "chapter-6": [f"Of 14 laws {int(summary['printed_reproduces'].sum())} as printed", "E4-1", "E43-4"],
    }  # fmt: skip
    for name, sentences in expected.items():
        text = said(find(parts, name))
        for sentence in sentences:
            assert sentence in text, f"{name}: {sentence}"


def test_energies_of_the_slip_joint(results: ReportResults) -> None:
    at = tabulate_energies_at(results.studies.slip.energies)
    A = np.array(AMPLITUDES)
    # K - K1 = 3/4, A1 = 1: exact 4 (K - K1)(A - 1) and printed (K - K1)(A^2 - 1) (erratum E243); read off a table of
    # 300 amplitudes by straight lines, which misses a parabola by (step)^2/8 of its curvature, 3e-4 at most
    np.testing.assert_allclose(at["exact"], 3.0 * (A - 1.0), rtol=1e-9, atol=0.0)
    np.testing.assert_allclose(at["printed"], 0.75 * (A**2 - 1.0), rtol=0.0, atol=1e-3)


def test_lumped_masses_have_their_closed_form() -> None:
    found = tabulate_lumped_masses()
    j = np.arange(1, 4)
    # LAPACK's symmetric eigenvalues: a few units of rounding, more where they are squared away from 0
    np.testing.assert_allclose(found["omega"], found["omega_closed_form"], rtol=0.0, atol=1e-12)
    # sum_i cos^2((i - 1/2) j pi/4) = 2, scaled to 1 at the first mass; the fourth moves with it or against it
    np.testing.assert_allclose(found["mass"][1:], 2.0 / np.cos(j * np.pi / 8.0) ** 2, rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(found["force"], [1.0, -1.0, 1.0, -1.0], rtol=1e-12, atol=0.0)
    joints = found.filter(like="joint").sum(axis=1)
    np.testing.assert_allclose(joints, found["C"], rtol=1e-11, atol=1e-12)


def test_spreads_are_those_of_the_levels(results: ReportResults) -> None:
    variations = results.studies.tables()["level_variations"]
    wide = tabulate_spreads(variations).set_index("case")
    assert len(wide) == variations["case"].nunique()
    xi = results.studies.levels[1, "xi"].variations.drop_duplicates("case").set_index("case")["spread_percent"]
    assert wide.loc["III", "mode 1, damping factor ξ"] == xi["III"]


def test_regressions_side_by_side(results: ReportResults) -> None:
    rows = tabulate_regression_rows(results.tables["regressions"])
    reported = rows[rows["fit"].isin(["E1", "E2", "E3", "E4"])]
    # printed to three or four digits from the recovered inputs (errata E5III-1 to E5IV-2): half a unit of the last one
    np.testing.assert_allclose(reported["from recovered or made"], reported["printed"], rtol=3e-3, atol=0.0)
    assert len(rows) == results.tables["regressions"].groupby(["fit", "term"]).ngroups


def test_counts_of_the_reproduction(results: ReportResults) -> None:
    rows = results.tables["reproduction"]
    table = count_agreements(rows).set_index("chapter")
    assert table.loc["all", "printed numbers"] == len(rows) == 479
    assert table.loc["all", "with erratum"] == (rows["erratum"] != "").sum()
    kinds = ["printed digits", "last digit", "0.5 per cent", "2 per cent", "no"]
    assert (table[kinds].sum(axis=1) == table["printed numbers"]).all()
    assert {chapter_of(identity) for identity in rows["id"]} == {2, 3, 4, 5}
    text = describe_agreement_text(rows[rows["id"].map(chapter_of) == 4])
    assert text.startswith(f"Of the {table.loc['chapter IV', 'printed numbers']} numbers")


def test_errata_come_with_their_proof_and_their_numbers(parts: list[ReportPart], results: ReportResults) -> None:
    errata = load_text("errata")
    shown = [b.frame for b in inside(find(parts, "errata").section.blocks) if isinstance(b, Table)]
    assert [len(frame) for frame in shown] == [int((errata["severity"] == s).sum()) for s in "ABC"]
    together = pd.concat(shown)
    assert {text.split(",")[0] for text in together["erratum"]} == set(errata["id"])
    assert (together["proof"].str.len() > 5).all()
    numbers = evidence(results.tables["reproduction"])
    assert set(numbers) <= set(errata["id"])
    assert numbers["E4-1"] == "eq4211.c1: 0.5486 → 1.097"
    proof = together.loc[together["erratum"].str.startswith("E4-1,"), "proof"].iloc[0]
    assert "Recomputed here: eq4211.c1: 0.5486 → 1.097." in proof


@pytest.mark.parametrize(
    ("plain", "expected"),
    [
        ("c1=2*xi_1*M*w_n", "c1=2·ξ_1·M·ω_n"),
        ("C5 pi A^2 w + (pi/4)A^4 w", "C5 π A² ω + (π/4)A⁴ ω"),
        ("A^2.5 -> 2pi*1.808", "A^2.5 → 2π·1.808"),
        ("with the view of a pixel", "with the view of a pixel"),
        ("|Q| Qd, sin wt", "|Q| Q̇, sin ωt"),
    ],
)
def test_proofs_in_symbols(plain: str, expected: str) -> None:
    assert describe_in_symbols(plain) == expected


def test_columns_have_symbols_and_units() -> None:
    names = ["rms_error_in_lb", "omega_rad_s", "A_printed_in", "printed_in_interval", "noise_percent", "ξ_1, in"]
    said = ["rms error, in-lb", "ω, rad/s", "A printed, in", "printed in interval", "noise, per cent", "ξ_1, in"]
    assert list(describe_columns(pd.DataFrame(columns=names)).values()) == said


def test_gaps_name_the_second_plane_and_the_missing_damping(results: ReportResults, parts: list[ReportPart]) -> None:
    """The second plane lies where least squares of the two-plane receptance have it: see tests/gap/test_history.py.

    11.48 to 11.51 rad/s with one damping for both planes (section 3.1), 11.46 where each has its own.
    """
    found = find(parts, "gaps")
    plane = re.search(r"The second plane lies at ([\d.]+) rad/s", said(found))
    assert plane
    assert 11.46 <= float(plane[1]) <= 11.51
    assert results.gaps["1"].leading.effects == ("planar-coupling",)
    assert "Damping grows with amplitude" in said(found)
    shown = found.tables["gap_configuration_2"]
    assert shown["probability"].sum() == pytest.approx(1.0)
    assert set(found.figures) >= {"gap-configuration-1-overlay", "gap-configuration-2-overlay"}
