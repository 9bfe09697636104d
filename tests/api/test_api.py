"""The library as it is imported: its names, results as objects, bad arguments, and what the commands give."""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import replace
from threading import Event, Thread

import matplotlib
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from threadpoolctl import threadpool_info

import damping as dp
from damping import api, ranking
from damping.infer.importance import LEAST_DRAWS
from damping.progress import undisturbed
from damping.records.record import record_to_csv
from damping_reed1970 import data_folder

SATURN = data_folder() / "saturn-v"
RECORD = SATURN / "records" / "config-2-mode-1.csv"
MODE = SATURN / "modes" / "config-2-mode-1.toml"
API = {
    *("AnalysisError", "InputError", "Law", "Mode", "Record", "condition", "diagnose", "extrapolate", "rank"),
    *("read_mode", "read_record", "regress", "sweep"),
}


@pytest.fixture
def form_of(damping) -> Callable[..., dict]:
    """The form that a command prints."""

    def run(*words: object) -> dict:
        done = damping(*words, "--json", "-")
        assert done.code == 0
        return json.loads(done.out)

    return run


def plain_json(value: object) -> object:
    """What JSON makes of plain values: fails on NaN and on what is not plain."""
    return json.loads(json.dumps(value, allow_nan=False))


def check_drawing(result) -> None:
    """A figure of its own, which a notebook shows, or the axes that were given."""
    figure = result.plot()
    assert isinstance(figure, Figure)
    assert figure._repr_png_().startswith(b"\x89PNG")
    axes = Figure().add_subplot()
    assert result.plot(axes) is axes
    assert axes.has_data()
    assert "matplotlib.pyplot" not in sys.modules or matplotlib.pyplot.get_fignums() == []


