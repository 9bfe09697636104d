"""Factors by which a wrong unit, scaling or kind of motion shows, and their names."""

import re
from collections.abc import Mapping
from math import inf, log, pi

from damping.arrays import POUND_FORCE_N, STANDARD_GRAVITY_M_S2, STANDARD_GRAVITY_REPORT_IN_S2
from damping.records.mode import Units

#: Factors by which a quantity in a wrong unit is off, by the mistake.
UNIT_FACTORS: dict[str, float] = {
    "N for lb": POUND_FORCE_N,
    "kgf for N, or g for m/s^2": STANDARD_GRAVITY_M_S2,
    "g for in/s^2": STANDARD_GRAVITY_REPORT_IN_S2,
    "g for ft/s^2": 32.174,
    "lb for kg": 2.20462,
    "mm for in": 25.4,
    "in for m": 39.3701,
    "in for ft": 12.0,
    "m for ft": 3.28084,
    "mm for m, or another factor of 1000": 1000.0,
    "um for m, or another factor of a million": 1.0e6,
    "g for mm/s^2": 1000.0 * STANDARD_GRAVITY_M_S2,
    "rad/s for Hz squared": (2.0 * pi) ** 2,
}
#: Factors within one system of units.
SCALING_FACTORS = {"rms for peak": 2.0**0.5, "peak-to-peak for peak": 2.0, "peak-to-peak for rms": 2.0 * 2.0**0.5}
#: All factors that a ratio of masses may mean.
FACTORS = UNIT_FACTORS | SCALING_FACTORS | {"degrees for rad": 180.0 / pi}
#: Factors between frequencies.
FREQUENCY_FACTORS = {"rad/s for Hz": 2.0 * pi, "1/min for Hz": 60.0, "kHz for Hz": 1000.0}


def list_motions(frequency: float) -> dict[str, float]:
    """Factors by which a motion of a frequency, Hz, is off as a displacement."""
    omega = 2.0 * pi * frequency
    motions = {"velocity for displacement": omega, "acceleration for displacement": omega**2}
    return motions | {"acceleration in g for displacement in m": omega**2 / STANDARD_GRAVITY_M_S2}


def name_factor(ratio: float, factors: Mapping[str, float] = FACTORS, within: float = 0.1) -> str:
    """Name of the factor nearest to a ratio (or its inverse); empty if none is within ``within`` in the logarithm."""
    size = abs(log(ratio))
    name = min(factors, key=lambda key: abs(size - log(factors[key])))
    return name if abs(size - log(factors[name])) < within else ""


def name_unit(ratio: float, units: Units, within: float = inf) -> str:
    """Name of the unit factor nearest to a ratio, among those of a unit of the mode file; of all if it names none."""
    named = {{"lbf": "lb"}.get(unit, unit) for unit in (units.force, units.length) if unit}
    of_mode = [name for name in UNIT_FACTORS if named & set(re.findall(r"for ([^\s,/]+)", name))]
    kept = {name: by for name, by in UNIT_FACTORS.items() if not of_mode or name in of_mode or "another factor" in name}
    return name_factor(ratio, kept, within=within)
