"""Pages as a reader has them: in Chromium, narrow and wide, light and dark, by pointer and by keyboard, on paper."""

from __future__ import annotations

import json
import re
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from damping.report import format_between, format_share, format_signed, number
from damping.report.study import Rendered, render

ROOT = Path(__file__).parents[2]
#: Pages as committed; the study's own in every run of the tests.
COMMITTED = [
    path if path.parent.name == "saturn-v" else pytest.param(path, marks=pytest.mark.slow)
    for path in sorted((ROOT / "results").rglob("*.html"))
]
#: Widths of a telephone and of a desk screen, pixels.
WIDTHS = (390, 1280)
#: A page that can be sent by mail.
MOST_BYTES = 6_000_000


@pytest.fixture(scope="module")
def html(rendered: Rendered, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(rendered.html)
    return path


def test_page_is_quiet_fits_and_can_be_read(check_page, html):
    check_page(html, *((width, scheme) for scheme in ("light", "dark") for width in WIDTHS))


@pytest.mark.parametrize("path", COMMITTED, ids=lambda path: str(path.relative_to(ROOT)))
def test_committed_pages(check_page, path):
    assert path.stat().st_size < MOST_BYTES
    check_page(path, (390, "light"), (1280, "dark"))


def test_hostile_text_stays_text(opened, rendered_hostile, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(rendered_hostile.html)
    with opened(path) as one:
        one.page.locator(".explorer input").first.press("ArrowLeft")
        one.page.locator(".sort").first.click()
        assert one.complaints == []
        assert one.page.locator("img").count() == 0
        assert "<img src=x onerror=alert(1)>" in one.page.locator("h1").inner_text()


def shown(page, name: str) -> str:
    return page.locator(f'.explorer [data-shows="{name}"]').first.inner_text()


def test_slider_shows_the_tables(opened, html, rendered, study):
    design, units = study.records[0].design, study.records[0].mode.units
    with opened(html) as one:
        box = one.page.locator(".explorer")
        assert box.count() == 1
        for i, force in enumerate(design.force):
            box.get_by_role("button", name=f"{force:g} {units.force}").click()
            band = design.average
            assert shown(one.page, "median") == f"{number(band.median[i])} in"
            assert shown(one.page, "predictive") == format_between(band.low[i], band.high[i], "in")
            assert shown(one.page, "linear") == f"{number(design.linear[i])} in"
            over = (design.overprediction, design.overprediction_low, design.overprediction_high)
            assert shown(one.page, "over") == "{} ({} to {})".format(*(format_signed(values[i]) for values in over))
            assert shown(one.page, "ratio") == number(design.ratio[i])


def test_slider_moves_the_band_by_keyboard(opened, html):
    with opened(html) as one:
        slider = one.page.locator(".explorer input")
        data = json.loads(one.page.locator(".explorer script").text_content())
        axes = json.loads(one.page.locator("figure:has(.explorer) svg").get_attribute("data-axes"))[0]
        left, top, width, height = axes["box"]
        slider.focus()
        for key, i in (("Home", 0), ("ArrowRight", 1), ("ArrowRight", 2), ("End", len(data["force"]) - 1)):
            one.page.keyboard.press(key)
            assert slider.get_attribute("aria-valuetext") == data["texts"]["force"][i] == shown(one.page, "force")
            bar = one.page.locator(".cursor rect").first  # the predictive band at this force
            y, tall = (float(bar.get_attribute(name)) for name in ("y", "height"))
            x = float(bar.get_attribute("x")) + 0.5 * float(bar.get_attribute("width"))
            share = (data["force"][i] - axes["x"]["low"]) / (axes["x"]["high"] - axes["x"]["low"])
            of_top = [1.0 - data[name][i] / axes["y"]["high"] for name in ("high", "low")]  # the axis starts at 0
            ends = top + height * np.clip(of_top, 0.0, 1.0)
            # the same arithmetic on the same numbers
            np.testing.assert_allclose([x, y, y + tall], [left + width * share, *ends], rtol=0.0, atol=1e-6)


def test_tables_sort_by_keyboard_and_back(opened, html):
    with opened(html) as one:
        one.page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
        ranking = one.page.locator("table:has(caption:has-text('Every distinct law'))").first
        heads = ranking.locator("th")
        at = heads.all_inner_texts().index(next(t for t in heads.all_inner_texts() if t.startswith("−2 ln Z")))
        cells = ranking.locator(f"tbody td:nth-child({at + 1})")
        before = cells.all_inner_texts()
        button = heads.nth(at).locator("button")
        button.focus()
        one.page.keyboard.press("Enter")
        assert heads.nth(at).get_attribute("aria-sort") == "ascending"
        up = [value(text) for text in cells.all_inner_texts()]
        assert up == sorted(up)  # a value that does not exist is infinite: always last
        one.page.keyboard.press("Enter")
        assert heads.nth(at).get_attribute("aria-sort") == "descending"
        down = [v for v in (value(text) for text in cells.all_inner_texts()) if np.isfinite(v)]
        assert down == sorted(down, reverse=True)
        one.page.keyboard.press(" ")
        assert heads.nth(at).get_attribute("aria-sort") is None
        assert cells.all_inner_texts() == before


def value(text: str) -> float:
    return np.inf if text == "–" else float(text.replace("−", "-"))


@pytest.mark.parametrize(
    ("texts", "ordered"),
    [
        (["10", "9", "–", "−3.5"], ["−3.5", "9", "10", "–"]),
        (["1.2×10⁶", "3.0×10⁻⁵", "2"], ["3.0×10⁻⁵", "2", "1.2×10⁶"]),
        (["0.001", format_share(1e-9), "0.25"], [format_share(1e-9), "0.001", "0.25"]),
        (["+67 %", "−4 %", "+5 %"], ["−4 %", "+5 %", "+67 %"]),
        (["2.5 (2.1 to 3.0)", "0.9 (0.5 to 1.3)"], ["0.9 (0.5 to 1.3)", "2.5 (2.1 to 3.0)"]),
        (["4.3.13", "4.3.2", "Table 2.II"], ["4.3.2", "4.3.13", "Table 2.II"]),
    ],
)
def test_order_of_what_cells_say(opened, tmp_path, texts, ordered):
    import pandas as pd

    from damping.report.page import Footer, Section, Table, render_page

    path = tmp_path / "page.html"
    path.write_text(
        render_page("t", [Section("s", "S", [Table(pd.DataFrame({"a": texts}), caption="c")])], Footer(1, {}, {}))
    )
    with opened(path) as one:
        one.page.locator(".sort").click()
        assert one.page.locator("tbody td").all_inner_texts() == ordered


def test_every_sheet_of_a_long_table_has_its_headings(opened, tmp_path):
    """Counted in the PDF by the colour of a heading, which nothing else has."""
    import pandas as pd

    from damping.report.page import Footer, Section, Table, render_page

    path, table = tmp_path / "page.html", Table(pd.DataFrame({"a": range(200)}), caption="c")
    path.write_text(render_page("t", [Section("s", "S", [table])], Footer(1, {}, {})))
    with opened(path) as one:
        one.page.locator("th").evaluate("head => { head.style.color = '#0f0'; }")
        printed = one.page.pdf(format="A4")
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", printed, re.DOTALL)
    drawn = [zlib.decompress(stream) for stream in streams if stream[:1] == b"x"]  # deflated
    (sheets,) = re.findall(rb"/Type /Pages\s+/Count (\d+)", printed)
    assert int(sheets) >= 4
    assert sum(b"0 1 0 rg" in text for text in drawn) == int(sheets)


def test_no_heading_of_a_table_stands_alone_at_the_foot_of_a_sheet(opened, tmp_path):
    """Tables of one to four rows: on every sheet cells, told by their colour, are drawn after the last heading."""
    import pandas as pd

    from damping.report.page import Footer, Section, Table, render_page

    path, tables = (
        tmp_path / "page.html",
        [Table(pd.DataFrame({"a": range(1 + k % 4)}), caption="c") for k in range(80)],
    )
    path.write_text(render_page("t", [Section("s", "S", tables)], Footer(1, {}, {})))
    with opened(path) as one:
        for element, colour in (("th", "#0f0"), ("td", "#f00")):
            one.page.locator(element).evaluate_all(f"all => all.forEach(one => {{ one.style.color = '{colour}'; }})")
        printed = one.page.pdf(format="A4")
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", printed, re.DOTALL)
    sheets = [text for text in (zlib.decompress(s) for s in streams if s[:1] == b"x") if b"0 1 0 rg" in text]
    assert len(sheets) >= 4
    assert all(text.rfind(b"1 0 0 rg") > text.rfind(b"0 1 0 rg") for text in sheets)


def test_figures_say_their_values(opened, html, rendered):
    peaks = rendered.tables["config-2-mode-1-observations"].sort_values("amplitude")
    with opened(html) as one:
        figure = one.page.locator("#sweeps figure").first
        figure.scroll_into_view_if_needed()
        figure.locator(".scroll").focus()
        for F, A in peaks[["damping_force", "amplitude"]].to_numpy():
            one.page.keyboard.press("ArrowRight")
            said = [float(text) for text in re.findall(r": (-?[\d.]+)", one.page.locator(".said").inner_text())]
            # coordinates are rounded to 0.01 point of some 400, and written to a thousandth of the axis
            np.testing.assert_allclose(said, [F, A], rtol=2e-3, atol=0.0)
        one.page.keyboard.press("Escape")
        assert not one.page.locator(".tip").is_visible()
        mark = figure.locator("g[clip-path] > use").first.bounding_box()
        one.page.mouse.move(mark["x"] + mark["width"] / 2 + 3, mark["y"] + mark["height"] / 2)
        assert "resonant amplitude (in): 1.2" in one.page.locator(".tip").inner_text()
        assert one.page.locator(".ring").count() == 1


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_reader_chooses_light_or_dark(opened, html, scheme):
    with opened(html, scheme=scheme) as one:
        paper, flip = look(one.page)
        assert (flip != "none") is (scheme == "dark")
        one.page.get_by_role("button", name="Dark page" if scheme == "light" else "Light page").click()
        changed = look(one.page)
        assert changed[0] != paper
        assert (changed[1] != "none") is (scheme == "light")
        one.page.locator(".theme").click()
        assert look(one.page) == [paper, flip]


def look(page) -> list[str]:
    """Colour of the paper and the filter of figures."""
    return page.evaluate(
        """() => [getComputedStyle(document.body).backgroundColor,
                  getComputedStyle(document.querySelector("figure svg")).filter]"""
    )


def test_every_control_is_reached_by_tab_and_shows_it(opened, html):
    with opened(html) as one:
        wanted = one.page.evaluate(
            """() => [...document.querySelectorAll("a, button, input, summary, [tabindex='0']")]
                .filter((element) => element.checkVisibility())
                .map((element, i) => { element.dataset.stop = i; return i; })"""
        )
        reached = set()
        for _ in range(len(wanted) + 5):
            one.page.keyboard.press("Tab")
            stop, outline = one.page.evaluate(
                """() => [document.activeElement.dataset.stop, getComputedStyle(document.activeElement).outlineStyle]"""
            )
            if stop is not None:
                assert outline != "none"
                reached.add(int(stop))
        assert reached == set(wanted)


def test_without_scripts_everything_is_there_and_nothing_is_dead(opened, html, rendered):
    with opened(html, scripts=False) as one:
        assert one.page.locator("table").count() == rendered.html.count("<table>")
        assert one.page.locator("figure svg").first.is_visible()
        assert not one.page.locator(".explorer").is_visible()
        assert not one.page.locator(".theme").is_visible()
        assert one.page.locator(".sort").count() == 0


def test_on_paper_there_is_what_paper_can_hold(opened, html):
    with opened(html, scheme="dark") as one:
        one.page.emulate_media(media="print")
        for name in (".explorer", ".theme", "nav", ".skip", ".cursor"):
            assert not one.page.locator(name).first.is_visible(), name
        assert look(one.page) == ["rgb(255, 255, 255)", "none"]
        one.page.set_viewport_size({"width": 688, "height": 1009})  # A4 less the margins, at 96 dots per inch
        right = "getBoundingClientRect().right"
        cut = f"all => all.filter(one => one.{right} > one.closest('figure').{right} + 1)"
        assert one.page.locator("figure svg:visible").evaluate_all(f"{cut}.length") == 0  # no figure runs into the next
        small = one.page.locator("td", has_text=format_share(1e-9))
        assert small.count() > 0
        lines = """cells => cells.map((cell) => { const range = document.createRange(); range.selectNodeContents(cell);
            return new Set([...range.getClientRects()].map((box) => Math.round(box.top))).size; })"""
        assert set(small.evaluate_all(lines)) <= {0, 1}  # 0: folded away; "<" never stands on a line of its own
        assert one.page.pdf(format="A4").startswith(b"%PDF")


def test_tables_fit_into_a_small_window(opened, html):
    """1000 pixels; tables that are folded away may be wider, and scroll."""
    wide = "(all) => all.filter((s) => s.offsetParent && s.scrollWidth > s.clientWidth + 1).map((s) => s.innerText)"
    with opened(html, width=1000) as one:
        assert one.page.locator("main .scroll table").count() > 3
        assert one.page.locator("main .scroll").evaluate_all(wide) == []


def test_the_answer_and_its_cautions_are_above_the_fold(opened, study, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(render(replace(study, records=study.records[:1])).html)
    with opened(path) as one:
        box = one.page.locator("#answer .callout").bounding_box()
        assert box["y"] + box["height"] < 900
    with opened(path, width=390) as one:
        for figure in one.page.locator("main > section .row figure svg").all():
            if figure.is_visible():
                assert figure.bounding_box()["width"] <= 390  # seen whole, without scrolling sideways


def test_screens_are_few_and_short(opened, html):
    with opened(html) as one:
        assert one.page.evaluate("document.documentElement.scrollHeight") < 9000
        assert len(one.page.locator("main").inner_text().split()) < 2500
