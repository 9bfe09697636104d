"""A fleet on real schedulers and workers: killed workers, killed clients, failing and hostile records."""

import html
import os
import re
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from urllib.parse import unquote

import cloudpickle
import dask
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.dataset
import pyarrow.parquet as pq
import pytest
from distributed import Client

from benchmarks._structures import simulated_levels, structures
from damping.errors import AnalysisError, InputError
from damping.infer.law import Law
from damping.records.text import read_bytes
from damping.report import format_force_text, format_length_band, format_percent_ratio
from damping_pipelines import fleet as command
from damping_pipelines.fleet import fleet, runners
from damping_pipelines.fleet.analyse import analyse, failed, limit_time
from damping_pipelines.fleet.dataset import (
    FleetDataSet,
    FleetResult,
    FleetSettings,
    FleetTask,
    find_cases,
    list_skipped,
    row_of,
    seed_of,
    tasks_of,
)
from damping_pipelines.fleet.page import (
    COLUMNS,
    _build_lists,
    _tabulate_records,
    collect_facts,
    describe_force,
    list_copies,
    list_drives,
    tabulate_outliers,
)
from damping_pipelines.manifest import digest_code, sole_writer, verify
from damping_pipelines.store import write_bytes
from damping_validation.truths import OMEGA
from tests.html import Reader

RECORDS = 6
SIZE = 10_000_000
#: Two laws to rank and one to predict with, in whatever process this runs: where the laws do not matter.
FEW_LAWS = """from damping import extrapolation
from damping.infer.law import Law
from damping_pipelines.fleet import analyse
analyse.candidate_laws = lambda *data: [Law(("viscous",)), Law(("viscous", "velocity-squared"))]
extrapolation.resonant_laws = lambda *data: [Law(("viscous", "velocity-squared"))]
"""
MODE = "[mode]\nfrequency = 1.6\nmass = 1.0\n"


def record_text(seed: int, levels: int = 3) -> str:
    """Resonances of a structure whose law is known, with 2 % of noise."""
    structure = structures()[seed % 4]
    data = simulated_levels(structure, levels, 4.0, 0.02, np.random.default_rng(seed))
    rows = zip(data.tested_force.tolist(), data.tested_amplitude.tolist(), strict=True)
    hertz = OMEGA / (2.0 * np.pi)
    return "sweep,force,frequency,amplitude\n" + "".join(f"L{i},{F},{hertz},{A}\n" for i, (F, A) in enumerate(rows))


def write_record(folder: Path, name: str, seed: int) -> None:
    write_bytes(folder / f"{name}.csv", record_text(seed).encode())
    write_bytes(folder / f"{name}.toml", MODE.encode())


def lossy(lost: int, *words, **options) -> None:
    """A fleet of which some records fail: the others are done, one line says how many, and the exit code is 1."""
    with pytest.raises(AnalysisError, match=f"^{lost} of [0-9]+ records failed; the first: "):
        fleet(*words, **options)


#: A run in this process.
HERE = {"fast": True, "workers": 0, "max_size": SIZE}


def rows_of(out: Path) -> list[dict]:
    """All rows of a run, by name."""
    table = pyarrow.dataset.dataset(out / "records", format="parquet").to_table().to_pylist()
    return sorted(table, key=lambda row: row["name"])


def files_of(out: Path) -> dict[str, bytes]:
    """Every page of a run."""
    return {str(path.relative_to(out)): path.read_bytes() for path in sorted(out.rglob("*.html"))}


@pytest.fixture(scope="module")
def records(tmp_path_factory) -> Path:
    """Records, one of which cannot be read."""
    folder = tmp_path_factory.mktemp("records")
    for i in range(RECORDS):
        write_record(folder, f"mode-{i:02d}", i)
    write_bytes(folder / "mode-05.csv", b"sweep,force,frequency,amplitude\nA,1,2,-3\n")
    return folder


