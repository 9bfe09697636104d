"""Studies killed (SIGKILL) at random moments, and what is left of them: ``python -m benchmarks.kills [--kills 50]``.

Two studies that differ in their seed are run into one folder by turns and killed, every other one while it writes.
After each kill the folder is read as a user would: either its manifest fits, and then every file is of one finished
study, or the reader says that it does not; every file is whole, whosever it is; no process of the study is left. At
the end the study is run once more without a kill: its files are those of a run never killed.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType

from damping.errors import InputError
from damping_pipelines.manifest import MANIFEST, digest, open_folder, verify
from damping_reed1970 import data_folder

SEEDS = (1, 2)
SETTINGS = """title = "Short"
[[records]]
name = "peaks"
record = "records/config-2-mode-1.csv"
mode = "modes/config-2-mode-1.toml"
"""
_LONGEST_S = 300.0


@dataclass
class Tally:
    """What was seen after the kills: manifests that fitted, and that did not."""

    kills: int = 0
    while_writing: int = 0
    fitting: int = 0
    refused: int = 0


class Studies:
    """The server of short studies; use as a context."""

    def __init__(self, folder: Path) -> None:
        self.settings, self.folder = folder / "STUDY.toml", folder
        for name in ("records", "modes"):
            (folder / name).symlink_to(data_folder() / "saturn-v" / name)
        self.settings.write_text(SETTINGS)

    def __enter__(self) -> Studies:
        root = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
        self.server = subprocess.Popen(
            [sys.executable, "-m", "benchmarks._short_study"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"PYTHONPATH": root, "OMP_NUM_THREADS": "1"},
        )
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, of: TracebackType | None) -> None:
        assert self.server.stdin is not None
        self.server.stdin.close()
        self.server.wait()

    def start(self, out: Path, seed: int) -> int:
        """Process id of a study that has just begun."""
        assert self.server.stdin is not None
        print(self.settings, out, seed, sep="\t", file=self.server.stdin, flush=True)
        return int(self._answer())

    def ended(self) -> int:
        """Exit status of the study, once it has ended."""
        return int(self._answer())

    def whole(self, out: Path, seed: int) -> tuple[dict[str, str], float]:
        """Outputs of a study that nobody kills, and its seconds."""
        begun = monotonic()
        self.start(out, seed)
        status = self.ended()
        assert status == 0, f"a study of seed {seed} ended with {status}"
        return verify(out).manifest.outputs, monotonic() - begun

    def _answer(self) -> str:
        assert self.server.stdout is not None
        return self.server.stdout.readline()


def run(folder: Path, kills: int, seed: int) -> Tally:
    """Kill ``kills`` studies and check what each leaves; AssertionError for the first promise that is broken."""
    chance, tally = random.Random(seed), Tally()
    with Studies(folder) as studies:
        out = folder / "out"
        wholes = [studies.whole(where, one) for where, one in zip((folder / "other", out), SEEDS, strict=True)]
        known = [outputs for outputs, _ in wholes]
        for turn in range(kills):
            process = studies.start(out, SEEDS[turn % 2])
            wait(out, process, chance, wholes[1][1], writing=turn % 2 == 1)
            kill(process)
            studies.ended()
            look(out, known, tally)
            gone(process)
            tally.while_writing += (out / ".staged").exists()
            tally.kills += 1
        last = (kills + 1) % 2
        assert studies.whole(out, SEEDS[last])[0] == known[last], "a study run again has other digits"
        assert not (out / ".staged").exists()
    return tally


def wait(out: Path, process: int, chance: random.Random, seconds: float, *, writing: bool) -> None:
    """Until a random moment of the run, or (``writing``) one of the moments in which it moves its files."""
    until = monotonic() + chance.random() * seconds
    if not writing:
        sleep(max(until - monotonic(), 0.0))
        return
    until = monotonic() + _LONGEST_S
    while not (out / ".staged" / "report.html").exists() and monotonic() < until and alive(process):
        sleep(0.0005)
    sleep(chance.random() * 0.02)


def alive(process: int) -> bool:
    """Whether a process is running (one that has ended and was not waited for is not)."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def kill(process: int) -> None:
    """SIGKILL to the study alone: its workers have to notice."""
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        return


def gone(session: int) -> None:
    """Its workers end by themselves."""
    until = monotonic() + 20.0
    while monotonic() < until:
        try:
            os.killpg(session, 0)
        except ProcessLookupError:
            return
        sleep(0.01)
    raise AssertionError("a worker outlives its study")


def look(out: Path, known: list[dict[str, str]], tally: Tally) -> None:
    """Read what is left as a user would."""
    for path in out.rglob("*"):
        name = str(path.relative_to(out))
        if path.is_file() and not name.startswith((".staged", ".manifest")) and name != MANIFEST:
            assert digest(path.read_bytes()) in {outputs[name] for outputs in known}, f"{name} is not whole"
    try:
        found = verify(out).manifest.outputs
    except InputError:
        tally.refused += 1
        return
    assert found in known, "a manifest of two studies"
    assert {name: digest(open_folder(out).read(name)) for name in found} == found
    tally.fitting += 1


def main() -> None:
    """Kill fifty studies and print what was seen."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1970)
    words, _ = parser.parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        tally = run(Path(folder), words.kills, words.seed)
    print(
        f"{tally.kills} kills, {tally.while_writing} of them between staging and the manifest: {tally.fitting} folders "
        f"fitted their manifest, {tally.refused} were refused; no file was half-written, "
        "no process was left, and the study run again has the digits of one that was never killed"
    )


if __name__ == "__main__":
    main()
