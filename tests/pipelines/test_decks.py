"""Damping for structural codes: what a deck holds is what the form held."""

from __future__ import annotations

import hashlib
import json
import re
from math import pi
from pathlib import Path

import numpy as np
import pytest

from damping_pipelines.decks import BOUNDS, COMMENTS, FLANK, Point, fit_coefficients
from damping_pipelines.manifest import publish

FORM = {
    "format": "loads/1",
    "level": 0.9,
    "predictions": [
        {"force": 60.0, "median": 2.2, "low": 2.0, "high": 2.4, "frequency": 1.66, "extrapolation_ratio": 2.07}
        | {"damping_ratio": {"median": 0.0213, "low": 0.0189, "high": 0.0241}}
        | {"by_model": [{"name": "viscous + velocity-squared", "weight": 0.7, "median": 2.2}]},
        {"force": 90.0, "median": 2.9, "low": 2.4, "high": 3.4, "frequency": 1.65, "extrapolation_ratio": 3.1}
        | {"damping_ratio": {"median": 0.0254, "low": 0.0211, "high": 0.0301}, "by_model": []},
        {"force": 900.0, "median": None, "low": None, "high": None, "frequency": None, "damping_ratio": None},
    ],
}
UNKNOWN = {"force": 1.0, "median": None, "low": None, "high": None}
CAMPAIGN = {
    "format": "campaign/1",
    "modes": [
        {
            "name": name,
            "at": [{"level": 0.6, "frequency": f, "damping_ratio": {"median": z, "low": 0.9 * z, "high": z}}],
        }
        for name, f, z in (("second", 58.0, 0.008), ("first", 32.0, 0.006))
    ],
}


@pytest.fixture
def deck(damping, tmp_path):
    """``deck(form, code)`` gives the text that the command writes."""

    def write(form: dict, code: str) -> str:
        source, out = tmp_path / "form.json", tmp_path / "deck.txt"
        source.write_text(json.dumps(form))
        run = damping("export", source, "--to", code, "--out", out)
        assert run.code == 0, run.err
        assert hashlib.sha256(source.read_bytes()).hexdigest() in out.read_text()
        return out.read_text()

    return write


def read_tabdmp1(text: str) -> dict[int, list[tuple[float, float]]]:
    """TABDMP1 entries in large fields, by number: 16 characters a field, four a line (MSC Quick Reference Guide).

    The lines of an entry are halves of lines in small fields: Straus7 reads none with an odd number of them.
    """
    tables: dict[int, list[tuple[float, float]]] = {}
    entries = re.findall(r"^TABDMP1.*\n(?:\*.*\n)*", text, re.MULTILINE)
    assert entries
    assert all(entry.count("\n") % 2 == 0 for entry in entries)
    for line in text.splitlines():
        fields = [line[8 + 16 * i : 24 + 16 * i].strip() for i in range(4)]
        if line.startswith("TABDMP1*"):
            assert fields[1] == "CRIT"
            values = tables.setdefault(int(fields[0]), [])
        elif line.startswith("*"):
            numbers = [float(field) for field in fields if field and field != "ENDT"]
            values += list(zip(numbers[::2], numbers[1::2], strict=True))
    return tables


def test_nastran_tables_read_back(deck):
    tables = read_tabdmp1(deck(FORM, "nastran"))
    # nine digits are written
    np.testing.assert_allclose(tables[1], [(1.66 / FLANK, 0.0213), (1.66, 0.0213), (1.66 * FLANK, 0.0213)], rtol=1e-9)
    assert [values[1][1] for values in tables.values()] == [0.0213, 0.0189, 0.0254, 0.0211]


