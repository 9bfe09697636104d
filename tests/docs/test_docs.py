"""The documentation: it builds without a warning, its links lead somewhere, and every block of every page runs.

Commands run as they stand, each page in a folder of its own, shortened: on every third row of the examples, with two or
three candidate laws, a diagnosis without chains, and a fleet and studies without processes.
"""

from __future__ import annotations

import json
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pytest
import typer

import damping as dp
from damping.forces import CATALOGUE
from damping_pipelines.cli import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "_build" not in path.parts)


class Block(NamedTuple):
    """A fenced block of a page: its language, caption and text."""

    language: str
    caption: str
    text: str


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page in order, those within lists too."""
    fence = re.compile(r"^( *)```(\S+)(?: (\S+))?\n(.*?)^\1```$", re.MULTILINE | re.DOTALL)
    found = []
    for indent, kind, argument, body in fence.findall(page.read_text()):
        text = re.sub(rf"^{indent}", "", body, flags=re.MULTILINE)
        caption = re.match(r":caption: (.+)\n\n?", text)
        language = argument if kind == "{code-block}" else kind
        found.append(Block(language, caption[1] if caption else "", text[caption.end() :] if caption else text))
    return found


EXECUTED = {page: [b for b in blocks(page) if b.language in ("sh", "python", "toml")] for page in PAGES}


@pytest.fixture
def folder(tmp_path, monkeypatch, few_laws, one_process, no_drawing) -> Path:
    """A folder with the data and the examples, their records thinned, and few laws to try."""
    (tmp_path / "data").symlink_to(ROOT / "data")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    for record in tmp_path.glob("examples/*/record.csv"):
        pd.read_csv(record).iloc[::3].to_csv(record, index=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def exit_code(damping) -> Callable[[str], int]:
    """Runs a line of a page, shortened, and gives its exit code."""

    def run(line: str) -> int:
        words = shlex.split(line.replace("--workers 1", "--workers 0"))
        return damping(*words[1:], *(["--no-posterior"] if words[1] == "gap" else [])).code

    return run


def run(block: Block, names: dict[str, Any], exit_code: Callable[[str], int]) -> None:
    """Run the lines of a block, or write the file that it is."""
    if block.language == "python":
        exec(compile(block.text, "page", "exec"), names)  # a page of our own: its blocks are what is tested
    elif block.language == "sh":
        wanted = int(block.caption.removeprefix("exit code ")) if block.caption.startswith("exit code") else 0
        for line in block.text.splitlines():
            if line.startswith("damping "):
                assert exit_code(line) == wanted, line
            else:
                assert line.split()[0] in ("mkdir", "cp"), line
                subprocess.run(shlex.split(line), check=True)
    if re.fullmatch(r"[\w-]+\.\w+", block.caption):
        Path(block.caption).write_text(block.text)


@pytest.mark.slow
@pytest.mark.sampling
@pytest.mark.parametrize("page", [page for page in PAGES if EXECUTED[page]], ids=lambda p: str(p.relative_to(DOCS)))
def test_every_block_of_a_page_runs(page, folder, exit_code):
    names: dict[str, Any] = {}
    for block in blocks(page):
        run(block, names, exit_code)
    if page.name == "forms.md":
        forms_have_their_keys(page, folder)


#: Keys of a proposed test.
NEXT_TEST = {
    "what",
    "why",
    "expected_log_odds",
    "columns",
    "rows",
    "command",
    "points",
    "added_mass",
    "amplitude",
    "force",
}


def forms_have_their_keys(page: Path, folder: Path) -> None:
    """Every key of a form's table is in the form just written."""
    checked = 0
    for section in page.read_text().split("\n## ")[1:]:
        written = re.search(r"--json (\w+\.json)", section)
        if not written:
            continue
        form = json.loads((folder / written[1]).read_text())
        assert form["format"] == section.split("\n")[0]
        prose = re.sub(r"```.*?```", "", section, flags=re.DOTALL)
        keys = set(re.findall(r"`([a-z_]+)`", prose)) - {"null"}
        # without --select there are no steps, and no proof that one is the best; an action is one of its values
        missing = {"action", "term", "reason", "nodes", "bound"}
        missing |= {"relative", "state", "instead", "smooth"}  # parameters of other effects than those of the example
        if form.get("far_off") == []:  # no reading is far off
            missing |= {"sigma", "set_aside"}
        if form.get("next_test", True) is None:  # nothing to settle: a test has no keys
            missing |= NEXT_TEST
        assert keys - every_key(form) <= missing, section[:20]
        checked += len(keys)
    assert checked > 60


