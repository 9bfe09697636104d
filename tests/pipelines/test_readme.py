"""Every command of the README's tour runs as written."""

import re
import shlex
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TOUR = re.findall(r"^damping (.+)$", (ROOT / "README.md").read_text(), re.MULTILINE)


def test_the_tour_shows_the_main_commands():
    assert {line.split()[0] for line in TOUR} >= {"rank", "extrapolate", "regress", "sweep", "condition"}


@pytest.mark.sampling
@pytest.mark.parametrize("line", TOUR)
def test_command_of_the_tour(line, damping, tmp_path, monkeypatch):
    (tmp_path / "data").symlink_to(ROOT / "data")
    monkeypatch.chdir(tmp_path)
    run = damping(*shlex.split(line))
    assert run.code == 0, run.err
    words = shlex.split(line)
    if "--out" in words:
        assert (tmp_path / words[words.index("--out") + 1]).stat().st_size > 0
    else:
        assert run.out.strip()
