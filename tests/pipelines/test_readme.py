"""Every command of the README's tour, and its Python, runs as written."""

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PYTHON = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
BLOCKS = re.findall(r"```\n(damping .*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
TOUR = [line.removeprefix("damping ") for block in BLOCKS for line in block.splitlines()]


def test_the_tour_shows_the_main_commands():
    assert {line.split()[0] for line in TOUR} >= {"rank", "extrapolate", "regress", "sweep", "gap", "condition"}


@pytest.mark.sampling
@pytest.mark.parametrize("block", BLOCKS, ids=lambda block: block.split()[1])
def test_commands_of_the_tour(block, damping, tmp_path, monkeypatch, few_laws):
    """The commands of a block follow each other, and one reads what another wrote."""
    for folder in ("data", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    for line in block.splitlines():
        words = shlex.split(line)[1:]
        run = damping(*words)
        assert run.code == 0, run.err
        if "--out" in words:
            assert (tmp_path / words[words.index("--out") + 1]).stat().st_size > 0
        else:
            assert run.out.strip()


@pytest.mark.sampling
def test_python_in_ten_lines(tmp_path, monkeypatch, capsys, few_laws):
    (code,) = PYTHON
    assert len([line for line in code.splitlines() if line]) == 9
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)  # our own text: that it runs is what is tested
    out = capsys.readouterr().out
    assert "held_out_error" in out
    assert re.search(r"^1 +90\.0( +[0-9.]+){4}$", out, re.MULTILINE)
    assert names["figure"].axes
    assert "viscous" in names["posterior"].posterior


def test_links_of_the_readme_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", (ROOT / "README.md").read_text()):
        assert "://" in target or (ROOT / target).exists(), target
