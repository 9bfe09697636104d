"""The generator shares no code with what diagnoses its cases."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

import damping
import damping_validation

PIPELINES = Path(damping_validation.__file__).parents[1]
GENERATOR = PIPELINES / "damping_validation" / "generator"
SELECTION = Path(damping.__file__).parent


def imports(module: Path) -> set[str]:
    """Full names of everything a module imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in {module}"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


@pytest.mark.parametrize("module", sorted(GENERATOR.rglob("*.py")), ids=lambda path: path.stem)
def test_the_generator_imports_only_itself_numpy_and_scipy(module):
    foreign = {
        name
        for name in imports(module)
        if not name.startswith("damping_validation.generator.")
        and name.split(".")[0] not in {"numpy", "scipy", *sys.stdlib_module_names}
    }
    assert not foreign


def test_only_the_blind_stage_imports_the_generator():
    users = {
        module.relative_to(PIPELINES.parent).as_posix()
        for folder in (PIPELINES, SELECTION)
        for module in folder.rglob("*.py")
        if GENERATOR not in module.parents
        and any(name.startswith("damping_validation.generator") for name in imports(module))
    }
    assert users == {"pipelines/damping_validation/blind.py"}