@pytest.fixture(scope="module")
def few():
    """Few candidates in this process; returned is what does the same in another."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("damping_pipelines.fleet.analyse.candidate_laws", "damping.extrapolation.resonant_laws"):
            patch.setattr(name, None)  # so that what it was comes back
        # a constant of this module, as text so that workers of Dask can run it too: no input gets here
        exec(FEW_LAWS, {})
        yield FEW_LAWS


@pytest.fixture(scope="module")
def alone(records, few, tmp_path_factory) -> Path:
    """The result of one process, one record after the other."""
    out = tmp_path_factory.mktemp("alone")
    lossy(1, records, out, **HERE, seed=5)
    return out


@pytest.fixture
def one_law(monkeypatch, no_drawing):
    """One candidate in this process: where the laws do not matter."""
    for name in ("damping_pipelines.fleet.analyse.candidate_laws", "damping.extrapolation.resonant_laws"):
        monkeypatch.setattr(name, lambda *data, **options: [Law(("viscous",))])


#: A scheduler that fetches a result asks a dead worker again until this is over, by default 30 s.
DASK = """import dask
dask.config.set({"distributed.comm.timeouts.connect": "2s"})
from dask.__main__ import main
main()
"""


@pytest.fixture(scope="module")
def cluster(few, forking):
    """A scheduler and two workers as processes on the loopback: its address and the workers."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    common = ["--host", "127.0.0.1", "--no-dashboard"]
    scheduler = forking.start(DASK, "scheduler", "--port", port, *common)
    words = ("worker", address, "--no-nanny", "--nthreads", "1", "--preload", few, *common)
    workers = [forking.start(DASK, *words) for _ in range(2)]
    yield address, workers
    for process in (*workers, scheduler):
        if process.poll() is None:
            process.send(signal.SIGKILL)
            process.wait()


def test_a_worker_killed_in_the_middle_loses_nothing(records, alone, cluster, tmp_path, monkeypatch):
    """SIGKILL to one of two workers once a first result is there; every byte is that of the serial run."""
    address, workers = cluster
    monkeypatch.setattr(command, "BATCH", 1)
    at_kill = []

    def kill() -> None:
        while not list(tmp_path.glob("records/*.parquet")):
            time.sleep(0.01)
        workers[0].send(signal.SIGKILL)
        at_kill.append(len(list(tmp_path.glob("records/*.parquet"))))

    killer = threading.Thread(target=kill)
    killer.start()
    lossy(1, records, tmp_path, fast=True, scheduler=address, seed=5, max_size=SIZE)
    killer.join()
    assert workers[0].wait() == -signal.SIGKILL
    assert at_kill[0] < RECORDS
    assert rows_of(tmp_path) == rows_of(alone)
    assert files_of(tmp_path) == files_of(alone)


def test_a_killed_client_resumes_without_repeating_work(records, alone, cluster, tmp_path, capfd, forking):
    """SIGKILL to the client after its first batches: the rest is done by the next run, and nothing twice."""
    script = (
        "import sys; from pathlib import Path; from damping_pipelines import fleet as command\n"
        "command.BATCH, command.PERIOD = 2, 600.0\n"
        "records, out = map(Path, sys.argv[1:3])\n"
        f"command.fleet(records, out, fast=True, scheduler=sys.argv[3], seed=5, max_size={SIZE})"
    )
    client = forking.start(script, records, tmp_path, cluster[0])
    while not list(tmp_path.glob("records/*.parquet")):
        assert client.poll() is None, "the client ended before a batch was written"
        time.sleep(0.01)
    client.send(signal.SIGKILL)
    client.wait()
    first = {path: path.stat().st_mtime_ns for path in tmp_path.glob("records/*.parquet")}
    there = sum(len(pd.read_parquet(path, columns=["key"])) for path in first)
    assert 2 <= there < RECORDS
    capfd.readouterr()
    lossy(1, records, tmp_path, fast=True, scheduler=cluster[0], seed=5, max_size=SIZE)
    said = capfd.readouterr().err
    assert len(re.findall(r"^fleet: \d+/6 mode-", said, re.MULTILINE)) == RECORDS - there
    assert {path: path.stat().st_mtime_ns for path in first} == first
    assert rows_of(tmp_path) == rows_of(alone)
    assert files_of(tmp_path) == files_of(alone)


def harmless_or_deadly(task):
    """Stands for an analysis: one record kills whoever works on it, one raises what no record should."""
    if task.name == "mode-01":
        os.kill(os.getpid(), signal.SIGKILL)
    if task.name == "mode-02":
        raise ZeroDivisionError("of no record's making")
    return FleetResult({"name": task.name, "status": "done", "reason": "", "code": digest_code()}, {})


def test_a_record_that_kills_workers_becomes_a_row_and_spares_the_others(records, monkeypatch):
    """On a local cluster of one: the others are done though it died beside them; an error of ours is a row, too."""
    cloudpickle.register_pickle_by_value(sys.modules[__name__])
    monkeypatch.setattr(runners, "DEATHS", 0)
    tasks = list(tasks_of(find_cases(records), settings()))
    # each worker after a dead one is forked from a process that has imported what it needs
    forked = dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
    with forked, runners.connected(None, 1) as client:
        results = list(runners.distributed(client, tasks, harmless_or_deadly))
    assert sorted(result.row["name"] for result in results) == [task.name for task in tasks]
    failed = {result.row["name"]: result.row["reason"] for result in results if result.row["status"] == "failed"}
    assert set(failed) == {"mode-01", "mode-02"}
    assert "workers died" in failed["mode-01"]
    assert failed["mode-02"] == "internal error, please report it (ZeroDivisionError: of no record's making)"


