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
_LONGEST_TEXT = 60  # characters of a unit or a name that are kept
_MOST_PARTS = 1000  # most arrays that one name may stand for
_MOST_COLUMNS = 8  # most columns of a cell array whose members are listed
_NUMBERS = "fiucb"  # kinds of numpy's types that are numbers
_MAT_CLASSES = {"double", "single", "logical"} | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
_SAMPLING = set().union(*tomllib.loads(Path(__file__).with_name("names.toml").read_text("utf-8"))["rate"].values())
# a step of a MATLAB name: ``.field``, or indices from 1, of cells ``{1,2}`` or of an array ``(:,2)``
_STEP = re.compile(r"\.(\w+)|([({])\s*([\d:]+)\s*(?:,\s*([\d:]+)\s*)?[)}]")


class RefusedError(Exception):
    """Why an array is not read."""


@dataclass
class Contents:
    """What a file holds, and how much of it may be read."""

    bytes_left: int  #: of arrays that may still be read
    is_mat: bool = False  #: whether its axes are in MATLAB's order, the reverse of that of HDF5
    rows: list[int] = field(default_factory=list)  #: first row read and end (exclusive); empty for all
    known: dict[str, list[int]] = field(default_factory=dict)  #: shapes by name
    units: dict[str, str] = field(default_factory=dict)  #: by name
    steps: dict[str, tuple[float, float]] = field(default_factory=dict)  #: start and step in s of channels against time

    def add_channel(self, name: str, count: int, unit: object, start: float, step: float) -> slice:
        """Note a channel against time, and return the range of its samples to read."""
        self.known[name], self.units[name] = [count], _as_text(unit)
        if step > 0.0:
            self.steps[name] = (float(start), float(step))
        return self.find_range([count])[0]

    def find_range(self, shape: Any) -> tuple[slice, ...]:
        """The range to read of an array, along its longest axis."""
        part, longest = [slice(0, int(n)) for n in shape], max(shape, default=0)
        if self.rows and longest > 1:
            part[list(shape).index(longest)] = slice(*(min(place, longest) for place in self.rows))
        return tuple(part)

    def require_room(self, shape: Any, item: int) -> None:
        """Refuse an array of that shape, with ``item`` bytes per value, if it is larger than the file warrants."""
        if item * math.prod(max(int(n), 1) for n in shape) > self.bytes_left:
            raise RefusedError(f"an array of {' x '.join(str(n) for n in shape)} is larger than the file warrants")


def main() -> None:
    """Read ``sys.argv``: format, path, JSON list of names, limits of array bytes, memory and seconds, JSON rows."""
    kind, path, names, most, memory, seconds, rows = sys.argv[1:]
    _limit(int(memory), int(seconds))
    contents = Contents(int(most), kind == "mat73", json.loads(rows) or [])
    arrays: list[tuple[str, np.ndarray[Any, Any]]] = []
    problem = missing = None
    try:
        for name, array in _READERS[kind](path, json.loads(names), contents):
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
    loaded = [(name, array.dtype.str, array.shape) for name, array in arrays]
    answer = json.dumps({**vars(contents), "loaded": loaded, "problem": problem, "missing": missing})
    sys.stdout.buffer.write(answer.encode() + b"\n")
    sys.stdout.buffer.writelines(array.data if array.size else b"" for _, array in arrays)


def _limit(memory: int, seconds: int) -> None:
    """Limit memory and processor time of this process, if the system supports it."""
    try:
        import resource  # noqa: PLC0415 - not available on Windows
    except ImportError:
        return
    for kind, most in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        resource.setrlimit(kind, (most, most))


def _read_mat(path: str, names: list[str], contents: Contents) -> Iterator[tuple[str, Any]]:
    """Arrays of a MAT file of version 5 by MATLAB names: ``s.field``, ``s(2).field``, ``c{1,2}``, ``c{:,2}``."""
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - half a second, for this format alone

    wanted, loaded = {re.split(r"[.({]", name)[0] for name in names}, list[str]()
    for name, shape, mat_class in whosmat(path)[:_MOST_NAMES]:
        contents.known[name] = [int(n) for n in shape]
        if mat_class in ("struct", "cell") or name in wanted:
            loaded.append(name)
        if name in wanted and mat_class in _MAT_CLASSES:
            contents.require_room(shape, 8)
    variables = loadmat(path, variable_names=loaded, struct_as_record=True) if loaded else {}
    for name in (name for name in loaded if name in variables):
        _list_mat_members(variables[name], name, contents.known, 0)
    for name in names:
        for value in _find_values(variables, name):
            if not isinstance(value, np.ndarray) or value.dtype.kind not in _NUMBERS:
                raise RefusedError(f"{name!r} is no array of numbers")
            yield name, value[contents.find_range(value.shape)]


