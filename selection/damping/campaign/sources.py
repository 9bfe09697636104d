"""Files of a campaign to runs: which level, which drive, which sensors, found in labels, units, groups and channels.

A universal file says it in ID lines, points and units; an HDF5 file in a group a run; a table of time in a file a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from damping.campaign.runs import (
    CampaignRun,
    Channel,
    Corrections,
    Source,
    correct_run,
    describe_quantity,
    find_level,
    is_drive,
)
from damping.campaign.tracked import (
    LOOKED_AT,
    TIMES,
    find_channels,
    find_table,
    make_decay,
    name_function,
    read_histories,
    track_channels,
    track_group,
    track_table,
)
from damping.errors import InputError, naming
from damping.formats import Samples, Summary
from damping.formats.arrays import read_arrays
from damping.formats.columns import read_columns
from damping.formats.uff import Function, read_functions
from damping.records.text import describe_shortened, read_bytes, read_start

_FREQUENCIES = ("frequency", "freq", "f")


def read_runs(
    files: Sequence[Path], max_size: int, corrections: Corrections | None = None
) -> tuple[list[CampaignRun], Summary]:
    """The runs of some files, lowest level first, as corrected, and what was understood.

    Raises:
        InputError: a file that cannot be read, or in which no runs are found, with what is expected; a correction of
            what is not there.
    """
    summary, stated = Summary(), corrections or Corrections()
    runs: list[CampaignRun] = []
    for file in files:
        with naming(file):
            runs += _read(Source(Path(file), max_size, stated, summary))
    drives = [name for name, channel in stated.channels.items() if channel.role == "drive"]
    sensors = [channel.name for run in runs for channel in run.channels]
    stated.require_known([run.label for run in runs], [*drives, *sensors])
    runs = [correct_run(run, stated) for run in runs if stated.levels.get(run.label, 0.0) is not None]
    if not runs:
        raise InputError("every run is left out", file=stated.source or None, expected="one at least")
    if len({run.is_time for run in runs}) > 1:
        raise InputError("free decays beside sweeps", expected="files of one kind")
    runs = sorted(runs, key=lambda run: run.level or 0.0)
    _summarise(runs, summary)
    return runs, summary


def _join_controls(values: Sequence[Samples], control: str) -> Samples:
    """One drive (n,) of several control channels: their average, or at each row the one that is largest."""
    stacked = np.array(values)
    if control == "average":
        return np.asarray(np.mean(stacked, axis=0))
    return np.asarray(np.take_along_axis(stacked, np.argmax(np.abs(stacked), axis=0)[None], axis=0)[0])


def _read(source: Source) -> list[CampaignRun]:
    start = read_start(source.file, LOOKED_AT)
    kind = "tdms" if start.startswith(b"TDSm") else "hdf5" if start.startswith(b"\x89HDF") else ""
    channels = find_channels(source, kind) if kind else None
    if channels is not None:
        return track_channels(channels, source, kind)
    if kind:
        return _list_hdf(source)
    if start.lstrip()[:2] == b"-1":
        functions = read_functions(read_bytes(source.file, source.most), source.summary)
        return _list_functions(functions, source)
    table = find_table(start)
    drive = next((h.name for h in table[1] if is_drive(h.name, source.stated)), None) if table else None
    return [track_table(source, *table, drive) if table and drive else _read_decay(source)]


def _list_functions(functions: Sequence[Function], source: Source) -> list[CampaignRun]:
    """Runs of a universal file: functions of one level in their ID lines belong together."""
    groups: dict[str, list[Function]] = {}
    for function in functions:
        level = find_level(function.title)
        groups.setdefault(f"{level[0]:g} {level[1]}" if level else "one run", []).append(function)
    return [_function_run(label, group, source) for label, group in groups.items()]


def _function_run(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    stated = source.stated
    if any(function.is_time for function in group):
        return read_histories(label, group, source)
    drives = [f for f in group if not f.per and (f.quantity == "force" or is_drive(name_function(f), stated))]
    sensors = [function for function in group if not any(function is drive for drive in drives)]
    ratio = bool(sensors) and bool(sensors[0].per)
    if not sensors or (not drives and not ratio):
        what = "no response" if not sensors else "neither a control channel nor a ratio to the drive"
        raise InputError(f"{label}: {what}", expected="a channel named control, drive, base or force")
    x = sensors[0].x
    if any(len(f.x) != len(x) or not np.allclose(f.x, x, rtol=1e-4, atol=0.0) for f in group):
        raise InputError(f"{label}: channels at different frequencies", expected="one list of frequencies")
    level, channels = find_level(label), tuple(_channel(sensor) for sensor in sensors)
    if ratio:
        if level is None or not level[0] > 0.0:
            raise InputError("functions without a level", expected="the level in the ID line, such as 0.5 g or 2 N")
        drive_unit = sensors[0].units[1] or level[1]
        return CampaignRun(label, level[0], drive_unit, x, np.full(len(x), level[0], dtype=complex), channels)
    drive = _join_controls([f.y * stated.of(name_function(f)).scale for f in drives], stated.control)
    drive_unit = stated.of(name_function(drives[0])).unit or drives[0].units[0] or "g"
    return source.set_level(CampaignRun(label, None, drive_unit, x, drive, channels), label)


def _channel(function: Function) -> Channel:
    name, text = name_function(function), function.units[0]
    quantity = function.quantity or describe_quantity(text, name)
    at_drive = function.per == "force" and function.response == function.reference
    return Channel(name, quantity, text, np.asarray(function.y), bool(function.per), at_drive)


def _list_hdf(source: Source) -> list[CampaignRun]:
    """Runs of an HDF5 file: every group with a frequency, a drive and other arrays."""
    known = read_arrays(source.file, "hdf5", [], None).known
    groups: dict[str, list[str]] = {}
    for name in known:
        group, _, leaf = name.rpartition("/")
        groups.setdefault(group, []).append(leaf)
    runs = []
    for group, leaves in groups.items():
        x = next((leaf for leaf in leaves if leaf.lower() in _FREQUENCIES), None)
        drive = next((leaf for leaf in leaves if is_drive(leaf, source.stated)), None)
        t = next((leaf for leaf in leaves if leaf.lower() in TIMES), None)
        if t and drive and not x:
            runs.append(track_group(source, group, t, drive, leaves, known))
        if x and drive and len(leaves) > 2:
            runs.append(_group_run(source, group, x, drive, leaves))
    if not runs:
        has = f"it has {', '.join(list(known)[:8])}"
        raise InputError("no runs", expected=f"groups with frequency, control (or force) and responses; {has}")
    return runs


def _group_run(source: Source, group: str, x: str, drive: str, leaves: Sequence[str]) -> CampaignRun:
    stated = source.stated.of(drive)
    path = {leaf: f"{group}/{leaf}".lstrip("/") for leaf in leaves}
    contents = read_arrays(source.file, "hdf5", list(path.values()), source.most)
    f = contents.arrays[path[x]][0].real.reshape(-1)
    units = {leaf: contents.units.get(path[leaf], "") for leaf in leaves}
    level = find_level(group.replace("_", " "))
    channels: list[Channel] = []
    for leaf in leaves:
        if leaf in (x, drive) or path[leaf] not in contents.arrays:
            continue
        values = contents.arrays[path[leaf]][0]
        rows = np.atleast_2d(values if values.ndim == 2 and values.shape[1] == len(f) else values.T)
        if rows.shape[1] != len(f) or not np.iscomplexobj(rows):
            what = f"{path[leaf]} is passed over: no complex spectra at {len(f)} frequencies"
            source.summary.note(f"{source.file.name}: {what}")
            continue
        text = units[leaf] or units[drive] or (level[1] if level else "")
        names = [leaf] if len(rows) == 1 else [f"{leaf}[{k}]" for k in range(len(rows))]
        channels += [
            Channel(name, describe_quantity(text, leaf), text, row) for name, row in zip(names, rows, strict=True)
        ]
    drive_unit = stated.unit or units[drive] or (level[1] if level else channels[0].unit if channels else "")
    values = contents.arrays[path[drive]][0] * stated.scale
    rows = np.atleast_2d(values if values.shape[-1] == len(f) else values.T)
    control = _join_controls(list(rows), source.stated.control)
    return source.set_level(CampaignRun(group, None, drive_unit, f, control, tuple(channels)), group)


def _read_decay(source: Source) -> CampaignRun:
    """The run of a table of motions against time: a free decay."""
    data = read_bytes(source.file, source.most)
    table = find_table(data[:LOOKED_AT])
    headers = table[1] if table else []
    time = next((h for h in headers if h.name.lower() in TIMES), None)
    sensors = [h for h in headers if h is not time and h.text]
    if time is None or not sensors:
        first = data[:LOOKED_AT].decode("utf-8-sig", errors="replace").partition("\n")[0]
        expected = "a column of time beside columns of motion, a universal file, or HDF5 with a group a run"
        raise InputError(f"columns {describe_shortened(first, 80)}", expected=expected)
    roles = [f"sensor {k}" for k in range(len(sensors))]
    mapped = {"time": time.text} | dict(zip(roles, (header.text for header in sensors), strict=True))
    numbers = read_columns(data, mapped, {}).numbers
    names, units = [header.name for header in sensors], [header.unit for header in sensors]
    return make_decay(source.file.stem, numbers["time"], names, units, [numbers[role] for role in roles])


def _summarise(runs: Sequence[CampaignRun], summary: Summary) -> None:
    """A row a run and a row a channel: what can be corrected, by the names that a correction uses."""
    for run in runs:
        drive = "free decay" if run.is_time else f"level {run.level:g} {run.drive_unit}"
        kind = "" if run.is_time else (", base drive" if run.is_base_driven else ", driven by a force")
        span = f"{run.x[0]:g} to {run.x[-1]:g} {'s' if run.is_time else 'Hz'}, {len(run.x)} rows"
        summary.add(f"run {run.label!r}", f"{drive}{kind}; {span}; {len(run.channels)} sensors", "found in the file")
    for channel in {channel.name: channel for run in runs for channel in run.channels}.values():
        ratio = ", per drive" if channel.per_drive else ""
        text = f"sensor of {channel.quantity}{ratio} in {channel.unit or 'no unit'}"
        summary.add(f"channel {channel.name!r}", text, "found in the file")
