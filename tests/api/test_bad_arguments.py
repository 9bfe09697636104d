"""What Python users hand in by mistake is an InputError, and what is meant well is understood."""

from __future__ import annotations

import dataclasses
import io
import json
import warnings
from decimal import Decimal
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import damping as dp
from damping.answers import CurveResult, LoadsResult
from damping.extrapolation.requested import check_loads, list_asked
from damping.gap.simulator import Simulator
from damping.plots.curves import damping_curve
from damping.plots.fits import ranking, sweeps
from damping_reed1970 import data_folder

FORCE = np.array([4.0, 8.0, 12.0, 18.0, 25.0])
TABLE = pd.DataFrame(
    {"sweep": list("ABCDE"), "force": FORCE, "frequency": 25.0, "amplitude": 0.2 * (FORCE / 4.0) ** 0.76}
)
MODE = dp.Mode(name="m", frequency=25.0, mass=0.04, damping={"viscous": 1.0})
RECORD = dp.Record(TABLE)
DATES = np.arange("2026-01-01", "2026-01-06", dtype="datetime64[D]").astype("datetime64[ns]")


def made(**changed: object) -> dp.Mode:
    return dp.Mode(**{"name": "m", "frequency": 25.0, "mass": 0.04, **changed})


def regressed(**changed: object) -> object:
    return dp.regress(**{"frame": TABLE, "response": "amplitude", "terms": "force", **changed})


def swept(**changed: object) -> object:
    return dp.sweep(**{"mode": MODE, "force": 1.0, "frequency": [24.0, 26.0], **changed})


UNLIKE = [[1.0, 2.0], [3.0]]
FLAG = " 'no'; expected True or False"  # a text is true, whatever it says
NO_PAIRS = r"states are no pairs; expected \(record, mode\)"
SIMULATOR = "; expected a function of force, frequency"
#: What is said, and of which call.
MISTAKES = [
    ("record is of type DataFrame; expected Record", lambda: dp.rank(TABLE)),
    ("mode is of type Record", lambda: dp.extrapolate(RECORD, RECORD, [60.0])),
    ("mode is of type str", lambda: dp.diagnose(RECORD, "mode.toml")),
    *(("^path is of type", lambda of=of, read=read: read(of))
      for of in (5, None, b"r.csv", TABLE, io.StringIO()) for read in (dp.read_record, dp.read_mode)),
    ("^an empty path; expected the name of a file", lambda: dp.read_record("")),
    *((f"^max_size {of!r}; expected a whole number", lambda of=of, read=read: read("r", max_size=of))
      for of in (1e9, None) for read in (dp.read_record, dp.read_mode)),
    *(("source is of type", lambda of=of: dp.Record(TABLE, of)) for of in (None, 3)),
    ("column force: two columns of this name", lambda: dp.Record(pd.concat([TABLE, TABLE[["force"]]], axis=1))),
    (
        "column force: a number too large; expected a finite number",
        lambda: dp.Record(TABLE.assign(force=pd.Series([10**400, 2, 3, 4, 5], dtype=object))),
    ),
    *(
        (r"source is of type .*; expected a text or a path", lambda of=of: made(source=of))
        for of in (None, 3, np.array([]))
    ),
    *((f"column {key}: unknown key in", lambda key=key: made(damping={key: 1.0})) for key in (3, pd.NA)),
    ("despite is array", lambda: dp.rank(RECORD, despite=np.array("units"))),
    ("despite is 'phase-sign'; expected a list", lambda: dp.rank(RECORD, despite="phase-sign")),
    *((NO_PAIRS, lambda of=of: dp.diagnose(RECORD, MODE, states=of)) for of in (np.array(5), 3, [RECORD])),
    *(("the simulator " + said + SIMULATOR, lambda of=of: dp.diagnose(RECORD, MODE, simulate=of))
      for said, of in (("tells no parameters", max), ("is of type int", 3))),
    ("frequency before force", lambda: dp.diagnose(RECORD, MODE, simulate=lambda frequency, force: 1 / 0)),
    ("posterior" + FLAG, lambda: dp.diagnose(RECORD, MODE, posterior="no")),
    ("compare" + FLAG, lambda: dp.diagnose(RECORD, MODE, compare="no")),
    *((r"no list of (force|amplitude)s; expected an? ", lambda ask=ask, name=name: ask(RECORD, MODE, **{name: UNLIKE}))
      for ask in (dp.extrapolate, dp.curve) for name in ("forces", "amplitudes")),
    (r"level array\(0.9\); expected a probability", lambda: dp.curve(RECORD, MODE, level=np.array(0.9))),
    (r"force np.datetime64\('2026-01-01.*; expected a force", lambda: dp.extrapolate(RECORD, MODE, DATES)),
    ("column mass: is a datetime64; expected a number > 0", lambda: made(mass=DATES[0])),
    ("structure" + FLAG, lambda: swept(structure="no")),
    ("force -2", lambda: swept(force=-2.0)),
    (r"force \[2.0, 3.0\]; expected positive numbers", lambda: swept(force=[[2.0, 3.0]])),
    ("force 1e[+]60; .* of a magnitude of 1e-50 to 1e[+]50", lambda: swept(force=1e60)),
    ("frequencies out of range; .* of a magnitude of", lambda: swept(frequency=[1.0, 1e60])),
    ("force or frequency is no number", lambda: swept(force="strong")),
    ("frequencies out of range", lambda: swept(frequency=[2.0, 1.0])),
    (
        "200000 rows; expected 100000 rows",
        lambda: swept(force=[2.0, 3.0], frequency=np.linspace(1.0, 2.0, 100_000)),
    ),
    ("nonnegative" + FLAG, lambda: regressed(nonnegative="no")),
    ("source is of type int; expected str", lambda: regressed(source=3)),
    ("response is of type int; expected str", lambda: regressed(response=3)),
    ("terms is of type list; expected a text, or a list of terms", lambda: regressed(terms=[3])),
    ("terms is of type int", lambda: regressed(terms=3)),
    *(("column sweep: 'A' in row 0; expected a finite number", lambda ask=ask: regressed(**ask))
      for ask in ({"response": "sweep"}, {"terms": "sweep"})),
    ("column sweep: '(None|nan)' in row 0; expected text",
     lambda: regressed(frame=TABLE.assign(sweep=[None, *"BCDE"]), response="energy")),
    ("no column 'amplitude'; expected a table with columns", lambda: regressed(frame=pd.DataFrame())),
    *(("to stop at; expected a finite number >= 0", lambda of=of: regressed(select="backward", t_stop=of))
      for of in (True, "2", "x", np.array([2.0]))),
]  # fmt: skip