def every_key(value: Any) -> set[str]:
    if isinstance(value, dict):
        return set(value) | {key for inner in value.values() for key in every_key(inner)}
    return {key for inner in value for key in every_key(inner)} if isinstance(value, list) else set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("example", "mode", "leader", "said"),
    [
        ("bolted-joint", "panel", "displacement + slip", "`displacement + slip` leads (0.69)"),
        ("tank", "tank", "viscous + quadratic-displacement", "puts `viscous + quadratic-displacement` first"),
        ("two-plane-mode", "model", "viscous", "none fits: the first, viscous damping, misses the"),
    ],
)
def test_examples_say_what_the_ranking_says(example, mode, leader, said):
    folder = ROOT / "examples" / example
    ranking = dp.rank(dp.read_record(folder / "record.csv"), dp.read_mode(folder / f"{mode}.toml"))
    best = ranking.ranking.candidates[0]
    assert best.name == leader
    assert f"{best.weight:.2f}" in said or "(" not in said
    assert (ranking.ranking.fit.verdict == "none fits") == ("none fits" in said)
    assert said in (folder / "README.md").read_text()


def test_options_named_anywhere_exist():
    """Every option in the documents is one of a command."""
    group = typer.main.get_command(app)
    known = {option for one in group.commands.values() for parameter in one.params for option in parameter.opts}
    known |= {
        option for one in group.commands.values() for parameter in one.params for option in parameter.secondary_opts
    }
    known |= {"--help", "--version", "--quiet", "--port"}  # the latter of Dask's scheduler
    pages = [*PAGES, ROOT / "README.md", *(ROOT / "examples").rglob("README.md")]
    # benchmarks have options of their own
    texts = [(page.name, re.sub(r"`python -m benchmarks[^`]*`", "", page.read_text())) for page in pages]
    named = {(option, page) for page, text in texts for option in re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)}
    assert len(named) > 30
    assert {(option, page) for option, page in named if option not in known} == set()


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages, built as ``make docs`` does; a broken link or a page that is nowhere listed is an error."""
    out = tmp_path_factory.mktemp("docs")
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "--fail-on-warning",
        "--quiet",
        "--doctree-dir",
        out / "trees",
        DOCS,
        out,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return out


def test_reference_has_every_command_and_every_force(built):
    commands = (built / "reference" / "commands.html").read_text()
    for command in app.registered_commands:
        assert f"damping {command.name or command.callback.__name__}</h2>" in re.sub(r"<a .*?</a>", "", commands)
    forces = (built / "reference" / "forces.html").read_text()
    assert all(name in forces for name in CATALOGUE)


def test_pages_link_to_what_is_there(built):
    pages = sorted(built.rglob("*.html"))
    assert len(pages) >= len(PAGES)
    for page in pages:
        html = page.read_text()
        for target in re.findall(r'href="([^"]*)"', html):
            path, _, anchor = target.partition("#")
            if re.match(r"https?:|mailto:|data:", target):
                continue
            file = (page.parent / path.split("?")[0]).resolve() if path else page
            file = file / "index.html" if file.is_dir() else file
            assert file.exists(), f"{page.name}: {target}"
            if anchor and file.suffix == ".html":
                assert f'id="{anchor}"' in file.read_text(), f"{page.name}: {target}"


@pytest.mark.slow
def test_pages_are_quiet_load_nothing_fit_and_can_be_read(check_page, built):
    for page in PAGES:
        path = (built / page.relative_to(DOCS)).with_suffix(".html")
        check_page(path, (390, "light"), (1280, "dark"), least=20, alone=False)
