"""Commands from start to finish, start-up included, beside importing what they stand on; and the memory they take.

Run ``python -m benchmarks.commands``. Each command and the import of numpy, pandas and scipy.stats run by turns, in
processes of their own. ``python -m benchmarks --guard`` compares the ratios with those of the table at the tag set last
(the committed table where there is no tag) and fails where a command has become 1.5 times slower.
"""

from __future__ import annotations

import io
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from benchmarks._rows import Row, middle, run_process
from damping_reed1970 import data_folder

ROOT = Path(__file__).parents[1]
STACK = [sys.executable, "-c", "import numpy, pandas, scipy.stats"]
PEER = "importing numpy, pandas and scipy.stats"
REPEATS = 3
#: A command that takes this times as long as it did, beside the import, is slower.
SLOWER = 1.5
#: Largest memory of a command, MB, and of ``rank`` alone.
MOST_MB = 300.0
MOST_RANK_MB = 150.0


@dataclass(frozen=True)
class Command:
    """``words`` after ``damping``, the goal in ``times`` of the import, and the most memory it may take."""

    work: str
    words: tuple[str, ...]
    times: float
    most_mb: float = MOST_MB
    repeats: int = REPEATS
    guarded: bool = True


def list_commands(folder: Path) -> list[Command]:
    """On three resonances of Saturn V, on the sweeps of a bolted joint, and the study, which writes to ``folder``."""
    saturn, joint = data_folder() / "saturn-v", ROOT / "examples" / "bolted-joint"
    peaks = (f"{saturn / 'records/config-2-mode-1.csv'}", "--mode", f"{saturn / 'modes/config-2-mode-1.toml'}")
    rows = (f"{joint / 'record.csv'}", "--mode", f"{joint / 'panel.toml'}")
    return [
        Command("rank, three peaks", ("rank", *peaks), 1.2 / 0.9, MOST_RANK_MB),
        Command("extrapolate, three peaks", ("extrapolate", *peaks, "--force", "40"), 2.0 / 0.9),
        Command("curve, three peaks", ("curve", *peaks), 2.0 / 0.9),
        Command("rank, sweeps of a bolted joint", ("rank", *rows), 3.0 / 0.9, MOST_RANK_MB),
        Command("study of Saturn V", ("study", "--out", f"{folder / 'study'}"), 40.0 / 0.9, repeats=1, guarded=False),
    ]


def measure(*, guarded: bool = False) -> list[Row]:
    """Every command, or those that the guard looks at."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for command in list_commands(Path(folder)):
            if guarded and not command.guarded:
                continue
            line = [sys.executable, "-m", "damping_pipelines.cli", *command.words]
            runs = [(run_process(line), run_process(STACK)) for _ in range(command.repeats)]
            memory = max(ours.largest_mb for ours, _ in runs)
            ours, stack = (middle([run.time for run in side]) for side in zip(*runs, strict=True))
            rows.append(
                Row(
                    f"damping {command.work}", ours, PEER, stack, at_least=1.0 / command.times,
                    right=memory <= command.most_mb, remark=f"{memory:.0f} MB at most, {command.most_mb:g} allowed",
                )
            )  # fmt: skip
    return rows


def guard(table: Path) -> bool:
    """Print each guarded command beside the ratio it had; whether none is ``SLOWER`` times slower."""
    before = _read_reference(table).set_index("work")["ratio"]
    fast = True
    for row in measure(guarded=True):
        slower = float(before[row.work]) / float(row.ratio or 0.0) if row.work in before else 1.0
        fast &= slower <= SLOWER
        print(f"{row.work}: {1.0 / (row.ratio or 0.0):.2f} times the import, {slower:.2f} times what it was")
    return fast


def _read_reference(table: Path) -> pd.DataFrame:
    """The table at the tag set last, as far as it was there; else the one that is committed."""
    name = table.resolve().relative_to(ROOT).as_posix()
    tag = subprocess.run(
        ["git", "describe", "--tags", "--abbrev=0"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.strip()
    shown = subprocess.run(
        ["git", "show", f"{tag or 'HEAD'}:{name}"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return pd.read_csv(io.StringIO(shown.stdout) if shown.returncode == 0 else table)


if __name__ == "__main__":
    for row in measure():
        print(row, row.ratio, row.met)
