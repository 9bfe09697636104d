"""Files of a campaign to runs: which level, which drive, which sensors, found in labels, units, groups and channels.

A universal file says it in ID lines, points and units; an HDF5 file in a group a run; a table of time in a file a run.
A drive in time is tracked some lines or samples at a time, so that a file of any size takes the memory of a block.
"""

import io
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.runs import (
    DRIVE,
    LEVEL,
    CampaignRun,
    Channel,
    Corrections,
    correct_run,
    describe_quantity,
    find_level,
    keep_common_sensors,
    summarise_runs,
)
from damping.campaign.tracked import Source
from damping.errors import InputError, naming
from damping.formats.arrays import Arrays, read_arrays, read_blocks
from damping.formats.columns import DELIMITERS, Layout, find_layout, read_columns
from damping.formats.headers import ABSCISSAS, ROLE_NAMES, ColumnHeader, parse_header
from damping.formats.series import Summary
from damping.formats.uff import Function, read_functions
from damping.records.text import describe_shortened, is_binary, name_apart, read_bytes, read_start, recode

BLOCK = 8_000_000  #: bytes of a table that are read together
SAMPLES = 2_000_000  #: samples of all channels that are read together
LOOKED_AT = 100_000  #: first bytes of a table by which its layout is told
UNEVEN = 0.02  #: steps of time that differ by more than this share of one are no even sampling


def read_runs(
    files: Sequence[Path], max_size: int, corrections: Corrections | None = None
) -> tuple[list[CampaignRun], Summary]:
    """The runs of some files, lowest level first, as corrected, with their common sensors, and what was understood.

    InputError: a file that cannot be read, or in which no runs are found, with what is expected; a correction of what
    is not there; no sensor that every run has.
    """
    summary, stated = Summary(), corrections or Corrections()
    runs: list[CampaignRun] = []
    for file in files:
        with naming(file):
            runs += _read(Source(Path(file), max_size, stated, summary))
    runs = [replace(run, label=label) for run, label in zip(runs, name_apart(r.label for r in runs), strict=True)]
    drives = [name for name, channel in stated.channels.items() if channel.role == "drive"]
    stated.require_known([run.label for run in runs], [*drives, *(name for run in runs for name in run.names)])
    runs = [correct_run(run, stated) for run in runs if stated.levels.get(run.label, 0.0) is not None]
    if not runs:
        raise InputError("every run is left out", file=stated.source or None, expected="one at least")
    if len({run.is_time for run in runs}) > 1:
        raise InputError("free decays beside sweeps", expected="files of one kind")
    runs = sorted(runs, key=lambda run: run.level or 0.0)
    summarise_runs(runs, summary)
    return keep_common_sensors(runs), summary


def _read(source: Source) -> list[CampaignRun]:
    start = read_start(source.file, LOOKED_AT)
    kind = "tdms" if start.startswith(b"TDSm") else "hdf5" if start.startswith(b"\x89HDF") else ""
    if kind:
        contents = read_arrays(source.file, kind, [], None, rows=(0, 1))
        return _list_channel_runs(source, kind, contents) if contents.steps else _list_group_runs(source, contents)
    if start.lstrip()[:2] != b"-1":
        return [_read_table(source, start)]
    groups: dict[str, list[Function]] = {}  # functions of a universal file with one level in their ID lines
    for function in read_functions(read_bytes(source.file, source.most), source.summary):
        level = find_level(function.of.title)
        groups.setdefault(f"{level[0]:g} {level[1]}" if level else "one run", []).append(function)
    return [_join_functions(label, group, source) for label, group in groups.items()]


def _name_functions(group: Sequence[Function]) -> list[str]:
    """Names of channels: the ID lines without their level; the points of responses that these do not tell apart."""
    titles = [" ".join(LEVEL.sub("", function.of.title, count=1).split()) for function in group]
    return [
        title if title and (titles.count(title) == 1 or (not f.of.per and DRIVE.search(title))) else f.of.point
        for title, f in zip(titles, group, strict=True)
    ]


