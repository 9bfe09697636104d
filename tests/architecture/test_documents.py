"""The documents speak of the code as it is."""

import re
import runpy
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text()


def documented() -> dict[str, str]:
    rows = re.findall(r"^\| `([a-z_0-9./]+)` \| (.+?) \|$", ARCHITECTURE, re.MULTILINE)
    return dict(rows)


def test_module_table_is_the_code():
    """``python tests/architecture/write_module_table.py`` writes it."""
    script = runpy.run_path(str(ROOT / "tests" / "architecture" / "write_module_table.py"))
    assert documented() == script["modules"]()


def test_commands_of_the_tour_exist():
    from damping_pipelines.cli import app

    names = {command.name or command.callback.__name__ for command in app.registered_commands}
    readme = (ROOT / "README.md").read_text()
    used = set(re.findall(r"^(?:\.venv/bin/)?damping ([a-z]+)", readme, re.MULTILINE))
    assert used <= names
    assert {"regress", "rank", "extrapolate"} <= used


def test_every_runtime_dependency_has_a_reason():
    lines = (ROOT / "pyproject.toml").read_text().splitlines()
    for dependency in tomllib.loads("\n".join(lines))["project"]["dependencies"]:
        line = next(line for line in lines if f'"{dependency}"' in line)
        assert "#" in line, f"{dependency} has no reason beside it"


def test_constraints_pin_every_dependency():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"] + [d for extra in project["optional-dependencies"].values() for d in extra]
    pinned = {
        line.split("==")[0].lower() for line in (ROOT / "constraints.txt").read_text().splitlines() if "==" in line
    }
    for dependency in wanted:
        assert re.match(r"[A-Za-z0-9_.-]+", dependency)[0].lower() in pinned, dependency


@pytest.mark.parametrize("word", ["pypi", "pythonhosted", "npmjs", "/root/", "/work/"])
def test_no_host_names_or_machine_paths(word):
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False).stdout.split(b"\0")
    this = Path(__file__).name.encode()
    for name in filter(None, files):
        path = ROOT / name.decode()
        if path.is_file() and not name.endswith(this) and path.suffix in (".py", ".md", ".toml", ".txt", ".html", ""):
            assert word not in path.read_text(errors="ignore"), f"{name.decode()} holds {word}"
