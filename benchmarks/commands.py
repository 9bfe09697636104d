"""Commands from start to finish, start-up included, beside importing what they stand on; and the memory they take.

Run ``python -m benchmarks commands``. Each command and the import of numpy, pandas and scipy.stats run by turns, in
processes of their own, with what a bare install has. ``python -m benchmarks --guard`` runs them by turns with the tree
at the tag set last (without a tag, with the one whose times are published), and fails where one has become 1.5 times
slower.
"""

from __future__ import annotations

import compileall
import io
import math
import os
import subprocess
import sys
import tarfile
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks._rows import Row, middle, run_process
from damping_reed1970 import data_folder

ROOT = Path(__file__).parents[1]
HOUSES = ("selection", "pipelines")
#: As in a bare install: pandas loads it, which only extras bring, wherever it is (40 MB, 0.1 s).
BARE = "import sys; sys.modules['pyarrow'] = None"
COMMAND = [sys.executable, "-c", f"{BARE}; from damping_pipelines.cli import main; main()"]
STACK = [sys.executable, "-c", f"{BARE}; import numpy, pandas, scipy.stats"]
PEER = "importing numpy, pandas and scipy.stats"
REPEATS = 3
#: Of the tree that they were measured with: what the guard compares with where nothing is tagged.
PUBLISHED = "results/benchmarks/commands.csv"
#: A command that takes this times as long as before is slower.
SLOWER = 1.5
#: One that takes at most this times as long in a first turn is not: processor times of equal work differ by a tenth.
CLEARLY = 1.2
#: Turns of both trees, where the first is not clear.
TURNS = 5
#: Largest memory of a command, MB, and of ``rank`` alone.
MOST_MB = 300.0
MOST_RANK_MB = 150.0


@dataclass(frozen=True)
class Command:
    """``words`` after ``damping``, the goal in ``times`` of the import if any, and the most memory it may take.

    ``guarded``: beside the earlier tree too, and measured as in a bare install; the study starts processes of its own.
    """

    work: str
    words: tuple[str, ...]
    times: float | None
    most_mb: float = MOST_MB
    repeats: int = REPEATS
    guarded: bool = True


def list_commands(folder: Path) -> list[Command]:
    """On three resonances of Saturn V, on sweeps of two examples, and the study, which writes to ``folder``."""
    saturn, joint = data_folder() / "saturn-v", ROOT / "examples" / "bolted-joint"
    peaks = (f"{saturn / 'records/config-2-mode-1.csv'}", "--mode", f"{saturn / 'modes/config-2-mode-1.toml'}")
    rows = (f"{joint / 'record.csv'}", "--mode", f"{joint / 'panel.toml'}")
    planes = ROOT / "examples" / "two-plane-mode"
    gap = ("gap", f"{planes / 'model.toml'}", f"{planes / 'record.csv'}", "--no-posterior")
    return [
        Command("rank, three peaks", ("rank", *peaks), 1.2 / 0.9, MOST_RANK_MB),
        Command("extrapolate, three peaks", ("extrapolate", *peaks, "--force", "40"), 2.0 / 0.9),
        Command("curve, three peaks", ("curve", *peaks), 2.0 / 0.9),
        Command("rank, sweeps of a bolted joint", ("rank", *rows), 3.0 / 0.9, MOST_RANK_MB),
        Command("gap, sweeps of two planes", gap, None),
        Command("study of Saturn V", ("study", "--out", f"{folder / 'study'}"), 40.0 / 0.9, repeats=1, guarded=False),
    ]


def measure() -> list[Row]:
    """Every command."""
    rows = []
    _compile(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        for command in list_commands(Path(folder)):
            start = COMMAND if command.guarded else [sys.executable, "-m", "damping_pipelines.cli"]
            line = [*start, *command.words]
            runs = [(run_process(line), run_process(STACK)) for _ in range(command.repeats)]
            memory = max(ours.largest_mb for ours, _ in runs)
            goal = 1.0 / command.times if command.times else None
            ours, stack = (middle([run.time for run in side]) for side in zip(*runs, strict=True))
            rows.append(
                Row(
                    f"damping {command.work}", ours, PEER, stack, at_least=goal,
                    right=memory <= command.most_mb, remark=f"{memory:.0f} MB at most, {command.most_mb:g} allowed",
                )
            )  # fmt: skip
    return rows


def guard() -> bool:
    """Time each guarded command with an earlier tree and with this one by turns; whether none is slower.

    Where the first turn does not say so, the least time of ``TURNS`` on either side does. Without history nothing can
    be compared: said on standard error, and passed.
    """
    fast = True
    with tempfile.TemporaryDirectory() as folder:
        before = _unpack_earlier(Path(folder) / "before")
        if before is None:
            print("SPEED NOT GUARDED: this clone has no history (git fetch --unshallow --tags)", file=sys.stderr)
            return True
        _compile(before, ROOT)
        for command in list_commands(Path(folder)):
            if command.guarded:
                fast &= _stays_fast(command, before)
    return fast


def _compile(*trees: Path) -> None:
    """Compile the packages of trees before anything is timed, as an installation does."""
    for tree in trees:
        for house in HOUSES:
            compileall.compile_dir(tree / house, quiet=2)


def _stays_fast(command: Command, before: Path) -> bool:
    """Whether a command is not ``SLOWER`` times slower than with another tree; said, and passed, if that has it not."""
    line = [sys.executable, "-m", "damping_pipelines.cli", *command.words]
    ours, theirs = math.inf, math.inf
    for _ in range(TURNS):
        try:
            theirs = min(theirs, _run_tree(line, before))
        except RuntimeError:
            print(f"{command.work}: SPEED NOT GUARDED: the earlier tree cannot do it", file=sys.stderr)
            return True
        ours = min(ours, _run_tree(line, ROOT))
        if ours <= CLEARLY * theirs:
            break
    print(f"{command.work}: {ours:.2f} s, {ours / theirs:.2f} times what it was", flush=True)
    return ours <= SLOWER * theirs


def _run_tree(line: list[str], tree: Path) -> float:
    """Processor seconds of a command with the packages of a tree."""
    packages = os.pathsep.join(str(tree / house) for house in HOUSES)
    return run_process(line, {"PYTHONPATH": packages}).time.processor


def _unpack_earlier(folder: Path) -> Path | None:
    """The tree at the tag set last; without one, at the commit that published ``PUBLISHED``; None without history."""
    published = "log", "-1", "--format=%H", "HEAD~1", "--", PUBLISHED
    earlier = (_git("describe", "--tags", "--abbrev=0") or _git(*published)).decode().strip()
    if not earlier:
        return None
    with tarfile.open(fileobj=io.BytesIO(_git("archive", earlier))) as file:
        file.extractall(folder, filter="data")
    print(f"beside {earlier}", flush=True)
    return folder


def _git(*words: str) -> bytes:
    """What git prints; nothing where it cannot."""
    return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, check=False).stdout
