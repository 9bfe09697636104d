"""Arrays and channels of MAT, HDF5, TDMS, LVM and Rattlesnake files, read by ``worker`` in a process of its own.

The process may use so much memory and time and no more; when it dies, the file is to blame and an error says so.
"""

from __future__ import annotations

import json
import math
import os
import stat
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from damping.errors import AnalysisError, InputError
from damping.records.text import describe_shortened

Array: TypeAlias = npt.NDArray[Any]  # of float64 or complex128

#: Seconds after which a file that is still being read is given up.
LONGEST = 60.0
_WARRANTED = 32_000_000  # bytes of arrays that any file may hold, beside its own size
_WORKING = 100_000_000  # bytes that libraries and buffers may take, beside three times the file


@dataclass(frozen=True)
class Arrays:
    """Arrays by name (several where a name stands for several), the units that the file gives for them, the shape of
    every array in the file by name, and start and step in s of those that are channels against time."""

    arrays: dict[str, list[Array]]
    units: dict[str, str]
    known: dict[str, tuple[int, ...]]
    steps: dict[str, tuple[float, float]]


def read_arrays(path: str | Path, kind: str, names: Sequence[str], max_size: int) -> Arrays:
    """The arrays ``names`` that the file has, and what is in it.

    Args:
        path: the file. kind: ``mat5``, ``mat73``, ``hdf5``, ``tdms`` or ``lvm``; of the last two every channel is read.
        names: names of variables (``structure.field``, ``cells{:,2}``) or paths of data sets (``group/name``).
        max_size: largest file read, bytes.

    Raises:
        AnalysisError: the package that reads the format is not installed.
        InputError: the file cannot be read, is too large, is not of its kind, or holds objects in place of numbers.
    """
    size = _size(path, max_size)
    script = Path(__file__).with_name("worker.py")
    limits = (size + _WARRANTED, _WORKING + 3 * size, int(LONGEST))
    words = [kind, os.path.abspath(path), json.dumps(list(names)), *map(str, limits)]
    try:
        done = subprocess.run(
            [sys.executable, "-P", str(script), *words],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=LONGEST,
            check=False,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "HDF5_PLUGIN_PATH": "::"},
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"not read within {LONGEST:g} s", file=path, expected=_EXPECTED[kind]) from None
    head, _, body = done.stdout.partition(b"\n")
    if done.returncode != 0 or not head:
        reason = (done.stderr.decode(errors="replace").strip().splitlines() or ["the reader broke off"])[-1]
        raise InputError(f"cannot be read ({describe_shortened(reason, 120)})", file=path, expected=_EXPECTED[kind])
    answer = json.loads(head)
    if answer["problem"]:
        raise InputError(f"cannot be read: {answer['problem']}", file=path, expected=_EXPECTED[kind])
    if answer["missing"]:
        raise AnalysisError(
            f"{path}: a {kind.upper()} file needs the package {answer['missing']}, which is not installed "
            "(pip install 'damping-selection[formats]')"
        )
    known = {name: tuple(shape) for name, shape in answer["known"].items()}
    units = {name: text for name, text in answer["units"].items() if text}
    steps = {name: (start, step) for name, (start, step) in answer["steps"].items()}
    return Arrays(_unpacked(answer["loaded"], body), units, known, steps)


_EXPECTED = {
    "mat5": "a whole MAT file of version 5 to 7.2",
    "mat73": "a whole MAT file of version 7.3",
    "hdf5": "a whole HDF5 file with arrays of numbers",
    "tdms": "a whole TDMS file of National Instruments",
    "lvm": "a whole LabVIEW measurement file",
}


def _size(path: str | Path, max_size: int) -> int:
    try:
        found = os.stat(path)
    except (OSError, ValueError) as error:
        raise InputError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=path) from None
    if not stat.S_ISREG(found.st_mode):
        raise InputError("is no regular file", file=path, expected="a file")
    if found.st_size > max_size:
        raise InputError(f"larger than {max_size} bytes", file=path, expected="a smaller file or a larger --max-size")
    return found.st_size


def _unpacked(loaded: Sequence[tuple[str, str, Sequence[int]]], body: bytes) -> dict[str, list[Array]]:
    """The arrays out of their bytes."""
    arrays: dict[str, list[Array]] = {}
    place = 0
    for name, of, shape in loaded:
        pair = 2 if of == "complex" else 1
        values = np.frombuffer(body, dtype=np.float64, count=pair * math.prod(shape), offset=place)
        arrays.setdefault(name, []).append((values.view(np.complex128) if pair == 2 else values).reshape(shape))
        place += values.nbytes
    return arrays