def test_the_interface_is_what_dir_shows():
    names = {name for name in dir(dp) if not name.startswith("__")}
    assert names == set(dp.__all__) >= API
    for name in names:
        assert getattr(dp, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'guess'"):
        _ = dp.guess


def test_importing_loads_nothing():
    code = "import damping, sys; print([m for m in ('numpy', 'pandas', 'scipy', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_one_thread_also_where_numpy_was_there_before(record, monkeypatch):
    threads = []

    def look(*_: object, **__: object):
        threads.extend(found["num_threads"] for found in threadpool_info())
        raise dp.AnalysisError("seen")

    monkeypatch.setattr(api, "rank_laws", look)
    with pytest.raises(dp.AnalysisError, match="seen"):
        dp.rank(record)
    assert threads
    assert set(threads) == {1}


def test_calls_at_once_leave_the_threads_as_they_were(monkeypatch):
    """The first ends before the second, which restored the limit that it had found: that of the first."""
    pool = [2]  # threads of the process

    class Limits:
        def __init__(self, limits: int) -> None:
            self.found, pool[0] = pool[0], limits

        def restore_original_limits(self) -> None:
            pool[0] = self.found

        def __enter__(self) -> None:
            pass

        def __exit__(self, *_: object) -> None:
            self.restore_original_limits()

    monkeypatch.setattr("damping.progress.threadpool_limits", Limits)
    begun, second_begun, ended = Event(), Event(), Event()
    first = Thread(target=undisturbed(lambda: (begun.set(), second_begun.wait(9))))
    second = Thread(target=undisturbed(lambda: (second_begun.set(), ended.wait(9))))
    first.start()
    assert begun.wait(9)
    second.start()
    first.join()
    assert pool == [1]
    ended.set()
    second.join()
    assert pool == [2]


def test_small_numbers_are_zero_whatever_numpy_is_told(record, mode, few_laws):
    """Weights that no number holds were errors of floating point, also of what is computed when it is asked for."""
    expected = dp.extrapolate(record, mode, [60.0]).to_json()
    with np.errstate(all="raise"):
        assert dp.extrapolate(record, mode, [60.0]).to_json() == expected
        assert np.geterr()["under"] == "raise"


@pytest.mark.usefixtures("few_laws")
def test_rank_is_the_command(form_of, record, mode):
    result = dp.rank(record, mode)
    assert list(result.table)[:5] == ["rank", "law", "weight", "score", "held_out_error"]
    assert result.table["rank"].tolist() == [1, 2]  # the third law predicts the same as the second
    assert result.to_json() == form_of("rank", RECORD, "--mode", MODE)
    assert plain_json(result.to_json()) == result.to_json()
    # sums of weights: rounding of three numbers below 1
    np.testing.assert_allclose(result.table["weight"].sum(), 1.0, rtol=1e-12, atol=0.0)
    assert "viscous + velocity-squared" in repr(result)
    assert "<table" in result._repr_html_()
    check_drawing(result)


@pytest.mark.sampling
@pytest.mark.usefixtures("few_laws")
def test_laws_of_a_ranking_are_sampled_and_go_to_arviz(record):
    result = dp.rank(record)
    law = result["velocity-squared + viscous"]
    assert law.law == result["viscous + velocity-squared"].law
    assert "velocity-squared + viscous" in result
    assert "viscos" not in result
    sample = law.sample(seed=1)
    assert sample.posterior.converged
    data = sample.to_arviz()
    assert set(data.posterior.data_vars) >= {"viscous", "velocity-squared"}
    again = law.to_arviz(seed=1)
    np.testing.assert_array_equal(data.posterior["viscous"], again.posterior["viscous"])
    with pytest.raises(dp.InputError, match=r"no law 'viscos'.*viscous"):
        result["viscos"]


@pytest.mark.sampling
def test_a_law_that_was_left_as_negligible_is_sampled_all_the_same():
    table = pd.DataFrame({"sweep": list("abcd"), "force": [1.0, 2.0, 4.0, 8.0], "frequency": 2.0})
    read = np.array([1.0, 2.0, 4.0, 8.0]) * np.exp(0.004 * np.array([1.0, -1.0, -1.0, 1.0]))
    result = dp.rank(dp.Record(table.assign(amplitude=read), "viscous"))
    law = result["velocity-squared + slip"]
    assert law.candidate.evidence.effective_draws < LEAST_DRAWS
    assert any("negligible" in caution for caution in law.candidate.cautions)
    assert law.sample(seed=1).posterior.converged


@pytest.mark.sampling
@pytest.mark.usefixtures("few_laws")
def test_extrapolate_is_the_command(form_of, record, mode, few_laws):
    result = dp.extrapolate(record, mode, [60.0, 90.0], level=0.8)
    wanted = form_of("extrapolate", RECORD, "--mode", MODE, "--force", 60, "--force", 90, "--level", 0.8)
    assert result.to_json() == wanted
    keys = set(wanted["predictions"][0]) - {"by_model", "parts_percent"}
    assert keys <= set(result.table.columns)
    for row, prediction in zip(result.table.to_dict("records"), wanted["predictions"], strict=True):
        assert all(row[key] == prediction[key] for key in keys - {"cautions", "damping_ratio"})
        assert row["damping_ratio"] == prediction["damping_ratio"]["median"]
        assert row["cautions"] == "; ".join(prediction["cautions"])
    assert "90 " in str(result)
    check_drawing(result)


@pytest.mark.parametrize("forces", [[-5.0], [0.0], [float("nan")], [float("inf")], [], ["60"], None, [True], True])
def test_bad_forces_are_refused_before_any_work(record, mode, forces, monkeypatch):
    monkeypatch.setattr(api, "prepare_record", lambda *given: pytest.fail("work began"))
    with pytest.raises(dp.InputError, match="force"):
        dp.extrapolate(record, mode, forces)


@pytest.mark.parametrize("level", [0.0, 1.0, -1.0, 90, float("nan"), "0.9"])
def test_bad_levels_are_refused_before_any_work(record, mode, level, monkeypatch):
    monkeypatch.setattr(api, "prepare_record", lambda *given: pytest.fail("work began"))
    with pytest.raises(dp.InputError, match="level"):
        dp.extrapolate(record, mode, [60.0], level)
    with pytest.raises(dp.InputError, match="level"):
        dp.curve(record, mode, level=level)


@pytest.mark.parametrize("seed", [-1, 1.5, "a", None, True])
@pytest.mark.parametrize("ask", [dp.rank, lambda r, m, **k: dp.extrapolate(r, m, [60.0], **k), dp.curve, dp.diagnose])
def test_bad_seeds_are_refused_before_any_work(record, mode, ask, seed):
    with pytest.raises(dp.InputError, match=f"seed {seed!r}; expected a whole number >= 0"):
        ask(record, mode, seed=seed)


def test_an_audit_draws_its_sweeps(record):
    """Those that a finding names with crosses."""
    table = record.table.copy()
    table["amplitude"] = table["amplitude"].to_numpy()[::-1]
    axes, falling = Figure().subplots(), dp.check(dp.Record(table))
    assert falling.plot(axes) is axes
    crosses = {line.get_label() for line in axes.get_lines() if line.get_marker() == "x"}
    assert crosses == set(falling.findings[0].sweeps) < set(table["sweep"])
    assert {line.get_marker() for line in dp.check(record).plot().axes[0].get_lines()} == {"o"}


@pytest.mark.usefixtures("few_laws", "few_steps")
def test_a_sweep_is_a_record_that_can_be_ranked_and_diagnosed(mode, form_of, tmp_path):
    swept = dp.sweep(mode, force=[20.0, 30.0], frequency=np.linspace(1.6, 1.73, 25))
    assert swept.table["sweep"].unique().tolist() == ["A", "B"]
    assert plain_json(swept.to_json())["rows"][0]["force"] == 20.0
    check_drawing(swept)
    path = tmp_path / "record.csv"
    path.write_text(record_to_csv(swept.record))
    result = dp.diagnose(swept.record, mode)
    form = result.to_json()
    assert form["effects"] == []  # the record is the simulation
    assert form == form_of("gap", MODE, path, "--no-posterior")
    assert list(result.table) == ["effects", "probability"]
    assert "already fits" in repr(result)
    check_drawing(result)


@pytest.mark.usefixtures("few_steps")
@pytest.mark.parametrize("method", ["ritz", "time"])
def test_a_base_that_shakes_drives_by_its_acceleration_times_the_mass(method):
    """q = a/|omega_n^2 - omega^2 + i omega C/M| of a linear model, whatever the mass."""
    omega_n, mass, viscous, a = 2.0 * np.pi * 5.0, 12.4, 20.0, 0.3
    base = dp.Mode(name="base", frequency=5.0, mass=mass, damping={"viscous": viscous}, drive="base")
    swept = dp.sweep(base, force=a, frequency=[4.8, 5.0, 5.2], method=method).table
    omega = 2.0 * np.pi * swept["frequency"].to_numpy()
    wanted = a / np.abs(omega_n**2 - omega**2 + 1j * omega * viscous / mass)
    # the integration ends where windows of several periods agree to 1e-4
    np.testing.assert_allclose(swept["amplitude"], wanted, rtol=1e-9 if method == "ritz" else 1e-3)
    assert swept["force"].unique().tolist() == [a]


def test_regress_takes_a_record_as_its_table():
    record = dp.read_record(SATURN / "records" / "config-2-mode-1.csv")
    asked = {"response": "energy", "terms": "A^2*omega"}
    of_record, of_table = dp.regress(record, **asked), dp.regress(record.table, **asked, source=record.source)
    assert of_record.to_json() == of_table.to_json()


def test_regress_is_the_command(form_of):
    table = SATURN / "tables" / "table_5_II.csv"
    terms = "A_in^2*omega_rad_s, A_in^3*omega_rad_s"
    result = dp.regress(pd.read_csv(table), response="E_in_lb", terms=terms.split(","))
    wanted = form_of("regress", table, "--response", "E_in_lb", "--terms", terms)
    assert {**result.to_json(), "data": "table_5_II.csv"} == wanted
    assert result.table["name"].tolist() == ["A_in^2*omega_rad_s", "A_in^3*omega_rad_s"]
    assert "E_in_lb" in repr(result)
    check_drawing(result)
    for bad, match in (({"response": "E"}, "no column 'E'"), ({"terms": "A_in^"}, "term"), ({"select": "all"}, "all")):
        with pytest.raises(dp.InputError, match=match):
            dp.regress(pd.read_csv(table), **{"response": "E_in_lb", "terms": terms, **bad})


def test_condition_is_the_command(damping, tmp_path):
    raw, config = SATURN / "raw" / "config-1-mode-2.csv", SATURN / "condition.toml"
    result = dp.condition(pd.read_csv(raw), config)
    out = tmp_path / "record.csv"
    assert damping("condition", raw, "--config", config, "--out", out).code == 0
    read = dp.read_record(out).table
    # CSV keeps every digit; the labels and kept columns may be text in one and numbers in the other
    numbers = ["force", "frequency", "amplitude", "phase"]
    np.testing.assert_allclose(result.table[numbers], read[numbers], rtol=1e-14, atol=0.0)
    assert result.steps
    with pytest.raises(dp.InputError, match="unknown key"):
        dp.condition(pd.read_csv(raw), {"sensor": []})
    with pytest.raises(dp.InputError, match="no column"):
        dp.condition(pd.DataFrame({"a": [1.0]}), config)
    text = tmp_path / "condition.toml"
    text.write_text(config.read_text().replace('"omega_rad_s"', '"sweep"'))
    with pytest.raises(dp.InputError, match="column sweep"):
        dp.condition(pd.read_csv(raw).assign(sweep="abc"), text)


GOOD = pd.DataFrame({"sweep": [1, 1, 2], "force": [1, 1, 2.0], "frequency": [1.0, 1.1, 1.0], "amplitude": [1.0, 2, 3]})


def test_a_record_of_a_frame_is_the_record_of_its_file(tmp_path):
    path = tmp_path / "r.csv"
    path.write_text(record_to_csv(GOOD))
    frame = GOOD.set_axis([7, 8, 9], axis=0)
    made = dp.Record(frame)
    pd.testing.assert_frame_equal(made.table, dp.read_record(path).table)
    frame["force"] = 0.0
    assert made.table["force"].tolist() == [1.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("column", "value", "expected"),
    [
        ("force", -1.0, "-1.*expected a force amplitude > 0"),
        ("amplitude", 0.0, "expected a displacement amplitude > 0"),
        ("frequency", 1e60, "magnitude"),
        ("phase", 90.0, "degrees"),
        ("energy", 0.0, "energy per cycle > 0"),
        ("amplitude_sd", -0.1, "standard uncertainty >= 0"),
    ],
)
def test_what_a_file_may_not_hold_a_frame_may_not_either(tmp_path, column, value, expected):
    table = GOOD.assign(**{column: [1.0, value, 1.5]})
    with pytest.raises(dp.InputError, match=f"record, column {column}: .* in row 1.*{expected.split('.*')[-1]}"):
        dp.Record(table)
    path = tmp_path / "r.csv"
    path.write_text(record_to_csv(table))
    with pytest.raises(dp.InputError, match=f"line 3, column {column}: .*{expected.split('.*')[-1]}"):
        dp.read_record(path)


def test_frames_that_are_no_record():
    for table, match in (
        (
            GOOD.drop(columns="force"),
            r"missing column force among .*; expected columns sweep, force, frequency, amplitude$",
        ),
        (GOOD.iloc[:0], "no data rows"),
        (GOOD.to_dict(), "no table"),
        (pd.concat([GOOD, GOOD.iloc[:1]]), r"row 3 \(labelled 0\) is identical in every column to row 0; expected"),
        (GOOD.assign(force=["1", "x", "2"]), "'x' in row 1; expected a finite number"),
        (GOOD.assign(force=[1.0, np.nan, 2.0]), "'nan' in row 1"),
        (GOOD.assign(sweep=["a", None, "b"]), "column sweep: '(None|nan)' in row 1; expected text"),
    ):
        with pytest.raises(dp.InputError, match=match):
            dp.Record(table)


def test_a_mode_is_checked_when_it_is_made():
    given = {"damping": {"viscous": 1.5}, "units": {"force": "N"}, "tolerance": {"mass": 0.1}}
    mode = dp.Mode(name="m", frequency=2, mass=np.float64(3.0), **given)
    assert mode.damping == {"viscous": {"coefficient": 1.5}}
    assert (mode.units.force, mode.tolerance.mass, mode.tolerance.frequency) == ("N", 0.1, 0.001)
    for changed, match in (
        ({"frequency": -2.0}, "frequency: is -2; expected a number > 0"),
        ({"mass": float("nan")}, "mass: is nan"),
        ({"damping": {"viscos": 1.0}}, "unknown key in .damping.; expected viscous"),
        ({"damping": {"viscous": -1.0}}, "viscous: is -1"),
        ({"tolerance": {"masss": 1.0}}, "expected mass"),
        ({"name": 3}, "name: is a number"),
    ):
        with pytest.raises(dp.InputError, match=match):
            dp.Mode(**{"name": "m", "frequency": 2.0, "mass": 3.0, **changed})


@pytest.mark.usefixtures("few_laws")
def test_progress_is_seen(record):
    seen = []

    @contextmanager
    def progress(title, total):
        seen.append((title, total))
        yield lambda what, parts=1: seen.append(what)

    dp.rank(record, progress=progress)
    names = ["viscous", "viscous + displacement-velocity", "viscous + velocity-squared"]
    assert [seen[0], *sorted(seen[1:])] == [("ranking", 3), *names]  # in the order of weighing
    assert ranking.CRITERION in dp.rank(record).title


@pytest.mark.usefixtures("few_laws")
def test_progress_of_a_comparison_with_the_other_command_is_seen(record, mode):
    titles, done = [], Counter()

    @contextmanager
    def progress(title, total):
        titles.append(title)
        yield lambda what, parts=1: done.update({title: 1})

    simulated = replace(mode, damping={"viscous": {"coefficient": 1.5}})
    dp.extrapolate(record, simulated, [60.0], progress=progress)
    assert titles == ["weighing laws", "sampling", "comparing"]
    titles.clear()
    dp.diagnose(record, simulated, posterior=True, progress=progress)
    assert titles == ["diagnosing", "holding levels out", "weighing laws", "sampling", "posterior"]
    assert done["comparing"] > 2
    assert done["posterior"] > 80  # steps of a chain at least


def test_weights_of_loads_that_are_not_those_of_the_ranking_are_explained(record, mode, few_laws):
    """Of one row a sweep both rest on the same rows, with the same weights; of whole sweeps the loads say why not."""
    rows = [(k, f, F) for k, F in enumerate((10.0, 20.0, 40.0)) for f in np.linspace(1.6, 1.8, 15)]
    sweep, frequency, force = map(np.array, zip(*rows, strict=True))
    r = frequency / 1.7
    response = force / (1.0 - r**2 + 0.04j * r)
    columns = {"sweep": sweep.astype(str), "force": force, "frequency": frequency, "amplitude": np.abs(response)}
    swept = dp.Record(pd.DataFrame({**columns, "phase": -np.angle(response)}))
    linear = dp.Mode(name="m", frequency=1.7, mass=1.0 / (2.0 * np.pi * 1.7) ** 2)
    for own, of, differ in ((record, mode, False), (swept, linear, True)):
        for answer in (dp.extrapolate(own, of, [60.0]), dp.curve(own, of, forces=[60.0])):
            assert any("a ranking weighs them on every row" in said for said in answer.to_json()["cautions"]) == differ
    one = dp.Record(swept.table[swept.table["sweep"] == "0"].reset_index(drop=True))
    said = "; ".join(dp.extrapolate(one, linear, [12.0]).to_json()["cautions"])
    assert "on the rows between the half-power points" in said
    assert "one level does not show how damping changes with amplitude" in said
    assert "resonances of the sweeps" not in said
