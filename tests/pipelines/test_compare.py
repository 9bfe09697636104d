"""``damping compare`` and ``damping verify``: what the page says, and folders that are not what they seem."""

from __future__ import annotations

import json
import re
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from damping.ranking.sharing import tabulate_rows, weigh_sharing
from damping_pipelines.compare_page import RecordSummary
from damping_pipelines.manifest import MANIFEST, digest, publish
from tests.html import Reader

HOSTILE = "<script>alert(1)</script>"
POSTERIORS = (
    "law,weight,parameter,unit,prior_low,prior_median,prior_high,low,median,high,converged\n"
    "viscous,0.7,viscous,lb·s/in,0.1,1,10,1.1,{median},1.3,True\n"
    "'=cmd,0.3,{hostile},,0.1,1,10,,,,False\n"
)


def summary(median: float = 2.0, weight: float = 0.7, **changes: Any) -> dict[str, Any]:
    loads = {"force": 45.0, "median": median, "low": 1.8, "high": 2.3, "linear": 2.6, "extra": 1}
    models = [
        {"rank": 1, "name": "viscous", "forces": [], "weight": weight, "held_out_error": 3.0},
        {"rank": 2, "name": "velocity-squared", "forces": [], "weight": 1.0 - weight, "held_out_error": None},
        {"rank": None, "name": HOSTILE, "forces": [], "weight": None},
    ]
    ratio = {"median": 0.00558, "low": 0.00485, "high": 0.0077}
    row = {"amplitude": 0.5, "frequency": 2.716, "damping_ratio": ratio, "tested": True}
    record = {
        "name": "panel",
        "title": f"Panel {HOSTILE}",
        "units": {"force": "lb", "length": "in"},
        "rank": {"format": "rank/1", "criterion": "c", "models": models},
        "loads": {"format": "loads/1", "level": 0.9, "predictions": [loads]},
        "curve": {"format": "curve/1", "level": 0.9, "rows": [row, row | {"amplitude": 9.0, "tested": False}]},
        "power_laws": [{"form": "velocity-power", "p": 1.65, "std_error": 0.039, "p_high": 2.144, "level": 0.95}],
    } | changes
    return {"format": "study/1", "title": HOSTILE, "seed": 1, "level": 0.9, "records": [record]}


def study(
    folder: Path, form: dict[str, Any] | str, median: float = 1.2, inputs: str = "0", name: str = "panel.csv"
) -> Path:
    text = form if isinstance(form, str) else json.dumps(form)
    posteriors = POSTERIORS.format(median=median, hostile=HOSTILE)
    files = {"summary.json": text.encode(), "panel-posteriors.csv": posteriors.encode()}
    publish(folder, files, seed=1, versions={"numpy": "2"}, inputs={name: inputs * 64})
    return folder


def power_study(folder: Path, rows: str, **changes: Any) -> Path:
    """A study that found a power law and keeps its observations."""
    models = [{"rank": 1, "name": "velocity-power", "forces": [], "weight": 1.0, "held_out_error": 3.0}]
    form = summary(rank={"format": "rank/1", "criterion": "c", "models": models}, **changes)
    files = {"summary.json": json.dumps(form).encode(), "panel-observations.csv": rows.encode()}
    publish(folder, files, seed=1, versions={"numpy": "2"}, inputs={"panel.csv": digest(rows.encode())})
    return folder


@pytest.fixture
def compared(tmp_path, damping):
    """``compared(*folders)``: the HTML of the page about these studies, which is written without a word."""

    def compare(*folders: Path) -> str:
        run = damping("compare", *folders, "--out", tmp_path / "page.html")
        assert (run.code, run.err) == (0, "")
        return (tmp_path / "page.html").read_text()

    return compare


@pytest.fixture
def refused(tmp_path, damping):
    """``refused(*folders)``: the one line that is said where nothing is written."""

    def compare(*folders: Path) -> str:
        run = damping("compare", *folders, "--out", tmp_path / "page.html")
        assert (run.code, run.err.count("\n")) == (2, 1)
        assert not (tmp_path / "page.html").exists()
        return run.err

    return compare


def rows_of(html: str, caption: str) -> list[list[str]]:
    """Cells of each row of the table whose caption begins so."""
    table = html[html.index(f"<caption>{caption}") :].split("<tbody>", 1)[1].split("</tbody>")[0]
    return [re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row) for row in table.split("<tr>")[1:]]


