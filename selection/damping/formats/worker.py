"""Reads arrays and channels of a binary or LabVIEW file in a separate process; a script, started by ``arrays``.

A damaged or hostile file can make the HDF5 library crash, loop or allocate without end; that ends only this process,
not the program. Standard output gets one line of JSON, then the bytes of the arrays in the order listed there. Only
numbers are read: no objects, references, functions or text, nothing outside the file (external, virtual), no pickles.
"""

import json
import math
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

_MOST_NAMES = 200  # most arrays of a file that are listed: a bound for files with thousands
_DEEPEST = 6  # deepest level of nested groups that is read: a bound for endless nesting
_MOST_PARTS = 1000  # most arrays that one name may stand for
_FILTERS = {"gzip", "lzf", None}
_MAT_CLASSES = {"double", "single", "logical"} | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_SAMPLING = set().union(*tomllib.loads(Path(__file__).with_name("names.toml").read_text("utf-8"))["rate"].values())
_STEP = re.compile(r"\.(\w+)|([({])\s*([\d:]+)\s*(?:,\s*([\d:]+)\s*)?[)}]")
Read = Iterator[tuple[str, Any]]


class RefusedError(Exception):
    """Why an array is not read."""


@dataclass
class Contents:
    """Shapes, units, (start, step) in s by name; bytes allowed; first row and end (exclusive) read, empty for all."""

    bytes_left: int
    rows: list[int] = field(default_factory=list)
    known: dict[str, list[int]] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    steps: dict[str, tuple[float, float]] = field(default_factory=dict)

    def add_channel(self, name: str, count: int, unit: object, start: float, step: float) -> slice:
        """Note a channel against time, and return the range of its samples to read."""
        self.known[name], self.units[name] = [count], str(unit)[:60]
        if step > 0.0:
            self.steps[name] = (float(start), float(step))
        return self.cut([count])[0]

    def cut(self, shape: Any) -> tuple[slice, ...]:
        """The samples to read of an array, along its longest axis."""
        part, longest = [slice(0, int(n)) for n in shape], max(shape, default=0)
        if self.rows and longest > 1:
            part[list(shape).index(longest)] = slice(*(min(place, longest) for place in self.rows))
        return tuple(part)

    def refuse_beyond(self, shape: Any, item: int) -> None:
        """Refuse an array of that shape, with ``item`` bytes per value, if it is larger than the file warrants."""
        if item * math.prod(max(int(n), 1) for n in shape) > self.bytes_left:
            raise RefusedError(f"an array of {' x '.join(str(n) for n in shape)} is larger than the file warrants")


def main() -> None:
    """Read ``sys.argv``: format, path, JSON list of names, limits of array bytes, memory and seconds, JSON rows."""
    kind, path, names = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
    most, memory, seconds = map(int, sys.argv[4:7])
    _limit(memory, seconds)
    contents = Contents(most, json.loads(sys.argv[7]) or [])
    arrays: list[tuple[str, np.ndarray[Any, Any]]] = []
    problem = missing = None
    try:
        for name, array in _READERS[kind](path, kind, names, contents):
            arrays.append((name, np.ascontiguousarray(array, dtype=complex if np.iscomplexobj(array) else float)))
            contents.bytes_left -= arrays[-1][1].nbytes
            if contents.bytes_left < 0:
                raise RefusedError("the arrays are larger than the file warrants")
    except RefusedError as error:
        problem = str(error)
    except MemoryError:
        problem = "it asks for more memory than its size warrants"
    except ModuleNotFoundError as error:
        missing = error.name
    loaded = [(name, "complex" if np.iscomplexobj(array) else "float", array.shape) for name, array in arrays]
    answer = {**vars(contents), "loaded": loaded, "problem": problem, "missing": missing}
    sys.stdout.buffer.write(json.dumps(answer).encode() + b"\n")
    for _, array in arrays:
        sys.stdout.buffer.write(array.data if array.size else b"")
    sys.stdout.buffer.flush()


def _limit(memory: int, seconds: int) -> None:
    """Limit memory and processor time of this process, if the system supports it."""
    try:
        import resource  # noqa: PLC0415 - not available on Windows
    except ImportError:
        return
    for kind, most in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        resource.setrlimit(kind, (most, most))


def _mat(path: str, kind: str, names: list[str], contents: Contents) -> Read:
    """Arrays of a MAT file of version 5 by MATLAB names: ``s.field``, ``s(2).field``, ``c{1,2}``, ``c{:,2}``.

    A name of several arrays (a field of an array of structures) gives each of them, in order.
    """
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - half a second, for this format alone

    wanted, tops = {re.split(r"[.({]", name)[0] for name in names}, list[str]()
    for name, shape, mat_class in whosmat(path)[:_MOST_NAMES]:
        contents.known[name] = [int(n) for n in shape]
        if mat_class in ("struct", "cell") or name in wanted:
            tops.append(name)
        if name in wanted and mat_class in _MAT_CLASSES:
            contents.refuse_beyond(shape, 8)
    variables = loadmat(path, variable_names=tops, struct_as_record=True) if tops else {}
    for top in (top for top in tops if top in variables):
        _list_nested(variables[top], top, contents.known, 0)
    for name in names:
        for value in _list_addressed(variables, name):
            if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiucb":
                raise RefusedError(f"{name!r} is no array of numbers")
            yield name, value[contents.cut(value.shape)]