def _list_mat_members(value: Any, name: str, known: dict[str, list[int]], depth: int) -> None:
    """List the members below a structure or a cell array, with the shape of the first of each."""
    if depth > _DEEPEST or len(known) >= _MOST_NAMES or not isinstance(value, np.ndarray):
        return
    known.setdefault(name, [int(n) for n in value.shape])
    if value.size and value.dtype.names:
        for member in value.dtype.names:
            _list_mat_members(value[member].flat[0], f"{name}.{member}", known, depth + 1)
    elif value.size and value.dtype == object:
        for column in range(min(value.shape[-1], _MOST_COLUMNS)):
            _list_mat_members(value[0, column], f"{name}{{:,{column + 1}}}", known, depth + 1)


def _find_values(variables: Any, name: str) -> list[Any]:
    """The values, in order, that a name with fields and indices stands for; empty if there are none."""
    variable = re.split(r"[.({]", name)[0]
    if variable not in variables or not re.fullmatch(rf"\w+({_STEP.pattern})*", name):
        return []
    values = [variables[variable]]
    for step in _STEP.finditer(name, len(variable)):
        values = [part for value in values for part in _select_parts(value, step)][:_MOST_PARTS]
    return values


def _select_parts(value: Any, step: re.Match[str]) -> list[Any]:
    """The values at one step of a name: a field of every structure, or the elements at indices; empty if none."""
    member, bracket, row, column = step.groups()
    is_array = isinstance(value, np.ndarray)
    if member:
        return list(value[member].flat) if is_array and member in (value.dtype.names or ()) else []
    if not is_array or (bracket == "{") != (value.dtype == object):  # braces are for cells alone
        return []
    value = value.reshape(-1, order="F") if column is None else value
    places: list[slice] = []
    for text, size in zip([row] if column is None else [row, column], value.shape, strict=False):
        if text != ":" and not (text.isdigit() and 1 <= int(text) <= size):
            return []
        places.append(slice(None) if text == ":" else slice(int(text) - 1, int(text)))
    part = value[tuple(places)]
    return list(part.flat) if bracket == "{" else [part]


def _read_hdf(path: str, names: list[str], contents: Contents) -> Iterator[tuple[str, Any]]:
    """Arrays of an HDF5 file by path, ``group/name``; of a MAT file of version 7.3 by MATLAB names."""
    import h5py  # noqa: PLC0415 - for this format alone

    with h5py.File(path, "r", locking=False) as file:
        _list_hdf_members(h5py, file, "", contents.known, 0)
        if not names and {"time_data", "channels/node_number"} <= set(contents.known) and "sample_rate" in file.attrs:
            yield from _read_rattlesnake(h5py, file, contents)
        for name in names:
            yield from _read_hdf_array(h5py, file, name, contents)


def _list_hdf_members(h5py: Any, member: Any, path: str, known: dict[str, list[int]], depth: int) -> None:
    """List arrays from a path on with their shapes, following only hard links, and attributes that state sampling."""
    if isinstance(member, h5py.Dataset):
        known[path] = [int(n) for n in member.shape or ()]
    for name in filter(lambda name: name.lower() in _SAMPLING, member.attrs):
        own = member.attrs.get_id(name)
        if own.dtype.kind in "fiu" and own.get_space().get_simple_extent_npoints() == 1:  # one number
            known[f"{path}/{name}".strip("/")] = []
    for name in member if isinstance(member, h5py.Group) and depth <= _DEEPEST else ():
        is_hard = not name.startswith("#") and isinstance(member.get(name, getlink=True), h5py.HardLink)
        if is_hard and len(known) < _MOST_NAMES:
            _list_hdf_members(h5py, member[name], f"{path}/{name}".strip("/"), known, depth + 1)


def _read_hdf_array(h5py: Any, file: Any, name: str, contents: Contents) -> Iterator[tuple[str, Any]]:
    """The array, with its unit, or the attribute of a name, if there is one; ``name(:,1)`` is the first column."""
    place = name.replace(".", "/") if contents.is_mat else name.strip("/")
    index = None if place in contents.known else _STEP.match(place, place.rfind("("))
    place = place[: index.start()] if index else place
    if place not in contents.known:
        return
    if contents.is_mat:
        contents.known[name] = contents.known[place]
    if place not in file:
        owner, _, attribute = place.rpartition("/")
        yield name, np.asarray(file[owner or "/"].attrs[attribute], dtype=float)
        return
    dataset = file[place]
    _require_numbers(h5py, dataset, name)
    part, dtype = contents.find_range(dataset.shape), dataset.dtype
    contents.require_room([k.stop - k.start for k in part], 16 if dtype.names or dtype.kind == "c" else 8)
    array = _join_parts(dataset[part], name)
    if isinstance(unit := dataset.attrs.get("units", dataset.attrs.get("unit")), str | bytes):
        contents.units[name] = _as_text(unit)
    array = array.T if contents.is_mat else array
    for value in _select_parts(array, index) if index else [array]:
        yield name, value