@pytest.mark.parametrize("code", ["nastran", "abaqus", "ansys", "opensees", "openfast"])
def test_a_deck_says_what_a_level_is_and_its_unit(deck, code):
    said = "at force 60 lb" if code == "openfast" else " force 60 lb, median"
    assert said in deck({**FORM, "units": {"force": "lb", "length": "in", "time": "s"}}, code)
    if code != "openfast":
        form = {**CAMPAIGN, "level_name": "base acceleration", "level_unit": "g"}
        assert " base acceleration 0.6 g, low" in deck(form, code)


@pytest.mark.parametrize("code", COMMENTS)
def test_a_level_without_a_prediction_is_named(damping, tmp_path: Path, code):
    """In the deck and on the terminal, of loads that were refused and of a campaign's mode at one level only."""
    third = {**CAMPAIGN["modes"][0], "name": "third"}
    refused = {"level": 2.0, "frequency": None, "damping_ratio": {"median": None}, "cautions": ["no prediction: why"]}
    modes = {**CAMPAIGN, "modes": [{**third, "at": [*third["at"], refused]}]}
    for form, named in ((FORM, "mode at force 900: no damping"), (modes, "third at level 2: no prediction: why")):
        if code == "openfast" and form is modes:  # which takes no campaign
            continue
        (tmp_path / "form.json").write_text(json.dumps(form))
        run = damping("export", tmp_path / "form.json", "--to", code, "--out", tmp_path / "deck.txt")
        said = " ".join((run.out + run.err).split())
        assert f"left out: {named}" in said
        assert f"{COMMENTS[code]} left out: {named}" in (tmp_path / "deck.txt").read_text()


@pytest.mark.parametrize("code", COMMENTS)
def test_a_deck_keeps_the_cautions_of_its_form(deck, code):
    """Who opens the deck has not seen the terminal: what holds for the whole answer stands before the numbers."""
    finding = {"check": "outlier", "verdict": "caution", "what": "a row apart", "advice": "look", "sweeps": ["a"]}
    units = {"force": "N", "length": "m", "time": "s"}
    text = deck({**FORM, "units": units, "cautions": ["no law fits: why\nand"], "audit": [finding]}, code)
    for said in ("caution: outlier: a row apart", "caution: no law fits: why and"):
        assert text.index(f"{COMMENTS[code]} {said}\n") < text.index("median")
    if code != "openfast":  # which takes no campaign
        said = f"{COMMENTS[code]} caution: first: outlier: a row apart\n"
        assert said in deck({**CAMPAIGN, "audit": [{**finding, "mode": "first"}]}, code)


def test_nastran_deck_of_a_campaign_has_the_modes_by_frequency(deck):
    tables = read_tabdmp1(deck(CAMPAIGN, "nastran"))
    assert [f for f, _ in tables[1]] == [16.0, 32.0, 58.0, 116.0]
    np.testing.assert_allclose([z for _, z in tables[2]], [0.0054, 0.0054, 0.0072, 0.0072], rtol=1e-9)


@pytest.mark.parametrize("order", [1, -1])
def test_a_mode_at_a_level_that_was_tested_and_asked_is_one_point(deck, order):
    """A design level beside a run of the same level: what was tested stands in the deck."""
    at = [
        {"level": 0.6, "tested": tested, "frequency": f, "damping_ratio": {"median": z, "low": z}}
        for tested, f, z in ((True, 32.0, 0.006), (False, 32.1, 0.007))
    ]
    form = {"format": "campaign/1", "modes": [{"name": "first", "at": at[::order]}]}
    assert read_tabdmp1(deck(form, "nastran"))[1] == [(16.0, 0.006), (32.0, 0.006), (64.0, 0.006)]
    assert re.search(r"^\*MODAL DAMPING\n1, 1, 0.006\n(?!2)", deck(form, "abaqus"), re.MULTILINE)


