"""Tables of motions against time: a run each, tracked some lines at a time, or a free decay."""

import io
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.runs import CampaignRun
from damping.campaign.tracked import UNEVEN, Source
from damping.errors import InputError
from damping.formats.columns import DELIMITERS, Layout, find_layout, read_columns
from damping.formats.headers import ABSCISSAS, ROLE_NAMES, ColumnHeader, parse_header
from damping.records.text import describe_shortened, is_binary, read_bytes, recode

BLOCK = 8_000_000  #: characters of a table that are read together


def read_table(source: Source, start: bytes) -> CampaignRun:
    """The run of a table of motions against time: tracked where a column is the drive, else a free decay."""
    if is_binary(start):
        expected = "a universal file, HDF5, TDMS or a table of times; convert another file with damping import"
        raise InputError("no file of a known kind", expected=expected)
    known, encoding = recode(start)
    lines = known.decode("utf-8-sig", errors="replace").splitlines()
    layout = find_layout(lines, "auto", "auto")
    headers = [parse_header(name.strip()) for name in layout.names] if layout else []
    time = next((header for header in headers if header.name.lower() in ROLE_NAMES["time"]), None)
    drive = next((header.name for header in headers if source.stated.is_drive(header.name)), None)
    if layout and time and drive:
        return _track_table(source, replace(layout, encoding=encoding), headers, time, drive)
    data = read_bytes(source.file, source.most)
    sensors = [header for header in headers if header is not time and header.text]
    if time is None or not sensors:
        expected = "a column of time beside columns of motion, a universal file, or HDF5 with a group a run"
        raise InputError(f"columns {describe_shortened(lines[0], 80)}", expected=expected)
    roles = [f"sensor {k}" for k in range(len(sensors))]
    mapped = {"time": time.text} | dict(zip(roles, (header.text for header in sensors), strict=True))
    numbers = read_columns(data, mapped, {}).numbers
    units = [(header.name, header.unit) for header in sensors]
    t = numbers["time"] * _find_factor(time)
    return source.make_decay(source.file.stem, t, units, [numbers[role] for role in roles])


def _find_factor(time: ColumnHeader) -> float:
    """The unit of a column of times in s; 1 where it has none."""
    return ABSCISSAS["time"].get(time.unit.lower(), 1.0)


def _track_table(
    source: Source, layout: Layout, headers: Sequence[ColumnHeader], time: ColumnHeader, drive: str
) -> CampaignRun:
    """The run of a table of time, a drive and responses. InputError for cells that are no numbers, or uneven times."""
    columns = [k for k, header in enumerate(headers) if header.text and header is not time]
    factor = _find_factor(time)
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
    with source.file.open(encoding=layout.encoding or "utf-8", errors="replace") as stream:
        for _ in range(layout.header):
            stream.readline(BLOCK)
        line = layout.header
        while block := stream.read(BLOCK):
            rest = stream.readline(BLOCK)
            if len(rest) == BLOCK:
                raise InputError(
                    f"a line of more than {BLOCK} characters", expected="rows of time, drive and responses"
                )
            block += rest
            text = block.replace(",", ".") if layout.decimal == "comma" else block
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # a block of blank lines or comments has no rows
                    table = np.loadtxt(
                        io.BytesIO(text.encode()),
                        delimiter=None if delimiter == " " else delimiter,
                        usecols=columns,
                        ndmin=2,
                        comments=["#", "%"] if layout.comments else None,
                    )
            except ValueError as error:
                reason = describe_shortened(str(error), 100)
                raise InputError(reason, expected=f"numbers in every row from line {line + 1} on") from None
            line += block.count("\n")
            if table.size:
                yield table.T
