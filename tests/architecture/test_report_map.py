"""docs/report-map.md: what it names exists, and every section and figure of the report is in it."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "report-map.md").read_text()
ROWS = [[cell.strip() for cell in line.strip("|").split("|")] for line in TEXT.splitlines() if re.match(r"\| \d", line)]
SECTIONS = [row for row in ROWS if len(row) == 5]
FIGURES = [row for row in ROWS if len(row) == 3]
NAMED = sorted(set(re.findall(r"`((?:selection|pipelines|tests|data|docs)/[^`]+)`", TEXT)))


@cache
def defined(path: Path) -> set[str]:
    """Functions and classes at the top of a file."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    return {node.name for node in ast.parse(path.read_text()).body if isinstance(node, kinds)}


def test_files_and_names_exist() -> None:
    assert len(NAMED) > 100
    for name in NAMED:
        file, _, symbol = name.partition("::")
        assert (ROOT / file).is_file(), name
        assert not symbol or symbol in defined(ROOT / file), name


def test_commands_exist() -> None:
    from damping_pipelines.cli import app

    names = {command.name or command.callback.__name__ for command in app.registered_commands if command.callback}
    used = set(re.findall(r"`damping ([a-z]+)", TEXT))
    assert used <= names


def test_every_section_has_module_command_and_test() -> None:
    # the numbered sections of chapters II to VI; chapter I is the introduction
    sections = {2: 5, 3: 2, 4: 3, 5: 3, 6: 3}
    expected = {f"{chapter}.{k}" for chapter, number in sections.items() for k in range(1, number + 1)}
    assert {row[0] for row in SECTIONS} == expected
    for section, _, module, command, test in SECTIONS:
        assert "`selection/" in module or "`pipelines/" in module, section
        assert command.startswith("`damping "), section
        assert "`tests/" in test, section


def test_every_figure_has_a_drawing() -> None:
    listed = [number for row in FIGURES for number in row[0].split(", ")]
    expected = ["2.4", "2.5", "3.2", "3.3", "3.5", "3.6", "3.9", "3.10", *(f"4.{n}" for n in range(1, 11)), "5.1"]
    assert listed == expected
    assert all("`pipelines/damping_reed1970/chapter_" in row[2] for row in FIGURES)
