"""Values of a data set 58, read and written: text in fixed columns or between blanks, or bytes of either order.

Values are read in parts of bounded size, so that memory stays a small multiple of the file. Each sweep of a record is
written as its receptance (type 4) and its force amplitude (spectrum, type 12): as bytes (58b) with every digit, as text
with 13 digits of the ordinate and 6 of the abscissa. The format has no field for peak values: the fourth ID line states
them, and the reader recognises it.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import accumulate, pairwise

import numpy as np

from damping.arrays import FloatArray, join_complex
from damping.errors import AnalysisError, InputError
from damping.formats.series import Samples
from damping.formats.uff_blocks import D_TO_E, FREQUENCY, DataSet
from damping.records.keys import LARGEST, REQUIRED_COLUMNS, SMALLEST
from damping.records.record import Record

_PART = 1_000_000  # bytes of text taken at a time
_NO_LETTER = re.compile(rb"(?<=\d)([+-]\d{3})(?=\s|$)")  # 1.5-101: Fortran omits the letter before 3 digits
_LONGEST = 40  # most characters of a number
_PADDING = 5  # most zeros that fill the last line beyond the points


def values(data: bytes, entry: DataSet) -> tuple[FloatArray, Samples]:
    """Abscissa (points,) and ordinate (points,), real or complex.

    InputError: fewer or more values than points, or a value that is not a number.
    """
    if entry.form is not None:
        table = np.frombuffer(data, dtype=entry.form, count=entry.points, offset=entry.start)
        x = _even(entry) if entry.even else table["x"].astype(np.float64)
        return x, _ordinate(table["y"])
    width = entry.parts + (not entry.even)
    columns = _from_text(data, entry, width * entry.points).reshape(entry.points, width)
    x = _even(entry) if entry.even else columns[:, 0].copy()
    return x, _ordinate(columns[:, width - entry.parts :])


def _even(entry: DataSet) -> FloatArray:
    if not (abs(entry.first) <= LARGEST and (entry.points == 1 or SMALLEST <= entry.step <= LARGEST)):
        message = f"abscissa from {entry.first:g} with increment {entry.step:g}"
        raise InputError(message, line=entry.line + 7, expected="an increment > 0 (even spacing)")
    step = entry.step if entry.points > 1 else 0.0
    return entry.first + step * np.arange(entry.points, dtype=np.float64)


def _ordinate(columns: FloatArray) -> Samples:
    """One column unchanged, two as complex numbers."""
    if columns.shape[1] == 1:
        return np.ascontiguousarray(columns[:, 0], dtype=np.float64)
    return join_complex(columns[:, 0], columns[:, 1])


def _widths(entry: DataSet) -> tuple[int, ...]:
    """Column widths of a line of values (record 12 of the format)."""
    if entry.ordinate in (2, 5):
        return (13,) * 6
    if entry.even:
        return (20,) * 4
    return (13, 20, 13, 20) if entry.ordinate == 4 else (13, 20, 20)


def _from_text(data: bytes, entry: DataSet, needed: int) -> FloatArray:
    cut_off = "" if entry.end < len(data) else " (the file is cut off)"
    as_the_header_says = f"{needed} values, as the header says"
    if needed > (entry.end - entry.start) // 2 + 1:  # each value takes a digit and a blank
        raise InputError(f"fewer values{cut_off}", line=entry.line + 12, expected=as_the_header_says)
    numbers = np.empty(needed)
    columns = list(accumulate(_widths(entry), initial=0))
    count, line = 0, entry.line + 12
    for part in _parts(data, entry.start, entry.end):
        values = _numbers(part, columns, line)
        taken = min(len(values), needed - count)
        numbers[count : count + taken] = values[:taken]
        surplus = values[taken:]
        if len(surplus) > _PADDING or np.any(surplus != 0.0):
            message = f"more values than the {needed} of the header"
            raise InputError(message, line=line, expected="as many as the header says")
        count += taken
        line += part.count(b"\n")
    if count < needed:
        message = f"{count} values where the header needs {needed}{cut_off}"
        raise InputError(message, line=entry.line + 12, expected=as_the_header_says)
    return numbers


def _parts(data: bytes, start: int, end: int) -> Iterator[bytes]:
    """The body in parts that end at a line end."""
    while start < end:
        stop = data.rfind(b"\n", start, start + _PART) + 1 if start + _PART < end else end
        yield data[start:stop] if stop > start else b"a line too long"
        start = stop if stop > start else end


def _numbers(part: bytes, columns: list[int], line: int) -> FloatArray:
    """Numbers in some lines: separated by blanks, else in columns, which may touch."""
    part = _NO_LETTER.sub(rb"E\1", part.translate(D_TO_E))
    texts = part.split()
    if max(map(len, texts), default=0) <= _LONGEST:
        with suppress(ValueError):
            return np.array(texts, dtype=np.bytes_).astype(np.float64)
    numbers: list[float] = []
    for at, row in enumerate(part.split(b"\n"), line):
        try:
            numbers += _in_columns(row, columns)
        except ValueError:
            raise InputError("a value is not a number", line=at, expected="numbers alone") from None
    return np.array(numbers)


def _in_columns(row: bytes, columns: list[int]) -> list[float]:
    """Numbers of a line between places, without blank fields. ValueError: no number, or text beyond the columns."""
    if row[columns[-1] :].strip():
        raise ValueError
    fields = (row[start:stop].strip() for start, stop in pairwise(columns))
    return [float(field.rstrip(b"\0")) for field in fields if field]  # as numpy reads bytes


PEAK = "peak amplitudes"  #: fourth ID line of a set with peak amplitudes of the sine
_DISPLACEMENT = 8  #: data type of the numerator
_FORCE = 13  #: data type of the denominator
_ACCELERATION = 12  #: the same where a base is driven
_ABSCISSA = "{:13.5E}"  #: of uneven spacing as text, which the format sets


def write_uff(record: Record, length: str, force: str, *, binary: bool, of_base: bool) -> tuple[bytes, list[str]]:
    """The universal file of a record, and notes on what it does not hold.

    Args:
        record: with phases, or with sweeps of one row, which is at phase resonance.
        length: label of its unit, up to 18 characters; '' where none is named.
        force: likewise.
        binary: values as bytes.
        of_base: the column ``force`` is the acceleration of a base.

    AnalysisError: a sweep of several rows without phases.
    """
    written = (*REQUIRED_COLUMNS, "phase")
    notes = [f"column {name} is not in the universal file" for name in record.frame.columns if name not in written]
    off = max(abs(float(_ABSCISSA.format(f)) - f) for f in record.column("frequency").tolist())
    if off > 0.0 and not binary:
        notes.append(f"frequencies are off by up to {off:.2g} Hz: as text they have six digits")
    displacement = _describe_axis(_DISPLACEMENT, "Displacement", length)
    force = force.replace("²", "^2")  # the format is of ASCII characters
    drive = _describe_axis(_ACCELERATION, "Acceleration", force) if of_base else _describe_axis(_FORCE, "Force", force)
    sets = []
    for label in record.sweeps:
        sweep = record.of(label)
        f, F = sweep.column("frequency"), sweep.column("force")
        if not record.has_phase and len(sweep) > 1:
            raise AnalysisError(f"sweep {label!r} has no phases, and a frequency response is not complete without them")
        lag = sweep.column("phase") if record.has_phase else np.full(1, 0.5 * np.pi)
        receptance = sweep.column("amplitude") / F * np.exp(-1j * lag)
        title = " ".join(label.split())
        if len(title.encode()) > 80 or title != label:
            notes.append(f"label {label!r} is shortened")
            title = title.encode()[:80].decode(errors="ignore")
        sets.append(_set(title, 4, f, receptance, (displacement, drive), binary))
        sets.append(_set(title, 12, f, F, (drive, _describe_axis(0, "NONE", "")), binary))
    return b"".join(sets), notes


def _describe_axis(code: int, label: str, unit: str) -> str:
    return f"{code:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit or 'NONE':<20s}\n"


def _set(title: str, function: int, x: FloatArray, y: Samples, axes: tuple[str, str], binary: bool) -> bytes:
    """One data set with uneven spacing and double precision."""
    numbers = np.column_stack([x, y.real, y.imag] if np.iscomplexobj(y) else [x, y])
    first = f"{58:6d}{'':74s}\n"
    if binary:
        first = f"{58:6d}b{1:6d}{2:6d}{11:12d}{numbers.nbytes:12d}{0:6d}{0:6d}{0:12d}{0:12d}\n"
    lines = [
        f"{-1:6d}\n",
        first,
        *(f"{line or 'NONE'}\n" for line in (title, "", "", PEAK, "")),
        f"{function:5d}{0:10d}{0:5d}{0:10d} {'NONE':<10s}{1:10d}{0:4d} {'NONE':<10s}{1:10d}{0:4d}\n",
        f"{6 if np.iscomplexobj(y) else 4:10d}{len(x):10d}{0:10d}{0.0:13.5e}{0.0:13.5e}{0.0:13.5e}\n",
        _describe_axis(FREQUENCY, "Frequency", "Hz"),
        *axes,
        _describe_axis(0, "NONE", ""),
    ]
    return "".join(lines).encode() + (numbers.astype("<f8").tobytes() if binary else _as_text(numbers)) + b"    -1\n"


def _as_text(numbers: FloatArray) -> bytes:
    """Text in the format 1E13.5,2E20.12 for complex and 2(1E13.5,1E20.12) for real values."""
    points = [_ABSCISSA.format(row[0]) + "".join(f"{value:20.12E}" for value in row[1:]) for row in numbers.tolist()]
    if numbers.shape[1] == 2:
        points = ["".join(points[i : i + 2]) for i in range(0, len(points), 2)]
    return "".join(f"{point}\n" for point in points).encode()