def test_pynastran_reads_it(deck, tmp_path, monkeypatch):
    monkeypatch.setattr(np, "in1d", np.isin, raising=False)  # its release of the day asks for a name numpy 2.4 dropped
    bdf = pytest.importorskip("pyNastran.bdf.bdf", reason="pyNastran pins numpy below 2: not among our tools")
    path = tmp_path / "deck.bdf"
    path.write_text(deck(CAMPAIGN, "nastran"))
    model = bdf.BDF(debug=False)
    model.read_bdf(str(path), punch=True, xref=False)
    np.testing.assert_allclose(model.tables_sdamping[1].x, [16.0, 32.0, 58.0, 116.0], rtol=1e-9)
    np.testing.assert_allclose(model.tables_sdamping[1].y, [0.006, 0.006, 0.008, 0.008], rtol=1e-9)


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        ("abaqus", r"^\*MODAL DAMPING\n1, 1, 0.0054\n2, 2, 0.0072$"),
        ("ansys", r"^MDAMP,1,0.0054,0.0072$"),
        ("opensees", r"^eigen 2\nmodalDamping 0.0054 0.0072$"),
    ],
)
def test_one_ratio_a_mode(code, expected, deck):
    text = deck(CAMPAIGN, code)
    assert len(re.findall(expected, text, re.MULTILINE)) == 1
    assert read_live(text, code) == [0.0054, 0.0072]  # the other tables are comments
    assert "live: the low end at" in text


def read_live(text: str, code: str) -> list[float]:
    """Ratios of the lines that are no comments, in order."""
    lines = [line for line in text.splitlines() if not line.startswith(f"{COMMENTS[code]} ")]
    return [float(number) for line in lines for number in re.findall(r"0\.\d+", line)]


@pytest.mark.parametrize("code", ["abaqus", "ansys", "opensees", "nastran"])
def test_the_live_block_is_the_low_end_at_the_level_that_is_sized(code, deck):
    """Of loads the largest asked for; of a curve the largest within the test or beyond it, with less damping."""
    rows = [
        {"force": F, "amplitude": A, "frequency": 1.6, "tested": F < 50.0, "damping_ratio": {"median": z, "low": low}}
        for F, A, z, low in ((20.0, 1.0, 0.02, 0.018), (40.0, 1.8, 0.022, 0.019), (80.0, 3.0, 0.025, 0.016))
    ]
    beyond = {"format": "curve/1", "level": 0.9, "rows": rows[2:]}
    for form, at, ratio, table in (
        (FORM, "force 90", 0.0211, 4), ({**beyond, "rows": rows}, "force 80", 0.016, 6), (beyond, "force 80", 0.016, 2)
    ):  # fmt: skip
        text = deck(form, code)
        if code == "nastran":
            assert f"SDAMPING = {table} selects the low end at {at}:" in text
            assert read_tabdmp1(text)[table][1][1] == pytest.approx(ratio, rel=1e-9)  # nine digits
        else:
            assert f"live: the low end at {at};" in text
            assert read_live(text, code) == [ratio]


@pytest.mark.parametrize(("ratio", "why"), [(1.0, "the one with less damping"), (1.5, "no level is within the test")])
def test_loads_within_the_test_are_tested_levels(deck, ratio, why):
    """Loads at and beyond the tested force: as of a curve, the level with less damping is live, and why is said."""
    rows = [
        {**row, "extrapolation_ratio": ratio * k} for row, k in zip(FORM["predictions"][:2], (1.0, 1.5), strict=True)
    ]
    text = deck({**FORM, "predictions": rows}, "abaqus")
    assert f"live: the low end at force {60 if ratio == 1.0 else 90};" in text
    assert read_live(text, "abaqus") == [0.0189 if ratio == 1.0 else 0.0211]
    assert why in text


def test_one_level_is_said_not_to_part_linear_from_quadratic(deck):
    text = deck({**FORM, "predictions": FORM["predictions"][:1]}, "openfast")
    assert text.count("one level (force 60) does not separate linear from quadratic damping") == 2
    assert "differs from the damping of the form" not in text
    assert "differs from the damping of the form" in deck({**FORM, "predictions": FORM["predictions"][:2]}, "openfast")


