"""Units as text: ``m/s^2/N``, ``(m/s²)/N``, ``g``, ``in/lbf`` to powers of force, length and time and a factor to SI.

Only products, quotients and whole powers of known names; nothing is evaluated. ``g`` is the standard acceleration of
gravity and ``lb`` the pound-force, as records of vibration tests use them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from selection.errors import InputError
from selection.records.text import shortened
from selection.units import INCH_M, POUND_FORCE_N, STANDARD_GRAVITY_M_S2

#: Names of units: (powers of force, length, time), factor to N, m, s.
_NAMES: dict[str, tuple[tuple[int, int, int], float]] = {
    "1": ((0, 0, 0), 1.0),
    "N": ((1, 0, 0), 1.0),
    "mN": ((1, 0, 0), 1e-3),
    "kN": ((1, 0, 0), 1e3),
    "lb": ((1, 0, 0), POUND_FORCE_N),
    "lbf": ((1, 0, 0), POUND_FORCE_N),
    "kgf": ((1, 0, 0), STANDARD_GRAVITY_M_S2),
    "m": ((0, 1, 0), 1.0),
    "cm": ((0, 1, 0), 1e-2),
    "mm": ((0, 1, 0), 1e-3),
    "um": ((0, 1, 0), 1e-6),
    "µm": ((0, 1, 0), 1e-6),  # micro sign
    "μm": ((0, 1, 0), 1e-6),  # Greek mu
    "nm": ((0, 1, 0), 1e-9),
    "in": ((0, 1, 0), INCH_M),
    "inch": ((0, 1, 0), INCH_M),
    "mil": ((0, 1, 0), 1e-3 * INCH_M),
    "ft": ((0, 1, 0), 12.0 * INCH_M),
    "s": ((0, 0, 1), 1.0),
    "sec": ((0, 0, 1), 1.0),
    "ms": ((0, 0, 1), 1e-3),
    "us": ((0, 0, 1), 1e-6),
    "g": ((0, 1, -2), STANDARD_GRAVITY_M_S2),
    "gn": ((0, 1, -2), STANDARD_GRAVITY_M_S2),
    "kg": ((1, -1, 2), 1.0),
    "J": ((1, 1, 0), 1.0),
}
_TOKEN = re.compile(r"\s*([A-Za-zµμ]+|[0-9]+|\^|\*\*|[*/()·.²³-])")
_LONGEST = 60  # characters of a unit; labels of UFF files have 20
_POWERS = {"²": 2, "³": 3}
_EXPECTED = "a unit such as N, lbf, m, mm, in, m/s, g, m/s^2, m/s^2/N or in/lbf"


@dataclass(frozen=True)
class Unit:
    """A unit: its ``text``, its powers of ``force``, ``length`` and ``time``, and its size in N, m and s."""

    text: str
    force: int
    length: int
    time: int
    factor: float

    @property
    def powers(self) -> tuple[int, int, int]:
        """Powers of force, length and time."""
        return self.force, self.length, self.time

    def per(self, other: Unit) -> Unit:
        """The quotient of two units."""
        force, length, time = (a - b for a, b in zip(self.powers, other.powers, strict=True))
        return Unit(f"({self.text})/{other.text}", force, length, time, self.factor / other.factor)


#: The two consistent systems records are written in: names of force and length; time is s, mass force s^2/length.
SYSTEMS = {"si": ("N", "m"), "us": ("lbf", "in")}


def unit(text: str, *, what: str = "unit") -> Unit:
    """The unit that ``text`` names.

    Raises:
        InputError: an unknown name (logarithmic and electrical units among them), or no unit at all; ``what`` says
            whose.
    """
    try:
        powers, factor = _parsed(text)
    except (ValueError, OverflowError):
        raise InputError(f"{what} {shortened(text)!r} is not understood", expected=_EXPECTED) from None
    return Unit(text.strip(), *powers, factor)


def _parsed(text: str) -> tuple[tuple[int, int, int], float]:
    """Powers and factor; ValueError where the text is no unit."""
    if len(text) > _LONGEST:
        raise ValueError
    signs, sign, powers, factor = [1], 1, [0, 0, 0], 1.0
    tokens = _tokens(text)
    wants_name = True
    while tokens:
        token = tokens.pop(0)
        if token == "(" and wants_name:
            signs.append(signs[-1] * sign)
            sign = 1
        elif token == ")" and not wants_name and len(signs) > 1:
            signs.pop()
        elif token in ("*", "·", ".", "/") and not wants_name:
            sign, wants_name = (-1 if token == "/" else 1), True
        elif wants_name:
            of_name, size = _named(token)
            power = signs[-1] * sign * _power(tokens)
            powers = [total + power * one for total, one in zip(powers, of_name, strict=True)]
            factor *= size**power
            sign, wants_name = 1, False
        else:
            raise ValueError
    if wants_name or len(signs) > 1:
        raise ValueError
    return (powers[0], powers[1], powers[2]), factor


def _tokens(text: str) -> list[str]:
    """The text cut into names, numbers and signs; a space between two names multiplies."""
    tokens: list[str] = []
    position = 0
    text = text.strip()
    while position < len(text):
        match = _TOKEN.match(text, position)
        if match is None:
            raise ValueError
        if tokens and match[0][0].isspace() and tokens[-1].isalpha() and match[1].isalpha():
            tokens.append("*")
        tokens.append(match[1])
        position = match.end()
    return tokens


def _named(token: str) -> tuple[tuple[int, int, int], float]:
    """A name as it is, else in lower case (LBF, IN, G)."""
    if token in _NAMES:
        return _NAMES[token]
    if (token.lower() in _NAMES and len(token) > 1) or token in ("G", "S"):
        return _NAMES[token.lower()]
    raise ValueError


def _power(tokens: list[str]) -> int:
    """The power that follows a name: ^2, **2, 2, ², ^-1; 1 where there is none."""
    if tokens and tokens[0] in _POWERS:
        return _POWERS[tokens.pop(0)]
    marked = bool(tokens) and tokens[0] in ("^", "**")
    if marked:
        tokens.pop(0)
    negative = bool(tokens) and tokens[0] == "-"
    if negative:
        tokens.pop(0)
    if tokens and tokens[0].isdecimal() and len(tokens[0]) == 1:
        power = int(tokens.pop(0))
        return -power if negative else power
    if marked or negative:
        raise ValueError
    return 1
