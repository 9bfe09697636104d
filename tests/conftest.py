"""Fixtures that several parts share: the report's records as observations, synthetic resonances, pages in a browser."""

from __future__ import annotations

import gc
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import IO, TYPE_CHECKING, Any, TextIO

if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    sys.dont_write_bytecode = False  # each of the processes that tests start would compile everything anew: 2 s a time

import damping_pipelines  # isort: skip  # first, since it sets one thread for the linear algebra before numpy is loaded
import hypothesis
import numpy as np
import pandas as pd
import pytest
import typer.main

from damping import effects
from damping.forces.contract import Force
from damping.infer.law import Law
from damping.infer.observations import Observations, observe
from damping.predict.steady import resonant_amplitude
from damping.ranking import Ranking, rank_laws
from damping.records.reading import read_record
from damping.records.record import Record
from damping_pipelines.cli import main
from damping_reed1970 import data_folder
from damping_validation import truths

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Dialog, Page

    from damping_pipelines.study import Input
    from damping_pipelines.study_files import StudySettings
    from damping_reed1970.chapter_3.study import Chapter3
    from damping_reed1970.studies import Gaps, Studies

assert damping_pipelines.__doc__  # imported for its effect
gc.disable()  # until all is collected: a tenth of the time that collecting takes
# The same examples at every run, so that a change is judged by what it does; ``DAMPING_TRIES`` looks for new ones.
hypothesis.settings.register_profile("same", derandomize=True)
hypothesis.settings.register_profile("new", derandomize=False)
hypothesis.settings.load_profile("new" if "DAMPING_TRIES" in os.environ else "same")
typer.main.get_command = cache(typer.main.get_command)  # commands are built once, not at every call: 30 ms each
#: Names under which systems install the browser.
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")


#: Files that share what is made once for a session: they run on one worker, one after the other.
TOGETHER = {
    "architecture": ("architecture/test_house", "architecture/test_layers", "architecture/test_no_names"),
    "chapters": (
        *("gap/test_history", "pipelines/test_results", "reed1970/test_chapter_3_study"),
        *("reed1970/test_chapter_figures", "reed1970/test_source_tables", "report/test_browser"),
        *("report/test_chapters", "report/test_page", "report/test_tables"),
    ),
    "gap": (
        *("gap/test_command", "gap/test_corrected", "gap/test_effects", "gap/test_equivalents", "gap/test_evidence"),
        *("gap/test_size", "gap/test_unexplained"),
    ),
    "forks": (
        *("packaging/test_wheel", "pipelines/test_contributing", "pipelines/test_fleet", "pipelines/test_manifest"),
        *("pipelines/test_outputs",),
    ),
}
#: What takes longest starts first, so that no worker is left alone with it.
FIRST = (
    *("chapters", "gap", "forks", "ranking/test_ranking", "campaign/test_levels", "campaign/test_campaign"),
    *("gap/test_outside", "gap/test_search", "validation/test_cases", "validation/test_blind", "pipelines/test_cli"),
    *("pipelines/test_fleet_records", "api/test_agreement", "gap/test_further_effects", "records/test_odd_levels"),
    *("records/test_audit", "extrapolation/test_extrapolate", "extrapolation/test_decay", "extrapolation/test_curve"),
    *("gap/test_base_drive", "gap/test_other_law", "gap/test_too_large", "gap/test_null", "extrapolation/test_near"),
    *("campaign/test_base_shares", "campaign/test_nonlinear", "campaign/test_delays", "predict/test_sweep_rate"),
    *("records/test_ceiling", "predict/test_integrate", "predict/test_sweep_stage", "signals/test_ringdown"),
    *("plots/test_boxes", "campaign/test_tables", "api/test_api", "records/test_plausible_corruption"),
    *("pipelines/test_readme", "validation/test_steady", "validation/test_scorer", "docs/test_docs"),
)
assert all((Path(__file__).parent / f"{file}.py").is_file() for files in TOGETHER.values() for file in files)