@pytest.mark.parametrize(("said", "call"), MISTAKES)
def test_what_is_no_argument_is_refused(said, call):
    with pytest.raises(dp.InputError, match=said):
        call()


def test_what_is_meant_well_is_understood():
    assert made(source=Path("a/b.toml")).source == "a/b.toml"
    assert dp.Record(TABLE, Path("a/b.csv")) == dp.Record(TABLE, "a/b.csv")
    for five in (5.0, np.array(5.0), [np.array(5.0)]):
        assert list_asked(five, "force", 0.9).tolist() == [5.0]
    boxed = [np.array(force) for force in FORCE]
    assert dp.Record(TABLE.assign(force=boxed)) == RECORD
    assert regressed(frame=TABLE.assign(force=boxed)).to_json() == regressed().to_json()
    assert made(mass=np.array(0.04), damping={"viscous": np.array(1.0)}) == MODE


def test_a_mode_is_made_of_what_it_tells():
    """Of what is not known too: None was no number."""
    for mode in (MODE, made(rig={"planes": 1}, repeatability={"amplitude": 0.01})):
        assert dp.Mode(**dataclasses.asdict(mode)) == mode


@pytest.mark.parametrize("column", [5, ("a", "b"), float("nan")])
def test_a_regression_takes_a_table_whose_columns_have_any_names(column):
    """A response that is derived was an AttributeError beside such a column."""
    asked = {"response": "energy", "terms": "A^2*omega"}
    table = TABLE.rename(columns={"sweep": column}).assign(sweep=TABLE["sweep"])
    assert regressed(frame=table, **asked).to_json() == regressed(**asked).to_json()


