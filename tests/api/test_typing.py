"""What a type checker knows of the interface: the package is marked as typed, and every name has its type."""

from __future__ import annotations

import ast
import inspect
import re
from importlib import import_module
from pathlib import Path

import pytest
from mypy import api

import damping as dp

USER = """
import numpy as np
import damping as dp
record = dp.read_record("record.csv")
mode = dp.read_mode("mode.toml")
reveal_type(dp.rank(record)["viscous"].sample().draws)
reveal_type(dp.extrapolate(record, mode, np.array([60.0])).table)
reveal_type(dp.sweep(mode, force=np.array([2.0]), frequency=[1.0, 2.0]).record)
dp.rnak(record)
dp.rank("record.csv")
"""


def test_type_checkers_see_the_names_that_are_loaded() -> None:
    """The imports for them name each object at the place where it is found."""
    tree = ast.parse(inspect.getsource(dp))
    block = next(node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    imported = {
        name.name: node.module for node in block.body if isinstance(node, ast.ImportFrom) for name in node.names
    }
    assert sorted(imported) == dp.__all__
    for name, module in imported.items():
        assert getattr(import_module(str(module)), name) is getattr(dp, name)


@pytest.mark.slow
def test_a_typed_script_is_checked(tmp_path: Path) -> None:
    script = tmp_path / "user.py"
    script.write_text(USER)
    settings = Path(__file__).parents[2] / "pyproject.toml"
    said, _, _ = api.run(["--config-file", str(settings), "--follow-imports", "silent", str(script)])
    lines = re.findall(r"user\.py:(\d+): (?:note|error): (.*)", said)
    assert [(int(line), text.split("  [")[0]) for line, text in lines] == [
        (6, 'Revealed type is "dict[str, numpy.ndarray[tuple[Any, ...], numpy.dtype[numpy.float64]]]"'),
        (7, 'Revealed type is "pandas.core.frame.DataFrame"'),
        (8, 'Revealed type is "damping.records.record.Record"'),
        (9, 'Module has no attribute "rnak"'),
        (10, 'Argument 1 to "rank" has incompatible type "str"; expected "Record"'),
    ]
