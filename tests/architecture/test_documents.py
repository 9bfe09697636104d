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


def test_lowest_versions_are_those_that_are_tried():
    """``make lowest`` installs what ``pyproject.toml`` promises, of every dependency that people install."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *extras["fleet"], *extras["formats"]]
    promised = {m[1]: m[2] for m in (re.match(r"([A-Za-z0-9_]+)(?:\[\w+\])?>=([\d.]+)", d) for d in wanted)}
    lines = (ROOT / "constraints-lowest.txt").read_text().splitlines()
    assert promised == dict(line.split("==") for line in lines if "==" in line)


def test_the_citation_is_of_this_version():
    from damping import __version__

    assert f"version: {__version__}\n" in (ROOT / "CITATION.cff").read_text()


def test_new_names_of_coming_over_exist():
    """What became of each module: every module in the left column is one."""
    rows = re.findall(r"^\| `(damping[\w.]*)` \| `", (ROOT / "docs" / "coming-over.md").read_text(), re.MULTILINE)
    assert len(rows) > 100
    for module in rows:
        house = ROOT / ("selection" if module.split(".")[0] == "damping" else "pipelines")
        path = house.joinpath(*module.split("."))
        assert path.with_suffix(".py").is_file() or (path / "__init__.py").is_file(), module


# the words themselves, so that they are found in every other file
@pytest.mark.parametrize("word", ["pypi", "pythonhosted", "npmjs", "/root/", "/work/"])
def test_no_host_names_or_machine_paths(word):
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False).stdout.split(b"\0")
    this = Path(__file__).name.encode()
    for name in filter(None, files):
        path = ROOT / name.decode()
        if path.is_file() and not name.endswith(this) and path.suffix in (".py", ".md", ".toml", ".txt", ".html", ""):
            assert word not in path.read_text(errors="ignore"), f"{name.decode()} holds {word}"