def settings(**changes) -> FleetSettings:
    fields = {"seed": 5, "fast": True, "level": 0.9, "forces": (), "versions": {"damping-selection": "1"}}
    fields["code"] = digest_code()
    return FleetSettings(**{**fields, "max_size": SIZE, **changes})


def test_a_failed_record_is_a_row_with_its_reason(alone):
    row = next(row for row in rows_of(alone) if row["name"] == "mode-05")
    assert row["status"] == "failed"
    assert row["reason"].startswith("mode-05.csv, line 2, column amplitude: -3")
    assert (alone / row["report"]).read_text().count(html.escape(row["reason"])) == 1
    assert row["law"] is None


def test_the_page_of_a_record_says_damping_and_what_its_numbers_are(alone):
    row = next(row for row in rows_of(alone) if row["median"] is not None)
    text = html.unescape((alone / row["report"]).read_text())
    assert format_percent_ratio(row["damping_ratio"]) in text
    assert format_percent_ratio(row["damping_ratio_low"]) in text
    assert f"({format_length_band(row['low'], row['high'], row['units_length'])}, 90 % predictive band)" in text
    assert "A coefficient is a posterior median." in text
    assert f"At {format_force_text(row['design_force'], row['units_force'])}: beyond the test: 2.00 times" in text
    assert "with the 90 % predictive interval" in html.unescape((alone / "fleet.html").read_text())


def test_rows_say_how_they_came_about(alone):
    rows = rows_of(alone)
    assert {row["method"] for row in rows} == {"few importance draws"}
    assert len({row["seed"] for row in rows}) == len(rows)
    good = [row for row in rows if row["status"] == "done"]
    assert len(good) == RECORDS - 1
    for row in good:
        assert row["extrapolation_ratio"] == pytest.approx(2.0, rel=1e-12)  # 2 times the largest, up to rounding
        assert row["design_force"] == pytest.approx(2.0 * row["largest_tested_force"], rel=1e-12)
        assert 0.0 < row["damping_ratio_low"] < row["damping_ratio"] < row["damping_ratio_high"] < 1.0
        assert row["median"] is None or row["low"] < row["median"] < row["high"]


def test_an_interrupted_run_keeps_what_has_come(records, alone, tmp_path, monkeypatch):
    """An interrupt after two results: both are there, and the next run does the others."""
    done = []

    def interrupted(task):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(task.name)
        return analyse(task)

    monkeypatch.setattr("damping_pipelines.fleet.analyse.analyse", interrupted)
    with pytest.raises(KeyboardInterrupt):
        fleet(records, tmp_path, **HERE, seed=5)
    assert [row["name"] for row in rows_of(tmp_path)] == done
    assert rows_of(tmp_path) == rows_of(alone)[:2]


def test_records_one_by_one_need_no_dask(tmp_path, one_law, monkeypatch):
    """What only workers need is not loaded without them: neither its memory nor its installation is asked for."""
    for package in ("dask", "distributed"):
        monkeypatch.setitem(sys.modules, package, None)
    monkeypatch.delattr("damping_pipelines.fleet.runners")
    monkeypatch.delitem(sys.modules, "damping_pipelines.fleet.runners")
    fleet(_one(tmp_path), tmp_path / "out", **HERE)
    assert [row["status"] for row in rows_of(tmp_path / "out")] == ["done"]


