"""Arrays and channels of MAT, HDF5, TDMS, LVM and Rattlesnake files to series, read by ``worker`` in another process.

The memory and time of that process are limited; if it dies, an error names the file as the cause.
"""

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.formats.headers import ABSCISSAS, NAMES, ROLES, describe_angle, refuse_decibels
from damping.formats.named import UNIT_OF, list_units, note_unheeded_units, to_series
from damping.formats.quantity import find_powers
from damping.formats.sampling import SAMPLING, Shapes, find_abscissa, find_nearest, last_name, list_times, split
from damping.formats.series import FileFacts, Samples, Series, Stated, Summary, require_response
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
        for name, form, shape in answer["loaded"]:
            dtype = np.complex128 if form == "complex" else np.float64
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


def list_array_series(
    path: str | Path, kind: str, stated: Stated, summary: Summary, max_size: int, rows: tuple[int, int] | None = None
) -> list[Series]:
    """Series of a file of named arrays or channels; ``rows`` as of ``read_arrays``."""
    read_whole, first = partial(read_arrays, path, kind, max_size=max_size), rows[0] if rows else 0
    read = partial(read_whole, rows=rows)
    channels = kind in ("tdms", "lvm")
    defaults = [] if channels else [name for names in NAMES["own"].values() for name in names]
    contents = read(list(stated.columns.values()) or defaults)
    if not channels and not contents.arrays:
        channels = bool((contents := read([])).steps) if kind == "hdf5" else False
    if channels and (contents.steps or stated.rate or kind == "lvm"):
        return list_channels(contents, stated, summary)
    arrays, known = contents.arrays, contents.known
    names = {role: _find_whole_name(name, arrays) for role, name in stated.columns.items()}
    if stated.columns:
        if (missing := next((name for name in names.values() if name not in arrays), None)) is not None:
            raise InputError(f"no array {describe_shortened(missing)!r}", expected=_has(known))
        if names.keys().isdisjoint(ABSCISSAS) and not stated.rate:  # an array may have the name of the role
            names |= {role: role for role in ABSCISSAS if known.get(role)}
        if len(names) > len(stated.columns):
            arrays = arrays | read(list(names.values())).arrays
    elif not channels:
        names = _find_own_names(arrays, known)
    if stated.rate is not None and set(ABSCISSAS) & set(names):
        raise InputError("--rate beside an array of times or frequencies", expected="one of them")
    main = next((names[role] for role in ("response", "amplitude", "x") if role in names), "")
    usual = {} if set(names) & set(ABSCISSAS) else find_abscissa(known, main)
    require_response(names | usual, known, stated, many=kind == "hdf5")
    if names.keys().isdisjoint(ABSCISSAS):
        signal = arrays[main][0]
        if stated.rate is None:
            sampled = _find_sampled(read_whole, signal, main, known, first)
        else:
            if sampling := [array for array in known if last_name(array) in SAMPLING]:
                summary.note(f"--rate {stated.rate:g} is stated, beside {', '.join(sampling[:4])} in the file")
            sampled = "time", f"--rate {stated.rate:g}", list_times("fs", stated.rate, max(signal.shape), first)
        if sampled is not None:
            role, name, values = sampled
            names, arrays = names | {role: name}, arrays | {name: [values]}
        elif usual:
            names, arrays = names | usual, arrays | read(list(usual.values())).arrays
    for role, name in names.items():
        if role in UNIT_OF:
            refuse_decibels(role, f"{name} {contents.units.get(name, '')}".strip())
        _add_array(role, name, arrays[name], stated, summary)
    texts = {role: contents.units[name] for role, name in names.items() if name in contents.units}
    angles = {role: angle for role, text in texts.items() if (angle := describe_angle(text))}
    note_unheeded_units(names, stated, summary)
    facts = FileFacts(units=list_units(texts, stated), angles=angles)
    return _list_each(names, arrays, facts, Path(path).stem, summary)


def _find_own_names(arrays: Mapping[str, list[Samples]], known: Shapes) -> dict[str, str]:
    """Arrays by the role that they are named after. InputError: none of those ``known`` in the file is."""
    if names := {role: name for role, by_role in NAMES["own"].items() for name in by_role if name in arrays}:
        return names
    groups = "damping campaign, which reads a group for each run, or " * any("/" in name for name in known)
    expected = f"{groups}--column ROLE=NAME; it has {_has(known)}"
    raise InputError("no array has the name of a role", expected=expected)


def _add_array(role: str, name: str, arrays: Sequence[Samples], stated: Stated, summary: Summary) -> None:
    """Say in the summary which array has a role, and its shape."""
    shape = " x ".join(str(n) for n in arrays[0].shape) or "1"
    many = f"{len(arrays)} of " if len(arrays) > 1 else ""
    source = "stated" if role in stated.columns else "by its name"
    summary.add(f"array {describe_shortened(name)!r}", f"{role}: {ROLES[role]} ({many}{shape})", source)


def _find_whole_name(name: str, arrays: Mapping[str, Any]) -> str:
    """The path of an array that is named by its last part, if there is one alone; else the name."""
    ends = [path for path in arrays if path.split("/")[-1] == name]
    return ends[0] if len(ends) == 1 and name not in arrays else name


