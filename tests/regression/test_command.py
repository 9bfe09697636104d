"""``damping regress``: what it prints, writes and draws, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

import damping as dp
from damping_pipelines.cli import main
from damping_reed1970 import data_folder, load_table

Run = Callable[..., tuple[int, str, str]]
RECORDS = data_folder() / "saturn-v" / "records"
SHOE = "x,y,z,label\n1,2,0.5,a\n2,3,0.1,b\n3,5,0.4,c\n4,4,0.8,d\n5,8,0.2,e\n"


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the command in this process: exit code, standard output, standard error."""

    def command(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as end:
            main(["regress", *map(str, arguments)])
        printed = capsys.readouterr()
        return int(end.value.code or 0), printed.out, printed.err

    return command


@pytest.fixture
def shoe(tmp_path: Path) -> Path:
    path = tmp_path / "shoe.csv"
    path.write_text(SHOE)
    return path


@pytest.fixture
def rough(tmp_path: Path) -> Path:
    """Table 5.III as its regression used it."""
    path = tmp_path / "rough.csv"
    table = load_table("5_III", "used")[["omega_rad_s", "A2bar_in", "E_in_lb"]]
    path.write_text(table.set_axis(["omega", "A", "E"], axis=1).to_csv(index=False))
    return path


def form_of(run: Run, *arguments: object) -> Any:
    code, out, err = run(*arguments, "--json", "-")
    assert (code, err) == (0, "")
    return json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} in JSON"))


def test_a_response_that_is_its_own_term_is_named(run: Run, shoe: Path) -> None:
    """y fitted to y is exact whatever the data: R^2 = 1 says nothing."""
    note = "y is a factor of y, x*y^2: the response is fitted to itself"
    assert note in form_of(run, shoe, "--response", "y", "--terms", "x, y, x*y^2")["notes"]
    assert not form_of(run, shoe, "--response", "y", "--terms", "x")["notes"]


@pytest.mark.parametrize(("last", "exact"), [("6", True), ("6.000000000001", False)])
def test_an_exact_fit_says_that_its_statistics_are_of_rounding(
    run: Run, tmp_path: Path, last: str, exact: bool
) -> None:
    """y = 2 x fits 2, 4, 6 to rounding; with 1e-12 added to 6 the T-ratio is of a deviation that the table holds."""
    path = tmp_path / "line.csv"
    path.write_text(f"x,y\n1,2\n2,4\n3,{last}\n")
    notes = form_of(run, path, "--response", "y", "--terms", "x")["notes"]
    assert [note.startswith("the fit is exact to the digits of the table") for note in notes] == [True] * exact


def test_a_table_of_semicolons_and_decimal_commas_is_named(run: Run, shoe: Path) -> None:
    shoe.write_text("x;y\n1,5;2,5\n2,5;4,5\n")
    code, _, err = run(shoe, "--response", "y", "--terms", "x")
    assert code == 2
    assert "line 2: 3 cells in the row (the header is separated by semicolons or tabs: damping import reads" in err


def test_the_form_has_every_key_and_every_number(run: Run, rough: Path) -> None:
    form = form_of(run, rough, "--response", "E", "--terms", "A^2*omega, A^3*omega")
    assert (form["format"], form["n"], form["response"]) == ("regress/1", 15, "E")
    assert [term["name"] for term in form["terms"]] == ["A^2*omega", "A^3*omega"]
    assert set(form["terms"][0]) == {"name", "coefficient", "std_error", "t_ratio", "p_value"}
    # Eq. 5.3.9, printed digits
    np.testing.assert_allclose([t["coefficient"] for t in form["terms"]], [5.221, 5.538], atol=5e-4, rtol=0)
    assert set(form["one_term_fits"][0]) == {"name", "coefficient", "t_ratio", "rms_error", "r_squared"}
    assert {
        "rms_error", "average_absolute_deviation", "average_absolute_percent", "standard_error",
        "largest_absolute_deviation", "largest_absolute_percent", "r_squared", "r_squared_centred",
        "correlation_fitted_observed", "condition_number",
    } <= set(form["summary"])  # fmt: skip
    for row in form["deviations"]:
        assert row["deviation"] == pytest.approx(row["observed"] - row["fitted"], abs=1e-12)
        assert row["percent"] == pytest.approx(100 * row["deviation"] / row["observed"], rel=1e-12)
    assert form["steps"] == []
    assert [v["name"] for v in form["variables"]] == ["A^2*omega", "A^3*omega", "E"]
    assert np.array(form["correlations"]["matrix"]).shape == (3, 3)
    assert [row["name"] for row in form["plane"]] == ["1", "A", "omega"]