def test_changed_and_removed_records(tmp_path, one_law):
    """What changed is done again and replaces its row and page; what is gone goes; settings are part of the key."""
    source, out = tmp_path / "in", tmp_path / "out"
    for i in range(3):
        write_record(source, f"r{i}", i)
    fleet(source, out, **HERE)
    before = rows_of(out)
    write_bytes(source / "r1.toml", MODE.replace("1.0", "2.0").encode())
    (source / "r2.csv").unlink()
    with pytest.raises(InputError, match=r"holds 1 result of other .* the first of 'r2'; expected another --out, or"):
        fleet(source, out, **HERE)
    write_bytes(out / "reports" / "mine.html", b"of the user")
    write_bytes(out / "records" / "mine.parquet", b"of the user")
    fleet(source, out, replace=True, **HERE)
    for name in ("reports/mine.html", "records/mine.parquet"):  # what is not ours stays
        assert (out / name).read_bytes() == b"of the user"
        (out / name).unlink()
    after = rows_of(out)
    assert [row["name"] for row in after] == ["r0", "r1"]
    with pytest.raises(InputError, match="holds 2 results of other records, settings"):
        fleet(source, out, **HERE | {"force": (1.0,)})
    assert rows_of(out) == after
    assert after[0] == before[0]
    assert after[1]["key"] != before[1]["key"]
    assert {Path(row["report"]).name for row in after} == {path.name for path in (out / "reports").iterdir()}
    page = out / after[0]["report"]
    written = page.read_bytes()
    page.unlink()  # by whom ever: the page of the fleet leads there
    with pytest.raises(InputError, match="holds 2 results"):
        fleet(source, out, **HERE | {"force": (1.0,)})
    assert rows_of(out) == after
    fleet(source, out, **HERE)
    assert (page.read_bytes(), rows_of(out)) == (written, after)
    write_bytes(page, written + b"x")  # a page that verify rejects is no page of this run
    fleet(source, out, **HERE)
    assert page.read_bytes() == written
    task = next(tasks_of(find_cases(source), settings()))
    changed = {"seed": 6, "fast": False, "level": 0.8, "forces": (1.0,), "versions": {"x": "2"}, "code": "2"}
    for name, value in changed.items():
        assert next(tasks_of(find_cases(source), settings(**{name: value}))).key != task.key
    for free in ({"max_size": SIZE + 1}, {"time_limit": 1.0}):
        assert next(tasks_of(find_cases(source), settings(**free))).key == task.key


def test_a_record_that_lost_its_workers_is_tried_again(tmp_path, one_law):
    """It failed through no doing of its own; one that failed for what it holds stays as it is."""
    source, out = tmp_path / "in", tmp_path / "out"
    write_record(source, "good", 1)
    write_bytes(source / "bad.csv", b"sweep,force,frequency,amplitude\na,1,2,-3\n")
    write_bytes(source / "bad.toml", MODE.encode())
    lossy(1, source, out, **HERE)
    before, kept = rows_of(out), FleetDataSet(out / "records")
    lost = failed(next(task for task in tasks_of(find_cases(source), settings())), f"{runners.DIED} under it")
    kept.keep({before[0]["key"]})
    kept.add([lost.row | {"key": before[1]["key"], "name": "good"}])
    assert {row["reason"] for row in rows_of(out)} == {before[0]["reason"], "workers died under it"}
    lossy(1, source, out, **HERE)
    assert rows_of(out) == before


HOSTILE = [
    "<img src=x onerror=alert(1)>",
    "..%2f..%2fescape",
    '"><script>alert(2)<',
    "=1+1",
    "a\nb",
    "#frag?q&x",
    "{{7*7}}",
]


def test_hostile_names_stay_names(tmp_path, one_law):
    """Markup, paths, line ends and bytes that are no text: nothing leaves the folder or becomes markup."""
    source, out = tmp_path / "in", tmp_path / "out"
    names = [*(name.replace("/", "") for name in HOSTILE), os.fsdecode(b"\xff\xfe")]
    for i, name in enumerate(names):
        write_bytes(source / f"{name}.toml", f"[mode]\nname = '../../<b>{i}'\nfrequency = 1.6\nmass = 1.0\n".encode())
        write_bytes(source / f"{name}.csv", record_text(i).encode() if i < 2 else b"no record")
    lossy(len(names) - 2, source, out, **HERE)
    assert {path.name for path in tmp_path.iterdir()} == {"in", "out"}
    assert len(rows_of(out)) == len(names)
    for path in out.rglob("*.html"):
        assert re.fullmatch(r"[A-Za-z0-9_-]+\.html", path.name)
        page = Reader(path.read_text())
        assert not {tag for tag, _ in page.elements} & {"img", "b", "iframe"}
        assert "alert(" not in "".join(re.findall(r"<script[^>]*>(.*?)</script>", path.read_text(), re.DOTALL))
        for href in (attrs["href"] for tag, attrs in page.elements if tag == "a" and "href" in attrs):
            assert href.startswith("#") or (path.parent / unquote(href)).resolve().is_relative_to(out)
            assert href.startswith("#") or (path.parent / unquote(href)).is_file()


def test_folders_of_cases_are_diagnosed(tmp_path, one_law):
    """``model.toml`` beside ``data.csv``: the gap form is there; a model of another mode is refused by the audit."""
    hertz = OMEGA / (2.0 * np.pi)
    model = f"[mode]\nfrequency = {hertz}\nmass = 1.0\n[damping]\nviscous = 0.1\n"
    for name, text in (("a", model), ("b", model.replace(str(hertz), "40.0"))):
        write_bytes(tmp_path / "in" / name / "data.csv", record_text(0).encode())
        write_bytes(tmp_path / "in" / name / "model.toml", text.encode())
    lossy(1, tmp_path / "in", tmp_path / "out", **HERE)
    good, other = rows_of(tmp_path / "out")
    assert good["status"] == "done"
    assert good["effects"] is not None
    assert '"format": "gap/1"' in good["gap_form"]
    assert (tmp_path / "out" / good["report"].replace(".html", "-gap.html")).is_file()
    assert other["status"] == "failed"
    assert other["reason"].startswith("b/data.csv: ")  # of a hundred folders each holds a data.csv
    assert "different modes" in other["reason"]
    assert "a/model.toml" in (tmp_path / "out" / good["report"]).read_text()