def test_a_deck_is_ascii(deck):
    """Units and names of modes as codes read them: Abaqus takes nothing but ASCII."""
    form = {**CAMPAIGN, "modes": [{**CAMPAIGN["modes"][0], "name": "Brücke λ"}]}
    text = deck({**form, "level_name": "base acceleration", "level_unit": "mm/s²"}, "nastran")
    assert "by frequency" not in text  # of one mode there is nothing to interpolate
    assert "$ by frequency: a mode of your model between two tested ones" in deck(CAMPAIGN, "nastran")
    assert text.isascii()
    assert "base acceleration 0.6 mm/s^2, median\n$   Brucke ?: 58 Hz" in text


@pytest.mark.parametrize("code", COMMENTS)
def test_no_line_is_longer_than_a_code_takes(deck, code):
    """Of many laws those are named whose weight shows, on lines that Abaqus takes (256 characters)."""
    laws = [{"name": f"a law with a rather long name {i}", "weight": 0.1 if i < 9 else 1e-3} for i in range(40)]
    rows = [{**row, "by_model": laws} for row in FORM["predictions"][:2]]
    text = deck({**FORM, "predictions": rows}, code)
    assert max(map(len, text.splitlines())) <= 256
    assert all(line.startswith(COMMENTS[code]) for line in text.splitlines() if "law" in line)
    if code != "openfast":
        assert "name 8 (0.10)" in " ".join(text.replace(COMMENTS[code], " ").split())
        assert "name 9" not in text


@pytest.mark.parametrize(("beyond", "live"), [(1.2, "0.6"), (0.8, "1.2")])
def test_the_live_level_is_the_safer_one(deck, beyond, live):
    """Damping 0.006 at the top tested level and 1.2 or 0.8 times as much at twice it: the block with less is live."""
    at = [
        {"level": level, "tested": tested, "frequency": 32.0, "damping_ratio": {"median": z, "low": 0.9 * z}}
        for level, tested, z in ((0.6, True, 0.006), (1.2, False, 0.006 * beyond))
    ]
    text = deck({"format": "campaign/1", "modes": [{"name": "first", "at": at}]}, "abaqus")
    assert f"live: the low end at level {live}; of the largest tested and the largest requested level" in text
    assert read_live(text, "abaqus") == [pytest.approx(0.0054 * min(beyond, 1.0))]
    assert "** mode numbers: 1, 2, ... are the tested modes by frequency; use their numbers" in text


def test_a_mode_keeps_its_number_where_another_has_no_ratio(deck):
    """Of eight modes the second has none at the higher level: the ratio of the third is not that of mode 2."""
    ratios = {i: {"frequency": 10.0 * i, "damping_ratio": {"median": 0.01 * i, "low": 0.01 * i}} for i in range(1, 9)}
    at = {i: [{"level": level, **of} for level in (1, 2) if (i, level) != (2, 2)] for i, of in ratios.items()}
    form = {"format": "campaign/1", "modes": [{"name": f"m{i}", "at": levels} for i, levels in at.items()]}
    assert "** 3, 3, 0.03\n** 4, 4, 0.04\n" in deck(form, "abaqus").split("level 2, median")[1]
    higher = deck(form, "ansys").split("level 2, median")[1]
    assert "! MDAMP,1,0.01\n! MDAMP,3,0.03,0.04,0.05,0.06,0.07,0.08\n" in higher
    assert "! MDAMP,1,0.01,0.02,0.03,0.04,0.05,0.06\n! MDAMP,7,0.07,0.08\n" in deck(form, "ansys")
    assert "\nMDAMP,1,0.01\nMDAMP,3,0.03,0.04,0.05,0.06,0.07,0.08\n" in deck(form, "ansys")
    said = {"nastran": "the table gives it that of the modes", "abaqus": "undamped", "ansys": "undamped"}
    for code, becomes in said.items():  # beside the numbers of that level, and of no other
        text = deck(form, code)
        assert text.count("m2: no ratio here") == text.count(f"m2: no ratio here: {becomes}") == 2
        assert "m2: no" not in text.split("level 2")[0]
    opensees = deck(form, "opensees")
    assert re.findall(r"^eigen .*\nmodalDamping .*$", opensees, re.MULTILINE) == [
        "eigen 8\nmodalDamping 0.01 0.02 0.03 0.04 0.05 0.06 0.07 0.08"
    ]
    assert "modalDamping 0" not in opensees.split("level 2, median")[1]


