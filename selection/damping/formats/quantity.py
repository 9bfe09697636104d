"""Units as text: ``m/s^2/N``, ``(m/s²)/N``, ``g``, ``in/lbf`` to powers of force, length and time and a factor to SI.

Only products, quotients and whole powers of known names are parsed; nothing is evaluated. ``g`` is the standard
acceleration of gravity and ``lb`` the pound-force, as in records of vibration tests.

Also converts records and modes between consistent systems of units: SI (N, m, kg) and US (lbf, in, lbf s^2/in).
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from math import pi

import pandas as pd

from damping.arrays import INCH_M, POUND_FORCE_N, STANDARD_GRAVITY_M_S2
from damping.errors import InputError
from damping.predict import rescale_mode
from damping.records.keys import POWERS
from damping.records.mode import Mode, Units
from damping.records.record import Record
from damping.records.text import describe_shortened

#: Names of units by their powers of force, length and time, each with its factor to N, m, s.
_SIZES: dict[tuple[int, int, int], dict[str, float]] = {
    (0, 0, 0): {"1": 1.0, "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6, "μrad": 1e-6, "deg": pi / 180.0},
    (1, 0, 0): {
        **{"N": 1.0, "newton": 1.0, "newtons": 1.0, "mN": 1e-3, "kN": 1e3, "kgf": STANDARD_GRAVITY_M_S2},
        **{"daN": 10.0, "kp": STANDARD_GRAVITY_M_S2, "kip": 1e3 * POUND_FORCE_N, "klbf": 1e3 * POUND_FORCE_N},
        **{"lb": POUND_FORCE_N, "lbf": POUND_FORCE_N, "MN": 1e6, "uN": 1e-6, "nN": 1e-9, "pN": 1e-12},
        **{"µN": 1e-6, "μN": 1e-6},  # micro sign, Greek mu
    },
    (0, 1, 0): {
        **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "in": INCH_M, "inch": INCH_M},
        **{"mil": 1e-3 * INCH_M, "mils": 1e-3 * INCH_M, "ft": 12.0 * INCH_M, "meter": 1.0, "metre": 1.0},
        **{"µm": 1e-6, "μm": 1e-6, "pm": 1e-12, "km": 1e3, "micron": 1e-6, "microns": 1e-6},
    },
    (0, 0, 1): {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6},
    (0, 1, -1): {"ips": INCH_M},
    (0, 1, -2): {
        **{"g": STANDARD_GRAVITY_M_S2, "gn": STANDARD_GRAVITY_M_S2, "mg": 1e-3 * STANDARD_GRAVITY_M_S2},
        "gal": 1e-2,
        **{f"{micro}g": 1e-6 * STANDARD_GRAVITY_M_S2 for micro in "uµμ"},
    },
    (1, -1, 2): {"kg": 1.0},
    (1, 1, 0): {"J": 1.0, "Nm": 1.0, "mNm": 1e-3, "Nmm": 1e-3, "kNm": 1e3},
}
_NAMES = {name: (powers, size) for powers, sizes in _SIZES.items() for name, size in sizes.items()}
#: A name and the power that may follow it: ^2, **2, 2, ², ^-1.
_TERM = re.compile(r"([A-Za-zµμ]+|[0-9]+)(?:\s*(?:([²³])|(?:\^|\*\*)?\s*(-?)\s*([0-9])(?![0-9])))?")
_LONGEST = 60  # characters of a unit; labels of UFF files have 20
_POWERS = {"²": 2, "³": 3}
_EXPECTED = "a unit such as N, mN, kN, lbf, m, mm, in, m/s, g, m/s^2, m/s^2/N or in/lbf"


@dataclass(frozen=True)
class Unit:
    """A unit: its ``text``, its ``powers`` of force, length and time, and its size in N, m and s."""

    text: str
    powers: tuple[int, int, int]
    factor: float

    def per(self, other: Unit) -> Unit:
        """The quotient of two units."""
        force, length, time = (a - b for a, b in zip(self.powers, other.powers, strict=True))
        return Unit(f"({self.text})/{other.text}", (force, length, time), self.factor / other.factor)

    def agrees_with(self, other: Unit) -> bool:
        """Whether both have the same powers and factor, whatever their names."""
        return (self.powers, self.factor) == (other.powers, other.factor)


#: Consistent systems of units of records: names of force and length; time is s, mass force s^2/length.
SYSTEMS = {"si": ("N", "m"), "us": ("lbf", "in")}


def unit(text: str, *, what: str = "unit", option: str = "") -> Unit:
    """The unit that ``text`` names.

    InputError: an unknown name (logarithmic and electrical units included), or no unit; ``what`` names it in errors,
    and ``option`` states another.
    """
    try:
        return Unit(text.strip(), *_parsed(text))
    except (ValueError, OverflowError):
        expected = f"{option} of {_EXPECTED}" if option else _EXPECTED
        raise InputError(f"{what} {describe_shortened(text)!r} is not understood", expected=expected) from None


def find_powers(text: str) -> tuple[int, int, int] | None:
    """Powers of force, length and time of a unit; None if the text is not a unit."""
    try:
        return unit(text).powers
    except InputError:
        return None


def _parsed(text: str) -> tuple[tuple[int, int, int], float]:
    """Powers and factor; ValueError if the text is not a unit."""
    if len(text) > _LONGEST:
        raise ValueError
    signs, sign, powers, factor = [1], 1, [0, 0, 0], 1.0
    rest, wants_name = text.strip(), True
    while rest:
        mark, term = rest[0], _TERM.match(rest)
        if wants_name and term is not None:
            name, square, minus, digit = term.groups()
            if name == "ms" and minus:  # m s^-2 without its blank, and not 1/ms^2
                raise ValueError
            of_name, size = _find_name(name)
            power = signs[-1] * sign * (_POWERS[square] if square else int(f"{minus}{digit}") if digit else 1)
            powers = [total + power * exponent for total, exponent in zip(powers, of_name, strict=True)]
            factor *= size**power
            rest = rest[term.end() :]
            # a space between two names multiplies
            wants_name = name.isalpha() and name == term[0] and bool(re.match(r"\s+[A-Za-zµμ]", rest))
            sign, rest = 1, rest.lstrip()
            continue
        if mark == "(" and wants_name:
            signs.append(signs[-1] * sign)
            sign = 1
        elif mark == ")" and not wants_name and len(signs) > 1:
            signs.pop()
        elif mark in "*·./" and not wants_name:
            sign, wants_name = (-1 if mark == "/" else 1), True
        else:
            raise ValueError
        rest = rest[1:].lstrip()
    if wants_name or len(signs) > 1:
        raise ValueError
    return (powers[0], powers[1], powers[2]), factor


def _find_name(name: str) -> tuple[tuple[int, int, int], float]:
    """Powers and size of a name as written, else in lower case (LBF, IN, G)."""
    if name in _NAMES:
        return _NAMES[name]
    if (name.lower() in _NAMES and len(name) > 1) or name in ("G", "S"):
        return _NAMES[name.lower()]
    raise ValueError


#: Further columns without a unit, of records of free decays.
_OF_DECAYS = ("decay", "damping_ratio")


@dataclass(frozen=True)
class Factors:
    """Factors from the old to the new system, for units of force and of length."""

    force: float
    length: float

    def of(self, force: float, length: float) -> float:
        """Factor of a quantity with these powers of force and length."""
        return float(self.force**force * self.length**length)

    @property
    def per_mass(self) -> Factors:
        """The factors if the force column is the acceleration of a base: masses are then pure numbers."""
        return Factors(self.length, self.length)


def factors(units: Units, to: str, *, source: str) -> Factors:
    """Factors from the named units to a system of ``SYSTEMS``.

    InputError: units that are not named or not understood, a time that is not in s, or an unknown system.
    """
    if to not in SYSTEMS:
        raise InputError(f"--units {to!r} is unknown", expected=" or ".join(SYSTEMS))
    for what, name in (("force", units.force), ("length", units.length)):
        if not name:
            raise InputError(f"the unit of {what} is not known", file=source, expected="[units] of a mode, or --from")
    if units.time not in ("", "s", "sec"):
        raise InputError(f"time in {units.time!r}", file=source, expected="s")
    old = unit(units.force, what="unit of force"), unit(units.length, what="unit of length")
    new = tuple(unit(name).factor for name in SYSTEMS[to])
    by = Factors(old[0].factor / new[0], old[1].factor / new[1])
    if old[1].powers == (0, 1, 0) and (old[0].powers, old[0].factor) == ((0, 1, -2), old[1].factor):
        return by.per_mass  # acceleration of a base
    if (old[0].powers, old[1].powers) != ((1, 0, 0), (0, 1, 0)):
        what = f"{units.force} and {units.length} are no units of force and length"
        raise InputError(what, file=source, expected="units of force and length, such as N and m")
    return by


def find_factors_between(own: Units, to: Units) -> tuple[float, float] | None:
    """Factors of force and length from one system of units to another; None if unknown."""
    if own == to:
        return 1.0, 1.0
    pairs = ((own.force, to.force), (own.length, to.length))
    if any(find_powers(a) is None or find_powers(a) != find_powers(b) for a, b in pairs):
        return None
    of_force, of_length = (unit(a).factor / unit(b).factor for a, b in pairs)
    return of_force, of_length


def convert_record(record: Record, by: Factors, drive: str) -> tuple[Record, list[str]]:
    """The record in the new system, and notes on columns whose unit is not known.

    ``drive``: of its mode; with ``base`` the column ``force`` is an acceleration, and energies are per mass.
    """
    table, driven = record.frame.copy(), by.per_mass if drive == "base" else by
    for name, powers in POWERS.items():
        if name in table and any(powers):
            table[name] = table[name] * (by if name in ("mass", "added_mass") else driven).of(*powers)
    kept = [name for name in table if name not in (*POWERS, *_OF_DECAYS)]
    return Record(table, record.source), [f"column {name} is kept as it is: its unit is not known" for name in kept]


def convert_loads(table: pd.DataFrame, by: Factors, asked: str) -> pd.DataFrame:
    """Predictions (one row for each design value and law) in the new system.

    ``asked``: the given quantity, ``force`` or ``amplitude``; the other is predicted.
    """
    force, amplitude = by.of(1, 0), by.of(0, 1)
    given, predicted = (force, amplitude) if asked == "force" else (amplitude, force)
    changed = {name: table[name] * predicted for name in ("median", "low", "high", "linear")}
    return table.assign(**{asked: table[asked] * given}, **changed)


def convert_curve(table: pd.DataFrame, by: Factors) -> pd.DataFrame:
    """Resonances (a row each) in the new system: forces, amplitudes and their bands."""
    scales = {"force": by.of(1, 0), "amplitude": by.of(0, 1)}
    names = [f"{of}{end}" for of in scales for end in ("", "_low", "_high")]
    return table.assign(**{name: table[name] * scales[name.split("_")[0]] for name in names})


def convert_mode(mode: Mode, by: Factors, to: str) -> Mode:
    """The mode in the new system, with the parameters of its damping forces and effects.

    InputError: an unknown force or effect.
    """
    return replace(rescale_mode(mode, by.force, by.length), units=Units(*SYSTEMS[to], "s"))
