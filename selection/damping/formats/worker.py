"""Reads named arrays of a MAT or HDF5 file in a process of its own; a script, started by ``arrays``.

The HDF5 library can be brought to crash, to loop or to allocate without end by a damaged or hostile file. Here that
ends this process and not the program. Standard output gets one line of JSON, then the bytes of the arrays in its
order; an error of a library ends it with a traceback on standard error. Only numbers are read: no objects, references,
functions or text, nothing outside the file (external and virtual data), no pickles.
"""

from __future__ import annotations

import json
import sys
from typing import Any

import numpy as np

#: Arrays of a file that are listed: a bound for files that hold thousands.
_MOST_NAMES = 200
#: Groups within groups that are looked into: a bound for files that nest without end.
_DEEPEST = 6
_FILTERS = {"gzip", "lzf", None}


class RefusedError(Exception):
    """Why an array is not read."""


def main() -> None:
    """Read ``sys.argv``: format, path, JSON list of names, most bytes of arrays, of memory, and most seconds."""
    kind, path, names = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
    most, memory, seconds = map(int, sys.argv[4:7])
    _limit(memory, seconds)
    known: dict[str, list[int]] = {}
    units: dict[str, str] = {}
    arrays: dict[str, np.ndarray[Any, Any]] = {}
    problem = None
    try:
        read = _mat if kind == "mat5" else _hdf
        for name, array in read(path, kind, names, most, known, units):
            arrays[name] = np.ascontiguousarray(array, dtype=complex if np.iscomplexobj(array) else float)
            most -= arrays[name].nbytes
            if most < 0:
                raise RefusedError("the arrays are larger than the file warrants")
    except RefusedError as error:
        problem = str(error)
    except MemoryError:
        problem = "it asks for more memory than its size warrants"
    loaded = [(name, "complex" if np.iscomplexobj(array) else "float", array.shape) for name, array in arrays.items()]
    out = sys.stdout.buffer
    out.write(json.dumps({"known": known, "units": units, "loaded": loaded, "problem": problem}).encode() + b"\n")
    for array in arrays.values():
        out.write(array.data if array.size else b"")
    out.flush()


def _limit(memory: int, seconds: int) -> None:
    """Limits of memory and of processor time of this process, where the system has them."""
    try:
        import resource  # noqa: PLC0415 - there is none on Windows
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _mat(path: str, kind: str, names: list[str], most: int, known: dict[str, list[int]], units: dict[str, str]) -> Any:
    """Arrays of a MAT file of version 5; fields of structures as ``structure.field``."""
    from scipy.io import loadmat, whosmat  # noqa: PLC0415 - half a second, for this format alone

    for name, shape, of in whosmat(path)[:_MOST_NAMES]:
        known[name] = [int(n) for n in shape]
        if name in {wanted.split(".")[0] for wanted in names} and of in _MAT_CLASSES:
            _bounded(shape, 16, most)
    tops = [name for name in dict.fromkeys(wanted.split(".")[0] for wanted in names) if name in known]
    found = loadmat(path, variable_names=tops, struct_as_record=True) if tops else {}
    for name in names:
        top, *fields = name.split(".")
        if top not in found:
            continue
        value = found[top]
        known.update({f"{top}.{field}": [] for field in value.dtype.names or ()})
        for field in fields:
            if not value.dtype.names or field not in value.dtype.names or value.size != 1:
                break
            value = value[field].flat[0]
        else:
            if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiucb":
                raise RefusedError(f"{name!r} is no array of numbers")
            yield name, value


_MAT_CLASSES = {"double", "single", "logical"} | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}


def _hdf(path: str, kind: str, names: list[str], most: int, known: dict[str, list[int]], units: dict[str, str]) -> Any:
    """Arrays of an HDF5 file by path, ``group/name``; of a MAT file of version 7.3 in MATLAB's order of axes.

    An attribute ``units`` or ``unit`` of an array is its unit.
    """
    import h5py  # noqa: PLC0415 - for this format alone

    with h5py.File(path, "r", locking=False) as file:
        _list(h5py, file, "", known, 0)
        for name in names:
            place = name.replace(".", "/") if kind == "mat73" else name.strip("/")
            if place not in known:
                continue
            if kind == "mat73":
                known[name] = known[place]
            found = file[place]
            _readable(h5py, found, name)
            _bounded(found.shape, max(found.dtype.itemsize, 16), most)
            array = _numbers(found[()], name)
            named = found.attrs.get("units", found.attrs.get("unit"))
            if isinstance(named, str | bytes):
                units[name] = (named if isinstance(named, str) else named.decode(errors="replace"))[:60]
            yield name, array.T if kind == "mat73" else array


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
    size = item
    for n in shape:
        size *= max(int(n), 1)
    if size > most:
        raise RefusedError(f"an array of {' x '.join(str(n) for n in shape)} is larger than the file warrants")


def _numbers(array: Any, name: str) -> Any:
    """Complex numbers of a compound of real and imaginary part as such."""
    for real, imag in (("real", "imag"), ("r", "i"), ("re", "im")):
        if array.dtype.names == (real, imag):
            return array[real].astype(float) + 1j * array[imag].astype(float)
    if array.dtype.names:
        raise RefusedError(f"{name!r} is a table with columns {', '.join(array.dtype.names)}, no array of numbers")
    return array


if __name__ == "__main__":
    main()