def group_of(nodeid: str) -> str:
    """The files that a test belongs to: a name of ``TOGETHER``, or its own."""
    file = nodeid.partition("::")[0].removeprefix("tests/").removesuffix(".py")
    return next((name for name, files in TOGETHER.items() if file in files), file)


def is_double(item: pytest.Item) -> bool:
    """A slow test with ``few`` candidates (fixtures of that parameter) whose double has them all."""
    params = item.callspec.params.values() if hasattr(item, "callspec") else ()
    few = any(isinstance(value, str) and value == "few" for value in params)
    return few and item.get_closest_marker("slow") is not None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the slow tests to ``make slow``, which asks for them by ``-m``; what takes longest comes first."""
    asked = "slow" in config.option.markexpr
    left = {item for item in items if (is_double(item) if asked else item.get_closest_marker("slow"))}
    items[:] = [item for item in items if item not in left]
    config.hook.pytest_deselected(items=[*left])
    items.sort(key=lambda item: FIRST.index(group) if (group := group_of(item.nodeid)) in FIRST else len(FIRST))


def pytest_collection_finish() -> None:
    """What was imported and collected stays: looking through it for garbage took a 25th of the time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)
    gc.enable()


@pytest.hookimpl(optionalhook=True)  # pytest-xdist need not be installed
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file is run by one worker, and so are the files of a group, in the order of the tests.

    The marks ``xdist_group`` say nothing to pytest from 9.2 on, whose node ids stay as they are (pytest-xdist #1386).
    """
    if config.option.dist != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class GroupScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(nodeid)

    config.option.loadscopereorder = False
    return GroupScheduling(config, log)


def resonances_of(A: np.ndarray, F: np.ndarray, omega: np.ndarray | float) -> Observations:
    """One row a level, at phase resonance."""
    omega = np.broadcast_to(np.asarray(omega, dtype=float), (len(A),)).copy()
    return replace(truths.peaks(np.broadcast_to(F, A.shape), A), omega=omega, tested_omega=omega)


@pytest.fixture(scope="session")
def peaks() -> Callable[..., Observations]:
    return resonances_of


@pytest.fixture(scope="session")
def saturn() -> Callable[[str], Observations]:
    """Observations of a record of the report by name."""
    return lambda name: observe(read_record(data_folder() / "saturn-v" / "records" / f"{name}.csv"))


# What the chapters of the source report are made of takes seconds: files that use it are one group, on one worker.
# What it needs is imported by it: a second that other tests do not wait for.


@pytest.fixture(scope="session")
def chapter_3() -> Chapter3:
    """Everything of chapter III."""
    from damping_reed1970.chapter_3.study import chapter_3_results

    return chapter_3_results()


@pytest.fixture(scope="session")
def study_settings() -> StudySettings:
    """Settings of the Saturn V study."""
    from damping_pipelines.study_files import default_study, read_settings

    return read_settings(default_study())


@pytest.fixture(scope="session")
def study_inputs(study_settings: StudySettings) -> list[Input]:
    """The records of that study."""
    from damping_pipelines.study import read_inputs
    from damping_pipelines.study_files import default_study

    return read_inputs(study_settings, default_study().parent)


@pytest.fixture(scope="session")
def studies(study_settings: StudySettings) -> Studies:
    """Studies of the other chapters, as the Saturn V study has them."""
    from damping_reed1970.studies import compute_studies

    return compute_studies(study_settings.seed)


@pytest.fixture(scope="session")
def gaps() -> Gaps:
    """Two gaps of the report, diagnosed."""
    from damping_reed1970.studies import diagnose_gaps

    return diagnose_gaps()


@pytest.fixture(scope="session")
def rankings(study_settings: StudySettings, study_inputs: list[Input]) -> dict[str, Ranking]:
    """Rankings of all laws by record of that study."""
    seed = study_settings.seed
    return {one.settings.name: rank_laws(one.prepared.all_rows, seed) for one in study_inputs}


@pytest.fixture(scope="session")
def tables_of_source(rankings: dict[str, Ranking]) -> dict[str, pd.DataFrame]:
    """Tables of the report beside ours."""
    from damping_reed1970.exhibit import source_tables

    return source_tables(rankings)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Headless Chromium; without it the tests are skipped, and say so."""
    from playwright.sync_api import sync_playwright

    found = next((path for path in map(shutil.which, CHROMIUM) if path), None)
    if found is None:
        pytest.skip(f"NO BROWSER, PAGES NOT CHECKED: none of {', '.join(CHROMIUM)} is installed (.ci/run installs it)")
    with sync_playwright() as playwright:
        # without a sandbox of its own, so that it starts in a container
        running = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        yield running
        running.close()


@dataclass
class Opened:
    """A page in the browser with what it complained about and what it asked for."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)


@pytest.fixture(scope="session")
def open_page(browser: Browser) -> Callable[[bool], Page]:
    """A page with or without scripts, opened once: a new one is a new process of the browser."""
    return cache(lambda scripts: browser.new_context(java_script_enabled=scripts).new_page())


@pytest.fixture
def opened(open_page: Callable[[bool], Page]) -> Callable[..., AbstractContextManager[Opened]]:
    """``with opened(path, width=390, scheme="dark") as one``: a page loaded from its file."""

    @contextmanager
    def opening(path: Path, width: int = 1280, scheme: str = "light", scripts: bool = True) -> Iterator[Opened]:
        page = open_page(scripts)
        page.set_viewport_size({"width": width, "height": 900})
        page.emulate_media(media="null", color_scheme=scheme)
        page.mouse.move(0, 0)
        one = Opened(page)

        def refuse(dialog: Dialog) -> None:
            one.complaints.append(f"dialog {dialog.message}")
            dialog.dismiss()

        listeners = {
            "console": lambda said: one.complaints.append(said.text) if said.type in ("error", "warning") else None,
            "pageerror": lambda error: one.complaints.append(str(error)),
            "dialog": refuse,
            "request": lambda request: one.requests.append(request.url),
        }
        for event, listener in listeners.items():
            page.on(event, listener)
        try:
            page.goto(path.as_uri())
            yield one
        finally:
            for event, listener in listeners.items():
                page.remove_listener(event, listener)
            page.goto("about:blank")

    return opening


@pytest.fixture
def check_page(opened: Callable[..., AbstractContextManager[Opened]]) -> Callable[..., None]:
    """``check_page(path, *looks)``: a page is quiet, asks for nothing, fits and can be read at each look.

    It is loaded once, at the first look, with its folds opened. ``least`` texts are there; ``alone``: it is one file.
    """
    contrast = (Path(__file__).parent / "contrast.js").read_text()

    def check(path: Path, *looks: tuple[int, str], least: int = 50, alone: bool = True) -> None:
        with opened(path, width=looks[0][0], scheme=looks[0][1]) as one:
            one.page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            for width, scheme in looks:
                one.page.set_viewport_size({"width": width, "height": 900})
                one.page.emulate_media(color_scheme=scheme)
                assert one.page.evaluate("document.documentElement.scrollWidth") <= width, path.name
                assert one.page.evaluate(
                    "[...document.querySelectorAll('figure .scroll')].every((f) => f.scrollWidth <= f.clientWidth + 1)"
                )
                found = one.page.evaluate(contrast)
                assert found["checked"] > least
                assert found["found"] == [], path.name
            assert one.complaints == []
            if alone:
                assert one.requests == [path.as_uri()]
            assert all(request.startswith(("file:", "data:")) for request in one.requests)

    return check


REAL = Path(__file__).parents[2] / "shared" / "real"


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Callable[[bytes | str, str], Path]:
    """Writes bytes or text to a file of the given name and returns its path; the next call may overwrite it."""
    folder = tmp_path_factory.mktemp("records")

    def write(content: bytes | str, name: str = "record.csv") -> Path:
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


#: Stands for the process that every read of an array file starts with its imports: they are done once here, and each
#: read is a child with the limits of its own.
READER = """
import json, os, sys, traceback
import h5py, scipy.io
import worker
for line in sys.stdin:
    words, *streams = json.loads(line)
    child = os.fork()
    if child == 0:
        for number, path in enumerate(streams, start=1):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.argv, code = ["worker", *words], 1
        try:
            worker.main()
            code = 0
        except Exception:  # whatever ends a reader: its traceback is what the parent reads
            traceback.print_exc()
        sys.stderr.flush()
        os._exit(code)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="session", autouse=True)
