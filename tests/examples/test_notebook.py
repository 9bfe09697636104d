"""The example notebook: its cells are those of the script, and executing it again gives the outputs that are stored."""

from __future__ import annotations

import ast
import io
import os
import runpy
from contextlib import redirect_stdout
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).parents[2]
SCRIPT = runpy.run_path(str(ROOT / "examples" / "make_notebook.py"))
STORED = nbformat.read(SCRIPT["NOTEBOOK"], as_version=4)


def text_outputs(notebook: nbformat.NotebookNode) -> list[list[str]]:
    """What each cell printed or showed as text; pictures depend on the fonts of a machine."""
    return [
        [out.get("text") or out.get("data", {}).get("text/plain", "") for out in cell.get("outputs", [])]
        for cell in notebook.cells
    ]


def test_the_cells_are_those_of_the_script():
    made = SCRIPT["make"]()
    assert [(c.cell_type, c.source) for c in STORED.cells] == [(c.cell_type, c.source) for c in made.cells]


def test_it_was_executed_and_shows_tables_and_figures():
    shown = [set(out.data) for cell in STORED.cells for out in cell.get("outputs", []) if "data" in out]
    assert sum("text/html" in kinds for kinds in shown) >= 3
    assert sum("image/png" in kinds for kinds in shown) == 2
    assert not any(out.output_type == "error" for cell in STORED.cells for out in cell.get("outputs", []))


#: Words of the cells that compute nothing: reading, and a refusal.
QUICK = ("read_record", "InputError")


def run_cell(source: str, names: dict[str, object]) -> list[str]:
    """What a cell prints, and the value of its last expression as text."""
    body, printed, value = ast.parse(source).body, io.StringIO(), None
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    with redirect_stdout(printed):
        # cells of our own notebook, as a kernel runs them and shows the last expression: no input gets here
        exec(compile(ast.Module(body, []), "cell", "exec"), names)
        if last:
            # the last expression of the same cell
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    return [text for text in (printed.getvalue(), "" if value is None else repr(value)) if text]


def test_quick_cells_give_the_stored_outputs(monkeypatch):
    monkeypatch.chdir(SCRIPT["FOLDER"])
    cells = [cell for cell in STORED.cells if any(word in cell.source for word in QUICK)]
    assert len(cells) == 2
    names: dict[str, object] = {}
    made = [run_cell(cell.source, names) for cell in cells]
    assert made == text_outputs(nbformat.v4.new_notebook(cells=cells))


@pytest.mark.slow
@pytest.mark.sampling
def test_executing_it_again_gives_the_stored_outputs(monkeypatch):
    """In a kernel of its own."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(str(ROOT / house) for house in ("selection", "pipelines")))
    assert text_outputs(SCRIPT["execute"](SCRIPT["make"]())) == text_outputs(STORED)
