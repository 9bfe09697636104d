"""Forces and effects carry their own facts: nobody outside their packages asks for one by name or by class."""

from __future__ import annotations

import ast
from pathlib import Path

from damping import forces
from damping.forces.contract import Force
from tests.architecture.test_layers import nodes

ROOT = Path(__file__).parents[2]
#: Houses whose modules ask a force for what it does. The exhibit of 1970 speaks of the report's own cases.
HOUSES = ("selection/damping", "pipelines/damping_pipelines", "pipelines/damping_validation")
#: The catalogues themselves, and the generator of blind cases: its forces are its own and share nothing with these.
APART = ("selection/damping/forces", "selection/damping/effects", "pipelines/damping_validation/generator")
MODULES = [
    path
    for house in HOUSES
    for path in sorted((ROOT / house).rglob("*.py"))
    if not path.relative_to(ROOT).as_posix().startswith(APART)
]
NAMES = set(forces.CATALOGUE)
CLASSES = {name for name, value in vars(forces).items() if isinstance(value, type) and issubclass(value, Force)} - {
    "Force"
}
#: The power law of section 4.3 that the regression fits has these two forms, named after the forces that they are.
POWER_LAWS = {"selection/damping/regression/fit.py"}


def literals(node: ast.AST) -> set[str]:
    """Texts anywhere in an expression."""
    return {part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)}


def test_no_force_is_asked_for_by_name_or_class():
    for path in MODULES:
        name = path.relative_to(ROOT).as_posix()
        for node in nodes(path):
            if isinstance(node, ast.Compare) and name not in POWER_LAWS:
                assert not literals(node) & NAMES, f"{name}:{node.lineno} compares with the name of a force"
            called = isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
            if called and node.func.id in ("isinstance", "issubclass"):
                asked = {part.id for part in ast.walk(node.args[1]) if isinstance(part, ast.Name)}
                assert not asked & (CLASSES | {"Force"}), f"{name}:{node.lineno} asks for the class of a force"
            if isinstance(node, ast.Attribute):
                assert node.attr not in ("register", "singledispatch"), f"{name}:{node.lineno} dispatches on classes"


def test_the_names_and_classes_looked_for_are_there():
    assert {"viscous", "slip"} <= NAMES
    assert {"Viscous", "Slip", "Sum"} <= CLASSES