def test_modes_whose_frequencies_cross_keep_their_ratios(deck):
    """The first mode hardens past the second: in the order of the frequencies there, their ratios were exchanged."""
    at = {"first": [(10.0, 0.01), (10.3, 0.02)], "second": [(10.2, 0.03), (10.1, 0.06)]}
    levels = {
        name: [{"level": i, "frequency": f, "damping_ratio": {"median": z, "low": z}} for i, (f, z) in enumerate(of, 1)]
        for name, of in at.items()
    }
    form = {"format": "campaign/1", "modes": [{"name": name, "at": of} for name, of in levels.items()]}
    text = deck(form, "opensees")
    assert "# eigen 2\n# modalDamping 0.02 0.06\n" in text.split("level 2, median")[1]
    assert read_live(text, "opensees") == [0.02, 0.06]


@pytest.mark.parametrize("code", COMMENTS)
@pytest.mark.parametrize("wrong", [{"median": -0.01, "low": -0.02}, {"median": 0.01, "low": 0.0}])
def test_a_ratio_that_is_not_positive_is_left_out(deck, code, wrong):
    """A negative ratio would feed energy in; of 0 no amplitude follows."""
    first, second = FORM["predictions"][:2]
    text = deck({**FORM, "predictions": [{**first, "damping_ratio": wrong}, second]}, code)
    assert f"{COMMENTS[code]} left out: mode at force 60: no damping predicted" in text
    assert (
        text.split("\n", 1)[1]
        == deck({**FORM, "predictions": [UNKNOWN | {"force": 60.0}, second]}, code).split("\n", 1)[1]
    )


def test_coefficients_carry_the_forces_they_came_from(deck):
    """A law c1 q' + c2 q'|q'| comes back: exact forces at three amplitudes."""
    omega, c1, c2 = 2.0 * pi * 1.66, 0.5, 0.09
    points = [
        Point("mode", 1.66, 0.02, 0.02, c1 * omega * A + 8.0 / (3.0 * pi) * c2 * (omega * A) ** 2, A, "")
        for A in (0.8, 1.6, 3.0)
    ]
    found = fit_coefficients(points, "median")
    np.testing.assert_allclose((found.linear, found.quadratic), (c1, c2), rtol=1e-9)  # linear algebra of two columns
    assert abs(found.miss) < 1e-9
    text = deck(FORM, "openfast")
    assert len(re.findall(r"^\S+  AddBLin$", text, re.MULTILINE)) == 1  # two pairs of scalars would both be read
    assert len(re.findall(r"^! \S+  AddBLin$", text, re.MULTILINE)) == 1
    assert "6 x 6" in text