def _list_nested(value: Any, name: str, known: dict[str, list[int]], depth: int) -> None:
    """List the members below a structure or a cell array, with the shape of the first of each."""
    if depth > _DEEPEST or len(known) >= _MOST_NAMES or not isinstance(value, np.ndarray):
        return
    known.setdefault(name, [int(n) for n in value.shape])
    if value.size and value.dtype.names:
        for field in value.dtype.names:
            _list_nested(value[field].flat[0], f"{name}.{field}", known, depth + 1)
    elif value.size and value.dtype == object:
        for column in range(min(value.shape[-1], 8)):
            _list_nested(value[0, column], f"{name}{{:,{column + 1}}}", known, depth + 1)


def _list_addressed(variables: Any, name: str) -> list[Any]:
    """The values that a name with fields and indices stands for; empty if there are none."""
    top = re.match(r"\w+", name)
    if top is None or top[0] not in variables:
        return []
    values, place = [variables[top[0]]], top.end()
    while place < len(name) and values:
        step = _STEP.match(name, place)
        if step is None:
            return []
        values = [part for value in values for part in _list_parts(value, step)][:_MOST_PARTS]
        place = step.end()
    return values


def _list_parts(value: Any, step: re.Match[str]) -> list[Any]:
    """The values at one step of a name: a field of every structure, or the elements at indices from 1."""
    field, bracket, row, column = step.groups()
    if not isinstance(value, np.ndarray):
        return []
    if field:
        return list(value[field].flat) if value.dtype.names and field in value.dtype.names else []
    if (bracket == "{") != (value.dtype == object):
        return []
    value, places = (value.reshape(-1, order="F"), [row]) if column is None else (value, [row, column])
    pairs = list(zip(places, value.shape, strict=False))
    if not all(text == ":" or (text.isdigit() and 1 <= int(text) <= size) for text, size in pairs):
        return []
    part = value[tuple(slice(None) if text == ":" else slice(int(text) - 1, int(text)) for text, _ in pairs)]
    return list(part.flat) if bracket == "{" else [part]


def _hdf(path: str, kind: str, names: list[str], contents: Contents) -> Read:
    """Arrays of an HDF5 file by path, ``group/name``; for a MAT file of version 7.3 in MATLAB's order of axes.

    An attribute ``units`` or ``unit`` of an array is its unit. ``name(:,1)`` is the first column of an array.
    """
    import h5py  # noqa: PLC0415 - for this format alone

    with h5py.File(path, "r", locking=False) as file:
        _list(h5py, file, "", contents.known, 0)
        if {"time_data", "channels/node_number"} <= set(contents.known) and "sample_rate" in file.attrs and not names:
            yield from _rattlesnake(h5py, file, contents)
        for name in names:
            place = name.replace(".", "/") if kind == "mat73" else name.strip("/")
            index = None if place in contents.known else _STEP.match(place, place.rfind("("))
            place = place[: index.start()] if index else place
            if place not in contents.known:
                continue
            if kind == "mat73":
                contents.known[name] = contents.known[place]
            if place not in file:  # an attribute
                of, _, own = place.rpartition("/")
                yield name, np.asarray(file[of or "/"].attrs[own], dtype=float)
                continue
            dataset = file[place]
            _readable(h5py, dataset, name)
            part, dtype = contents.cut(dataset.shape), dataset.dtype
            contents.refuse_beyond([k.stop - k.start for k in part], 16 if dtype.names or dtype.kind == "c" else 8)
            array = _numbers(dataset[part], name)
            if isinstance(named := dataset.attrs.get("units", dataset.attrs.get("unit")), str | bytes):
                contents.units[name] = _as_text(named)
            array = array.T if kind == "mat73" else array
            yield from ((name, part) for part in (_list_parts(array, index) if index else [array]))


def _as_text(value: object) -> str:
    return (value.decode(errors="replace") if isinstance(value, bytes) else str(value))[:60]