@pytest.mark.parametrize("select", ["backward", "forward", "stepwise", "best"])
@pytest.mark.parametrize("more", [[], ["--nonnegative"], ["--criterion", "loo"]])
def test_selected_terms_follow_from_the_steps(
    run: Run, rough: Path, nine_terms: str, select: str, more: list[str]
) -> None:
    form = form_of(run, rough, "--response", "E", "--terms", nine_terms, "--select", select, *more)
    names = {term["name"] for term in form["terms"]}
    assert len(form["one_term_fits"]) == len(form["all_terms"]) == 9
    everything = {term.strip() for term in nine_terms.split(",")}
    terms = set() if select in ("forward", "stepwise") else everything
    for step in form["steps"]:
        assert step["reason"]
        assert (step["term"] in terms) == (step["action"] == "drop")
        terms ^= {step["term"]}
    assert terms == names
    if "--nonnegative" in more:
        assert all(term["coefficient"] >= 0 for term in form["terms"])
    if select == "best":
        assert form["subsets"][0]["terms"] == [term["name"] for term in form["terms"]]
        assert len(form["subsets"]) == 511 or "--nonnegative" in more


def test_the_best_of_many_terms_is_proved(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """2^30 - 1 subsets: two true terms far above the noise; and one line where the work would be too large."""
    rng = np.random.default_rng(30)
    x = rng.normal(size=(60, 30))
    table, names = tmp_path / "wide.csv", [f"x{i}" for i in range(30)]
    rows = np.column_stack([x, 2.0 * x[:, 3] + 3.0 * x[:, 20] + 0.1 * rng.normal(size=60)])
    np.savetxt(table, rows, delimiter=",", header=",".join([*names, "y"]), comments="")
    asked = (table, "--response", "y", "--terms", ", ".join(names), "--select", "best", "--nonnegative")
    form = form_of(run, *asked)
    assert {"x3", "x20"} <= set(form["subsets"][0]["terms"])
    assert form["proof"]["subsets"] == 2**30 - 1
    # 16 roundings times a condition number below 100, of a response 40 times the deviations, in n ln SSE
    assert 0.0 <= form["subsets"][0]["bic"] - form["proof"]["bound"] < 1e-8
    assert f"best of all 2^30 - 1 subsets, proved by {form['proof']['nodes']} fits" in run(*asked)[1]
    monkeypatch.setattr("damping.regression.leaps.MOST_WORK", 2.0 * 30**2)
    code, out, err = run(*asked)
    assert (code, out, len(err.splitlines())) == (1, "", 1)
    assert "2^30 - 1 subsets is not proved after 2 fits, the most that are made; give fewer terms" in err


def test_percent_is_null_where_the_observation_is_zero(run: Run, tmp_path: Path) -> None:
    (tmp_path / "zero.csv").write_text("x,y\n1,0\n2,2\n3,3\n")
    form = form_of(run, tmp_path / "zero.csv", "--response", "y", "--terms", "x")
    assert form["deviations"][0]["percent"] is None
    expected = np.mean([abs(form["deviations"][i]["percent"]) for i in (1, 2)])
    assert form["summary"]["average_absolute_percent"] == pytest.approx(expected, rel=1e-12)


def test_what_does_not_exist_is_null(run: Run, tmp_path: Path) -> None:
    (tmp_path / "one.csv").write_text("x,y\n2,0\n")
    form = form_of(run, tmp_path / "one.csv", "--response", "y", "--terms", "x")
    assert [form["terms"][0][name] for name in ("std_error", "t_ratio", "p_value")] == [None] * 3
    summary = form["summary"]
    missing = ("standard_error", "r_squared", "r_squared_centred", "correlation_fitted_observed")
    assert [summary[name] for name in (*missing, "average_absolute_percent")] == [None] * 5
    assert form["plane"] is None


def test_the_print_out_has_every_statistic(run: Run, rough: Path, nine_terms: str) -> None:
    """The list of section 5.2, in its words."""
    code, out, err = run(rough, "--response", "E", "--terms", nine_terms, "--select", "best")
    assert (code, err) == (0, "")
    for words in (
        "sum ", "average value", "standard deviation", "sum of squares", "CORRELATION COEFFICIENTS",
        "ONE-TERM FITS IN DECREASING ORDER OF SIGNIFICANCE", "PLANE", "T-RATIO", "standard error", "p-value",
        "DESCENDING ORDER OF T-RATIO", "fitted E", "observed E", "a) root-mean-square error",
        "b) average absolute deviation", "c) average absolute per cent", "d) standard error of the regression",
        "e) largest absolute deviation", "f) largest absolute per cent", "g) square of the correlation",
        "h) correlation coefficient", "i) |per cent deviation|", "R^2 about zero", "R^2 about the mean", "AICc", "BIC",
        "leave-one-out", "Scaled condition number", "DEVIATIONS", "drop", "best subsets",
    ):  # fmt: skip
        assert words in out, words


def test_several_curves_on_several_tables(run: Run) -> None:
    tables = [RECORDS / "config-2-mode-1.csv", RECORDS / "config-2-mode-2.csv"]
    curves = ["--terms", "A^2*omega", "--terms", "A^2*omega, A^3*omega"]
    forms = form_of(run, *tables, "--response", "energy", *curves)
    assert [(form["data"], len(form["terms"])) for form in forms] == [
        ("config-2-mode-1.csv", 1),
        ("config-2-mode-1.csv", 2),
        ("config-2-mode-2.csv", 1),
        ("config-2-mode-2.csv", 2),
    ]
    code, out, _ = run(*tables, "--response", "energy", *curves)
    assert code == 0
    assert out.count("MULTIVARIATE REGRESSION PROGRAM I") == 4
    assert "COMPARISON OF FITS" in out


def test_energy_of_resonance_peaks(run: Run) -> None:
    """Without phase and energy, energy = pi F A: the coefficient of A^2*omega averages pi C_1 = pi F/(A omega)."""
    record = RECORDS / "config-2-mode-1.csv"
    form = form_of(run, record, "--response", "energy", "--terms", "A^2*omega")
    F, f, A = np.loadtxt(record, delimiter=",", skiprows=1, usecols=(1, 2, 3), unpack=True)
    np.testing.assert_allclose([row["observed"] for row in form["deviations"]], np.pi * F * A, rtol=1e-14)
    C1 = F / (A * 2 * np.pi * f)
    assert C1.min() < form["terms"][0]["coefficient"] / np.pi < C1.max()


def test_deviations_are_plotted_against_every_variable(run: Run, shoe: Path, tmp_path: Path) -> None:
    arguments = (shoe, "--response", "y", "--terms", "x, z^2, 1", "--plots", tmp_path / "plots")
    assert run(*arguments)[0] == 0
    files = sorted((tmp_path / "plots").iterdir())
    variables = ("1", "fitted_y", "row", "x", "z", "z2")
    assert [path.name for path in files] == [f"shoe-deviations-{name}.svg" for name in variables]
    drawn = {path: path.read_bytes() for path in files}
    for content in drawn.values():
        texts = [element.text or "" for element in ElementTree.fromstring(content).iter() if element.text]
        assert any("deviation of y" in text for text in texts)
    assert run(*arguments)[0] == 0
    assert {path: path.read_bytes() for path in files} == drawn  # the same each time


@pytest.mark.usefixtures("no_drawing")
def test_names_that_make_no_file_name(run: Run, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("a/b,A/B,y\n1,4,1\n2,3,2\n4,1,3\n3,7,4\n")
    assert run(tmp_path / "t.csv", "--response", "y", "--terms", "a/b, A/B", "--plots", tmp_path / "p")[0] == 0
    names = {path.name.lower() for path in (tmp_path / "p").iterdir()}
    assert {"t-deviations-a_b.svg", "t-deviations-a_b-2.svg"} <= names


def test_control_characters_of_the_input_are_shown(run: Run, tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("x\x1b[2J,y\n1,2\n2,3\n3,5\n")
    code, out, _ = run(tmp_path / "t.csv", "--response", "y", "--terms", "x\x1b[2J")
    assert code == 0
    assert "\x1b" not in out
    assert "x\\x1b[2J" in out


BAD = {
    "term ends early": ("--terms", "x*", "character 3"),
    "no terms": ("--terms", " ", "character"),
    "nothing between commas": ("--terms", "x,,z", "character 3"),
    "power of nothing": ("--terms", "^2", "character 1"),
    "power that is a word": ("--terms", "x^two", "character 3"),
    "power of a power": ("--terms", "x^2^2", "character 3"),
    "power that is not finite": ("--terms", "x^inf", "character 3"),
    "code": ("--terms", "__import__('os').getcwd()", "missing column"),
    "a number for a column": (
        "--terms",
        "2*x",
        "shoe.csv: missing column 2; expected columns alone: the fit gives each",
    ),
    "unknown column": ("--terms", "xx", "missing column xx"),
    "text column": ("--terms", "x, label", "line 2, column label: 'a' is not a number"),
    "unknown response": ("--response", "w", "missing column w among x, y, z, label; expected columns w, x"),
    "text response": ("--response", "label", "line 2, column label"),
    "empty response": ("--response", "", "name of the response is empty"),
    "unknown selection": ("--select", "all", "none, backward, forward, stepwise, best"),
    "unknown criterion": ("--criterion", "press", "bic, aic, aicc, adjusted-r2, loo"),
    "T-ratio without steps": ("--t-stop", "2", "backward, forward, stepwise"),
    "T-ratio that is a word": ("--t-stop", "two", "--t-stop"),
    "file too large": ("--max-size", "5", "5 bytes"),
    "unknown option": ("--colour", "red", "--colour"),
}


@pytest.mark.parametrize("case", BAD)
def test_options_that_cannot_be_are_refused(run: Run, shoe: Path, case: str) -> None:
    option, value, said = BAD[case]
    options = {"--response": "y", "--terms": "x", option: value}
    code, out, err = run(shoe, *(part for pair in options.items() for part in pair))
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) == 1


def test_an_option_is_refused_before_any_table_is_read(run: Run, tmp_path: Path) -> None:
    _, _, err = run(tmp_path / "no.csv", "--response", "y", "--terms", "x", "--criterion", "press")
    assert "press" in err


FILES = {
    "missing": (None, "no such file"),
    "empty": (b"", "empty"),
    "header only": (b"x,y\n", "no data rows"),
    "not UTF-8": (b"x,y\n1,\xff\n", "UTF-8"),
    "doubled column": (b"x,y,x\n1,2,3\n", "column x"),
    "text": (b"x,y\n1,2\n3,many\n", "line 3, column y: 'many' is not a number"),
    "nan": (b"x,y\n1,2\n3,nan\n", "line 3, column y"),
    "infinity": (b"x,y\n1,2\ninf,2\n", "line 3, column x"),
    "empty cell": (b"x,y\n1,2\n,2\n", "line 3, column x: empty cell"),
    "ragged": (b"x,y\n1,2\n3\n", "line 3"),
    "semicolons": (b"x;y\n1;2\n", "semicolons"),
}


@pytest.mark.parametrize("case", FILES)
def test_tables_that_cannot_be_read_are_refused(run: Run, tmp_path: Path, case: str) -> None:
    content, said = FILES[case]
    path = tmp_path / "bad.csv"
    if content is not None:
        path.write_bytes(content)
    code, out, err = run(path, "--response", "y", "--terms", "x")
    assert (code, out) == (2, "")
    assert said in err
    assert "bad.csv" in err
    assert len(err.splitlines()) == 1


CANNOT = {
    "copied column": ("x, x^1", ["x", "x^1"]),
    "the same term twice": ("x*z, z*x", ["x*z", "z*x"]),
    "scaled sum": ("x, double, 1", ["x", "double"]),
    "zero column": ("x, none", ["none"]),
    "too few rows": ("x, z, 1, x^2, z^2, x*z", ["5", "6"]),
    "no value": ("none^-1", ["none^-1", "observation 1 (none = 0)"]),
    "no square": ("x^300, z", ["x^300", "to be squared"]),
}


@pytest.mark.parametrize("case", CANNOT)
def test_what_cannot_be_fitted(run: Run, tmp_path: Path, case: str) -> None:
    path = tmp_path / "shoe.csv"
    lines = SHOE.splitlines()
    path.write_text("\n".join([f"{lines[0]},double,none", *(f"{x},{2 * int(x[0])},0" for x in lines[1:])]))
    terms, named = CANNOT[case]
    code, out, err = run(path, "--response", "y", "--terms", terms)
    assert (code, out) == (1, "")
    assert all(name in err for name in (f"{path}: ", *named))
    assert len(err.splitlines()) == 1


def test_a_failed_run_leaves_earlier_results(run: Run, shoe: Path, tmp_path: Path) -> None:
    target = tmp_path / "fit.json"
    assert run(shoe, "--response", "y", "--terms", "x", "--json", target)[0] == 0
    before = target.read_bytes()
    plots = tmp_path / "plots"
    curves = ("--terms", "z", "--terms", "x, x^1")  # the second cannot be fitted
    assert run(shoe, "--response", "y", *curves, "--json", target, "--plots", plots)[0] == 1
    assert target.read_bytes() == before
    assert not plots.exists()


def test_a_table_too_long_to_list_is_refused(run: Run, tmp_path: Path) -> None:
    data = tmp_path / "long.csv"
    data.write_text("x,y\n" + "1,2\n3,4\n" * 50_001)
    code, out, err = run(data, "--response", "y", "--terms", "x")
    assert (code, out) == (1, "")
    assert err.count("\n") == 1
    assert "100002 rows; every deviation is listed, of 100000 rows at most" in err


@pytest.mark.parametrize(
    ("options", "said"),
    [((), False), (("--criterion", "aic"), True), (("--criterion", "aic", "--select", "backward"), False)],
)
def test_a_criterion_without_a_selection_is_said(run: Run, shoe: Path, options: tuple[str, ...], said: bool) -> None:
    code, _, err = run(shoe, "--response", "y", "--terms", "x, z", *options)
    assert code == 0
    assert ("--criterion aic changes nothing without --select" in err) is said


@pytest.mark.parametrize(("select", "said"), [("none", False), ("best", True), ("backward", True), ("stepwise", True)])
def test_statistics_of_terms_selected_from_noise_are_said_to_take_them_as_given(select: str, said: bool) -> None:
    """The best of 8 terms has p < .05 in about half of such tables; nothing was said of it."""
    noise = np.random.default_rng(3).normal(size=(25, 9))
    table = pd.DataFrame(noise, columns=[*"abcdefgh", "y"])
    form = dp.regress(table, response="y", terms=list("abcdefgh"), select=select).to_json()
    assert (len(form["terms"]) < 8) is said
    assert any("take the selected terms as given" in note for note in form["notes"]) is said