def test_a_regression_compares_numbers_that_are_text():
    """The row of largest amplitude, of which an energy is derived, was the last in the order of the alphabet."""
    sweeps = TABLE.assign(sweep=list("AABBB"), amplitude=[9.0, 10.0, 8.0, 11.0, 3.0])
    rows = [row["row"] for row in regressed(frame=sweeps.astype(str), response="energy").to_json()["deviations"]]
    assert rows == [2, 4]


@pytest.mark.parametrize(
    ("column", "values", "said"),
    [
        ("amplitude", TABLE["amplitude"] * np.exp(1j), "column amplitude: holds complex values"),
        ("amplitude", (TABLE["amplitude"] * np.exp(1j)).astype(object), "column amplitude: holds complex values"),
        ("force", [True] * 5, "column force: holds boolean values"),
        ("phase", pd.Series([1.5, 1.5, 1j, 1.5, 1.5], dtype=object), "column phase: holds complex values"),
        ("added_mass", pd.Series([0.0, True, 2, "3", None], dtype=object), "column added_mass: holds boolean values"),
        ("time", pd.date_range("2020", periods=5), "column time: holds datetime64 values"),
        ("time", pd.to_timedelta(range(5), unit="s"), "column time: holds timedelta64 values"),
        ("time", [np.array(moment) for moment in DATES], "column time: holds datetime64 values"),
        ("time", [1.0, 2.0, 3.0, 4.0, np.ma.masked], "column time: holds values that are no numbers"),
    ],
)
def test_columns_that_pandas_would_make_numbers_of(column, values, said):
    with pytest.raises(dp.InputError, match=said):
        dp.Record(TABLE.assign(**{column: values}))


def test_a_mass_may_be_left_out_where_the_base_is_shaken():
    assert dp.Mode(name="m", frequency=25.0, drive="base").mass == 1.0
    with pytest.raises(dp.InputError, match="no mass in"):
        dp.Mode(name="m", frequency=25.0)
    with pytest.raises(dp.InputError, match="no frequency in"):
        dp.Mode(name="m", mass=1.0)
    with pytest.raises(dp.InputError, match="is nan"):
        dp.Mode(name="m", frequency=25.0, mass=float("nan"), drive="base")
    with pytest.raises(dp.InputError, match="column name: is None; expected a text"):
        dp.Mode(name=None, frequency=25.0, mass=1.0)


def test_messages_without_a_file_begin_with_what_is_wrong():
    assert str(dp.InputError("wrong", file="")) == "wrong"


@pytest.mark.parametrize("value", [1e300, 1e51, 1e-51, 1e-300])
def test_forces_and_amplitudes_are_of_the_magnitudes_of_records(value):
    """Before any work: neither an overflow nor a warning."""
    record, mode = dp.Record(TABLE), dp.Mode(name="m", frequency=25.0, mass=0.04)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(dp.InputError, match="of a magnitude of 1e-50 to 1e\\+50"):
            dp.curve(record, mode, [value])
        with pytest.raises(dp.InputError, match="of a magnitude of 1e-50 to 1e\\+50"):
            dp.extrapolate(record, mode, value)
        assert check_loads([1e50, 1e-50], 0.9).tolist() == [1e50, 1e-50]
        assert check_loads(np.array([2.0, 3.0], dtype=np.float32), 0.9).tolist() == [2.0, 3.0]


#: No text: comparing some is ambiguous, others have no hash, and an array without axes has no items.
NO_NAMES = (["up"], {"up": 1}, np.array([]), np.array("up"), pd.DataFrame(), pd.NA, 3)


@pytest.mark.parametrize("value", NO_NAMES, ids=repr)
def test_choices_are_texts(value):
    for key in ("select", "criterion"):
        with pytest.raises(dp.InputError, match=r"no (selection|criterion) .*; expected one of"):
            dp.regress(TABLE, response="amplitude", terms="force", **{key: value})
    for key in ("direction", "method"):
        with pytest.raises(dp.InputError, match=f"{key} .* is unknown; expected"):
            dp.sweep(MODE, force=1.0, frequency=[24.0, 26.0], **{key: value})