def _find_sampled(
    read: Callable[[Sequence[str]], Arrays], signal: Samples, main: str, known: Shapes, first: int
) -> tuple[str, str, FloatArray] | None:
    """Role, name and values of an even abscissa, by a number in the file near the array ``main``; None if none is.

    Of a complex response it is the frequency, by its increment. ``first``: sample with which the signal begins.
    """
    kinds = NAMES["rate"]["increment"] if np.iscomplexobj(signal) else SAMPLING
    name = find_nearest([one for one in known if math.prod(known[one]) == 1 and last_name(one) in kinds], main)
    if name is None:
        return None
    names, is_increment = [name], last_name(name) in NAMES["rate"]["increment"]
    beside = [one for one in known if is_increment and split(one)[:-1] == split(name)[:-1]]
    names += [one for one in beside if last_name(one) in NAMES["rate"]["start"]]
    numbers = read(names).arrays
    step, start = (float(numbers[one][0].real.reshape(-1)[0]) for one in (name, names[-1]))
    role = "frequency" if np.iscomplexobj(signal) else "time"
    return role, name, (start if len(names) > 1 else 0.0) + list_times(name, step, max(signal.shape, default=1), first)


def _list_each(
    names: Mapping[str, str], arrays: Mapping[str, list[Samples]], facts: FileFacts, stem: str, summary: Summary
) -> list[Series]:
    """Series from arrays; a role has one array for each sweep, or a single one for all."""
    sweeps = list_members(list(names.values()), arrays)
    series: list[Series] = []
    for k, values in enumerate(sweeps, 1):
        of_role = dict(zip(names, values, strict=True))
        labels = [f"{value:g}" for value in of_role.pop("sweep").real.reshape(-1)] if "sweep" in of_role else None
        series += to_series(of_role, labels, facts, stem if len(sweeps) == 1 else f"{stem} {k}", summary, peak=True)
    return series


def list_members(names: Sequence[str], arrays: Mapping[str, list[Samples]]) -> list[list[Samples]]:
    """The arrays of some names, sweep by sweep: of a name one for each, or a single one for all.

    InputError: another number of arrays.
    """
    count = max(len(arrays[name]) for name in names)
    for name in names:
        if len(arrays[name]) not in (1, count):
            what = f"{len(arrays[name])} arrays {describe_shortened(name)!r} beside {count} of others"
            raise InputError(what, expected=f"1 or {count}")
    return [[arrays[name][min(k, len(arrays[name]) - 1)] for name in names] for k in range(count)]


def list_channels(contents: Arrays, stated: Stated, summary: Summary) -> list[Series]:
    """Time histories of a file of channels with time steps."""
    unheeded = next((role for role in stated.columns if role != "response"), None)
    if unheeded:
        raise InputError(f"--column {unheeded} of a file of channels", expected="--column response=NAME")
    asked = stated.columns.get("response")
    names = [name for name in contents.arrays if asked in (None, name) or name.split("/")[-1] == asked]
    if not names:
        raise InputError(f"no channel {describe_shortened(asked or '')!r}", expected=_has(contents.known))
    for name in names:
        if name not in contents.steps and stated.rate is None:
            raise InputError(f"channel {name!r} has no time step", expected="--rate HZ, or --column response=NAME")
        if stated.rate and (step := contents.steps.get(name, (0.0, 0.0))[1]):
            summary.note(f"--rate {stated.rate:g} is stated, beside a step of {step:g} s in the file")
        description = f"{contents.arrays[name][0].size} samples, step {_find_step(name, contents, stated)[1]:g} s"
        summary.add(f"channel {describe_shortened(name)!r}", description, "found in the file")
    kinds = {find_powers(contents.units[name]) for name in names if name in contents.units and not stated.units}
    if len(kinds) > 1:
        listed = ", ".join(f"{name} ({contents.units.get(name, 'no unit')})" for name in names[:8])
        raise InputError(f"channels of several kinds: {listed}", expected="--column response=NAME")
    series = []
    for name in names:
        start, step = _find_step(name, contents, stated)
        values = np.asarray(contents.arrays[name][0], dtype=np.float64).reshape(-1)
        facts = FileFacts(units={"response": contents.units[name]} if name in contents.units else {})
        t = np.arange(contents.first, contents.first + len(values), dtype=np.float64)
        t *= step  # in place: a file may have many samples
        t += start
        series.append(Series(name, t, values, is_time=True, has_phase=False, facts=facts))
    return series


def _find_step(name: str, contents: Arrays, stated: Stated) -> tuple[float, float]:
    """Start and step of a channel, s; a stated rate takes precedence."""
    start, step = contents.steps.get(name, (0.0, 0.0))
    return start, step if stated.rate is None else 1.0 / stated.rate


def _has(known: Shapes) -> str:
    listed = ", ".join(f"{name} ({' x '.join(map(str, shape)) or '1'})" for name, shape in list(known.items())[:12])
    return listed or "arrays of numbers"
