"""Axes of a data set 58: abscissas in Hz or s, and the units of the ordinate."""

from __future__ import annotations

from pathlib import Path

from selection.arrays import FloatArray
from selection.errors import InputError
from selection.records.imports.quantity import unit
from selection.records.imports.summary import Summary
from selection.records.imports.uff_blocks import Axis, Header
from selection.units import RAD_S_PER_HZ

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


def abscissa(x: FloatArray, axis: Axis, is_time: bool, file: str | Path, summary: Summary) -> FloatArray:
    """Abscissa in Hz or s."""
    if is_time:
        found = unit(axis.unit or "s", what="unit of time")
        if found.powers != (0, 0, 1):
            raise InputError(f"time in {axis.unit!r}", file=file, expected="a unit of time")
        summary.add("time", found.text, "found in the file" if axis.unit else "of the format")
        return x * found.factor
    name = axis.unit.lower()
    factors = {"": 1.0, "hz": 1.0, "hertz": 1.0, "1/s": 1.0, "khz": 1e3, "rpm": 1.0 / 60.0}
    factors |= dict.fromkeys(("rad/s", "rad/sec"), 1.0 / RAD_S_PER_HZ)
    if name not in factors:
        raise InputError(
            f"frequency in {axis.unit!r}", file=file, expected=f"one of {', '.join(filter(None, factors))}"
        )
    summary.add("frequency", axis.unit or "Hz", "found in the file" if axis.unit else "of the format")
    return x * factors[name]


def units(head: Header, quantity: str, per: str, code: int, summary: Summary) -> dict[str, str]:
    """Units of response and force by their labels; where there are none, by the units ``code`` of data set 164.

    ``quantity`` and ``per`` are what the ordinate is and what it is divided by ('' where that is not known).
    """
    found = {}
    if head.numerator.unit:
        found["force" if (quantity == "force" and not per) else "response"] = head.numerator.unit
    if head.function == 4 and head.denominator.unit:
        found["force"] = head.denominator.unit
    if code in _UNIT_CODES:
        length, force = _UNIT_CODES[code]
        if quantity in _PER_TIME and "response" not in found:
            found["response"] = length + _PER_TIME[quantity]
            summary.note(f"units code {code} of data set 164 gives {length} and {force}")
        if "force" in (quantity, per):
            found.setdefault("force", force)
    elif code:
        summary.note(f"units code {code} of data set 164 is not used: it names no units")
    return found