def test_low_coefficients_reach_the_amplitude_of_the_low_ratio(deck):
    """Under the forces asked for, damping of the low ratio resonates at F/(2 M omega^2 zeta), and at none less."""
    omega, mass = 2.0 * pi * 25.0, 40.0
    force, low = np.array([10.0, 40.0]), np.array([0.008, 0.012])
    rows = [
        {"force": f, "median": f / (2.0 * mass * omega**2 * 1.5 * z), "low": None, "high": None, "frequency": 25.0}
        | {"damping_ratio": {"median": 1.5 * z, "low": z, "high": 2.0 * z}}
        for f, z in zip(force, low, strict=True)
    ]
    curve = [
        {**row, "amplitude": row["median"], "amplitude_low": 0.8 * row["median"], "force_low": row["force"]}
        for row in rows
    ]
    for form in ({"format": "loads/1", "predictions": rows}, {"format": "curve/1", "rows": curve}):
        text = deck({**form, "level": 0.9, "units": {"force": "N", "length": "m", "time": "s"}}, "openfast")
        c1, c2 = (float(number) for number in re.findall(r"^(\S+)  AddB", text, re.MULTILINE))
        square, line = 8.0 / (3.0 * pi) * c2 * omega**2, c1 * omega
        A = (np.sqrt(line**2 + 4.0 * square * force) - line) / (2.0 * square)
        np.testing.assert_allclose(A, force / (2.0 * mass * omega**2 * low), rtol=1e-6)  # nine digits are written


def test_openfast_takes_newtons_and_metres(damping, tmp_path: Path):
    """c1 = 2.5 N/(m/s) and c2 = 19 N/(m/s)^2 by forces in kN and amplitudes in mm; a form without units says so."""
    c1, c2, omega = 2.5, 19.0, 2.0 * pi * 25.0
    A = np.array([0.0002, 0.001, 0.003])
    F = c1 * omega * A + 8.0 / (3.0 * pi) * c2 * (omega * A) ** 2
    rows = [
        {"amplitude": 1e3 * a, "force": 1e-3 * f, "frequency": 25.0, "damping_ratio": dict.fromkeys(BOUNDS, 0.01)}
        for a, f in zip(A, F, strict=True)
    ]
    source, out = tmp_path / "form.json", tmp_path / "deck.txt"
    form = {"format": "curve/1", "level": 0.9, "rows": rows}
    for units, factors, said in (
        ({"force": "kN", "length": "mm", "time": "s"}, (1.0, 1.0), "AddBLin in N/(m/s), AddBQuad in N/(m/s)^2"),
        ({"force": "kN m", "length": "rad"}, (1e-3, 1e-6), "AddBLin in N m/(rad/s), AddBQuad in N m/(rad/s)^2"),
        ({}, (1e-6, 1e-9), "these are the units of the form, which names none"),
    ):
        source.write_text(json.dumps({**form, "units": units}))
        run = damping("export", source, "--to", "openfast", "--out", out)
        assert run.code == 0
        assert ("which names none" in run.out) is not bool(units)  # not in a comment alone
        text = out.read_text()
        numbers = [float(number) for number in re.findall(r"^(\S+)  AddB", text, re.MULTILINE)][:2]
        np.testing.assert_allclose(numbers, np.multiply(factors, (c1, c2)), rtol=1e-8)  # nine digits are written
        assert said in text


def test_damping_that_falls_with_amplitude_is_said_to_be_of_no_such_form(damping, tmp_path: Path):
    """Coulomb's damping beside viscous: F = c omega A + 4 R/pi (Table 2.II, case VI); exact c1 by hand with c2 = 0."""
    f, M, c, R = 25.0, 40.0, 50.0, 2.0
    omega = 2.0 * pi * f
    A = np.array([0.0002, 0.0005, 0.001, 0.003])
    F = c * omega * A + 4.0 * R / pi
    ratio = F / (2.0 * M * omega**2 * A)
    rows = [
        {"amplitude": a, "force": force, "frequency": f, "tested": True, "damping_ratio": dict.fromkeys(BOUNDS, z)}
        for a, force, z in zip(A, F, ratio, strict=True)
    ]
    source, out = tmp_path / "form.json", tmp_path / "deck.txt"
    source.write_text(json.dumps({"format": "curve/1", "level": 0.9, "rows": rows}))
    run = damping("export", source, "--to", "openfast", "--out", out)
    share = omega * A / F  # least squares of c1 share = 1
    linear = share.sum() / (share @ share)
    miss = linear * share - 1.0
    worst = int(np.argmax(np.abs(miss)))
    text = out.read_text()
    assert [float(number) for number in re.findall(r"^(\S+)  AddB", text, re.MULTILINE)][:2] == [
        pytest.approx(linear, rel=1e-8),  # nine digits are written
        0.0,
    ]
    said = f"by up to {100.0 * abs(miss[worst]):.2g} % (at force {F[worst]:g}, where AddBLin alone would be "
    said += f"{F[worst] / (omega * A[worst]):.3g}): this form cannot follow damping that falls as the amplitude grows"
    assert said in text
    assert said in " ".join(run.out.split())