def one_reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Array files are read by children of one process, started when a first file is read."""
    started: list[subprocess.Popen[str]] = []
    folder = tmp_path_factory.mktemp("reader")
    streams = [folder / "out", folder / "err"]

    def run(
        command: list[str], env: dict[str, str], stdout: IO[bytes], **_: object
    ) -> subprocess.CompletedProcess[bytes]:
        python, _safe, script, *words = command
        if not started:
            environment = env | {"PYTHONPATH": str(Path(script).parent)}
            pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
            started.append(subprocess.Popen([python, "-c", READER], env=environment, **pipes))
        print(json.dumps([words, *map(str, streams)]), file=started[0].stdin, flush=True)
        code = int(started[0].stdout.readline())
        stdout.write(streams[0].read_bytes())
        return subprocess.CompletedProcess(command, code, None, streams[1].read_bytes())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("damping.formats.arrays.subprocess", SimpleNamespace(**vars(subprocess) | {"run": run}))
        yield
    for process in started:
        process.stdin.close()
        process.wait()


#: Forks a child for each line: its code, words, folder, environment, paths of modules, and files as standard streams. A
#: child starts with everything imported that is not of this project; ``wait`` asks for the exit code of one.
FORKING = """
import atexit, gc, json, os, sys, traceback
import arviz, dask.__main__, distributed.cli.dask_scheduler, distributed.cli.dask_worker, emcee, h5netcdf, jinja2
import matplotlib.backends.backend_svg, matplotlib.figure, netCDF4, pyarrow.dataset, pyarrow.parquet
import pydantic, rich.progress, rich.table, scipy.integrate, scipy.optimize, scipy.signal, scipy.stats, typer.main
gc.freeze()
for line in sys.stdin:
    order = json.loads(line)
    if "wait" in order:
        child, status = os.waitpid(order["wait"], 0 if order["until it ends"] else os.WNOHANG)
        print(json.dumps(os.waitstatus_to_exitcode(status) if child else None), flush=True)
        continue
    child = os.fork()
    if child:
        print(child, flush=True)
        continue
    for number, path in enumerate(order["streams"]):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT if number else os.O_RDONLY), number)
    sys.stdin = open(0, closefd=False)
    os.chdir(order["folder"])
    os.environ.update(order["environment"])
    sys.path[:0] = order["paths"]
    sys.argv[1:], code = order["words"], 0
    try:
        # code that a test wrote, as for ``python -c``; it comes by the pipe from the test alone
        exec(order["code"], {"__name__": "__main__"})
    except SystemExit as stopped:
        code = stopped.code or 0
    except BaseException:
        traceback.print_exc()
        code = 1
    atexit._run_exitfuncs()
    try:
        sys.stdout.flush()
    except OSError:
        code = 120  # as Python ends then
    os._exit(code)  # without a second for taking down what was imported
