"""Files of a campaign to runs: which level, which drive, which sensors, found in labels, units, groups and channels.

A universal file says it in ID lines, points and units; an HDF5 file in a group a run; a table of time in a file a run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from damping.campaign.runs import (
    CampaignRun,
    Channel,
    Corrections,
    correct_run,
    describe_quantity,
    find_level,
    is_drive,
    set_level,
)
from damping.campaign.tracked import (
    LOOKED_AT,
    TIMES,
    find_channels,
    find_table,
    name_function,
    read_histories,
    track_channels,
    track_group,
    track_table,
)
from damping.errors import InputError
from damping.formats.arrays import read_arrays
from damping.formats.columns import read_columns
from damping.formats.series import Samples, Summary
from damping.formats.uff import Function, read_functions
from damping.records.text import describe_shortened, read_bytes

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
    runs = [run for file in files for run in _read(Path(file), max_size, summary, stated)]
    drives = [name for name, channel in stated.channels.items() if channel.role == "drive"]
    stated.require_known([run.label for run in runs], [*drives, *(one.name for run in runs for one in run.channels)])
    runs = [correct_run(run, stated) for run in runs if stated.levels.get(run.label, 0.0) is not None]
    if not runs:
        raise InputError("every run is left out", file=stated.source or None, expected="one at least")
    if len({run.is_time for run in runs}) > 1:
        raise InputError("free decays beside sweeps", expected="files of one kind")
    runs = sorted(runs, key=lambda run: run.level or 0.0)
    _described(runs, summary)
    return runs, summary


def _join_controls(values: Sequence[Samples], control: str) -> Samples:
    """One drive (n,) of several control channels: their average, or at each row the one that is largest."""
    stacked = np.array(values)
    if control == "average":
        return np.asarray(np.mean(stacked, axis=0))
    return np.asarray(np.take_along_axis(stacked, np.argmax(np.abs(stacked), axis=0)[None], axis=0)[0])


def _read(file: Path, max_size: int, summary: Summary, stated: Corrections) -> list[CampaignRun]:
    start = _read_start(file)
    kind = "tdms" if start.startswith(b"TDSm") else "hdf5" if start.startswith(b"\x89HDF") else ""
    channels = find_channels(file, kind) if kind else None
    if channels is not None:
        return track_channels(channels, file, kind, max_size, summary, stated)
    if kind:
        return _list_hdf(file, max_size, summary, stated)
    if start.lstrip()[:2] == b"-1":
        return _list_functions(read_functions(read_bytes(file, max_size), file, summary), file, summary, stated)
    table = find_table(start)
    drive = next((h.name for h in table[1] if is_drive(h.name, stated)), None) if table else None
    if table and drive:
        run = track_table(file, *table, drive, stated)
        return [set_level(run, find_level(file.stem.replace("_", " ")), file, summary)]
    return [_read_decay(read_bytes(file, max_size), file, summary)]


def _read_start(file: Path) -> bytes:
    """The first bytes of a file."""
    try:
        with file.open("rb") as stream:
            return stream.read(LOOKED_AT)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None


def _list_functions(
    functions: Sequence[Function], file: Path, summary: Summary, stated: Corrections
) -> list[CampaignRun]:
    """Runs of a universal file: functions of one level in their ID lines belong together."""
    groups: dict[str, list[Function]] = {}
    for function in functions:
        level = find_level(function.title)
        groups.setdefault(f"{level[0]:g} {level[1]}" if level else "one run", []).append(function)
    return [_function_run(label, group, file, summary, stated) for label, group in groups.items()]


def _function_run(
    label: str, group: Sequence[Function], file: Path, summary: Summary, stated: Corrections
) -> CampaignRun:
    if any(one.is_time for one in group):
        return read_histories(label, group, file, summary, stated)
    drives = [one for one in group if not one.per and (one.quantity == "force" or is_drive(name_function(one), stated))]
    sensors = [one for one in group if not any(one is drive for drive in drives)]
    ratio = bool(sensors) and bool(sensors[0].per)
    if not sensors or (not drives and not ratio):
        what = "no response" if not sensors else "neither a control channel nor a ratio to the drive"
        raise InputError(f"{label}: {what}", file=file, expected="a channel named control, drive, base or force")
    x = sensors[0].x
    if any(len(one.x) != len(x) or not np.allclose(one.x, x, rtol=1e-4, atol=0.0) for one in group):
        raise InputError(f"{label}: channels at different frequencies", file=file, expected="one list of frequencies")
    drive_unit = sensors[0].units[1] if ratio else drives[0].units[0]
    level = find_level(label)
    channels = [_channel(sensor) for sensor in sensors]
    if ratio:
        if level is None:
            raise InputError(
                "functions without a level", file=file, expected="the level in the ID line, such as 0.5 g or 2 N"
            )
        run = CampaignRun(label, level[0], level[1], x, np.full(len(x), level[0], dtype=complex), tuple(channels))
        return run if drive_unit in ("", level[1]) else replace(run, drive_unit=drive_unit)
    drive = _join_controls([one.y * stated.of(name_function(one)).scale for one in drives], stated.control)
    drive_unit = stated.of(name_function(drives[0])).unit or drive_unit
    return set_level(CampaignRun(label, None, drive_unit or "g", x, drive, tuple(channels)), level, file, summary)


def _channel(function: Function) -> Channel:
    name = name_function(function)
    quantity = function.quantity or describe_quantity(function.units[0], name)
    return Channel(
        name,
        quantity,
        function.units[0],
        np.asarray(function.y),
        bool(function.per),
        function.per == "force" and function.response == function.reference,
    )


def _list_hdf(file: Path, max_size: int, summary: Summary, stated: Corrections) -> list[CampaignRun]:
    """Runs of an HDF5 file: every group with a frequency, a drive and other arrays."""
    known = read_arrays(file, "hdf5", [], None).known
    groups: dict[str, list[str]] = {}
    for name in known:
        group, _, leaf = name.rpartition("/")
        groups.setdefault(group, []).append(leaf)
    runs = []
    for group, leaves in groups.items():
        x = next((leaf for leaf in leaves if leaf.lower() in _FREQUENCIES), None)
        drive = next((leaf for leaf in leaves if is_drive(leaf, stated)), None)
        t = next((leaf for leaf in leaves if leaf.lower() in TIMES), None)
        if t and drive and not x:
            runs.append(track_group(file, group, t, drive, leaves, known, summary, stated))
        if x and drive and len(leaves) > 2:
            runs.append(_group_run(file, group, x, drive, leaves, max_size, summary, stated))
    if not runs:
        listed = ", ".join(list(known)[:8])
        expected = f"groups with frequency, control (or force) and responses; it has {listed}"
        raise InputError("no runs", file=file, expected=expected)
    return runs


def _group_run(
    file: Path,
    group: str,
    x: str,
    drive: str,
    leaves: Sequence[str],
    max_size: int,
    summary: Summary,
    stated: Corrections,
) -> CampaignRun:
    path = {leaf: f"{group}/{leaf}".lstrip("/") for leaf in leaves}
    arrays = read_arrays(file, "hdf5", list(path.values()), max_size)
    f = arrays.arrays[path[x]][0].real.reshape(-1)
    units = {leaf: arrays.units.get(path[leaf], "") for leaf in leaves}
    level = find_level(group.replace("_", " "))
    channels: list[Channel] = []
    for leaf in leaves:
        if leaf in (x, drive) or path[leaf] not in arrays.arrays:
            continue
        values = arrays.arrays[path[leaf]][0]
        rows = values if values.ndim == 2 and values.shape[1] == len(f) else values.T
        rows = np.atleast_2d(rows)
        if rows.shape[1] != len(f) or not np.iscomplexobj(rows):
            summary.note(f"{file.name}: {path[leaf]} is passed over: no complex spectra at {len(f)} frequencies")
            continue
        of = units[leaf] or units[drive] or (level[1] if level else "")
        for k, row in enumerate(rows):
            name = leaf if len(rows) == 1 else f"{leaf}[{k}]"
            channels.append(Channel(name, describe_quantity(of, leaf), of, row))
    drive_unit = units[drive] or (level[1] if level else channels[0].unit if channels else "")
    values = arrays.arrays[path[drive]][0] * stated.of(drive).scale
    rows = values if values.shape[-1] == len(f) else values.T
    values = _join_controls(list(np.atleast_2d(rows)), stated.control)
    drive_unit = stated.of(drive).unit or drive_unit
    run = CampaignRun(group, None, drive_unit, f, values, tuple(channels))
    return set_level(run, level, file, summary)


def _read_decay(data: bytes, file: Path, summary: Summary) -> CampaignRun:
    """The run of a table of motions against time: a free decay."""
    table = find_table(data[:LOOKED_AT])
    headers = table[1] if table else []
    time = next((h for h in headers if h.name.lower() in TIMES), None)
    sensors = [h for h in headers if h is not time and h.text]
    if time is None or not sensors:
        first = data[:LOOKED_AT].decode("utf-8-sig", errors="replace").partition("\n")[0]
        expected = "a column of time beside columns of motion, a universal file, or HDF5 with a group a run"
        raise InputError(f"columns {describe_shortened(first, 80)}", file=file, expected=expected)
    mapped = {"time": time.text} | {f"sensor {k}": header.text for k, header in enumerate(sensors)}
    columns = read_columns(data, file, mapped, {})
    channels = []
    for k, header in enumerate(sensors):
        of = header.unit.replace("m/s2", "m/s^2")
        channels.append(Channel(header.name, describe_quantity(of, header.name), of, columns.numbers[f"sensor {k}"]))
    return CampaignRun(file.stem, None, "", columns.numbers["time"], None, tuple(channels), is_time=True)


def _described(runs: Sequence[CampaignRun], summary: Summary) -> None:
    """A row a run and a row a channel: what can be corrected, by the names that a correction uses."""
    for run in runs:
        drive = "free decay" if run.is_time else f"level {run.level:g} {run.drive_unit}"
        kind = "" if run.is_time else (", base drive" if run.is_base_driven else ", driven by a force")
        span = f"{run.x[0]:g} to {run.x[-1]:g} {'s' if run.is_time else 'Hz'}, {len(run.x)} rows"
        summary.add(f"run {run.label!r}", f"{drive}{kind}; {span}; {len(run.channels)} sensors", "found in the file")
    for one in {channel.name: channel for run in runs for channel in run.channels}.values():
        ratio = ", per drive" if one.per_drive else ""
        text = f"sensor of {one.quantity}{ratio} in {one.unit or 'no unit'}"
        summary.add(f"channel {one.name!r}", text, "found in the file")