def test_chains_where_they_are_asked_for(tmp_path, one_law):
    """Without ``--fast`` the row says so, and the band is that of ``extrapolate``'s chains."""
    write_record(tmp_path / "in", "one", 0)
    fleet(tmp_path / "in", tmp_path / "out", workers=0, force=(3.0,), max_size=SIZE)
    fleet(tmp_path / "in", tmp_path / "fast", fast=True, workers=0, force=(3.0,), max_size=SIZE)
    (row,), (fast,) = rows_of(tmp_path / "out"), rows_of(tmp_path / "fast")
    assert row["method"] == "importance draws"
    assert row["design_force"] == 3.0
    assert row["held_out_error"] is not None
    assert fast["held_out_error"] is None
    # one coefficient known to 1 %: the Gaussian differs by its missing tail, of order 1/n of the band of 10 %
    assert fast["median"] == pytest.approx(row["median"], rel=0.02)
    assert "<svg" in (tmp_path / "out" / row["report"]).read_text()


@pytest.mark.parametrize(
    ("source", "options", "said"),
    [
        ("nowhere", {}, "no such folder"),
        (".", {}, "holds no record"),
        ("in", {"workers": -1}, "--workers -1"),
        ("in", {"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "either --scheduler or --workers"),
        ("in", {"workers": 0, "force": (-1.0,)}, "a force amplitude > 0"),
        ("in", {"scheduler": "tcp://127.0.0.1:9"}, "no scheduler answers"),
        *(
            ("in", {"dashboard": at}, r"--dashboard .*; expected HOST:PORT")
            for at in ("foo", "127.0.0.1:99999", "x y:8")
        ),
        ("in", {"workers": 0, "time_limit": 0.0}, "--time-limit 0"),
    ],
)
def test_a_fleet_that_cannot_begin_says_why(tmp_path, monkeypatch, source, options, said):
    write_record(tmp_path / "in", "one", 0)
    monkeypatch.setattr(runners, "CONNECT", 0.2)
    with pytest.raises(InputError, match=said):
        fleet(tmp_path / source, tmp_path / "out", fast=True, max_size=SIZE, **options)


def test_two_runs_do_not_write_into_one_folder(tmp_path):
    write_record(tmp_path / "in", "one", 0)
    with sole_writer(tmp_path / "out"), pytest.raises(InputError, match="another run is writing here"):
        fleet(tmp_path / "in", tmp_path / "out", **HERE)


def test_a_broken_part_is_set_aside_and_its_records_computed_again(tmp_path, one_law, capsys):
    source, out = tmp_path / "in", tmp_path / "out"
    write_record(source, "one", 0)
    fleet(source, out, **HERE)
    before, part = rows_of(out), next((out / "records").glob("part-*.parquet"))
    part.write_bytes(b"no parquet")
    with pytest.raises(InputError, match="is not from the run of the manifest"):
        verify(out)
    fleet(source, out, **HERE)
    assert f"kept as {part.name}.broken" in capsys.readouterr().err
    assert part.with_name(f"{part.name}.broken").read_bytes() == b"no parquet"
    part.with_name(f"{part.name}.broken").unlink()
    assert rows_of(out) == before
    assert {"fleet.html", f"records/{part.name}", before[0]["report"]} == set(verify(out).manifest.outputs)


def test_a_part_without_all_columns_is_broken(tmp_path):
    """Parquet, but of another version or program: its rows cannot be read as results."""
    part = tmp_path / "part-1.parquet"
    pq.write_table(pa.table({"name": ["one"], "key": ["k"]}), part)
    assert FleetDataSet(tmp_path).set_broken_aside() == [tmp_path / f"{part.name}.broken"]
    assert FleetDataSet(tmp_path).read(["reason"]).empty


def test_a_page_of_somebody_else_is_not_written_over(tmp_path, one_law):
    write_record(tmp_path / "in", "one", 0)
    write_bytes(tmp_path / "out" / "fleet.html", b"of the user")
    with pytest.raises(InputError, match=r"fleet\.html: is no result of an earlier run"):
        fleet(tmp_path / "in", tmp_path / "out", **HERE)
    assert (tmp_path / "out" / "fleet.html").read_bytes() == b"of the user"


def test_a_record_that_takes_too_long_is_given_up(records, monkeypatch):
    """In the thread of a worker, where no signal reaches it; the next record is not touched."""
    monkeypatch.setattr("damping_pipelines.fleet.analyse._analyse", count_for_ever)
    task = next(tasks_of(find_cases(records), settings(time_limit=0.2)))
    rows = []
    thread = threading.Thread(target=lambda: rows.append(analyse(task).row))
    thread.start()
    thread.join()
    assert rows[0]["status"] == "failed"
    assert rows[0]["reason"] == "out of time: it took more than 0.2 s (--time-limit)"


def test_any_time_may_be_allowed(monkeypatch):
    """More than a clock can wait for, too: no thread fails with a traceback."""
    errors = []
    monkeypatch.setattr(threading, "excepthook", errors.append)
    with limit_time(float("inf")):
        time.sleep(0.02)
    assert not errors


def count_for_ever(task: FleetTask) -> FleetResult:
    while True:
        time.sleep(0.001)


def test_a_worker_of_other_code_is_refused(records):
    """It may join late, when nobody asks: its rows say what it computes with."""
    task = next(tasks_of(find_cases(records), settings()))
    own = failed(task, "anything")
    assert own.row["code"] == digest_code()
    assert runners._result(task, own) is own
    late = FleetResult(own.row | {"code": "0" * 64, "status": "done"}, {})
    refused = runners._result(task, late)
    assert refused.row["status"] == "failed"
    assert refused.row["reason"].startswith(runners.OTHER_CODE)


def test_a_local_cluster_answers_its_client_alone():
    with runners.connected(None, 1) as client:
        address = client.scheduler.address
        assert address.startswith("tls://127.0.0.1:")
        with pytest.raises(OSError, match=r"(?i)timed out|closed|TLS|SSL"):
            Client(address.replace("tls", "tcp"), timeout=1.0)


def test_every_record_failed_is_exit_code_1(tmp_path):
    write_bytes(tmp_path / "in" / "one.csv", record_text(0).encode())
    with pytest.raises(AnalysisError, match=r"1 of 1 records failed; the first: one\.toml: no such file"):
        fleet(tmp_path / "in", tmp_path / "out", workers=0, max_size=SIZE)
    assert rows_of(tmp_path / "out")[0]["status"] == "failed"


def test_seeds_depend_on_the_run_and_the_record_alone():
    seeds = {seed_of(run, key) for run in range(30) for key in ("a", "b", "c")}
    assert len(seeds) == 90  # of 2^31: a repeat has probability 2e-6
    assert seed_of(1, "a") == seed_of(1, "a")
    assert all(0 <= seed < 2**31 for seed in seeds)


def test_outliers_are_what_stands_apart():
    """Overprediction both ways, error of the fit upwards only; a fleet without spread has none."""
    table = pd.DataFrame(
        {
            "name": [f"r{i}" for i in range(22)],
            "report": "x",
            "law": "viscous",
            "linear_overprediction_percent": [*np.linspace(10.0, 12.0, 20), 60.0, -40.0],
            "average_absolute_percent": [*np.linspace(1.0, 2.0, 20), 1.5, 0.0],
        }
    )
    table["record_sha256"] = table["name"]
    found = tabulate_outliers(table)
    assert list(found["name"]) == ["r20", "r21"]
    assert all("overprediction" in why and "error" not in why for why in found["why"])
    assert tabulate_outliers(table.assign(linear_overprediction_percent=1.0, average_absolute_percent=np.nan)).empty
    assert tabulate_outliers(table.iloc[[0, 1, 19]]).empty  # z = 12, which chance makes of three even values too
    copies = pd.concat([table[:20], *[table[9:10]] * 40], ignore_index=True)
    error = "average_absolute_percent"
    copies.loc[20:, error] += np.linspace(-1e-3, 1e-3, 40)  # each has a seed of its own
    assert tabulate_outliers(copies).equals(tabulate_outliers(table[:20]))  # a copy is no evidence of a narrow fleet


def test_what_is_not_read_is_named(tmp_path):
    """A mode without its record, a name in capitals, links that lead nowhere and a folder of records below it."""
    records = _one(tmp_path)
    write_record(records / "further", "two", 1)
    (records / "ALSO.CSV").write_text(record_text(2))
    (records / "alone.toml").write_text(MODE)
    (records / "broken.csv").symlink_to("nowhere.csv")
    for name in ("loop", "loop.csv"):
        (records / name).symlink_to(name)
    (records / "notes.txt").write_text("of the test")
    cases = find_cases(records)
    assert [case.name for case in cases] == ["one"]
    assert list_skipped(records, cases) == ["ALSO.CSV", "alone.toml", "broken.csv", "further", "loop.csv"]


def test_folders_as_a_campaign_writes_them_are_read(tmp_path):
    """They were named as not read; a folder of gap comes first where a name is in both."""
    for name in ("mode-1", "both"):
        write_bytes(tmp_path / name / "record.csv", record_text(1).encode())
        write_bytes(tmp_path / name / "mode.toml", MODE.encode())
    write_bytes(tmp_path / "both" / "data.csv", record_text(2).encode())
    write_bytes(tmp_path / "below" / "mode.toml", MODE.encode())  # shared by records there
    cases = find_cases(tmp_path)
    assert [(case.files, case.is_model) for case in cases] == [
        (("both/data.csv", "both/model.toml"), True),
        (("mode-1/record.csv", "mode-1/mode.toml"), False),
    ]
    assert next(task for task in tasks_of(cases, settings()) if task.name == "mode-1").model_text == MODE.encode()
    assert list_skipped(tmp_path, cases) == []


def test_one_mode_file_serves_every_record_without_its_own(tmp_path):
    """Unless it is that of a record ``mode.csv``; messages and keys follow the file that was taken."""
    records = _one(tmp_path)
    (records / "two.csv").write_text(record_text(2))
    (records / "mode.toml").write_text(MODE.replace("1.0", "2.0"))
    assert list_skipped(records, find_cases(records)) == []
    own, shared = tasks_of(find_cases(records), settings())
    assert (own.files, shared.files) == (("one.csv", "one.toml"), ("two.csv", "mode.toml"))
    assert shared.model_text == (records / "mode.toml").read_bytes() != own.model_text
    (records / "mode.csv").write_text(record_text(3))
    assert [case.files[1] for case in find_cases(records)] == ["mode.toml", "one.toml", "two.toml"]


def test_amplitudes_on_the_page_have_their_units():
    """Records in inches and in metres stand in one table."""
    table = pd.DataFrame(index=range(3), columns=list(COLUMNS)).assign(
        name=["a", "b", "c"], report="r.html", status=["done", "done", "failed"], median=[1.1, 0.03, np.nan]
    )
    frame = _tabulate_records(table.assign(units_length=["in", "m", None])).frame
    assert list(frame["unit"]) == ["in", "m", ""]


def test_the_page_has_the_damping_of_every_record():
    table = pd.DataFrame(index=range(2), columns=list(COLUMNS)).assign(
        name=["a", "b"], report="r.html", status=["done", "failed"], median=[1.1, np.nan]
    )
    values = {"damping_ratio": 0.0125, "damping_ratio_low": 0.011, "frequency": 17.5, "design_force": 30.0}
    rows = _tabulate_records(table.assign(units_force=["N", None], **values)).rows
    texts = [cell.text for cell in rows[0]]
    assert {"1.25 %", "1.10 %", "17.50", "30 N"} <= set(texts)
    assert "30" not in " ".join(cell.text for cell in rows[1])  # no prediction was made


def test_a_key_counts_once(tmp_path):
    task = next(iter(tasks_of(find_cases(_one(tmp_path)), settings())))
    kept = FleetDataSet(tmp_path / "set")
    row = row_of(task)
    kept.add([row])
    kept.add([row, row | {"key": "other"}])
    assert len(kept.read(["status"])) == 2
    assert set(kept.read([])["key"]) == {task.key, "other"}
    kept.keep({"other"})
    assert set(kept.read([])["key"]) == {"other"}
    assert len(kept.files()) == 1


def _one(folder: Path) -> Path:
    write_record(folder / "in", "one", 0)
    return folder / "in"


def test_an_interrupt_is_one_line_and_130(records, tmp_path, monkeypatch, damping):
    def interrupted(task):
        raise KeyboardInterrupt

    monkeypatch.setattr("damping_pipelines.fleet.analyse.analyse", interrupted)
    run = damping("fleet", records, "--out", tmp_path, "--workers", 0)
    assert (run.code, run.out) == (130, "")
    assert run.err == "damping: interrupted; no half-written file is left\n"


def test_a_pipe_is_refused_and_not_waited_for(tmp_path, one_law):
    write_record(tmp_path / "in", "good", 1)
    write_bytes(tmp_path / "in" / "ring.csv", record_text(2).encode())
    os.mkfifo(tmp_path / "in" / "ring.toml")
    lossy(1, tmp_path / "in", tmp_path / "out", **HERE)
    assert [row["reason"] for row in rows_of(tmp_path / "out")] == ["", "ring.toml: is no regular file"]
    with pytest.raises(InputError, match="is no regular file"):
        read_bytes(tmp_path / "in" / "ring.toml")


def test_a_job_scheduler_ends_it_in_order(records, alone, few, tmp_path, forking):
    """SIGTERM is what batch systems send before they kill: what has come is kept, and one line says so."""
    words = ["fleet", records, "--out", tmp_path, "--fast", "--workers", "0", "--seed", "5"]
    process = forking.start(f"{few}from damping_pipelines.cli import main\nmain()", *words)
    while process.poll() is None and "\n" not in process.err.read_text():
        time.sleep(0.01)
    process.send(signal.SIGTERM)
    code = process.wait()
    first, *_, last = process.err.read_text().splitlines()
    assert first.startswith("fleet: 1/")
    assert code == 130
    assert last == "damping: interrupted; no half-written file is left"
    done = rows_of(tmp_path)
    assert done
    assert done == rows_of(alone)[: len(done)]


def test_copies_are_told_and_laws_that_lead_alike_are_all_named(few, tmp_path, capsys):
    """Of a record and its copy: two of three count for one; three laws that lead once each would be three."""
    folder, out = tmp_path / "records", tmp_path / "out"
    folder.mkdir()
    for name, seed in (("first", 0), ("second", 0), ("third", 1)):
        write_record(folder, name, seed)
    fleet(folder, out, **HERE, seed=5)
    said = "first and second are byte-for-byte copies of one record, which counts 2 times in every share"
    assert f"Caution: {said}." in " ".join(capsys.readouterr().out.split())
    assert said in " ".join(html.unescape((out / "fleet.html").read_text()).split())
    many = pd.DataFrame({"name": [f"n{k}" for k in range(9)], "status": "done", "record_sha256": "same"})
    assert list_copies(many)[0].startswith("n0, n1, n2, n3, n4 and 4 more are byte-for-byte copies")
    assert not list_copies(many.assign(status="failed"))


@pytest.mark.parametrize(
    ("laws", "name", "text"),
    [
        (["a", "a", "b"], "a", "leads in 2 of them"),
        (["b", "b", "a", "a", "c", "c", "d"], "a, b and c", "lead in 2 each"),
        (list("abcde"), "5 laws", "lead in 1 each"),
    ],
)
def test_the_card_names_every_law_that_leads(laws, name, text):
    table = pd.DataFrame({"law": laws, "damping_ratio": np.nan})
    assert (name, text) in collect_facts(table, table, np.array([])).items


@pytest.mark.parametrize(("count", "said"), [(4, "in all of them"), (40, "in nine records of ten")])
def test_few_records_have_a_range_and_no_tenths(count, said):
    table = pd.DataFrame({"law": "viscous", "damping_ratio": np.linspace(0.01, 0.02, count)})
    texts = [text for _, text in collect_facts(table, table, np.linspace(5.0, 30.0, count)).items]
    assert f"linear over median amplitude, {said}" in texts
    assert f"of critical damping at the design load, {said}" in texts


def test_a_range_is_of_records_with_a_prediction():
    """One of four has none: the range is not of all of them."""
    table = pd.DataFrame({"law": "viscous", "damping_ratio": [0.01, 0.02, 0.03, np.nan]})
    texts = [text for _, text in collect_facts(table, table, np.array([5.0, 6.0, 7.0])).items]
    assert "of critical damping at the design load, where there is a prediction" in texts
    assert "linear over median amplitude, where there is a prediction" in texts


def test_a_design_force_is_told_where_records_have_several_units():
    """One number is newtons of one record, pounds of another and an acceleration of a third: no answer compares."""
    table = pd.DataFrame({"units_force": ["N", "N", "lbf", "m/s²", None]})
    assert list_drives(table, (2.0, 3.0)) == [
        "a design force is taken in the unit of each record: N (2 records), lbf (1 record) and m/s² (1 record)"
    ]
    assert describe_force(table, (2.0, 3.0)) == "the largest design force, 3"
    assert not list_drives(table, ())  # multiples of each record's own force
    assert not list_drives(table[:2], (3.0,))
    assert describe_force(table[:2], (2.0, 3.0)) == "the largest design force, 3 N"


def test_records_in_doubt_are_told_on_the_page_of_the_fleet():
    """A law that does not fit and a finding of the audit stand beside the record; what every design load says not."""
    cautions = [["beyond the test: 2.00 times", "no law fits: why"], ["it fits poorly: why"], ["beyond the test"], None]
    table = pd.DataFrame(index=range(4), columns=list(COLUMNS)).assign(
        name=list("abcd"), report="r.html", status=["done"] * 3 + ["failed"], cautions=cautions
    )
    table["audit"] = [None, "outlier (caution): a row", "", None]
    found = _build_lists(table)["doubts"].frame
    assert list(found["why"]) == ["no law fits: why", "it fits poorly: why; outlier (caution): a row"]
    assert "doubts" not in _build_lists(table[2:].reset_index(drop=True))
