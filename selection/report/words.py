"""Numbers and lists as an engineer would say them."""

from __future__ import annotations

from math import isfinite
from typing import SupportsFloat

from selection.plots.words import joined as joined  # one of the words of the report

#: What stands for a number that does not exist.
NOTHING = "–"
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: SupportsFloat, digits: int = 3) -> str:
    """``value`` with so many significant digits: 2.90, 1 250 000 as 1.25×10⁶, a dash where there is none."""
    x = float(value)
    if not isfinite(x):
        return NOTHING
    if x == 0.0:
        return "0"
    mantissa, _, exponent = f"{x:.{digits - 1}e}".partition("e")
    power = int(exponent)
    if -4 < power < 6:
        return f"{x:.{max(digits - 1 - power, 0)}f}".replace("-", "−")
    return f"{mantissa}×10{str(power).translate(_SUPERSCRIPT)}".replace("-", "−")


def share(value: SupportsFloat) -> str:
    """A probability with two decimals, three where small."""
    x = float(value)
    if not isfinite(x):
        return NOTHING
    if x == 0.0 or x >= 0.0095:
        return f"{x:.2f}" if x else "0"
    return f"{x:.3f}" if x >= 0.0005 else "< 0.001"


def count(n: int, what: str) -> str:
    """``1 sweep``, ``3 sweeps``."""
    return f"{n} {what}{'' if n == 1 else 's'}"


def quantity(value: SupportsFloat, unit: str, digits: int = 3) -> str:
    """A number with its unit, where it has one: ``2.90 in``."""
    return f"{number(value, digits)} {unit}".strip()


def force_text(force: SupportsFloat, unit: str) -> str:
    """A force as it was asked for: ``90 lb``."""
    return f"{float(force):.6g} {unit}".strip()


def between(low: SupportsFloat, high: SupportsFloat, unit: str = "", digits: int = 3) -> str:
    """``2.59 to 3.26 in``."""
    return f"{number(low, digits)} to {quantity(high, unit, digits)}"


def percent(value: SupportsFloat) -> str:
    """Per cent: whole numbers from 10, two digits below, and ``< 0.01`` for less than that either way."""
    x = float(value)
    if not isfinite(x):
        return NOTHING
    if 0.0 < abs(x) < 0.01:
        return "< 0.01"
    return (f"{x:.0f}" if abs(x) >= 9.95 else number(x, 2)).replace("-", "−")


def signed(value: SupportsFloat) -> str:
    """Per cent with its sign: ``+68 %``."""
    x = float(value)
    return f"{'+' if x > 0.0 else ''}{percent(x)} %" if isfinite(x) else NOTHING