def _join_functions(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    """The run of some functions of a universal file: of frequency, or of time (tracked where one is the drive)."""
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
        is_drive = not f.of.per and (f.of.quantity == "force" or stated.is_drive(name))
        (drives if is_drive else sensors).append((name, f))
    ratio = bool(sensors) and bool(sensors[0][1].of.per)
    if not sensors or (not drives and not ratio):
        what = "no response" if not sensors else "neither a control channel nor a ratio to the drive"
        raise InputError(f"{label}: {what}", expected="a channel named control, drive, base or force")
    x = sensors[0][1].x
    if any(len(f.x) != len(x) or not np.allclose(f.x, x, rtol=1e-4, atol=0.0) for f in group):
        raise InputError(f"{label}: channels at different frequencies", expected="one list of frequencies")
    level, channels = find_level(label), []
    for name, sensor in sensors:
        text = sensor.of.numerator.unit
        quantity = sensor.of.quantity or describe_quantity(text, name)
        at_drive = sensor.of.per == "force" and sensor.of.response_point == sensor.of.reference_point
        channels.append(Channel(name, quantity, text, np.asarray(sensor.y), bool(sensor.of.per), at_drive))
    if ratio:
        if level is None or not level[0] > 0.0:
            raise InputError("functions without a level", expected="the level in the ID line, such as 0.5 g or 2 N")
        drive_unit = sensors[0][1].of.denominator.unit or level[1]
        return CampaignRun(label, level[0], drive_unit, x, np.full(len(x), level[0], dtype=complex), tuple(channels))
    drive = stated.join_controls([f.y * stated.of(name).scale for name, f in drives])
    drive_unit = stated.of(drives[0][0]).unit or drives[0][1].of.numerator.unit or "g"
    return source.set_level(CampaignRun(label, None, drive_unit, x, drive, tuple(channels)), label)


def _list_group_runs(source: Source, contents: Arrays) -> list[CampaignRun]:
    """Runs of an HDF5 file of mere arrays: every group with a frequency or times, a drive and other arrays."""
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
        has = f"it has {', '.join(list(contents.known)[:8])}"
        raise InputError("no runs", expected=f"groups with frequency, control (or force) and responses; {has}")
    return runs


def _group_run(source: Source, group: str, x: str, drive: str, paths: Mapping[str, str]) -> CampaignRun:
    """The run of a group with a frequency, a drive and complex spectra, each by its name in the group."""
    stated = source.stated.of(drive)
    contents = read_arrays(source.file, "hdf5", list(paths.values()), source.most)
    f = contents.arrays[paths[x]][0].real.reshape(-1)
    level = find_level(group.replace("_", " "))
    of_drive = contents.units.get(paths[drive], "")
    channels: list[Channel] = []
    for leaf, path in paths.items():
        if leaf in (x, drive) or path not in contents.arrays:
            continue
        values = contents.arrays[path][0]
        rows = np.atleast_2d(values if values.ndim == 2 and values.shape[1] == len(f) else values.T)
        if rows.shape[1] != len(f) or not np.iscomplexobj(rows):
            what = f"{path} is passed over: no complex spectra at {len(f)} frequencies"
            source.summary.note(f"{source.file.name}: {what}")
            continue
        text = contents.units.get(path, "") or of_drive or (level[1] if level else "")
        quantity = describe_quantity(text, leaf)
        names = [leaf] if len(rows) == 1 else [f"{leaf}[{k}]" for k in range(len(rows))]
        channels += [Channel(name, quantity, text, row) for name, row in zip(names, rows, strict=True)]
    drive_unit = stated.unit or of_drive or (level[1] if level else channels[0].unit if channels else "")
    values = contents.arrays[paths[drive]][0] * stated.scale
    rows = np.atleast_2d(values if values.shape[-1] == len(f) else values.T)
    control = source.stated.join_controls(list(rows))
    return source.set_level(CampaignRun(group, None, drive_unit, f, control, tuple(channels)), group)


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
    """Runs of a file of channels with their time step, one for each of its groups: tracked, or free decays."""
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


def _read_table(source: Source, start: bytes) -> CampaignRun:
    """The run of a table of motions against time: tracked where a column is the drive, else a free decay."""
    if is_binary(start):
        expected = "a universal file, HDF5, TDMS or a table of times; convert another file with damping import"
        raise InputError("no file of a known kind", expected=expected)
    layout = find_layout(recode(start)[0].decode("utf-8-sig", errors="replace").splitlines(), "auto", "auto")
    headers = [parse_header(name.strip()) for name in layout.names] if layout else []
    time = next((header for header in headers if header.name.lower() in ROLE_NAMES["time"]), None)
    drive = next((header.name for header in headers if source.stated.is_drive(header.name)), None)
    if layout and time and drive:
        return _track_table(source, layout, headers, time, drive)
    data = read_bytes(source.file, source.most)
    sensors = [header for header in headers if header is not time and header.text]
    if time is None or not sensors:
        first = start.decode("utf-8-sig", errors="replace").partition("\n")[0]
        expected = "a column of time beside columns of motion, a universal file, or HDF5 with a group a run"
        raise InputError(f"columns {describe_shortened(first, 80)}", expected=expected)
    roles = [f"sensor {k}" for k in range(len(sensors))]
    mapped = {"time": time.text} | dict(zip(roles, (header.text for header in sensors), strict=True))
    numbers = read_columns(data, mapped, {}).numbers
    units = [(header.name, header.unit) for header in sensors]
    return source.make_decay(source.file.stem, numbers["time"], units, [numbers[role] for role in roles])


def _track_table(
    source: Source, layout: Layout, headers: Sequence[ColumnHeader], time: ColumnHeader, drive: str
) -> CampaignRun:
    """The run of a table of time, a drive and responses. InputError for cells that are no numbers, or uneven times."""
    columns = [k for k, header in enumerate(headers) if header.text and header is not time]
    factor = ABSCISSAS["time"].get(time.unit.lower(), 1.0)
    blocks = _list_table_blocks(source, layout, [headers.index(time), *columns])
    first = next(blocks, None)
    if first is None or first.shape[1] < 2:
        raise InputError("no samples", expected="rows of time, drive and responses")
    step = float(first[0, -1] - first[0, 0]) / (first.shape[1] - 1) * factor

    def samples() -> Iterator[FloatArray]:
        start = float(first[0, 0]) * factor
        for block in chain([first], blocks):
            t = block[0] * factor
            off = np.max(np.abs(t - (start + step * np.arange(len(t)))))
            if not step > 0.0 or not off <= max(UNEVEN * step, 1e-6 * float(np.max(np.abs(t)))):
                raise InputError("the times are not evenly spaced", expected="one step throughout, rising")
            start = float(block[0, -1]) * factor + step
            yield block[1:]

    units = [(headers[k].name, headers[k].unit) for k in columns]
    return source.track(source.file.stem, units, drive, step, samples())


def _list_table_blocks(source: Source, layout: Layout, columns: Sequence[int]) -> Iterator[FloatArray]:
    """Columns (k, n) of a table, some lines at a time."""
    delimiter = DELIMITERS[layout.delimiter]
    with source.file.open("rb") as stream:
        for _ in range(layout.header):
            stream.readline(BLOCK)
        line = layout.header
        while block := stream.read(BLOCK):
            rest = stream.readline(BLOCK)
            if len(rest) == BLOCK:
                raise InputError(f"a line of more than {BLOCK} bytes", expected="rows of time, drive and responses")
            block += rest
            text = block.replace(b",", b".") if layout.decimal == "comma" else block
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # a block of blank lines or comments has no rows
                    table = np.loadtxt(
                        io.BytesIO(text),
                        delimiter=None if delimiter == " " else delimiter,
                        usecols=columns,
                        ndmin=2,
                        comments=["#", "%"] if layout.comments else None,
                    )
            except ValueError as error:
                reason = describe_shortened(str(error), 100)
                raise InputError(reason, expected=f"numbers in every row from line {line + 1} on") from None
            line += block.count(b"\n")
            if table.size:
                yield table.T
