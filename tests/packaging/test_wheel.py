"""The wheel holds what runs: code, page, data. ``make package`` installs it into empty environments and runs it."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hatchling.build import build_editable, build_wheel

ROOT = Path(__file__).parents[2]
HOUSES = ("damping", "damping_pipelines", "damping_reed1970", "damping_validation")
DATA = Path("damping_reed1970", "_data")


def unpack(build: Callable[[str], str], folder: Path) -> Path:
    """The wheel that ``build`` makes of the clone without the network, unpacked."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        wheel = folder / build(str(folder))
    with zipfile.ZipFile(wheel) as file:
        file.extractall(folder / "site")
    return folder / "site"


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return unpack(build_wheel, tmp_path_factory.mktemp("wheel"))


@pytest.fixture
def run(unpacked: Path, tmp_path: Path, forking) -> Callable[..., str]:
    """Python code in a folder outside the clone, with the packages of the wheel before all others."""

    def run(code: str) -> str:
        done = forking.run(code, folder=tmp_path, paths=[unpacked])
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()

    return run


def names_in(unpacked: Path) -> list[str]:
    """Every file of the wheel by its path there."""
    return sorted(str(path.relative_to(unpacked)) for path in unpacked.rglob("*") if path.is_file())


def test_every_top_level_name_is_ours(unpacked):
    """Packages called ``selection``, ``pipelines`` or ``tests`` are other projects': ours must not meet them."""
    tops = {name.split("/")[0] for name in names_in(unpacked)}
    assert {top for top in tops if not top.endswith(".dist-info")} == set(HOUSES)


def test_no_package_of_that_name_can_overwrite_ours(unpacked, run, tmp_path):
    """With packages ``selection`` and ``pipelines`` installed into the same folder, ours are what they were."""
    for stranger in ("selection", "pipelines"):
        assert not (unpacked / stranger).exists()
        (tmp_path / stranger).mkdir()
        (tmp_path / stranger / "__init__.py").write_text("raise ImportError('of another project')\n")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r})\n" + "".join(f"import {house}\n" for house in HOUSES)
    run(code + "import damping_pipelines.cli\n")


def test_every_file_of_the_packages_is_in_it(unpacked):
    done = subprocess.run(
        ["git", "ls-files", "selection", "pipelines"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    tracked = [Path(name) for name in done.stdout.split() if (ROOT / name).is_file()]
    assert {path.parts[1] for path in tracked} == set(HOUSES)
    assert [path for path in tracked if not unpacked.joinpath(*path.parts[1:]).is_file()] == []


def test_every_package_says_that_it_is_typed(unpacked):
    assert [house for house in HOUSES if not (unpacked / house / "py.typed").is_file()] == []


#: The package that ships each folder of ``data``.
SHIPPED = {"saturn-v": "damping_reed1970", "blind": "damping_validation"}


def test_the_data_are_in_it_byte_by_byte(unpacked):
    for path in (ROOT / "data").rglob("*"):
        if path.is_file() and path.name != "README.md":  # origin and licence: the source distribution holds it
            name = path.relative_to(ROOT / "data")
            assert (unpacked / SHIPPED[name.parts[0]] / "_data" / name).read_bytes() == path.read_bytes()


def test_the_editable_install_finds_every_package(tmp_path):
    """The wheel of an editable install holds nothing but the way to the folders of the houses."""
    ways = [path.read_text() for path in unpack(build_editable, tmp_path).glob("*.pth")]
    folders = [Path(line) for way in ways for line in way.splitlines()]
    assert all(any((folder / house / "__init__.py").is_file() for folder in folders) for house in HOUSES)


def test_nothing_of_the_clone_is_needed(unpacked, run):
    code = """
from damping.report.page import Footer, Section, render_page
from damping_pipelines.study_files import default_study, read_settings
from damping_validation.scorer_output import load_blind_table
read_settings(default_study())
print(default_study(), len(load_blind_table()), len(render_page("t", [Section("s", "S", [])], Footer(1, {}, {}))))
"""
    study, cases, letters = run(code).rsplit(maxsplit=2)
    assert Path(study) == unpacked / "damping_reed1970" / "_data" / "saturn-v" / "study.toml"
    assert int(cases) > 0
    assert int(letters) > 10_000


def test_the_command_runs_outside_the_clone(unpacked, run):
    table = unpacked / "damping_reed1970" / "_data" / "saturn-v" / "tables" / "table_5_II.csv"
    words = ["regress", str(table), "--response", "E_in_lb", "--terms", "A_in^2*omega_rad_s"]
    assert "A_in^2*omega_rad_s" in run(f"from damping_pipelines.cli import main; main({words!r})")


def without(package: str) -> str:
    """The command line where a package is not installed."""
    return f"import sys; sys.modules[{package!r}] = None\nfrom damping_pipelines.cli import main; main()"


def check_extra(done: subprocess.CompletedProcess[str], extra: str, folder: Path) -> None:
    """One line says what to install, and nothing was written."""
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("damping: ")
    assert done.stderr.count("\n") == 1
    assert f"damping-selection[{extra}]" in done.stderr
    assert list(folder.iterdir()) == []


def test_an_install_without_fleets_says_which_extra_to_install(unpacked, tmp_path, forking):
    words = ("fleet", ".", "--out", "out")
    check_extra(forking.run(without("distributed"), *words, folder=tmp_path, paths=[unpacked]), "fleet", tmp_path)


def test_an_install_without_formats_says_which_extra_to_install(unpacked, tmp_path):
    """In an interpreter of its own: one that has loaded pandas beside the package would not be bare."""
    record = unpacked / DATA / "saturn-v" / "records" / "config-2-mode-1.csv"
    command = [sys.executable, "-c", without("pyarrow"), "export", str(record), "--out", "out.parquet"]
    env = {**os.environ, "PYTHONPATH": str(unpacked)}
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    check_extra(done, "formats", tmp_path)


def test_every_house_answers_from_the_wheel(run):
    """In one process: the first lines of help of each."""
    commands = ("study", "blind", "calibrate", "fleet", "gap", "import")
    code = f"""
from damping_pipelines.cli import main
for command in {commands!r}:
    try:
        main([command, "--help"])
    except SystemExit as stopped:
        assert not stopped.code, command
"""
    shown = run(code)
    assert [command for command in commands if f"damping {command}" not in shown] == []