@pytest.mark.parametrize(
    "value",
    [True, "5", ["5", "6"], b"5", np.datetime64("2026"), Decimal(5), pd.NaT, 5 + 0j, [[1.0], [2.0, 3.0]], {"a": 1}],
    ids=repr,
)
def test_what_looks_like_the_forces_of_a_sweep(value):
    """A date was taken for days since 1970, and a text for its number."""
    with pytest.raises(dp.InputError, match="force or frequency is no number; expected"):
        dp.sweep(MODE, force=value, frequency=[24.0, 26.0])
    with pytest.raises(dp.InputError, match="force or frequency is no number; expected"):
        dp.sweep(MODE, force=1.0, frequency=value)


def test_a_notebook_shows_records_and_modes():
    html = dp.Record(TABLE, "<b>")._repr_html_()
    assert "&lt;b&gt;: 5 rows in 5 sweeps" in html
    assert html.count("<tr") == 6
    assert "frequency = 25.0" in dp.Mode(name="m", frequency=25.0, mass=0.04)._repr_html_()


def test_axes_that_are_none():
    with pytest.raises(dp.InputError, match="ax is of type int; expected Axes"):
        sweeps(TABLE, axes=3)
    for nothing in (LoadsResult(None, None), CurveResult(None, None, curve=None)):  # before any work
        with pytest.raises(dp.InputError, match="ax is of type int; expected Axes"):
            nothing.plot(3)
    for projection in ("polar", "3d"):
        with pytest.raises(dp.InputError, match=f"ax has {projection} coordinates; expected Axes with a plain x and y"):
            sweeps(TABLE, axes=Figure().add_subplot(projection=projection))


@pytest.mark.parametrize(("cells", "said"), [
    (TABLE["force"] + 1j, "table, column c: holds complex values; expected real numbers"),
    (pd.date_range("2026-01-01", periods=len(TABLE)), "table, column c: holds datetime64 values; expected numbers"),
    (pd.Series([10**400, *[1] * (len(TABLE) - 1)], dtype=object), "table, column c: a number too large"),
])  # fmt: skip
def test_a_regression_takes_no_column_that_is_no_number(cells, said):
    """The imaginary part was dropped, and dates were counted in units of their storage."""
    with pytest.raises(dp.InputError, match=said):
        dp.regress(TABLE.assign(c=cells), response="force", terms="c, 1")
    twice = pd.concat([TABLE, TABLE[["amplitude"]]], axis=1)
    with pytest.raises(dp.InputError, match="column amplitude: two columns of this name"):
        dp.regress(twice, response="force", terms="amplitude")


def test_a_drawing_on_given_axes_has_its_legend():
    """And no second one on the figure, which is the caller's."""
    figure = Figure()
    axes = figure.add_subplot()
    table = pd.DataFrame({"amplitude": [1.0, 2.0], "damping_ratio": 0.02, "tested": [True, False]})
    damping_curve(table.assign(damping_ratio_low=0.01, damping_ratio_high=0.03), 0.9, axes=axes)
    assert [text.get_text() for text in axes.get_legend().get_texts()][:2] == [
        "median, tested",
        "median, beyond (hatched)",
    ]
    assert not figure.legends


def test_laws_are_told_apart_beside_their_bars():
    laws = ["viscous + velocity-squared + " + last for last in ("slip", "coulomb", "quadratic-displacement")]
    table = pd.DataFrame({"rank": [1, 2, 3], "law": laws, "weight": [0.5, 0.3, 0.2], "physical": True})
    axes = Figure().add_subplot()
    ranking(table, axes=axes)
    assert [" ".join(label.get_text().split()) for label in axes.get_yticklabels()] == laws


def test_further_columns_hold_anything():
    """Lists, dictionaries and arrays are kept; rows that differ in them alone are no copies."""
    for cells in ([[1], [2], [3], [4], [5]], [{"a": k} for k in range(5)], [np.arange(k) for k in range(5)]):
        record = dp.Record(TABLE.assign(channels=cells))
        assert [str(cell) for cell in record.table["channels"]] == [str(cell) for cell in cells]
    twice = pd.concat([TABLE.iloc[:1]] * 2)
    assert len(dp.Record(twice.assign(channels=[[1], [2]]))) == 2
    with pytest.raises(dp.InputError, match=r"row 1 \(labelled 0\) is identical in every column to row 0; expected"):
        dp.Record(twice.assign(channels=[[1], [1]]))


