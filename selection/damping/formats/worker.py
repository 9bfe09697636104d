"""Reads arrays and channels of a binary or LabVIEW file in a process of its own; a script, started by ``arrays``.

The HDF5 library can be brought to crash, to loop or to allocate without end by a damaged or hostile file. Here that
ends this process and not the program. Standard output gets one line of JSON, then the bytes of the arrays in its
order; an error of a library ends it with a traceback on standard error. Only numbers are read: no objects, references,
functions or text, nothing outside the file (external and virtual data), no pickles.
"""

from __future__ import annotations

import json
import math
import re
import sys
from typing import Any

import numpy as np

_MOST_NAMES = 200  # arrays of a file that are listed: a bound for files that hold thousands
_DEEPEST = 6  # groups within groups that are looked into: a bound for files that nest without end
_MOST_PARTS = 1000  # arrays that one name may stand for
#: First and behind the last sample of every array that are read; empty: all.
_ROWS: list[int] = []
_FILTERS = {"gzip", "lzf", None}


class RefusedError(Exception):
    """Why an array is not read."""


def main() -> None:
    """Read ``sys.argv``: format, path, JSON list of names, most bytes of arrays, of memory, and most seconds."""
    kind, path, names = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
    most, memory, seconds = map(int, sys.argv[4:7])
    _ROWS.extend(json.loads(sys.argv[7]) or [])
    _limit(memory, seconds)
    known: dict[str, list[int]] = {}
    units: dict[str, str] = {}
    steps: dict[str, tuple[float, float]] = {}
    arrays: list[tuple[str, np.ndarray[Any, Any]]] = []
    problem = missing = None
    try:
        for name, array in _READERS[kind](path, kind, names, most, known, units, steps):
            arrays.append((name, np.ascontiguousarray(array, dtype=complex if np.iscomplexobj(array) else float)))
            most -= arrays[-1][1].nbytes
            if most < 0:
                raise RefusedError("the arrays are larger than the file warrants")
    except RefusedError as error:
        problem = str(error)
    except MemoryError:
        problem = "it asks for more memory than its size warrants"
    except ModuleNotFoundError as error:
        missing = error.name
    loaded = [(name, "complex" if np.iscomplexobj(array) else "float", array.shape) for name, array in arrays]
    answer = {"known": known, "units": units, "steps": steps, "loaded": loaded, "problem": problem, "missing": missing}
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")
    for _, array in arrays:
        sys.stdout.buffer.write(array.data if array.size else b"")
    sys.stdout.buffer.flush()


def _limit(memory: int, seconds: int) -> None:
    """Limits of memory and of processor time of this process, where the system has them."""
    try:
        import resource  # noqa: PLC0415 - there is none on Windows
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _mat(path: str, kind: str, names: list[str], most: int, known: Any, units: Any, steps: Any) -> Any:
    """Arrays of a MAT file of version 5, as MATLAB names them: ``s.field``, ``s(2).field``, ``c{1,2}``, ``c{:,2}``.

    A name that stands for several arrays (a field of an array of structures) gives each of them, in order.
    """
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - half a second, for this format alone

    wanted = {re.split(r"[.({]", name)[0] for name in names}
    tops = []
    for name, shape, of in whosmat(path)[:_MOST_NAMES]:
        known[name] = [int(n) for n in shape]
        if of in ("struct", "cell") or name in wanted:
            tops.append(name)
            if of in _MAT_CLASSES:
                _bounded(shape, 16, most)
    found = loadmat(path, variable_names=tops, struct_as_record=True) if tops else {}
    for top in tops:
        if top in found:
            _list_nested(found[top], top, known, 0)
    for name in names:
        for value in _list_addressed(found, name):
            if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiucb":
                raise RefusedError(f"{name!r} is no array of numbers")
            yield name, value


def _list_nested(value: Any, name: str, known: dict[str, list[int]], depth: int) -> None:
    """Names of what is below a structure or a cell array, with the shape of the first of each."""
    if depth > _DEEPEST or len(known) >= _MOST_NAMES or not isinstance(value, np.ndarray):
        return
    known.setdefault(name, [int(n) for n in value.shape])
    if not value.size:
        return
    if value.dtype.names:
        for field in value.dtype.names:
            _list_nested(value[field].flat[0], f"{name}.{field}", known, depth + 1)
    elif value.dtype == object:
        for column in range(min(value.shape[-1], 8)):
            _list_nested(value[0, column], f"{name}{{:,{column + 1}}}", known, depth + 1)


