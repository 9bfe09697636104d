"""Arrays and channels of a file, as ``arrays`` reads them, to series: by role, against an abscissa or as sampled."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from damping.arrays import FloatArray
from damping.errors import InputError
from damping.formats.arrays import Arrays, read_arrays
from damping.formats.headers import ABSCISSAS, NAMES, ROLES, ColumnHeader, parse_header
from damping.formats.named import find_scaling, note_unheeded_units, read_facts, require_linear, to_series
from damping.formats.quantity import find_powers
from damping.formats.sampling import SAMPLING, Shapes, find_abscissa, find_nearest, last_name, list_times, split
from damping.formats.series import FileFacts, Samples, Series, Stated, Summary, require_response
from damping.records.text import describe_shortened


def list_array_series(
    path: str | Path, kind: str, stated: Stated, summary: Summary, max_size: int, rows: tuple[int, int] | None = None
) -> list[Series]:
    """Series of a file of named arrays or channels; ``rows`` as of ``read_arrays``."""
    read = partial(read_arrays, path, kind, max_size=max_size)
    contents, are_channels = _read_contents(partial(read, rows=rows), kind, stated)
    if are_channels and (contents.steps or stated.rate or kind == "lvm"):
        return list_channels(contents, stated, summary)
    names = {} if are_channels and not stated.columns else _name_arrays(contents, stated)
    if further := [name for name in names.values() if name not in contents.arrays]:
        contents = contents.join(read(further, rows=rows))
    needs_abscissa = names.keys().isdisjoint(ABSCISSAS)
    if stated.rate is not None and not needs_abscissa:
        raise InputError("--rate beside an array of times or frequencies", expected="one of them")
    main = next((names[role] for role in ("response", "amplitude", "x") if role in names), "")
    usual = find_abscissa(contents.known, main) if needs_abscissa else {}
    require_response(names | usual, contents.known, stated, many=kind == "hdf5")
    even = _find_even_abscissa(read, contents, main, stated, summary) if needs_abscissa else None
    if even is not None:
        role, name, values, text = even
        names, contents = names | {role: name}, contents.join(Arrays({name: [values]}, {name: text}, {}, {}))
    elif usual:
        names, contents = names | usual, contents.join(read(list(usual.values()), rows=rows))
    headers = {role: _read_header(name, contents) for role, name in names.items()}
    require_linear(headers)
    for role, name in names.items():
        _describe_array(role, name, contents.arrays[name], stated, summary)
    note_unheeded_units(names, stated, summary)
    of_response, of_force = (find_scaling(headers, quantity) for quantity in ("response", "force"))
    assumed = ["force"] if of_force is None and of_response not in (None, "peak") else []
    facts = read_facts(headers, stated)
    facts = replace(facts, scaling=of_response, force_scaling=of_force, peak_assumed=assumed)
    return _list_sweeps(names, contents.arrays, facts, Path(path).stem, summary)


def _read_header(name: str, contents: Arrays) -> ColumnHeader:
    """The header of an array: its unit and scaling as the file states them, such as g rms."""
    text = contents.units.get(name, "")
    header = parse_header(f"value [{text}]")
    return replace(header, text=f"{name} {text}".strip(), name=name, unit=header.unit or text)


def _read_contents(read: Callable[[Sequence[str]], Arrays], kind: str, stated: Stated) -> tuple[Arrays, bool]:
    """The stated arrays of a file, else those with the name of a role, or all channels; whether it is of channels."""
    are_channels = kind in ("tdms", "lvm")
    usual = [] if are_channels else list(chain.from_iterable(NAMES["own"].values()))
    contents = read(list(stated.columns.values()) or usual)
    if kind == "hdf5" and not contents.arrays:  # as of a controller, whose channels are read if no array is named
        contents = read([])
        are_channels = bool(contents.steps)
    return contents, are_channels


def _name_arrays(contents: Arrays, stated: Stated) -> dict[str, str]:
    """Names of arrays by role: as stated, and of an abscissa that has the name of its role; else those so called.

    InputError: a stated array that the file does not have, or none has the name of a role.
    """
    arrays, known = contents.arrays, contents.known
    if not stated.columns:
        if usual := {role: name for role, of_role in NAMES["own"].items() for name in of_role if name in arrays}:
            return usual
        groups = "damping campaign, which reads a group for each run, or " if any("/" in name for name in known) else ""
        expected = f"{groups}--column ROLE=NAME; it has {_list_known(known)}"
        raise InputError("no array has the name of a role", expected=expected)
    names = {role: _find_path(name, arrays) for role, name in stated.columns.items()}
    if (missing := next((name for name in names.values() if name not in arrays), None)) is not None:
        raise InputError(f"no array {describe_shortened(missing)!r}", expected=_list_known(known))
    if names.keys().isdisjoint(ABSCISSAS) and not stated.rate:
        names |= {role: role for role in ABSCISSAS if known.get(role)}
    return names


def _describe_array(role: str, name: str, arrays: Sequence[Samples], stated: Stated, summary: Summary) -> None:
    """Say in the summary which array has a role, and its shape."""
    shape = " x ".join(str(n) for n in arrays[0].shape) or "1"
    many = f"{len(arrays)} of " if len(arrays) > 1 else ""
    source = "stated" if role in stated.columns else "by its name"
    summary.add(f"array {describe_shortened(name)!r}", f"{role}: {ROLES[role]} ({many}{shape})", source)


def _find_path(name: str, arrays: Mapping[str, Any]) -> str:
    """The path of an array that is named by its last part, if there is one alone; else the name."""
    ends = [path for path in arrays if path.split("/")[-1] == name]
    return ends[0] if len(ends) == 1 and name not in arrays else name


def _find_even_abscissa(
    read: Callable[[Sequence[str]], Arrays], contents: Arrays, main: str, stated: Stated, summary: Summary
) -> tuple[str, str, FloatArray, str] | None:
    """Role, name, values, unit of an even abscissa: by ``--rate``, else by a number near the array ``main``; or None.

    Of a complex response it is the frequency, by its increment.
    """
    signal, known, first = contents.arrays[main][0], contents.known, contents.first
    length, is_spectrum = max(signal.shape, default=1), np.iscomplexobj(signal)
    if stated.rate is not None:
        if sampling := [array for array in known if last_name(array) in SAMPLING]:
            summary.note(f"--rate {stated.rate:g} is stated, beside {', '.join(sampling[:4])} in the file")
        return "time", f"--rate {stated.rate:g}", list_times("fs", stated.rate, length, first), ""
    kinds = NAMES["rate"]["increment"] if is_spectrum else SAMPLING
    name = find_nearest([one for one in known if math.prod(known[one]) == 1 and last_name(one) in kinds], main)
    if name is None:
        return None
    beside = [one for one in known if split(one)[:-1] == split(name)[:-1]]
    starts = [one for one in beside if last_name(one) in NAMES["rate"]["start"]]
    starts = starts if last_name(name) in NAMES["rate"]["increment"] else []
    numbers = read([name, *starts])
    step, *origins = (float(numbers.arrays[one][0].real.reshape(-1)[0]) for one in [name, *starts])
    text = numbers.units.get(name, "")
    if last_name(name) in NAMES["rate"]["rate"]:
        step, text = step * ABSCISSAS["frequency"].get(text.lower(), 1.0), ""
    values = list_times(name, step, length, first)
    return "frequency" if is_spectrum else "time", name, (origins[-1] if origins else 0.0) + values, text


def _list_sweeps(
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
        raise InputError(f"no channel {describe_shortened(asked or '')!r}", expected=_list_known(contents.known))
    steps = {name: _find_step(name, contents, stated) for name in names}
    for name, (_, step) in steps.items():
        if stated.rate and (own := contents.steps.get(name, (0.0, 0.0))[1]):
            summary.note(f"--rate {stated.rate:g} is stated, beside a step of {own:g} s in the file")
        description = f"{contents.arrays[name][0].size} samples, step {step:g} s"
        summary.add(f"channel {describe_shortened(name)!r}", description, "found in the file")
    headers = {name: _read_header(name, contents) for name in names}
    kinds = {find_powers(header.unit) for header in headers.values() if header.unit and not stated.units}
    if len(kinds) > 1:
        listed = ", ".join(f"{name} ({contents.units.get(name, 'no unit')})" for name in names[:8])
        raise InputError(f"channels of several kinds: {listed}", expected="--column response=NAME")
    series = []
    for name, (start, step) in steps.items():
        values = np.asarray(contents.arrays[name][0], dtype=np.float64).reshape(-1)
        header = headers[name]
        facts = FileFacts(units={"response": header.unit} if header.unit else {}, scaling=header.scaling)
        t = np.arange(contents.first, contents.first + len(values), dtype=np.float64)
        t *= step  # in place: a file may have many samples
        t += start
        series.append(Series(name, t, values, is_time=True, has_phase=False, facts=facts))
    return series


def _find_step(name: str, contents: Arrays, stated: Stated) -> tuple[float, float]:
    """Start and step of a channel, s; a stated rate takes precedence. InputError: there is neither."""
    if name not in contents.steps and stated.rate is None:
        raise InputError(f"channel {name!r} has no time step", expected="--rate HZ, or --column response=NAME")
    start, step = contents.steps.get(name, (0.0, 0.0))
    return start, step if stated.rate is None else 1.0 / stated.rate


def _list_known(known: Shapes) -> str:
    listed = ", ".join(f"{name} ({' x '.join(map(str, shape)) or '1'})" for name, shape in list(known.items())[:12])
    return listed or "arrays of numbers"
