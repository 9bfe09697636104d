"""Make the example notebook and execute it: ``python examples/make_notebook.py`` (about a minute)."""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

from damping_pipelines.store import write_text

FOLDER = Path(__file__).parent
NOTEBOOK = FOLDER / "notebook.ipynb"
#: Seconds that a cell may take.
TIMEOUT = 900
TEXT = new_markdown_cell
CODE = new_code_cell
#: The cells in order.
CELLS = (
    (
        TEXT,
        """# From a record to a design load

The resonances of the bolted joint of this folder, tested at a few forces: which law, and how large at higher ones?""",
    ),
    (
        CODE,
        """import damping as dp

record = dp.read_record("bolted-joint/record.csv")
mode = dp.read_mode("bolted-joint/panel.toml")
record.table.groupby("sweep")[["force", "amplitude"]].max()""",
    ),
    (
        TEXT,
        """## Which damping law do the data support?

Best first; `weight` is the probability among the candidates, errors are in per cent of resonant amplitude.""",
    ),
    (
        CODE,
        """ranking = dp.rank(record, mode)
ranking""",
    ),
    (CODE, """ranking.plot()"""),
    (TEXT, """A law of the ranking can be sampled and handed to arviz."""),
    (
        CODE,
        """best = ranking.table["law"].iloc[0]
posterior = ranking[best].sample(seed=1).to_arviz()
print(best, dict(posterior.posterior.sizes))""",
    ),
    (TEXT, """## How large does the resonance get beyond the test?"""),
    (
        CODE,
        """largest = record.table["force"].max()
loads = dp.extrapolate(record, mode, [1.5 * largest, 2.0 * largest])
loads""",
    ),
    (CODE, """loads.plot()"""),
    (TEXT, """The same as plain values, as `damping extrapolate --json` writes them:"""),
    (
        CODE,
        """prediction = loads.to_json()["predictions"][0]
{key: f"{prediction[key]:.4g}" for key in ("force", "median", "low", "high", "linear_overprediction_percent")}""",
    ),
    (TEXT, """A bad argument is refused before any work."""),
    (
        CODE,
        """try:
    dp.extrapolate(record, mode, [-5])
except dp.InputError as error:
    print(error)""",
    ),
)


def make() -> nbformat.NotebookNode:
    """The notebook, not executed."""
    cells = []
    for number, (new_cell, source) in enumerate(CELLS):
        cell = new_cell(source)
        cell["id"] = f"cell-{number}"  # equal runs give equal files
        cells.append(cell)
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return new_notebook(cells=cells, metadata={"kernelspec": kernel})


def execute(notebook: nbformat.NotebookNode) -> nbformat.NotebookNode:
    """The notebook with its outputs, without the times at which they came."""
    NotebookClient(
        notebook, timeout=TIMEOUT, kernel_name="python3", record_timing=False, resources={"metadata": {"path": FOLDER}}
    ).execute()
    notebook.metadata.pop("language_info", None)
    return notebook


if __name__ == "__main__":
    write_text(NOTEBOOK, nbformat.writes(execute(make())) + "\n")
