"""Every reader of files under a coverage-guided fuzzer: ``python -m benchmarks.fuzz [--runs 20000] [READER ...]``.

The fuzzer is atheris (libFuzzer for Python): it changes files and keeps those that reach new lines of a reader. A run
ends early, and so does this command with exit code 1, for an error that is not one of the two that people see, an
input that takes a minute, or memory beyond 600 MB, packages included (inputs have at most 8 kB). The seeds are good
files.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import scipy.io

from damping_reed1970 import data_folder

#: Of one reader; the packages that are imported take 290 of them.
MEMORY_MB = 600
SECONDS = 60
LONGEST_INPUT = 8192
_SATURN = data_folder() / "saturn-v"
_SWEEP = b"sweep,force,frequency,amplitude,phase,energy,mass\na,1,2,0.5,0.3,0.4,2\n'=a,1,2.1,0.6,1.5,1,2\n"
_MODE = (
    b'[mode]\nname = "m"\nfrequency = 2.0\nmass = 3.0\n[mode.tolerance]\nmass = 0.02\n'
    b"[repeatability]\namplitude = 0.01\n"
    b'[units]\nforce = "lbf"\n[damping]\nviscous = 1.5\nslip = {stiffness = 4.0, limit = 0.01}\n[effects.a]\nb = 0.3\n'
)
_STUDY = (
    b'title = "t"\nseed = 1\nlevel = 0.9\n[[records]]\nname = "a"\nrecord = "r"\nmode = "m"\nlaws = [["viscous"]]\n'
)
_LOCK_IN = b"freq (Hz),X [mm],Y [mm],force [N]\n1,0.5,-0.5,2\n2,0.25,-1e-3,2\n"
_LOADS = b'{"format": "loads/1", "level": 0.9, "predictions": [{"force": 1, "median": 2, "low": 1, "high": 3}]}'
_RANK = b'{"format": "rank/1", "criterion": "x", "models": [{"rank": 1, "name": "a", "forces": [{"name": "viscous"}]}]}'
_MANIFEST = b'{"format": "manifest/1", "seed": 1, "versions": {}, "inputs": {}, "outputs": {"a": "' + b"0" * 64 + b'"}}'
_UFF_HEAD = """    -1
    58{binary}
level 1
NONE
NONE
NONE
NONE
    4         0    0         0       NONE         1   3       NONE         1   3
{form}
        18    0    0    0            Frequency                   Hz
        12    0    0    0         Acceleration                m/s^2
        13    0    0    0                Force                    N
         0    0    0    0                 NONE                 NONE
"""
_TEXT_FORM = "         5         3         1  1.00000E+00  5.00000E-01  0.00000E+00"
_BYTES_FORM = "         6         3         1  1.00000E+00  5.00000E-01  0.00000E+00"
_BYTES_FIELDS = "b     1     2          11          48     0     0           0           0"


def seeds(name: str, folder: Path) -> list[bytes]:
    """Good files for a reader."""
    if name == "mat":
        arrays = {"frequency": np.arange(3.0), "response": np.exp(1j * np.arange(3.0)), "s": {"x": 1.0}, "t": "text"}
        for number, packed in enumerate((False, True)):
            scipy.io.savemat(folder / f"{number}.mat", arrays, do_compression=packed)
        return [path.read_bytes() for path in sorted(folder.glob("*.mat"))]
    text = _UFF_HEAD.format(binary="", form=_TEXT_FORM) + "  1.00000E+00" * 6 + "\n    -1\n"
    binary = _UFF_HEAD.format(binary=_BYTES_FIELDS, form=_BYTES_FORM).encode() + np.arange(6.0).tobytes() + b"    -1\n"
    units = b"    -1\n   164\n         1units                       2\n  1.0D+00\n    -1\n"
    files = {
        "record": [_SWEEP, (_SATURN / "records" / "config-2-mode-1.csv").read_bytes()],
        "mode": [_MODE],
        "study": [_STUDY],
        "condition": [(_SATURN / "condition.toml").read_bytes()],
        "raw": [(_SATURN / "raw" / "config-1-mode-2.csv").read_bytes()],
        "uff": [text.encode(), binary, units + text.encode()],
        "form": [_LOADS, _RANK],
        "manifest": [_MANIFEST],
    }
    return files.get(name, [_SWEEP, _LOCK_IN])


READERS = ("record", "table", "mode", "study", "condition", "raw", "uff", "csv", "lock-in", "mat", "form", "manifest")


def fuzz(name: str, runs: int, folder: Path, seed: int) -> tuple[int, int, str]:
    """Inputs tried, lines and branches reached, and what broke a promise ('' where nothing did)."""
    corpus, given = folder / "corpus", folder / "given"
    for one in (corpus, given):
        one.mkdir()
    for number, content in enumerate(seeds(name, folder)):
        (given / str(number)).write_bytes(content)
    limits = [f"-runs={runs}", f"-seed={seed}", f"-max_len={LONGEST_INPUT}", f"-timeout={SECONDS}"]
    limits += [f"-rss_limit_mb={MEMORY_MB}", f"-artifact_prefix={folder}/", "-print_final_stats=1"]
    words = [sys.executable, "-m", "benchmarks._fuzz_reader", name, str(corpus), str(given), *limits]
    done = subprocess.run(words, capture_output=True, text=True, errors="replace", check=False)
    tried = re.findall(r"stat::number_of_executed_units:\s*(\d+)", done.stderr)
    reached = re.findall(r"\bcov: (\d+)", done.stderr)
    broken = "" if done.returncode == 0 else "\n".join(done.stderr.splitlines()[-40:])
    for path in [*folder.glob("crash-*"), *folder.glob("timeout-*"), *folder.glob("oom-*")]:
        broken += f"\n{path.name}: {path.read_bytes()!r}"
    return int(tried[-1]) if tried else 0, int(reached[-1]) if reached else 0, broken


def main() -> None:
    """Fuzz every reader, or those named, and print what was tried."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=1970)
    parser.add_argument("readers", nargs="*", choices=[*READERS, []])
    words = parser.parse_args(sys.argv[1:] if "fuzz" in Path(sys.argv[0]).stem else [])
    total, failed = 0, False
    for name in words.readers or READERS:
        with tempfile.TemporaryDirectory() as folder:
            tried, reached, broken = fuzz(name, words.runs, Path(folder), words.seed)
        total += tried
        failed |= bool(broken)
        print(f"{name:10s} {tried:8d} inputs, {reached:6d} places reached{': BROKEN' if broken else ''}", flush=True)
        if broken:
            print(broken)
    print(f"{total} inputs in all, {'see above' if failed else 'no promise broken'}")
    if failed:
        sys.exit(1)


if __name__ == "__main__":
    main()
