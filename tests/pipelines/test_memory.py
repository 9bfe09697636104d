"""Memory of commands on hostile and on large files: at most 300 MB and four times the file."""

from __future__ import annotations

import os
import re
import struct
import sys
import zlib
from pathlib import Path

import pytest

SIZE = 6_000_000


def rows() -> bytes:
    """More rows than a table may have, each different."""
    return b"sweep,force,frequency,amplitude\n" + b"".join(b"a,%d.5,2,3\n" % i for i in range(SIZE // 14))


def packed() -> bytes:
    """A MAT file of 100 kB that unpacks to a column of 100 MB."""
    n = 12_500_000
    shape = struct.pack("<IIIIIIii", 6, 8, 6, 0, 5, 8, n, 1) + struct.pack("<HH", 1, 1) + b"f\0\0\0"
    body = struct.pack("<II", 14, len(shape) + 8 + 8 * n) + shape + struct.pack("<II", 9, 8 * n)
    packer = zlib.compressobj(9)
    content = packer.compress(body) + b"".join(packer.compress(b"\0" * 1_000_000) for _ in range(100)) + packer.flush()
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<HH", 0x0100, 0x4D49)
    return head + struct.pack("<II", 15, len(content)) + content


def table() -> bytes:
    """As many rows as the regression lists."""
    lines = (b"%.6f,%.6f,%.6f\n" % (A, A % 0.7, A**2 + A % 0.3) for A in (0.1 + 3e-5 * i for i in range(100_000)))
    return b"A,omega,E\n" + b"".join(lines)


EXPORT = ("export", "IN", "--out", "OUT", "--from", "us", "--units", "si")
IMPORT = ("import", "IN", "--out", "OUT", "--column", "frequency=f", "--column", "response=f", "--consistent")
REGRESS = ("regress", "IN", "--response", "E", "--terms", "A, A^2, A^3, omega", "--json", "OUT")
CASES = {
    "rows": (rows, EXPORT, "more than 250000 rows"),
    "commas": (lambda: b"," * SIZE, EXPORT, "a row of more than 1000000 characters"),
    "quotes": (lambda: b'sweep,force,frequency,amplitude\n"' + b'a""\n' * (SIZE // 4), EXPORT, "field larger than"),
    "wide": (lambda: ("a,\U0001f600\r" * (SIZE // 8)).encode(), EXPORT, "missing columns"),
    "packed": (packed, IMPORT, "warrants"),
    "table": (table, REGRESS, "and 99000 more"),
}
#: The cases that end well; the others are refused.
TAKEN = ("table",)
#: Cases by the process that meets them, one after the other: its peak is the largest of theirs.
PROCESSES = (("packed", "rows", "commas", "quotes", "wide"), pytest.param(("table",), marks=pytest.mark.slow))
COMMANDS = """
import sys
from damping_pipelines.cli import main
for words in sys.argv[1:]:
    try:
        main(words.split(chr(9)))
    except SystemExit as stopped:
        print("ended with", stopped.code or 0, flush=True)
"""


@pytest.mark.parametrize("names", PROCESSES, ids=" ".join)
def test_memory(tmp_path: Path, names: tuple[str, ...]) -> None:
    said, commands, sizes = tmp_path / "said", [], []
    for name in names:
        make, words, _ = CASES[name]
        given = tmp_path / name
        given.write_bytes(make())
        sizes.append(given.stat().st_size)
        places = {"IN": str(given), "OUT": str(tmp_path / "out.csv")}
        commands.append("\t".join(places.get(word, word) for word in words))
    # a small process between the two: what one that is forked had of its parent counts as its own
    script = (
        "import os, sys\n"
        "child = os.posix_spawn(sys.executable, sys.argv[2:], os.environ)\n"
        "_, status, used = os.wait4(child, 0)\n"
        "open(sys.argv[1], 'w').write(f'{os.waitstatus_to_exitcode(status)} {used.ru_maxrss}')\n"
    )
    out = os.open(tmp_path / "err", os.O_WRONLY | os.O_CREAT)
    actions = [(os.POSIX_SPAWN_DUP2, out, 2), (os.POSIX_SPAWN_DUP2, out, 1)]
    command = [sys.executable, "-c", COMMANDS, *commands]
    process = os.posix_spawn(
        sys.executable, [sys.executable, "-c", script, str(said), *command], os.environ, file_actions=actions
    )
    os.waitpid(process, 0)
    os.close(out)
    code, kilobytes = map(int, said.read_text().split())
    assert code == 0
    *parts, rest = re.split(r"ended with (\d)\n", (tmp_path / "err").read_text())
    assert rest == ""
    for name, text, ended in zip(names, parts[::2], parts[1::2], strict=True):
        assert int(ended) == (0 if name in TAKEN else 2)
        assert CASES[name][2] in text
    assert 1024 * kilobytes <= 300e6 + 4 * min(sizes)
