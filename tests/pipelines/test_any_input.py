"""Any bytes in any file of any command: exit code 0, 1 or 2, one line of error, no traceback, nothing left half-done.

``DAMPING_TRIES=1000`` tries so many of each; ``python -m benchmarks.fuzz`` is guided by coverage.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from damping_pipelines.cli import main
from damping_reed1970 import data_folder

DATA = data_folder() / "saturn-v"
#: Pieces that readers stumble over.
PIECES = (
    *(b"-1", b"1e999", b"nan", b"inf", b"-0.0", b"1e-320", b"9" * 400, b"0x10", b"1_000", b"=1+1", b"@x", b"\xff\xfe"),
    *(b"\0", b"\r", b"\n\n", b",", b'"', b"'", b"[", b"]]", b"{", b'"""', b"#", b"\\", b"\xe2\x80\xae", b"../../x"),
    *(b"[mode]\n", b"1979-05-27", b"true", b"\t", b"<script>", b" " * 300, b"[[a]]\n", b"a.b.c=1\n", b"\xc3\x28"),
)
#: Inputs of each command.
TRIES = int(os.environ.get("DAMPING_TRIES", "25"))
tried: Counter[str] = Counter()


@st.composite
def damaged(draw: st.DrawFn, seed: bytes) -> bytes:
    """A good file with bytes, pieces or lines put in, taken out or doubled; or any bytes at all."""
    if draw(st.integers(0, 4)) == 0:
        return draw(st.binary(max_size=200))
    data = bytearray(seed)
    for _ in range(draw(st.integers(1, 5))):
        place = draw(st.integers(0, len(data)))
        how = draw(st.sampled_from(("byte", "piece", "over", "cut", "line", "without")))
        piece = draw(st.sampled_from(PIECES))
        if how == "byte":
            data[place : place + 1] = draw(st.binary(min_size=1, max_size=2))
        elif how == "piece":
            data[place:place] = piece
        elif how == "over":
            data[place : place + len(piece)] = piece
        elif how == "cut":
            del data[place:]
        else:
            end = data.find(b"\n", place) + 1
            data[end:end] = data[place:end] * (how == "line")
            if how == "without":
                del data[place:end]
    return bytes(data)


def run(words: list[str]) -> tuple[int, str, str]:
    """Exit code, standard output and standard error of a command."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), pytest.raises(SystemExit) as stopped:
        main(words)
    return int(stopped.value.code or 0), out.getvalue(), err.getvalue()


def kept(words: list[str], folder: Path, data: bytes) -> None:
    """The promise about one input."""
    code, _, err = run(words)
    tried[words[0]] += 1
    told = [line for line in err.splitlines() if line.startswith("damping: ")]
    assert code in (0, 1, 2), err
    assert "internal error" not in err, (err, data)
    assert "Traceback" not in err
    assert len(told) == (code != 0), err
    assert not list(folder.glob(".*.tmp")), "something half-written"
    if code:
        assert not list(folder.glob("out*")), "an output of a failed command"
    for path in folder.glob("out*"):
        path.unlink()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("any")


RECORD = (DATA / "records" / "config-2-mode-1.csv").read_bytes()
SWEEP = (
    b"sweep,force,frequency,amplitude,phase,energy,mass,amplitude_sd\na,1,2,0.5,0.3,0.4,2,0.01\n"
    b"'=a,1,2.1,0.6,1.5,1,2,0.01\n"
)
MODE = (
    b'[mode]\nname = "m"\nfrequency = 2.0\nmass = 3.0\n[mode.tolerance]\nmass = 0.02\n'
    b"[repeatability]\namplitude = 0.01\n"
    b'[units]\nforce = "lbf"\nlength = "in"\n[damping]\nviscous = 1.5\nslip = {stiffness = 4.0, limit = 0.01}\n'
    b"velocity-power = {coefficient = 0.2, exponent = 1.6}\n[effects.planar-coupling]\nangle = 0.3\n"
)
STUDY = (
    b'title = "t"\nseed = 1\nlevel = 0.9\n[[records]]\nname = "a"\nrecord = "no.csv"\nmode = "no.toml"\n'
    b'laws = [["viscous"]]\n'
)
RAW = (DATA / "raw" / "config-1-mode-2.csv").read_bytes()
CONFIG = (DATA / "condition.toml").read_bytes()
FORM = b'{"format": "loads/1", "level": 0.9, "predictions": [{"force": 1, "median": 2, "low": 1, "high": 3}]}'
#: Seed of the damaged file and the words of the command by name; IN is that file, OUT what is written.
COMMANDS: dict[str, tuple[bytes, str]] = {
    "record to units": (SWEEP, "export IN --out OUT.csv --from us --units si"),
    "record to UFF": (SWEEP, "export IN --out OUT.uff --from us --text"),
    "mode to units": (MODE, "export GOOD.csv --out OUT.csv --units si --mode IN --mode-out OUT.toml"),
    "form": (FORM, "export IN --out OUT.parquet"),
    "sweep": (MODE, "sweep IN --force 1 --frequency 1.9:2.1:3 --out OUT.csv"),
    "study": (STUDY, "study IN --out OUT"),
    "regress": (SWEEP, "regress IN --response energy --terms A^2*omega,A --json OUT.json"),
    "raw": (RAW, f"condition IN --config {DATA / 'condition.toml'} --out OUT.csv"),
    "condition": (CONFIG, f"condition {DATA / 'raw' / 'config-1-mode-2.csv'} --config IN --out OUT.csv"),
    "import": (SWEEP, "import IN --out OUT.csv --response displacement --consistent"),
    "lock-in": (b"f,x,y,force\n1,0.5,-0.5,2\n2,0.2,-1e-3,2\n", "import IN --format lock-in --out OUT.csv --consistent"),
    "decay mode": (MODE, "import GOOD.csv --out OUT.csv --ring-down --mode IN --consistent"),
    "ring-down": (
        b"time,response\n" + b"".join(b"%g,%g\n" % (i / 16, (-0.9) ** i) for i in range(99)),
        "import IN --out OUT.csv --ring-down --mode GOOD.toml --response displacement --consistent",
    ),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_any_damaged_file_is_an_answer_or_one_line(folder: Path, name: str) -> None:
    seed, words = COMMANDS[name]
    (folder / "GOOD.csv").write_bytes(SWEEP)
    (folder / "GOOD.toml").write_bytes(MODE)
    places = {"IN": str(folder / "in"), "GOOD": str(folder / "GOOD"), "OUT": str(folder / "out")}

    def placed(word: str) -> str:
        stem, dot, end = word.partition(".")
        return places[stem] + dot + end if stem in places else word

    @settings(max_examples=TRIES, deadline=None, suppress_health_check=list(HealthCheck))
    @given(data=damaged(seed))
    def check(data: bytes) -> None:
        (folder / "in").write_bytes(data)
        kept([placed(word) for word in words.split()], folder, data)

    (folder / "in").write_bytes(seed)
    kept([placed(word) for word in words.split()], folder, seed)
    before = tried.total()
    check()
    assert tried.total() - before >= TRIES
