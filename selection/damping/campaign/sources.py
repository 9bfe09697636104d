"""Files of a campaign to runs: which level, which drive, which sensors, found in labels, units, groups and channels.

A universal file says it in ID lines, points and units; an HDF5 file in a group a run; a table of time in a file a run.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from damping.arrays import STANDARD_GRAVITY_M_S2
from damping.campaign.runs import CampaignRun, Channel, Corrections, correct_run, describe_quantity
from damping.campaign.tracked import LOOKED_AT, UNEVEN, find_table, track_arrays, track_table
from damping.errors import InputError
from damping.formats.arrays import read_arrays
from damping.formats.columns import read_columns
from damping.formats.quantity import unit
from damping.formats.series import Samples, Summary
from damping.formats.uff import Function, read_functions
from damping.records.text import describe_shortened, read_bytes

_LEVEL = re.compile(r"(?<![\w.])(?:run[_ -]?)?(?:[A-Za-z]+\s*=\s*)?(\d+(?:\.\d+)?)[\s_]*(mN|kN|N|g|m/s\^?2)(?![\w/])")
_DRIVE = re.compile(r"(?i)\b(control|ctrl|drive|base|input|force|shaker|reference)\b")
_FREQUENCIES = ("frequency", "freq", "f")
_TIMES = ("time", "t", "zeit")
#: A control that is off from the level in its label by no more than this is that level.
LABEL_AGREES = 0.15


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


def _is_drive(name: str, stated: Corrections) -> bool:
    """Whether a channel is the drive: as stated, else by its name."""
    role = stated.of(name).role
    return role == "drive" or (not role and bool(_DRIVE.search(name)))


def _join_controls(values: Sequence[Samples], control: str) -> Samples:
    """One drive (n,) of several control channels: their average, or at each row the one that is largest."""
    stacked = np.array(values)
    if control == "average":
        return np.asarray(np.mean(stacked, axis=0))
    return np.asarray(np.take_along_axis(stacked, np.argmax(np.abs(stacked), axis=0)[None], axis=0)[0])


def _read(file: Path, max_size: int, summary: Summary, stated: Corrections) -> list[CampaignRun]:
    start = _read_start(file, max_size)
    if start.startswith(b"\x89HDF"):
        return _list_hdf(file, max_size, summary, stated)
    if start.lstrip()[:2] == b"-1":
        return _list_functions(read_functions(read_bytes(file, max_size), file, summary), file, summary, stated)
    table = find_table(start)
    drive = next((h.name for h in table[1] if _is_drive(h.name, stated)), None) if table else None
    if table and drive:
        run = track_table(file, *table, drive, stated)
        return [_levelled(run, _level(file.stem.replace("_", " ")), file, summary)]
    return [_table(read_bytes(file, max_size), file, summary)]


def _read_start(file: Path, max_size: int) -> bytes:
    """The first bytes of a file that may be read."""
    try:
        if file.stat().st_size > max_size:
            raise InputError(
                f"larger than {max_size} bytes", file=file, expected="a smaller file or a larger --max-size"
            )
        with file.open("rb") as stream:
            return stream.read(LOOKED_AT)
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", file=file) from None


def _level(text: str) -> tuple[float, str] | None:
    found = _LEVEL.search(text)
    return (float(found[1]), found[2].replace("m/s2", "m/s^2")) if found else None


def _list_functions(
    functions: Sequence[Function], file: Path, summary: Summary, stated: Corrections
) -> list[CampaignRun]:
    """Runs of a universal file: functions of one level in their ID lines belong together."""
    groups: dict[str, list[Function]] = {}
    for one in functions:
        level = _level(one.title)
        groups.setdefault(f"{level[0]:g} {level[1]}" if level else "one run", []).append(one)
    return [_function_run(label, group, file, summary, stated) for label, group in groups.items()]


def _function_run(
    label: str, group: Sequence[Function], file: Path, summary: Summary, stated: Corrections
) -> CampaignRun:
    if any(one.is_time for one in group):
        raise InputError("time histories in a universal file", file=file, expected="spectra or frequency responses")
    drives = [one for one in group if not one.per and (one.quantity == "force" or _is_drive(_name_of(one), stated))]
    sensors = [one for one in group if not any(one is drive for drive in drives)]
    ratio = bool(sensors) and bool(sensors[0].per)
    if not sensors or (not drives and not ratio):
        what = "no response" if not sensors else "neither a control channel nor a ratio to the drive"
        raise InputError(f"{label}: {what}", file=file, expected="a channel named control, drive, base or force")
    x = sensors[0].x
    if any(len(one.x) != len(x) or not np.allclose(one.x, x, rtol=1e-4, atol=0.0) for one in group):
        raise InputError(f"{label}: channels at different frequencies", file=file, expected="one list of frequencies")
    drive_unit = sensors[0].units[1] if ratio else drives[0].units[0]
    level = _level(label)
    channels = [_channel(one) for one in sensors]
    if ratio:
        if level is None:
            raise InputError(
                "functions without a level", file=file, expected="the level in the ID line, such as 0.5 g or 2 N"
            )
        run = CampaignRun(label, level[0], level[1], x, np.full(len(x), level[0], dtype=complex), tuple(channels))
        return run if drive_unit in ("", level[1]) else replace(run, drive_unit=drive_unit)
    drive = _join_controls([one.y * stated.of(_name_of(one)).scale for one in drives], stated.control)
    drive_unit = stated.of(_name_of(drives[0])).unit or drive_unit
    return _levelled(CampaignRun(label, None, drive_unit or "g", x, drive, tuple(channels)), level, file, summary)


def _name_of(one: Function) -> str:
    """Name of a channel: the ID line without its level."""
    found = _LEVEL.search(one.title)
    name = one.title[: found.start()] + one.title[found.end() :] if found else one.title
    return " ".join(name.split()) or f"node {one.response[0]}"


def _channel(one: Function) -> Channel:
    name = _name_of(one)
    quantity = one.quantity or describe_quantity(one.units[0], name)
    return Channel(
        name,
        quantity,
        one.units[0],
        np.asarray(one.y),
        bool(one.per),
        one.per == "force" and one.response == one.reference,
    )


def _levelled(run: CampaignRun, stated: tuple[float, str] | None, file: Path, summary: Summary) -> CampaignRun:
    """The run with its level: as the label says where the control agrees, else the median of the control.

    A control whose label is in g and whose values are that level in m/s^2 holds SI values under a label of g, as
    universal files may: values of every channel in g are then divided by g.
    """
    assert run.drive is not None
    measured = float(np.median(np.abs(run.drive)))
    if stated is None or unit(stated[1]).powers != unit(run.drive_unit).powers:
        return replace(run, level=measured)
    level = stated[0] * unit(stated[1]).factor / unit(run.drive_unit).factor
    if abs(measured / level - 1.0) <= LABEL_AGREES:
        return replace(run, level=level)
    if run.drive_unit == "g" and abs(measured / level / STANDARD_GRAVITY_M_S2 - 1.0) <= LABEL_AGREES:
        summary.note(
            f"{file.name}: values labelled g are in m/s^2 (the control of {run.label!r} says so): taken as such"
        )
        channels = tuple(
            replace(one, values=one.values / STANDARD_GRAVITY_M_S2) if one.unit == "g" else one for one in run.channels
        )
        return replace(run, level=level, drive=run.drive / STANDARD_GRAVITY_M_S2, channels=channels)
    summary.note(f"{file.name}: the control of {run.label!r} reads {measured:.3g} {run.drive_unit}, taken as its level")
    return replace(run, level=measured)


def _list_hdf(file: Path, max_size: int, summary: Summary, stated: Corrections) -> list[CampaignRun]:
    """Runs of an HDF5 file: every group with a frequency, a drive and other arrays."""
    known = read_arrays(file, "hdf5", [], max_size).known
    groups: dict[str, list[str]] = {}
    for name in known:
        group, _, leaf = name.rpartition("/")
        groups.setdefault(group, []).append(leaf)
    runs = []
    for group, leaves in groups.items():
        x = next((leaf for leaf in leaves if leaf.lower() in _FREQUENCIES), None)
        drive = next((leaf for leaf in leaves if _is_drive(leaf, stated)), None)
        t = next((leaf for leaf in leaves if leaf.lower() in _TIMES), None)
        if t and drive and not x:
            runs.append(_time_run(file, group, t, drive, leaves, known, max_size, summary, stated))
        if x and drive and len(leaves) > 2:
            runs.append(_group_run(file, group, x, drive, leaves, max_size, summary, stated))
    if not runs:
        listed = ", ".join(list(known)[:8])
        expected = f"groups with frequency, control (or force) and responses; it has {listed}"
        raise InputError("no runs", file=file, expected=expected)
    return runs


def _time_run(file: Path, group: str, t: str, drive: str, leaves: Sequence[str], known: Mapping[str, tuple[int, ...]],
              max_size: int, summary: Summary, stated: Corrections) -> CampaignRun:  # fmt: skip
    """The run of a group with times, a drive and responses of one length."""
    path = {leaf: f"{group}/{leaf}".lstrip("/") for leaf in leaves}
    like = [leaf for leaf in leaves if leaf != t and known[path[leaf]] == known[path[t]]]
    first = read_arrays(file, "hdf5", list(path.values()), max_size, rows=(0, 1000))
    times = first.arrays[path[t]][0].real.reshape(-1)
    step = np.diff(times)
    if not len(step) or not np.all(np.abs(step / np.mean(step) - 1.0) < UNEVEN):
        raise InputError(f"{path[t]} is not evenly spaced", file=file, expected="one step throughout, rising")
    units = {leaf: first.units.get(path[leaf], "") for leaf in leaves}
    run = track_arrays(file, group, drive, like, float(np.mean(step)), units, max_size, stated)
    return _levelled(run, _level((group or file.stem).replace("_", " ")), file, summary)


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
    found = read_arrays(file, "hdf5", list(path.values()), max_size)
    f = found.arrays[path[x]][0].real.reshape(-1)
    units = {leaf: found.units.get(path[leaf], "") for leaf in leaves}
    level = _level(group.replace("_", " "))
    channels: list[Channel] = []
    for leaf in leaves:
        if leaf in (x, drive) or path[leaf] not in found.arrays:
            continue
        values = found.arrays[path[leaf]][0]
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
    values = found.arrays[path[drive]][0] * stated.of(drive).scale
    rows = values if values.shape[-1] == len(f) else values.T
    values = _join_controls(list(np.atleast_2d(rows)), stated.control)
    drive_unit = stated.of(drive).unit or drive_unit
    run = CampaignRun(group, None, drive_unit, f, values, tuple(channels))
    return _levelled(run, level, file, summary)


def _table(data: bytes, file: Path, summary: Summary) -> CampaignRun:
    """The run of a table of motions against time: a free decay."""
    table = find_table(data[:LOOKED_AT])
    headers = table[1] if table else []
    time = next((h for h in headers if h.name.lower() in _TIMES), None)
    sensors = [h for h in headers if h is not time and h.text]
    if time is None or not sensors:
        first = data[:LOOKED_AT].decode("utf-8-sig", errors="replace").partition("\n")[0]
        expected = "a column of time beside columns of motion, a universal file, or HDF5 with a group a run"
        raise InputError(f"columns {describe_shortened(first, 80)}", file=file, expected=expected)
    mapped = {"time": time.text} | {f"sensor {k}": header.text for k, header in enumerate(sensors)}
    found = read_columns(data, file, mapped, {})
    channels = []
    for k, header in enumerate(sensors):
        of = header.unit.replace("m/s2", "m/s^2")
        channels.append(Channel(header.name, describe_quantity(of, header.name), of, found.numbers[f"sensor {k}"]))
    return CampaignRun(file.stem, None, "", found.numbers["time"], None, tuple(channels), is_time=True)


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
