"""The report: results in, tables, figures and one self-contained HTML page out. This module formats text."""

import re
from collections.abc import Callable, Iterable
from itertools import pairwise
from math import isfinite, isnan
from typing import Any, SupportsFloat

import numpy as np
import pandas as pd

from damping.arrays import RAD_S_PER_HZ, STANDARD_GRAVITY_M_S2
from damping.forces import shapes_of
from damping.forces.shapes import Dimension
from damping.records.mode import Units
from damping.records.text import NOTHING as NOTHING
from damping.records.text import SUPERSCRIPT
from damping.records.text import count as count
from damping.records.text import format_share as format_share

_SMALL = ("no", "one", "two", "three", "four", "five", "six")


def format_joined(parts: Iterable[str]) -> str:
    """``a, b and c``; items that hold commas are joined by semicolons."""
    items = list(parts)
    comma = "; " if any("," in item for item in items) else ", "
    if len(items) < 2:
        return "".join(items)
    return comma.join(items[:-1]) + " and " + items[-1]


def format_numbers(values: Iterable[SupportsFloat], digits: int = 3) -> str:
    """``1.24 and 2.00``."""
    return format_joined(number(value, digits) for value in values)


def format_points_text(points: Iterable[int]) -> str:
    """``points 1 to 6, 14 and 15``."""
    numbers = sorted(int(p) for p in points)
    if not numbers:
        return "no point"
    cuts = [0, *(i + 1 for i, (a, b) in enumerate(pairwise(numbers)) if b != a + 1), len(numbers)]
    runs = [numbers[a:b] for a, b in pairwise(cuts)]
    parts = [text for run in runs for text in ([f"{run[0]} to {run[-1]}"] if len(run) > 2 else [str(n) for n in run])]
    return f"point{'s' * (len(numbers) > 1)} {format_joined(parts)}"


def format_counted(n: int, what: str) -> str:
    """``no peak``, ``one peak``, ``two peaks``, ``15 peaks``."""
    return f"{_SMALL[n] if n < len(_SMALL) else n} {what}{'s' * (n > 1)}"


def number(value: SupportsFloat, digits: int = 3) -> str:
    """``value`` with ``digits`` significant digits: 2.90, 583000, 1 250 000 as 1.25×10⁶, a dash for none."""
    x = float(value)
    if not isfinite(x):
        return NOTHING
    if x == 0.0:
        return "0"
    mantissa, _, exponent = f"{x:.{digits - 1}e}".partition("e")
    power = int(exponent)
    if -4 < power < 6:
        x = round(x, digits - 1 - power) if power > digits else x  # four digits of 1234 are what people write
        return f"{x:.{max(digits - 1 - power, 0)}f}".replace("-", "−")
    return f"{mantissa}×10{str(power).translate(SUPERSCRIPT)}".replace("-", "−")


