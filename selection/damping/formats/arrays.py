"""Arrays and channels of MAT, HDF5, TDMS, LVM and Rattlesnake files, read by ``worker`` in another process.

The memory and time of that process are limited; if it dies, an error names the file as the cause.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.formats.headers import NAMES
from damping.formats.sampling import Shapes
from damping.formats.series import Samples
from damping.records.text import describe_shortened, read_start, too_large

LONGEST = 60.0  #: time limit for reading a file, s
_WARRANTED = 32_000_000  # bytes of arrays that any file may hold, besides _EXPANDED times its size
_EXPANDED = 4  # a sample of 16 bits becomes a number of 8 bytes
_BLOCKWISE = 200_000_000  # largest size, bytes, that counts for a file read in blocks
_WORKING = 100_000_000  # bytes for libraries and buffers, besides three times the arrays


@dataclass(frozen=True)
class Arrays:
    """Arrays read from a file, and its contents."""

    arrays: dict[str, list[Samples]]  #: by name; a name may stand for several arrays
    units: dict[str, str]  #: stated in the file, by name
    known: Shapes
    steps: dict[str, tuple[float, float]]  #: start and step in s of channels against time
    first: int = 0  #: sample of the file with which the arrays begin

    def join(self, further: "Arrays") -> "Arrays":
        """These and further arrays of the same file, with their units."""
        return replace(self, arrays=self.arrays | further.arrays, units=self.units | further.units)


def read_arrays(
    path: str | Path, kind: str, names: Sequence[str], max_size: int | None, rows: tuple[int, int] | None = None
) -> Arrays:
    """Read the arrays ``names`` of a file, as far as it has them, and list its contents.

    Args:
        path: the file.
        kind: ``mat5``, ``mat73``, ``hdf5``, ``tdms`` or ``lvm``; of the last every channel is read, of ``tdms`` if none
            is named.
        names: names of variables (``structure.field``, ``cells{:,2}``) or paths of data sets (``group/name``).
        max_size: largest file read, bytes; None: any, for reading in blocks.
        rows: first sample and end (exclusive) of the range read of every channel, and of every array along its longest
            axis; None: all.

    AnalysisError: the package that reads the format is not installed. InputError: the file cannot be read, is too
    large, is not of its kind, or holds objects in place of numbers.
    """
    read_start(path, 1)  # raises if there is no such file
    size = os.stat(path).st_size
    if max_size is not None and size > max_size:
        raise too_large(path, max_size)
    if rows is not None or max_size is None:
        size = min(size, _BLOCKWISE)
    size *= _EXPANDED
    limits = (size + _WARRANTED, _WORKING + 3 * size, int(LONGEST))
    answer, arrays = _run_worker(path, kind, [json.dumps(list(names)), *map(str, limits), json.dumps(rows)])
    known = {name: tuple(shape) for name, shape in answer["known"].items()}
    units = {name: text for name, text in answer["units"].items() if text}
    steps = {name: (start, step) for name, (start, step) in answer["steps"].items()}
    return Arrays(arrays, units, known, steps, rows[0] if rows else 0)


def _run_worker(path: str | Path, kind: str, words: Sequence[str]) -> tuple[dict[str, Any], dict[str, list[Samples]]]:
    """The answer of ``worker.py`` on a file, run in another process, and its arrays, by a file: a pipe copies."""
    script, whole = Path(__file__).with_name("worker.py"), NAMES["whole"][kind]
    with tempfile.TemporaryFile() as output:
        try:
            done = subprocess.run(
                [sys.executable, "-P", str(script), kind, os.path.abspath(path), *words],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.PIPE,
                timeout=LONGEST,
                check=False,
                env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "HDF5_PLUGIN_PATH": "::"},
            )
        except subprocess.TimeoutExpired:
            raise InputError(f"not read within {LONGEST:g} s", file=path, expected=whole) from None
        output.seek(0)
        head = output.readline()
        if done.returncode != 0 or not head:
            reason = (done.stderr.decode(errors="replace").strip().splitlines() or ["the reader broke off"])[-1]
            raise InputError(f"cannot be read ({describe_shortened(reason, 120)})", file=path, expected=whole)
        answer, arrays = json.loads(head), dict[str, list[Samples]]()
        for name, dtype, shape in answer["loaded"]:
            values = np.fromfile(output, dtype=dtype, count=math.prod(shape))
            arrays.setdefault(name, []).append(values.reshape(shape))
    if answer["problem"]:
        expected = f"{whole}, not compressed" if "warrants" in answer["problem"] else whole
        raise InputError(f"cannot be read: {answer['problem']}", file=path, expected=expected)
    if answer["missing"]:
        needed = f"a {kind.upper()} file needs the package {answer['missing']}, which is not installed"
        raise AnalysisError(f"{path}: {needed} (pip install 'damping-selection[formats]')")
    return answer, arrays


def read_blocks(
    path: str | Path, kind: str, names: Sequence[str], count: int, *, together: bool
) -> Iterator[FloatArray]:
    """Samples (names, n) of arrays of equal length, at most ``count`` of each at a time.

    ``together``: they are channels of a file whose channels are always read together.
    """
    first = 0
    while True:
        arrays = read_arrays(path, kind, [] if together else names, None, rows=(first, first + count)).arrays
        block = np.array([arrays[name][0].real.reshape(-1) for name in names])
        if block.shape[1]:
            yield block
        if block.shape[1] < count:
            return
        first += count
