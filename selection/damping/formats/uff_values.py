"""Axes of a data set 58: abscissas in Hz or s, and the units of the ordinate.

Values of a data set 58: from text of fixed columns or blanks between, or from bytes of either order.

The values are taken in parts of bounded size, so that memory stays a small multiple of the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from damping.arrays import RAD_S_PER_HZ, FloatArray
from damping.errors import InputError
from damping.formats.named import cartesian
from damping.formats.quantity import unit
from damping.formats.series import Samples, Summary
from damping.formats.uff_blocks import Axis, Header, UffBlock
from damping.records.keys import LARGEST, SMALLEST

#: Length and force of the units codes of data set 164 that need no factors.
_UNIT_CODES = {
    1: ("m", "N"),
    2: ("ft", "lbf"),
    3: ("m", "kgf"),
    5: ("mm", "mN"),
    7: ("in", "lbf"),
    8: ("mm", "kgf"),
} | {10: ("mm", "N")}
_PER_TIME = {"displacement": "", "velocity": "/s", "acceleration": "/s^2"}


def abscissa(x: FloatArray, axis: Axis, is_time: bool, summary: Summary) -> FloatArray:
    """Abscissa in Hz or s."""
    if is_time:
        time = unit(axis.unit or "s", what="unit of time")
        if time.powers != (0, 0, 1):
            raise InputError(f"time in {axis.unit!r}", expected="a unit of time")
        summary.add("time", time.text, "found in the file" if axis.unit else "of the format")
        return x * time.factor
    name = axis.unit.lower()
    factors = {"": 1.0, "hz": 1.0, "hertz": 1.0, "1/s": 1.0, "khz": 1e3, "rpm": 1.0 / 60.0}
    factors |= dict.fromkeys(("rad/s", "rad/sec"), 1.0 / RAD_S_PER_HZ)
    if name not in factors:
        raise InputError(f"frequency in {axis.unit!r}", expected=f"one of {', '.join(filter(None, factors))}")
    summary.add("frequency", axis.unit or "Hz", "found in the file" if axis.unit else "of the format")
    return x * factors[name]


def units(head: Header, quantity: str, per: str, code: int, summary: Summary) -> dict[str, str]:
    """Units of response and force by their labels; where there are none, by the units ``code`` of data set 164.

    ``quantity`` and ``per`` are what the ordinate is and what it is divided by ('' where that is not known).
    """
    texts = {}
    if head.numerator.unit:
        texts["force" if (quantity == "force" and not per) else "response"] = head.numerator.unit
    if head.function == 4 and head.denominator.unit:
        texts["force"] = head.denominator.unit
    if code in _UNIT_CODES:
        length, force = _UNIT_CODES[code]
        if quantity in _PER_TIME and "response" not in texts:
            texts["response"] = length + _PER_TIME[quantity]
            summary.note(f"units code {code} of data set 164 gives {length} and {force}")
        if "force" in (quantity, per):
            texts.setdefault("force", force)
    elif code:
        summary.note(f"units code {code} of data set 164 is not used: it names no units")
    return texts


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