_STEP = re.compile(r"\.(\w+)|([({])\s*([\d:]+)\s*(?:,\s*([\d:]+)\s*)?[)}]")


def _list_addressed(found: Any, name: str) -> list[Any]:
    """What a name with fields and places stands for; empty where there is nothing of it."""
    top = re.match(r"\w+", name)
    if top is None or top[0] not in found:
        return []
    values, place = [found[top[0]]], top.end()
    while place < len(name) and values:
        step = _STEP.match(name, place)
        if step is None:
            return []
        values = [part for value in values for part in _list_parts(value, step)][:_MOST_PARTS]
        place = step.end()
    return values


def _list_parts(value: Any, step: re.Match[str]) -> list[Any]:
    """What one step of a name leads to: a field of every structure, or the elements at a place counted from 1."""
    field, bracket, row, column = step.groups()
    if not isinstance(value, np.ndarray):
        return []
    if field:
        return list(value[field].flat) if value.dtype.names and field in value.dtype.names else []
    if (bracket == "{") != (value.dtype == object):
        return []
    if column is None:
        value, places = value.reshape(-1, order="F"), [row]
    else:
        places = [row, column]
    cut = []
    for text, size in zip(places, value.shape, strict=False):
        if text != ":" and not (text.isdigit() and 1 <= int(text) <= size):
            return []
        cut.append(slice(None) if text == ":" else slice(int(text) - 1, int(text)))
    part = value[tuple(cut)]
    return list(part.flat) if bracket == "{" else [part]


_MAT_CLASSES = {"double", "single", "logical"} | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}


def _hdf(path: str, kind: str, names: list[str], most: int, known: Any, units: Any, steps: Any) -> Any:
    """Arrays of an HDF5 file by path, ``group/name``; of a MAT file of version 7.3 in MATLAB's order of axes.

    An attribute ``units`` or ``unit`` of an array is its unit.
    """
    import h5py  # noqa: PLC0415 - for this format alone

    with h5py.File(path, "r", locking=False) as file:
        _list(h5py, file, "", known, 0)
        if {"time_data", "channels/node_number"} <= set(known) and "sample_rate" in file.attrs and not names:
            yield from _rattlesnake(h5py, file, most, known, units, steps)
        for name in names:
            place = name.replace(".", "/") if kind == "mat73" else name.strip("/")
            if place not in known:
                continue
            if kind == "mat73":
                known[name] = known[place]
            found = file[place]
            _readable(h5py, found, name)
            shape, part = _choose_rows(found.shape)
            _bounded(shape, max(found.dtype.itemsize, 16), most)
            array = _numbers(found[part], name)
            named = found.attrs.get("units", found.attrs.get("unit"))
            if isinstance(named, str | bytes):
                units[name] = (named if isinstance(named, str) else named.decode(errors="replace"))[:60]
            yield name, array.T if kind == "mat73" else array


def _choose_rows(shape: Any) -> tuple[Any, Any]:
    """Shape and index of the samples that are wanted, along the longest axis."""
    if not _ROWS or not shape:
        return shape, ()
    axis = max(range(len(shape)), key=lambda k: shape[k])
    part = slice(*(min(place, shape[axis]) for place in _ROWS))
    index = tuple(part if k == axis else slice(n) for k, n in enumerate(shape))
    return tuple(one.stop - (one.start or 0) for one in index), index


def _choose_samples(count: int) -> slice:
    """The samples of a channel that are wanted."""
    first, last = _ROWS or (0, count)
    return slice(min(first, count), min(last, count))


def _rattlesnake(h5py: Any, file: Any, most: int, known: Any, units: Any, steps: Any) -> Any:
    """Every channel of a file of the Rattlesnake controller: ``time_data`` (channel, sample) at ``sample_rate``."""
    data, channels = file["time_data"], file["channels"]
    _readable(h5py, data, "time_data")
    part = _choose_samples(int(data.shape[1]))
    _bounded((data.shape[0], part.stop - part.start), 16, most)

    def text(of: str, k: int) -> str:
        found = channels[of][k] if of in channels else b""
        return (found.decode(errors="replace") if isinstance(found, bytes) else str(found)).strip()[:60]

    known.clear()
    for k in range(data.shape[0]):
        name = f"{text('node_number', k)} {text('node_direction', k)}".strip() or f"channel {k + 1}"
        name = f"{name} drive" if text("feedback_device", k) else name  # the signal that went to an exciter
        name = f"{name} ({k + 1})" if name in known else name
        known[name] = [int(data.shape[1])]
        units[name], steps[name] = text("unit", k), (0.0, 1.0 / float(np.ravel(file.attrs["sample_rate"])[0]))
        yield name, data[k, part]