def test_states_are_read_once_whatever_holds_them(monkeypatch):
    """An iterator of states is no empty list of them."""
    seen = []
    record, mode = dp.Record(TABLE), dp.Mode(name="m", frequency=25.0, mass=0.04, damping={"viscous": 1.0})
    monkeypatch.setattr("damping.gap.diagnose.diagnose", lambda *_, states, **__: seen.append(states) or 1 / 0)
    for states in ([(record, mode)], iter([(record, mode)])):
        with pytest.raises(ZeroDivisionError):
            dp.diagnose(record, mode, states=states)
    assert [list(states) for states in seen] == [[(record, mode)]] * 2


def test_a_raw_table_is_checked_like_a_file():
    """Numbers as text are numbers; a table without rows is none."""
    folder = data_folder() / "saturn-v"
    raw, config = pd.read_csv(folder / "raw" / "config-1-mode-2.csv"), folder / "condition.toml"
    asked, texts = dp.condition(raw, config).table, dp.condition(raw.astype(str), config).table
    expected = asked.drop(columns=["sweep", "point"])
    np.testing.assert_allclose(texts.drop(columns=["sweep", "point"]), expected, rtol=1e-12)
    with pytest.raises(dp.InputError, match="no data rows"):
        dp.condition(raw.iloc[:0], config)
    with pytest.raises(dp.InputError, match="column point: two columns of this name"):
        dp.condition(pd.concat([raw, raw[["point"]]], axis=1), config)


def test_the_form_of_a_record_is_plain_whatever_columns_are_kept():
    """A date or a missing number of pandas was no JSON."""
    folder = data_folder() / "saturn-v"
    raw = pd.read_csv(folder / "raw" / "config-1-mode-2.csv")
    for kept, first in (
        (pd.array([pd.NA, *range(14)]), None),
        (pd.date_range("2026", periods=15), "2026-01-01 00:00:00"),
    ):
        form = dp.condition(raw.assign(point=kept), folder / "condition.toml").to_json()
        assert json.loads(json.dumps(form, allow_nan=False)) == form
        assert form["rows"][0]["point"] == first


@pytest.mark.parametrize("of", ["force", "frequency", "scalar"])
def test_what_a_mask_hides_is_no_argument(of):
    """The values under the mask were swept without a word."""
    forces, hertz = np.ma.array([1.0, 2.0]), np.ma.array([24.0, 25.0, 26.0])
    assert set(dp.sweep(MODE, force=forces, frequency=hertz).table["force"]) == {1.0, 2.0}  # nothing is masked
    {"force": forces, "frequency": hertz}.get(of, forces)[1] = np.ma.masked
    with pytest.raises(dp.InputError, match="expected numbers, or lists of them, none masked"):
        dp.sweep(MODE, force=np.ma.array(1.0, mask=True) if of == "scalar" else forces, frequency=hertz)


@pytest.mark.parametrize("kind", [float, int])
def test_what_a_simulator_masks_is_no_answer(kind):
    simulator = Simulator(lambda force, frequency: (np.ma.array([3, 3], kind, mask=[False, True]), force), {}, {}, MODE)
    with pytest.raises(dp.InputError, match="the amplitude that the simulator returns is nan at force 2"):
        simulator.answer(np.array([1.0, 2.0]), np.array([24.0, 25.0]), {})


def test_a_column_of_decays_without_a_label_tells_of_no_decay(tmp_path):
    """An empty column of a form made levels those of the amplitude, and silenced the checks of forces."""
    for labels in (None, "", " ", float("nan"), pd.NA, pd.Categorical([None] * 5)):
        assert not dp.Record(TABLE.assign(decay=labels)).is_decay
    TABLE.assign(decay="").to_csv(file := tmp_path / "record.csv", index=False)
    assert not dp.read_record(file).is_decay
    assert dp.Record(TABLE.assign(decay=[None, *"abcd"])).is_decay


def test_a_time_of_day_is_told_what_is_expected(tmp_path):
    stamped = TABLE.assign(time=[f"10:00:{k:02d}.000" for k in range(5)])
    stamped.to_csv(file := tmp_path / "record.csv", index=False)
    for read in (lambda: dp.Record(stamped), lambda: dp.read_record(file)):
        said = r"'10:00:00.000' .*; expected a finite number: s since any moment, not"
        with pytest.raises(dp.InputError, match=said):
            read()