def as_number(written: str) -> float:
    """8.04×10⁻⁹ as a number."""
    mantissa, _, exponent = written.partition("×10")
    return float(f"{mantissa}e{exponent.translate(str.maketrans('⁰¹²³⁴⁵⁶⁷⁸⁹⁻', '0123456789-'))}")


def test_records_are_fitted_jointly(tmp_path, damping, compared, peaks):
    """Exponents of 1.2 and 2.2 are not one: the page says so, with the values of each."""
    F = np.geomspace(1.0, 8.0, 8)
    made = [tabulate_rows(peaks(F ** (1.0 / p), F, 10.0)).to_csv(index=False) for p in (1.2, 2.2)]
    one, two = (power_study(tmp_path / name, rows) for name, rows in zip("ab", made, strict=True))
    html = compared(one, two)
    text = Reader(html).text
    assert "medians with 90 % intervals, in all records and in each alone" in text
    labels, (odds, *values) = zip(*rows_of(html, "Joint fits with one exponent"), strict=True)
    title = f"Panel {escape(HOSTILE)}"
    assert labels == ("odds of one value", "one value", f"a: {title}", f"b: {title}")
    found = re.search(r" is ([0-9.]+×10[⁰¹²³⁴⁵⁶⁷⁸⁹]+) times more probable than one law in all", text)
    assert found
    np.testing.assert_allclose(as_number(odds) * as_number(found[1]), 1.0, rtol=0.05)  # one of them is to two digits
    pooled, *alone = [[float(part) for part in re.findall(r"[0-9.]+", value)] for value in values]
    assert alone[0][1] <= 1.2 <= alone[0][2] < alone[1][1] <= 2.2 <= alone[1][2]
    assert alone[0][0] < pooled[0] <= alone[1][0]  # a compromise of the two
    assert "run them again" not in text
    for broken, code in ((made[0].replace("1.0,", "nan,", 1), 2), (made[0].replace("force_in_phase", "x"), 0)):
        three = power_study(tmp_path / f"c{code}", broken)
        assert damping("compare", one, three, "--out", tmp_path / "page.html").code == code
    assert "run them again" in (tmp_path / "page.html").read_text()


def test_a_record_in_two_studies_counts_once(tmp_path, compared, peaks):
    """The same rows in two studies of other settings are no second evidence for a law: two records, not three."""
    F = np.geomspace(1.0, 8.0, 8)
    made = [tabulate_rows(peaks(F ** (1.0 / p), F, 10.0)).to_csv(index=False) for p in (1.2, 2.2)]
    folders = [power_study(tmp_path / name, rows) for name, rows in zip("abc", (*made, made[0]), strict=True)]
    manifest = json.loads((folders[2] / MANIFEST).read_text())
    manifest["inputs"]["STUDY.toml"] = "1" * 64  # as where a title was changed
    (folders[2] / MANIFEST).write_text(json.dumps(manifest))
    converted = tabulate_rows(peaks(0.0254 * F ** (1.0 / 1.2), 4.4482216 * F, 10.0)).to_csv(index=False)
    folders.append(power_study(tmp_path / "d", converted, units={"force": "N", "length": "m"}))
    assert "each of 2 records (a: Panel" in Reader(compared(*folders)).text


def test_two_studies_side_by_side(tmp_path, compared):
    one, two = study(tmp_path / "spring", summary()), study(tmp_path / "autumn", summary(2.2, 0.4), 1.5, "1")
    html = compared(one, two)
    page = Reader(html)
    assert page.count("script") == 1  # the page's own
    assert all(address.startswith("#") for address in page.addresses)
    assert "http://" not in html.replace("http://www.w3.org/", "")
    for said in (
        "viscous leads in spring and velocity-squared leads in autumn",
        "Not the same input in every study: panel.csv",
        "0.558 % (0.485 to 0.770 %)",  # damping ratio at the top of the test
        "the odds are 0.92 to 1",  # 0.7 viscous in one, 0.4 in the other: (0.7*0.4 + 0.3*0.6)*2 = 0.92
        "+10",  # per cent from 2.0 to 2.2
        "damping at the top of its test with its 90 % predictive band",
        "Resonant amplitude at design forces (lb and in), ends of the 90 % predictive band",
        HOSTILE,  # as text
        "=cmd",
    ):
        assert said in page.text, said
    assert compared(one, two) == html


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("spring/panel.csv", "0", None),  # the same file, from another folder
        ("panel.csv", "1", "Not the same input in every study: panel.csv."),
        ("other.csv", "1", "Not the same input in every study: panel.csv and other.csv."),
    ],
)
def test_inputs_are_the_same_where_their_contents_are(tmp_path, compared, name, content, said):
    """The page promises to name what differs, and a path is no difference."""
    one, two = study(tmp_path / "a", summary()), study(tmp_path / "b", summary(2.2), 1.5, content, name)
    found = re.search("Not the same input.*", Reader(compared(one, two)).text)
    assert (found and found[0]) == said