def _tdms(path: str, kind: str, names: list[str], most: int, known: Any, units: Any, steps: Any) -> Any:
    """Channels of a TDMS file, ``group/channel``, with ``unit_string`` and ``wf_increment``."""
    from nptdms import TdmsFile  # noqa: PLC0415 - for this format alone

    with TdmsFile.open(path) as file:
        for group in file.groups():
            for channel in group.channels():
                name = f"{group.name}/{channel.name}"
                if len(known) >= _MOST_NAMES or channel.dtype.kind not in "fiu":
                    continue
                known[name] = [len(channel)]
                units[name] = str(channel.properties.get("unit_string", ""))[:60]
                step = float(channel.properties.get("wf_increment", 0.0))
                if step > 0.0:
                    steps[name] = (float(channel.properties.get("wf_start_offset", 0.0)), step)
                part = _choose_samples(len(channel))
                _bounded((part.stop - part.start,), 16, most)
                yield name, channel[part]


def _lvm(path: str, kind: str, names: list[str], most: int, known: Any, units: Any, steps: Any) -> Any:
    """Columns of a LabVIEW measurement file, ``segment/column``, with ``Y_Unit_Label`` and ``Delta_X``."""
    import lvm_read  # noqa: PLC0415 - for this format alone

    file = lvm_read.read(path, read_from_pickle=False, dump_file=False)
    for number in range(file["Segments"]):
        segment = file[number]
        data, columns = segment["data"], segment["Channel names"]
        count = int(segment["Channels"])
        first = 0 if str(file.get("X_Columns", "No")).lower() == "no" else 1
        for k in range(count):
            place = 2 * k + 1 if str(file.get("X_Columns", "")).lower() == "multi" else first + k
            name = columns[place] if file["Segments"] == 1 else f"{number + 1}/{columns[place]}"
            known[name] = [len(data)]
            units[name] = str((segment.get("Y_Unit_Label") or [""] * count)[k])[:60]
            step = float((segment.get("Delta_X") or [0.0] * count)[k])
            if step > 0.0:
                steps[name] = (float((segment.get("X0") or [0.0] * count)[k]), step)
            yield name, data[:, place]


def _list(h5py: Any, group: Any, prefix: str, known: dict[str, list[int]], depth: int) -> None:
    """Names and shapes of the arrays below a group, through hard links alone."""
    for name in group:
        if len(known) >= _MOST_NAMES:
            return
        if name.startswith("#") or not isinstance(group.get(name, getlink=True), h5py.HardLink):
            continue
        found = group[name]
        if isinstance(found, h5py.Dataset):
            known[prefix + name] = [int(n) for n in found.shape or ()]
        elif isinstance(found, h5py.Group) and depth < _DEEPEST:
            _list(h5py, found, f"{prefix}{name}/", known, depth + 1)


def _readable(h5py: Any, found: Any, name: str) -> None:
    """Refuse what is no plain array of numbers inside the file."""
    if not isinstance(found, h5py.Dataset) or found.shape is None or "MATLAB_empty" in found.attrs:
        raise RefusedError(f"{name!r} is no array of numbers")
    if found.external or found.is_virtual:
        raise RefusedError(f"{name!r} has its values outside the file")
    if found.compression not in _FILTERS:
        raise RefusedError(f"{name!r} is compressed in a way that is not read")
    kinds = [found.dtype[part].kind for part in found.dtype.names] if found.dtype.names else [found.dtype.kind]
    if any(kind not in "fiucb" for kind in kinds):
        raise RefusedError(f"{name!r} is no array of numbers")


def _bounded(shape: Any, item: int, most: int) -> None:
    if item * math.prod(max(int(n), 1) for n in shape) > most:
        raise RefusedError(f"an array of {' x '.join(str(n) for n in shape)} is larger than the file warrants")


def _numbers(array: Any, name: str) -> Any:
    """Complex numbers of a compound of real and imaginary part as such."""
    for real, imag in (("real", "imag"), ("r", "i"), ("re", "im")):
        if array.dtype.names == (real, imag):
            return array[real].astype(float) + 1j * array[imag].astype(float)
    if array.dtype.names:
        raise RefusedError(f"{name!r} is a table with columns {', '.join(array.dtype.names)}, no array of numbers")
    return array


_READERS = {"mat5": _mat, "mat73": _hdf, "hdf5": _hdf, "tdms": _tdms, "lvm": _lvm}

if __name__ == "__main__":
    main()