"""


@dataclass
class Fork:
    """A process of its own that runs Python code; it can be killed and waited for."""

    server: Forking
    pid: int
    out: Path
    err: Path
    code: int | None = None

    def poll(self, until_it_ends: bool = False) -> int | None:
        """Its exit code, None while it runs."""
        if self.code is None:
            self.code = self.server.ask({"wait": self.pid, "until it ends": until_it_ends})
        return self.code

    def wait(self) -> int:
        code = self.poll(until_it_ends=True)
        assert code is not None
        return code

    def send(self, number: int) -> None:
        os.kill(self.pid, number)


class Forking:
    """``start(code, *words)`` runs Python code in a process that has imported all but the modules of this project."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.count = folder, 0
        single = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}  # a process that forks has no threads
        self.server = subprocess.Popen(
            [sys.executable, "-c", FORKING],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | single,
        )

    def ask(self, order: dict[str, object]) -> int | None:
        print(json.dumps(order), file=self.server.stdin, flush=True)
        answer = self.server.stdout.readline()
        assert answer, "the process that forks the others has ended"
        return json.loads(answer)

    def start(
        self,
        code: str,
        *words: object,
        folder: Path | None = None,
        paths: Iterable[Path] = (),
        given: Path = Path(os.devnull),
        out: Path | None = None,
        **environment: str,
    ) -> Fork:
        """``given`` and ``out`` are the files (or pipes) of standard input and output."""
        self.count += 1
        out, err = out or self.folder / f"{self.count}.out", self.folder / f"{self.count}.err"
        err.touch()
        order = {
            "code": code,
            "words": [str(word) for word in words],
            "streams": [str(given), str(out), str(err)],
            "folder": str(folder or Path.cwd()),
            "paths": [str(path) for path in paths],
            "environment": environment,
        }
        pid = self.ask(order)
        assert pid is not None
        return Fork(self, pid, out, err)

    def talk(self, code: str, **options: Any) -> tuple[Fork, TextIO, TextIO]:
        """A process with its standard input, to write to, and its standard output, to read from."""
        pipes = [self.folder / f"{self.count}.{name}" for name in ("asked", "answered")]
        for pipe in pipes:
            os.mkfifo(pipe)
        fork = self.start(code, given=pipes[0], out=pipes[1], **options)
        return fork, pipes[0].open("w"), pipes[1].open()

    def run(self, code: str, *words: object, **options: Any) -> subprocess.CompletedProcess[str]:
        fork = self.start(code, *words, **options)
        done = fork.wait()
        shown = "" if fork.out.is_char_device() else fork.out.read_text()
        return subprocess.CompletedProcess([], done, shown, fork.err.read_text())