def test_studies_of_different_records_differ_by_no_input(tmp_path, compared):
    """Their files are different data, not different settings of the same; an exponent has the digits of its interval.

    Of three levels the interval is 12.7 standard errors to either side.
    """
    laws = [{"form": "velocity-power", "p": 1.4712, "std_error": 0.0012, "p_high": 1.4737, "level": 0.95}]
    other = summary(2.2, power_laws=laws, name="tail")
    one, two = study(tmp_path / "a", summary()), study(tmp_path / "b", other, 1.5, "1", "tail.csv")
    html = compared(one, two)
    text = Reader(html).text
    assert "No record is in every study" in text
    assert "Not the same input" not in text
    exponents = [row[-1] for row in rows_of(html, "Every record")]
    assert exponents == ["1.65 ± 0.49", "1.4712 ± 0.0025"]
    assert "exponent p of F in proportion to A^p, ± half the width of its 95 % interval." in text


def test_bands_are_said_to_have_the_level_of_their_study(tmp_path, compared):
    folders = study(tmp_path / "one", summary() | {"level": 0.8}), study(tmp_path / "two", summary(2.2), 1.5, "1")
    assert "with its 80 and 90 % predictive band" in Reader(compared(*folders)).text


def test_the_title_says_what_is_compared(tmp_path, damping):
    form = summary()
    form["records"].append({**form["records"][0], "name": "other"})
    assert damping("compare", study(tmp_path / "one", form), "--out", tmp_path / "page.html").code == 0
    assert "<h1>Records of a study side by side</h1>" in (tmp_path / "page.html").read_text()


@pytest.mark.parametrize("name", ["summary.json", "panel-posteriors.csv", MANIFEST])
def test_files_of_a_study_are_not_written_over(tmp_path, damping, name):
    one, two = study(tmp_path / "a", summary()), study(tmp_path / "b", summary(2.2))
    before = (two / name).read_bytes()
    run = damping("compare", one, two, "--out", two / ".." / "b" / name)
    assert run.code == 2
    assert "--out is one of the inputs, which are never overwritten; expected another file\n" in run.err
    assert (two / name).read_bytes() == before
    assert damping("compare", one, two, "--out", two / "compared.html").code == 0


def test_studies_that_share_nothing(tmp_path, compared):
    two = study(tmp_path / "b", summary(name="other", loads=None, units={}))
    text = Reader(compared(study(tmp_path / "a", summary()), two)).text
    assert all(said in text for said in ("No record is in every study.", "Not in b.", "Not in a."))


def test_other_units_are_not_drawn_together(tmp_path, compared):
    two = study(tmp_path / "b", summary(units={"force": "N", "length": "m"}))
    text = Reader(compared(study(tmp_path / "a", summary()), two)).text
    assert "in different units: amplitudes and coefficients cannot be compared" in text


def test_names_that_are_alike(tmp_path, damping, compared):
    one, two = study(tmp_path / "x" / "out", summary()), study(tmp_path / "y" / HOSTILE.replace("/", ""), summary())
    three = study(tmp_path / "y" / "out", summary())
    page = Reader(compared(one, two, three))
    assert page.count("script") == 1
    assert all(name in page.text for name in ("x/out", "y/out"))  # the shortest ends that differ
    assert str(tmp_path) not in page.text
    again = damping("compare", one, tmp_path / "x" / ".." / "x" / "out", "--out", tmp_path / "p.html")
    assert (again.code, again.err) == (2, "damping: a folder is given twice; expected different folders\n")
    assert damping("compare", one, "--out", tmp_path / "p.html").code == 2
    assert damping("compare", *[one] * 9, "--out", tmp_path / "p.html").code == 2


@pytest.mark.parametrize("name", ["summary.json", "panel-posteriors.csv"])
def test_files_of_two_runs_are_refused(tmp_path, damping, refused, name):
    one, two = study(tmp_path / "a", summary()), study(tmp_path / "b", summary(2.2), 1.5)
    (two / name).write_bytes((one / name).read_bytes())
    said = f"{name}: is not from the run of the manifest; expected files of one run; run it again"
    assert said in refused(one, two)
    run = damping("verify", one, two)
    assert run.code == 2
    assert run.out == f"{one}: 2 files of one run, seed 1\n"


