"""Files of a campaign to runs: level, drive and sensors from labels, units, groups and channels.

A universal file has them in ID lines, points and units; an HDF5 file in one group per run; a table of time histories in
one file per run. A drive in time is tracked block by block, so that a file of any size takes the memory of a block.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from damping.campaign.runs import (
    DRIVE,
    LABEL_AGREES,
    LEVEL,
    CampaignRun,
    Channel,
    Corrections,
    find_level,
    keep_common_sensors,
    summarise_runs,
)
from damping.campaign.sensors import EXPLAINED, SCALINGS
from damping.campaign.tracked import OTHERWISE, Source, read_table
from damping.errors import InputError, naming
from damping.formats.arrays import Arrays, read_arrays, read_blocks
from damping.formats.headers import ROLE_NAMES
from damping.formats.quantity import find_powers, unit
from damping.formats.series import Summary
from damping.formats.uff import Function, read_functions
from damping.records.text import name_apart, read_bytes, read_start
from damping.signals.windows import UNEVEN

SAMPLES = 2_000_000  #: samples of all channels that are read together
#: A level in an ID line, with the word for it: it differs between runs and is not part of a sensor's name.
OF_LEVEL = re.compile(rf"(?:\b[Ll]evel\s*[:=]?\s*)?{LEVEL.pattern}")
_NO_LEVEL = "one run"  # the run of functions whose ID lines name no level
#: Names of numbered drive channels, such as ``force_1``.
NUMBERED = re.compile(r"(?i)(?:^|[\W_])(?:control|drive|base|input|force|shaker)[ _-]?\d+$")
LOOKED_AT = 100_000  #: first bytes of a table from which its layout is determined


def read_runs(
    files: Sequence[Path], max_size: int, corrections: Corrections | None = None
) -> tuple[list[CampaignRun], Summary]:
    """The corrected runs of some files, lowest level first, with their common sensors, and a summary.

    InputError: a file that cannot be read or contains no runs, with what is expected; a correction of an unknown run or
    channel; no sensor common to all runs.
    """
    summary, stated = Summary(), corrections or Corrections()
    runs: list[CampaignRun] = []
    channels: set[str] = set()
    for file in files:
        with naming(file):
            runs += _read(Source(Path(file), max_size, stated, summary, channels))
    runs = [replace(run, label=label) for run, label in zip(runs, name_apart(r.label for r in runs), strict=True)]
    stated.require_known([run.label for run in runs], channels)
    out = {label for label, level in stated.levels.items() if level is None}
    runs = [replace(run, level=stated.levels.get(run.label, run.level)) for run in runs if run.label not in out]
    if not runs:
        raise InputError("every run is left out", file=stated.source or None, expected="one at least")
    if len({run.is_time for run in runs}) > 1:
        raise InputError("free decays beside sweeps", expected="files of one kind")
    runs = sorted(runs, key=lambda run: run.level or 0.0)
    summarise_runs(runs, summary)
    _compare_labels([run for run in runs if run.label not in stated.levels], summary)
    return keep_common_sensors(runs), summary


def _compare_labels(runs: Sequence[CampaignRun], summary: Summary) -> None:
    """Note a caution if the drives of all runs read one factor times the levels in their labels."""
    labelled = [(run, find_level(run.label.replace("_", " "))) for run in runs]
    pairs = [(run, level) for run, level in labelled if run.level and level and level[0] > 0.0]
    alike = [unit(level[1]).powers == unit(run.drive_unit).powers for run, level in pairs]
    if len(pairs) < 2 or len(pairs) < len(runs) or not all(alike):
        return
    times = [float(run.level or 0.0) * unit(run.drive_unit).factor / (of * unit(u).factor) for run, (of, u) in pairs]
    if max(times) > (1.0 + LABEL_AGREES) * min(times) or min(abs(k - 1.0) for k in times) <= LABEL_AGREES:
        return
    causes = ((k, f" ({said})") for k, said in SCALINGS.items() if "of the drive" not in said)
    cause = next((said for k, said in causes if abs(times[0] / k - 1.0) < EXPLAINED), "")
    right = "its unit, scaling or gain (--correct: unit or scale of its channel), or the labels"
    summary.note(f"caution: in every run the drive reads {times[0]:.3g} times the level in the label{cause}: {right}")


def _read(source: Source) -> list[CampaignRun]:
    start = read_start(source.file, LOOKED_AT)
    kind = "tdms" if start.startswith(b"TDSm") else "hdf5" if start.startswith(b"\x89HDF") else ""
    if kind:
        contents = read_arrays(source.file, kind, [], None, rows=(0, 1))
        if kind == "tdms" and not contents.steps:
            expected = f"channels with a time step (wf_increment); {OTHERWISE} against frequency"
            raise InputError("channels without a time step", expected=expected)
        return _list_channel_runs(source, kind, contents) if contents.steps else _list_group_runs(source, contents)
    if start.lstrip()[:2] != b"-1":
        return [read_table(source, start)]
    functions = read_functions(read_bytes(source.file, source.most), source.summary)
    return [_join_functions(label, group, source) for label, group in _group_functions(functions).items()]


def _group_functions(functions: Sequence[Function]) -> dict[str, list[Function]]:
    """Functions of a universal file by level: that in the first ID line, else in another ID line of all functions.

    The other line must distinguish functions of the same title and place, or contain one level and nothing else.
    """
    places = [(f.of.title, f.of.place, f.of.function, f.of.quantity) for f in functions]
    labels = [_label_level(f.of.title) for f in functions]
    further = zip(*(f.of.notes for f in functions), strict=True) if set(labels) == {_NO_LEVEL} else ()
    for lines in further:
        in_line = [_label_level(line) for line in lines]
        bare = len(set(in_line)) == 1 and all(OF_LEVEL.fullmatch(line) for line in lines)
        apart = len(set(zip(in_line, places, strict=True))) == len(functions) > len(set(places))
        if _NO_LEVEL not in in_line and (bare or apart):
            labels = in_line
            break
    groups: dict[str, list[Function]] = {}
    for label, function in zip(labels, functions, strict=True):
        groups.setdefault(label, []).append(function)
    return groups


def _label_level(text: str) -> str:
    """The label of a run, from the level in a text."""
    level = find_level(text)
    return f"{level[0]:g} {level[1]}" if level else _NO_LEVEL


def _name_functions(group: Sequence[Function]) -> list[str]:
    """Names of channels: first ID lines without their level where unique.

    Of the others, second ID lines if every one has its own, else response entities if so, else points of responses.
    """
    titles = [_drop_level(function.of.title) for function in group]
    is_name = [
        bool(title) and (titles.count(title) == 1 or bool(not f.of.per and DRIVE.search(title)))
        for title, f in zip(titles, group, strict=True)
    ]
    others = [f.of for f, named in zip(group, is_name, strict=True) if not named]
    candidates = ([_drop_level(of.notes[0]) for of in others], [of.entity for of in others])
    distinct = (names for names in candidates if all(names) and len(set(names)) == len(names) > 1)
    further = iter(next(distinct, [of.point for of in others]))
    return [title if named else next(further) for title, named in zip(titles, is_name, strict=True)]


def _drop_level(line: str) -> str:
    """An ID line without the level in it."""
    return " ".join(OF_LEVEL.sub("", line, count=1).split()).strip(" ,;:")


def _join_functions(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    """The run of some functions of a universal file: of frequency, or of time (tracked if one is the drive)."""
    if not any(function.of.is_time for function in group):
        return _read_spectra(label, group, source)
    units = [(name, f.of.numerator.unit) for name, f in zip(_name_functions(group), group, strict=True)]
    t = group[0].x
    if not all(function.of.is_time and len(function.x) == len(t) and np.allclose(function.x, t) for function in group):
        raise InputError(f"{label}: functions of time of several lengths", expected="one list of times")
    samples = [np.asarray(function.y).real for function in group]
    drive = source.stated.choose_drive(dict(units))
    if drive is None:
        return source.make_decay(label, t, units, samples)
    step = float(t[-1] - t[0]) / (len(t) - 1)
    return source.track(label, units, drive, step, [np.array(samples)])


def _read_spectra(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    stated = source.stated
    drives: list[tuple[str, Function]] = []
    sensors: list[tuple[str, Function]] = []
    for name, f in zip(_name_functions(group), group, strict=True):
        source.channels.add(name)
        if stated.of(name).role != "out":
            is_drive = not f.of.per and (f.of.quantity == "force" or stated.is_drive(name))
            (drives if is_drive else sensors).append((name, f))
    ratio = bool(sensors) and bool(sensors[0][1].of.per)
    if not sensors or (not drives and not ratio):
        what = "no response" if not sensors else "neither a control channel nor a ratio to the drive"
        raise InputError(f"{label}: {what}", expected="a channel named control, drive, base or force")
    x = sensors[0][1].x
    if any(len(f.x) != len(x) or not np.allclose(f.x, x, rtol=1e-4, atol=0.0) for _, f in (*drives, *sensors)):
        raise InputError(f"{label}: channels at different frequencies", expected="one list of frequencies")
    source.note_scaling(text for f in group for text in (f.of.title, *f.of.notes))
    level, made = find_level(label), []
    for name, sensor in sensors:
        of, samples = sensor.of, np.asarray(sensor.y)
        known = {"per_drive": bool(of.per), "at_drive": of.per == "force" and of.response_point == of.reference_point}
        made.append(source.make_channel(name, of.numerator.unit, samples, of.quantity, **known))
    channels = tuple(filter(None, made))
    if ratio:
        per = sensors[0][1].of.denominator.unit
        if level is None or not level[0] > 0.0 or find_powers(per or level[1]) != find_powers(level[1]):
            expected = f"that of the drive{f' (in {per})' if per else ''} in an ID line, such as 0.5 g or 2 N"
            raise InputError("functions without a level", expected=expected)
        drive_unit = per or level[1]
        size = level[0] * (unit(level[1]).factor / unit(drive_unit).factor)
        drive = np.full(len(x), size, dtype=complex)
        return source.leave_flat(CampaignRun(label, size, drive_unit, x, drive, channels))
    if len(drives) > 1 and any(f.of.is_force for _, f in drives):
        names = ", ".join(name for name, _ in drives[:4])
        expected = "one force, or controls of one base (--correct: role = 'out' of the others)"
        raise InputError(f"{label}: {len(drives)} drives, {names}", expected=expected)
    control = stated.join_controls([f.y * stated.of(name).scale for name, f in drives])
    drive_unit = stated.of(drives[0][0]).unit or drives[0][1].of.numerator.unit or "g"
    return source.set_level(source.leave_flat(CampaignRun(label, None, drive_unit, x, control, channels)), label)


def _list_group_runs(source: Source, contents: Arrays) -> list[CampaignRun]:
    """Runs of an HDF5 file of plain arrays: every group with a frequency or times, a drive and other arrays."""
    groups: dict[str, dict[str, str]] = {}
    for path in contents.known:
        group, _, leaf = path.rpartition("/")
        groups.setdefault(group, {})[leaf] = path
    runs = []
    for group, paths in groups.items():
        x = next((leaf for leaf in paths if leaf.lower() in ROLE_NAMES["frequency"]), None)
        drive = next((leaf for leaf in paths if source.stated.is_drive(leaf)), None)
        t = next((leaf for leaf in paths if leaf.lower() in ROLE_NAMES["time"]), None)
        like = [path for path in paths.values() if t and contents.known[path] == contents.known[paths[t]]]
        if t and drive and not x and paths[drive] in like:
            runs.append(_track_group(source, group, paths[t], drive, like))
        if x and drive and len(paths) > 2:
            runs.append(_group_run(source, group, x, drive, paths))
    if not runs:
        drives = max(([leaf for leaf in paths if NUMBERED.search(leaf)] for paths in groups.values()), key=len)
        if len(drives) > 1:
            expected = "one, named control or force (--correct: role = 'drive' of one, 'out' of the others)"
            raise InputError(f"a run with {len(drives)} drives, {', '.join(drives[:4])}", expected=expected)
        has = f"it has {', '.join(list(contents.known)[:8])}"
        raise InputError("no runs", expected=f"groups with frequency, control (or force) and responses; {has}")
    return runs


def _group_run(source: Source, group: str, x: str, drive: str, paths: Mapping[str, str]) -> CampaignRun:
    """The run of a group with a frequency, a drive and complex spectra, named as in the group."""
    stated = source.stated.of(drive)
    contents = read_arrays(source.file, "hdf5", list(paths.values()), source.most)
    f = contents.arrays[paths[x]][0].real.reshape(-1)
    level = find_level(group.replace("_", " "))
    of_drive = contents.units.get(paths[drive], "")
    source.note_scaling(paths.values())
    channels: list[Channel] = []
    source.channels.add(drive)
    for leaf, path in paths.items():
        if leaf in (x, drive) or path not in contents.arrays:
            continue
        values = contents.arrays[path][0]
        rows = np.atleast_2d(values if values.ndim == 2 and values.shape[1] == len(f) else values.T)
        if rows.shape[1] != len(f) or not np.iscomplexobj(rows):
            what = f"{path} is skipped: no complex spectra at {len(f)} frequencies"
            source.summary.note(f"{source.file.name}: {what}")
            source.channels.add(leaf)
            continue
        text = contents.units.get(path, "") or of_drive or (level[1] if level else "")
        names = [leaf] if len(rows) == 1 else [f"{leaf}[{k}]" for k in range(len(rows))]
        channels += filter(None, (source.make_channel(name, text, row) for name, row in zip(names, rows, strict=True)))
    drive_unit = stated.unit or of_drive or (level[1] if level else channels[0].unit if channels else "")
    values = contents.arrays[paths[drive]][0] * stated.scale
    rows = np.atleast_2d(values if values.shape[-1] == len(f) else values.T)
    control = source.stated.join_controls(list(rows))
    return source.set_level(source.leave_flat(CampaignRun(group, None, drive_unit, f, control, tuple(channels))), group)


def _track_group(source: Source, group: str, t: str, drive: str, paths: Sequence[str]) -> CampaignRun:
    """The run of a group with times (at the path ``t``), a drive and responses of one length."""
    first = read_arrays(source.file, "hdf5", paths, None, rows=(0, 1000))
    step = np.diff(first.arrays[t][0].real.reshape(-1))
    if not len(step) or not np.all(np.abs(step / np.mean(step) - 1.0) < UNEVEN):
        raise InputError(f"{t} is not evenly spaced", expected="one step throughout, rising")
    units = {path: first.units.get(path, "") for path in paths if path != t}
    blocks = read_blocks(source.file, "hdf5", list(units), max(SAMPLES // len(units), 1), together=False)
    named = [(path.rpartition("/")[2], text) for path, text in units.items()]
    return source.track(group or source.file.stem, named, drive, float(np.mean(step)), blocks)


def _list_channel_runs(source: Source, kind: str, contents: Arrays) -> list[CampaignRun]:
    """Runs of a file of channels with a time step, one for each group: tracked, or free decays."""
    groups: dict[str, list[str]] = {}
    for path in contents.steps:
        groups.setdefault(path.rpartition("/")[0], []).append(path)
    runs = []
    for group, paths in groups.items():
        label = group or source.file.stem
        units = [(path.rpartition("/")[2], contents.units.get(path, "")) for path in paths]
        steps, sizes = {contents.steps[path] for path in paths}, {contents.known[path] for path in paths}
        if len(steps) > 1 or len(sizes) > 1:
            raise InputError(f"channels of {label} of several rates or lengths", expected="one for all")
        start, step = next(iter(steps))
        drive = source.stated.choose_drive(dict(units))
        if drive is None:
            arrays = read_arrays(source.file, kind, [], source.most).arrays
            t = np.asarray(start + step * np.arange(next(iter(sizes))[0]))
            runs.append(source.make_decay(label, t, units, [arrays[path][0].reshape(-1) for path in paths]))
        else:
            blocks = read_blocks(source.file, kind, paths, max(SAMPLES // len(contents.known), 1), together=True)
            runs.append(source.track(label, units, drive, step, blocks))
    return runs
