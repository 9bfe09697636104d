"""The wheel holds what runs: code, page, data. ``make package`` installs it into empty environments."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built without the network and unpacked."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "site")
    return folder / "site"


def run(unpacked: Path, code: str, folder: Path) -> str:
    """Python code in a folder outside the clone, with the packages of the wheel before all others."""
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_every_file_of_the_packages_is_in_it(unpacked):
    tracked = subprocess.run(
        ["git", "ls-files", "selection", "pipelines"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    assert len(tracked) > 150
    missing = [n for n in tracked if (ROOT / n).is_file() and not (unpacked / n.partition("/")[2]).is_file()]
    assert missing == []


#: The package that ships each folder of ``data``.
SHIPPED = {"saturn-v": "damping_reed1970", "blind": "damping_validation"}


def test_the_data_are_in_it_byte_by_byte(unpacked):
    for path in (ROOT / "data").rglob("*"):
        if path.is_file():
            name = path.relative_to(ROOT / "data")
            assert (unpacked / SHIPPED[name.parts[0]] / "_data" / name).read_bytes() == path.read_bytes()


def test_nothing_of_the_clone_is_needed(unpacked, tmp_path):
    code = """
from damping_pipelines.settings import default_study, read_settings
read_settings(default_study())
print(default_study())
"""
    assert Path(run(unpacked, code, tmp_path)) == unpacked / "damping_reed1970" / "_data" / "saturn-v" / "study.toml"
    code = "from damping_validation.blind_page import load_blind_table; print(len(load_blind_table()))"
    assert int(run(unpacked, code, tmp_path)) > 0
    code = """
from damping.report.page import Footer, Section, page
print(len(page("t", [Section("s", "S", [])], Footer(1, {}, {}))))
"""
    assert int(run(unpacked, code, tmp_path)) > 10_000


def test_the_command_runs_outside_the_clone(unpacked, tmp_path):
    data = unpacked / "damping_reed1970" / "_data" / "saturn-v"
    words = [
        "regress",
        str(data / "tables" / "table_5_II.csv"),
        "--response",
        "E_in_lb",
        "--terms",
        "A_in^2*omega_rad_s",
    ]
    assert "A_in^2*omega_rad_s" in run(unpacked, f"from damping_pipelines.cli import main; main({words!r})", tmp_path)
