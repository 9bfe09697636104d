"""Fixtures that several parts share: the report's records as observations, synthetic resonances, pages in a browser."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import damping_pipelines  # isort: skip  # first, since it sets one thread for the linear algebra before numpy is loaded
import numpy as np
import pandas as pd
import pytest

from damping.forces.contract import Force
from damping.infer.law import Law
from damping.infer.observations import Observations, observe
from damping.predict.steady import resonant_amplitude
from damping.ranking import Ranking, rank_laws
from damping.records.reading import read_record
from damping.records.record import Record
from damping_pipelines.cli import main
from damping_reed1970 import data_folder
from damping_reed1970.chapter_3.study import Chapter3, chapter_3_results
from damping_reed1970.chapter_6 import printed_laws
from damping_reed1970.exhibit import source_tables
from damping_reed1970.studies import Studies, compute_studies

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

assert damping_pipelines.__doc__  # imported for its effect
#: Names under which systems install the browser.
CHROMIUM = ("chromium", "chromium-browser", "google-chrome")


def resonances_of(A: np.ndarray, F: np.ndarray, omega: np.ndarray | float) -> Observations:
    """One row a level, at phase resonance."""
    n = len(A)
    omega = np.broadcast_to(np.asarray(omega, dtype=float), (n,)).copy()
    zero = np.zeros(n)
    return Observations(
        A=A,
        omega=omega,
        D=F,
        R=zero,
        sweep=np.arange(n),
        sd_amplitude=zero,
        sd_force=zero,
        sd_phase=zero,
        sweeps=tuple(f"L{i}" for i in range(n)),
        tested_force=F,
        tested_amplitude=A,
        tested_omega=omega,
    )


@pytest.fixture
def peaks() -> Callable[..., Observations]:
    return resonances_of


@pytest.fixture(scope="session")
def saturn() -> Callable[[str], Observations]:
    """Observations of a record of the report by name."""
    return lambda name: observe(read_record(data_folder() / "saturn-v" / "records" / f"{name}.csv"))


# What the chapters of the source report are made of takes seconds: files that use it are one group, on one worker.


@pytest.fixture(scope="session")
def chapter_3() -> Chapter3:
    """Everything of chapter III."""
    return chapter_3_results()


@pytest.fixture(scope="session")
def short_studies() -> Studies:
    """Studies of the other chapters with few simulated tests."""
    return compute_studies(replicates=(60, 40))


@pytest.fixture(scope="session")
def rankings_of_printed_laws(saturn: Callable[[str], Observations]) -> dict[str, Ranking]:
    """Rankings of the laws of section 6.1 by record."""
    laws: dict[str, list[Law]] = {}
    for law in printed_laws():
        laws.setdefault(law.record, []).append(Law(law.forces))
    return {name: rank_laws(saturn(name), 0, tuple(dict.fromkeys(wanted))) for name, wanted in laws.items()}


@pytest.fixture(scope="session")
def tables_of_source(rankings_of_printed_laws: dict[str, Ranking]) -> dict[str, pd.DataFrame]:
    """Tables of the report beside ours."""
    return source_tables(rankings_of_printed_laws)


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


@pytest.fixture
def opened(browser: Browser) -> Callable[..., AbstractContextManager[Opened]]:
    """``with opened(path, width=390, scheme="dark") as one``: a page loaded from its file."""

    @contextmanager
    def opening(path: Path, width: int = 1280, scheme: str = "light", scripts: bool = True) -> Iterator[Opened]:
        size = {"width": width, "height": 900}
        context = browser.new_context(viewport=size, color_scheme=scheme, java_script_enabled=scripts)
        page = context.new_page()
        one = Opened(page)
        page.on("console", lambda said: one.complaints.append(said.text) if said.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: one.complaints.append(str(error)))
        page.on("dialog", lambda dialog: one.complaints.append(f"dialog {dialog.message}"))
        page.on("request", lambda request: one.requests.append(request.url))
        page.goto(path.as_uri())
        yield one
        context.close()

    return opening


@pytest.fixture
def check_page(opened: Callable[..., AbstractContextManager[Opened]]) -> Callable[..., None]:
    """``check_page(path, width, scheme)``: a report is quiet, self-contained, no wider than the window, readable."""
    contrast = (Path(__file__).parent / "contrast.js").read_text()

    def check(path: Path, width: int = 1280, scheme: str = "light") -> None:
        with opened(path, width=width, scheme=scheme) as one:
            one.page.evaluate("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
            assert one.complaints == []
            assert one.requests == [path.as_uri()]
            assert one.page.evaluate("document.documentElement.scrollWidth") <= width
            assert one.page.evaluate(
                "[...document.querySelectorAll('figure .scroll')].every((f) => f.scrollWidth <= f.clientWidth + 1)"
            )
            found = one.page.evaluate(contrast)
            assert found["checked"] > 50
            assert found["found"] == []

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
