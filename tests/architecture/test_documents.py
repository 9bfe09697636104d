"""The documents speak of the code as it is."""

import ast
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text()


def purpose(path: Path) -> str:
    """First line of a module's docstring, without the full stop."""
    text = ast.get_docstring(ast.parse(path.read_text()))
    assert text, f"{path} has no docstring"
    return text.splitlines()[0].rstrip(".")


def documented() -> dict[str, str]:
    rows = re.findall(r"^\| `([a-z_./]+)` \| (.+?) \|$", ARCHITECTURE, re.MULTILINE)
    return dict(rows)


def code() -> dict[str, str]:
    parts = {f"selection/{p.parent.name}/": p for p in sorted((ROOT / "selection").glob("*/__init__.py"))}
    parts |= {f"selection/{p.name}": p for p in sorted((ROOT / "selection").glob("*.py")) if p.name != "__init__.py"}
    parts |= {f"pipelines/{p.parent.name}/": p for p in sorted((ROOT / "pipelines").glob("*/__init__.py"))}
    parts |= {f"pipelines/{p.name}": p for p in sorted((ROOT / "pipelines").glob("*.py")) if p.name != "__init__.py"}
    return {name: purpose(path) for name, path in parts.items()}


def test_module_table_is_the_code():
    assert documented() == code()


def test_commands_of_the_tour_exist():
    from pipelines.cli import app

    names = {command.name or command.callback.__name__ for command in app.registered_commands}
    readme = (ROOT / "README.md").read_text()
    used = set(re.findall(r"^(?:\.venv/bin/)?damping ([a-z]+)", readme, re.MULTILINE))
    assert used <= names
    assert {"study", "regress", "rank", "extrapolate"} <= used


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