def _rattlesnake(h5py: Any, file: Any, contents: Contents) -> Read:
    """Every channel of a file of the Rattlesnake controller: ``time_data`` (channel, sample) at ``sample_rate``."""
    data, channels = file["time_data"], file["channels"]
    _readable(h5py, data, "time_data")
    step = 1.0 / float(np.ravel(file.attrs["sample_rate"])[0])

    def text(of: str, k: int) -> str:
        return _as_text(channels[of][k]).strip() if of in channels else ""

    contents.known.clear()
    for k in range(data.shape[0]):
        name = f"{text('node_number', k)} {text('node_direction', k)}".strip() or f"channel {k + 1}"
        name = f"{name} drive" if text("feedback_device", k) else name  # the signal sent to an exciter
        name = f"{name} ({k + 1})" if name in contents.known else name
        part = contents.add_channel(name, int(data.shape[1]), text("unit", k), 0.0, step)
        contents.refuse_beyond((data.shape[0] - k, part.stop - part.start), 8)
        yield name, data[k, part]


def _tdms(path: str, kind: str, names: list[str], contents: Contents) -> Read:
    """Channels of a TDMS file, ``group/channel``, with ``unit_string`` and ``wf_increment``."""
    from nptdms import TdmsFile  # noqa: PLC0415 - for this format alone

    with TdmsFile.open(path) as file:
        for channel in (channel for group in file.groups() for channel in group.channels()):
            if len(contents.known) >= _MOST_NAMES or channel.dtype.kind not in "fiu":
                continue
            name, about = f"{channel.group_name}/{channel.name}", channel.properties
            start, step = about.get("wf_start_offset", 0.0), about.get("wf_increment", 0.0)
            part = contents.add_channel(name, len(channel), about.get("unit_string", ""), start, step)
            if not names or {name, channel.name} & set(names):
                contents.refuse_beyond((part.stop - part.start,), 8)
                yield name, channel[part]


def _lvm(path: str, kind: str, names: list[str], contents: Contents) -> Read:
    """Columns of a LabVIEW measurement file, ``segment/column``, with ``Y_Unit_Label`` and ``Delta_X``."""
    import lvm_read  # noqa: PLC0415 - for this format alone

    file = lvm_read.read(path, read_from_pickle=False, dump_file=False)
    abscissas = str(file.get("X_Columns", "No")).lower()
    for number in range(file["Segments"]):
        segment = file[number]
        data, columns, count = segment["data"], segment["Channel names"], int(segment["Channels"])
        for k in range(count):
            place = 2 * k + 1 if abscissas == "multi" else k + (abscissas != "no")
            name = columns[place] if file["Segments"] == 1 else f"{number + 1}/{columns[place]}"
            unit = (segment.get("Y_Unit_Label") or [""] * count)[k]
            start, step = (float((segment.get(key) or [0.0] * count)[k]) for key in ("X0", "Delta_X"))
            yield name, data[contents.add_channel(name, len(data), unit, start, step), place]


def _list(h5py: Any, member: Any, path: str, known: dict[str, list[int]], depth: int) -> None:
    """List arrays from a path on with their shapes, following only hard links, and attributes that state sampling."""
    if isinstance(member, h5py.Dataset):
        known[path] = [int(n) for n in member.shape or ()]
    for name in (name for name in member.attrs if name.lower() in _SAMPLING):
        own = member.attrs.get_id(name)
        if own.dtype.kind in "fiu" and own.get_space().get_simple_extent_npoints() == 1:  # one number
            known[f"{path}/{name}".strip("/")] = []
    for name in member if isinstance(member, h5py.Group) and depth <= _DEEPEST else ():
        is_hard = not name.startswith("#") and isinstance(member.get(name, getlink=True), h5py.HardLink)
        if is_hard and len(known) < _MOST_NAMES:
            _list(h5py, member[name], f"{path}/{name}".strip("/"), known, depth + 1)


def _readable(h5py: Any, array: Any, name: str) -> None:
    if not isinstance(array, h5py.Dataset) or array.shape is None or "MATLAB_empty" in array.attrs:
        raise RefusedError(f"{name!r} is no array of numbers")
    if array.external or array.is_virtual:
        raise RefusedError(f"{name!r} has its values outside the file")
    if array.compression not in _FILTERS:
        raise RefusedError(f"{name!r} is compressed in a way that is not read")
    dtype = array.dtype
    if any(part.kind not in "fiucb" for part in ([dtype[name] for name in dtype.names] if dtype.names else [dtype])):
        raise RefusedError(f"{name!r} is no array of numbers")


def _numbers(array: Any, name: str) -> Any:
    """The array, with a compound of real and imaginary parts as complex numbers."""
    names = array.dtype.names
    if names in (("real", "imag"), ("r", "i"), ("re", "im")):
        return array[names[0]].astype(float) + 1j * array[names[1]].astype(float)
    if names:
        raise RefusedError(f"{name!r} is a table with columns {', '.join(names)}, no array of numbers")
    return array


_READERS = {"mat5": _mat, "mat73": _hdf, "hdf5": _hdf, "tdms": _tdms, "lvm": _lvm}

if __name__ == "__main__":
    main()