@pytest.mark.parametrize(
    ("form", "code", "said", "status"),
    [
        (FORM, "sap2000", "expected nastran or abaqus", 2),
        ({**FORM, "predictions": [UNKNOWN]}, "nastran", "no level holds a damping ratio", 1),
        ({**FORM, "predictions": FORM["predictions"][2:]}, "nastran", "mode at force 900: no damping predicted", 1),
        ({"format": "curve/1", "level": 0.9, "rows": [{"force": "x"}]}, "ansys", "rows.0.force", 2),
        # as damping export --out TABLE reads them
        ({"format": "loads/1", "level": 0.9, "rows": [{"force": 1.0}]}, "ansys", "predictions: Field required", 2),
        ({**FORM, "predictions": [UNKNOWN | {"amplitude": 1.0}]}, "ansys", "force or amplitude is required", 2),
        ({key: of for key, of in FORM.items() if key != "level"}, "ansys", "level: Field required", 2),
        (
            {"format": "rank/1", "models": [], "rows": []},
            "nastran",
            "expected tags: 'loads/1', 'curve/1', 'campaign/1'",
            2,
        ),
        ({**CAMPAIGN, "modes": 2 * CAMPAIGN["modes"]}, "abaqus", "two modes are called second", 2),
        (CAMPAIGN, "openfast", "coefficients need force and amplitude", 1),
        ({**FORM, "predictions": [FORM["predictions"][0] | {"force": 0.0}]}, "openfast", "coefficients need force", 1),
        ({**CAMPAIGN, "level_name": "base acceleration"}, "openfast", "this form is of base acceleration", 1),
        ({**FORM, "drive": "base acceleration"}, "openfast", "of a force, and this form is of base acceleration", 1),
    ],
)
def test_what_cannot_be_written_is_said_in_one_line(form, code, said, status, damping, tmp_path: Path):
    source, out = tmp_path / "form.json", tmp_path / "deck.txt"
    source.write_text(json.dumps(form))
    run = damping("export", source, "--to", code, "--out", out)
    assert run.code == status
    assert said in run.err
    assert len(run.err.strip().splitlines()) == 1
    assert not out.exists()


def test_an_unknown_code_is_said_before_the_file_is_read(damping, tmp_path: Path):
    record = tmp_path / "record.csv"
    record.write_text("sweep,force,frequency,amplitude\nL1,1,20,0.002\n")
    told = damping("export", record, "--to", "uff", "--out", tmp_path / "record.uff")
    assert told.code == 2
    assert "--to 'uff' is unknown; expected nastran or abaqus or ansys or opensees or openfast" in told.err


def summarise(name: str, loads: object = None, **changes: object) -> dict[str, object]:
    """A record of a study, tested at 20 and 40 with damping ratios .01 and .012; the curve goes on to 80 with .016."""
    rows = [
        {"force": F, "amplitude": F / 20.0, "frequency": 25.0, "tested": F < 50.0}
        | {"damping_ratio": {"median": z, "low": 0.9 * z, "high": z}}
        for F, z in ((20.0, 0.010), (40.0, 0.012), (80.0, 0.016))
    ]
    rank = {"format": "rank/1", "criterion": "c", "models": [{"rank": 1, "name": "viscous", "forces": []}]}
    units = {"force": "N", "length": "m", "time": "s"}
    curve = {"format": "curve/1", "level": 0.9, "rows": rows}
    return {"name": name, "units": units, "rank": rank, "curve": curve, "loads": loads, "audit": []} | changes


