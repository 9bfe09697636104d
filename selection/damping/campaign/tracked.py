"""Files of time with a drive channel to runs: the drive tracked, every channel at its frequency, read in blocks.

A table of text is read some lines at a time, an HDF5 or Rattlesnake file some samples at a time, so that a file of any
size takes the memory of a block.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from damping.arrays import FloatArray
from damping.campaign.runs import CampaignRun, Channel, Corrections, describe_quantity
from damping.errors import InputError
from damping.formats.arrays import read_arrays
from damping.formats.headers import ABSCISSAS, DELIMITERS, ColumnHeader, Layout, find_layout, parse_header
from damping.records.text import describe_shortened
from damping.signals.tracking import track_sine

#: Bytes of a table, and samples of a channel, that are read together.
BLOCK = 8_000_000
SAMPLES = 500_000
#: First bytes of a table by which its layout is told.
LOOKED_AT = 100_000
#: Steps of time that differ by more than this share of one are no even sampling.
UNEVEN = 0.02


def find_table(start: bytes) -> tuple[Layout, list[ColumnHeader]] | None:
    """Layout and headers of a table of text by its first bytes; None where it has no column of time."""
    layout = find_layout(start.decode("utf-8-sig", errors="replace").splitlines(), "auto", "auto")
    headers = [parse_header(name.strip()) for name in layout.names] if layout else []
    if layout is None or not any(header.name.lower() in ("time", "t", "zeit") for header in headers):
        return None
    return layout, headers


def track_table(
    file: Path, layout: Layout, headers: Sequence[ColumnHeader], drive: str, stated: Corrections
) -> CampaignRun:
    """The run of a table of time, a drive and responses.

    Raises:
        InputError: cells that are no numbers, or times that are not evenly spaced.
    """
    place = next(k for k, header in enumerate(headers) if header.name.lower() in ("time", "t", "zeit"))
    columns = [k for k, header in enumerate(headers) if header.text and k != place]
    factor = ABSCISSAS["time"].get(headers[place].unit.lower(), 1.0)
    blocks = _list_blocks(file, layout, [place, *columns])
    first = next(blocks, None)
    if first is None or first.shape[1] < 2:
        raise InputError("no samples", file=file, expected="rows of time, drive and responses")
    step = float(first[0, -1] - first[0, 0]) / (first.shape[1] - 1) * factor

    def samples() -> Iterator[FloatArray]:
        for block in (part for parts in ([first], blocks) for part in parts):
            _require_even(block[0] * factor, step, file)
            yield block[1:]

    names = [headers[k].name for k in columns]
    units = [headers[k].unit.replace("m/s2", "m/s^2") for k in columns]
    return _track(samples(), names, units, names.index(drive), step, file.stem, stated)


def track_arrays(file: Path, group: str, drive: str, leaves: Sequence[str], step: float, units: dict[str, str],
                 most: int, stated: Corrections) -> CampaignRun:  # fmt: skip
    """The run of a group of an HDF5 file with arrays of samples of one length: a drive and responses."""
    paths = [f"{group}/{leaf}".lstrip("/") for leaf in leaves]

    def samples() -> Iterator[FloatArray]:
        first = 0
        while True:
            found = read_arrays(file, "hdf5", paths, most, rows=(first, first + SAMPLES)).arrays
            block = np.array([found[path][0].real.reshape(-1) for path in paths])
            if block.shape[1]:
                yield block
            if block.shape[1] < SAMPLES:
                return
            first += SAMPLES

    named = [units.get(leaf, "").replace("m/s2", "m/s^2") for leaf in leaves]
    return _track(samples(), list(leaves), named, list(leaves).index(drive), step, group or file.stem, stated)


def _track(
    samples: Iterator[FloatArray],
    names: Sequence[str],
    units: Sequence[str],
    drive: int,
    step: float,
    label: str,
    stated: Corrections,
) -> CampaignRun:
    found = track_sine(samples, drive, step)
    order = np.argsort(found.frequency, kind="stable")
    others = [k for k in range(len(names)) if k != drive]
    channels = tuple(
        Channel(names[k], describe_quantity(units[k], names[k]), units[k], found.response[place][order])
        for place, k in enumerate(others)
        if stated.of(names[k]).role != "out"
    )
    size = found.drive[order].astype(complex) * stated.of(names[drive]).scale
    text = stated.of(names[drive]).unit or units[drive]
    return CampaignRun(label, None, text, found.frequency[order], size, channels, rate=found.rate[order])


def _list_blocks(file: Path, layout: Layout, columns: Sequence[int]) -> Iterator[FloatArray]:
    """Columns (k, n) of a table, some lines at a time."""
    decimal, delimiter = layout.decimal == "comma", DELIMITERS[layout.delimiter]
    with file.open("rb") as stream:
        for _ in range(layout.header):
            stream.readline()
        line = layout.header
        while block := stream.read(BLOCK):
            block += stream.readline()
            text = block.replace(b",", b".") if decimal else block
            try:
                table = np.loadtxt(
                    io.BytesIO(text),
                    delimiter=None if delimiter == " " else delimiter,
                    usecols=columns,
                    ndmin=2,
                    comments=["#", "%"] if layout.comments else None,
                )
            except ValueError as error:
                reason = describe_shortened(str(error), 100)
                raise InputError(reason, file=file, expected=f"numbers in every row from line {line + 1} on") from None
            line += block.count(b"\n")
            yield table.T


def _require_even(t: FloatArray, step: float, file: Path) -> None:
    """InputError for times that are not evenly spaced."""
    even = t[0] + step * np.arange(len(t))
    if not step > 0.0 or float(np.max(np.abs(t - even))) > max(UNEVEN * step, 1e-6 * float(np.max(np.abs(t)))):
        raise InputError("the times are not evenly spaced", file=file, expected="one step throughout, rising")
