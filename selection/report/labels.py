"""Units and names as the reader sees them."""

from __future__ import annotations

from selection.posterior.law import component
from selection.records.mode import Units

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def parameter_unit(parameter: str, units: Units) -> str:
    """Unit of a parameter as :meth:`Coordinates.parameters` names it; empty where it has none or none is known.

    A force whose energy per cycle is proportional to C A^m omega^n has C in force length^(1-m) time^n.
    """
    force, _, shape = parameter.partition(" ")
    if not (units.force and units.length and units.time) or shape == "exponent" or "scatter" in parameter:
        return ""
    if shape == "limit":
        return units.length
    if force == "slip":
        return _product({units.force: 1.0, units.length: -1.0})
    if force == "velocity-power":
        return f"{units.force}·({units.time}/{units.length})^p"
    if force == "displacement-velocity-power":
        return f"{units.force}·{units.time}^p/{units.length}^(p+1)"
    exponents = component(force).unit({}).energy_exponents
    assert exponents is not None  # slip, the one force without, was answered above
    m, n = (float(exponent) for exponent in exponents)
    return _product({units.force: 1.0, units.time: n, units.length: 1.0 - m})


def energy_unit(units: Units) -> str:
    """Unit of energy per cycle."""
    return f"{units.force}·{units.length}" if units.force and units.length else ""


def parameter_label(parameter: str, units: Units) -> str:
    """A parameter with its unit for an axis."""
    unit = parameter_unit(parameter, units)
    name = {"scatter": "scatter of a row", "level_scatter": "scatter of a level"}.get(parameter, parameter)
    return f"{name} ({unit})" if unit else name


def _product(powers: dict[str, float]) -> str:
    """Units with powers: ``lb·s²/in²``."""
    above = "·".join(f"{unit}{_power(power)}" for unit, power in powers.items() if power > 0)
    below = "·".join(f"{unit}{_power(-power)}" for unit, power in powers.items() if power < 0)
    return above if not below else f"{above}/{below}" if "·" not in below else f"{above}/({below})"


def _power(power: float) -> str:
    if power == 1.0:
        return ""
    return f"{power:.0f}".translate(_SUPERSCRIPT) if power == round(power) else f"^{power:g}"
