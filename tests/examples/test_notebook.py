"""The example notebook: its cells are those of the script, and executing it again gives the outputs that are stored."""

from __future__ import annotations

import os
import runpy
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


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=[pytest.mark.slow, pytest.mark.sampling])])
def test_executing_it_again_gives_the_stored_outputs(monkeypatch, every):
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(str(ROOT / house) for house in ("selection", "pipelines")))
    chosen = [every or any(word in cell.source for word in QUICK) for cell in STORED.cells]
    assert sum(chosen) == (len(chosen) if every else 2)
    made, stored = SCRIPT["make"](), nbformat.from_dict(STORED)
    for notebook in (made, stored):
        notebook.cells = [cell for cell, wanted in zip(notebook.cells, chosen, strict=True) if wanted]
    assert text_outputs(SCRIPT["execute"](made)) == text_outputs(stored)