def describe_written(value: Any) -> str:
    """A value for people: numbers to four digits, yes and no, a dash for nothing."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if value is None or value is pd.NA or (isinstance(value, float) and isnan(value)) or value == "":
        return NOTHING
    if isinstance(value, int | np.integer):
        return str(value)
    return number(value, 4) if isinstance(value, float | np.floating) else str(value)


def format_decimals(value: float, digits: int) -> str:
    """``value`` with ``digits`` decimals, a dash where there is none."""
    return f"{value:.{digits}f}".replace("-", "−") if isfinite(value) else NOTHING


def end_sentence(text: str) -> str:
    """Text with a full stop unless it ends as a question."""
    return text if text.endswith("?") else f"{text}."


def start_sentence(text: str) -> str:
    """Text with a capital first letter, unless it begins with the name of a file or a run (digits, ``_`` or ``.``)."""
    first = text.partition(" ")[0]
    return text if re.search(r"[\d_.]", first) else text[:1].upper() + text[1:]


def format_quantity(value: SupportsFloat, unit: str, digits: int = 3) -> str:
    """A number with its unit, where it has one: ``2.90 in``; a dash where there is none."""
    return f"{number(value, digits)} {unit}".strip() if isfinite(value) else NOTHING


#: Smaller names of a metre, each with what it is multiplied by, for amplitudes up to the first number.
_SMALLER_METRES = ((2e-8, 1e9, "nm"), (2e-5, 1e6, "µm"), (0.02, 1e3, "mm"))


def choose_length(unit: str, largest: SupportsFloat) -> tuple[float, str]:
    """Factor and name of the unit for lengths up to ``largest``: mm, µm or nm for small ones in metres."""
    size = abs(float(largest))
    for most, factor, name in _SMALLER_METRES:
        if unit == "m" and 0.0 < size < most:
            return factor, name
    return 1.0, unit


def format_length(value: SupportsFloat, unit: str) -> str:
    """A length with its unit; small ones in metres are given in mm, µm or nm."""
    factor, name = choose_length(unit, value)
    return format_quantity(factor * float(value), name)


def format_length_band(low: SupportsFloat, high: SupportsFloat, unit: str) -> str:
    """The ends of a band of lengths, in the unit of the upper one."""
    factor, name = choose_length(unit, high)
    return format_between(factor * float(low), factor * float(high), name)


def format_gravity(amplitude: SupportsFloat, frequency: SupportsFloat, unit: str) -> str:
    """Peak acceleration omega^2 A of a harmonic motion in standard gravities; a dash where the unit is not known."""
    from damping.formats import quantity  # noqa: PLC0415 - loads every format, for pages alone

    if quantity.find_powers(unit) != (0, 1, 0):
        return NOTHING
    omega, metres = RAD_S_PER_HZ * float(frequency), quantity.unit(unit).factor
    return format_quantity(metres * float(amplitude) * omega**2 / STANDARD_GRAVITY_M_S2, "g")


def format_force_text(force: SupportsFloat, unit: str) -> str:
    """A requested force: ``90 lb``, ``8×10⁻⁹ N``."""
    mantissa, _, power = f"{float(force):.6g}".partition("e")
    size = f"{mantissa}×10{str(int(power)).translate(SUPERSCRIPT)}" if power else mantissa
    return f"{size} {unit}".strip()


def format_between(low: SupportsFloat, high: SupportsFloat, unit: str = "", digits: int = 3) -> str:
    """``2.59 to 3.26 in``; a dash where there is neither."""
    ends = f"{number(low, digits)} to {format_quantity(high, unit, digits)}"
    return ends if isfinite(low) or isfinite(high) else NOTHING


def format_percent(value: SupportsFloat) -> str:
    """Per cent: whole numbers from 10, two digits below, and ``< 0.01``, which no line breaks, for less either way."""
    x = float(value)
    if not isfinite(x):
        return NOTHING
    if 0.0 < abs(x) < 0.01:
        return "<\N{NO-BREAK SPACE}0.01"
    return (f"{x:.0f}" if abs(x) >= 9.95 else number(x, 2)).replace("-", "−")


def format_percent_ratio(ratio: float) -> str:
    """A damping ratio in per cent: ``0.287 %``."""
    return f"{number(100.0 * ratio)} %" if isfinite(ratio) else NOTHING


def format_signed(value: SupportsFloat) -> str:
    """Per cent with its sign: ``+68 %``."""
    x = float(value)
    return f"{'+' if x > 0.0 else ''}{format_percent(x)} %" if isfinite(x) else NOTHING


#: What parameters that are no part of a force are called for people.
SCATTERS = {
    "scatter": "scatter of a row",
    "level_scatter": "scatter of a level",
    "discrepancy": "discrepancy of the local exponent",
}


def format_parameter_unit(parameter: str, units: Units) -> str:
    """Unit of a parameter as :meth:`Coordinates.parameters` names it; empty where it has none or none is known."""
    if not (units.force and units.length and units.time) or parameter in SCATTERS:
        return ""
    force, _, name = parameter.partition(" ")
    shapes = shapes_of(force)
    return format_dimension_text(next((shape for shape in shapes if shape.name == name), shapes[0]).unit, units)


def format_parameter_label(parameter: str, units: Units) -> str:
    """A parameter with its unit for an axis."""
    unit = format_parameter_unit(parameter, units)
    name = SCATTERS.get(parameter, parameter)
    return f"{name} ({unit})" if unit else name


def format_dimension_text(dimension: Dimension, units: Units) -> str:
    """A dimension in the units of a record: ``lb·s²/in²``; with a power p that is a parameter ``lb·(s/in)^p``.

    Empty if the record does not name a unit that it needs.
    """
    names = vars(units)
    dimension = dimension if units.drive == "force" else dimension.of_base_drive
    plain = {base: float(getattr(dimension, base)) for base in names}
    raised = {base: sum(float(getattr(part, base)) for _, part in dimension.raised) for base in names}
    if any((plain[base] or raised[base]) and not names[base] for base in names):
        return ""
    both = any(plain[base] and raised[base] for base in names)
    if both or sum(map(bool, raised.values())) < 2:
        signs = {base: (raised[base] or plain[base]) for base in names}
        powers = {base: _format_raised(plain[base], raised[base]) for base in names}
        return _format_quotient({names[base]: (sign, powers[base]) for base, sign in signs.items()})
    free = _format_quotient({names[base]: (power, _format_power(abs(power))) for base, power in raised.items()})
    fixed = _format_quotient({names[base]: (power, _format_power(abs(power))) for base, power in plain.items()})
    return f"{fixed}·({free})^p" if fixed else f"({free})^p"


def _format_quotient(parts: dict[str, tuple[float, str]]) -> str:
    """A quotient of units; given the sign of the power of each unit, and the power as text without sign."""
    above = "·".join(f"{unit}{power}" for unit, (sign, power) in parts.items() if sign > 0)
    below = "·".join(f"{unit}{power}" for unit, (sign, power) in parts.items() if sign < 0)
    if not below:
        return above
    return f"{above or 1}/{below}" if "·" not in below else f"{above or 1}/({below})"


def _format_raised(plain: float, raised: float) -> str:
    """The power plain + raised p without the sign of its leading part: ``²``, ``^p``, ``^(p+1)``."""
    if not raised:
        return _format_power(abs(plain))
    free = "p" if abs(raised) == 1.0 else f"{abs(raised):g}p"
    rest = plain if raised > 0.0 else -plain
    return f"^({free}{rest:+g})" if rest else f"^{free}"


def _format_power(power: float) -> str:
    if power == 1.0:
        return ""
    return f"{power:.0f}".translate(SUPERSCRIPT) if power == round(power) else f"^{power:g}"


_IN_TEXTS: tuple[Callable[..., str], ...] = (
    *(
        count,
        end_sentence,
        start_sentence,
        number,
        format_between,
        format_counted,
        format_force_text,
        format_joined,
        format_numbers,
    ),
    *(format_percent, format_points_text, format_quantity, format_share, format_signed),
)
#: Functions that the texts of a page may use, without ``format_``: numbers and lists in words.
WORDS = {function.__name__.removeprefix("format_"): function for function in _IN_TEXTS}