def _require_numbers(h5py: Any, array: Any, name: str) -> None:
    """Refuse anything but an array of numbers within the file."""
    if not isinstance(array, h5py.Dataset) or array.shape is None or "MATLAB_empty" in array.attrs:
        raise RefusedError(f"{name!r} is no array of numbers")
    if array.external or array.is_virtual:
        raise RefusedError(f"{name!r} has its values outside the file")
    if array.compression not in ("gzip", "lzf", None):
        raise RefusedError(f"{name!r} is compressed in a way that is not read")
    types = [array.dtype[part] for part in array.dtype.names or ()] or [array.dtype]
    if any(part.kind not in _NUMBERS for part in types):
        raise RefusedError(f"{name!r} is no array of numbers")


def _join_parts(array: Any, name: str) -> Any:
    """The array, with a compound of real and imaginary parts as complex numbers."""
    parts = array.dtype.names
    if parts in (("real", "imag"), ("r", "i"), ("re", "im")):
        return array[parts[0]].astype(float) + 1j * array[parts[1]].astype(float)
    if parts:
        raise RefusedError(f"{name!r} is a table with columns {', '.join(parts)}, no array of numbers")
    return array


def _as_text(value: object) -> str:
    text = value.decode(errors="replace") if isinstance(value, bytes) else str(value)
    return text[:_LONGEST_TEXT]


def _read_rattlesnake(h5py: Any, file: Any, contents: Contents) -> Iterator[tuple[str, Any]]:
    """Every channel of a file of the Rattlesnake controller: ``time_data`` (channel, sample) at ``sample_rate``."""
    data, channels = file["time_data"], file["channels"]
    _require_numbers(h5py, data, "time_data")
    step = 1.0 / float(np.ravel(file.attrs["sample_rate"])[0])

    def read_text(of: str, k: int) -> str:
        return _as_text(channels[of][k]).strip() if of in channels else ""

    contents.known.clear()
    for k in range(data.shape[0]):
        name = f"{read_text('node_number', k)} {read_text('node_direction', k)}".strip() or f"channel {k + 1}"
        name = f"{name} drive" if read_text("feedback_device", k) else name  # the signal sent to an exciter
        name = f"{name} ({k + 1})" if name in contents.known else name
        part = contents.add_channel(name, int(data.shape[1]), read_text("unit", k), 0.0, step)
        contents.require_room((data.shape[0] - k, part.stop - part.start), 8)
        yield name, data[k, part]


def _read_tdms(path: str, names: list[str], contents: Contents) -> Iterator[tuple[str, Any]]:
    """Channels of a TDMS file, ``group/channel``, with ``unit_string`` and ``wf_increment``."""
    from nptdms import TdmsFile  # noqa: PLC0415 - for this format alone

    with TdmsFile.open(path) as file:
        for channel in (channel for group in file.groups() for channel in group.channels()):
            if len(contents.known) >= _MOST_NAMES or channel.dtype.kind not in "fiu":
                continue
            name, about = f"{channel.group_name}/{channel.name}", channel.properties
            start, step = about.get("wf_start_offset", 0.0), about.get("wf_increment", 0.0)
            part = contents.add_channel(name, len(channel), about.get("unit_string", ""), start, step)
            if not names or name in names or channel.name in names:
                contents.require_room((part.stop - part.start,), 8)
                yield name, channel[part]


def _read_lvm(path: str, names: list[str], contents: Contents) -> Iterator[tuple[str, Any]]:
    """Columns of a LabVIEW measurement file, ``segment/column``, with ``Y_Unit_Label``, ``X0`` and ``Delta_X``."""
    import lvm_read  # noqa: PLC0415 - for this format alone

    file = lvm_read.read(path, read_from_pickle=False, dump_file=False)
    abscissas = str(file.get("X_Columns", "No")).lower()  # no; one, before all; multi, one before each channel
    for number in range(file["Segments"]):
        segment = file[number]
        data, columns, count = segment["data"], segment["Channel names"], int(segment["Channels"])
        stated = {"Y_Unit_Label": "", "X0": 0.0, "Delta_X": 0.0}
        units, starts, steps = (segment.get(key) or [missing] * count for key, missing in stated.items())
        for k in range(count):
            place = 2 * k + 1 if abscissas == "multi" else k + (abscissas != "no")
            name = columns[place] if file["Segments"] == 1 else f"{number + 1}/{columns[place]}"
            part = contents.add_channel(name, len(data), units[k], float(starts[k]), float(steps[k]))
            yield name, data[part, place]


_READERS = {"mat5": _read_mat, "mat73": _read_hdf, "hdf5": _read_hdf, "tdms": _read_tdms, "lvm": _read_lvm}

if __name__ == "__main__":
    main()
