"""Values of a data set 58, read and written: text of fixed columns or blanks between, or bytes of either order.

They are read in parts of bounded size, so that memory stays a small multiple of the file. A record is written as, for
each sweep, its receptance (type 4) and its force amplitude (spectrum, type 12): as bytes (58b) with every digit, as
text with 13 digits of the ordinate and 6 of the abscissa. The fourth ID line says that amplitudes are peak values,
which the format has no field for; reading knows it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from damping.arrays import FloatArray
from damping.errors import AnalysisError, InputError
from damping.formats.named import cartesian
from damping.formats.series import Samples
from damping.formats.uff_blocks import Header, UffBlock
from damping.records.keys import LARGEST, REQUIRED_COLUMNS, SMALLEST
from damping.records.record import Record

_PART = 1_000_000  # bytes of text taken at a time
_NO_LETTER = re.compile(rb"(?<=\d)([+-]\d{3})(?=\s|$)")  # 1.5-101: Fortran leaves the letter out where 3 digits follow
_D_TO_E = bytes.maketrans(b"Dd", b"EE")
_CLOSING = re.compile(rb"[\r\n]{0,2}[ \t]{0,8}-1[ \t]*(?=[\r\n]|$)")
_LONGEST = 40  # characters of a number
_PADDING = 5  # zeros that may fill the last line beyond the points


def values(data: bytes, block: UffBlock, header: Header) -> tuple[FloatArray, Samples]:
    """Abscissa (points,) and ordinate (points,), real or complex.

    Raises:
        InputError: fewer or more values than points, or something that is no number.
    """
    if block.binary:
        form, _ = binary_form(data, block, header)
        table = np.frombuffer(data, dtype=form, count=header.points, offset=block.start)
        x = _even(header, block) if header.even else table["x"].astype(np.float64)
        return x, _ordinate(table["y"])
    parts = 1 if header.ordinate in (2, 4) else 2
    width = parts + (not header.even)
    numbers = _from_text(data, block, width * header.points, _widths(header))
    columns = numbers.reshape(header.points, width)
    x = _even(header, block) if header.even else columns[:, 0].copy()
    return x, _ordinate(columns[:, width - parts :])


def binary_form(data: bytes, block: UffBlock, header: Header) -> tuple[np.dtype[np.void], int]:
    """How one point of a binary set is stored, and where the values end.

    As wide as the ordinate, or (uneven spacing, double precision) with an abscissa of single precision; whichever is
    followed by the end of the set. The number of bytes in the header is not used: some programs write half of it.

    Raises:
        InputError: a floating-point format other than IEEE, no byte order, or neither form fits.
    """
    order = _describe_byte_order(block)
    wide = "f4" if header.ordinate in (2, 5) else "f8"
    shape = (1 if header.ordinate in (2, 4) else 2,)
    forms = [np.dtype([("y", order + wide, shape)])]
    if not header.even:
        forms = [np.dtype([("x", order + x), ("y", order + wide, shape)]) for x in dict.fromkeys((wide, "f4"))]
    for form in forms:
        end = block.start + header.points * form.itemsize
        if end <= len(data) and _CLOSING.match(data, end):
            return form, end
    raise InputError(
        f"the bytes of {header.points} values are not followed by the end of the data set",
        line=block.line + 7,
        expected="as many values as the header says, then a line with -1",
    )


def _even(header: Header, block: UffBlock) -> FloatArray:
    if not (abs(header.first) <= LARGEST and (header.points == 1 or SMALLEST <= header.step <= LARGEST)):
        raise InputError(
            f"abscissa from {header.first:g} with increment {header.step:g}",
            line=block.line + 7,
            expected="an increment > 0 (even spacing)",
        )
    step = header.step if header.points > 1 else 0.0
    return header.first + step * np.arange(header.points, dtype=np.float64)


def _ordinate(columns: FloatArray) -> Samples:
    """One column as it is, two as a complex number."""
    if columns.shape[1] == 1:
        return np.ascontiguousarray(columns[:, 0], dtype=np.float64)
    return cartesian(columns[:, 0], columns[:, 1])


def _widths(header: Header) -> tuple[int, ...]:
    """Column widths of a line of values (record 12 of the format)."""
    if header.ordinate in (2, 5):
        return (13,) * 6
    if header.even:
        return (20,) * 4
    return (13, 20, 13, 20) if header.ordinate == 4 else (13, 20, 20)


def _from_text(data: bytes, block: UffBlock, needed: int, widths: tuple[int, ...]) -> FloatArray:
    """The first ``needed`` numbers of the body."""
    if needed > (block.end - block.start) // 2 + 1:  # a number and a blank each
        raise _few(needed, None, block)
    numbers = np.empty(needed)
    count, line = 0, block.line + 12
    for part in _parts(data, block.start, block.end):
        values = _numbers(part, widths, line)
        taken = min(len(values), needed - count)
        numbers[count : count + taken] = values[:taken]
        surplus = values[taken:]
        if len(surplus) > _PADDING or np.any(surplus != 0.0):
            raise InputError(
                f"more values than the {needed} of the header", line=line, expected="as many as the header says"
            )
        count += taken
        line += part.count(b"\n")
    if count < needed:
        raise _few(needed, count, block)
    return numbers


def _few(needed: int, count: int | None, block: UffBlock) -> InputError:
    has = "" if count is None else f" where the header needs {needed}"
    message = f"{'fewer' if count is None else count} values{has}" + ("" if block.closed else " (the file is cut off)")
    return InputError(message, line=block.line + 12, expected=f"{needed} values, as the header says")


def _parts(data: bytes, start: int, end: int) -> Iterator[bytes]:
    """The body in parts that end with a line."""
    while start < end:
        stop = data.rfind(b"\n", start, start + _PART) + 1 if start + _PART < end else end
        yield data[start:stop] if stop > start else b"a line too long"
        start = stop if stop > start else end


def _numbers(part: bytes, widths: tuple[int, ...], line: int) -> FloatArray:
    """Numbers of some lines: separated by blanks, else in columns (where they may touch)."""
    part = _NO_LETTER.sub(rb"E\1", part.translate(_D_TO_E))
    for fields in (bytes.split, lambda text: list(_in_columns(text, widths))):
        texts = fields(part)
        try:
            if max(map(len, texts), default=0) <= _LONGEST:
                return np.array(texts, dtype=np.bytes_).astype(np.float64)
        except ValueError:
            continue
    bad = next((i for i, text in enumerate(part.split(b"\n")) if not _readable(text, widths)), 0)
    raise InputError("a value is not a number", line=line + bad, expected="numbers alone")


def _readable(text: bytes, widths: tuple[int, ...]) -> bool:
    try:
        [float(field) for field in _in_columns(text, widths)]
    except ValueError:
        return False
    return True


def _in_columns(text: bytes, widths: tuple[int, ...]) -> Iterator[bytes]:
    """The fields of each line by column width; blank ones are left out."""
    for row in text.split(b"\n"):
        start = 0
        for width in widths:
            field = row[start : start + width].strip()
            start += width
            if field:
                yield field
        if row[start:].strip():
            yield b"beyond the columns"


def _describe_byte_order(block: UffBlock) -> str:
    """``<`` or ``>``: fields 1 (byte order) and 2 (floating-point format) of the first line."""
    order, form = (*block.fields, 0, 0)[:2]
    if form not in (0, 2):
        raise InputError(f"floating-point format {form}", line=block.line, expected="2 (IEEE 754) in data set 58b")
    if order not in (1, 2):
        raise InputError(
            f"byte order {order}", line=block.line, expected="1 (little endian) or 2 (big endian) after 58b"
        )
    return "<" if order == 1 else ">"


#: Fourth ID line of a set whose amplitudes are those of the sine.
PEAK = "peak amplitudes"
#: Data types of data set 58: abscissa, numerator and denominator.
_FREQUENCY = 18
_DISPLACEMENT = 8
_FORCE = 13
_LAST_LINE = b"    -1\n"


def write_uff(record: Record, length: str, force: str, *, binary: bool) -> tuple[bytes, list[str]]:
    """The universal file of a record, and notes on what it does not hold.

    Args:
        record: with phases, or with sweeps of one row, which is at phase resonance.
        length, force: labels of the units, up to 18 characters; '' where none is named.
        binary: values as bytes.

    Raises:
        AnalysisError: a sweep of several rows without phases.
    """
    written = (*REQUIRED_COLUMNS, "phase")
    notes = [f"column {name} is not in the universal file" for name in record.table.columns if name not in written]
    displacement, drive = _describe_axis(_DISPLACEMENT, "Displacement", length), _describe_axis(_FORCE, "Force", force)
    sets = []
    for label in record.sweeps:
        sweep = record.of(label)
        f, F = sweep.column("frequency"), sweep.column("force")
        receptance = sweep.column("amplitude") / F * np.exp(-1j * _lag(sweep, label))
        title = " ".join(label.split())
        if len(title.encode()) > 80 or title != label:
            notes.append(f"label {label!r} is shortened")
            title = title.encode()[:80].decode(errors="ignore")
        sets.append(_set(title, 4, f, receptance, (displacement, drive), binary))
        sets.append(_set(title, 12, f, F, (drive, _describe_axis(0, "NONE", "")), binary))
    return b"".join(sets), notes


def _lag(record: Record, label: str) -> FloatArray:
    if record.has_phase:
        return record.column("phase")
    if len(record) > 1:
        raise AnalysisError(f"sweep {label!r} has no phases, and a frequency response is not complete without them")
    return np.full(1, 0.5 * np.pi)


def _describe_axis(code: int, label: str, unit: str) -> str:
    return f"{code:10d}{0:5d}{0:5d}{0:5d} {label:<20s} {unit or 'NONE':<20s}\n"


def _set(title: str, function: int, x: FloatArray, y: Samples, axes: tuple[str, str], binary: bool) -> bytes:
    """One data set of uneven spacing and double precision."""
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
        _describe_axis(_FREQUENCY, "Frequency", "Hz"),
        *axes,
        _describe_axis(0, "NONE", ""),
    ]
    values = numbers.astype("<f8").tobytes() if binary else _as_text(numbers)
    return "".join(lines).encode() + values + _LAST_LINE


def _as_text(numbers: FloatArray) -> bytes:
    """Format 1E13.5,2E20.12 of complex and 2(1E13.5,1E20.12) of real values."""
    points = [f"{row[0]:13.5E}" + "".join(f"{value:20.12E}" for value in row[1:]) for row in numbers.tolist()]
    if numbers.shape[1] == 2:
        points = ["".join(points[i : i + 2]) for i in range(0, len(points), 2)]
    return "".join(f"{point}\n" for point in points).encode()