@pytest.mark.parametrize(
    ("form", "message"),
    [
        ("{", "Invalid JSON"),
        ("[]", "summary.json"),
        (json.dumps(summary(name="../up")), "records.0.name"),
        (json.dumps(summary(rank=None)), "records.0.rank"),
        (json.dumps(summary(weight=float("inf"))), "records.0.rank.models.0.weight"),
        (json.dumps(summary() | {"format": "study/9"}), "format"),
    ],
)
def test_summaries_that_are_none(tmp_path, refused, form, message):
    assert message in refused(study(tmp_path / "a", summary()), study(tmp_path / "b", form))


def test_results_of_a_campaign_name_the_study_to_run(tmp_path, refused):
    """They hold no ranking that could be compared; its study.toml leads to one."""
    publish(tmp_path / "sine", {"campaign.json": b"{}"}, seed=1, versions={}, inputs={"a.h5": "0" * 64})
    publish(tmp_path / "fleet", {"fleet.html": b"-"}, seed=1, versions={}, inputs={"a": "0" * 64})
    other = study(tmp_path / "b", summary())
    said = f"not of a study; expected the folder that damping study {tmp_path}/sine/study.toml writes"
    assert said in refused(tmp_path / "sine", other)
    said = f"{tmp_path}/fleet: holds no study; expected a folder that damping study wrote"
    assert said in refused(tmp_path / "fleet", other)


def test_posteriors_that_are_none(tmp_path, refused):
    one = study(tmp_path / "a", summary())
    for content in (b"law,parameter,low,median,high\na,b,x,1,2\n", b"\xff", b'law\n"a\n', b"law\n" + b"a,b,c\n"):
        (one / "panel-posteriors.csv").write_bytes(content)
        form = json.loads((one / MANIFEST).read_text())
        form["outputs"]["panel-posteriors.csv"] = digest(content)
        (one / MANIFEST).write_text(json.dumps(form))
        assert refused(one, study(tmp_path / "b", summary())), content


@pytest.mark.parametrize("size", [1e300, 1e-300, -1.0, 0.0])
def test_numbers_of_any_size(tmp_path, compared, size):
    assert compared(study(tmp_path / "a", summary(size), size), study(tmp_path / "b", summary()))


def test_predictions_of_one_test_in_mm_and_in_m_are_in_one_unit(tmp_path, compared):
    """2.0 mm and 0.002 m at 45 N are no difference; units that are not known stay beside what is in them."""
    loads = {"force": 45.0, "median": 0.002, "low": 0.0018, "high": 0.0023, "linear": 0.0026}
    metres = {"loads": {"format": "loads/1", "level": 0.9, "predictions": [loads]}}
    one = study(tmp_path / "a", summary(units={"force": "N", "length": "mm"}))
    two = study(tmp_path / "b", summary(units={"force": "N", "length": "m"}, **metres), inputs="1")
    three = study(tmp_path / "c", summary(units={"force": "N", "length": "furlong"}), inputs="2")
    rows = {o: rows_of(compared(one, o), "Resonant amplitude at design forces") for o in (two, three)}
    (_, *first), (_, *second) = rows[two]
    assert first[0] == second[0] == "N, mm"
    assert first[2:5] == second[2:5]
    assert [row[1] for row in rows[three]] == ["N, mm", "N, furlong"]


def test_laws_that_were_not_fitted_have_no_part_in_the_odds():
    """Prior mass 1/3 each: two laws of one term, one of two; evidence 3 w, so odds sum(3 w^2) of two equal records."""
    weights = {"viscous": 0.6, "velocity-squared": 0.2, "viscous + velocity-squared": 0.2}
    models = [SimpleNamespace(name=name, weight=w, rank=1, equivalents=[]) for name, w in weights.items()]
    unfitted = SimpleNamespace(name="coulomb", weight=0.0, rank=None, equivalents=[])
    form = SimpleNamespace(rank=SimpleNamespace(models=[*models, unfitted]))
    odds, _ = weigh_sharing([RecordSummary(form, pd.DataFrame(), None).groups] * 2)
    np.testing.assert_allclose(odds, 3.0 * sum(w**2 for w in weights.values()), rtol=1e-12)