@pytest.fixture(scope="session")
def forking(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forking]:
    """Processes that need not import what others have imported: tests that use it are one group, on one worker."""
    forking = Forking(tmp_path_factory.mktemp("forks"))
    yield forking
    forking.server.stdin.close()
    forking.server.wait()


@pytest.fixture(scope="session")
def real() -> Path:
    """Folder of the measured records, which are not part of the project."""
    if not REAL.is_dir():
        pytest.skip("the folder of measured records is absent: their licences keep them out of the project")
    return REAL


@dataclass(frozen=True)
class Run:
    code: int
    out: str
    err: str


#: A cell that is a number cut short.
CUT = re.compile(r"(^|\s)[-−]?[\d.]+…", re.MULTILINE)


def check_width(shown: str) -> None:
    """Standard output keeps to 80 columns with whole numbers; commands and paths, to be copied, are one line."""
    wide = [line for line in shown.splitlines() if len(line) > 80 and "damping " not in line and os.sep not in line]
    assert wide == [] or shown.startswith(("{", "["))  # or the JSON form
    assert not CUT.search(shown)


@pytest.fixture
def damping(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Callable[..., Run]:
    """``damping(*words)`` gives exit code, standard output and standard error of a command in a pipe.

    Whatever test calls a command, what it prints is held against the width of a pipe.
    """
    monkeypatch.delenv("COLUMNS", raising=False)

    def run(*words: object) -> Run:
        with pytest.raises(SystemExit) as stopped:
            main([str(word) for word in words])
        captured = capsys.readouterr()
        check_width(captured.out)
        return Run(int(stopped.value.code or 0), captured.out, captured.err)

    return run


@pytest.fixture
def no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures that nobody looks at are built and written without their marks: to draw them takes most of the time."""
    monkeypatch.setattr("matplotlib.figure.Figure.draw", lambda *_: None)


@pytest.fixture
def no_rivals(monkeypatch: pytest.MonkeyPatch) -> None:
    """Diagnoses without causes outside the library, a third of their time: where effects and sizes alone are looked at.

    They can only lower what is staked on the library, and are told in cautions.
    """
    monkeypatch.setattr("damping.gap.outside.weigh_outside", lambda *_: ((), ()))


@pytest.fixture
def few_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sweeps by averages in a twentieth of the steps: a mode with one steady state leaves no branch to be followed."""
    monkeypatch.setattr("damping.predict.branches._FEWEST_STEPS", 100)


@pytest.fixture
def one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """A study samples in this process: to start others takes longer than what short studies do in them."""
    monkeypatch.setattr("damping_pipelines.study.start_pool", lambda: ThreadPoolExecutor(1))


#: What stands for all candidates of a ranking, and of a prediction.
LAWS = (Law(("viscous",)), Law(("viscous", "velocity-squared")), Law(("viscous", "displacement-velocity")))
#: And for all effects of a diagnosis: of damping, frequency, a second plane, and of either quantity that is measured.
EXPLAINING = (
    "viscous-coefficient",
    "velocity-squared",
    "natural-frequency",
    "planar-coupling",
    "amplitude-scale",
    "phase-lag",
)


@pytest.fixture
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """A tenth of the draws that a prediction averages: where a few more digits of its bands are not what is tested."""
    monkeypatch.setattr("damping.extrapolation.draws.AVERAGE_DRAWS", 4_000)
    monkeypatch.setattr("damping.extrapolation.FRESH_DRAWS", 154)


@pytest.fixture
def few_laws(few_draws: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three laws to rank and to predict with, few draws and six effects: where they are not what is tested."""
    for module in ("api", "campaign.answer"):
        monkeypatch.setattr(f"damping.{module}.candidate_laws", lambda *_: list(LAWS))
    monkeypatch.setattr("damping.extrapolation.plan.resonant_laws", lambda *_: list(LAWS))
    monkeypatch.setattr("damping_pipelines.fleet.analyse.candidate_laws", lambda *_: list(LAWS))
    monkeypatch.setattr("damping.extrapolation.resonant_laws", lambda *_: list(LAWS))
    for choose in ("candidate_laws", "resonant_laws"):
        monkeypatch.setattr(f"damping_pipelines.study.{choose}", lambda *_: list(LAWS))
    monkeypatch.setattr("damping.gap.diagnose.CATALOGUE", {name: effects.CATALOGUE[name] for name in EXPLAINING})


@pytest.fixture(scope="session")
def saturn_data() -> Path:
    return data_folder() / "saturn-v"


#: Mass and natural frequency (rad/s) of the mode whose sweeps tests make.
M = 0.5
OMEGA_N = 10.0


def swept_record(
    force: Force,
    levels: np.ndarray,
    noise: float = 0.0,
    offset: float = 0.0,
    dropout: float = 0.0,
    rows: int = 21,
    seed: int = 0,
) -> Record:
    """Rows from phase 0.15 pi to 0.85 pi: C(A) = F sin(phase), M omega^2 = K + (S - F cos(phase))/A.

    Args:
        noise: relative, of amplitude, and in rad of phase. offset: added to every phase. dropout: share by which the
            force is lower at resonance than far from it (the force column is the real one).
    """
    rng = np.random.default_rng(seed)
    tables = []
    for level in levels:
        phase = np.linspace(0.15 * np.pi, 0.85 * np.pi, rows)
        F = level * (1.0 - dropout * np.sin(phase) ** 4)
        A = resonant_amplitude(force, F * np.sin(phase), OMEGA_N)
        S = np.asarray(force.in_phase(A, OMEGA_N))
        omega = np.sqrt(OMEGA_N**2 + (S - F * np.cos(phase)) / (M * A))
        tables.append(
            pd.DataFrame(
                {
                    "sweep": f"F{level:.3g}",
                    "force": F,
                    "frequency": omega / (2.0 * np.pi),
                    "amplitude": A * np.exp(noise * rng.standard_normal(rows)),
                    "phase": phase + offset + noise * rng.standard_normal(rows),
                }
            )
        )
    return Record(pd.concat(tables, ignore_index=True), "simulated")


@pytest.fixture
def swept() -> Callable[..., Record]:
    return swept_record
