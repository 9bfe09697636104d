"""Files of time with a drive channel to runs: the drive tracked, every channel at its frequency, read in blocks.

A table of text is read some lines at a time, an HDF5, TDMS or Rattlesnake file some samples at a time, so that a file
of any size takes the memory of a block.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.runs import (
    LEVEL,
    CampaignRun,
    Channel,
    Corrections,
    Source,
    describe_quantity,
    is_drive,
)
from damping.errors import InputError
from damping.formats.arrays import Arrays, read_arrays
from damping.formats.headers import ABSCISSAS, DELIMITERS, ColumnHeader, Layout, find_layout, parse_header
from damping.formats.quantity import unit
from damping.formats.uff import Function
from damping.records.text import describe_shortened
from damping.signals.tracking import track_sine

#: Bytes of a table, and samples of all channels, that are read together.
BLOCK = 8_000_000
SAMPLES = 2_000_000
#: First bytes of a table by which its layout is told.
LOOKED_AT = 100_000
#: Steps of time that differ by more than this share of one are no even sampling.
UNEVEN = 0.02
#: Names of a column of time.
TIMES = ("time", "t", "zeit")


def find_table(start: bytes) -> tuple[Layout, list[ColumnHeader]] | None:
    """Layout and headers of a table of text by its first bytes; None where it has no column of time."""
    layout = find_layout(start.decode("utf-8-sig", errors="replace").splitlines(), "auto", "auto")
    headers = [parse_header(name.strip()) for name in layout.names] if layout else []
    if layout is None or not any(header.name.lower() in TIMES for header in headers):
        return None
    return layout, headers


def track_table(source: Source, layout: Layout, headers: Sequence[ColumnHeader], drive: str) -> CampaignRun:
    """The run of a table of time, a drive and responses.

    Raises:
        InputError: cells that are no numbers, or times that are not evenly spaced.
    """
    place = next(k for k, header in enumerate(headers) if header.name.lower() in TIMES)
    columns = [k for k, header in enumerate(headers) if header.text and k != place]
    factor = ABSCISSAS["time"].get(headers[place].unit.lower(), 1.0)
    blocks = _list_blocks(source, layout, [place, *columns])
    first = next(blocks, None)
    if first is None or first.shape[1] < 2:
        raise InputError("no samples", expected="rows of time, drive and responses")
    step = float(first[0, -1] - first[0, 0]) / (first.shape[1] - 1) * factor

    def samples() -> Iterator[FloatArray]:
        start = float(first[0, 0]) * factor
        for block in (part for parts in ([first], blocks) for part in parts):
            _require_even(block[0] * factor, start, step, source)
            start = float(block[0, -1]) * factor + step
            yield _require_finite(block[1:], source)

    names = [headers[k].name for k in columns]
    units = [headers[k].unit for k in columns]
    label = source.file.stem
    return source.set_level(track_samples(samples(), names, units, drive, step, label, source.stated), label)


def track_arrays(
    source: Source, kind: str, channels: Mapping[str, str], drive: str, step: float, label: str
) -> CampaignRun:
    """The run of arrays or channels of one length, a drive and responses.

    Args:
        kind: ``hdf5`` or ``tdms``. channels: unit of each by its path in the file, named by its last part.
    """
    paths = list(channels)
    # channels of a file are read all together or not at all, arrays one by one
    contents = find_channels(source, kind)
    asked = paths if contents is None else []

    def samples() -> Iterator[FloatArray]:
        first, count = 0, max(SAMPLES // (len(contents.known) if contents else len(paths)), 1)
        while True:
            arrays = read_arrays(source.file, kind, asked, None, rows=(first, first + count)).arrays
            block = np.array([arrays[path][0].real.reshape(-1) for path in paths])
            if block.shape[1]:
                yield _require_finite(block, source)
            if block.shape[1] < count:
                return
            first += count

    names = [path.rpartition("/")[2] for path in paths]
    run = track_samples(samples(), names, list(channels.values()), drive, step, label, source.stated)
    return source.set_level(run, label)


def find_channels(source: Source, kind: str) -> Arrays | None:
    """The first samples of every channel of a file that says their time step; None for a file of mere arrays."""
    arrays = read_arrays(source.file, kind, [], None, rows=(0, 1))
    return arrays if arrays.steps else None


def track_samples(
    samples: Iterable[FloatArray],
    names: Sequence[str],
    units: Sequence[str],
    drive: str,
    step: float,
    label: str,
    stated: Corrections,
) -> CampaignRun:
    """The run of blocks of samples (channels, n), one of whose names is the drive."""
    place = names.index(drive)
    track = track_sine(samples, place, step)
    texts = [text.replace("m/s2", "m/s^2") for text in units]
    order = np.argsort(track.frequency, kind="stable")
    others = [(name, text) for k, (name, text) in enumerate(zip(names, texts, strict=True)) if k != place]
    channels = tuple(
        Channel(name, describe_quantity(text, name), text, values[order], third=third[order])
        for (name, text), values, third in zip(others, track.response, track.third, strict=True)
        if stated.of(name).role != "out"
    )
    size = track.drive[order].astype(complex) * stated.of(drive).scale
    text = stated.of(drive).unit or texts[place]
    return CampaignRun(label, None, text, track.frequency[order], size, channels, rate=track.rate[order])


def _list_blocks(source: Source, layout: Layout, columns: Sequence[int]) -> Iterator[FloatArray]:
    """Columns (k, n) of a table, some lines at a time."""
    decimal, delimiter = layout.decimal == "comma", DELIMITERS[layout.delimiter]
    with source.file.open("rb") as stream:
        for _ in range(layout.header):
            stream.readline(BLOCK)
        line = layout.header
        while block := stream.read(BLOCK):
            rest = stream.readline(BLOCK)
            if len(rest) == BLOCK:
                raise InputError(f"a line of more than {BLOCK} bytes", expected="rows of time, drive and responses")
            block += rest
            text = block.replace(b",", b".") if decimal else block
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


def _require_finite(block: FloatArray, source: Source) -> FloatArray:
    """The samples; InputError for those that are no numbers."""
    if not np.isfinite(block).all():
        raise InputError("samples that are no numbers", expected="finite numbers in every channel")
    return block


def _require_even(t: FloatArray, start: float, step: float, source: Source) -> None:
    """InputError for times that do not go on evenly from ``start``."""
    even = start + step * np.arange(len(t))
    if not step > 0.0 or not float(np.max(np.abs(t - even))) <= max(UNEVEN * step, 1e-6 * float(np.max(np.abs(t)))):
        raise InputError("the times are not evenly spaced", expected="one step throughout, rising")


def name_function(function: Function) -> str:
    """Name of a channel: the ID line without its level."""
    match = LEVEL.search(function.title)
    name = function.title[: match.start()] + function.title[match.end() :] if match else function.title
    return " ".join(name.split()) or f"node {function.response[0]}"


def read_histories(label: str, group: Sequence[Function], source: Source) -> CampaignRun:
    """The run of functions of time: tracked where one is the drive, else free decays."""
    t, names = group[0].x, [name_function(function) for function in group]
    if not all(function.is_time and len(function.x) == len(t) and np.allclose(function.x, t) for function in group):
        raise InputError(f"{label}: functions of time of several lengths", expected="one list of times")
    units = [function.units[0] for function in group]
    samples = [np.asarray(function.y).real for function in group]
    drive = choose_drive(dict(zip(names, units, strict=True)), source.stated)
    if drive is None:
        return make_decay(label, t, names, units, samples)
    step = float(t[-1] - t[0]) / (len(t) - 1)
    run = track_samples([np.array(samples)], names, units, drive, step, label, source.stated)
    return source.set_level(run, label)


def make_decay(
    label: str, t: FloatArray, names: Sequence[str], units: Sequence[str], samples: Iterable[FloatArray]
) -> CampaignRun:
    """The run of motions against time that nothing drives: a free decay."""
    texts = [text.replace("m/s2", "m/s^2") for text in units]
    channels = [Channel(n, describe_quantity(u, n), u, x) for n, u, x in zip(names, texts, samples, strict=True)]
    return CampaignRun(label, None, "", t, None, tuple(channels), is_time=True)


def choose_drive(units: Mapping[str, str], stated: Corrections) -> str | None:
    """The channel that is the drive, of all by their units: as stated, by its name, or the only force."""
    named = next((name for name in units if is_drive(name, stated)), None)
    forces = [name for name, text in units.items() if text and unit(text).powers == (1, 0, 0)]
    return named or (forces[0] if len(forces) == 1 else None)


def track_channels(contents: Arrays, source: Source, kind: str) -> list[CampaignRun]:
    """Runs of a file of channels with their time step, one for each of its groups: tracked, or free decays."""
    groups: dict[str, list[str]] = {}
    for path in contents.steps:
        groups.setdefault(path.rpartition("/")[0], []).append(path)
    stem = source.file.stem
    return [_track_paths(group or stem, contents, paths, source, kind) for group, paths in groups.items()]


def _track_paths(label: str, contents: Arrays, paths: Sequence[str], source: Source, kind: str) -> CampaignRun:
    unit_of = {path: contents.units.get(path, "") for path in paths}
    steps, sizes = {contents.steps[path] for path in paths}, {contents.known[path] for path in paths}
    if len(steps) > 1 or len(sizes) > 1:
        raise InputError(f"channels of {label} of several rates or lengths", expected="one for all")
    start, step = next(iter(steps))
    names = [path.rpartition("/")[2] for path in paths]
    drive = choose_drive(dict(zip(names, unit_of.values(), strict=True)), source.stated)
    if drive is not None:
        return track_arrays(source, kind, unit_of, drive, step, label)
    arrays = read_arrays(source.file, kind, [], source.most).arrays
    t = np.asarray(start + step * np.arange(next(iter(sizes))[0]))
    return make_decay(label, t, names, list(unit_of.values()), (arrays[path][0].reshape(-1) for path in paths))


def track_group(
    source: Source, group: str, t: str, drive: str, leaves: Sequence[str], known: Mapping[str, tuple[int, ...]]
) -> CampaignRun:
    """The run of a group with times, a drive and responses of one length."""
    path = {leaf: f"{group}/{leaf}".lstrip("/") for leaf in leaves}
    like = [leaf for leaf in leaves if leaf != t and known[path[leaf]] == known[path[t]]]
    first = read_arrays(source.file, "hdf5", list(path.values()), None, rows=(0, 1000))
    step = np.diff(first.arrays[path[t]][0].real.reshape(-1))
    if not len(step) or not np.all(np.abs(step / np.mean(step) - 1.0) < UNEVEN):
        raise InputError(f"{path[t]} is not evenly spaced", expected="one step throughout, rising")
    channels = {path[leaf]: first.units.get(path[leaf], "") for leaf in like}
    return track_arrays(source, "hdf5", channels, drive, float(np.mean(step)), group or source.file.stem)