def publish_study(folder: Path, *records: dict[str, object]) -> Path:
    form = {"format": "study/1", "title": "t", "seed": 1, "level": 0.9, "records": records}
    publish(folder, {"summary.json": json.dumps(form).encode()}, seed=1, versions={}, inputs={})
    return folder


LOADS = {"format": "loads/1", "level": 0.9, "predictions": FORM["predictions"][:2]}


@pytest.mark.parametrize(
    ("loads", "expected"),
    [
        (None, {20.0: 0.010, 40.0: 0.012, 80.0: 0.016}),  # nothing is asked for: the whole curve
        (LOADS, {20.0: 0.010, 40.0: 0.012, 60.0: 0.0213, 90.0: 0.0254}),  # what was tested and what is asked for
    ],
)
def test_a_study_is_a_source_of_decks(loads, expected, damping, tmp_path: Path):
    record = summarise("panel", loads, cautions=["no law fits"])
    folder, out = publish_study(tmp_path / "run", record), tmp_path / "deck.bdf"
    assert damping("export", folder, "--to", "nastran", "--out", out).code == 0
    text = out.read_text()
    assert hashlib.sha256((folder / "summary.json").read_bytes()).hexdigest() in text
    assert "from study/1" in text
    assert "caution: no law fits" in text
    assert "$   panel: 25 Hz; within the test" in text
    assert ("outside the test" in text) == (loads is None)
    assert re.findall(r"force (\S+) N, median", text) == [f"{force:g}" for force in expected]
    # nine digits are written
    medians = [values[1][1] for number, values in read_tabdmp1(text).items() if number % 2]
    assert medians == pytest.approx(list(expected.values()), rel=1e-9)


def test_of_a_study_of_several_records_one_is_named(damping, tmp_path: Path):
    other = summarise("mast", units={"force": "m/s\u00b2", "length": "m", "time": "s"})
    folder = publish_study(tmp_path / "run", summarise("panel"), other, summarise("odd", curve=None))
    before = (folder / "summary.json").read_bytes()
    for words, status, said in (
        (
            (),
            2,
            "run: the study has 3 records, and a deck holds the damping of one; expected --record panel or mast or",
        ),
        (("--record", "panl"), 2, "no record 'panl'; expected --record panel (nearest of panel, mast, odd)"),
        (("--record", "odd"), 1, "odd has no curve of damping"),
        (("--record", "mast"), 1, "coefficients are of a force, and this form is of base acceleration"),
        (("--record", "panel"), 0, ""),
    ):
        run = damping("export", folder, "--to", "openfast", "--out", tmp_path / "deck", *words)
        assert run.code == status
        assert said in run.err
        assert len(run.err.strip().splitlines()) == (status > 0)
    into = damping("export", folder, "--to", "ansys", "--record", "panel", "--out", folder / "summary.json")
    assert into.code == 2
    assert (folder / "summary.json").read_bytes() == before


def test_a_campaign_is_a_source_of_decks_as_its_form_is(damping, deck, tmp_path: Path):
    form = json.dumps(CAMPAIGN)
    publish(tmp_path / "run", {"campaign.json": form.encode()}, seed=1, versions={}, inputs={})
    out = tmp_path / "of-folder"
    assert damping("export", tmp_path / "run", "--to", "abaqus", "--out", out).code == 0
    assert out.read_text() == deck(CAMPAIGN, "abaqus")
    for source in (tmp_path / "run", tmp_path / "form.json"):
        run = damping("export", source, "--to", "abaqus", "--record", "first", "--out", out)
        assert (run.code, "expected --record of a study" in run.err) == (2, True)
